"""How much alike neighbouring residuals are, mended for what the fit has taken out of them.

A fit follows slow noise: the residuals are smaller and whiter than the noise was, the more so
the fewer samples there are to a parameter. With e the noise, X the slopes and H = X C X' the fit's
own share, the residual is e - H e, and its mean autocovariance follows from that of e. What is
lacking is added, and the autoregression estimated again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matmul_toeplitz

from swimbladder.estimation.motion.noise import autocovariance, yule_walker

Array = NDArray[np.float64]

_ROUNDS = 4  # of the correction: more change an interval by less than a hundredth
_NEAR = 0.995  # largest root of an autoregression, beyond which it is as good as a random walk


class ArNoise(NamedTuple):
    """An autoregression: its coefficients and its variance, in squares of the noise."""

    coefficients: tuple[float, ...]
    variance: float


def ar_noises(
    slopes: Sequence[Array],
    residuals: Sequence[Array],
    seen_as: Sequence[tuple[float, ...]],
    inverse: Array,
    prior: Array,
) -> tuple[ArNoise, ...]:
    """Return the autoregression of each experiment's noise.

    slopes: [n, p] and residuals: [n] of each, weighted, in standard deviations of the noise;
    seen_as: the autoregression of each residual, none where it passes for white, and is left so;
    inverse [p, p]: of all information as if the noise were white; prior [p, p]: what of it is known
    before.
    """  # fmt: skip
    first = [ArNoise(coefficients, 1.0) for coefficients in seen_as]
    seen = [_autocovariances(u, len(c.coefficients)) for u, c in zip(residuals, first, strict=True)]
    found = first
    for _ in range(_ROUNDS if any(c.coefficients for c in first) else 0):
        covariance = inverse @ (information(slopes, found) + prior) @ inverse
        found = [
            _mended(X, r, c, inverse, covariance) if c.coefficients else c
            for X, r, c in zip(slopes, seen, found, strict=True)
        ]
    return tuple(found)


def information(slopes: Sequence[Array], found: Sequence[ArNoise]) -> Array:
    """Return the sum of X' G X, with G the covariance of each experiment's noise."""
    total: Array = np.zeros((slopes[0].shape[1],) * 2)
    for X, c in zip(slopes, found, strict=True):
        total = total + X.T @ (_spread(c, X) if c.coefficients else X)
    return total


def _spread(c: ArNoise, X: Array) -> Array:
    gamma = autocovariance(c.coefficients, c.variance, len(X))
    return np.asarray(matmul_toeplitz(gamma, X), np.float64)


def _autocovariances(u: Array, most: int) -> Array:
    return np.array([u[: len(u) - k] @ u[k:] for k in range(most + 1)]) / len(u)


def _mended(X: Array, seen: Array, c: ArNoise, inverse: Array, covariance: Array) -> ArNoise:
    """Return the colour whose residual would look as it does, one step nearer."""
    n, order = len(X), len(c.coefficients)
    gamma = autocovariance(c.coefficients, c.variance, n)
    GX, XC, XV = _spread(c, X), X @ inverse, X @ covariance
    mean = np.array(
        [
            (n - k) * gamma[k]
            - np.sum(XC[: n - k] * GX[k:])
            - np.sum(XC[k:] * GX[: n - k])
            + np.sum(XV[: n - k] * X[k:])
            for k in range(order + 1)
        ]
    )
    wanted = seen + gamma[: order + 1] - mean / n
    if not np.isfinite(wanted).all():  # slopes beyond all bounds: nothing can be mended
        return c
    a, left = yule_walker(wanted)
    roots = np.abs(np.roots([1.0, *(-a)]))
    if left <= 0.0 or not math.isfinite(left) or roots.max() > _NEAR:
        return c
    return ArNoise(tuple(a.tolist()), float(wanted[0]))
