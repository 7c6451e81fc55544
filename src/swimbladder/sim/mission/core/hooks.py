"""The phases of a mission of pump and valve as hooks of the closed loop: see `closed_loop.hooks`.

A tick of the loop is whatever comes next that somebody has to decide: a look of the processor, the
end of a phase, a full buffer. Between two ticks RODAS moves the vehicle in steps as long as its
motion lets.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.rate import RateParameters
from swimbladder.sim.closed_loop.hooks import Hooks, hook_in
from swimbladder.sim.closed_loop.outside import kernel_of
from swimbladder.sim.closed_loop.pumped import DIVES, FLOATS, PAUSE, one_lane
from swimbladder.sim.closed_loop.rows import Row, rows
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.layers import NO_LAYERS
from swimbladder.sim.engine.modes import V_0
from swimbladder.sim.engine.rodas.drive import FULL, STAYED, end_run, note, press_out
from swimbladder.sim.engine.rodas.leap import LEVEL, TOO_DEEP
from swimbladder.sim.engine.rodas.line import empty_line
from swimbladder.sim.engine.rodas.motion import rate_of
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Note, Now, Stop
from swimbladder.sim.engine.rodas.sensing import measured, measured_volume
from swimbladder.sim.mission.core.names import Kind, Phases, Stage
from swimbladder.sim.mission.core.phases import (
    arrive,
    awaited_level,
    begin_phase,
    begin_row,
    close_cycle,
    enter_hold,
    next_phase,
    row,
    settle,
)
from swimbladder.sim.mission.core.rule import RULE, Nothing, Rule

T, Z, W, V, T_END = int(Now.T), int(Now.Z), int(Now.W), int(Now.V), int(Now.T_END)
T_LOOK, T_MOVE, CHARGE, PHASE = int(Now.T_LOOK), int(Now.T_MOVE), int(Now.CHARGE), int(At.PHASE)
T_PHASE, DOING, PLACE, ARRIVED = int(Now.T_PHASE), int(At.DOING), int(At.PLACE), int(At.ARRIVED)
ALARM, STOP, NEW_PHASE, EMPTY = int(At.ALARM), int(At.STOP), int(At.NEW_PHASE), int(Given.EMPTY)
IDLE, LOOKS, BY_VOLUME = int(At.IDLE), int(At.LOOKS), int(Given.BY_VOLUME)
V_MIN, V_MAX, NEUTRAL_TOP = int(Given.V_MIN), int(Given.V_MAX), int(Given.NEUTRAL_TOP)
SHALLOW, LINE, T_KIND = int(Given.SHALLOW), int(Given.LINE), int(Account.T_KIND)
KIND, DEPTH, TOLERANCE = int(Stage.KIND), int(Stage.DEPTH), int(Stage.TOLERANCE)
SPEED, LOADS, COEFFICIENT = int(Stage.SPEED), int(Stage.LOADS), int(Stage.LAW)
DEAD = COEFFICIENT + RateParameters._fields.index("dead")
TO_SURFACE, NOTHING, PUMPING = int(Kind.SURFACE), int(Doing.NOTHING), int(Doing.PUMPING)
PRIMING, NOTE_DEEP, STUCK = int(Doing.PRIMING), int(Note.TOO_DEEP), int(Stop.STUCK)
DEEPEST, LOST, STOP_EMPTY = int(Given.DEEPEST), int(Stop.LOST), int(Stop.BATTERY_EMPTY)
_ROOM = 8  # rows or notes that a step may add
RESCUE = 30.0 * 86400.0  # s to come up in after the alarm; a vehicle that floats deeper is lost
_IDLE = 200  # ticks without time passing: a fault of the model
MANY = np.broadcast_to(np.int64(0), (10**15,))  # ticks of one set-point: the hooks say which

Array = NDArray[np.float64]


@inlined
def full(f: Phases, room: int) -> bool:
    """Return whether a buffer may lack room for so many rows or notes, or for a cycle."""
    rows_full = 0 < f.rows.shape[0] < f.counts[0] + room
    notes_full = 0 < f.notes.shape[0] < f.counts[1] + room
    return bool(rows_full or notes_full or 0 < f.cycles.shape[0] <= f.counts[2])


@part
def turn(f: Phases) -> bool:
    """End and begin phases; return whether it goes on only when it is asked to: see `Stop`."""
    p, x, at = f.given, f.x, f.at
    over = False
    if at[NEW_PHASE] == 0 and at[STOP] == 0 and x[T] >= x[T_END]:
        if at[ALARM] == 1:
            at[STOP] = LOST
        else:
            over = next_phase(f)
    if at[STOP] == 0 and x[CHARGE] <= p[EMPTY]:
        at[STOP] = STOP_EMPTY
    if at[STOP] != 0:
        row(f)
        if not over:
            close_cycle(f)
    elif at[NEW_PHASE] == 1 and not over:
        begin_phase(f)
        row(f)
    return bool(over or at[STOP] != 0)


@inlined
def _begin(f: Phases, S: Array, k: int, built: Any) -> bool:  # noqa: ARG001
    x, at = f.x, f.at
    at[IDLE] += 1
    if at[STOP] == 0 and (S[Row.STOPPED] != 0.0 or at[IDLE] > _IDLE):
        at[STOP] = STUCK
    over = turn(f)
    if at[STOP] != 0 and f.given[LINE] > 0.0 and at[DOING] != PUMPING and at[DOING] != PRIMING:
        empty_line(f.given, f.table, x)
    if over or full(f, _ROOM):
        return True
    if x[T] == x[T_PHASE] and x[T] >= x[T_LOOK]:
        settled(f)
    return False


@inlined
def _sense(f: Phases, S: Array, k: int) -> None:  # noqa: ARG001
    """Measure where the processor looks; the law is called at no other tick."""
    p, x, at, up = f.given, f.x, f.at, f.board
    S[Row.WAIT] = 1.0
    if at[STOP] != 0 or x[T] < x[T_LOOK] or x[T] >= x[T_END]:
        return
    stage = f.stages[at[PHASE]]
    if at[DOING] != NOTHING:
        x[T_LOOK] = x[T_MOVE] if x[T_MOVE] < math.inf else x[T] + stage[DEAD]
    elif at[ALARM] == 1:
        press_out(p, f.table, x, at, f.accounts, f.notes, f.counts)
        x[T_LOOK] = x[T_MOVE]
    else:
        at[LOOKS] += 1
        seen, surface = measured(p, f.waves, x, at), stage[KIND] == TO_SURFACE
        S[Row.SEEN_DEPTH], S[Row.WAIT] = seen, 0.0
        afloat = surface and seen <= p[SHALLOW]
        S[Row.SEEN_VOLUME] = x[V] if afloat else measured_volume(p, x, at)
        S[Row.REFERENCE] = 0.0 if surface else stage[DEPTH]
        up[0], up[1], up[2] = p[SHALLOW], p[NEUTRAL_TOP], p[V_MAX]
        up[3], up[5] = FULL * (p[V_MAX] - p[V_MIN]), p[BY_VOLUME]
        up[4] = stage[COEFFICIENT] * stage[SPEED] * stage[SPEED]
        # at the begin of a phase it floats with all volume out, and knows how much that is
        up[PAUSE], up[DIVES] = stage[DEAD], 0.0 if x[T] == x[T_PHASE] else 1.0
        up[FLOATS] = 1.0 if at[ARRIVED] == 1 else 0.0


@inlined
def _ask(f: Phases, S: Array, k: int) -> bool:  # noqa: ARG001
    return bool(S[Row.WAIT] == 0.0)


@inlined
def _drive(f: Phases, S: Array, k: int, command: float) -> float:  # noqa: ARG001
    return command


@inlined
def _bound(f: Phases, until: float) -> float:  # noqa: ARG001
    """Return when somebody has to decide [s]: now, where a buffer is full or the battery empty."""
    x = f.x
    if full(f, _ROOM) or x[CHARGE] <= f.given[EMPTY]:
        return float(x[T])
    return float(max(x[T], min(x[T_LOOK], x[T_END])))


@inlined
def _set_off(f: Phases) -> tuple[float, float]:
    begin_row(f)
    return f.stages[f.at[PHASE], LOADS], awaited_level(f)


@inlined
def _moved(f: Phases, event: int, time: float, depth: float) -> None:
    """Enter a step in what is known of the phase, and see whether it arrived or is too deep."""
    x, at = f.x, f.at
    arrived = at[ARRIVED] == 1
    if event == LEVEL:
        arrive(f)
    elif event == TOO_DEEP:
        _alarm(f)
    if event != STAYED or at[PLACE] == 2 or at[DOING] != NOTHING:
        row(f)
    enter_time(f, depth, x[T] - time, arrived)
    if x[T] > time:
        at[IDLE] = 0


@inlined
def enter_time(f: Phases, depth: float, h: float, arrived: bool) -> None:
    """Enter h [s] in the time of the phase, and in what it holds where it had arrived."""
    f.accounts[T_KIND + int(f.stages[f.at[PHASE], KIND])] += h
    if arrived and f.at[ALARM] == 0:
        enter_hold(f, depth, h)


@inlined
def raise_alarm(f: Phases) -> None:
    """Note that the vehicle is too deep: it comes up, or is lost."""
    note(f.notes, f.counts, f.x, NOTE_DEEP, f.x[W])
    f.at[ALARM] = 1
    f.x[T_END] = f.x[T] + RESCUE


@part
def _alarm(f: Phases) -> None:
    """Move the volume to its upper limit, in runs as long as the pump stands."""
    x, at, notes, counts = f.x, f.at, f.notes, f.counts
    raise_alarm(f)
    if at[DOING] != NOTHING:
        end_run(x, at, notes, counts)
    press_out(f.given, f.table, x, at, f.accounts, notes, counts)
    x[T_LOOK] = x[T_MOVE]


@inlined
def settled(f: Phases) -> None:
    """See what `settle` does; afloat the processor decides again only if oil comes in by itself."""
    p, x = f.given, f.x
    if settle(f):
        comes = rate_of(p, f.table, NOTHING, True, x[Z], x[V], 0.0)[0]
        x[T_LOOK] = math.inf if comes == 0.0 else x[T] + f.stages[f.at[PHASE], DEAD]


hook_in(
    Phases,
    Hooks(
        _begin, _sense, _ask, _drive, bound=_bound, set_off=_set_off, moved=_moved, settled=settled
    ),
)


def fly(phases: Phases) -> Stop:
    """Fly until a cycle is over, a buffer is full, or the mission ends."""
    f = phases
    stepper = one_lane(
        f.given, f.table, f.x, f.at, waves=f.waves, accounts=f.accounts, notes=f.notes,
        counts=f.counts, board=f.board,
    )  # fmt: skip
    f.at[IDLE] = 0
    lane, none = np.zeros(rows(len(Rule._fields), len(Nothing._fields))), np.zeros((1, 0, 0))
    lane[Row.PLANT + V_0] = f.given[Given.NEUTRAL_TOP] + f.given[Given.TRIM]
    kernel_of(RULE, pumped=True)(
        lane, (0.0,), (), (), f, stepper,
        Rule(f.stages, f.x, f.at), Nothing(0.0), 1, len(MANY) - 1, 0.0, 1, MANY,
        np.zeros(1, np.int64), np.zeros((1, 1)), none, none, -1, None,
        np.zeros((1, 1), np.uint8), np.zeros((1, 0)), none, np.zeros((1, 1), np.int64), NO_LAYERS,
    )  # fmt: skip
    return Stop(int(f.at[STOP]))
