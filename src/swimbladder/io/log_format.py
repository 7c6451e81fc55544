"""What a log's columns are called and mean: the ``[log]`` table.

::

    [log]
    delimiter = ";"              # found in the header where it is not given
    decimal = ","                # "." where it is not given
    rows = "sort"                # rows out of order: sort them by time instead of refusing
    volume_zero = "first"        # the vehicle is neutral at the first sample (the default)
    volume_zero = "12 cm3"       # or: what volume_m3 reads at mid-stroke
    piston_zero = "25.75 mm"     # what piston_m reads at mid-stroke; "first" as above
    piston_positive = "in"       # a larger piston_m means less volume; "out" is the default

    [log.columns]
    time_s = { name = "Time", unit = "iso" }     # seconds, any unit of time, or ISO 8601
    depth_m = { name = "Depth", unit = "cm" }
    voltage_V = "Motor [mV]"                     # the unit in brackets counts
    [log.where]
    log = 47                                     # only the rows with 47 in the column `log`
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from swimbladder.errors import InputError
from swimbladder.io.config import file_text, read_model
from swimbladder.io.log_formats import format_names, format_text
from swimbladder.parameters import Parameters
from swimbladder.parameters.schema import did_you_mean, refusal
from swimbladder.units import parse_quantity, unit_factor

__all__ = ["COLUMNS", "LogColumn", "LogColumns", "LogFormat", "column_factor", "log_format"]

COLUMNS = {
    "time_s": "s",
    "depth_m": "m",
    "volume_m3": "m3",
    "piston_m": "m",
    "voltage_V": "V",
    "current_A": "A",
    "speed_m_s": "m/s",
    "reference_depth_m": "m",
    "reference_volume_m3": "m3",
    "reference_piston_m": "m",
}


class LogColumn(Parameters):
    """Which column of the file to read, and its unit."""

    name: str = Field(min_length=1, description="its name in the header of the file")
    unit: str | None = Field(None, description="its unit; iso: ISO 8601 times")


def _column(value: object) -> object:
    return {"name": value} if isinstance(value, str) else value


_Column = Annotated[LogColumn | None, BeforeValidator(_column)]


class LogColumns(Parameters):
    """Which column of the file each column of a log is; those not named are looked for as such."""

    time_s: _Column = Field(None, description="time of the sample")
    depth_m: _Column = Field(None, description="depth of the pressure sensor")
    volume_m3: _Column = Field(None, description="volume change, positive: lighter")
    piston_m: _Column = Field(None, description="position of the piston")
    voltage_V: _Column = Field(None, description="voltage of the motor")
    current_A: _Column = Field(None, description="current of the motor")
    speed_m_s: _Column = Field(None, description="vertical speed, positive down")
    reference_depth_m: _Column = Field(None, description="depth asked for")
    reference_volume_m3: _Column = Field(None, description="volume the actuator was asked for")
    reference_piston_m: _Column = Field(
        None, description="position of the piston the actuator was asked for"
    )

    def mapped(self) -> dict[str, LogColumn]:
        """Return the columns that are named."""
        found = {name: getattr(self, name) for name in COLUMNS}
        return {name: column for name, column in found.items() if column is not None}


def _zero(unit: str) -> BeforeValidator:
    def check(value: object) -> float | None:
        if value is None or value == "first":
            return None
        try:
            return parse_quantity(value, unit)
        except InputError as error:
            remedy = f'Write "first" or the reading at mid-stroke, in {unit}'
            raise refusal(error.what, remedy) from None

    return BeforeValidator(check)


Delimiter = Literal[",", ";", "\t", "|"]


class LogFormat(Parameters):
    """The ``[log]`` table: how to read a log."""

    delimiter: Delimiter | None = Field(
        None, description="between two fields; not given: taken from the header"
    )
    decimal: Literal[".", ","] = Field(".", description="mark before the decimals")
    rows: Literal["ordered", "sort"] = Field(
        "ordered", description="sort: put rows in the order of time instead of refusing the log"
    )
    volume_zero: Annotated[float | None, _zero("m3")] = Field(
        None, description="reading of volume_m3 at mid-stroke; first: neutral at the first sample"
    )
    piston_zero: Annotated[float | None, _zero("m")] = Field(
        None, description="reading of piston_m at mid-stroke; first: neutral at the first sample"
    )
    piston_positive: Literal["in", "out"] = Field(
        "out", description="where a larger piston_m moves it; out: more volume"
    )
    columns: LogColumns = Field(LogColumns(), description="column of a log = column of the file")
    where: dict[str, str | float] = Field(
        default_factory=dict, description="column of the file = what it has to hold"
    )


class _LogFile(Parameters):
    log: LogFormat


def log_format(name_or_path: str | Path) -> LogFormat:
    """Return the log format of a shipped name or of the ``[log]`` table of a TOML file.

    Raises InputError with file, line, field, value and remedy.
    """
    text = str(name_or_path)
    if text in format_names() and not isinstance(name_or_path, Path):
        return read_model(_LogFile, format_text(text), f"log format {text}", versioned=False).log
    path = Path(name_or_path)
    named = isinstance(name_or_path, Path) or path.suffix == ".toml" or len(path.parts) != 1
    if not named and not path.is_file():
        raise InputError(
            "there is no log format of that name, and no such file",
            field="--log-format",
            value=text,
            remedy=f"{did_you_mean(text, format_names())}Log formats: {', '.join(format_names())}; "
            "or give the path of a TOML file with a [log] table",
        )
    return read_model(_LogFile, file_text(path), path, versioned=False).log


def column_factor(column: LogColumn, unit: str) -> float | None:
    """Return the factor from a column's own unit, stated or in brackets, to `unit`.

    None where it states no unit: it is taken to be in `unit`. Raises UnitError where the unit is
    unknown or of another kind.
    """
    stated = column.unit or bracketed(column.name)
    return None if stated is None else unit_factor(stated, unit)


def bracketed(name: str) -> str | None:
    """Return what a column's name holds in brackets at its end: ``Depth [cm]`` -> ``cm``."""
    for opening, closing in ("[]", "()"):
        if name.endswith(closing) and opening in name:
            return name[name.rindex(opening) + 1 : -1].strip() or None
    return None
