"""Phases and cycles: how they begin, arrive, hold their depth and end."""

from __future__ import annotations

import math

from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.drive import FULL, note
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Note, Now, Stop
from swimbladder.sim.mission.core.names import Cycle, Holding, Kind, Phases, Row, Stage

T, Z, W, V = int(Now.T), int(Now.Z), int(Now.W), int(Now.V)
T_PHASE, T_END = int(Now.T_PHASE), int(Now.T_END)
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
TO_SURFACE = int(Kind.SURFACE)
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
PUMP_ENERGY, R_PUMP, R_COUNT = int(Account.PUMP_ENERGY), int(Row.PUMP_ENERGY), int(Row.COUNT)
R_T, R_Z, R_W, R_V = int(Row.T), int(Row.Z), int(Row.W), int(Row.V)
R_PHASE, R_DOING, R_CYCLE = int(Row.PHASE), int(Row.DOING), int(Row.CYCLE)


@inlined
def row(f: Phases) -> None:
    """Add a row to the trajectory; without room nothing is kept."""
    x, at = f.x, f.at
    n = f.counts[0]
    if n < f.rows.shape[0]:
        f.rows[n, R_T], f.rows[n, R_Z], f.rows[n, R_W], f.rows[n, R_V] = x[T], x[Z], x[W], x[V]
        f.rows[n, R_PHASE], f.rows[n, R_DOING], f.rows[n, R_CYCLE] = at[PHASE], at[DOING], at[CYCLE]
        for k in range(R_COUNT - R_PUMP):  # both in one order
            f.rows[n, R_PUMP + k] = f.accounts[PUMP_ENERGY + k]
        f.counts[0] = n + 1


@inlined
def begin_row(f: Phases) -> None:
    """Let the last row say what is done from here on; a new one where it is of an earlier time."""
    x, at = f.x, f.at
    if f.rows.shape[0] > 0:
        last = f.counts[0] - 1
        if last < 0 or (f.rows[last, R_DOING] != at[DOING] and f.rows[last, R_T] < x[T]):
            row(f)
        else:
            f.rows[last, R_DOING] = at[DOING]


@part
def begin_phase(f: Phases) -> None:
    """Begin the phase that At.PHASE names, with its law anew."""
    x, at = f.x, f.at
    stage = f.stages[at[PHASE]]
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
    note(f.notes, f.counts, x, NOTE_PHASE, float(at[PHASE]))


@inlined
def awaited_level(f: Phases) -> float:
    """Return the depth at which the phase arrives [m], negative from below, 0: not awaited."""
    x, at = f.x, f.at
    stage = f.stages[at[PHASE]]
    if at[ARRIVED] == 1 or at[ALARM] == 1 or stage[KIND] == TO_SURFACE:
        return 0.0
    if x[Z] < stage[DEPTH]:
        return float(stage[DEPTH] - stage[TOLERANCE])
    return -float(stage[DEPTH] + stage[TOLERANCE])


@inlined
def enter_hold(f: Phases, z: float, h: float) -> None:
    """Enter h [s] that led from depth z [m] to here in what tells how the phase holds its depth.

    Between the two the depth counts as straight: exact at rest, and steps are short off it.
    """
    x, at = f.x, f.at
    stage = f.stages[at[PHASE]]
    a, b = z - stage[DEPTH], x[Z] - stage[DEPTH]
    low, high, tolerance = min(a, b), max(a, b), stage[TOLERANCE]
    if high - low > 0.0:
        share = max(min(high, tolerance) - max(low, -tolerance), 0.0) / (high - low)
    else:
        share = 1.0 if abs(a) <= tolerance else 0.0
    x[T_INSIDE] += share * h
    n = ACCOUNTS + HOLDINGS * at[PHASE]
    f.accounts[n + HELD_TIME] += h
    f.accounts[n + HELD_INSIDE] += share * h
    f.accounts[n + HELD_SQUARES] += h * (a * a + a * b + b * b) / 3.0
    f.accounts[n + HELD_MOST] = max(f.accounts[n + HELD_MOST], high, -low)


