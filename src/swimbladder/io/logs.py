"""Measured logs: CSV with a header, into arrays in SI units, with a report of what was done.

A log has the columns ``time_s`` and ``depth_m`` and any of ``volume_m3, piston_m, voltage_V,
current_A, speed_m_s, reference_depth_m``. Other names and units are mapped, by `columns` or by a
``[log]`` table (`swimbladder.io.log_format`); nothing is guessed in silence.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, LogError
from swimbladder.io.log_format import COLUMNS, LogColumn, LogFormat, column_factor, log_format
from swimbladder.io.log_table import Table, read_header, read_table

__all__ = ["Log", "header_names", "read_log"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Log:
    """What was measured, in SI units, as arrays of one length.

    source: file and selection. report: what was converted, dropped or ignored. volume counts
    from mid-stroke where volume_absolute, otherwise its zero is arbitrary; piston likewise, and it
    counts outward: positive displaces more. line: where each sample stands in the file.
    """

    source: str
    time: Array  # s, as logged; ISO 8601 times from the first sample
    depth: Array  # m
    volume: Array | None = None  # m3
    piston: Array | None = None  # m
    voltage: Array | None = None  # V
    current: Array | None = None  # A
    speed: Array | None = None  # m/s
    reference_depth: Array | None = None  # m
    volume_absolute: bool = False
    piston_absolute: bool = False
    line: NDArray[np.int64]
    report: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)


def read_log(
    path: str | Path,
    *,
    columns: Mapping[str, str | LogColumn] | None = None,
    where: Mapping[str, str | float] | None = None,
    log_format: LogFormat | str | Path | None = None,
) -> Log:
    """Return the log in a CSV file, which may be compressed by gzip.

    columns: {"depth_m": "Depth [cm]"}, over those of the log format; a unit in brackets counts,
    and "Depth@cm" states it where the header does not. where: {"log": 47} keeps the rows that hold
    it. log_format: a `LogFormat`, a shipped one's name or a TOML file with a ``[log]`` table.
    Rows without time or depth, and repeated ones, are dropped and reported.
    Raises LogError, an InputError, with file, line, column, value and remedy.
    """
    form = _format(log_format)
    wanted = {**form.where, **(where or {})}
    mapped: dict[str, LogColumn | str] = {**form.columns.mapped(), **(columns or {})}
    for name in mapped:
        if name not in COLUMNS:
            raise LogError(
                "no such column of a log",
                file=path,
                field=name,
                remedy=f"Columns: {', '.join(COLUMNS)}",
            )
    table = read_table(path, form, wanted, lambda header: _sources(mapped, header, path))
    return _log(table, form, wanted, path)


def header_names(path: str | Path) -> list[str]:
    """Return the names in the header of a log.

    Raises LogError where there is none.
    """
    return read_header(path)


def _format(given: LogFormat | str | Path | None) -> LogFormat:
    if given is None:
        return LogFormat()
    return given if isinstance(given, LogFormat) else log_format(given)


def _sources(
    mapped: Mapping[str, LogColumn | str], header: list[str], path: str | Path
) -> dict[str, LogColumn]:
    """Return which column of the file each column of the log is read from."""
    sources: dict[str, LogColumn] = {}
    for name in COLUMNS:
        given = mapped.get(name)
        if given is None:
            if name not in header:
                continue
            given = LogColumn(name=name, unit=COLUMNS[name])
        elif isinstance(given, str):
            source, at, unit = given.rpartition("@")
            stated = at and given not in header
            given = LogColumn(name=source, unit=unit) if stated else LogColumn(name=given or " ")
        if header.count(given.name) != 1:
            raise LogError(
                "the header has this column twice" if given.name in header else "no such column",
                file=path,
                field=name,
                value=given.name,
                remedy=f"Columns of the file: {_listed(header)}",
            )
        sources[name] = given
    for name in ("time_s", "depth_m"):
        if name not in sources:
            raise LogError(
                f"the log has no column {name}",
                file=path,
                field=name,
                remedy=f"Say which one it is with --column {name}=NAME or in a [log] table; "
                f"columns of the file: {_listed(header)}",
            )
    return sources


def _listed(header: list[str], limit: int = 30) -> str:
    more = f" and {len(header) - limit} more" if len(header) > limit else ""
    return ", ".join(name[:40] for name in header[:limit]) + more


def _log(table: Table, form: LogFormat, where: Mapping[str, object], path: str | Path) -> Log:
    """Return the log of a table: scaled, dropped, ordered."""
    report = list(table.report)
    data: dict[str, Array] = {}
    for name, column in table.sources.items():
        data[name] = _scaled(name, column, table.values[name], path, report)
    line = table.line
    keep = np.isfinite(data["time_s"]) & np.isfinite(data["depth_m"])
    if not keep.all():
        gone = int((~keep).sum())
        report.append(f"{gone} of {len(keep)} rows without time or depth dropped")
        if gone > len(keep) / 2:
            raise LogError(
                f"{gone} of {len(keep)} rows have no time or no depth",
                file=path,
                line=int(line[~keep][0]),
                field="depth_m",
                remedy="Check that the right columns are mapped",
            )
    data, line = {name: values[keep] for name, values in data.items()}, line[keep]
    data, line = _in_order(data, line, form, path, where, report)
    if len(line) < 2:
        raise LogError(
            f"{len(line)} usable samples are too few",
            file=path,
            field="rows",
            remedy="Give a log with a row per sample",
        )
    for name in list(data):
        if not np.isfinite(data[name]).any():
            report.append(f"{name} holds no number and is ignored")
            del data[name]
    piston = data.get("piston_m")
    volume = data.get("volume_m3")
    if piston is not None:
        sign = -1.0 if form.piston_positive == "in" else 1.0
        piston = sign * (piston - (form.piston_zero or 0.0))
        if sign < 0.0:
            report.append("piston_m counts inward in the file; turned to count outward")
    if volume is not None:
        volume = volume - (form.volume_zero or 0.0)
    chosen = ", ".join(f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
                       for name, value in where.items())  # fmt: skip
    return Log(
        source=f"{path} ({chosen})" if chosen else str(path),
        time=data["time_s"],
        depth=data["depth_m"],
        volume=volume,
        piston=piston,
        voltage=data.get("voltage_V"),
        current=data.get("current_A"),
        speed=data.get("speed_m_s"),
        reference_depth=data.get("reference_depth_m"),
        volume_absolute=form.volume_zero is not None,
        piston_absolute=form.piston_zero is not None,
        line=line,
        report=tuple(report),
    )


def _scaled(
    name: str, column: LogColumn, values: Array, path: str | Path, report: list[str]
) -> Array:
    """Return a column in the unit of its name; what is not finite becomes NaN."""
    unit = COLUMNS[name]
    values = np.where(np.isfinite(values), values, np.nan)
    if column.unit == "iso":
        report.append(f"{name} read from {column.name!r} as ISO 8601, in seconds from the first")
        return values
    try:
        factor = column_factor(column, unit)
    except InputError as error:
        raise LogError(
            error.what, file=path, field=name, value=column.name, unit=unit, remedy=error.remedy
        ) from None
    if column.name != name:
        stated = f"taken to be in {unit}" if factor is None else f"times {factor:g} for {unit}"
        stated = f"in {unit}" if factor == 1.0 else stated
        report.append(f"{name} read from {column.name!r}, {stated}")
    return values if factor is None else values * factor


def _in_order(
    data: dict[str, Array],
    line: NDArray[np.int64],
    form: LogFormat,
    path: str | Path,
    where: Mapping[str, object],
    report: list[str],
) -> tuple[dict[str, Array], NDArray[np.int64]]:
    """Return the rows with time increasing; those that repeat a time are dropped."""
    time = data["time_s"]
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back) and form.rows == "sort":
        report.append(f"rows sorted by time: it went back {len(back)} times")
        order = np.argsort(time, kind="stable")
        data, line = {name: values[order] for name, values in data.items()}, line[order]
    elif len(back):
        at = int(back[0]) + 1
        several = (
            "" if where else "choose one of several logs in the file with --where COLUMN=VALUE, "
        )
        raise LogError(
            f"time goes back, {len(back)} times in the log",
            file=path,
            line=int(line[at]),
            field="time_s",
            value=float(time[at]),
            unit="s",
            remedy=f'If the file is in disorder, {several}or set rows = "sort" in its [log] table',
        )
    new = np.append(True, np.diff(data["time_s"]) > 0.0)
    if not new.all():
        report.append(f"{int((~new).sum())} rows that repeat the time before them dropped")
        data, line = {name: values[new] for name, values in data.items()}, line[new]
    return data, line
