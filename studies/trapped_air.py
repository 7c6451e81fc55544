"""Does a float lose volume with depth as eq. (31) says, psi z, or as a hull with trapped air does?

``python -m studies.trapped_air FOLDER`` prints a table for the nine resting points of a SeaBot
float (FOLDER holds seabot_psi), 1 m to 18 m and back. A float that rests at depth z has as much
volume out as its hull has lost there, so the piston tells of the hull::

    V(z) = c + psi z                                     eq. (31)
    V(z) = c + psi z + V_air (1 - p_a/(p_a + rho g z))   with air, Boyle
    V(z) = c + psi z + b z^2                             as bent as that, without a physical law

each also with a term that grows with the order of the points (air that dissolves, a leak). All are
linear in their unknowns; with normal errors of one unknown size the F test and the intervals by
profile likelihood are exact for nine points, and a likelihood ratio alone would not be.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from swimbladder.physics.hull import displaced_volume
from swimbladder.vehicle import (
    Hull,
    IdentifiedActuator,
    IdentifiedMotion,
    Stroke,
    Supply,
    Vehicle,
    Water,
)

__all__ = ["MODELS", "Fit", "Points", "better_by", "fit", "read_points"]

Array = NDArray[np.float64]
WATER = Water(density=1000.0)  # the place is not on record; sea water changes V_air by 2 %

MODELS = {
    "psi z": ("psi",),
    "psi z and air": ("psi", "air"),
    "psi z and b z2": ("psi", "bend"),
    "psi z, drift": ("psi", "drift"),
    "psi z and air, drift": ("psi", "air", "drift"),
    "psi z and b z2, drift": ("psi", "bend", "drift"),
}
"""Terms of each model, beside a constant."""


class Points(NamedTuple):
    """Resting points in the order of measurement."""

    depth: Array  # m
    volume: Array  # m3 displaced by the piston, zero arbitrary


class Fit(NamedTuple):
    """A model fitted to resting points; numbers in SI, by the name of the term."""

    model: str
    values: dict[str, float]
    ci95: dict[str, tuple[float, float]]
    rms: float  # m3, of the residuals
    rss: float  # m6
    free: int  # points less unknowns
    log_likelihood: float
    aicc: float


def read_points(folder: Path) -> Points:
    """Return the resting points of the file in `folder`/seabot_psi."""
    path = folder / "seabot_psi" / "piston_compressibility_law.csv"
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    retracted = np.array([float(row["piston_volume_retracted_cm3_rel"]) for row in rows])
    return Points(np.array([float(row["depth_m"]) for row in rows]), -1e-6 * retracted)


def _float_with_air() -> Vehicle:
    """Return a vehicle of which 1 L is air and the rest gives way as the water does."""
    hull = Hull(displaced_volume=0.1, psi=0.0, waterplane_area=0.01, height=0.5, trapped_air=1e-3)
    return Vehicle(
        name="air",
        water=WATER,
        hull=hull,
        stroke=Stroke(minimum=-1e-3, maximum=1e-3),
        actuator=IdentifiedActuator(K1=1e-3, T1=0.1, piston_area=2e-3),
        supply=Supply(voltage=12.0),
        motion=IdentifiedMotion(K2=8000.0, T2=30.0),
    )


def lost_share(depth: Array) -> Array:
    """Return the share that trapped air loses of its volume at depths [m], by `hull`."""
    vehicle = _float_with_air()
    p = WATER.specific_weight * depth
    T = np.full_like(depth, vehicle.hull.reference_temperature)
    both = displaced_volume(vehicle, 0.0, T) - displaced_volume(vehicle, p, T)
    # what gives way as the water does is no part of psi
    return (both - 0.1 * WATER.compressibility * p) / vehicle.hull.trapped_air


def fit(points: Points, model: str) -> Fit:
    """Return the least squares of a model, with exact intervals."""
    terms = ("constant", *MODELS[model])
    depth, n = points.depth, len(points.depth)
    columns = {
        "constant": np.ones(n),
        "psi": depth,
        "air": lost_share(depth),
        "bend": depth**2,
        "drift": np.arange(float(n)),
    }
    X = np.stack([columns[term] for term in terms], axis=1)
    values, _, rank, _ = np.linalg.lstsq(X, points.volume, rcond=None)
    assert rank == len(terms)
    residuals = points.volume - X @ values
    rss, free = float(residuals @ residuals), n - len(terms)
    half = stats.t.ppf(0.975, free) * np.sqrt(rss / free * np.diag(np.linalg.inv(X.T @ X)))
    k = len(terms) + 1  # the size of the errors is an unknown too
    likelihood = -0.5 * n * (math.log(2.0 * math.pi * rss / n) + 1.0)
    return Fit(
        model=model,
        values=dict(zip(terms, map(float, values), strict=True)),
        ci95={
            term: (float(v - h), float(v + h))
            for term, v, h in zip(terms, values, half, strict=True)
        },
        rms=math.sqrt(rss / n),
        rss=rss,
        free=free,
        log_likelihood=likelihood,
        aicc=2.0 * k - 2.0 * likelihood + 2.0 * k * (k + 1) / (n - k - 1),
    )


def better_by(small: Fit, large: Fit) -> tuple[float, float]:
    """Return twice the log likelihood ratio of a model and one with a term more, and the p value.

    The p value is that of the F test, exact for few points.
    """
    ratio = 2.0 * (large.log_likelihood - small.log_likelihood)
    more = small.free - large.free
    F = (small.rss - large.rss) / more / (large.rss / large.free)
    return ratio, float(stats.f.sf(F, more, large.free))


def table(points: Points) -> Iterable[str]:
    """Yield the lines of a table of all models."""
    fits = {model: fit(points, model) for model in MODELS}
    best = min(f.aicc for f in fits.values())
    yield (
        f"{'model':22s} {'psi [cm3/m]':>22s} {'air [cm3]':>20s} {'drift [cm3/point]':>22s} "
        f"{'rms':>5s} {'AICc':>6s}"
    )
    for f in fits.values():
        yield (
            f"{f.model:22s} {_told(f, 'psi'):>22s} {_told(f, 'air'):>20s} "
            f"{_told(f, 'drift'):>22s} "
            f"{1e6 * f.rms:5.2f} {f.aicc - best:6.1f}"
        )
    for drift in ("", ", drift"):
        ratio, p = better_by(fits[f"psi z{drift}"], fits[f"psi z and air{drift}"])
        yield f"air or none{drift}: 2 log likelihood ratio {ratio:.1f}, F test p = {p:.1e}"


def _told(f: Fit, term: str) -> str:
    if term not in f.values:
        return ""
    low, high = f.ci95[term]
    return f"{1e6 * f.values[term]:.3g} ({1e6 * low:.3g} to {1e6 * high:.3g})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    for line in table(read_points(parser.parse_args().folder)):
        print(line)


if __name__ == "__main__":
    main()
