"""The time of each row in seconds: a number, a counter, ISO 8601, a clock or a pattern."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.log_format import LogColumn, bracketed
from swimbladder.io.log_text import LogFile, counted

Array = NDArray[np.float64]
Instant = Callable[[str], tuple[float, bool]]

_CLOCK = re.compile(r"(\d{1,3}):([0-5]\d):([0-5]\d(?:[.,]\d{1,9})?)")
_DAY = 86400.0
_COUNTERS = (16, 24, 32)  # bits of the counters that are common
_DIRECTIVES = set("YymdHMSfIpzjbB%")
_DATES, _YEARS = set("mdjbB"), set("Yy")
_PATTERN = 'unit = "%d.%m.%Y %H:%M:%S" says day, month, year'


class TimeColumn(NamedTuple):
    """The column that times are read from, and what a number in it counts as [s].

    None where the times are texts or have been counted otherwise.
    """

    name: str = "NAME"
    seconds: float | None = 1.0


def reads_text(column: LogColumn) -> bool:
    """Say whether a time is text and no number: iso, clock or a pattern."""
    unit = column.unit or ""
    return unit in ("iso", "clock") or bool(re.search("%[A-Za-z]", unit))


def text_seconds(
    texts: Sequence[str],
    dates: Sequence[str] | None,
    column: LogColumn,
    missing: frozenset[str],
    file: LogFile,
) -> tuple[Array, list[int]]:
    """Return times in seconds, NaN where missing, and which of them are no times.

    Times of the day are unwound over midnight. Raises LogError where the unit is no pattern or
    some times have a zone and others have none.
    """
    instant = _instant(column, file)
    between = "T" if column.unit == "iso" else " "
    values = np.full(len(texts), np.nan)
    bad: list[int] = []
    zones: dict[bool, int] = {}
    for k, text in enumerate(texts):
        day, time = "" if dates is None else dates[k].strip(), text.strip()
        if time.lower() in missing or (dates is not None and day.lower() in missing):
            continue
        try:
            values[k], zoned = instant(time if dates is None else f"{day}{between}{time}")
        except (ValueError, OverflowError):
            bad.append(k)
        else:
            zones.setdefault(zoned, k)
    if len(zones) == 2:
        raise file.refused(
            "some times have a zone and others have none",
            field=column.name,
            value=texts[zones[max(zones, key=lambda zoned: zones[zoned])]].strip(),
            remedy="Give all of them a zone, or none",
        )
    if column.unit == "clock" or (dates is None and _dateless(column.unit or "")):
        values = _unwound(values, _DAY)[0]
    return values, bad


def counter_seconds(
    values: Array, column: LogColumn, line: NDArray[np.int64], file: LogFile
) -> tuple[Array, float | None]:
    """Return numbers with the turns of a counter unwound, and the length of a tick [s].

    The length is None where the unit is not tick. Raises LogError where the counter holds what it
    cannot hold, or ticks have no length.
    """
    form, tick = file.form, None
    if _unit(column) == "tick":
        if form.tick is None:
            raise file.refused(
                "the length of a tick is missing",
                field="tick",
                remedy='Add tick = "30.5 us", or tick = "32768 Hz", to the [log] table',
            )
        tick = form.tick
    elif form.tick is not None:
        raise file.refused(
            "the length of a tick has no use: the unit of the time is not tick",
            field="tick",
            value=form.tick,
            unit="s",
            remedy='Map the time with unit = "tick", or leave tick out',
        )
    if form.counter_bits is None:
        if form.rows == "ordered":
            _refuse_unsaid_turn(values, column, line, file)
        return values, tick
    period = 2.0**form.counter_bits
    known = np.isfinite(values)
    wrong = known & ~((values >= 0.0) & (values < period) & (values == np.floor(values)))
    if wrong.any():
        at = int(np.flatnonzero(wrong)[0])
        raise file.refused(
            f"a counter of {form.counter_bits} bits does not hold this",
            line=line[at],
            field=column.name,
            value=float(values[at]),
            remedy="Check counter_bits in the [log] table",
        )
    values, turns = _unwound(values, period)
    if len(turns):
        times = counted(len(turns), "time")
        file.report.append(
            f"the counter of {form.counter_bits} bits began again {times}, first on line "
            f"{line[turns[0]]}; more than a turn within a gap cannot be seen"
        )
    return values, tick


def _refuse_unsaid_turn(
    values: Array, column: LogColumn, line: NDArray[np.int64], file: LogFile
) -> None:
    """Raise LogError where the time falls like a counter that begins again."""
    known = np.flatnonzero(np.isfinite(values))
    falls = np.flatnonzero(np.diff(values[known]) < 0.0)
    if not len(falls):
        return
    before, after = values[known[falls[0]]], values[known[falls[0] + 1]]
    for bits in _COUNTERS:
        if 0.9 * 2.0**bits <= before < 2.0**bits and 0.0 <= after < 0.1 * 2.0**bits:
            raise file.refused(
                f"time goes back from {before:.17g}, as a counter of {bits} bits does",
                line=line[known[falls[0] + 1]],
                field=column.name,
                value=float(after),
                remedy=f"If it is one, set counter_bits = {bits} in a [log] table",
            )


def time_remedy(column: LogColumn, text: str) -> str:
    """Return what to do about a text that is no time."""
    if column.unit == "iso":
        if re.match(r"\d{1,2}[./-]\d{1,2}[./-]\d{2,4}", text):
            return f"Day and month can be read in two ways, so say which is which: {_PATTERN}"
        return f"Write times like 2023-04-14T10:31:05.5, or state their pattern: {_PATTERN}"
    if column.unit == "clock":
        return "Write times of the day like 10:31:05.5"
    if reads_text(column):
        return f"The pattern is {column.unit}"
    if re.match(r"\d{4}-?\d\d-?\d\d[T ]", text):
        return f'If it is a time in ISO 8601, map it with --column "time_s={column.name}@iso"'
    if re.match(r"\d{1,2}[./-]\d{1,2}[./-]\d{2,4}", text):
        return f"If it is a date, state its pattern in a [log] table: {_PATTERN}"
    if _CLOCK.match(text):
        return f'If it is a time of the day, map it with --column "time_s={column.name}@clock"'
    return ""


def _unit(column: LogColumn) -> str | None:
    return column.unit or bracketed(column.name)


def _dateless(unit: str) -> bool:
    return unit != "iso" and _YEARS.isdisjoint(re.findall("%(.?)", unit, re.DOTALL))


def _unwound(values: Array, period: float) -> tuple[Array, NDArray[np.int64]]:
    """Return values that fall by more than half a period raised by periods, and where they fall."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return values, known[:0]
    falls = np.diff(values[known]) < -period / 2.0
    result = values.copy()
    result[known] += period * np.append(0.0, np.cumsum(falls))
    return result, known[1:][falls]


