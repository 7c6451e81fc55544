"""The pool procedure's state machine, fed with scripted measurements."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.codegen.twin import twin
from swimbladder.control import cascade, protocol
from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.law import Measurement
from swimbladder.control.protocol import EMPTY, POOL, Does, Window, procedure_for

LOOP = CascadeParameters(k_pV=1.002e6, k_pz=-1.043e-4, k_iz=-7.486e-7, k_dz=-2.341e-3, S_p=0.3)
dV = 30e-6


def parameters(**changes):
    p = procedure_for(
        LOOP,
        rate_per_volt=4.44e-4 * 75e-4,
        limit=12.0,
        load_voltage=0.07707,
        bottom_depth=4.5,
        clearance=0.75,
        change=dV,
    )
    return p._replace(**changes)


def window_of(depths, volumes=None, target=0.0):
    window = EMPTY
    for z, V in zip(depths, [0.0] * len(depths) if volumes is None else volumes, strict=True):
        window = protocol.extend(window, z - target, V)
    return window


class Machine:
    """Feeds the machine and notes what it says."""

    def __init__(self, p):
        self.p, self.k, self.state, self.notes, self.go = p, 0, None, [], 1.0

    def see(self, depth, volume, times=1):
        for _ in range(times):
            seen = Measurement(self.k * LOOP.S_p, depth, volume)
            if self.state is None:
                self.state = protocol.initial(self.p, seen, self.go)
            u, self.state, wait = protocol.step(self.p, self.state, seen, self.go)
            self.notes.append((self.phase, u))
            assert wait == LOOP.S_p
            self.k += 1
        return u

    @property
    def phase(self):
        return self.p.phases[int(self.state.phase)]

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
        assert m.see(z, V) == min(max(expected, -12.0), 12.0)


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
    assert m.notes[-1][1] == min(max(expected, -12.0), 12.0)


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
    window = window_of([depths(0.3 * k) for k in range(200)], target=3.75)
    assert protocol.at_rest(parameters(), window) is rests


@given(
    st.lists(st.tuples(st.floats(-5.0, 5.0), st.floats(-3e-4, 3e-4)), min_size=3, max_size=60),
    st.floats(-5.0, 5.0),
)
def test_a_window_is_a_straight_line_through_the_samples(samples, target):
    depths, volumes = np.array(samples).T
    window = window_of(depths, volumes, target)
    expected = np.polyfit(0.3 * np.arange(len(samples)), depths, 1)[0]
    assert protocol.slope(window, 0.3) == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert target + window.z / window.samples == pytest.approx(depths.mean(), abs=1e-12)
    assert window.V / window.samples == pytest.approx(volumes.mean(), abs=1e-16)


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
    st.floats(1e-6, 0.05),
    st.sampled_from([-1.0, 1.0]),
    st.floats(1e-5, 1e-2),
    st.floats(1.0, 60.0),
    st.floats(0.01, 1.0),
)
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
    state = protocol.initial(p, seen, 1.0)
    assert protocol.step(p, state, seen, 1.0) == protocol.step(p, state, seen, 1.0)
    assert state == protocol.initial(p, seen, 1.0)


class TestWhatABoardNeeds:
    """Waiting, rounds, measurements that are none, an end by order, and coming up afterwards."""

    def test_it_waits_for_a_word_and_a_measurement(self):
        m = Machine(parameters())
        m.go = 0.0
        assert m.see(0.1, 9e-5, times=50) == pytest.approx(0.1 * 0.07707)
        assert m.state.phase == -1.0
        m.go = 1.0
        m.see(math.nan, 9e-5)
        assert m.state.phase == -1.0
        m.see(0.1, 9e-5)
        assert m.phase.does is Does.HOLD
        first = Measurement(0.0, 0.1, 9e-5)
        expected, *_ = cascade.step(LOOP, cascade.initial(LOOP, first, 3.75), first, 3.75)
        assert m.notes[-1][1] == min(max(expected, -12.0), 12.0)

    def test_rounds_change_the_volume_from_a_first_to_a_last(self):
        m = Machine(parameters(rounds=3.0, change=20e-6, more=10e-6))
        asked = []
        for n in range(3):
            m.until(Does.PULSE, 3.75, 15e-6)
            asked.append(m.state.pulse * (m.state.pulses + 1) * 0.3 * 4.44e-4 * 75e-4)
            m.until(Does.GLIDE, 3.75, 15e-6)
            m.see(0.0, 15e-6)
            m.until(Does.PULSE, 0.75, 15e-6)
            asked.append(m.state.pulse * (m.state.pulses + 1) * 0.3 * 4.44e-4 * 75e-4)
            m.until(Does.GLIDE, 0.75, 15e-6)
            m.see(4.5, 15e-6)
            assert m.state.completed == n + 1
        expected = [sign * dV for dV in (20e-6, 30e-6, 40e-6) for sign in (1.0, -1.0)]
        assert asked == pytest.approx(expected, rel=1e-9)
        assert m.phase.does is Does.DONE

    @pytest.mark.parametrize(
        ("depth", "volume"),
        [(math.nan, 1e-5), (3.75, math.nan), (math.inf, 1e-5), (7.0, 1e-5), (3.75, 5e-4)],
    )
    def test_what_can_not_be_holds_the_piston_and_begins_the_minute_anew(self, depth, volume):
        p = parameters(depth_most=6.0, depth_least=-1.0, volume_most=4e-4, volume_least=-4e-4)
        m = Machine(p)
        m.see(3.75, 15e-6, times=150)
        loop = m.state.loop
        assert m.see(depth, volume) == pytest.approx(3.75 * 0.07707)
        assert m.state.window.samples == 0.0
        assert m.state.loop == loop  # the loop goes on where it was
        assert m.until(Does.HALT, 3.75, 15e-6)[0] == 201

    def test_without_a_measurement_it_gives_up_after_a_while(self):
        m = Machine(parameters(blind=5.0))
        m.see(3.75, 15e-6, times=10)
        m.see(math.nan, 15e-6, times=16)
        assert m.phase.does is Does.HOLD
        m.see(math.nan, 15e-6)
        assert m.phase.does is Does.GAVE_UP
        assert m.state.gave_up_in == 0.0
        m.see(3.75, 15e-6, times=500)
        assert m.phase.does is Does.GAVE_UP

    def test_a_timed_voltage_asks_no_sensor(self):
        m = Machine(parameters(change=60e-6))
        m.until(Does.PULSE, 3.75, 15e-6)
        u, left = m.state.pulse, int(m.state.pulses)
        assert left > 2
        for _ in range(left):
            assert m.see(math.nan, math.nan) == u
        assert m.see(math.nan, math.nan) == pytest.approx(3.75 * 0.07707)
        assert m.phase.does is Does.GLIDE

    @pytest.mark.parametrize("at", [1, 150, 203, 400])
    def test_it_ends_when_told_to(self, at):
        m = Machine(parameters())
        m.see(3.75, 15e-6, times=at)
        m.go = -1.0
        m.see(3.75, 15e-6)
        assert m.phase.does is Does.GAVE_UP

    def test_afterwards_it_comes_up_where_it_is_to(self):
        m = Machine(parameters(end_volume=3e-4))
        m.see(3.75, 15e-6)
        m.go = -1.0
        assert m.see(3.75, 15e-6) == 12.0
        near = m.see(0.0, 3e-4 - 1e-6)
        assert near == pytest.approx(1.002)  # the cascade's gain on a cubic centimetre
        assert m.see(0.0, math.nan) == 0.0

    def test_phases_have_words(self):
        words = [phase.words for phase in parameters().phases]
        assert words[:4] == ["(a) hold", "(b) halt", "(b) pulse", "(b) glide"]
        assert words[-2:] == ["done", "gave up"]


@pytest.mark.parametrize("samples", [2, 200, 600, 6000])
def test_float32_is_enough_for_a_minute(samples):
    """Means to 0.01 cm3 and 0.02 mm, the speed to a hundredth of what counts as rest."""
    law, S_p = twin(POOL), 60.0 / samples
    p = parameters(loop=LOOP._replace(S_p=S_p))
    random = np.random.default_rng(3)
    seconds = S_p * np.arange(samples)
    depths = (3.75 + 0.019 + 4e-4 * (seconds - 30.0) + 0.005 * random.normal(size=samples)).astype(
        np.float32
    )
    volumes = (3.4e-4 + 6e-6 * random.normal(size=samples)).astype(np.float32)
    state = law.initial(p, Measurement(0.0, depths[0], np.float32(3.3e-4)), 1.0)
    for z, V in zip(depths, volumes, strict=True):
        _, state, _ = law.step(p, state, Measurement(0.0, z, V), 1.0)
    assert state.window.samples == samples
    window = Window(*map(float, state.window))
    exact = depths.astype(float), volumes.astype(float)
    assert float(state.neutral) + window.V / samples == pytest.approx(exact[1].mean(), abs=1e-8)
    assert 3.75 + window.z / samples == pytest.approx(exact[0].mean(), abs=2e-5)
    speed = np.polyfit(seconds, exact[0], 1)[0]
    assert protocol.slope(window, S_p) == pytest.approx(speed, abs=5e-6)


@pytest.mark.parametrize(
    ("dx", "samples"), [(0.0, 1), (1e-5, 1), (1.5e-3, 1), (1.501e-3, 2), (-4e-3, 3), (9e-3, 6)]
)
def test_a_move_takes_the_fewest_whole_samples_in_which_the_voltage_makes_it(dx, samples):
    """At 0.5 mm/s/V and 10 V at most it is 1.5 mm in a sample of 0.3 s."""
    voltage, taken = protocol.timed(dx, 0.5e-3, 10.0, 0.3)
    assert taken == samples
    assert voltage * 0.5e-3 * taken * 0.3 == pytest.approx(dx, rel=1e-12)
    assert abs(voltage) <= 10.0 * (1.0 + 1e-9)
