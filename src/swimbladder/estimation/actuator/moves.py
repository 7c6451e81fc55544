"""Moves at full speed, found in the position itself or from what was asked of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.series import stretches

Array = NDArray[np.float64]

_MOVES = 0.5  # of the full speed: it moves
_FULL = 0.85  # of the full speed of the move: it has started, and does not yet brake
_RESTS = 0.1  # of the full speed: it stands
_FEWEST = 6  # samples at full speed
_FEWEST_ASKED = 4  # where it is known that full speed was asked for
_WIDTHS = (1, 2, 4, 8, 16, 32)  # intervals that a speed is taken over
_BLUR = 0.05  # of the full speed, that noise may make of a speed
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


def _speed(
    bench: Bench, first: int, after: int, widths: tuple[int, ...] = _WIDTHS
) -> tuple[Array, int]:
    """Return the speed of each interval [m/s], and over how many intervals it is taken.

    Over as few as noise and quantum allow, the median of three against outliers.
    """
    x, t = bench.position[first:after], bench.time[first:after]
    for width in widths:
        if after - first < 4 * width:
            break
        raw = (x[width:] - x[:-width]) / (t[width:] - t[:-width])
        # each interval has the speed of the stretch around it
        padded = np.pad(raw, (1 + width // 2, 1 + (width - 1) // 2), mode="edge")
        speed = np.median(np.lib.stride_tricks.sliding_window_view(padded, 3), axis=1)
        full = max(_full(speed), _full(-speed))
        blur = (1.4 * bench.noise + bench.quantum) / (width * bench.step)
        if blur < _BLUR * full:
            break
    return speed, width


def _full(speed: Array) -> float:
    """Return the full speed among speeds of one sign [m/s]: the median of those above its half."""
    fast = np.sort(speed[speed > 0.0])
    if not len(fast):
        return 0.0
    top = float(fast[int(0.95 * (len(fast) - 1))])
    return float(np.median(fast[fast > 0.5 * top]))


def _seen(bench: Bench, log: int, first: int, after: int) -> list[Move]:
    speed, width = _speed(bench, first, after)
    least = 4.0 * (bench.noise + bench.quantum)
    found = []
    for direction in (1, -1):
        full = _full(direction * speed)
        for low, high in stretches(direction * speed > _MOVES * full):
            move = _one(direction * speed, low, high, full, width)
            if move is None:
                continue
            begin, start, end = move
            travel = bench.position[end + first] - bench.position[start + first]
            if direction * travel > least:
                whole = Move(log, direction, _add(begin, first), start + first, end + first)
                found.append(_from_rest(bench, whole))
    return sorted(found, key=lambda move: move.first)


def _from_rest(bench: Bench, move: Move) -> Move:
    """Return the move, without its start where that goes to and fro."""
    if move.begin is None:
        return move
    gone = move.direction * bench.position[move.begin : move.first + 1]
    gone = gone - gone[0]
    rests = -_RESTS * gone[-1] <= gone.min() and gone.max() <= (1.0 + _RESTS) * gone[-1]
    return move if rests else move._replace(begin=None)


def _add(index: int | None, first: int) -> int | None:
    return None if index is None else index + first


def _one(
    speed: Array, low: int, high: int, full: float, width: int
) -> tuple[int | None, int, int] | None:
    """Return (begin, first, last) of the move whose intervals low..high are fast.

    width: intervals over which a speed is taken.
    """
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
    end = max(end - width, start)  # the stretch in which it begins to brake looks fast
    if end - start < _FEWEST:
        return None
    return _begin(speed, low, own, width), start, end


def _begin(speed: Array, low: int, own: float, width: int) -> int | None:
    """Return the first sample of the start of a move whose interval `low` is the first fast one.

    None where it does not come from rest shortly before.
    """
    near = _FEWEST + 2 * width
    rest = np.flatnonzero(np.abs(speed[:low]) < _RESTS * own)
    if len(rest) and low - int(rest[-1]) <= max(near, low // 2):
        last = int(rest[-1]) + 1 - width
        begin = max(last - _BEFORE, 0)
        moved = np.flatnonzero(np.abs(speed[begin : max(last, begin)]) > 2.0 * _RESTS * own)
        return begin + (int(moved[-1]) + 1 if len(moved) else 0)
    return 0 if low <= _FEWEST // 2 + width else None  # it starts with the log


def _asked(bench: Bench, log: int, first: int, after: int) -> list[Move]:
    assert bench.reference is not None
    speed, _ = _speed(bench, first, after, (1,))  # its moves may be few samples long
    ahead = bench.reference[first:after] - bench.position[first:after]
    found = []
    for direction in (1, -1):
        full = _full(direction * speed)
        reach = 1.5 * full * bench.step
        if full <= 0.0:
            continue
        goes = direction * np.append(speed, speed[-1]) > _MOVES * full
        far = (direction * ahead > reach) & goes  # it may be at an end stop
        for low, high in stretches(far):
            start, end = low + 1, high - 1  # it may take up an order late
            if end - start + 1 >= _FEWEST_ASKED:
                found.append(Move(log, direction, None, start + first, end + first))
    return sorted(found, key=lambda move: move.first)
