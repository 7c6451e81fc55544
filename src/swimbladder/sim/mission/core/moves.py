"""What the vehicle's processor does: it looks, and lets the drive run for a bounded time."""

from __future__ import annotations

import math

from swimbladder.control import hold, rate
from swimbladder.control.deadband import DeadbandParameters, DeadbandState
from swimbladder.control.law import Measurement
from swimbladder.sim.closed_loop.dispatch import compilable
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.line import empty_line, fill_lacks
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Drive, Given, Note, Now, Table
from swimbladder.sim.engine.rodas.sensing import measured, measured_volume, normal
from swimbladder.sim.mission.core.names import Kind, Stage

__all__ = ["FULL", "end_run", "look", "note", "start_run"]

RateParameters, RateState = rate.RateParameters, rate.RateState
_law_step = inlined(compilable(rate.step))
_law_initial = inlined(compilable(rate.initial))
_hold_step = inlined(compilable(hold.step))
_hold_begin = inlined(compilable(hold.begin))

T, Z, V, H = int(Now.T), int(Now.Z), int(Now.V), int(Now.H)
T_LOOK, T_MOVE, V_MOVE = int(Now.T_LOOK), int(Now.T_MOVE), int(Now.V_MOVE)
T_PRIMED, T_PHASE = int(Now.T_PRIMED), int(Now.T_PHASE)
T_BEGIN, Z_LOOK, LAW = int(Now.T_BEGIN), int(Now.Z_LOOK), int(Now.LAW)
T_END = int(Now.T_END)
DOING, RESTS, NEW_LAW = int(At.DOING), int(At.RESTS), int(At.NEW_LAW)
SEED, PHASE, LOOKS = int(At.SEED), int(At.PHASE), int(At.LOOKS)
ARRIVED = int(At.ARRIVED)
STEP, V_MIN, V_MAX = int(Given.STEP), int(Given.V_MIN), int(Given.V_MAX)
START = int(Table.START)
BY_VOLUME, QUANTUM, LONGEST = int(Given.BY_VOLUME), int(Given.QUANTUM), int(Given.LONGEST)
DELIVERY, MAKES_UP = int(Given.DELIVERY), int(Given.MAKES_UP)
LINE, RUN_UP, SHUT = int(Given.LINE), int(Given.RUN_UP), int(At.SHUT)
VOLUME_NOISE, VOLUME_QUANTUM = int(Given.VOLUME_NOISE), int(Given.VOLUME_QUANTUM)
NEUTRAL_TOP, SHALLOW = int(Given.NEUTRAL_TOP), int(Given.SHALLOW)
KIND, DEPTH, SPEED, STAGE_LAW = int(Stage.KIND), int(Stage.DEPTH), int(Stage.SPEED), int(Stage.LAW)
SURFACE, CAPTURE, STAGE_HOLD = int(Kind.SURFACE), int(Stage.CAPTURE), int(Stage.HOLD)
W_SEEN, CAPTURED = int(Now.W_SEEN), int(At.CAPTURED)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
LETTING_IN, BYPASSING = int(Doing.LETTING_IN), int(Doing.BYPASSING)
RATE_OUT, RATE_IN, BYPASS = int(Table.RATE_OUT), int(Table.RATE_IN), int(Table.BYPASS)
PUMP_RUNS, VALVE_RUNS = int(Account.PUMP_RUNS), int(Account.VALVE_RUNS)
PUMP_NOTE, VALVE_NOTE = int(Note.PUMP), int(Note.VALVE)
BYPASS_NOTE, RUN_OVER = int(Note.BYPASS), int(Note.RUN_OVER)
N_T, N_WHAT, N_Z = int(Drive.T), int(Drive.WHAT), int(Drive.Z)
N_V, N_NUMBER = int(Drive.V), int(Drive.NUMBER)

FULL = 1e-3  # share of the stroke that may be lacking where all volume counts as out
_FRESH = 2.0  # s, of the first step after the drive has started or stopped
_PAST = 1e-6  # of a quantum, past the edge between two of its steps
_SINKS = 0.05  # m; deeper by less since the last look, it still floats


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
def _change(p, table, x, at, accounts, notes, counts, volume, wanted, longest):  # type: ignore[no-untyped-def]
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
def _dive(p, table, stage, x, at, accounts, notes, counts, seen, longest):  # type: ignore[no-untyped-def]
    """Take in volume at the surface, run by run, until it sinks."""
    by_valve, by_bypass = (
        value(table, p[STEP], RATE_IN, 0.0)[0],
        value(table, p[STEP], BYPASS, 0.0)[0],
    )
    if max(by_valve, by_bypass) <= 0.0:  # no head at depth 0: there is some where it floats
        by_valve = value(table, p[STEP], RATE_IN, max(x[Z], 0.0))[0]
        by_bypass = value(table, p[STEP], BYPASS, max(x[Z], 0.0))[0]
    doing, flow = (BYPASSING, by_bypass) if by_bypass > by_valve else (LETTING_IN, by_valve)
    slack = stage[STAGE_LAW] * stage[SPEED] * stage[SPEED]
    if p[BY_VOLUME] > 0.0:
        goal, volume = p[NEUTRAL_TOP] - slack, measured_volume(p, x, at)
        if volume <= goal and seen - x[Z_LOOK] < _SINKS:
            goal = volume - slack
        if volume > goal:
            _run_to(p, table, x, at, accounts, notes, counts, doing, volume, goal, longest)
    elif seen - x[Z_LOOK] < _SINKS:
        wanted = slack
        if x[T] == x[T_PHASE]:  # it floats with all volume out, and knows how much that is
            wanted += p[V_MAX] - p[NEUTRAL_TOP]
        if flow > 0.0:
            longest = max(_in_steps(p, min(longest, wanted / flow)), p[QUANTUM])
        start_run(p, table, x, at, accounts, notes, counts, doing, -wanted, -math.inf, longest)
    x[Z_LOOK] = seen


