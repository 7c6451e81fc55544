"""The tables of an Argo float's packets: `NAME_actions.csv`, and `NAME_ctd.csv` beside it.

Floats of the Arvor and Provor kind (NKE) send each action of pump and valve, with the pressure at
it, and their own CTD. Decoded they are tables: a row an action, with the columns ``cycle,
time_s_since_day0, action, pressure_dbar, duration_s``; a row a reading of the CTD, ``cycle, phase,
packet_time_s_since_day0, index_in_packet, pressure_dbar``. Both may have a deployment's first day,
``mission_day0``. They are plain text or gzip.

Actions are stamped in whole minutes and their pressures in whole dbar; of the readings only the
first of a packet has a time.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from swimbladder.io.columns import mapped_column
from swimbladder.io.float_log import Device, FloatLog, table_log
from swimbladder.io.log_format import LogColumn
from swimbladder.io.log_rows import Sheet
from swimbladder.io.log_table import Table, read_table
from swimbladder.io.log_text import LogFile, counted
from swimbladder.physics.arrays import Array

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
