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

Values of the table at any place: cubic Hermite, one read, no search.
"""

import math
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from numba import types

from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater.column import look_up_bent
from swimbladder.physics.seawater.motion import moved
from swimbladder.sim.engine.cache import chosen_by_first, inlined, part
from swimbladder.sim.engine.rodas.records import Account, Doing, Lane, Table

# Value, slope and curvature of a column at depth z [m]; of the columns over the line's pressure z
# is its logarithm, as in `line`, and the step that of its grid.
value = part(look_up_bent)


P = ParamSpec("P")
R = TypeVar("R")

_moved = inlined(moved)

_HIGHEST = 40.0  # e^40 of the reservoir's pressure: no sea, where the table goes on straight
_HALVINGS = 60  # to the last bit of a pressure
_MUCH = 1e-8  # m3 that a line gives in one step of a vehicle that rises, at most about
_EMPTY = 1e-9  # share of the reservoir's pressure above it that does not count
_SEATS = 1e-15  # m3/s of flow back that shut it
_FLOW_SCALE = 1e6  # the guard of a flow counts in mL/s


def with_line(without: Callable[..., R]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function of a lane, or of a record of GIVEN, be that of a vehicle with an oil line.

    For others it is `without`, and nothing of it is compiled: a sixth of the time of a first run.
    """

    def choose(function: Callable[P, R]) -> Callable[P, R]:
        """Return the function for vehicles with a line, `without` for others."""
        own = part(function)

        def of_value(of: Any) -> Callable[..., Any]:
            return function if "line" in getattr(of, "p", of).dtype.fields else without

        def of_type(of: Any) -> Callable[..., Any]:
            given = of if isinstance(of, types.Record) else of.types[0]
            return own if "line" in given.fields else without

        return chosen_by_first(of_value, of_type)

    return choose


@part
def _head(p: Any, table: Array, z: float) -> Any:
    """Return the sea's pressure over the reservoir's [Pa] at depth z, its slope and curvature."""
    pressure, slope, bend = value(table, p.step, Table.PRESSURE, max(z, 0.0))
    if z < 0.0:
        slope, bend = 0.0, 0.0
    return pressure + p.head_afloat, slope, bend


@part
def _sea(p: Any, table: Array, z: float) -> Any:
    """Return y at which the check valve opens at depth z."""
    head = _head(p, table, z)[0]
    return math.log(1.0 + max(head, 0.0) / (p.line_ratio * p.reservoir))


@part
def _give(p: Any, y: float) -> Any:
    """Return C [m3/Pa], and its derivative by y."""
    oil = p.reservoir * math.exp(y)
    gas = p.line_gas * math.exp(-p.line_power * y)
    squared = p.line_ratio * p.line_ratio
    liquid = (p.line - gas) / p.line_modulus
    by_level = p.line_power * gas * (1.0 / p.line_modulus - (1.0 + p.line_power) / oil)
    return (liquid + p.line_power * gas / oil) / squared, by_level / squared


@with_line(lambda *_: (0.0, 0.0, 0.0))
def line_flow(p: Any, table: Array, z: float, dz: float) -> Any:
    """Return what an open line gives the bladder beside the pump's delivery [m3/s].

    dz: speed of the vehicle down [m/s]. Also the slopes by depth [m2/s] and by dz [m2].
    """
    head, slope, bend = _head(p, table, z)
    head = max(head, 0.0)
    oil = p.reservoir + head / p.line_ratio
    give, by_level = _give(p, math.log(oil / p.reservoir))
    by_depth = by_level * slope / (p.line_ratio * oil)
    return -give * slope * dz, -(by_depth * slope + give * bend) * dz, -give * slope


@part
def _fill_time(p: Any, table: Array, y: float) -> Any:
    """Return the time [s] in which the pump takes the line from rest to y; inf: it stalls."""
    if y > p.line_top:
        return math.inf
    return value(table, p.line_step, Table.FILLING, y)[0]


