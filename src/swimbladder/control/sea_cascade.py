"""The paper's cascade made fit for sea: a PID on depth outside, a gain on volume inside.

The loop is that of Fig. 15 and eqs (36)-(37); with every addition left out it is `cascade` to the
last bit. Added are, after Astrom and Hagglund (Advanced PID Control, ISA 2006, chs 3 and 5):

- the reference moves as the motor can follow (see `profile`), and the volume that this motion needs
  is fed forward, so that a new set-point makes no error, no jump and nothing to integrate;
- the derivative is smoothed, and acts on the measured depth where `target_weight` is 0;
- the integral stands still while the voltage or the stroke is at a limit that it would push further
  into (conditional integration), and stays within the stroke;
- the neutral volume psi z and the voltage c z that the sea's load takes are fed forward;
- within a dead zone the motor rests; out of it the volume is brought all the way.

While the depth is missing the volume does no more than what the target's motion needs; while the
volume is missing the motor holds against the sea.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control import law
from swimbladder.control.law import SMOOTH, Friction, friction_voltage
from swimbladder.control.profile import (
    Target,
    aim,
    approach,
    estimate_effectiveness,
    is_behind,
    moves,
    own_drive,
)

_DEEPEST = 12000.0  # m, beyond it a depth is none
_LARGEST = 1000.0  # m3, beyond it a volume is none
_BROUGHT = 0.25  # share of the dead zone in which a volume counts as reached


class SeaCascadeGains(NamedTuple):
    """The cascade's own gains."""

    k_pV: Annotated[float, "V/m3"]
    k_pz: Annotated[float, "m3/m"]
    k_iz: Annotated[float, "m3/s/m"]
    k_dz: Annotated[float, "m3 s/m"]


class SeaCascadeParameters(NamedTuple):
    """The paper's gains and what the sea adds; an addition whose number is 0 is left out."""

    gains: SeaCascadeGains
    target_weight: Annotated[float, ""]  # of the target's motion in the derivative; the paper: 1
    smoothing: Annotated[float, ""]  # weight of the newest difference; 1: no smoothing
    leash: Annotated[float, "m"]  # largest error that counts
    fastest: Annotated[float, "m/s"]  # of the target
    jerk: Annotated[float, "m/s3"]  # of the target
    shortest: Annotated[float, "s"]  # that the target takes for any change
    volume_per_speed: Annotated[float, "m3 s/m"]  # 1/K2
    volume_per_acceleration: Annotated[float, "m3 s2/m"]  # T2/K2
    psi: Annotated[float, "m3/m"]  # neutral volume per depth
    depth_voltage: Annotated[float, "V/m"]  # k_z/k_u
    rate_per_volt: Annotated[float, "m3/s/V"]  # K1 A
    voltage_limit: Annotated[float, "V"]
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    dead_zone: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]
    balanced: Friction = SMOOTH


class SeaCascadeState(NamedTuple):
    """What the law remembers between samples."""

    begun: float  # -, 1 once a depth and a volume have been seen
    integral: float  # m3
    difference: float  # m, weighted target less depth, when the depth was last seen
    slope: float  # m, change of the difference over a sample, smoothed
    missed: float  # -, samples since a depth was seen
    depth: float  # m, last one seen
    path: Target  # where the target is on its way
    goal: float  # m, where it goes
    need: float  # m3, of volume that its motion took at the sample before
    moving: float  # -, 1 while the volume is brought out of the dead zone
    volume: float  # m3, last one seen
    drive: float  # V, beyond the load of the sea, at the sample before
    driven: float  # V, at the one before that
    effectiveness: float  # -, share of its rate that the motor was seen to have
    volume_reference: float  # m3


