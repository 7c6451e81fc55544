"""The columns of a log as numbers, with line numbers: rows chosen, texts read, times in seconds."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.log_format import COLUMNS, LogColumn, bracketed
from swimbladder.io.log_numbers import ColumnReader, RowTest, column_texts, none_chosen
from swimbladder.io.log_parquet import ParquetRows, is_parquet
from swimbladder.io.log_rows import Column, Rows, Sheet
from swimbladder.io.log_text import LogFile, read_bytes
from swimbladder.io.log_time import TimeColumn

Array = NDArray[np.float64]
Choose = Callable[[list[str]], dict[str, LogColumn]]


@dataclass(frozen=True, kw_only=True)
class Table:
    """Columns of numbers in the units of their names, NaN where there is none.

    parts: how many times the header stands in the file; times: where the times are from.
    """

    values: dict[str, Array]
    line: NDArray[np.int64]
    parts: int
    times: TimeColumn


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
    sources = {
        name: _with_unit(name, column, sheet, units, file)
        for name, column in choose(sheet.header).items()
    }
    tests = [RowTest(file, sheet.header, name, value) for name, value in where.items()]
    dates = {column.date for column in sources.values() if column.date is not None}
    line, columns = sheet.take({*(column.name for column in sources.values()), *dates, *where})
    report = file.report
    if not len(line):
        raise file.refused(
            "the log has a header and no rows",
            field="rows",
            remedy="Give a log with a row per sample",
        )
    if tests:
        chosen = np.logical_and.reduce([test.of(columns[test.name]) for test in tests])
        if not chosen.any():
            raise none_chosen(file, len(line), where, columns)
        report.append(f"{int(chosen.sum())} of {len(line)} rows chosen")
        line = line[chosen]
        columns = {name: _only(column, chosen) for name, column in columns.items()}
    for name in sorted(set(labels) & set(sources)):
        columns[sources[name].name] = _numbered(columns[sources[name].name])
    reader = ColumnReader(file, columns, line, units)
    written = {name: reader.read(name, column) for name, column in sources.items()}
    reader.refuse_bad()  # first: it may be why the rest makes no sense
    values = {name: reader.in_unit(name, sources[name], written[name]) for name in sources}
    values, line = reader.without_bad(values)
    used = {column.name for column in sources.values()} | dates | set(where)
    unused = [name for name in sheet.header if name and name not in used]
    if unused:
        more = ", ..." if len(unused) > 12 else ""
        report.append(f"columns not used: {', '.join(name[:40] for name in unused[:12])}{more}")
    report += reader.conversions
    return Table(values=values, line=line, parts=sheet.parts, times=reader.times)


def open_sheet(file: LogFile, wanted: Sequence[Collection[str]] = ()) -> Sheet:
    """Return the table in a file, its header read.

    Raises LogError where it cannot be read or has no header.
    """
    data = read_bytes(file.path)
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
        raise file.refused(
            f"the row of units says {row!r}, and the name of the column {said}",
            field=column.name,
            remedy=f'State the unit: {name} = {{ name = "{column.name}", unit = "{row}" }}',
        )
    return LogColumn(name=column.name, unit=row, date=column.date)


def _numbered(column: Column) -> Column:
    """Return a column; its texts, where not all are numbers, numbered from 1, empty ones nan."""
    texts = [text.strip() for text in column_texts(column)]
    try:
        [float(text or "nan") for text in texts]
    except ValueError:
        found = dict.fromkeys(text for text in texts if text)
        number = {text: float(k) for k, text in enumerate(found, start=1)}
        return np.array([number.get(text, np.nan) for text in texts])
    return column


def _only(column: Column, chosen: NDArray[np.bool_]) -> Column:
    if not isinstance(column, list):
        return column[chosen]
    return [text for text, kept in zip(column, chosen, strict=True) if kept]
