"""The kernel: from phase to phase, until the mission is over or a buffer is full."""

from __future__ import annotations

import math

from swimbladder.control.rate import RateParameters
from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.rodas.leap import (
    AIR,
    BOTTOM,
    LEVEL,
    LOST,
    SURFACE,
    TOO_DEEP,
    VALVE,
    VOLUME,
    leap,
)
from swimbladder.sim.engine.rodas.line import empty_line, fill_lacks, turn_valve, valve_turns
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Note, Now, Stop
from swimbladder.sim.engine.rodas.rest import lift_volume, settle, stay
from swimbladder.sim.mission.core.moves import end_run, look, note, start_run
from swimbladder.sim.mission.core.names import Kind, Row, Stage
from swimbladder.sim.mission.core.phases import (
    afloat,
    arrive,
    awaited_level,
    begin_phase,
    close_cycle,
    enter_hold,
    next_phase,
)

__all__ = ["RESCUE", "fly", "row"]

T, Z, W, V, T_END = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.T_END)
T_LOOK, T_MOVE, V_MOVE, CHARGE = int(Now.T_LOOK), int(Now.T_MOVE), int(Now.V_MOVE), int(Now.CHARGE)
PHASE, CYCLE, DOING, PLACE = int(At.PHASE), int(At.CYCLE), int(At.DOING), int(At.PLACE)
RESTS, ARRIVED, ALARM, STOP = int(At.RESTS), int(At.ARRIVED), int(At.ALARM), int(At.STOP)
NEW_PHASE, MASS, V_MAX = int(At.NEW_PHASE), int(Given.MASS), int(Given.V_MAX)
HULL = int(Now.HULL)
V_MIN, EMPTY, Z_BOTTOM = int(Given.V_MIN), int(Given.EMPTY), int(Given.Z_BOTTOM)
LONGEST, KIND, DEPTH = int(Given.LONGEST), int(Stage.KIND), int(Stage.DEPTH)
TOLERANCE, LOADS = int(Stage.TOLERANCE), int(Stage.LOADS)
DEAD, TO_SURFACE = int(Stage.LAW) + RateParameters._fields.index("dead"), int(Kind.SURFACE)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
T_PRIMED, BLOWS = int(Now.T_PRIMED), int(Account.BLOWS)
LINE, DELIVERY, SHUT = int(Given.LINE), int(Given.DELIVERY), int(At.SHUT)
SURFACING_ENERGY, PUMP_ENERGY = int(Account.SURFACING_ENERGY), int(Account.PUMP_ENERGY)
VALVE_ENERGY, HOLDING_ENERGY = int(Account.VALVE_ENERGY), int(Account.HOLDING_ENERGY)
LOAD_ENERGY, SELF_DISCHARGED = int(Account.LOAD_ENERGY), int(Account.SELF_DISCHARGED)
T_KIND, R_T, R_Z, R_W, R_V = int(Account.T_KIND), int(Row.T), int(Row.Z), int(Row.W), int(Row.V)
R_PHASE, R_DOING, R_CYCLE = int(Row.PHASE), int(Row.DOING), int(Row.CYCLE)
R_PUMP, R_VALVE, R_HOLDING = int(Row.PUMP_ENERGY), int(Row.VALVE_ENERGY), int(Row.HOLDING_ENERGY)
R_LOAD, R_SURFACING = int(Row.LOAD_ENERGY), int(Row.SURFACING_ENERGY)
R_LOST, NOTE_EMERGED = int(Row.SELF_DISCHARGED), int(Note.EMERGED)
NOTE_SUBMERGED, NOTE_BOTTOM = int(Note.SUBMERGED), int(Note.BOTTOM)
NOTE_LEFT, NOTE_UPPER = int(Note.LEFT_BOTTOM), int(Note.UPPER_STOP)
NOTE_LOWER, NOTE_DEEP, STOP_LOST = int(Note.LOWER_STOP), int(Note.TOO_DEEP), int(Stop.LOST)
STOP_EMPTY, LEFT_WATER, STUCK = int(Stop.BATTERY_EMPTY), int(Stop.LEFT_WATER), int(Stop.STUCK)
_ROOM = 8  # rows or notes that one pass of the loop may add
RESCUE = 30.0 * 86400.0  # s to come up in after the alarm; a vehicle that floats deeper is lost
_PASSES = 200  # without time passing: a fault of the model
_FULL = 1e-9  # s; a line that lacks less is full


@part
def row(rows, counts, x, at, accounts):  # type: ignore[no-untyped-def]
    """Add a row to the trajectory; without room nothing is kept."""
    n = counts[0]
    if n < rows.shape[0]:
        rows[n, R_T], rows[n, R_Z], rows[n, R_W], rows[n, R_V] = x[T], x[Z], x[W], x[V]
        rows[n, R_PHASE], rows[n, R_DOING], rows[n, R_CYCLE] = at[PHASE], at[DOING], at[CYCLE]
        rows[n, R_PUMP], rows[n, R_VALVE] = accounts[PUMP_ENERGY], accounts[VALVE_ENERGY]
        rows[n, R_HOLDING], rows[n, R_LOAD] = accounts[HOLDING_ENERGY], accounts[LOAD_ENERGY]
        rows[n, R_SURFACING] = accounts[SURFACING_ENERGY]
        rows[n, R_LOST] = accounts[SELF_DISCHARGED]
        counts[0] = n + 1


