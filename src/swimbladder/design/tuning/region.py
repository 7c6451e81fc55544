"""The vehicles that a law has to hold: a 95 % region of the parameters, and what else may change.

With an `[identified]` table the region is the ellipsoid of its covariance that holds 95 % of the
probability; without one K2 and T2 are taken to be known to 5 %. Of a pump and valve drag, psi and
both rates are uncertain, by what was identified or by the spread that `campaign` draws floats from.
It is looked at in the middle, at the ends of its axes and at points drawn from its boundary, each
with the supply full and low.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from swimbladder.design.linear.pump_valve import moved_by_volume, with_drag
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.spread import INPUTS, Spread

UNKNOWN = 0.05  # of K2 and T2, or of mass and drag, where nothing was identified
NEUTRAL = 2e-6  # m3, where nothing is known: either way
RANDOM_WALK = 1e-6 / 60.0  # m3/s^0.5, likewise: 1 cm3 per root hour
FLOATS = ("drag", "psi", "pump", "valve")
"""What is uncertain of a pump and valve: factors, psi in m3/m."""

_DIVES = "logs of more dives, at other speeds, and `identify --cast` on all of them, narrow it"
_NARROWED = {
    "drag": _DIVES,
    "mass": _DIVES,
    "pump": "logged runs at other depths, and `energy --fit` or `identify --cast`, narrow it",
}
_DRAWN = 16  # points of the boundary beside the ends of the axes
_LEVEL = 0.95  # of the probability that the ellipsoid holds


class Region(NamedTuple):
    """Plants to look at, the first the nominal one, and in words what they are."""

    plants: tuple[Plant, ...]
    neutral: float  # m3, farthest that the neutral volume is from what is known
    random_walk: float  # m3/s^0.5, intensity of its random walk
    words: tuple[str, ...]
    drives: tuple[tuple[float, float], ...] = ()  # of pumps and valves: what each gives of its rate

    def knowing(self, fields: Collection[str]) -> Region:
        """Return the region where these fields of `Plant` are those of the nominal vehicle."""
        known = {name: getattr(self.plants[0], name) for name in fields}
        return self._replace(plants=tuple(p._replace(**known) for p in self.plants))


class Member(NamedTuple):
    """A vehicle of the region: its plant, and its uncertain numbers over their nominal values."""

    plant: Plant
    shares: Mapping[str, float]  # -, of what was identified
    drive: tuple[float, float] = (1.0, 1.0)  # -, rates of pump and valve over what is known


def unknowns(vehicle: Vehicle) -> tuple[tuple[str, ...], bool]:
    """Return what is uncertain of a vehicle, and whether its region is an ellipsoid, not a box."""
    if vehicle.command == "volume change":
        return FLOATS, True
    if vehicle.identified is None:
        return ("K2", "T2"), False
    return tuple(vehicle.identified.names), True


def neutral_random_walk(vehicle: Vehicle) -> float:
    """Return the intensity [m3/s^0.5] of the random walk that a neutral volume is assumed to do."""
    if vehicle.command == "volume change":
        return 0.0  # what a float's volume loses is leakage and creep, and flown as such
    return (
        RANDOM_WALK
        if vehicle.identified is None
        else max(RANDOM_WALK, vehicle.identified.random_walk)
    )


def member(vehicle: Vehicle, s: Array) -> Member:
    """Return the vehicle at s [unknowns]; the unit ball, of a box the unit cube, is the region."""
    names, _ = unknowns(vehicle)
    nominal, known = plant(moved_by_volume(vehicle)), vehicle.identified
    if names == FLOATS:
        return _float(vehicle, nominal, s)
    if known is None:
        shares = {n: 1.0 + UNKNOWN * float(x) for n, x in zip(names, s, strict=True)}
        return Member(_changed(nominal, shares, psi=nominal.psi), shares)
    values, C = np.array(known.values), np.array(known.covariance)
    found = values + _radius(C) @ s
    psi = float(found[names.index("psi")]) if "psi" in names else nominal.psi
    numbers = zip(names, found, values, strict=True)
    shares = {n: float(v / m) if m else math.nan for n, v, m in numbers}
    return Member(_changed(nominal, shares, psi=psi), shares)


def unit_points(vehicle: Vehicle, *, drawn: int = _DRAWN) -> Array:
    """Return where the region is looked at [points, unknowns], in the unit ball or cube."""
    names, ball = unknowns(vehicle)
    return (_sphere if ball else _box)(len(names), drawn)


def with_middle(vehicle: Vehicle) -> Array:
    """Return the middle of the region, then where else it is looked at."""
    points = unit_points(vehicle)
    return np.concatenate([np.zeros_like(points[:1]), points])


def region(vehicle: Vehicle, *, drawn: int = _DRAWN) -> Region:
    """Return the region of a vehicle's parameters that holds 95 % of the probability."""
    known = vehicle.identified
    names, _ = unknowns(vehicle)
    if names == FLOATS:
        spread = _spread(vehicle)
        words = [
            f"{', '.join(names)} within their {100.0 * _LEVEL:g} % region, "
            + ("as identified" if known else "by the usual spread of floats")
            + f": 1 sigma {100.0 * spread.drag:.2g} %, {1e6 * spread.psi:.2g} cm3/m, "
            f"{100.0 * spread.pump:.2g} %, {100.0 * spread.pump:.2g} %"
        ]
        neutral = 2.0 * spread.trim
    elif known is None:
        words = [f"K2 and T2 each within {100.0 * UNKNOWN:g} %, as nothing was identified"]
        neutral = NEUTRAL
    else:
        words = [
            f"{', '.join(names)} within the {100.0 * _LEVEL:g} % region of their covariance, from "
            f"{len(known.logs)} logs"
        ]
        neutral = max(NEUTRAL, 2.0 * known.neutral_std)
    intensity = neutral_random_walk(vehicle)
    drift = f"{60e6 * intensity:.2g} cm3 in a root hour"
    moves = f", random walk {drift}" if intensity > 0.0 else ""
    words.append(f"neutral volume within {1e6 * neutral:.2g} cm3{moves}")
    found = [Member(plant(moved_by_volume(vehicle)), {})]
    found += [member(vehicle, s) for s in unit_points(vehicle, drawn=drawn)]
    drives = tuple(one.drive for one in found) if names == FLOATS else ()
    return Region(tuple(one.plant for one in found), neutral, intensity, tuple(words), drives)


