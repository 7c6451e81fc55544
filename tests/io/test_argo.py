"""Tables of an Argo float's packets: made-up ones row by row, real ones by what they must hold."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from swimbladder.errors import LogError
from swimbladder.io.float_logs import read_float_log

ACTIONS = """\
mission_day0,cycle,time_utc,time_s_since_day0,action,pressure_dbar,duration_s
2031-05-01,4,2031-05-02T00:10:00Z,87000,valve,120,0.31
2031-05-01,4,2031-05-02T01:30:00Z,91800,valve,402,0.20
2031-05-01,4,2031-05-03T06:00:00Z,194400,pump,500,11.2
2031-05-01,4,2031-05-03T06:22:00Z,195720,pump,381,11.2
2031-05-01,5,2031-05-06T00:10:00Z,432600,valve,130,0.31
2031-05-01,5,2031-05-08T06:00:00Z,626400,pump,505,11.2
"""
READINGS = """\
mission_day0,cycle,phase,packet_time_s_since_day0,index_in_packet,pressure_dbar,temperature_degC
2031-05-01,4,drift,120000,0,498.3,3.1
2031-05-01,4,ascent,194700,0,470.1,3.3
2031-05-01,4,ascent,194700,1,462.8,3.4
2031-05-01,4,in_air,199000,0,0.2,9.1
2031-05-01,5,ascent,626700,0,475.0,3.3
"""


@pytest.fixture
def tables(tmp_path) -> Path:
    (tmp_path / "it_ctd.csv").write_text(READINGS)
    path = tmp_path / "it_actions.csv"
    path.write_text(ACTIONS)
    return path


def test_a_cycle_is_its_actions_and_the_readings_that_have_a_time(tables) -> None:
    log = read_float_log(tables, where={"cycle": "4"})
    assert log.name == "cycle 4"
    begin = 87000.0
    assert log.time + begin == pytest.approx([87000, 91800, 120000, 194400, 194700, 195720])
    assert log.pressure == pytest.approx(1e4 * np.array([120, 402, 498.3, 500, 470.1, 381]))
    assert log.time_step.tolist() == [60, 60, 1, 60, 1, 60]
    assert log.pressure_step.tolist() == [1e4, 1e4, 1e3, 1e4, 1e3, 1e4]
    assert [(a.device, a.time + begin, a.seconds) for a in log.actions] == [
        ("valve", 87000.0, 0.31),
        ("valve", 91800.0, 0.2),
        ("pump", 194400.0, 11.2),
        ("pump", 195720.0, 11.2),
    ]
    assert log.report == ("4 of 6 rows chosen", "2 pressures read from it_ctd.csv too")


def test_it_may_be_packed_and_alone(tables) -> None:
    packed = tables.with_name("other_actions.csv.gz")
    packed.write_bytes(gzip.compress(ACTIONS.encode()))
    log = read_float_log(packed, where={"cycle": "5"})
    assert len(log) == 2
    assert log.report[-1] == (
        "no table of CTD readings beside it (other_ctd.csv.gz): only those of actions"
    )


@pytest.mark.parametrize(
    ("change", "where", "says"),
    [
        (("", ""), {}, "the file holds 2 cycles: 4, 5. Choose one dive: `where={'cycle': '4'}`;"),
        (("500,11.2", "500,-1"), {"cycle": "4"}, "line 4, duration_s: no action has this"),
        (("500,11.2", ",11.2"), {"cycle": "4"}, "line 4, pressure_dbar: no action has this"),
        ((",valve,", ",7,"), {"cycle": "4"}, "no such action"),
        (("01,4,2031-05-02T00", "01,,2031-05-02T00"), {"action": "valve"}, "cycle: no action"),
        (("cycle", "Cycle"), {}, "cycle: no such column (got 'cycle')"),
        (("2031-05-01,5", "2031-06-01,4"), {"cycle": "4"}, "holds 2 deployments: 2031-05-01"),
        ((",pump,500", ",bleed,500"), {"cycle": "4"}, "line 4, action: no such action (got 'bleed"),
        ((",11.2", ",eleven"), {"cycle": "4"}, "line 4, duration_s: not a number"),
        (("", ""), {"cycle": "9"}, "none of 6 rows is chosen"),
    ],
)
def test_what_is_no_dive_is_refused(tables, change, where, says: str) -> None:
    tables.write_text(ACTIONS.replace(*change) if change[0] else ACTIONS)
    with pytest.raises(LogError) as refused:
        read_float_log(tables, where=where, log_format="argo")
    assert says in str(refused.value)


def test_real_tables_hold_every_action(data_dir) -> None:
    """The deep float's own counts agree with its packets, but for the run at the surface."""
    folder = data_dir / "argo_arvor"
    cycles = np.genfromtxt(folder / "deep_4000_cycles.csv", delimiter=",", names=True, dtype=None)
    assert len(cycles) == 10
    for row in cycles:
        log = read_float_log(
            folder / "deep_4000_actions.csv.gz", where={"cycle": str(row["cycle"])}
        )
        counts = {
            device: sum(int(row[name]) for name in row.dtype.names if name.startswith(device))
            for device in ("pump_actions", "valve_actions")
        }
        below = [name for name in row.dtype.names if name == "valve_actions_surface"]
        valves = counts["valve_actions"] - int(row[below[0]])
        assert len(log.of("valve")) == valves
        assert len(log.of("pump")) == pytest.approx(counts["pump_actions"] + 1, abs=2)
        assert 3900e4 < log.pressure.max() < 4100e4
        assert (np.diff(log.time) >= 0.0).all()
