"""``swimbladder ballast``: what to add, and whether the stroke does, in the sea of a cast."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    above_rating,
    asked_casts,
    share,
)
from swimbladder.cli.common import emit_json, json_text, output, progress, quantity
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.design.ballast import Ballasting
    from swimbladder.physics.seawater import Cast, Column
    from swimbladder.vehicle import Vehicle

__all__ = ["ballast"]


def ballast(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    cast: Annotated[
        list[Path] | None,
        typer.Option("--cast", metavar="CTD", help="Cast: CSV, netCDF, Argo; several: all count."),
    ] = None,
    neutral_depth: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="Find the mass to be neutral there.")
    ] = None,
    at_volume: Annotated[
        str | None, typer.Option(metavar="VOLUME", help="Of the drive, to be neutral with (0).")
    ] = None,
    freeboard: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Hull out of the water, at full volume.")
    ] = None,
    deepest: Annotated[
        str | None, typer.Option(metavar="DEPTH", help="To go to (the rating, or the cast's end).")
    ] = None,
    speed: Annotated[
        str, typer.Option(metavar="SPEED", help="To sink and rise with, everywhere.")
    ] = "0 m/s",
    probability: Annotated[
        str, typer.Option(metavar="SHARE", help="With which the stroke has to do.")
    ] = "95 %",
    material: Annotated[
        str,
        typer.Option("--ballast", metavar="WHAT", help="lead, steel, ..., a density, or inside."),
    ] = "lead",
    mass: Annotated[
        str | None, typer.Option(metavar="MASS", help="On the scale (that of trim_error).")
    ] = None,
    mass_std: Annotated[
        str | None, typer.Option(metavar="MASS", help="1 sigma of the mass.")
    ] = None,
    volume_std: Annotated[
        str | None, typer.Option(metavar="VOLUME", help="1 sigma of the hull's volume.")
    ] = None,
    trim_std: Annotated[
        str | None, typer.Option(metavar="VOLUME", help="1 sigma of the neutral volume.")
    ] = None,
    psi_std: Annotated[
        str | None, typer.Option(metavar="PSI", help="1 sigma of psi, the hull's compression.")
    ] = None,
    heat_std: Annotated[
        str | None, typer.Option(metavar="1/K", help="1 sigma of the thermal expansion.")
    ] = None,
    air_std: Annotated[
        str | None, typer.Option(metavar="VOLUME", help="1 sigma of the trapped air.")
    ] = None,
    density_std: Annotated[
        str | None, typer.Option(metavar="DENSITY", help="1 sigma of the sea's density.")
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
        "swimbladder-ballast"
    ),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    r"""Find the ballast of a vehicle in a real sea, and whether its stroke is enough.

    Without --cast the water is that of the vehicle's file, of constant density. Exit code 1 says
    that the stroke does not cover it with that probability, what is short and by how much.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = load_vehicle(vehicle, weighed=True)
    weighed = quantity(mass, "kg", "--mass")
    stds = {
        "mass": quantity(mass_std, "kg", "--mass-std"),
        "volume": quantity(volume_std, "m3", "--volume-std"),
        "trim": quantity(trim_std, "m3", "--trim-std"),
        "psi": quantity(psi_std, "m3/m", "--psi-std"),
        "heat": quantity(heat_std, "1/K", "--heat-std"),
        "air": quantity(air_std, "m3", "--air-std"),
        "density": quantity(density_std, "kg/m3", "--density-std"),
    }
    target = {
        "neutral_depth": quantity(neutral_depth, "m", "--neutral-depth"),
        "volume": quantity(at_volume, "m3", "--at-volume") or 0.0,
        "freeboard": quantity(freeboard, "m", "--freeboard"),
    }
    asked = quantity(deepest, "m", "--deepest")
    if asked is not None and not asked > 0.0:
        raise InputError(
            "not above 0", field="--deepest", value=deepest, unit="m",
            remedy="Give a depth below the surface",
        )  # fmt: skip
    wanted, moving = share(probability, "--probability"), quantity(speed, "m/s", "--speed")
    density, named = _material(material)
    if at_volume is not None and neutral_depth is None:
        raise InputError(
            "a volume to be neutral with needs the depth", field="--at-volume", value=at_volume,
            remedy="Give --neutral-depth too, or leave --at-volume out",
        )  # fmt: skip
    check_place(out)
    casts = asked_casts(
        cast or [], column=column, where=where, log_format=log_format, profile=profile,
        latitude=latitude, longitude=longitude, salinity=salinity, inversions=inversions,
    )  # fmt: skip

    from swimbladder.design.ballast import Target, uncertainty_of
    from swimbladder.design.ballast import ballast as find
    from swimbladder.show.report.ballast import write_ballasting

    columns, said, warned = _columns(v, casts, asked)
    v, told, doubt = _weighed(v, weighed)
    warned += doubt
    uncertainty = uncertainty_of(v, stds)
    with progress("drawing vehicles", 1.0) as advance:
        found = find(
            v, columns, target=Target(**target), uncertainty=uncertainty,  # type: ignore[arg-type]
            probability=wanted, speed=moving or 0.0, density=density, material=named,
            assumptions=(*warned, *said, told, *_hull_words(v), *uncertainty.said), advance=advance,
        )  # fmt: skip
    answer = found.to_json()
    with progress("drawing the picture"):
        files = write_ballasting(found, out, answer=json_text(answer))
    if json:
        emit_json({**answer, "files": [str(path) for path in files]})
    else:
        _print(found, warned, files)
    if not found.covered:
        raise typer.Exit(1)


