"""The lines of a log as rows of fields below a header; what is left out is counted and reported."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.log_format import LogFormat
from swimbladder.io.log_header import BLANK, CONTROL, find_header, quoted_row
from swimbladder.io.log_text import counted, text_lines

Column = list[str] | NDArray[np.float64]

_LONGEST_QUOTE = 20  # lines that a quoted field may go over
_TAILS = 10  # latest rows that the last one is held against


class Sheet(Protocol):
    """A file with named columns, none of them read yet.

    units: what a row of units says, by name. parts: how many times the header stands in it, once
    it is read. report: what was assumed or left out.
    """

    header: list[str]
    units: dict[str, str]
    parts: int
    report: list[str]

    def take(self, names: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the line of each row, and the columns of these names as the file has them."""


class Rows:
    """The rows of a text below their header: a `Sheet`."""

    def __init__(
        self, data: bytes, form: LogFormat, path: str | Path, wanted: Sequence[Collection[str]] = ()
    ) -> None:
        """Find the header and the row of units; `wanted`: see `find_header`.

        Raises LogError where the bytes are no text or there is no header.
        """
        self.path, self.form = path, form
        self.report: list[str] = []
        self.units: dict[str, str] = {}
        self.parts = 1
        self._lines, self._ended = text_lines(data, form.encoding, path, self.report)
        self._clean = not any(CONTROL.search(line) for line in self._lines)
        found = find_header(self._lines, form, wanted, path, self.report)
        self._split, self._delimiter = found.split, found.delimiter
        self.header, self._next = found.names, found.below
        self._fields = form.fields or len(self.header)
        self._remarks = self._void = 0
        if self._fields < len(self.header):
            raise LogError(
                f"the header names {len(self.header)} columns, more than there are fields",
                file=path,
                line=self._next,
                field="fields",
                value=form.fields,
                remedy="Give the number of fields in a row",
            )
        if form.units_row:
            self._read_units()
        for line, _ in islice(self._records(self._next), form.skip_rows):
            self._next = line
        if form.skip_rows:
            self.report.append(f"{counted(form.skip_rows, 'row')} below the names left out")

    def take(self, names: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the line of each whole row, and the columns of these names as texts.

        Raises LogError where more than a tenth of the rows is damaged.
        """
        columns: dict[str, list[str]] = {name: [] for name in names}
        filled = [(self.header.index(name), column) for name, column in columns.items()]
        lines: list[int] = []
        for line, row in self._whole():
            lines.append(line)
            for index, column in filled:
                column.append(row[index] if index < len(row) else "")
        return np.array(lines, dtype=np.int64), dict(columns)

    def _read_units(self) -> None:
        line, row = next(self._records(self._next), (0, []))
        if not row:
            raise LogError(
                "there is no row of units below the names",
                file=self.path,
                field="units_row",
                remedy="Leave units_row out",
            )
        texts = [field.strip(BLANK).strip("[]() ") for field in row]
        named = zip(self.header, texts, strict=False)
        self.units = {name: text for name, text in named if text not in ("", "-")}
        self._next = line

    def _records(self, start: int) -> Iterator[tuple[int, list[str]]]:
        """Yield (line counted from 1, fields) from a line on, without blank lines and remarks."""
        lines, comment, split = self._lines, self.form.comment, self._split
        at = start
        while at < len(lines):
            line = lines[at]
            at += 1
            if not line.strip(BLANK):
                self._void += bool(line.strip())
            elif line.startswith(comment):
                self._remarks += 1
            elif '"' in line and line.count('"') % 2:
                row, more = self._longer(at - 1)
                at += more
                yield at, row
            else:
                yield at, split(line)

    def _longer(self, at: int) -> tuple[list[str], int]:
        """Return the row of a quoted field that goes on below, and over how many lines more.

        A stray quotation mark must not swallow the file: what has not the header's length is taken
        as the one line.
        """
        for more in range(1, min(_LONGEST_QUOTE, len(self._lines) - at)):
            if self._lines[at + more].count('"') % 2:
                row = quoted_row(self._lines[at : at + more + 1], self._delimiter)
                if row is not None and len(row) == self._fields:
                    return row, more
                break
        return self._split(self._lines[at]), 0

    def _whole(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the rows that are whole, and report those that are not."""
        named, last = self.form.names is None, 0 if self._ended else len(self._lines)
        whole = skip = 0
        ragged: list[tuple[int, int]] = []
        junk: list[int] = []
        again: list[int] = []
        tails: deque[int] = deque(maxlen=_TAILS)  # lengths of the last fields
        for line, row in self._records(self._next):
            if skip:
                skip -= 1
            elif not self._clean and any(CONTROL.search(field) for field in row):
                junk.append(line)
            elif named and self._is_header(row):
                again.append(line)
                self.parts += 1
                skip = self.form.units_row + self.form.skip_rows
            elif self.form.part not in (None, self.parts):
                continue
            elif line == last and tails and (
                len(row) < self._fields or len(row[-1]) < min(tails)
            ):  # fmt: skip
                self.report.append(f"the last row, on line {line}, is cut short and is dropped")
            elif len(row) == self._fields or self._differs_by_a_blank(row):
                whole += 1
                tails.append(len(row[-1]))
                yield line, row
            else:
                ragged.append((line, len(row)))
        self._report(again)
        self._judge(whole, ragged, junk)

    def _is_header(self, row: list[str]) -> bool:
        return row[0].strip(BLANK) == self.header[0] and self.header == [
            field.strip(BLANK) for field in row
        ]

    def _differs_by_a_blank(self, row: list[str]) -> bool:
        """Say whether a row, or the header, only has a delimiter more at its end."""
        if len(row) == self._fields + 1:
            return not row[-1].strip()
        return len(row) == self._fields - 1 and self.form.fields is None and not self.header[-1]

    def _report(self, again: list[int]) -> None:
        """Report remarks, blocks without text, and headers within the rows."""
        form = self.form
        if self._fields > len(self.header):
            more = counted(self._fields - len(self.header), "field")
            self.report.append(f"{more} of each row, beyond the names, not used")
        if self._remarks:
            self.report.append(
                f"{counted(self._remarks, 'remark')}, after {form.comment!r}, left out"
            )
        if self._void:
            self.report.append(f"{counted(self._void, 'line')} of control characters left out")
        if again:
            times = "once" if len(again) == 1 else f"{len(again)} times"
            self.report.append(f"the header stands again {times}, first on line {again[0]}")
        if form.part is None:
            return
        if form.part > self.parts:
            raise LogError(
                f"the file has {counted(self.parts, 'part')}",
                file=self.path,
                field="part",
                value=form.part,
                remedy="A part begins where the header stands again",
            )
        self.report.append(f"part {form.part} of {self.parts} chosen")

    def _judge(self, whole: int, ragged: list[tuple[int, int]], junk: list[int]) -> None:
        """Report the rows that are damaged; raise LogError where they are more than a tenth."""
        words = f"{counted(len(ragged), 'row')} without the header's {self._fields} fields"
        if len(junk) * 10 > whole:
            raise LogError(
                f"{len(junk)} of {whole + len(ragged) + len(junk)} rows have characters that are "
                "no text",
                file=self.path,
                line=junk[0],
                field="row",
                remedy="Check that this is a log, and set encoding in a [log] table",
            )
        if len(ragged) * 10 > whole:
            line, fields = ragged[0]
            remedy = "Check the delimiter; decimal commas need another one between fields"
            if fields > self._fields and {count for _, count in ragged} == {fields}:
                remedy += f"; if the header names too few columns, set fields = {fields}"
            raise LogError(
                f"{words}, of {whole + len(ragged)}",
                file=self.path,
                line=line,
                field="row",
                value=f"{fields} fields",
                remedy=remedy,
            )
        if junk:
            self.report.append(
                f"{counted(len(junk), 'row')} with characters that are no text dropped, the first "
                f"on line {junk[0]}"
            )
        if ragged:
            self.report.append(f"{words} dropped, the first on line {ragged[0][0]}")
