"""A hull that bobs at the surface with its volume at the end stop and hardly a voltage on it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.physics.dynamics import acceleration, plant
from tests.sim.closed_loop.test_events import agree, both
from tests.vehicles import paper

P = plant(paper())
END = 6.0  # s


@pytest.mark.parametrize("u", [0.0, -1e-20, -1e-18, -3e-16, -1e-15, -1e-12, 1e-18])
def test_a_voltage_near_zero_leaves_it_at_the_upper_stop(u):
    """SciPy with the volume at the stop: once above the surface the load presses it there."""
    ours, _ = both(paper(), [(0.0, u)], END, depth=0.0, volume=P.V_max)
    assert ours.finished
    assert np.max(np.abs(ours.volume - P.V_max)) < 1e-12
    theirs = solve_ivp(
        lambda _, y: [y[1], acceleration(P.V_max, y[0], y[1], P)],
        (0.0, END),
        [0.0, 0.0],
        t_eval=ours.time,
        rtol=1e-12,
        atol=1e-14,
        max_step=0.01,
    ).y[0]
    np.testing.assert_allclose(ours.depth, theirs, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("u", [-2e-4, -8e-4])
def test_it_leaves_the_stop_and_comes_back_as_the_load_does(u):
    """With a voltage that the load of a bobbing hull passes to and fro: the oracle's events."""
    ours, theirs = both(paper(), [(0.0, u)], END, depth=-0.002, volume=P.V_max)
    assert len(theirs.events) > 2
    agree(ours, theirs)
