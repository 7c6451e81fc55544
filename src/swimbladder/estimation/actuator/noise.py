"""The residual of a position: its quantum and its outliers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.series import Autoregression
from swimbladder.estimation.series import autoregression as of_blocks

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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


def autoregression(blocks: Sequence[Array]) -> Autoregression:
    """Return the autoregression of residuals in independent blocks, each about its mean."""
    return of_blocks([b - b.mean() for b in blocks if len(b) > 1], highest=4, samples=20)
