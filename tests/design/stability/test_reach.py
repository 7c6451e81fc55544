"""From where no controller comes back, against integration of the motion by SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.design.stability.recover import (
    edge_speed,
    falls,
    fastest_rate,
    holdable_depth,
    unstable_rate,
)
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import acceleration, plant

P = plant(load_vehicle("feup-em"))._replace(a_s=0.0)
BENT = P._replace(epsilon=0.0, d_b=P.d_l, d_t=0.5)


def depth_after(p, depth, speed, volume, control, time=600.0):
    """Return the depth that a volume rate control(t) [m3/s], within limits, leads to."""

    def rates(t, x):
        z, w, V = x
        rate = min(max(control(t), -fastest_rate(p)), fastest_rate(p))
        rate = 0.0 if (p.V_max <= V and rate > 0.0) or (p.V_min >= V and rate < 0.0) else rate
        return [w, acceleration(min(max(V, p.V_min), p.V_max), z, w, p), rate]

    end = solve_ivp(
        rates, (0.0, time), [depth, speed, volume], rtol=1e-10, atol=1e-10, max_step=2.0
    )
    return float(end.y[0, -1])


def extend(_):
    return math.inf


@pytest.mark.parametrize("depth", [2.0, 30.0, 80.0])
def test_the_edge_parts_what_the_fastest_extension_saves(depth):
    volume = P.psi * depth + P.V_0
    edge = edge_speed(P, depth=depth, volume=volume)
    assert depth_after(P, depth, edge - 1e-3, volume, extend) < holdable_depth(P)
    assert depth_after(P, depth, edge + 1e-3, volume, extend) > 2.0 * holdable_depth(P)


def test_without_a_limit_on_the_rate_it_is_the_stroke_that_ends():
    quick = P._replace(gain=1e3)
    s = unstable_rate(P)
    assert s * s + P.d_l * s == pytest.approx(P.a_b * P.psi)
    edge = edge_speed(quick, depth=0.0, volume=0.0)
    assert edge == pytest.approx(P.a_b * P.V_max / s, rel=1e-6)
    # At rest: where the whole stroke just balances.
    assert edge_speed(quick, depth=holdable_depth(P), volume=0.0) == pytest.approx(0.0, abs=1e-4)
    assert edge_speed(P, depth=2.0, volume=8e-6) < edge_speed(quick, depth=2.0, volume=8e-6)


def test_no_controller_that_was_drawn_comes_back_from_beyond():
    rng = np.random.default_rng(1)
    for p in (P, BENT):
        for depth in (10.0, 60.0):
            volume = p.psi * depth + p.V_0
            edge = edge_speed(p, depth=depth, volume=volume)
            if math.isinf(edge):
                continue
            for _ in range(4):
                rates = rng.uniform(-1.0, 2.0, 60) * fastest_rate(p)
                held = depth_after(
                    p, depth, edge + 0.05, volume, lambda t, r=rates: r[min(int(t / 5.0), 59)]
                )
                assert held > holdable_depth(p)


def test_integration_agrees_where_there_is_a_formula():
    straight = P._replace(epsilon=0.0, d_b=P.d_l, d_t=0.0)
    for depth in (1.0, 50.0):
        volume = P.psi * depth
        formula = edge_speed(P, depth=depth, volume=volume)
        assert edge_speed(straight, depth=depth, volume=volume) == pytest.approx(formula, abs=1e-3)
    # Turbulent drag stops a fall that laminar drag alone does not.
    volume = P.psi * 75.0
    assert edge_speed(BENT, depth=75.0, volume=volume) > edge_speed(P, depth=75.0, volume=volume)


def test_a_hull_that_is_stiffer_than_water_never_falls():
    stiff = P._replace(psi=-1e-6)
    assert not falls(stiff, depth=1e3, speed=5.0, volume=0.0)
    assert edge_speed(stiff, depth=1e3, volume=0.0) == math.inf
    assert holdable_depth(stiff) == math.inf
    assert unstable_rate(stiff) == 0.0
