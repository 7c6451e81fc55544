"""The kernel: from phase to phase, until the mission is over or a buffer is full."""

from __future__ import annotations

import math

from swimbladder.control.rate import RateParameters
from swimbladder.engine.cache import part
from swimbladder.mission.core.leap import (
    AIR,
    BOTTOM,
    LEVEL,
    LOST,
    SURFACE,
    TOO_DEEP,
    VOLUME,
    leap,
    lift_volume,
    settle,
    stay,
)
from swimbladder.mission.core.motion import rate_of
from swimbladder.mission.core.moves import FULL, end_run, look, note, start_run
from swimbladder.mission.core.names import (
    Account,
    At,
    Cycle,
    Doing,
    Given,
    Holding,
    Kind,
    Note,
    Now,
    Row,
    Stage,
    Stop,
)

__all__ = ["fly"]

T, Z, W, V, H = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.H)
T_PHASE, T_END, T_LOOK, T_MOVE = int(Now.T_PHASE), int(Now.T_END), int(Now.T_LOOK), int(Now.T_MOVE)
V_MOVE, CHARGE, T_ARRIVAL = int(Now.V_MOVE), int(Now.CHARGE), int(Now.T_ARRIVAL)
Z_MOST, V_LEAST, V_MOST = int(Now.Z_MOST), int(Now.V_LEAST), int(Now.V_MOST)
T_CYCLE, T_AFLOAT, Z_LOOK = int(Now.T_CYCLE), int(Now.T_AFLOAT), int(Now.Z_LOOK)
PHASE, CYCLE, DOING, PLACE = int(At.PHASE), int(At.CYCLE), int(At.DOING), int(At.PLACE)
RESTS, ARRIVED, NEW_LAW, ALARM = int(At.RESTS), int(At.ARRIVED), int(At.NEW_LAW), int(At.ALARM)
CAPTURED = int(At.CAPTURED)
STOP, MISSED, NEW_PHASE = int(At.STOP), int(At.MISSED), int(At.NEW_PHASE)
MASS, V_MAX, V_MIN, EMPTY = int(Given.MASS), int(Given.V_MAX), int(Given.V_MIN), int(Given.EMPTY)
RESERVE, LAST_TIME, LAST_CYCLE = int(Given.RESERVE), int(Given.LAST_TIME), int(Given.LAST_CYCLE)
SURFACING, Z_BOTTOM = int(Given.SURFACING), int(Given.Z_BOTTOM)
LONGEST = int(Given.LONGEST)
KIND, DEPTH, TOLERANCE = int(Stage.KIND), int(Stage.DEPTH), int(Stage.TOLERANCE)
DURATION, TIMEOUT, LOADS = int(Stage.DURATION), int(Stage.TIMEOUT), int(Stage.LOADS)
DEAD = int(Stage.LAW) + RateParameters._fields.index("dead")
TO_SURFACE, PARK, HOLD = int(Kind.SURFACE), int(Kind.PARK), int(Kind.HOLD)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
T_PRIMED = int(Now.T_PRIMED)
BLOWS, SURFACING_ENERGY = int(Account.BLOWS), int(Account.SURFACING_ENERGY)
PUMP_ENERGY, VALVE_ENERGY = int(Account.PUMP_ENERGY), int(Account.VALVE_ENERGY)
HOLDING_ENERGY, LOAD_ENERGY = int(Account.HOLDING_ENERGY), int(Account.LOAD_ENERGY)
SELF_DISCHARGED, T_KIND = int(Account.SELF_DISCHARGED), int(Account.T_KIND)
ACCOUNTS = int(Account.COUNT)
C_BEGIN, C_END, C_DEEPEST = int(Cycle.T_BEGIN), int(Cycle.T_END), int(Cycle.DEEPEST)
C_MISSED, C_LEAST, C_MOST = int(Cycle.MISSED), int(Cycle.V_LEAST), int(Cycle.V_MOST)
C_ARRIVAL, C_SURFACED = int(Cycle.ARRIVAL), int(Cycle.SURFACED)
C_ACCOUNTS, C_NOT_HELD = int(Cycle.ACCOUNTS), int(Cycle.NOT_HELD)
NOT_HELD, HELD = int(At.NOT_HELD), int(Given.HELD)
T_INSIDE, T_ARRIVED = int(Now.T_INSIDE), int(Now.T_ARRIVED)
HOLDINGS, HELD_TIME = int(Holding.COUNT), int(Holding.TIME)
HELD_INSIDE, HELD_SQUARES = int(Holding.INSIDE), int(Holding.SQUARES)
HELD_MOST = int(Holding.MOST)
R_T, R_Z, R_W, R_V = int(Row.T), int(Row.Z), int(Row.W), int(Row.V)
R_PHASE, R_DOING, R_CYCLE = int(Row.PHASE), int(Row.DOING), int(Row.CYCLE)
R_DRIVE, R_TOTAL = int(Row.DRIVE_ENERGY), int(Row.TOTAL_ENERGY)
NOTE_PHASE, NOTE_ARRIVED = int(Note.PHASE), int(Note.ARRIVED)
NOTE_TIME, NOTE_EMERGED = int(Note.OUT_OF_TIME), int(Note.EMERGED)
NOTE_SUBMERGED, NOTE_BOTTOM = int(Note.SUBMERGED), int(Note.BOTTOM)
NOTE_LEFT, NOTE_UPPER = int(Note.LEFT_BOTTOM), int(Note.UPPER_STOP)
NOTE_LOWER, NOTE_DEEP = int(Note.LOWER_STOP), int(Note.TOO_DEEP)
NOTE_CYCLE, NOTE_AFLOAT = int(Note.CYCLE), int(Note.AFLOAT)
FINISHED, STOP_RESERVE = int(Stop.FINISHED), int(Stop.RESERVE)
NO_SURFACE, PASSED = int(Stop.DID_NOT_SURFACE), int(Stop.PASSED_DEPTH)
STOP_LOST, STOP_EMPTY = int(Stop.LOST), int(Stop.BATTERY_EMPTY)
LEFT_WATER, STUCK = int(Stop.LEFT_WATER), int(Stop.STUCK)

