"""The oil between pump and check valve: its pressure p, a state of the mission, by eq. (1).

::

    C(p) dp/dt = Q - out,   C = V/beta_e = (V - V_g)/beta + V_g/(n p),   V_g as p^(-1/n)

Q is what the pump delivers against p, or what slips back through a pump that stands. The check
valve is ideal. While it is shut, out = 0 and p goes its own way, whatever the depth: the table
holds how long and with which energy the pump takes it from the reservoir's pressure to p, and how
long it takes to fall. While it is open, p is the sea's, and

    out = Q - C dp_sea/dt

goes into the bladder. The valve opens where p comes to the sea's pressure and shuts where `out`
falls below 0. While the pump stands it is shut; where a rising vehicle's sea has fallen below p
after a step, the line gives the bladder what it holds above that, and steps are short where it is
much.

The state is y = ln(p/p_reservoir). Behind a pressure amplifier p is the sea's over its ratio; C
counts volume and pressure of the water.

The time to fall diverges at the reservoir's pressure: with h = p - p_reservoir, C_0 = C there and
the slip s it is -(C_0/s) ln h - S, S being the integral of (C - C_0)/(s h) dh that the table holds.
"""

from __future__ import annotations

import math

from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Now, Table

_moved = inlined(moved)

T, Z, V, H, LEVEL = int(Now.T), int(Now.Z), int(Now.V), int(Now.H), int(Now.LINE_LEVEL)
T_LEVEL = int(Now.T_LEVEL)
T_PRIMED, PUMPED, PUMP_WORK = int(Now.T_PRIMED), int(Account.PUMPED), int(Account.PUMP_WORK)
DOING, SHUT = int(At.DOING), int(At.SHUT)
PUMPING, PRIMING = int(Doing.PUMPING), int(Doing.PRIMING)
STEP, DELIVERY, V_MAX = int(Given.STEP), int(Given.DELIVERY), int(Given.V_MAX)
LINE, GAS, MODULUS = int(Given.LINE), int(Given.LINE_GAS), int(Given.LINE_MODULUS)
POWER, RATIO, RESERVOIR = int(Given.LINE_POWER), int(Given.LINE_RATIO), int(Given.RESERVOIR)
AFLOAT, SLIP, RUN_UP = int(Given.HEAD_AFLOAT), int(Given.SLIP), int(Given.RUN_UP)
LINE_STEP, TOP = int(Given.LINE_STEP), int(Given.LINE_TOP)
PRESSURE, RATE_OUT, TEMPERATURE = int(Table.PRESSURE), int(Table.RATE_OUT), int(Table.TEMPERATURE)
FILLING, FILL_ENERGY = int(Table.FILLING), int(Table.FILL_ENERGY)
FILL_WARMTH, EMPTYING = int(Table.FILL_WARMTH), int(Table.EMPTYING)
_HIGHEST = 40.0  # e^40 of the reservoir's pressure: no sea, where the table goes on straight
_HALVINGS = 60  # to the last bit of a pressure
_MUCH = 1e-8  # m3 that a line gives in one step of a vehicle that rises, at most about
_EMPTY = 1e-9  # share of the reservoir's pressure above it that does not count
_SEATS = 1e-15  # m3/s of flow back that shut it
_FLOW_SCALE = 1e6  # the guard of a flow counts in mL/s


@part
def _head(p, table, z):  # type: ignore[no-untyped-def]
    """Return the sea's pressure over the reservoir's [Pa] at depth z, its slope and curvature."""
    pressure, slope, bend = value(table, p[STEP], PRESSURE, max(z, 0.0))
    if z < 0.0:
        slope, bend = 0.0, 0.0
    return pressure + p[AFLOAT], slope, bend


@part
def _sea(p, table, z):  # type: ignore[no-untyped-def]
    """Return y at which the check valve opens at depth z."""
    head = _head(p, table, z)[0]
    return math.log(1.0 + max(head, 0.0) / (p[RATIO] * p[RESERVOIR]))


