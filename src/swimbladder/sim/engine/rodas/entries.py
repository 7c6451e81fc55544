"""What a step is entered with: volume, work, electrical energy, what is left in the battery."""

from __future__ import annotations

import math

from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.line import advance_line, stalls
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.motion import displaced, drag, inside, lagging, rate_of, terms
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Now, Table

T, Z, W, V, CHARGE = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.CHARGE)
HULL, FOLLOWS, HEAT = int(Now.HULL), int(Given.FOLLOWS), int(Account.HEAT)
SHUT = int(At.SHUT)
DOING, PLACE, STEP, MASS = int(At.DOING), int(At.PLACE), int(Given.STEP), int(Given.MASS)
SELF_DISCHARGE, NOTHING, PUMPING = int(Given.SELF_DISCHARGE), int(Doing.NOTHING), int(Doing.PUMPING)
PRIMING, LETTING_IN, PRESSURE = int(Doing.PRIMING), int(Doing.LETTING_IN), int(Table.PRESSURE)
HOLDING, POWER_OUT, POWER_IN = int(Table.HOLDING), int(Table.POWER_OUT), int(Table.POWER_IN)
POWER_BYPASS, PUMPED, LET_IN = int(Table.POWER_BYPASS), int(Account.PUMPED), int(Account.LET_IN)
LEAKED, PUMP_ENERGY = int(Account.LEAKED), int(Account.PUMP_ENERGY)
VALVE_ENERGY, HOLDING_ENERGY = int(Account.VALVE_ENERGY), int(Account.HOLDING_ENERGY)
LOAD_ENERGY, SELF_DISCHARGED = int(Account.LOAD_ENERGY), int(Account.SELF_DISCHARGED)
PUMP_WORK, LET_IN_WORK = int(Account.PUMP_WORK), int(Account.LET_IN_WORK)
LEAK_WORK, DRAG, FORCED = int(Account.LEAK_WORK), int(Account.DRAG), int(Account.FORCED)
PUMP_TIME, VALVE_TIME = int(Account.PUMP_TIME), int(Account.VALVE_TIME)
STALLED = int(Account.STALLED)
_moved = inlined(moved)
# Lobatto's rule of four points on [0, 1] (Abramowitz and Stegun 25.4.32), exact to degree 5
_INNER = 0.5 - 0.1 * math.sqrt(5.0)


@part
def enter_step(p, table, waves, x, at, accounts, loads, h, work):  # type: ignore[no-untyped-def]
    """Enter a step of h [s] to work[0] in the accounts, by Lobatto's rule on its cubic."""
    y, k1, k2 = work[0], work[2], work[3]
    doing, shut = at[DOING], at[SHUT] == 1
    sums = work[4]
    sums[:] = 0.0
    for n in range(4):
        s = 0.0 if n == 0 else (_INNER if n == 1 else (1.0 - _INNER if n == 2 else 1.0))
        share = h / 12.0 if n == 0 or n == 3 else 5.0 * h / 12.0
        z = inside(x[Z], y[0], k1[0], k2[0], s)
        w = inside(x[W], y[1], k1[1], k2[1], s)
        v = inside(x[V], y[2], k1[2], k2[2], s)
        sums[0] += share * p[MASS] * drag(p, w)[0] * w
        sums[1] += share * power(p, table, doing, z)
        way, dz = 0.0, w
        hull = inside(x[HULL], y[3], k1[3], k2[3], s)
        if waves.shape[0] > 0:
            t = x[T] + s * h
            dz, pull, _, _ = terms(
                p, table, waves, doing, shut, at[PLACE] == 1, t, z, w, v, hull
            )  # fmt: skip
            sums[4] += share * p[MASS] * (pull + drag(p, w)[0]) * (dz - w)
            way = _moved(waves, z, t)[0]
            slope = value(table, p[STEP], PRESSURE, z)[1]
            sums[4] -= share * slope * displaced(p, table, z, way)[0] * dz
        rate = rate_of(p, table, doing, shut, z, v, dz)[0]
        if rate != 0.0:
            sums[2] += share * rate * value(table, p[STEP], PRESSURE, z)[0]
        elif doing == PUMPING or stalls(p, table, at, z):
            sums[3] += share
        if p[FOLLOWS] > 0.0:
            slope = value(table, p[STEP], PRESSURE, z)[1]
            sums[5] -= share * slope * lagging(p, table, z - way, hull)[0] * dz
    accounts[DRAG] += sums[0]
    accounts[FORCED] += sums[4]
    accounts[HEAT] += sums[5]
    energy = advance_line(p, table, x, at, y[0], h, sums[1])
    enter(accounts, doing, y[2] - x[V], sums[2], energy, h)
    accounts[STALLED] += sums[3]
    enter_energy(p, x, accounts, energy, loads, h)


@part
def power(p, table, doing, z):  # type: ignore[no-untyped-def]
    """Return the electrical power of what the drive does at depth z [W]."""
    what = HOLDING
    if doing in (PUMPING, PRIMING):
        what = POWER_OUT
    elif doing == LETTING_IN:
        what = POWER_IN
    elif doing != NOTHING:
        what = POWER_BYPASS
    return value(table, p[STEP], what, max(z, 0.0))[0]


@part
def enter(accounts, doing, change, work_done, energy, h):  # type: ignore[no-untyped-def]
    """Enter volume [m3], work on the sea [J] and electrical energy [J] under what was done."""
    if doing in (PUMPING, PRIMING):
        accounts[PUMPED] += change
        accounts[PUMP_WORK] += work_done
        accounts[PUMP_ENERGY] += energy
        accounts[PUMP_TIME] += h
    elif doing == NOTHING:
        accounts[LEAKED] -= change
        accounts[LEAK_WORK] -= work_done
        accounts[HOLDING_ENERGY] += energy
    else:
        accounts[LET_IN] -= change
        accounts[LET_IN_WORK] -= work_done
        accounts[VALVE_ENERGY] += energy
        accounts[VALVE_TIME] += h


@part
def enter_energy(p, x, accounts, drive, loads, h):  # type: ignore[no-untyped-def]
    """Take the drive's energy [J] and the loads' power [W] over h [s] from the battery.

    dC/dt = -P - s C, as `swimbladder.physics.battery.charge_after`.
    """
    accounts[LOAD_ENERGY] += loads * h
    drawn = drive + loads * h
    s = p[SELF_DISCHARGE] * h
    if s > 0.0:
        lost = -x[CHARGE] * math.expm1(-s) - drawn * (1.0 + math.expm1(-s) / s)
        accounts[SELF_DISCHARGED] += lost
        x[CHARGE] -= lost
    x[CHARGE] -= drawn
