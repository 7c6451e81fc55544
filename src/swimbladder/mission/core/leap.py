"""One step of the motion: as long as its error allows, ended where something happens, and booked.

What happens is a guard that rises above 0. Where one is above 0 at the end or in the middle of a
step, the earliest is found on the step's cubic, the step is taken again to there, and its length
corrected by Newton's rule until the state stands on the edge.
"""

from __future__ import annotations

import math

from swimbladder.engine.cache import inlined, part
from swimbladder.mission.core.motion import (
    displaced,
    drag,
    inside,
    rate_of,
    rosenbrock,
    slope_of_force,
    terms,
    value,
)
from swimbladder.mission.core.names import Account, At, Doing, Given, Now, Table
from swimbladder.seawater.motion import moved

__all__ = ["GUARDS", "enter_energy", "leap", "lift_volume", "settle", "stay"]

_moved = inlined(moved)

GUARDS = 7
SURFACE, BOTTOM, AIR, LEVEL, TOO_DEEP, VOLUME, LOST = range(GUARDS)

T, Z, W, V, H = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.H)
V_MOVE, CHARGE = int(Now.V_MOVE), int(Now.CHARGE)
Z_MOST, V_LEAST, V_MOST = int(Now.Z_MOST), int(Now.V_LEAST), int(Now.V_MOST)
DOING, PLACE, RESTS, ALARM = int(At.DOING), int(At.PLACE), int(At.RESTS), int(At.ALARM)
STEPS, REJECTED = int(At.STEPS), int(At.REJECTED)
STEP, MASS, A_S = int(Given.STEP), int(Given.MASS), int(Given.A_S)
Z_SURFACE, Z_BOTTOM, Z_AIR = int(Given.Z_SURFACE), int(Given.Z_BOTTOM), int(Given.Z_AIR)
Z_LOST, DEEPEST = int(Given.Z_LOST), int(Given.DEEPEST)
V_MIN, V_MAX = int(Given.V_MIN), int(Given.V_MAX)
RTOL, ATOL_Z, ATOL_W = int(Given.RTOL), int(Given.ATOL_Z), int(Given.ATOL_W)
ATOL_V, LONGEST_STEP = int(Given.ATOL_V), int(Given.LONGEST_STEP)
REST_DEEP, REST_AFLOAT = int(Given.REST_DEEP), int(Given.REST_AFLOAT)
SELF_DISCHARGE = int(Given.SELF_DISCHARGE)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
LETTING_IN = int(Doing.LETTING_IN)
PRESSURE, NEUTRAL, HOLDING = int(Table.PRESSURE), int(Table.NEUTRAL), int(Table.HOLDING)
TRIM, GIVE = int(Given.TRIM), int(Given.GIVE)
POWER_OUT, POWER_IN = int(Table.POWER_OUT), int(Table.POWER_IN)
POWER_BYPASS = int(Table.POWER_BYPASS)
PUMPED, LET_IN, LEAKED = int(Account.PUMPED), int(Account.LET_IN), int(Account.LEAKED)
PUMP_ENERGY, VALVE_ENERGY = int(Account.PUMP_ENERGY), int(Account.VALVE_ENERGY)
HOLDING_ENERGY, LOAD_ENERGY = int(Account.HOLDING_ENERGY), int(Account.LOAD_ENERGY)
SELF_DISCHARGED = int(Account.SELF_DISCHARGED)
PUMP_WORK, LET_IN_WORK = int(Account.PUMP_WORK), int(Account.LET_IN_WORK)
LEAK_WORK, DRAG, SETTLED = int(Account.LEAK_WORK), int(Account.DRAG), int(Account.SETTLED)
FORCED, PUMP_TIME = int(Account.FORCED), int(Account.PUMP_TIME)
VALVE_TIME, STALLED = int(Account.VALVE_TIME), int(Account.STALLED)

_SHORTEST = 1e-9  # s; a step that has to be shorter is taken all the same
_EDGE = 1e-13  # how near a guard's zero is near enough, of its unit (m, m3 times 1e4)
_AWASH = 1e-3  # m of the hull still out of the water where its rest afloat ends
_V_SCALE = 1e4  # guards of volumes are counted in tenths of litres, to be of the size of metres
# Lobatto's rule of four points on [0, 1] (Abramowitz and Stegun 25.4.32), exact to degree 5
_INNER = 0.5 - 0.1 * math.sqrt(5.0)