@part
def _give(p, y):  # type: ignore[no-untyped-def]
    """Return C [m3/Pa], and its derivative by y."""
    oil = p[RESERVOIR] * math.exp(y)
    gas = p[GAS] * math.exp(-p[POWER] * y)
    squared = p[RATIO] * p[RATIO]
    liquid = (p[LINE] - gas) / p[MODULUS]
    by_level = p[POWER] * gas * (1.0 / p[MODULUS] - (1.0 + p[POWER]) / oil)
    return (liquid + p[POWER] * gas / oil) / squared, by_level / squared


@part
def line_flow(p, table, z, dz):  # type: ignore[no-untyped-def]
    """Return what an open line gives the bladder beside the pump's delivery [m3/s].

    dz: speed of the vehicle down [m/s]. Also the slopes by depth [m2/s] and by dz [m2].
    """
    head, slope, bend = _head(p, table, z)
    head = max(head, 0.0)
    oil = p[RESERVOIR] + head / p[RATIO]
    give, by_level = _give(p, math.log(oil / p[RESERVOIR]))
    by_depth = by_level * slope / (p[RATIO] * oil)
    return -give * slope * dz, -(by_depth * slope + give * bend) * dz, -give * slope


@part
def _fill_time(p, table, y):  # type: ignore[no-untyped-def]
    """Return the time [s] in which the pump takes the line from rest to y; inf: it stalls."""
    if y > p[TOP]:
        return math.inf
    return value(table, p[LINE_STEP], FILLING, y)[0]


@part
def _filled(p, table, y, h):  # type: ignore[no-untyped-def]
    """Return what y becomes after h [s] of the pump, and the energy of that [J] at 0 degC, J/K."""
    step = p[LINE_STEP]
    goal = value(table, step, FILLING, y)[0] + h
    low, high = y, min(p[TOP], _HIGHEST)
    if high <= low or value(table, step, FILLING, high)[0] <= goal:
        low = max(low, high)  # it stalls, and draws what it draws there
    else:
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if value(table, step, FILLING, middle)[0] < goal:
                low = middle
            else:
                high = middle
    time, slow, _ = value(table, step, FILLING, low)
    e, by_level, _ = value(table, step, FILL_ENERGY, low)
    k, warmth, _ = value(table, step, FILL_WARMTH, low)
    e -= value(table, step, FILL_ENERGY, y)[0]
    k -= value(table, step, FILL_WARMTH, y)[0]
    if goal > time and slow > 0.0:
        e += (goal - time) * by_level / slow
        k += (goal - time) * warmth / slow
    return low, e, k


@part
def _fall_time(p, table, y):  # type: ignore[no-untyped-def]
    """Return the time [s], from some beginning, at which a line that empties is at y > 0."""
    head = p[RATIO] * p[RESERVOIR] * math.expm1(y)
    first = _give(p, 0.0)[0] / p[SLIP]
    return -first * math.log(head) - value(table, p[LINE_STEP], EMPTYING, y)[0]


@part
def _emptied(p, table, y, h):  # type: ignore[no-untyped-def]
    """Return what y becomes in h [s] while the pump stands and the check valve is shut."""
    if p[SLIP] == 0.0 or y <= _EMPTY or h <= 0.0:
        return y
    goal = _fall_time(p, table, y) + h
    low, high = 0.0, y
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _fall_time(p, table, middle) > goal:
            low = middle
        else:
            high = middle
    return high


@part
def fill_lacks(p, table, x):  # type: ignore[no-untyped-def]
    """Return how long the pump has to run [s] before the line is at the pressure of the sea."""
    begun = _fill_time(p, table, min(x[LEVEL], p[TOP]))
    return max(_fill_time(p, table, _sea(p, table, x[Z])) - begun, 0.0)


@part
def stalls(p, table, at, z):  # type: ignore[no-untyped-def]
    """Return whether the pump fills a line that it cannot bring to the sea's pressure."""
    if p[LINE] == 0.0 or at[DOING] != PRIMING or at[SHUT] == 0:
        return False
    return _sea(p, table, z) > p[TOP]


