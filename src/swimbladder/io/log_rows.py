"""The lines of a log as rows of fields below a header; what is left out is counted and reported.

The header is found first: where the names of the columns stand, and what separates fields. A
Parquet file is read as such a table too, its columns by name as numbers or as texts.
"""

from __future__ import annotations

import csv
import io
import re
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.log_format import Delimiter, LogFormat
from swimbladder.io.log_text import LogFile, counted, text_lines
from swimbladder.plugins import optional

if TYPE_CHECKING:
    import pandas as pd

# What no log writes on purpose: controls but the tab, and the mark of what could not be decoded.
CONTROL = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\ufffd]")
BLANK = "".join(map(chr, range(33))) + "\x7f\u00a0\ufeff"

_NUMERIC = re.compile(r"[-+]?\d[\d.,:/TZ+-]*([eE][-+]?\d+)?")
_DELIMITERS: tuple[Delimiter, ...] = (";", "\t", "|", ",")
_LIKELY = 60  # lines among which the header is looked for where its names are not known


def _delimiter(line: str, file: LogFile) -> Delimiter:
    """Return what separates the fields of a header."""
    found = _found_delimiter(line, file.form)
    if found is None:
        what = "a comma cannot separate both fields and decimals"
        remedy = "Set delimiter in the [log] table to the one of the file"
        raise file.refused(what, remedy, "decimal", value=",")
    return found


def _found_delimiter(line: str, form: LogFormat) -> Delimiter | None:
    """Return the stated delimiter, else the first known one in the line, else a blank."""
    if form.delimiter is not None:
        return form.delimiter
    for delimiter in _DELIMITERS:
        if delimiter in line:
            # with names= the line holds numbers, whose decimal comma separates nothing
            if delimiter != "," or form.decimal != ",":
                return delimiter
            if form.names is None:
                return None
    return " " if len(line.split()) > 1 else ";" if form.decimal == "," else ","


def _split(line: str, delimiter: Delimiter) -> list[str]:
    """Return the fields of a line, of which some may be quoted."""
    if '"' not in line:
        return line.split() if delimiter == " " else line.split(delimiter)
    return quoted_row([line], delimiter) or line.split(delimiter)


def quoted_row(lines: list[str], delimiter: Delimiter) -> list[str] | None:
    """Return the fields of a row that goes over all of `lines`, None where it does not."""
    if delimiter == " ":
        lines = [line.replace("\t", " ").strip() for line in lines]
    ended, blank = [f"{line}\n" for line in lines], delimiter == " "
    reader = csv.reader(ended, delimiter=delimiter, skipinitialspace=blank)
    try:
        row = next(reader, None)
    except csv.Error:
        return None
    return row if reader.line_num == len(lines) else None


Column = list[str] | NDArray[np.float64]

_LONGEST_QUOTE = 20  # lines that a quoted field may go over
_TAILS = 10  # latest rows that the last one is held against


