"""One step of RODAS and the rate of the drive, on their own."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.io.config import load_vehicle
from swimbladder.physics.seawater import InternalWave, WaterMotion, motion_table
from swimbladder.physics.seawater import look_up as look
from swimbladder.sim.engine.rodas.motion import inside, rate_of, rosenbrock, terms
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.records import NOTE, WORK, Account, Doing, Lane, Table
from swimbladder.vehicle import Oil
from tests.sim.mission.conftest import stratified
from tests.sim.mission.test_hull_heat import heated
from tests.sim.mission.test_line import with_line

DEEP = 82.3  # m


def lane_of(vehicle, waves):
    column = stratified()
    given = given_of(vehicle, column, bottom=math.inf, accuracy=Accuracy())
    table, _ = make_table(vehicle, column)
    x, at = first_lane(given, table, DEEP)
    notes, counts = np.zeros(0, NOTE), np.zeros(3, np.int64)
    accounts, work = np.zeros(len(Account)), np.zeros(WORK)
    return Lane(given, table, waves, x, at, accounts, notes, counts, work)


@pytest.mark.parametrize("line", [False, True])
def test_half_a_step_has_less_than_a_twentieth_of_the_error_of_a_whole_one(line):
    """Of order 4: in depth, speed, volume and the hull's warmth, with the pump on, in a wave."""
    vehicle = heated(load_vehicle("example-float"), lag=20.0)
    if line:  # whose oil gives with the sea's pressure, and so with the speed
        vehicle = with_line(vehicle, Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.02))
    wave = InternalWave(amplitude=3.0, period=90.0, water_depth=380.0, phase=0.7)
    waves = motion_table(WaterMotion(internal_waves=(wave,)), 9.81)
    lane = lane_of(vehicle, waves)
    lane.x["t"], lane.x["w"] = 700.0, 0.1
    lane.at["doing"], lane.at["shut"] = Doing.PUMPING, 0
    lane.x["hull"] += 5.0
    begin = np.array([lane.x[name] for name in ("z", "w", "v", "hull")])
    ends, middles = [], []
    for h in (2.0, 1.0):
        rosenbrock(lane, h)
        y, _, k1, k2 = lane.work[:4, :4]
        middle, end = solve_ivp(
            lambda t, y: terms(lane, t, *y),
            (700.0, 700.0 + h),
            begin,
            t_eval=[700.0 + 0.5 * h, 700.0 + h],
            method="DOP853",
            rtol=1e-13,
            atol=1e-16,
        ).y.T
        ends.append(np.abs(y - end))
        middles.append(np.abs(inside(begin, y, k1, k2, 0.5) - middle))
    assert np.all(ends[0] / ends[1] > 20.0), ends  # 32, but for the next order
    assert np.all(middles[0] / middles[1] > 10.0), middles  # 16


@pytest.mark.parametrize("share", [0.01, 0.1, 1.0])
def test_a_pump_that_beats_a_valve_that_is_stuck_open_fills_an_empty_bladder(share):
    """One that is beaten leaves it empty, and draws down a volume that is there."""
    lane = lane_of(load_vehicle("example-float"), np.zeros((0, 6)))
    p, table = lane.p, lane.table
    p["open"] = p["open_running"] = share
    out, lets = (look(table, p["step"], n, DEEP)[0] for n in (Table.RATE_OUT, Table.RATE_IN))
    net = out - share * lets
    for volume in (p["v_min"], p["v_min"] + 1e-5):
        rate = rate_of(p, table, Doing.PUMPING, True, DEEP, volume, 0.0)[0]
        left = net if net > 0.0 or volume > p["v_min"] else 0.0
        assert rate == pytest.approx(left, rel=1e-12)
        idle = rate_of(p, table, Doing.NOTHING, True, DEEP, volume, 0.0)[0]
        assert idle == (pytest.approx(-share * lets) if volume > p["v_min"] else 0.0)