def sea_cascade_gains(
    b: float, drag: float, rate_per_volt: float, bandwidth: float, S_p: float
) -> SeaCascadeGains:
    """Return gains whose loop on depth crosses 1 near `bandwidth` [rad/s].

    b: acceleration per volume, K2/T2 [1/m2/s2]; drag: deceleration per speed, 1/T2 [1/s];
    rate_per_volt: K1 A [m3/s/V]; S_p [s]. The volume goes half of its way in a sample; the zeros of
    the PID lie at 0.28 and 0.05 of the bandwidth, which leaves phase for the motor's lag.
    """
    k_pz = -(bandwidth**2) / (3.0 * b)
    return SeaCascadeGains(
        k_pV=0.5 / (rate_per_volt * S_p),
        k_pz=k_pz,
        k_iz=k_pz * bandwidth / 24.0,
        k_dz=(drag - bandwidth) / b,
    )


def initial(
    parameters: SeaCascadeParameters, measurement: law.Measurement, reference: float
) -> SeaCascadeState:
    """Start at rest: the integral holds the volume as it is, a target that moves starts here."""
    p = parameters
    seen = abs(measurement.depth) < _DEEPEST
    measured = abs(measurement.volume) < _LARGEST
    depth = measurement.depth if seen else 0.0
    volume = measurement.volume if measured else 0.0
    begun = 1.0 if seen and measured else 0.0
    target = depth if moves(p) or abs(reference) >= _DEEPEST else reference
    return SeaCascadeState(
        begun=begun,
        integral=volume - p.psi * depth,
        difference=p.target_weight * target - depth,
        slope=0.0,
        missed=0.0,
        depth=depth,
        path=Target(target, 0.0, 0.0, p.shortest, 0.0, 0.0),
        goal=target,
        need=0.0,
        moving=0.0,
        volume=volume,
        drive=0.0,
        driven=0.0,
        effectiveness=1.0,
        volume_reference=volume,
    )


def vehicle_as_target(
    p: SeaCascadeParameters, state: SeaCascadeState, volume: float, depth: float
) -> Target:
    """Return the target that the vehicle itself is, with the speed of the smoothed difference."""
    speed = p.target_weight * state.path.target_speed - state.slope / p.S_p
    acceleration = 0.0
    if p.volume_per_acceleration > 0.0:
        heavy = state.integral + p.psi * depth - volume - p.volume_per_speed * speed
        acceleration = heavy / p.volume_per_acceleration
    return Target(depth, speed, acceleration, 0.0, 0.0, 0.0)


