"""Closed-loop trajectories against independent integration, and the paper's check values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.sim.closed_loop import Solution, StopReason, simulate, step_metrics
from swimbladder.vehicle import IdentifiedActuator
from tests.examples import examples
from tests.oracle import TABLE_3, closed_loop, paper_cascade
from tests.vehicles import BLENDED, paper, pump

GAINS = CascadeParameters(**TABLE_3)


def by_expm(setpoints, duration: float, depth: float):
    """The paper's vehicle, sampled exactly: 12 V limit, linear drag, no stop in the way."""
    T1, K1A, c = 0.09, 0.444e-3 * 75e-4, 7.707e-2
    K2, T2, psi = 7935.54, 36.3, 4.04e-6
    # q' = (K1 A (u - c z) - q)/T1, V' = q, z' = w, w' = (K2 (psi z - V) - w)/T2, eqs (26)-(33)
    A = np.zeros((5, 5))
    A[0, [0, 2, 4]] = -1 / T1, -K1A * c / T1, K1A / T1
    A[1, 0] = A[2, 3] = 1.0
    A[3, [1, 2, 3]] = -K2 / T2, K2 * psi / T2, -1 / T2
    E = expm(0.3 * A)[:4]
    law = paper_cascade(**TABLE_3)
    x = np.array([0.0, psi * depth, depth, 0.0])
    rows = []
    for k in range(math.ceil(duration / 0.3 - 1e-9) + 1):
        reference = [z for t, z in setpoints if t <= 0.3 * k + 1e-9][-1]
        rows.append(x)
        u = law(0.3 * k, x[2], x[1], reference)
        x = E @ np.append(x, min(max(u, -12.0), 12.0))
    return np.array(rows).T


@pytest.mark.parametrize(
    ("start", "target"),
    [(1.5, 3.0), (3.0, 1.5), (1.0, 3.5), (3.5, 1.0), (0.6, 0.7), (2.0, 2.0), (20.0, 22.0)],
)
def test_a_step_against_the_exact_sampled_solution(start: float, target: float) -> None:
    ours = simulate(paper(), setpoints=[(0.0, target)], duration=600.0, start_depth=start)
    q, V, z, w = by_expm([(0.0, target)], 600.0, start)
    assert ours.stop is StopReason.FINISHED
    assert not ours.events
    assert np.abs(ours.depth - z).max() < 1e-10
    assert np.abs(ours.speed - w).max() < 1e-11
    assert np.abs(ours.volume - V).max() < 1e-14
    assert np.abs(ours.motor_rate - q).max() < 1e-14


@examples(20)
@given(
    start=st.floats(1.0, 40.0),
    moves=st.lists(st.tuples(st.floats(10.0, 120.0), st.floats(-0.6, 0.6)), min_size=1, max_size=5),
)
def test_any_list_of_setpoints(start: float, moves: list[tuple[float, float]]) -> None:
    times = np.concatenate(([0.0], np.cumsum([t for t, _ in moves])))
    depths = start + np.concatenate(([0.0], np.cumsum([dz for _, dz in moves])))
    depths = np.maximum(depths, 0.8)
    setpoints = [(float(t), float(z)) for t, z in zip(times, depths, strict=True)]
    duration = float(times[-1]) + 40.0
    ours = simulate(paper(), setpoints=setpoints, duration=duration, start_depth=start)
    _, V, z, _ = by_expm(setpoints, duration, start)
    if np.abs(V).max() < 350e-6 and z.min() > 0.0:
        assert np.abs(ours.depth - z).max() < 1e-9
        assert np.abs(ours.volume - V).max() < 1e-13
    np.testing.assert_array_equal(
        ours.reference, [[r for t, r in setpoints if t <= k + 1e-9][-1] for k in ours.time]
    )


def test_a_step_against_adaptive_integration() -> None:
    """The same, by SciPy's DOP853 at 1e-12 from the equations in torques and forces."""
    ours = simulate(paper(), setpoints=[(0.0, 3.0)], duration=120.0, start_depth=1.5)
    theirs = closed_loop(
        paper(),
        paper_cascade(**TABLE_3),
        setpoints=[(0.0, 3.0)],
        duration=120.0,
        tick=0.3,
        depth=1.5,
    )
    assert np.abs(ours.depth - theirs.depth).max() < 1e-11
    assert np.abs(ours.volume - theirs.volume).max() < 1e-15
    np.testing.assert_allclose(ours.command, theirs.command, rtol=1e-9, atol=1e-8)
    np.testing.assert_array_equal(ours.voltage, np.clip(ours.command, -12.0, 12.0))


