"""Argo's trajectory and technical files, written as the user's manual has them."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

from swimbladder.errors import LogError
from swimbladder.io.float_logs import read_float_log
from tests.io import test_argo

ACTIONS = test_argo.ACTIONS
READINGS = test_argo.READINGS.replace("00,", "07,")  # to the second, and seen to be
DAY0 = 29706.0  # days since 1950
FILLS = {"d": 999999.0, "f": 99999.0, "i": 99999}
CODES = {"descent": 190, "drift": 290, "ascent": 590}


def put(path, kind: str, rows, units=None, **texts) -> Path:
    """Write an Argo file: rows by variable, numbers or a letter each, all in one dimension."""
    with netcdf_file(path, "w") as file:
        for name, text in {"DATA_TYPE": kind, "PLATFORM_NUMBER": "7900001", **texts}.items():
            size = 32 if name == "DATA_TYPE" else 8
            file.createDimension(f"of {name}", size)
            letters = file.createVariable(name, "c", (f"of {name}",))
            letters._FillValue = b" "
            letters[:] = list(text.ljust(size))
        file.createDimension("N_MEASUREMENT", len(next(iter(rows.values()))))
        for name, values in rows.items():
            if isinstance(values, str):
                letters = file.createVariable(name, "c", ("N_MEASUREMENT",))
                letters._FillValue = b" "
                letters[:] = list(values)
                continue
            form = {"J": "d", "C": "i", "M": "i"}.get(name[0], "f")
            fill = -1.0 if name.endswith("DURATION") else FILLS[form]
            item = file.createVariable(name, form, ("N_MEASUREMENT",))
            item._FillValue = np.array([fill], form)
            item.units = {"J": "days since 1950-01-01 00:00:00 UTC", "P": "decibar"}.get(
                name[0], ""
            )
            if name.endswith("DURATION"):
                item.units = units or "csec"
            item[:] = np.where(np.isfinite(values), values, fill)
    return path


def table(text: str):
    return np.genfromtxt(text.splitlines(), delimiter=",", names=True, dtype=None, encoding=None)


def written(folder, actions, readings) -> Path:
    """Write a packet table as Coriolis would: pressures here, durations there."""
    folder.mkdir(exist_ok=True)
    first = readings[(readings["index_in_packet"] == 0) & np.isin(readings["phase"], list(CODES))]
    day = DAY0 + np.append(actions["time_s_since_day0"], first["packet_time_s_since_day0"]) / 86400
    cycle = np.append(actions["cycle"], first["cycle"])
    codes = np.where(actions["action"] == "pump", 589, 189)
    rows = {
        "JULD": day,
        "CYCLE_NUMBER": cycle,
        "MEASUREMENT_CODE": np.append(codes, [CODES[phase] for phase in first["phase"]]),
        "PRES": np.append(actions["pressure_dbar"], first["pressure_dbar"]).astype(float),
    }
    # what else is in such a file: times alone, a fix, an estimate, a bin without a time
    others = [(100, 4.0, 2), (703, np.nan, 4), (590, 333.0, 1), (590, 222.0, " "), (301, 498.0, 3)]
    for code, pressure, _ in others:
        time = np.nan if pressure == 222.0 else day[0]
        for name, value in zip(rows, (time, cycle[0], code, pressure), strict=True):
            rows[name] = np.append(rows[name], value)
    status = "2" * len(day) + "".join(str(status) for *_, status in others)
    rows |= {"JULD_STATUS": status, "PRES_QC": "1" * len(status)}
    n = len(actions)
    technical = {"JULD": day[:n], "CYCLE_NUMBER_MEAS": cycle[:n], "MEASUREMENT_CODE": codes}
    for device in ("pump", "valve"):
        seconds = np.where(actions["action"] == device, 100.0 * actions["duration_s"], np.nan)
        technical[f"{device.upper()}_ACTION_DURATION"] = seconds
    put(folder / "7900001_tech_aux.nc", "Argo auxiliary technical data", technical)
    return put(folder / "7900001_Rtraj.nc", "Argo trajectory", rows)


@pytest.fixture
def path(tmp_path) -> Path:
    return written(tmp_path, table(ACTIONS), table(READINGS))


def same(log, other) -> None:
    """Compare the logs of a trajectory and a table: pressures are 32 bits there."""
    assert log.name == other.name
    assert log.time == pytest.approx(other.time, abs=1e-3)
    assert log.pressure == pytest.approx(other.pressure, abs=3.0)
    assert log.time_step.tolist() == other.time_step.tolist()
    assert log.pressure_step.tolist() == other.pressure_step.tolist()
    assert log.stage.tolist() == other.stage.tolist()
    assert np.isnan(log.temperature).all()
    assert [a.device for a in log.actions] == [a.device for a in other.actions]
    for name in ("time", "asked", "seconds"):
        of = [[getattr(a, name) for a in one.actions] for one in (log, other)]
        assert of[0] == pytest.approx(of[1], abs=1e-3)


@pytest.mark.parametrize("cycle", ["4", "5"])
def test_a_made_up_cycle_is_that_of_its_packet_table(path, cycle: str) -> None:
    (path.parent / "it_actions.csv").write_text(ACTIONS)
    (path.parent / "it_ctd.csv").write_text(READINGS)
    log = read_float_log(path, where={"cycle": cycle})
    same(log, read_float_log(path.parent / "it_actions.csv", where={"cycle": cycle}))
    assert log.source == f"{path}, cycle {cycle}"
    actions = {"4": "6 pressures and 4 actions", "5": "3 pressures and 2 actions"}[cycle]
    assert log.report == (f"{actions} of cycle {cycle}, these from 7900001_tech_aux.nc",)


def test_a_real_cycle_is_that_of_its_packet_table(data_dir, tmp_path) -> None:
    read = []
    for name in ("actions", "ctd"):
        packed = (data_dir / "argo_arvor" / f"deep_4000_{name}.csv.gz").read_bytes()
        rows = table(gzip.decompress(packed).decode())
        read.append(rows[rows["cycle"] <= 3])
    path = written(tmp_path, *read)
    for cycle in ("1", "2", "3"):
        other = data_dir / "argo_arvor" / "deep_4000_actions.csv.gz"
        same(
            read_float_log(path, where={"cycle": cycle}),
            read_float_log(other, where={"cycle": cycle}),
        )


TRAJECTORY = {
    "JULD": [DAY0, DAY0 + 0.1, DAY0 + 0.2],
    "CYCLE_NUMBER": [7, 7, 7],
    "MEASUREMENT_CODE": [189, 290, 589],
    "PRES": [101.0, 500.3, 490.0],
}
RUNS = {
    "JULD": [DAY0, DAY0 + 0.2],
    "CYCLE_NUMBER_MEAS": [7, 7],
    "MEASUREMENT_CODE": [189, 589],
    "VALVE_ACTION_DURATION": [30.0, np.nan],
    "PUMP_ACTION_DURATION": [np.nan, 1120.0],
}
TECHNICAL = "Argo technical data"


def pair(folder, trajectory=(), runs=(), *, without=(), units=None, name="tech") -> Path:
    """Write the two files, changed."""
    rows = {n: v for n, v in (TRAJECTORY | dict(trajectory)).items() if n not in without}
    ran = {n: v for n, v in (RUNS | dict(runs)).items() if n not in without}
    if name:
        put(folder / f"7900001_{name}.nc", TECHNICAL, ran, units=units)
    return put(folder / "7900001_Rtraj.nc", "Argo trajectory", rows)


def test_the_only_cycle_needs_no_choice_and_seconds_may_be_in_seconds(tmp_path) -> None:
    log = read_float_log(pair(tmp_path, units="second"))
    assert log.name == "cycle 7"
    assert [(a.device, a.seconds) for a in log.actions] == [("valve", 30.0), ("pump", 1120.0)]
    assert read_float_log(tmp_path / "7900001_Rtraj.nc", log_format="argo").name == "cycle 7"


def test_adjusted_pressures_are_taken_and_bad_ones_are_not(tmp_path) -> None:
    more = {"PRES_QC": "114", "PRES_ADJUSTED": [100.25, 499.5, np.nan], "PRES_ADJUSTED_QC": "11 "}
    log = read_float_log(pair(tmp_path, more))
    assert log.pressure == pytest.approx([100.25e4, 499.5e4])
    assert log.pressure_step.tolist() == [1e4, 1e3]  # as the float rounded
    assert log.report == (
        "2 pressures and 2 actions of cycle 7, these from 7900001_tech.nc; "
        "1 of the pressures are at actions",
    )


def test_durations_may_stand_in_the_trajectory_itself(tmp_path) -> None:
    more = {"PUMP_ACTION_DURATION": [np.nan, np.nan, 500.0]}
    log = read_float_log(pair(tmp_path, more, name=""))
    assert [(a.device, a.seconds) for a in log.actions] == [("pump", 5.0)]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"without": ["PRES"]}, "PRES: the file has no such variable"),
        ({"without": ["MEASUREMENT_CODE"]}, "MEASUREMENT_CODE: the file has no such variable"),
        ({"without": ["CYCLE_NUMBER_MEAS"]}, "_tech.nc, CYCLE_NUMBER: the file has no such"),
        ({"trajectory": {"PRES": "abc"}}, "PRES: the file has no such variable with a number"),
        ({"trajectory": {"PRES": [np.nan] * 3}}, "fewer than two pressures of cycle 7"),
        ({"trajectory": {"JULD": [np.nan] * 3}}, "fewer than two pressures of cycle 7"),
        ({"trajectory": {"JULD_STATUS": "111"}}, "fewer than two pressures of cycle 7"),
        ({"trajectory": {"CYCLE_NUMBER": [6, 6, 6]}}, "fewer than two pressures of cycle 7"),
        ({"runs": {"JULD": [DAY0, np.nan]}}, "PUMP_ACTION_DURATION: an action that has no"),
        ({"runs": {"VALVE_ACTION_DURATION": [-5.0, np.nan]}}, "VALVE_ACTION_DURATION: an action"),
        ({"runs": {"CYCLE_NUMBER_MEAS": [7, 8]}}, "the file holds 2 cycles: 7, 8. Choose one"),
        (
            {"runs": {name: [np.nan, np.nan] for name in list(RUNS)[3:]}},
            "PUMP_ACTION_DURATION: no action of pump or valve",
        ),
        ({"units": "count"}, "PUMP_ACTION_DURATION: its unit is no time (got 'count')"),
        ({"without": list(RUNS)[3:]}, "VALVE_ACTION_DURATION; 7900001_tech.nc lacks them"),
        ({"name": ""}, "Put 7900001_tech_aux.nc beside it"),
    ],
)
def test_what_is_no_cycle_is_refused(tmp_path, change, says: str) -> None:
    with pytest.raises(LogError) as refused:
        read_float_log(pair(tmp_path, **change))
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("where", "says"),
    [
        ({"cycle": "9"}, "where: no such cycle (got '9'). Cycles with actions"),
        ({"cycle": "four"}, "no such cycle (got 'four')"),
        ({"mission_day0": "2031-05-01"}, "where: no such column (got 'mission_day0')"),
        ({}, "the file holds 2 cycles: 4, 5. Choose one dive: `where={'cycle': '4'}`; several"),
    ],
)
def test_a_cycle_that_is_not_there_is_refused(path, where, says: str) -> None:
    with pytest.raises(LogError) as refused:
        read_float_log(path, where=where)
    assert says in str(refused.value)


@pytest.mark.parametrize("kind", [TECHNICAL, "Argo meta-data", "Argo profile", ""])
def test_another_file_of_the_float_is_refused(tmp_path, kind: str) -> None:
    path = put(tmp_path / "it.nc", kind, RUNS)
    with pytest.raises(LogError) as refused:
        read_float_log(path)
    assert f"(got '{kind or 'nothing'}')" in str(refused.value)
    assert "Give the float's trajectory, 7900001_Rtraj.nc" in str(refused.value)


def test_a_damaged_file_is_refused(path) -> None:
    """Whatever bytes are cut or changed, it is read or refused in words."""
    data, rng = path.read_bytes(), np.random.default_rng(1)
    refused = 0
    for k in range(120):
        spoilt = bytearray(data[: rng.integers(4, len(data))] if k % 2 else data)
        for at in rng.integers(4, len(spoilt), 0 if k % 2 else 3):
            spoilt[at] = rng.integers(256)
        path.write_bytes(spoilt)
        try:
            read_float_log(path, where={"cycle": "4"})
        except LogError:
            refused += 1
    assert refused > 40
