"""The two ways through a day: a log that grows, and a rehearsal; both yield what happens."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from swimbladder.design.pool_day.day import News, PoolDay
from swimbladder.design.pool_day.growing_log import GrowingLog, samples_of
from swimbladder.design.pool_day.rehearsal import Operator
from swimbladder.design.pool_day.segments import Sample
from swimbladder.design.pool_day.verdict import State
from swimbladder.errors import LogError, check_number
from swimbladder.io.logs import read_log
from swimbladder.io.tables import write_csv

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
    day: PoolDay, tail: GrowingLog, *, timeout: float, sleep: Callable[[float], None] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[News | None]:  # fmt: skip
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
        remedy = "Check the path, or give more --timeout"
        raise LogError(what, file=tail.path, field="--follow", remedy=remedy)
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
    day: PoolDay, operator: Operator, *, most: int, speed: float, whole: Path,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[News | None]:  # fmt: skip
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
