"""The two ways through a day at the pool: a log that grows, and a rehearsal in simulation.

Both yield what happens; `GrowingLog` says what is new since it was last read. In a rehearsal the
operator works as section 3.1 of the paper: the vehicle's own loop brings it to rest, judged
over a minute as `control.protocol` does; then the loop is open and the piston moves to where it is
wanted. The operator goes by what is believed of the vehicle; the one in the water may be another.
With the loop open the piston is moved by a timed voltage, a servo, or directly.
"""

import math
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from swimbladder.control import protocol
from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.law import Measurement
from swimbladder.control.protocol import timed_voltage
from swimbladder.control.registry import bind
from swimbladder.design.plan import Move
from swimbladder.design.pool_day.day import News, PoolDay, Task
from swimbladder.design.pool_day.segments import Rules, Sample
from swimbladder.design.pool_day.verdict import State
from swimbladder.errors import (
    InputError,
    LogError,
    NoAnswerError,
    Parameter,
    check_number,
    column_as,
)
from swimbladder.io.files import read_at_most, temporary_folder, write_csv
from swimbladder.io.log_format import LogFormat
from swimbladder.io.log_text import MOST_BYTES
from swimbladder.io.logs import Log, read_log
from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import IdentifiedActuator, Vehicle

_NEAR = 0.002  # of the stroke, that counts as there
_SLOW = 120.0  # s, after which a move counts as over


# A drive moves the piston and keeps it where it is: from now on it is to `stay`, or to `go` to a
# volume [m3]. `done` says whether it has arrived; a `command` is in V, or in m3 for a positioner.


class _Timed:
    """A voltage for a time, as the paper has it; between them, what holds against the sea."""

    def __init__(self, actuator: IdentifiedActuator, limit: float, sample_time: float) -> None:
        self._a, self._limit, self._tick = actuator, limit, sample_time
        self._pulse, self._left = 0.0, 0
        self._depth = math.nan  # m, at the last sample

    def stay(self, seen: Measurement) -> None:  # noqa: ARG002 - a spindle stays by itself
        self._left = 0

    def go(self, volume: float, seen: Measurement) -> None:
        dx = (volume - seen.volume) / self._a.piston_area
        self._pulse, self._left = timed_voltage(
            dx, K1=self._a.K1, limit=self._limit, sample_time=self._tick
        )

    def done(self, seen: Measurement) -> bool:  # noqa: ARG002
        return self._left <= 0

    def command(self, seen: Measurement) -> float:
        before = seen.depth if math.isnan(self._depth) else self._depth
        self._depth = seen.depth
        if self._left > 0:
            self._left -= 1
            return self._pulse
        # Held until the next sample: the depth half way there, or the piston creeps as it goes.
        return self._a.depth_voltage * (seen.depth + 0.5 * (seen.depth - before))


class _Servo:
    """Where the piston is to be: a positioner takes that, else the inner loop of a cascade does."""

    def __init__(self, near: float, k_pV: float | None = None, limit: float = math.inf) -> None:
        self._near, self._k_pV, self._limit = near, k_pV, limit
        self._volume, self._until = 0.0, 0.0

    def stay(self, seen: Measurement) -> None:
        self._volume = seen.volume

    def go(self, volume: float, seen: Measurement) -> None:
        self._volume, self._until = volume, seen.time + _SLOW

    def done(self, seen: Measurement) -> bool:
        return abs(seen.volume - self._volume) <= self._near or seen.time > self._until

    def command(self, seen: Measurement) -> float:
        if self._k_pV is None:
            return self._volume
        u = self._k_pV * (self._volume - seen.volume)
        return math.copysign(min(abs(u), self._limit), u)


def manual_drive_of(vehicle: Vehicle) -> _Timed | _Servo:
    """Return what moves the piston of a vehicle with a controller.

    Raises InputError where nothing known can: a voltage-driven one without a cascade.
    """
    near = _NEAR * (vehicle.stroke.maximum - vehicle.stroke.minimum)
    assert vehicle.controller is not None
    if not vehicle.voltage_driven:
        return _Servo(near)
    assert vehicle.supply is not None
    limit = vehicle.supply.voltage
    if isinstance(vehicle.engine, IdentifiedActuator):
        return _Timed(vehicle.engine, limit, vehicle.controller.sample_time)
    law, parameters = bind(vehicle.controller)
    if not isinstance(parameters, CascadeParameters):
        what = "a rehearsal moves the piston with the inner loop of a cascade"
        remedy = "Give the vehicle that controller"
        raise InputError(what, field="controller.law", value=law.name, remedy=remedy)
    return _Servo(near, parameters.k_pV, limit)


Does = Literal["hold", "halt", "move", "glide", "arrived", "over", "gave up"]

