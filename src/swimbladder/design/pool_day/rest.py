"""Whether a stretch of a log is rest, and at which volume the vehicle was neutral in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLOCK = 5.0  # s; what the vehicle does in less than this is the sensor's noise
_WILD = 8.0  # robust standard deviations, beyond which a volume is a fault of its sensor


class Rest(NamedTuple):
    """A stretch of a log, judged as protocol.at_rest judges the last minute before a release."""

    time: float  # s, its end
    depth: float  # m, of its straight line at its end
    speed: float  # m/s, slope of that line
    spread: float  # m, rms of the depth about it, noise averaged out
    neutral: float  # m3, mean volume
    jitter: float  # m3, standard deviation of the volume


def stillness(time: Array, depth: Array) -> tuple[float, float, float]:
    """Return (speed [m/s], spread [m], depth at the end [m]) of a stretch of depths [m]."""
    t = time - time[0]
    middle, mean = float(t.mean()), float(depth.mean())
    from_middle = t - middle
    speed = float(from_middle @ depth) / float(from_middle @ from_middle)
    away = depth - mean - speed * from_middle
    blocks = (t / _BLOCK).astype(np.intp)
    count = np.bincount(blocks)
    sums = np.bincount(blocks, away)
    spread = math.sqrt(float((sums**2 / np.maximum(count, 1)).sum()) / len(t))
    return speed, spread, mean + speed * (float(t[-1]) - middle)


def neutral_volume(volume: Array) -> tuple[float, float]:
    """Return mean and standard deviation [m3] of the volumes, those that no piston had left out."""
    away = np.abs(volume - np.median(volume))
    limit = _WILD * 1.4826 * float(np.median(away))
    sane = volume if limit == 0.0 else volume[away <= limit]
    return float(sane.mean()), float(sane.std())


def settled(volume: Array, change: float) -> bool:
    """Say whether a stretch of volumes [m3] stands still, by the measure of a change [m3].

    The means of its halves agree to a tenth of the change, and it scatters by less than a fifth:
    a piston that a controller moves does not do so, one with a noisy sensor does.
    """
    half = len(volume) // 2
    moved = abs(float(np.median(volume[half:]) - np.median(volume[:half])))
    away = np.abs(volume - np.median(volume))
    kept = away <= np.sort(away)[-2] if len(away) > 5 else away >= 0.0  # one may be a fault
    scatter = float(volume[kept].std())
    return moved <= 0.1 * abs(change) and scatter <= 0.2 * abs(change)