@part
def arrive(f: Phases) -> None:
    """Say that the phase has come to its depth, and when it is over."""
    x, at = f.x, f.at
    stage = f.stages[at[PHASE]]
    at[ARRIVED] = 1
    x[T_ARRIVED], x[T_INSIDE] = x[T], 0.0
    first = stage[KIND] != TO_SURFACE
    for n in range(at[PHASE]):
        first = first and f.stages[n, KIND] == TO_SURFACE
    if first:
        x[T_ARRIVAL] = x[T] - x[T_CYCLE]
    note(f.notes, f.counts, x, NOTE_ARRIVED, float(at[PHASE]))
    if stage[KIND] == HOLD or stage[KIND] == TO_SURFACE:
        x[T_END] = x[T] + stage[DURATION]
    elif stage[KIND] != PARK:
        x[T_END] = x[T]


@part
def afloat(f: Phases) -> bool:
    """Say so where the vehicle floats with all its volume out; return whether it is afloat now."""
    x, at = f.x, f.at
    if at[PLACE] != 1 or x[V] < f.given[V_MAX] - FULL * (f.given[V_MAX] - f.given[V_MIN]):
        return False
    if at[ALARM] == 1:
        at[STOP] = PASSED
    elif at[ARRIVED] == 0 and f.stages[at[PHASE], KIND] == TO_SURFACE:
        note(f.notes, f.counts, x, NOTE_AFLOAT, 0.0)
        x[T_AFLOAT] = x[T] - x[T_CYCLE]
        f.accounts[SURFACING_ENERGY] += f.given[SURFACING]
        x[CHARGE] -= f.given[SURFACING]
        arrive(f)
        return True
    return False


@inlined
def settle(f: Phases) -> bool:
    """See whether it floats, which is returned, or has come to the depth of its phase."""
    x, at = f.x, f.at
    floats = bool(at[STOP] == 0 and at[PLACE] == 1 and afloat(f))
    if at[STOP] == 0 and at[ARRIVED] == 0 and at[ALARM] == 0:
        stage = f.stages[at[PHASE]]
        if stage[KIND] != TO_SURFACE and abs(x[Z] - stage[DEPTH]) <= stage[TOLERANCE]:
            arrive(f)
    return floats


@part
def next_phase(f: Phases) -> bool:
    """End the phase; return whether a cycle is over with it."""
    x, at = f.x, f.at
    stage = f.stages[at[PHASE]]
    if at[ARRIVED] == 0:
        note(f.notes, f.counts, x, NOTE_TIME, float(at[PHASE]))
        at[MISSED] |= 1 << at[PHASE]
        if stage[KIND] == TO_SURFACE:
            at[STOP] = NO_SURFACE
    elif (stage[KIND] == PARK or stage[KIND] == HOLD) and x[T_INSIDE] < f.given[HELD] * (
        x[T] - x[T_ARRIVED]
    ):
        at[NOT_HELD] |= 1 << at[PHASE]
    at[NEW_PHASE] = 1
    at[PHASE] += 1
    if at[PHASE] < f.stages.shape[0] and at[STOP] == 0:
        return False
    note(f.notes, f.counts, x, NOTE_CYCLE, float(at[CYCLE]))
    close_cycle(f)
    at[CYCLE] += 1
    at[PHASE] = 0
    if at[STOP] == 0:
        if at[CYCLE] >= f.given[LAST_CYCLE] or x[T] >= f.given[LAST_TIME]:
            at[STOP] = FINISHED
        elif x[CHARGE] <= f.given[RESERVE]:
            at[STOP] = STOP_RESERVE
    return True


@part
def close_cycle(f: Phases) -> None:
    """Enter the cycle in the table, and begin what is counted for the next."""
    x, at = f.x, f.at
    n = f.counts[2]
    if n < f.cycles.shape[0]:
        c = f.cycles[n]
        c[C_BEGIN], c[C_END], c[C_DEEPEST] = x[T_CYCLE], x[T], x[Z_MOST]
        c[C_MISSED], c[C_LEAST], c[C_MOST] = at[MISSED], x[V_LEAST], x[V_MOST]
        c[C_ARRIVAL], c[C_SURFACED] = x[T_ARRIVAL], x[T_AFLOAT]
        c[C_NOT_HELD] = at[NOT_HELD]
        for k in range(ACCOUNTS):  # no slice: Numba would compile what it says of shapes
            c[C_ACCOUNTS + k] = f.accounts[k]
        f.counts[2] = n + 1
    x[T_CYCLE], x[Z_MOST], at[MISSED], at[NOT_HELD] = x[T], x[Z], 0, 0
    x[V_LEAST], x[V_MOST] = x[V], -math.inf
    x[T_ARRIVAL], x[T_AFLOAT] = math.nan, math.nan