@part
def _filled(p: Any, table: Array, y: float, h: float) -> Any:
    """Return what y becomes after h [s] of the pump, and the energy of that [J] at 0 degC, J/K."""
    step = p.line_step
    goal = value(table, step, Table.FILLING, y)[0] + h
    low, high = y, min(p.line_top, _HIGHEST)
    if high <= low or value(table, step, Table.FILLING, high)[0] <= goal:
        low = max(low, high)  # it stalls, and draws what it draws there
    else:
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if value(table, step, Table.FILLING, middle)[0] < goal:
                low = middle
            else:
                high = middle
    time, slow, _ = value(table, step, Table.FILLING, low)
    e, by_level, _ = value(table, step, Table.FILL_ENERGY, low)
    k, warmth, _ = value(table, step, Table.FILL_WARMTH, low)
    e -= value(table, step, Table.FILL_ENERGY, y)[0]
    k -= value(table, step, Table.FILL_WARMTH, y)[0]
    if goal > time and slow > 0.0:
        e += (goal - time) * by_level / slow
        k += (goal - time) * warmth / slow
    return low, e, k


@part
def _fall_time(p: Any, table: Array, y: float) -> Any:
    """Return the time [s], from some beginning, at which a line that empties is at y > 0."""
    head = p.line_ratio * p.reservoir * math.expm1(y)
    first = _give(p, 0.0)[0] / p.slip
    return -first * math.log(head) - value(table, p.line_step, Table.EMPTYING, y)[0]


@part
def _emptied(p: Any, table: Array, y: float, h: float) -> Any:
    """Return what y becomes in h [s] while the pump stands and the check valve is shut."""
    if p.slip == 0.0 or y <= _EMPTY or h <= 0.0:
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


@with_line(lambda *_: 0.0)
def fill_lacks(lane: Lane) -> Any:
    """Return how long the pump has to run [s] before the line is at the pressure of the sea."""
    p, table, x = lane.p, lane.table, lane.x
    begun = _fill_time(p, table, min(x.line_level, p.line_top))
    return max(_fill_time(p, table, _sea(p, table, x.z)) - begun, 0.0)


def _begins_at_once(lane: Lane) -> bool:
    lane.at.shut = 0
    return False


@with_line(_begins_at_once)
def fills_line(lane: Lane) -> bool:
    """Begin to bring the line to the sea's pressure; return whether the pump has to."""
    x, at = lane.x, lane.at
    empty_line(lane)
    at.doing = Doing.PRIMING
    at.shut = 1
    x.t_primed = math.inf
    return True


def _start_volume(lane: Lane, rate: float) -> Any:  # noqa: ARG001
    return value(lane.table, lane.p.step, Table.START, max(lane.x.z, 0.0))[0]


@with_line(_start_volume)
def lost_to_start(lane: Lane, rate: float) -> Any:
    """Return what a start falls short of [m3] with a pump of this rate [m3/s].

    What its line still holds it need not press into it.
    """
    empty_line(lane)
    return lane.p.run_up + rate * fill_lacks(lane)


@with_line(lambda *_: False)
def stalls(lane: Lane, z: float) -> bool:
    """Return whether the pump fills a line that it cannot bring to the sea's pressure."""
    p, at = lane.p, lane.at
    if at.doing != Doing.PRIMING or at.shut == 0:
        return False
    return bool(_sea(p, lane.table, z) > p.line_top)


@with_line(lambda *given: given[3])
def advance_line(lane: Lane, z: float, h: float, energy: float) -> Any:
    """Let the line's pressure go on for h [s], in which the vehicle comes to depth z [m].

    energy: what the drive takes at the sea's pressure [J]. Return what it does take.
    """
    p, table, x, at = lane.p, lane.table, lane.x, lane.at
    if at.shut == 0:
        x.line_level = _sea(p, table, z)
        x.t_level = x.t + h
    elif at.doing == Doing.PRIMING:
        x.t_level = x.t + h
        share = p.delivery
        x.line_level, cold, by_warmth = _filled(p, table, x.line_level, share * h)
        warmth = value(table, p.step, Table.TEMPERATURE, max(x.z, 0.0))[0]
        return (cold + by_warmth * warmth) / share
    return energy  # what a line loses at rest is seen when it matters: `empty_line`


