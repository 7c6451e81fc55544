"""The start of a run in a mission against SciPy with the line's pressure as a state, eq. (1).

The mission lets a pump run without delivery for as long as its line takes to come to the sea's
pressure, then at the steady rate of that pressure. Here the pressure in the line is integrated from
the run's begin to its end, with a check valve that opens by it.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from swimbladder.mission.core.names import Drive, Note, Row
from swimbladder.mission.flight import fly_mission
from swimbladder.mission.power import drive_energy
from swimbladder.mission.prepare import Accuracy
from swimbladder.parameters import Oil, PowerLawPump
from tests.mission.conftest import phases

ATMOSPHERE, RESERVOIR, N = 101325.0, 0.85e5, 1.4
PUMP = PowerLawPump(delivery=1.2e-6, slip=5e-14, idle_power=7.0, power_per_pressure=2e-6)
TIGHT = Accuracy(relative=1e-8, depth=1e-7, speed=1e-9, volume=1e-13)
OPENS = 2e-9  # m3/s/Pa: 600 Pa for the pump's rate, 0.6 permille of the least pressure here


def by_scipy(line, begin, end, depth, pressure):
    """Volume [m3] and energy [J] of a run, the line's pressure going by eq. (1)."""

    def sea(t):
        return ATMOSPHERE + float(pressure(depth(t)))

    def slope(t, y):  # of the logarithm of the line's pressure, volume [cm3], energy [J]
        p = np.exp(y[0])
        gas = line.volume * line.trapped_air * (ATMOSPHERE / p) ** (1.0 / N)
        give = (line.volume - gas) / line.bulk_modulus + gas / (N * p)
        out = OPENS * max(p - sea(t), 0.0)
        flow = PUMP.delivery - PUMP.slip * (p - RESERVOIR)
        drawn = PUMP.idle_power + PUMP.power_per_pressure * (p - RESERVOIR)
        return [(flow - out) / (give * p), 1e6 * out, drawn]

    def opened(t, y):
        return y[0] - np.log(sea(t))

    opened.terminal = True
    y, t, events = [np.log(RESERVOIR), 0.0, 0.0], begin, opened
    while t < end:  # on either side of the valve's opening, where the slope has a kink
        found = solve_ivp(
            slope, (t, end), y, method="Radau", events=events, rtol=1e-8, atol=[1e-9, 1e-8, 1e-7]
        )
        assert found.success
        y, t, events = found.y[:, -1], float(found.t[-1]), None
    return 1e-6 * y[1], y[2]


@pytest.mark.parametrize(("volume", "air"), [(2e-5, 0.0), (2e-5, 0.05), (1e-4, 0.02)])
def test_a_run_is_that_of_the_lines_pressure(profiler, sea, volume, air):
    line = Oil(volume=volume, bulk_modulus=1.4e9, trapped_air=air)
    actuator = profiler.actuator.model_copy(
        update={"pump": PUMP, "line": line, "start_volume": 0.0, "internal_pressure": RESERVOIR}
    )
    supply = profiler.supply.model_copy(update={"internal_resistance": 0.0})
    vehicle = profiler.model_copy(update={"actuator": actuator, "supply": supply})
    flight = fly_mission(vehicle, phases(), sea, accuracy=TIGHT)
    rows = flight.rows[np.concatenate(([True], np.diff(flight.rows[:, Row.T]) > 0.0))]
    depth = CubicHermiteSpline(rows[:, Row.T], rows[:, Row.Z], rows[:, Row.W])
    pressure = CubicHermiteSpline(sea.depth, sea.pressure, sea.density * sea.gravity)
    spent = flight.rows[:, Row.T], drive_energy(flight.rows)
    deep = flight.notes[flight.notes[:, Drive.Z] > 30.0]
    pumped = np.flatnonzero(deep[:, Drive.WHAT] == Note.PUMP)
    assert pumped.size >= 3
    for k in pumped:
        run, over = deep[k], deep[k + 1 :][deep[k + 1 :, Drive.WHAT] == Note.RUN_OVER][0]
        begin, end = run[Drive.T], over[Drive.T]
        moved, energy = by_scipy(line, begin, end, depth, pressure)
        flown = over[Drive.V] - run[Drive.V]
        used = np.interp(end, *spent) - np.interp(begin, *spent)
        # the valve's opening takes 600 Pa of the line's give; the sea's pressure changes meanwhile
        assert flown == pytest.approx(moved, rel=1e-3)
        # priming is entered at the power that the sea's pressure takes: too much, and by less than
        # the difference to the reservoir's for as long as it lasts
        head = ATMOSPHERE + float(pressure(run[Drive.Z])) - RESERVOIR
        primed = (end - begin) - flown / (PUMP.delivery - PUMP.slip * head)
        assert -1e-3 * energy < used - energy < PUMP.power_per_pressure * head * primed + 0.01
        assert used < 1.22 * energy
        if flown > 3.9e-6:
            assert used == pytest.approx(energy, rel=0.07)