@part
def _fill(p, x, at, level, z, v, found):  # type: ignore[no-untyped-def]
    """Fill found [GUARDS]: above 0 where something has happened."""
    if at[PLACE] == 1:
        found[SURFACE] = z - p[Z_SURFACE]
    else:
        found[SURFACE] = p[Z_SURFACE] - z
    found[BOTTOM] = z - p[Z_BOTTOM]
    found[AIR] = p[Z_AIR] - z
    if level > 0.0:  # from above
        found[LEVEL] = z - level
    elif level < 0.0:  # from below
        found[LEVEL] = -level - z
    else:
        found[LEVEL] = -1.0
    found[TOO_DEEP] = z - p[DEEPEST] if at[ALARM] == 0 else -1.0
    if at[DOING] == PUMPING:
        found[VOLUME] = (v - min(p[V_MAX], x[V_MOVE])) * _V_SCALE
    elif at[DOING] == PRIMING:
        found[VOLUME] = -1.0
    elif at[DOING] != NOTHING:
        found[VOLUME] = (max(p[V_MIN], x[V_MOVE]) - v) * _V_SCALE
    else:
        found[VOLUME] = (p[V_MIN] - v) * _V_SCALE if v < x[V] else -1.0
    found[LOST] = z - p[Z_LOST]


@part
def _step(p, table, waves, x, at, h, work):  # type: ignore[no-untyped-def]
    rosenbrock(
        p, table, waves, at[DOING], at[PLACE] == 1, x[T], x[Z], x[W], x[V], h,
        work[0], work[1], work[2], work[3],
    )  # fmt: skip


@part
def leap(p, table, waves, x, at, accounts, loads, level, until, work):  # type: ignore[no-untyped-def]
    """Advance the state by one step, `until` [s] at most; return the guard that ended it, or -1.

    level: depth of arrival [m], negative from below, 0 none. work: [6, 8] to write in.
    """
    y, e, before, after = work[0], work[1], work[4], work[5]
    _fill(p, x, at, level, x[Z], x[V], before)
    left = until - x[T]
    h = min(x[H], left, p[LONGEST_STEP])
    while True:
        _step(p, table, waves, x, at, h, work)
        dw, dz = y[1] - x[W], y[0] - x[Z]
        error = max(
            abs(e[0]) / (p[ATOL_Z] + p[RTOL] * abs(dz)),
            abs(e[1]) / (p[ATOL_W] + p[RTOL] * (abs(x[W]) + abs(dw))),
            abs(e[2]) / (p[ATOL_V] + p[RTOL] * abs(y[2] - x[V])),
        )
        if not math.isfinite(error):
            error = 1e6
        factor = min(max(0.9 * error ** (-0.25), 0.2), 6.0) if error > 0.0 else 6.0
        if error <= 1.0 or h <= _SHORTEST:
            break
        at[REJECTED] += 1
        h = max(h * min(factor, 0.9), _SHORTEST)
    x[H] = max(h * factor, x[H] if h == left else 0.0)
    at[STEPS] += 1
    event = -1
    _fill(p, x, at, level, y[0], y[2], after)
    middle = inside(x[Z], y[0], work[2, 0], work[3, 0], 0.5)
    edge = middle < p[Z_SURFACE] if at[PLACE] == 0 else middle > p[Z_SURFACE]
    for n in range(GUARDS):
        if after[n] > 0.0 or edge:
            event = n
    if event >= 0:
        event, h = _located(p, table, waves, x, at, level, h, work)
    book(p, table, waves, x, at, accounts, loads, h, work)
    x[T] = until if h == left else x[T] + h
    x[Z], x[W], x[V] = y[0], y[1], y[2]
    if x[Z] > x[Z_MOST]:
        x[Z_MOST] = x[Z]
    x[V_LEAST] = min(x[V_LEAST], x[V])
    if at[PLACE] == 0:
        x[V_MOST] = max(x[V_MOST], x[V])
    return event


