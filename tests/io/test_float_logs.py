"""Logs of floats: a made-up one line by line, real ones against what others took from them."""

import contextlib
import gzip
import math
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from swimbladder.errors import LogError
from swimbladder.io.float_logs import read_float_log
from swimbladder.io.log_formats.mermaid import is_mermaid, read_mermaid
from tests.quoted import refused

# Made up in the manner of such a float: a dive to 30 bar, with the mishaps that logs have.
MADE_UP = """\
2031-03-01T10:00:00:[MAIN  ,0007]buoy 999.001-X-0001
2031-03-01T10:00:00:[MAIN  ,0055]soft pilotage 999.001.100_V2.20-20310101
2031-03-01T10:00:20:[SURF  ,0082]Latitude : S12deg30.000mn, Longitude :W045deg15.000mn
2031-03-01T10:01:00:[BYCMD ,0125]    near 1000mbar 3mbar/s (15000mbar 3mbar/s stored)
2031-03-01T10:01:00:[BYCMD ,0129]    coeff 16/10 (16/10 stored)
2031-03-01T10:01:00:[BYCMD ,0130]    coeff is running
2031-03-01T10:01:01:[STAGE ,0080]Stage [0] 30000mbar (+/-500mbar) 3600s (<3600s)
2031-03-01T10:01:01:[STAGE ,0091]Stage [1] surfacing 1800s (<5400s) SBE41
2031-03-01T10:01:02:[SBE41 ,0282]SBE41 parameters :
      addtimingdelays=0 (n(0)/y(1))
2031-03-01T10:01:10:[PRESS ,0038]P    -12mbar,T+21000mdegC
2031-03-01T10:02:00:[DIVING,0141]diving from -12mbar, +0mbar/s
2031-03-01T10:02:00:[BYPASS,0035]bypass opening 20000ms
2031-03-01T10:02:05:[BYPASS,0104]battery 14700mV,  300000uA (bypass opening), P    -12mbar
2031-03-01T10:02:25:[BYPASS,0106]battery 14600mV,  390000uA (bypass closing), P    -12mbar
2031-03-01T10:04:00:[MAIN  ,0056]stage[0]
2031-03-01T10:05:00:[PRESS ,0038]P   +600mbar,T+20500mdegC
2031-03-01T10:05:30:[BUOY  ,0087]from +2mbar/s to +4mbar/s
2031-03-01T10:05:30:[BUOY  ,0090]need to transfer -20mL (valve during 9000ms)
2031-03-01T10:05:30:[VALVE ,0034]valve opening 9000ms
2031-03-01T10:05:40:[VALVE ,0234]battery 14400mV,  610000uA, P   +650mbar
2031-03-01T10:50:00:[PRESS ,0038]P +29800mbar,T+13500mdegC
2031-03-01T10:50:00:<WARN>[BUOY  ,0094]stage[0] should DESCENT, stuck at 29800mbar for the #1 time
2031-03-01T10:50:10:[BUOY  ,0087]from +9mbar/s to +0mbar/s
2031-03-01T10:50:10:[BUOY  ,0089]need to transfer +130mL (pump during 158600ms)
2031-03-01T10:50:18:[PUMP  ,0207]battery 15000mV,   40000uA (warmup), P +29900mbar
2031-03-01T10:50:18:[PUMP  ,0016]pump during 60000ms
2031-03-01T10:51:17:[PUMP  ,0212]battery 14300mV,  600000uA (steady state), P +29900mbar
2031-03-01T10:52:00:[PRESS ,0038]P+999999mbar,T+13500mdegC
2031-03-01T09:00:00:[PRESS ,0038]P +29000mbar,T+13500mdegC
2031-03-01T10:53:00:[BUOY  ,0087]from +15397mbar/s to +15397mbar/s
2031-03-01T11:30:00:[MAIN  ,0065]surfacing
2031-03-01T11:30:10:[PUMP  ,0207]pump warmup 15010mV/41000uA
2031-03-01T11:30:10:[PUMP  ,0016]pump during 300000ms
2031-03-01T11:32:00:[PUMP  ,0212]pump stopped, 14100mV/1490000uA
2031-03-01T11:32:02:[SURFIN,0019]external bladder full
2031-03-01T11:33:00:[PRESS ,0038]P   +180mbar,T+21000mdegC
2031-03-01T11:33:30:[MAIN  ,0272]Vbat 14700mV (min 14650mV)
2031-03-01T11:33:31:[MAIN  ,0024]internal pressure 80000Pa
"""


