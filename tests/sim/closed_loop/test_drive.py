"""Open loop: a recorded volume or voltage at irregular instants, against the oracle."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.sim.closed_loop import StopReason, drive
from tests.examples import examples
from tests.oracle import open_loop
from tests.vehicles import BLENDED, QUADRATIC, SWITCHED, paper, pump, screw, stepper

RNG = np.random.default_rng(11)
TIME = np.cumsum(np.concatenate(([5.0], RNG.choice([0.01, 0.13, 0.5, 0.5, 0.5, 1.7], 80))))


@pytest.mark.parametrize(
    "vehicle",
    [paper(), stepper(BLENDED), screw(drag=QUADRATIC), pump(drag=SWITCHED)],
    ids=["paper", "stepper", "screw", "pump"],
)
def test_a_prescribed_volume(vehicle: Any) -> None:
    V = 6e-5 * np.sin(0.4 * TIME) + 2e-5 * RNG.standard_normal(len(TIME))
    ours = drive(vehicle, time=TIME, volume=V, start_depth=6.0, start_speed=0.05)
    theirs = open_loop(vehicle, TIME, V, ramps=True, depth=6.0, speed=0.05)
    np.testing.assert_array_equal(ours.time, TIME)
    np.testing.assert_array_equal(ours.volume, V)
    assert ours.finished
    assert np.abs(ours.depth - theirs.depth).max() < 1e-6
    assert np.abs(ours.speed - theirs.speed).max() < 1e-6
    assert np.all(np.isnan(ours.voltage))
    np.testing.assert_allclose(ours.motor_rate[:-1], np.diff(V) / np.diff(TIME), rtol=1e-9)


def test_a_prescribed_volume_under_laminar_drag_is_exact() -> None:
    V = 6e-5 * np.sin(0.4 * TIME)
    ours = drive(paper(), time=TIME, volume=V, start_depth=6.0)
    m, rho_g = paper().mass, 9806.65

    def rhs(t: float, x: np.ndarray) -> list[float]:
        pull = rho_g / m * (4.04e-6 * x[0] - np.interp(t, TIME, V))
        return [x[1], pull - x[1] / 36.3]

    x = np.array([6.0, 0.0])
    for k in range(len(TIME) - 1):  # the ramps have corners
        x = solve_ivp(rhs, TIME[k : k + 2], x, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
        assert ours.depth[k + 1] == pytest.approx(x[0], abs=1e-11)


@pytest.mark.parametrize(
    "vehicle",
    [paper(), screw(friction=2e-3, drag=QUADRATIC, R_b=0.3), pump(leak=2e-12, R_b=0.2)],
    ids=["paper", "screw", "pump"],
)
def test_a_recorded_voltage(vehicle: Any) -> None:
    u = 8.0 * np.sin(0.8 * TIME) + 3.0
    ours = drive(vehicle, time=TIME, voltage=u, start_depth=20.0)
    theirs = open_loop(vehicle, TIME, u, depth=20.0)
    assert np.abs(ours.depth - theirs.depth).max() < 2e-6
    assert np.abs(ours.volume - theirs.volume).max() < 1e-9
    np.testing.assert_array_equal(ours.command, u)


def test_a_voltage_beyond_the_supply_is_cut() -> None:
    both = [
        drive(paper(), time=[0.0, 3.0], voltage=[u, 0.0], start_depth=5.0) for u in (12.0, 40.0)
    ]
    np.testing.assert_array_equal(both[0].depth, both[1].depth)
    assert both[1].voltage[0] == 12.0
    assert both[1].command[0] == 40.0


def test_bottom_and_surface_under_a_recorded_volume() -> None:
    """Neither the stroke nor the motor limits what was recorded; ground and air do."""
    V = 4e-4 * np.sin(0.12 * TIME)
    ours = drive(paper(), time=TIME, volume=V, start_depth=1.0, bottom_depth=2.0)
    theirs = open_loop(paper(), TIME, V, ramps=True, depth=1.0, bottom=2.0)
    kinds = [e.kind for e in ours.events]
    assert {"reached the bottom", "left the bottom", "began to emerge"} <= set(kinds)
    assert kinds == [kind for _, kind in theirs.events]
    np.testing.assert_allclose(ours.depth, theirs.depth, rtol=0.0, atol=1e-5)
    assert ours.depth.max() == 2.0
    assert V.max() > paper().stroke.maximum


def test_the_start_of_the_clock_does_not_matter() -> None:
    V = 6e-5 * np.sin(0.4 * np.arange(40))
    t = 0.5 * np.arange(40)
    a = drive(paper(), time=t, volume=V, start_depth=6.0)
    b = drive(paper(), time=t + 4096.0, volume=V, start_depth=6.0)
    np.testing.assert_array_equal(b.depth, a.depth)


def test_one_long_interval_is_many_short_ones() -> None:
    t = np.linspace(0.0, 60.0, 61)
    long = drive(paper(), time=[0.0, 60.0], voltage=[0.5, 0.0], start_depth=30.0)
    short = drive(paper(), time=t, voltage=np.full(61, 0.5), start_depth=30.0)
    assert long.depth[-1] == pytest.approx(short.depth[-1], abs=1e-11)
    assert long.volume[-1] == pytest.approx(short.volume[-1], abs=1e-15)
    assert long.balance.energy["source"] == pytest.approx(short.balance.energy["source"], rel=1e-4)


def test_a_run_that_ends_early_says_why() -> None:
    t = np.arange(0.0, 4000.0, 10.0)
    s = drive(paper(), time=t, volume=np.full(t.shape, -3e-4), start_depth=80.0)
    assert s.stop is StopReason.TOO_DEEP
    assert len(s.time) == len(s.depth) < len(t)
    assert s.law == "none (recorded volume)"


def test_numbers_of_any_kind_are_taken() -> None:
    a = drive(paper(), time=[0, 1, 2], voltage=[0, 1, 2], start_depth=5)
    b = drive(paper(), time=np.array([0.0, 1.0, 2.0]), voltage=(0.0, 1.0, 2.0), start_depth=5.0)
    np.testing.assert_array_equal(a.depth, b.depth)


@examples(30)
@given(
    steps=st.lists(st.sampled_from([0.02, 0.3, 1.1, 7.0]), min_size=3, max_size=12),
    volumes=st.lists(st.floats(-3e-4, 3e-4), min_size=13, max_size=13),
    depth=st.floats(0.5, 40.0),
)
def test_the_books_of_recorded_volumes_balance(
    steps: list[float], volumes: list[float], depth: float
) -> None:
    time = np.concatenate(([0.0], np.cumsum(steps)))
    V = np.array(volumes[: len(time)])
    s = drive(screw(drag=BLENDED), time=time, volume=V, start_depth=depth, bottom_depth=60.0)
    if s.finished:
        assert abs(s.balance.volume_residue) <= 1e-12 * max(np.abs(np.diff(V)).sum(), 1e-6)
        assert s.balance.relative_energy_residue < 1e-3
        assert s.balance.energy["drag"] >= 0.0
        assert math.isfinite(s.balance.energy["source"])
