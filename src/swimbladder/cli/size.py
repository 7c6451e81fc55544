"""``swimbladder size``: which pump or screw, motor, stroke and battery do a dive."""

from pathlib import Path
from typing import Annotated

import typer

from swimbladder.cli.casts import CastReading, refuse_doubted_unit
from swimbladder.cli.common import progress
from swimbladder.cli.options import Files, Options, grouped, loaded, valued
from swimbladder.cli.texts import Given


class Task(Options):
    """The dive, as `design.sizing.Dive` has it."""

    max_depth: str = valued("DEPTH", "Greatest depth.", "1000 m")
    speed: str = valued("SPEED", "Vertical speed.", "0.1 m/s")
    turn_time: str = valued("TIME", "Longest time from sinking to rising at the depth.", "10 min")
    trim_std: str = valued("VOLUME", "1 sigma of the neutral volume.", "20 cm3")
    probability: str = valued("SHARE", "Probability that the stroke suffices.", "95 %")
    antenna_volume: str = valued("VOLUME", "Volume that lifts the antenna.", "0 cm3")
    stroke_reserve: str = valued("SHARE", "Reserve of the stroke.", "10 %")
    cycles: int = valued("N", "Cycles on one battery.", 200)
    park_time: str = valued("TIME", "Time at the depth per cycle.", "0 s")
    hotel: str = valued("POWER", "Power of everything but the drive.", "20 mW")
    surface_energy: str = valued("ENERGY", "Energy for fix and telemetry per cycle.", "0 J")
    corrections: str = valued("SHARE", "Added way and energy of corrections.", "20 %")
    surface_time: str = valued("TIME", "Time at the surface per cycle.", "15 min")
    battery_reserve: str = valued("SHARE", "Reserve of the battery.", "10 %")
    battery_temperature: Given = valued("TEMP", "Battery temperature (the cast's, or 4 degC).")


class Driver(Options):
    """The motor's driver, in place of the list's."""

    efficiency: Given = valued(
        "SHARE", "Efficiency of the driver (the list's).", name="--driver-efficiency"
    )
    standby_power: Given = valued(
        "POWER", "Standby power of the driver (the list's).", name="--driver-standby-power"
    )


class Limits(Options):
    """What is to be least, and what the body has room for."""

    goal: str = valued("GOAL", "Goal: least mass (drive, battery) or energy (per cycle).", "mass")
    max_piston_stroke: str = valued("LENGTH", "Longest travel of the piston.", "0.6 m")
    max_mass: Given = valued("MASS", "Largest mass of drive and battery (the body's).")


_BODY = typer.Argument(metavar="BODY", help="Preset or TOML file with hull, mass and drag.")
_PARTS = typer.Option(metavar="FILE", help="List of parts (a typical one).")


@grouped("max_depth speed cycles turn_time park_time parts goal", out=Path("swimbladder-size"))
def size(
    body: Annotated[str, _BODY] = "example-eh",
    *,
    parts: Annotated[Path | None, _PARTS] = None,
    task: Task,
    driver: Driver,
    limits: Limits,
    reading: CastReading,
    to: Files,
) -> None:
    """Search all combinations of parts for a drive and battery that meet the dive.

    vehicle.toml is the body with that drive, for `energy`, `ballast` and `mission`. Exit code 1
    says that no combination will do, which requirement is in the way, and by how much.
    """
    vehicle = loaded(body)
    asked, room = task.read(), limits.given()
    casts = reading.casts()
    with progress("loading"):
        from swimbladder.design.sizing import Dive, load_parts
        from swimbladder.design.sizing import size as find
    sea = None
    if casts:
        from swimbladder.physics.seawater import cast_column

        sea = cast_column(casts[0])
        refuse_doubted_unit(casts, asked["max_depth"], vehicle.hull.depth_limit)
    listed = load_parts(parts).with_driver(**driver.read())
    doing = progress("weighing drives", total=6.0)
    with doing as advance:
        found = find(vehicle, Dive(**asked), cast=sea, parts=listed, advance=advance, **room)
    to.answer(found)
