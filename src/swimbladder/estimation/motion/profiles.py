"""Profile likelihoods: one parameter held, all others fitted again."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from swimbladder.estimation.estimates import Z95
from swimbladder.estimation.motion.fit import Fit, inverse_of
from swimbladder.estimation.motion.model import NAMES
from swimbladder.estimation.motion.problem import Problem
from swimbladder.estimation.motion.result import Profile

Array = NDArray[np.float64]

_AT = (0.7, 1.4, 2.1, 2.8)  # standard deviations to either side
_EVALUATIONS = 30  # more than ever needed but on long records of an unstable motion
_FURTHER = (4.0, 6.0, 9.0)  # where the interval has not ended by then


def profile(problem: Problem, fit: Fit, i: int) -> Profile:
    """Return the profile of the i-th parameter of the vehicle.

    The weights and the noise stay those of the fit. The deviance is scaled by how much wider
    autocorrelated residuals make the interval (the vertical adjustment of Chandler and Bate 2007).
    """
    spread = math.sqrt(fit.covariance[i, i])
    plain = inverse_of(fit.information)[:, i]
    naive = max(float(plain[i]), 1e-300)
    ratio = naive / spread**2
    others = np.delete(np.arange(len(fit.x)), i)
    low, high = problem.bounds()

    def held(u: float, start: Array) -> tuple[float, Array]:
        def full(y: Array) -> Array:
            x = np.empty(len(fit.x))
            x[i], x[others] = u, y
            return x

        def rows(y: Array) -> Array:
            return problem.weighted(full(y), fit.root)

        def slopes(y: Array) -> Array:
            return -problem.weighted_slope(full(y), fit.root)[:, others]

        done = least_squares(
            rows, np.clip(start, low[others] + 1e-9, high[others] - 1e-9), slopes,
            bounds=(low[others], high[others]), xtol=1e-6, ftol=1e-6, gtol=1e-8,
            max_nfev=_EVALUATIONS,
        )  # fmt: skip
        return 2.0 * float(done.cost), done.x

    at_best, _ = held(fit.x[i], fit.x[others])
    entries, deviance = [fit.x[i]], [0.0]
    ridge = plain[others] / naive
    for side in (-1.0, 1.0):
        x, before = fit.x[others], fit.x[i]
        for k in (*_AT, *_FURTHER):
            u = fit.x[i] + side * k * spread
            if not low[i] < u < high[i] or (k in _FURTHER and deviance[-1] > 1.2 * Z95**2):
                break
            cost, x = held(u, x + ridge * (u - before))
            before = u
            entries.append(u)
            deviance.append(max(cost - at_best, 0.0) * ratio)
    order = np.argsort(entries)
    u, D = np.array(entries)[order], np.array(deviance)[order]
    ends = _interval(u, D, fit.x[i])
    name, (low_end, high_end) = problem.names[i], problem.values_of(i, ends).tolist()
    return Profile(name, NAMES[name].unit, problem.values_of(i, u), D, (low_end, high_end))


def _interval(u: Array, deviance: Array, best: float) -> Array:
    """Return where the signed root of the deviance passes -1.96 and 1.96; infinite if nowhere."""
    root = np.maximum.accumulate(np.sign(u - best) * np.sqrt(deviance)) + 1e-9 * np.arange(len(u))
    inverse = PchipInterpolator(root, u, extrapolate=False)
    low, high = (float(inverse(end)) for end in (-Z95, Z95))
    return np.array(
        [low if math.isfinite(low) else -np.inf, high if math.isfinite(high) else np.inf]
    )
