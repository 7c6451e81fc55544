"""The exact motion under held voltages: against eq. (22) written out, and against SciPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.benches import Motor, steps, travel
from swimbladder.estimation.actuator.model import Drive, respond, steady_speed


def drive(motor):
    return Drive(motor.K_out, motor.K_in, motor.T1, motor.dead_zone, motor.load, motor.rate)


def test_a_step_without_friction_is_eq_22():
    K1, T1, u = 0.444e-3, 0.09, 12.0
    time = np.linspace(0.0, 2.0, 41)
    x, v = respond(time, np.full(41, u), Drive(K1, K1, T1, 0.0, 0.0))
    assert v == pytest.approx(K1 * u * (1.0 - np.exp(-time / T1)), rel=1e-12, abs=1e-18)
    assert x == pytest.approx(K1 * u * (time - T1 * (1.0 - np.exp(-time / T1))), rel=1e-12)


@given(
    seed=st.integers(0, 10_000),
    dead=st.sampled_from([0.0, 0.5, 2.0]),
    load=st.sampled_from([0.0, 0.3, -3.0]),
    rate=st.sampled_from([np.inf, 2e-3]),
)
def test_any_voltages_agree_with_scipy(seed, dead, load, rate):
    random = np.random.default_rng(seed)
    motor = Motor(T1=float(10.0 ** random.uniform(-2, 0)), dead_zone=dead, load=load, rate=rate)
    time = np.cumsum(random.uniform(0.01, 0.1, 40))
    voltage = np.repeat(random.choice([-9.0, -1.0, 0.0, 0.4, 6.0], 8), 5)
    ours, _ = respond(time, voltage, drive(motor))
    assert ours == pytest.approx(travel(motor, time, voltage), abs=2e-9)


def test_it_stops_where_friction_stops_it_and_stays():
    motor = Motor(dead_zone=1.0, load=0.0)
    time, voltage = steps([6.0], hold=1.0, rest=2.0, step=0.05)
    x, v = respond(time, voltage, drive(motor))
    # from v0 under u = 0 it stands after T1 ln(1 + v0/(K d)), eq. (22) with friction against it
    v0 = motor.K_out * 5.0
    after = motor.T1 * np.log1p(v0 / (motor.K_out * 1.0))
    stands = time > 3.0 + after
    assert np.all(v[stands] == 0.0)
    assert np.all(x[stands] == x[-1])
    assert v[(time > 3.0 + 1e-9) & ~stands].min() > 0.0


def test_the_steady_speed_is_what_a_lasting_voltage_reaches():
    motor = Motor(rate=3e-3)
    for u in (-12.0, -3.0, -0.2, 0.3, 0.7, 5.0, 12.0):
        _, v = respond(np.array([0.0, 60.0]), np.full(2, u), drive(motor))
        assert v[-1] == pytest.approx(steady_speed(u, drive(motor)), abs=1e-15)


def test_a_run_may_begin_in_motion():
    K1, T1 = 1e-3, 0.2
    time = np.array([0.0, 0.1, 0.4])
    x, v = respond(time, np.zeros(3), Drive(K1, K1, T1, 0.0, 0.0), first_speed=2e-3)
    assert v == pytest.approx(2e-3 * np.exp(-time / T1), rel=1e-12)
    assert x == pytest.approx(2e-3 * T1 * (1.0 - np.exp(-time / T1)), rel=1e-12)