@part
def advance_line(p, table, x, at, z, h, energy):  # type: ignore[no-untyped-def]
    """Let the line's pressure go on for h [s], in which the vehicle comes to depth z [m].

    energy: what the drive takes at the sea's pressure [J]. Return what it does take.
    """
    if p[LINE] == 0.0:
        return energy
    if at[SHUT] == 0:
        x[LEVEL] = _sea(p, table, z)
        x[T_LEVEL] = x[T] + h
    elif at[DOING] == PRIMING:
        x[T_LEVEL] = x[T] + h
        share = p[DELIVERY]
        x[LEVEL], cold, by_warmth = _filled(p, table, x[LEVEL], share * h)
        warmth = value(table, p[STEP], TEMPERATURE, max(x[Z], 0.0))[0]
        return (cold + by_warmth * warmth) / share
    return energy  # what a line loses at rest is seen when it matters: `empty_line`


@part
def empty_line(p, table, x):  # type: ignore[no-untyped-def]
    """Let the line be as empty as it is by now, while the pump stands."""
    x[LEVEL] = _emptied(p, table, x[LEVEL], x[T] - x[T_LEVEL])
    x[T_LEVEL] = x[T]


@part
def _held(p, y):  # type: ignore[no-untyped-def]
    """Return what the line takes in from the reservoir's pressure to y [m3], the integral of C."""
    more = 1.0 - p[POWER]  # of the air's volume as e^(-POWER y), over the pressure
    liquid = p[LINE] * math.expm1(y) - p[GAS] * math.expm1(more * y) / more
    gas = -p[GAS] * math.expm1(-p[POWER] * y)
    return (p[RESERVOIR] * liquid / p[MODULUS] + gas) / p[RATIO]


@part
def relieve(p, table, x, accounts, h):  # type: ignore[no-untyped-def]
    """Let the line give what it holds above the sea's pressure after a step of h [s].

    That counts as pumped. What the stroke has no room for stays in it.
    """
    sea = _sea(p, table, x[Z])
    if x[LEVEL] <= sea or x[V] >= p[V_MAX]:
        return
    empty_line(p, table, x)
    if x[LEVEL] <= sea:
        return
    held = _held(p, x[LEVEL])
    given = held - _held(p, sea)
    if given > p[V_MAX] - x[V]:
        given = p[V_MAX] - x[V]
        low, high = sea, x[LEVEL]
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if _held(p, middle) < held - given:
                low = middle
            else:
                high = middle
        sea = high
    x[LEVEL] = sea
    x[V] += given
    accounts[PUMPED] += given
    accounts[PUMP_WORK] += given * value(table, p[STEP], PRESSURE, x[Z])[0]
    if given > _MUCH:
        x[H] = min(x[H], h * _MUCH / given)


@part
def valve_turns(p, table, waves, x, at, t, z, w):  # type: ignore[no-untyped-def]
    """Return a number that is above 0 where the check valve of a pump that runs opens, or shuts.

    t [s] after the state x, at depth z [m] and speed w [m/s].
    """
    doing = at[DOING]
    if at[SHUT] == 1 and doing == PRIMING:
        sea = _sea(p, table, z)
        if sea > p[TOP]:
            return -1.0
        begun = _fill_time(p, table, min(x[LEVEL], p[TOP]))
        return begun + p[DELIVERY] * t - _fill_time(p, table, sea)
    if at[SHUT] == 1 or doing != PUMPING:
        return -1.0
    dz = w
    if waves.shape[0] > 0:
        dz += _moved(waves, z, x[T] + t)[1]
    out = line_flow(p, table, z, dz)[0]
    out += p[DELIVERY] * max(value(table, p[STEP], RATE_OUT, max(z, 0.0))[0], 0.0)
    return -(out + _SEATS) * _FLOW_SCALE


@part
def turn_valve(p, table, x, at):  # type: ignore[no-untyped-def]
    """Open or shut the check valve of a pump that runs: the line is at the pressure of the sea."""
    x[LEVEL], x[T_LEVEL] = _sea(p, table, x[Z]), x[T]
    if at[SHUT] == 0:
        at[SHUT] = 1
        at[DOING] = PRIMING
        return
    at[SHUT] = 0
    if x[T_PRIMED] == math.inf:
        delivery = p[DELIVERY] * value(table, p[STEP], RATE_OUT, max(x[Z], 0.0))[0]
        x[T_PRIMED] = x[T] + (p[RUN_UP] / delivery if delivery > 0.0 else 0.0)
    if x[T] >= x[T_PRIMED]:
        at[DOING] = PUMPING
