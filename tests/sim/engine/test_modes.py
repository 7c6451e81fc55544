"""The modes: their numbers, and the forces that the stepper and the accounts of energy take."""

import itertools

import numpy as np
import pytest

from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine import accounts as kept
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.modes import NO_LAYERS

COUNT = 10, 2, 3  # states of the actuator, limited by the supply or not, places
SURFACE = 0.04  # m


def test_a_mode_is_told_from_every_other():
    every = list(itertools.product(*map(range, COUNT)))
    numbers = [act + 10 * limited + 20 * where for act, limited, where in every]
    assert sorted(numbers) == list(range(modes.COUNT))
    assert [modes.split(number) for number in numbers] == every


@pytest.mark.parametrize("depth", [-0.05, 0.02, 3.0])
@pytest.mark.parametrize("trim", [-3e-5, 4e-5])
def test_the_accounts_take_the_force_that_the_stepper_integrates(depth, trim):
    """Of one vehicle above, at and below the surface, at rest, heavy and light: eqs (13), (31)."""
    values = dict.fromkeys(Plant._fields, 0.0)
    values |= {"a_b": 0.1, "psi": 2e-6, "V_0": trim, "a_s": 5.0, "z_surface": SURFACE}
    p = np.array(list(values.values()))
    A, b_u, b_1 = np.empty((4, 4)), np.empty(4), np.empty(4)
    where = modes.EMERGING if depth < SURFACE else modes.SUBMERGED
    for volume in (-1e-4, 0.0, 2e-4):
        modes.linear_part(p, modes.STUCK + 20 * where, A, b_u, b_1)
        pull = A[3] @ np.array([0.0, volume, depth, 0.0]) + b_1[3]
        assert kept._pull(p, NO_LAYERS, volume, depth) == pytest.approx(pull, rel=1e-12)


def test_the_drag_s_work_where_its_law_bends_is_what_the_pull_gave_and_the_motion_did_not_gain():
    """Of a vehicle that is accelerated evenly under a pull that grows with its depth, eq. (13)."""
    values = dict.fromkeys(Plant._fields, 0.0)
    values |= {"a_b": 0.1, "psi": 2e-6, "V_0": 3e-5}
    p, h, volume, accounts = (
        np.array(list(values.values())),
        4.0,
        -2e-4,
        np.zeros(len(kept.Account)),
    )
    for z0, w0, w1 in ((3.0, 0.02, 0.14), (40.0, 0.1, -0.3), (2.0, 0.05, 0.05)):
        z1 = z0 + 0.5 * (w0 + w1) * h
        x, y = (np.array([0.0, volume, z, w, 0.0]) for z, w in ((z0, w0), (z1, w1)))
        accounts[:] = 0.0
        kept.enter_bend(p, NO_LAYERS, x, y, h, accounts)
        given = 0.1 * (3e-5 - volume) * (z1 - z0) + 0.1 * 2e-6 * 0.5 * (z1**2 - z0**2)
        due = given - 0.5 * (w1**2 - w0**2)
        assert accounts[kept.Account.DRAG] == pytest.approx(due, rel=1e-12)


@pytest.mark.parametrize(("act", "rate"), [(modes.MOVING_OUT, 2e-6), (modes.MOVING_IN, -2e-6)])
def test_a_positioner_that_moves_at_a_depth_raises_the_sea_by_its_rate(act, rate):
    """To and fro it counts by its amount, whichever way it goes and whatever the volume."""
    h, depth, accounts = 3.0, 50.0, np.zeros(len(kept.Account))
    x = np.array([rate, 1e-4, depth, 0.0, 0.0])
    y = np.array([rate, 1e-4 + rate * h, depth, 0.0, depth * h])
    p = np.zeros(len(Plant._fields))
    kept.enter(p, act, x, y, 0.0, h, np.zeros(5), accounts)
    a = kept.Account
    assert accounts[a.PUMPED] == rate * h
    assert accounts[[a.Z_Q, a.Z_DV]] == pytest.approx(2 * [rate * depth * h])
    assert accounts[a.TO_AND_FRO] == pytest.approx(abs(rate) * depth * h)
    assert accounts[a.MOTOR_ON] == h