def _spread(vehicle: Vehicle) -> Spread:
    """Return how floats differ; raises NoAnswerError where they differ more than is represented."""
    if vehicle.identified is None:
        return Spread()
    try:
        return Spread().identified(vehicle)
    except InputError as error:
        if error.field not in _NARROWED:
            raise
        raise NoAnswerError(
            f"no law of volume changes is tuned for this: {error.field} is identified to "
            f"{100.0 * float(str(error.value)):.3g} % (1 sigma), and floats that differ by more "
            f"than 30 % are not represented. What limits it is the region of {error.field}: "
            f"{_NARROWED[error.field]}"
        ) from None


def _float(vehicle: Vehicle, p: Plant, s: Array) -> Member:
    """Return a float at s [4], the unit ball being the region; its valve as uncertain as a pump."""
    spread = _spread(vehicle)
    sigma = np.array([spread.drag, spread.psi, spread.pump, spread.pump])
    order, together = [INPUTS.index(name) for name in ("drag", "psi", "pump")], np.eye(4)
    together[:3, :3] = spread.matrix[np.ix_(order, order)]
    axes = _radius(sigma[:, None] * together * sigma)
    drag, psi, pump, valve = np.array([1.0, p.psi, 1.0, 1.0]) + axes @ s
    drag, pump, valve = (max(float(x), 0.05) for x in (drag, pump, valve))
    ratio = float(psi / p.psi) if p.psi else math.nan
    shares = dict(zip(FLOATS, (drag, ratio, pump, valve), strict=True))
    return Member(with_drag(p, drag)._replace(psi=float(psi)), shares, (pump, valve))


def _box(n: int, drawn: int) -> Array:
    """Return the corners of a cube of half side 1, the middles of its faces and points within."""
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * n), axis=-1).reshape(-1, n)
    faces = np.concatenate([np.eye(n), -np.eye(n)])
    inside = np.random.default_rng(1).uniform(-1.0, 1.0, (drawn, n))
    return np.concatenate([corners, faces, inside])


def _sphere(n: int, drawn: int) -> Array:
    """Return the ends of the axes of the unit ball and points of its boundary."""
    directions = np.random.default_rng(1).normal(size=(drawn, n))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.concatenate([np.eye(n), -np.eye(n), directions])


def _radius(C: Array) -> Array:
    """Return what takes the unit ball to the ellipsoid of a covariance; its axes to the axes."""
    size = np.sqrt(np.maximum(np.diag(C), 1e-300))
    values, vectors = np.linalg.eigh(C / np.outer(size, size))
    root = vectors * np.sqrt(np.maximum(values, 0.0)) * size[:, None]
    return np.asarray(math.sqrt(float(chdtri(len(C), 1.0 - _LEVEL))) * root)


def _changed(p: Plant, shares: Mapping[str, float], *, psi: float) -> Plant:
    """Return the plant with its identified numbers times their shares."""
    K2, T2, K1, T1 = (max(shares.get(name, 1.0), 0.05) for name in ("K2", "T2", "K1", "T1"))
    mass = shares.get("mass", T2 / K2)
    turbulent = max(shares.get("drag_quadratic", 1.0), 0.0)
    return p._replace(
        a_b=p.a_b / mass,
        a_s=p.a_s / mass,
        d_l=p.d_l / T2,
        d_b=p.d_b / T2,
        d_t=p.d_t * turbulent / mass,
        gain=p.gain * K1,
        T1=p.T1 * T1,
        psi=psi,
    )