def _instant(column: LogColumn, file: LogFile) -> Instant:
    """Return what turns a text into seconds, and says whether it had a zone."""
    unit = column.unit or ""
    if unit == "iso":
        return lambda text: _stamp(datetime.fromisoformat(text))
    if unit == "clock":
        return _clock
    letters = re.findall("%(.?)", unit, re.DOTALL)
    dated = not _DATES.isdisjoint(letters)
    if not _DIRECTIVES.issuperset(letters) or dated == _YEARS.isdisjoint(letters):
        what = "not a pattern of a time"
        if dated:
            what = "a pattern with a date needs the year"
        raise file.refused(
            what,
            field="time_s",
            value=unit,
            remedy=f"Known are %{', %'.join(sorted(_DIRECTIVES))}; for example {_PATTERN}",
        )
    return lambda text: _stamp(datetime.strptime(text, unit))


def _clock(text: str) -> tuple[float, bool]:
    match = _CLOCK.fullmatch(text)
    if match is None:
        raise ValueError(text)
    hours, minutes, seconds = match.groups()
    return 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds.replace(",", ".")), False


def _stamp(instant: datetime) -> tuple[float, bool]:
    """Return the seconds of an instant; one without a zone is taken as UTC."""
    if instant.tzinfo is None:
        return instant.replace(tzinfo=UTC).timestamp(), False
    return instant.timestamp(), True