_SINK = 0.1  # of the volume to the end of the stroke, below neutral: it lies on the bottom at first
_HALT = 0.6  # s, for the motor to stop
_AFTER = 3.0  # s of the glide's end that are logged before the loop is closed again
_PATIENCE = 1200.0  # s, longest that coming to rest may take


class Performed(NamedTuple):
    """An experiment as logged; phases: when each began [s], and what it was."""

    time: Array  # s
    depth: Array  # m
    volume: Array  # m3, from mid-stroke
    command: Array  # V; m3 for a positioner
    phases: tuple[tuple[float, Does], ...]


class Operator:
    """Does one experiment after the other, each from where the one before ended."""

    def __init__(
        self, believed: Vehicle, truth: Vehicle, *, bottom_depth: float, seed: int
    ) -> None:
        """Put the vehicle on the bottom.

        Raises InputError where the procedure cannot be done with this vehicle.
        """
        if believed.controller is None:
            what = f"the vehicle {believed.name!r} has no controller to come to rest with"
            remedy = "Add a [controller] table to the vehicle"
            raise InputError(what, field="controller", remedy=remedy)
        if truth.voltage_driven != believed.voltage_driven:
            what = "its actuator does not take the commands of the believed vehicle"
            remedy = "Give one with the same kind of actuator"
            raise InputError(what, field="truth", value=truth.name, remedy=remedy)
        self.believed, self.truth = believed, truth
        self.bottom_depth, self.seed = bottom_depth, seed
        self._time, self._runs = 0.0, 0
        self._depth, self._speed = bottom_depth, 0.0
        neutral = truth.neutral_volume(bottom_depth)
        self._volume = neutral - _SINK * (neutral - truth.stroke.minimum)

    def perform(self, task: Task) -> Performed:
        """Return what is logged while a task is done, from coming to rest to the glide's end.

        Raises NoAnswerError where the vehicle does not come to rest.
        """
        assert self.believed.controller is not None
        work = _Work(self.believed, task)
        notes: list[tuple[Measurement, float, Does]] = []

        def law(seen: Measurement, _: float) -> tuple[float, float]:
            command, does = work.step(seen)
            notes.append((seen, command, does))
            return command, math.inf if does in ("over", "gave up") else 0.0

        s = simulate(
            self.truth,
            setpoints=[(0.0, self.bottom_depth)],
            duration=_PATIENCE + task.longest + 120.0,
            start_depth=self._depth,
            start_speed=self._speed,
            start_volume=self._volume,
            bottom_depth=self.bottom_depth,
            seed=self.seed + self._runs,
            law=law,
            sample_time=self.believed.controller.sample_time,
            checked=False,
        )
        if notes[-1][2] != "over":
            where = f"{task.start:.2f} m in {_PATIENCE / 60.0:g} min. Tune its controller"
            why = f"the vehicle did not come to rest at {where}" if s.finished else s.stop.value
            when = self._time + notes[-1][0].time
            raise NoAnswerError(f"The rehearsal stopped at {when:.0f} s: {why}")
        n, began = len(notes) - 1, self._time
        self._time, self._runs = began + notes[-1][0].time, self._runs + 1
        self._depth, self._speed, self._volume = (float(x[n]) for x in (s.depth, s.speed, s.volume))
        rows = [(began + m.time, m.depth, m.volume, u) for m, u, _ in notes[:-1]]
        groups = groupby(notes[:-1], key=itemgetter(2))
        phases = tuple((began + next(group)[0].time, does) for does, group in groups)
        time, depth, volume, command = np.array(rows).T
        return Performed(time, depth, volume, command, phases)