@with_line(lambda *_: None)
def empty_line(lane: Lane) -> None:
    """Let the line be as empty as it is by now, while the pump stands."""
    x = lane.x
    x.line_level = _emptied(lane.p, lane.table, x.line_level, x.t - x.t_level)
    x.t_level = x.t


@part
def _held(p: Any, y: float) -> Any:
    """Return what the line takes in from the reservoir's pressure to y [m3], the integral of C."""
    more = 1.0 - p.line_power  # of the air's volume as e^(-POWER y), over the pressure
    liquid = p.line * math.expm1(y) - p.line_gas * math.expm1(more * y) / more
    gas = -p.line_gas * math.expm1(-p.line_power * y)
    return (p.reservoir * liquid / p.line_modulus + gas) / p.line_ratio


@with_line(lambda *_: None)
def relieve(lane: Lane, h: float) -> None:
    """Let the line give what it holds above the sea's pressure after a step of h [s].

    That counts as pumped. What the stroke has no room for stays in it.
    """
    p, table, x, accounts = lane.p, lane.table, lane.x, lane.accounts
    sea = _sea(p, table, x.z)
    if x.line_level <= sea or x.v >= p.v_max:
        return
    empty_line(lane)
    if x.line_level <= sea:
        return
    held = _held(p, x.line_level)
    given = held - _held(p, sea)
    if given > p.v_max - x.v:
        given = p.v_max - x.v
        low, high = sea, x.line_level
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if _held(p, middle) < held - given:
                low = middle
            else:
                high = middle
        sea = high
    x.line_level = sea
    x.v += given
    accounts[Account.PUMPED] += given
    accounts[Account.PUMP_WORK] += given * value(table, p.step, Table.PRESSURE, x.z)[0]
    if given > _MUCH:
        x.h = min(x.h, h * _MUCH / given)


@with_line(lambda *_: -1.0)
def valve_turns(lane: Lane, t: float, z: float, w: float) -> Any:
    """Return a number that is above 0 where the check valve of a pump that runs opens, or shuts.

    t [s] after the state x, at depth z [m] and speed w [m/s].
    """
    p, table, waves, x, at = lane.p, lane.table, lane.waves, lane.x, lane.at
    doing = at.doing
    if at.shut == 1 and doing == Doing.PRIMING:
        sea = _sea(p, table, z)
        if sea > p.line_top:
            return -1.0
        begun = _fill_time(p, table, min(x.line_level, p.line_top))
        return begun + p.delivery * t - _fill_time(p, table, sea)
    if at.shut == 1 or doing != Doing.PUMPING:
        return -1.0
    dz = w
    if waves.shape[0] > 0:
        dz += _moved(waves, z, x.t + t)[1]
    out = line_flow(p, table, z, dz)[0]
    out += p.delivery * max(value(table, p.step, Table.RATE_OUT, max(z, 0.0))[0], 0.0)
    return -(out + _SEATS) * _FLOW_SCALE


@with_line(lambda *_: None)
def turn_valve(lane: Lane) -> None:
    """Open or shut the check valve of a pump that runs: the line is at the pressure of the sea."""
    p, table, x, at = lane.p, lane.table, lane.x, lane.at
    x.line_level, x.t_level = _sea(p, table, x.z), x.t
    if at.shut == 0:
        at.shut = 1
        at.doing = Doing.PRIMING
        return
    at.shut = 0
    if x.t_primed == math.inf:
        delivery = p.delivery * value(table, p.step, Table.RATE_OUT, max(x.z, 0.0))[0]
        x.t_primed = x.t + (p.run_up / delivery if delivery > 0.0 else 0.0)
    if x.t >= x.t_primed:
        at.doing = Doing.PUMPING
