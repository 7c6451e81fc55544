"""The lines of a log as rows of fields below a header; what is left out is counted and reported.

The header is found first: where the names of the columns stand, and what separates fields. A
Parquet file is read as such a table too, its columns by name as numbers or as texts.
"""

import csv
import io
import re
from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import compress, islice
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.columns import named_by_unit, plain_unit
from swimbladder.io.log_format import Delimiter, LogFormat
from swimbladder.io.log_text import LogFile, counted, is_netcdf, read_bytes, whole_text
from swimbladder.io.netcdf import NetCDF
from swimbladder.physics.arrays import Array, Flags
from swimbladder.vehicle.plugins import optional

# What no log writes on purpose: controls but the tab, and the mark of what could not be decoded.
CONTROL = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\ufffd]")
BLANK = "".join(map(chr, range(33))) + "\x7f\u00a0\ufeff"

_NUMERIC = re.compile(r"[-+]?\d[\d.,:/TZ+-]*([eE][-+]?\d+)?")
_DELIMITERS: tuple[Delimiter, ...] = (";", "\t", "|", ",")
_LIKELY = 60  # lines among which the header is looked for where its names are not known
_HEAD, _BLOCK = 1 << 22, 1 << 20  # characters: above the rows at most, of rows taken at once


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


Column = list[str] | Array
Chunk = tuple[NDArray[np.int64], dict[str, Column]]

_LONGEST_QUOTE = 20  # lines that a quoted field may go over
_TAILS = 10  # latest rows that the last one is held against


class Sheet(Protocol):
    """A file with named columns, none of them read yet.

    units: what a row of units says, by name. meant: of which column a name is, where the file says.
    parts: how many times the header stands in it, once it is read.
    """

    header: list[str]
    units: dict[str, str]
    meant: dict[str, str]
    parts: int

    def chunks(self, names: Collection[str]) -> Iterator[Chunk]:
        """Yield lines of rows, and the columns of these names as the file has them, by pieces."""


