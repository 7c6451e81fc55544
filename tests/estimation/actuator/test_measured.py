"""Measured motors: a buoyancy engine on a bench, and a stepper in a float's missions."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from swimbladder.estimation.actuator import identify_actuator
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import read_log

pytestmark = pytest.mark.data


def motor_log(data_dir, name):
    return read_log(
        data_dir / "ufloat_motor" / "cycles.parquet",
        columns={"time_s": "t_s", "piston_m": "position_in@in"},
        where={"log": name},
        required=("piston_m",),
    )


def started(time, x0, rate, T1, t0):
    """Eq. (22) after a step at t0, written again."""
    s = np.maximum(time - t0, 0.0)
    return x0 + rate * (s - T1 * (1.0 - np.exp(-s / T1)))


@pytest.mark.parametrize(
    ("name", "noted_T1", "noted_rate"),
    # what others read off the first start of a log, in s and m/s
    [
        ("2017-02-22_224003", 0.021, 5.38e-3),
        ("2017-02-23_012413", 0.014, 2.82e-3),
        ("2016-12-15_201740", 0.04, 1.10e-3),
    ],
)
def test_a_motor_on_a_bench(data_dir, name, noted_T1, noted_rate):
    log = motor_log(data_dir, name)
    found = identify_actuator([log])
    assert found.identified
    assert not any(f.kind == "soft start" for f in found.findings)
    for way in ("out", "in"):
        T1, rate = found.derived[f"T1_{way}"], found.derived[f"rate_{way}"]
        assert T1.ci95[0] < T1.value < T1.ci95[1]
        assert (T1.ci95[1] - T1.ci95[0]) < 0.6 * T1.value
        assert (rate.ci95[1] - rate.ci95[0]) < 0.03 * rate.value
    assert found.derived["T1_out"].value == pytest.approx(noted_T1, rel=0.3)
    assert found.derived["rate_out"].value == pytest.approx(noted_rate, rel=0.05)
    # each outward start by itself, SciPy's least squares with the instant of the start free
    alone = []
    for step in (s for s in found.steps if s.label == "outward"):
        t, x = step.time[: step.start], step.position[: step.start]
        guess = (x[0], step.speed, 0.03, t[0] + 0.05)
        least, most = [-1.0, 0.0, 1e-4, t[0] - 0.1], [1.0, 0.1, 1.0, t[-1]]
        best, _ = curve_fit(started, t, x, guess, x_scale=np.abs(guess), bounds=(least, most))
        alone.append(best[2])
    assert np.median(alone) == pytest.approx(found.derived["T1_out"].value, rel=0.3)


def test_a_stepper_in_missions(data_dir):
    logs = [
        read_log(
            data_dir / "ntnu_bv" / "missions.csv.gz",
            columns={"reference_piston_m": "pid_output_m"},
            where={"log": mission},
            log_format="ntnu-bv",
            required=("piston_m",),
        )
        for mission in (37, 47, 57)
    ]
    found = identify_actuator(logs, load_vehicle("ntnu-bv"))
    assert found.driven == "reference"
    rate = found.parameters["rate"]
    assert rate.value == pytest.approx(2.44e-3, rel=2e-3)  # as the firmware's constants have it
    assert rate.ci95[1] - rate.ci95[0] < 0.02 * rate.value
    assert found.parameters["asymmetry"].value == pytest.approx(1.0, abs=2e-3)
