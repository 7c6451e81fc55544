"""Moves at full speed, found in the position itself or from what was asked of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.identify_actuator.bench import Bench

__all__ = ["Move", "moves"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MOVES = 0.5  # of the full speed: it moves
_FULL = 0.85  # of the full speed of the move: it has started, and does not yet brake
_FEWEST = 6  # samples at full speed
_FEWEST_ASKED = 4  # where it is known that full speed was asked for
_BEFORE = 5  # samples of rest that are kept before it starts


class Move(NamedTuple):
    """A stretch at full speed, with its start where that is in the log.

    samples first..last at full speed; begin: the first sample of the start-up (a few at rest and
    the acceleration), None where the log does not show it. direction: 1 outward, -1 inward.
    """

    log: int
    direction: int
    begin: int | None
    first: int
    last: int


def moves(bench: Bench, log: int) -> list[Move]:
    """Return the moves at full speed of a bench, in order.

    Without a reference: where the speed, over a few samples, is near the largest that the log has
    in that direction. With one: where it is out of reach for the whole of a step of time.
    """
    found: list[Move] = []
    for first, after in bench.runs:
        if after - first >= _FEWEST:
            part = _asked if bench.reference is not None else _seen
            found += part(bench, log, first, after)
    return found


def _speed(bench: Bench, first: int, after: int) -> Array:
    """Return the speed between neighbours [m/s], the median of three against outliers."""
    raw = np.diff(bench.position[first:after]) / np.diff(bench.time[first:after])
    padded = np.pad(raw, 1, mode="edge")
    result: Array = np.median(np.lib.stride_tricks.sliding_window_view(padded, 3), axis=1)
    return result


def _full(speed: Array) -> float:
    """Return the full speed among speeds of one sign [m/s]: the median of those above its half."""
    fast = np.sort(speed[speed > 0.0])
    if not len(fast):
        return 0.0
    top = float(fast[int(0.95 * (len(fast) - 1))])
    return float(np.median(fast[fast > 0.5 * top]))


def _seen(bench: Bench, log: int, first: int, after: int) -> list[Move]:
    speed = _speed(bench, first, after)
    noise = 3.0 * (bench.noise + bench.quantum) / bench.step
    found = []
    for direction in (1, -1):
        full = _full(direction * speed)
        if full <= noise:
            continue
        for low, high in _stretches(direction * speed > _MOVES * full):
            move = _one(direction * speed, low, high, full)
            if move is not None:
                begin, start, end = move
                found.append(Move(log, direction, _add(begin, first), start + first, end + first))
    return sorted(found, key=lambda move: move.first)


def _add(index: int | None, first: int) -> int | None:
    return None if index is None else index + first


def _one(speed: Array, low: int, high: int, full: float) -> tuple[int | None, int, int] | None:
    """Return (begin, first, last) of the move whose intervals low..high are fast."""
    own = float(np.median(speed[low:high]))
    fast = np.flatnonzero(speed[low:high] > _FULL * own)
    if own < _MOVES * full or not len(fast):
        return None
    start = low + int(fast[0])
    slow = speed[start:high] < _FULL * own
    lasting = slow & np.append(slow[1:], True) & np.append(slow[2:], [True, True])
    brake = np.flatnonzero(lasting[: len(slow)])
    brake = brake[brake > (high - start) // 2]
    end = start + int(brake[0]) - 1 if len(brake) else high - 1
    end = max(end - 1, start)  # the interval in which it begins to brake looks fast
    if end - start < _FEWEST:
        return None
    return _begin(speed, low, own), start, end


def _begin(speed: Array, low: int, own: float) -> int | None:
    """Return the first sample of the start of a move whose interval `low` is the first fast one.

    None where it does not come from rest within the few intervals before.
    """
    rest = np.flatnonzero(np.abs(speed[:low]) < 0.1 * own)
    if len(rest) and low - int(rest[-1]) <= _FEWEST:
        begin = max(int(rest[-1]) + 1 - _BEFORE, 0)
        moved = np.flatnonzero(np.abs(speed[begin : int(rest[-1])]) > 0.1 * own)
        return begin + (int(moved[-1]) + 1 if len(moved) else 0)
    return 0 if low <= _FEWEST // 2 else None  # it starts with the log


def _asked(bench: Bench, log: int, first: int, after: int) -> list[Move]:
    assert bench.reference is not None
    speed = _speed(bench, first, after)
    ahead = bench.reference[first:after] - bench.position[first:after]
    found = []
    for direction in (1, -1):
        full = _full(direction * speed)
        reach = 1.5 * full * bench.step
        if full <= 0.0:
            continue
        goes = direction * np.append(speed, speed[-1]) > _MOVES * full
        far = (direction * ahead > reach) & goes  # it may be at an end stop
        for low, high in _stretches(far):
            start, end = low + 1, high - 1  # it may take up an order late
            if end - start + 1 >= _FEWEST_ASKED:
                begin = _add(_begin(direction * speed, low, full), first)
                found.append(Move(log, direction, begin, start + first, end + first))
    return sorted(found, key=lambda move: move.first)


def _stretches(mask: Mask) -> list[tuple[int, int]]:
    """Return (first, after) of the stretches where the mask holds."""
    padded = np.concatenate(([False], mask, [False])).astype(int)
    turns = np.flatnonzero(np.diff(padded)).tolist()
    return list(zip(turns[::2], turns[1::2], strict=True))
