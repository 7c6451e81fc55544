"""The observer: its model against SciPy's motion, its gains against python-control's."""

import math
from itertools import pairwise

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.control.law import Measurement, TuningParameters, from_leaves, leaves, numbers
from swimbladder.control.motion import (
    e_folding_time,
    filter_gains,
    held_motion,
    hold_gains,
    motion_over_sample,
)
from swimbladder.control.observer import OBSERVER, Estimate, Trust, estimate, initial, moves, step
from swimbladder.design.tuning.gains import gains, setting_of
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant

VEHICLE = load_vehicle("feup-em")
PLANT = plant(VEHICLE)
H = 0.3
KNOBS = TuningParameters(frequency=0.2, damping=0.8, inner=1.2, sharpness=6.0, learning=0.01)


def parameters(**changes):
    s = setting_of(VEHICLE, sample_time=H, supply=12.0, neutral_range=20e-6)
    return gains("observer", s, KNOBS)._replace(**changes)


def sailed(volumes, z, w, neutral):
    """Return depths and speeds at the samples: SciPy, under volumes straight between them."""
    a, d, psi = PLANT.a_b, PLANT.d_l, PLANT.psi
    found = [(z, w)]
    for before, after in pairwise(volumes):

        def rates(t, x, before=before, after=after):
            V = before + (after - before) * t / H
            return [x[1], a * (psi * x[0] + neutral - V) - d * x[1]]

        run = solve_ivp(rates, (0.0, H), found[-1], rtol=1e-11, atol=1e-13)
        found.append(tuple(run.y[:, -1]))
    return np.array(found)


def test_the_motion_over_a_sample_is_scipys():
    F, G0, G1 = motion_over_sample(PLANT, H)
    rng = np.random.default_rng(1)
    for _ in range(5):
        x = np.array([rng.uniform(0.5, 4.0), rng.normal(0.0, 0.1)])
        q0, q1 = rng.normal(0.0, 40e-6, 2)
        path = sailed([q0, q1], *x, neutral=0.0)
        np.testing.assert_allclose(F @ x + G0 * q0 + G1 * q1, path[1], rtol=0.0, atol=1e-10)


def test_the_gains_are_the_settled_kalman_filters():
    depth, acceleration, walk = 2e-3, 3e-3, 1e-7
    F, G0, G1 = motion_over_sample(PLANT, H)
    A = np.eye(3)
    A[:2, :2], A[:2, 2] = F, -(G0 + G1)
    scale = np.diag([1e-3, 1e-3, 1e-6])
    unscale = np.diag([1e3, 1e3, 1e6])
    Q = np.diag([1e-30, (acceleration * 1e3) ** 2 * H, (walk * 1e6) ** 2 * H])
    L, _, _ = control.dlqe(
        unscale @ A @ scale, np.eye(3), np.array([[1.0, 0.0, 0.0]]), Q, (depth * 1e3) ** 2
    )
    # python-control's gain is the predictor's, A K; ours corrects at once.
    expected = scale @ np.linalg.solve(unscale @ A @ scale, L[:, 0]) / 1e-3
    found = filter_gains(PLANT, H, depth=depth, acceleration=acceleration, random_walk=walk)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_the_estimate_finds_a_neutral_volume_that_nobody_knew():
    s = setting_of(VEHICLE, sample_time=H, supply=12.0, neutral_range=20e-6)
    p = gains("observer", s, KNOBS._replace(learning=0.3))
    rng = np.random.default_rng(2)
    volumes = 6e-6 + 15e-6 * np.sin(np.arange(600) / 25.0) + rng.normal(0.0, 0.5e-6, 600)
    truth = 3e-6
    path = sailed(volumes, 1.5, 0.0, truth)
    e = Estimate(1.5, 0.0, 0.0, volumes[0])
    for k in range(1, 600):
        e = estimate(p.model, p.model.trust, e, volumes[k], path[k, 0])
    assert e.depth == pytest.approx(path[-1, 0], abs=1e-5)
    assert e.speed == pytest.approx(path[-1, 1], abs=1e-5)
    assert e.neutral == pytest.approx(truth, abs=2e-8)


