"""``swimbladder size``: which pump or screw, motor, stroke and battery do a dive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.cast_unit import refuse_doubted_unit
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
from swimbladder.cli.common import emit_json, output, progress, quantity, said_as_typed

if TYPE_CHECKING:
    from swimbladder.design.sizing import Parts

__all__ = ["size"]


def size(
    body: Annotated[
        str,
        typer.Argument(metavar="BODY", help="Preset or TOML file with hull, mass and drag."),
    ] = "example-eh",
    depth: Annotated[str, typer.Option(metavar="DEPTH", help="How deep it has to go.")] = "1000 m",
    cast: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CTD cast (the body's own water).")
    ] = None,
    parts: Annotated[
        Path | None, typer.Option(metavar="FILE", help="List of parts (a typical one).")
    ] = None,
    least: Annotated[
        str, typer.Option(metavar="WHAT", help="mass (drive and battery) or energy (per cycle).")
    ] = "mass",
    speed: Annotated[str, typer.Option(metavar="SPEED", help="Down and up.")] = "0.1 m/s",
    turn_time: Annotated[
        str, typer.Option(metavar="TIME", help="From sinking to rising at the depth, at most.")
    ] = "10 min",
    trim: Annotated[
        str, typer.Option(metavar="VOLUME", help="Neutral volume that is not known, 1 sigma.")
    ] = "20 cm3",
    probability: Annotated[
        str, typer.Option(metavar="SHARE", help="With which the stroke covers the trim.")
    ] = "95 %",
    freeboard: Annotated[
        str, typer.Option(metavar="VOLUME", help="That lifts the antenna at the surface.")
    ] = "0 cm3",
    reserve: Annotated[
        str, typer.Option(metavar="SHARE", help="Of the stroke, kept besides.")
    ] = "10 %",
    cycles: Annotated[int, typer.Option(metavar="N", help="Dives on one battery.")] = 200,
    park: Annotated[str, typer.Option(metavar="TIME", help="At the depth, in each cycle.")] = "0 s",
    hotel: Annotated[
        str, typer.Option(metavar="POWER", help="Of everything but the drive, all the time.")
    ] = "20 mW",
    surfacing: Annotated[
        str, typer.Option(metavar="ENERGY", help="For fix and telemetry, in each cycle.")
    ] = "0 J",
    corrections: Annotated[
        str, typer.Option(metavar="SHARE", help="Of way and energy, that decisions add.")
    ] = "20 %",
    surface_time: Annotated[
        str, typer.Option(metavar="TIME", help="Afloat, in each cycle.")
    ] = "15 min",
    battery_reserve: Annotated[
        str, typer.Option(metavar="SHARE", help="Of the battery, that is not flown with.")
    ] = "10 %",
    coldest: Annotated[
        str | None,
        typer.Option(metavar="TEMP", help="Water that the battery is in (the cast's, or 4 degC)."),
    ] = None,
    driver_efficiency: Annotated[
        str | None, typer.Option(metavar="SHARE", help="Of the motor's driver (the list's).")
    ] = None,
    driver_standby: Annotated[
        str | None, typer.Option(metavar="POWER", help="That it draws all the time (the list's).")
    ] = None,
    longest_travel: Annotated[
        str, typer.Option(metavar="LENGTH", help="Of a piston that there is room for.")
    ] = "0.6 m",
    largest_mass: Annotated[
        str | None, typer.Option(metavar="MASS", help="Of drive and battery (the body's).")
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
        "swimbladder-size"
    ),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Search all combinations of parts for the drive and battery that do a dive.

    vehicle.toml is the body with that drive, for `energy`, `ballast` and `mission`. Exit code 1
    says that no combination will do, which requirement is in the way, and by how much.
    """
    import math

    from swimbladder.errors import InputError
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    vehicle = load_vehicle(body)
    if least not in ("mass", "energy"):
        raise InputError(
            "not something to be least", field="--least", value=least,
            remedy="Allowed: mass, energy",
        )  # fmt: skip
    numbers = {
        "depth": (depth, "m"), "speed": (speed, "m/s"), "turn_time": (turn_time, "s"),
        "trim": (trim, "m3"), "probability": (probability, ""), "freeboard": (freeboard, "m3"),
        "reserve": (reserve, ""), "park_time": (park, "s"), "hotel": (hotel, "W"),
        "surface_energy": (surfacing, "J"), "corrections": (corrections, ""),
        "surface_time": (surface_time, "s"), "battery_reserve": (battery_reserve, ""),
    }  # fmt: skip
    options = {"park_time": "--park", "surface_energy": "--surfacing"}
    named = {name: options.get(name, "--" + name.replace("_", "-")) for name in numbers}
    wished = {n: quantity(text, unit, named[n]) or 0.0 for n, (text, unit) in numbers.items()}
    travel = quantity(longest_travel, "m", "--longest-travel") or 0.0
    mass = quantity(largest_mass, "kg", "--largest-mass")
    cold = quantity(coldest, "degC", "--coldest")
    check_place(out)
    casts = asked_casts(
        [] if cast is None else [cast], column=column, where=where, log_format=log_format,
        profile=profile, latitude=latitude, longitude=longitude, salinity=salinity,
        inversions=inversions,
    )  # fmt: skip
    with progress("loading"):
        from swimbladder.cli.size_files import write_sizing
        from swimbladder.design.sizing import Dive, load_parts, sentences, to_json
        from swimbladder.design.sizing import size as find
    sea = None
    if casts:
        from swimbladder.physics.seawater import cast_column

        sea = cast_column(casts[0])
        refuse_doubted_unit(casts, wished["depth"], vehicle.hull.depth_limit)
    listed = _with_driver(load_parts(parts), driver_efficiency, driver_standby)
    typed: dict[str, str | None] = {named[name]: text for name, (text, _) in numbers.items()}
    typed |= {"--coldest": coldest}
    typed |= {"--longest-travel": longest_travel, "--largest-mass": largest_mass}
    with (
        said_as_typed(
            typed, **named, cycles="--cycles", coldest="--coldest",
            longest_travel="--longest-travel", largest_mass="--largest-mass",
        ),
        progress("weighing drives", total=6.0) as advance,
    ):  # fmt: skip
        found = find(
            vehicle, Dive(cycles=cycles, coldest=cold, **wished), column=sea, parts=listed,
            longest_travel=travel, largest_mass=math.inf if mass is None else mass,
            least="mass" if least == "mass" else "energy", advance=advance,
        )  # fmt: skip
    files = write_sizing(found, out)
    if json:
        emit_json({**to_json(found), "files": [str(path) for path in files]})
        return
    for line in () if sea is None else sea.report:
        output.print(f"cast: {line}", soft_wrap=True)
    for sentence in sentences(found):
        output.print(sentence, soft_wrap=True)
    output.print("")
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)


