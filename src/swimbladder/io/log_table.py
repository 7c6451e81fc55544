"""The columns of a log as numbers, with line numbers: rows chosen, texts read, times in seconds."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.log_format import COLUMNS, LogColumn, bracketed
from swimbladder.io.log_numbers import ColumnReader, RowTest, TimeColumn, none_chosen
from swimbladder.io.log_rows import Sheet, chosen, open_sheet
from swimbladder.io.log_text import LogFile

Array = NDArray[np.float64]
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
