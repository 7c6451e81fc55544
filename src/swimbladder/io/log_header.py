"""Where the names of a log's columns stand, and what separates its fields."""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from swimbladder.errors import LogError
from swimbladder.io.log_format import Delimiter, LogFormat
from swimbladder.io.log_text import counted

# What no log writes on purpose: controls but the tab, and the mark of what could not be decoded.
CONTROL = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\ufffd]")
BLANK = "".join(map(chr, range(33))) + "\x7f\u00a0\ufeff"

_NUMERIC = re.compile(r"[-+]?\d[\d.,:/TZ+-]*([eE][-+]?\d+)?")
_DELIMITERS: tuple[Delimiter, ...] = (";", "\t", "|", ",")
_LIKELY = 60  # lines among which the header is looked for where its names are not known


@dataclass(frozen=True, kw_only=True)
class Header:
    """The names of the columns; `below` is the index of the line after them."""

    names: list[str]
    delimiter: Delimiter
    below: int

    def split(self, line: str) -> list[str]:
        """Return the fields of a line."""
        return _split(line, self.delimiter)


def find_header(
    lines: list[str],
    form: LogFormat,
    wanted: Sequence[Collection[str]],
    path: str | Path,
    report: list[str],
) -> Header:
    """Return the header: what `form` says, else the first line with one of each `wanted` names.

    Where there is no such line it is that of the first lines which has most fields and no number.
    Raises LogError where there is none.
    """
    top = min(form.skip_lines, len(lines))
    if top:
        report.append(f"the first {counted(top, 'line')} left out")
    if form.header_starts is not None:
        at, line = _starting(lines, top, form.header_starts, path, report)
    elif form.names is None:
        at, line = _naming(lines, top, form, wanted, path)
    else:
        at, line = _first(lines, top, form, path)
    delimiter = _delimiter(line, form, path)
    if form.delimiter is None and delimiter != ",":
        named = "blanks" if delimiter == " " else repr(delimiter)
        report.append(f"fields are separated by {named}, as in the header")
    if form.names is not None:
        return Header(names=list(form.names), delimiter=delimiter, below=at)
    above = [k for k in range(top, at) if lines[k].strip(BLANK)]
    said = [lines[k] for k in above if not lines[k].startswith(form.comment)]
    if said:
        first = " ".join(CONTROL.sub(" ", said[0]).split())[:150]
        report.append(
            f"{counted(len(said), 'line')} above the names left out, the first: {first!r}"
        )
    if len(above) > len(said):
        report.append(f"{counted(len(above) - len(said), 'remark')} above the names left out")
    if form.header_starts is None and lines[at].startswith(form.comment):
        report.append(f"the names are those of the remark on line {at + 1}")
    names = [field.strip(BLANK) for field in _split(line, delimiter)]
    return Header(names=names, delimiter=delimiter, below=at + 1)


def _starting(
    lines: list[str], top: int, starts: str, path: str | Path, report: list[str]
) -> tuple[int, str]:
    """Return the first line that has the text `starts`, from there on."""
    for at in range(top, len(lines)):
        before, found, after = lines[at].partition(starts)
        if found:
            if before.strip():
                count = counted(len(before), "character")
                report.append(f"{count} before the names on line {at + 1} left out")
            return at, found + after
    raise LogError(
        "no line has this text",
        file=path,
        field="header_starts",
        value=starts,
        remedy="Give how the line with the names of the columns begins",
    )


def _naming(
    lines: list[str], top: int, form: LogFormat, wanted: Sequence[Collection[str]], path: str | Path
) -> tuple[int, str]:
    """Return the first line that has the names wanted, else the one most like a header."""
    for at in range(top, len(lines)) if wanted else ():
        line = lines[at]
        if not all(any(name in line for name in names) for names in wanted):
            continue
        line = line.removeprefix(form.comment).strip(BLANK)
        found = {field.strip(BLANK) for field in _split(line, _delimiter(line, form, path))}
        if all(not found.isdisjoint(names) for names in wanted):
            return at, line
    first, _ = _first(lines, top, form, path)
    best, most = first, 0
    for at in range(first, min(first + _LIKELY, len(lines))):
        if lines[at].startswith(form.comment) or not lines[at].strip(BLANK):
            continue
        fields = _split(lines[at].strip(BLANK), _found_delimiter(lines[at], form) or ",")
        if len(fields) > most and not any(_NUMERIC.fullmatch(f.strip(BLANK)) for f in fields):
            best, most = at, len(fields)
    return best, lines[best].strip(BLANK)


def _first(lines: list[str], top: int, form: LogFormat, path: str | Path) -> tuple[int, str]:
    """Return the first line that is no remark and not blank."""
    for at in range(top, len(lines)):
        if lines[at].strip(BLANK) and not lines[at].startswith(form.comment):
            return at, lines[at]
    raise LogError("the log is empty", file=path, field="header", remedy="Give a CSV with a header")


def _delimiter(line: str, form: LogFormat, path: str | Path) -> Delimiter:
    """Return what separates the fields of a header."""
    found = _found_delimiter(line, form)
    if found is None:
        raise LogError(
            "a comma cannot separate both fields and decimals",
            file=path,
            field="decimal",
            value=",",
            remedy="Set delimiter in the [log] table to the one of the file",
        )
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
    reader = csv.reader(
        [f"{line}\n" for line in lines], delimiter=delimiter, skipinitialspace=delimiter == " "
    )
    try:
        row = next(reader, None)
    except csv.Error:
        return None
    return row if reader.line_num == len(lines) else None
