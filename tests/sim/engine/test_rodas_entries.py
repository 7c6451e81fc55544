"""What a step is booked with: the integrals over its cubic, of each account's own integrand."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.seawater import InternalWave, WaterMotion, motion_table, moved
from swimbladder.physics.seawater import look_up as look
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.records import NOTE, WORK, Account, Doing, Lane, Table
from swimbladder.sim.engine.rodas.step import enter_step
from tests.sim.mission.conftest import stratified
from tests.sim.mission.test_hull_heat import heated

BEGIN = np.array([82.0, 0.1, 1e-4, 11.0])  # z [m], w [m/s], V [m3], T of the hull [degC]
BENDS = np.array([[1.5, -0.03, 6e-5, 0.4], [-2.0, 0.04, -9e-5, -0.6]])  # k1, k2 of the cubic
LASTS = 40.0  # s


def end_of(doing):
    return np.array([86.0, 0.16, 1.5e-4 if doing == Doing.PUMPING else 0.5e-4, 10.5])


def entered(doing, waves):
    """The cubic entered as a step of a float that lags behind the water; its lane."""
    vehicle, column = heated(load_vehicle("example-float")), stratified()
    given = given_of(vehicle, column, bottom=math.inf, accuracy=Accuracy())
    given["v_min"], given["v_max"] = -1.0, 1.0
    table, _ = make_table(vehicle, column)
    x, at = first_lane(given, table, BEGIN[0])
    x["t"], x["z"], x["w"], x["v"], x["hull"] = 700.0, *BEGIN
    at["doing"], at["shut"] = doing, 0
    accounts = np.zeros(len(Account))
    notes, counts, work = np.zeros(0, NOTE), np.zeros(3, np.int64), np.zeros(WORK)
    work[0, :4], work[2, :4], work[3, :4] = end_of(doing), *BENDS
    lane = Lane(given, table, waves, x, at, accounts, notes, counts, work)
    enter_step(lane, 0.0, LASTS)
    return vehicle, lane


def over_step(end, of):
    """The integral of a function of the time, and of the cubic's state then, over the step."""

    def at(s):
        bend = BENDS[0] + s * BENDS[1]
        return of(700.0 + s * LASTS, *(BEGIN * (1.0 - s) + s * (end + (1.0 - s) * bend)))

    return LASTS * quad(at, 0.0, 1.0, epsrel=1e-9)[0]


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("doing", [Doing.PUMPING, Doing.LETTING_IN])
def test_a_step_is_entered_with_the_integrals_over_its_cubic(doing, moves):
    """Work, energy, drag, what the moving water and the hull's heat take: each by quadrature."""
    wave = InternalWave(amplitude=12.0, period=2400.0, water_depth=380.0, phase=0.7)
    table = motion_table(WaterMotion(internal_waves=(wave,)), 9.81)
    waves = table if moves else table[:0]
    vehicle, lane = entered(doing, waves)
    step, out = float(lane.p["step"]), doing == Doing.PUMPING
    rates, powers = (Table.RATE_OUT, Table.POWER_OUT) if out else (Table.RATE_IN, Table.POWER_IN)

    def integral(function):
        return over_step(end_of(doing), function)

    def of(what, z):
        return look(lane.table, step, what, z)[0]

    def slope(z):
        return look(lane.table, step, Table.PRESSURE, z)[1]

    def water(t, z):
        return moved(waves, z, t) if moves else (0.0, 0.0)

    def layers(t, z):
        return of(Table.LAYERS, z - water(t, z)[0]) - of(Table.LAYERS, z)

    def heat(t, z, hull):
        grown = float(lane.p["expansion"])
        return grown * (of(Table.TEMPERATURE, z - water(t, z)[0]) - hull)

    def forced(t, z, w, v, hull):
        u = water(t, z)[1]
        push = slope(z) * (of(Table.NEUTRAL, z) + layers(t, z) + heat(t, z, hull) - v)
        return push * u - slope(z) * layers(t, z) * (w + u)

    work = integral(lambda _t, z, *_: of(rates, z) * of(Table.PRESSURE, z))
    energy = integral(lambda _t, z, *_: of(powers, z))
    due = {
        Account.DRAG: integral(lambda _t, _z, w, *_: drag_force(vehicle.drag, w) * w),
        Account.FORCED: integral(forced) if moves else 0.0,
        Account.HEAT: integral(
            lambda t, z, w, _, hull: -slope(z) * heat(t, z, hull) * (w + water(t, z)[1])
        ),
        Account.PUMPED if out else Account.LET_IN: abs(end_of(doing) - BEGIN)[2],
        Account.PUMP_WORK if out else Account.LET_IN_WORK: work,
        Account.PUMP_ENERGY if out else Account.VALVE_ENERGY: energy,
        Account.PUMP_TIME if out else Account.VALVE_TIME: LASTS,
        Account.STALLED: 0.0,
    }
    for account, right in due.items():
        assert lane.accounts[account] == pytest.approx(right, rel=1e-3, abs=1e-12), account
