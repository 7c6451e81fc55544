"""What the columns of a foreign log mean, by the words and the units of their names.

A column is taken where its words name one quantity, its unit is stated and of that kind, and no
other column fits: what is taken is reported, and what is not with the option that reads it.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeGuard

from swimbladder.io.log_format import COLUMNS, LogColumn, bracketed
from swimbladder.io.log_rows import Column
from swimbladder.io.log_text import LogFile
from swimbladder.units import has_kind

_TEXT = "text"  # of times without a unit: what they are their texts say
TAKEN, NOT_READ = "columns taken by their names: ", "not read: "
_WORDS = {
    "time_s": "time, t, elapsed time, elapsed, timestamp, time stamp, datetime, date time, zeit",
    "depth_m": "depth, z, tiefe, profondeur",
    "pressure_Pa": "pressure, press, p, druck",
    "volume_m3": "volume, vol, volume change, displaced volume",
    "piston_m": "piston, piston position, position, stepper, stepper position, motor angle, kolben",
    "voltage_V": "voltage, motor voltage, motor, spannung",
    "current_A": "current, motor current, strom",
    "speed_m_s": "speed, vertical speed, velocity",
    "reference_depth_m": "target depth, depth target, set-point, setpoint, depth setpoint",
}
_NAMES = {word: name for name, words in _WORDS.items() for word in words.split(", ")}
_SPELLED = {
    "ft": "feet foot",
    "in": "inch inches",
    "m": "meter meters metre metres",
    "s": "sec secs second seconds",
    "min": "mins minute minutes",
    "h": "hr hrs hour hours",
    "ms": "msec millis milliseconds",
    "mbar": "millibar millibars",
    "dbar": "decibar decibars",
    "V": "v volt volts",
    "A": "amp amps ampere amperes",
    "deg": "degree degrees",
}
_UNITS = {word: unit for unit, words in _SPELLED.items() for word in words.split()}
_EXAMPLES = {"time_s": "s", "depth_m": "m", "pressure_Pa": "mbar", "volume_m3": "cm3"}
_ISO = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d\d")
_CLOCK = re.compile(r"\d{1,3}:[0-5]\d:[0-5]\d")


class _Meant(NamedTuple):
    """A column of a file: what its words name, and its unit, "" where it states none."""

    column: str
    name: str
    unit: str

    @property
    def sure(self) -> bool:
        """Whether its unit is stated, and of the kind; times of no unit may be texts."""
        return has_kind(self.unit, COLUMNS[self.name]) or (self.name == "time_s" and not self.unit)

    @property
    def option(self) -> str:
        """How it is read on the command line, in a unit that may be it."""
        unit = _EXAMPLES.get(self.name, COLUMNS[self.name])
        if has_kind(self.unit, "rad"):
            unit = "0.01 mm/deg"
        return f'--column "{self.name}={self.column}{"" if self.sure else f"@{unit}"}"'


def _meant(header: Sequence[str], but: Mapping[str, LogColumn]) -> dict[str, list[_Meant]]:
    """Return the columns of a header by what they mean, without those that are read already."""
    found: dict[str, list[_Meant]] = {}
    read = {column.name for column in but.values()}
    for column in (name for name in header if name not in read):
        unit = bracketed(column)
        words = column[: column.rindex(unit) - 1] if unit else column
        if not unit and (parts := re.fullmatch(r"(.*[^\W_])[\s_/,.]+([^\W_]+)", column)):
            tail = _UNITS.get(parts[2].lower(), parts[2])
            if any(has_kind(tail, of) for of in (*COLUMNS.values(), "rad")):
                words, unit = parts[1], tail
        plain = " ".join(re.split(r"[\s_]+", words.lower())).strip()
        name = _NAMES.get(plain)
        if name is not None and name not in but:
            unit = "" if (unit or "").upper() in ("UTC", "GMT") else unit or ""
            found.setdefault(name, []).append(_Meant(column, name, _UNITS.get(unit.lower(), unit)))
    return found


def meant_columns(
    file: LogFile, header: Sequence[str], read: Mapping[str, LogColumn]
) -> dict[str, LogColumn]:
    """Return the columns that can only be meant, and report which, and which cannot be read so."""
    found, why = {}, []
    meant = _meant(header, read)
    if "depth_m" in meant and "pressure_Pa" in meant:
        del meant["pressure_Pa"]
    for name, several in meant.items():
        one = several[0]
        if len(several) == 1 and one.sure:
            found[name] = LogColumn(name=one.column, unit=one.unit or _TEXT)
        else:
            how = " or ".join(each.option for each in several)
            lacks = "several fit" if len(several) > 1 else one.unit or "no unit"
            why.append(f"{NOT_READ}{name} ({lacks}): {how} reads it")
    if found:
        taken = (f"{name} from {column.name!r}" for name, column in found.items())
        file.report.append(TAKEN + ", ".join(taken))
    file.report.extend(why)
    return found


def text_unit(name: str, column: LogColumn, texts: Column, file: LogFile) -> LogColumn:
    """Return a column, of times that are texts with what they are: ISO 8601, or of the day.

    Raises LogError where the column is taken for the time by its name alone, and says no unit.
    """
    if name != "time_s" or column.date or column.unit not in (None, _TEXT):
        return column
    first = next((text.strip() for text in texts if text.strip()), "") if _texts(texts) else ""
    for unit, pattern in {"iso": _ISO, "clock": _CLOCK}.items():
        if pattern.match(first):
            return LogColumn(name=column.name, unit=unit)
    if column.unit == _TEXT:
        what = "it may be the time, and says no unit"
        remedy = f'Say it: --column "time_s={column.name}@s", or @ms, @min, @h'
        raise file.refused(what, remedy, name, value=column.name)
    return column


def _texts(column: Column) -> TypeGuard[list[str]]:
    return isinstance(column, list)


def likely(header: Sequence[str], read: Mapping[str, LogColumn]) -> str:
    """Return the options that read what is not read yet, each in a unit that it may have."""
    options = [one.option for several in _meant(header, read).values() for one in several]
    return f". Perhaps {' '.join(options)}" if options else ""
