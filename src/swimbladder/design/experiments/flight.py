"""A release followed: what its record would hold of a vehicle with given parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.experiments.conditions import Passing, Ramps, Release, Setting
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.motion.experiment import Experiment, Segment
from swimbladder.estimation.motion.model import Model
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.closed_loop.bundle import Course

Array = NDArray[np.float64]

CLEAR = 0.05  # m inside of an end of the range that a depth has to be before the end counts
_FIRST_STRETCH = 60.0  # s, followed at first; then twice as long each time


class Flight(NamedTuple):
    """A record, from `rest` before the release to where it ends. Volumes are above the rest's."""

    release: Release
    time: Array  # s, from the first sample
    volume: Array  # m3
    depth: Array  # m
    moved: tuple[int, ...]  # samples at which the moves that happened began
    ended: Literal["shallowest", "deepest", "longest"]

    @property
    def duration(self) -> float:
        """Time from the release to the end of the record [s]."""
        return float(self.time[-1] - self.time[self.moved[0]])

    @property
    def complete(self) -> bool:
        """Whether all moves happened."""
        return len(self.moved) == len(self.release.moves)


def follow(
    release: Release, model: Model, values: Mapping[str, float], ramps: Ramps, setting: Setting
) -> Flight:
    """Return the record of a release without noise, of a vehicle with these values."""
    h = setting.sample_time
    first = math.ceil(setting.rest / h - 1e-9)
    whole = first + math.ceil(setting.longest / h - 1e-9) + 1
    time = h * np.arange(whole, dtype=np.float64)
    volume = np.zeros(whole)
    p = model.plant(values, -values["psi"] * release.start)
    at, moved, looked = first, [first], min(whole, first + math.ceil(_FIRST_STRETCH / h))
    volume[at:] = ramps.move(0.0, release.moves[0].volume, whole - at)
    while True:
        depth = _depths(p, time[:looked], volume[:looked], release.start)
        end, why = _end(depth, first, setting)
        following = release.moves[len(moved)] if len(moved) < len(release.moves) else None
        if following is not None and following.when is not None:
            k = _passed(depth, at, following.when)
            if k is not None and k < end:
                at = k
                moved.append(k)
                volume[k:] = ramps.move(float(volume[k]), following.volume, whole - k)
                looked = min(whole, max(looked, k + math.ceil(_FIRST_STRETCH / h)))
                continue
        if end < looked or looked == whole:
            return Flight(release, time[:end], volume[:end], depth[:end], tuple(moved), why)
        looked = min(whole, 2 * looked)


def _depths(p: Plant, time: Array, volume: Array, start: float) -> Array:
    course = Course(time, volume, ramps=True)
    rate = (volume[1] - volume[0]) / (time[1] - time[0])
    found: Array = course.follow([p], np.array([[rate, volume[0], start, 0.0]]))[0]
    return found


def _end(
    depth: Array, first: int, setting: Setting
) -> tuple[int, Literal["shallowest", "deepest", "longest"]]:
    """Return how many samples the record has, and what ended it."""
    low = np.maximum.accumulate(depth < setting.deepest - CLEAR) & (depth > setting.deepest)
    high = np.maximum.accumulate(depth > setting.shallowest + CLEAR) & (depth < setting.shallowest)
    out = low | high | np.isnan(depth)
    out[: first + 1] = False
    if not out.any():
        return len(depth), "longest"
    end = int(np.argmax(out))
    return end, "deepest" if low[end] else "shallowest"


def _passed(depth: Array, since: int, when: Passing) -> int | None:
    """Return the first sample beyond the place, once the depth was on this side of it."""
    beyond = depth[since:] < when.depth if when.up else depth[since:] > when.depth
    crossed = beyond & np.maximum.accumulate(~beyond)
    return since + int(np.argmax(crossed)) if crossed.any() else None


def experiment_of(flight: Flight, name: str) -> Experiment:
    """Return a flight as `identify` takes a log of it."""
    n = len(flight.time)
    record = Record(
        drive="volume", time=flight.time, depth=flight.depth, speed=None, volume=flight.volume,
        volume_absolute=False, voltage=None, setpoints=(), reference=None,
        compared=np.ones(n, np.bool_), afloat=False, bottom_depth=math.inf, notes=(),
    )  # fmt: skip
    start = flight.release.start
    return Experiment(
        source=name, record=record, inputs=flight.volume, ramps=True, reference=start, neutral=0.0,
        segments=(Segment(0, n - 1, start, 0.0),),
    )  # fmt: skip
