"""Pump, valve and bypass: runs that end by time or by volume, and how a vehicle moves through them.

`change_volume`, `take_in` and `press_out` start what a processor asks for; `move` takes the vehicle
by a step at most, with all that happens in it.
"""

from __future__ import annotations

import math

from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.leap import (
    AIR,
    BOTTOM,
    LOST,
    SURFACE,
    VALVE,
    VOLUME,
    leap,
)
from swimbladder.sim.engine.rodas.line import empty_line, fill_lacks, turn_valve, valve_turns
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.names import (
    Account,
    At,
    Doing,
    Drive,
    Given,
    Note,
    Now,
    Stop,
    Table,
)
from swimbladder.sim.engine.rodas.rest import lift_volume, settle, stay
from swimbladder.sim.engine.rodas.sensing import normal

T, Z, W, V, H = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.H)
T_MOVE, V_MOVE, HULL = int(Now.T_MOVE), int(Now.V_MOVE), int(Now.HULL)
T_PRIMED, T_BEGIN = int(Now.T_PRIMED), int(Now.T_BEGIN)
DOING, RESTS, PLACE, STOP = int(At.DOING), int(At.RESTS), int(At.PLACE), int(At.STOP)
SEED, SHUT = int(At.SEED), int(At.SHUT)
STEP, V_MIN, V_MAX = int(Given.STEP), int(Given.V_MIN), int(Given.V_MAX)
START, MASS, Z_BOTTOM = int(Table.START), int(Given.MASS), int(Given.Z_BOTTOM)
BY_VOLUME, QUANTUM, LONGEST = int(Given.BY_VOLUME), int(Given.QUANTUM), int(Given.LONGEST)
DELIVERY, MAKES_UP = int(Given.DELIVERY), int(Given.MAKES_UP)
LINE, RUN_UP = int(Given.LINE), int(Given.RUN_UP)
VOLUME_NOISE, VOLUME_QUANTUM = int(Given.VOLUME_NOISE), int(Given.VOLUME_QUANTUM)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
LETTING_IN, BYPASSING = int(Doing.LETTING_IN), int(Doing.BYPASSING)
RATE_OUT, RATE_IN, BYPASS = int(Table.RATE_OUT), int(Table.RATE_IN), int(Table.BYPASS)
PUMP_RUNS, VALVE_RUNS = int(Account.PUMP_RUNS), int(Account.VALVE_RUNS)
BLOWS = int(Account.BLOWS)
PUMP_NOTE, VALVE_NOTE = int(Note.PUMP), int(Note.VALVE)
BYPASS_NOTE, RUN_OVER = int(Note.BYPASS), int(Note.RUN_OVER)
NOTE_EMERGED, NOTE_SUBMERGED = int(Note.EMERGED), int(Note.SUBMERGED)
NOTE_BOTTOM, NOTE_LEFT = int(Note.BOTTOM), int(Note.LEFT_BOTTOM)
NOTE_UPPER, NOTE_LOWER = int(Note.UPPER_STOP), int(Note.LOWER_STOP)
N_T, N_WHAT, N_Z = int(Drive.T), int(Drive.WHAT), int(Drive.Z)
N_V, N_NUMBER = int(Drive.V), int(Drive.NUMBER)
STOP_LOST, LEFT_WATER = int(Stop.LOST), int(Stop.LEFT_WATER)

FULL = 1e-3  # share of the stroke that may be lacking where all volume counts as out
STAYED = -2  # what `move` returns beside the guards of `leap` and -1: no step was needed
_FRESH = 2.0  # s, of the first step after the drive has started or stopped
_PAST = 1e-6  # of a quantum, past the edge between two of its steps
_FULL_LINE = 1e-9  # s; a line that lacks less is full


@part
def note(notes, counts, x, what, number):  # type: ignore[no-untyped-def]
    """Note something with its time; without room nothing is kept."""
    n = counts[1]
    if n < notes.shape[0]:
        notes[n, N_T] = x[T]
        notes[n, N_WHAT] = what
        notes[n, N_Z] = x[Z]
        notes[n, N_V] = x[V]
        notes[n, N_NUMBER] = number
        counts[1] = n + 1


@part
def _end_of(p, at, doing, goal):  # type: ignore[no-untyped-def]
    """Return the volume [m3] at which the measured one comes to a goal, by noise and quantum."""
    if at[SEED] < 0:
        return goal
    q = p[VOLUME_QUANTUM]
    if q > 0.0 and doing == PUMPING:
        goal = q * (math.ceil(goal / q - _PAST) - 0.5 + _PAST)
    elif q > 0.0:
        goal = q * (math.floor(goal / q + _PAST) + 0.5 - _PAST)
    if p[VOLUME_NOISE] > 0.0:
        goal -= p[VOLUME_NOISE] * normal(at)
    return goal


@part
def _run_to(p, table, x, at, accounts, notes, counts, doing, seen, goal, longest):  # type: ignore[no-untyped-def]
    """Start a run from a measured volume to a measured goal [m3]; none where it is past it."""
    end = _end_of(p, at, doing, goal)
    if (end - x[V] if doing == PUMPING else x[V] - end) > 0.0:
        start_run(p, table, x, at, accounts, notes, counts, doing, goal - seen, end, longest)


