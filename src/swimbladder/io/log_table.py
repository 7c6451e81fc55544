"""The columns of a log as numbers, with line numbers: rows chosen, texts read, times in seconds.

Which column of the file each of them is read from is found first.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.log_format import COLUMNS, LogColumn, bracketed
from swimbladder.io.log_names import likely, meant_columns, text_unit
from swimbladder.io.log_numbers import ColumnReader, RowTest, TimeColumn, column_texts, none_chosen
from swimbladder.io.log_rows import Column, ParquetRows, Rows, Sheet, is_parquet
from swimbladder.io.log_text import LogFile, is_netcdf, read_bytes
from swimbladder.vehicle.schema import did_you_mean

Mapped = Mapping[str, LogColumn | str]


def mapped_columns(file: LogFile, columns: Mapped, required: Collection[str]) -> Mapped:
    """Return what is mapped; raises LogError where that, or what is required, is no column."""
    mapped: Mapped = {**file.form.columns.mapped(), **columns}
    check_columns(file, (*mapped, *required), COLUMNS, "a log")
    return mapped


def check_columns(
    file: LogFile, names: Collection[str], known: Mapping[str, str], table: str
) -> None:
    """Raise LogError for a name that is no column of such a table."""
    for name in names:
        if name not in known:
            remedy = f"{did_you_mean(name, known)}Columns: {', '.join(known)}"
            raise file.refused(f"no such column of {table}", remedy, name)


def wanted_names(mapped: Mapped, needed: Sequence[str]) -> list[set[str]]:
    """Return sets of names, of each of which the header has to have one."""
    wanted = [set(column_readings(given)) for given in mapped.values()]
    dates = [given.date for given in mapped.values() if isinstance(given, LogColumn)]
    wanted += [{date} for date in dates if date is not None]
    choices = [{"depth_m", "pressure_Pa"} if name == "depth_m" else {name} for name in needed]
    return wanted + [names for names in choices if names.isdisjoint(mapped)]


def column_readings(given: LogColumn | str) -> dict[str, LogColumn]:
    """Return what ``NAME``, ``NAME@UNIT`` or ``DATE+NAME@UNIT`` may mean, by the column's name."""
    if isinstance(given, LogColumn) and (given.unit is not None or given.date is not None):
        return {given.name: given}
    text = given if isinstance(given, str) else given.name
    found = {text: LogColumn(name=text or " ")}
    name, at, unit = text.rpartition("@")
    if at and name:
        found.setdefault(name, LogColumn(name=name, unit=unit))
        day, plus, time = name.partition("+")
        if plus and day.strip() and time.strip():
            day, time = day.strip(), time.strip()
            found.setdefault(time, LogColumn(name=time, unit=unit, date=day))
    return found


def mapped_column(
    file: LogFile, name: str, given: LogColumn | str, header: Sequence[str]
) -> LogColumn:
    """Return the column of the file that is mapped.

    Raises LogError unless the header has it, and its date, once.
    """
    readings = column_readings(given)
    fitting = [column for reading, column in readings.items() if reading in header]
    meant = list(readings.values())[:2][-1]  # without what is after the @, for the refusal
    column = fitting[0] if fitting else meant
    for wanted in (column.name, column.date):
        if wanted is not None and header.count(wanted) != 1:
            near = did_you_mean(wanted[:60], [column[:60] for column in header[:200]])
            what = "the header has this column twice" if wanted in header else "no such column"
            remedy = f"{near}Columns of the file: {listed(header)}"
            raise file.refused(what, remedy, name, value=wanted)
    return column


def named_columns(
    file: LogFile, mapped: Mapped, header: Sequence[str], known: Collection[str]
) -> dict[str, LogColumn]:
    """Return which column of the file each known one is read from: as mapped, else by its name."""
    return {
        name: mapped_column(file, name, mapped.get(name, name), header)
        for name in known
        if name in mapped or name in header
    }


def depth_source(names: set[str], mapped: set[str], file: LogFile) -> str | None:
    """Return which of the columns at hand is to become the depth, None where there is none.

    depth_m, unless pressure_Pa is mapped and depth_m only happens to be there. Raises LogError
    where both are mapped.
    """
    both = {"depth_m", "pressure_Pa"}
    if both <= mapped:
        what = "depth cannot come both from depth_m and from pressure_Pa"
        raise file.refused(what, "Map one of the two", "pressure_Pa")
    if both <= names:
        return "pressure_Pa" if "pressure_Pa" in mapped else "depth_m"
    return next(iter(both & names), None)