@part
def _hold(p, table, stage, x, at, accounts, notes, counts, seen):  # type: ignore[no-untyped-def]
    """Let `control.hold` decide, and start what it asks for."""
    h = stage[STAGE_HOLD:]
    law = DeadbandParameters(
        h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8], h[9], h[10], h[11], h[12], h[13],
        h[14], h[15], h[16], h[17], h[18], h[19], h[20],
    )  # fmt: skip
    now = Measurement(x[T], seen - stage[DEPTH], measured_volume(p, x, at))
    if at[NEW_LAW] == 1:
        state = _hold_begin(law, now, x[W_SEEN])
        at[NEW_LAW] = 0
    else:
        s = x[LAW:]
        state = DeadbandState(
            s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12], s[13],
            s[14],
        )  # fmt: skip
    wanted, state, pause = _hold_step(law, state, now)
    for k in range(15):
        x[LAW + k] = state[k]
    x[W_SEEN] = state.speed
    x[T_LOOK] = x[T] + pause
    if wanted != 0.0:
        longest = min(p[LONGEST], pause)
        _change(p, table, x, at, accounts, notes, counts, now.volume, wanted, longest)


@part
def look(p, table, waves, stage, x, at, accounts, notes, counts):  # type: ignore[no-untyped-def]
    """Measure the depth, let the law `rate` decide, and start what it asks for."""
    at[LOOKS] += 1
    seen = measured(p, waves, x, at)
    law = RateParameters(
        stage[STAGE_LAW], stage[STAGE_LAW + 1], stage[STAGE_LAW + 2], stage[STAGE_LAW + 3],
        stage[STAGE_LAW + 4], stage[STAGE_LAW + 5], stage[STAGE_LAW + 6], stage[STAGE_LAW + 7],
        stage[STAGE_LAW + 8], stage[STAGE_LAW + 9], stage[STAGE_LAW + 10], stage[STAGE_LAW + 11],
        stage[STAGE_LAW + 12], stage[STAGE_LAW + 13],
    )  # fmt: skip
    longest = min(p[LONGEST], law.dead)  # a run is over by the next look
    surface = stage[KIND] == SURFACE
    if surface and seen <= p[SHALLOW]:
        full, lacking = p[V_MAX], p[V_MAX] - x[V]
        x[T_LOOK] = x[T] + law.dead
        if at[ARRIVED] == 1 and lacking <= FULL * (p[V_MAX] - p[V_MIN]):
            return  # it floats, and what has leaked is not worth a run
        start_run(p, table, x, at, accounts, notes, counts, PUMPING, lacking, full, p[LONGEST])
        if at[DOING] != NOTHING and x[T_MOVE] < math.inf:
            x[T_LOOK] = max(x[T_LOOK], x[T_MOVE])
        return
    if not surface and seen <= p[SHALLOW] and stage[DEPTH] > p[SHALLOW]:
        _dive(p, table, stage, x, at, accounts, notes, counts, seen, longest)
        x[T_LOOK] = x[T] + law.dead
        if at[DOING] != NOTHING:
            x[T_LOOK] = max(x[T_LOOK], x[T_MOVE])
        at[NEW_LAW] = 1
        x[W_SEEN] = 0.0
        return
    if stage[CAPTURE] > 0.0 and not surface:
        if at[CAPTURED] == 0 and abs(seen - stage[DEPTH]) <= stage[CAPTURE]:
            at[CAPTURED], at[NEW_LAW] = 1, 1
        if at[CAPTURED] == 1:
            _hold(p, table, stage, x, at, accounts, notes, counts, seen)
            return
    now = Measurement(x[T], seen, measured_volume(p, x, at))
    reference = 0.0 if surface else stage[DEPTH]
    if at[NEW_LAW] == 1:
        state = _law_initial(law, now, reference)
        at[NEW_LAW] = 0
    else:
        state = RateState(
            x[LAW], x[LAW + 1], x[LAW + 2], x[LAW + 3], x[LAW + 4], x[LAW + 5], x[LAW + 6]
        )
    wanted, state, pause = _law_step(law, state, now, reference)
    x[LAW], x[LAW + 1], x[LAW + 2], x[LAW + 3] = state[0], state[1], state[2], state[3]
    x[LAW + 4], x[LAW + 5], x[LAW + 6] = state[4], state[5], state[6]
    x[W_SEEN] = state[6]
    if wanted != 0.0:
        _change(p, table, x, at, accounts, notes, counts, now.volume, wanted, longest)
    x[T_LOOK] = x[T] + pause
    if at[DOING] != NOTHING:
        x[T_LOOK] = max(x[T_LOOK], x[T_MOVE])
