"""Stall, neutral volume and depth load against the nonlinear motion."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from swimbladder.design.linear import linearise
from swimbladder.design.linear.depths import (
    depth_load,
    doubling_time,
    neutral_volume,
    stall,
)
from swimbladder.physics.dynamics import Plant, State, motor_rhs, plant


def starts(p: Plant, depth: float, voltage: float) -> bool:
    """Whether a motor at rest begins to press volume out at a depth."""
    return motor_rhs(State(0.0, 0.0, depth, 0.0), voltage, p).q > 0.0


def test_paper_vehicle_stalls_at_155_7_m(feup):
    found = stall(plant(feup), depth=100.0, depth_limit=100.0)
    assert found.depth == pytest.approx(12.0 / 0.07707, rel=1e-12)
    assert found.depth == pytest.approx(155.7, abs=0.05)
    assert found.within_limit is True
    assert found.depth - found.limit == pytest.approx(55.7, abs=0.05)
    assert (found.depth_without_sag, found.back_drive_depth) == (found.depth, 0.0)
    # K1 A (12 - 7.707) V
    assert found.extending_rate == pytest.approx(0.444e-3 * 75e-4 * 4.293, rel=1e-12)


def test_stall_is_where_the_nonlinear_motor_stops_turning(lossy):
    """Friction and a sagging supply: 24 V behind 0.2 ohm leave 20 V at a motor of 1 ohm."""
    p = plant(lossy)
    found = stall(p, depth=0.0, depth_limit=lossy.hull.depth_limit)
    assert found.voltage == pytest.approx(20.0)
    # (k_u 20 V - T_b)/k_z
    assert found.depth == pytest.approx((0.05 * 20.0 - 0.02) / 2e-4, rel=1e-12)
    assert starts(p, found.depth * (1 - 1e-9), found.voltage)
    assert not starts(p, found.depth * (1 + 1e-9), found.voltage)
    assert starts(p, found.depth_without_sag * (1 - 1e-9), 24.0)
    assert not starts(p, found.depth_without_sag * (1 + 1e-9), 24.0)
    # Below the back-drive depth the sea turns a motor without voltage.
    at_rest = State(0.0, 0.0, found.back_drive_depth * (1 - 1e-9), 0.0)
    assert motor_rhs(at_rest, 0.0, p).q == 0.0
    assert motor_rhs(at_rest._replace(z=found.back_drive_depth * (1 + 1e-9)), 0.0, p).q < 0.0


def test_leaking_pump_holds_less_deep_than_it_turns(lossy):
    """At the holding depth the steady rate of the motor, its own voltage sagging, is k_l z."""
    p = plant(lossy)
    found = stall(p, depth=0.0, depth_limit=None)

    def spare(z):
        """Volume rate left when R_b i is taken off the supply, i = (u - kappa q)/R."""

        def imbalance(q):
            u = (24.0 + 0.2 * p.kappa * q) / 1.2
            return motor_rhs(State(q, 0.0, z, 0.0), u, p).q

        return brentq(imbalance, 1e-15, 1.0, xtol=1e-20) - p.k_l * z

    assert found.holding_depth == pytest.approx(brentq(spare, 1.0, found.depth * 0.999), rel=1e-6)
    assert found.holding_depth < found.depth
    assert found.limit is None
    assert found.within_limit is None
    shallow = stall(p, depth=500.0, depth_limit=None)
    assert shallow.extending_rate == pytest.approx(spare(500.0) + p.k_l * 500.0, rel=1e-6)


def test_unloaded_motor_never_stalls_and_a_weak_one_never_starts(feup):
    p = plant(feup)
    assert stall(p._replace(load_drive=0.0), depth=0.0, depth_limit=10.0).depth == math.inf
    weak = stall(p._replace(friction=13.0), depth=0.0, depth_limit=10.0)
    assert (weak.depth, weak.extending_rate, weak.within_limit) == (0.0, 0.0, False)


def test_neutral_volume_leaves_the_stroke(feup, lossy):
    found = neutral_volume(plant(feup), down_to=100.0)
    assert (found.depths[0], found.depths[-1]) == (0.0, 100.0)
    np.testing.assert_allclose(found.volumes, [4.04e-6 * z for z in found.depths])
    assert found.leaves_stroke == pytest.approx(350e-6 / 4.04e-6)
    # Stiffer than water and trimmed light: it leaves through the lower stop.
    other = neutral_volume(plant(lossy), down_to=200.0)
    assert other.leaves_stroke == pytest.approx(310e-6 / 8e-7)
    for vehicle, leaves in ((feup, found), (lossy, other)):
        below, above = (
            vehicle.neutral_volume(leaves.leaves_stroke * f) for f in (1 - 1e-9, 1 + 1e-9)
        )
        assert vehicle.stroke.minimum < below < vehicle.stroke.maximum
        assert not vehicle.stroke.minimum < above < vehicle.stroke.maximum
    assert neutral_volume(plant(feup)._replace(psi=0.0), down_to=1.0).leaves_stroke == math.inf


def test_depth_load_of_the_paper_is_1_9_percent_of_psi(feup):
    p = plant(feup)
    found = depth_load(p, k_pV=1002e3)
    assert found.extra_psi == pytest.approx(7.707e-2 / 1002e3, rel=1e-12)
    assert found.extra_psi == pytest.approx(7.7e-8, rel=2e-3)
    assert found.share_of_psi == pytest.approx(0.019, abs=5e-4)
    assert found.doubling_time < found.doubling_time_rejected


@given(st.floats(1e4, 1e7), st.floats(0.0, 1e-8))
def test_depth_load_is_what_the_settled_inner_loop_lets_through(k_pV, k_l):
    p = _PLANT._replace(k_l=k_l)
    formula = depth_load(p, k_pV=k_pV)
    system = linearise(p)  # states (q, V, z, w), closed by u = k_pV (U - V)
    actuator = system.A[:2, :2] - k_pV * system.B[:2] @ np.array([[0.0, 1.0]])
    settled = np.linalg.solve(actuator, -system.A[:2, 2])[1]
    assert -settled == pytest.approx(formula.extra_psi, rel=1e-9)


_PLANT = Plant(
    positioner=0.0,
    T1=0.09,
    gain=3.33e-6,
    load_drive=0.07707,
    load_back=0.05,
    friction=0.0,
    k_l=0.0,
    rate=0.0,
    supply=12.0,
    sag=0.0,
    kappa=0.0,
    V_min=-3.5e-4,
    V_max=3.5e-4,
    a_b=218.6,
    psi=4.04e-6,
    V_0=0.0,
    d_l=0.0275,
    d_b=0.0,
    d_0=0.0,
    d_t=0.0,
    epsilon=math.inf,
    z_surface=0.0,
    a_s=0.0,
    z_air=-1.0,
    z_bottom=math.inf,
)


def test_inner_loop_settles_there_in_the_nonlinear_motion(feup):
    """Hold the depth, let the inner loop settle from one depth to another, and look at V."""
    p = plant(feup)
    k_pV, settled = 1002e3, []
    for z in (10.0, 60.0):
        q, V, dt = 0.0, 0.0, 1e-3
        for _ in range(20_000):
            rates = motor_rhs(State(q, V, z, 0.0), k_pV * (1e-4 - V), p)
            q, V = q + dt * rates.q, V + dt * rates.V
        settled.append(V)
    assert (settled[0] - settled[1]) / 50.0 == pytest.approx(7.691617e-8, rel=1e-5)


def test_depth_load_matters_most_where_psi_is_nothing(feup):
    p = plant(feup)._replace(psi=0.0)
    found = depth_load(p, k_pV=1002e3)
    assert found.share_of_psi == math.inf
    # w' = a_b extra z - d_l w: the growing root of s^2 + d_l s - a_b extra.
    root = (-p.d_l + math.sqrt(p.d_l**2 + 4.0 * p.a_b * found.extra_psi)) / 2.0
    assert found.doubling_time == pytest.approx(math.log(2.0) / root)
    assert found.doubling_time_rejected == math.inf
    assert doubling_time(linearise(p._replace(load_drive=0.0))) == math.inf
