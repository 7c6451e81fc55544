"""One step of the motion: as long as its error allows, ended where something happens, and booked.

What happens is a guard that rises above 0. Where one is above 0 at the end or in the middle of a
step, the earliest is found on the step's cubic, the step is taken again to there, and its length
corrected by Newton's rule until the state stands on the edge.
"""

from __future__ import annotations

import math

from swimbladder.sim.engine.cache import apart, part
from swimbladder.sim.engine.rodas.entries import enter_step
from swimbladder.sim.engine.rodas.line import relieve, valve_turns
from swimbladder.sim.engine.rodas.motion import inside, rosenbrock, terms
from swimbladder.sim.engine.rodas.names import At, Doing, Given, Now

T, Z, W, V, H, V_MOVE = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.H), int(Now.V_MOVE)
Z_MOST, V_LEAST, V_MOST, DOING = int(Now.Z_MOST), int(Now.V_LEAST), int(Now.V_MOST), int(At.DOING)
HULL, FOLLOWS, EXPANSION = int(Now.HULL), int(Given.FOLLOWS), int(Given.EXPANSION)
PLACE, ALARM, STEPS, REJECTED = int(At.PLACE), int(At.ALARM), int(At.STEPS), int(At.REJECTED)
Z_SURFACE, Z_BOTTOM, Z_AIR = int(Given.Z_SURFACE), int(Given.Z_BOTTOM), int(Given.Z_AIR)
Z_LOST, DEEPEST, V_MIN = int(Given.Z_LOST), int(Given.DEEPEST), int(Given.V_MIN)
V_MAX, RTOL, ATOL_Z = int(Given.V_MAX), int(Given.RTOL), int(Given.ATOL_Z)
ATOL_W, ATOL_V, LONGEST_STEP = int(Given.ATOL_W), int(Given.ATOL_V), int(Given.LONGEST_STEP)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
LINE, SHUT = int(Given.LINE), int(At.SHUT)
GUARDS = 8
SURFACE, BOTTOM, AIR, LEVEL, TOO_DEEP, VOLUME, LOST, VALVE = range(GUARDS)
_SHORTEST = 1e-9  # s; a step that has to be shorter is taken all the same
_EDGE = 1e-13  # how near a guard's zero is near enough, of its unit (m, m3 times 1e4)
_V_SCALE = 1e4  # guards of volumes are counted in tenths of litres, to be of the size of metres


@part
def _fill(p, table, waves, x, at, level, t, z, w, v, found):  # type: ignore[no-untyped-def]
    """Fill found [GUARDS]: above 0 where something has happened t [s] into the step."""
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
    found[VOLUME] = (p[V_MIN] - v) * _V_SCALE if v < x[V] else -1.0
    if at[DOING] == PUMPING:
        found[VOLUME] = max((v - min(p[V_MAX], x[V_MOVE])) * _V_SCALE, found[VOLUME])
    elif at[DOING] != NOTHING and at[DOING] != PRIMING:
        found[VOLUME] = (max(p[V_MIN], x[V_MOVE]) - v) * _V_SCALE
    found[LOST] = z - p[Z_LOST]
    found[VALVE] = -1.0
    if p[LINE] > 0.0:
        found[VALVE] = valve_turns(p, table, waves, x, at, t, z, w)


@apart
def _step(p, table, waves, x, at, h, work):  # type: ignore[no-untyped-def]
    rosenbrock(
        p, table, waves, at[DOING], at[SHUT] == 1, at[PLACE] == 1, x[T], x[Z], x[W], x[V], x[HULL],
        h,        work[0], work[1], work[2], work[3],
    )  # fmt: skip


@part
def leap(p, table, waves, x, at, accounts, loads, level, until, work):  # type: ignore[no-untyped-def]
    """Advance the state by one step, `until` [s] at most; return the guard that ended it, or -1.

    level: depth of arrival [m], negative from below, 0 none. work: [6, 8] to write in.
    """
    y, e, before, after = work[0], work[1], work[4], work[5]
    _fill(p, table, waves, x, at, level, 0.0, x[Z], x[W], x[V], before)
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
        if p[FOLLOWS] > 0.0:
            grown = p[EXPANSION] * abs(y[3] - x[HULL])
            error = max(error, p[EXPANSION] * abs(e[3]) / (p[ATOL_V] + p[RTOL] * grown))
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
    _fill(p, table, waves, x, at, level, h, y[0], y[1], y[2], after)
    middle = inside(x[Z], y[0], work[2, 0], work[3, 0], 0.5)
    edge = middle < p[Z_SURFACE] if at[PLACE] == 0 else middle > p[Z_SURFACE]
    for n in range(GUARDS):
        if after[n] > 0.0 or edge:
            event = n
    if event >= 0:
        event, h = _located(p, table, waves, x, at, level, h, work)
    enter_step(p, table, waves, x, at, accounts, loads, h, work)
    x[T] = until if h == left else x[T] + h
    x[Z], x[W], x[V], x[HULL] = y[0], y[1], y[2], y[3]
    if x[Z] > x[Z_MOST]:
        x[Z_MOST] = x[Z]
    if p[LINE] > 0.0 and event != VOLUME and at[DOING] != PUMPING and at[DOING] != PRIMING:
        relieve(p, table, x, accounts, h)
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
            s = min(0.25 * k, share)
            _between(p, table, waves, x, at, level, h, work, s)
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
            _between(p, table, waves, x, at, level, h, work, s)
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
        if event == VALVE:
            break
        _fill(p, table, waves, x, at, level, t, y[0], y[1], y[2], found)
        gone = found[event]
        if abs(gone) < _EDGE:
            break
        emerging = at[PLACE] == 1
        rates = terms(
            p, table, waves, at[DOING], at[SHUT] == 1, emerging, x[T] + t, y[0], y[1], y[2], y[3]
        )  # fmt: skip
        rise = abs(rates[0]) if event != VOLUME else abs(rates[2]) * _V_SCALE
        if rise <= abs(gone) / h:
            break
        t = min(max(t - gone / rise, 0.0), h)
        if t <= 0.0:
            break
    if t <= 0.0:
        y[0], y[1], y[2], y[3] = x[Z], x[W], x[V], x[HULL]
        work[2, :4] = 0.0
        work[3, :4] = 0.0
    return event, t


@part
def _between(p, table, waves, x, at, level, h, work, s):  # type: ignore[no-untyped-def]
    """Fill work[5] with the guards at a share s of the step."""
    z = inside(x[Z], work[0, 0], work[2, 0], work[3, 0], s)
    v = inside(x[V], work[0, 2], work[2, 2], work[3, 2], s)
    w = inside(x[W], work[0, 1], work[2, 1], work[3, 1], s)
    _fill(p, table, waves, x, at, level, s * h, z, w, v, work[5])
