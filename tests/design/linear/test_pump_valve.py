"""A pump and valve without its loop: the body's motion against SciPy, stall against arithmetic."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder import load_vehicle
from swimbladder.design.analysis import analyse
from swimbladder.design.linear.pump_valve import drag_slope, motions, moved_by_volume, pump_stall
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.dynamics import acceleration, plant
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.vehicle.actuators import PowerLawPump

FLOAT = load_vehicle("example-float")
PLANT = plant(moved_by_volume(FLOAT))


def softer(psi: float):
    return FLOAT.model_copy(update={"hull": FLOAT.hull.model_copy(update={"psi": psi})})


@pytest.mark.parametrize("psi", [-4.9e-8, 3e-8])
@pytest.mark.parametrize("speed", [0.0, 0.02, 0.1])
def test_the_poles_are_those_of_the_differentiated_motion(psi, speed):
    p = PLANT._replace(psi=psi)
    V = psi * 500.0 + p.V_0 - (p.d_t / p.a_b) * speed**2  # keeps the speed at 500 m
    dz, dw = 0.1, 1e-5
    A = np.array(
        [
            [0.0, 1.0],
            [
                (acceleration(V, 500.0 + dz, speed, p) - acceleration(V, 500.0 - dz, speed, p))
                / (2.0 * dz),
                (acceleration(V, 500.0, speed + dw, p) - acceleration(V, 500.0, speed - dw, p))
                / (2.0 * dw),
            ],
        ]
    )
    one = next(m for m in motions(softer(psi), p) if m.speed == speed)
    found = sorted(one.poles, key=lambda s: (s.real, s.imag))
    expected = sorted(np.linalg.eigvals(A), key=lambda s: (s.real, s.imag))
    np.testing.assert_allclose(found, expected, atol=1e-5)
    grows = max(s.real for s in expected)
    if psi > 0.0:
        assert one.growth_time == pytest.approx(1.0 / grows, rel=1e-2)
    else:
        assert one.growth_time == math.inf


def test_at_rest_it_swings_with_the_period_that_is_stated():
    def motion(_, y):
        return [y[1], acceleration(PLANT.psi * 500.0 + PLANT.V_0, y[0], y[1], PLANT)]

    def turns(_, y):
        return y[1]

    flown = solve_ivp(motion, (0.0, 4000.0), [500.05, 0.0], events=turns, rtol=1e-10, atol=1e-12)
    times = flown.t_events[0]
    half = float(np.diff(times[times > 1.0])[0])
    assert motions(FLOAT, PLANT)[0].period == pytest.approx(2.0 * half, rel=1e-3)


def test_a_speed_follows_its_volume_with_the_time_constant_that_is_stated():
    p = PLANT._replace(psi=0.0)
    force = p.d_t / p.a_b * 0.1**2

    def motion(_, w):
        return [acceleration(p.V_0 - 1.001 * force, 500.0, w[0], p)]

    one = next(m for m in motions(FLOAT, p) if m.speed == 0.1)
    end = math.sqrt(1.001) * 0.1
    after = solve_ivp(motion, (0.0, one.time_constant), [0.1], rtol=1e-10, atol=1e-14).y[0, -1]
    assert (end - after) / (end - 0.1) == pytest.approx(math.exp(-1.0), rel=2e-3)
    assert drag_slope(p, -0.1) == pytest.approx(1.0 / one.time_constant)


def test_a_power_law_stalls_where_its_delivery_ends():
    pump = PowerLawPump(
        kind="power-law", delivery=1e-6, slip=1e-13, idle_power=1.0, power_per_pressure=1e-6
    )
    a = FLOAT.actuator.model_copy(update={"pump": pump})
    slipping = FLOAT.model_copy(update={"actuator": a})
    weight = FLOAT.water.specific_weight
    head = 1e-6 / 1e-13
    deepest = (head - ATMOSPHERIC_PRESSURE + a.internal_pressure) / weight
    s = pump_stall(slipping, depth=500.0)
    assert s.depth == pytest.approx(deepest, rel=1e-9)
    lost = (1e-6 - a.leakage * 1e7) / 1e-13  # nearly
    assert s.holding_depth == pytest.approx(lost / weight, rel=1e-2)
    assert s.within_limit is False
    found = analyse(slipping, depth=1500.0)
    assert not found.rests
    assert "leaks back" in " ".join(found.sentences)


def test_the_stall_of_a_datasheet_is_where_its_map_ends():
    s = pump_stall(FLOAT, depth=1000.0)
    weight = FLOAT.water.specific_weight
    above, below = drive_map(
        FLOAT, weight * s.depth * np.array([0.999, 1.001]), power=False
    ).rate_out
    assert above > 0.0 == below
    assert s.extending_rate == drive_map(FLOAT, [weight * 1000.0]).rate_out[0]
    assert s.depth_without_sag > s.depth
