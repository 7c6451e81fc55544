"""``swimbladder size``: which pump or screw, motor, stroke and battery do a dive.

The files of ``swimbladder size``.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from swimbladder.cli.casts import CastReading, refuse_doubted_unit
from swimbladder.cli.common import json_text, output, progress
from swimbladder.cli.options import Files, Options, grouped
from swimbladder.design.sizing import Sizing, columns, sized_vehicle, to_json
from swimbladder.io.files import publish, write_atomically
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.size import draw_candidates, draw_parts, draw_requirements
from swimbladder.show.plots.style import save
from swimbladder.vehicle import Vehicle

_DIGITS = 12  # that are written: more than a part is known to, fewer than what sums of floats add


def write_sizing(found: Sizing, out: Path) -> list[Path]:
    """Write the vehicle, every drive that does the dive, the whole answer and three pictures."""
    names = [
        "vehicle.toml",
        "drives.csv",
        "size.json",
        "drives.png",
        "parts.png",
        "requirements.png",
    ]
    head = f"Written by swimbladder size: {found.body.name} to {found.asked.dive.depth:g} m."

    def write(folder: Path) -> None:
        made = Vehicle.model_validate(_rounded(sized_vehicle(found).model_dump()))
        write_atomically(folder / names[0], vehicle_file(made, head=head))
        write_atomically(folder / names[1], _drives_csv(found))
        write_atomically(folder / names[2], json_text(to_json(found)) + "\n")
        save(draw_candidates(found), folder / names[3])
        save(draw_parts(found), folder / names[4])
        save(draw_requirements(found), folder / names[5])

    publish(out, write)
    return [out / name for name in names]


def _rounded(value: Any) -> Any:
    """Return numbers as a person reads them, 0.6 for 0.6000000000000001."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _drives_csv(found: Sizing) -> str:
    table = columns(found)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*table.values(), strict=True))
    return text.getvalue()


@dataclass(frozen=True)
class Task(Options):
    """The dive, as `design.sizing.Dive` has it."""

    depth: Annotated[str, typer.Option(metavar="DEPTH", help="How deep it has to go.")] = "1000 m"
    speed: Annotated[str, typer.Option(metavar="SPEED", help="Down and up.")] = "0.1 m/s"
    turn_time: Annotated[
        str, typer.Option(metavar="TIME", help="From sinking to rising at the depth, at most.")
    ] = "10 min"
    trim: Annotated[
        str, typer.Option(metavar="VOLUME", help="Neutral volume that is not known, 1 sigma.")
    ] = "20 cm3"
    probability: Annotated[
        str, typer.Option(metavar="SHARE", help="With which the stroke covers the trim.")
    ] = "95 %"
    freeboard: Annotated[
        str, typer.Option(metavar="VOLUME", help="That lifts the antenna at the surface.")
    ] = "0 cm3"
    reserve: Annotated[str, typer.Option(metavar="SHARE", help="Of the stroke, kept besides.")] = (
        "10 %"
    )
    cycles: Annotated[int, typer.Option(metavar="N", help="Dives on one battery.")] = 200
    park_time: Annotated[
        str, typer.Option("--park", metavar="TIME", help="At the depth, in each cycle.")
    ] = "0 s"
    hotel: Annotated[
        str, typer.Option(metavar="POWER", help="Of everything but the drive, all the time.")
    ] = "20 mW"
    surface_energy: Annotated[
        str,
        typer.Option("--surfacing", metavar="ENERGY", help="For fix and telemetry, in each cycle."),
    ] = "0 J"
    corrections: Annotated[
        str, typer.Option(metavar="SHARE", help="Of way and energy, that decisions add.")
    ] = "20 %"
    surface_time: Annotated[str, typer.Option(metavar="TIME", help="Afloat, in each cycle.")] = (
        "15 min"
    )
    battery_reserve: Annotated[
        str, typer.Option(metavar="SHARE", help="Of the battery, that is not flown with.")
    ] = "10 %"
    coldest: Annotated[
        str | None,
        typer.Option(metavar="TEMP", help="Water that the battery is in (the cast's, or 4 degC)."),
    ] = None


@dataclass(frozen=True)
class Driver(Options):
    """The motor's driver, in place of the list's."""

    efficiency: Annotated[
        str | None,
        typer.Option(
            "--driver-efficiency", metavar="SHARE", help="Of the motor's driver (the list's)."
        ),
    ] = None
    standby_power: Annotated[
        str | None,
        typer.Option(
            "--driver-standby", metavar="POWER", help="That it draws all the time (the list's)."
        ),
    ] = None


@dataclass(frozen=True)
class Limits(Options):
    """What is to be least, and what the body has room for."""

    least: Annotated[
        str, typer.Option(metavar="WHAT", help="mass (drive and battery) or energy (per cycle).")
    ] = "mass"
    longest_travel: Annotated[
        str, typer.Option(metavar="LENGTH", help="Of a piston that there is room for.")
    ] = "0.6 m"
    largest_mass: Annotated[
        str | None, typer.Option(metavar="MASS", help="Of drive and battery (the body's).")
    ] = None


@grouped(out=Path("swimbladder-size"))
def size(
    body: Annotated[
        str,
        typer.Argument(metavar="BODY", help="Preset or TOML file with hull, mass and drag."),
    ] = "example-eh",
    *,
    cast: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CTD cast (the body's own water).")
    ] = None,
    parts: Annotated[
        Path | None, typer.Option(metavar="FILE", help="List of parts (a typical one).")
    ] = None,
    task: Task,
    driver: Driver,
    limits: Limits,
    reading: CastReading,
    to: Files,
) -> None:
    """Search all combinations of parts for the drive and battery that do a dive.

    vehicle.toml is the body with that drive, for `energy`, `ballast` and `mission`. Exit code 1
    says that no combination will do, which requirement is in the way, and by how much.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    vehicle = load_vehicle(body)
    asked, room = task.read(), limits.given()
    check_place(to.out)
    casts = reading.casts(cast)
    with progress("loading"):
        from swimbladder.design.sizing import Dive, load_parts, sentences, to_json
        from swimbladder.design.sizing import size as find
    sea = None
    if casts:
        from swimbladder.physics.seawater import cast_column

        sea = cast_column(casts[0])
        refuse_doubted_unit(casts, asked["depth"], vehicle.hull.depth_limit)
    with driver.said_as_typed():
        listed = load_parts(parts).with_driver(**driver.read())
    doing = progress("weighing drives", total=6.0)
    with task.said_as_typed(), limits.said_as_typed(), doing as advance:
        found = find(vehicle, Dive(**asked), column=sea, parts=listed, advance=advance, **room)

    def show() -> None:
        for line in () if sea is None else sea.report:
            output.print(f"cast: {line}", soft_wrap=True)
        for sentence in sentences(found):
            output.print(sentence, soft_wrap=True)
        output.print("")

    to.answer(to_json(found), write_sizing(found, to.out), show)
