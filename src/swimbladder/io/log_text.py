"""The bytes of a log, decompressed and decoded into lines; what had to be assumed is reported."""

import codecs
import gzip
import io
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self, TypedDict, Unpack

from swimbladder.errors import LogError
from swimbladder.io.files import read_at_most, why_unreadable
from swimbladder.io.log_format import LogFormat

_LONGEST = 100  # characters of a name in an error
MOST_BYTES = 1 << 28  # of a file, decompressed; taken apart it needs ten times that
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before UTF-16, whose mark begins the same
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_OTHERS = (
    (b"PK\x03\x04", "a spreadsheet or an archive", "Save the sheet as CSV, or unpack the archive"),
    (b"\xd0\xcf\x11\xe0", "an old spreadsheet", "Save the sheet as CSV"),
    (b"\x89HDF", "HDF5 or netCDF", "Write its variables to a CSV with a header"),
    (b"CDF", "netCDF", "Write its variables to a CSV with a header"),
    (b"MATLAB", "a MATLAB file", "Save its variables as CSV with a header"),
    (b"%PDF", "a PDF", "Give the log itself"),
    (b"BZh", "compressed by bzip2", "Decompress it, or compress it with gzip"),
    (b"\xfd7zXZ", "compressed by xz", "Decompress it, or compress it with gzip"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", "Decompress it, or compress it with gzip"),
)


class Value(TypedDict, total=False):
    """What an error about a file says of the value that stands there."""

    value: object
    unit: str | None


@dataclass(frozen=True)
class LogFile:
    """A file that is read: how, and the report of what was assumed or left out.

    frame: a DataFrame or a Dataset that is read in its place; its kind stands for the name.
    """

    path: str | Path
    form: LogFormat = field(default_factory=LogFormat)
    report: list[str] = field(default_factory=list)
    frame: Any = None

    @classmethod
    def of(cls, source: Any, form: LogFormat) -> Self:
        """Return what is read: a file by its name, a pandas DataFrame or an xarray Dataset."""
        if is_frame(source):
            return cls(type(source).__name__, form, frame=source)
        return cls(source, form)

    def refused(
        self, what: str, remedy: str, field: str, *, line: int | None = None, **more: Unpack[Value]
    ) -> LogError:
        """Return the error about the file, or about a line of it."""
        at = None if line is None else int(line)
        field = field if len(field) <= _LONGEST else field[:_LONGEST]
        remedy = remedy[: 20 * _LONGEST]
        return LogError(what, file=self.path, line=at, field=field, remedy=remedy, **more)

    def refuse_unused(
        self, names: Iterable[str], why: str, remedy: str = "Leave {} out", idle: object = None
    ) -> None:
        """Raise LogError where the format states one of these options, which has no use.

        idle: a value, beside none, that changes nothing.
        """
        for name in names:
            value = getattr(self.form, name)
            if name in self.form.model_fields_set and value not in (None, idle):
                what, unit = f"{name} has no use: {why}", "s" if name == "tick" else None
                raise self.refused(what, remedy.format(name), name, value=value, unit=unit)


def is_frame(source: object) -> bool:
    """Whether this is a DataFrame or a Dataset; neither library is loaded to see it."""
    bases = {f"{base.__module__.split('.')[0]}.{base.__name__}" for base in type(source).__mro__}
    return not bases.isdisjoint({"pandas.DataFrame", "xarray.Dataset"})


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: ``1 row``, ``2 rows``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def read_bytes(path: str | Path) -> bytes:
    """Return what a file holds, decompressed where it is gzipped.

    Raises LogError where it cannot be read or is larger than 256 MiB.
    """
    try:
        data = read_at_most(Path(path), MOST_BYTES)
        if data[:2] == b"\x1f\x8b":
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as unpacked:
                data = unpacked.read(MOST_BYTES + 1)
        if len(data) <= MOST_BYTES:
            return data
        what, remedy = "larger than 256 MiB", "Cut the log into parts"
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        what, remedy = f"the compressed file is damaged: {error}", "Compress it anew with gzip"
    except (OSError, ValueError, MemoryError) as error:
        what, remedy = why_unreadable(error, "log")
    raise LogError(what, file=path, field="file", remedy=remedy)


def is_netcdf(data: bytes) -> bool:
    """Say whether bytes are those of a netCDF file."""
    return data.startswith((b"CDF\x01", b"CDF\x02", b"\x89HDF\r\n\x1a\n"))


def whole_text(data: bytes, file: LogFile) -> str:
    """Return a text whose lines end in a newline, whatever ends them in the file.

    A NUL that a program in C wrote beside each line end is left out. Raises LogError where the
    bytes are no text.
    """
    for magic, what, remedy in _OTHERS:
        if data.startswith(magic):
            raise file.refused(f"not a text but {what}", remedy, "file")
    text = _decoded(data, file).replace("\r\n", "\n").replace("\r", "\n")
    if "\0" not in text:
        return text
    bare = text.replace("\n\0", "\n").replace("\0\n", "\n")
    if len(bare) < len(text):
        nuls = counted(len(text) - len(bare), "NUL")
        file.report.append(f"{nuls} beside line ends left out")
    return bare


def _decoded(data: bytes, file: LogFile) -> str:
    encoding, report = file.form.encoding, file.report
    marked = next((name for mark, name in _BOMS if data.startswith(mark)), None)
    chosen = encoding or marked or _unmarked_utf16(data) or "utf-8"
    try:
        text = data.decode(chosen).removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        if chosen != "utf-8" or encoding is not None:
            what = f"not text in {chosen}, at byte {error.start}"
            remedy = "Set encoding in a [log] table to that of the file, or save it as UTF-8"
            raise file.refused(what, remedy, "file") from None
        line = data[: error.start].replace(b"\r\n", b"\n").replace(b"\r", b"\n").count(b"\n") + 1
        text = data.decode("utf-8", "replace")
        damaged = text.count("\ufffd")
        if len(text) - len(text.encode("ascii", "ignore")) >= 2 * damaged:  # the others are right
            report.append(f"{counted(damaged, 'byte')} damaged, not UTF-8, first on line {line}")
            return text
        report.append(f"read as Latin-1, being not UTF-8 on line {line}; [log] encoding overrules")
        return data.decode("latin-1")
    if marked is None and encoding is None and chosen != "utf-8":
        report.append(f"read as {chosen}, without a byte order mark")
    return text


def _unmarked_utf16(data: bytes) -> str | None:
    """Return which UTF-16 it is where every other byte is 0, as of a text in plain letters."""
    start = data[:2000]
    if len(start) < 8:
        return None
    even, odd = start[::2].count(0) / len(start[::2]), start[1::2].count(0) / len(start[1::2])
    if odd > 0.9 and even < 0.1:
        return "utf-16-le"
    return "utf-16-be" if even > 0.9 and odd < 0.1 else None
