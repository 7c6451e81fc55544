"""The mission's own rule as a law of the loop: `rate` on the way, `control.hold` at a depth."""

from typing import Any, NamedTuple

from swimbladder.control import hold, rate
from swimbladder.control.deadband import DeadbandParameters, DeadbandState
from swimbladder.control.law import Law, Measurement
from swimbladder.control.rate import RateParameters, RateState
from swimbladder.sim.closed_loop.dispatch import compilable, gather, scatter_where
from swimbladder.sim.engine.cache import inlined

# what the compiler knows the numbers of a phase and of the state by
_RATE = RateParameters(*map(float, range(len(RateParameters._fields))))
_RATE_STATE = RateState(*map(float, range(len(RateState._fields))))
_HOLD = DeadbandParameters(*map(float, range(len(DeadbandParameters._fields))))
_HOLD_STATE = DeadbandState(*map(float, range(len(DeadbandState._fields))))

_rate_step, _rate_begin = inlined(compilable(rate.step)), inlined(compilable(rate.initial))
_hold_step, _hold_begin = inlined(compilable(hold.step)), inlined(compilable(hold.begin))


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
def _begin(rule: Any, measurement: Any, reference: float) -> None:
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
    _begin(rule, measurement, reference)
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
