"""The text of a log: decompressed, decoded, split and turned into numbers, with line numbers."""

from __future__ import annotations

import csv
import gzip
import io
import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.log_format import Delimiter, LogColumn, LogFormat

__all__ = ["Table", "read_header", "read_table"]

_MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "inf", "+inf", "-inf"}
_DELIMITERS: tuple[Delimiter, ...] = (";", "\t", "|", ",")


@dataclass(frozen=True, kw_only=True)
class Table:
    """Columns of numbers as the file has them, NaN where there is none."""

    sources: dict[str, LogColumn]
    values: dict[str, NDArray[np.float64]]
    line: NDArray[np.int64]
    report: tuple[str, ...]


def read_header(path: str | Path) -> list[str]:
    """Return the names in the header of a CSV file.

    Raises LogError where it cannot be read or has none.
    """
    rows = _Rows(path, LogFormat())
    return rows.header


def read_table(
    path: str | Path,
    form: LogFormat,
    where: Mapping[str, str | float],
    choose: Callable[[list[str]], dict[str, LogColumn]],
) -> Table:
    """Return the columns that `choose` names for the header, of the rows that hold `where`.

    Raises LogError with file, line, column and value.
    """
    rows = _Rows(path, form)
    sources = choose(rows.header)
    index = {name: rows.header.index(column.name) for name, column in sources.items()}
    tests = [_test(rows, name, value) for name, value in where.items()]
    parse = {
        name: _instant if column.unit == "iso" else _number(rows.decimal)
        for name, column in sources.items()
    }
    values: dict[str, list[float]] = {name: [] for name in sources}
    lines: list[int] = []
    total = 0
    for line, row in rows:
        total += 1
        if not all(test(row) for test in tests):
            continue
        lines.append(line)
        for name, at in index.items():
            text = row[at].strip()
            try:
                values[name].append(parse[name](text))
            except (ValueError, OverflowError):
                raise _not_a_number(path, line, sources[name], text, rows) from None
    if not lines:
        raise _nothing(path, total, where, rows)
    if where:
        rows.report.append(f"{len(lines)} of {total} rows chosen")
    used = {column.name for column in sources.values()} | set(where)
    unused = [name for name in rows.header if name and name not in used]
    if unused:
        more = ", ..." if len(unused) > 12 else ""
        rows.report.append(f"columns not used: {', '.join(unused[:12])}{more}")
    arrays = {name: np.array(column) for name, column in values.items()}
    if "time_s" in sources and sources["time_s"].unit == "iso":
        finite = arrays["time_s"][np.isfinite(arrays["time_s"])]
        arrays["time_s"] -= finite[0] if len(finite) else 0.0
    return Table(sources=sources, values=arrays, line=np.array(lines), report=tuple(rows.report))


class _Rows:
    """The rows of a CSV file and their lines; comments and ragged rows are left out."""

    def __init__(self, path: str | Path, form: LogFormat) -> None:
        self.path = path
        self.report: list[str] = []
        self.decimal = form.decimal
        text = _text(path)
        lines = text.split("\n")
        first = next((s for s in lines if s.strip() and not s.startswith("#")), "")
        found: Delimiter = next((d for d in _DELIMITERS if d in first), ",")
        self.delimiter: Delimiter = form.delimiter or found
        if form.delimiter is None and self.delimiter != ",":
            self.report.append(f"fields are separated by {self.delimiter!r}, as in the header")
        if self.delimiter == "," == self.decimal:
            raise LogError(
                "a comma cannot separate both fields and decimals",
                file=path,
                field="decimal",
                value=",",
                remedy="Set delimiter in the [log] table to the one of the file",
            )
        self._reader = csv.reader(io.StringIO(text), delimiter=self.delimiter)
        self._ragged: list[tuple[int, int]] = []
        self.header = [name.strip() for name in next(self._lines(), (0, []))[1]]
        if not self.header:
            raise LogError(
                "the log is empty", file=path, field="header", remedy="Give a CSV with a header"
            )

    def _lines(self) -> Iterator[tuple[int, list[str]]]:
        while True:
            try:
                row = next(self._reader, None)
            except csv.Error as error:
                raise LogError(
                    f"not CSV: {error}", file=self.path, line=self._reader.line_num, field="row"
                ) from None
            if row is None:
                return
            if any(field.strip() for field in row) and not row[0].startswith("#"):
                yield self._reader.line_num, row

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        """Yield (line, fields) and report how many rows did not have the header's length."""
        whole = 0
        for line, row in self._lines():
            if len(row) == len(self.header):
                whole += 1
                yield line, row
            else:
                self._ragged.append((line, len(row)))
        if not self._ragged:
            return
        line, fields = self._ragged[0]
        ragged = f"{len(self._ragged)} rows do not have the header's {len(self.header)} fields"
        if len(self._ragged) * 10 > whole:
            raise LogError(
                f"{ragged}, of {whole + len(self._ragged)}",
                file=self.path,
                line=line,
                field="row",
                value=f"{fields} fields",
                remedy="Check the delimiter; decimal commas need another one between fields",
            )
        self.report.append(f"{ragged} and are dropped, the first on line {line}")


