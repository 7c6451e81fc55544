"""Residuals: their scale, outliers and autocorrelation.

Autocorrelation is corrected for what the fit has taken out of the residuals. A fit follows slow
noise: the residuals are smaller and whiter than the noise was, the more so the fewer samples there
are to a parameter. With e the noise, X the slopes and H = X C X' the fit's own share, the residual
is e - H e, and its mean autocovariance follows from that of e. What is lacking is added, and the
autoregression estimated again.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import matmul_toeplitz, solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

from swimbladder.estimation.series import autoregression as of_blocks
from swimbladder.physics.arrays import Array

# Weight 1 up to _KEPT standard deviations, none from _CUT on. For normal noise this costs
# 0.1 % of the information.
_KEPT, _CUT = 3.5, 6.0
_OUTLIER = 2.0 * math.log(1.0 / 0.01) - math.log(2.0 * math.pi)  # of a density of 0.01/m
_MOST_ORDER = 6
_AT_70 = 1.0364333894937898  # of the absolute value of a normal variable, its 70th percentile
# m; residuals are less only in a simulation without noise, and how the volume goes between two
# samples, which the log does not say, costs as much.
_SMALLEST = 1e-4


def weights(u: Array) -> Array:
    """Return the weight of residuals u, in standard deviations: 1, falling smoothly to 0."""
    beyond = np.clip((np.abs(u) - _KEPT) / (_CUT - _KEPT), 0.0, 1.0)
    return np.asarray((1.0 - beyond**2) ** 2)


def cost(residual: Array, noise: Array) -> Array:
    """Return minus twice the logarithm of each residual's density, up to a constant.

    Normal, or an outlier: one sample in a hundred, anywhere in a metre. An outlier costs the same
    whatever the noise, so that calling samples outliers does not pay by making the noise small.
    """
    return np.asarray(np.minimum((residual / noise) ** 2 + 2.0 * np.log(noise), _OUTLIER))


def scale(residual: Array, weight: Array, lost: float) -> float:
    """Return the standard deviation [m] of weighted residuals; `lost` parameters were fitted.

    Where the weights are all 1: the unbiased estimate.
    """
    count = max(float(weight.sum()) - lost, 1.0)
    return max(math.sqrt(float((weight * residual**2).sum()) / count), _SMALLEST)


def pooled(scales: Array, freedom: Array) -> Array:
    """Return the scales [m] of several residuals, drawn together as far as they may be one.

    freedom: samples less parameters fitted, of each. A scale from few samples is itself uncertain;
    as a weight it costs information that its interval does not show. So the logarithms are shrunk
    towards their mean by the share of their scatter that chance explains (the moment estimator of
    DerSimonian and Laird 1986).
    """
    if len(scales) < 2:
        return scales
    chance = 2.0 / np.maximum(freedom, 2.0)  # variance of the logarithm of a variance
    logs = 2.0 * np.log(scales) + 0.5 * chance
    weight = 1.0 / chance
    mean = float((weight * logs).sum() / weight.sum())
    beyond = float((weight * (logs - mean) ** 2).sum()) - (len(logs) - 1)
    real = max(beyond, 0.0) / float(weight.sum() - (weight**2).sum() / weight.sum())
    mean = float((logs / (chance + real)).sum() / (1.0 / (chance + real)).sum())
    return np.asarray(np.exp(0.5 * (mean + (logs - mean) * real / (chance + real))))


def robust_scale(residual: Array) -> float:
    """Return the standard deviation [m] of normal noise with as large a 70th percentile.

    Three tenths of the residuals may be anything.
    """
    return max(float(np.quantile(np.abs(residual), 0.7)) / _AT_70, _SMALLEST)


def white_part(residual: Array, weight: Array, noise: float) -> float:
    """Return the noise [m, 1 sigma] that neighbouring samples of a residual do not share.

    It is the sensor's: what a model lacks changes slowly. noise [m]: of the whole residual.
    """
    pairs = weight[1:] * weight[:-1]
    square = float((pairs * np.diff(residual) ** 2).sum()) / max(2.0 * float(pairs.sum()), 1.0)
    return min(max(math.sqrt(square), _SMALLEST), noise)


def autoregression(residual: Array) -> tuple[float, ...]:
    """Return the coefficients of the autoregression that describes the residual, none if white."""
    return of_blocks([residual], highest=_MOST_ORDER, samples=10).coefficients


def yule_walker(r: Array) -> tuple[Array, float]:
    """Return the autoregression of autocovariances r, its coefficients and its innovations' power.

    As many coefficients as there are lags; the power is not above 0 where there is no such one.
    """
    a: Array = solve_toeplitz(r[:-1], r[1:])
    return a, float(r[0] - a @ r[1:])


def autocovariance(coefficients: tuple[float, ...], variance: float, n: int) -> Array:
    """Return the autocovariance [n] of an autoregression whose variance is given."""
    if not coefficients:
        return np.asarray(variance * np.eye(1, n)[0])
    impulse = np.eye(1, max(n, 4096))[0]
    response = lfilter([1.0], [1.0, *(-c for c in coefficients)], impulse)
    size = 2 * len(response)
    gamma = np.fft.irfft(np.abs(np.fft.rfft(response, size)) ** 2)[:n]
    return np.asarray(variance * gamma / gamma[0])


def whiteness(residual: Array) -> float:
    """Return the probability of a residual at least as coloured if it were white (Ljung-Box)."""
    n = len(residual)
    lags = max(1, min(20, n // 5))
    power = float(residual @ residual)
    if power == 0.0 or n < 8:
        return 1.0
    r = np.array([residual[: n - k] @ residual[k:] for k in range(1, lags + 1)]) / power
    Q = n * (n + 2.0) * float((r**2 / (n - np.arange(1, lags + 1))).sum())
    return float(chi2.sf(Q, lags))


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
    """
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
    mean = (n - np.arange(order + 1)) * gamma[: order + 1]
    for k in range(order + 1):
        first, later = slice(n - k), slice(k, None)
        mean[k] -= np.sum(XC[first] * GX[later]) + np.sum(XC[later] * GX[first])
        mean[k] += np.sum(XV[first] * X[later])
    wanted = seen + gamma[: order + 1] - mean / n
    if not np.isfinite(wanted).all():  # slopes beyond all bounds: nothing can be mended
        return c
    a, left = yule_walker(wanted)
    roots = np.abs(np.roots([1.0, *(-a)]))
    if left <= 0.0 or not math.isfinite(left) or roots.max() > _NEAR:
        return c
    return ArNoise(tuple(a.tolist()), float(wanted[0]))
