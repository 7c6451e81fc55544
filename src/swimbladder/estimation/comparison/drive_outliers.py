"""Samples of a logged volume that no actuator can have been at: zeros, spikes, dropped digits.

A run of a few samples counts as off where the volume goes and comes back faster than the actuator
can: all of them lie outside of what is between the samples beside the run. A jump that stays is
none, and of the first and the last sample nothing shows whether it comes back. Of all ways to leave
runs out and to take jumps as they are, dynamic programming finds the cheapest: a sample left out
costs 1, a jump that is kept `_JUMP`.
"""

from collections.abc import Sequence

import numpy as np

from swimbladder.estimation.series import white_noise
from swimbladder.io.log_checks import spikes
from swimbladder.physics.arrays import Array, Flags
from swimbladder.sim.engine.cache import compiled

_JUMP = 3.0  # samples: a run that is left out has fewer than twice as many
LONGEST = 5  # samples of a run
_MARGIN = 1.25  # times the rate of the vehicle's file, and times what the log keeps up
_STEPS = 4  # one after the other, for which a rate is kept up
_FAR = 8.0  # standard deviations of the noise
_COARSE = 0.005  # of the stroke, what may be a coarse sensor


def drive_outliers(
    time: Array,
    volume: Array,
    gaps: Sequence[tuple[float, float]] = (),
    *,
    rate: float,
    stroke: float,
) -> tuple[Flags, Flags]:
    """Return which samples of a volume [m3] at times [s] the actuator cannot have been at, and
    which are single ones far off the others that it can: a spike, or a kick of the control law.

    gaps: (time before, time after) [s] without samples. rate: of the vehicle's actuator at its
    fastest [m3/s]; the log's own counts where it is higher. stroke: largest less smallest volume
    [m3].
    """
    off = np.zeros(len(volume), dtype=bool)
    single = off.copy()
    if len(volume) <= LONGEST:
        return off, single
    steps, span = np.diff(volume), np.diff(time)
    fastest = _MARGIN * max(_kept_up(steps / span), rate)
    least = max(_FAR * white_noise(time, volume), _COARSE * stroke)
    if (np.abs(steps) > least + fastest * span).any():
        off = np.asarray(~_kept(time, volume, fastest, least))
    alone = spikes("volume_m3", volume[~off], time[~off], gaps)
    single[np.flatnonzero(~off)[alone]] = True
    return off, single


def filled(time: Array, volume: Array, off: Flags) -> Array:
    """Return a volume, or piston, with values for the samples that are off.

    Between the samples beside a run it goes on as it did before, until it meets the line on which
    it goes on after: the corner where a move begins or ends. Where these do not meet, straight.
    """
    on = np.flatnonzero(~off)
    at = np.flatnonzero(off)
    if len(on) < 2:
        return volume
    new, place = volume.copy(), np.searchsorted(on, at)
    straight = np.interp(time[at], time[on], volume[on])
    slope = np.diff(volume[on]) / np.diff(time[on])
    before, after = (np.clip(place + k, 0, len(on) - 1) for k in (-1, 0))
    old = volume[on[before]] + slope[np.clip(place - 2, 0, None)] * (time[at] - time[on[before]])
    next_one = slope[np.clip(place, 0, len(slope) - 1)]
    later = volume[on[after]] - next_one * (time[on[after]] - time[at])
    middle = np.median([straight, old, later], axis=0)
    inside = (place > 1) & (place < len(on) - 1)
    new[at] = np.where(inside, middle, straight)
    return new


def _kept_up(speed: Array) -> float:
    """Return the fastest that a volume goes one way for several steps."""
    runs = np.lib.stride_tricks.sliding_window_view(speed, _STEPS)
    slowest = np.minimum(np.abs(runs.min(axis=1)), np.abs(runs.max(axis=1)))
    one_way = (runs > 0.0).all(axis=1) | (runs < 0.0).all(axis=1)
    return float(slowest[one_way].max(initial=0.0))


@compiled
def _kept(time: Array, volume: Array, fastest: float, least: float) -> Flags:
    """Return which samples are kept at the least cost."""
    n = len(time)
    cost, before = np.zeros(n), np.full(n, -1)
    for j in range(1, n):
        cost[j] = np.inf
        for i in range(j - 1, max(j - 2 - LONGEST, -1), -1):
            run = j - 1 - i
            if run > 0 and not _comes_back(time, volume, i, j, fastest, least):
                continue
            reached = abs(volume[j] - volume[i]) <= least + fastest * (time[j] - time[i])
            total = cost[i] + run + (0.0 if reached else _JUMP)
            if total < cost[j]:
                cost[j], before[j] = total, i
    kept = np.zeros(n, dtype=np.bool_)
    j = n - 1
    while j >= 0:
        kept[j] = True
        j = before[j]
    return kept


@compiled
def _comes_back(time: Array, volume: Array, i: int, j: int, fastest: float, least: float) -> bool:
    """Return whether a volume goes and comes back between two samples, faster than it can."""
    low, high = min(volume[i], volume[j]) - least, max(volume[i], volume[j]) + least
    possible = True
    for k in range(i + 1, j + 1):
        if k < j and low <= volume[k] <= high:
            return False
        far = least + fastest * (time[k] - time[k - 1])
        possible = possible and abs(volume[k] - volume[k - 1]) <= far
    return not possible
