"""Moves at full speed, their voltage not logged: simulated by SciPy, and of a positioner."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from studies.actuator import score
from studies.benches import Motor, log_of, measured, random_motor, random_moves, soft_moves, travel
from swimbladder.errors import InputError, LogError, NoAnswerError
from swimbladder.estimation.actuator import identify_actuator
from swimbladder.io.config import load_vehicle
from tests.quoted import refused

MOTOR = Motor(T1=0.05)
OUT = MOTOR.K_out * (12.0 - MOTOR.dead_zone - MOTOR.load)
IN = MOTOR.K_in * (12.0 - MOTOR.dead_zone + MOTOR.load)


@pytest.mark.prove
@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        "moves",
        pytest.param("moves, speeds differ by 1 %", marks=pytest.mark.prove),
        pytest.param("moves, 10 % outliers", marks=pytest.mark.prove),
    ],
)
def test_intervals_hold_the_truth_as_often_as_they_say(case):
    scores = score(case, 8, seed=21)
    assert all(s.significant >= 7 for s in scores.values())
    told, held = sum(s.significant for s in scores.values()), sum(s.held for s in scores.values())
    assert binomtest(held, told, 0.95, alternative="less").pvalue > 0.001, scores


def test_rate_and_time_constant_without_a_voltage():
    log = random_moves(np.random.default_rng(4), MOTOR)
    found = identify_actuator([log])
    assert found.driven == "nothing"
    assert found.identified
    for name in ("K1", "dead_zone", "load_voltage"):
        assert not found.parameters[name].known
        assert "not in the log" in found.parameters[name].why
    for name, value in {"T1_out": 0.05, "rate_out": OUT, "rate_in": IN}.items():
        e = found.derived[name]
        assert abs(e.value - value) < 4.0 * e.std, name
    assert found.parameters["asymmetry"].value == pytest.approx(OUT / IN, rel=0.01)
    assert found.parameters["rate"].value == pytest.approx(np.sqrt(OUT * IN), rel=0.01)
    assert len(found.steps) >= 6
    assert all(step.start > 0 for step in found.steps)


@pytest.mark.parametrize(("period", "size"), [(200.0, 0.01), (400.0, 0.02)])
def test_a_piston_that_swings_slowly_has_no_time_constant(period, size):
    """No move comes to full speed; a tenth of a million seconds fitted best, "known to 37 %"."""
    time = np.arange(0.0, 400.0, 0.5)
    found = identify_actuator([log_of(time, size * np.sin(2.0 * np.pi * time / period))])
    assert "too short to show" in found.parameters["T1"].why
    for step in found.steps:
        assert np.array_equal(step.time, np.unique(step.time))


def test_one_direction_only():
    log = random_moves(np.random.default_rng(4), MOTOR)
    end = int(np.argmin(np.diff(log.piston) > -0.5 * OUT * (log.time[1] - log.time[0]))) - 2
    found = identify_actuator([log_of(log.time[:end], log.piston[:end])])
    assert "rate_in" not in found.derived
    assert "outward only" in found.parameters["asymmetry"].why
    assert found.parameters["rate"].value == pytest.approx(OUT, rel=0.01)


def test_a_start_within_a_sample_bounds_the_time_constant():
    time = np.arange(0.0, 60.0, 0.5)
    position = np.interp(time, [5.3, 25.3, 40.2, 50.2], [0.0, 0.05, 0.05, 0.025])
    seen = measured(position, np.random.default_rng(1), noise=2e-5)
    found = identify_actuator([log_of(time, seen)])
    T1 = found.parameters["T1"]
    assert not T1.known
    assert T1.ci95[0] == 0.0
    assert T1.ci95[1] < 0.5
    assert "T1" in found.refusal
    low, high = found.derived["rate_out"].ci95
    assert low < 2.5e-3 < high


def test_nothing_can_be_set_and_rest_tells_nothing():
    log = random_moves(np.random.default_rng(4), MOTOR)
    with refused(InputError, field="fixed", value="T1"):
        identify_actuator([log], fixed={"T1": 0.1})
    still = log_of(log.time, measured(0.0 * log.time, np.random.default_rng(1), noise=1e-5))
    with pytest.raises(NoAnswerError, match="No move at full speed"):
        identify_actuator([still])


def positioner(speed, *, seed=1, step=0.5, stop=0.02):
    """A stepper that goes to where it was told at its speed, cut at an end stop."""
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.9, 1.1, 400)) * step
    reference = np.repeat(random.choice([-0.03, -0.01, 0.0, 0.005, 0.015, 0.03], 20), 20)
    position = np.zeros(400)
    for k in range(399):
        way = np.clip(reference[k] - position[k], -1.0, 1.0)
        most = speed * (time[k + 1] - time[k])
        position[k + 1] = np.clip(position[k] + np.clip(way, -most, most), -stop, stop)
    seen = measured(position, random, noise=1e-5, quantum=1e-5)
    return log_of(time, seen, reference_piston=reference)


def test_a_positioner_is_judged_where_it_is_asked_for_more_than_it_can():
    found = identify_actuator([positioner(2.5e-3)], load_vehicle("ntnu-bv"))
    assert found.driven == "reference"
    assert found.asked == ("rate",)
    assert found.identified
    for name in ("rate_out", "rate_in"):
        low, high = found.derived[name].ci95
        assert low < 2.5e-3 < high
        assert (high - low) < 0.01 * 2.5e-3
    assert found.vehicle.actuator.speed == found.parameters["rate"].value
    assert found.vehicle.provenance["actuator.speed"].startswith("identified from bench.csv")


def test_moves_of_logs_that_differ():
    logs = [
        random_moves(np.random.default_rng(k), MOTOR._replace(K_out=f * MOTOR.K_out))
        for k, f in enumerate((1.0, 1.3))
    ]
    found = identify_actuator(logs)
    (said,) = [f for f in found.findings if f.kind == "logs differ"]
    assert "rate_out" in said.sentence
    assert said.severity == "warning"
    assert found.logs[0].parameters["rate_out"].value == pytest.approx(OUT, rel=0.01)


def ramps(log):
    return [f for f in identify_actuator([log]).findings if f.kind == "soft start"]


@pytest.mark.parametrize(
    ("ramp", "T1", "noise"), [(0.3, 0.0, 2e-6), (0.3, 0.03, 2e-6), (0.1, 0.02, 5e-6)]
)
def test_a_soft_start_is_said_not_to_be_a_time_constant(ramp, T1, noise):
    (said,) = ramps(soft_moves(np.random.default_rng(1), ramp=ramp, T1=T1, noise=noise))
    assert said.severity == "warning"
    assert "outward and inward start along a straight ramp" in said.sentence
    assert "T1 is then the ramp's" in said.sentence


def test_a_time_constant_that_is_a_ramps_is_not_identified():
    found = identify_actuator([soft_moves(np.random.default_rng(1), ramp=0.3)])
    assert not found.identified
    assert not found.parameters["T1"].known
    assert found.parameters["rate"].value == pytest.approx(5e-3, rel=1e-3)


def test_the_ramp_is_as_long_as_it_is():
    (said,) = ramps(soft_moves(np.random.default_rng(1), ramp=0.3, noise=1e-7))
    assert "ramp of 0.3 s" in said.sentence


def test_moves_that_lose_half_of_their_speed_have_no_one_rate():
    """The rate was given with exit code 0, and a note that 48 or 214 % of the speed were lost."""
    time = np.arange(0.0, 48.0, 0.05)
    since = np.clip(time % 12.0 - 2.0, 0.0, 8.0)
    gone = 2e-3 * (since - since**2 / 32.0)
    position = np.where(time % 24.0 < 12.0, gone, gone[time < 12.0][-1] - gone)
    random = np.random.default_rng(1)
    found = identify_actuator([log_of(time, measured(position, random, noise=1e-6))])
    assert not found.identified
    (said,) = [f for f in found.findings if f.kind == "load"]
    assert said.severity == "no"
    assert "of its speed" in said.sentence
    assert "supply and end stops" in said.sentence


@pytest.mark.parametrize("count", [3, pytest.param(100, marks=pytest.mark.prove)])
def test_intervals_of_logs_without_noise_hold_the_truth(count):
    """T1 was "known" to 1e-7, its error was 1e-6."""
    for k in range(count):
        random = np.random.default_rng([8, k])
        motor = random_motor(random)
        time = np.arange(0.0, 40.0, 0.05)
        begins = random.uniform(2.0, 2.05) + np.arange(6) * 6.0
        fine = np.unique(np.concatenate([time, begins, begins + 3.0]))
        voltage = np.zeros(len(fine))
        for j, begin in enumerate(begins):
            voltage[(fine >= begin) & (fine < begin + 3.0)] = (-1.0) ** j * 12.0
        position = travel(motor, fine, voltage)[np.searchsorted(fine, time)]
        found = identify_actuator([log_of(time, position)])
        for name in ("T1", "rate"):
            e = found.parameters[name]
            assert not e.known or e.std >= 1e-4 * e.value
        low, high = found.parameters["T1"].ci95
        assert low <= motor.T1 <= high, k


@pytest.mark.prove
def test_a_motor_alone_is_not_taken_for_a_soft_start():
    for k in range(25):
        random = np.random.default_rng([9, k])
        assert not ramps(random_moves(random, random_motor(random), outliers=0.1 * (k % 2)))


@pytest.mark.parametrize(
    ("time", "position", "name"), [(1e3, 1.0, "T1"), (1.0, 1e3, "rate"), (1e-3, 1.0, "T1")]
)
def test_what_no_actuator_does_is_no_answer(time, position, name):
    """Milliseconds read as seconds gave T1 = 90 s, millimetres as metres 5 m/s: exit code 0."""
    log = random_moves(np.random.default_rng(4), MOTOR)
    found = identify_actuator([log_of(time * log.time, position * log.piston)])
    assert not found.identified
    assert any(f.kind == "impossible" and name in f.sentence for f in found.findings)
    vehicle = load_vehicle("feup-em")
    with refused(LogError, field="piston_m"):
        identify_actuator([log_of(log.time, 1e3 * log.piston)], vehicle)


@pytest.mark.parametrize(
    ("time", "position", "times"), [(1e3, 1.0, 1e-3), (1 / 60, 1.0, 60.0), (1.0, 1 / 25.4, 0.04)]
)
def test_a_speed_far_from_that_of_the_file_is_in_another_unit(time, position, times):
    """Milliseconds, minutes and inches: speeds that some actuator has, known to a percent."""
    vehicle = load_vehicle("ntnu-bv")
    log = positioner(vehicle.actuator.speed)
    assert identify_actuator([log], vehicle).identified
    x, asked = position * log.piston, position * log.reference_piston
    spoilt = replace(log, time=time * log.time, piston=x, reference_piston=asked)
    found = identify_actuator([spoilt], vehicle)
    assert not found.identified
    (said,) = [f.sentence for f in found.findings if f.kind == "impossible"]
    assert float(said.split(" is ")[1].split(" times ")[0]) == pytest.approx(times, rel=0.02)