def test_a_sensor_that_fails_for_a_while_leaves_no_trace():
    p = parameters()
    path = sailed(np.full(400, 6e-6), 1.5, 0.0, 0.0)
    state = initial(p, Measurement(0.0, 1.5, 6e-6), 1.5)
    for k in range(1, 400):
        gone = 50 <= k < 80
        depth = (math.nan, math.inf, -math.inf)[k % 3] if gone else path[k, 0]
        volume = math.nan if 60 <= k < 65 else 6e-6
        voltage, state, _ = step(p, state, Measurement(k * H, depth, volume), 1.5)
        assert math.isfinite(voltage)
        assert all(math.isfinite(x) for x in numbers(state))
    assert state.estimate.depth == pytest.approx(path[-1, 0], abs=1e-4)


def test_it_begins_at_rest_even_without_a_measurement():
    p = parameters()
    p = from_leaves(type(p), leaves(p) | {"neutral": 2e-6})
    state = initial(p, Measurement(0.0, math.nan, math.nan), 2.0)
    assert state.estimate.depth == 2.0
    assert state.estimate.volume == pytest.approx(2e-6 + p.model.psi * 2.0)
    afloat = initial(p, Measurement(0.0, 0.0, 300e-6), 2.0)
    assert (
        afloat.estimate.neutral == 2e-6
    )  # a volume that lifts it out of the water is no neutral one


def test_the_motor_rests_within_its_dead_zone_and_stops_at_a_quarter_of_it():
    assert moves(1.1, 0.0, 1.0) == 1.0
    assert moves(-1.1, 0.0, 1.0) == 1.0
    assert moves(0.9, 0.0, 1.0) == 0.0
    assert moves(0.9, 1.0, 1.0) == 1.0
    assert moves(0.2, 1.0, 1.0) == 0.0
    p = parameters(dead=5e-6)
    state = initial(p, Measurement(0.0, 2.0, p.model.psi * 2.0), 2.0)
    voltage, _, _ = step(p, state, Measurement(H, 2.001, p.model.psi * 2.0), 2.0)
    # At rest the voltage is the one that holds the piston against the sea, eq. (30).
    assert voltage == pytest.approx(p.depth_voltage * 2.0, rel=1e-2)


def held(x, V, time, steps=1):
    """Return (z, w) after a time [s] under a volume off neutral: SciPy."""
    a, d, psi = PLANT.a_b, PLANT.d_l, PLANT.psi
    run = solve_ivp(
        lambda _, y: [y[1], a * (psi * y[0] - V) - d * y[1]],
        (0.0, time),
        x,
        rtol=1e-11,
        atol=1e-15,
        t_eval=np.linspace(0.0, time, steps + 1),
    )
    return run.y[:, 1:]


@pytest.mark.parametrize("time", [5.0, 45.0])
def test_a_move_leaves_the_share_of_an_error_that_it_should(time):
    r_z, r_w = hold_gains(PLANT, time, left=0.3)
    F, G = held_motion(PLANT, time)
    x, sizes = np.array([0.02, 1e-4]), []
    for _ in range(12):
        V = r_z * x[0] + r_w * x[1]  # beyond neutral at the set-point
        after = held(x, V, time)[:, -1]
        np.testing.assert_allclose(F @ x + G * V, after, rtol=0.0, atol=1e-9)
        x = after
        sizes.append(x[0])
    # Two poles at 0.3: x(n) = (c1 + c2 n) 0.3^n, so that the second difference of x/0.3^n is 0.
    left = np.array(sizes) / 0.3 ** np.arange(12)
    assert np.abs(np.diff(left, 2)).max() < 1e-4 * np.abs(left).max()


