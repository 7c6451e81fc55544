"""The joint fit on SciPy's integrators, as it is written today: least squares or Nelder-Mead.

The same model, records, priors and unknowns as the package's fit: what the vehicle has in common,
and of each experiment its neutral volume, depth and speed at the start. Nothing is known of the
derivatives, and the noise is given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import least_squares, minimize

__all__ = ["INTEGRATORS", "Answer", "Flight", "Task", "descend", "profile", "solve"]

Array = NDArray[np.float64]

TOLERANCE = 1e-8  # of the integrators: depths to 1e-6 m or better
STEP = 1e-4  # of an unknown, for its derivative
SCALE = np.array([1e-6, 1e-2, 1e-2])  # m3, m, m/s: of what belongs to an experiment


@dataclass(frozen=True)
class Flight:
    """A record: time [s], measured depth [m], volume above that of the rest [m3]."""

    time: Array
    depth: Array
    volume: Array


@dataclass(frozen=True)
class Task:
    """Records, priors, the noise of a depth, and where a fit starts: log K2, log T2, psi."""

    flights: tuple[Flight, ...]
    psi_mean: float  # m3/m
    psi_std: float
    neutral_std: float  # m3
    noise: float  # m
    start: tuple[float, float, float]

    def begin(self) -> Array:
        """Return the unknowns at the start; psi in units of its prior's mean."""
        K2, T2, psi = self.start
        shared = [np.log(K2), np.log(T2), psi / self.psi_mean]
        each = [[0.0, f.depth[0] / SCALE[1], 0.0] for f in self.flights]
        return np.concatenate([shared, *each])

    def residual(self, x: Array, depths: Depths) -> Array:
        """Return everything whose squares are to be least, in standard deviations."""
        K2, T2, psi = np.exp(x[0]), np.exp(x[1]), x[2] * self.psi_mean
        parts = []
        for j, f in enumerate(self.flights):
            neutral, depth, speed = x[3 + 3 * j : 6 + 3 * j] * SCALE
            found = depths(f, K2, T2, psi, neutral, depth, speed)
            parts.append((f.depth - found) / self.noise)
        parts.append(x[3::3] * SCALE[0] / self.neutral_std)
        parts.append(np.array([(psi - self.psi_mean) / self.psi_std]))
        return np.concatenate(parts)


@dataclass(frozen=True)
class Answer:
    """Where a fit ended: K2, T2, psi, their deviations in that order, and the cost there."""

    x: Array
    deviation: Array  # nan where the method gives none
    cost: float  # sum of squares
    evaluations: int


Depths = Callable[[Flight, float, float, float, float, float, float], Array]


def _rates(
    f: Flight, K2: float, T2: float, psi: float, neutral: float
) -> Callable[[float, Array], list[float]]:
    time, volume, reference = f.time, f.volume, float(f.depth[0])

    def rates(t: float, y: Array) -> list[float]:
        z, w = y
        against = psi * (z - reference) + neutral - np.interp(t, time, volume)
        return [w, (K2 * against - w) / T2]

    return rates


def by_odeint(
    f: Flight, K2: float, T2: float, psi: float, neutral: float, depth: float, speed: float
) -> Array:
    """Return the depths at the samples by odeint."""
    rates = _rates(f, K2, T2, psi, neutral)
    found: Array = odeint(
        rates, [depth, speed], f.time, tfirst=True, rtol=TOLERANCE, atol=TOLERANCE, hmax=1.0
    )
    return found[:, 0]


def by_solve_ivp(
    f: Flight, K2: float, T2: float, psi: float, neutral: float, depth: float, speed: float
) -> Array:
    """Return the depths at the samples by solve_ivp."""
    rates = _rates(f, K2, T2, psi, neutral)
    span = (float(f.time[0]), float(f.time[-1]))
    found = solve_ivp(
        rates,
        span,
        [depth, speed],
        method="DOP853",
        t_eval=f.time,
        rtol=TOLERANCE,
        atol=TOLERANCE,
        max_step=1.0,
    )
    result: Array = found.y[0]
    return result


INTEGRATORS: dict[str, Depths] = {"odeint": by_odeint, "solve_ivp DOP853": by_solve_ivp}


def solve(
    task: Task,
    depths: Depths,
    *,
    start: Array | None = None,
    held: float | None = None,
    most: int | None = None,
) -> Answer:
    """Return the fit by least_squares on finite differences; with log K2 held where it is given.

    most: evaluations of the residuals, those for derivatives not counted.
    """
    x = task.begin() if start is None else start

    def rows(y: Array) -> Array:
        return task.residual(y if held is None else np.concatenate([[held], y]), depths)

    def slopes(y: Array) -> Array:
        # SciPy's own steps are of 1e-8: below the integrator's error, the fit then gets stuck.
        here, steps = rows(y), STEP * np.eye(len(y))
        return np.stack([(rows(y + h) - here) / STEP for h in steps], axis=1)

    begin = x if held is None else x[1:]
    found = least_squares(rows, begin, slopes, x_scale="jac", xtol=1e-8, ftol=1e-8, max_nfev=most)
    end = found.x if held is None else np.concatenate([[held], found.x])
    information = found.jac.T @ found.jac
    deviation = np.sqrt(np.diag(np.linalg.inv(information)))[:3]
    each = 1 + len(found.x)  # a row of derivatives takes a run for every unknown
    return Answer(end, deviation, 2.0 * float(found.cost), int(found.njev) * each)


def profile(task: Task, depths: Depths, best: Answer, points: int) -> list[float]:
    """Return how the cost rises as K2 is held at points within 2.8 deviations: fit after fit."""
    rises = []
    for k in np.linspace(-2.8, 2.8, points):
        held = float(best.x[0] + k * best.deviation[0])
        rises.append(solve(task, depths, start=best.x, held=held).cost - best.cost)
    return rises


def descend(task: Task, depths: Depths, *, most: int) -> Answer:
    """Return where Nelder and Mead's simplex is after at most so many evaluations."""

    def cost(x: Array) -> float:
        return float(np.sum(task.residual(x, depths) ** 2))

    found = minimize(
        cost,
        task.begin(),
        method="Nelder-Mead",
        options={"maxfev": most, "maxiter": most, "xatol": 1e-6, "fatol": 1e-3, "adaptive": True},
    )
    return Answer(found.x, np.full(3, np.nan), float(found.fun), int(found.nfev))
