"""What a recorded volume may be off by: its resolution, and what it did between two samples.

A single volume far off those beside it may have been one, or not: it is off by all of that.
A coarse recorder is off by the same while one value stands in the log, evenly within half a step.
Between two samples a volume may go early or late: where it bends, the mean of a span is off by a
share of the bend. And no volume is exact.
"""

import numpy as np

from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.series import Index
from swimbladder.physics.arrays import Array

_EXACT = 2e-5  # of the stroke, 1 sigma of a sample of a volume
_BEND = 0.12  # of the change of a volume's step, 1 sigma of the mean of a span
_FIRST = 0.5  # of what it mostly is, 1 sigma of the first sample, whose neighbor is on one side


def volume_errors(record: Record, stroke: float) -> Array:
    """Return how far a record's volume may be off [2, n], as `Samples` has it; stroke [m3]."""
    volume, time = record.volume, record.time
    assert volume is not None  # it drives the model
    found, span = np.zeros((2, len(volume))), np.diff(time)
    found[0, 1:] = -1.0
    if record.quantum > 0.0:
        square = record.quantum**2 / 12.0
        stays = _stays(volume, 0.5 * record.quantum)
        runs = _stays(volume, 1.5 * record.quantum)
        found[0, runs] = square
        lasts = np.diff(np.append(time[stays], time[-1]))
        alone = np.isin(stays, runs) & np.isin(np.append(stays[1:], len(time)), [*runs, len(time)])
        which = np.searchsorted(stays, np.arange(len(time)), side="right") - 1
        found[1, 1:] = np.where(alone, 0.0, square * lasts)[which][:-1]
    else:
        bends = np.pad(np.abs(np.diff(volume, 2)), 1)
        found[0, :2] = (_FIRST * min(bends[1], np.median(bends))) ** 2, 0.0
        found[1, 1:] = (_BEND * np.maximum(bends[1:], bends[:-1])) ** 2 * span
    if record.uncertain is not None:
        uncertain = 0.5 * record.uncertain**2
        found[1, 1:] += (uncertain[1:] + uncertain[:-1]) * span
    found[1, 1:] += (_EXACT * stroke) ** 2 * span
    return found


def early_moves(record: Record) -> Array:
    """Return by how much each volume [n, m3] is off where the motor moves as early as it can.

    A volume that is sampled may have gone to where it is next evenly, at once, or at the last
    moment (then the negative). As fast as in its fastest span, the mean of a span is off by
    change / 2 (1 - |change| / largest). Shared by the span's two samples. Coarse steps say nothing
    of it.
    """
    assert record.volume is not None  # it drives the model
    change = np.diff(record.volume)
    if record.quantum > 0.0:
        return np.zeros(len(change) + 1)
    rate = np.abs(change) / np.diff(record.time)
    mean = 0.5 * change * (1.0 - rate / max(float(rate.max()), 1e-300))
    return np.asarray(0.5 * (np.append(mean, 0.0) + np.append(0.0, mean)))


def _stays(volume: Array, within: float) -> Index:
    """Return where stretches begin that stay within a range, each as long as it can be."""
    first, low, high = [0], volume[0], volume[0]
    for k, value in enumerate(volume.tolist()):
        low, high = min(low, value), max(high, value)
        if high - low > within:
            first.append(k)
            low = high = value
    return np.array(first)


def as_white(time: Array, off: Array) -> Array:
    """Return errors that last as white noise of the same integral over the record."""
    (begins,) = np.nonzero(off[0] >= 0.0)
    lasts = np.diff(np.append(time[begins], time[-1]))
    total = float((off[0, begins] * lasts**2).sum()) / float(time[-1] - time[0])
    return np.array([np.append(0.0, np.full(len(time) - 1, -1.0)), off[1] + total])