@pytest.mark.parametrize("start, target", [(12.0, 6.0), (6.0, 9.0)])  # noqa: PT006
def test_losses_nonlinear_drag_and_a_sagging_supply(start: float, target: float) -> None:
    """Everything at once, events included, against the oracle."""
    vehicle = pump(drag=BLENDED, R_b=0.4)
    gains = dict(k_pV=3e5, k_pz=-2e-5, k_iz=-1e-7, k_dz=-5e-4, S_p=0.5)
    run = dict(setpoints=[(0.0, target), (50.0, start)], duration=90.0)
    ours = simulate(
        vehicle,
        law=CASCADE,
        parameters=CascadeParameters(**gains),
        sample_time=0.5,
        start_depth=start,
        **run,
    )
    theirs = closed_loop(vehicle, paper_cascade(**gains), tick=0.5, depth=start, **run)
    assert {"stands still", "drives", "driven back"} <= {kind for _, kind in theirs.events}
    assert np.any(np.abs(ours.command) > 24.0)
    assert np.abs(ours.depth - theirs.depth).max() < 2e-7
    assert np.abs(ours.volume - theirs.volume).max() < 1e-10


@pytest.fixture(scope="module")  # not at import, where every worker would compile for it
def down() -> Solution:
    return simulate(paper(), setpoints=[(0.0, 3.0)], duration=600.0, start_depth=1.5)


@pytest.fixture(scope="module")
def up() -> Solution:
    return simulate(paper(), setpoints=[(0.0, 1.5)], duration=600.0, start_depth=3.0)


class TestPublishedNumbers:
    """shared numbers of an independent LSODA run of the printed paper, 1.5 m to 3.0 m."""

    def test_step_response(self, down: Solution) -> None:
        m = step_metrics(down.time, down.depth, start=1.5, target=3.0)
        assert m.overshoot_pct == pytest.approx(14.7, abs=0.05)
        assert m.rise90_s == pytest.approx(37.8, abs=1e-9)
        assert m.settle2_s == pytest.approx(338.0, abs=0.5)

    def test_volume_and_limit(self, down: Solution) -> None:
        assert down.volume.min() == pytest.approx(-99e-6, abs=0.5e-6)
        assert down.volume.max() == pytest.approx(13e-6, abs=0.5e-6)
        assert down.voltage[0] == -12.0
        assert np.all(np.abs(down.voltage) <= 12.0)

    def test_overshoot_is_slightly_lower_when_ascending(self, down: Solution, up: Solution) -> None:
        descent = step_metrics(down.time, down.depth, start=1.5, target=3.0)
        ascent = step_metrics(up.time, up.depth, start=3.0, target=1.5)
        assert 0.0 < descent.overshoot_pct - ascent.overshoot_pct < 1.0


def test_starting_the_same_run_later_changes_nothing() -> None:
    # without a load the vehicle rests exactly at its first set-point
    actuator = IdentifiedActuator(K1="0.444 mm/s/V", T1=0.09, piston_area="75 cm2")
    vehicle = paper(actuator=actuator)
    early = simulate(vehicle, setpoints=[(0.0, 2.0), (30.0, 3.0)], duration=150.0, start_depth=2.0)
    late = simulate(vehicle, setpoints=[(0.0, 2.0), (90.0, 3.0)], duration=210.0, start_depth=2.0)
    np.testing.assert_allclose(late.depth[200:], early.depth, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(late.volume[200:], early.volume, rtol=0.0, atol=1e-16)


def test_a_longer_run_begins_like_a_shorter_one() -> None:
    short = simulate(paper(), setpoints=[(0.0, 3.0)], duration=60.0, start_depth=1.5)
    long = simulate(paper(), setpoints=[(0.0, 3.0)], duration=61.0, start_depth=1.5)
    assert len(long.time) == 205  # a duration is rounded up to whole samples
    np.testing.assert_array_equal(long.depth[: len(short.depth)], short.depth)
