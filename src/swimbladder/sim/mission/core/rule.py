"""The mission's own rule as a law of the loop: `rate` on the way, `control.hold` at a depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control import hold, rate
from swimbladder.control.deadband import DeadbandParameters, DeadbandState
from swimbladder.control.law import Law, Measurement
from swimbladder.control.rate import RateParameters, RateState
from swimbladder.sim.closed_loop.dispatch import compilable, gather, scatter_where
from swimbladder.sim.engine.cache import inlined
from swimbladder.sim.engine.rodas.names import At, Now
from swimbladder.sim.mission.core.names import Stage

W_SEEN, STATE = int(Now.W_SEEN), int(Now.LAW)
PHASE, CAPTURED = int(At.PHASE), int(At.CAPTURED)
STAGE_LAW, CAPTURE, STAGE_HOLD = int(Stage.LAW), int(Stage.CAPTURE), int(Stage.HOLD)
# what the compiler knows the numbers of a phase and of the state by
_RATE = RateParameters(*map(float, range(len(RateParameters._fields))))
_RATE_STATE = RateState(*map(float, range(len(RateState._fields))))
_HOLD = DeadbandParameters(*map(float, range(len(DeadbandParameters._fields))))
_HOLD_STATE = DeadbandState(*map(float, range(len(DeadbandState._fields))))

_rate_step, _rate_begin = inlined(compilable(rate.step)), inlined(compilable(rate.initial))
_hold_step, _hold_begin = inlined(compilable(hold.step)), inlined(compilable(hold.begin))


class Rule(NamedTuple):
    """The phases, and where the vehicle is among them; what is remembered stands there too."""

    stages: NDArray[np.float64]  # [phases, Stage.COUNT]
    x: NDArray[np.float64]  # [Now.COUNT]
    at: NDArray[np.int64]  # [At.COUNT]


class Nothing(NamedTuple):
    """The state of the rule, which is in the vehicle's."""

    nothing: float


@inlined
def _from(measurement, depth):  # type: ignore[no-untyped-def]
    """Return a measurement whose depth counts from the one that is held [m]."""
    return Measurement(measurement.time, measurement.depth - depth, measurement.volume)


@inlined
def _begin(rule, measurement, reference):  # type: ignore[no-untyped-def]
    x, stage = rule.x, rule.stages[rule.at[PHASE]]
    if rule.at[CAPTURED] == 1:
        holds = gather(_HOLD, stage, STAGE_HOLD, 1)
        state = _hold_begin(holds, _from(measurement, reference), x[W_SEEN])
        scatter_where(True, state, x, STATE, 1)
    else:
        law = gather(_RATE, stage, STAGE_LAW, 1)
        scatter_where(True, _rate_begin(law, measurement, reference), x, STATE, 1)


@inlined
def _decide(rule, measurement, reference):  # type: ignore[no-untyped-def]
    x, at, stage = rule.x, rule.at, rule.stages[rule.at[PHASE]]
    away = _from(measurement, reference)
    if at[CAPTURED] == 0 and stage[CAPTURE] > 0.0 and abs(away.depth) <= stage[CAPTURE]:
        at[CAPTURED] = 1
        holds = gather(_HOLD, stage, STAGE_HOLD, 1)
        scatter_where(True, _hold_begin(holds, away, x[W_SEEN]), x, STATE, 1)
    if at[CAPTURED] == 1:
        change, held, pause = _hold_step(
            gather(_HOLD, stage, STAGE_HOLD, 1), gather(_HOLD_STATE, x, STATE, 1), away
        )
        scatter_where(True, held, x, STATE, 1)
        x[W_SEEN] = held.speed
        return change, pause
    law = gather(_RATE, stage, STAGE_LAW, 1)
    change, after, pause = _rate_step(law, gather(_RATE_STATE, x, STATE, 1), measurement, reference)
    scatter_where(True, after, x, STATE, 1)
    x[W_SEEN] = after.speed
    return change, pause


def _initial(rule: Rule, measurement: Measurement, reference: float) -> Nothing:
    _begin(rule, measurement, reference)
    return Nothing(0.0)


def _step(
    rule: Rule, state: Nothing, measurement: Measurement, reference: float
) -> tuple[float, Nothing, float]:
    change, pause = _decide(rule, measurement, reference)
    return change, state, pause


RULE = Law(
    name="rule", summary="the mission's own rule", command="volume change", parameters=Rule,
    state=Nothing, step=_step, initial=_initial,
)  # fmt: skip
