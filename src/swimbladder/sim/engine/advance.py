"""One vehicle over one step with a held input, events located to 2^-20 of the step.

A step is tried whole; where a limit is crossed inside it, it is halved by table look-up until the
event stands between two ticks. An impact (end stop, bottom) takes the state before the crossing,
put at the limit, so that none is passed; what is continuous (surface, direction of the motor,
supply) the one after.

What may be crossed unseen inside a step, and what is done where a limit is crossed.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.arrays import Array
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.accounts import Account, decays, enter, enter_bend, enter_impact
from swimbladder.sim.engine.cache import compiled, inlined, part, shared
from swimbladder.sim.engine.chain import (
    COEFFICIENTS,
    LEVELS,
    TICKS,
    accept,
    build_chain,
    exponential_step,
)
from swimbladder.sim.engine.modes import COUNT, Layers, event, first_mode, resting_volume, split


@part
def may_hide(p: Array, layers: Any, mode: int, x: Array, y: Array, h: float) -> Any:
    """Return whether z or V turned inside the step so near a limit that it may have crossed it."""
    act, _, where = split(mode)
    if where == modes.EMERGING and h * h * p[modes.A_S] > modes.SLOW_BOBBING:
        # it may bob more than once
        return layers.table.shape[0] > 0 or _may_submerge(p, x, y)
    if where != modes.BOTTOM and x[3] * y[3] < 0.0:
        reach = h * max(abs(x[3]), abs(y[3]))
        low, high = min(x[2], y[2]) - reach, max(x[2], y[2]) + reach
        if high > p[modes.Z_BOTTOM]:
            return True
        if where == modes.EMERGING and high > p[modes.Z_SURFACE]:
            return True
        if where != modes.EMERGING and low < p[modes.Z_SURFACE]:
            return True
    if act in (modes.FORWARD, modes.BACKWARD):
        before, after = x[0] - p[modes.K_L] * x[2], y[0] - p[modes.K_L] * y[2]
        if before * after < 0.0:
            reach = h * max(abs(before), abs(after))
            low, high = min(x[1], y[1]) - reach, max(x[1], y[1]) + reach
            if high > p[modes.V_MAX] or low < p[modes.V_MIN]:
                return True
            if where == modes.BOTTOM and high > resting_volume(p, layers, x[2]):
                return True
    return False


@part
def _may_submerge(p: Array, x: Array, y: Array) -> Any:
    """Return whether an emerged hull that bobs about where it floats may reach the water line."""
    stiffness = p[modes.A_S] - p[modes.A_B] * p[modes.PSI]
    if stiffness <= 0.0:
        return True
    pull = p[modes.A_S] * p[modes.Z_SURFACE]
    floats = (pull - p[modes.A_B] * (x[1] - p[modes.V_0])) / stiffness
    floats_next = (pull - p[modes.A_B] * (y[1] - p[modes.V_0])) / stiffness
    swing = math.sqrt((x[2] - floats) ** 2 + x[3] * x[3] / stiffness)
    swing_next = math.sqrt((y[2] - floats_next) ** 2 + y[3] * y[3] / stiffness)
    reach = max(floats, floats_next) + max(swing, swing_next) + abs(floats - floats_next)
    return reach >= p[modes.Z_SURFACE]


@part
def note(log: Array, count: Any, t: float, old: Any, new: Any) -> None:
    """Record a passage that a reader cares about: end stops, surface, bottom, supply limit."""
    old_act, _, old_where = split(old)
    new_act, _, new_where = split(new)
    at_stop = new_act in (modes.UPPER, modes.LOWER, modes.LOWER_SPINNING)
    was_at_stop = old_act in (modes.UPPER, modes.LOWER, modes.LOWER_SPINNING)
    if (at_stop == was_at_stop) and old_where == new_where:
        return
    if count[0] < log.shape[0]:
        log[count[0], 0] = t
        log[count[0], 1] = old
        log[count[0], 2] = new
    count[0] += 1


@part
def at_stop(p: Array, mode: int, x: Array) -> Any:
    """Return whether a mode is one of an end stop at which the volume stands."""
    act = mode % 10
    if act == modes.UPPER:
        return x[1] == p[modes.V_MAX]
    return act in (modes.LOWER, modes.LOWER_SPINNING) and x[1] == p[modes.V_MIN]


@part
def put_volume(p: Array, volume: float, x: Array, accounts: Array) -> None:
    """Put V at a volume less than a tick away, as if the motor had worked for it."""
    moved = volume - x[1]
    x[1] = volume
    if accounts.shape[0] > 0 and moved != 0.0:
        raised = x[2] * moved
        load = p[modes.LOAD_DRIVE] if moved > 0.0 else p[modes.LOAD_BACK]
        accounts[Account.PUMPED] += moved
        accounts[Account.Z_DV] += raised
        accounts[Account.Z_Q] += raised
        accounts[Account.LOAD_Q] += load * raised
        accounts[Account.U_Q] += load * raised


@part
def put_at_limit(p: Array, mode: int, x: Array, accounts: Array) -> None:
    """Put V or z at the end stop or the bottom that was reached: less than a tick of the way."""
    act, _, where = split(mode)
    if act == modes.UPPER:
        put_volume(p, p[modes.V_MAX], x, accounts)
    elif act in (modes.LOWER, modes.LOWER_SPINNING):
        put_volume(p, p[modes.V_MIN], x, accounts)
    if where == modes.BOTTOM:
        x[2] = p[modes.Z_BOTTOM]


DONE, LEFT_WATER, TOO_DEEP, CHATTERS, NOT_FINITE = 0, 1, 2, 3, 4
EVENTS = 2000  # passages kept of a vehicle; more are counted
_TRANSITIONS = 500  # in one step: more is no motion but chatter
_FINE = 6  # level from which on turns inside a step cannot hide a crossing that matters
_STEPS = 50_000  # in one step: likewise
_BENDS = 8  # in one step: from then on the bend of the drag is no longer searched for


class ModeLane(NamedTuple):
    """A vehicle that `advance` moves by its modes, with what it is moved in and what is kept."""

    p: Array  # its parameters [len(Plant)]
    layers: Layers  # of the water
    x: Array  # q, V, z, w, integral of z
    y: Array  # [10] to write in
    chains: Array  # [COUNT, LEVELS + 1, COEFFICIENTS], exponentials for steps of one length
    built: NDArray[np.uint8]  # [COUNT], 1: those of the mode are made
    accounts: Array  # accounts to add to, or empty
    log: Array  # [n, 3], passages from mode to mode
    noted: NDArray[np.int64]  # [1], how many there were


def new_lane(p: Array, layers: Layers, start: Array, *, booked: bool = False) -> ModeLane:
    """Return a vehicle in a state (q, V, z, w); booked: its accounts and passages are kept."""
    return ModeLane(
        p=p,
        layers=layers,
        x=np.array([*start, 0.0]),
        y=np.zeros(10),
        chains=np.empty((COUNT, LEVELS + 1, COEFFICIENTS)),
        built=np.zeros(COUNT, np.uint8),
        accounts=np.zeros(len(Account) if booked else 0),
        log=np.zeros((EVENTS if booked else 0, 3)),
        noted=np.zeros(1, np.int64),
    )


@inlined
def ensure_chain(lane: ModeLane, mode: int, h: float) -> None:
    """Make the exponentials of a mode for steps of h [s] where they are not made yet."""
    if lane.built[mode] == 0:
        build_chain(lane.p, mode, h, lane.chains[mode])
        lane.built[mode] = 1


@inlined
def _accept(lane: ModeLane, mode: int, u: float, span: float, bend: bool) -> None:
    """Make what a step of a span [s] led to the state, and enter it in the accounts."""
    p, x, y, accounts = lane.p, lane.x, lane.y, lane.accounts
    if accounts.shape[0] > 0:
        decays(p, mode, span, y[5:])
        enter(p, mode, x, y, u, span, y[5:], accounts)
        if bend:
            enter_bend(p, lane.layers, x, y, span, accounts)
    accept(x, y)


@shared
def advance(lane: ModeLane, mode: int, u: float, h: float, t: float) -> Any:
    """Advance a vehicle in place by h [s] from the time t [s]; return (mode, why it stopped).

    u: the held input. The exponentials of the lane are those for this h.
    """
    p, layers, x, y, accounts = lane.p, lane.layers, lane.x, lane.y, lane.accounts
    log, noted = lane.log, lane.noted
    wants_small = p[modes.EPSILON] < np.inf or accounts.shape[0] > 0  # steps of a hull that bobs
    remaining = TICKS
    cap = TICKS
    searching = False
    last_try = False  # the search is over, and what it looked for is in the tick to come
    smallest = 1  # more where rounding hides what is looked for
    transitions = 0
    steps = 0
    bent = 0
    act = mode % 10
    if (act == modes.MOVING_OUT and u < x[1]) or (act == modes.MOVING_IN and u > x[1]):
        x[0] = -x[0]  # a positioner that is asked to turn back
        mode += (modes.MOVING_IN if act == modes.MOVING_OUT else modes.MOVING_OUT) - act
    while remaining > 0:
        while True:
            new, q, w, reset = event(p, layers, mode, x, u)
            if new == -1:
                break
            if new == -2:
                return mode, LEFT_WATER
            if new == -3:
                return mode, TOO_DEEP
            transitions += 1
            if transitions > _TRANSITIONS:
                return mode, CHATTERS
            if accounts.shape[0] > 0 and (reset or q != x[0]):
                enter_impact(x[0], q, x[3], w, accounts)
            note(log, noted, t + h * (TICKS - remaining) / TICKS, mode, new)
            if new % 10 == modes.HOLDING:  # the last part of a tick
                put_volume(p, max(p[modes.V_MIN], min(p[modes.V_MAX], u)), x, accounts)
            x[0], x[3], mode = q, w, new
        ensure_chain(lane, mode, h)
        applied = u
        if (mode // 10) % 2 == 1:
            applied = math.copysign(p[modes.SUPPLY], u)
        size = cap
        while size > remaining:
            size >>= 1
        level = 0
        while (TICKS >> level) > size:
            level += 1
        while True:
            steps += 1
            if steps > _STEPS:
                return mode, CHATTERS
            bend = exponential_step(lane.chains[mode], level, p, layers, x, applied, y)
            span = h * size / TICKS
            if not abs(y[2]) + abs(y[3]) + abs(y[1]) < 1e12:
                return mode, NOT_FINITE
            new, q, w, reset = event(p, layers, mode, y, u)
            if new == -1:
                search = size > smallest and bend and bent < _BENDS
                bobs = mode // 20 == modes.EMERGING and wants_small
                bobs = bobs and span * span * p[modes.A_S] > modes.QUICK_BOBBING
                if search or (
                    level < _FINE and (bend or bobs or may_hide(p, layers, mode, x, y, span))
                ):
                    size >>= 1
                    level += 1
                    cap = size
                    searching = searching or search
                    continue
                if bend:
                    bent += 1
                    searching, last_try, smallest, cap = False, False, 1, TICKS
                _accept(lane, mode, u, span, bend)
                remaining -= size
                if searching:
                    cap = size >> 1
                    if last_try:
                        cap, searching, last_try = TICKS, False, False
                        smallest = min(2 * smallest, TICKS)
                    elif cap < smallest:
                        cap, last_try = smallest, True
                break
            if size > smallest:
                size >>= 1
                level += 1
                cap = size
                searching = True
                continue
            # the event lies within this one tick
            searching, last_try, smallest, cap = False, False, 1, TICKS
            # Where the volume stands at the stop already and the motor turns back to it within this
            # tick, the state before would leave it again, without end: the one after is taken.
            back = reset and new // 20 == mode // 20 and at_stop(p, new, x)
            if reset and not back:
                transitions += 1
                if transitions > _TRANSITIONS:
                    return mode, CHATTERS
                q_new = x[0] if new % 10 in (mode % 10, modes.LOWER_SPINNING) else q
                w_new = 0.0 if new // 20 == modes.BOTTOM and mode // 20 != modes.BOTTOM else x[3]
                if accounts.shape[0] > 0:
                    enter_impact(x[0], q_new, x[3], w_new, accounts)
                note(log, noted, t + h * (TICKS - remaining) / TICKS, mode, new)
                x[0], x[3], mode = q_new, w_new, new
                put_at_limit(p, mode, x, accounts)
            else:
                _accept(lane, mode, u, span, False)
                remaining -= size
                if back:
                    if accounts.shape[0] > 0:
                        enter_impact(y[0], q, y[3], y[3], accounts)
                    note(log, noted, t + h * (TICKS - remaining) / TICKS, mode, new)
                    x[0], mode = q, new
                    put_at_limit(p, mode, x, accounts)
            break
    return mode, DONE


class Inputs(NamedTuple):
    """What a vehicle is driven by: volumes that go linearly from instant to instant, or voltages.

    A voltage is held until the next instant.
    """

    time: Array  # s [n]
    values: Array  # m3 or V [n]
    ramps: bool  # whether they are volumes
    parts: NDArray[np.int64]  # steps in each interval [n - 1]


@compiled
def follow(lane: ModeLane, given: Inputs, record: Array) -> Any:
    """Drive a vehicle by recorded inputs; return (instants reached, why). record [7, n]."""
    p, x = lane.p, lane.x
    time, inputs, ramps = given.time, given.values, given.ramps
    h_before = -1.0
    n = time.shape[0]
    mode, x[0] = first_mode(p, lane.layers, x)
    if ramps:
        mode += modes.PRESCRIBED - mode % 10
    why = DONE
    for k in range(n):
        if ramps:
            x[1] = inputs[k]
            if k < n - 1:
                x[0] = (inputs[k + 1] - inputs[k]) / (time[k + 1] - time[k])
        record[0, k], record[1, k], record[2, k], record[3, k] = x[2], x[3], x[1], x[0]
        record[4, k], record[5, k] = inputs[k], inputs[k]
        if k == n - 1:
            break
        h = (time[k + 1] - time[k]) / given.parts[k]
        if h != h_before:
            lane.built[:] = 0
            h_before = h
        u = 0.0 if ramps else max(-p[modes.SUPPLY], min(p[modes.SUPPLY], inputs[k]))
        record[5, k] = inputs[k] if ramps else u
        for piece in range(given.parts[k]):
            mode, why = advance(lane, mode, u, h, time[k] + piece * h)
            if why != DONE:
                return k + 1, why
    return n, why


@compiled
def begin(lane: ModeLane) -> Any:
    """Return the mode that a vehicle's state begins in, and make its volume rate that of it."""
    mode, lane.x[0] = first_mode(lane.p, lane.layers, lane.x)
    return mode
