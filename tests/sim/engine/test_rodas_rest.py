"""What counts as rest: how large an oscillation may be, and what lifts off the bottom."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from swimbladder.io.config import load_vehicle
from swimbladder.physics.hull import heat_expansion, neutral_volume
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.records import NOTE, WORK, Account, Lane, Table
from swimbladder.sim.engine.rodas.step import lift_volume, settle
from tests.sim.mission.conftest import stratified
from tests.sim.mission.test_hull_heat import heated
from tests.vehicles import LINEAR, screw

DEEP = 100.0  # m, where it rests
ACCURACY = Accuracy(rest_deep=1e-2, rest_afloat=5e-2)


def lane_of(vehicle, column, depth):
    """A vehicle without a leak at rest, alone in still water."""
    given = given_of(vehicle, column, bottom=math.inf, accuracy=ACCURACY)
    table, _ = make_table(vehicle, column)
    table[:, Table.LEAKAGE : Table.LEAKAGE + 2] = 0.0
    x, at = first_lane(given, table, depth)
    notes, counts = np.zeros(0, NOTE), np.zeros(3, np.int64)
    accounts, work = np.zeros(len(Account)), np.zeros(WORK)
    return Lane(given, table, np.zeros((0, 6)), x, at, accounts, notes, counts, work)


def stiffness(vehicle, column, depth):
    """What a metre off its depth pulls it back by, over its mass [1/s2]."""
    weight = vehicle.water.specific_weight
    near = np.interp([depth - 1.0, depth + 1.0], column.depth, neutral_volume(vehicle, column))
    return weight * (near[0] - near[1]) / 2.0 / vehicle.mass


def middle_afloat(vehicle, column):
    """Where waterplane and neutral volume balance all volume out [m]."""
    hull, volumes = vehicle.hull, neutral_volume(vehicle, column)
    slope = (volumes[1] - volumes[0]) / column.depth[1]
    light = volumes[0] - vehicle.stroke.maximum
    return brentq(
        lambda z: light + slope * z + hull.waterplane_area * (hull.emergence_depth - z), -9.0, 9.0
    )


@pytest.mark.parametrize("share", [0.96, 1.04])
@pytest.mark.parametrize("angle", [0.0, 0.8, 0.5 * math.pi])
@pytest.mark.parametrize("afloat", [False, True])
@pytest.mark.parametrize("vehicle", [load_vehicle("example-float"), screw(drag=LINEAR)])
def test_it_rests_where_its_oscillation_without_drag_is_below_the_limit(
    share, angle, afloat, vehicle
):
    """x^2 + (w/omega)^2 of a spring: of the water's, afloat of the waterplane's too."""
    column = uniform_column(vehicle.water, 400.0)
    lane = lane_of(vehicle, column, 0.0 if afloat else DEEP)
    omega2 = stiffness(vehicle, column, 1.0 if afloat else DEEP)
    middle, limit = DEEP, ACCURACY.rest_deep
    if afloat:
        middle, limit = middle_afloat(vehicle, column), ACCURACY.rest_afloat
        weight = vehicle.water.specific_weight
        omega2 += weight * vehicle.hull.waterplane_area / vehicle.mass
    w = share * limit * math.sqrt(omega2) * math.sin(angle)
    lane.x["z"], lane.x["w"] = middle + share * limit * math.cos(angle), w
    settle(lane)
    assert lane.at["rests"] == (share < 1.0)
    if share < 1.0:
        assert lane.x["w"] == 0.0
        assert lane.accounts[Account.SETTLED] == pytest.approx(0.5 * vehicle.mass * w**2)


@pytest.mark.parametrize("share", [-1.04, -0.96, 0.96, 1.04])
def test_a_hull_that_is_yet_to_warm_rests_where_that_moves_it_by_less_than_the_limit(share):
    """E (T_water - T) over the slope of the neutral volume is the way that it has to go."""
    vehicle = heated(load_vehicle("example-float"))
    column = uniform_column(vehicle.water, 400.0)
    lane = lane_of(vehicle, column, DEEP)
    volumes = neutral_volume(vehicle, column)
    slope = np.interp(DEEP + 1.0, column.depth, volumes) - np.interp(DEEP, column.depth, volumes)
    colder = share * ACCURACY.rest_deep * -slope / heat_expansion(vehicle)
    lane.x["hull"] -= colder
    lane.x["v"] += heat_expansion(vehicle) * colder
    settle(lane)
    assert lane.at["rests"] == (abs(share) < 1.0)


def test_it_lifts_off_where_it_is_neutral_with_its_trim_and_what_its_hull_gives():
    """V_neutral + trim + give z + E (T_water - T), and no rounding above it."""
    vehicle, column = heated(load_vehicle("example-float")), stratified()
    lane = lane_of(vehicle, column, DEEP)
    lane.p["trim"], lane.p["give"] = 3e-6, 2e-7
    water = float(np.interp(DEEP, column.depth, column.temperature))
    found = lift_volume(lane.p, lane.table, DEEP, water - 4.0)
    neutral = float(np.interp(DEEP, column.depth, neutral_volume(vehicle, column)))
    due = neutral + 3e-6 + 2e-7 * DEEP + 4.0 * heat_expansion(vehicle)
    assert found == pytest.approx(due, abs=2e-12 * (lane.p["v_max"] - lane.p["v_min"]))
