"""The phases of a mission of pump and valve as hooks of the closed loop: see `closed_loop.lane`.

A tick of the loop is whatever comes next that somebody has to decide: a sample of the processor,
the end of a phase, a full buffer. Between two ticks RODAS moves the vehicle in steps as long as its
motion lets.

The mission's own rule as a law of the loop: `rate` on the way, `deadband.hold_step` at a depth.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control import rate
from swimbladder.control.deadband import (
    DeadbandParameters,
    DeadbandState,
    hold_begin,
    hold_step,
)
from swimbladder.control.law import Law, Measurement
from swimbladder.control.rate import RateParameters, RateState
from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop.dispatch import compilable, gather, scatter_where
from swimbladder.sim.closed_loop.lane import Lanes, Like, Row, hook_in, rows
from swimbladder.sim.closed_loop.lanes import Schedule
from swimbladder.sim.closed_loop.outside import kernel_of
from swimbladder.sim.closed_loop.pumped import DIVES, FLOATS, PAUSE, one_lane
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.modes import NO_LAYERS, V_0
from swimbladder.sim.engine.rodas.drive import FULL, STAYED, change_volume, end_run, note, press_out
from swimbladder.sim.engine.rodas.line import empty_line
from swimbladder.sim.engine.rodas.motion import rate_of
from swimbladder.sim.engine.rodas.records import Account, Doing, Note, Stop
from swimbladder.sim.engine.rodas.step import LEVEL, TOO_DEEP
from swimbladder.sim.engine.sensor import measured_depth, measured_volume
from swimbladder.sim.mission.core.phases import (
    Kind,
    Phases,
    arrive,
    awaited_level,
    begin_phase,
    begin_row,
    close_cycle,
    enter_hold,
    goal_of,
    grounds,
    next_phase,
    row,
    seek_ice,
    settle,
)

# what the compiler knows the numbers of a phase and of the state by
_RATE = RateParameters(*map(float, range(len(RateParameters._fields))))
_RATE_STATE = RateState(*map(float, range(len(RateState._fields))))
_HOLD = DeadbandParameters(*map(float, range(len(DeadbandParameters._fields))))
_HOLD_STATE = DeadbandState(*map(float, range(len(DeadbandState._fields))))

_rate_step, _rate_begin = inlined(compilable(rate.step)), inlined(compilable(rate.initial))
_hold_step, _hold_begin = inlined(compilable(hold_step)), inlined(compilable(hold_begin))


class Rule(NamedTuple):
    """The phases, and where the vehicle is among them; what is remembered stands there too."""

    stages: Any  # [phases] of STAGE
    x: Any  # [1] of NOW
    at: Any  # [1] of AT


class Nothing(NamedTuple):
    """The state of the rule, which is in the vehicle's."""

    nothing: float


@inlined
def _from(measurement: Any, depth: float) -> Any:
    """Return a measurement whose depth counts from the one that is held [m]."""
    below = measurement.depth - depth
    return Measurement(measurement.time, below, measurement.volume, measurement.battery)


@inlined
def _begin_rule(rule: Any, measurement: Any, reference: float) -> None:
    x, at = rule.x[0], rule.at[0]
    stage = rule.stages[at.phase]
    if at.captured == 1:
        holds = gather(_HOLD, stage.hold, 0, 1)
        state = _hold_begin(holds, _from(measurement, reference), x.w_seen)
        scatter_where(True, state, x.law, 0, 1)
    else:
        law = gather(_RATE, stage.law, 0, 1)
        scatter_where(True, _rate_begin(law, measurement, reference), x.law, 0, 1)


@inlined
def _decide(rule: Any, measurement: Any, reference: float) -> Any:
    x, at = rule.x[0], rule.at[0]
    stage = rule.stages[at.phase]
    away = _from(measurement, reference)
    if at.captured == 0 and stage.capture > 0.0 and abs(away.depth) <= stage.capture:
        at.captured = 1
        holds = gather(_HOLD, stage.hold, 0, 1)
        scatter_where(True, _hold_begin(holds, away, x.w_seen), x.law, 0, 1)
    if at.captured == 1:
        change, held, pause = _hold_step(
            gather(_HOLD, stage.hold, 0, 1), gather(_HOLD_STATE, x.law, 0, 1), away
        )
        scatter_where(True, held, x.law, 0, 1)
        x.w_seen = held.speed
        return change, pause
    law = gather(_RATE, stage.law, 0, 1)
    change, after, pause = _rate_step(law, gather(_RATE_STATE, x.law, 0, 1), measurement, reference)
    scatter_where(True, after, x.law, 0, 1)
    x.w_seen = after.speed
    return change, pause


def _initial(rule: Rule, measurement: Measurement, reference: float) -> Nothing:
    _begin_rule(rule, measurement, reference)
    return Nothing(0.0)


def _step(
    rule: Rule, state: Nothing, measurement: Measurement, reference: float
) -> tuple[float, Nothing, float]:
    change, pause = _decide(rule, measurement, reference)
    return change, state, pause


