"""One step of the motion: as long as its error allows, ended where something happens, and booked.

What happens is a guard that rises above 0. Where one is above 0 at the end or in the middle of a
step, the earliest is found on the step's cubic, the step is taken again to there, and its length
corrected by Newton's rule until the state stands on the edge. Booked are volume, work, electrical
energy and what is left in the battery. A vehicle at rest or on the bottom takes no steps: its time
passes at once.
"""

import math
from typing import Any

from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.line import advance_line, relieve, stalls, value, valve_turns
from swimbladder.sim.engine.rodas.motion import (
    displaced,
    drag,
    inside,
    lagging,
    rate_of,
    rosenbrock,
    slope_of_force,
    terms,
)
from swimbladder.sim.engine.rodas.records import Account, Doing, Lane, Table

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


_EDGE = 1e-13  # how near a guard's zero is near enough, of its unit (m, m3 times 1e4)
_AWASH = 1e-3  # m of the hull still out of the water where its rest afloat ends
_COUNTS = 1e-10  # m3, by which a hull that warms or cools on the bottom may lift it
_PART = 0.1  # of the hull's time constant: so exact is the time at which it does


@part
def stay(lane: Lane, loads: float, until: float) -> int:
    """Let time pass at rest or on the bottom, where only the volume may change.

    Return 1 where it reached the end of its move or an end stop, 2 what lifts it off the bottom,
    3 what sinks it from the surface, else 0.
    """
    p, table, x, at, accounts = lane.p, lane.table, lane.x, lane.at, lane.accounts
    rate = rate_of(p, table, at.doing, at.shut == 1, x.z, x.v, 0.0)[0]
    colder = 0.0
    if p.follows > 0.0:
        more, _, colder, _ = lagging(p, table, x.z, x.hull)
        if at.place == 2 and abs(more) > _COUNTS:
            until = min(until, x.t + _PART / p.follows)
    h, change = until - x.t, 0.0
    ended = 0
    if rate != 0.0:
        goal = min(p.v_max, x.v_move) if rate > 0.0 else p.v_min
        if rate < 0.0 and x.v_move <= x.v:
            goal = max(p.v_min, x.v_move)
        lift = lift_volume(p, table, x.z, x.hull)
        if rate > 0.0 and x.v < lift < goal:
            goal = lift
            ended = 2
        elif at.place == 1 and rate < 0.0 and sink_volume(p, table, x.hull) > goal:
            goal = min(sink_volume(p, table, x.hull), x.v)
            ended = 3
        else:
            ended = 1
        if (goal - x.v) / rate <= h:
            h, change = max((goal - x.v) / rate, 0.0), goal - x.v
        else:
            ended, change = 0, rate * h
    pressure = value(table, p.step, Table.PRESSURE, x.z)[0]
    energy = power(p, table, at.doing, x.z) * h
    energy = advance_line(lane, x.z, h, energy)
    enter(accounts, at.doing, change, change * pressure, energy, h)
    if (at.doing == Doing.PUMPING and rate == 0.0) or stalls(lane, x.z):
        accounts[Account.STALLED] += h
    enter_energy(p, x, accounts, energy, loads, h)
    x.t = until if ended == 0 else x.t + h
    x.hull -= colder * math.expm1(-p.follows * h)
    if at.place == 1:
        by_depth, by_volume = slope_of_force(lane, x.z, x.v, x.hull, 0.0, 0.0)
        x.z -= change * by_volume / by_depth
    x.v += change
    x.v_least = min(x.v_least, x.v)
    if at.place != 1:
        x.v_most = max(x.v_most, x.v)
    return ended


@part
def lift_volume(p: Any, table: Array, z: float, hull: float) -> Any:
    """Return the volume above which a vehicle that lies at depth z rises [m3]; hull: degC."""
    neutral = value(table, p.step, Table.NEUTRAL, z)[0] + p.trim + p.give * z
    if p.follows > 0.0:
        neutral += lagging(p, table, z, hull)[0]
    return neutral + 1e-12 * (p.v_max - p.v_min)


