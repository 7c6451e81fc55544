"""The tables of an Argo float's packets: `NAME_actions.csv`, and `NAME_ctd.csv` beside it.

Floats of the Arvor and Provor kind (NKE) send each action of pump and valve, with the pressure at
it, and their own CTD. Decoded they are tables: a row an action, with the columns ``cycle,
time_s_since_day0, action, pressure_dbar, duration_s``; a row a reading of the CTD, ``cycle, phase,
packet_time_s_since_day0, index_in_packet, pressure_dbar``. Both may have a deployment's first day,
``mission_day0``. They are plain text or gzip.

Actions are stamped in whole minutes and their pressures in whole dbar; of the readings only the
first of a packet has a time.

An Argo float's trajectory: netCDF, `WMO_Rtraj.nc`, and the technical file of its runs beside it.

A row of the trajectory is a measurement at a time, JULD: PRES, CYCLE_NUMBER, and MEASUREMENT_CODE,
which says what it is (Argo reference table 15). Codes count from those of a cycle's times, 100
where the descent begins to 600 where the ascent ends: 10 before one of them is a series of
readings, 11 before it an action of pump or valve. The row of an action has its pressure. Which of
the two it was, and for how long, stands in the technical time series (Argo user's manual 3.41,
section 2.5): `WMO_tech_aux.nc`, or `WMO_tech.nc`, with JULD, CYCLE_NUMBER_MEAS, and
PUMP_ACTION_DURATION or VALVE_ACTION_DURATION. Codes and names are those that Coriolis writes for
floats of the Arvor and Provor kind.

Times are the float's own, which are as they were sent or computed from what was; adjusted
pressures are taken where a row has one.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swimbladder.errors import InputError, Parameter
from swimbladder.io.columns import mapped_column, plain_unit
from swimbladder.io.float_log import Device, FloatLog, table_log
from swimbladder.io.log_format import LogColumn
from swimbladder.io.log_rows import Sheet
from swimbladder.io.log_table import Table, read_table
from swimbladder.io.log_text import LogFile, counted, read_bytes
from swimbladder.io.netcdf import NetCDF
from swimbladder.physics.arrays import Array
from swimbladder.units import unit_factor

_ACTIONS = {
    "time_s": LogColumn(name="time_s_since_day0", unit="s"),
    "pressure_Pa": LogColumn(name="pressure_dbar", unit="dbar"),
    "run_s": LogColumn(name="duration_s", unit="s"),
    "device": LogColumn(name="action"),
    "cycle": LogColumn(name="cycle"),
    "deployment": LogColumn(name="mission_day0"),
}
_READINGS = {
    "time_s": LogColumn(name="packet_time_s_since_day0", unit="s"),
    "pressure_Pa": LogColumn(name="pressure_dbar", unit="dbar"),
    "index": LogColumn(name="index_in_packet"),
    "phase": LogColumn(name="phase"),
}
_UNITS = {"time_s": "s", "pressure_Pa": "Pa", "run_s": "s", "index": "", "cycle": ""}
_UNITS |= {"device": "", "phase": "", "deployment": ""}
_LABELS = ("device", "phase", "deployment", "cycle")
_DEVICES: dict[str, Device] = {"pump": "pump", "valve": "valve"}
_DIVES = ("descent", "drift", "ascent")  # phases in which the float is under water by itself
_MINUTE, _DBAR = 60.0, 1e4


def is_argo(header: bytes) -> bool:
    """Return whether a file's first line names the columns of an Argo float's actions."""
    names = header.decode("latin-1").strip().split(",")
    return {c.name for n, c in _ACTIONS.items() if n != "deployment"} <= set(names)


def read_argo(path: str | Path, where: Mapping[str, str | float]) -> FloatLog:
    """Return the log of one cycle; raises LogError where `where` chooses none, or several."""
    file = LogFile(Path(path))
    table = _read(file, where, _ACTIONS)
    words = dict(enumerate(table.labels["device"], start=1))
    devices = [words.get(k, f"{k:g}") for k in table.values["device"].tolist()]
    for k, device in enumerate(devices):
        if device not in _DEVICES:
            remedy, line = f"Actions are {', '.join(_DEVICES)}", int(table.line[k])
            raise file.refused("no such action", remedy, "action", line=line, value=device)
    least = {"time_s": 0.0, "pressure_Pa": -1e5, "run_s": 0.0, "cycle": 0.0}
    for name, values in ((name, table.values[name]) for name in least):
        for k in np.flatnonzero(~(values >= least[name]))[:1]:
            what, remedy = "no action has this", "Correct the row, or leave it out"
            line, value, field = table.line[k], float(values[k]), _ACTIONS[name].name
            raise file.refused(what, remedy, field, line=line, value=value, unit=_UNITS[name])
    chosen = {n: table.labels[n] for n in ("deployment", "cycle") if table.labels.get(n)}
    for name, found in chosen.items():
        refuse_several(file, name, found, _ACTIONS[name].name)
    time, pressure, run = (table.values[name] for name in ("time_s", "pressure_Pa", "run_s"))
    rows = [time, pressure, np.full(len(time), _MINUTE), np.full(len(time), _DBAR)]
    readings, said = _readings(Path(path), {_ACTIONS[n].name: f[0] for n, f in chosen.items()})
    rows = [np.append(a, b) for a, b in zip(rows, readings, strict=True)]
    at = np.argsort(rows[0], kind="stable")
    time_of, pressures, steps, widths = (column[at] for column in rows)
    runs = zip(time.tolist(), (_DEVICES[device] for device in devices), run.tolist(), strict=True)
    cycle = chosen["cycle"][0]
    return table_log(
        time_of,
        pressures,
        runs,
        source=f"{file.path}, cycle {cycle}",
        name=f"cycle {cycle}",
        time_step=steps,
        pressure_step=widths,
        report=(*(text for text in file.report if text.endswith("chosen")), said),
    )


def refuse_several(file: LogFile, what: str, found: Sequence[str], column: str) -> None:
    """Raise LogError where a file holds several dives to choose from by a column."""
    if len(found) > 1:
        held = f"the file holds {counted(len(found), what)}: {', '.join(found[:8])}"
        more = f" and {len(found) - 8} more" if len(found) > 8 else ""
        remedy = (
            f"Choose one dive: `where={{'{column}': '{found[0]}'}}`; several: {column}={found[0]},"
        )
        raise file.refused(f"{held}{more}", f"{remedy}{found[1]}", column)


def _read(
    file: LogFile, where: Mapping[str, str | float], columns: Mapping[str, LogColumn]
) -> Table:
    def choose(sheet: Sheet) -> dict[str, LogColumn]:
        there = sheet.header
        needed = {n: c for n, c in columns.items() if n != "deployment" or c.name in there}
        return {name: mapped_column(file, name, c, there) for name, c in needed.items()}

    return read_table(file, where, choose, [], _UNITS, labels=_LABELS)


def _readings(path: Path, where: Mapping[str, str]) -> tuple[list[Array], str]:
    """Return times, pressures and their steps of the CTD beside a table, and what was read."""
    beside = path.with_name(path.name.replace("_actions", "_ctd"))
    none = [np.zeros(0)] * 4
    if beside == path or not beside.exists():
        return none, f"no table of CTD readings beside it ({beside.name}): only those of actions"
    table = _read(LogFile(beside), where, _READINGS)
    dives = [k for k, phase in enumerate(table.labels["phase"], start=1) if phase in _DIVES]
    used = np.isin(table.values["phase"], dives) & (table.values["index"] == 0.0)
    used &= np.isfinite(table.values["time_s"]) & np.isfinite(table.values["pressure_Pa"])
    time, pressure = table.values["time_s"][used], table.values["pressure_Pa"][used]
    steps = [np.full(len(time), 1.0), np.full(len(time), 0.1 * _DBAR)]
    return [time, pressure, *steps], f"{counted(len(time), 'pressure')} read from {beside.name} too"


_RUNS: dict[str, Device] = {"PUMP_ACTION_DURATION": "pump", "VALVE_ACTION_DURATION": "valve"}
_BESIDE = ("{}_tech_aux.nc", "auxiliary/{}_tech_aux.nc", "{}_tech.nc")
_BEGUN, _UP = 100, 600  # measurement codes: descent begins, ascent ends
_APART = 50  # codes of a cycle's times
_READING, _ACTION = 40, 39  # what is left of a code over that: 10 and 11 before the next time
_BAD = ("3", "4")  # Argo reference table 2
_SENT = ("2", "3")  # Argo reference table 19: sent by the float, computed from what it sent
_DAY = 86400.0
_TIMES, _PRESSURES = (60.0, 1.0), (10.0, 1.0, 0.1)  # s, dbar: what floats round to


class Run(NamedTuple):
    """A run of the pump or an opening of the valve: when [days], for how long [s]."""

    cycle: float
    day: float
    device: Device
    seconds: float


def read_trajectory(path: str | Path, data: bytes, where: Mapping[str, str | float]) -> FloatLog:
    """Return the log of one cycle; raises LogError where `where` chooses none, or several."""
    found = NetCDF(data, LogFile(Path(path)))
    file = found.file
    wmo = " ".join(found.texts("PLATFORM_NUMBER")).strip("\0 ") or Path(path).name.partition("_")[0]
    remedy = f"Give the float's trajectory, {wmo}_Rtraj.nc, its technical file beside it"
    found.refuse_unless("Argo trajectory", remedy)
    rows = _columns(found, ("JULD", "CYCLE_NUMBER", "MEASUREMENT_CODE", "PRES"))
    days, code, pressure = rows["JULD"], rows["MEASUREMENT_CODE"], _pressures(found)
    technical = _technical(found, Path(path), wmo)
    runs = sorted(_runs(technical), key=lambda run: run.day)
    cycle = _cycle({run.cycle for run in runs}, where, file)
    runs = [run for run in runs if run.cycle == cycle]
    kind = np.where((code > _BEGUN) & (code < _UP), code % _APART, np.nan)
    known = np.isfinite(days) & np.isfinite(pressure) & np.isin(kind, (_READING, _ACTION))
    if "JULD_STATUS" in found.attributes:
        known &= np.isin(found.flags("JULD_STATUS", "JULD", days.shape), _SENT)
    steps = np.zeros((2, len(days)))
    for some in (known & (kind == _READING), known & (kind == _ACTION)):
        steps[0, some] = _resolution(_DAY * days[some], _TIMES, 0.5)
        steps[1, some] = _DBAR * _resolution(rows["PRES"][some], _PRESSURES, 0.01)
    own = np.flatnonzero(known & (rows["CYCLE_NUMBER"] == cycle))
    own = own[np.argsort(days[own], kind="stable")]
    if len(own) < 2:
        what = f"fewer than two pressures of cycle {cycle:g} have a time that the float sent"
        raise file.refused(what, "Choose another cycle with `where={'cycle': 'N'}`", "PRES")
    first = min(float(days[own[0]]), runs[0].day)
    begun = [(_DAY * (day - first), device, lasts) for _, day, device, lasts in runs]
    said = f"{len(own)} pressures and {counted(len(runs), 'action')} of cycle {cycle:g}"
    said += "" if technical is found else f", these from {Path(technical.file.path).name}"
    if (acted := int(np.sum(kind[own] == _ACTION))) != len(runs):
        said += f"; {acted} of the pressures are at actions"
    return table_log(
        _DAY * (days[own] - first),
        _DBAR * pressure[own],
        begun,
        source=f"{file.path}, cycle {cycle:g}",
        name=f"cycle {cycle:g}",
        time_step=steps[0, own],
        pressure_step=steps[1, own],
        report=(said,),
    )


def _columns(found: NetCDF, names: tuple[str, ...]) -> dict[str, Array]:
    """Return the numbers of variables, a row each; raises LogError where they are not that."""
    rows: dict[str, Array] = {}
    for name in names:
        one = found.numbers.get(name)
        if one is None or one.ndim != 1:
            what = "the file has no such variable with a number a row"
            raise found.file.refused(what, "Fetch the file anew", name)
        rows[name] = one
        if rows[name].shape != rows[names[0]].shape:
            what = f"not as many numbers as {names[0]} has"
            raise found.file.refused(what, "Fetch the file anew", name)
    said = found.attributes["JULD"].get("units", "days")
    if said.split()[:1] != ["days"]:
        remedy = "Fetch the file anew: Argo counts days since 1950-01-01"
        raise found.file.refused("its times are no days", remedy, "JULD", value=said)
    return rows


def _pressures(found: NetCDF) -> Array:
    """Return the pressures [dbar] [n], those that are flagged as bad left out."""
    raw = found.good("PRES")
    if "PRES_ADJUSTED" not in found.attributes:
        return raw
    adjusted = found.good("PRES_ADJUSTED")
    if adjusted.shape != raw.shape:
        remedy = "Fetch the file anew"
        raise found.file.refused("not as many numbers as PRES has", remedy, "PRES_ADJUSTED")
    pressure = np.where(np.isfinite(adjusted), adjusted, raw)
    if "PRES_ADJUSTED_QC" in found.attributes:
        bad = np.isin(found.flags("PRES_ADJUSTED_QC", "PRES_ADJUSTED", raw.shape), _BAD)
        pressure[bad] = np.nan
    return pressure


def _technical(found: NetCDF, path: Path, wmo: str) -> NetCDF:
    """Return the file that says for how long pump and valve ran; raises LogError for none."""
    there = [path.parent / name.format(wmo) for name in _BESIDE]
    there = [beside for beside in there if beside.exists()]
    files = (NetCDF(read_bytes(beside), LogFile(beside)) for beside in there)
    for one in (found, *files):
        if not _RUNS.keys().isdisjoint(one.attributes):
            return one
    what = "a trajectory has the pressures at actions of pump and valve, but not how long they took"
    remedy = f"Put {_BESIDE[0].format(wmo)} beside it, with {' and '.join(_RUNS)}"
    if there:
        remedy += f"; {' and '.join(beside.name for beside in there)} lacks them"
    raise found.file.refused(what, remedy, next(iter(_RUNS)))


def _runs(technical: NetCDF) -> list[Run]:
    """Return all runs; raises LogError for one without a time, and for a unit that is none."""
    file = technical.file
    cycle = "CYCLE_NUMBER_MEAS" if "CYCLE_NUMBER_MEAS" in technical.attributes else "CYCLE_NUMBER"
    names = [name for name in _RUNS if name in technical.attributes]
    rows = _columns(technical, ("JULD", cycle, *names))
    found = []
    for name in names:
        unit = technical.attributes[name].get("units", "")
        try:
            seconds = rows[name] * unit_factor(plain_unit(unit), "s")
        except InputError:
            remedy = "Correct the variable's attribute `units`: Coriolis writes csec"
            raise file.refused("its unit is no time", remedy, name, value=unit) from None
        of = np.stack([rows[cycle], rows["JULD"], seconds], axis=1)[np.isfinite(seconds)]
        if not np.isfinite(of).all() or np.any(of[:, 2] < 0.0):
            what = "an action that has no cycle, no time, or less than 0 s"
            raise file.refused(what, "Fetch the file anew", name)
        found += [Run(number, day, _RUNS[name], lasts) for number, day, lasts in of.tolist()]
    return found


def _cycle(cycles: set[float], where: Mapping[str, str | float], file: LogFile) -> float:
    """Return the cycle that is chosen among those of the runs; raises LogError for no one."""
    held = [f"{cycle:g}" for cycle in sorted(cycles)]
    for name in where:
        if name != "cycle":
            remedy = "Of a trajectory choose a cycle: `where={'cycle': 'N'}`"
            raise file.refused("no such column", remedy, Parameter("where"), value=name)
    if not held:
        what, remedy = "no action of pump or valve", "Give the files of a float that sends them"
        raise file.refused(what, remedy, next(iter(_RUNS)))
    given = where.get("cycle")
    if given is None:
        refuse_several(file, "cycle", held, "cycle")
        return float(held[0])
    with suppress(ValueError):
        if float(given) in cycles:
            return float(given)
    remedy = f"Cycles with actions of pump and valve: {', '.join(held[:30])}"
    raise file.refused("no such cycle", remedy, Parameter("where"), value=given)


def _resolution(values: Array, steps: tuple[float, ...], within: float) -> float:
    """Return the largest of the steps that all values are multiples of, the last if none is."""
    off = (np.abs(values - step * np.round(values / step)) for step in steps)
    fits = (not np.any(away > within) for away in off)  # one that is missing fits
    return next((step for step, fit in zip(steps, fits, strict=True) if fit), steps[-1])
