"""Pump, valve and bypass: runs that end by time or by volume, and how a vehicle moves through them.

`change_volume`, `take_in` and `press_out` start what a processor asks for; `move` takes the vehicle
by a step at most, with all that happens in it.
"""

import math
from typing import Any

from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.line import (
    fill_lacks,
    fills_line,
    lost_to_start,
    turn_valve,
    value,
    valve_turns,
    with_line,
)
from swimbladder.sim.engine.rodas.records import Account, Doing, Lane, Note, Stop, Table
from swimbladder.sim.engine.rodas.step import (
    AIR,
    BOTTOM,
    LOST,
    SURFACE,
    VALVE,
    VOLUME,
    integrate,
    lift_volume,
    settle,
    stay,
)
from swimbladder.sim.engine.sensor import normal

FULL = 1e-3  # share of the stroke that may be lacking where all volume counts as out
STAYED = -2  # what `move` returns beside the guards of `integrate` and -1: no step was needed
_FRESH = 2.0  # s, of the first step after the drive has started or stopped
_PAST = 1e-6  # of a quantum, past the edge between two of its steps
_FULL_LINE = 1e-9  # s; a line that lacks less is full


@part
def note(lane: Lane, what: int, number: float) -> None:
    """Note something with its time; without room nothing is kept."""
    n, x = lane.counts[1], lane.x
    if n < lane.notes.shape[0]:
        new = lane.notes[n]
        new.t, new.what, new.z, new.v, new.number = x.t, what, x.z, x.v, number
        lane.counts[1] = n + 1


@part
def _end_of(lane: Lane, doing: int, goal: float) -> float:
    """Return the volume [m3] at which the measured one comes to a goal, by noise and quantum."""
    p, at = lane.p, lane.at
    if at.seed < 0:
        return goal
    q = p.volume_quantum
    if q > 0.0 and doing == Doing.PUMPING:
        goal = q * (math.ceil(goal / q - _PAST) - 0.5 + _PAST)
    elif q > 0.0:
        goal = q * (math.floor(goal / q + _PAST) + 0.5 - _PAST)
    if p.volume_noise > 0.0:
        goal -= p.volume_noise * normal(at)
    return goal


@part
def _run_to(lane: Lane, doing: int, seen: float, goal: float, longest: float) -> None:
    """Start a run from a measured volume to a measured goal [m3]; none where it is past it."""
    end, v = _end_of(lane, doing, goal), lane.x.v
    if (end - v if doing == Doing.PUMPING else v - end) > 0.0:
        start_run(lane, doing, goal - seen, end, longest)


@part
def _in_steps(p: Any, length: float) -> Any:
    """Return the length of a run [s] as the processor's clock gives it."""
    if p.quantum > 0.0:
        return p.quantum * math.floor(length / p.quantum + 0.5)
    return length


@part
def start_run(lane: Lane, doing: int, wanted: float, volume: float, longest: float) -> None:
    """Start the drive: until a `volume` [m3] is reached, for `longest` [s] at most.

    wanted: what was asked for [m3], to be noted.
    """
    p, table, x, at = lane.p, lane.table, lane.x, lane.at
    if doing == Doing.PUMPING and x.v >= p.v_max:
        return
    if doing != Doing.PUMPING and x.v <= p.v_min:
        return
    at.doing = doing
    at.rests = 0
    short = value(table, p.step, Table.START, max(x.z, 0.0))[0]
    delivery = p.delivery * value(table, p.step, Table.RATE_OUT, max(x.z, 0.0))[0]
    if doing == Doing.PUMPING:
        fills = fills_line(lane)
        if not fills and short > 0.0 and delivery > 0.0:
            at.doing = Doing.PRIMING
            x.t_primed = x.t + short / delivery
    x.v_move = volume
    x.h = min(x.h, _FRESH)
    x.t_begin = x.t
    x.t_move = x.t + longest
    lane.accounts[Account.PUMP_RUNS if doing == Doing.PUMPING else Account.VALVE_RUNS] += 1.0
    what = Note.VALVE if doing == Doing.LETTING_IN else Note.BYPASS
    what = Note.PUMP if doing == Doing.PUMPING else what
    note(lane, what, wanted)


@part
def end_run(lane: Lane) -> None:
    """Stop the drive."""
    x, at = lane.x, lane.at
    at.doing = Doing.NOTHING
    at.shut = 1
    note(lane, Note.RUN_OVER, x.t - x.t_begin)
    x.t_move = math.inf
    x.v_move = math.nan
    x.h = min(x.h, _FRESH)


@part
def change_volume(lane: Lane, volume: float, wanted: float, longest: float) -> None:
    """Start the run that a wanted change of volume [m3] takes, for `longest` [s] at most.

    volume: as it was measured [m3], where it is.
    """
    p, table, x = lane.p, lane.table, lane.x
    doing = Doing.PUMPING if wanted > 0.0 else Doing.LETTING_IN
    if p.by_volume > 0.0:
        _run_to(lane, doing, volume, volume + wanted, longest)
        return
    column = Table.RATE_OUT if wanted > 0.0 else Table.RATE_IN
    rate_now = value(table, p.step, column, max(x.z, 0.0))[0]
    length = longest
    if rate_now > 0.0:
        lost = 0.0
        if wanted > 0.0 and p.makes_up > 0.0:
            lost = lost_to_start(lane, rate_now)
        length = min((abs(wanted) + lost) / rate_now, longest)
    length = _in_steps(p, length)
    if length > 0.0:
        end = math.inf if wanted > 0.0 else -math.inf
        start_run(lane, doing, wanted, end, length)


