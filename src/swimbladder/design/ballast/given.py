"""What ballasting starts from: the seas down to where the vehicle goes, its mass, the ballast."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from swimbladder.errors import InputError
from swimbladder.physics.hull import mass_mismatch, weighing, weight_mass
from swimbladder.physics.seawater import Cast, Column, cast_column, uniform_column
from swimbladder.physics.seawater.cast_unit import above_rating, check_cast_unit
from swimbladder.units import parse_quantity
from swimbladder.vehicle import PhysicalMotion, Vehicle

# kg/m3 at room temperature: CRC Handbook of Chemistry and Physics, 97th ed., section 4 (elements)
# and 12 (alloys): lead, iron/plain steel, stainless steel 304, aluminium.
MATERIALS = {"lead": 11340.0, "steel": 7850.0, "stainless": 8000.0, "aluminium": 2700.0}


class Seas(NamedTuple):
    """The waters a vehicle may meet, what was assumed of them, and what is in doubt."""

    columns: list[Column]
    assumed: list[str]
    warnings: list[str]


def seas(vehicle: Vehicle, casts: Sequence[Cast], deepest: float | None = None) -> Seas:
    """Return the waters of casts down to where a vehicle is to go; its own where there are none.

    deepest [m]; None: its rating, or where the first cast ends. Raises InputError for a depth that
    it cannot go to, where none is known, and for a cast that may be in another unit.
    """
    limit = vehicle.hull.depth_limit
    if deepest is not None and not deepest > 0.0:
        raise InputError(
            "not above 0", field="deepest", value=deepest, unit="m",
            remedy="Give a depth below the surface",
        )  # fmt: skip
    if deepest is not None and limit is not None and deepest > limit:
        raise InputError(
            f"deeper than the vehicle is rated for, {limit:g} m", field="deepest", value=deepest,
            unit="m", remedy="Give a lesser depth, or correct hull.depth_limit",
        )  # fmt: skip
    if not casts:
        down = limit if deepest is None else deepest
        if down is None:
            raise InputError(
                "neither a cast, nor a depth, nor the vehicle's file says how deep it goes",
                field="deepest", remedy="Give this depth, or a cast",
            )  # fmt: skip
        column = uniform_column(vehicle.water, down, step=down / 1000.0)
        return Seas([column], [f"no cast: {column.source}, as in the vehicle's file"], [])
    for cast in casts:
        check_cast_unit(cast, deepest, limit)
    assumed: list[str] = []
    warnings: list[str] = []
    if deepest is None:
        ends = [cast_column(cast).deepest for cast in casts]
        shallowest = min(ends)
        deepest = min(shallowest, limit) if limit is not None else shallowest
        why = "its rating" if deepest == limit else "where the cast ends; --deepest"
        assumed.append(f"it goes down to {deepest:g} m ({why})")
        warnings += above_rating(casts[ends.index(shallowest)].name, shallowest, limit, "deepest")
    columns = [cast_column(cast, deepest) for cast in casts]
    said = dict.fromkeys(line for column in columns for line in column.report)
    return Seas(columns, [*assumed, *said], warnings)


def with_mass(vehicle: Vehicle, mass: float | None = None) -> tuple[Vehicle, str, list[str]]:
    """Return the vehicle with the mass on the scale [kg], what is assumed of it, what is in doubt.

    None: what its trim_error says. Raises InputError for a mass that the hull could not carry by
    far: a wrong unit or volume.
    """
    by_trim = weight_mass(vehicle)
    if mass is None:
        assumed = f"it weighs {by_trim:.6g} kg, by trim_error in the water of the vehicle's file"
        if isinstance(vehicle.motion, PhysicalMotion):
            assumed += f" (its dry mass there is {vehicle.motion.dry_mass:.6g} kg)"
        warning = mass_mismatch(vehicle)
        rest = ", and trim_error is taken; weigh it and give --mass"
        return vehicle, assumed, [warning + rest] if warning else []
    if not 0.5 * by_trim < mass < 2.0 * by_trim:
        raise InputError(
            f"a vehicle that displaces {by_trim / vehicle.water.density * 1e3:.4g} L does not "
            "weigh this", field="mass", value=mass, unit="kg",
            remedy="Check the mass, and hull.displaced_volume in the vehicle's file",
        )  # fmt: skip
    assumed = f"it weighs {mass:.6g} kg, as given (by trim {by_trim:.6g} kg)"
    return weighing(vehicle, mass), assumed, []


def material_of(text: str) -> tuple[float, str]:
    """Return density [kg/m3] and name of ballast; infinite for what stands inside the hull.

    Raises InputError for what is neither one of `MATERIALS`, nor a density, nor "inside".
    """
    if text == "inside":
        return math.inf, text
    if text in MATERIALS:
        return MATERIALS[text], text
    try:
        density = parse_quantity(text, "kg/m3")
    except InputError:
        raise InputError(
            "no such ballast", field="material", value=text,
            remedy=f'Give one of {", ".join(MATERIALS)}, a density like "19 g/cm3", or inside',
        ) from None  # fmt: skip
    return density, f"{density:g} kg/m3"
