"""The vehicles that a law has to hold: a 95 % region of the parameters, and what else may change.

With an `[identified]` table the region is the ellipsoid of its covariance that holds 95 % of the
probability; without one K2 and T2 are taken to be known to 5 %. It is looked at in the middle, at
the ends of its axes and at points drawn from its boundary, each with the supply full and low.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from swimbladder.dynamics import Plant, plant
from swimbladder.parameters import Vehicle

__all__ = ["Region", "region"]

Array = NDArray[np.float64]

UNKNOWN = 0.05  # of K2 and T2, or of mass and drag, where nothing was identified
NEUTRAL = 2e-6  # m3, where nothing is known: either way
_DRAWN = 16  # points of the boundary beside the ends of the axes


class Region(NamedTuple):
    """Plants to look at, the first the nominal one, and in words what they are."""

    plants: tuple[Plant, ...]
    neutral: float  # m3, farthest that the neutral volume is from what is known
    words: tuple[str, ...]


def region(vehicle: Vehicle, *, level: float = 0.95, drawn: int = _DRAWN, seed: int = 1) -> Region:
    """Return the region of a vehicle's parameters that holds `level` of the probability."""
    known = vehicle.identified
    nominal = plant(vehicle)
    if known is None:
        names: Sequence[str] = ("K2", "T2")
        shares = _box(2, drawn, seed) * UNKNOWN
        points = [dict(zip(names, 1.0 + s, strict=True)) for s in shares]
        words = [f"K2 and T2 each within {100.0 * UNKNOWN:g} %, as nothing was identified"]
        psi: list[float] = [nominal.psi] * len(points)
        neutral = NEUTRAL
    else:
        names = known.names
        values, C = np.array(known.values), np.array(known.covariance)
        offsets = _ellipsoid(C, level, drawn, seed)
        found = values + offsets
        points = [
            {n: float(v / m) for n, v, m in zip(names, x, values, strict=True) if n != "psi"}
            for x in found
        ]
        psi = [float(x[names.index("psi")]) if "psi" in names else nominal.psi for x in found]
        words = [
            f"{', '.join(names)} within the {100.0 * level:g} % region of their covariance, from "
            f"{len(known.logs)} logs"
        ]
        neutral = max(NEUTRAL, 2.0 * known.neutral_std)
    words.append(f"neutral volume within {1e6 * neutral:.2g} cm3")
    plants = [_changed(nominal, p, psi=x) for p, x in zip(points, psi, strict=True)]
    return Region((nominal, *plants), neutral, tuple(words))


def _box(n: int, drawn: int, seed: int) -> Array:
    """Return the corners of a cube of half side 1, the middles of its faces and points within."""
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * n), axis=-1).reshape(-1, n)
    faces = np.concatenate([np.eye(n), -np.eye(n)])
    inside = np.random.default_rng(seed).uniform(-1.0, 1.0, (drawn, n))
    return np.concatenate([corners, faces, inside])


def _ellipsoid(C: Array, level: float, drawn: int, seed: int) -> Array:
    """Return the ends of the axes of the ellipsoid and points of its boundary."""
    n = len(C)
    size = np.sqrt(np.maximum(np.diag(C), 1e-300))
    values, vectors = np.linalg.eigh(C / np.outer(size, size))
    root = vectors * np.sqrt(np.maximum(values, 0.0)) * size[:, None]
    directions = np.random.default_rng(seed).normal(size=(drawn, n))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    sphere = np.concatenate([np.eye(n), -np.eye(n), directions])
    result: Array = math.sqrt(float(chi2.ppf(level, n))) * sphere @ root.T
    return result


def _changed(p: Plant, shares: Mapping[str, float], *, psi: float) -> Plant:
    """Return the plant with its identified numbers times their shares."""
    K2, T2, K1, T1 = (max(shares.get(name, 1.0), 0.05) for name in ("K2", "T2", "K1", "T1"))
    mass = shares.get("mass", T2 / K2)
    turbulent = max(shares.get("drag_quadratic", 1.0), 0.0)
    return p._replace(
        a_b=p.a_b / mass, a_s=p.a_s / mass, d_l=p.d_l / T2, d_b=p.d_b / T2,
        d_t=p.d_t * turbulent / mass, gain=p.gain * K1, T1=p.T1 * T1, psi=psi,
    )  # fmt: skip
