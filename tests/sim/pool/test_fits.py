"""K2 and T2 from records: against SciPy, closed forms, and independently computed numbers."""

# ruff: noqa: SIM300 - K2 and T2 are not constants

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.errors import NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.sim import pool
from swimbladder.sim.pool import Record
from tests.examples import examples

K2, T2, PSI = 7935.54, 36.3, 4.04e-6
STEPS = (20e-6, 30e-6, 45e-6, 75e-6)


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("feup-em")


@pytest.fixture(scope="module")
def still(vehicle):
    return pool.still_starts(vehicle, dVs=[s * dV for dV in STEPS for s in (1.0, -1.0)])


def travel(t, dV, psi=PSI):
    """Travel from rest under a constant volume above neutral: two exponentials about dV/psi."""
    fast, slow = sorted(np.roots([T2, 1.0, -psi * K2]).real)
    return dV / psi * (1.0 + (slow * np.exp(fast * t) - fast * np.exp(slow * t)) / (fast - slow))


@given(
    st.floats(500.0, 5e4),
    st.floats(1.0, 200.0),
    st.sampled_from([0.0, 4.04e-6, 1e-9, -1e-7, -4.04e-6, -1e-3]),
    st.integers(0, 2**32 - 1),
)
@examples(30)
def test_response_is_that_of_the_differential_equation(gain, lag, psi, seed):
    random = np.random.default_rng(seed)
    h = 0.3
    time = np.arange(60) * h
    volume = 1e-4 * random.uniform(-1.0, 1.0, 60)

    def rates(t, x):
        return [x[1], (-x[1] + psi * gain * x[0] - gain * np.interp(t, time, volume)) / lag]

    z, w = pool.response(time, volume, K2=gain, T2=lag, psi=psi)
    x, by_scipy = np.zeros(2), [np.zeros(2)]
    for k in range(59):  # a kink at every sample
        x = solve_ivp(rates, (time[k], time[k + 1]), x, rtol=1e-10, atol=1e-14).y[:, -1]
        by_scipy.append(x)
    by_scipy = np.array(by_scipy)
    assert z == pytest.approx(by_scipy[:, 0], abs=1e-8 * np.abs(by_scipy[:, 0]).max())
    assert w == pytest.approx(by_scipy[:, 1], abs=1e-8 * np.abs(by_scipy[:, 1]).max())


def test_response_is_continuous_where_its_formula_changes():
    """Near psi = 0 the slow pole's exponential is summed, elsewhere it is divided by the pole."""
    time, volume = np.arange(100) * 0.3, np.full(100, 3e-5)
    for psi in (1e-3 / 0.3 / K2 * 0.999, 1e-3 / 0.3 / K2 * 1.001):  # either side of |x| = 1e-3
        z, _ = pool.response(time, volume, K2=K2, T2=T2, psi=psi)
        assert z == pytest.approx(travel(time, 3e-5, psi), abs=1e-11)


def test_still_starts_are_the_closed_form(still):
    for record, dV in zip(still, [s * dV for dV in STEPS for s in (1.0, -1.0)], strict=True):
        assert record.depth - record.start == pytest.approx(travel(record.time, dV), abs=1e-10)
        assert abs(record.depth[-1] - record.start) <= 3.0
        assert abs(travel(record.time[-1] + 0.3, dV)) > 3.0  # no sample is missing
        assert np.all(record.volume == dV)
        assert np.sign(record.depth[-1] - record.start) == -np.sign(dV)  # more volume rises


def test_still_starts_that_do_not_get_there(vehicle):
    with pytest.raises(NoAnswerError, match=r"1 cm3 .* 3 m in 10 s: give a larger volume"):
        pool.still_starts(vehicle, dVs=[1e-6], longest=10.0)


def test_leaving_out_psi_gives_the_independent_numbers(still):
    """Independent least squares on the printed numbers: K2 14350, T2 69 s, 7 mm; 13076, 62.5 s."""
    joint = pool.fit_jointly(still)
    assert joint.K2 == pytest.approx(14350.0, abs=10.0)
    assert joint.T2 == pytest.approx(69.0, abs=0.5)
    assert joint.rms == pytest.approx(7e-3, abs=0.5e-3)
    each = [pool.fit_depth(record) for record in still]
    mean = pool.average(each)
    assert mean.K2 == pytest.approx(13076.0, abs=1.0)
    assert mean.T2 == pytest.approx(62.5, abs=0.05)
    by_size = [fit.K2 for fit in each[::2]]
    assert by_size == sorted(by_size, reverse=True)
    assert by_size[0] == pytest.approx(16300.0, abs=50.0)
    assert by_size[-1] == pytest.approx(10600.0, abs=50.0)


def test_leaving_out_psi_keeps_the_ratio(still):
    """K2/T2 = rho g/m: with it the mass, 44.9 kg."""
    joint = pool.fit_jointly(still)
    assert 9806.65 * joint.T2 / joint.K2 == pytest.approx(44.9, rel=0.06)
    assert K2 / T2 == pytest.approx(9806.65 / 44.9, rel=1e-3)


def test_with_psi_known_the_truth_is_found(still):
    joint = pool.fit_jointly(still, psi=PSI)
    assert joint.K2 == pytest.approx(K2, rel=1e-9)
    assert joint.T2 == pytest.approx(T2, rel=1e-9)
    assert joint.rms < 1e-10


@given(st.floats(2e3, 4e4), st.floats(10.0, 100.0), st.sampled_from([0.0, 2e-6, -2e-6]))
@examples(25)
@example(37412.0, 10.0, 2e-6)  # the first step leads to where the depths overflow
@example(35636.0, 10.0, 2e-6)
def test_a_fit_finds_what_made_the_record(gain, lag, psi):
    time = np.arange(150) * 0.3
    volume = np.where(time < 2.0, 15e-6 * time, 30e-6)
    z, _ = pool.response(time, volume, K2=gain, T2=lag, psi=psi)
    fit = pool.fit_depth(Record(time, 2.0 + z, volume, 2.0), psi=psi)
    assert fit.K2 == pytest.approx(gain, rel=1e-5)
    assert fit.T2 == pytest.approx(lag, rel=1e-5)


def test_the_speed_fit_finds_it_too_as_differences_get_finer():
    errors = []
    for h in (0.4, 0.2, 0.1):
        time = np.arange(round(40.0 / h)) * h
        volume = np.full(len(time), 30e-6)
        z, _ = pool.response(time, volume, K2=K2, T2=T2)
        errors.append(abs(pool.fit_speed(Record(time, z, volume, 0.0)).K2 / K2 - 1.0))
    assert errors[0] < 0.02
    # the one-sided difference at either end is what is left: its error falls with h
    assert math.log2(errors[0] / errors[2]) > 1.5


def test_average_is_the_mean_of_each():
    fits = [pool.Fit(1.0, 10.0, 0.1), pool.Fit(3.0, 30.0, 0.3)]
    assert pool.average(fits) == pytest.approx(pool.Fit(2.0, 20.0, 0.2))
