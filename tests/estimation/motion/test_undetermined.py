"""An interval without an end is a no, in every way of asking."""

import math
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.estimation.actuator import identify_actuator
from swimbladder.estimation.actuator.result import PARAMETERS
from swimbladder.estimation.estimates import Estimate, claims_too_much, undetermined
from swimbladder.estimation.motion import identify
from swimbladder.estimation.motion.diagnose import not_determined
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from tests.estimation.actuator.test_moves import log_of
from tests.estimation.motion.pool import campaign, trace
from tests.estimation.motion.test_closed_loop_logs import FEUP
from tests.estimation.motion.test_problem import problem_of

VEHICLE = load_vehicle("feup-em")
TIME = np.arange(0.0, 120.0, 0.3)


def log(volume, *, noise=0.0, w0=0.0, z0=1.0, **truth):
    depth = trace(TIME, volume, z0=z0, w0=w0, **truth)
    depth = depth + noise * np.random.default_rng(0).normal(size=len(depth))
    n = int(np.argmin((depth > 0.3) & (depth < 60.0))) or len(depth)
    arrays = {"time": TIME[:n], "depth": depth[:n], "volume": volume[:n], "line": np.arange(n)}
    return Log(source="log", volume_absolute=True, **arrays)


def positive(ends, value=2.0):
    return replace(Estimate.of(value, 0.5, "s", logarithmic=True), ci95=ends)


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ((1.0, 3.0), ""),
        ((0.0, 3.0), "no end below"),
        ((1e-2, 3.0), "no end below"),
        ((1.0, math.inf), "no end above"),
        ((0.0, math.inf), "no end on either side"),
        ((math.nan, math.nan), "no end on either side"),
        ((2.1, 3.0), "no end"),
    ],
)
def test_only_an_interval_with_two_ends_around_the_value_is_one(ends, said):
    why = undetermined(positive(ends), (1e-2, 1e6))
    assert (said in why) if said else not why


def test_a_quantity_that_may_be_0_has_an_end_there():
    assert not undetermined(Estimate.of(0.0, 1.0, "m3/m"))
    assert undetermined(Estimate.of(0.0, math.inf, "m3/m"))


def test_parts_per_million_beside_a_residual_that_is_no_noise_are_claimed_not_known():
    sharp = Estimate.of(7900.0, 0.03, "1/m2/s", logarithmic=True)
    assert not undetermined(sharp, misfit=1.2)
    assert "560 times the sensor's noise" in undetermined(sharp, misfit=560.0)
    assert not claims_too_much(1.0, 7900.0, 560.0)


def test_any_parameter_without_an_interval_is_named():
    problem = problem_of(campaign(24)[:1], ("K2", "T2", "psi"))
    known = {
        "K2": Estimate.of(7900.0, 100.0, "1/m2/s", logarithmic=True),
        "T2": Estimate.of(36.0, 1.0, "s", logarithmic=True),
        "psi": Estimate.of(4e-6, math.inf, "m3/m"),
    }
    (finding,) = not_determined(problem, known)
    assert (finding.severity, finding.kind) == ("no", "not identifiable")
    assert finding.sentence.startswith("psi is not identifiable")


GLIDE = {"m": 44.0, "k_dt": 14.0, "psi": 0.0}  # at its last speed from the first sample on


@pytest.mark.parametrize("noise", [0.0, 2e-3])
def test_a_glide_at_a_steady_speed_does_not_give_the_drag(noise):
    steady = log(np.full(len(TIME), -75e-6), noise=noise, w0=0.3, **GLIDE)
    found = identify([steady], VEHICLE, process_noise="never", choices=False)
    assert not found.identified
    assert found.result_vehicle == VEHICLE
    said = [f.sentence for f in found.findings if f.severity == "no"]
    assert any("K2 is not identifiable" in s and "no end" in s for s in said)
    assert found.to_dict()["parameters"]["K2"]["ci95"] is None


@pytest.mark.parametrize("drag", ["quadratic", "blended"])
def test_a_vehicle_that_hardly_moves_gives_nothing_and_no_traceback(drag):
    volume = 1e-8 * np.sign(np.sin(TIME / 7.0))
    still = log(volume, z0=2.0, V0=-2.0 * FEUP["psi"], **FEUP)
    found = identify([still], VEHICLE, process_noise="never", drag=drag, choices=False)
    assert not found.identified
    json = found.to_dict()
    assert all(p["value"] is None for p in json["parameters"].values())


def test_two_logs_of_rates_tenfold_apart_do_not_give_a_rate():
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 60.0, 0.2)
    moves = [
        np.interp(time, [5.0, 5.0 + 0.02 / rate, 45.0, 45.0 + 0.02 / rate], [0.0, 0.02, 0.02, 0.0])
        for rate in (1e-3, 8e-3)
    ]
    logs = [log_of(time, x + 1e-6 * rng.normal(size=len(x))) for x in moves]
    found = identify_actuator(logs, required=["rate"])
    rate = found.parameters["rate"]
    assert not found.identified
    assert "no end below" in rate.why
    assert math.isnan(rate.value)
    assert "rate" in found.refusal
    assert set(found.covariance) <= set(PARAMETERS) - {"rate"}


def test_a_psi_that_takes_a_halocline_needs_the_water():
    """The vehicle gains 30 cm3 a metre down: more than a kg/m3 a metre."""
    volume = 40e-6 * np.sign(np.sin(TIME / 9.0))
    steep = {**FEUP, "psi": -3e-5}
    deep = log(volume, z0=3.0, V0=-3.0 * steep["psi"], noise=2e-3, **steep)
    quick = {"process_noise": "never", "choices": False, "profiles": False}
    found = identify([deep], VEHICLE, neutral_std=math.inf, **quick)
    assert [f.kind for f in found.findings if f.severity == "no"] == ["stratified"]
    assert "kg/m3 denser a metre down" in " ".join(f.sentence for f in found.findings)
    known = identify([deep], VEHICLE, neutral_std=math.inf, priors={"psi": (-3e-5, 1e-5)}, **quick)
    assert known.identified