def column_sources(
    file: LogFile, mapped: Mapped, needed: Sequence[str], header: list[str]
) -> dict[str, LogColumn]:
    """Return which column of the file each column of the log is read from."""
    sources = named_columns(file, mapped, header, COLUMNS)
    source = depth_source(set(sources), set(mapped), file)
    for other in {"depth_m", "pressure_Pa"} - {source} if source else ():
        sources.pop(other, None)
    at_hand = {*sources, "depth_m"} if source else {*sources}
    if not (file.form.columns.mapped() or at_hand.issuperset(needed)):
        sources |= meant_columns(file, header, sources)
        source = depth_source(set(sources), set(mapped), file)
    for name in needed:
        if name not in sources and not (name == "depth_m" and source):
            how = f"with --column {name}=NAME or in a [log] table"
            how += ", or a pressure with pressure_Pa=NAME" if name == "depth_m" else ""
            columns = f"columns of the file: {listed(header)}{likely(header, sources)}"
            remedy = f"Say which one it is {how}; {columns}"
            raise file.refused(f"the log has no column {name}", remedy, name)
    return sources


def listed(header: Sequence[str], limit: int = 30) -> str:
    """Return the names of a header, the first of a long one."""
    more = f" and {len(header) - limit} more" if len(header) > limit else ""
    return ", ".join(name[:40] for name in header[:limit]) + more


Array = NDArray[np.float64]
Choose = Callable[[list[str]], dict[str, LogColumn]]


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

    def only(self, kept: NDArray[np.bool_] | NDArray[np.int64]) -> Table:
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
) -> Table:
    """Return the columns that `choose` names for the header, of the rows that hold `where`.

    wanted: of each of these sets the header has a name. units: of each column that may be named,
    those of a log unless others are given. labels: columns that may hold texts, which are
    numbered in their order. Raises LogError with file, line, column and value.
    """
    sheet = open_sheet(file, [*wanted, *({name} for name in where)])
    chosen = choose(sheet.header)
    sources = {name: _with_unit(name, c, sheet, units, file) for name, c in chosen.items()}
    tests = [RowTest(file, sheet.header, name, value) for name, value in where.items()]
    dates = {column.date for column in sources.values() if column.date is not None}
    line, columns = sheet.take({*(column.name for column in sources.values()), *dates, *where})
    report = file.report
    if not len(line):
        what = "the log has a header and no rows"
        raise file.refused(what, "Give a log with a row per sample", "rows")
    if tests:
        kept = np.logical_and.reduce([test.of(columns[test.name]) for test in tests])
        if not kept.any():
            raise none_chosen(file, len(line), where, columns)
        report.append(f"{int(kept.sum())} of {len(line)} rows chosen")
        line = line[kept]
        columns = {name: _only(column, kept) for name, column in columns.items()}
    sources = {name: text_unit(name, c, columns[c.name], file) for name, c in sources.items()}
    texts = {}
    for name in sorted(set(labels) & set(sources)):
        columns[sources[name].name], texts[name] = _numbered(columns[sources[name].name])
    reader = ColumnReader(file, line, columns, units)
    written = {name: reader.read(name, column) for name, column in sources.items()}
    reader.refuse_bad()  # first: it may be why the rest makes no sense
    values = {name: reader.in_unit(name, sources[name], written[name]) for name in sources}
    parts, times = sheet.parts, reader.times
    table = Table(values=values, sources=chosen, line=line, parts=parts, times=times, labels=texts)
    table = table.only(reader.good_rows())
    used = {column.name for column in sources.values()} | dates | set(where)
    unused = [name for name in sheet.header if name and name not in used]
    if unused:
        more = ", ..." if len(unused) > 12 else ""
        report.append(f"columns not used: {', '.join(name[:40] for name in unused[:12])}{more}")
    report += reader.conversions
    return table


def open_sheet(file: LogFile, wanted: Sequence[Collection[str]] = ()) -> Sheet:
    """Return the table in a file, its header read.

    Raises LogError where it cannot be read or has no header.
    """
    if file.frame is not None:
        from swimbladder.io.log_netcdf import FrameRows

        return FrameRows(file)
    data = read_bytes(file.path)
    if is_netcdf(data):
        from swimbladder.io.log_netcdf import NetCDFRows  # which reads casts, as tables are read

        return NetCDFRows(data, file)
    return ParquetRows(data, file) if is_parquet(data, file) else Rows(data, file, wanted)


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


def _numbered(column: Column) -> tuple[Column, tuple[str, ...]]:
    """Return a column, and its texts: where not all are numbers it has theirs, from 1."""
    texts = [text.strip() for text in column_texts(column)]
    found = tuple(dict.fromkeys(text for text in texts if text))
    try:
        [float(text or "nan") for text in texts]
    except ValueError:
        number = {text: float(k) for k, text in enumerate(found, start=1)}
        return np.array([number.get(text, np.nan) for text in texts]), found
    return column, found


def _only(column: Column, chosen: NDArray[np.bool_]) -> Column:
    if not isinstance(column, list):
        return column[chosen]
    return [text for text, kept in zip(column, chosen, strict=True) if kept]