@part
def _in_steps(p, length):  # type: ignore[no-untyped-def]
    """Return the length of a run [s] as the processor's clock gives it."""
    if p[QUANTUM] > 0.0:
        return p[QUANTUM] * math.floor(length / p[QUANTUM] + 0.5)
    return length


@part
def start_run(p, table, x, at, accounts, notes, counts, doing, wanted, volume, longest):  # type: ignore[no-untyped-def]
    """Start the drive: until a `volume` [m3] is reached, for `longest` [s] at most.

    wanted: what was asked for [m3], to be noted.
    """
    if doing == PUMPING and x[V] >= p[V_MAX]:
        return
    if doing != PUMPING and x[V] <= p[V_MIN]:
        return
    at[DOING] = doing
    at[RESTS] = 0
    if p[LINE] == 0.0:
        at[SHUT] = 0
    short = value(table, p[STEP], START, max(x[Z], 0.0))[0]
    delivery = p[DELIVERY] * value(table, p[STEP], RATE_OUT, max(x[Z], 0.0))[0]
    if doing == PUMPING and p[LINE] > 0.0:
        empty_line(p, table, x)
        at[DOING] = PRIMING
        at[SHUT] = 1
        x[T_PRIMED] = math.inf
    elif doing == PUMPING and short > 0.0 and delivery > 0.0:
        at[DOING] = PRIMING
        x[T_PRIMED] = x[T] + short / delivery
    x[V_MOVE] = volume
    x[H] = min(x[H], _FRESH)
    x[T_BEGIN] = x[T]
    x[T_MOVE] = x[T] + longest
    accounts[PUMP_RUNS if doing == PUMPING else VALVE_RUNS] += 1.0
    what = PUMP_NOTE if doing == PUMPING else (VALVE_NOTE if doing == LETTING_IN else BYPASS_NOTE)
    note(notes, counts, x, what, wanted)


@part
def end_run(x, at, notes, counts):  # type: ignore[no-untyped-def]
    """Stop the drive."""
    at[DOING] = NOTHING
    at[SHUT] = 1
    note(notes, counts, x, RUN_OVER, x[T] - x[T_BEGIN])
    x[T_MOVE] = math.inf
    x[V_MOVE] = math.nan
    x[H] = min(x[H], _FRESH)


@part
def change_volume(p, table, x, at, accounts, notes, counts, volume, wanted, longest):  # type: ignore[no-untyped-def]
    """Start the run that a wanted change of volume [m3] takes, for `longest` [s] at most.

    volume: as it was measured [m3], where it is.
    """
    doing = PUMPING if wanted > 0.0 else LETTING_IN
    if p[BY_VOLUME] > 0.0:
        goal = volume + wanted
        _run_to(p, table, x, at, accounts, notes, counts, doing, volume, goal, longest)
        return
    rate_now = value(table, p[STEP], RATE_OUT if wanted > 0.0 else RATE_IN, max(x[Z], 0.0))[0]
    length = longest
    if rate_now > 0.0:
        lost = 0.0
        if wanted > 0.0 and p[MAKES_UP] > 0.0:
            lost = value(table, p[STEP], START, max(x[Z], 0.0))[0]
            if p[LINE] > 0.0:  # what its line still holds it need not press into it
                empty_line(p, table, x)
                lost = p[RUN_UP] + rate_now * fill_lacks(p, table, x)
        length = min((abs(wanted) + lost) / rate_now, longest)
    length = _in_steps(p, length)
    if length > 0.0:
        end = math.inf if wanted > 0.0 else -math.inf
        start_run(p, table, x, at, accounts, notes, counts, doing, wanted, end, length)


@part
def take_in(p, table, x, at, accounts, notes, counts, volume, wanted, longest):  # type: ignore[no-untyped-def]
    """Let in volume near the surface by valve or bypass, whichever is quicker there.

    volume: as it was measured [m3]; wanted: of `control.surfacing` [m3]; longest [s].
    """
    by_valve, by_bypass = (
        value(table, p[STEP], RATE_IN, 0.0)[0],
        value(table, p[STEP], BYPASS, 0.0)[0],
    )
    if max(by_valve, by_bypass) <= 0.0:  # no head at depth 0: there is some where it floats
        by_valve = value(table, p[STEP], RATE_IN, max(x[Z], 0.0))[0]
        by_bypass = value(table, p[STEP], BYPASS, max(x[Z], 0.0))[0]
    doing, flow = (BYPASSING, by_bypass) if by_bypass > by_valve else (LETTING_IN, by_valve)
    if p[BY_VOLUME] > 0.0:
        if wanted < volume:
            _run_to(p, table, x, at, accounts, notes, counts, doing, volume, wanted, longest)
        return
    if wanted == 0.0:
        return
    if flow > 0.0:
        longest = max(_in_steps(p, min(longest, -wanted / flow)), p[QUANTUM])
    start_run(p, table, x, at, accounts, notes, counts, doing, wanted, -math.inf, longest)


