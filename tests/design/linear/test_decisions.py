"""The map from decision to decision: against arithmetic, and against differences of flights."""

import math

import numpy as np
import pytest

from swimbladder import load_vehicle
from swimbladder.control.law import smooth
from swimbladder.control.registry import bind
from swimbladder.design.linear.margins import spectral_radius
from swimbladder.design.linear.pump_valve import (
    Delivery,
    decision_maps,
    decision_of,
    drive_rates,
    moved_by_volume,
)
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning.trial import fly
from swimbladder.physics.dynamics import drag_per_mass, plant

FLOAT = load_vehicle("example-float")
LAW, OWN = bind(FLOAT.controller)
PLANT = plant(moved_by_volume(FLOAT))
WAYS = {way.name: way for way in LAW.ways(OWN)}


def drag_coefficient(p, speed):
    return drag_per_mass(speed, p) / (p.a_b * speed**2)


@pytest.mark.parametrize("share", [0.3, 1.0, 1.9, 2.1])
def test_where_the_speed_follows_at_once_the_eigenvalue_is_that_of_the_ratio(share):
    """1 - eta c/c_true: a body without inertia (both a_b and d_t times 1e4), a stiff hull."""
    p = PLANT._replace(a_b=1e4 * PLANT.a_b, d_t=1e4 * PLANT.d_t, psi=0.0)
    d = decision_of(LAW, OWN, WAYS["far"], down=True)
    ratio = share * OWN.coefficient / drag_coefficient(p, OWN.far_speed)
    found = np.linalg.eigvals(decision_maps([p], d, [Delivery(share, 0.0)])[0])
    largest = found[np.argmax(np.abs(found))]
    assert largest == pytest.approx(1.0 - ratio, abs=2e-3)
    assert (spectral_radius(decision_maps([p], d, [Delivery(share, 0.0)])[0]) < 1.0) == (
        0.0 < ratio < 2.0
    )


def test_it_samples_when_the_law_does_and_acts_only_where_it_does():
    d = decision_of(LAW, OWN, WAYS["far"], down=True)
    assert d.samples == pytest.approx((0.0, OWN.dead, OWN.dead + OWN.run))
    slope = 2.0 * OWN.coefficient * OWN.far_speed / OWN.run
    np.testing.assert_allclose(d.slopes, (0.0, -slope, slope), rtol=1e-3, atol=1e-9)
    assert decision_of(LAW, OWN, WAYS["far"], down=True, faster=True) is None  # haste is welcome
    near = decision_of(LAW, OWN, WAYS["near"], down=True, faster=True)
    assert near.pumps
    assert not d.pumps
    assert decision_of(LAW, OWN, WAYS["ascent"], down=False).pumps
    assert all(getattr(smooth(LAW, OWN), name) == 0.0 for name in LAW.roundings)


@pytest.mark.parametrize(
    ("name", "down", "psi", "drive"),
    [
        ("far", True, -4.9e-8, (1.0, 1.0)),
        ("far", False, -4.9e-8, (0.9, 1.0)),
        ("near", True, -4.9e-8, (1.0, 1.2)),
        ("near", True, 4e-8, (1.0, 1.0)),
    ],
)
def test_the_map_is_that_of_flights_that_differ_a_little(name, down, psi, drive):
    """Flights of the whole vehicle, its drive and law, in which only speed and volume differ.

    Two errors at a decision, (dw, e, u), and what they are at the next; without bands and steps, as
    in the map. The pump's start and run are its delay.
    """
    way, sign = WAYS[name], 1.0 if down else -1.0
    bound = BoundLaw(LAW, smooth(LAW, OWN))
    p = PLANT._replace(psi=psi)
    slow = 0.97 * sign * way.speed  # so that the same drive acts in all flights
    begin = 1000.0
    steady = psi * begin + p.V_0 - drag_per_mass(slow, p) / p.a_b
    off_speed = np.array([0.0, 1e-4 * sign, 0.0])
    off_volume = np.array([0.0, 0.0, 1e-8])
    finely = FLOAT.actuator.model_copy(update={"quantum": 0.0})  # else small changes are cut
    flown = fly(
        FLOAT.model_copy(update={"actuator": finely}),
        bound,
        target=begin + sign * (way.distance + way.speed * 90.0),
        start_depth=begin,
        duration=90.0,
        start_speed=slow + off_speed,
        start_volume=steady + off_volume,
        vary={"psi": psi, "pump": drive[0], "valve": drive[1]},
    )
    first, second = int(OWN.run), int(OWN.run + OWN.dead + OWN.run)

    def errors(at: int, action: int) -> np.ndarray:
        k = int(np.flatnonzero(flown.time == at)[0])
        z, w, V = flown.depth[k], flown.speed[k], flown.volume[k]
        asked = np.array([acts[action, 1] for acts in flown.actions])
        assert all(acts[action, 0] == pytest.approx(at) for acts in flown.actions)
        rows = np.stack([w, psi * z - V, asked])
        return rows[:, 1:] - rows[:, :1]

    before, after = errors(first, 0), errors(second, 1)
    d = decision_of(LAW, OWN, way, down=down)
    rates = drive_rates(FLOAT, [begin])
    asked = abs(flown.actions[0][0, 1])
    share = drive[0] if d.pumps else drive[1]
    wait = (asked + rates.start_volume[0]) / rates.pump[0] if d.pumps else asked / rates.valve[0]
    M = decision_maps([p], d, [Delivery(share, wait)])[0]
    expected = M @ before
    size = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(after / size, expected / size, atol=0.06)


def test_pumping_longer_than_the_speed_needs_makes_it_unstable():
    """A speed that follows slowly, and a decision that does not wait for it."""
    slow = OWN._replace(slow_speed=0.005, near_speed=0.005, far_speed=0.005, dead=10.0, run=10.0)
    way = LAW.ways(slow)[0]
    d = decision_of(LAW, slow, way, down=True, faster=False)
    assert spectral_radius(decision_maps([PLANT], d, [Delivery(1.0, 0.0)])[0]) < 1.0
    assert spectral_radius(decision_maps([PLANT], d, [Delivery(1.0, 20.0)])[0]) > 1.0
    assert math.isfinite(d.period)
