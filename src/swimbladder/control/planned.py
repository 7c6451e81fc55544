"""A near time-optimal law: a path that the actuator can follow, and feedback that keeps to it.

What limits a step of depth is how fast the volume changes: the depth's third derivative. The path
is that of the least time for a bound on this jerk, by the feedback law of the triple integrator
(Athans and Falb, Optimal Control, 1966, chapter 7), integrated in fine steps, so that the set-point
may change at any moment; a bound on its speed rests on the double integrator's. Depth is a flat
output of eqs (13)-(15): the volume that the path takes follows from its derivatives without a
differential equation being solved,

    V = psi z + b - T2/K2 (z'' + z'/T2 + k_dt/m |z'| z').

The jerk is planned a little below what the supply allows, so that feedback on the observer's
estimates has room.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control import law, observer
from swimbladder.control.law import SMOOTH, Friction, friction_voltage, from_leaves
from swimbladder.control.observer import Estimate, begin_estimate, estimate, limited, moves
from swimbladder.control.profile import BEHIND, estimate_effectiveness, own_drive, usable

FINE = 32  # steps of the path in a sample

_SINGLE = 4e-7  # of the target, that single precision does not resolve


class Path(NamedTuple):
    """A point of the path."""

    depth: float  # m
    speed: float  # m/s
    acceleration: float  # m/s2


class PlannedParameters(NamedTuple):
    """The observer's model and filter, the feedback, the path's bounds, the actuator's limits."""

    model: observer.Observed
    inertia: Annotated[float, "m2 s2"]  # T2/K2 = m/(rho g): volume per acceleration
    laminar: Annotated[float, "1/s"]  # 1/T2
    quadratic: Annotated[float, "1/m"]  # k_dt/m
    share: Annotated[float, ""]  # of the volume's rate at the deeper end that the path takes
    speed: Annotated[float, "m/s"]  # bound of the path
    k_z: Annotated[float, "m3/m"]  # volume per depth error
    k_w: Annotated[float, "m3 s/m"]  # volume per speed error
    k_V: Annotated[float, "V/m3"]  # voltage per volume error
    dead: Annotated[float, "m3"]  # volume error at which the motor rests at the end
    rate: Annotated[float, "V s/m3"]  # voltage per rate of volume, 1/(K1 A)
    depth_voltage: Annotated[float, "V/m"]  # k_z/k_u
    limit: Annotated[float, "V"]
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]
    balanced: Friction = SMOOTH


class PlannedState(NamedTuple):
    """What the law remembers between samples."""

    estimate: Estimate
    path_depth: float  # m, where the path is at the sample to come
    path_speed: float  # m/s
    path_acceleration: float  # m/s2
    volume_reference: float  # m3, asked for at the sample before
    moving: float  # 1: the motor is on its way, 0: it rests
    drive: float  # V, beyond the load of the sea, at the sample before
    driven: float  # V, at the one before that
    effectiveness: float  # -, share of its rate that the motor was seen to have


def _turn(x: float) -> float:
    """Return 1, 0 or -1."""
    if x > 0.0:
        return 1.0
    if x < 0.0:
        return -1.0
    return 0.0


def along(path: Path, target: float, jerk: float, speed: float, time: float) -> Path:
    """Return where the path is `time` [s] later, on its way to rest at `target` [m].

    jerk [m/s3], speed [m/s]: its bounds.
    """
    h = time / FINE
    z, w, a = path.depth - target, path.speed, path.acceleration
    for _ in range(FINE):
        # In units in which the jerk is 1.
        x1, x2, x3 = z / jerk, w / jerk, a / jerk
        side = _turn(x2 + 0.5 * x3 * abs(x3))
        reach = max(side * x2 + 0.5 * x3 * x3, 0.0)
        push = -_turn(x1 + x3 * x3 * x3 / 3.0 + side * x2 * x3 + side * reach * math.sqrt(reach))
        top = speed / jerk
        push = min(push, -_turn(x2 - top + 0.5 * x3 * abs(x3)))
        push = max(push, -_turn(x2 + top + 0.5 * x3 * abs(x3)))
        near = (
            abs(x3) <= 3.0 * h
            and abs(x2) <= 60.0 * h * h
            and abs(x1) <= 600.0 * h * h * h + _SINGLE * abs(target) / jerk
        )
        if near:
            z, w, a = 0.0, 0.0, 0.0
        else:
            j = push * jerk
            z = z + h * (w + 0.5 * h * (a + h * j / 3.0))
            w = w + h * (a + 0.5 * h * j)
            a = a + h * j
    return Path(target + z, w, a)