@part
def _located(p, table, waves, x, at, level, h, work):  # type: ignore[no-untyped-def]
    """Return the earliest guard within a step of h [s] and the time to it; work has that step."""
    y, found, before = work[0], work[5], work[4]
    event, share = -1, 1.0
    for n in range(GUARDS):
        low, high = 0.0, 0.0
        for k in range(1, 5):  # a turn may hide two crossings
            s = 0.25 * k
            if s > share:
                break
            _between(p, x, at, level, work, s)
            if found[n] > max(before[n], 0.0):
                high = s
                break
            low = s
        if high == 0.0:
            continue
        for _ in range(50):
            s = 0.5 * (low + high)
            _between(p, x, at, level, work, s)
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
        _step(p, table, waves, x, at, t, work)
        _fill(p, x, at, level, y[0], y[2], found)
        gone = found[event]
        if abs(gone) < _EDGE:
            break
        rates = terms(p, table, waves, at[DOING], at[PLACE] == 1, x[T] + t, y[0], y[1], y[2])
        rise = abs(rates[0]) if event != VOLUME else abs(rates[2]) * _V_SCALE
        if rise <= abs(gone) / h:
            break
        t = min(max(t - gone / rise, 0.0), h)
        if t <= 0.0:
            break
    if t <= 0.0:
        y[0], y[1], y[2] = x[Z], x[W], x[V]
        work[2, :3] = 0.0
        work[3, :3] = 0.0
    return event, t


@part
def _between(p, x, at, level, work, s):  # type: ignore[no-untyped-def]
    """Fill work[5] with the guards at a share s of the step."""
    z = inside(x[Z], work[0, 0], work[2, 0], work[3, 0], s)
    v = inside(x[V], work[0, 2], work[2, 2], work[3, 2], s)
    _fill(p, x, at, level, z, v, work[5])


@part
def book(p, table, waves, x, at, accounts, loads, h, work):  # type: ignore[no-untyped-def]
    """Enter a step of h [s] to work[0] in the accounts, by Lobatto's rule on its cubic."""
    y, k1, k2 = work[0], work[2], work[3]
    doing = at[DOING]
    sums = work[4]
    sums[:] = 0.0
    for n in range(4):
        s = 0.0 if n == 0 else (_INNER if n == 1 else (1.0 - _INNER if n == 2 else 1.0))
        share = h / 12.0 if n == 0 or n == 3 else 5.0 * h / 12.0
        z = inside(x[Z], y[0], k1[0], k2[0], s)
        w = inside(x[W], y[1], k1[1], k2[1], s)
        v = inside(x[V], y[2], k1[2], k2[2], s)
        sums[0] += share * p[MASS] * drag(p, w)[0] * w
        sums[1] += share * _power(p, table, doing, z)
        rate = rate_of(p, table, doing, z, v)[0]
        if rate != 0.0:
            sums[2] += share * rate * value(table, p[STEP], PRESSURE, z)[0]
        elif doing == PUMPING:
            sums[3] += share
        if waves.shape[0] > 0:
            dz, pull, _ = terms(p, table, waves, doing, at[PLACE] == 1, x[T] + s * h, z, w, v)
            sums[4] += share * p[MASS] * (pull + drag(p, w)[0]) * (dz - w)
            way = _moved(waves, z, x[T] + s * h)[0]
            slope = value(table, p[STEP], PRESSURE, z)[1]
            sums[4] -= share * slope * displaced(p, table, z, way)[0] * dz
    accounts[DRAG] += sums[0]
    accounts[FORCED] += sums[4]
    _enter(accounts, doing, y[2] - x[V], sums[2], sums[1], h)
    accounts[STALLED] += sums[3]
    enter_energy(p, x, accounts, sums[1], loads, h)


@part
def _power(p, table, doing, z):  # type: ignore[no-untyped-def]
    what = HOLDING
    if doing in (PUMPING, PRIMING):
        what = POWER_OUT
    elif doing == LETTING_IN:
        what = POWER_IN
    elif doing != NOTHING:
        what = POWER_BYPASS
    return value(table, p[STEP], what, max(z, 0.0))[0]


