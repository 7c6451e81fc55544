"""Logs of floats that pump and bleed: the makers' texts, or a table of pressures and seconds.

A table has the columns ``time_s`` and ``pressure_Pa`` and any of ``temperature_degC, pump_s,
valve_s, bypass_s``: for how long the device then runs, in the row in which it begins, 0 or nothing
elsewhere. A row may have a run and no pressure. Other names and units are mapped as for other logs.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.files import pipes_kept
from swimbladder.io.float_log import DEVICES, Action, FloatLog
from swimbladder.io.log_format import LogColumn, LogFormat, log_format
from swimbladder.io.log_formats.mermaid import is_mermaid, read_mermaid
from swimbladder.io.log_sources import column_readings, listed
from swimbladder.io.log_table import read_table
from swimbladder.io.log_text import read_bytes
from swimbladder.vehicle.schema import did_you_mean

FLOAT_COLUMNS = {
    "time_s": "s",
    "pressure_Pa": "Pa",
    "temperature_degC": "degC",
    "pump_s": "s",
    "valve_s": "s",
    "bypass_s": "s",
}
_NEEDED = ("time_s", "pressure_Pa")
_SHALLOW = 2.5e4  # Pa, of the greatest pressure: no float that pumps goes no deeper
_UNDER, _UP = 1e5, 5e3  # Pa: surely under water, surely at the surface
_NONE = -2  # the stage at the surface
_ABSOLUTE = (9.5e4, 1.06e5)  # Pa: a log whose least pressure is here counts from the vacuum


@pipes_kept()
def read_float_log(
    path: str | Path,
    *,
    log_format_name: str | None = None,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, str] | None = None,
) -> FloatLog:
    """Return a float's log; that it is a maker's text is seen by its lines.

    log_format_name: ``mermaid``, or a TOML file with a ``[log]`` table for a table. columns and
    where: of a table, as for other logs. Raises LogError, an InputError, with file, column and
    remedy.
    """
    texts = log_format_name is None and not columns and is_mermaid(_beginning(path))
    if log_format_name == "mermaid" or texts:
        log = read_mermaid(path)
        # while it comes up it may log no pressure, but it pumps
        pumps = [action.time for action in log.actions if action.stage is None]
        time = np.append(log.time, pumps)
        stage = np.append(log.stage, np.full(len(pumps), _NONE))
        order = np.argsort(time, kind="stable")
        _refuse_dives(time[order], stage[order] >= 0, stage[order] == _NONE, path)
        return log
    form = LogFormat() if log_format_name is None else log_format(log_format_name)
    mapped = dict(columns or {})
    for name in mapped:
        if name not in FLOAT_COLUMNS:
            raise LogError(
                "no such column of a float's log", file=path, field=name,
                remedy=f"{did_you_mean(name, FLOAT_COLUMNS)}Columns: {', '.join(FLOAT_COLUMNS)}",
            )  # fmt: skip
    table = read_table(
        path, form, {**form.where, **(where or {})},
        lambda header: _sources(mapped, header, path), [], FLOAT_COLUMNS,
    )  # fmt: skip
    return _float_log(table.values, path, list(table.report))


def _beginning(path: str | Path) -> str:
    return read_bytes(path)[:4000].decode("latin-1")


def _sources(
    mapped: Mapping[str, str], header: list[str], path: str | Path
) -> dict[str, LogColumn]:
    """Return which column of the file each column of the log is read from."""
    found: dict[str, LogColumn] = {}
    for name in FLOAT_COLUMNS:
        if name in mapped:
            readings = column_readings(mapped[name])
            fitting = [column for reading, column in readings.items() if reading in header]
            if not fitting:
                raise LogError(
                    "no such column", file=path, field=name, value=mapped[name],
                    remedy=f"Columns of the file: {listed(header)}",
                )  # fmt: skip
            found[name] = fitting[0]
        elif name in header:
            found[name] = LogColumn(name=name)
    for name in _NEEDED:
        if name not in found:
            raise LogError(
                f"the float's log has no column {name}", file=path, field=name,
                remedy=f"Say which one it is with --column {name}=NAME; columns of the file: "
                f"{listed(header)}",
            )  # fmt: skip
    if not {f"{device}_s" for device in DEVICES} & set(found):
        raise LogError(
            "the float's log does not say when pump or valve ran", file=path, field="pump_s",
            remedy="Say which columns hold their seconds with --column pump_s=NAME; columns of "
            f"the file: {listed(header)}",
        )  # fmt: skip
    return found


def _float_log(
    values: Mapping[str, NDArray[np.float64]], path: str | Path, report: list[str]
) -> FloatLog:
    time, pressure = values["time_s"], values["pressure_Pa"]
    if np.any(np.diff(time) < 0.0):
        raise LogError(
            "the times do not increase", file=path, field="time_s",
            remedy="Give one dive, in order, or choose it with --where COLUMN=VALUE",
        )  # fmt: skip
    known = np.isfinite(pressure)
    if known.sum() < 2:
        raise LogError(
            "fewer than two pressures", file=path, field="pressure_Pa",
            remedy="Check the column's name and unit",
        )  # fmt: skip
    if _ABSOLUTE[0] < float(pressure[known].min()) < _ABSOLUTE[1]:
        raise LogError(
            "the pressure never is that of the surface: it looks absolute", file=path,
            field="pressure_Pa", value=float(pressure[known].min()), unit="Pa",
            remedy="Give pressures above the atmosphere, 0 at the surface",
        )  # fmt: skip
    deepest = float(pressure[known].max())
    if deepest < _SHALLOW:
        raise LogError(
            f"the greatest pressure is {deepest:.4g} Pa, that of {deepest / 1e4:.2g} m of water: "
            "it is likely in kPa, dbar or bar", file=path, field="pressure_Pa",
            remedy='State its unit: --column "pressure_Pa=NAME@dbar"',
        )  # fmt: skip
    _check_seconds(values, float(time[-1] - time[0]), path)
    _refuse_dives(time[known], pressure[known] > _UNDER, pressure[known] < _UP, path)
    actions = [
        Action(device=device, time=float(t), asked=float(s), seconds=float(s))
        for device in DEVICES
        if f"{device}_s" in values
        for t, s in zip(time, values[f"{device}_s"], strict=True)
        if np.isfinite(s) and s > 0.0
    ]
    temperature = values.get("temperature_degC", np.full(len(time), np.nan))
    return FloatLog(
        source=str(path), time=time[known] - time[0], pressure=pressure[known],
        temperature=temperature[known], stage=np.full(int(known.sum()), -2, dtype=np.int64),
        actions=tuple(
            Action(device=a.device, time=a.time - float(time[0]), asked=a.asked, seconds=a.seconds)
            for a in sorted(actions, key=lambda a: a.time)
        ),
        report=tuple(report),
    )  # fmt: skip


def _refuse_dives(
    time: NDArray[np.float64], under: NDArray[np.bool_], up: NDArray[np.bool_], path: str | Path
) -> None:
    """Raise LogError where the float is under water, at the surface, and under water again.

    What it pumps at the surface is not known: a full bladder ends it.
    """
    state = np.where(under, 1, np.where(up, -1, 0))
    kept = np.flatnonzero(state)
    turns = np.flatnonzero(np.diff(state[kept]) > 0)  # from the surface down
    again = [kept[k + 1] for k in turns if under[: kept[k]].any()]
    if again:
        raise LogError(
            f"the log holds {len(again) + 1} dives: after {time[again[0]] - time[0]:.6g} s the "
            "float dives again", file=path, field="log",
            remedy="Give a file for each dive, or choose the rows of one with --where COLUMN=VALUE",
        )  # fmt: skip


def _check_seconds(
    values: Mapping[str, NDArray[np.float64]], lasts: float, path: str | Path
) -> None:
    """Raise LogError where a device ran for longer than the whole log lasts [s]."""
    for name in (f"{device}_s" for device in DEVICES):
        ran = float(np.nansum(values.get(name, np.zeros(1))))
        if ran > lasts:
            raise LogError(
                f"{ran:.4g} s of runs in a log of {lasts:.4g} s", file=path, field=name,
                remedy=f'They are likely milliseconds: --column "{name}=NAME@ms"',
            )  # fmt: skip
