"""Whether a stretch of a log is rest, where the vehicle was neutral in it, and how its volume
stood.

While a piston stands the volume is one number, or a slow drift, not the noise of its sensor. A fit
takes a logged volume as what the volume was. Noise and quantum of the piston's sensor then push the
model to and fro: half a quantum of 0.75 cm3 over a glide of the paper's smallest step is 2 % of
what drives it. While the piston stands, the mean of many samples knows the volume better than each
of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SURE = 4.0  # standard errors of a trend that is one
_HALF = 4  # samples to either side of one, that show whether the piston stands
_NOISE = 6.0  # standard deviations of the sensor's noise, between the largest and the least of them
_FEWEST = 8  # samples of a stretch
_SMALL = 0.1  # of the range of the volume, up to which a step may be a quantum
_DECIMALS = 12  # of m3, that are not rounding


def steadied(time: Array, volume: Array) -> Array:
    """Return the volumes [m3] of a glide at times [s], made steady where the piston stands.

    In each such stretch the volume is its mean or, where it leaks by more than the sensor's noise
    and quantum explain, the straight line or the parabola that follows the leak.
    """
    result = volume.copy()
    step = quantum(volume)
    noise = 1.4826 * float(np.median(np.abs(np.diff(volume)))) / math.sqrt(2.0)
    limit = max(1.01 * step, _NOISE * noise, 10.0**-_DECIMALS)
    for first, last in _stands(volume, limit):
        t, v = time[first:last] - time[first:last].mean(), volume[first:last]
        for order in (0, 1, 2):
            smooth = np.polynomial.polynomial.polyval(
                t, np.polynomial.polynomial.polyfit(t, v, order)
            )
            if not _trend(v - smooth, step):
                break
        result[first:last] = smooth
    return result


def quantum(volume: Array) -> float:
    """Return the smallest step [m3] by which a standing volume jumps, 0 where there is none.

    A step counts where those before and after do not go the same way, as on a ramp, and where it is
    small beside all that the volume does.
    """
    steps = np.diff(np.round(volume, _DECIMALS))
    ahead, behind = np.append(steps[1:], 0.0), np.insert(steps[:-1], 0, 0.0)
    alone = (steps != 0.0) & (steps * ahead <= 0.0) & (steps * behind <= 0.0)
    sizes = np.abs(steps[alone])
    sizes = sizes[sizes <= _SMALL * np.ptp(volume)]
    return float(sizes.min()) if len(sizes) else 0.0


def _stands(volume: Array, limit: float) -> list[tuple[int, int]]:
    """Return the stretches (first, one past the last) in which the volume stands."""
    width = 2 * _HALF + 1
    if len(volume) < width:
        return []
    near = np.lib.stride_tricks.sliding_window_view(volume, width)
    quiet = np.zeros(len(volume) + 2, dtype=np.int8)
    quiet[1 + _HALF : 1 + _HALF + len(near)] = np.ptp(near, axis=-1) <= limit
    edges = np.flatnonzero(np.diff(quiet))
    found: list[tuple[int, int]] = []
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if found:
            first = max(first, found[-1][1])
        if last - first < width:
            continue
        level = float(np.median(volume[first : first + width]))
        while first > (found[-1][1] if found else 0) and abs(volume[first - 1] - level) <= limit:
            first -= 1
        level = float(np.median(volume[last - width : last]))
        while last < len(volume) and abs(volume[last] - level) <= limit:
            last += 1
        if last - first >= _FEWEST:
            found.append((first, last))
    return found


def _trend(away: Array, step: float) -> bool:
    """Say whether the residuals differ between thirds by more than noise and quantum do."""
    third = len(away) // 3
    means = [float(away[i * third : (i + 1) * third].mean()) for i in range(3)]
    noise = float(np.diff(away).std()) / math.sqrt(2.0)
    return max(means) - min(means) > max(1.1 * step, _SURE * noise / math.sqrt(third))


FEWEST = 12  # samples of an experiment


class Rules(NamedTuple):
    """Numbers that distinguish the phases; the first three are those of control.protocol."""

    minute: float = 60.0  # s, over which rest is judged
    rest_speed: float = 5e-4  # m/s
    rest_distance: float = 0.02  # m
    still_speed: float = 2e-3  # m/s, up to which a release is taken, and said to be hasty
    change: float = 3e-6  # m3, least change of volume that is one
    surface: float = 0.1  # m, where a glide upward is over
    bottom: float = math.inf  # m, where one downward is over
    margin: float = 0.05  # m, within which a vehicle that something stops does not move
    travel: float = 3.0  # m, after which a glide is over
    turns: bool = False  # whether the volume may be changed again under way, as plans have it
    least_travel: float = 0.3  # m, of an informative glide
    longest: float = 1200.0  # s, of a glide
    gap: float = 5.0  # s without a sample, which ends everything
    before: float = 3.0  # s of rest that an experiment's record begins with


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