@part
def press_out(p, table, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
    """Pump out all volume, in runs as long as the pump stands, one after the other."""
    wanted = p[V_MAX] - x[V]
    start_run(p, table, x, at, accounts, notes, counts, PUMPING, wanted, p[V_MAX], p[LONGEST])


@part
def _happen(p, table, x, at, accounts, notes, counts, event):  # type: ignore[no-untyped-def]
    """Let happen what a step ended with."""
    if event == SURFACE:
        at[PLACE] = 1 - at[PLACE]
        note(notes, counts, x, NOTE_EMERGED if at[PLACE] == 1 else NOTE_SUBMERGED, x[W])
    elif event == BOTTOM:
        note(notes, counts, x, NOTE_BOTTOM, x[W])
        accounts[BLOWS] += 0.5 * p[MASS] * x[W] * x[W]
        x[Z], x[W] = p[Z_BOTTOM], 0.0
        at[PLACE] = 2
    elif event == AIR:
        at[STOP] = LEFT_WATER
    elif event == VOLUME:
        _at_volume(p, x, at, notes, counts)
    elif event == LOST:
        at[STOP] = STOP_LOST
    elif event == VALVE:
        turn_valve(p, table, x, at)


@part
def _at_volume(p, x, at, notes, counts):  # type: ignore[no-untyped-def]
    """End a run at its volume or at an end stop; put rounding right.

    A pump that a valve beats runs on where nothing more can come in.
    """
    beaten = at[DOING] == PUMPING and x[V] - p[V_MIN] < min(p[V_MAX], x[V_MOVE]) - x[V]
    if at[DOING] == PRIMING or beaten:
        x[V] = p[V_MIN]
        note(notes, counts, x, NOTE_LOWER, 0.0)
        return
    if at[DOING] == PUMPING:
        x[V] = min(p[V_MAX], x[V_MOVE])
    elif at[DOING] != NOTHING:
        x[V] = max(p[V_MIN], x[V_MOVE])
    else:
        x[V] = p[V_MIN]
    if x[V] == p[V_MAX]:
        note(notes, counts, x, NOTE_UPPER, 0.0)
    elif x[V] == p[V_MIN]:
        note(notes, counts, x, NOTE_LOWER, 0.0)
    if at[DOING] != NOTHING:
        end_run(x, at, notes, counts)


@inlined
def next_turn(p, table, x, at, until):  # type: ignore[no-untyped-def]
    """Return `until` [s], or when the drive ends or changes what it does, if that is earlier."""
    if at[DOING] != NOTHING:
        until = min(until, x[T_MOVE])
        if at[DOING] == PRIMING and at[SHUT] == 0:
            until = min(until, x[T_PRIMED])
        elif at[DOING] == PRIMING and at[PLACE] == 2:
            until = min(until, x[T] + fill_lacks(p, table, x) / p[DELIVERY])
    return until


@inlined
def move(p, table, waves, x, at, accounts, notes, counts, loads, level, until, work):  # type: ignore[no-untyped-def]
    """Move the vehicle by a step, `until` [s] at most, with what happens in it.

    loads [W]; level: depth of arrival [m], negative from below, 0 none; work: [6, 8] to write in.
    Return the guard of `leap` that ended it, -1 where none did, `STAYED` where it rests or lies on
    the bottom.
    """
    if at[RESTS] == 1 or at[PLACE] == 2:
        ended = stay(p, table, x, at, accounts, loads, until)
        if ended == 1:
            _at_volume(p, x, at, notes, counts)
        elif ended == 2:
            at[PLACE] = 0
            note(notes, counts, x, NOTE_LEFT, 0.0)
        elif ended == 3:
            at[RESTS] = 0
        lift = lift_volume(p, table, x[Z], x[HULL])
        if at[PLACE] == 2 and at[DOING] == NOTHING and x[V] >= lift:
            at[PLACE] = 0
            note(notes, counts, x, NOTE_LEFT, 0.0)
        return STAYED
    event = leap(p, table, waves, x, at, accounts, loads, level, until, work)
    if event >= 0:
        _happen(p, table, x, at, accounts, notes, counts, event)
    else:
        settle(p, table, waves, x, at, accounts)
    return event


@inlined
def end_turn(x, at, notes, counts):  # type: ignore[no-untyped-def]
    """Let a primed pump deliver, and end a run whose time is over."""
    if at[DOING] == PRIMING and at[SHUT] == 0 and x[T] >= x[T_PRIMED]:
        at[DOING] = PUMPING
    if at[DOING] != NOTHING and x[T] >= x[T_MOVE]:
        end_run(x, at, notes, counts)


@inlined
def turn_line(p, table, waves, x, at):  # type: ignore[no-untyped-def]
    """Open or shut the check valve of an oil line where its pressure is that of the sea."""
    if p[LINE] > 0.0 and at[STOP] == 0:
        early = _FULL_LINE if at[DOING] == PRIMING and at[PLACE] == 2 else 0.0
        if valve_turns(p, table, waves, x, at, 0.0, x[Z], x[W]) > -early:
            turn_valve(p, table, x, at)