def test_held_it_runs_away_e_fold_in_that_time():
    late = held([1e-3, 0.0], 0.0, 10.0 * e_folding_time(PLANT), steps=10)[0]
    assert late[-1] / late[-2] == pytest.approx(math.e, rel=1e-6)


def test_near_the_set_point_the_motor_starts_when_a_prediction_leaves_the_band():
    s = setting_of(VEHICLE, sample_time=H, supply=12.0, neutral_range=20e-6)
    k = KNOBS._replace(frequency=0.06, damping=0.85, learning=0.4, dead=1e-8, pause=25.0, band=0.03)
    p = gains("observer", s, k)
    rng = np.random.default_rng(3)
    state = initial(p, Measurement(0.0, 2.0, p.model.psi * 2.0), 2.0)
    x, before = np.array([2.0, 0.0]), p.model.psi * 2.0
    volume, neutral, starts = before, 0.0, []
    F, G0, G1 = motion_over_sample(PLANT, H)
    for n in range(4000):
        seen = Measurement(n * H, x[0] + rng.normal(0.0, 2e-3), volume)
        rested = state.moving == 0.0
        voltage, after, _ = step(p, state, seen, 2.0)
        if rested and after.moving > 0.0:
            starts.append(n * H)
            # With the volume as it was it would have left the band: SciPy.
            e = after.estimate
            off = volume - p.model.psi * 2.0 - e.neutral
            ahead = held([e.depth - 2.0, e.speed], off, k.pause)[0, -1]
            assert abs(ahead) > 0.03
        state = after
        neutral += rng.normal(0.0, 1e-6 * math.sqrt(H / 3600.0))
        before, volume = volume, volume + PLANT.gain * (voltage - p.depth_voltage * x[0]) * H
        x = F @ x + G0 * (before - neutral) + G1 * (volume - neutral)
        assert abs(x[0] - 2.0) < 0.075
    assert len(starts) > 5
    assert np.diff(starts).min() >= p.pause - 1e-6
    # Farther away it does not wait.
    _, after, _ = step(
        p,
        state._replace(estimate=state.estimate._replace(depth=2.2)),
        Measurement(0.0, 2.2, volume),
        2.0,
    )
    assert after.moving == 1.0


def test_near_the_set_point_the_filter_is_the_kalman_filter_of_the_walk():
    """In simulation its error is the one that the Riccati equation tells, and others' is more."""
    noise = 2e-3
    s = setting_of(VEHICLE, sample_time=H, supply=12.0, neutral_range=20e-6)._replace(noise=noise)
    p = gains("observer", s, KNOBS._replace(pause=25.0, band=0.03))
    F, G0, G1 = motion_over_sample(PLANT, H)
    A = np.eye(3)
    A[:2, :2], A[:2, 2] = F, -(G0 + G1)
    # The same as a control problem of python-control's, in mm and cm3.
    scale = np.diag([1e-3, 1e-3, 1e-6])
    A = np.linalg.solve(scale, A @ scale)
    Q = np.diag([1e-30, 1e-30, (s.random_walk * 1e6) ** 2 * H])
    _, P, _ = control.dlqe(A, np.eye(3), np.array([[1.0, 0.0, 0.0]]), Q, (noise * 1e3) ** 2)
    expected = P - P[:, :1] @ P[:1] / (P[0, 0] + (noise * 1e3) ** 2)

    def errors(**changes):
        trust = Trust(*p.resting)._replace(**changes)
        rng = np.random.default_rng(4)
        found = []
        x, b, e = np.array([2.0, 0.0]), 0.0, None
        for n in range(40_000):
            volume = PLANT.psi * x[0] + b - 2e-5 * (2.0 - x[0]) + 3e-4 * x[1]  # keeps it there
            x = F @ x + (G0 + G1) * (volume - b)
            before = Estimate(2.0, 0.0, 0.0, volume) if e is None else e._replace(volume=volume)
            e = estimate(p.model, trust, before, volume, x[0] + rng.normal(0.0, noise))
            b += rng.normal(0.0, s.random_walk * math.sqrt(H))
            if n > 1000:
                found.append([e.depth - x[0], e.speed - x[1], e.neutral - b])
        return np.std(found, axis=0) / [1e-3, 1e-3, 1e-6]

    ours = errors()
    np.testing.assert_allclose(ours, np.sqrt(np.diag(expected)), rtol=0.06)
    assert (errors(**p.model.trust._asdict()) > ours).all()


