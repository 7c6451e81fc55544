"""What the commands that read logs share: which rows of which file make a log, and its columns."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from swimbladder.cli.common import console, progress, quantity
from swimbladder.errors import InputError, LogError

if TYPE_CHECKING:
    from swimbladder.io.log_format import LogFormat
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle

__all__ = [
    "Chosen",
    "LogColumns",
    "LogForm",
    "LogRows",
    "chosen",
    "depth",
    "names",
    "pair",
    "read",
    "selections",
]

LogRows = Annotated[
    list[str] | None,
    typer.Option(
        "--where", metavar="COLUMN=VALUE", help="Only these rows; VALUE,VALUE: one log each."
    ),
]
LogColumns = Annotated[
    list[str] | None,
    typer.Option(
        "--column", metavar="NAME=COLUMN",
        help=r'As in depth_m="Depth \[cm]" or depth_m=Depth@cm.',
    ),
]  # fmt: skip
LogForm = Annotated[
    str | None,
    typer.Option("--log-format", metavar="FORMAT", help=r"TOML file with a \[log] table."),
]


class Chosen(NamedTuple):
    """A log: a file, and the rows of it that hold these values."""

    path: Path
    where: dict[str, str]

    @property
    def label(self) -> str:
        """The file's name and the selection."""
        rows = ", ".join(f"{name}={value}" for name, value in self.where.items())
        return f"{self.path.name} {rows}".rstrip()


def chosen(paths: list[Path], where: list[str]) -> list[Chosen]:
    """Return every selection of every file, in order.

    Raises InputError for a selection that is not NAME=VALUE.
    """
    return [Chosen(path, one) for path in paths for one in selections(where)]


def pair(text: str, option: str) -> tuple[str, str]:
    """Return NAME and VALUE of a text NAME=VALUE given to `option`.

    Raises InputError naming the option where it is none.
    """
    name, sign, value = text.partition("=")
    if not sign or not name.strip() or not value.strip():
        raise InputError(
            "not a pair", field=option, value=text, remedy=f"Write it as {option} NAME=VALUE"
        )
    return name.strip(), value.strip()


def selections(texts: list[str]) -> list[dict[str, str]]:
    """Return one selection of rows for each log: all combinations of the values given."""
    pairs = [pair(text, "--where") for text in texts]
    names = [name for name, _ in pairs]
    values = [[v.strip() for v in value.split(",") if v.strip()] for _, value in pairs]
    return [dict(zip(names, one, strict=True)) for one in product(*values)]


def names(text: str | None) -> tuple[str, ...] | None:
    """Return the names of NAME,NAME; none of ``none``; None where nothing is given."""
    if text is None:
        return None
    found = tuple(name.strip() for name in text.split(",") if name.strip())
    return () if found in ((), ("none",)) else found


def depth(text: str | None, option: str) -> float:
    """Return a depth [m], infinite where none is given; raises InputError naming the option."""
    number = quantity(text, "m", option)
    if number is not None and number < 0.0:
        raise InputError(
            "it must not be negative",
            field=option,
            value=text,
            unit="m",
            remedy="Check the number and its unit",
        )
    return float("inf") if number is None else number


def read(
    log: Chosen, vehicle: Vehicle | None, *, columns: Mapping[str, str], log_format: str | None,
    quiet: bool = False, required: Collection[str] = ("time_s", "depth_m"),
) -> Log:  # fmt: skip
    """Return the log of a vehicle, read by the format asked for or the one shipped for it.

    quiet: that a shipped one is used has been said. required: columns it must have. Raises
    LogError, an InputError, with file, line, column, value and remedy.
    """
    from swimbladder.io.logs import read_log

    with progress(f"reading {log.label}"):
        form = _format(log.path, vehicle, columns, log_format, required, quiet=quiet)
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

    if is_mermaid(read_bytes(path)[:4000].decode("latin-1")):
        return LogError(
            "the log of a float of the MERMAID kind: it tells of pressures and runs of a pump, and "
            "of no volume", file=path, field=error.field,
            remedy="Identify it with --cast and a --vehicle that has a pump and a valve",
        )  # fmt: skip
    known = [name for name in FORMATS.own if vehicle and name.startswith(vehicle.name)]
    if not known:
        return error
    return LogError(
        error.what, file=error.file, line=error.line, field=error.field, value=error.value,
        unit=error.unit,
        remedy=f"{error.remedy}; formats of this vehicle's logs, for --log-format: "
        f"{', '.join(known)}",
    )  # fmt: skip


def _format(
    path: Path, vehicle: Vehicle | None, columns: Mapping[str, str], asked: str | None,
    required: Collection[str], *, quiet: bool,
) -> LogFormat | None:  # fmt: skip
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
        console.print(
            f"{path}: its columns are those of the log format {vehicle.name}, and read so",
            markup=False,
            soft_wrap=True,
        )
    return form