class Rows:
    """The rows of a text below their header: a `Sheet`."""

    def __init__(
        self,
        data: bytes,
        file: LogFile,
        wanted: Sequence[Collection[str]] = (),
        *,
        strict: bool = False,
    ) -> None:
        """Find the header, which has one of each of the names `wanted`, and the row of units.

        strict: whether one damaged row is too many. Raises LogError where the bytes are no text or
        there is no header.
        """
        self.file, self.form, self.report = file, file.form, file.report
        self.units, self.meant, self.parts = dict[str, str](), dict[str, str](), 1
        self._allowed = 0.0 if strict else 0.1
        text = whole_text(data, file)
        self._clean = not CONTROL.search(text)
        cut = not text.endswith("\n")  # the last line may be
        self._text = text.removesuffix("\n")
        self._last = self._text.count("\n") + 1 if cut else 0
        end = self._text.find("\n", _HEAD)
        self._lines = self._text[: end if end >= 0 else None].split("\n") if text else []
        self.header, self._next = self._find_header(wanted)
        form = self.form
        self._fields = form.fields or len(self.header)
        self._remarks = self._void = self._whole = self._skip = 0
        self._junk, self._again = list[int](), list[int]()
        self._ragged = list[tuple[int, int]]()  # line, number of fields
        self._tails: deque[int] = deque(maxlen=_TAILS)  # lengths of the last fields
        if self._fields < len(self.header):
            what = f"the header names {len(self.header)} columns, more than there are fields"
            remedy = "Give the number of fields in a row"
            raise file.refused(what, remedy, "fields", line=self._next, value=form.fields)
        if form.units_row:
            self._read_units()
        below = self._records(self._next + 1, self._lines[self._next :])
        for self._next, _ in islice(below, form.skip_rows):
            pass
        if form.skip_rows:
            self.report.append(f"{counted(form.skip_rows, 'row')} below the names left out")
        self._start = sum(len(line) + 1 for line in self._lines[: self._next])
        self._lines = []

    def chunks(self, names: Collection[str]) -> Iterator[Chunk]:
        """Yield the line of each whole row, and the columns of these names as texts, by pieces.

        Raises LogError where more than a tenth of the rows is damaged.
        """
        at = {name: self.header.index(name) for name in names}
        for first, text in self._blocks():
            lines = text.split("\n")
            rows = [line.split(self._separator) for line in lines] if self._plain(text) else []
            if rows and {len(row) for row in rows} == {self._fields}:
                number: list[int] = [*range(first, first + len(rows))]
                self._whole += len(rows)
                self._tails.extend(len(row[-1]) for row in rows[-_TAILS:])
            else:
                found = [*self._good(self._records(first, lines))]
                number, rows = [line for line, _ in found], [row for _, row in found]
            columns: dict[str, Column] = {
                name: [row[k] if k < len(row) else "" for row in rows] for name, k in at.items()
            }
            yield np.array(number, dtype=np.int64), columns
        self._judge()

    def _blocks(self) -> Iterator[tuple[int, str]]:
        """Yield pieces of the text, whole lines, each with the number of its first line."""
        text, at, number = self._text, self._start, self._next + 1
        while at < len(text):
            end = at + _BLOCK
            for _ in range(_LONGEST_QUOTE):  # a quoted field is not taken apart
                end = text.find("\n", end) if text.find("\n", end) >= 0 else len(text)
                if text.count('"', at, end) % 2 == 0:
                    break
                end += 1
            piece = text[at:end]
            yield number, piece
            at, number = end + 1, number + piece.count("\n") + 1

    def _plain(self, text: str) -> bool:
        """Say whether lines can only be rows: no remarks, quotes, headers, parts, and no end."""
        odd = ('"', f"\n{self.form.comment}", "\n\t", self.header[0])
        whole = self._clean and self._fields > 1 and self.form.part is None and not self._skip
        return whole and not self._last and not any(word in f"\n{text}" for word in odd)

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
        self._separator = None if self._delimiter == " " else self._delimiter
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
        if self.form.names is not None:
            raise self.file.refused(
                "there are no rows", "Give a file with a row per sample", "rows"
            )
        raise self.file.refused("the log is empty", "Give a CSV with a header", "header")

    def _read_units(self) -> None:
        below = self._records(self._next + 1, self._lines[self._next :])
        line, row = next(below, (0, []))
        if not row:
            what = "there is no row of units below the names"
            raise self.file.refused(what, "Leave units_row out", "units_row")
        texts = [field.strip(BLANK).strip("[]() ") for field in row]
        named = zip(self.header, texts, strict=False)
        self.units = {name: text for name, text in named if text not in ("", "-")}
        self._next = line

    def _records(self, first: int, lines: list[str]) -> Iterator[tuple[int, list[str]]]:
        """Yield (line counted from 1, fields), without blank lines and remarks."""
        at = 0
        while at < len(lines):
            line = lines[at]
            at += 1
            if not line.strip(BLANK):
                self._void += bool(line.strip())
            elif line.startswith(self.form.comment):
                self._remarks += 1
            elif '"' in line and line.count('"') % 2:
                row, more = self._longer(lines, at - 1)
                at += more
                yield first + at - 1, row
            else:
                yield first + at - 1, _split(line, self._delimiter)

    def _longer(self, lines: list[str], at: int) -> tuple[list[str], int]:
        """Return the row of a quoted field that goes on below, and over how many lines more.

        A stray quotation mark must not swallow the file: what has not the header's length is taken
        as the one line.
        """
        for more in range(1, min(_LONGEST_QUOTE, len(lines) - at)):
            if lines[at + more].count('"') % 2:
                row = quoted_row(lines[at : at + more + 1], self._delimiter)
                if row is not None and len(row) == self._fields:
                    return row, more
                break
        return _split(lines[at], self._delimiter), 0

    def _good(self, records: Iterator[tuple[int, list[str]]]) -> Iterator[tuple[int, list[str]]]:
        """Yield the records that are whole rows, and keep in mind those that are not."""
        form, tails, last, fields = self.form, self._tails, self._last, self._fields
        for line, row in records:
            if self._skip:
                self._skip -= 1
            elif not self._clean and any(CONTROL.search(field) for field in row):
                self._junk.append(line)
            elif form.names is None and self._is_header(row):
                self._again.append(line)
                self.parts += 1
                self._skip = form.units_row + form.skip_rows
            elif form.part not in (None, self.parts):
                continue
            elif line == last and tails and (len(row) < fields or len(row[-1]) < min(tails)):
                self.report.append(f"the last row, on line {line}, is cut short and is dropped")
            elif len(row) == fields or self._differs_by_a_blank(row):
                self._whole += 1
                tails.append(len(row[-1]))
                yield line, row
            else:
                self._ragged.append((line, len(row)))

    def _is_header(self, row: list[str]) -> bool:
        first = row[0].strip(BLANK)
        return first == self.header[0] and self.header == [field.strip(BLANK) for field in row]

    def _differs_by_a_blank(self, row: list[str]) -> bool:
        """Say whether a row, or the header, only has a delimiter more at its end."""
        if len(row) == self._fields + 1:
            return not row[-1].strip()
        return len(row) == self._fields - 1 and self.form.fields is None and not self.header[-1]

    def _judge(self) -> None:
        """Report what was left out; raise LogError where that is more than a tenth of the rows."""
        form, report, again = self.form, self.report, self._again
        if self._fields > len(self.header):
            more = counted(self._fields - len(self.header), "field")
            report.append(f"{more} of each row, beyond the names, not used")
        if self._remarks:
            report.append(f"{counted(self._remarks, 'remark')}, after {form.comment!r}, left out")
        if self._void:
            report.append(f"{counted(self._void, 'line')} of control characters left out")
        if again:
            times = "once" if len(again) == 1 else f"{len(again)} times"
            report.append(f"the header stands again {times}, first on line {again[0]}")
        if form.part is not None and form.part > self.parts:
            what = f"the file has {counted(self.parts, 'part')}"
            remedy = "A part begins where the header stands again"
            raise self.file.refused(what, remedy, "part", value=form.part)
        if form.part is not None:
            report.append(f"part {form.part} of {self.parts} chosen")
        junk, ragged, whole = self._junk, self._ragged, self._whole
        words = f"{counted(len(ragged), 'row')} without the header's {self._fields} fields"
        if len(junk) > self._allowed * whole:
            total = whole + len(ragged) + len(junk)
            what = f"{len(junk)} of {total} rows have characters that are no text"
            remedy = "Check that this is a log, and set encoding in a [log] table"
            raise self.file.refused(what, remedy, "row", line=junk[0])
        if len(ragged) > self._allowed * whole:
            line, fields = ragged[0]
            remedy = "Check the delimiter; decimal commas need another one between fields"
            if fields > self._fields and {length for _, length in ragged} == {fields}:
                remedy += f"; if the header names too few columns, set fields = {fields}"
            what = f"{words}, of {whole + len(ragged)}"
            raise self.file.refused(what, remedy, "row", line=line, value=f"{fields} fields")
        if junk:
            rows = counted(len(junk), "row")
            said = f"{rows} with characters that are no text dropped, the first on line {junk[0]}"
            report.append(said)
        if ragged:
            report.append(f"{words} dropped, the first on line {ragged[0][0]}")


