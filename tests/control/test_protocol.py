"""The pool procedure's state machine, fed with scripted measurements."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.control import cascade, protocol
from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.law import Measurement
from swimbladder.control.protocol import Does, PoolParameters, Window

LOOP = CascadeParameters(k_pV=1.002e6, k_pz=-1.043e-4, k_iz=-7.486e-7, k_dz=-2.341e-3, S_p=0.3)
dV = 30e-6


def parameters(**changes):
    given = dict(
        phases=protocol.pool_phases(pool_depth=4.5, clearance=0.75, dV=dV), loop=LOOP,
        K1=4.44e-4, piston_area=75e-4, limit=12.0, load_voltage=0.07707, minute=60.0,
        rest_speed=5e-4, rest_distance=0.02, halt=0.6, patience=1200.0,
    )  # fmt: skip
    return PoolParameters(**{**given, **changes})


class Machine:
    """Feeds the machine and notes what it says."""

    def __init__(self, p):
        self.p, self.k, self.state, self.notes = p, 0, None, []

    def see(self, depth, volume, times=1):
        for _ in range(times):
            seen = Measurement(self.k * LOOP.S_p, depth, volume)
            if self.state is None:
                self.state = protocol.begin(self.p, seen)
            u, self.state, wait = protocol.step(self.p, self.state, seen)
            self.notes.append((self.phase, u))
            assert wait == LOOP.S_p
            self.k += 1
        return u

    @property
    def phase(self):
        return self.p.phases[self.state.phase]

    def until(self, does, depth, volume, at_most=1000):
        for n in range(at_most):
            u = self.see(depth, volume)
            if self.phase.does is does:
                return n + 1, u
        raise AssertionError(f"{does} not reached, still {self.phase}")


def test_the_phases_are_steps_a_to_d():
    phases = parameters().phases
    assert [p.step for p in phases] == ["a", "b", "b", "b", "c", "d", "d", "d", "", ""]
    assert phases[0] == ("a", Does.HOLD, 3.75)
    assert phases[2].target == dV  # (b) displaces more, the vehicle rises
    assert phases[3].target < phases[0].target  # and ends near the surface
    assert phases[4] == ("c", Does.HOLD, 0.75)
    assert phases[6].target == -dV
    assert phases[7].target > 4.0


def test_the_whole_procedure_in_order():
    m = Machine(parameters())
    assert m.until(Does.HALT, 3.75, 15e-6)[0] == 201  # a minute of 200 samples, then the next
    assert m.until(Does.PULSE, 3.75, 15e-6)[0] == 2  # 0.6 s
    m.until(Does.GLIDE, 3.7, 45e-6)
    m.see(1.0, 45e-6, times=50)
    assert m.phase.does is Does.GLIDE
    m.see(0.04, 45e-6)
    assert m.phase == ("c", Does.HOLD, 0.75)
    m.until(Does.PULSE, 0.75, 3e-6)
    m.until(Does.GLIDE, 0.8, -27e-6)
    m.see(4.4, -27e-6)
    assert m.phase.does is Does.GLIDE
    m.see(4.46, -27e-6)
    assert m.phase.does is Does.DONE
    m.see(4.46, -27e-6, times=10)
    assert m.phase.does is Does.DONE


def test_holding_is_the_cascade():
    p = parameters()
    m = Machine(p)
    state = None
    random = np.random.default_rng(1)
    for _ in range(50):
        z, V = 3.0 + 0.1 * random.normal(), 1e-5 * random.normal()
        seen = Measurement(m.k * LOOP.S_p, z, V)
        if state is None:
            state = cascade.initial(LOOP, seen, 3.75)
        expected, state, _ = cascade.step(LOOP, state, seen, 3.75)
        assert m.see(z, V) == expected


def test_a_new_hold_starts_its_integral_from_the_volume_it_finds():
    m = Machine(parameters())
    m.until(Does.GLIDE, 3.75, 15e-6)
    m.see(0.0, 47e-6)
    assert m.phase.step == "c"
    expected, _, _ = cascade.step(
        LOOP,
        cascade.initial(LOOP, Measurement(0.0, 0.0, 47e-6), 0.75),
        Measurement(0.0, 0.0, 47e-6),
        0.75,
    )
    assert m.notes[-1][1] == expected


@pytest.mark.parametrize(
    ("depths", "rests"),
    [
        (lambda _: 3.75, True),
        (lambda t: 3.75 + 4e-4 * (t - 30.0), True),
        (lambda t: 3.75 + 6e-4 * (t - 30.0), False),  # faster than 0.5 mm/s
        (lambda t: 3.75 - 6e-4 * (t - 30.0), False),
        (lambda _: 3.78, False),  # at rest, but elsewhere
        (lambda t: 3.75 + 0.05 * math.sin(2.0 * math.pi * t / 6.0), True),  # jitter about rest
    ],
)
def test_rest_is_judged_over_the_minute(depths, rests):
    p = parameters()
    window = Window()
    for k in range(200):
        window = protocol.extend(window, Measurement(500.0 + 0.3 * k, depths(0.3 * k), 0.0))
    assert protocol.at_rest(p, window, 3.75) is rests


@given(
    st.lists(st.tuples(st.floats(-5.0, 5.0), st.floats(-3e-4, 3e-4)), min_size=3, max_size=60),
    st.floats(0.0, 1e5),
)
def test_a_window_is_a_straight_line_through_the_samples(samples, start):
    window = Window()
    times = start + 0.3 * np.arange(len(samples))
    for t, (z, V) in zip(times, samples, strict=True):
        window = protocol.extend(window, Measurement(float(t), z, V))
    depths, volumes = np.array(samples).T
    slope = np.polyfit(times - times[0], depths, 1)[0]
    assert window.speed == pytest.approx(slope, rel=1e-6, abs=1e-9)
    assert window.depth == pytest.approx(depths.mean(), abs=1e-12)
    assert window.volume == pytest.approx(volumes.mean(), abs=1e-16)


def test_a_minute_without_rest_is_followed_by_another():
    m = Machine(parameters())
    m.see(3.60, 15e-6, times=201)
    assert m.phase.does is Does.HOLD
    m.until(Does.HALT, 3.75, 15e-6, at_most=201)  # the bad minute does not spoil the good one


def test_the_change_is_made_from_the_mean_of_the_last_minute():
    m = Machine(parameters())
    random = np.random.default_rng(2)
    seen = []
    while m.state is None or m.phase.does is Does.HOLD:
        seen.append(15e-6 + 6e-6 * random.normal())
        m.see(3.75, seen[-1])
    neutral = np.mean(seen[:200])
    assert m.state.neutral == pytest.approx(neutral, rel=1e-12)
    m.until(Does.PULSE, 3.75, 24e-6)  # the moment's volume is 9 cm3 off
    u, samples = m.state.pulse, m.state.pulses + 1
    dx = (neutral + dV - 24e-6) / 75e-4
    assert u * samples * 0.3 * 4.44e-4 == pytest.approx(dx, rel=1e-12)


def test_a_pulse_lasts_its_samples_and_then_the_piston_is_held():
    m = Machine(parameters())
    m.until(Does.PULSE, 3.75, 15e-6)
    dx = dV / 75e-4
    samples = math.ceil(dx / (4.44e-4 * 12.0 * 0.3))
    m.see(3.7, 30e-6, times=samples)
    pulses = [u for phase, u in m.notes if phase.does is Does.PULSE]
    assert pulses == [pytest.approx(dx / (4.44e-4 * 0.3 * samples))] * samples
    assert m.phase.does is Does.GLIDE
    assert m.notes[-1][1] == pytest.approx(0.07707 * 3.7)
    halts = [u for phase, u in m.notes if phase.does is Does.HALT]
    assert halts == [pytest.approx(0.07707 * 3.75)] * 2


def test_without_a_holding_voltage_the_motor_gets_none():
    m = Machine(parameters(load_voltage=0.0))
    m.until(Does.GLIDE, 3.75, 15e-6)
    assert m.notes[-1][1] == 0.0


def test_more_volume_takes_a_positive_voltage_and_less_a_negative():
    m = Machine(parameters())
    m.until(Does.PULSE, 3.75, 15e-6)
    assert m.notes[-1][1] > 0.0
    m.until(Does.GLIDE, 3.75, 45e-6)
    m.see(0.0, 45e-6)
    m.until(Does.PULSE, 0.75, 3e-6)
    assert m.notes[-1][1] < 0.0


@given(
    st.floats(1e-6, 0.05), st.sampled_from([-1.0, 1.0]), st.floats(1e-5, 1e-2),
    st.floats(1.0, 60.0), st.floats(0.01, 1.0),
)  # fmt: skip
def test_a_timed_voltage_moves_the_piston_by_dx_in_whole_samples(dx, sign, K1, limit, S_p):
    u, samples = protocol.timed_voltage(sign * dx, K1=K1, limit=limit, sample_time=S_p)
    assert samples >= 1
    assert K1 * u * samples * S_p == pytest.approx(sign * dx, rel=1e-12)
    assert abs(u) <= limit * (1.0 + 1e-8)
    if samples > 1:  # one sample less would take more than the limit
        assert dx / (K1 * (samples - 1) * S_p) > limit * (1.0 - 1e-8)


@pytest.mark.parametrize("depth", [3.75, 2.0])
def test_patience_ends(depth):
    """Neither a vehicle that does not come to rest nor one that does not arrive is waited for."""
    m = Machine(parameters(patience=100.0, rest_speed=0.0 if depth == 3.75 else 5e-4))
    n = 0
    while m.state is None or m.phase.does is not Does.GAVE_UP:
        m.see(depth + 0.001 * (n % 3), 15e-6)
        n += 1
        assert n < 1000
    assert m.k * 0.3 == pytest.approx(120.0, abs=1.0)  # two whole minutes
    m = Machine(parameters(patience=100.0))
    m.until(Does.GLIDE, 3.75, 15e-6)
    m.see(2.0, 15e-6, times=330)
    assert m.phase.does is Does.GLIDE
    m.see(2.0, 15e-6, times=10)
    assert m.phase.does is Does.GAVE_UP
    assert m.see(2.0, 15e-6) == pytest.approx(2.0 * 0.07707)


def test_a_step_is_pure():
    p = parameters()
    seen = Measurement(0.0, 3.6, 1e-5)
    state = protocol.begin(p, seen)
    assert protocol.step(p, state, seen) == protocol.step(p, state, seen)
    assert state == protocol.begin(p, seen)
