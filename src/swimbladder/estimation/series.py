"""Series of samples: their stretches, their size, and how residuals resemble their past."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from swimbladder.physics.arrays import Array, Flags
from swimbladder.sim.engine.cache import compiled

Index = NDArray[np.int64]

_COME_BACK = 2  # times that each level of a coarse recorder is met, at least
_LEVELS, _SURELY = 4, 20  # levels that are enough, or so many changes between fewer
_OFF_GRID = 0.05  # of a step


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def huber(size: Array, gate: float) -> Array:
    """Return half the square of deviations, beyond a gate only in proportion (Huber 1964)."""
    return np.where(size < gate, 0.5 * size**2, gate * (size - 0.5 * gate))


def scale(values: Array) -> float:
    """Return the standard deviation of what is normal but for outliers, from the median."""
    if not len(values):
        return 0.0
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def white_noise(time: Array, values: Array) -> float:
    """Return the standard deviation of white noise on what is smooth else, outliers aside.

    From what a sample is off the line between its neighbours.
    """
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:]
    return scale(off / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2))


def stretches(mask: Flags) -> list[tuple[int, int]]:
    """Return (first, after) of the stretches where the mask holds."""
    turns = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int))).tolist()
    return list(zip(turns[::2], turns[1::2], strict=True))


def quantum(values: Array) -> float:
    """Return the step in which values are recorded, 0 where they are on no grid or on a fine one.

    Levels that are mostly one step apart and come back are a recorder's; those of a ramp that is
    passed once are samples of it.
    """
    whole = float(np.ptp(values)) if len(values) else 0.0
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > 1e-6 * whole]
    runs = int(np.count_nonzero(np.abs(np.diff(values)) > 1e-6 * whole)) + 1
    levels = len(gaps) + 1
    if levels < 2 or runs < _COME_BACK * levels or (levels < _LEVELS and runs < _SURELY):
        return 0.0
    counts = np.round(gaps / np.median(gaps))
    if np.median(np.abs(counts - 1.0)) > 0.0 or (counts < 1.0).any():
        return 0.0
    step = float(gaps.sum() / counts.sum())
    return step if np.abs(gaps - counts * step).max() < _OFF_GRID * step else 0.0


@compiled
def followed(time: Array, values: Array, time_constant: float) -> Array:
    """Return what follows values [n] by a first-order lag [s], from the same value at the first.

    Exactly, for values that are straight between their times.
    """
    found = values.copy()
    if time_constant > 0.0:
        for i in range(1, len(values)):
            h = time[i] - time[i - 1]
            behind = time_constant * (values[i] - values[i - 1]) / h
            off = found[i - 1] - values[i - 1] + behind
            found[i] = values[i] - behind + off * np.exp(-h / time_constant)
    return found


@compiled
def shifted(time: Array, values: Array, late: float) -> tuple[Array, Array]:
    """Return values [lanes, n] at times [n] that are `late` later, and how fast the first then go.

    By the cubic spline that is one polynomial over the first two intervals, and over the last two
    (not-a-knot, de Boor, *A Practical Guide to Splines*, 1978, ch. IV), for four samples or more.
    """
    lanes, n = values.shape
    found, rates = np.empty((lanes, n)), np.empty(n)
    slope, speed, above = np.empty(n - 1), np.empty(n), np.empty(n)
    for lane in range(lanes):
        z = values[lane]
        for k in range(n - 1):
            slope[k] = (z[k + 1] - z[k]) / (time[k + 1] - time[k])
        # a tridiagonal system for the derivatives at the samples, eliminated downwards
        a, b = time[1] - time[0], time[2] - time[1]
        right = ((3.0 * a + 2.0 * b) * b * slope[0] + a * a * slope[1]) / (a + b)
        above[0], speed[0] = (a + b) / b, right / b
        for k in range(1, n - 1):
            a, b = time[k] - time[k - 1], time[k + 1] - time[k]
            pivot = 2.0 * (a + b) - b * above[k - 1]
            above[k] = a / pivot
            speed[k] = (3.0 * (b * slope[k - 1] + a * slope[k]) - b * speed[k - 1]) / pivot
        a, b = time[n - 2] - time[n - 3], time[n - 1] - time[n - 2]
        right = (b * b * slope[n - 3] + (3.0 * b + 2.0 * a) * a * slope[n - 2]) / (a + b)
        pivot = a - (a + b) * above[n - 2]
        speed[n - 1] = (right - (a + b) * speed[n - 2]) / pivot
        for k in range(n - 2, -1, -1):
            speed[k] -= above[k] * speed[k + 1]
        i = 0
        for k in range(n):
            t = time[k] + late
            while i < n - 2 and time[i + 1] <= t:
                i += 1
            while i > 0 and time[i] > t:
                i -= 1
            span, h = time[i + 1] - time[i], t - time[i]
            bend = (speed[i] + speed[i + 1] - 2.0 * slope[i]) / span
            c3, c2 = bend / span, (slope[i] - speed[i]) / span - bend
            found[lane, k] = ((c3 * h + c2) * h + speed[i]) * h + z[i]
            if lane == 0:
                rates[k] = (3.0 * c3 * h + 2.0 * c2) * h + speed[i]
    return found, rates


class Autoregression(NamedTuple):
    """A stationary autoregression of residuals, by its prediction of each order below its own."""

    coefficients: tuple[float, ...]
    predictors: tuple[tuple[float, ...], ...]  # of order 0, 1, ... p
    variances: tuple[float, ...]  # of what each leaves over, as a share of the innovation's

    def whiten(self, columns: Array) -> Array:
        """Return the columns [n, c] of a block, each row less its prediction, of equal variance."""
        return np.asarray(_whitener(self, len(columns)) @ columns)

    def matrix(self, lengths: Index) -> csr_array:
        """Return what whitens blocks of these lengths, one after the other, as a matrix."""
        total = int(lengths.sum())
        starts = np.cumsum(lengths) - lengths
        place = np.arange(total) - np.repeat(starts, lengths)  # within the block
        top = len(self.coefficients)
        values, rows, columns = [np.ones(total)], [np.arange(total)], [np.arange(total)]
        for lag in range(1, top + 1):
            row = np.flatnonzero(place >= lag)
            order = np.minimum(place[row], top)
            ahead = np.array([0.0] * lag + [own[lag - 1] for own in self.predictors[lag:]])
            values.append(-ahead[order])
            rows.append(row)
            columns.append(row - lag)
        scale = 1.0 / np.sqrt(np.array(self.variances))[np.minimum(place, top)]
        joined = np.concatenate(rows)
        entries = np.concatenate(values) * scale[joined]
        return csr_array((entries, (joined, np.concatenate(columns))), shape=(total, total))


@lru_cache(maxsize=256)
def _whitener(noise: Autoregression, samples: int) -> csr_array:
    return noise.matrix(np.array([samples]))


WHITE = Autoregression((), ((),), (1.0,))
"""Noise that does not resemble its past."""


def autoregression(blocks: Sequence[Array], *, highest: int, samples: int) -> Autoregression:
    """Return the autoregression of residuals in independent blocks, its order by BIC.

    highest: of the orders; samples: of residuals for each order, at least.
    """
    total = sum(len(block) for block in blocks)
    power = sum(float(block @ block) for block in blocks)
    highest = min(highest, total // samples)
    if power <= 0.0 or highest < 1:
        return WHITE
    r = [
        sum(float(b[lag:] @ b[: len(b) - lag]) for b in blocks if len(b) > lag) / power
        for lag in range(highest + 1)
    ]
    predictors: list[tuple[float, ...]] = [()]
    variances = [1.0]
    for order in range(1, highest + 1):  # Levinson and Durbin
        old = np.array(predictors[-1])
        reflection = (r[order] - float(old @ np.array(r[1:order])[::-1])) / variances[-1]
        reflection = min(max(reflection, -0.999), 0.999)
        predictors.append((*(old - reflection * old[::-1]).tolist(), reflection))
        variances.append(variances[-1] * (1.0 - reflection**2))
    orders = math.log(total) * np.arange(highest + 1)
    best = int(np.argmin(total * np.log(np.maximum(variances, 1e-300)) + orders))
    if best == 0:
        return WHITE
    shares = tuple(variance / variances[best] for variance in variances[: best + 1])
    return Autoregression(predictors[best], tuple(predictors[: best + 1]), shares)