_HEADER_OPTIONS = ("encoding", "delimiter", "header_starts", "names", "skip_lines", "units_row")
TEXT_OPTIONS = (*_HEADER_OPTIONS, "skip_rows", "fields", "part")


class Arrays:
    """Series of one length as columns: a `Sheet`, whose lines are rows counted from 1."""

    def __init__(
        self,
        series: Mapping[str, Any],
        units: Mapping[str, str],
        meant: Mapping[str, str] | None = None,
    ) -> None:
        """Take pandas Series or arrays of numbers by name, and the units of those that have one.

        meant: as for a `Sheet`; where that is not given, one that is a log's by name and unit, as
        `depth` in m, is called as that.
        """
        self.parts, self.units, self.meant = 1, dict[str, str](), dict(meant or {})
        self._columns: dict[str, Any] = {}
        for name, one in series.items():
            unit = plain_unit(units.get(name, "").partition(" since ")[0])
            column = named_by_unit(name, unit) if meant is None else None
            self._columns[column or name] = one
            if unit and column is None:
                self.units[name] = unit
        self.header = [*self._columns]

    def chunks(self, names: Collection[str]) -> Iterator[Chunk]:
        """Yield the number of each row, and the columns of these names."""
        length = max((len(column) for column in self._columns.values()), default=0)
        yield np.arange(1, length + 1), {name: column_of(self._columns[name]) for name in names}


def parquet_sheet(data: bytes, file: LogFile) -> Arrays:
    """Return the columns of a Parquet file.

    Raises InputError where pyarrow is not installed, the file is damaged, or the format has
    options that are for texts.
    """
    library = optional("pyarrow.parquet", "parquet", "reading Parquet", file=file.path)
    _refuse_text_options(file, "the log is Parquet")
    try:
        frame = library.read_table(io.BytesIO(data)).to_pandas(ignore_metadata=True)
    except Exception as error:
        # whatever a decoder makes of damaged bytes, it is the bytes that are wrong
        what = f"this Parquet file cannot be read: {' '.join(str(error).split())[:200]}"
        raise file.refused(what, "Write the file anew, or as CSV", "file") from None
    return Arrays({str(name): one for name, one in frame.items()}, {})


