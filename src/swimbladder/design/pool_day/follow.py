"""The two ways through a day: a log that grows, and a rehearsal; both yield what happens.

`GrowingLog` says what is new in a log that grows since it was last read.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.pool_day.day import News, PoolDay
from swimbladder.design.pool_day.rehearsal import Operator
from swimbladder.design.pool_day.segments import Sample
from swimbladder.design.pool_day.verdict import State
from swimbladder.errors import LogError, Parameter, check_number, column_as
from swimbladder.io.files import read_at_most, temporary_folder
from swimbladder.io.log_format import LogFormat
from swimbladder.io.log_text import MOST_BYTES
from swimbladder.io.logs import Log, read_log
from swimbladder.io.tables import write_csv
from swimbladder.vehicle import Vehicle

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
        self._known: NDArray[np.float64] = np.empty((0, 3))

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

    def _rows(self, data: bytes) -> NDArray[np.float64] | None:
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


def samples_of(log: Log, vehicle: Vehicle) -> NDArray[np.float64]:
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


def check_waiting(*, timeout: float | None = None, speed: float | None = None) -> None:
    """Raise InputError for a time or a speed with which nothing comes; None: any."""
    for field, value, unit, remedy in (
        ("timeout", timeout, "s", "Give a time, or do not wait where a log is finished"),
        ("speed", speed, "", "Give simulated seconds a second, or leave it out"),
    ):
        if value is not None:
            check_number(value, field, unit, above=0.0, finite=False, remedy=remedy)


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
    check_waiting(speed=speed)
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
