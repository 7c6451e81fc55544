"""A release followed: the actuator's limits, when moves happen, where a record ends."""

import math
from dataclasses import replace

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.design.experiments.conditions import Ramps, Release, follow, ramps
from swimbladder.design.plan import Move
from swimbladder.errors import InputError
from swimbladder.sim.pool import timed_travel
from tests.design.experiments.truth import Vehicle, depths
from tests.quoted import refused

CM3 = 1e-6
TRUE = Vehicle(K2=7935.54, T2=36.3, psi=4.04e-6)


def test_the_actuator_goes_at_its_limit(vehicle, setting, limits):
    """Of the supply, against the deepest sea: the closed form of eqs (21)-(22)."""
    for way, depth, sign in ((limits.out, 3.75, 1.0), (limits.back, 0.75, -1.0)):
        expected = [
            75e-4
            * timed_travel(12.0 * sign, 0.3 * k, K1=0.444e-3, T1=0.09, opposing=7.707e-2 * depth)[0]
            for k in range(10)
        ]
        assert way[:10] == pytest.approx(sign * np.array(expected), rel=1e-9, abs=1e-15)
    # The stroke less the neutral volume of the range, with three deviations of it to spare.
    assert limits.most == pytest.approx(350e-6 - 3.75 * 4.04e-6 - 1.5e-6)
    assert limits.least == pytest.approx(-350e-6 - 0.75 * 4.04e-6 + 1.5e-6)
    few = ramps(vehicle, replace(setting, largest=50e-6))
    assert (few.most, few.least) == (50e-6, -50e-6)


def test_a_positioner_goes_at_its_speed(setting):
    small = sb.load_vehicle("ntnu-bv")
    way = ramps(small, setting)
    rate = 2.44e-3 * math.pi * 0.02**2
    assert way.out[:8] == pytest.approx(rate * 0.3 * np.arange(8))
    assert way.most < -way.least  # it floats with more than half of its stroke out


def test_a_stroke_or_a_supply_that_leaves_nothing_is_refused(vehicle, setting):
    full = vehicle.model_copy(update={"trim_error": 349e-6})
    with refused(InputError, field="stroke"):
        ramps(full, setting)
    weak = vehicle.supply.model_copy(update={"voltage": 0.2})
    with refused(InputError, field="supply.voltage", value=0.2):
        ramps(vehicle.model_copy(update={"supply": weak}), setting)


def test_a_move_that_is_under_way_goes_on_from_where_it_is():
    way = Ramps(np.array([0.0, 1.0, 3.0, 5.0]), np.array([0.0, 2.0, 4.0]), 10.0, -10.0)
    assert way.move(1.0, 5.0, 6).tolist() == [1.0, 2.0, 4.0, 5.0, 5.0, 5.0]
    assert way.move(1.0, -2.0, 4).tolist() == [1.0, -1.0, -2.0, -2.0]


RELEASES = [
    Release.to_and_fro(3.75, [30 * CM3], []),
    Release.to_and_fro(0.75, [-20 * CM3, 25 * CM3, -20 * CM3], [1.9, 2.4]),
    Release.to_and_fro(3.75, [15 * CM3, 0.0], [2.9]),
]


@pytest.mark.parametrize("release", RELEASES)
def test_the_depths_are_those_of_an_exact_integration(release, conditions):
    f = follow(release, conditions.question.values, conditions)
    exact = depths(TRUE, f.volume, release.start, 0.3)
    assert np.abs(exact - f.depth).max() < 1e-9
    assert f.complete


def test_a_record_is_what_the_plan_says(conditions):
    release = RELEASES[1]
    f = follow(release, conditions.question.values, conditions)
    first, second, third = f.moved
    assert f.time[first] == pytest.approx(5.1)  # whole samples of the 5 s at rest
    assert np.all(f.volume[: first + 1] == 0.0)
    assert f.depth[second - 1] <= 1.9 < f.depth[second]
    assert f.depth[third] < 2.4 <= f.depth[third - 1]
    assert f.volume[second - 1] == pytest.approx(-20e-6)
    assert f.volume[third] == pytest.approx(25e-6)
    assert f.ended == "deepest"
    assert f.depth.max() <= 3.75
    assert f.duration == pytest.approx(f.time[-1] - 5.1)


def test_a_move_that_comes_too_late_does_not_happen(conditions):
    release = Release.to_and_fro(3.75, [150 * CM3, -20 * CM3], [0.9])
    f = follow(release, conditions.question.values, conditions)
    assert len(f.moved) == 2
    gone = release._replace(moves=(*release.moves, Move(volume=30 * CM3, depth=3.0, going="down")))
    late = follow(gone, conditions.question.values, conditions)
    assert not late.complete
    assert late.ended == "shallowest"


def test_the_longest_record_ends(conditions):
    short = conditions._replace(setting=replace(conditions.setting, longest=20.0))
    f = follow(RELEASES[0], conditions.question.values, short)
    assert f.ended == "longest"
    assert f.duration == pytest.approx(20.1)
