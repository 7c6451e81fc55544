"""Phases and cycles: how they begin, arrive, hold their depth and end."""

from __future__ import annotations

import math

from swimbladder.control.rate import RateParameters
from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.rodas.drive import FULL, note
from swimbladder.sim.engine.rodas.motion import rate_of
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Note, Now, Stop
from swimbladder.sim.mission.core.names import Cycle, Holding, Kind, Stage

T, Z, V, T_PHASE, T_END = int(Now.T), int(Now.Z), int(Now.V), int(Now.T_PHASE), int(Now.T_END)
T_LOOK, T_MOVE, CHARGE = int(Now.T_LOOK), int(Now.T_MOVE), int(Now.CHARGE)
T_ARRIVAL, Z_MOST, V_LEAST = int(Now.T_ARRIVAL), int(Now.Z_MOST), int(Now.V_LEAST)
V_MOST, T_CYCLE, T_AFLOAT = int(Now.V_MOST), int(Now.T_CYCLE), int(Now.T_AFLOAT)
Z_LOOK, PHASE, CYCLE, DOING = int(Now.Z_LOOK), int(At.PHASE), int(At.CYCLE), int(At.DOING)
PLACE, ARRIVED, NEW_LAW, ALARM = int(At.PLACE), int(At.ARRIVED), int(At.NEW_LAW), int(At.ALARM)
CAPTURED, STOP, MISSED = int(At.CAPTURED), int(At.STOP), int(At.MISSED)
NEW_PHASE, V_MAX, V_MIN = int(At.NEW_PHASE), int(Given.V_MAX), int(Given.V_MIN)
RESERVE, LAST_TIME, LAST_CYCLE = int(Given.RESERVE), int(Given.LAST_TIME), int(Given.LAST_CYCLE)
SURFACING, KIND, DEPTH = int(Given.SURFACING), int(Stage.KIND), int(Stage.DEPTH)
TOLERANCE, DURATION, TIMEOUT = int(Stage.TOLERANCE), int(Stage.DURATION), int(Stage.TIMEOUT)
DEAD, TO_SURFACE = int(Stage.LAW) + RateParameters._fields.index("dead"), int(Kind.SURFACE)
PARK, HOLD, NOTHING = int(Kind.PARK), int(Kind.HOLD), int(Doing.NOTHING)
SURFACING_ENERGY, ACCOUNTS = int(Account.SURFACING_ENERGY), int(Account.COUNT)
C_BEGIN, C_END, C_DEEPEST = int(Cycle.T_BEGIN), int(Cycle.T_END), int(Cycle.DEEPEST)
C_MISSED, C_LEAST, C_MOST = int(Cycle.MISSED), int(Cycle.V_LEAST), int(Cycle.V_MOST)
C_ARRIVAL, C_SURFACED, C_ACCOUNTS = int(Cycle.ARRIVAL), int(Cycle.SURFACED), int(Cycle.ACCOUNTS)
C_NOT_HELD, NOT_HELD, HELD = int(Cycle.NOT_HELD), int(At.NOT_HELD), int(Given.HELD)
T_INSIDE, T_ARRIVED, HOLDINGS = int(Now.T_INSIDE), int(Now.T_ARRIVED), int(Holding.COUNT)
HELD_TIME, HELD_INSIDE, HELD_SQUARES = int(Holding.TIME), int(Holding.INSIDE), int(Holding.SQUARES)
HELD_MOST, NOTE_PHASE, NOTE_ARRIVED = int(Holding.MOST), int(Note.PHASE), int(Note.ARRIVED)
NOTE_TIME, NOTE_CYCLE, NOTE_AFLOAT = int(Note.OUT_OF_TIME), int(Note.CYCLE), int(Note.AFLOAT)
FINISHED, STOP_RESERVE = int(Stop.FINISHED), int(Stop.RESERVE)
NO_SURFACE, PASSED = int(Stop.DID_NOT_SURFACE), int(Stop.PASSED_DEPTH)


@part
def begin_phase(stages, x, at, notes, counts):  # type: ignore[no-untyped-def]
    """Begin the phase that At.PHASE names, with its law anew."""
    stage = stages[at[PHASE]]
    at[NEW_PHASE] = 0
    at[NEW_LAW] = 1
    at[ARRIVED] = 0
    at[CAPTURED] = 0
    x[T_PHASE] = x[T]
    x[T_LOOK] = x[T] if at[DOING] == NOTHING else max(x[T], x[T_MOVE])
    x[Z_LOOK] = x[Z]
    if stage[KIND] == PARK:
        x[T_END] = x[T] + stage[DURATION]
    else:
        x[T_END] = x[T] + stage[TIMEOUT]
    note(notes, counts, x, NOTE_PHASE, float(at[PHASE]))


@part
def awaited_level(stages, x, at):  # type: ignore[no-untyped-def]
    """Return the depth at which the phase arrives [m], negative from below, 0: not awaited."""
    stage = stages[at[PHASE]]
    if at[ARRIVED] == 1 or at[ALARM] == 1 or stage[KIND] == TO_SURFACE:
        return 0.0
    if x[Z] < stage[DEPTH]:
        return stage[DEPTH] - stage[TOLERANCE]
    return -(stage[DEPTH] + stage[TOLERANCE])


