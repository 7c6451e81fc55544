"""``swimbladder campaign``: an array of floats on one mission, each a little different."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import (
    Columns,
    Inversions,
    Latitude,
    LogFormat,
    Longitude,
    Profile,
    Salinity,
    Where,
    asked_casts,
)
from swimbladder.cli.common import (
    asked_of,
    compile_notice,
    emit_json,
    json_text,
    kept,
    output,
    progress,
    quantity,
    said_as_typed,
)
from swimbladder.cli.masses import warn_of_mass
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.sim.campaign.draw import Spread
    from swimbladder.sim.campaign.result import Campaign
    from swimbladder.sim.campaign.sensitivity import Sensitivity
    from swimbladder.sim.campaign.store import Layout
    from swimbladder.vehicle import Vehicle

__all__ = ["campaign"]


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
    cycles: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Cycles (as in the mission).")
    ] = None,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help="After it no cycle begins.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all that is drawn.")] = 1,
    trim_std: Annotated[
        str | None, typer.Option(metavar="VOLUME", help="1 sigma of the neutral volume (5 cm3).")
    ] = None,
    psi_std: Annotated[
        str | None,
        typer.Option(metavar="PSI", help="1 sigma of the hull's compression (0.002 cm3/m)."),
    ] = None,
    drag_std: Annotated[
        str | None, typer.Option(metavar="SHARE", help="1 sigma of the drag (10 %).")
    ] = None,
    pump_std: Annotated[
        str | None, typer.Option(metavar="SHARE", help="1 sigma of the pump's delivery (5 %).")
    ] = None,
    spread: Annotated[
        Path | None, typer.Option("--spread", metavar="FILE", help="TOML file with all of these.")
    ] = None,
    identified: Annotated[
        bool, typer.Option("--identified", help="Spread as identified of the vehicle, correlated.")
    ] = False,
    sensitivity: Annotated[
        bool, typer.Option("--sensitivity", help="Sobol indices: what the outcome comes from.")
    ] = False,
    executor: Annotated[
        str, typer.Option(metavar="WHO", help="threads, processes or dask.")
    ] = "threads",
    workers: Annotated[
        int | None, typer.Option(metavar="N", help="How many (one on each core).")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="WHERE", help="Address of a dask scheduler, or the file it wrote."),
    ] = None,
    part: Annotated[
        str | None, typer.Option(metavar="K/N", help="Fly one part of N, into the same folder.")
    ] = None,
    column: Columns = None,
    where: Where = None,
    log_format: LogFormat = None,
    profile: Profile = None,
    latitude: Latitude = None,
    longitude: Longitude = None,
    salinity: Salinity = None,
    inversions: Inversions = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "swimbladder-campaign"
    ),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
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
    span, (number, parts) = quantity(duration, "s", "--duration"), _part(part)
    check_place(out)
    casts = asked_casts(
        cast or [], column=column, where=where, log_format=log_format, profile=profile,
        latitude=latitude, longitude=longitude, salinity=salinity, inversions=inversions,
        place=task.latitude,
    )  # fmt: skip
    warn_of_mass(v)
    with asked_of(mission, task):
        columns = [water(v, task, one) for one in casts] or [water(v, task, None)]
    with progress("loading the simulator"):
        from swimbladder.jobs import Workers, run
        from swimbladder.sim.campaign.result import Campaign
        from swimbladder.sim.campaign.run import Floats
        from swimbladder.sim.campaign.sensitivity import Sensitivity

    who = Workers(executor=executor, count=workers, scheduler=scheduler, part=(number, parts))
    stated = {
        "trim": trim_std, "psi": psi_std, "drag": drag_std, "pump": pump_std,
    }  # fmt: skip
    drawn = _spread(v, spread, identified, stated)
    with asked_of(mission, task, duration=duration):
        job = Floats(
            vehicle=v, mission=task, columns=columns, floats=floats, seed=seed, cycles=cycles,
            spread=drawn, span=span, sensitivity=sensitivity,
            store=(out / "campaign.zarr").absolute(),
        )  # fmt: skip
    layout = job.layout
    doing = f"flying {layout.floats} floats"
    job.check()
    with kept(job.store), compile_notice(), progress(doing, 1.0) as advance:
        whole = run(job, who, advance)
    if not whole:
        _unfinished(layout, part or "1/1", json)
        return
    layout.tidy()
    table, energy_unknown = layout.table(), job.plans[0].energy_known
    indices = None
    if job.design is not None:
        indices = Sensitivity(design=job.design, table=table, energy_unknown=energy_unknown)
    found = Campaign(
        vehicle=v, mission=task, columns=columns, spread=job.spread, seed=seed,
        table=table if indices is None else indices.independent, energy_unknown=energy_unknown,
    )  # fmt: skip
    answer = found.to_json()
    with progress("writing the results"):
        if indices is not None:
            answer["sensitivity"] = indices.to_json()
        files = [out / "campaign.zarr", *_write(replace(found, table=table), answer, indices, out)]
    if json:
        emit_json({**answer, "files": [str(path) for path in files]})
    else:
        _print(found, indices, files)
    if indices is None and not found.good.all():
        raise typer.Exit(1)


def _part(text: str | None) -> tuple[int, int]:
    """Return which part of how many is asked for."""
    if text is None:
        return 1, 1
    try:
        number, total = (int(piece) for piece in text.split("/"))
    except ValueError:
        raise InputError(
            "no part of a whole", field="--part", value=text,
            remedy="Give a number and how many there are, from --part 1/8 to --part 8/8",
        ) from None  # fmt: skip
    return number, total


def _spread(
    vehicle: Vehicle, file: Path | None, identified: bool, stated: dict[str, str | None]
) -> Spread:
    """Return the spread of a file, or the usual one; as identified; with what options state."""
    from swimbladder.io.config import file_text, read_model
    from swimbladder.sim.campaign.draw import Spread

    found = Spread() if file is None else read_model(Spread, file_text(file), file)
    if identified:
        try:
            found = found.identified(vehicle)
        except InputError as error:
            raise InputError(error.what, field="--identified", remedy=error.remedy) from None
    options = {f"--{name}-std": text for name, text in stated.items()}
    names = {name: f"--{name}-std" for name in stated}
    given = {name: text for name, text in stated.items() if text is not None}
    with said_as_typed(options, **names):
        return Spread(**{**found.model_dump(), **given})


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


def _print(found: Campaign, indices: Sensitivity | None, files: list[Path]) -> None:
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
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)


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
