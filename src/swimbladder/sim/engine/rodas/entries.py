"""What a step is entered with: volume, work, electrical energy, what is left in the battery."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.line import advance_line, stalls
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.motion import displaced, drag, inside, lagging, rate_of, terms
from swimbladder.sim.engine.rodas.records import Account, Doing, Lane, Table

Array = NDArray[np.float64]


_moved = inlined(moved)
# Lobatto's rule of four points on [0, 1] (Abramowitz and Stegun 25.4.32), exact to degree 5
_INNER = 0.5 - 0.1 * math.sqrt(5.0)


@part
def enter_step(lane: Lane, loads: float, h: float) -> None:
    """Enter a step of h [s] to work[0] in the accounts, by Lobatto's rule on its cubic."""
    p, table, waves, x, at = lane.p, lane.table, lane.waves, lane.x, lane.at
    accounts, work = lane.accounts, lane.work
    y, k1, k2 = work[0], work[2], work[3]
    doing, shut = at.doing, at.shut == 1
    sums = work[4]
    sums[:] = 0.0
    for n in range(4):
        s = 0.0 if n == 0 else (_INNER if n == 1 else (1.0 - _INNER if n == 2 else 1.0))
        share = h / 12.0 if n == 0 or n == 3 else 5.0 * h / 12.0
        z = inside(x.z, y[0], k1[0], k2[0], s)
        w = inside(x.w, y[1], k1[1], k2[1], s)
        v = inside(x.v, y[2], k1[2], k2[2], s)
        sums[0] += share * p.mass * drag(p, w)[0] * w
        sums[1] += share * power(p, table, doing, z)
        way, dz = 0.0, w
        hull = inside(x.hull, y[3], k1[3], k2[3], s)
        if waves.shape[0] > 0:
            t = x.t + s * h
            dz, pull, _, _ = terms(lane, t, z, w, v, hull)
            sums[4] += share * p.mass * (pull + drag(p, w)[0]) * (dz - w)
            way = _moved(waves, z, t)[0]
            slope = value(table, p.step, Table.PRESSURE, z)[1]
            sums[4] -= share * slope * displaced(p, table, z, way)[0] * dz
        rate = rate_of(p, table, doing, shut, z, v, dz)[0]
        if rate != 0.0:
            sums[2] += share * rate * value(table, p.step, Table.PRESSURE, z)[0]
        elif doing == Doing.PUMPING or stalls(lane, z):
            sums[3] += share
        if p.follows > 0.0:
            slope = value(table, p.step, Table.PRESSURE, z)[1]
            sums[5] -= share * slope * lagging(p, table, z - way, hull)[0] * dz
    accounts[Account.DRAG] += sums[0]
    accounts[Account.FORCED] += sums[4]
    accounts[Account.HEAT] += sums[5]
    energy = advance_line(lane, y[0], h, sums[1])
    enter(accounts, doing, y[2] - x.v, sums[2], energy, h)
    accounts[Account.STALLED] += sums[3]
    enter_energy(p, x, accounts, energy, loads, h)


@part
def power(p: Any, table: Array, doing: int, z: float) -> Any:
    """Return the electrical power of what the drive does at depth z [W]."""
    what = Table.HOLDING
    if doing in (Doing.PUMPING, Doing.PRIMING):
        what = Table.POWER_OUT
    elif doing == Doing.LETTING_IN:
        what = Table.POWER_IN
    elif doing != Doing.NOTHING:
        what = Table.POWER_BYPASS
    return value(table, p.step, what, max(z, 0.0))[0]


@part
def enter(
    accounts: Array, doing: int, change: float, work_done: float, energy: float, h: float
) -> None:
    """Enter volume [m3], work on the sea [J] and electrical energy [J] under what was done."""
    if doing in (Doing.PUMPING, Doing.PRIMING):
        accounts[Account.PUMPED] += change
        accounts[Account.PUMP_WORK] += work_done
        accounts[Account.PUMP_ENERGY] += energy
        accounts[Account.PUMP_TIME] += h
    elif doing == Doing.NOTHING:
        accounts[Account.LEAKED] -= change
        accounts[Account.LEAK_WORK] -= work_done
        accounts[Account.HOLDING_ENERGY] += energy
    else:
        accounts[Account.LET_IN] -= change
        accounts[Account.LET_IN_WORK] -= work_done
        accounts[Account.VALVE_ENERGY] += energy
        accounts[Account.VALVE_TIME] += h


@part
def enter_energy(p: Any, x: Any, accounts: Array, drive: float, loads: float, h: float) -> None:
    """Take the drive's energy [J] and the loads' power [W] over h [s] from the battery.

    dC/dt = -P - s C, in closed form.
    """
    accounts[Account.LOAD_ENERGY] += loads * h
    drawn = drive + loads * h
    s = p.self_discharge * h
    if s > 0.0:
        lost = -x.charge * math.expm1(-s) - drawn * (1.0 + math.expm1(-s) / s)
        accounts[Account.SELF_DISCHARGED] += lost
        x.charge -= lost
    x.charge -= drawn
