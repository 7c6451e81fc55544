"""Measured logs: CSV with a header, into arrays in SI units, with a report of what was done.

A log has the columns ``time_s`` and ``depth_m`` and any of ``volume_m3, piston_m, voltage_V,
current_A, speed_m_s, reference_depth_m, reference_volume_m3, reference_piston_m``; a caller may
ask for others than the depth (a motor on a bench has none). Other names and units are mapped, by
`columns` or by a ``[log]`` table (`swimbladder.io.log_format`); nothing is guessed in silence.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, LogError
from swimbladder.io.log_format import COLUMNS, LogColumn, LogFormat, column_factor, log_format
from swimbladder.io.log_table import Table, read_header, read_table

__all__ = ["Log", "header_names", "read_log"]

Array = NDArray[np.float64]
REQUIRED = ("time_s", "depth_m")


@dataclass(frozen=True, kw_only=True)
class Log:
    """What was measured, in SI units, as arrays of one length.

    source: file and selection. report: what was converted, dropped or ignored. volume counts
    from mid-stroke where volume_absolute, otherwise its zero is arbitrary; piston likewise, and it
    counts outward: positive displaces more. What the actuator was asked for, reference_volume and
    reference_piston, counts from the same zero. depth is NaN where it was not measured: in places
    or throughout, and only where the caller did not require it. line: where each sample stands in
    the file.
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
    reference_volume: Array | None = None  # m3
    reference_piston: Array | None = None  # m
    volume_absolute: bool = False
    piston_absolute: bool = False
    line: NDArray[np.int64]
    report: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    def only(self, kept: NDArray[np.bool_]) -> Log:
        """Return the log with the samples that are `kept` (an array of its length)."""
        arrays = {
            name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        chosen: dict[str, Any] = {name: values[kept] for name, values in arrays.items()}
        return replace(self, **chosen)


def read_log(
    path: str | Path,
    *,
    columns: Mapping[str, str | LogColumn] | None = None,
    where: Mapping[str, str | float] | None = None,
    log_format: LogFormat | str | Path | None = None,
    required: Collection[str] = REQUIRED,
) -> Log:
    """Return the log in a CSV file, which may be compressed by gzip.

    columns: {"depth_m": "Depth [cm]"}, over those of the log format; a unit in brackets counts,
    and "Depth@cm" states it where the header does not. where: {"log": 47} keeps the rows that hold
    it. log_format: a `LogFormat`, a shipped one's name or a TOML file with a ``[log]`` table.
    required: the columns without which a log is refused, beside ``time_s``; rows without them, and
    repeated ones, are dropped and reported.
    Raises LogError, an InputError, with file, line, column, value and remedy.
    """
    form = _format(log_format)
    wanted = {**form.where, **(where or {})}
    mapped: dict[str, LogColumn | str] = {**form.columns.mapped(), **(columns or {})}
    for name in (*mapped, *required):
        if name not in COLUMNS:
            raise LogError(
                "no such column of a log",
                file=path,
                field=name,
                remedy=f"Columns: {', '.join(COLUMNS)}",
            )
    needed = tuple(name for name in COLUMNS if name == "time_s" or name in required)
    table = read_table(path, form, wanted, lambda header: _sources(mapped, header, path, needed))
    return _log(table, form, wanted, path, needed)


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
    mapped: Mapping[str, LogColumn | str],
    header: list[str],
    path: str | Path,
    needed: Sequence[str],
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
    for name in needed:
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


def _log(
    table: Table,
    form: LogFormat,
    where: Mapping[str, object],
    path: str | Path,
    needed: Sequence[str],
) -> Log:
    """Return the log of a table: scaled, dropped, ordered."""
    report = list(table.report)
    data: dict[str, Array] = {}
    for name, column in table.sources.items():
        data[name] = _scaled(name, column, table.values[name], path, report)
    line = table.line
    keep = np.logical_and.reduce([np.isfinite(data[name]) for name in needed])
    if not keep.all():
        gone = int((~keep).sum())
        words = [name.split("_")[0] if name.count("_") == 1 else name for name in needed]
        report.append(f"{gone} of {len(keep)} rows without {' or '.join(words)} dropped")
        if gone > len(keep) / 2:
            holes = {name: int((~np.isfinite(data[name])).sum()) for name in needed}
            raise LogError(
                f"{gone} of {len(keep)} rows have no {' or no '.join(words)}",
                file=path,
                line=int(line[~keep][0]),
                field=max(holes, key=lambda name: holes[name]),
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
    for name in {"piston_m", "reference_piston_m"} & data.keys():
        sign = -1.0 if form.piston_positive == "in" else 1.0
        data[name] = sign * (data[name] - (form.piston_zero or 0.0))
    if form.piston_positive == "in" and "piston_m" in data:
        report.append("piston_m counts inward in the file; turned to count outward")
    for name in {"volume_m3", "reference_volume_m3"} & data.keys():
        data[name] = data[name] - (form.volume_zero or 0.0)
    chosen = ", ".join(f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
                       for name, value in where.items())  # fmt: skip
    return Log(
        source=f"{path} ({chosen})" if chosen else str(path),
        time=data["time_s"],
        depth=data.get("depth_m", np.full(len(line), np.nan)),
        volume=data.get("volume_m3"),
        piston=data.get("piston_m"),
        voltage=data.get("voltage_V"),
        current=data.get("current_A"),
        speed=data.get("speed_m_s"),
        reference_depth=data.get("reference_depth_m"),
        reference_volume=data.get("reference_volume_m3"),
        reference_piston=data.get("reference_piston_m"),
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
