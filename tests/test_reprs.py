"""What is read and asked prints itself in a few lines, whatever arrays it holds."""

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.io.float_log import FloatLog
from swimbladder.physics.seawater import Cast

# 44.86 kg: m = rho g T2/K2 = 9806.65 * 36.3/7935.54, eqs (28) and (29)
VEHICLE = """Vehicle 'feup-em'
  Electromechanical prototype of Falcao Carneiro et al. 2023, as identified in a 4.5 m pool
  actuator: identified, -350 to 350 cm3
  hull: 27.5 L, psi 4.04 cm3/m, rated for 100 m
  motion: 44.86 kg accelerated, linear drag
  controller: cascade, every 0.3 s"""
PARK = {"kind": "park", "depth": 40.0, "tolerance": 5.0, "duration": 1800.0}
MISSION = sb.Mission(phases=[PARK, {"kind": "surface", "duration": 60.0}], cycles=3, name="short")


def log(folder):
    rows = "\n".join(f"{t},{1 + 0.01 * t},{20 - t}" for t in range(12))
    (folder / "log.csv").write_text("time_s,depth_m,temperature_degC\n" + rows + "\n")
    return sb.read_log(folder / "log.csv")


def cast(_):
    p = np.linspace(0.0, 100.0, 51)
    return Cast(pressure=p, SA=35.0 + 0.0 * p, CT=10.0 - 0.01 * p, name="a cast")


def float_log(_):
    some = np.arange(4.0)
    given = {"time": some, "pressure": some, "temperature": some, "stage": some.astype(int)}
    return FloatLog(source="x.json", name="p0051", actions=(), **given)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda _: sb.load_vehicle("feup-em"), VEHICLE),
        (lambda _: MISSION, "Mission('short': park (40 m), surface (0 m), 3 cycles)"),
        (log, "samples in 11 s, depth, temperature)"),
        (cast, "Cast('a cast': 51 rows, 0 to 100 dbar)"),
        (lambda _: sb.cast_column(cast(_)), "depths to 99 m)"),
        (float_log, "FloatLog('x.json': p0051, 4 pressures, 0 actions)"),
        (
            lambda _: sb.mission(sb.load_vehicle("example-float"), MISSION).flight,
            "Flight('example-float', 'short': 3 cycles, ",
        ),
    ],
)
def test_it_is_short_and_says_what_it_is(made, words, tmp_path):
    shown = repr(made(tmp_path))
    assert words in shown
    assert len(shown.splitlines()) <= 15
    assert max(map(len, shown.splitlines())) <= 200


def test_a_long_mission_is_cut():
    task = sb.Mission(
        start_depth=1.0,
        duration=900.0,
        setpoints=[{"time": 100.0 * k, "depth": 1.0 + k} for k in range(9)],
    )
    assert str(task).endswith("6 m at 500 s, 3 more)")