def initial(
    parameters: PlannedParameters, measurement: law.Measurement, reference: float
) -> PlannedState:
    """Start at rest with the volume as it is, the path where the vehicle is."""
    p = parameters
    e = begin_estimate(p.model, measurement, reference)
    return PlannedState(e, e.depth, 0.0, 0.0, e.volume, 0.0, 0.0, 0.0, 1.0)


def _volume(p: PlannedParameters, path: Path, neutral: float) -> float:
    drag = p.laminar * path.speed + p.quadratic * path.speed * abs(path.speed)
    return p.model.psi * path.depth + neutral - p.inertia * (path.acceleration + drag)


def _where(p: PlannedParameters, e: Estimate, volume: float) -> Path:
    """Return the path's state that is the vehicle's: one that cannot follow begins anew there."""
    drag = p.laminar * e.speed + p.quadratic * e.speed * abs(e.speed)
    return Path(e.depth, e.speed, (p.model.psi * e.depth + e.neutral - volume) / p.inertia - drag)


def _jerk(p: PlannedParameters, here: float, target: float) -> float:
    """Return the jerk [m/s3] that the supply allows against the sea at the deeper end.

    Near the depth at which the motor stalls a twentieth of the supply is left to plan with.
    """
    spare = p.limit - p.balanced.friction - p.depth_voltage * max(max(here, target), 0.0)
    return p.share * max(spare, 0.05 * p.limit) / (p.rate * p.inertia)


def step(
    parameters: PlannedParameters,
    state: PlannedState,
    measurement: law.Measurement,
    reference: float,
) -> tuple[float, PlannedState, float]:
    """Return the voltage [V] that takes the volume along the path's, with feedback to the path."""
    p = parameters
    volume = measurement.volume if math.isfinite(measurement.volume) else state.estimate.volume
    e = estimate(p.model, p.model.trust, state.estimate, volume, measurement.depth)
    here = Path(state.path_depth, state.path_speed, state.path_acceleration)
    target = reference if math.isfinite(reference) else state.path_depth
    if abs(state.volume_reference - volume) > BEHIND * p.S_p * p.limit / p.rate:
        here = _where(p, e, volume)
    effectiveness, drive = state.effectiveness, state.drive
    if math.isfinite(measurement.volume):
        moved = (volume - state.estimate.volume) / p.S_p * p.rate
        drive = own_drive(drive, moved)
        effectiveness = estimate_effectiveness(effectiveness, drive, state.driven, moved, p.limit)
    jerk = usable(effectiveness) * _jerk(p, here.depth, target)
    there = along(here, target, jerk, p.speed, p.S_p)
    planned = _volume(p, here, e.neutral)
    rate = (_volume(p, there, e.neutral) - planned) / p.S_p
    wanted = planned + p.k_z * (e.depth - here.depth) + p.k_w * (e.speed - here.speed)
    wanted = limited(wanted, p.volume_min, p.volume_max)
    under_way = abs(there.speed) > 0.0 or abs(here.speed) > 0.0
    moving = 1.0 if under_way else moves(wanted - volume, state.moving, p.dead)
    driven = moving * (p.k_V * (wanted - volume) + p.rate * rate)
    load = p.depth_voltage * e.depth
    load = load + friction_voltage(driven, p.balanced, e.depth)
    voltage = limited(load + driven, -p.limit, p.limit)
    return (
        voltage,
        PlannedState(
            e,
            there.depth,
            there.speed,
            there.acceleration,
            wanted,
            moving,
            voltage - load,
            drive,
            effectiveness,
        ),
        p.S_p,
    )


def _gains(s: law.Setting, k: law.TuningParameters) -> PlannedParameters:
    p = s.plant
    d, a = law.stiffness(p)
    own = {
        "inertia": 1.0 / a,
        "laminar": d,
        "quadratic": p.d_t,
        "share": k.share,
        "speed": law.fastest_speed(p, law.jerk_of(s, k)),
        "rate": 1.0 / p.gain,
    }
    return from_leaves(PlannedParameters, observer.feedback(s, k) | own)


PLANNED = law.Law(
    name="planned",
    summary="near time-optimal: a path of bounded jerk, followed with state feedback",
    command="voltage",
    parameters=PlannedParameters,
    state=PlannedState,
    step=step,
    initial=initial,
    volume_gain="k_V",
    dead_zone="dead",
    roundings=Friction._fields,
    recipe=law.Recipe(
        gains=_gains, fast=law.FAST, quiet=law.QUIET, shares=(0.85, 0.75), jitter=observer.jitter
    ),
)
