"""Where a voltage-driven log is cut: between one rest and the next, each with its own start."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.series import stretches

_IDLE = 0.02  # of the largest voltage: none
_BEFORE = 8  # samples of rest that are kept before the voltage comes
_AFTER = 1.0  # s after it went, by which the actuator stands
_ROUND = 3.0  # times noise and quantum that it may seem to move while it stands


class Block(NamedTuple):
    """Samples of one run that share an unknown start."""

    log: int  # which bench
    run: int
    samples: NDArray[np.int64]  # of the bench, increasing


def cut(bench: Bench, log: int) -> list[Block]:
    """Return the blocks of a voltage-driven bench.

    A stretch without voltage in which the actuator stands ends a block; its samples but for the
    first and the last few say nothing and are left out, as are readings that only repeat the one
    before while it stands: they are one reading.
    """
    assert bench.voltage is not None
    least = _IDLE * float(np.abs(bench.voltage).max(initial=0.0))
    blocks = []
    for number, (first, after) in enumerate(bench.runs):
        idle = np.abs(bench.voltage[first:after]) <= least
        kept, ends = _rests(bench, first, idle)
        edges = [0, *ends, after - first]
        for low, high in itertools.pairwise(edges):
            samples = first + low + np.flatnonzero(kept[low:high])
            if len(samples) >= 3:
                blocks.append(Block(log, number, samples.astype(np.int64)))
    return blocks


def _rests(
    bench: Bench, first: int, idle: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], list[int]]:
    """Return which samples of a run are kept, and where it is cut."""
    kept = np.ones(len(idle), bool)
    ends: list[int] = []
    for low, high in stretches(idle):
        opens = low + (_standing(bench, first + low, first + high) if low else 0)
        closes = max(high - (_BEFORE if high < len(idle) else 0), opens)
        kept[opens:closes] = False
        still = bench.position[first + opens : first + high]
        if len(still) > 1:  # repeated readings are one
            same = np.append(False, still[1:] == still[:-1])
            same[2:] |= still[2:] == still[:-2]  # an outlier may stand between
            kept[opens:high] &= ~same
            if closes < high:
                kept[closes] = True
        if 0 < opens < high < len(idle):
            ends.append(closes)
    return kept, ends


def _standing(bench: Bench, first: int, after: int) -> int:
    """Return how many samples after `first` the actuator stands, as far as noise lets one see."""
    x = bench.position[first:after]
    latest = min(max(round(_AFTER / bench.step), _BEFORE), len(x))
    last = min(_BEFORE, len(x) // 3)
    if last < 2:
        return latest
    end = float(np.median(x[-last:]))
    width = min(9, len(x) - 1 + len(x) % 2)
    around = np.median(np.lib.stride_tricks.sliding_window_view(x, width), axis=1)
    near = np.abs(around - end) <= _ROUND * (bench.noise + bench.quantum)
    gone = np.flatnonzero(~near)
    return min(int(gone[-1]) + width // 2 + 3 if len(gone) else width // 2, latest)
