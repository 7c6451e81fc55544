"""What a log's columns are called and mean: the ``[log]`` table.

::

    [log]
    delimiter = ";"              # found in the header where it is not given
    decimal = ","                # "." where it is not given
    header_starts = "Time[ms]"   # what stands above, and before it on its line, is left out
    units_row = true             # the row below the names holds the units
    rows = "sort"                # rows out of order: sort them by time instead of refusing
    volume_zero = "first"        # the vehicle is neutral at the first sample (the default)
    volume_zero = "12 cm3"       # or: what volume_m3 reads at mid-stroke
    piston_zero = "25.75 mm"     # what piston_m reads at mid-stroke; "first" as above
    piston_positive = "in"       # a larger piston_m means less volume; "out" is the default
    water_density = "998 kg/m3"  # to turn pressure_Pa into depth_m
    atmospheric_pressure = "gauge"
    spikes = "drop"              # leave out single samples that stand far off

    [log.columns]
    time_s = { name = "Time", unit = "iso" }     # or any unit of time, clock, tick or a pattern
    depth_m = { name = "Depth", unit = "cm" }
    voltage_V = "Motor [mV]"                     # the unit in brackets counts
    [log.where]
    log = 47                                     # only the rows with 47 in the column `log`
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from swimbladder.errors import InputError, UnitError
from swimbladder.io.config import file_text, read_model
from swimbladder.io.files import file_there
from swimbladder.io.log_formats import FORMATS
from swimbladder.units import has_kind, unit_factor
from swimbladder.vehicle import Parameters, Unit
from swimbladder.vehicle.schema import did_you_mean, quantity_in, refusal


class LogColumn(Parameters):
    """Which column of the file to read, and its unit."""

    name: str = Field(min_length=1)
    """its name in the header of the file"""
    unit: str | None = None
    """its unit; of times also iso, clock, tick or a pattern: %d.%m.%Y %H:%M:%S"""
    date: str | None = Field(None, min_length=1)
    """column with the date of a time of day"""


def _column(value: object) -> object:
    return {"name": value} if isinstance(value, str) else value


_Column = Annotated[LogColumn | None, BeforeValidator(_column)]


class LogColumns(Parameters):
    """Columns of the file; columns not named are looked for under these names."""

    time_s: _Column = None
    """time of the sample"""
    depth_m: _Column = None
    """depth of the pressure sensor"""
    pressure_Pa: _Column = None
    """pressure, to be turned into depth_m"""
    volume_m3: _Column = None
    """volume change, positive: lighter"""
    piston_m: _Column = None
    """position of the piston"""
    voltage_V: _Column = None
    """voltage of the motor"""
    current_A: _Column = None
    """current of the motor"""
    temperature_degC: _Column = None
    """temperature of the hull (or water)"""
    speed_m_s: _Column = None
    """vertical speed, positive down"""
    reference_depth_m: _Column = None
    """depth asked for"""
    reference_volume_m3: _Column = None
    """volume the actuator was asked for"""
    reference_piston_m: _Column = None
    """position of the piston the actuator was asked for"""

    def mapped(self) -> dict[str, LogColumn]:
        """Return the columns that are named."""
        found = {name: getattr(self, name) for name in COLUMNS}
        return {name: column for name, column in found.items() if column is not None}


COLUMNS = {
    name: "m/s" if name.endswith("_m_s") else name.rpartition("_")[2]
    for name in LogColumns.model_fields
}
"""The columns of a log and their units, which end their names."""


def _zero(unit: str) -> BeforeValidator:
    how = f'Write "first" or the reading at mid-stroke, in {unit}'
    return BeforeValidator(lambda x: None if x in (None, "first") else quantity_in(x, unit, how))


def _surface(value: object) -> object:
    """Return what the pressure sensor reads at the surface [Pa], or the text that says how."""
    text = value.strip() if isinstance(value, str) else value
    if text is None or text in ("gauge", "first"):
        return text
    how = 'Write "gauge", "first", "first 10 s" or a pressure like "1013 mbar"'
    if not isinstance(text, str) or not text.startswith("first "):
        return quantity_in(text, "Pa", how)
    seconds = quantity_in(text.removeprefix("first "), "s", how)
    if seconds > 0.0:
        return f"first {seconds!r} s"
    raise refusal("the time must be above 0", 'Write it like "first 10 s"')


def _tick(value: object) -> object:
    """Return the length of a tick [s], of a text in Hz its inverse."""
    if isinstance(value, str) and value.rstrip().endswith("Hz"):
        rate = quantity_in(value, "1/s", 'Write it like "30.5 us" or "32768 Hz"')
        return 1.0 / rate if rate > 0.0 else rate
    return value


Delimiter = Literal[",", ";", "\t", "|", " "]
_Unicode = Literal["utf-8", "utf-16-le", "utf-16-be"]
_Western = Literal["latin-1", "cp1252", "cp437", "mac-roman"]
Encoding = Literal[_Unicode, _Western, "shift_jis", "gb18030"]


class LogFormat(Parameters):
    """The ``[log]`` table: how to read a log."""

    encoding: Encoding | None = None
    """default: byte order mark, else UTF-8, else Latin-1"""
    delimiter: Delimiter | None = None
    """a blank: any blanks and tabs; default: from the header"""
    decimal: Literal[".", ","] = "."
    """decimal mark"""
    comment: str = Field("#", min_length=1, max_length=8)
    """beginning of remarks"""
    missing: tuple[str, ...] = ()
    """texts that stand for no number"""
    header_starts: str | None = Field(None, min_length=1)
    """beginning of the header's line, before which text is skipped; default: the first line with
    all names needed"""
    names: tuple[str, ...] | None = Field(None, min_length=1)
    """of columns, in a file without a header"""
    skip_lines: Annotated[int, Field(ge=0)] = 0
    """at the top of the file"""
    units_row: bool = False
    """the row below the names holds units"""
    skip_rows: Annotated[int, Field(ge=0)] = 0
    """below names and units"""
    fields: Annotated[int, Field(ge=1)] | None = None
    """per row, if the header names fewer"""
    part: Annotated[int, Field(ge=1)] | None = None
    """of a file with repeated headers; default: all"""
    bad_rows: Literal["refuse", "drop"] = "refuse"
    """rows with non-numbers"""
    rows: Literal["ordered", "sort"] = "ordered"
    """`sort` orders by time instead of refusing"""
    tick: Annotated[float, Unit("s"), Field(gt=0.0), BeforeValidator(_tick)] | None = None
    """of `time_s`; also in Hz"""
    counter_bits: Annotated[int, Field(ge=8, le=64)] | None = None
    """of a time counter that wraps to 0"""
    gap: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """least gap; default: five times the median step"""
    spikes: Literal["report", "drop"] = "report"
    """single samples far off"""
    volume_zero: Annotated[float | None, _zero("m3")] = None
    """at mid-stroke; `first`: neutral at the first sample"""
    piston_zero: Annotated[float | None, _zero("m")] = None
    """at mid-stroke; `first`: neutral at the first sample"""
    piston_positive: Literal["in", "out"] = "out"
    """direction in which `piston_m` grows; `out`: more volume"""
    depth_positive: Literal["down", "up"] = "down"
    """direction in which depths and speeds grow"""
    water_density: Annotated[float, Unit("kg/m3"), Field(ge=900.0, le=1300.0)] | None = None
    """for pressure into depth"""
    gravity: Annotated[float, Unit("m/s2"), Field(ge=9.7, le=9.9)] = 9.80665
    """for pressure into depth"""
    atmospheric_pressure: Annotated[float | str | None, BeforeValidator(_surface)] = None
    """reading at the surface: a pressure, or `gauge` (0), `first` (sample), `first 10 s`
    (median)"""
    logger_density: Annotated[float, Unit("kg/m3"), Field(ge=900.0, le=1300.0)] | None = None
    """used by the logger for `depth_m`, if not `water_density`"""
    depth_offset: Annotated[float, Unit("m")] = 0.0
    """added to the depth at the end; positive: deeper"""
    columns: LogColumns = LogColumns()
    """column of a log = column of the file"""
    where: dict[str, str | float] = Field(default_factory=dict)
    """column of the file = what it has to hold"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        for name in ("header_starts", "units_row", "skip_rows", "fields", "part"):
            if self.names is not None and getattr(self, name):
                what = f"{name} is for a file with a header, and names for one without"
                raise refusal(what, "Leave one of the two out", name)
        if self.logger_density is not None and self.water_density is None:
            remedy = 'Add a line water_density = "998 kg/m3", or that of your water'
            raise refusal("the density of the water itself is missing", remedy, "logger_density")