@part
def enter_hold(stages, x, at, accounts, z, h):  # type: ignore[no-untyped-def]
    """Enter h [s] that led from depth z [m] to here in what tells how the phase holds its depth.

    Between the two the depth counts as straight: exact at rest, and steps are short off it.
    """
    stage = stages[at[PHASE]]
    a, b = z - stage[DEPTH], x[Z] - stage[DEPTH]
    low, high, tolerance = min(a, b), max(a, b), stage[TOLERANCE]
    if high - low > 0.0:
        share = max(min(high, tolerance) - max(low, -tolerance), 0.0) / (high - low)
    else:
        share = 1.0 if abs(a) <= tolerance else 0.0
    x[T_INSIDE] += share * h
    n = ACCOUNTS + HOLDINGS * at[PHASE]
    accounts[n + HELD_TIME] += h
    accounts[n + HELD_INSIDE] += share * h
    accounts[n + HELD_SQUARES] += h * (a * a + a * b + b * b) / 3.0
    accounts[n + HELD_MOST] = max(accounts[n + HELD_MOST], high, -low)


@part
def arrive(stages, x, at, notes, counts):  # type: ignore[no-untyped-def]
    """Say that the phase has come to its depth, and when it is over."""
    stage = stages[at[PHASE]]
    at[ARRIVED] = 1
    x[T_ARRIVED], x[T_INSIDE] = x[T], 0.0
    first = stage[KIND] != TO_SURFACE
    for n in range(at[PHASE]):
        first = first and stages[n, KIND] == TO_SURFACE
    if first:
        x[T_ARRIVAL] = x[T] - x[T_CYCLE]
    note(notes, counts, x, NOTE_ARRIVED, float(at[PHASE]))
    if stage[KIND] == HOLD or stage[KIND] == TO_SURFACE:
        x[T_END] = x[T] + stage[DURATION]
    elif stage[KIND] != PARK:
        x[T_END] = x[T]


@part
def afloat(p, table, stages, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
    """Say so where the vehicle floats with all its volume out, and what that means."""
    if at[PLACE] != 1 or x[V] < p[V_MAX] - FULL * (p[V_MAX] - p[V_MIN]):
        return
    if at[ALARM] == 1:
        at[STOP] = PASSED
    elif at[ARRIVED] == 0 and stages[at[PHASE], KIND] == TO_SURFACE:
        note(notes, counts, x, NOTE_AFLOAT, 0.0)
        x[T_AFLOAT] = x[T] - x[T_CYCLE]
        accounts[SURFACING_ENERGY] += p[SURFACING]
        x[CHARGE] -= p[SURFACING]
        arrive(stages, x, at, notes, counts)
        x[T_LOOK] = math.inf
        if rate_of(p, table, NOTHING, True, x[Z], x[V], 0.0)[0] != 0.0:
            x[T_LOOK] = x[T] + stages[at[PHASE], DEAD]


@part
def next_phase(p, stages, x, at, accounts, cycles, notes, counts):  # type: ignore[no-untyped-def]
    """End the phase; return whether a cycle is over with it."""
    stage = stages[at[PHASE]]
    if at[ARRIVED] == 0:
        note(notes, counts, x, NOTE_TIME, float(at[PHASE]))
        at[MISSED] |= 1 << at[PHASE]
        if stage[KIND] == TO_SURFACE:
            at[STOP] = NO_SURFACE
    elif (stage[KIND] == PARK or stage[KIND] == HOLD) and x[T_INSIDE] < p[HELD] * (
        x[T] - x[T_ARRIVED]
    ):
        at[NOT_HELD] |= 1 << at[PHASE]
    at[NEW_PHASE] = 1
    at[PHASE] += 1
    if at[PHASE] < stages.shape[0] and at[STOP] == 0:
        return False
    note(notes, counts, x, NOTE_CYCLE, float(at[CYCLE]))
    close_cycle(x, at, accounts, cycles, counts)
    at[CYCLE] += 1
    at[PHASE] = 0
    if at[STOP] == 0:
        if at[CYCLE] >= p[LAST_CYCLE] or x[T] >= p[LAST_TIME]:
            at[STOP] = FINISHED
        elif x[CHARGE] <= p[RESERVE]:
            at[STOP] = STOP_RESERVE
    return True


@part
def close_cycle(x, at, accounts, cycles, counts):  # type: ignore[no-untyped-def]
    """Enter the cycle in the table, and begin what is counted for the next."""
    n = counts[2]
    if n < cycles.shape[0]:
        c = cycles[n]
        c[C_BEGIN], c[C_END], c[C_DEEPEST] = x[T_CYCLE], x[T], x[Z_MOST]
        c[C_MISSED], c[C_LEAST], c[C_MOST] = at[MISSED], x[V_LEAST], x[V_MOST]
        c[C_ARRIVAL], c[C_SURFACED] = x[T_ARRIVAL], x[T_AFLOAT]
        c[C_NOT_HELD] = at[NOT_HELD]
        for k in range(ACCOUNTS):  # no slice: Numba would compile what it says of shapes
            c[C_ACCOUNTS + k] = accounts[k]
        counts[2] = n + 1
    x[T_CYCLE], x[Z_MOST], at[MISSED], at[NOT_HELD] = x[T], x[Z], 0, 0
    x[V_LEAST], x[V_MOST] = x[V], -math.inf
    x[T_ARRIVAL], x[T_AFLOAT] = math.nan, math.nan