class _Work:
    """One experiment: what the operator does at each sample."""

    def __init__(self, vehicle: Vehicle, task: Task) -> None:
        assert vehicle.controller is not None
        assert task.start is not None
        self._law, self._parameters = bind(vehicle.controller)
        self._drive = manual_drive_of(vehicle)
        self._task, self._start = task, task.start
        self._turns = [Move(volume=task.change), *task.turns]
        self._rules = Rules()
        self._does: Does = "hold"
        self._state: Any = None
        self._window = protocol.EMPTY
        self._tick = vehicle.controller.sample_time
        self._began = self._neutral = self._released = 0.0
        self._seen: list[float] = []
        self._deepest, self._shallowest = -math.inf, math.inf  # since the last change of volume

    def step(self, seen: Measurement) -> tuple[float, Does]:
        """Return the command and what it is for."""
        if self._does == "hold":
            self._hold(seen)
        if self._does == "halt" and seen.time - self._began >= _HALT - 1e-9:
            self._released = seen.time
            self._move(seen)
        if self._does == "move" and self._drive.done(seen):
            self._does = "glide"
        if self._does == "glide":
            self._glide(seen)
        elif self._does == "arrived" and seen.time - self._began > _AFTER:
            self._does = "over"
        if self._does == "hold":
            step: Any = self._law.step
            command, self._state, _ = step(self._parameters, self._state, seen, self._start)
            self._window = protocol.extend(self._window, seen.depth - self._start, seen.volume)
            return float(command), "hold"
        return self._drive.command(seen), self._does

    def _hold(self, seen: Measurement) -> None:
        """Bring the vehicle to rest; when it has been for a minute, open the loop."""
        if self._state is None:
            initial: Any = self._law.initial
            self._state = initial(self._parameters, seen, self._start)
        w, r = self._window, self._rules
        if w.samples * self._tick < r.minute - 1e-9:
            return
        still = abs(protocol.slope(w, self._tick)) <= r.rest_speed
        if still and abs(w.z / w.samples) <= r.rest_distance:
            self._neutral, self._began, self._does = w.V / w.samples, seen.time, "halt"
            self._drive.stay(seen)
        elif seen.time > _PATIENCE:
            self._does = "gave up"
            self._drive.stay(seen)
        else:
            self._window = protocol.EMPTY

    def _move(self, seen: Measurement) -> None:
        self._drive.go(self._neutral + self._turns.pop(0).volume, seen)
        self._does, self._seen = "move", []
        self._deepest, self._shallowest = -math.inf, math.inf

    def _glide(self, seen: Measurement) -> None:
        """Wait for the place of the next change of volume, or for the end."""
        task = self._task
        self._seen = [*self._seen[-2:], seen.depth]
        depth = sorted(self._seen)[len(self._seen) // 2]
        self._deepest, self._shallowest = max(self._deepest, depth), min(self._shallowest, depth)
        if self._turns:
            place, up = self._turns[0].depth, self._turns[0].going == "up"
            assert place is not None  # of the first alone, which is the release
            if depth <= place < self._deepest if up else depth >= place > self._shallowest:
                self._move(seen)
                return
        risen = depth <= task.shallowest and depth < self._deepest - 0.02
        sunk = depth >= task.deepest and depth > self._shallowest + 0.02
        if risen or sunk or seen.time - self._released > task.longest:
            self._does, self._began = "arrived", seen.time
            self._drive.stay(seen)


_EARLY = 20  # lines, up to which a log that cannot be read may just not be there yet
_ENDS = (b"\n", b"\r")


class Growth(NamedTuple):
    """What a read of the file found. new: the log is another one than before."""

    samples: list[Sample]
    new: bool
    state: Literal["missing", "still", "grown"]


class GrowingLog:
    """Reads what a logger has written so far, in bursts, cut or begun anew as it may be.

    The whole of the file is read each time it has grown, by the same reader as everywhere, so that
    units, pressures and times mean what they mean elsewhere; only what is new is handed on. A last
    line without its end is left for later. A file that is cut is waited for: it may be written
    again; one that goes on differently is another log.
    """

    def __init__(
        self, path: Path, vehicle: Vehicle, *, columns: Mapping[str, str], log_format: LogFormat
    ) -> None:
        self.path, self.vehicle, self.columns = path, vehicle, dict(columns)
        self.log_format = log_format
        self.report: tuple[str, ...] = ()
        self.trouble: LogError | None = None
        self.cost = 0.0  # s, of the last reading
        self._data = b""
        self._known: Array = np.empty((0, 3))

    def read_new(self) -> Growth:
        """Return what is new; raises LogError where the file is no such log."""
        try:
            data = read_at_most(self.path, MOST_BYTES)
        except FileNotFoundError:
            return Growth([], False, "missing")
        except OSError as error:
            what = f"cannot be read: {error.strerror or error}"
            remedy = "Check the path and its permissions"
            raise LogError(
                what, file=self.path, field=Parameter("follow"), remedy=remedy
            ) from error
        data = data[: max(data.rfind(end) for end in _ENDS) + 1]
        if data == self._data or self._data.startswith(data):
            return Growth([], False, "still")
        begin = time.perf_counter()
        other = not data.startswith(self._data)
        rows = self._rows(data)
        self.cost = time.perf_counter() - begin
        if rows is None:
            return Growth([], False, "grown")
        n = len(self._known)
        new = n > 0 and (other or len(rows) < n or not np.array_equal(rows[:n], self._known))
        self._data, self._known = data, rows
        return Growth([Sample(*row) for row in rows[0 if new else n :].tolist()], new, "grown")

    def _rows(self, data: bytes) -> Array | None:
        """Return all rows of the text; None where it is too short to be a log yet."""
        folder = temporary_folder(Path(tempfile.gettempdir()))
        try:
            copy = folder / self.path.name
            copy.write_bytes(data)
            log = read_log(copy, columns=self.columns, log_format=self.log_format)
            rows = samples_of(log, self.vehicle)
        except LogError as error:
            self.trouble = error.but(file=self.path)
            if data.count(b"\n") + data.count(b"\r") > _EARLY:
                raise self.trouble from None
            return None
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        self.trouble, self.report = None, log.report
        return rows


def samples_of(log: Log, vehicle: Vehicle) -> Array:
    """Return time [s], depth [m] and volume [m3] of a log as rows.

    Raises LogError where the log has no volume.
    """
    volume, area = log.volume, vehicle.piston_area
    if volume is None and log.piston is not None and area is not None:
        volume = log.piston * area
    if volume is None:
        what = "the log has no volume, so a change of it cannot be seen"
        field = "volume_m3 or piston_m"
        remedy = f"Say which column it is with {column_as('volume_m3', 'NAME@cm3')} or "
        remedy += column_as("piston_m", "NAME@mm")
        raise LogError(what, file=log.source, field=field, remedy=remedy)
    rows = np.column_stack([log.time, log.depth, volume])
    return rows[np.isfinite(rows).all(axis=1)]


_PERIOD = 0.5  # s between two reads of the file
_IDLE = 4.0  # times what reading it takes, at least
_BURST = 1.0  # s of a rehearsal's clock between two reads


def check_waiting(*, timeout: float | None = None, real_time_factor: float | None = None) -> None:
    """Raise InputError for a time or a factor with which nothing comes; None: any."""
    how = "Give a time, or do not wait where a log is finished"
    check_number(timeout, "timeout", "s", above=0.0, most=math.inf, remedy=how)
    how = "Give simulated seconds a second, or leave it out"
    check_number(real_time_factor, "real_time_factor", above=0.0, most=math.inf, remedy=how)


def follow(
    day: PoolDay,
    tail: GrowingLog,
    *,
    timeout: float,
    sleep: Callable[[float], None] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[News | None]:
    """Yield what happens in a growing log until it is good enough, and None at every read.

    timeout: ends when the log has not grown for so long [s]. Raises LogError where there is no log
    by then, or it cannot be used.
    """
    check_waiting(timeout=timeout)
    grown, seen = clock(), False
    yield from day.begin_log(str(tail.path))
    while True:
        growth = tail.read_new()
        if growth.new:
            yield from day.begin_log(str(tail.path))
            yield News("log", 0.0, f"{tail.path} begins anew: it is taken as another log.")
        yield from day.feed(growth.samples)
        yield None
        if growth.state == "grown":  # a fit may have taken longer than the log may stand still
            grown, seen = clock(), True
        if day.verdict.good:
            return
        if clock() - grown > timeout:
            break
        sleep(max(_PERIOD, _IDLE * tail.cost))
    if tail.trouble is not None:
        raise tail.trouble
    if not seen:
        what = f"there is no log, after {timeout:g} s"
        remedy = "Check the path, or give more `timeout=`"
        raise LogError(what, file=tail.path, field=Parameter("follow"), remedy=remedy)
    yield from day.end_log()
    yield News("log", 0.0, f"{tail.path} has not grown for {timeout:g} s: taken as finished.")


def finished(day: PoolDay, tail: GrowingLog) -> Iterator[News | None]:
    """Yield what happened in a log that is finished; raises LogError where it cannot be used."""
    log = read_log(tail.path, columns=tail.columns, log_format=tail.log_format)
    tail.report = log.report
    yield from day.begin_log(str(tail.path))
    yield from day.feed(Sample(*row) for row in samples_of(log, day.vehicle).tolist())
    yield from day.end_log()
    yield None


def rehearse(
    day: PoolDay,
    operator: Operator,
    *,
    most: int,
    speed: float,
    whole: Path,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[News | None]:
    """Yield what happens in a rehearsal of at most so many experiments; None at every step.

    speed: simulated seconds a second, inf for no waiting. whole: the log of all of it, as far as
    it has come. Raises NoAnswerError where the vehicle does not come to rest or does not arrive.
    """
    check_waiting(real_time_factor=speed)
    yield from day.begin_log("rehearsal")
    command = "voltage_V" if day.vehicle.voltage_driven else "reference_volume_m3"
    names = ("time_s", "depth_m", "volume_m3", command)
    done = np.empty((len(names), 0))
    for _ in range(most):
        p = operator.perform(day.next)
        done = np.hstack([done, p[:4]])
        write_csv(whole, dict(zip(names, done, strict=True)))
        rows = np.column_stack(p[:3])
        due = np.searchsorted(p.time, np.arange(p.time[0], p.time[-1], _BURST * min(speed, 60.0)))
        for first, last in zip(due, [*due[1:], len(rows)], strict=True):
            yield from day.feed(Sample(*row) for row in rows[first:last].tolist())
            yield None
            if np.isfinite(speed):
                sleep((p.time[last - 1] - p.time[first]) / speed)
        if day.verdict.good or day.verdict.state == State.LIMITED:
            return
    yield from day.end_log()
