"""One step of the motion: as long as its error allows, ended where something happens, and booked.

What happens is a guard that rises above 0. Where one is above 0 at the end or in the middle of a
step, the earliest is found on the step's cubic, the step is taken again to there, and its length
corrected by Newton's rule until the state stands on the edge.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.rodas.entries import enter_step
from swimbladder.sim.engine.rodas.line import relieve, valve_turns
from swimbladder.sim.engine.rodas.motion import inside, rosenbrock, terms
from swimbladder.sim.engine.rodas.records import Doing, Lane

Array = NDArray[np.float64]


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
def leap(lane: Lane, loads: float, level: float, until: float) -> int:
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
