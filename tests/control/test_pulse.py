"""Pulses: their gains against a numerical minimum, their area against SciPy's motion."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from swimbladder.control.law import Measurement, TuningParameters, leaves, numbers
from swimbladder.control.motion import held_motion, motion_over_sample, pulse_gains
from swimbladder.control.observer import OBSERVER
from swimbladder.control.pulse import PULSE, holds, initial, run, step
from swimbladder.design.tuning.gains import gains, setting_of
from swimbladder.design.tuning.trial import motor_starts, motor_turns
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant

VEHICLE = load_vehicle("feup-em")
PLANT = plant(VEHICLE)
H = 0.3
KNOBS = TuningParameters(0.046, 1.0, 1.0, 5.0, 0.7, dead=3.5e-8, pause=65.0, band=0.025)
NEUTRAL = PLANT.psi * 2.0  # at 2 m


def parameters(**changes):
    s = setting_of(VEHICLE, sample_time=H, supply=12.0, neutral_range=20e-6)
    return gains("pulse", s._replace(noise=2.5e-3), KNOBS)._replace(**changes)


def squares(z, w, V, time):
    """Return the integral of z^2 over a time [s] under a volume off neutral: SciPy."""
    a, d, psi = PLANT.a_b, PLANT.d_l, PLANT.psi
    return solve_ivp(
        lambda _, y: [y[1], a * (psi * y[0] - V) - d * y[1], y[0] ** 2],
        (0.0, time),
        [z, w, 0.0],
        rtol=1e-11,
        atol=1e-13,
    ).y[2, -1]


@pytest.mark.parametrize("time", [20.0, 65.0])
def test_no_other_speed_and_volume_leave_less_of_the_error(time):
    speed, volume = pulse_gains(PLANT, time)
    assert speed < 0.0  # towards the set-point
    assert volume < 0.0  # and braking on the way
    found = minimize(
        lambda y: squares(1.0, y[0] / time, y[1] / (PLANT.a_b * time**2), time),
        [-1.0, -1.0],
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-12},
    )
    expected = found.x[0] / time, found.x[1] / (PLANT.a_b * time**2)
    assert (speed, volume) == pytest.approx(expected, rel=1e-4)


def test_without_drag_and_psi_it_is_the_parabola_nearest_to_nothing():
    # 1 - 4 s + 10/3 s^2: of all 1 + b s + c s^2 the least squares over 0 to 1.
    p = PLANT._replace(d_l=0.0, d_b=0.0, psi=0.0)
    speed, volume = pulse_gains(p, 50.0)
    assert speed == pytest.approx(-4.0 / 50.0, rel=1e-9)
    assert volume == pytest.approx(-20.0 / 3.0 / (p.a_b * 50.0**2), rel=1e-9)


def test_a_prediction_right_on_the_edge_of_the_band_is_left_alone():
    """At rest and neutral it is the error itself; beyond the edge the motor drives in to sink."""
    p = parameters(a_z=1.0, band=0.5)
    for error, going, voltage in ((0.5, 0.0, 0.0), (math.nextafter(0.5, 1.0), -1.0, -p.swing)):
        found = run(p, 0.0, error, 0.0, NEUTRAL, NEUTRAL, NEUTRAL, PLANT.gain * p.swing)
        assert found == (going, voltage)


class Flown:
    """A vehicle under the law, without noise: the motor without lag, the gain times what is known.

    volumes off neutral [m3], errors (depth, speed) at each sample, states and voltages.
    """

    def __init__(self, p, z, w, *, samples, off=0.0, gain=1.0, known=True):
        F, G0, G1 = motion_over_sample(PLANT, H)
        x, volume = np.array([z, w]), NEUTRAL + off
        state = initial(p, Measurement(0.0, 2.0 + z, PLANT.psi * (2.0 + z)), 2.0)
        state = state._replace(estimate=state.estimate._replace(volume=volume))
        if known:  # the speed, as the filter would have it
            back = np.linalg.solve(F, x - (G0 + G1) * off)
            there = state.estimate._replace(depth=2.0 + back[0], speed=back[1])
            state = state._replace(estimate=there)
        self.x, self.volumes, self.states, self.voltages = [x], [off], [state], []
        for n in range(samples):
            seen = Measurement(n * H, 2.0 + x[0], volume)
            voltage, state, _ = step(p, state, seen, 2.0)
            before = volume
            volume += PLANT.gain * (gain * voltage - p.depth_voltage * (2.0 + x[0])) * H
            x = F @ x + G0 * (before - NEUTRAL) + G1 * (volume - NEUTRAL)
            self.x.append(x)
            self.volumes.append(volume - NEUTRAL)
            self.states.append(state)
            self.voltages.append(voltage)
        self.moves = np.diff(self.volumes)

    @property
    def end(self):
        """The first sample after the run at which the motor rests."""
        going = [s.going for s in self.states]
        first = next(n for n, x in enumerate(going) if x != 0.0)
        return next(n for n in range(first, len(going)) if going[n] == 0.0)


@pytest.mark.parametrize("z", [0.03, -0.03])
def test_a_pulse_leaves_the_speed_and_the_volume_that_it_should(z):
    p = parameters()
    ran = Flown(p, z, math.copysign(1e-3, z), samples=60)
    assert 5 < ran.end < 40
    assert motor_turns(np.array(ran.volumes)[:, None]) == 1
    assert motor_starts(np.array([0.0, *ran.volumes])[:, None]) == 1
    depth, speed = ran.x[ran.end]
    turned = ran.x[int(np.argmax(np.abs(ran.volumes)))][0]
    assert abs(depth) < abs(turned)  # it went on to the set-point while the volume came back
    assert p.homing * abs(depth) < -math.copysign(speed, z * speed) < 1.05 * p.homing * abs(turned)
    volume = ran.volumes[ran.end]
    assert volume == pytest.approx(p.p_z * depth, abs=p.dead)
    # And so it is back in a time of 1/homing or so, without another run.
    assert abs(ran.x[60][0]) < 0.5 * abs(z)
    assert all(s.going == 0.0 for s in ran.states[ran.end :])


def test_it_goes_out_on_the_side_that_slows_the_vehicle_and_is_no_larger_than_it_need_be():
    p = parameters()
    ran = Flown(p, 0.03, 1e-3, samples=60)
    assert max(ran.volumes) > 0.0  # lighter against sinking
    # Out and back at one rate: the area is the change of speed over a, the peak its root.
    change = 1e-3 + p.homing * 0.03
    peak = math.sqrt(change / PLANT.a_b * p.rate)
    assert max(ran.volumes) == pytest.approx(peak, rel=0.25)
    assert np.abs(ran.moves).max() <= p.rate * H * 1.01


def test_inside_the_band_nothing_moves():
    p = parameters()
    ran = Flown(p, 0.01, 0.0, samples=5)
    assert np.abs(ran.moves).max() < 1e-9
    ahead = held_motion(PLANT, 13.0)[0][0] @ [0.01, 0.0]
    assert ahead < p.band
    assert all(s.holding == 1.0 and s.going == 0.0 for s in ran.states[1:])


def test_an_error_of_just_the_band_is_left_alone():
    p = parameters()
    ahead = abs(p.a_z * 0.03)  # at rest with the neutral volume nothing else adds to it
    for band, going in ((ahead, 0.0), (math.nextafter(ahead, 0.0), 1.0)):
        found = run(p._replace(band=band), 0.0, -0.03, 0.0, NEUTRAL, NEUTRAL, NEUTRAL, p.rate)
        assert found.going == going


def test_at_the_end_of_the_stroke_it_comes_back():
    p = parameters(volume_max=NEUTRAL + 1e-6)
    out = run(p, 1.0, -0.03, 0.01, NEUTRAL + 0.9e-6, NEUTRAL, NEUTRAL, p.rate)
    assert out.going == 1.0
    back = run(p, 1.0, -0.03, 0.01, NEUTRAL + 1e-6, NEUTRAL, NEUTRAL, p.rate)
    assert back.going == -2.0
    assert back.voltage < 0.0


def test_a_motor_that_does_half_or_twice_of_what_it_is_told_is_found_out():
    p = parameters()
    for gain in (0.5, 2.0):
        ran = Flown(p, 0.03, 1e-3, samples=2400, gain=gain)
        going = np.array([s.going for s in ran.states])
        n = next(n for n in range(2400, 1200, -1) if not going[n - 30 : n + 1].any())
        last = ran.states[n]
        # c z = gain (c z + hold)
        load = p.depth_voltage * (2.0 + ran.x[n][0])
        assert last.hold == pytest.approx(load / gain - load, rel=0.02)
        assert last.share == pytest.approx(gain, rel=0.1)
        assert np.abs(ran.moves[n - 5 : n]).max() < 1e-8
        assert max(abs(z) for z, _ in ran.x[1200:]) < 0.05


def test_it_is_held_by_pulses_from_where_it_is_slow_to_where_it_is_far():
    p = parameters()
    fast = p.homing * p.near
    assert holds(p, 0.0, 0.9 * p.near, 0.0) == 1.0
    assert holds(p, 0.0, 0.9 * p.near, 0.2 * fast) == 0.0
    assert holds(p, 1.0, 0.9 * p.near, 0.2 * fast) == 1.0
    assert holds(p, 1.0, 1.1 * p.near, 0.0) == 0.0
    assert holds(p._replace(near=0.0), 0.0, 0.0, 0.0) == 0.0


def test_farther_away_it_is_the_observer():
    s = setting_of(VEHICLE, sample_time=H, supply=12.0, neutral_range=20e-6)
    own, other = (
        gains(name, s, KNOBS._replace(dead=0.0, pause=0.0)) for name in ("pulse", "observer")
    )
    seen = Measurement(0.0, 1.5, PLANT.psi * 1.5)
    a, b = PULSE.initial(own, seen, 1.5), OBSERVER.initial(other, seen, 1.5)
    rng = np.random.default_rng(1)
    for n in range(50):
        seen = Measurement(n * H, 1.5 + rng.normal(0.0, 1e-2), 6e-6 + rng.normal(0.0, 1e-6))
        u, a, _ = PULSE.step(own, a, seen, 3.0)
        v, b, _ = OBSERVER.step(other, b, seen, 3.0)
        assert u == v
        assert (a.estimate, a.volume_reference) == (b.estimate, b.volume_reference)


def test_nothing_moves_without_a_volume_and_limits_hold_whatever_is_measured():
    p = parameters()
    state = initial(p, Measurement(0.0, 2.03, NEUTRAL), 2.0)._replace(holding=1.0, going=1.0)
    voltage, after, _ = step(p, state, Measurement(H, 2.03, math.nan), 2.0)
    assert after.going == 0.0
    assert voltage == pytest.approx(p.depth_voltage * 2.03, rel=1e-2)
    for depth in (1e3, -1e3, 1e30, math.nan):
        for volume in (0.0, 3e-4, math.inf):
            u, after, _ = step(p, state, Measurement(H, depth, volume), 2.0)
            assert abs(u) <= p.limit
            assert p.volume_min <= after.volume_reference <= p.volume_max
            assert all(math.isfinite(x) for x in numbers(after))


def test_the_way_back_begins_half_a_sample_ahead():
    """Out until a x (x/2/rate + S_p), what coming back does and the sample until it begins does."""
    p = parameters()
    out, error = 2e-6, -0.02
    way_back = PLANT.a_b * (out**2 / (2.0 * p.rate) + out * H)
    for share, going in ((1.01, 1.0), (0.99, -2.0)):
        speed = p.homing * error + share * way_back
        assert run(p, 1.0, error, speed, NEUTRAL + out, NEUTRAL, NEUTRAL, p.rate).going == going


def test_nine_tenths_of_a_load_that_is_not_reckoned_with_are_known_within_seconds():
    """At rest, where each sample shows what the voltage beyond the load moves."""
    p, error, volume = parameters(), 0.2, NEUTRAL  # V
    state = initial(p, Measurement(0.0, 2.0, volume), 2.0)._replace(holding=1.0)
    held = error
    for n in range(12):  # 3.6 s
        _, state, _ = step(p, state._replace(going=0.0), Measurement(n * H, 2.0, volume), 2.0)
        held = error + state.hold
        volume += PLANT.gain * held * H
    assert 0.0 < held < 0.1 * error


def test_what_holds_the_volume_is_learnt_up_to_twice_the_load_and_a_swing():
    p = parameters()
    state = initial(p, Measurement(0.0, 2.0, NEUTRAL), 2.0)._replace(holding=1.0)
    for n in range(400):  # at rest it creeps in all the time, whatever the voltage
        volume = NEUTRAL - n * 1e-8
        state = state._replace(going=0.0)
        voltage, state, _ = step(p, state, Measurement(n * H, 2.0, volume), 2.0)
    most = p.depth_voltage * 2.0 + p.swing
    assert state.hold == pytest.approx(most, rel=0.05)
    assert voltage <= p.limit


@pytest.mark.parametrize(("reference", "gain"), [(2.0, "n_b"), (4.0, "l_b")])
def test_near_the_reference_the_filter_has_the_gains_of_a_neutral_volume_that_walks(
    reference, gain
):
    p = parameters()
    assert p.resting.n_b != pytest.approx(p.model.trust.l_b, rel=0.1)
    state = initial(p, Measurement(0.0, 2.0, NEUTRAL), 2.0)
    _, after, _ = step(p, state, Measurement(H, 2.004, NEUTRAL), reference)
    b = leaves(p)[gain]
    assert after.estimate.neutral - state.estimate.neutral == pytest.approx(b * 0.004, rel=1e-6)
