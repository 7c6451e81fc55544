"""Swell: linear wave theory, against a body integrated in the waves themselves."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from swimbladder.design.law_comparison.contenders import SCENARIOS
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.water import Swell, amplitude, depth_error, wavenumber

FEUP = load_vehicle("feup-em")
G = FEUP.water.gravity


def tall(height=1.285, emergence=0.0):
    hull = FEUP.hull.model_copy(update={"height": height, "emergence_depth": emergence})
    return FEUP.model_copy(update={"hull": hull})


def test_deep_water_waves_are_as_long_as_they_should_be():
    """L = 1.56 T^2 in metres, Dean and Dalrymple (1991), ch. 3."""
    assert 2.0 * math.pi / wavenumber(10.0, 9.81) == pytest.approx(156.1, abs=0.1)


@pytest.mark.parametrize("emergence", [0.0, 0.3])
def test_the_reading_is_that_of_a_neutral_body_in_the_waves(emergence):
    """The body's own equation in a fixed frame: forces of the waves along the hull, drag by the
    speed against the mean of the water, buoyancy as the pressure in the hull's middle has it.
    """
    vehicle = tall(emergence=emergence)
    height, z0 = vehicle.hull.height, 2.0
    p = plant(vehicle)
    period, phase = 8.0, 0.7
    swell = Swell(0.2, (period,))  # low waves: linear theory is for small ones
    a, k, w = amplitude(swell), wavenumber(period, G), 2.0 * math.pi / period
    phases = np.random.default_rng([5, 2]).uniform(0.0, 2.0 * math.pi, (1, 1))
    phase = float(phases[0, 0])

    def along(depth_of_sensor, f):
        """The mean of f over the hull, whose top is above the sensor by the emergence depth."""
        top = depth_of_sensor - emergence
        return quad(f, top, top + height)[0] / height

    still = along(z0, lambda s: math.exp(-k * s))  # linear: where the body rests

    def water_speed(t):  # positive down; the surface goes as a cos(w t + phase) upwards
        return a * w * math.sin(w * t + phase) * still

    def water_acceleration(t):
        return a * w * w * math.cos(w * t + phase) * still

    def motion(t, y):
        speed = y[1]
        return speed, -p.d_l * (speed - water_speed(t)) + water_acceleration(t)

    time = np.arange(0.0, 120.0, 0.25)
    went = -a * math.cos(phase) * still  # it starts where the water carries it
    ran = solve_ivp(
        motion, (0.0, time[-1]), [z0 + went, water_speed(0.0)], t_eval=time, rtol=1e-10, atol=1e-12
    )
    sensed = ran.y[0] + a * np.exp(-k * z0) * np.cos(w * time + phase)
    found = depth_error(swell, vehicle, time, depth=z0, runs=1, seed=5)[:, 0]
    assert np.ptp(found) > 1e-4  # there is something to be compared
    assert sensed - z0 == pytest.approx(found, abs=1e-7)


def test_it_fades_with_depth_and_with_the_length_of_the_hull():
    swell = next(s.swell for s in SCENARIOS if s.swell is not None)
    time = np.arange(0.0, 600.0, 0.5)

    def size(vehicle, depth):
        return float(depth_error(swell, vehicle, time, depth=depth, runs=3, seed=1).std())

    near, far = size(FEUP, 2.0), size(FEUP, 30.0)
    slow = [wavenumber(period, G) for period in swell.periods]
    assert math.exp(-28.0 * max(slow)) < far / near < math.exp(-28.0 * min(slow))
    assert size(tall(0.3), 2.0) < 0.3 * near
    assert size(tall(1e-6), 2.0) < 1e-6 * near


def test_the_height_is_four_times_the_deviation_of_the_surface():
    swell = Swell(1.2, (8.0, 10.0, 12.0))
    variance = sum(amplitude(swell) ** 2 / 2.0 for _ in swell.periods)
    assert 4.0 * math.sqrt(variance) == pytest.approx(1.2)


def test_runs_have_waves_of_their_own_and_a_seed_gives_them_again():
    swell, time = Swell(1.0, (8.0, 12.0)), np.arange(0.0, 60.0, 0.3)
    one = depth_error(swell, FEUP, time, depth=2.0, runs=4, seed=7)
    assert one.shape == (len(time), 4)
    assert np.array_equal(one, depth_error(swell, FEUP, time, depth=2.0, runs=4, seed=7))
    assert np.abs(one[:, 0] - one[:, 1]).max() > 1e-3
