"""Which column of a file is which quantity: as it is mapped, or by the words and unit of its name.

A column of a foreign log is taken where its words name one quantity, its unit is stated and of that
kind, and no other column fits: what is taken is reported, and what is not with the option that
reads it.
"""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from swimbladder.errors import LogError, column_as
from swimbladder.io.log_format import COLUMNS, LogColumn, bracketed
from swimbladder.io.log_text import LogFile
from swimbladder.units import has_kind, unit_factor
from swimbladder.vehicle.schema import did_you_mean

Mapped = Mapping[str, LogColumn | str]

TEXT = "text"  # the unit of times without one: what they are their texts say
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
_EXAMPLES = {"time_s": "s", "depth_m": "m", "pressure_Pa": "mbar", "volume_m3": "cm3"}
_SPELLED = {
    "": "1, psu, pss-78, pss, ppt, 1e-3, 0.001, practical salinity scale",
    "deg": "degree, degrees, degree_north, degrees_north, degree_east, degrees_east",
    "ft": "feet, foot",
    "in": "inch, inches",
    "m": "m, meter, meters, metre, metres, salt water, m",
    "d": "day, days",
    "h": "hr, hrs, hour, hours",
    "min": "mins, minute, minutes",
    "s": "sec, secs, second, seconds",
    "cs": "csec",
    "ms": "msec, millis, milliseconds",
    "mbar": "mbar, millibar, millibars",
    "dbar": "dbar, decibar, decibars, db",
    "bar": "bar",
    "Pa": "pa",
    "hPa": "hpa",
    "kPa": "kpa, kpascal",
    "MPa": "mpa",
    "V": "v, volt, volts",
    "A": "amp, amps, ampere, amperes",
    "degC": "c, celsius, deg c, deg_c, degree_c, degrees_c, degree_celsius, degrees_celsius, "
    "degrees celsius, its-90, deg c",
    "K": "kelvin",
    "S/m": "s/m, s m-1, s.m-1, siemens/meter, mhos/m",
    "mS/cm": "ms/cm, ms cm-1",
    "uS/cm": "us/cm, microsiemens per centimeter",
    "kg/m3": "kg m-3",
}
_UNITS = {word: unit for unit, words in _SPELLED.items() for word in words.split(", ")}
_UNITS |= {"salt water, m": "m", "its-90, deg c": "degC"}


def plain_unit(text: str) -> str:
    """Return a unit as it stands in files, of oceanographers too, in the grammar of `units`."""
    return _UNITS.get(text.strip().lower(), text.strip())


def words_and_unit(name: str) -> tuple[str, str | None]:
    """Return the words of a name, and its unit: in brackets or as its last words; None for none.

    ``Depth [cm]`` -> ("Depth", "cm"), ``cond_mS_cm`` -> ("cond", "mS/cm").
    """
    unit = bracketed(name)
    if unit is not None:
        return name[: name.rindex(unit) - 1], plain_unit(unit)
    parts = re.split(r"[\s_/,.]+", name.strip(" _"))
    for last in (2, 1):
        tail = plain_unit("/".join(parts[-last:]))
        if len(parts) > last and parts[-1][:1].isalpha() and (tail == "" or has_kind(tail, tail)):
            return " ".join(parts[:-last]), tail
    return name, None


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
        """How it is mapped, in a unit that may be it."""
        unit = _EXAMPLES.get(self.name, COLUMNS[self.name])
        if has_kind(self.unit, "rad"):
            unit = "0.01 mm/deg"
        return column_as(self.name, self.column if self.sure else f"{self.column}@{unit}")


def _meant(header: Sequence[str], but: Mapping[str, LogColumn]) -> dict[str, list[_Meant]]:
    """Return the columns of a header by what they mean, without those that are read already."""
    found: dict[str, list[_Meant]] = {}
    read = {column.name for column in but.values()}
    for column in (name for name in header if name not in read):
        words, unit = words_and_unit(column)
        name = _NAMES.get(" ".join(re.split(r"[\s_]+", words.lower())).strip())
        if name is not None and name not in but:
            unit = "" if (unit or "").upper() in ("UTC", "GMT") else unit or ""
            found.setdefault(name, []).append(_Meant(column, name, unit))
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
            found[name] = LogColumn(name=one.column, unit=one.unit or TEXT)
        else:
            how = " or ".join(each.option for each in several)
            lacks = "several fit" if len(several) > 1 else one.unit or "no unit"
            why.append(f"{NOT_READ}{name} ({lacks}): {how} reads it")
    if found:
        taken = (f"{name} from {column.name!r}" for name, column in found.items())
        file.report.append(TAKEN + ", ".join(taken))
    file.report.extend(why)
    return found


