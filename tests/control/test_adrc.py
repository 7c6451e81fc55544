"""Active disturbance rejection: its observer against theory and SciPy, the loop against the sea."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.control.adrc import ADRC, AdrcState, adrc_gains, initial, observe, step
from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.law import Measurement, numbers
from swimbladder.design.linear import BoundLaw, SampledLoop, linearise, linearise_law, loop_margins
from swimbladder.physics.dynamics import State, motor_rhs
from swimbladder.sim.closed_loop import simulate, step_metrics
from tests.control.examples import ADRC_FAST, PLANT, S_P, blind, by_hand
from tests.oracle import TABLE_3
from tests.vehicles import paper

# vehicles and missions that no user could mean
fly_anything = partial(simulate, checked=False)

HAN = ADRC_FAST._replace(drag=0.0, psi=0.0, gains=adrc_gains(0.2, 1.2, S_P))
NOWHERE = initial(ADRC_FAST, Measurement(0.0, 2.0, 0.0), 2.0)


def error_map(p) -> np.ndarray:
    """How an error of the estimates goes over a sample, the truth being at rest at 0."""
    columns = []
    for d in 1e-3 * np.eye(3):
        before = NOWHERE._replace(depth=d[0], speed=d[1], disturbance=d[2], volume=0.0)
        columns.append(np.array(observe(p, before, 0.0, 0.0)) / 1e-3)
    return np.array(columns).T


@given(wide=st.floats(0.05, 8.0), slow=st.floats(0.01, 8.0), S_p=st.floats(0.05, 1.0))
def test_the_observers_poles_are_where_they_were_asked_to_be(wide, slow, S_p) -> None:
    p = HAN._replace(gains=adrc_gains(0.2, wide, S_p, slow), S_p=S_p, volume_max=1.0)
    p = p._replace(volume_min=-1.0)
    asked = np.poly([math.exp(-wide * S_p)] * 2 + [math.exp(-slow * S_p)])
    np.testing.assert_allclose(np.poly(error_map(p)), asked, atol=1e-9)


def test_one_bandwidth_gives_the_published_gains() -> None:
    """Miklosovic, Radke and Gao 2006, current observer, third order: 1 - b^3 and so on."""
    beta = math.exp(-1.2 * S_P)
    g = adrc_gains(0.2, 1.2, S_P)
    assert g.l_z == pytest.approx(1.0 - beta**3, rel=1e-12)
    assert g.l_w == pytest.approx(1.5 * (1.0 - beta) ** 2 * (1.0 + beta) / S_P, rel=1e-12)
    assert g.l_f == pytest.approx((1.0 - beta) ** 3 / S_P**2, rel=1e-12)
    assert (g.k_p, g.k_d) == pytest.approx((0.04, 0.4))


def test_the_observer_finds_what_accelerates_the_vehicle() -> None:
    """SciPy: a volume that comes and goes, and 3e-4 m/s2 from nowhere, without drag and psi."""
    f, b = 3e-4, HAN.b

    def volume(t):
        return 2e-6 * math.sin(0.3 * t)

    times = np.arange(200) * S_P
    truth = solve_ivp(
        lambda t, y: [y[1], f - b * volume(t)],
        (0.0, times[-1]),
        [5.0, 0.01],
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
    ).y
    state: AdrcState = initial(HAN, Measurement(0.0, 5.0, 0.0), 5.0)
    for k, t in enumerate(times):
        seen = observe(HAN, state, volume(t), truth[0, k])
        state = state._replace(**seen._asdict(), volume=volume(t))
    assert state.depth == pytest.approx(truth[0, -1], abs=1e-5)
    assert state.speed == pytest.approx(truth[1, -1], abs=2e-5)
    assert state.disturbance == pytest.approx(f, abs=1e-5)


STEP = dict(setpoints=[(0.0, 3.0)], start_depth=1.5, duration=300.0)


def flown(p=ADRC_FAST, vehicle=None, **run):
    return fly_anything(vehicle or paper(), law=ADRC, parameters=p, sample_time=S_P, **STEP | run)


def metrics(ran, start=1.5, target=3.0):
    return step_metrics(ran.time, ran.depth, start=start, target=target)


@pytest.fixture(scope="module")
def nominal():
    return flown()


def test_a_step(nominal) -> None:
    found = metrics(nominal)
    assert found.overshoot_pct < 0.5
    assert found.settle2_s < 16.5
    assert np.max(np.abs(nominal.depth[-100:] - 3.0)) < 1e-3


def test_against_scipy(nominal) -> None:
    """The same step, the plant integrated by SciPy and the law called from Python."""
    x, state, found = np.array([0.0, 4.04e-6 * 1.5, 1.5, 0.0]), None, []
    for k in range(100):
        found.append(x[2])
        seen = Measurement(k * S_P, x[2], x[1])
        state = state or initial(ADRC_FAST, seen, 3.0)
        u, state, _ = step(ADRC_FAST, state, seen, 3.0)
        x = solve_ivp(
            lambda _, y, u=u: motor_rhs(State(*y), u, PLANT), (0.0, S_P), x, rtol=1e-10, atol=1e-13
        ).y[:, -1]
    np.testing.assert_allclose(nominal.depth[:100], found, rtol=0, atol=1e-6)


def test_as_han_has_it_drag_and_compressibility_are_found_out() -> None:
    """Without drag and psi: they count as disturbance, which takes more overshoot to learn."""
    ran = flown(HAN)
    assert metrics(ran).overshoot_pct < 3.0
    assert np.max(np.abs(ran.depth[-100:] - 3.0)) < 1e-3


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_b_need_not_be_known_well(factor) -> None:
    """A third off, with a jerk that the motor can follow all the same."""
    ran = flown(ADRC_FAST._replace(b=ADRC_FAST.b * factor, jerk=0.0045))
    assert metrics(ran).overshoot_pct < 10.0
    assert abs(ran.depth[-1] - 3.0) < 0.01


def test_a_trim_that_nobody_told_is_found_and_balanced() -> None:
    """60 cm3 heavier than thought: the disturbance is b times that, and the depth comes back."""
    ran, calls = by_hand(
        ADRC,
        ADRC_FAST,
        lambda _, seen: seen,
        vehicle=paper(trim_error=6e-5),
        start_depth=20.0,
        start_volume=4.04e-6 * 20.0,
        setpoints=[(0.0, 20.0)],
        duration=300.0,
    )
    assert calls.states[-1].disturbance == pytest.approx(ADRC_FAST.b * 6e-5, rel=0.01)
    assert np.max(np.abs(ran.depth - 20.0)) < 0.5
    assert abs(ran.depth[-1] - 20.0) < 0.01


def test_a_reference_below_the_bottom_does_not_wind_it_up() -> None:
    """An hour on the bottom, then up to 1.5 m: the time until it is within 5 cm of it."""

    def late(law, p):
        ran = fly_anything(
            paper(),
            law=law,
            parameters=p,
            sample_time=S_P,
            bottom_depth=3.0,
            start_depth=2.5,
            setpoints=[(0.0, 4.0), (3600.0, 1.5)],
            duration=7200.0,
        )
        return ran.time[np.flatnonzero(np.abs(ran.depth - 1.5) > 0.05)[-1]] - 3600.0

    assert late(CASCADE, CascadeParameters(**TABLE_3)) > 2000.0
    assert late(ADRC, ADRC_FAST) < 200.0


@given(z=st.lists(st.floats(-1.0, 100.0), min_size=2, max_size=40), reference=st.floats(0.0, 100.0))
def test_it_stays_within_its_limits(z, reference) -> None:
    p = ADRC_FAST
    state = initial(p, Measurement(0.0, z[0], 0.0), reference)
    for k, depth in enumerate(z):
        u, state, _ = step(p, state, Measurement(k * S_P, depth, 0.0), reference)
        assert abs(u) <= 12.0
        assert p.volume_min <= state.volume_reference <= p.volume_max
        assert p.b * p.volume_min <= state.disturbance <= p.b * p.volume_max


@pytest.mark.parametrize("depth", [0.5, 2.0, 20.0, 80.0])
def test_the_margins_of_the_recommended_gains(depth: float) -> None:
    seen = Measurement(0.0, depth, 4.04e-6 * depth)
    law = linearise_law(BoundLaw(ADRC, ADRC_FAST, S_P), seen)
    assert law.smooth
    loop = SampledLoop(plant=linearise(PLANT, depth=depth), law=law)
    for broken in (loop.broken_at_command(), loop.broken_at_depth()):
        m = loop_margins(broken)
        assert m is not None
        assert m.gain_up > 10 ** (6 / 20)
        assert m.gain_down < 10 ** (-6 / 20)
        assert math.degrees(m.phase) > 45.0
        assert m.peak_sensitivity < 1.6
        assert m.disk > 0.5


# Sensors that fail.


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e30])
@pytest.mark.parametrize("field", ["depth", "volume"])
@pytest.mark.parametrize("first", [0, 40])
def test_it_recovers_when_the_sensor_does(value, field, first) -> None:
    """Six seconds without it, at the start or on the way: at the reference all the same."""
    ran, calls = by_hand(
        ADRC,
        ADRC_FAST,
        blind(first, first + 20, value, field),
        setpoints=[(0.0, 3.0)],
        start_depth=1.5,
        duration=150.0,
    )
    assert len(ran.time) == 501
    assert np.all(np.isfinite([[*numbers(state)] for state in calls.states]))
    assert np.max(ran.depth) < 3.1
    assert abs(ran.depth[-1] - 3.0) < 0.01


def test_a_missing_volume_is_predicted_from_the_voltage() -> None:
    """Ten samples unseen while the motor runs: within what T1 hides of the true one."""
    ran, calls = by_hand(
        ADRC,
        ADRC_FAST,
        blind(5, 15, field="volume"),
        setpoints=[(0.0, 3.0)],
        start_depth=1.5,
        duration=6.0,
    )
    predicted = np.array([s.volume for s in calls.states])[5:15]
    moved = np.ptp(ran.volume[4:15])
    assert moved > 1e-5
    assert np.max(np.abs(predicted - ran.volume[5:15])) < 0.15 * moved


def test_a_missing_depth_is_predicted_from_the_volume() -> None:
    ran, calls = by_hand(
        ADRC, ADRC_FAST, blind(30, 50), setpoints=[(0.0, 3.0)], start_depth=1.5, duration=15.0
    )
    predicted = np.array([s.depth for s in calls.states])[30:50]
    assert np.ptp(ran.depth[30:50]) > 0.3
    assert np.max(np.abs(predicted - ran.depth[30:50])) < 0.02
