"""The truth of the studies against closed forms and balances, and its two integrators."""

import math
from dataclasses import replace

import numpy as np
import pytest

from studies.truth import Body, Motor, Step, follow, with_changes

K_B = 9806.65
PAPER = Body.identified(k_b=K_B, K2=7935.54, T2=36.3, psi=4.04e-6)
MOTOR = Motor(K1=0.444e-3, T1=0.09, area=75e-4, load=7.707e-2)
STEP = Step(
    sample_time=0.3,
    rest=3,
    pulse=4,
    voltage=6.0,
    start_depth=3.7,
    reference_depth=3.7,
    neutral_error=3e-7,
    start_speed=2e-3,
)


def test_identified_parameters_are_those_of_equations_28_and_29():
    assert PAPER.k_b / PAPER.k_dl == pytest.approx(7935.54, rel=1e-12)
    assert PAPER.mass / PAPER.k_dl == pytest.approx(36.3, rel=1e-12)


def test_volume_is_that_of_equation_22():
    """A voltage held for t moves the piston by K1 u (t - T1 (1 - exp(-t/T1))), then it coasts."""
    motor = replace(MOTOR, load=0.0)
    _, volume = follow(PAPER, motor, STEP, 60)
    t = 0.3 * 4
    steady = 0.444e-3 * 6.0 * 75e-4
    at_end = steady * (t + 0.09 * math.expm1(-t / 0.09))
    assert volume[0, 7] == pytest.approx(at_end, rel=1e-12)
    assert volume[0, -1] == pytest.approx(steady * t, rel=1e-12)
    assert np.all(volume[0, :4] == 0.0)


def test_depth_without_psi_is_that_of_equation_27():
    """A motor without inertia ramps the volume over one sample: eq. (27) integrated by hand."""
    body = Body.identified(k_b=K_B, K2=7935.54, T2=36.3, psi=0.0)
    motor = Motor(K1=0.444e-3, T1=1e-7, area=75e-4)
    step = Step(sample_time=0.5, rest=0, pulse=1, voltage=10.0, start_depth=2.0)
    depth, volume = follow(body, motor, step, 80)
    t = 0.5 * np.arange(80)

    def ramp(t):  # response to a volume that grows with the time, eq. (27) for V = t
        return -7935.54 * (t**2 / 2 - 36.3 * t + 36.3**2 * -np.expm1(-t / 36.3))

    rate = volume[0, -1] / 0.5
    after = t >= 0.5
    expected = 2.0 + rate * (ramp(t) - np.where(after, ramp(np.maximum(t - 0.5, 0.0)), 0.0))
    assert np.abs(depth[0] - expected).max() < 5e-8


def test_unstable_hull_runs_away_with_the_pole_of_equation_34():
    """From a neutral error alone z grows with the positive root of T2 s2 + s - psi K2."""
    step = replace(STEP, voltage=0.0, start_speed=0.0)
    depth, _ = follow(PAPER, replace(MOTOR, load=0.0), step, 900)
    root = (-1.0 + math.sqrt(1.0 + 4.0 * 36.3 * 4.04e-6 * 7935.54)) / (2.0 * 36.3)
    moved = depth[0] - 3.7 + 3e-7 / 4.04e-6  # from where it would be neutral
    assert math.log(moved[-1] / moved[-101]) / 30.0 == pytest.approx(root, rel=1e-5)


@pytest.mark.parametrize("psi", [4.04e-6, 0.0, -1e-6])
def test_both_integrators_agree(psi):
    linear = replace(PAPER, psi=psi)
    nearly = replace(linear, k_dt=1e-300)  # sends it through DOP853
    exact, by_steps = follow(linear, MOTOR, STEP, 150), follow(nearly, MOTOR, STEP, 150)
    assert np.abs(exact[0] - by_steps[0]).max() < 1e-8
    assert np.abs(exact[1] - by_steps[1]).max() < 1e-13


def test_quadratic_drag_ends_at_its_terminal_speed():
    body = Body(k_b=K_B, mass=9.0, k_dt=40.0)
    step = replace(STEP, neutral_error=0.0, start_speed=0.0)
    depth, volume = follow(body, MOTOR, step, 2000)
    speed = (depth[0, -1] - depth[0, -101]) / 30.0
    assert speed == pytest.approx(-math.sqrt(K_B * volume[0, -1] / 40.0), rel=1e-7)


def test_energy_is_balanced_with_blended_drag():
    """What buoyancy did is what the water took and what the motion has."""
    body = Body.identified(k_b=K_B, K2=7935.54, T2=36.3, psi=4.04e-6, k_dt=30.0)
    step = replace(STEP, sample_time=0.02, rest=30, pulse=60)
    z, V = (x[0] for x in follow(body, MOTOR, step, 1501))
    h = 0.02
    w = np.gradient(z, h, edge_order=2)
    force = K_B * (4.04e-6 * (z - 3.7) + 3e-7 - V)
    power = force * w - body.k_dl * w**2 - 30.0 * np.abs(w) ** 3
    work = h * (power.sum() - 0.5 * (power[0] + power[-1]))
    kinetic = 0.5 * body.mass * (w[-1] ** 2 - w[0] ** 2)
    assert work == pytest.approx(kinetic, rel=1e-4)


def test_lanes_are_the_single_runs():
    bodies = [PAPER, replace(PAPER, psi=1e-6)]
    steps = [STEP, replace(STEP, start_depth=3.0)]
    both, _ = follow(bodies, MOTOR, steps, 50)
    for lane, (body, step) in enumerate(zip(bodies, steps, strict=True)):
        assert np.abs(both[lane] - follow(body, MOTOR, step, 50)[0][0]).max() < 1e-14
    with pytest.raises(ValueError, match="timing"):
        follow(PAPER, MOTOR, [STEP, replace(STEP, rest=1)], 50)


def test_changes_keep_what_the_name_says():
    body, _, _ = with_changes(PAPER, MOTOR, STEP, "K2", 0.1)
    assert K_B / body.k_dl == pytest.approx(7935.54 * math.exp(0.1))
    assert body.mass / body.k_dl == pytest.approx(36.3)
    body, _, _ = with_changes(PAPER, MOTOR, STEP, "T2", 0.1)
    assert body.k_dl == PAPER.k_dl
    assert body.mass / body.k_dl == pytest.approx(36.3 * math.exp(0.1))
    _, motor, _ = with_changes(PAPER, MOTOR, STEP, "T1", math.log(2.0))
    lag = motor.T1
    assert lag == pytest.approx(0.18)
    assert with_changes(PAPER, MOTOR, STEP, "psi", 1e-6)[0].psi == pytest.approx(5.04e-6)
    assert with_changes(PAPER, MOTOR, STEP, "start_depth", 0.1)[2].start_depth == 3.7 + 0.1
