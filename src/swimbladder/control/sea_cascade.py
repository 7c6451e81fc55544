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

from typing import NamedTuple

from swimbladder.control.law import Law, Measurement
from swimbladder.control.profile import Target, approach, depart

__all__ = [
    "SEA_CASCADE",
    "SeaCascadeGains",
    "SeaCascadeParameters",
    "SeaCascadeState",
    "initial",
    "sea_cascade_gains",
    "step",
]

_DEEPEST = 12000.0  # m, beyond it a depth is none
_LARGEST = 1000.0  # m3, beyond it a volume is none
_BROUGHT = 0.25  # share of the dead zone in which a volume counts as reached


class SeaCascadeGains(NamedTuple):
    """The cascade's own gains."""

    k_pV: float  # V/m3
    k_pz: float  # m3/m
    k_iz: float  # m3/s/m
    k_dz: float  # m3 s/m


class SeaCascadeParameters(NamedTuple):
    """The paper's gains and what the sea adds; an addition whose number is 0 is left out."""

    k_pV: float  # V/m3
    k_pz: float  # m3/m
    k_iz: float  # m3/s/m
    k_dz: float  # m3 s/m
    target_weight: float  # -, of the target's motion in the derivative; 1 as the paper has it
    smoothing: float  # -, weight of the newest difference in the derivative; 1: no smoothing
    leash: float  # m, largest error that counts
    fastest: float  # m/s, of the target
    jerk: float  # m/s3, of the target
    shortest: float  # s, that the target takes for any change
    volume_per_speed: float  # m3 s/m, 1/K2
    volume_per_acceleration: float  # m3 s2/m, T2/K2
    psi: float  # m3/m, neutral volume per depth
    depth_voltage: float  # V/m, k_z/k_u
    rate_per_volt: float  # m3/s/V, K1 A
    voltage_limit: float  # V
    volume_min: float  # m3
    volume_max: float  # m3
    dead_zone: float  # m3
    S_p: float  # s


class SeaCascadeState(NamedTuple):
    """What the law remembers between samples."""

    begun: float  # -, 1 once a depth and a volume have been seen
    integral: float  # m3
    difference: float  # m, weighted target less depth, when the depth was last seen
    slope: float  # m, change of the difference over a sample, smoothed
    missed: float  # -, samples since a depth was seen
    depth: float  # m, last one seen
    target: float  # m
    speed: float  # m/s, of the target
    acceleration: float  # m/s2, of the target
    left: float  # s, that the target is still on its way
    whole: float  # s, that this way takes in all; 0 for one that began in motion
    jerk: float  # m/s3, of its first quarter
    goal: float  # m, where it goes
    need: float  # m3, of volume that its motion took at the sample before
    moving: float  # -, 1 while the volume is brought out of the dead zone
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
    parameters: SeaCascadeParameters, measurement: Measurement, reference: float
) -> SeaCascadeState:
    """Start at rest: the integral holds the volume as it is, a target that moves starts here."""
    p = parameters
    seen = abs(measurement.depth) < _DEEPEST
    measured = abs(measurement.volume) < _LARGEST
    depth = measurement.depth if seen else 0.0
    volume = measurement.volume if measured else 0.0
    moves = p.fastest > 0.0 or p.jerk > 0.0 or p.shortest > 0.0
    target = depth if moves or abs(reference) >= _DEEPEST else reference
    begun = 1.0 if seen and measured else 0.0
    return SeaCascadeState(
        begun=begun,
        integral=volume - p.psi * depth,
        difference=p.target_weight * target - depth,
        slope=0.0,
        missed=0.0,
        depth=depth,
        target=target,
        speed=0.0,
        acceleration=0.0,
        left=p.shortest,
        whole=0.0,
        jerk=0.0,
        goal=target,
        need=0.0,
        moving=0.0,
        volume_reference=volume,
    )


