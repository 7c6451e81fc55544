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

from swimbladder.io.float_log import Action, Device, FloatLog
from swimbladder.io.log_format import LogColumn
from swimbladder.io.log_rows import Sheet
from swimbladder.io.log_table import Array, Table, read_table
from swimbladder.io.log_text import LogFile, counted

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
    devices = [table.labels["device"][int(k) - 1] for k in table.values["device"]]
    for k, device in enumerate(devices):
        if device not in _DEVICES:
            remedy, line = f"Actions are {', '.join(_DEVICES)}", int(table.line[k])
            raise file.refused("no such action", remedy, "action", line=line, value=device)
    chosen = {n: table.labels[n] for n in ("deployment", "cycle") if n in table.labels}
    for name, found in chosen.items():
        refuse_several(file, name, found, _ACTIONS[name].name)
    time, pressure, run = (table.values[name] for name in ("time_s", "pressure_Pa", "run_s"))
    rows = [time, pressure, np.full(len(time), _MINUTE), np.full(len(time), _DBAR)]
    readings, said = _readings(Path(path), {_ACTIONS[n].name: f[0] for n, f in chosen.items()})
    rows = [np.append(a, b) for a, b in zip(rows, readings, strict=True)]
    at = np.argsort(rows[0], kind="stable")
    time_of, pressures, steps, widths = (column[at] for column in rows)
    first = float(time_of[0])
    actions = [
        Action(device=_DEVICES[d], time=float(t) - first, asked=float(s), seconds=float(s))
        for d, t, s in zip(devices, time, run, strict=True)
    ]
    return FloatLog(
        source=f"{file.path}, cycle {chosen['cycle'][0]}",
        name=f"cycle {chosen['cycle'][0]}",
        time=time_of - first,
        pressure=pressures,
        temperature=np.full(len(time_of), np.nan),
        stage=np.full(len(time_of), -2, dtype=np.int64),
        time_step=steps,
        pressure_step=widths,
        actions=tuple(sorted(actions, key=lambda a: a.time)),
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
        return {name: column for name, column in columns.items() if column.name in sheet.header}

    return read_table(file, where, choose, [], _UNITS, labels=_LABELS)


def _readings(path: Path, where: Mapping[str, str]) -> tuple[list[Array], str]:
    """Return times, pressures and their steps of the CTD beside a table, and what was read."""
    beside = path.with_name(path.name.replace("_actions", "_ctd"))
    none = [np.zeros(0)] * 4
    if beside == path or not beside.exists():
        return none, f"no table of CTD readings beside it ({beside.name}): only those of actions"
    table = _read(LogFile(beside), where, _READINGS)
    phases = np.array(table.labels["phase"])[table.values["phase"].astype(int) - 1]
    used = np.isin(phases, _DIVES) & (table.values["index"] == 0.0)
    time, pressure = table.values["time_s"][used], table.values["pressure_Pa"][used]
    steps = [np.full(len(time), 1.0), np.full(len(time), 0.1 * _DBAR)]
    return [time, pressure, *steps], f"{counted(len(time), 'pressure')} read from {beside.name} too"
