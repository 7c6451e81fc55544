"""A PID on depth that commands the position of a piston, as stepper-driven floats run it.

Three habits set it apart from the textbook's: the integral takes the error only while it is small
(conditional integration) and stays within the travel; the derivative acts on the measured depth,
smoothed by an exponential moving average, not on the error; the command is a position within
limits. The piston's position counts inward: further in displaces less and the vehicle sinks.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control.law import Law, Measurement


class PositionPidParameters(NamedTuple):
    """Gains, limits and the way from a position to a volume; S_p is the sample time."""

    K_p: Annotated[float, "m/m"]  # position per depth
    K_i: Annotated[float, "m/s/m"]
    K_d: Annotated[float, "m s/m"]
    threshold: Annotated[float, "m"]  # the integral holds while |error| is this or more
    smoothing: Annotated[float, ""]  # weight of the newest depth in the average; 1: no smoothing
    position_min: Annotated[float, "m"]  # inward
    position_max: Annotated[float, "m"]  # inward
    piston_area: Annotated[float, "m2"]
    volume_at_zero: Annotated[float, "m3"]  # with the piston at position 0
    S_p: Annotated[float, "s"]


class PositionPidState(NamedTuple):
    """What the law remembers between samples."""

    integral: float  # m, of position
    depth: float  # m, smoothed
    volume_reference: float  # m3, commanded at the sample before


def initial(
    parameters: PositionPidParameters, measurement: Measurement, reference: float
) -> PositionPidState:
    """Start with the integral at the piston's position and the average at the measured depth.

    A piston that starts at 0, as the firmware has it, starts the integral at 0.
    """
    p = parameters
    position = (p.volume_at_zero - measurement.volume) / p.piston_area
    depth = measurement.depth if math.isfinite(measurement.depth) else reference
    return PositionPidState(
        min(max(position, p.position_min), p.position_max), depth, measurement.volume
    )


def step(
    parameters: PositionPidParameters,
    state: PositionPidState,
    measurement: Measurement,
    reference: float,
) -> tuple[float, PositionPidState, float]:
    """Return the volume to go to [m3]: less while the vehicle is above the reference."""
    p = parameters
    # A depth that is no number is taken to be the smoothed one: it would stay in the average.
    seen = measurement.depth if math.isfinite(measurement.depth) else state.depth
    error = reference - seen
    depth = p.smoothing * seen + (1.0 - p.smoothing) * state.depth
    integral = state.integral
    if abs(error) < p.threshold:
        integral = min(max(integral + p.K_i * p.S_p * error, p.position_min), p.position_max)
    position = p.K_p * error + integral - p.K_d * (depth - state.depth) / p.S_p
    position = min(max(position, p.position_min), p.position_max)
    volume = p.volume_at_zero - p.piston_area * position
    return volume, PositionPidState(integral, depth, volume), p.S_p


POSITION_PID = Law(
    name="position-pid",
    summary="PID on depth with conditional integration and a smoothed derivative, for a positioner",
    command="volume",
    parameters=PositionPidParameters,
    state=PositionPidState,
    step=step,
    initial=initial,
)