RULE = Law(
    name="rule",
    summary="the mission's own rule",
    command="volume change",
    parameters=Rule,
    state=Nothing,
    step=_step,
    initial=_initial,
)


DEAD = RateParameters._fields.index("dead")
_ROOM = 8  # rows or notes that a step may add
RECOVERY = 30.0 * 86400.0  # s to come up in after the alarm; a vehicle that floats deeper is lost
_IDLE = 200  # ticks without time passing: a fault of the model
MANY = np.broadcast_to(np.int64(0), (10**15,))  # ticks of one set-point: the hooks say which


@inlined
def full(f: Phases, room: int) -> bool:
    """Return whether a buffer may lack room for so many rows or notes, or for a cycle."""
    rows_full = 0 < f.rows.shape[0] < f.lane.counts[0] + room
    notes_full = 0 < f.lane.notes.shape[0] < f.lane.counts[1] + room
    return bool(rows_full or notes_full or 0 < f.cycles.shape[0] <= f.lane.counts[2])


@part
def turn(f: Phases) -> bool:
    """End and begin phases; return whether it goes on only when it is asked to: see `Stop`."""
    p, x, at = f.lane.p, f.lane.x, f.lane.at
    over = False
    if at.new_phase == 0 and at.stop == 0 and x.t >= x.t_end:
        if at.alarm != 0:
            at.stop = Stop.LOST
        else:
            over = next_phase(f)
    if at.stop == 0 and x.charge <= p.empty:
        at.stop = Stop.BATTERY_EMPTY
    if at.stop != 0:
        row(f)
        if not over:
            close_cycle(f)
    elif at.new_phase == 1 and not over:
        begin_phase(f)
        row(f)
    return bool(over or at.stop != 0)


@inlined
def begin_tick(f: Phases, S: Array) -> bool:
    """End and begin phases, with the numbers of their law; return whether the flight pauses."""
    at = f.lane.at
    at.idle += 1
    if at.stop == 0 and (S[Row.STOPPED] != 0.0 or at.idle > _IDLE):
        at.stop = Stop.STUCK
    over = turn(f)
    if at.stop != 0 and at.doing != Doing.PUMPING and at.doing != Doing.PRIMING:
        empty_line(f.lane)
    if over or full(f, _ROOM):
        return True
    for n in range(f.numbers.shape[1]):
        S[Row.LAW + n] = f.numbers[at.phase, n]
    return False


@inlined
def _begin(f: Phases, S: Array, k: int, built: Any) -> bool:  # noqa: ARG001
    x = f.lane.x
    if begin_tick(f, S):
        return True
    if x.t == x.t_phase and x.t >= x.t_sample:
        settled(f)
    return False


@inlined
def _sense(f: Phases, S: Array, k: int) -> None:  # noqa: ARG001
    """Measure where the processor looks; the law is called at no other tick."""
    p, x, at, up = f.lane.p, f.lane.x, f.lane.at, f.board
    S[Row.WAIT] = 1.0
    if at.stop != 0 or x.t < x.t_sample or x.t >= x.t_end:
        return
    stage = f.stages[at.phase]
    if at.doing != Doing.NOTHING:
        x.t_sample = x.t_move if x.t_move < math.inf else x.t + stage.law[DEAD]
    elif at.alarm == 1:
        press_out(f.lane)
        x.t_sample = x.t_move
    else:
        at.calls += 1
        seen, surface = measured_depth(p, f.lane.waves, x, at), stage.kind == Kind.SURFACE
        lift = grounds(f, seen)
        if lift > 0.0:  # of which the law knows nothing
            change_volume(f.lane, x.v, lift, p.longest)
        if lift > 0.0 or at.ends == 1:
            return
        S[Row.SEEN_DEPTH], S[Row.WAIT] = seen, 0.0
        afloat = surface and seen <= p.shallow
        S[Row.SEEN_VOLUME] = x.v if afloat else measured_volume(p, x, at)
        S[Row.REFERENCE] = 0.0 if surface else goal_of(f)
        up[0], up[1], up[2] = p.shallow, p.neutral_top, p.v_max
        up[3], up[5] = FULL * (p.v_max - p.v_min), p.by_volume
        up[4] = stage.law[0] * stage.speed * stage.speed
        # at the begin of a phase it floats with all volume out, and knows how much that is
        up[PAUSE], up[DIVES] = stage.law[DEAD], 0.0 if x.t == x.t_phase else 1.0
        up[FLOATS] = 1.0 if at.arrived == 1 else 0.0


@inlined
def _ask(f: Phases, S: Array, k: int) -> bool:  # noqa: ARG001
    return bool(S[Row.WAIT] == 0.0)


@inlined
def _bound(f: Phases, until: float) -> float:  # noqa: ARG001
    """Return when somebody has to decide [s]: now, where a buffer is full or the battery empty."""
    x = f.lane.x
    if full(f, _ROOM) or x.charge <= f.lane.p.empty:
        return float(x.t)
    return float(max(x.t, min(x.t_sample, x.t_end)))