class Sheet(Protocol):
    """A file with named columns, none of them read yet.

    units: what a row of units says, by name. parts: how many times the header stands in it, once
    it is read.
    """

    header: list[str]
    units: dict[str, str]
    parts: int

    def take(self, names: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the line of each row, and the columns of these names as the file has them."""


class Rows:
    """The rows of a text below their header: a `Sheet`."""

    def __init__(self, data: bytes, file: LogFile, wanted: Sequence[Collection[str]] = ()) -> None:
        """Find the header, which has one of each of the names `wanted`, and the row of units.

        Raises LogError where the bytes are no text or there is no header.
        """
        self.file, self.form, self.report = file, file.form, file.report
        self.units: dict[str, str] = {}
        self.parts = 1
        self._lines, self._ended = text_lines(data, file)
        self._clean = not any(CONTROL.search(line) for line in self._lines)
        self.header, self._next = self._find_header(wanted)
        form = self.form
        self._fields = form.fields or len(self.header)
        self._remarks = self._void = 0
        if self._fields < len(self.header):
            what = f"the header names {len(self.header)} columns, more than there are fields"
            remedy = "Give the number of fields in a row"
            raise file.refused(what, remedy, "fields", line=self._next, value=form.fields)
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

    def _find_header(self, wanted: Sequence[Collection[str]]) -> tuple[list[str], int]:
        """Return the names of the columns and the index of the line below; find the delimiter.

        The names stand where the format says, or on the first line with one of each `wanted`; where
        there is no such line on that of the first lines which has most fields and no number.
        Raises LogError where there is none.
        """
        form, report, lines = self.form, self.report, self._lines
        top = min(form.skip_lines, len(lines))
        if top:
            report.append(f"the first {counted(top, 'line')} left out")
        if form.header_starts is not None:
            at, line = self._starting(top, form.header_starts)
        elif form.names is None:
            at, line = self._naming(top, wanted)
        else:
            at, line = self._first(top)
        self._delimiter = _delimiter(line, self.file)
        if form.delimiter is None and self._delimiter != ",":
            named = "blanks" if self._delimiter == " " else repr(self._delimiter)
            report.append(f"fields are separated by {named}, as in the header")
        if form.names is not None:
            return list(form.names), at
        above = [k for k in range(top, at) if lines[k].strip(BLANK)]
        said = [lines[k] for k in above if not lines[k].startswith(form.comment)]
        if said:
            first = " ".join(CONTROL.sub(" ", said[0]).split())[:150]
            count = counted(len(said), "line")
            report.append(f"{count} above the names left out, the first: {first!r}")
        if len(above) > len(said):
            report.append(f"{counted(len(above) - len(said), 'remark')} above the names left out")
        if form.header_starts is None and lines[at].startswith(form.comment):
            report.append(f"the names are those of the remark on line {at + 1}")
        return [field.strip(BLANK) for field in _split(line, self._delimiter)], at + 1

    def _starting(self, top: int, starts: str) -> tuple[int, str]:
        """Return the first line that has the text `starts`, from there on."""
        for at in range(top, len(self._lines)):
            before, found, after = self._lines[at].partition(starts)
            if found:
                if before.strip():
                    count = counted(len(before), "character")
                    self.report.append(f"{count} before the names on line {at + 1} left out")
                return at, found + after
        remedy = "Give how the line with the names of the columns begins"
        raise self.file.refused("no line has this text", remedy, "header_starts", value=starts)

    def _naming(self, top: int, wanted: Sequence[Collection[str]]) -> tuple[int, str]:
        """Return the first line that has the names wanted, else the one most like a header."""
        lines, comment = self._lines, self.form.comment
        for at in range(top, len(lines)) if wanted else ():
            line = lines[at]
            if not all(any(name in line for name in names) for names in wanted):
                continue
            line = line.removeprefix(comment).strip(BLANK)
            found = {field.strip(BLANK) for field in _split(line, _delimiter(line, self.file))}
            if all(not found.isdisjoint(names) for names in wanted):
                return at, line
        first, _ = self._first(top)
        best, most = first, 0
        for at in range(first, min(first + _LIKELY, len(lines))):
            if lines[at].startswith(comment) or not lines[at].strip(BLANK):
                continue
            fields = _split(lines[at].strip(BLANK), _found_delimiter(lines[at], self.form) or ",")
            if len(fields) > most and not any(_NUMERIC.fullmatch(f.strip(BLANK)) for f in fields):
                best, most = at, len(fields)
        return best, lines[best].strip(BLANK)

    def _first(self, top: int) -> tuple[int, str]:
        """Return the first line that is no remark and not blank."""
        for at in range(top, len(self._lines)):
            line = self._lines[at]
            if line.strip(BLANK) and not line.startswith(self.form.comment):
                return at, line
        raise self.file.refused("the log is empty", "Give a CSV with a header", "header")

    def _read_units(self) -> None:
        line, row = next(self._records(self._next), (0, []))
        if not row:
            what = "there is no row of units below the names"
            raise self.file.refused(what, "Leave units_row out", "units_row")
        texts = [field.strip(BLANK).strip("[]() ") for field in row]
        named = zip(self.header, texts, strict=False)
        self.units = {name: text for name, text in named if text not in ("", "-")}
        self._next = line

    def _records(self, start: int) -> Iterator[tuple[int, list[str]]]:
        """Yield (line counted from 1, fields) from a line on, without blank lines and remarks."""
        lines, comment, delimiter = self._lines, self.form.comment, self._delimiter
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
                yield at, _split(line, delimiter)

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
        return _split(self._lines[at], self._delimiter), 0

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
            elif line == last and tails and (len(row) < self._fields or len(row[-1]) < min(tails)):
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
        first = row[0].strip(BLANK)
        return first == self.header[0] and self.header == [field.strip(BLANK) for field in row]

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
            remarks = counted(self._remarks, "remark")
            self.report.append(f"{remarks}, after {form.comment!r}, left out")
        if self._void:
            self.report.append(f"{counted(self._void, 'line')} of control characters left out")
        if again:
            times = "once" if len(again) == 1 else f"{len(again)} times"
            self.report.append(f"the header stands again {times}, first on line {again[0]}")
        if form.part is None:
            return
        if form.part > self.parts:
            what = f"the file has {counted(self.parts, 'part')}"
            remedy = "A part begins where the header stands again"
            raise self.file.refused(what, remedy, "part", value=form.part)
        self.report.append(f"part {form.part} of {self.parts} chosen")

    def _judge(self, whole: int, ragged: list[tuple[int, int]], junk: list[int]) -> None:
        """Report the rows that are damaged; raise LogError where they are more than a tenth."""
        words = f"{counted(len(ragged), 'row')} without the header's {self._fields} fields"
        if len(junk) * 10 > whole:
            total = whole + len(ragged) + len(junk)
            what = f"{len(junk)} of {total} rows have characters that are no text"
            remedy = "Check that this is a log, and set encoding in a [log] table"
            raise self.file.refused(what, remedy, "row", line=junk[0])
        if len(ragged) * 10 > whole:
            line, fields = ragged[0]
            remedy = "Check the delimiter; decimal commas need another one between fields"
            if fields > self._fields and {count for _, count in ragged} == {fields}:
                remedy += f"; if the header names too few columns, set fields = {fields}"
            what = f"{words}, of {whole + len(ragged)}"
            raise self.file.refused(what, remedy, "row", line=line, value=f"{fields} fields")
        if junk:
            rows = counted(len(junk), "row")
            said = f"{rows} with characters that are no text dropped, the first on line {junk[0]}"
            self.report.append(said)
        if ragged:
            self.report.append(f"{words} dropped, the first on line {ragged[0][0]}")


_HEADER_OPTIONS = ("encoding", "delimiter", "header_starts", "names", "skip_lines", "units_row")
TEXT_OPTIONS = (*_HEADER_OPTIONS, "skip_rows", "fields", "part")


def is_parquet(data: bytes, file: LogFile) -> bool:
    """Say whether the bytes of a file are Parquet.

    Raises LogError where its name says so and its bytes do not.
    """
    if data.startswith(b"PAR1") and data.endswith(b"PAR1"):
        return True
    if Path(file.path).suffix == ".parquet":
        what = "this is not Parquet, or not all of it"
        raise file.refused(what, "Write the file anew; a CSV has another suffix", "file")
    return False


class ParquetRows:
    """The rows of a Parquet file: a `Sheet`, whose lines are rows counted from 1."""

    def __init__(self, data: bytes, file: LogFile) -> None:
        """Read the names of the columns.

        Raises InputError where pyarrow is not installed, the file is damaged, or the format has
        options that are for texts.
        """
        self._library = optional("pyarrow.parquet", "parquet", "reading Parquet", file=file.path)
        remedy = "Leave {} out of the [log] table: it is for texts"
        file.refuse_unused(TEXT_OPTIONS, "the log is Parquet", remedy, idle=0)
        self.file, self._data = file, data
        self.units: dict[str, str] = {}
        self.parts = 1
        try:
            self.header = [str(n) for n in self._library.read_schema(io.BytesIO(data)).names]
        except Exception as error:
            raise self._damaged(error) from None

    def take(self, names: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the number of each row, and the columns of these names.

        Raises LogError where the file is damaged.
        """
        try:
            table = self._library.read_table(io.BytesIO(self._data), columns=list(names))
            columns = {name: column_of(table.column(name).to_pandas()) for name in names}
        except Exception as error:
            raise self._damaged(error) from None
        return np.arange(1, table.num_rows + 1), columns

    def _damaged(self, error: Exception) -> LogError:
        # whatever a decoder makes of damaged bytes, it is the bytes that are wrong
        what = f"this Parquet file cannot be read: {' '.join(str(error).split())[:200]}"
        return self.file.refused(what, "Write the file anew, or as CSV", "file")


def column_of(series: pd.Series[Any]) -> Column:
    """Return numbers as floats, durations in seconds, instants as ISO 8601, all else as texts."""
    kind = getattr(series.dtype, "kind", "O")
    if kind in "biufm":
        numbers = series.dt.total_seconds() if kind == "m" else series
        return np.asarray(numbers.to_numpy(dtype=np.float64, na_value=np.nan))
    if kind == "M":
        return [
            instant.isoformat() if known else ""
            for instant, known in zip(series, series.notna(), strict=True)
        ]
    return ["" if value is None else str(value) for value in series]
