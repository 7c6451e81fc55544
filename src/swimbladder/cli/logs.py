"""What the commands that read logs share: which rows of which file make a log, and its columns."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from swimbladder.cli.common import aside, progress
from swimbladder.cli.options import Options, valued
from swimbladder.cli.texts import Several, once, pair, pairs
from swimbladder.errors import InputError, LogError

if TYPE_CHECKING:
    from swimbladder.io.log_format import LogFormat
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle


LogVehicle = Annotated[
    str | None,
    typer.Option("--vehicle", metavar="VEHICLE", help="Preset or TOML file (that of the format)."),
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


def selections(texts: Sequence[str], option: str = "--where") -> list[dict[str, str]]:
    """Return one selection of rows for each log or cast: all combinations of the values given."""
    given = [pair(text, option) for text in texts]
    names = [name for name, _ in given]
    values = [[v.strip() for v in value.split(",") if v.strip()] for _, value in given]
    return [dict(zip(names, one, strict=True)) for one in product(*values)]


def _states(text: str) -> bool:
    """Whether a text given as a log format is a field of one, not its name."""
    return "=" in text and not Path(text).exists()


class LogReading(Options):
    """Which rows of files make logs, and how they are read."""

    where: Several = valued("COLUMN=VALUE", "Rows of the log; VALUE,VALUE: one log each.")
    columns: Several = valued("NAME=COLUMN", r'Column of the log: "depth_m=Depth \[cm]" or @cm.')
    log_format: Several = valued(
        "FORMAT",
        r"Format of the log: TOML file with a \[log] table; also FIELD=VALUE: "
        "atmospheric_pressure=gauge.",
    )

    def chosen(self, paths: Sequence[Path]) -> list[Chosen]:
        """Return every selection of every file, in order; raises InputError naming the option."""
        return [Chosen(path, one) for path in paths for one in selections(self.where or [])]

    @property
    def mapped(self) -> dict[str, str]:
        """The columns by name; raises InputError naming the option."""
        return pairs(self.columns or [], "--column")

    @property
    def format_name(self) -> str | None:
        """The log format that is named."""
        named = [text for text in self.log_format or () if not _states(text)]
        return once([("", name) for name in named], "--log-format").get("")

    def _form(self, known: str | None) -> LogFormat | None:
        """Return the log format asked for, or a known one, with fields; None: the usual.

        Raises InputError naming the option.
        """
        from swimbladder.io.log_format import LogFormat, log_format

        name = self.format_name or known
        stated = pairs([text for text in self.log_format or () if _states(text)], "--log-format")
        form = None if name is None else log_format(name)
        if not stated:
            return form
        given = {} if form is None else form.model_dump(exclude_unset=True)
        try:
            return LogFormat(**{**given, **stated})
        except InputError as error:
            raise error.but(field=f"--log-format {error.field}") from None

    def log(
        self,
        log: Chosen,
        vehicle: Vehicle | None,
        *,
        quiet: bool = False,
        required: Collection[str] = ("time_s", "depth_m"),
    ) -> Log:
        """Return the log of a vehicle, read by the format asked for or the one shipped for it.

        quiet: what was taken has been said. required: columns it must have. A pressure becomes a
        depth by the density of the vehicle's water, where none is stated. Raises LogError, an
        InputError, with file, line, column, value and remedy.
        """
        from swimbladder.io.columns import NOT_READ, TAKEN
        from swimbladder.io.log_format import LogFormat
        from swimbladder.io.logs import read_log, shipped_format

        columns, said, known = self.mapped, list[str](), None
        if self.format_name is None:
            known = shipped_format(log.path, {*required} - {*columns})
        form = self._form(known)
        if known:
            said.append(f"its columns are those of the log format {known}, and read so")
        with progress(f"reading {log.label}"):
            how: dict[str, Any] = {"columns": columns, "where": log.where, "required": required}
            try:
                found = read_log(log.path, **how, log_format=form)
            except LogError as error:
                if error.field == "water_density" and vehicle is not None:
                    density = vehicle.water.density
                    said.append(f"water of {density:g} kg/m3, the vehicle's, makes depths of it")
                    form = (form or LogFormat()).model_copy(update={"water_density": density})
                    found = read_log(log.path, **how, log_format=form)
                elif form is None and not columns and error.field in required:
                    raise _of_its_kind(error, log.path, vehicle) from None
                else:
                    raise
        said += [note for note in found.report if note.startswith((TAKEN, NOT_READ))]
        aside(*(f"{log.path}: {note}" for note in said if not quiet))
        return found


def vehicle_of(logs: Sequence[Chosen], given: str | None) -> str:
    """Return the vehicle given, else the preset that the logs' known format is named after.

    Raises InputError where there is none.
    """
    from swimbladder.io.logs import shipped_format
    from swimbladder.io.presets import preset_names

    if given is not None:
        return given
    found = {shipped_format(log.path, ("time_s", "depth_m")) for log in logs}
    name = found.pop() if len(found) == 1 else None
    if name not in preset_names():
        why = "which vehicle made the log is not said"
        remedy = f"Give --vehicle: one of {', '.join(preset_names())}, or a file that "
        remedy += "`swimbladder vehicle new` begins"
        raise InputError(why, field="--vehicle", remedy=remedy)
    aside(f"the logs are in the format of {name}: --vehicle {name}")
    return str(name)


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
