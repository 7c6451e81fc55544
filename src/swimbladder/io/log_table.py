"""The columns of a log as numbers in SI, with line numbers: rows chosen, texts read.

What is no number is remembered with its row. Times become seconds: of a number, a counter, ISO
8601, a clock or a pattern.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, LogError, Parameter, column_as
from swimbladder.io.columns import TEXT
from swimbladder.io.log_format import COLUMNS, LogColumn, bracketed, column_factor
from swimbladder.io.log_rows import Column, Sheet, chosen, open_sheet
from swimbladder.io.log_text import LogFile, counted
from swimbladder.physics.arrays import Array, Flags

Instant = Callable[[str], tuple[float, bool]]

_ISO = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d\d")
_CLOCK = re.compile(r"(\d{1,3}):([0-5]\d):([0-5]\d(?:[.,]\d{1,9})?)")
_DAY = 86400.0
_CHOICES = 40  # values of a column that an error names
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
            remedy = 'Add tick = "30.5 us", or tick = "32768 Hz", to the [log] table'
            raise file.refused("the length of a tick is missing", remedy, "tick")
        tick = form.tick
    else:
        remedy = 'Map the time with unit = "tick", or leave {} out'
        file.refuse_unused(["tick"], "the unit of the time is not tick", remedy)
    if form.counter_bits is None:
        if form.rows == "ordered":
            _refuse_unsaid_turn(values, column, line, file)
        return values, tick
    period = 2.0**form.counter_bits
    known = np.isfinite(values)
    wrong = known & ~((values >= 0.0) & (values < period) & (values == np.floor(values)))
    if wrong.any():
        at = int(np.flatnonzero(wrong)[0])
        what = f"a counter of {form.counter_bits} bits does not hold this"
        remedy = "Check counter_bits in the [log] table"
        raise file.refused(what, remedy, column.name, line=line[at], value=float(values[at]))
    values, turns = _unwound(values, period)
    if len(turns):
        times = counted(len(turns), "time")
        began = f"began again {times}, first on line {line[turns[0]]}"
        unseen = "more than a turn within a gap cannot be seen"
        file.report.append(f"the counter of {form.counter_bits} bits {began}; {unseen}")
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
            what = f"time goes back from {before:.17g}, as a counter of {bits} bits does"
            remedy = f"If it is one, set counter_bits = {bits} in a [log] table"
            row, value = line[known[falls[0] + 1]], float(after)
            raise file.refused(what, remedy, column.name, line=row, value=value)


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
        return (
            f"If it is a time in ISO 8601, map it with {column_as('time_s', f'{column.name}@iso')}"
        )
    if re.match(r"\d{1,2}[./-]\d{1,2}[./-]\d{2,4}", text):
        return f"If it is a date, state its pattern in a [log] table: {_PATTERN}"
    if _CLOCK.match(text):
        return (
            f"If it is a time of the day, map it with {column_as('time_s', f'{column.name}@clock')}"
        )
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
        remedy = f"Known are %{', %'.join(sorted(_DIRECTIVES))}; for example {_PATTERN}"
        raise file.refused(what, remedy, "time_s", value=unit)
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


def number(text: str, *, comma: bool) -> float | None:
    """Return a text as a number; None where it is none."""
    if "_" in text or (comma and "." in text):
        return None
    try:
        return float((text.replace(",", ".") if comma else text).replace("−", "-"))
    except ValueError:
        return None


def column_texts(column: Column) -> list[str]:
    """Return a column as texts, numbers as Python writes them."""
    return column if isinstance(column, list) else [repr(value) for value in column.tolist()]


class RowTest:
    """Whether rows hold a value in a column, as a number where both are numbers."""

    def __init__(self, file: LogFile, header: list[str], name: str, value: str | float) -> None:
        if header.count(name) != 1:
            what = "no such column to choose rows by" if name not in header else "two such columns"
            remedy = f"Columns of the file: {', '.join(header[:30])}"
            raise file.refused(what, remedy, Parameter("where"), value=name)
        self.name, self._text, self.seen = name, str(value).strip(), dict[str, None]()
        self._comma = file.form.decimal == ","
        try:
            self._number = float(value)
        except ValueError:
            self._number = math.nan

    def of(self, column: Column) -> Flags:
        """Return for each row whether it holds the value; remember which ones there are."""
        texts = [text.strip() for text in column_texts(column)]
        if len(self.seen) <= _CHOICES:
            self.seen |= dict.fromkeys(texts)
        same = {t: number(t, comma=self._comma) == self._number for t in set(texts)}
        return np.array([text == self._text or same[text] for text in texts], dtype=bool)


def none_chosen(
    file: LogFile, total: int, where: Mapping[str, str | float], seen: Iterable[str]
) -> LogError:
    """Return the error for a log of which no row is left, with what the column holds."""
    found = [*seen]
    more = ", ..." if len(found) > _CHOICES else ""
    choices = ", ".join(text[:40] for text in found[:_CHOICES]) + more
    what = f"none of {total} rows is chosen"
    remedy = f"Choose one of: {choices}"
    asked = ", ".join(f"{name}={value}" for name, value in where.items())
    return file.refused(what, remedy, Parameter("where"), value=asked)


_MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "+inf", "-inf", "nat", "#n/a"}
_FIRST = 100  # rows that say what the mark before the decimals is
_LARGEST = 1e15  # in SI: no number of a log is larger, and their products stay finite
# The largest that a vehicle measures, in SI, and the unit in which it is likely where it is more.
_MOST = {
    "depth_m": (1.2e4, "cm"),
    "pressure_Pa": (1.2e8, "UNIT"),
    "speed_m_s": (100.0, "cm/s"),
    "volume_m3": (100.0, "mL"),
    "piston_m": (100.0, "mm"),
    "voltage_V": (1e3, "mV"),
    "current_A": (1e3, "mA"),
}


class ColumnReader:
    """Turns the texts of columns into numbers; remembers which rows hold something else."""

    def __init__(
        self,
        file: LogFile,
        sources: Mapping[str, LogColumn],
        units: Mapping[str, str],
        labels: Collection[str] = (),
    ) -> None:
        """Read the columns of the file, `sources`, in the units of their names.

        labels: columns that may hold texts, which are numbered in their order.
        """
        self.file, self.form, self.units = file, file.form, units
        self.sources, self.rows = dict(sources), 0
        self.texts: dict[str, Any] = {name: [] for name in sorted(set(labels) & set(sources))}
        self.conversions = list[str]()
        self.times = TimeColumn()
        self._comma = self.form.decimal == ","
        self._missing = frozenset(_MISSING | {text.strip().lower() for text in self.form.missing})
        said = (number(text, comma=self.form.decimal == ",") for text in self.form.missing)
        self._absent = [value for value in said if value is not None]
        self._lines: list[NDArray[np.int64]] = []
        self._parts: dict[str, list[Array]] = {name: [] for name in sources}
        self._zones: dict[bool, str] = {}
        self._bad: dict[int, LogError] = {}  # by row

    def add(self, line: NDArray[np.int64], columns: Mapping[str, Column]) -> None:
        """Read rows more: their lines, and the columns of the file."""
        if not self.rows:
            self._comma = self._comma or self._has_decimal_commas(columns.values())
            for name, column in self.sources.items():
                self.sources[name] = text_unit(name, column, columns[column.name], self.file)
        for name, column in self.sources.items():
            given = columns[column.name]
            if name in self.texts:
                self.texts[name] += [text.strip() for text in column_texts(given)]
            elif name == "time_s" and reads_text(column):
                days = None if column.date is None else columns[column.date]
                self._parts[name].append(self._times(column, given, days, line))
            else:
                self._parts[name].append(self._numbers(name, column, given, line))
        self._lines.append(line)
        self.rows += len(line)

    def values(self) -> tuple[dict[str, Array], NDArray[np.int64]]:
        """Return the columns in the units of their names, and their lines.

        Raises LogError for rows with anything but numbers, unless such rows may go, and for a unit
        that is of another kind.
        """
        self._line = np.concatenate(self._lines)
        self._lines.clear()
        for name, texts in self.texts.items():
            numbers, self.texts[name] = _numbered(texts)
            self._parts[name] = [self._numbers(name, self.sources[name], numbers, self._line)]
        if len(self._zones) == 2:
            what = "some times have a zone and others have none"
            remedy, other = "Give all of them a zone, or none", [*self._zones.values()][-1]
            name = self.sources["time_s"].name
            raise self.file.refused(what, remedy, name, value=other)
        self._refuse_bad()  # first: it may be why the rest makes no sense
        found = {}
        for name, column in self.sources.items():
            parts = self._parts.pop(name)
            found[name] = self._in_unit(name, column, np.concatenate(parts))
        self._refuse_bad()
        if not self._bad:
            return found, self._line
        first, rows = self._bad[min(self._bad)], counted(len(self._bad), "row")
        where = f"on line {first.line} ({first.field}: {str(first.value)[:40]!r})"
        said = f"{rows} with anything but a number dropped, the first {where}"
        self.file.report.append(said)
        kept = np.ones(self.rows, dtype=bool)
        kept[list(self._bad)] = False
        return {name: column[kept] for name, column in found.items()}, self._line[kept]

    def _has_decimal_commas(self, columns: Iterable[Column]) -> bool:
        """Say whether numbers can only have decimal commas: one without three digits, no point."""
        every = [column for column in columns if isinstance(column, list)]
        texts = [text.strip() for column in every for text in column[:_FIRST]]
        commas = [text for text in texts if re.fullmatch(r"[-+]?\d+,\d+", text)]
        points = any(re.fullmatch(r"[-+]?\d*\.\d+", text) for text in texts)
        sure = [text for text in commas if len(text.partition(",")[2]) != 3]
        if points or not sure:
            return False
        self.conversions.append("the numbers have decimal commas")
        return True

    def _refuse_bad(self) -> None:
        """Raise LogError for the first row with anything but a number, unless such rows may go."""
        if self._bad and (self.form.bad_rows == "refuse" or len(self._bad) > self.rows / 2):
            raise self._bad[min(self._bad)]

    def _in_unit(self, name: str, column: LogColumn, values: Array) -> Array:
        """Return a column in the unit of its name; raises LogError where its own unit is none."""
        factor = None
        if name == "time_s":
            if reads_text(column):
                self.times = TimeColumn(column.name, None)
                return self._seconds(column, values)
            values, factor = counter_seconds(values, column, self._line, self.file)
        unit = self.units[name]
        if unit == "degC" and _unit(column) == "K":
            self.conversions.append(f"{column.name} is in kelvin; 273.15 subtracted")
            return values - 273.15
        factor = factor if factor is not None else self._factor(name, column)
        if name == "time_s":
            self.times = TimeColumn(column.name, 1.0 if factor is None else factor)
        if column.name != name:
            stated = f"taken to be in {unit}" if factor is None else f"times {factor:g} for {unit}"
            stated = f"in {unit}" if factor == 1.0 else stated
            stated = stated if unit else "a number without unit"
            self.conversions.append(f"{name} read from {column.name!r}, {stated}")
        values = values if factor is None else _scaled(values, factor)
        most, likely = _MOST.get(name.removeprefix("reference_"), (_LARGEST, "UNIT"))
        wild = np.flatnonzero(np.abs(values) > most)
        what = f"too large for anything measured, {most:g} at most"
        how = column_as(name, f"{column.name}@{likely}")
        remedy = f"State its unit: {how}; or, in a [log] table, "
        remedy += 'what stands for no number as missing, or bad_rows = "drop"'
        for k in wild.tolist():
            self._spoilt(k, self._line[k], column, what, remedy, float(values[k]), unit)
        values[wild] = np.nan
        return values

    def _spoilt(
        self,
        k: int,
        line: int,
        column: LogColumn,
        what: str,
        remedy: str,
        value: object,
        unit: str = "",
    ) -> None:
        """Remember that row k holds no number, and where that was first found."""
        if k not in self._bad:
            name = column.name
            error = self.file.refused(what, remedy, name, line=line, value=value, unit=unit)
            self._bad[k] = error

    def _times(
        self, column: LogColumn, given: Column, days: Column | None, line: NDArray[np.int64]
    ) -> Array:
        """Return times that are text in seconds, NaN where missing; raises LogError for a unit
        that is no pattern.
        """
        why = f"the time is no number but {column.unit}"
        self.file.refuse_unused(("tick", "counter_bits"), why)
        instant = _instant(column, self.file)
        texts = [text.strip() for text in column_texts(given)]
        dates = [""] * len(texts) if days is None else map(str.strip, column_texts(days))
        between = "T" if column.unit == "iso" else " "
        values = np.full(len(texts), np.nan)
        for k, (day, time) in enumerate(zip(dates, texts, strict=True)):
            if time.lower() in self._missing or (column.date and day.lower() in self._missing):
                continue
            try:
                values[k], zoned = instant(f"{day}{between}{time}" if column.date else time)
            except (ValueError, OverflowError):
                what = "not a time in ISO 8601" if column.unit == "iso" else "not a time"
                text = f"{day} {time}".strip()
                remedy = time_remedy(column, text)
                self._spoilt(self.rows + k, line[k], column, what, remedy, text)
            else:
                self._zones.setdefault(zoned, time)
        return values

    def _seconds(self, column: LogColumn, values: Array) -> Array:
        """Return times in seconds from the first; times of the day are unwound over midnight."""
        if column.unit == "clock" or (column.date is None and _dateless(column.unit or "")):
            values = _unwound(values, _DAY)[0]
        found = values[np.isfinite(values)]
        how = {"iso": "ISO 8601", "clock": "times of the day"}.get(column.unit or "", column.unit)
        read = f"time_s read from {column.name!r} as {how}"
        self.conversions.append(f"{read}, in seconds from the first")
        return values - (found[0] if len(found) else 0.0)

    def _numbers(
        self, name: str, column: LogColumn, given: Column, line: NDArray[np.int64]
    ) -> Array:
        """Return the numbers of a column as they are written."""
        if column.date is not None:
            what = "a column with the date goes with a time of the day"
            remedy = 'Map it with unit = "iso", or with a pattern'
            raise self.file.refused(what, remedy, name, value=column.date)
        values = given if not isinstance(given, list) else self._fast(given)
        if values is None:
            found = [number(text, comma=self._comma) for text in given]
            values = np.array([math.nan if one is None else one for one in found])
            for k in (k for k, one in enumerate(found) if one is None):
                text = str(given[k]).strip()
                if text.lower() not in self._missing:
                    self._not_a_number(name, column, k, line[k], text)
        return np.where(np.isfinite(values) & ~np.isin(values, self._absent), values, np.nan)

    def _fast(self, texts: list[str]) -> Array | None:
        """Return texts as numbers at once; None where one may be none, or has a decimal comma."""
        try:
            odd = self._comma or "_" in "".join(texts)
            return None if odd else np.array(texts, dtype=np.float64)
        except ValueError:
            return None

    def _factor(self, name: str, column: LogColumn) -> float | None:
        try:
            return column_factor(column, self.units[name])
        except InputError as error:
            remedy = error.remedy or ""
            if name != "time_s" and column.unit in ("iso", "clock", "tick"):
                remedy = f"Only time_s is read as {column.unit}"
            if name != "time_s" or column.unit is None:
                remedy += f"; state the unit with {column_as(name, f'{column.name}@UNIT')}"
            if name == "time_s":
                remedy += "; for times that are no numbers see iso, clock and patterns"
            given, unit = column.unit or column.name, self.units[name]
            raise self.file.refused(error.what, remedy, name, value=given, unit=unit) from None

    def _not_a_number(self, name: str, column: LogColumn, k: int, line: int, text: str) -> None:
        """Remember a field that is no number, with what it looks like as remedy."""
        remedy = time_remedy(column, text) if name == "time_s" else ""
        if not remedy and "," in text and self.form.decimal == ".":
            remedy = 'If it is a decimal comma, set decimal = "," in a [log] table (`log_format=`)'
        if not remedy and self.rows + k == 0 and not any(letter.isdigit() for letter in text[:20]):
            remedy = "If this row holds the units, set units_row = true in a [log] table"
        drop = 'or set bad_rows = "drop" in a [log] table'
        correct = "Correct the field, leave it empty where nothing was measured"
        remedy = remedy or f"{correct}, {drop}"
        self._spoilt(self.rows + k, line, column, "not a number", remedy, text)


def _scaled(values: Array, factor: float) -> Array:
    """Return values in another unit, each the float nearest to what was written."""
    parts = round(1.0 / factor) if factor < 1.0 else 1
    with np.errstate(over="ignore"):
        return values / parts if parts > 1 and 1.0 / parts == factor else values * factor


def text_unit(name: str, column: LogColumn, texts: Column, file: LogFile) -> LogColumn:
    """Return a column, of times that are texts with what they are: ISO 8601, or of the day.

    Raises LogError where the column is taken for the time by its name alone, and says no unit.
    """
    if name != "time_s" or column.date or column.unit not in (None, TEXT):
        return column
    found = (text.strip() for text in texts) if isinstance(texts, list) else ()
    first = next(filter(None, found), "")
    for unit, pattern in {"iso": _ISO, "clock": _CLOCK}.items():
        if pattern.match(first):
            return LogColumn(name=column.name, unit=unit)
    if column.unit == TEXT:
        what = "it may be the time, and says no unit"
        remedy = f"Say it: {column_as('time_s', f'{column.name}@s')}, or @ms, @min, @h"
        raise file.refused(what, remedy, name, value=column.name)
    return column


def _numbered(texts: list[str]) -> tuple[Column, tuple[str, ...]]:
    """Return texts as they are where all are numbers, else theirs from 1; and the texts."""
    found = tuple(dict.fromkeys(text for text in texts if text))
    try:
        [float(text or "nan") for text in found]
    except ValueError:
        numbers = {text: float(k) for k, text in enumerate(found, start=1)}
        return np.array([numbers.get(text, np.nan) for text in texts]), found
    return texts, found


Choose = Callable[[Sheet], dict[str, LogColumn]]


@dataclass(frozen=True, kw_only=True)
class Table:
    """Columns of numbers in the units of their names, NaN where there is none.

    sources: the column of the file for each. parts: how many times the header stands in the file;
    times: where the times are from. labels: the texts of numbered columns, in order.
    """

    values: dict[str, Array]
    sources: Mapping[str, LogColumn]
    line: NDArray[np.int64]
    parts: int
    times: TimeColumn
    labels: Mapping[str, tuple[str, ...]]

    def only(self, kept: Flags | NDArray[np.int64]) -> Table:
        """Return the table with the rows `kept`, a mask or an order."""
        values = {name: column[kept] for name, column in self.values.items()}
        return replace(self, values=values, line=self.line[kept])


def read_table(
    file: LogFile,
    where: Mapping[str, str | float],
    choose: Choose,
    wanted: Sequence[Collection[str]],
    units: Mapping[str, str] = COLUMNS,
    labels: Collection[str] = (),
    sheet: Sheet | None = None,
) -> Table:
    """Return the columns that `choose` names for the header, of the rows that hold `where`.

    wanted: of each of these sets the header has a name. units: of each column that may be named,
    those of a log unless others are given. labels: columns that may hold texts, which are
    numbered in their order. sheet: what is read in the file's place. Raises LogError with file,
    line, column and value.
    """
    sheet = sheet or open_sheet(file, [*wanted, *({name} for name in where)])
    sources = {name: _with_unit(name, c, sheet, units, file) for name, c in choose(sheet).items()}
    tests = [RowTest(file, sheet.header, name, value) for name, value in where.items()]
    dates = [column.date for column in sources.values() if column.date is not None]
    used = list(dict.fromkeys([*(c.name for c in sources.values()), *dates, *where]))
    reader, total, report = ColumnReader(file, sources, units, labels), 0, file.report
    for line, columns in sheet.chunks(used):
        total += len(line)
        kept = np.ones(len(line), dtype=bool)
        for test in tests:
            kept &= test.of(columns[test.name])
        if kept.all() and len(line):
            reader.add(line, columns)
        elif kept.any():
            reader.add(line[kept], {name: chosen(c, kept) for name, c in columns.items()})
    if not total:
        what = "the log has a header and no rows"
        raise file.refused(what, "Give a log with a row per sample", "rows")
    if not reader.rows:
        raise none_chosen(file, total, where, tests[0].seen)
    if tests:
        report.append(f"{reader.rows} of {total} rows chosen")
    values, line = reader.values()
    unused = [name for name in sheet.header if name and name not in used]
    if unused:
        more = ", ..." if len(unused) > 12 else ""
        report.append(f"columns not used: {', '.join(name[:40] for name in unused[:12])}{more}")
    report += reader.conversions
    parts, times, texts = sheet.parts, reader.times, reader.texts
    return Table(values=values, sources=sources, line=line, parts=parts, times=times, labels=texts)


def _with_unit(
    name: str, column: LogColumn, sheet: Sheet, units: Mapping[str, str], file: LogFile
) -> LogColumn:
    """Return a column with the unit of its mapping, else of the row of units, else of its name."""
    row = sheet.units.get(column.name)
    own = bracketed(column.name)
    if column.unit is not None or row is None:
        return column
    if (own is not None and own != row) or column.name == name:
        said = units[name] if column.name == name else own
        if row == said:
            return column
        what = f"the row of units says {row!r}, and the name of the column {said}"
        remedy = f'State the unit: {name} = {{ name = "{column.name}", unit = "{row}" }}'
        raise file.refused(what, remedy, column.name)
    return LogColumn(name=column.name, unit=row, date=column.date)
