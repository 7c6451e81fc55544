"""The volume while a piston stands: one number, or a slow drift, not the noise of its sensor.

A fit takes a logged volume as what the volume was. Noise and quantum of the piston's sensor then
push the model to and fro: half a quantum of 0.75 cm3 over a glide of the paper's smallest step is
2 % of what drives it. While the piston stands, the mean of many samples knows the volume better
than each of them.
"""

from __future__ import annotations

import math

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
