"""The vertical motion of a deep vehicle at steady speed, in what can be identified of it.

Drag and excess volume balance within seconds, and the dive takes hours, so that

    k_dt w|w| / (rho g) = E = M/rho - V_hull(p, T) - V          (steady speed w, positive down)
    V_hull = V_0 (1 - beta p + s p^2/2 + alpha (T - T_ref)) + V_air p_a/(p_a + p)
    V = V_start + d pumped - short - starts v_s - f bled - b bypassed - l (t - t_start)

with M, V_0, the nominal volumes and what starts fall `short` by from the vehicle's
file. All volumes could be larger by one factor and the speeds be the same, but for M/rho, whose
shape the water gives: the absolute size is told weakly, and something has to be known before: by
default the drag.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.hull import hull_parts, weight_mass
from swimbladder.identify.deep_dive import Pieces
from swimbladder.identify.estimates import Prior
from swimbladder.parameters import Vehicle
from swimbladder.parameters.schema import did_you_mean
from swimbladder.seawater.column import ATMOSPHERE

__all__ = [
    "DEEP",
    "DEFAULT",
    "Body",
    "DeepName",
    "body_of",
    "check_deep_names",
    "drag_volume",
    "excess",
    "hull_volume",
    "priors_of",
    "steady_speed",
]

Array = NDArray[np.float64]

_SMALL = 5e-8  # m3, whose steady speed is 2 mm/s for such a vehicle: less than the water moves


class DeepName(NamedTuple):
    """A quantity that can be identified from deep dives."""

    unit: str
    meaning: str
    relative: float  # standard deviation of its default prior, as a share of its mean
    absolute: float  # [unit], added to it


DEEP: Mapping[str, DeepName] = {
    "drag": DeepName("N s2/m2", "quadratic drag k_dt while sinking", 0.1, 0.0),
    "drag_up": DeepName("", "drag while rising, as a share of that while sinking", 0.0, 0.3),
    "compressibility": DeepName("1/Pa", "of the hull and all in it, at the surface", 0.5, 5e-11),
    "stiffening": DeepName("1/Pa2", "how that falls with pressure", 0.0, 1e-17),
    "thermal_expansion": DeepName("1/K", "of volume, with the logged temperature", 0.5, 5e-5),
    "trapped_air": DeepName("m3", "at the surface; Boyle", 0.5, 2e-5),
    "pump_delivery": DeepName("", "what the pump gives, as a share of its datasheet", 0.3, 0.0),
    "pump_slip": DeepName("1/Pa", "what that share loses per pressure", 0.0, 5e-9),
    "pump_start": DeepName(
        "m3", "what a start falls short by, beyond the vehicle's file", 0.0, 2e-6
    ),
    "valve": DeepName("", "what the valve lets in, as a share of its datasheet", 0.3, 0.0),
    "bypass": DeepName("", "what the bypass lets in, as a share of its datasheet", 0.3, 0.0),
    "creep": DeepName("m3/s", "volume lost with time: leaks, creep, cooling", 0.0, 3e-10),
}
DEFAULT = tuple(name for name in DEEP if name not in ("trapped_air", "pump_slip", "bypass"))


class Body(NamedTuple):
    """What of a vehicle is not identified."""

    mass: float  # kg, that the water has to carry
    volume: float  # m3, of the hull at the surface, without trapped air
    reference_temperature: float  # degC
    inertia: float  # kg, that is accelerated


def body_of(vehicle: Vehicle) -> Body:
    """Return a vehicle's mass and hull."""
    hull = vehicle.hull
    return Body(
        mass=weight_mass(vehicle), volume=hull.displaced_volume - hull.trapped_air,
        reference_temperature=hull.reference_temperature, inertia=vehicle.mass,
    )  # fmt: skip


def priors_of(vehicle: Vehicle, given: Mapping[str, Prior]) -> dict[str, Prior]:
    """Return what is known of each quantity: as given, else from the vehicle's file.

    Raises InputError where the vehicle has no quadratic drag and none is given.
    """
    check_deep_names(list(given), "--prior")
    parts = hull_parts(vehicle)
    volume = sum(part.volume for part in parts)
    mean = {
        "drag": vehicle.drag.k_dt,
        "drag_up": 1.0,
        "compressibility": sum(x.volume * x.compressibility for x in parts) / volume,
        "stiffening": 0.0,
        "thermal_expansion": sum(x.volume * x.thermal_expansion for x in parts) / volume,
        "trapped_air": vehicle.hull.trapped_air,
        "pump_delivery": 1.0,
        "pump_slip": 0.0,
        "pump_start": 0.0,
        "valve": 1.0,
        "bypass": 1.0,
        "creep": 0.0,
    }
    if not mean["drag"] > 0.0 and "drag" not in given:
        raise InputError(
            "deep dives tell of quadratic drag, and the vehicle has none to begin with",
            field="motion.drag.k_dt", remedy='Give --prior "drag=160 +- 30 N s2/m2", or k_dt',
        )  # fmt: skip
    return {
        name: given.get(name, Prior(mean[name], about.relative * abs(mean[name]) + about.absolute))
        for name, about in DEEP.items()
    }


def check_deep_names(names: Sequence[str], option: str) -> None:
    """Raise InputError for a name that deep dives do not tell of."""
    for name in names:
        if name not in DEEP:
            raise InputError(
                "there is no such parameter of deep dives", field=option, value=name,
                remedy=f"{did_you_mean(name, DEEP)}Choose from {', '.join(DEEP)}",
            )  # fmt: skip


def hull_volume(
    body: Body, values: Mapping[str, float], pressure: Array, temperature: Array
) -> Array:
    """Return what the hull displaces, trapped air included [m3]."""
    p = pressure
    solid = 1.0 - values["compressibility"] * p + 0.5 * values["stiffening"] * p * p
    solid = solid + values["thermal_expansion"] * (temperature - body.reference_temperature)
    return body.volume * solid + values["trapped_air"] * ATMOSPHERE / (ATMOSPHERE + p)


def excess(body: Body, values: Mapping[str, float], start: float | Array, pieces: Pieces) -> Array:
    """Return by how much volume the vehicle is too heavy [m3] [n], E.

    start: the drive's volume when the dive began [m3].
    """
    pumped = values["pump_delivery"] * pieces.pumped - values["pump_slip"] * pieces.slipped
    drive = start + pumped - pieces.short - values["pump_start"] * pieces.starts
    drive = drive - values["valve"] * pieces.bled - values["bypass"] * pieces.bypassed
    drive = drive - values["creep"] * pieces.elapsed
    return np.asarray(
        body.mass / pieces.density
        - hull_volume(body, values, pieces.pressure, pieces.temperature)
        - drive
    )


def steady_speed(
    values: Mapping[str, float], heavy: Array, density: Array, gravity: float
) -> Array:
    """Return the speed at which drag balances an excess volume [m/s] [n].

    Below `_SMALL` it falls off faster than the root, whose slope at rest is infinite.
    """
    k = values["drag"] * np.where(heavy >= 0.0, 1.0, values["drag_up"])
    size = np.abs(heavy)
    return np.asarray(heavy * np.sqrt(density * gravity / (k * (size + _SMALL))))


def drag_volume(values: Mapping[str, float], speed: Array, density: Array, gravity: float) -> Array:
    """Return the volume that drag carries at a speed, k_dt w|w|/(rho g) [m3] [n]."""
    k = values["drag"] * np.where(speed >= 0.0, 1.0, values["drag_up"])
    return np.asarray(k * speed * np.abs(speed) / (density * gravity))