_ROOM = 8  # rows or notes that one pass of the loop may add
_RESCUE = 30.0 * 86400.0  # s to come up in after the alarm; a vehicle that floats deeper is lost
_PASSES = 200  # without time passing: a fault of the model


@part
def _row(rows, counts, x, at, accounts):  # type: ignore[no-untyped-def]
    n = counts[0]
    if n < rows.shape[0]:
        rows[n, R_T], rows[n, R_Z], rows[n, R_W], rows[n, R_V] = x[T], x[Z], x[W], x[V]
        rows[n, R_PHASE], rows[n, R_DOING], rows[n, R_CYCLE] = at[PHASE], at[DOING], at[CYCLE]
        drive = accounts[PUMP_ENERGY] + accounts[VALVE_ENERGY] + accounts[HOLDING_ENERGY]
        rows[n, R_DRIVE] = drive
        rows[n, R_TOTAL] = (
            drive + accounts[LOAD_ENERGY] + accounts[SURFACING_ENERGY] + accounts[SELF_DISCHARGED]
        )
        counts[0] = n + 1


@part
def _begin_phase(stages, x, at, notes, counts):  # type: ignore[no-untyped-def]
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
def _level(stages, x, at):  # type: ignore[no-untyped-def]
    """Return the depth at which the phase arrives [m], negative from below, 0: not awaited."""
    stage = stages[at[PHASE]]
    if at[ARRIVED] == 1 or at[ALARM] == 1 or stage[KIND] == TO_SURFACE:
        return 0.0
    if x[Z] < stage[DEPTH]:
        return stage[DEPTH] - stage[TOLERANCE]
    return -(stage[DEPTH] + stage[TOLERANCE])


