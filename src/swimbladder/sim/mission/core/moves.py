"""What the vehicle's processor does at a look: it measures, and lets the drive run for a time."""

from __future__ import annotations

import math

from swimbladder.control import hold, rate
from swimbladder.control.deadband import DeadbandParameters, DeadbandState
from swimbladder.control.law import Measurement
from swimbladder.control.surfacing import (
    IN,
    LAW,
    OUT,
    SurfacingParameters,
    SurfacingState,
    at_surface,
)
from swimbladder.sim.closed_loop.dispatch import compilable
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.drive import FULL, change_volume, press_out, take_in
from swimbladder.sim.engine.rodas.names import At, Doing, Given, Now
from swimbladder.sim.engine.rodas.sensing import measured, measured_volume
from swimbladder.sim.mission.core.names import Kind, Stage

RateParameters, RateState = rate.RateParameters, rate.RateState
_law_step = inlined(compilable(rate.step))
_law_initial = inlined(compilable(rate.initial))
_hold_step = inlined(compilable(hold.step))
_hold_begin = inlined(compilable(hold.begin))
_at_surface = inlined(compilable(at_surface))

T, V, T_PHASE = int(Now.T), int(Now.V), int(Now.T_PHASE)
T_LOOK, T_MOVE = int(Now.T_LOOK), int(Now.T_MOVE)
Z_LOOK, STATE, W_SEEN = int(Now.Z_LOOK), int(Now.LAW), int(Now.W_SEEN)
DOING, NEW_LAW, LOOKS = int(At.DOING), int(At.NEW_LAW), int(At.LOOKS)
ARRIVED, CAPTURED, NOTHING = int(At.ARRIVED), int(At.CAPTURED), int(Doing.NOTHING)
V_MIN, V_MAX = int(Given.V_MIN), int(Given.V_MAX)
BY_VOLUME, LONGEST = int(Given.BY_VOLUME), int(Given.LONGEST)
NEUTRAL_TOP, SHALLOW = int(Given.NEUTRAL_TOP), int(Given.SHALLOW)
KIND, DEPTH, SPEED, STAGE_LAW = int(Stage.KIND), int(Stage.DEPTH), int(Stage.SPEED), int(Stage.LAW)
SURFACE, CAPTURE, STAGE_HOLD = int(Kind.SURFACE), int(Stage.CAPTURE), int(Stage.HOLD)


@part
def _hold(p, table, stage, x, at, accounts, notes, counts, seen, volume):  # type: ignore[no-untyped-def]
    """Let `control.hold` decide, and start what it asks for."""
    h = stage[STAGE_HOLD:]
    law = DeadbandParameters(
        h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8], h[9], h[10], h[11], h[12], h[13],
        h[14], h[15], h[16], h[17], h[18], h[19], h[20],
    )  # fmt: skip
    now = Measurement(x[T], seen - stage[DEPTH], volume)
    if at[NEW_LAW] == 1:
        state = _hold_begin(law, now, x[W_SEEN])
        at[NEW_LAW] = 0
    else:
        s = x[STATE:]
        state = DeadbandState(
            s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12], s[13],
            s[14],
        )  # fmt: skip
    wanted, state, pause = _hold_step(law, state, now)
    for k in range(15):
        x[STATE + k] = state[k]
    x[W_SEEN] = state.speed
    x[T_LOOK] = x[T] + pause
    if wanted != 0.0:
        longest = min(p[LONGEST], pause)
        change_volume(p, table, x, at, accounts, notes, counts, now.volume, wanted, longest)


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
    reference = 0.0 if surface else stage[DEPTH]
    volume = x[V] if surface and seen <= p[SHALLOW] else measured_volume(p, x, at)
    up = SurfacingParameters(
        p[SHALLOW], p[NEUTRAL_TOP], p[V_MAX], FULL * (p[V_MAX] - p[V_MIN]),
        law.coefficient * stage[SPEED] * stage[SPEED], p[BY_VOLUME],
    )  # fmt: skip
    # at the begin of a phase it floats with all volume out, and knows how much that is
    before = SurfacingState(x[Z_LOOK], 0.0 if x[T] == x[T_PHASE] else 1.0)
    floats = 1.0 if at[ARRIVED] == 1 else 0.0
    action, wanted, after = _at_surface(up, before, seen, volume, reference, floats)
    if action != LAW:
        x[Z_LOOK] = after.depth
        x[T_LOOK] = x[T] + law.dead
        if action == OUT:
            press_out(p, table, x, at, accounts, notes, counts)
        elif action == IN:
            at[NEW_LAW] = 1
            x[W_SEEN] = 0.0
            take_in(p, table, x, at, accounts, notes, counts, volume, wanted, longest)
        if at[DOING] != NOTHING and x[T_MOVE] < math.inf:
            x[T_LOOK] = max(x[T_LOOK], x[T_MOVE])
        return
    if stage[CAPTURE] > 0.0 and not surface:
        if at[CAPTURED] == 0 and abs(seen - stage[DEPTH]) <= stage[CAPTURE]:
            at[CAPTURED], at[NEW_LAW] = 1, 1
        if at[CAPTURED] == 1:
            _hold(p, table, stage, x, at, accounts, notes, counts, seen, volume)
            return
    now = Measurement(x[T], seen, volume)
    if at[NEW_LAW] == 1:
        state = _law_initial(law, now, reference)
        at[NEW_LAW] = 0
    else:
        s = x[STATE:]
        state = RateState(s[0], s[1], s[2], s[3], s[4], s[5], s[6])
    wanted, state, pause = _law_step(law, state, now, reference)
    for k in range(7):
        x[STATE + k] = state[k]
    x[W_SEEN] = state[6]
    if wanted != 0.0:
        change_volume(p, table, x, at, accounts, notes, counts, volume, wanted, longest)
    x[T_LOOK] = x[T] + pause
    if at[DOING] != NOTHING:
        x[T_LOOK] = max(x[T_LOOK], x[T_MOVE])