# In the manner of 2018: seconds since 1970, parts padded otherwise, shorter words, no thermometer.
OLDER = """\
1900000000:[MRMAID,650]$GPSOFF:3686330;
1900000000:[MAIN  ,111]board 999.002-X-02
1900000000:[MAIN  ,112]soft 999.001.300.1667-20180518
1900000048:[SURF  ,394]S12deg30.000mn, W045deg15.000mn
1900000100:[MAIN  ,593]internal pressure 84000Pa
1900000101:    near 15000mbar 3mbar/s (10000mbar 3mbar/s stored)
1900000101:    p2t37: dp 5000mbar, dt 5000mdegC
1900000101:    stage[0] 150000mbar (+/-5000mbar) 60000s (<60000s)
1900000110:[BYPASS,147]opening 120000ms
1900000500:[DIVING,157]710mbar reached (+11mbar/s), 5 bypass done
1900000501:[MAIN  ,641]stage[0]
1900001100:[PRESS , 81]P  +7000mbar,T-10612mdegC
1900001200:[PRESS ,0038]P  +8000mbar
1900013000:[VALVE ,129]opening for 1008ms
1900014000:[PRESS , 81]P +67000mbar,T+32767mdegC
1900033000:[PUMP  ,368]during 24219ms
1900034000:[PRESS , 81]P+138000mbar,T +3500mdegC
1900170000:[MAIN  ,477]surfacing
1900190000:[SURFIN, 82]filling external bladder
1900190000:[PUMP  ,368]during 300000ms
1900190010:[PUMP  ,0210]aborted, 29100ticks remain
1900190012:[SURFIN,117]external bladder full
1900190100:[MAIN  ,493]Vbat 14600mV (min 12100mV)
1900190101:[MAIN  ,498]Pint 82000Pa
1900190102:*** switching to 02/5E709B26 ***
"""


@pytest.fixture
def made_up(tmp_path: Path) -> Path:
    path = tmp_path / "20310301__0001.LOG"
    path.write_bytes(MADE_UP.replace("\n", "\r\n").encode())
    return path


def test_a_made_up_dive(made_up: Path) -> None:
    log = read_mermaid(made_up)
    assert (log.name, log.firmware) == ("999.001-X-0001", "999.001.100_V2.20-20310101")
    assert log.start == "2031-03-01T10:00:00"
    assert log.position == (-12.5, -45.25)
    assert log.settings == {"near": "1000mbar 3mbar/s", "coeff": "16/10"}
    assert [(s.number, s.pressure, s.tolerance, s.duration) for s in log.stages] == [
        (0, 3e6, 5e4, 3600.0),
        (1, 0.0, 0.0, 1800.0),
    ]
    assert log.time.tolist() == [70.0, 300.0, 3000.0, 5580.0]
    assert log.pressure.tolist() == [-1200.0, 6e4, 2.98e6, 1.8e4]
    assert log.temperature.tolist() == [21.0, 20.5, 13.5, 21.0]
    assert log.stage.tolist() == [-2, 0, 0, -2]
    assert (log.battery_voltage, log.battery_least) == (14.7, 14.65)
    assert log.internal_pressure == 8e4
    assert log.report == (
        "1 line out of order in time left out, the first in line 30",
        "1 line of PRESS with numbers that cannot be, the first in line 29",
        "1 line of BUOY with numbers that cannot be, the first in line 31",
    )


def test_a_run_that_was_broken_off_is_not_ended_again_by_a_full_bladder(tmp_path: Path) -> None:
    path = tmp_path / "02_5E6D9838.LOG"
    for ticks, lasted in ((29100, 300.0 - 29100 * 0.01), (0, 300.0)):
        path.write_text(OLDER.replace("29100ticks", f"{ticks}ticks"))
        assert read_float_log(path).actions[-1].seconds == pytest.approx(lasted, rel=0.05)
    path.write_text(OLDER.replace("29100ticks", "99999ticks"))
    log = read_float_log(path)
    assert log.actions[-1].seconds == 0.0
    assert any("of PUMP with numbers that cannot be" in line for line in log.report)