@part
def take_in(lane: Lane, volume: float, wanted: float, longest: float) -> None:
    """Let in volume near the surface by valve or bypass, whichever is quicker there.

    volume: as it was measured [m3]; wanted: of `control.pump_valve` [m3]; longest [s].
    """
    p, table = lane.p, lane.table
    by_valve = value(table, p.step, Table.RATE_IN, 0.0)[0]
    by_bypass = value(table, p.step, Table.BYPASS, 0.0)[0]
    if max(by_valve, by_bypass) <= 0.0:  # no head at depth 0: there is some where it floats
        z = max(lane.x.z, 0.0)
        by_valve = value(table, p.step, Table.RATE_IN, z)[0]
        by_bypass = value(table, p.step, Table.BYPASS, z)[0]
    doing = Doing.BYPASSING if by_bypass > by_valve else Doing.LETTING_IN
    flow = max(by_bypass, by_valve)
    if p.by_volume > 0.0:
        if wanted < volume:
            _run_to(lane, doing, volume, wanted, longest)
        return
    if wanted == 0.0:
        return
    if flow > 0.0:
        longest = max(_in_steps(p, min(longest, -wanted / flow)), p.quantum)
    start_run(lane, doing, wanted, -math.inf, longest)


@part
def press_out(lane: Lane) -> None:
    """Pump out all volume, in runs as long as the pump stands, one after the other."""
    p = lane.p
    start_run(lane, Doing.PUMPING, p.v_max - lane.x.v, p.v_max, p.longest)


@part
def _happen(lane: Lane, event: int) -> None:
    """Let happen what a step ended with."""
    p, x, at = lane.p, lane.x, lane.at
    if event == SURFACE:
        at.place = 1 - at.place
        note(lane, Note.EMERGED if at.place == 1 else Note.SUBMERGED, x.w)
    elif event == BOTTOM:
        note(lane, Note.BOTTOM, x.w)
        lane.accounts[Account.IMPACTS] += 0.5 * p.mass * x.w * x.w
        x.z, x.w = p.z_bottom, 0.0
        at.place = 2
    elif event == AIR:
        at.stop = Stop.LEFT_WATER
    elif event == VOLUME:
        _at_volume(lane)
    elif event == LOST:
        at.stop = Stop.LOST
    elif event == VALVE:
        turn_valve(lane)


@part
def _at_volume(lane: Lane) -> None:
    """End a run at its volume or at an end stop; put rounding right.

    A pump that a valve beats runs on where nothing more can come in.
    """
    p, x, at = lane.p, lane.x, lane.at
    beaten = at.doing == Doing.PUMPING and x.v - p.v_min < min(p.v_max, x.v_move) - x.v
    if at.doing == Doing.PRIMING or beaten:
        x.v = p.v_min
        note(lane, Note.LOWER_STOP, 0.0)
        return
    if at.doing == Doing.PUMPING:
        x.v = min(p.v_max, x.v_move)
    elif at.doing != Doing.NOTHING:
        x.v = max(p.v_min, x.v_move)
    else:
        x.v = p.v_min
    if x.v == p.v_max:
        note(lane, Note.UPPER_STOP, 0.0)
    elif x.v == p.v_min:
        note(lane, Note.LOWER_STOP, 0.0)
    if at.doing != Doing.NOTHING:
        end_run(lane)


@inlined
def next_turn(lane: Lane, until: float) -> float:
    """Return `until` [s], or when the drive ends or changes what it does, if that is earlier."""
    x, at = lane.x, lane.at
    if at.doing != Doing.NOTHING:
        until = min(until, x.t_move)
        if at.doing == Doing.PRIMING and at.shut == 0:
            until = min(until, x.t_primed)
        elif at.doing == Doing.PRIMING and at.place == 2:
            until = min(until, x.t + fill_lacks(lane) / lane.p.delivery)
    return until


@inlined
def move(lane: Lane, loads: float, level: float, until: float) -> Any:
    """Move the vehicle by a step, `until` [s] at most, with what happens in it.

    loads [W]; level: depth of arrival [m], negative from below, 0 none. Return the guard of
    `integrate` that ended it, -1 where none did, `STAYED` where it rests or lies on the bottom.
    """
    x, at = lane.x, lane.at
    if at.rests == 1 or at.place == 2:
        ended = stay(lane, loads, until)
        if ended == 1:
            _at_volume(lane)
        elif ended == 2:
            at.place = 0
            note(lane, Note.LEFT_BOTTOM, 0.0)
        elif ended == 3:
            at.rests = 0
        lift = lift_volume(lane.p, lane.table, x.z, x.hull)
        if at.place == 2 and at.doing == Doing.NOTHING and x.v >= lift:
            at.place = 0
            note(lane, Note.LEFT_BOTTOM, 0.0)
        return STAYED
    event = integrate(lane, loads, level, until)
    if event >= 0:
        _happen(lane, event)
    else:
        settle(lane)
    return event


@inlined
def end_turn(lane: Lane) -> None:
    """Let a primed pump deliver, and end a run whose time is over."""
    x, at = lane.x, lane.at
    if at.doing == Doing.PRIMING and at.shut == 0 and x.t >= x.t_primed:
        at.doing = Doing.PUMPING
    if at.doing != Doing.NOTHING and x.t >= x.t_move:
        end_run(lane)


@with_line(lambda *_: None)
def turn_line(lane: Lane) -> None:
    """Open or shut the check valve of an oil line where its pressure is that of the sea."""
    x, at = lane.x, lane.at
    if at.stop == 0:
        early = _FULL_LINE if at.doing == Doing.PRIMING and at.place == 2 else 0.0
        if valve_turns(lane, 0.0, x.z, x.w) > -early:
            turn_valve(lane)
