"""The speed of a move once it is at full speed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.actuator.moves import Move
from swimbladder.estimation.actuator.noise import autoregression, changes, spikes

Array = NDArray[np.float64]


class Rate(NamedTuple):
    """The mean speed of a move at full speed [m/s], its deviation, and how it changes [1/s]."""

    value: float
    std: float
    trend: float  # share of the speed that is gained in a second
    samples: NDArray[np.int64]
    fitted: Array  # m, the position at these
    used: NDArray[np.bool_]


def rate_of(bench: Bench, move: Move, T1: float = 0.0) -> Rate:
    """Return the mean speed between the first and the last sample of a move at full speed.

    A parabola is fitted, and an exponential of time constant T1 [s], with which the speed is still
    on its way; the residual is taken as an autoregression beside the quantum.
    """
    first = move.first
    t = bench.time[first : move.last + 1]
    x = move.direction * bench.position[first : move.last + 1]
    middle, half = 0.5 * (t[0] + t[-1]), 0.5 * (t[-1] - t[0])
    s = (t - middle) / half
    parts = [np.ones_like(s), s]
    if len(s) > 6:
        parts.append(s * s)
    if 0.3 * bench.step < T1 < half:
        parts.append(np.exp(-(t - t[0]) / T1))
    columns = np.stack(parts, axis=1)
    keep = np.ones(len(s), bool)
    for _ in range(2):
        best = np.linalg.lstsq(columns[keep], x[keep], rcond=None)[0]
        off = x - columns @ best
        keep = ~spikes(off, 4.0 * (bench.quantum + changes(t, x)))
    noise = autoregression([off[keep]])
    white = noise.whiten(np.column_stack([columns[keep], x[keep]]))
    best, *_ = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)
    left = white[:, -1] - white[:, :-1] @ best
    variance = float(left @ left) / max(len(left) - len(best), 1)
    covariance = variance * np.linalg.inv(white[:, :-1].T @ white[:, :-1])
    # readings that the quantum alone puts off do so independently, at best
    least = bench.quantum / math.sqrt(12.0) / float(np.linalg.norm(s))
    std = max(math.sqrt(float(covariance[1, 1])), least)
    speed = float(best[1]) / half
    trend = 2.0 * float(best[2]) / half**2 / speed if len(s) > 6 else 0.0
    samples = np.arange(first, move.last + 1)
    return Rate(speed, std / half, trend, samples, move.direction * (columns @ best), keep)