def aim(parameters: SeaCascadeParameters, state: SeaCascadeState, wanted: float) -> Target:
    """Return the target of this sample, on its way to `wanted` [m]."""
    p = parameters
    if not (p.fastest > 0.0 or p.jerk > 0.0 or p.shortest > 0.0):
        return Target(wanted, 0.0, 0.0, p.shortest, 0.0, 0.0)
    now = Target(state.target, state.speed, state.acceleration, state.left, state.whole, state.jerk)
    if wanted == state.goal:
        return now
    return depart(now, wanted, p.fastest, p.jerk, p.shortest)


def step(
    parameters: SeaCascadeParameters,
    state: SeaCascadeState,
    measurement: Measurement,
    reference: float,
) -> tuple[float, SeaCascadeState, float]:
    """Return the voltage [V], eqs (36)-(37) about the target, within its limit."""
    p = parameters
    before = state
    if state.begun == 0.0:
        before = initial(p, measurement, reference)
    begun = before.begun > 0.0
    wanted = reference if begun and abs(reference) < _DEEPEST else before.goal
    target = aim(p, before, wanted)
    later = approach(target, wanted, p.shortest, p.S_p)
    need = p.volume_per_speed * target.speed + p.volume_per_acceleration * target.acceleration
    need_later = p.volume_per_speed * later.speed + p.volume_per_acceleration * later.acceleration

    depth = before.depth
    difference = before.difference
    slope = before.slope
    missed = before.missed + 1.0
    error = 0.0
    U = before.volume_reference + before.need - need
    if begun and abs(measurement.depth) < _DEEPEST:
        depth = measurement.depth
        difference = p.target_weight * target.depth - depth
        newest = (difference - before.difference) / missed
        slope = p.smoothing * newest + (1.0 - p.smoothing) * slope
        missed = 0.0
        error = target.depth - depth
        if p.leash > 0.0:
            error = min(max(error, -p.leash), p.leash)
        U = p.k_pz * error + p.k_dz * slope / p.S_p + before.integral
        U = U + (p.psi * depth - need)

    within = min(max(U, p.volume_min), p.volume_max)
    voltage = p.depth_voltage * depth
    moving = 0.0
    if abs(measurement.volume) < _LARGEST:
        gap = within - measurement.volume
        if abs(gap) >= p.dead_zone * (_BROUGHT if before.moving > 0.0 else 1.0):
            moving = 1.0
            voltage = p.k_pV * gap + voltage
            if p.rate_per_volt > 0.0:
                voltage = voltage + (need - need_later) / (p.S_p * p.rate_per_volt)
    limited = min(max(voltage, -p.voltage_limit), p.voltage_limit)

    change = p.k_iz * p.S_p * error
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
        target=later.depth,
        speed=later.speed,
        acceleration=later.acceleration,
        left=later.left,
        whole=later.whole,
        jerk=later.jerk,
        goal=wanted,
        need=need,
        moving=moving,
        volume_reference=U,
    )
    return limited, after, p.S_p


SEA_CASCADE = Law(
    name="sea-cascade",
    summary="the cascade with smooth set-points, feed-forward, anti-windup and a dead zone",
    command="voltage",
    parameters=SeaCascadeParameters,
    state=SeaCascadeState,
    units={
        "k_pV": "V/m3",
        "k_pz": "m3/m",
        "k_iz": "m3/s/m",
        "k_dz": "m3 s/m",
        "target_weight": "",
        "smoothing": "",
        "leash": "m",
        "fastest": "m/s",
        "jerk": "m/s3",
        "shortest": "s",
        "volume_per_speed": "m3 s/m",
        "volume_per_acceleration": "m3 s2/m",
        "psi": "m3/m",
        "depth_voltage": "V/m",
        "rate_per_volt": "m3/s/V",
        "voltage_limit": "V",
        "volume_min": "m3",
        "volume_max": "m3",
        "dead_zone": "m3",
        "S_p": "s",
    },
    step=step,
    initial=initial,
)
