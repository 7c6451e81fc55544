"""A vehicle at rest or on the bottom: time that passes without steps."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.rodas.entries import enter, enter_energy, power
from swimbladder.sim.engine.rodas.line import advance_line, stalls
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.motion import drag, lagging, rate_of, slope_of_force, terms
from swimbladder.sim.engine.rodas.records import Account, Doing, Lane, Table

Array = NDArray[np.float64]


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