def test_farther_away_the_filter_is_the_one_that_the_margins_are_of():
    p = gains(
        "observer",
        setting_of(VEHICLE, sample_time=H, supply=12.0, neutral_range=20e-6),
        KNOBS._replace(pause=25.0, band=0.03),
    )
    for depth, gain in (
        (2.0 + 0.5 * p.near, p.resting.n_z),
        (2.0 + 2.0 * p.near, p.model.trust.l_z),
    ):
        state = initial(p, Measurement(0.0, depth, p.model.psi * depth), 2.0)
        found = []
        for innovation in (0.0, 1e-3):
            seen = Measurement(H, depth + innovation, p.model.psi * depth)
            found.append(step(p, state, seen, 2.0)[1].estimate.depth)
        assert found[1] - found[0] == pytest.approx(1e-3 * gain, rel=1e-6)


@pytest.mark.parametrize(("frequency", "sharpness"), [(0.2, 6.0), (0.1, 10.0)])
@pytest.mark.parametrize("h", [0.02, 0.3])
def test_the_filter_is_as_many_times_as_fast_as_the_loop_as_its_sharpness_says(
    frequency, sharpness, h
):
    """Poles of a double integrator's Kalman filter: s^2 + sqrt(2) w s + w^2 = 0.

    w^2 is the ratio of the intensities of acceleration and noise; the tuning asks for this w.
    """
    s = setting_of(VEHICLE, sample_time=h, supply=12.0, neutral_range=20e-6)._replace(noise=2e-3)
    k = KNOBS._replace(frequency=frequency, sharpness=sharpness, learning=1e-6)
    trust = gains("observer", s, k).model.trust
    F, _, _ = motion_over_sample(PLANT, h)
    corrected = F - np.outer([trust.l_z, trust.l_w], [1.0, 0.0]) @ F
    poles = np.log(np.linalg.eigvals(corrected).astype(complex)) / h
    assert np.abs(poles) == pytest.approx(sharpness * frequency, rel=1e-3)
    assert -poles.real / np.abs(poles) == pytest.approx(math.sqrt(0.5), rel=0.01)


def test_limits_hold_whatever_is_measured():
    p = parameters()
    state = initial(p, Measurement(0.0, 1.5, 0.0), 1.5)
    for depth in (1e3, -1e3, 1e30):
        voltage, after, _ = step(p, state, Measurement(H, depth, 0.0), 1.5)
        assert abs(voltage) <= p.limit
        assert p.volume_min <= after.volume_reference <= p.volume_max
        assert abs(after.estimate.neutral - p.model.neutral) <= p.model.neutral_range


def test_the_poles_are_where_the_knobs_put_them():
    """Inner loop far faster than the depth: the two slow poles are those of the tuning."""
    k = KNOBS._replace(frequency=0.02, inner=2.0, sharpness=20.0, learning=1e-6)
    s = setting_of(VEHICLE, sample_time=0.02, supply=12.0, neutral_range=20e-6)
    p = gains("observer", s, k)
    a, d = PLANT.a_b, PLANT.d_l
    # z'' = a (psi z - V) - d z', V = psi z + k_z z + k_w z'
    poles = np.roots([1.0, d + a * p.k_w, a * p.k_z])
    assert abs(poles[0]) == pytest.approx(0.02, rel=1e-9)
    assert -poles[0].real / abs(poles[0]) == pytest.approx(k.damping, rel=1e-9)
    assert OBSERVER.name == "observer"
