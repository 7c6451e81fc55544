"""The residual of a position: its quantum, its outliers, and how it resembles its past."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_HIGHEST = 4  # order of the autoregression
_FAR = 5.0  # robust standard deviations beyond which a sample is an outlier


def quantum(position: Array) -> float:
    """Return the step between two positions that the sensor resolves, 0 where it is not seen.

    It is the smallest difference of neighbours, where at least nine tenths of all differences are
    its multiples.
    """
    steps = np.abs(np.diff(position))
    steps = np.sort(steps[steps > 1e-9 * max(float(np.ptp(position)), 1e-300)])
    if len(steps) < 10:
        return 0.0
    found = float(np.median(steps[steps <= 1.5 * steps[0]]))
    multiples = steps / found
    off = np.abs(multiples - np.rint(multiples))
    fits = off < np.maximum(0.02 * multiples, 0.2)
    return found if fits[multiples < 10.0].mean() > 0.9 and (multiples < 10.0).any() else 0.0


def scale(values: Array) -> float:
    """Return the standard deviation of what is normal but for outliers, from the median."""
    if not len(values):
        return 0.0
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def changes(time: Array, position: Array) -> float:
    """Return the standard deviation of white noise on a smooth position, outliers aside.

    From what a sample is off the line between its neighbours.
    """
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = position[1:-1] - (1.0 - share) * position[:-2] - share * position[2:]
    return scale(off / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2))


def spikes(residual: Array, least: float) -> Mask:
    """Return which samples stick out from their neighbours by more than `least` and by far."""
    width = 7
    if len(residual) < width:
        return np.zeros(len(residual), bool)
    windows = np.lib.stride_tricks.sliding_window_view(residual, width)
    around, side = np.median(windows, axis=1), np.arange(1.0, 1.0 + width // 2)
    first, last = (float(np.median(np.diff(w))) for w in (windows[0], windows[-1]))
    around = np.concatenate([around[0] - first * side[::-1], around, around[-1] + last * side])
    off = residual - around
    far: Mask = np.abs(off) > max(_FAR * scale(off), least)
    return far


class Autoregression(NamedTuple):
    """A stationary autoregression of residuals, by its prediction of each order below its own."""

    coefficients: tuple[float, ...]
    predictors: tuple[tuple[float, ...], ...]  # of order 0, 1, ... p
    variances: tuple[float, ...]  # of what each leaves over, as a share of the innovation's

    def whiten(self, columns: Array) -> Array:
        """Return the columns [n, c] of a block, each row less its prediction, of equal variance."""
        result = np.empty_like(columns)
        top = len(self.coefficients)
        for k in range(min(top, len(columns))):
            ahead = np.array(self.predictors[k])
            result[k] = columns[k] - ahead @ columns[:k][::-1]
            result[k] /= math.sqrt(self.variances[k])
        if len(columns) > top:
            result[top:] = columns[top:]
            for lag, factor in enumerate(self.coefficients, start=1):
                result[top:] -= factor * columns[top - lag : len(columns) - lag]
        return result

    def matrix(self, lengths: NDArray[np.int64]) -> csr_array:
        """Return what whitens blocks of these lengths, one after the other, as a matrix."""
        total = int(lengths.sum())
        starts = np.cumsum(lengths) - lengths
        place = np.arange(total) - np.repeat(starts, lengths)  # within the block
        top = len(self.coefficients)
        values, rows, columns = [np.ones(total)], [np.arange(total)], [np.arange(total)]
        for lag in range(1, top + 1):
            row = np.flatnonzero(place >= lag)
            order = np.minimum(place[row], top)
            ahead = np.array([0.0 if k < lag else self.predictors[k][lag - 1]
                              for k in range(top + 1)])  # fmt: skip
            values.append(-ahead[order])
            rows.append(row)
            columns.append(row - lag)
        scale = 1.0 / np.sqrt(np.array(self.variances))[np.minimum(place, top)]
        joined = np.concatenate(rows)
        entries = np.concatenate(values) * scale[joined]
        return csr_array((entries, (joined, np.concatenate(columns))), shape=(total, total))


WHITE = Autoregression((), ((),), (1.0,))
"""Noise that does not resemble its past."""


def autoregression(blocks: Sequence[Array]) -> Autoregression:
    """Return the autoregression of residuals in independent blocks, its order by BIC, 0 to 4."""
    blocks = [block - block.mean() for block in blocks if len(block) > 1]
    total = sum(len(block) for block in blocks)
    power = sum(float(block @ block) for block in blocks)
    highest = min(_HIGHEST, total // 20)
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
    score = [
        total * math.log(max(variance, 1e-300)) + order * math.log(total)
        for order, variance in enumerate(variances)
    ]
    best = int(np.argmin(score))
    if best == 0:
        return WHITE
    end = variances[best]
    return Autoregression(
        predictors[best],
        tuple(predictors[: best + 1]),
        tuple(variance / end for variance in variances[: best + 1]),
    )