def netcdf_sheet(data: bytes, file: LogFile) -> Arrays:
    """Return the variables of a netCDF file that have as many numbers as most.

    Raises LogError where the bytes are damaged or the format has options that are for texts.
    """
    _refuse_text_options(file, "the log is netCDF")
    found = NetCDF(data, file)
    series = {name: one for name, one in found.numbers.items() if one.ndim == 1}
    sizes = Counter(one.size for one in series.values()).most_common(1)
    fitting = {name: one for name, one in series.items() if one.size == sizes[0][0]}
    return Arrays(fitting, {name: found.unit(name) for name in fitting})


def frame_sheet(file: LogFile) -> Arrays:
    """Return a DataFrame, a named index among its columns, or what a Dataset has along its one
    dimension; instants are seconds since the first.

    The units are those of `attrs["units"]`: of a DataFrame by column, of a Dataset in each array's.
    Raises LogError where a Dataset has several dimensions, a DataFrame a name twice, or the format
    has options that are for texts.
    """
    kind, frame = str(file.path), file.frame
    file.refuse_unused(TEXT_OPTIONS, f"this is a {kind}", "Leave {} out", idle=0)
    units = frame.attrs.get("units", {})
    if kind == "Dataset":
        if len(frame.sizes) != 1:
            what = f"the Dataset has the dimensions {', '.join(map(str, frame.sizes))}"
            raise file.refused(what, "Choose one profile or one log, with isel or sel", "sizes")
        series = {name: one for name, one in frame.variables.items() if one.ndim == 1}
        units = {name: one.attrs.get("units", "") for name, one in series.items()}
        frame = frame[[*series]].to_dataframe()
    if not isinstance(units, Mapping):
        what, remedy = "they are no units by the names of columns", 'Give {"depth": "m"}'
        raise file.refused(what, remedy, 'attrs["units"]', value=units)
    columns = [(str(name), units.get(name, ""), one) for name, one in frame.items()]
    for k, name in enumerate(frame.index.names):
        level = frame.index.get_level_values(k).to_series()
        if name is not None or (level.dtype.kind == "M" and "time" not in frame):
            columns.insert(k, (str(name or "time"), units.get(name, ""), level))
    names = [name for name, _, _ in columns]
    for name in (name for name in names if names.count(name) > 1):
        raise file.refused("a column stands there twice", "Rename one", name)
    timed = {name for name, _, one in columns if one.dtype.kind in "mM"}
    said = {name: "s" if name in timed else str(unit or "") for name, unit, _ in columns}
    series = {
        name: one - one.iloc[0] if one.dtype.kind == "M" and len(one) else one
        for name, _, one in columns
    }
    return Arrays(series, said)


def _refuse_text_options(file: LogFile, why: str) -> None:
    file.refuse_unused(TEXT_OPTIONS, f"{why}, no text", idle=0)


def chosen(column: Column, kept: Flags) -> Column:
    """Return the rows of a column that are kept."""
    return [*compress(column, kept)] if isinstance(column, list) else column[kept]


def column_of(series: Any) -> Column:
    """Return numbers as floats, durations in seconds, instants as ISO 8601, all else as texts."""
    if isinstance(series, np.ndarray):
        return series
    kind = getattr(series.dtype, "kind", "O")
    if kind in "biufm":
        numbers = series.dt.total_seconds() if kind == "m" else series
        return np.asarray(numbers.to_numpy(dtype=np.float64, na_value=np.nan))
    if kind == "M":
        known = series.notna()
        return [x.isoformat() if is_one else "" for x, is_one in zip(series, known, strict=True)]
    return ["" if value is None else str(value) for value in series]


def open_sheet(
    file: LogFile, wanted: Sequence[Collection[str]] = (), *, head: bool = False
) -> Sheet:
    """Return the table in a file, a DataFrame or a Dataset, its header read.

    wanted: of each of these sets the header of a text has a name. head: only the header is needed.
    Raises LogError where it cannot be read or has no header.
    """
    if file.frame is not None:
        return frame_sheet(file)
    data = read_bytes(file.path)
    if is_netcdf(data):
        return netcdf_sheet(data, file)
    if data.startswith(b"PAR1") and data.endswith(b"PAR1"):
        return parquet_sheet(data, file)
    if Path(file.path).suffix == ".parquet":
        what = "this is not Parquet, or not all of it"
        raise file.refused(what, "Write the file anew; a CSV has another suffix", "file")
    if head and b"\0" not in data[: 4 * _HEAD]:  # a byte is no line end in UTF-16
        data = data[: data.rfind(b"\n", 0, 4 * _HEAD) + 1] or data
    return Rows(data, file, wanted)
