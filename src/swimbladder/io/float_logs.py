"""Logs of floats that pump and bleed: as they are handed out, or a table of pressures and seconds.

A table has the columns ``time_s`` and ``pressure_Pa`` and any of ``temperature_degC, pump_s,
valve_s, bypass_s``: for how long the device then runs, in the row in which it begins, 0 or nothing
elsewhere. A row may have a run and no pressure. Other names and units are mapped as for other logs.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.errors import column_as
from swimbladder.io.columns import check_columns, named_columns, no_column
from swimbladder.io.files import pipes_kept
from swimbladder.io.float_log import DEVICES, FloatLog, table_log
from swimbladder.io.log_format import LogColumn, format_of
from swimbladder.io.log_formats.argo import is_argo, read_argo, read_trajectory
from swimbladder.io.log_formats.mermaid import is_mermaid, read_mermaid
from swimbladder.io.log_table import read_table
from swimbladder.io.log_text import LogFile, counted, is_frame, is_netcdf, read_bytes
from swimbladder.physics.arrays import Array, Flags

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

FLOAT_COLUMNS = {"time_s": "s", "pressure_Pa": "Pa", "temperature_degC": "degC"}
FLOAT_COLUMNS |= {f"{device}_s": "s" for device in DEVICES}
_NEEDED = ("time_s", "pressure_Pa")
_SHALLOW = 2.5e4  # Pa, of the greatest pressure: no float that pumps goes no deeper
_UNDER, _UP = 1e5, 5e3  # Pa: surely under water, surely at the surface
_NONE = -2  # the stage at the surface
_ABSOLUTE = (9.5e4, 1.06e5)  # Pa: a log whose least pressure is here counts from the vacuum


@pipes_kept()
def read_float_log(
    path: str | Path | pd.DataFrame | xr.Dataset,
    *,
    log_format: str | None = None,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, str] | None = None,
) -> FloatLog:
    """Return a float's log; whether it is a maker's text, or Argo's, is seen by what it holds.

    Parameters
    ----------
    path
        Of the file; or a table as a DataFrame or a Dataset, as for other logs.
    log_format
        ``mermaid``, ``argo``, or a TOML file with a ``[log]`` table for a table; none: as the file
        is.
    columns
        Of a table, as for other logs; none: as the file names them.
    where
        Of a table, as for other logs; of Argo's netCDF ``cycle``; none: all rows.

    Returns
    -------
    FloatLog
        Pressure and temperature over time, and what the float's devices did.

    Raises
    ------
    LogError
        An InputError: the file is no float's log; with file, column and remedy.
    """
    source: Any = path
    mapped = is_frame(source) or columns or log_format not in (None, "argo")
    data = b"" if mapped else read_bytes(source)
    if is_netcdf(data):
        return read_trajectory(source, data, where or {})
    if log_format == "argo" or is_argo(data.partition(b"\n")[0]):
        return read_argo(source, where or {})
    if log_format == "mermaid" or is_mermaid(data):
        log = read_mermaid(source)
        # while it comes up it may log no pressure, but it pumps
        pumps = [action.time for action in log.actions if action.stage is None]
        time = np.append(log.time, pumps)
        stage = np.append(log.stage, np.full(len(pumps), _NONE))
        order = np.argsort(time, kind="stable")
        _refuse_dives(time[order], stage[order] >= 0, stage[order] == _NONE, LogFile(source))
        return log
    columns = dict(columns or {})
    file = LogFile.of(path, format_of(log_format))
    check_columns(file, columns, FLOAT_COLUMNS, "a float's log")
    rows = {**file.form.where, **(where or {})}
    table = read_table(
        file, rows, lambda sheet: _sources(file, columns, sheet.header), [], FLOAT_COLUMNS
    )
    return _float_log(table.values, file)


def _sources(file: LogFile, mapped: Mapping[str, str], header: list[str]) -> dict[str, LogColumn]:
    """Return which column of the file each column of the log is read from."""
    found = named_columns(file, mapped, header, FLOAT_COLUMNS)
    for name in _NEEDED:
        if name not in found:
            raise no_column(file, f"the float's log has no column {name}", name, header)
    if not {f"{device}_s" for device in DEVICES} & set(found):
        what = "the float's log does not say when pump or valve ran"
        raise no_column(file, what, "pump_s", header)
    return found


def _float_log(values: Mapping[str, Array], file: LogFile) -> FloatLog:
    timed = np.isfinite(values["time_s"])
    if not timed.all():
        file.report.append(f"{counted(int((~timed).sum()), 'row')} without time dropped")
    values = {name: column[timed] for name, column in values.items()}
    time, pressure = values["time_s"], values["pressure_Pa"]
    if np.any(np.diff(time) < 0.0):
        remedy = "Give one dive, in order, or choose it with `where={'COLUMN': 'VALUE'}`"
        raise file.refused("the times do not increase", remedy, "time_s")
    known = np.isfinite(pressure)
    if known.sum() < 2:
        what = "fewer than two pressures"
        raise file.refused(what, "Check the column's name and unit", "pressure_Pa")
    least, deepest = float(pressure[known].min()), float(pressure[known].max())
    if _ABSOLUTE[0] < least < _ABSOLUTE[1]:
        what = "the pressure never is that of the surface: it looks absolute"
        remedy = "Give pressures above the atmosphere, 0 at the surface"
        raise file.refused(what, remedy, "pressure_Pa", value=least, unit="Pa")
    if deepest < _SHALLOW:
        size = f"{deepest:.4g} Pa, that of {deepest / 1e4:.2g} m of water"
        what = f"the greatest pressure is {size}: it is likely in kPa, dbar or bar"
        remedy = f"State its unit: {column_as('pressure_Pa', 'NAME@dbar')}"
        raise file.refused(what, remedy, "pressure_Pa")
    _check_seconds(values, float(time[-1] - time[0]), file)
    _refuse_dives(time[known], pressure[known] > _UNDER, pressure[known] < _UP, file)
    runs = [
        (float(begin), device, float(lasts))
        for device in DEVICES
        for begin, lasts in zip(time, values.get(f"{device}_s", ()), strict=False)
        if lasts > 0.0
    ]
    temperature = values.get("temperature_degC", np.full(len(time), np.nan))[known]
    more = {"source": str(file.path), "report": tuple(file.report)}
    return table_log(time[known], pressure[known], runs, temperature=temperature, **more)


def _refuse_dives(time: Array, under: Flags, up: Flags, file: LogFile) -> None:
    """Raise LogError where the float is under water, at the surface, and under water again.

    What it pumps at the surface is not known: a full bladder ends it.
    """
    state = np.where(under, 1, np.where(up, -1, 0))
    kept = np.flatnonzero(state)
    turns = np.flatnonzero(np.diff(state[kept]) > 0)  # from the surface down
    again = [kept[k + 1] for k in turns if under[: kept[k]].any()]
    if again:
        after = f"after {time[again[0]] - time[0]:.6g} s the float dives again"
        what = f"the log holds {len(again) + 1} dives: {after}"
        remedy = (
            "Give a file for each dive, or choose the rows of one with `where={'COLUMN': 'VALUE'}`"
        )
        raise file.refused(what, remedy, "log")


def _check_seconds(values: Mapping[str, Array], lasts: float, file: LogFile) -> None:
    """Raise LogError where a device ran for longer than the whole log lasts [s], or less than 0."""
    for name in (f"{device}_s" for device in DEVICES if f"{device}_s" in values):
        ran, least = float(np.nansum(values[name])), float(np.nanmin(values[name], initial=0.0))
        if least < 0.0:
            remedy = "Leave the cell empty where the device does not run"
            raise file.refused("a run lasts no less than 0 s", remedy, name, value=least, unit="s")
        if ran > lasts:
            remedy = f"They are likely milliseconds: {column_as(name, 'NAME@ms')}"
            raise file.refused(f"{ran:.4g} s of runs in a log of {lasts:.4g} s", remedy, name)
