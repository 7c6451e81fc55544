"""The observer's law for a positioner: state feedback that commands a volume.

The filter is that of `observer`: it knows the volume and finds depth, speed and neutral volume. The
piston is a stepper's, which goes to a commanded place at a constant rate and holds it by itself. So
the volume that the state feedback asks for is the command, no farther from where the piston is than
it goes in a sample: then the next sample finds it there. Within a dead zone it stays.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control import law, observer
from swimbladder.control.law import from_leaves
from swimbladder.control.observer import Estimate, begin_estimate, estimate, limited, moves


class PositionObserverParameters(NamedTuple):
    """The model, the filter, the feedback and the piston's limits; see `observer`."""

    model: observer.Observed
    k_z: Annotated[float, "m3/m"]  # volume per depth error
    k_w: Annotated[float, "m3 s/m"]  # volume per speed error
    dead: Annotated[float, "m3"]  # volume error below which the piston rests
    farthest: Annotated[float, "m"]  # a depth error beyond which no more volume is asked for
    rate: Annotated[float, "m3/s"]  # of the piston
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]


class PositionObserverState(NamedTuple):
    """What the law remembers between samples."""

    estimate: Estimate
    volume_reference: float  # m3, commanded at the sample before
    moving: float  # 1: the piston is on its way, 0: it rests


def initial(
    parameters: PositionObserverParameters, measurement: law.Measurement, reference: float
) -> PositionObserverState:
    """Start at rest with the volume as it is."""
    p = parameters
    e = begin_estimate(p.model, measurement, reference)
    return PositionObserverState(e, e.volume, 0.0)


def step(
    parameters: PositionObserverParameters,
    state: PositionObserverState,
    measurement: law.Measurement,
    reference: float,
) -> tuple[float, PositionObserverState, float]:
    """Return the volume to go to [m3]; where none is measured the piston is where it was sent."""
    p = parameters
    volume = measurement.volume if math.isfinite(measurement.volume) else state.volume_reference
    e = estimate(p.model, p.model.trust, state.estimate, volume, measurement.depth)
    error = limited(reference - e.depth, -p.farthest, p.farthest)
    wanted = p.model.psi * (e.depth + error) + e.neutral - p.k_z * error + p.k_w * e.speed
    wanted = limited(wanted, p.volume_min, p.volume_max)
    moving = moves(wanted - volume, state.moving, p.dead)
    reach = p.rate * p.S_p
    command = volume + moving * limited(wanted - volume, -reach, reach)
    return (command, PositionObserverState(e, command, moving), p.S_p)


def _gains(s: law.Setting, k: law.TuningParameters) -> PositionObserverParameters:
    return from_leaves(PositionObserverParameters, observer.feedback(s, k) | {"rate": s.plant.rate})


POSITION_OBSERVER = law.Law(
    name="position-observer",
    summary="the observer's state feedback, commanding the volume of a positioner",
    command="volume",
    parameters=PositionObserverParameters,
    state=PositionObserverState,
    step=step,
    initial=initial,
    dead_zone="dead",
    recipe=law.Recipe(
        gains=_gains, fast=law.FAST, quiet=law.QUIET, jitter=observer.jitter, holds_best=True
    ),
)