def test_the_words_of_an_older_firmware(tmp_path: Path) -> None:
    path = tmp_path / "02_5E6D9838.LOG"
    path.write_text(OLDER)
    log = read_float_log(path)
    assert (log.name, log.firmware) == ("999.002-X-02", "999.001.300.1667-20180518")
    assert log.start == "2030-03-17T17:46:40"
    assert log.position == (-12.5, -45.25)
    assert log.settings == {"near": "15000mbar 3mbar/s"}
    assert [(s.number, s.pressure, s.tolerance, s.duration) for s in log.stages] == [
        (0, 1.5e7, 5e5, 60000.0)
    ]
    assert log.time.tolist() == [1100.0, 1200.0, 14000.0, 34000.0]
    assert log.pressure.tolist() == [7e5, 8e5, 6.7e6, 1.38e7]
    assert np.isnan(log.temperature).tolist() == [True, True, True, False]
    assert log.stage.tolist() == [0, 0, 0, 0]
    assert [(a.device, a.time, a.asked, a.seconds) for a in log.actions] == [
        ("bypass", 110.0, 120.0, 120.0),
        ("valve", 13000.0, 1.008, 1.008),
        ("pump", 33000.0, 24.219, 24.219),
        ("pump", 190000.0, 300.0, 9.0),
    ]
    assert (log.internal_pressure, log.battery_voltage, log.battery_least) == (8.2e4, 14.6, 12.1)
    assert log.report == ("3 samples without a temperature that a sea has",)


def test_a_misprinted_time_costs_its_own_line_only(tmp_path: Path) -> None:
    lines = [f"2020-06-25T10:{m:02d}:00:[PRESS ,0038]P +{m}00mbar,T+14277mdegC" for m in range(60)]
    lines[10] = lines[10].replace("06-25", "06-27")  # ahead, by less than a gap in a log may be
    lines[20] = lines[20].replace("06-25", "06-95")
    lines[30] = lines[30].replace("T10:30:00", "T10:20:30")  # back, by more than a second
    lines[40] = lines[40].replace("T10:40:00", "T10:38:59")  # by one: a clock put right
    path = tmp_path / "odd.LOG"
    path.write_text("\n".join(["1970-01-01T00:00:07:[MAIN  ,0007]buoy 1", *lines]))
    log = read_mermaid(path)
    kept = [m for m in range(60) if m not in (10, 20, 30)]
    assert (log.pressure / 1e4).round().astype(int).tolist() == kept
    assert log.start == "2020-06-25T10:00:00"
    assert log.report == ("4 lines out of order in time left out, the first in line 1",)
    assert log.time[kept.index(40)] == log.time[kept.index(39)]
    assert np.all(np.diff(log.time) >= 0.0)