def _material(text: str) -> tuple[float, str]:
    """Return density [kg/m3] and name of ballast; infinite for what stands inside the hull."""
    from swimbladder.design.ballast.run import MATERIALS

    if text == "inside":
        return math.inf, text
    if text in MATERIALS:
        return MATERIALS[text], text
    try:
        density = quantity(text, "kg/m3", "--ballast")
    except InputError:
        raise InputError(
            "no such ballast", field="--ballast", value=text,
            remedy=f'Give one of {", ".join(MATERIALS)}, a density like "19 g/cm3", or inside',
        ) from None  # fmt: skip
    assert density is not None
    return density, f"{density:g} kg/m3"


def _columns(
    vehicle: Vehicle, casts: list[Cast], asked: float | None
) -> tuple[list[Column], list[str], list[str]]:
    """Return the columns down to where the vehicle is to go, what was assumed, what is in doubt.

    Raises InputError where a cast ends so far above the rating that its unit may be wrong.
    """
    from swimbladder.physics.seawater import cast_column, uniform_column

    limit = vehicle.hull.depth_limit
    if asked is not None and limit is not None and asked > limit:
        raise InputError(
            f"deeper than the vehicle is rated for, {limit:g} m", field="--deepest", value=asked,
            unit="m", remedy="Give a lesser depth, or correct hull.depth_limit",
        )  # fmt: skip
    if not casts:
        if asked is None and limit is None:
            raise InputError(
                "neither a cast, nor a depth, nor the vehicle's file says how deep it goes",
                field="--deepest", remedy="Give --deepest or --cast",
            )  # fmt: skip
        down = asked if asked is not None else limit
        assert down is not None
        column = uniform_column(vehicle.water, down, step=down / 1000.0)
        return [column], [f"no cast: {column.source}, as in the vehicle's file"], []
    refuse_doubted_unit(casts, asked, limit)
    said: list[str] = []
    warned: list[str] = []
    if asked is None:
        ends = [cast_column(cast).deepest for cast in casts]
        shallowest = min(ends)
        down = min(shallowest, limit) if limit is not None else shallowest
        why = "its rating" if down == limit else "where the cast ends; --deepest"
        said.append(f"it goes down to {down:g} m ({why})")
        warned += above_rating(casts[ends.index(shallowest)].name, shallowest, limit, "--deepest")
    else:
        down = asked
    columns = [cast_column(cast, down) for cast in casts]
    return columns, [*said, *dict.fromkeys(s for column in columns for s in column.report)], warned


def _weighed(vehicle: Vehicle, mass: float | None) -> tuple[Vehicle, str, list[str]]:
    """Return the vehicle with the mass on the scale, what is reckoned with, what is in doubt.

    Raises InputError for a mass that the hull could not carry by far: a wrong unit or volume.
    """
    from swimbladder.physics.hull import mass_doubt, weighing, weight_mass
    from swimbladder.vehicle import PhysicalMotion

    by_trim = weight_mass(vehicle)
    if mass is None:
        told = f"it weighs {by_trim:.6g} kg, by trim_error in the water of the vehicle's file"
        if isinstance(vehicle.motion, PhysicalMotion):
            dry = vehicle.motion.dry_mass
            told += f" (its dry mass there is {dry:.6g} kg)"
        doubt = mass_doubt(vehicle)
        rest = ", and trim_error is taken; weigh it and give --mass"
        return vehicle, told, [doubt + rest] if doubt else []
    if not 0.5 * by_trim < mass < 2.0 * by_trim:
        raise InputError(
            f"a vehicle that displaces {by_trim / vehicle.water.density * 1e3:.4g} L does not "
            "weigh this", field="--mass", value=mass, unit="kg",
            remedy="Check the mass, and hull.displaced_volume in the vehicle's file",
        )  # fmt: skip
    told = f"it weighs {mass:.6g} kg, as given (by trim {by_trim:.6g} kg)"
    return weighing(vehicle, mass), told, []


def _hull_words(vehicle: Vehicle) -> list[str]:
    """Return what is reckoned with of the hull."""
    if vehicle.hull.parts:
        return [f"the hull is {', '.join(part.name for part in vehicle.hull.parts)}"]
    return [
        "the hull is one part whose compression is that of psi, and its thermal expansion is not "
        "known and taken as 0; [[hull.parts]] would tell"
    ]


def _print(found: Ballasting, warned: list[str], files: list[Path]) -> None:
    seas = ", ".join(column.source for column in found.columns)
    output.print(f"{found.vehicle.name} in {seas}", soft_wrap=True)
    for sentence in warned:
        output.print(f"warning: {sentence}", soft_wrap=True)
    output.print("")
    for sentence in found.sentences:
        output.print(sentence, soft_wrap=True)
    output.print("")
    spread: dict[str, Any] = {k: v for k, v in found.spread.items() if v > 0.0}
    if spread:
        parts = ", ".join(f"{name} {1e6 * value:.2g}" for name, value in spread.items())
        output.print(f"1 sigma of the neutral volume at the deepest, cm3: {parts}", soft_wrap=True)
    for sentence in found.assumptions[len(warned) :]:
        output.print(f"assumed: {sentence}", soft_wrap=True)
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)
