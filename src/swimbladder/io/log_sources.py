"""Which column of a file each column of a log is read from."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from swimbladder.io.log_depth import depth_source
from swimbladder.io.log_format import COLUMNS, LogColumn
from swimbladder.io.log_text import LogFile
from swimbladder.vehicle.schema import did_you_mean


def mapped_columns(
    file: LogFile, columns: Mapping[str, str | LogColumn], required: Collection[str]
) -> dict[str, LogColumn | str]:
    """Return what is mapped; raises LogError where that, or what is required, is no column."""
    mapped: dict[str, LogColumn | str] = {**file.form.columns.mapped(), **columns}
    check_columns(file, (*mapped, *required), COLUMNS, "a log")
    return mapped


def check_columns(
    file: LogFile, names: Collection[str], known: Mapping[str, str], table: str
) -> None:
    """Raise LogError for a name that is no column of such a table."""
    for name in names:
        if name not in known:
            raise file.refused(
                f"no such column of {table}",
                field=name,
                remedy=f"{did_you_mean(name, known)}Columns: {', '.join(known)}",
            )


def wanted_names(mapped: Mapping[str, LogColumn | str], needed: Sequence[str]) -> list[set[str]]:
    """Return sets of names, of each of which the header has to have one."""
    wanted = [set(column_readings(given)) for given in mapped.values()]
    dates = [given.date for given in mapped.values() if isinstance(given, LogColumn)]
    wanted += [{date} for date in dates if date is not None]
    for name in needed:
        if name == "depth_m" and "pressure_Pa" not in mapped and name not in mapped:
            wanted.append({"depth_m", "pressure_Pa"})
        elif name not in mapped and not (name == "depth_m" and "pressure_Pa" in mapped):
            wanted.append({name})
    return wanted


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
    """Return the column of the file that is mapped; raises LogError where it has none such."""
    readings = column_readings(given)
    fitting = [column for reading, column in readings.items() if reading in header]
    if not fitting:
        asked = given if isinstance(given, str) else given.name
        near = did_you_mean(asked[:60], [column[:60] for column in header[:200]])
        raise file.refused(
            "no such column",
            field=name,
            value=asked,
            remedy=f"{near}Columns of the file: {listed(header)}",
        )
    return fitting[0]


def named_columns(
    file: LogFile, mapped: Mapping[str, str], header: Sequence[str], known: Collection[str]
) -> dict[str, LogColumn]:
    """Return which column of the file each known one is read from: as mapped, else by its name."""
    return {
        name: mapped_column(file, name, mapped.get(name, name), header)
        for name in known
        if name in mapped or name in header
    }


def column_sources(
    file: LogFile, mapped: Mapping[str, LogColumn | str], header: list[str], needed: Sequence[str]
) -> dict[str, LogColumn]:
    """Return which column of the file each column of the log is read from."""
    sources: dict[str, LogColumn] = {}
    for name in COLUMNS:
        given = mapped.get(name)
        if given is None:
            if name in header:
                sources[name] = _one(file, name, LogColumn(name=name), header)
            continue
        readings = column_readings(given)
        fitting = [column for reading, column in readings.items() if reading in header]
        meant = list(readings.values())[:2][-1]  # without what is after the @, for the refusal
        given = fitting[0] if fitting else meant
        sources[name] = _one(file, name, given, header)
    source = depth_source(set(sources), set(mapped), file)
    for other in {"depth_m", "pressure_Pa"} - {source} if source else ():
        sources.pop(other, None)
    for name in needed:
        if name not in sources and not (name == "depth_m" and source):
            or_pressure = ", or a pressure with pressure_Pa=NAME" if name == "depth_m" else ""
            raise file.refused(
                f"the log has no column {name}",
                field=name,
                remedy=f"Say which one it is with --column {name}=NAME or in a [log] table"
                f"{or_pressure}; columns of the file: {listed(header)}{_likely(header, sources)}",
            )
    return sources


def _likely(header: Sequence[str], sources: Mapping[str, LogColumn]) -> str:
    """Return the options that map what is not read yet, where one column alone has the word."""
    words: dict[str, list[str]] = {}
    for column in header:
        words.setdefault(re.split(r"[^a-z]", column.strip().lower())[0], []).append(column)
    found = [
        f'--column "{name}={column}"'
        for name in COLUMNS
        for column in words.get(name.rpartition("_")[0], [])
        if name not in sources and len(words[name.rpartition("_")[0]]) == 1
    ]
    return f". Perhaps {' '.join(found)}" if found else ""


def _one(file: LogFile, name: str, column: LogColumn, header: list[str]) -> LogColumn:
    """Return the column; raises LogError unless the header has it, and its date, once."""
    for wanted in (column.name, column.date):
        if wanted is not None and header.count(wanted) != 1:
            raise file.refused(
                "the header has this column twice" if wanted in header else "no such column",
                field=name,
                value=wanted,
                remedy=f"{did_you_mean(wanted[:60], [n[:60] for n in header[:200]])}"
                f"Columns of the file: {listed(header)}",
            )
    return column


def listed(header: Sequence[str], limit: int = 30) -> str:
    """Return the names of a header, the first of a long one."""
    more = f" and {len(header) - limit} more" if len(header) > limit else ""
    return ", ".join(name[:40] for name in header[:limit]) + more
