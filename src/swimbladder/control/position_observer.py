"""The observer's law for a positioner: state feedback that commands a volume.

The filter is that of `observer`: it knows the volume and finds depth, speed and neutral volume. The
piston is a stepper's, which goes to a commanded place at a constant rate and holds it by itself. So
the volume that the state feedback asks for is the command, no farther from where the piston is than
it goes in a sample: then the next sample finds it there. Within a dead zone it stays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from swimbladder.control.law import Law, Measurement
from swimbladder.control.observer import (
    Estimate,
    Observed,
    begin_estimate,
    estimate,
    limited,
    moves,
)

__all__ = [
    "POSITION_OBSERVER",
    "PositionObserverParameters",
    "PositionObserverState",
    "initial",
    "step",
]


class PositionObserverParameters(NamedTuple):
    """The model, the filter, the feedback and the piston's limits; see `observer`."""

    f_zz: float  # -
    f_zw: float  # s
    f_wz: float  # 1/s
    f_ww: float  # -
    g_z0: float  # m/m3
    g_z1: float  # m/m3
    g_w0: float  # m/s/m3
    g_w1: float  # m/s/m3
    turbulent: float  # 1/m
    l_z: float  # -
    l_w: float  # 1/s
    l_b: float  # m3/m
    neutral: float  # m3
    neutral_range: float  # m3
    psi: float  # m3/m
    k_z: float  # m3/m, volume per depth error
    k_w: float  # m3 s/m, volume per speed error
    dead: float  # m3, volume error below which the piston rests
    farthest: float  # m, a depth error beyond which no more volume is asked for
    rate: float  # m3/s, of the piston
    volume_min: float  # m3
    volume_max: float  # m3
    S_p: float  # s


class PositionObserverState(NamedTuple):
    """What the law remembers between samples."""

    depth: float  # m, estimated
    speed: float  # m/s, estimated
    neutral: float  # m3, estimated
    volume: float  # m3, measured at the sample before
    volume_reference: float  # m3, commanded at the sample before
    moving: float  # 1: the piston is on its way, 0: it rests


def initial(
    parameters: PositionObserverParameters, measurement: Measurement, reference: float
) -> PositionObserverState:
    """Start at rest with the volume as it is."""
    p = parameters
    depth = measurement.depth if math.isfinite(measurement.depth) else reference
    volume = measurement.volume if math.isfinite(measurement.volume) else p.neutral + p.psi * depth
    e = begin_estimate(p.neutral, p.neutral_range, p.psi, depth, volume)
    return PositionObserverState(e.depth, e.speed, e.neutral, volume, volume, 0.0)


def step(
    parameters: PositionObserverParameters,
    state: PositionObserverState,
    measurement: Measurement,
    reference: float,
) -> tuple[float, PositionObserverState, float]:
    """Return the volume to go to [m3]; where none is measured the piston is where it was sent."""
    p = parameters
    volume = measurement.volume if math.isfinite(measurement.volume) else state.volume_reference
    model = Observed(
        p.f_zz, p.f_zw, p.f_wz, p.f_ww, p.g_z0, p.g_z1, p.g_w0, p.g_w1, p.turbulent,
        p.l_z, p.l_w, p.l_b, p.neutral, p.neutral_range, p.psi,
    )  # fmt: skip
    e = estimate(
        model,
        Estimate(state.depth, state.speed, state.neutral),
        state.volume,
        volume,
        measurement.depth,
    )
    error = limited(reference - e.depth, -p.farthest, p.farthest)
    wanted = p.psi * (e.depth + error) + e.neutral - p.k_z * error + p.k_w * e.speed
    wanted = limited(wanted, p.volume_min, p.volume_max)
    moving = moves(wanted - volume, state.moving, p.dead)
    reach = p.rate * p.S_p
    command = volume + moving * limited(wanted - volume, -reach, reach)
    return (
        command,
        PositionObserverState(e.depth, e.speed, e.neutral, volume, command, moving),
        p.S_p,
    )


POSITION_OBSERVER = Law(
    name="position-observer",
    summary="the observer's state feedback, commanding the volume of a positioner",
    command="volume",
    parameters=PositionObserverParameters,
    state=PositionObserverState,
    units={
        "f_zz": "", "f_zw": "s", "f_wz": "1/s", "f_ww": "",
        "g_z0": "m/m3", "g_z1": "m/m3", "g_w0": "m/s/m3", "g_w1": "m/s/m3",
        "turbulent": "1/m", "l_z": "", "l_w": "1/s", "l_b": "m3/m",
        "neutral": "m3", "neutral_range": "m3", "psi": "m3/m",
        "k_z": "m3/m", "k_w": "m3 s/m", "dead": "m3", "farthest": "m", "rate": "m3/s",
        "volume_min": "m3", "volume_max": "m3", "S_p": "s",
    },
    step=step,
    initial=initial,
)  # fmt: skip