@inlined
def _set_off(f: Phases) -> tuple[float, float]:
    begin_row(f)
    return f.stages[f.lane.at.phase].loads, awaited_level(f)


@inlined
def too_deep(f: Phases, event: int) -> bool:
    """Return whether a step ended at the deepest depth allowed; see where it ended at the phase's.

    event: how it ended.
    """
    if event == LEVEL and f.stages[f.lane.at.phase].kind != Kind.SURFACE:
        arrive(f)
    return bool(event == TOO_DEEP)


@inlined
def _moved(f: Phases, event: int, time: float, depth: float) -> None:
    """Enter a step in what is known of the phase, and see whether it arrived or is too deep."""
    x, at = f.lane.x, f.lane.at
    arrived = at.arrived == 1
    if too_deep(f, event):
        _alarm(f)
    if event != STAYED or at.place == 2 or at.doing != Doing.NOTHING:
        row(f)
    enter_time(f, depth, x.t - time, arrived)
    if x.t > time:
        at.idle = 0


@inlined
def enter_time(f: Phases, depth: float, h: float, arrived: bool) -> None:
    """Enter h [s] in the time of the phase, and in what it holds where it had arrived."""
    f.lane.accounts[Account.T_DESCEND + int(f.stages[f.lane.at.phase].kind)] += h
    if arrived and f.lane.at.alarm == 0:
        enter_hold(f, depth, h)
    if f.lane.p.ice_temperature > -math.inf:
        seek_ice(f, depth, h)


@inlined
def raise_alarm(f: Phases, reason: float) -> None:
    """Note that it is too deep, or that its supervisor took over: it comes up, or is lost."""
    x = f.lane.x
    if reason == 0.0:
        note(f.lane, Note.TOO_DEEP, x.w)
    else:
        note(f.lane, Note.ALARM, reason)
    f.lane.at.alarm = 1 if reason == 0.0 else 2
    x.t_end = x.t + RECOVERY


@part
def _alarm(f: Phases) -> None:
    """Move the volume to its upper limit, in runs as long as the pump stands."""
    raise_alarm(f, 0.0)
    if f.lane.at.doing != Doing.NOTHING:
        end_run(f.lane)
    press_out(f.lane)
    f.lane.x.t_sample = f.lane.x.t_move


@inlined
def settled(f: Phases) -> None:
    """See what `settle` does; afloat the processor decides again only if oil comes in by itself."""
    p, x = f.lane.p, f.lane.x
    if settle(f):
        comes = rate_of(p, f.lane.table, Doing.NOTHING, True, x.z, x.v, 0.0)[0]
        x.t_sample = math.inf if comes == 0.0 else x.t + f.stages[f.lane.at.phase].law[DEAD]


hook_in(
    Phases,
    begin=_begin,
    sense=_sense,
    ask=_ask,
    bound=_bound,
    set_off=_set_off,
    moved=_moved,
    settled=settled,
)


def fly(
    phases: Phases, law: Law = RULE, like: Like | None = None, work: Any = None, board: Any = None
) -> Stop:
    """Fly until a cycle is over, a buffer is full, or the mission ends.

    law: of volume changes in the place of the mission's own rule; like: what its numbers are, work
    [rows]: where they stand from call to call, with what the law remembers. board: of
    `core.sampled.Boarded`, where it is the law of a board, which commands seconds at every tick.
    """
    stepper, p, at = one_lane(phases.lane, phases.board), phases.lane.p, phases.lane.at
    at.idle, none = 0, np.zeros((1, 0, 0))
    if like is None:
        phases = phases._replace(numbers=np.zeros((len(phases.stages), 0)))  # the rule's own
        like = Like(Rule(phases.stages, stepper.x, stepper.at), Nothing(0.0), volume_row=-1)
        work = np.zeros(rows(len(Rule._fields), len(Nothing._fields)))
    hooks, tick, first = phases, 0.0, 1
    if board is not None:
        stepper, hooks, tick = stepper._replace(seconds=True), board, board.tick
        first = round(float(phases.lane.x["t"]) / tick)
    work[Row.STOPPED], work[Row.PLANT + V_0] = 0.0, p.neutral_top + p.trim
    lanes = Lanes(
        S=work,
        token=(0.0,),
        live=1,
        bend=(),
        sea=(),
        layers=NO_LAYERS,
        parts=1,
        depths=np.zeros((1, 1)),
        record=none,
        built=np.zeros((1, 1), np.uint8),
        accounts=np.zeros((1, 0)),
        log=none,
        noted=np.zeros((1, 1), np.int64),
    )
    clock = Schedule(tick=tick, turn=MANY, given=np.zeros(1, np.int64))
    kernel = kernel_of(law, pumped=True, hooks=hooks)
    kernel(lanes, hooks, stepper, like, clock, (first, len(MANY) - 1), np.zeros((0, 2, 1)), None)
    return Stop(int(at.stop))
