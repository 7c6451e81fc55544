"""A law of missions that holds a depth by its model: it predicts, learns, moves once, sleeps.

The estimate and the decision are those of the law `deadband`, for a drive that goes to a volume by
itself: what it commands is one change of volume at a wake, and the drive has got there long before
the next. Where the law `rate` is content with the speed at which drag balances the excess volume,
this one takes into account the vehicle's inertia and how far it gives way, T2 and psi, so that it
also holds a vehicle that diverges faster than it comes to a steady speed.

Depths count from the one that is held, where `neutral` is the volume at rest.
"""

from swimbladder.control.deadband import (
    DeadbandParameters,
    DeadbandState,
    Decision,
    decide,
    predict,
)
from swimbladder.control.law import Measurement


def remembered(decision: Decision, depth: float, volume: float, waited: float) -> DeadbandState:
    """Return the state after a decision, with the volume there will be [m3] in a time [s]."""
    return DeadbandState(
        begun=1.0,
        depth=depth,
        speed=decision.speed,
        depth_slope=0.0,
        speed_slope=0.0,
        neutral=decision.neutral,
        volume=volume,
        voltage=0.0,
        share=1.0,
        acting=decision.acting,
        moving=0.0,
        sleep=decision.sleep,
        waited=waited,
        goal=0.0,
        volume_reference=decision.volume_reference,
    )


def begin(parameters: DeadbandParameters, measurement: Measurement, speed: float) -> DeadbandState:
    """Start at a speed [m/s] that drag balances with the volume as it is."""
    p, depth, volume = parameters, measurement.depth, measurement.volume
    neutral = volume + speed / p.K2 - p.psi * depth
    return remembered(Decision(speed, neutral, 0.0, 0.0, p.interval, volume), depth, volume, 0.0)


def step(
    parameters: DeadbandParameters, state: DeadbandState, measurement: Measurement
) -> tuple[float, DeadbandState, float]:
    """Return the change of volume [m3], the state and the time to sleep [s].

    measurement: its depth counts from the one that is held [m].
    """
    p, volume = parameters, measurement.volume
    now = predict(p, state, volume)
    decision = decide(p, state, now, measurement, 0.0)
    change = decision.volume_reference - volume if decision.moves > 0.0 else 0.0
    if abs(change) <= p.tolerance:
        change = 0.0
    after = remembered(decision, measurement.depth, volume + change, decision.sleep)
    return change, after, decision.sleep
