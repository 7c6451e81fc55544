"""The kernel: from phase to phase, until the mission is over or a buffer is full."""

from __future__ import annotations

import math

from swimbladder.control.rate import RateParameters
from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.rodas.drive import (
    STAYED,
    end_run,
    end_turn,
    move,
    next_turn,
    note,
    press_out,
    turn_line,
)
from swimbladder.sim.engine.rodas.leap import LEVEL, TOO_DEEP
from swimbladder.sim.engine.rodas.line import empty_line
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Note, Now, Stop
from swimbladder.sim.mission.core.moves import look
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

T, Z, W, V, T_END = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.T_END)
T_LOOK, T_MOVE, CHARGE, PHASE = int(Now.T_LOOK), int(Now.T_MOVE), int(Now.CHARGE), int(At.PHASE)
CYCLE, DOING, PLACE, ARRIVED = int(At.CYCLE), int(At.DOING), int(At.PLACE), int(At.ARRIVED)
ALARM, STOP, NEW_PHASE, EMPTY = int(At.ALARM), int(At.STOP), int(At.NEW_PHASE), int(Given.EMPTY)
KIND, DEPTH, TOLERANCE = int(Stage.KIND), int(Stage.DEPTH), int(Stage.TOLERANCE)
LOADS, DEAD = int(Stage.LOADS), int(Stage.LAW) + RateParameters._fields.index("dead")
TO_SURFACE, NOTHING, PUMPING = int(Kind.SURFACE), int(Doing.NOTHING), int(Doing.PUMPING)
PRIMING, LINE, SURFACING_ENERGY = int(Doing.PRIMING), int(Given.LINE), int(Account.SURFACING_ENERGY)
PUMP_ENERGY, VALVE_ENERGY = int(Account.PUMP_ENERGY), int(Account.VALVE_ENERGY)
HOLDING_ENERGY, LOAD_ENERGY = int(Account.HOLDING_ENERGY), int(Account.LOAD_ENERGY)
SELF_DISCHARGED, T_KIND, R_T = int(Account.SELF_DISCHARGED), int(Account.T_KIND), int(Row.T)
R_Z, R_W, R_V, R_PHASE, R_DOING = int(Row.Z), int(Row.W), int(Row.V), int(Row.PHASE), int(Row.DOING)
R_CYCLE, R_PUMP, R_VALVE = int(Row.CYCLE), int(Row.PUMP_ENERGY), int(Row.VALVE_ENERGY)
R_HOLDING, R_LOAD = int(Row.HOLDING_ENERGY), int(Row.LOAD_ENERGY)
R_SURFACING, R_LOST = int(Row.SURFACING_ENERGY), int(Row.SELF_DISCHARGED)
NOTE_DEEP, STOP_LOST, STOP_EMPTY = int(Note.TOO_DEEP), int(Stop.LOST), int(Stop.BATTERY_EMPTY)
STUCK = int(Stop.STUCK)
_ROOM = 8  # rows or notes that one pass of the loop may add
RESCUE = 30.0 * 86400.0  # s to come up in after the alarm; a vehicle that floats deeper is lost
_PASSES = 200  # without time passing: a fault of the model


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
def _alarm(p, table, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
    """Move the volume to its upper limit, in runs as long as the pump stands."""
    note(notes, counts, x, NOTE_DEEP, x[W])
    at[ALARM] = 1
    if at[DOING] != NOTHING:
        end_run(x, at, notes, counts)
    press_out(p, table, x, at, accounts, notes, counts)
    x[T_LOOK] = x[T_MOVE]
    x[T_END] = x[T] + RESCUE


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
        until = next_turn(p, table, x, at, min(x[T_LOOK], x[T_END]))
        if until > x[T]:
            _begin_row(rows, counts, x, at, accounts)
            kind = int(stages[at[PHASE], KIND])
            arrived, depth = at[ARRIVED] == 1, x[Z]
            level = awaited_level(stages, x, at)
            event = move(p, table, waves, x, at, accounts, notes, counts, loads, level, until, work)
            if event == LEVEL:
                arrive(stages, x, at, notes, counts)
            elif event == TOO_DEEP:
                _alarm(p, table, x, at, accounts, notes, counts)
            if event != STAYED or at[PLACE] == 2 or at[DOING] != NOTHING:
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
    end_turn(x, at, notes, counts)
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
            press_out(p, table, x, at, accounts, notes, counts)
            x[T_LOOK] = x[T_MOVE]
        else:
            look(p, table, waves, stages[at[PHASE]], x, at, accounts, notes, counts)
    turn_line(p, table, waves, x, at)
