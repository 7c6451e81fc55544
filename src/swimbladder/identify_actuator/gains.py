"""How much the gains of blocks differ from one another by more than noise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swimbladder.identify_actuator.model import Problem

__all__ = ["gains", "slope"]

Array = NDArray[np.float64]

_DIFFER = 2.71  # deviance that differing gains have to gain: 5 % by chance


def slope(problem: Problem, q: Array) -> Array:
    """Return the derivative of the whitened residuals [n, p], by central differences."""
    columns = []
    for k in range(len(q)):
        h = np.zeros(len(q))
        h[k] = 1e-5
        columns.append((problem.white(q + h) - problem.white(q - h)) / 2e-5)
    return np.stack(columns, axis=1)


def gains(problem: Problem, q: Array) -> tuple[float, float, float]:
    """Return how much the gains of blocks differ (a share), sigma [m], and degrees of freedom.

    By restricted maximum likelihood of the problem made linear at q: the variance along each
    block's own gain is 1 + (spread size/sigma)^2 times that of the noise.
    """
    from scipy.optimize import minimize_scalar

    J, r, whiten = slope(problem, q), problem.white(q), problem.whiten
    assert whiten is not None
    size, a = whiten.size, whiten.along(whiten.gain, r)
    A = np.stack([whiten.along(whiten.gain, column) for column in J.T], axis=1)
    p, count = len(q), len(size)
    gain_like = sum(
        name in ("K1", "asymmetry", "dead_zone", "load_voltage") for name in problem.free
    )
    free = int((size > 0.0).sum()) - gain_like
    JJ, Jr, rr = J.T @ J, J.T @ r, float(r @ r)
    lost = max(len(r) - p - count, 1)
    plain = math.sqrt(rr / lost)
    if free < 1 or rr <= 0.0:
        return 0.0, plain, math.inf

    def parts(ratio: float) -> tuple[float, float, Array]:
        less = 1.0 - 1.0 / (1.0 + (ratio * size) ** 2)
        H = JJ - (A.T * less) @ A + 1e-10 * np.trace(JJ) / p * np.eye(p)
        b = Jr - A.T @ (less * a)
        left = rr - float(less @ a**2) - float(b @ np.linalg.solve(H, b))
        return max(left, 1e-300), float(-np.log1p(-less).sum()), H

    def score(log_ratio: float) -> float:
        left, spread_out, H = parts(math.exp(log_ratio))
        return lost * math.log(left) + spread_out + float(np.linalg.slogdet(H)[1])

    typical = float(np.median(size[size > 0.0]))
    low, high = math.log(1e-3 / typical), math.log(1e4 / typical)
    grid = np.linspace(low, high, 30)
    scores = [score(x) for x in grid.tolist()]
    k = int(np.argmin(scores))
    found = minimize_scalar(
        score, bounds=(grid[max(k - 1, 0)], grid[min(k + 1, 29)]), method="bounded"
    )
    if found.fun > score(low) - _DIFFER:
        return 0.0, plain, math.inf
    ratio = math.exp(float(found.x))
    left, _, H = parts(ratio)
    sigma = math.sqrt(left / lost)
    first = problem.free.index("K1") if "K1" in problem.free else 0
    alone = np.linalg.pinv(JJ)[first, first]
    share = 1.0 - min(alone / max(np.linalg.pinv(H)[first, first], 1e-300), 1.0)
    return ratio * sigma, sigma, free / share**2 if share > 1e-6 else math.inf