@part
def sink_volume(p: Any, table: Array, hull: float) -> Any:
    """Return the volume [m3] at which a floating hull [degC] is but `_AWASH` out of the water."""
    top = p.z_surface
    neutral = value(table, p.step, Table.NEUTRAL, top)[0] + p.trim + p.give * top
    if p.follows > 0.0:
        neutral += lagging(p, table, top, hull)[0]
    return neutral + _AWASH * p.a_s * p.mass / value(table, p.step, Table.PRESSURE, top)[1]


@part
def settle(lane: Lane) -> None:
    """Take a vehicle for resting where what is left of its oscillation is too small to count."""
    p, table, waves, x, at = lane.p, lane.table, lane.waves, lane.x, lane.at
    if at.doing != Doing.NOTHING or at.place == 2:
        return
    for k in range(waves.shape[0]):
        if waves[k, 5] > 0.0:
            return
    if rate_of(p, table, Doing.NOTHING, True, x.z, x.v, 0.0)[0] != 0.0 and (
        at.place != 1 or x.v <= sink_volume(p, table, x.hull) + _EDGE
    ):
        return  # it drifts with what leaks; afloat the hull gives way by next to nothing
    by_depth, by_volume = slope_of_force(lane, x.z, x.v, x.hull, 0.0, 0.0)
    stiffness = -by_depth
    if stiffness <= 0.0:
        return
    _, pull, _, _ = terms(lane, x.t, x.z, x.w, x.v, x.hull)
    way = (pull + drag(p, x.w)[0]) / stiffness
    limit = p.rest_afloat if at.place == 1 else p.rest_deep
    if p.follows > 0.0:
        goes = by_volume * lagging(p, table, x.z, x.hull)[0] / stiffness
        if abs(goes) > limit:
            return  # it goes on with the hull's temperature
    if way * way + x.w * x.w / stiffness < limit * limit:
        lane.accounts[Account.SETTLED] += 0.5 * p.mass * x.w * x.w
        x.w = 0.0
        at.rests = 1


GUARDS = 8
SURFACE, BOTTOM, AIR, LEVEL, TOO_DEEP, VOLUME, LOST, VALVE = range(GUARDS)
_SHORTEST = 1e-9  # s; a step that has to be shorter is taken all the same
_EDGE = 1e-13  # how near a guard's zero is near enough, of its unit (m, m3 times 1e4)
_V_SCALE = 1e4  # guards of volumes are counted in tenths of litres, to be of the size of metres


@part
def _fill(lane: Lane, level: float, t: float, z: float, w: float, v: float, found: Array) -> None:
    """Fill found [GUARDS]: above 0 where something has happened t [s] into the step."""
    p, x, at = lane.p, lane.x, lane.at
    if at.place == 1:
        found[SURFACE] = z - p.z_surface
    else:
        found[SURFACE] = p.z_surface - z
    found[BOTTOM] = z - p.z_bottom
    found[AIR] = p.z_air - z
    if level > 0.0:  # from above
        found[LEVEL] = z - level
    elif level < 0.0:  # from below
        found[LEVEL] = -level - z
    else:
        found[LEVEL] = -1.0
    found[TOO_DEEP] = z - p.deepest if at.alarm == 0 else -1.0
    found[VOLUME] = (p.v_min - v) * _V_SCALE if v < x.v else -1.0
    if at.doing == Doing.PUMPING:
        found[VOLUME] = max((v - min(p.v_max, x.v_move)) * _V_SCALE, found[VOLUME])
    elif at.doing != Doing.NOTHING and at.doing != Doing.PRIMING:
        found[VOLUME] = (max(p.v_min, x.v_move) - v) * _V_SCALE
    found[LOST] = z - p.z_lost
    found[VALVE] = valve_turns(lane, t, z, w)