def step(
    parameters: SeaCascadeParameters,
    state: SeaCascadeState,
    measurement: law.Measurement,
    reference: float,
) -> tuple[float, SeaCascadeState, float]:
    """Return the voltage [V], eqs (36)-(37) about the target, within its limit."""
    p = parameters
    before = state
    if state.begun == 0.0:
        before = initial(p, measurement, reference)
    begun = before.begun > 0.0
    wanted = reference if begun and abs(reference) < _DEEPEST else before.goal
    volume = before.volume
    effectiveness, drive = before.effectiveness, before.drive
    measured = abs(measurement.volume) < _LARGEST
    if measured:
        if p.rate_per_volt > 0.0:
            moved = (measurement.volume - before.volume) / (p.S_p * p.rate_per_volt)
            drive = own_drive(drive, moved)
            effectiveness = estimate_effectiveness(
                effectiveness, drive, before.driven, moved, p.voltage_limit
            )
        volume = measurement.volume
    target = Target(wanted, 0.0, 0.0, p.shortest, 0.0, 0.0)
    behind = begun and measured and abs(measurement.depth) < _DEEPEST
    asked = min(max(before.volume_reference, p.volume_min), p.volume_max)
    behind = behind and is_behind(p, asked, volume)
    if behind:
        target = vehicle_as_target(p, before, volume, measurement.depth)
    elif moves(p):
        target = before.path
    if behind or (moves(p) and wanted != before.goal):
        damping, inertia = p.volume_per_speed, p.volume_per_acceleration
        target = aim(p, target, wanted, before.depth, effectiveness, damping, inertia)
    later = approach(target, wanted, p.shortest, p.S_p)
    need = (
        p.volume_per_speed * target.target_speed
        + p.volume_per_acceleration * target.target_acceleration
    )
    need_later = (
        p.volume_per_speed * later.target_speed
        + p.volume_per_acceleration * later.target_acceleration
    )

    depth = before.depth
    difference = before.difference
    slope = before.slope
    missed = before.missed + 1.0
    error = 0.0
    U = before.volume_reference + before.need - need
    if begun and abs(measurement.depth) < _DEEPEST:
        depth = measurement.depth
        difference = p.target_weight * target.target - depth
        newest = (difference - before.difference) / missed
        slope = p.smoothing * newest + (1.0 - p.smoothing) * slope
        if behind:  # the target has jumped, the vehicle has not
            slope = (p.target_weight - 1.0) * target.target_speed * p.S_p
        missed = 0.0
        error = target.target - depth
        if p.leash > 0.0:
            error = min(max(error, -p.leash), p.leash)
        U = p.gains.k_pz * error + p.gains.k_dz / p.S_p * slope + before.integral
        U = U + (p.psi * depth - need)

    within = min(max(U, p.volume_min), p.volume_max)
    load = p.depth_voltage * depth
    voltage = load
    moving = 0.0
    if measured:
        gap = within - measurement.volume
        if abs(gap) >= p.dead_zone * (_BROUGHT if before.moving > 0.0 else 1.0):
            moving = 1.0
            voltage = p.gains.k_pV * gap + voltage
            if p.rate_per_volt > 0.0:
                voltage = voltage + (need - need_later) / (p.S_p * p.rate_per_volt)
    friction = friction_voltage(voltage - load, p.balanced, depth)
    voltage = voltage + friction
    limited = min(max(voltage, -p.voltage_limit), p.voltage_limit)

    change = p.gains.k_iz * p.S_p * error
    over = max(voltage - p.voltage_limit, U - p.volume_max) > 0.0
    under = min(voltage + p.voltage_limit, U - p.volume_min) < 0.0
    integral = before.integral
    if not ((over and change > 0.0) or (under and change < 0.0)):
        integral = min(max(integral + change, p.volume_min), p.volume_max)
    after = SeaCascadeState(
        begun=before.begun,
        integral=integral,
        difference=difference,
        slope=slope,
        missed=missed,
        depth=depth,
        path=later,
        goal=wanted,
        need=need,
        moving=moving,
        volume=volume,
        drive=limited - load - friction,
        driven=drive,
        effectiveness=effectiveness,
        volume_reference=U,
    )
    return limited, after, p.S_p


def _gains(s: law.Setting, k: law.TuningParameters) -> SeaCascadeParameters:
    p, h = s.plant, s.sample_time
    d, a = law.stiffness(p)
    own = sea_cascade_gains(a, d, p.gain, k.frequency, h)._replace(k_pV=k.inner / p.gain)
    return SeaCascadeParameters(
        gains=own,
        **law.target_numbers(s, k),
        target_weight=1.0,
        smoothing=1.0 - math.exp(-k.sharpness * k.frequency * h),
        volume_per_speed=d / a,
        volume_per_acceleration=1.0 / a,
        dead_zone=k.dead,
        balanced=law.friction_of(p),
    )


def _jitter(p: SeaCascadeParameters, s: law.Setting) -> float:
    """What the noise makes of the volume asked for [m3], 1 sigma."""
    return math.hypot(p.gains.k_pz, p.gains.k_dz * p.smoothing / p.S_p) * s.noise


SEA_CASCADE = law.Law(
    name="sea-cascade",
    summary="the cascade with smooth set-points, feed-forward, anti-windup and a dead zone",
    command="voltage",
    parameters=SeaCascadeParameters,
    state=SeaCascadeState,
    step=step,
    initial=initial,
    volume_gain="k_pV",
    dead_zone="dead_zone",
    roundings=Friction._fields,
    recipe=law.Recipe(
        gains=_gains,
        shares=(0.85, 0.75),
        jitter=_jitter,
        fast=law.Grid((0.4, 0.5), (0.13, 0.16, 0.19, 0.21, 0.23), (1.0,), (4.0, 6.5, 10.0)),
        quiet=law.Grid((0.4,), (0.05, 0.06, 0.075, 0.09, 0.12), (1.0,), (2.0, 3.0, 5.0)),
    ),
)
