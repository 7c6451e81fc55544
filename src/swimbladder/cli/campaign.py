"""``swimbladder campaign``: an array of floats on one mission, each a little different."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    share,
)
from swimbladder.cli.common import (
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

if TYPE_CHECKING:
    from swimbladder.sim.campaign.result import Campaign

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
        str, typer.Option(metavar="VOLUME", help="1 sigma of the neutral volume.")
    ] = "5 cm3",
    psi_std: Annotated[
        str, typer.Option(metavar="PSI", help="1 sigma of the hull's compression.")
    ] = "0.002 cm3/m",
    drag_std: Annotated[str, typer.Option(metavar="SHARE", help="1 sigma of the drag.")] = "10 %",
    pump_std: Annotated[
        str, typer.Option(metavar="SHARE", help="1 sigma of the pump's delivery.")
    ] = "5 %",
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

    Trim, hull, drag and pump differ, and the water where several casts are given.

    Exit code 1: a float did not do every phase. A run that is killed goes on where it was.
    """
    from swimbladder.cli.mission import asked_of, water
    from swimbladder.io.config import load_mission, load_vehicle
    from swimbladder.io.files import check_place, unfinished

    v, task = load_vehicle(vehicle, weighed=True), load_mission(mission)
    span = quantity(duration, "s", "--duration")
    trim, psi = quantity(trim_std, "m3", "--trim-std"), quantity(psi_std, "m3/m", "--psi-std")
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
        from swimbladder.sim.campaign.draw import Spread
        from swimbladder.sim.campaign.result import Campaign
        from swimbladder.sim.campaign.run import fly_floats
        from swimbladder.sim.mission.prepare import make_table

    assert trim is not None
    assert psi is not None
    typed = {
        "--trim-std": trim_std, "--psi-std": psi_std, "--drag-std": drag_std,
        "--pump-std": pump_std,
    }  # fmt: skip
    with said_as_typed(typed):
        spread = Spread(
            trim=trim, psi=psi, drag=share(drag_std, "--drag-std"),
            pump=share(pump_std, "--pump-std"),
        )  # fmt: skip
    aside = unfinished(out)
    with (
        asked_of(mission, task, duration=duration), kept(aside), compile_notice(),
        progress("flying", 1.0) as advance,
    ):  # fmt: skip
        table = fly_floats(
            v, task, columns, floats=floats, seed=seed, spread=spread, cycles=cycles, span=span,
            keep=aside, advance=advance,
        )  # fmt: skip
    found = Campaign(
        vehicle=v, mission=task, columns=columns, spread=spread, seed=seed, table=table,
        energy_unknown=make_table(v, columns[0])[1],
    )  # fmt: skip
    files = _write(found, out)
    shutil.rmtree(aside, ignore_errors=True)
    if json:
        emit_json({**found.to_json(), "files": [str(path) for path in files]})
    else:
        _print(found, files)
    if not found.good.all():
        raise typer.Exit(1)


def _write(found: Campaign, out: Path) -> list[Path]:
    from swimbladder.io.files import publish, write_atomically
    from swimbladder.io.tables import write_csv

    names = ["campaign.json", "floats.csv"]

    def write(folder: Path) -> None:
        write_atomically(folder / names[0], json_text(found.to_json()) + "\n")
        write_csv(folder / names[1], found.columns_csv)

    publish(out, write)
    return [out / name for name in names]


def _print(found: Campaign, files: list[Path]) -> None:
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
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)