@part
def integrate(lane: Lane, loads: float, level: float, until: float) -> int:
    """Advance the state by one step, `until` [s] at most; return the guard that ended it, or -1.

    level: depth of arrival [m], negative from below, 0 none.
    """
    p, x, at, work = lane.p, lane.x, lane.at, lane.work
    y, e, before, after = work[0], work[1], work[4], work[5]
    _fill(lane, level, 0.0, x.z, x.w, x.v, before)
    left = until - x.t
    h = min(x.h, left, p.longest_step)
    while True:
        rosenbrock(lane, h)
        dw, dz = y[1] - x.w, y[0] - x.z
        error = max(
            abs(e[0]) / (p.atol_z + p.rtol * abs(dz)),
            abs(e[1]) / (p.atol_w + p.rtol * (abs(x.w) + abs(dw))),
            abs(e[2]) / (p.atol_v + p.rtol * abs(y[2] - x.v)),
        )
        if p.follows > 0.0:
            grown = p.expansion * abs(y[3] - x.hull)
            error = max(error, p.expansion * abs(e[3]) / (p.atol_v + p.rtol * grown))
        if not math.isfinite(error):
            error = 1e6
        factor = min(max(0.9 * error ** (-0.25), 0.2), 6.0) if error > 0.0 else 6.0
        if error <= 1.0 or h <= _SHORTEST:
            break
        at.rejected += 1
        h = max(h * min(factor, 0.9), _SHORTEST)
    x.h = max(h * factor, x.h if h == left else 0.0)
    at.steps += 1
    event = -1
    _fill(lane, level, h, y[0], y[1], y[2], after)
    middle = inside(x.z, y[0], work[2, 0], work[3, 0], 0.5)
    edge = middle < p.z_surface if at.place == 0 else middle > p.z_surface
    for n in range(GUARDS):
        if after[n] > 0.0 or edge:
            event = n
    if event >= 0:
        event, h = _located(lane, level, h)
    enter_step(lane, loads, h)
    x.t = until if h == left else x.t + h
    x.z, x.w, x.v, x.hull = y[0], y[1], y[2], y[3]
    if x.z > x.z_most:
        x.z_most = x.z
    if event != VOLUME and at.doing != Doing.PUMPING and at.doing != Doing.PRIMING:
        relieve(lane, h)
    x.v_least = min(x.v_least, x.v)
    if at.place == 0:
        x.v_most = max(x.v_most, x.v)
    return event


@part
def _located(lane: Lane, level: float, h: float) -> Any:
    """Return the earliest guard within a step of h [s] and the time to it; work has that step."""
    x, work = lane.x, lane.work
    y, found, before = work[0], work[5], work[4]
    event, share = -1, 1.0
    for n in range(GUARDS):
        low, high = 0.0, 0.0
        for k in range(1, 5):  # a turn may hide two crossings
            s = min(0.25 * k, share)
            _between(lane, level, h, s)
            if found[n] > max(before[n], 0.0):
                high = s
                break
            low = s
            if s == share:
                break
        if high == 0.0:
            continue
        for _ in range(50):
            s = 0.5 * (low + high)
            _between(lane, level, h, s)
            if found[n] > max(before[n], 0.0):
                high = s
            else:
                low = s
        if high < share or event < 0:
            event, share = n, high
    if event < 0:
        return -1, h
    t = h * share
    for _ in range(4):
        rosenbrock(lane, t)
        if event == VALVE:
            break
        _fill(lane, level, t, y[0], y[1], y[2], found)
        gone = found[event]
        if abs(gone) < _EDGE:
            break
        rates = terms(lane, x.t + t, y[0], y[1], y[2], y[3])
        rise = abs(rates[0]) if event != VOLUME else abs(rates[2]) * _V_SCALE
        if rise <= abs(gone) / h:
            break
        t = min(max(t - gone / rise, 0.0), h)
        if t <= 0.0:
            break
    if t <= 0.0:
        y[0], y[1], y[2], y[3] = x.z, x.w, x.v, x.hull
        work[2, :4] = 0.0
        work[3, :4] = 0.0
    return event, t


@part
def _between(lane: Lane, level: float, h: float, s: float) -> None:
    """Fill work[5] with the guards at a share s of the step."""
    x, work = lane.x, lane.work
    z = inside(x.z, work[0, 0], work[2, 0], work[3, 0], s)
    v = inside(x.v, work[0, 2], work[2, 2], work[3, 2], s)
    w = inside(x.w, work[0, 1], work[2, 1], work[3, 1], s)
    _fill(lane, level, s * h, z, w, v, work[5])