def _with_driver(parts: Parts, efficiency: str | None, standby: str | None) -> Parts:
    """Return a list of parts with the driver that was asked for."""
    from swimbladder.errors import InputError

    asked = {
        "efficiency": quantity(efficiency, "", "--driver-efficiency"),
        "standby_power": quantity(standby, "W", "--driver-standby"),
    }
    share, power = asked["efficiency"], asked["standby_power"]
    if share is not None and not 0.0 < share <= 1.0:
        raise InputError(
            "a share above 0 and up to 1 is needed", field="--driver-efficiency", value=efficiency,
            remedy='Write a share like "92 %"',
        )  # fmt: skip
    if power is not None and not 0.0 <= power < float("inf"):
        raise InputError(
            "it cannot be negative", field="--driver-standby", value=standby,
            remedy="Check the number and its unit",
        )  # fmt: skip
    given = {key: value for key, value in asked.items() if value is not None}
    if not given:
        return parts
    options = {"efficiency": "--driver-efficiency", "standby_power": "--driver-standby"}
    source = "asked for: " + " and ".join(options[key] for key in given)
    if len(given) < len(options):
        source += "; the rest " + parts.provenance.get("driver", "as in the list of parts")
    return parts.model_copy(
        update={
            "driver": parts.driver.model_copy(update=given),
            "provenance": {**parts.provenance, "driver": source},
        }
    )
