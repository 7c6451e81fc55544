"""The law of Argo floats of the Arvor kind: check at set times, act where it went too little since.

It knows no model. While it rises the float checks every few minutes; has it come up by less than a
set depth since the last check, the pump runs once. While it sinks it checks less often; has it gone
down by less than a set depth, the valve opens once, for a set volume or, near the target, for one
in proportion to the way that is left. Within the tolerance of its target it does nothing, and
beyond it on the other side it goes back in the same way. Near the surface, where there may be ice,
it comes up slower. The numbers are those of a configuration by Argo's names::

    ascent_interval    CONFIG_PT24_PressureCheckPeriodDuringAscent, min
    ascent_progress    CONFIG_PT25_MinPressureDiffForPumpAction, dbar
    pump_volume        CONFIG_PT03_PumpMaxDurationDuringAscent, 0.01 s, times the pump's delivery
    descent_interval   CONFIG_PT26_PressureCheckPeriodDuringDescent, min
    descent_progress   CONFIG_PT27_MinPressureDiffForEVAction, dbar
    valve_volume       CONFIG_PT01_EVMaxVolumeDuringDescentAndRepositioning, cm3, nominal
    tolerance          CONFIG_PT05_PressureTargetToleranceForStabilization, dbar
    slow_depth         CONFIG_PG06_SlowDownPressure, dbar
    slow_progress      CONFIG_PG08_MinPressureDiffForPumpAction, dbar
    slow_share         CONFIG_PG09_PumpActionDuration over CONFIG_PT03

The steps in which the float reads its depth decide: of whole dbar, one that comes up by 9.7 dbar in
the interval reads 9 or 10, so that it waits, on the mean, until it is slower than the configuration
says. A valve is opened for seconds, for which the float takes its flow to grow in a line with the
pressure: in shallow water that is less than the volume it means.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control.law import Law, Measurement, Way
from swimbladder.control.rate import rounded


class ArgoParameters(NamedTuple):
    """Times, ways and volumes."""

    ascent_interval: Annotated[float, "s"]  # between two checks while it rises
    ascent_progress: Annotated[float, "m"]  # risen by less since the last check, the pump runs
    pump_volume: Annotated[float, "m3"]  # that a run of the pump adds at the surface
    pump_loss: Annotated[float, "m3/m"]  # of it per depth
    descent_interval: Annotated[float, "s"]  # between two checks else
    descent_progress: Annotated[float, "m"]  # gone by less since the last check, it acts
    valve_volume: Annotated[float, "m3"]  # that an opening of the valve lets in at most
    valve_depth: Annotated[float, "m"]  # where that is 0.7 of it, as little as it is above; 0: none
    gain: Annotated[float, "m3/m"]  # volume per way that is left, which is enough near the target
    tolerance: Annotated[float, "m"]  # of the band around the target in which it rests
    slow_depth: Annotated[float, "m"]  # above which it comes up slower
    slow_progress: Annotated[float, "m"]  # as ascent_progress, there
    slow_share: Annotated[float, ""]  # of a run of the pump, there
    depth_step: Annotated[float, "m"]  # whole numbers of which it sees; 0: all of the depth


class ArgoState(NamedTuple):
    """The last check."""

    checked: float  # -, 1: there was one on this way
    target: float  # m, of this way
    seen: float  # m, the depth as seen


def pumped(parameters: ArgoParameters, depth: float) -> float:
    """Return what a run of the pump adds at a depth [m3]."""
    return max(parameters.pump_volume - parameters.pump_loss * depth, 0.0)


def let_in(parameters: ArgoParameters, volume: float, depth: float) -> float:
    """Return what an opening for a volume [m3] lets in at a depth."""
    away = math.sqrt(depth * depth + parameters.valve_depth * parameters.valve_depth)
    return volume * depth / away if depth > 0.0 else 0.0


def initial(parameters: ArgoParameters, measurement: Measurement, reference: float) -> ArgoState:
    """Start on the way to a depth, without a check yet."""
    return ArgoState(0.0, reference, rounded(measurement.depth, parameters.depth_step))


def step(
    parameters: ArgoParameters, state: ArgoState, measurement: Measurement, reference: float
) -> tuple[float, ArgoState, float]:
    """Return the change of volume [m3], the state and the time to the next check [s].

    A reference of 0 or less is the surface: the first check on the way there is too little anyway.
    """
    p = parameters
    if not math.isfinite(measurement.depth):
        return 0.0, state, p.descent_interval
    depth = rounded(measurement.depth, p.depth_step)
    checked = state.checked > 0.0 and state.target == reference
    risen = state.seen - depth
    after = ArgoState(1.0, reference, depth)
    if reference <= 0.0:
        change, enough, share = 0.0, p.ascent_progress, 1.0
        if depth < p.slow_depth:
            enough, share = p.slow_progress, p.slow_share
        if not checked or risen < enough - 0.5 * p.depth_step:
            change = share * pumped(p, depth)
        return change, after, p.ascent_interval
    left = reference - depth
    change = 0.0
    if checked and left > p.tolerance and -risen < p.descent_progress - 0.5 * p.depth_step:
        change = -let_in(p, min(p.valve_volume, p.gain * left), depth)
    if checked and left < -p.tolerance and risen < p.descent_progress - 0.5 * p.depth_step:
        change = min(pumped(p, depth), -p.gain * left)
    return change, after, p.descent_interval


def ways(parameters: ArgoParameters) -> tuple[Way, ...]:
    """Return the slowest speeds that it is content with, down and up."""
    p = parameters
    down = p.descent_progress / p.descent_interval
    return Way("descent", down, 2.0 * p.tolerance), Way(
        "ascent", p.ascent_progress / p.ascent_interval, math.inf
    )


ARGO = Law(
    name="argo",
    summary="checks at set times, and pumps or bleeds once where it went too little since",
    command="volume change",
    parameters=ArgoParameters,
    state=ArgoState,
    step=step,
    initial=initial,
    band="tolerance",
    longest_wait=lambda p: max(p.ascent_interval, p.descent_interval),
    ways=ways,
    roundings=("depth_step",),
)