def likely(header: Sequence[str], read: Mapping[str, LogColumn]) -> str:
    """Return the options that read what is not read yet, each in a unit that it may have."""
    options = [one.option for several in _meant(header, read).values() for one in several]
    return f". Perhaps {' '.join(options)}" if options else ""


def named_by_unit(name: str, unit: str) -> str | None:
    """Return the column of a log that is a variable's by its name and unit: `depth` in m."""
    for column, wanted in COLUMNS.items():
        named = column == name or column.startswith(f"{name.lower()}_")
        if named and has_kind(unit, wanted) and unit_factor(unit, wanted) == 1.0:
            return column
    return None


def check_columns(file: LogFile, names: Collection[str], known: Iterable[str], table: str) -> None:
    """Raise LogError for a name that is no column of such a table."""
    columns = list(known)
    for name in names:
        if name not in columns:
            remedy = f"{did_you_mean(name, columns)}Columns: {', '.join(columns)}"
            raise file.refused(f"no such column of {table}", remedy, name)


def wanted_names(mapped: Mapped, choices: Iterable[Collection[str]]) -> list[set[str]]:
    """Return sets of names, of each of which the header has to have one.

    choices: of columns, of each of which one is needed.
    """
    wanted = [set(column_readings(given)) for given in mapped.values()]
    dates = [given.date for given in mapped.values() if isinstance(given, LogColumn)]
    wanted += [{date} for date in dates if date is not None]
    return wanted + [set(names) for names in choices if set(names).isdisjoint(mapped)]


def column_readings(given: LogColumn | str) -> dict[str, LogColumn]:
    """Return what ``NAME``, ``NAME@UNIT`` or ``DATE+NAME@UNIT`` may mean, by the column's name."""
    if isinstance(given, LogColumn) and (given.unit is not None or given.date is not None):
        return {given.name: given}
    text = given if isinstance(given, str) else given.name
    found = {text: LogColumn(name=text or " ")}
    name, at, unit = text.rpartition("@")
    if at and name:
        found.setdefault(name, LogColumn(name=name, unit=unit))
        day, plus, time = name.partition("+")
        if plus and day.strip() and time.strip():
            day, time = day.strip(), time.strip()
            found.setdefault(time, LogColumn(name=time, unit=unit, date=day))
    return found


def mapped_column(
    file: LogFile, name: str, given: LogColumn | str, header: Sequence[str]
) -> LogColumn:
    """Return the column of the file that is mapped.

    Raises LogError unless the header has it, and its date, once.
    """
    readings = column_readings(given)
    fitting = [column for reading, column in readings.items() if reading in header]
    meant = list(readings.values())[:2][-1]  # without what is after the @, for the refusal
    column = fitting[0] if fitting else meant
    for wanted in (column.name, column.date):
        if wanted is not None and header.count(wanted) != 1:
            near = did_you_mean(wanted[:60], [column[:60] for column in header[:200]])
            what = "the header has this column twice" if wanted in header else "no such column"
            remedy = f"{near}Columns of the file: {listed(header)}"
            raise file.refused(what, remedy, name, value=wanted)
    return column


def named_columns(
    file: LogFile, mapped: Mapped, header: Sequence[str], known: Collection[str]
) -> dict[str, LogColumn]:
    """Return which column of the file each known one is read from: as mapped, else by its name."""
    return {
        name: mapped_column(file, name, mapped.get(name, name), header)
        for name in known
        if name in mapped or name in header
    }


def no_column(
    file: LogFile, what: str, name: str, header: Sequence[str], more: str = "", hint: str = ""
) -> LogError:
    """Return the error for a table that lacks a column, with what says which it is."""
    how = f"Say which one it is with {column_as(name, 'NAME@UNIT')}{more}"
    return file.refused(what, f"{how}; columns of the file: {listed(header)}{hint}", name)


def listed(header: Sequence[str], limit: int = 30) -> str:
    """Return the names of a header, the first of a long one."""
    more = f" and {len(header) - limit} more" if len(header) > limit else ""
    return ", ".join(name[:40] for name in header[:limit]) + more