@part
def _begin_row(rows, counts, x, at, accounts):  # type: ignore[no-untyped-def]
    """Let the last row say what is done from here on; a new one where it is of an earlier time."""
    if rows.shape[0] > 0:
        last = counts[0] - 1
        if last < 0 or (rows[last, R_DOING] != at[DOING] and rows[last, R_T] < x[T]):
            row(rows, counts, x, at, accounts)
        else:
            rows[last, R_DOING] = at[DOING]


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
        arrive(stages, x, at, notes, counts)
    elif event == TOO_DEEP:
        note(notes, counts, x, NOTE_DEEP, x[W])
        at[ALARM] = 1
        if at[DOING] != NOTHING:
            end_run(x, at, notes, counts)
        _press_out(p, table, x, at, accounts, notes, counts)
        x[T_END] = x[T] + RESCUE
    elif event == VOLUME:
        _at_volume(p, x, at, notes, counts)
    elif event == LOST:
        at[STOP] = STOP_LOST
    elif event == VALVE:
        turn_valve(p, table, x, at)


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
            begin_phase(stages, x, at, notes, counts)
            row(rows, counts, x, at, accounts)
        loads = stages[at[PHASE], LOADS]
        before = x[T]
        until = min(x[T_LOOK], x[T_END])
        if at[DOING] != NOTHING:
            until = min(until, x[T_MOVE])
            if at[DOING] == PRIMING and at[SHUT] == 0:
                until = min(until, x[T_PRIMED])
            elif at[DOING] == PRIMING and at[PLACE] == 2:
                until = min(until, x[T] + fill_lacks(p, table, x) / p[DELIVERY])
        if until > x[T]:
            _begin_row(rows, counts, x, at, accounts)
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
                lift = lift_volume(p, table, x[Z], x[HULL])
                if at[PLACE] == 2 and at[DOING] == NOTHING and x[V] >= lift:
                    at[PLACE] = 0
                    note(notes, counts, x, NOTE_LEFT, 0.0)
                if at[PLACE] == 2 or at[DOING] != NOTHING:
                    row(rows, counts, x, at, accounts)
            else:
                level = awaited_level(stages, x, at)
                event = leap(p, table, waves, x, at, accounts, loads, level, until, work)
                if event >= 0:
                    _happen(p, table, stages, x, at, accounts, notes, counts, event)
                else:
                    settle(p, table, waves, x, at, accounts)
                row(rows, counts, x, at, accounts)
            accounts[T_KIND + kind] += x[T] - before
            if arrived and at[ALARM] == 0:
                enter_hold(stages, x, at, accounts, depth, x[T] - before)
        if at[STOP] == 0:
            _decide(p, table, waves, stages, x, at, accounts, notes, counts)
        over = False
        if at[STOP] == 0 and x[T] >= x[T_END]:
            if at[ALARM] == 1:
                at[STOP] = STOP_LOST
            else:
                over = next_phase(p, stages, x, at, accounts, cycles, notes, counts)
        if at[STOP] == 0 and x[CHARGE] <= p[EMPTY]:
            at[STOP] = STOP_EMPTY
        passes = 0 if x[T] > before else passes + 1
        if passes > _PASSES:
            at[STOP] = STUCK
        if at[STOP] != 0:
            if p[LINE] > 0.0 and at[DOING] != PUMPING and at[DOING] != PRIMING:
                empty_line(p, table, x)
            row(rows, counts, x, at, accounts)
            if not over:
                close_cycle(x, at, accounts, cycles, counts)
            return at[STOP]
        if over:
            return 0


@part
def _decide(p, table, waves, stages, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
    """End a run whose time is over, look where it is time, and see whether it floats."""
    if at[DOING] == PRIMING and at[SHUT] == 0 and x[T] >= x[T_PRIMED]:
        at[DOING] = PUMPING
    if at[DOING] != NOTHING and x[T] >= x[T_MOVE]:
        end_run(x, at, notes, counts)
    afloat(p, table, stages, x, at, accounts, notes, counts)
    if at[STOP] == 0 and at[ARRIVED] == 0 and at[ALARM] == 0:
        stage = stages[at[PHASE]]
        if stage[KIND] != TO_SURFACE and abs(x[Z] - stage[DEPTH]) <= stage[TOLERANCE]:
            arrive(stages, x, at, notes, counts)
    if at[STOP] == 0 and x[T] >= x[T_LOOK] and x[T] < x[T_END]:
        if at[DOING] != NOTHING and x[T_MOVE] < math.inf:
            x[T_LOOK] = x[T_MOVE]
        elif at[DOING] != NOTHING:
            x[T_LOOK] = x[T] + stages[at[PHASE], DEAD]
        elif at[ALARM] == 1:
            _press_out(p, table, x, at, accounts, notes, counts)
        else:
            look(p, table, waves, stages[at[PHASE]], x, at, accounts, notes, counts)
    if p[LINE] > 0.0 and at[STOP] == 0:
        early = _FULL if at[DOING] == PRIMING and at[PLACE] == 2 else 0.0
        if valve_turns(p, table, waves, x, at, 0.0, x[Z], x[W]) > -early:
            turn_valve(p, table, x, at)
