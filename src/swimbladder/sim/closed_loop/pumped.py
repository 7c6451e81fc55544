"""The stepper of lanes with pump and valve: what the loop does with them at a tick.

`Pumped` holds the arrays that `engine.rodas` moves, lane by lane, in the place of the modes'
exponentials of `lane`. Its steps are as long as the motion lets, to the
next call of the law at most; what lies between is read off the cubic of the last step.

The processor calls the law when it asked to be called and no run of pump or valve lasts. Near the
surface it acts itself, see `control.pump_valve`; afterwards the law begins anew. Where
`Pumped.seconds` is given the law does all that itself, as that of a board does: it is called at
every tick, knows no volume that is measured, and commands the seconds of the tick for which the
pump is to run, or, below 0, valve or bypass (`Row.WIDE`) are to be open.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Measurement
from swimbladder.control.pump_valve import (
    IN,
    LAW,
    OUT,
    SurfacingParameters,
    SurfacingState,
    at_surface,
)
from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop.dispatch import (
    compilable,
    extent,
    gather,
    law_initial,
    law_step,
    scatter_where,
)
from swimbladder.sim.closed_loop.lane import (
    Lanes,
    Like,
    Row,
    bound,
    commit,
    decide,
    drive,
    judge,
    moved,
    set_off,
    settled,
)
from swimbladder.sim.engine.advance import CHATTERS, LEFT_WATER, NOT_FINITE, TOO_DEEP
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.modes import V_0
from swimbladder.sim.engine.rodas.drive import (
    FULL,
    STAYED,
    change_volume,
    end_run,
    end_turn,
    move,
    next_turn,
    press_out,
    start_run,
    take_in,
    turn_line,
)
from swimbladder.sim.engine.rodas.motion import inside, rate_of
from swimbladder.sim.engine.rodas.records import Doing, Lane, Stop, lane_of

LAW_NOT_FINITE = 5  # why a lane stopped, beside engine.advance


class Pumped(NamedTuple):
    """Lanes that RODAS moves, of records of `engine.rodas.records`."""

    given: Any  # [lanes], of `engine.rodas.prepare.given_of`
    table: Array  # [n, 2 len(Table)], of all lanes
    waves: Array  # [m, 6], as `table`
    x: Any  # [lanes] of NOW
    at: Any  # [lanes] of AT
    accounts: Array  # [lanes, Account.COUNT]
    notes: Any  # [lanes, k] of NOTE; nothing is noted where k is 0
    counts: NDArray[np.int64]  # [lanes, 3]
    work: Array  # [lanes, *WORK]
    board: Array  # [lanes, BOARD]: the parameters of `control.pump_valve`, and see below
    segment: Array  # [lanes, SEGMENT]: begin and end of the last step [s], z, w, V there, Doing
    seconds: bool | None = None  # True: the law commands seconds of the tick


N_UP = len(SurfacingParameters._fields)
# s between two decisions at the surface; 1: it dives; 1: it is known to float with all volume out
PAUSE, DIVES, FLOATS, BOARD = range(N_UP, N_UP + 4)
BEGIN, END, Z_FROM, W_FROM, V_FROM, DID, SEGMENT = range(7)
_WHOLE = 1.0 - 1e-6  # of a tick: a run so long may go on with the next one
_SAME_TRIM = 1e-15  # m3
_PASSES = 200  # without time passing: a fault of the model
_at_surface = inlined(compilable(at_surface))


@part
def run_for(lane: Lane, length: float, wide: float, tick: float) -> None:
    """Let the pump of a lane run for a length [s], below 0 a valve; what else was on ends.

    wide: 1: by the bypass. A whole tick of it goes on until another command ends it. A pump that
    runs on against its end stop, where it makes up what seeps back, does not start anew.
    """
    p, x, at = lane.p, lane.x, lane.at
    does = Doing.PUMPING if length > 0.0 else (Doing.BYPASSING if wide > 0.0 else Doing.LETTING_IN)
    length = math.inf if abs(length) >= _WHOLE * tick else abs(length)
    now = Doing.PUMPING if at.doing == Doing.PRIMING else at.doing
    if now != Doing.NOTHING and (length == 0.0 or now != does):
        end_run(lane)
    if length > 0.0 and now != does:
        end = math.inf if does == Doing.PUMPING else -math.inf
        if does != Doing.PUMPING or x.v < p.v_max - FULL * (p.v_max - p.v_min):
            start_run(lane, does, 0.0, end, length)
    elif at.doing != Doing.NOTHING:
        x.t_move = x.t + length


@part
def _decide(
    s: Any, seconds: bool | None, lanes: Lanes, i: int, hooks: Any, law: Like, k: int, tick: float
) -> None:
    """Let the processor of lane i act where it is time, and start the run that follows."""
    S, W_ = lanes.S, len(lanes.token)
    p, x, at, accounts = s.given[i], s.x[i], s.at[i], s.accounts[i]
    lane = Lane(p, s.table, s.waves, x, at, accounts, s.notes[i], s.counts[i], s.work[i])
    if seconds is None:  # pruned before types are inferred
        _change(lane, s.board[i], lanes, i, hooks, law, k, tick)
        return
    if law.wide_row >= 0:
        S[Row.SEEN_VOLUME * W_ + i] = np.nan
    length = decide(S, W_, i, hooks, law, k, tick)
    if law.wide_row >= 0:
        row = Row.LAW + extent(law.parameters) + law.wide_row
        S[Row.WIDE * W_ + i] = S[row * W_ + i]
    if abs(length) < 1e30:
        run_for(lane, length, S[Row.WIDE * W_ + i], tick)
    else:
        S[Row.STOPPED * W_ + i], S[Row.STOP_TICK * W_ + i] = LAW_NOT_FINITE, k
    rate = rate_of(p, s.table, at.doing, at.shut == 1, x.z, x.v, x.w)
    S[Row.Q * W_ + i] = rate[0]
    if law.wide_row >= 0:
        S[Row.APPLIED * W_ + i] = at.doing


@part
def _change(
    lane: Lane, board: Array, lanes: Lanes, i: int, hooks: Any, law: Like, k: int, tick: float
) -> None:
    """Let a processor whose law asks for changes of volume act, as `_decide`."""
    S, W_ = lanes.S, len(lanes.token)
    S[Row.COMMAND * W_ + i] = 0.0
    waiting = S[Row.WAIT * W_ + i]
    if waiting > 0.0:
        S[Row.WAIT * W_ + i] = waiting - 1.0
        return
    p, x, at = lane.p, lane.x, lane.at
    t, change, pause = x.t, 0.0, board[PAUSE]
    depth, volume = S[Row.SEEN_DEPTH * W_ + i], S[Row.SEEN_VOLUME * W_ + i]
    reference = S[Row.REFERENCE * W_ + i]
    up = SurfacingParameters(board[0], board[1], board[2], board[3], board[4], board[5])
    before = SurfacingState(x.z_sample, board[DIVES])
    action, wanted, after = _at_surface(up, before, depth, volume, reference, board[FLOATS])
    if at.doing != Doing.NOTHING:
        pass  # a run to the end stop, of a pump that may run as long as it takes
    elif action == LAW:
        row = (Row.LAW + extent(law.parameters)) * W_ + i
        parameters = gather(law.parameters, S, Row.LAW * W_ + i, W_)
        now = Measurement(t, depth, volume, np.nan)
        if at.new_law == 1:
            at.new_law = 0
            scatter_where(True, law_initial(parameters, now, reference), S, row, W_)
        state = gather(law.state, S, row, W_)
        change, state, pause = law_step(parameters, state, now, reference)
        scatter_where(True, state, S, row, W_)
        change = drive(hooks, S, k, change)
        if not abs(change) < 1e30:
            S[Row.STOPPED * W_ + i], S[Row.STOP_TICK * W_ + i] = LAW_NOT_FINITE, k
            return
        if change != 0.0:
            longest = min(p.longest, pause)  # a run is over by the next call
            change_volume(lane, volume, change, longest)
    else:
        x.z_sample, board[DIVES], at.new_law = after.depth, after.dives, 1
        change = wanted
        if action == OUT:
            press_out(lane)
        elif action == IN:
            x.w_seen = 0.0
            take_in(lane, volume, wanted, min(p.longest, pause))
    turn_line(lane)
    x.t_sample = t + pause
    if at.doing != Doing.NOTHING and x.t_move < math.inf:
        x.t_sample = max(x.t_sample, x.t_move)
    S[Row.COMMAND * W_ + i], S[Row.APPLIED * W_ + i] = change, at.doing
    S[Row.Q * W_ + i] = rate_of(p, lane.table, at.doing, at.shut == 1, x.z, x.v, x.w)[0]
    if tick > 0.0:
        S[Row.WAIT * W_ + i] = max(math.ceil((x.t_sample - t) / tick - 1e-9) - 1.0, 0.0)


@part
def _move(s: Any, lanes: Lanes, i: int, hooks: Any, k: int, tick: float, ahead: float) -> None:
    """Bring lane i to the end of tick k; its steps may go on to `ahead` [s].

    A tick without a length ends where the hooks say.
    """
    p, x, at, accounts = s.given[i], s.x[i], s.at[i], s.accounts[i]
    seg, work = s.segment[i], s.work[i]
    lane = Lane(p, s.table, s.waves, x, at, accounts, s.notes[i], s.counts[i], work)
    S, W_ = lanes.S, len(lanes.token)
    lost = S[Row.LOST * W_ + i]  # see `hooks.lose`
    trimmed = S[(Row.PLANT + V_0) * W_ + i] - p.neutral_top + lost
    if abs(p.trim - trimmed) > _SAME_TRIM:
        p.trim = trimmed
        at.rests = 0
        x.h = min(x.h, 1.0)
    t = (k + 1) * tick
    until = max(t, min(ahead, (k + 1.0 + S[Row.WAIT * W_ + i]) * tick))
    t, until = bound(hooks, t), bound(hooks, until)
    passes = 0
    while x.t < t and at.stop == 0:
        before, z = x.t, x.z
        goal = next_turn(lane, until)
        if goal > before:
            loads, level = set_off(hooks)
            seg[BEGIN], seg[Z_FROM], seg[W_FROM], seg[V_FROM] = before, z, x.w, x.v
            seg[DID] = at.doing
            event = move(lane, loads, level, goal)
            seg[END] = x.t
            if event == STAYED:
                work[0, 0], work[0, 1], work[0, 2] = x.z, x.w, x.v
                for n in range(3):
                    work[2, n], work[3, n] = 0.0, 0.0
            moved(hooks, event, before, z)
        end_turn(lane)
        turn_line(lane)
        settled(hooks)
        t, until = bound(hooks, t), bound(hooks, until)
        passes = 0 if x.t > before else passes + 1
        if passes > _PASSES:
            at.stop = Stop.STUCK
    z, w, v, doing = x.z, x.w, x.v, float(at.doing)
    if x.t > t:
        share = (t - seg[BEGIN]) / (seg[END] - seg[BEGIN])
        z = inside(seg[Z_FROM], work[0, 0], work[2, 0], work[3, 0], share)
        w = inside(seg[W_FROM], work[0, 1], work[2, 1], work[3, 1], share)
        v = inside(seg[V_FROM], work[0, 2], work[2, 2], work[3, 2], share)
        doing = seg[DID]
    elif at.stop != 0 or not abs(z) < 1e30:
        why = CHATTERS
        if not abs(z) < 1e30:
            why = NOT_FINITE
        elif at.stop == Stop.LEFT_WATER:
            why = LEFT_WATER
        elif at.stop == Stop.LOST:
            why = TOO_DEEP
        S[Row.STOPPED * W_ + i], S[Row.STOP_TICK * W_ + i] = why, k
    rate = rate_of(p, s.table, int(doing), at.shut == 1, z, v, w)[0]
    commit(S, W_, i, (0.0,), (rate, v - lost, z, w))
    if s.seconds is None:
        S[Row.APPLIED * W_ + i] = doing


def one_lane(lane: Lane, board: Array) -> Pumped:
    """Return lanes that are a single one; board: see `Pumped`."""
    x, at = lane_of(lane.x), lane_of(lane.at)
    own: Any = [array[None] for array in (*lane[5:], board, np.zeros(SEGMENT))]
    return Pumped(lane_of(lane.p), lane.table, lane.waves, x, at, *own)


@part
def decide_lanes(
    stepper: Any, lanes: Lanes, hooks: Any, law: Like, k: int, tick: float, since: float
) -> None:
    """Judge every lane at tick k, `since` [s] its set-point, and let its processor act."""
    S, W_ = lanes.S, len(lanes.token)
    for i in range(W_):
        judge(S, W_, i, since)
        if S[Row.STOPPED * W_ + i] == 0.0:
            _decide(stepper, stepper.seconds, lanes, i, hooks, law, k, tick)


@part
def move_lanes(stepper: Any, lanes: Lanes, hooks: Any, k: int, tick: float, last: int) -> None:
    """Bring every lane to the end of tick k; no step goes beyond the begin of tick `last`."""
    W_ = len(lanes.token)
    ahead = (last if len(hooks) == 0 and stepper.seconds is None else k + 1) * tick
    for i in range(W_):
        if lanes.S[Row.STOPPED * W_ + i] == 0.0:
            _move(stepper, lanes, i, hooks, k, tick, ahead)
