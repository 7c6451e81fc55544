"""Active disturbance rejection: whatever accelerates the vehicle beyond its model is estimated.

Han (IEEE Trans. Industrial Electronics 56, 2009, 900) writes the motion as d2z/dt2 = f - b V with
one known number b = k_b/m and a total disturbance f [m/s2]: drag, compressibility, trim, currents
and all that the model lacks. An extended state observer finds depth, speed and f; the volume
cancels f and leaves a double integrator, which two gains place. Gao (Proc. American Control
Conference 2003, 4989) makes the gains functions of two bandwidths; Miklosovic, Radke and Gao (ACC
2006, 2949) sample the observer: predicted exactly for a held input, corrected by the newest sample.
Where more is known than Han takes for granted it is used: laminar drag and the neutral volume,
d2z/dt2 = f - b (V - psi z) - d dz/dt, and that the rest changes slowly, so that the third pole of
the observer may be slower than the other two.

The observer is fed the volume that was really reached: the measured one, its mean over the sample.
So neither the limit of the voltage nor the stroke winds it up. A volume that is missing is
predicted from the voltage as limited; a depth that is missing corrects nothing. Han's transient
profile is that of `profile`, whose jerk the motor can follow.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from swimbladder.control import law
from swimbladder.control.law import SMOOTH, Friction, friction_voltage
from swimbladder.control.observer import limited
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
_QUICKEST = 20.0  # m/s, beyond it no speed is believed


class AdrcGains(NamedTuple):
    """Gains of the feedback and of the observer."""

    k_p: Annotated[float, "1/s2"]
    k_d: Annotated[float, "1/s"]
    l_z: Annotated[float, ""]
    l_w: Annotated[float, "1/s"]
    l_f: Annotated[float, "1/s2"]


class AdrcParameters(NamedTuple):
    """One number of the vehicle, gains, limits; see `adrc_gains`."""

    b: Annotated[float, "1/m2/s2"]  # acceleration per volume, K2/T2
    drag: Annotated[float, "1/s"]  # deceleration per speed, 1/T2; 0: part of the disturbance
    psi: Annotated[float, "m3/m"]  # neutral volume per depth; 0: part of the disturbance
    gains: AdrcGains
    k_pV: Annotated[float, "V/m3"]
    leash: Annotated[float, "m"]  # largest error that counts; 0: any
    fastest: Annotated[float, "m/s"]  # of the target; 0: no limit
    jerk: Annotated[float, "m/s3"]  # of the target; 0: no limit
    shortest: Annotated[float, "s"]  # that the target takes for any change
    depth_voltage: Annotated[float, "V/m"]  # k_z/k_u
    rate_per_volt: Annotated[float, "m3/s/V"]  # K1 A
    voltage_limit: Annotated[float, "V"]
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]
    balanced: Friction = SMOOTH


class AdrcState(NamedTuple):
    """What the law remembers between samples."""

    begun: float  # -, 1 once a depth and a volume have been seen
    depth: float  # m, estimated
    speed: float  # m/s, estimated
    disturbance: float  # m/s2, estimated f
    missed: float  # -, 1 where the depth of the sample before was missing
    volume: float  # m3, of the sample before
    voltage: float  # V, of the sample before, as limited, less what friction took
    path: Target  # where the target is on its way
    goal: float  # m, where it goes
    driven: float  # V, beyond the load of the sea, at the sample before the last
    effectiveness: float  # -, share of its rate that the motor was seen to have
    volume_reference: float  # m3


class Observed(NamedTuple):
    """What the observer says."""

    depth: float  # m
    speed: float  # m/s
    disturbance: float  # m/s2


def adrc_gains(
    bandwidth: float,
    observer_bandwidth: float,
    S_p: float,
    disturbance_bandwidth: float | None = None,
) -> AdrcGains:
    """Return the gains that place the controller's two poles together, and the observer's three.

    Bandwidths [rad/s], S_p [s]; Gao 2003, Miklosovic et al. 2006. disturbance_bandwidth: of the
    observer's third pole, where it is not to be at the other two. Without drag the poles of the
    observer are exact.
    """
    quick = math.exp(-observer_bandwidth * S_p)
    slow = quick if disturbance_bandwidth is None else math.exp(-disturbance_bandwidth * S_p)
    l_z = 1.0 - quick**2 * slow
    turn = (1.0 - quick) ** 2 * (1.0 - slow)
    return AdrcGains(
        k_p=bandwidth**2,
        k_d=2.0 * bandwidth,
        l_z=l_z,
        l_w=(3.0 - l_z - 0.5 * turn - 2.0 * quick - slow) / S_p,
        l_f=turn / S_p**2,
    )


def initial(
    parameters: AdrcParameters, measurement: law.Measurement, reference: float
) -> AdrcState:
    """Start at rest: the disturbance is what the volume balances."""
    p = parameters
    seen = abs(measurement.depth) < _DEEPEST
    measured = abs(measurement.volume) < _LARGEST
    depth = measurement.depth if seen else 0.0
    volume = measurement.volume if measured else 0.0
    target = depth if moves(p) or abs(reference) >= _DEEPEST else reference
    begun = 1.0 if seen and measured else 0.0
    return AdrcState(
        begun=begun,
        depth=depth,
        speed=0.0,
        disturbance=p.b * (volume - p.psi * depth),
        missed=0.0,
        volume=volume,
        voltage=p.depth_voltage * depth,
        path=Target(target, 0.0, 0.0, p.shortest, 0.0, 0.0),
        goal=target,
        driven=0.0,
        effectiveness=1.0,
        volume_reference=volume,
    )


def observe(p: AdrcParameters, before: AdrcState, volume: float, depth: float) -> Observed:
    """Return the estimates after a sample with the volume going straight to `volume` [m3].

    The estimates stay where a vehicle can be: f no further than the stroke balances.
    """
    heavy = p.psi * before.depth - 0.5 * (before.volume + volume)
    a = before.disturbance + p.b * heavy - p.drag * before.speed
    z = before.depth + p.S_p * (before.speed + 0.5 * p.S_p * a)
    w = before.speed + p.S_p * a
    f = before.disturbance
    if abs(depth) < _DEEPEST:
        if before.missed > 0.0:
            z = depth
        else:
            e = depth - z
            z = z + p.gains.l_z * e
            w = w + p.gains.l_w * e
            f = f + p.gains.l_f * e
    return Observed(
        limited(z, -_DEEPEST, _DEEPEST),
        limited(w, -_QUICKEST, _QUICKEST),
        limited(f, p.b * p.volume_min, p.b * p.volume_max),
    )


def step(
    parameters: AdrcParameters, state: AdrcState, measurement: law.Measurement, reference: float
) -> tuple[float, AdrcState, float]:
    """Return the voltage [V] towards the volume (f - a)/b, a the acceleration that is wanted."""
    p = parameters
    started = state.begun > 0.0
    before = state
    if not started:
        before = initial(p, measurement, reference)
    volume = before.volume
    seen = Observed(before.depth, before.speed, before.disturbance)
    if started:
        rate = p.rate_per_volt * (before.voltage - p.depth_voltage * before.depth)
        volume = limited(before.volume + p.S_p * rate, p.volume_min, p.volume_max)
        if abs(measurement.volume) < _LARGEST:
            volume = measurement.volume
        seen = observe(p, before, volume, measurement.depth)
    missed = 0.0 if abs(measurement.depth) < _DEEPEST else 1.0
    drive = before.voltage - p.depth_voltage * before.depth
    effectiveness = before.effectiveness
    known = p.rate_per_volt > 0.0 and started and abs(measurement.volume) < _LARGEST
    lost = known and is_behind(p, before.volume_reference, volume)
    if known:
        moved = (volume - before.volume) / (p.S_p * p.rate_per_volt)
        drive = own_drive(drive, moved)
        effectiveness = estimate_effectiveness(
            before.effectiveness, drive, before.driven, moved, p.voltage_limit
        )

    begun = before.begun > 0.0
    wanted = reference if begun and abs(reference) < _DEEPEST else before.goal
    target = Target(wanted, 0.0, 0.0, p.shortest, 0.0, 0.0)
    if moves(p):
        target = before.path
        if lost:
            heavy = seen.disturbance + p.b * (p.psi * seen.depth - volume) - p.drag * seen.speed
            target = Target(seen.depth, seen.speed, heavy, 0.0, 0.0, 0.0)
        if wanted != before.goal or lost:
            target = aim(p, target, wanted, seen.depth, effectiveness, p.drag / p.b, 1.0 / p.b)
    later = approach(target, wanted, p.shortest, p.S_p)

    error = target.target - seen.depth
    if p.leash > 0.0:
        error = limited(error, -p.leash, p.leash)
    a = (
        target.target_acceleration
        + p.gains.k_p * error
        + p.gains.k_d * (target.target_speed - seen.speed)
    )
    a = a + p.drag * seen.speed
    U = p.psi * seen.depth + (seen.disturbance - a) / p.b
    U = limited(U, p.volume_min, p.volume_max)
    voltage = p.k_pV * (U - volume) + p.depth_voltage * seen.depth
    if p.rate_per_volt > 0.0:
        voltage = voltage + (target.target_acceleration - later.target_acceleration) / (
            p.b * p.S_p * p.rate_per_volt
        )
    drive = voltage - p.depth_voltage * seen.depth
    friction = friction_voltage(drive, p.balanced, seen.depth)
    voltage = limited(voltage + friction, -p.voltage_limit, p.voltage_limit)
    after = AdrcState(
        begun=before.begun,
        depth=seen.depth,
        speed=seen.speed,
        disturbance=seen.disturbance,
        missed=missed,
        volume=volume,
        voltage=voltage - friction,
        path=later,
        goal=wanted,
        driven=drive,
        effectiveness=effectiveness,
        volume_reference=U,
    )
    return voltage, after, p.S_p


def _gains(s: law.Setting, k: law.TuningParameters) -> AdrcParameters:
    p, w = s.plant, k.frequency
    d, a = law.stiffness(p)
    own = adrc_gains(w, k.sharpness * w, s.sample_time, k.learning * w)
    return AdrcParameters(
        gains=own,
        **law.target_numbers(s, k),
        b=a,
        drag=d,
        k_pV=k.inner / p.gain,
        balanced=law.friction_of(p),
    )


ADRC = law.Law(
    name="adrc",
    summary="active disturbance rejection on depth, a gain on volume inside (Han 2009, Gao 2003)",
    command="voltage",
    roundings=Friction._fields,
    parameters=AdrcParameters,
    state=AdrcState,
    step=step,
    initial=initial,
    volume_gain="k_pV",
    recipe=law.Recipe(
        gains=_gains,
        shares=(0.85, 0.75),
        fast=law.Grid(
            (0.4, 0.5), (0.08, 0.1, 0.12, 0.14, 0.16), (1.0,), (4.0, 6.0, 8.0), (0.1, 0.25, 0.4)
        ),
        quiet=law.Grid((0.4,), (0.03, 0.04, 0.05, 0.06, 0.08), (1.0,), (4.0, 6.0), (0.1, 0.25)),
    ),
)