@part
def _enter(accounts, doing, change, work_done, energy, h):  # type: ignore[no-untyped-def]
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

    dC/dt = -P - s C, as `swimbladder.battery.charge_after`.
    """
    accounts[LOAD_ENERGY] += loads * h
    drawn = drive + loads * h
    if p[SELF_DISCHARGE] > 0.0:
        s = p[SELF_DISCHARGE] * h
        lost = -x[CHARGE] * math.expm1(-s) - drawn * (1.0 + math.expm1(-s) / s)
        accounts[SELF_DISCHARGED] += lost
        x[CHARGE] -= lost
    x[CHARGE] -= drawn


@part
def stay(p, table, x, at, accounts, loads, until):  # type: ignore[no-untyped-def]
    """Let time pass at rest or on the bottom, where only the volume may change.

    Return 1 where it reached the end of its move or an end stop, 2 what lifts it off the bottom,
    3 what sinks it from the surface, else 0.
    """
    rate = rate_of(p, table, at[DOING], x[Z], x[V])[0]
    h, change = until - x[T], 0.0
    ended = 0
    if rate != 0.0:
        goal = min(p[V_MAX], x[V_MOVE]) if rate > 0.0 else p[V_MIN]
        if rate < 0.0 and at[DOING] != NOTHING:
            goal = max(p[V_MIN], x[V_MOVE])
        lift = lift_volume(p, table, x[Z])
        if rate > 0.0 and x[V] < lift < goal:
            goal = lift
            ended = 2
        elif at[PLACE] == 1 and rate < 0.0 and sink_volume(p, table) > goal:
            goal = min(sink_volume(p, table), x[V])
            ended = 3
        else:
            ended = 1
        if (goal - x[V]) / rate <= h:
            h, change = max((goal - x[V]) / rate, 0.0), goal - x[V]
        else:
            ended, change = 0, rate * h
    pressure = value(table, p[STEP], PRESSURE, x[Z])[0]
    energy = _power(p, table, at[DOING], x[Z]) * h
    _enter(accounts, at[DOING], change, change * pressure, energy, h)
    if at[DOING] == PUMPING and rate == 0.0:
        accounts[STALLED] += h
    enter_energy(p, x, accounts, energy, loads, h)
    x[T] = until if ended == 0 else x[T] + h
    if at[PLACE] == 1:
        by_depth, by_volume = slope_of_force(p, table, True, x[Z], x[V])
        x[Z] -= change * by_volume / by_depth
    x[V] += change
    x[V_LEAST] = min(x[V_LEAST], x[V])
    if at[PLACE] != 1:
        x[V_MOST] = max(x[V_MOST], x[V])
    return ended


@part
def lift_volume(p, table, z):  # type: ignore[no-untyped-def]
    """Return the volume above which a vehicle that lies at depth z rises [m3]."""
    neutral = value(table, p[STEP], NEUTRAL, z)[0] + p[TRIM] + p[GIVE] * z
    return neutral + 1e-12 * (p[V_MAX] - p[V_MIN])


@part
def sink_volume(p, table):  # type: ignore[no-untyped-def]
    """Return the volume [m3] at which a floating hull is but `_AWASH` out of the water."""
    top = p[Z_SURFACE]
    neutral = value(table, p[STEP], NEUTRAL, top)[0] + p[TRIM] + p[GIVE] * top
    return neutral + _AWASH * p[A_S] * p[MASS] / value(table, p[STEP], PRESSURE, top)[1]


@part
def settle(p, table, waves, x, at, accounts):  # type: ignore[no-untyped-def]
    """Take a vehicle for resting where what is left of its oscillation is too small to count."""
    if at[DOING] != NOTHING or at[PLACE] == 2:
        return
    for k in range(waves.shape[0]):
        if waves[k, 5] > 0.0:
            return
    if rate_of(p, table, NOTHING, x[Z], x[V])[0] != 0.0 and (
        at[PLACE] != 1 or x[V] <= sink_volume(p, table) + _EDGE
    ):
        return  # it drifts with what leaks; afloat the hull gives way by next to nothing
    stiffness = -slope_of_force(p, table, at[PLACE] == 1, x[Z], x[V])[0]
    if stiffness <= 0.0:
        return
    _, pull, _ = terms(p, table, waves, NOTHING, at[PLACE] == 1, x[T], x[Z], x[W], x[V])
    way = (pull + drag(p, x[W])[0]) / stiffness
    limit = p[REST_AFLOAT] if at[PLACE] == 1 else p[REST_DEEP]
    if way * way + x[W] * x[W] / stiffness < limit * limit:
        accounts[SETTLED] += 0.5 * p[MASS] * x[W] * x[W]
        x[W] = 0.0
        at[RESTS] = 1
