"""What the commands that read logs share: which rows of which file make a log, and its columns."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from swimbladder.cli.common import aside, progress
from swimbladder.cli.options import Options, valued
from swimbladder.cli.texts import Given, Several, pair, pairs
from swimbladder.errors import LogError

if TYPE_CHECKING:
    from swimbladder.io.log_format import LogFormat
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle


class Chosen(NamedTuple):
    """A log: a file, and the rows of it that hold these values."""

    path: Path
    where: dict[str, str]

    @property
    def label(self) -> str:
        """The file's name and the selection."""
        rows = ", ".join(f"{name}={value}" for name, value in self.where.items())
        return f"{self.path.name} {rows}".rstrip()


def selections(texts: Sequence[str]) -> list[dict[str, str]]:
    """Return one selection of rows for each log: all combinations of the values given."""
    given = [pair(text, "--where") for text in texts]
    names = [name for name, _ in given]
    values = [[v.strip() for v in value.split(",") if v.strip()] for _, value in given]
    return [dict(zip(names, one, strict=True)) for one in product(*values)]


@dataclass(frozen=True)
class LogReading(Options):
    """Which rows of files make logs, and how they are read."""

    where: Several = valued("COLUMN=VALUE", "Only these rows; VALUE,VALUE: one log each.")
    column: Several = valued("NAME=COLUMN", r'As in depth_m="Depth \[cm]" or depth_m=Depth@cm.')
    log_format: Given = valued("FORMAT", r"TOML file with a \[log] table.")

    def chosen(self, paths: Sequence[Path]) -> list[Chosen]:
        """Return every selection of every file, in order; raises InputError naming the option."""
        return [Chosen(path, one) for path in paths for one in selections(self.where or [])]

    def columns(self) -> dict[str, str]:
        """Return columns by name; raises InputError naming the option."""
        return pairs(self.column or [], "--column")

    def log(
        self,
        log: Chosen,
        vehicle: Vehicle | None,
        *,
        quiet: bool = False,
        required: Collection[str] = ("time_s", "depth_m"),
    ) -> Log:
        """Return the log of a vehicle, read by the format asked for or the one shipped for it.

        quiet: that a shipped one is used has been said. required: columns it must have. Raises
        LogError, an InputError, with file, line, column, value and remedy.
        """
        from swimbladder.io.logs import read_log

        columns = self.columns()
        with progress(f"reading {log.label}"):
            form = _format(log.path, vehicle, columns, self.log_format, required, quiet=quiet)
            try:
                return read_log(
                    log.path, columns=columns, where=log.where, log_format=form, required=required
                )
            except LogError as error:
                if form is None and not columns and error.field in required:
                    raise _of_its_kind(error, log.path, vehicle) from None
                raise


def _of_its_kind(error: LogError, path: Path, vehicle: Vehicle | None) -> LogError:
    """Return the error about a missing column with what is known of such files."""
    from swimbladder.io.log_formats import FORMATS
    from swimbladder.io.log_formats.mermaid import is_mermaid
    from swimbladder.io.log_text import read_bytes

    if is_mermaid(read_bytes(path)):
        has = "pressures and runs of a pump, and no volume"
        why = f"the log of a float of the MERMAID kind has {has}"
        remedy = "Identify it with --cast and a --vehicle that has a pump and a valve"
        return LogError(why, file=path, field=error.field, remedy=remedy)
    known = [name for name in FORMATS.own if vehicle and name.startswith(vehicle.name)]
    if not known:
        return error
    formats = f"formats of this vehicle's logs, for --log-format: {', '.join(known)}"
    return error.but(remedy=f"{error.remedy}; {formats}")


def _format(
    path: Path,
    vehicle: Vehicle | None,
    columns: Mapping[str, str],
    asked: str | None,
    required: Collection[str],
    *,
    quiet: bool,
) -> LogFormat | None:
    """Return the log format asked for; else the shipped one of the vehicle, where it fits.

    It fits where the log has all its columns and lacks a required one; that it is used is said.
    """
    from swimbladder.io.log_format import log_format
    from swimbladder.io.log_formats import FORMATS
    from swimbladder.io.logs import header_names

    if asked is not None:
        return log_format(asked)
    if vehicle is None or vehicle.name not in FORMATS:
        return None
    header = set(header_names(path))
    if set(required) <= header | set(columns):
        return None
    form = log_format(vehicle.name)
    if not {column.name for column in form.columns.mapped().values()} <= header:
        return None
    if not quiet:
        aside(f"{path}: its columns are those of the log format {vehicle.name}, and read so")
    return form
