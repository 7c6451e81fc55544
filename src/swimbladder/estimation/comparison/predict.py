"""The model along a record: in one run, or in windows that each start from what was measured."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.comparison.water import follow_in
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import Solution, drive, simulate
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_SPAN = 3.0  # s to each side, for the depth and speed at which a window starts
_WINDOWS = (10.0, 20.0, 40.0, 80.0, 160.0)  # s
_HORIZONS = (0.125, 0.25, 0.5)  # of the record


class Start(NamedTuple):
    """The state in which a run starts, and how its neutral volume drifts from there."""

    depth: float | None  # m; None: afloat
    speed: float  # m/s
    drift: float = 0.0  # m3/s


class Window(NamedTuple):
    """A stretch of a record, its last sample included."""

    first: int
    last: int


def stages(rec: Record) -> list[list[Window]]:
    """Return ever harder tasks for a fit: the last is the whole record in one run.

    A vehicle that floats freely doubles any error of its neutral volume over and over, so a fit
    over the whole of a record has many local minima. Short windows have one.
    With a logged volume each window starts from what was measured; with a voltage the volume on
    the way is not known, and the horizon grows instead; in closed loop errors do not grow.
    """
    whole = Window(0, len(rec.time) - 1)
    if rec.drive == "volume":
        return [*(_tiles(rec, w) for w in _WINDOWS if w < rec.duration), [whole]]
    if rec.drive == "voltage":
        ends = [int(np.searchsorted(rec.time, part * rec.duration)) for part in _HORIZONS]
        return [*([Window(0, end)] for end in ends if end >= 10), [whole]]
    return [[whole]]


def _tiles(rec: Record, length: float) -> list[Window]:
    count = max(round(rec.duration / length), 1)
    edges = np.searchsorted(rec.time, np.linspace(0.0, rec.duration, count + 1)[1:-1])
    bounds = [0, *sorted({int(e) for e in edges} - {0, len(rec.time) - 1}), len(rec.time) - 1]
    return [Window(a, b) for a, b in pairwise(bounds)]


def measured_start(rec: Record, at: int) -> Start:
    """Return depth and speed at sample `at`, as logged; without a logged speed from a parabola
    through the depths around it.
    """
    if rec.speed is not None and np.isfinite(rec.speed[at]):
        return Start(float(rec.depth[at]), float(rec.speed[at]))
    near = np.abs(rec.time - rec.time[at]) <= _SPAN
    if near.sum() < 4:
        return Start(float(rec.depth[at]), 0.0)
    parabola = np.polyfit(rec.time[near] - rec.time[at], rec.depth[near], 2)
    return Start(float(parabola[2]), float(parabola[1]))


def predict(vehicle: Vehicle, rec: Record, windows: list[Window], start: Start) -> Array:
    """Return the depth at every sample [m]; the first window starts as `start` says."""
    depth = np.empty_like(rec.depth)
    for window in windows:
        begin = start
        if window.first:
            begin = measured_start(rec, window.first)._replace(drift=start.drift)
        samples = slice(window.first + (window.first > 0), window.last + 1)
        depth[samples] = _run(vehicle, rec, window, begin)[0][-len(depth[samples]) :]
    return depth


def run(vehicle: Vehicle, rec: Record, start: Start) -> tuple[Array, Array, Solution | None]:
    """Return depth [m] and volume [m3] at every sample, and the Solution they are from.

    In the water of a cast there is none, and a depth is nan from where the vehicle left the water.
    """
    return _run(vehicle, rec, Window(0, len(rec.time) - 1), start)


def _run(
    vehicle: Vehicle, rec: Record, window: Window, start: Start
) -> tuple[Array, Array, Solution | None]:
    part = slice(window.first, window.last + 1)
    time = rec.time[part] - rec.time[window.first]
    volume = None if rec.volume is None else rec.volume[part]
    depth = start.depth
    if depth is None:
        added = rec.layers.at(vehicle.hull.emergence_depth)
        depth = _afloat(vehicle, None if volume is None else float(volume[0]) - added)
    depth = min(max(depth, _highest(vehicle)), rec.bottom_depth)
    at = vehicle.neutral_volume(depth)  # where the log does not say, at rest if the stroke lets it
    if volume is not None and rec.volume_absolute:
        at = float(volume[0])
    begin = min(max(at, vehicle.stroke.minimum), vehicle.stroke.maximum)
    known: dict[str, Any] = {
        "start_depth": depth,
        "start_speed": start.speed,
        "bottom_depth": rec.bottom_depth,
    }
    if rec.drive == "setpoint":
        solution = simulate(
            vehicle,
            setpoints=list(rec.setpoints),
            duration=float(time[-1]),
            start_volume=begin,
            checked=False,
            **known,
        )
        return _hermite(time, solution), np.interp(time, solution.time, solution.volume), solution
    if rec.drive == "volume" and volume is not None:
        # Only volume less neutral volume moves the vehicle.
        moving = volume - start.drift * rec.time[part]
        if len(rec.layers.table):
            plants = [plant(vehicle, bottom_depth=rec.bottom_depth)]
            starts = np.array([[depth, start.speed]])
            return follow_in(rec.layers, plants, time, moving, starts)[0], volume, None
        solution = drive(vehicle, time=time, volume=moving, **known)
    else:
        assert rec.voltage is not None  # record() checks it
        solution = drive(vehicle, time=time, voltage=rec.voltage[part], start_volume=begin, **known)
    pad = (0, len(time) - len(solution.depth))
    return np.pad(solution.depth, pad, "edge"), np.pad(solution.volume, pad, "edge"), solution


def _afloat(vehicle: Vehicle, volume: float | None) -> float:
    """Return the depth [m] at which a vehicle of this volume [m3] floats at the surface."""
    hull = vehicle.hull
    if volume is None:
        return hull.emergence_depth
    spare = max(volume - vehicle.neutral_volume(hull.emergence_depth), 0.0)
    return hull.emergence_depth - spare / hull.waterplane_area


def _highest(vehicle: Vehicle) -> float:
    """Return the least depth [m] at which a run may start: nearly out of the water."""
    return vehicle.hull.emergence_depth - 0.9 * vehicle.hull.height


def _hermite(time: Array, s: Solution) -> Array:
    """Return the depth [m] of a solution between its samples, from depths and speeds there."""
    if len(s.time) < 2:
        return np.full_like(time, s.depth[0])
    k = np.clip(np.searchsorted(s.time, time, side="right") - 1, 0, len(s.time) - 2)
    h = s.time[k + 1] - s.time[k]
    x = np.clip((time - s.time[k]) / h, 0.0, 1.0)
    rise = s.depth[k + 1] - s.depth[k]
    a, b = h * s.speed[k] - rise, rise - h * s.speed[k + 1]
    result: Array = s.depth[k] + x * (rise + (1.0 - x) * (a * (1.0 - x) + b * x))
    return result