@part
def _hold(stages, x, at, accounts, z, h):  # type: ignore[no-untyped-def]
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
def _arrive(stages, x, at, notes, counts):  # type: ignore[no-untyped-def]
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
def _afloat(p, table, stages, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
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
        _arrive(stages, x, at, notes, counts)
        x[T_LOOK] = math.inf
        if rate_of(p, table, NOTHING, x[Z], x[V])[0] != 0.0:
            x[T_LOOK] = x[T] + stages[at[PHASE], DEAD]


@part
def _next_phase(p, stages, x, at, accounts, cycles, notes, counts):  # type: ignore[no-untyped-def]
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
    _close_cycle(x, at, accounts, cycles, counts)
    at[CYCLE] += 1
    at[PHASE] = 0
    if at[STOP] == 0:
        if at[CYCLE] >= p[LAST_CYCLE] or x[T] >= p[LAST_TIME]:
            at[STOP] = FINISHED
        elif x[CHARGE] <= p[RESERVE]:
            at[STOP] = STOP_RESERVE
    return True


@part
def _close_cycle(x, at, accounts, cycles, counts):  # type: ignore[no-untyped-def]
    n = counts[2]
    if n < cycles.shape[0]:
        c = cycles[n]
        c[C_BEGIN], c[C_END], c[C_DEEPEST] = x[T_CYCLE], x[T], x[Z_MOST]
        c[C_MISSED], c[C_LEAST], c[C_MOST] = at[MISSED], x[V_LEAST], x[V_MOST]
        c[C_ARRIVAL], c[C_SURFACED] = x[T_ARRIVAL], x[T_AFLOAT]
        c[C_NOT_HELD] = at[NOT_HELD]
        c[C_ACCOUNTS : C_ACCOUNTS + ACCOUNTS] = accounts[:ACCOUNTS]
        counts[2] = n + 1
    x[T_CYCLE], x[Z_MOST], at[MISSED], at[NOT_HELD] = x[T], x[Z], 0, 0
    x[V_LEAST], x[V_MOST] = x[V], -math.inf
    x[T_ARRIVAL], x[T_AFLOAT] = math.nan, math.nan


@part
def _happen(p, table, stages, x, at, accounts, notes, counts, event):  # type: ignore[no-untyped-def]
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
    elif event == LEVEL:
        _arrive(stages, x, at, notes, counts)
    elif event == TOO_DEEP:
        note(notes, counts, x, NOTE_DEEP, x[W])
        at[ALARM] = 1
        if at[DOING] != NOTHING:
            end_run(x, at, notes, counts)
        _press_out(p, table, x, at, accounts, notes, counts)
        x[T_END] = x[T] + _RESCUE
    elif event == VOLUME:
        _at_volume(p, x, at, notes, counts)
    elif event == LOST:
        at[STOP] = STOP_LOST


@part
def _press_out(p, table, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
    """Pump out all volume, in runs as long as the pump stands, one after the other."""
    wanted = p[V_MAX] - x[V]
    start_run(p, table, x, at, accounts, notes, counts, PUMPING, wanted, p[V_MAX], p[LONGEST])
    x[T_LOOK] = x[T_MOVE]


@part
def _at_volume(p, x, at, notes, counts):  # type: ignore[no-untyped-def]
    """End a run at its volume or at an end stop; put rounding right."""
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


def fly(p, table, waves, stages, x, at, accounts, rows, notes, cycles, counts, work):  # type: ignore[no-untyped-def]
    """Fly until a cycle is over, a buffer is full, or the mission ends: see `Stop`.

    p: of `Given`; table [n, Table.WIDTH]; waves [m, 6] of `motion_table`; stages [k, Stage.COUNT];
    x: of `Now`, at: of `At`, accounts: of `Account` and k times `Holding`, all three changed.
    rows, notes, cycles: buffers, an empty one keeps nothing; counts [3]: how much is in them.
    work: [6, 8].
    """
    passes = 0
    while True:
        full = 0 < rows.shape[0] < counts[0] + _ROOM or 0 < notes.shape[0] < counts[1] + _ROOM
        if full or 0 < cycles.shape[0] <= counts[2]:
            return 0
        if at[NEW_PHASE] == 1:
            _begin_phase(stages, x, at, notes, counts)
            _row(rows, counts, x, at, accounts)
        loads = stages[at[PHASE], LOADS]
        before = x[T]
        until = min(x[T_LOOK], x[T_END])
        if at[DOING] != NOTHING:
            until = min(until, x[T_MOVE])
            if at[DOING] == PRIMING:
                until = min(until, x[T_PRIMED])
        if until > x[T]:
            kind = int(stages[at[PHASE], KIND])
            arrived, depth = at[ARRIVED] == 1, x[Z]
            if at[RESTS] == 1 or at[PLACE] == 2:
                ended = stay(p, table, x, at, accounts, loads, until)
                if ended == 1:
                    _at_volume(p, x, at, notes, counts)
                elif ended == 2:
                    at[PLACE] = 0
                    note(notes, counts, x, NOTE_LEFT, 0.0)
                elif ended == 3:
                    at[RESTS] = 0
                if at[PLACE] == 2 and at[DOING] == NOTHING and x[V] >= lift_volume(p, table, x[Z]):
                    at[PLACE] = 0
                if at[PLACE] == 2 or at[DOING] != NOTHING:
                    _row(rows, counts, x, at, accounts)
            else:
                level = _level(stages, x, at)
                event = leap(p, table, waves, x, at, accounts, loads, level, until, work)
                if event >= 0:
                    _happen(p, table, stages, x, at, accounts, notes, counts, event)
                else:
                    settle(p, table, waves, x, at, accounts)
                _row(rows, counts, x, at, accounts)
            accounts[T_KIND + kind] += x[T] - before
            if arrived and at[ALARM] == 0:
                _hold(stages, x, at, accounts, depth, x[T] - before)
        if at[STOP] == 0:
            _decide(p, table, waves, stages, x, at, accounts, notes, counts)
        over = False
        if at[STOP] == 0 and x[T] >= x[T_END]:
            if at[ALARM] == 1:
                at[STOP] = STOP_LOST
            else:
                over = _next_phase(p, stages, x, at, accounts, cycles, notes, counts)
        if at[STOP] == 0 and x[CHARGE] <= p[EMPTY]:
            at[STOP] = STOP_EMPTY
        passes = 0 if x[T] > before else passes + 1
        if passes > _PASSES:
            at[STOP] = STUCK
        if at[STOP] != 0:
            _row(rows, counts, x, at, accounts)
            if not over:
                _close_cycle(x, at, accounts, cycles, counts)
            return at[STOP]
        if over:
            return 0


@part
def _decide(p, table, waves, stages, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
    """End a run whose time is over, look where it is time, and see whether it floats."""
    if at[DOING] == PRIMING and x[T] >= x[T_PRIMED]:
        at[DOING] = PUMPING
    if at[DOING] != NOTHING and x[T] >= x[T_MOVE]:
        end_run(x, at, notes, counts)
    _afloat(p, table, stages, x, at, accounts, notes, counts)
    if at[STOP] == 0 and at[ARRIVED] == 0 and at[ALARM] == 0:
        stage = stages[at[PHASE]]
        if stage[KIND] != TO_SURFACE and abs(x[Z] - stage[DEPTH]) <= stage[TOLERANCE]:
            _arrive(stages, x, at, notes, counts)
    if at[STOP] == 0 and x[T] >= x[T_LOOK] and x[T] < x[T_END]:
        if at[DOING] != NOTHING and x[T_MOVE] < math.inf:
            x[T_LOOK] = x[T_MOVE]
        elif at[DOING] != NOTHING:
            x[T_LOOK] = x[T] + stages[at[PHASE], DEAD]
        elif at[ALARM] == 1:
            _press_out(p, table, x, at, accounts, notes, counts)
        else:
            look(p, table, waves, stages[at[PHASE]], x, at, accounts, notes, counts)