class _LogFile(Parameters):
    log: LogFormat


def format_of(given: LogFormat | Mapping[str, Any] | str | Path | None) -> LogFormat:
    """Return a log format: given itself, by its fields, or as `log_format` takes it; the usual."""
    if given is None or isinstance(given, Mapping):
        return LogFormat(**given or {})
    return given if isinstance(given, LogFormat) else log_format(given)


def log_format(name_or_path: str | Path) -> LogFormat:
    """Return the log format of a shipped name or of the ``[log]`` table of a TOML file.

    Raises InputError with file, line, field, value and remedy.
    """
    text = str(name_or_path)
    if text in FORMATS and not isinstance(name_or_path, Path):
        package = FORMATS.package(text)
        where = f"log format {text}" + (f" of the package {package}" if package else "")
        return read_model(_LogFile, FORMATS[text], where, versioned=False).log
    path = Path(name_or_path)
    named = isinstance(name_or_path, Path) or path.suffix == ".toml" or len(path.parts) != 1
    if not named and not file_there(path):
        what = "there is no log format of that name, and no such file"
        known = FORMATS.names()
        formats = f"{did_you_mean(text, known)}Log formats: {', '.join(known)}"
        remedy = f"{formats}; or give the path of a TOML file with a [log] table"
        raise InputError(what, field="log_format", value=text, remedy=remedy)
    return read_model(_LogFile, file_text(path), path, versioned=False).log


def column_factor(column: LogColumn, unit: str) -> float | None:
    """Return the factor from a column's own unit, stated or in brackets, to `unit`.

    None where it states no unit: it is taken to be in `unit`. A scale is one too, as for counts of
    an encoder: ``0.0833 mm/deg``. Raises UnitError where the unit is unknown or of another kind.
    """
    stated = column.unit if column.unit is not None else bracketed(column.name)
    if stated is None:
        return None
    scale = _SCALE.fullmatch(stated.strip())
    if scale is None:
        return unit_factor(stated, unit)
    number, of = float(scale[1]), scale[2]
    each, _, count = of.rpartition("/")
    counted = has_kind(count, "rad") or not has_kind(count, count)  # deg, rev, or no unit at all
    if not (counted and has_kind(each, unit)):
        each = of
    if number == 0.0 or not math.isfinite(number):
        remedy = "Write how much one count is, as 0.0833 mm/deg"
        raise UnitError("no scale", value=stated, unit=unit, remedy=remedy)
    return number * unit_factor(each, unit)


_SCALE = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d./].*)")


def bracketed(name: str) -> str | None:
    """Return what a column's name holds in brackets at its end: ``Depth [cm]`` -> ``cm``."""
    for opening, closing in ("[]", "()"):
        if name.endswith(closing) and opening in name:
            return name[name.rindex(opening) + 1 : -1].strip() or None
    return None
