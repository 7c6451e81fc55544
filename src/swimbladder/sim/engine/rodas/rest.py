"""A vehicle at rest or on the bottom: time that passes without steps."""

from __future__ import annotations

import math

from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.rodas.entries import enter, enter_energy, power
from swimbladder.sim.engine.rodas.line import advance_line, stalls
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.motion import drag, lagging, rate_of, slope_of_force, terms
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Now, Table

T, Z, W, V, V_MOVE = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.V_MOVE)
V_LEAST, V_MOST, DOING, PLACE = int(Now.V_LEAST), int(Now.V_MOST), int(At.DOING), int(At.PLACE)
RESTS, STEP, MASS, A_S = int(At.RESTS), int(Given.STEP), int(Given.MASS), int(Given.A_S)
Z_SURFACE, V_MIN, V_MAX = int(Given.Z_SURFACE), int(Given.V_MIN), int(Given.V_MAX)
REST_DEEP, REST_AFLOAT, NOTHING = int(Given.REST_DEEP), int(Given.REST_AFLOAT), int(Doing.NOTHING)
PUMPING, PRESSURE, NEUTRAL = int(Doing.PUMPING), int(Table.PRESSURE), int(Table.NEUTRAL)
SHUT = int(At.SHUT)
TRIM, GIVE, SETTLED = int(Given.TRIM), int(Given.GIVE), int(Account.SETTLED)
STALLED, HULL, FOLLOWS = int(Account.STALLED), int(Now.HULL), int(Given.FOLLOWS)
_EDGE = 1e-13  # how near a guard's zero is near enough, of its unit (m, m3 times 1e4)
_AWASH = 1e-3  # m of the hull still out of the water where its rest afloat ends
_COUNTS = 1e-10  # m3, by which a hull that warms or cools on the bottom may lift it
_PART = 0.1  # of the hull's time constant: so exact is the time at which it does


@part
def stay(p, table, x, at, accounts, loads, until):  # type: ignore[no-untyped-def]
    """Let time pass at rest or on the bottom, where only the volume may change.

    Return 1 where it reached the end of its move or an end stop, 2 what lifts it off the bottom,
    3 what sinks it from the surface, else 0.
    """
    rate = rate_of(p, table, at[DOING], at[SHUT] == 1, x[Z], x[V], 0.0)[0]
    colder = 0.0
    if p[FOLLOWS] > 0.0:
        more, _, colder, _ = lagging(p, table, x[Z], x[HULL])
        if at[PLACE] == 2 and abs(more) > _COUNTS:
            until = min(until, x[T] + _PART / p[FOLLOWS])
    h, change = until - x[T], 0.0
    ended = 0
    if rate != 0.0:
        goal = min(p[V_MAX], x[V_MOVE]) if rate > 0.0 else p[V_MIN]
        if rate < 0.0 and x[V_MOVE] <= x[V]:
            goal = max(p[V_MIN], x[V_MOVE])
        lift = lift_volume(p, table, x[Z], x[HULL])
        if rate > 0.0 and x[V] < lift < goal:
            goal = lift
            ended = 2
        elif at[PLACE] == 1 and rate < 0.0 and sink_volume(p, table, x[HULL]) > goal:
            goal = min(sink_volume(p, table, x[HULL]), x[V])
            ended = 3
        else:
            ended = 1
        if (goal - x[V]) / rate <= h:
            h, change = max((goal - x[V]) / rate, 0.0), goal - x[V]
        else:
            ended, change = 0, rate * h
    pressure = value(table, p[STEP], PRESSURE, x[Z])[0]
    energy = power(p, table, at[DOING], x[Z]) * h
    energy = advance_line(p, table, x, at, x[Z], h, energy)
    enter(accounts, at[DOING], change, change * pressure, energy, h)
    if (at[DOING] == PUMPING and rate == 0.0) or stalls(p, table, at, x[Z]):
        accounts[STALLED] += h
    enter_energy(p, x, accounts, energy, loads, h)
    x[T] = until if ended == 0 else x[T] + h
    x[HULL] -= colder * math.expm1(-p[FOLLOWS] * h)
    if at[PLACE] == 1:
        by_depth, by_volume = slope_of_force(p, table, True, x[Z], x[V], x[HULL], 0.0, 0.0)
        x[Z] -= change * by_volume / by_depth
    x[V] += change
    x[V_LEAST] = min(x[V_LEAST], x[V])
    if at[PLACE] != 1:
        x[V_MOST] = max(x[V_MOST], x[V])
    return ended


@part
def lift_volume(p, table, z, hull):  # type: ignore[no-untyped-def]
    """Return the volume above which a vehicle that lies at depth z rises [m3]; hull: degC."""
    neutral = value(table, p[STEP], NEUTRAL, z)[0] + p[TRIM] + p[GIVE] * z
    if p[FOLLOWS] > 0.0:
        neutral += lagging(p, table, z, hull)[0]
    return neutral + 1e-12 * (p[V_MAX] - p[V_MIN])


@part
def sink_volume(p, table, hull):  # type: ignore[no-untyped-def]
    """Return the volume [m3] at which a floating hull [degC] is but `_AWASH` out of the water."""
    top = p[Z_SURFACE]
    neutral = value(table, p[STEP], NEUTRAL, top)[0] + p[TRIM] + p[GIVE] * top
    if p[FOLLOWS] > 0.0:
        neutral += lagging(p, table, top, hull)[0]
    return neutral + _AWASH * p[A_S] * p[MASS] / value(table, p[STEP], PRESSURE, top)[1]


@part
def settle(p, table, waves, x, at, accounts):  # type: ignore[no-untyped-def]
    """Take a vehicle for resting where what is left of its oscillation is too small to count."""
    if at[DOING] != NOTHING or at[PLACE] == 2:
        return
    for k in range(waves.shape[0]):
        if waves[k, 5] > 0.0:
            return
    if rate_of(p, table, NOTHING, True, x[Z], x[V], 0.0)[0] != 0.0 and (
        at[PLACE] != 1 or x[V] <= sink_volume(p, table, x[HULL]) + _EDGE
    ):
        return  # it drifts with what leaks; afloat the hull gives way by next to nothing
    emerging = at[PLACE] == 1
    by_depth, by_volume = slope_of_force(p, table, emerging, x[Z], x[V], x[HULL], 0.0, 0.0)
    stiffness = -by_depth
    if stiffness <= 0.0:
        return
    _, pull, _, _ = terms(
        p, table, waves, NOTHING, True, emerging, x[T], x[Z], x[W], x[V], x[HULL]
    )  # fmt: skip
    way = (pull + drag(p, x[W])[0]) / stiffness
    limit = p[REST_AFLOAT] if emerging else p[REST_DEEP]
    if p[FOLLOWS] > 0.0:
        goes = by_volume * lagging(p, table, x[Z], x[HULL])[0] / stiffness
        if abs(goes) > limit:
            return  # it goes on with the hull's temperature
    if way * way + x[W] * x[W] / stiffness < limit * limit:
        accounts[SETTLED] += 0.5 * p[MASS] * x[W] * x[W]
        x[W] = 0.0
        at[RESTS] = 1
