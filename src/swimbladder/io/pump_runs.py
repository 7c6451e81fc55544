"""Runs of a pump from a table: one row a run, columns named and mapped as those of a log.

Or in a Seaglider's dives: netCDF, a file a dive, as its base station writes them. Each motor event
has its seconds (negative: the valve's), volts, amps and depth, and what two potentiometers of the
piston read before and after. Their mean times VBD_CNV [cm3] is the volume.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import column_as
from swimbladder.io.columns import check_columns, named_columns, no_column, wanted_names
from swimbladder.io.log_format import LogColumn, LogFormat, format_of
from swimbladder.io.log_rows import Sheet
from swimbladder.io.log_table import read_table
from swimbladder.io.log_text import LogFile, read_bytes
from swimbladder.io.netcdf import NetCDF
from swimbladder.physics.arrays import Array

_DRAWN = ("power_W", "voltage_V", "current_A")
_MEASURED = ("duration_s", "pressure_Pa", *_DRAWN, "volume_m3", "temperature_degC")
RUN_COLUMNS = {name: name.rpartition("_")[2] for name in _MEASURED} | {"dive": "", "time_s": "s"}
"""The columns of a table of runs and their units; power, or voltage and current, or power and
voltage."""
_MOST = 1e5  # W: no battery that floats gives as much
_MEND = "Mend the row, or leave the cell empty: a run that is not known is left out"
_LONGEST = 86400.0  # s: a run of more than a day is a duration in the wrong unit


@dataclass(frozen=True, kw_only=True)
class PumpRuns:
    """Runs of a pump, one a row [n]; NaN in what was not logged."""

    duration: Array  # s
    pressure: Array  # Pa above the atmosphere
    power: Array  # W, mean over the run or read at its end
    volume: Array | None = None  # m3 pressed out
    temperature: Array | None = None  # degC
    dive: Array | None = None  # number of the dive
    voltage: Array | None = None  # V at the battery while the pump runs
    time: Array | None = None  # s, when it begins
    report: tuple[str, ...] = ()


def read_pump_runs(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, str | float] | None = None,
    form: LogFormat | str | Path | None = None,
) -> PumpRuns:
    """Return the runs in a CSV or Parquet file, or in the netCDF file of a Seaglider's dive.

    columns: {"pressure_Pa": "P@dbar"}, names of RUN_COLUMNS. where: {"device": "pump"} keeps the
    rows that hold it. form: how the text is to be read, as for logs.
    Raises LogError, an InputError, with file, line, column, value and remedy.
    """
    mapped, file = dict(columns or {}), LogFile.of(path, format_of(form))
    if Path(file.path).suffix.lower() == ".nc":
        return _of_a_dive(path, file, {**mapped, **(where or {})})
    check_columns(file, mapped, RUN_COLUMNS, "a table of runs")
    wanted = wanted_names(mapped, [("duration_s",), ("pressure_Pa",)])
    rows, choose = {**file.form.where, **(where or {})}, partial(_sources, file, mapped)
    found = read_table(file, rows, choose, wanted, RUN_COLUMNS, labels=("dive",))
    values = found.values
    power = values.get("power_W")
    if power is None:
        power = values["voltage_V"] * values["current_A"]
    _check(values, found.line, file)
    _check_power(power, "power_W" if "power_W" in values else "current_A", file)
    fields = {name.rpartition("_")[0] or name: column for name, column in values.items()}
    fields.pop("current", None)
    return PumpRuns(**{**fields, "power": power}, report=tuple(file.report))


def _of_a_dive(path: str | Path, file: LogFile, chosen: Mapping[str, object]) -> PumpRuns:
    for name in chosen:
        what = "a Seaglider's dive has its own names, and all runs of its pump count"
        raise file.refused(what, "Leave it out", name)
    runs = read_dive(path, file)
    if len(runs.power):
        given = (runs.duration, runs.pressure, runs.volume, runs.voltage)
        named = zip(("duration_s", "pressure_Pa", "volume_m3", "voltage_V"), given, strict=True)
        values = {name: column for name, column in named if column is not None}
        _check(values, np.arange(1, len(runs.power) + 1), file)
        _check_power(runs.power, "current_A", file)
    return replace(runs, report=tuple(file.report))


def joined_runs(tables: Sequence[PumpRuns]) -> PumpRuns:
    """Return the runs of several tables as one; a table without dives is a dive of its own."""
    if len(tables) == 1:
        return tables[0]
    numbers = [float(np.nanmax(t.dive, initial=0.0)) for t in tables if t.dive is not None]
    more = max(numbers, default=0.0) + np.arange(1.0, len(tables) + 1.0)

    def column(name: str, otherwise: Sequence[float]) -> Array | None:
        """Return a column of all tables, `otherwise` for rows of tables without it."""
        found = [getattr(table, name) for table in tables]
        if name != "dive" and all(values is None for values in found):
            return None
        sizes = [len(table.duration) for table in tables]
        own = zip(found, sizes, otherwise, strict=True)
        return np.concatenate([np.full(n, x) if v is None else v for v, n, x in own])

    names = [each.name for each in fields(PumpRuns) if each.name not in ("dive", "report")]
    columns: dict[str, Any] = {name: column(name, [np.nan] * len(tables)) for name in names}
    report = dict.fromkeys(line for table in tables for line in table.report)
    return PumpRuns(**columns, dive=column("dive", more.tolist()), report=tuple(report))


def _sources(file: LogFile, mapped: Mapping[str, str], sheet: Sheet) -> dict[str, LogColumn]:
    """Return which column of the file each column of the table is read from."""
    header = sheet.header
    sources = named_columns(file, mapped, header, RUN_COLUMNS)
    if "power_W" in sources:
        sources.pop("current_A", None)
    needed = ["duration_s", "pressure_Pa"]
    needed += [] if "power_W" in sources else ["voltage_V", "current_A"]
    for name in needed:
        if name not in sources:
            or_both = ", or power_W" if name in ("voltage_V", "current_A") else ""
            raise no_column(file, f"the table has no column {name}{or_both}", name, header)
    return sources


def _check(values: Mapping[str, Array], line: NDArray[np.int64], file: LogFile) -> None:
    """Raise LogError for numbers that no run of a pump has."""
    for name, low, high, likely in (
        ("duration_s", 0.0, _LONGEST, "ms"),
        ("pressure_Pa", -2e5, 1.2e8, "dbar"),
        ("temperature_degC", -5.0, 60.0, "degC"),
        ("volume_m3", -0.1, 0.1, "mL"),
        ("voltage_V", -1e3, 1e3, "mV"),  # of a battery
    ):
        v = values.get(name, np.zeros(0))
        for row in np.flatnonzero((v < low) | (v > high))[:1]:
            what = "no run of a pump has this"
            remedy = f"State its unit: {column_as(name, f'NAME@{likely}')}"
            if name == "duration_s" and v[row] < 0.0:
                what = "a run lasts no less than 0 s"
                remedy = _MEND
            value, unit = float(v[row]), RUN_COLUMNS[name]
            raise file.refused(what, remedy, name, line=line[row], value=value, unit=unit)
    pressure = values["pressure_Pa"]
    known = pressure[np.isfinite(pressure)]
    if known.size and float(np.max(known)) < 2.5e4:
        most = f"{float(np.max(known)):.4g} Pa, that of 2.5 m of water at most"
        what = f"the greatest pressure is {most}: it is likely in dbar or bar"
        raise file.refused(
            what, 'State its unit: `columns={"pressure_Pa": "NAME@dbar"}`', "pressure_Pa"
        )


def _check_power(power: Array, field: str, file: LogFile) -> None:
    """Raise LogError where the powers of most runs are those of no pump [W]."""
    known = power[np.isfinite(power)]
    middle = float(np.median(known)) if known.size else 1.0
    if 0.0 < middle < _MOST:
        return
    small = "mW" if field == "power_W" else "mA"
    what = f"half of the runs take more than {middle:.4g} W"
    remedy = f"State its unit: {column_as(field, f'NAME@{small}')}"
    if middle <= 0.0:
        what = f"half of the runs take less than {middle:.4g} W"
        remedy = "Give what is drawn as positive numbers"
    raise file.refused(what, remedy, field)


_NEEDED = ("gc_vbd_secs", "gc_vbd_volts", "gc_vbd_i", "gc_depth")
_POTENTIOMETERS = ("gc_vbd_pot1_ad", "gc_vbd_pot2_ad")
_MOTOR = 0.05  # A, less is no motor: a valve was opened
_LATITUDE = 30.0  # degrees, where the file has none: 0.3 % of a pressure at most


def moved(events: Mapping[str, Array], volume_per_count: float | Array) -> Array:
    """Return what each event has pressed out [m3] [n], below 0 let in; NaN where nothing says it.

    events: by the base station's names; volume_per_count: VBD_CNV [cm3].
    """
    known = [name for name in _POTENTIOMETERS if {name, f"{name}_start"} <= {*events}]
    if not known:
        return np.full(len(events["gc_vbd_secs"]), np.nan)
    moves = [events[name] - events[f"{name}_start"] for name in known]
    return np.asarray(1e-6 * volume_per_count * np.mean(moves, axis=0))


def pressures(events: Mapping[str, Array], latitude: float | Array) -> Array:
    """Return the pressure at each event [Pa] [n]; latitude [degrees]."""
    import gsw

    return 1e4 * np.asarray(gsw.p_from_z(-np.asarray(events["gc_depth"]), latitude))


def runs_of_events(
    events: Mapping[str, Array], volume_per_count: float, latitude: float, dive: float
) -> PumpRuns:
    """Return the pump's runs among the motor events of a dive [n], in their order.

    events: by the base station's names. volume_per_count: VBD_CNV [cm3], NaN where it is not known;
    latitude [degrees]; dive: its number, NaN where it has none.
    """
    seconds, amps = events["gc_vbd_secs"], events["gc_vbd_i"]
    volume = moved(events, volume_per_count)
    runs = (seconds > 0.0) & (amps > _MOTOR) & ~(volume <= 0.0)
    volts, volume = events["gc_vbd_volts"][runs], volume[runs]
    return PumpRuns(
        duration=seconds[runs],
        pressure=pressures(events, latitude)[runs],
        power=volts * amps[runs],
        volume=volume if np.isfinite(volume).any() else None,
        dive=None if np.isnan(dive) else np.full(len(volts), dive),
        voltage=volts,
        time=events.get("gc_st_secs", np.full(len(seconds), np.nan))[runs],
    )


def read_dive(path: str | Path, file: LogFile) -> PumpRuns:
    """Return the pump's runs of a dive.

    Raises LogError where the file is damaged or is no Seaglider's dive.
    """
    numbers = NetCDF(read_bytes(path), file).numbers
    missing = [name for name in _NEEDED if name not in numbers]
    if missing:
        what = f"this netCDF file has no motor events of a Seaglider: {', '.join(missing)}"
        remedy = "Give the file of a dive from its base station, or a CSV with a row a run"
        raise file.refused(what, remedy, missing[0])
    values = {name: np.ravel(v) for name, v in numbers.items()}

    def number(name: str, otherwise: float = np.nan) -> float:
        found = values.get(name, np.empty(0))
        known = found.size == 1 and np.isfinite(found[0])
        return float(found[0]) if known else otherwise

    per_count = number("log_VBD_CNV")
    if np.isnan(per_count):
        file.report.append("volumes are not known: the file has no log_VBD_CNV")
    latitude = number("avg_latitude", _LATITUDE)
    return runs_of_events(values, per_count, latitude, number("log_DIVE"))
