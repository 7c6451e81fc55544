"""Ballasting: the mass for a target, the volumes that the sea asks for, and how sure that is.

It starts from the seas down to where the vehicle goes, its mass, the ballast.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.ballast.result import (
    Ballasting,
    Curve,
    Need,
    Target,
    Uncertainty,
    drawn_volumes,
    sensitivities,
)
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import (
    displaced_volume,
    hull_parts,
    mass_mismatch,
    neutral_volume,
    psi_terms,
    weighing,
    weight_mass,
)
from swimbladder.physics.seawater import Cast, Column, cast_column, uniform_column
from swimbladder.physics.seawater.cast_unit import above_rating, check_cast_unit
from swimbladder.units import parse_quantity, rounded
from swimbladder.vehicle import Hull, HullPart, PhysicalMotion, Vehicle

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


Array = NDArray[np.float64]

_DRAWS = 20_000  # so that a probability of 95 % is known to 0.15 % (1 sigma)
_POINTS = 200  # depths that each draw is looked at, the extremes of the mean among them


def ballast(
    vehicle: Vehicle,
    columns: Sequence[Column],
    *,
    target: Target | None = None,
    uncertainty: Uncertainty,
    probability: float = 0.95,
    speed: float = 0.0,
    density: float = MATERIALS["lead"],
    material: str = "lead",
    draws: int = _DRAWS,
    seed: int = 0,
    assumptions: Sequence[str] = (),
    advance: Callable[[float], None] = lambda _: None,
) -> Ballasting:
    """Return what to add to a vehicle for a target, and whether its stroke does in every column.

    columns: the seas it may meet, down to the deepest it has to go; the target is for the first.
    density [kg/m3] of what is added outside the hull, infinite for what is added inside. speed: at
    which it has to sink and rise besides [m/s]. Raises InputError for targets that make no sense
    and NoAnswerError where no mass fulfils them.
    """
    target = target or Target()
    _check(vehicle, columns, target, probability, speed, density)
    added = _added(vehicle, columns[0], target, density)
    made = ballasted(vehicle, added, density, columns[0])
    curves, needs, floats = [], [], []
    for k, column in enumerate(columns):
        thin = _thinned(column, made)
        nominal = neutral_volume(made, thin)
        drawn = drawn_volumes(made, thin, uncertainty, draws=draws, seed=seed + k)
        weight = thin.density * thin.gravity
        push = [abs(drag_force(made.drag, w)) / weight for w in (speed, -speed)]
        needs.append(_need(made, thin, nominal, drawn, push, target, probability))
        tails = np.quantile(drawn, [0.5 - 0.5 * probability, 0.5 + 0.5 * probability], axis=0)
        curves.append(Curve(depth=thin.depth, nominal=nominal, low=tails[0], high=tails[1]))
        floats.append(made.stroke.maximum - drawn[:, 0])
        advance(1.0 / len(columns))
    tight = min(needs, key=lambda need: (need.probability, need.margin))
    shift = 0.5 * (tight.margin_out - tight.margin_in)
    per_mass = 1.0 / float(columns[0].density[0]) - 1.0 / density
    first = columns[0]
    area, height = made.hull.waterplane_area, made.hull.height
    out = [made.stroke.maximum - float(curves[0].nominal[0]),
           float(np.quantile(floats[0], 1.0 - probability))]  # fmt: skip
    free, sure = (min(max(volume / area, 0.0), height) for volume in out)
    at = min(target.neutral_depth or 0.5 * first.deepest, first.deepest)
    spread = {
        name: float(abs(values[-1]))
        for name, values in sensitivities(made, first, uncertainty).items()
    }
    return Ballasting(
        vehicle=made, given=vehicle, target=target, columns=tuple(columns), curves=tuple(curves),
        needs=tuple(needs), uncertainty=uncertainty, wanted=probability, draws=draws, speed=speed,
        added=added, added_volume=added / density, material=material, best=shift / per_mass,
        best_margin=0.5 * (tight.margin_in + tight.margin_out),
        freeboard=free, sure_freeboard=sure, psi_depth=at,
        psi=psi_terms(made, first, at), spread=spread, assumptions=tuple(assumptions),
    )  # fmt: skip


def ballasted(vehicle: Vehicle, added: float, density: float, column: Column) -> Vehicle:
    """Return the vehicle with a mass [kg] of that density [kg/m3] added, in the water of a column.

    Its [water] is that of the surface of the column, and trim_error the volume at which it is
    neutral there; what weighs and what is displaced is otherwise as before.
    """
    volume = added / density
    hull = vehicle.hull.model_dump()
    hull["displaced_volume"] += volume
    if vehicle.hull.parts and volume != 0.0:
        hull["parts"] = _with_ballast(vehicle.hull, volume)
    water = vehicle.water.model_copy(
        update={
            "density": float(column.density[0]), "temperature": float(column.temperature[0]),
            "gravity": column.gravity,
        }
    )  # fmt: skip
    displaced = (weight_mass(vehicle) + added) / water.density
    if not vehicle.hull.parts:  # the hull gives way as before, whatever psi is counted from
        loss = hull_parts(vehicle)[0].volume * hull_parts(vehicle)[0].compressibility
        hull["psi"] = (loss - displaced * water.compressibility) * water.specific_weight
    warm = vehicle.model_copy(update={"hull": Hull.model_validate(hull)})
    # at pressure 0, where it does not matter what the hull's compression is
    trim = displaced - float(displaced_volume(warm, 0.0, water.temperature))
    changes: dict[str, object] = {"water": water, "trim_error": trim}
    if isinstance(vehicle.motion, PhysicalMotion) and added != 0.0:
        changes["motion"] = vehicle.motion.model_copy(
            update={"dry_mass": vehicle.motion.dry_mass + added}
        )
    return warm.model_copy(update=changes)


def _with_ballast(hull: Hull, volume: float) -> tuple[HullPart, ...]:
    """Return the parts with ballast among them; what is taken away is taken from the first.

    Ballast is stiff: the first part then loses and gains as much volume as before.
    """
    if volume > 0.0:
        return (*hull.parts, HullPart(name="added ballast", volume=volume, compressibility=0.0))
    first = hull.parts[0]
    left = first.volume + volume
    if left <= 0.0:
        raise NoAnswerError(
            f"{rounded(-1e3 * volume, 3)} L of ballast would have to be taken away, more than "
            f"{first.name} displaces: check the mass and the water of the cast"
        )
    changes = {
        "volume": left,
        "compressibility": first.compressibility * first.volume / left,
        "thermal_expansion": first.thermal_expansion * first.volume / left,
        "stiffening": first.stiffening * first.volume / left,
    }
    return (first.model_copy(update=changes), *hull.parts[1:])


def _check(
    vehicle: Vehicle, columns: Sequence[Column], target: Target, probability: float, speed: float,
    density: float,
) -> None:  # fmt: skip
    """Raise InputError for what cannot be asked."""
    deepest = columns[0].deepest

    def refuse(what: str, field: str, value: float, unit: str, remedy: str) -> None:
        raise InputError(what, field=field, value=value, unit=unit, remedy=remedy)

    if not 0.5 <= probability < 1.0:
        refuse("a probability from 50 % to below 100 % is asked for", "probability",
               probability, "", "Write it like 95 %")  # fmt: skip
    if not 0.0 <= speed <= 2.0:
        refuse("no speed of a vehicle that moves by its volume", "speed", speed, "m/s",
               "Give what it has to sink and rise with, 0 or more")  # fmt: skip
    if density <= float(columns[0].density[-1]):
        refuse("ballast that is not denser than the water does nothing", "material", density,
               "kg/m3", "Give the density of what you add, lead is 11340 kg/m3")  # fmt: skip
    if target.neutral_depth is not None and not 0.0 <= target.neutral_depth <= deepest:
        refuse(f"the depth is not between the surface and {deepest:g} m, where the water "
               "ends", "neutral_depth", target.neutral_depth, "m",
               "Give a depth in the water, or water as deep")  # fmt: skip
    if target.freeboard is not None and not 0.0 <= target.freeboard <= vehicle.hull.height:
        refuse(f"no more than the height of the hull, {vehicle.hull.height:g} m, can be out of "
               "the water", "freeboard", target.freeboard, "m",
               "Check the number and its unit")  # fmt: skip
    if target.volume != 0.0 and target.neutral_depth is None:
        refuse("a volume to be neutral with needs the depth", "volume", target.volume, "m3",
               "Give the neutral depth too, or leave the volume out")  # fmt: skip
    stroke = vehicle.stroke
    if not stroke.minimum <= target.volume <= stroke.maximum:
        refuse("outside the stroke", "volume", target.volume, "m3",
               "Volumes count from mid-stroke")  # fmt: skip


def _added(vehicle: Vehicle, column: Column, target: Target, density: float) -> float:
    """Return the mass to add for a target [kg]: m/rho - V(p, T) is to be the volume wished for."""
    if target.neutral_depth is None and target.freeboard is None:
        return 0.0
    neutral = neutral_volume(vehicle, column)
    at = target.neutral_depth or 0.0
    volume = target.volume
    if target.neutral_depth is None and target.freeboard is not None:
        volume = vehicle.stroke.maximum - target.freeboard * vehicle.hull.waterplane_area
    now = float(np.interp(at, column.depth, neutral))
    rho = float(np.interp(at, column.depth, column.density))
    added = (volume - now) / (1.0 / rho - 1.0 / density)
    if added < -0.5 * weight_mass(vehicle):
        raise NoAnswerError(
            f"{rounded(-added, 3)} kg would have to be taken away, more than half of the vehicle: "
            "check its volume, its mass and the water of the cast"
        )
    return added


def _thinned(column: Column, vehicle: Vehicle) -> Column:
    """Return the column at `_POINTS` depths, and those where the vehicle's extremes are."""
    n = len(column.depth)
    neutral = neutral_volume(vehicle, column)
    rows = np.unique(
        np.concatenate(
            [
                np.linspace(0, n - 1, min(n, _POINTS)).astype(int),
                [int(np.argmin(neutral)), int(np.argmax(neutral))],
            ]
        )
    )
    return Column(
        depth=column.depth[rows], pressure=column.pressure[rows], density=column.density[rows],
        temperature=column.temperature[rows], gravity=column.gravity,
        compressibility=column.compressibility, source=column.source,
    )  # fmt: skip


def _need(
    vehicle: Vehicle, column: Column, nominal: Array, drawn: Array, push: list[Array],
    target: Target, probability: float,
) -> Need:  # fmt: skip
    """Return what the stroke has to cover in one column, and how likely it does.

    push: what drives it down and up [m3] [n].
    """
    stroke = vehicle.stroke
    out = target.asked_freeboard * vehicle.hull.waterplane_area
    down, up = push
    sink, rise = nominal - down, nominal + up
    rise[0] = max(rise[0], nominal[0] + out)
    least, most = int(np.argmin(sink)), int(np.argmax(rise))
    highest = np.maximum((drawn + up).max(axis=1), drawn[:, 0] + out)
    inward = (drawn - down).min(axis=1) - stroke.minimum
    outward = stroke.maximum - highest
    return Need(
        source=column.source, least=float(sink[least]), least_depth=float(column.depth[least]),
        most=float(rise[most]), most_depth=float(column.depth[most]),
        probability=float(np.mean((inward >= 0.0) & (outward >= 0.0))),
        margin_in=float(np.quantile(inward, 1.0 - probability)),
        margin_out=float(np.quantile(outward, 1.0 - probability)),
        out_for="freeboard" if most == 0 and out > up[0] else "rise",
    )  # fmt: skip