@pytest.mark.parametrize("seed", range(8))
def test_no_damage_to_a_log_ends_in_anything_but_a_log_or_an_error(
    made_up: Path, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    whole = made_up.read_bytes()
    for _ in range(20):
        data = bytearray(whole)
        for at in rng.integers(len(data), size=rng.integers(1, 60)):
            data[at] = rng.integers(256) if seed % 2 else ord("0") + rng.integers(10)
        made_up.write_bytes(bytes(data[: rng.integers(1, len(data))]))
        with contextlib.suppress(LogError):
            assert np.all(np.diff(read_mermaid(made_up).time) >= 0.0)


def test_what_its_pump_and_valves_did(made_up: Path) -> None:
    bypass, valve, pump, fill = read_mermaid(made_up).actions
    assert (bypass.device, bypass.time, bypass.asked, bypass.stage) == ("bypass", 120.0, 20.0, -1)
    assert bypass.before is not None
    assert bypass.after is not None
    assert (bypass.before.current, bypass.after.current) == (0.3, 0.39)
    assert bypass.target is None
    assert (valve.device, valve.seconds, valve.pressure) == ("valve", 9.0, 6.5e4)
    assert valve.target is not None
    assert (valve.target.speed_from, valve.target.speed_to) == (200.0, 400.0)
    assert (valve.target.change, valve.target.seconds) == pytest.approx((-20e-6, 9.0))
    assert (pump.device, pump.asked, pump.seconds, pump.stage) == ("pump", 60.0, 60.0, 0)
    assert pump.target is not None
    assert pump.before is not None
    assert pump.after is not None
    assert pump.target.change == pytest.approx(130e-6)
    assert (pump.before.current, pump.after.voltage, pump.after.current) == (0.04, 14.3, 0.6)
    assert (fill.asked, fill.seconds, fill.stage, fill.target) == (300.0, 112.0, None, None)
    assert math.isnan(fill.pressure)


def test_a_compressed_log(made_up: Path, tmp_path: Path) -> None:
    packed = tmp_path / "dive.LOG.gz"
    packed.write_bytes(gzip.compress(made_up.read_bytes()))
    assert read_float_log(packed).name == read_mermaid(made_up).name


def test_what_is_no_such_log(tmp_path: Path, made_up: Path) -> None:
    assert is_mermaid(made_up.read_bytes())
    assert not is_mermaid(b"time_s,depth_m\n0,1\n")
    assert not is_mermaid(b"2031-03-01T10:00:00:[OTHER ,0001]x\n")
    other = tmp_path / "other.csv"
    other.write_text("time_s,depth_m\n0,1\n")
    with refused(LogError, field="[PRESS ,0038]"):
        read_mermaid(other)
    with refused(LogError, field="file"):
        read_mermaid(tmp_path / "none.LOG")


@pytest.mark.data
@pytest.mark.parametrize("key", ["5E44C314", "5ED0CB15", "5EF46586", "5F033FD8"])
def test_raw_logs_give_what_others_took_from_them(data_dir: Path, key: str) -> None:
    folder = data_dir / "mermaid_p0051"
    (path,) = folder.glob(f"raw_logs/*_{key}.LOG")
    log = read_mermaid(path)
    start = datetime.fromisoformat(log.start)
    samples, actions = (_of(folder / f"{name}.csv.gz", key) for name in ("pressure", "actions"))
    dive = _of(folder / "dives.csv", key).iloc[0]
    assert log.report == ()

    def seconds(times: pd.Series) -> np.ndarray:
        return (pd.to_datetime(times) - start).dt.total_seconds().to_numpy()

    assert np.array_equal(log.time, seconds(samples["time"]))
    assert log.pressure == pytest.approx(100.0 * samples["P_mbar"].to_numpy(), abs=1e-6)
    assert log.temperature == pytest.approx(samples["T_mdegC"].to_numpy() / 1000.0, abs=1e-9)
    # There: 99 while it comes up, nothing before a dive.
    stage = samples["stage"].fillna(99.0).to_numpy()
    assert np.array_equal(log.stage, np.where(stage == 99.0, -2, stage))

    assert [a.device for a in log.actions] == actions["device"].tolist()
    assert np.array_equal([a.time for a in log.actions], seconds(actions["time"]))
    asked = [1000.0 * a.asked for a in log.actions]
    assert asked == pytest.approx(actions["cmd_ms"].to_numpy())
    for name, found in (
        ("want_mL", [a.target and 1e6 * a.target.change for a in log.actions]),
        ("want_ms", [a.target and 1e3 * a.target.seconds for a in log.actions]),
        ("v_from_mbar_s", [a.target and a.target.speed_from / 100.0 for a in log.actions]),
        ("v_to_mbar_s", [a.target and a.target.speed_to / 100.0 for a in log.actions]),
        ("end_mV", [a.after and 1e3 * a.after.voltage for a in log.actions]),
        ("end_uA", [a.after and 1e6 * a.after.current for a in log.actions]),
    ):
        expected = actions[name].to_numpy(dtype=float)
        got = np.array(found, dtype=float)
        assert got == pytest.approx(expected, rel=1e-9, abs=1e-6, nan_ok=True), name
    full = actions["full_time"].notna().to_numpy()
    until = [a.time + a.seconds for a in np.array(log.actions, dtype=object)[full]]
    assert np.array_equal(
        np.minimum(until, seconds(actions["full_time"][full])), until
    )  # the bladder was full
    assert 1000.0 * log.battery_voltage == pytest.approx(dive["vbat_mV"])
    assert log.firmware == dive["firmware"]
    for name in ("near", "far", "dead", "coeff"):
        assert log.settings[name] == dive[f"cmd_{name}"]
    stage0 = log.stages[0]
    said = f"{stage0.pressure / 100:.0f}+/-{stage0.tolerance / 100:.0f}mbar {stage0.duration:.0f}s"
    assert said == dive["stage0"]


def _of(path: Path, key: str) -> pd.DataFrame:
    frame = pd.read_csv(path)
    return frame[frame["log"].str.endswith(key)]


# -- tables ----------------------------------------------------------------------------------------


def test_a_table_of_pressures_and_seconds(tmp_path: Path) -> None:
    path = tmp_path / "dive.csv"
    path.write_text(
        "clock,p [dbar],pump,valve_s,T\n100,0.5,,,20\n160,3,,4.5,19\n220,9,0,0,15\n280,,30,,\n"
        "340,12,,,14\n"
    )
    log = read_float_log(
        path,
        columns={
            "time_s": "clock",
            "pressure_Pa": "p [dbar]",
            "pump_s": "pump",
            "temperature_degC": "T@degC",
        },
    )
    assert log.time.tolist() == [0.0, 60.0, 120.0, 240.0]
    assert log.pressure == pytest.approx([5e3, 3e4, 9e4, 1.2e5])
    assert log.temperature.tolist() == [20.0, 19.0, 15.0, 14.0]
    assert [(a.device, a.time, a.seconds) for a in log.actions] == [
        ("valve", 60.0, 4.5),
        ("pump", 180.0, 30.0),
    ]
    assert set(log.stage.tolist()) == {-2}


def test_rows_without_a_time_are_left_out_and_said(tmp_path: Path) -> None:
    path = tmp_path / "dive.csv"
    path.write_text("time_s,pressure_Pa,pump_s\n0,0,1\n,1e5,7\n60,2e5,\n")
    log = read_float_log(path)
    assert log.time.tolist() == [0.0, 60.0]
    assert [a.seconds for a in log.actions] == [1.0]
    assert "1 row without time dropped" in log.report


def test_the_kind_of_log_is_seen(tmp_path: Path, made_up: Path) -> None:
    assert read_float_log(made_up).name == "999.001-X-0001"
    table = tmp_path / "dive.csv"
    table.write_text("time_s,pressure_Pa,pump_s\n0,0,1\n60,1e5,\n")
    assert len(read_float_log(table)) == 2
    with refused(LogError, field="[PRESS ,0038]"):
        read_float_log(table, log_format="mermaid")


@pytest.mark.parametrize(
    ("text", "says", "field"),
    [
        ("time_s,pump_s\n0,1\n60,\n", "no column pressure_Pa", "pressure_Pa"),
        ("time_s,pressure_Pa\n0,1\n60,2\n", "when pump or valve ran", "pump_s"),
        ("time_s,pressure_Pa,pump_s\n60,1,1\n0,2,\n", "do not increase", "time_s"),
        ("time_s,pressure_Pa,pump_s\n0,101325,1\n60,2e5,\n", "absolute", "pressure_Pa"),
        ("time_s,pressure_Pa,pump_s\n0,1,1\n60,,\n", "fewer than two", "pressure_Pa"),
        (
            "time_s,pressure_Pa,pump_s\n0,1,1\n60,2000,\n",
            "likely in kPa, dbar or bar",
            "pressure_Pa",
        ),
        ("time_s,pressure_Pa,pump_s\n0,1,-3\n60,2e6,\n", "no less than 0 s", "pump_s"),
        (
            "time_s,pressure_Pa,valve_s\n0,1,8e4\n600,2e6,\n",
            "s of runs in a log of 600 s",
            "valve_s",
        ),
    ],
)
def test_tables_that_are_refused(tmp_path: Path, text: str, says: str, field: str) -> None:
    path = tmp_path / "dive.csv"
    path.write_text(text)
    with pytest.raises(LogError, match=says) as caught:
        read_float_log(path)
    assert caught.value.field == field
    assert caught.value.remedy


def test_two_dives_in_one_log_are_told(tmp_path: Path, made_up: Path) -> None:
    path = tmp_path / "dives.csv"
    down = [0.0, 2e6, 4e6, 6e4, 2e6]  # it may come near the surface
    rows = [f"{60 * k},{p},{int(k == 1)}" for k, p in enumerate([*down, 1e2, 1e2, *down, 0.0])]
    path.write_text("\n".join(["time_s,pressure_Pa,pump_s", *rows[:6]]))
    assert len(read_float_log(path)) == 6
    path.write_text("\n".join(["time_s,pressure_Pa,pump_s", *rows]))
    with refused(LogError, field="log", holds={2.0, 480.0}):
        read_float_log(path)
    twice = tmp_path / "twice.LOG"
    twice.write_text(MADE_UP + MADE_UP.replace("2031-03-01T1", "2031-03-02T1"))
    with refused(LogError, field="log", holds={2.0}):
        read_float_log(twice)
    above = [line for line in twice.read_text().splitlines() if "T+21000mdegC" not in line]
    twice.write_text("\n".join(above))  # no pressures at the surface
    with refused(LogError, field="log", holds={2.0}):
        read_float_log(twice)
    assert len(read_float_log(made_up)) == 4


def test_columns_that_are_not_there(tmp_path: Path) -> None:
    path = tmp_path / "dive.csv"
    path.write_text("time_s,pressure_Pa,pump_s\n0,1,1\n60,2,\n")
    with refused(LogError, field="pump_seconds"):
        read_float_log(path, columns={"pump_seconds": "pump_s"})
    with refused(LogError, field="pump_s", value="pump"):
        read_float_log(path, columns={"pump_s": "pump"})