def _text(path: str | Path) -> str:
    """Return the text of a file: decompressed, without its byte order mark."""
    try:
        data = Path(path).read_bytes()
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
        bom = data[:2] in (b"\xff\xfe", b"\xfe\xff")
        text = data.decode("utf-16" if bom else "utf-8-sig")
        return text.replace("\r\n", "\n").replace("\r", "\n")
    except FileNotFoundError:
        what, remedy = "there is no such file", "Check the path"
    except IsADirectoryError:
        what, remedy = "this is a folder", "Give the log in it"
    except UnicodeDecodeError as error:
        what, remedy = f"not text in UTF-8, at byte {error.start}", "Save the log as UTF-8"
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        what, remedy = f"the compressed file is damaged: {error}", "Compress it anew with gzip"
    except (OSError, ValueError) as error:
        what, remedy = f"cannot read the file: {error}", "Check the path and its permissions"
    raise LogError(what, file=path, field="file", remedy=remedy)


def _number(decimal: str) -> Callable[[str], float]:
    def parse(text: str) -> float:
        if text.lower() in _MISSING:
            return math.nan
        if "_" in text or (decimal == "," and "." in text):
            raise ValueError(text)
        return float(text.replace(",", ".") if decimal == "," else text)

    return parse


def _instant(text: str) -> float:
    """Return the seconds of an ISO 8601 time; one without a zone is taken as UTC."""
    if text.lower() in _MISSING:
        return math.nan
    instant = datetime.fromisoformat(text)
    return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp()


def _test(rows: _Rows, name: str, value: str | float) -> Callable[[list[str]], bool]:
    """Return whether a row holds `value` in column `name`, as a number where both are numbers."""
    if rows.header.count(name) != 1:
        raise LogError(
            "no such column to choose rows by" if name not in rows.header else "two such columns",
            file=rows.path,
            field="where",
            value=name,
            remedy=f"Columns of the file: {', '.join(rows.header[:30])}",
        )
    at, parse, text = rows.header.index(name), _number(rows.decimal), str(value).strip()
    try:
        number = float(value)
    except ValueError:
        return lambda row: row[at].strip() == text

    def same(row: list[str]) -> bool:
        try:
            return row[at].strip() == text or parse(row[at].strip()) == number
        except ValueError:
            return False

    return same


def _not_a_number(
    path: str | Path, line: int, column: LogColumn, text: str, rows: _Rows
) -> LogError:
    """Return the error for a field that is no number, with what it looks like as the remedy."""
    remedy = "Correct the field, or leave it empty where nothing was measured"
    if column.unit == "iso":
        remedy = "Write times like 2023-04-14T10:31:05.5"
    elif "," in text and rows.decimal == "." and rows.delimiter != ",":
        remedy = 'If it is a decimal comma, set decimal = "," in a [log] table (--log-format)'
    elif text[:4].isdigit() and (":" in text or text.count("-") >= 2):
        remedy = f'If it is a time in ISO 8601, map it with --column "time_s={column.name}@iso"'
    return LogError(
        "not a number" if column.unit != "iso" else "not a time in ISO 8601",
        file=path,
        line=line,
        field=column.name,
        value=text,
        remedy=remedy,
    )


def _nothing(
    path: str | Path, total: int, where: Mapping[str, str | float], rows: _Rows
) -> LogError:
    """Return the error for a log of which no row is left."""
    if not total or not where:
        return LogError(
            "the log has a header and no rows",
            file=path,
            field="rows",
            remedy="Give a log with a row per sample",
        )
    return LogError(
        f"none of {total} rows is chosen",
        file=path,
        field="where",
        value=", ".join(f"{name}={value}" for name, value in where.items()),
        remedy=f"Choose one of: {_choices(path, next(iter(where)), rows)}",
    )


def _choices(path: str | Path, name: str, rows: _Rows) -> str:
    again = _Rows(path, LogFormat(delimiter=rows.delimiter))
    at = again.header.index(name)
    found = list(dict.fromkeys(row[at].strip() for _, row in again))
    return ", ".join(found[:40]) + (", ..." if len(found) > 40 else "")
