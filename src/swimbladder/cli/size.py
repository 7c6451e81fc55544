"""``swimbladder size``: which pump or screw, motor, stroke and battery do a dive."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from swimbladder.cli.casts import CastReading, refuse_doubted_unit
from swimbladder.cli.common import labelled, progress
from swimbladder.cli.options import Files, Options, grouped, valued
from swimbladder.cli.texts import Given


@dataclass(frozen=True)
class Task(Options):
    """The dive, as `design.sizing.Dive` has it."""

    depth: str = valued("DEPTH", "How deep it has to go.", "1000 m")
    speed: str = valued("SPEED", "Down and up.", "0.1 m/s")
    turn_time: str = valued("TIME", "From sinking to rising at the depth, at most.", "10 min")
    trim: str = valued("VOLUME", "Neutral volume that is not known, 1 sigma.", "20 cm3")
    probability: str = valued("SHARE", "With which the stroke covers the trim.", "95 %")
    freeboard: str = valued("VOLUME", "That lifts the antenna at the surface.", "0 cm3")
    reserve: str = valued("SHARE", "Of the stroke, kept besides.", "10 %")
    cycles: int = valued("N", "Dives on one battery.", 200)
    park_time: str = valued("TIME", "At the depth, in each cycle.", "0 s", name="--park")
    hotel: str = valued("POWER", "Of everything but the drive, all the time.", "20 mW")
    surface_energy: str = valued(
        "ENERGY", "For fix and telemetry, in each cycle.", "0 J", name="--surfacing"
    )
    corrections: str = valued("SHARE", "Of way and energy, that decisions add.", "20 %")
    surface_time: str = valued("TIME", "Afloat, in each cycle.", "15 min")
    battery_reserve: str = valued("SHARE", "Of the battery, that is not flown with.", "10 %")
    coldest: Given = valued("TEMP", "Water that the battery is in (the cast's, or 4 degC).")


@dataclass(frozen=True)
class Driver(Options):
    """The motor's driver, in place of the list's."""

    efficiency: Given = valued(
        "SHARE", "Of the motor's driver (the list's).", name="--driver-efficiency"
    )
    standby_power: Given = valued(
        "POWER", "That it draws all the time (the list's).", name="--driver-standby"
    )


@dataclass(frozen=True)
class Limits(Options):
    """What is to be least, and what the body has room for."""

    least: str = valued("WHAT", "mass (drive and battery) or energy (per cycle).", "mass")
    longest_travel: str = valued("LENGTH", "Of a piston that there is room for.", "0.6 m")
    largest_mass: Given = valued("MASS", "Of drive and battery (the body's).")


_BODY = typer.Argument(metavar="BODY", help="Preset or TOML file with hull, mass and drag.")
_CAST = typer.Option(metavar="FILE", help="CTD cast (the body's own water).")
_PARTS = typer.Option(metavar="FILE", help="List of parts (a typical one).")


@grouped(out=Path("swimbladder-size"))
def size(
    body: Annotated[str, _BODY] = "example-eh",
    *,
    cast: Annotated[Path | None, _CAST] = None,
    parts: Annotated[Path | None, _PARTS] = None,
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

    vehicle = load_vehicle(body)
    asked, room = task.read(), limits.given()
    to.check()
    casts = reading.casts(cast)
    with progress("loading"):
        from swimbladder.design.sizing import Dive, load_parts
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

    water = labelled("cast", () if sea is None else sea.report)
    to.answer(found, (*water, *found.sentences, ""))
