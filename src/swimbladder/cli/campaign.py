"""``swimbladder campaign``: an array of floats on one mission, each a little different."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastReading, warn_of_mass
from swimbladder.cli.common import (
    asked_of,
    compile_notice,
    emit_json,
    json_text,
    kept,
    output,
    progress,
)
from swimbladder.cli.options import Files, Options, Read, grouped
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.sim.campaign.result import Campaign, Sensitivity
    from swimbladder.sim.campaign.store import Layout
    from swimbladder.vehicle import Vehicle
    from swimbladder.vehicle.spread import Spread


def _part(text: str, option: str) -> tuple[int, int]:
    """Return which part of how many is asked for."""
    try:
        number, total = (int(piece) for piece in text.split("/"))
    except ValueError:
        raise InputError(
            "no part of a whole", field=option, value=text,
            remedy="Give a number and how many there are, from --part 1/8 to --part 8/8",
        ) from None  # fmt: skip
    return number, total


@dataclass(frozen=True)
class Flown(Options):
    """How many floats are flown, for how long."""

    cycles: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Cycles (as in the mission).")
    ] = None
    span: Annotated[
        str | None,
        typer.Option("--duration", metavar="TIME", help="After it no cycle begins."),
    ] = None
    seed: Annotated[int, typer.Option(min=0, help="Of all that is drawn.")] = 1


@dataclass(frozen=True)
class Spreads(Options):
    """How much floats differ, by the inputs of a `Spread`."""

    trim: Annotated[
        str | None,
        typer.Option("--trim-std", metavar="VOLUME", help="1 sigma of the neutral volume (5 cm3)."),
    ] = None
    psi: Annotated[
        str | None,
        typer.Option(
            "--psi-std",
            metavar="PSI",
            help="1 sigma of the hull's compression (0.002 cm3/m).",
        ),
    ] = None
    drag: Annotated[
        str | None,
        typer.Option("--drag-std", metavar="SHARE", help="1 sigma of the drag (10 %)."),
    ] = None
    pump: Annotated[
        str | None,
        typer.Option("--pump-std", metavar="SHARE", help="1 sigma of the pump's delivery (5 %)."),
    ] = None

    def of(self, vehicle: Vehicle, file: Path | None, identified: bool) -> Spread:
        """Return the spread of a file, or the usual one; as identified; with what is stated."""
        from swimbladder.io.config import file_text, read_model
        from swimbladder.vehicle.spread import Spread

        found = Spread() if file is None else read_model(Spread, file_text(file), file)
        if identified:
            try:
                found = found.identified(vehicle)
            except InputError as error:
                raise InputError(error.what, field="--identified", remedy=error.remedy) from None
        given = {name: text for name, text in vars(self).items() if text is not None}
        with self.said_as_typed():
            return Spread(**{**found.model_dump(), **given})


@dataclass(frozen=True)
class Work(Options):
    """Who flies them, as `jobs.Workers` has it."""

    executor: Annotated[str, typer.Option(metavar="WHO", help="threads, processes or dask.")] = (
        "threads"
    )
    count: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="How many (one on each core)."),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="WHERE", help="Address of a dask scheduler, or the file it wrote."),
    ] = None
    part: Annotated[
        str,
        typer.Option(
            metavar="K/N", help="Fly one part of N, into the same folder.", show_default=False
        ),
        Read(_part),
    ] = "1/1"


@grouped(out=Path("swimbladder-campaign"))
def campaign(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    mission: Annotated[
        Path, typer.Argument(metavar="MISSION", help="TOML file with phases and cycles.")
    ],
    floats: Annotated[int, typer.Option(metavar="N", help="How many.")] = 4000,
    cast: Annotated[
        list[Path] | None,
        typer.Option("--cast", metavar="CTD", help="A water; several: each float draws one."),
    ] = None,
    *,
    how: Flown,
    stated: Spreads,
    spread: Annotated[
        Path | None, typer.Option("--spread", metavar="FILE", help="TOML file with all of these.")
    ] = None,
    identified: Annotated[
        bool, typer.Option("--identified", help="Spread as identified of the vehicle, correlated.")
    ] = False,
    sensitivity: Annotated[
        bool, typer.Option("--sensitivity", help="Sobol indices: what the outcome comes from.")
    ] = False,
    work: Work,
    reading: CastReading,
    to: Files,
) -> None:
    """Fly many floats on a mission: how many do it, how long their batteries last.

    Trim, hull, drag and pump differ, and the water where several casts are given. All results go to
    campaign.zarr in the folder, a chunk of floats at a time, by as many workers as there are.

    Exit code 1: a float did not do every phase. A run that is killed goes on where it was.
    """
    from swimbladder.cli.mission import water
    from swimbladder.io.config import load_mission, load_vehicle
    from swimbladder.io.files import check_place

    v, task = load_vehicle(vehicle, weighed=True), load_mission(mission)
    asked, who = how.read(), work.read()
    check_place(to.out)
    casts = reading.casts(cast, task.latitude)
    warn_of_mass(v)
    with asked_of(mission, task):
        columns = [water(v, task, one) for one in casts] or [water(v, task, None)]
    with progress("loading the simulator"):
        from swimbladder.jobs import Workers, run
        from swimbladder.sim.campaign.result import Campaign, Sensitivity
        from swimbladder.sim.campaign.run import Floats

    workers = Workers(**who)
    drawn = stated.of(v, spread, identified)
    with asked_of(mission, task, duration=how.span):
        job = Floats(
            vehicle=v, mission=task, columns=columns, floats=floats, spread=drawn,
            sensitivity=sensitivity, store=(to.out / "campaign.zarr").absolute(), **asked,
        )  # fmt: skip
    layout = job.layout
    doing = f"flying {layout.floats} floats"
    job.check()
    with kept(job.store), compile_notice(), progress(doing, 1.0) as advance:
        whole = run(job, workers, advance)
    if not whole:
        _unfinished(layout, work.part, to.json)
        return
    layout.tidy()
    table, energy_unknown = layout.table(), job.plans[0].energy_known
    indices = None
    if job.design is not None:
        indices = Sensitivity(design=job.design, table=table, energy_unknown=energy_unknown)
    found = Campaign(
        vehicle=v, mission=task, columns=columns, spread=job.spread, seed=job.seed,
        table=table if indices is None else indices.independent, energy_unknown=energy_unknown,
    )  # fmt: skip
    answer = found.to_json()
    with progress("writing the results"):
        if indices is not None:
            answer["sensitivity"] = indices.to_json()
        files = [
            to.out / "campaign.zarr",
            *_write(replace(found, table=table), answer, indices, to.out),
        ]
    to.answer(answer, files, lambda: _print(found, indices))
    if indices is None and not found.good.all():
        raise typer.Exit(1)


def _unfinished(layout: Layout, part: str, json: bool) -> None:
    """Say how far the campaign is of which this was a part."""
    done = len(layout.done())
    sentence = (
        f"part {part} is flown: {done} of {layout.count} chunks of the campaign are done, the "
        "others are for other parts"
    )
    if json:
        emit_json({"sentence": sentence, "chunks": layout.count, "done": done,
                   "files": [str(layout.folder)]})  # fmt: skip
    else:
        output.print(sentence, soft_wrap=True)


def _write(
    found: Campaign, answer: dict[str, Any], indices: Sensitivity | None, out: Path
) -> list[Path]:
    from swimbladder.io.files import publish, write_atomically
    from swimbladder.io.tables import write_csv

    names = ["campaign.json", "floats.csv"] + ["sensitivity.png"] * (indices is not None)

    def write(folder: Path) -> None:
        write_atomically(folder / names[0], json_text(answer) + "\n")
        write_csv(folder / names[1], found.columns_csv)
        if indices is not None:
            from swimbladder.show.plots.campaign import draw_sensitivity
            from swimbladder.show.plots.style import save

            save(draw_sensitivity(indices), folder / names[2])

    publish(out, write)
    return [out / name for name in names]


def _print(found: Campaign, indices: Sensitivity | None) -> None:
    from rich.table import Table

    output.print(found.sentence, soft_wrap=True)
    output.print("")
    ways = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("floats", "share", "95 %", "what became of them"):
        ways.add_column(heading, justify="left" if heading.startswith("what") else "right")
    for words, count, part, (low, high) in found.shares():
        ways.add_row(
            str(count), f"{100.0 * part:.1f} %", f"{100.0 * low:.1f} to {100.0 * high:.1f} %", words
        )
    output.print(ways)
    output.print("")
    numbers = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("per float", "median", "5 %", "95 %", "unit"):
        side = "left" if heading in ("per float", "unit") else "right"
        numbers.add_column(heading, justify=side)  # type: ignore[arg-type]
    for words, unit, middle, low, high in found.spreads():
        numbers.add_row(words, f"{middle:.4g}", f"{low:.4g}", f"{high:.4g}", unit)
    output.print(numbers)
    if indices is not None:
        _print_indices(indices)


def _print_indices(found: Sensitivity) -> None:
    from rich.table import Table

    output.print("")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("output", "comes from", "first order", "95 %", "total", "95 % "):
        table.add_column(
            heading, justify="left" if heading in ("output", "comes from") else "right"
        )
    for one in found.outputs:
        for name, index in zip(found.design.names, one.indices, strict=False):
            (low, high), (least, most) = index.first_ci95, index.total_ci95
            table.add_row(
                one.name if name == found.design.names[0] else "", name, f"{index.first:.2f}",
                f"{low:.2f} to {high:.2f}", f"{index.total:.2f}", f"{least:.2f} to {most:.2f}",
            )  # fmt: skip
    if table.rows:
        output.print(table)
    for one in found.outputs:
        if one.why:
            output.print(f"{one.name}: no indices, as {one.why}", soft_wrap=True)
