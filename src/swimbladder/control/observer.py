"""State feedback on an observer that knows the volume and finds depth, speed and neutral volume.

Inside, the volume follows the one that the state feedback asks for, with the voltage that the load
of the sea takes fed forward, eq. (30). `estimate` and what belongs to it serve other laws as well.

Near the set-point the motor may rest: the volume stays and the filter goes on, with gains of its
own, until the depth predicted for a time ahead leaves a band; then one move brings the volume to
where gains made for holds of that length want it. Deciding by events takes fewer of them than by
the clock (Astrom and Bernhardsson, IEEE CDC 2002, 2011).

The observer is a Kalman filter. The volume is measured, so depth and speed follow from it but for
the neutral volume, which nobody knows to the cubic centimetre: trim, trapped air, water of another
density. Le Mezo et al. (IFAC PapersOnLine 53, 2020, 9143) estimate it, and the compressibility,
with an extended Kalman filter on the profiling float of ENSTA; at one depth the two are one number,
so here psi is a parameter and the neutral volume at depth 0 is estimated. The filter's gains are
those it settles to: they are computed where the law is tuned, as is the transition over a sample,
exact for a volume that is straight between samples.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from swimbladder.control import law
from swimbladder.control.law import (
    SMOOTH,
    Friction,
    Measurement,
    friction_voltage,
    from_leaves,
    leaf_names,
)


class Trust(NamedTuple):
    """Gains on the innovation, the depth that is measured beyond the predicted one."""

    l_z: Annotated[float, ""]
    l_w: Annotated[float, "1/s"]
    l_b: Annotated[float, "m3/m"]


class Resting(NamedTuple):
    """The same gains while nothing moves, near the set-point."""

    n_z: Annotated[float, ""]
    n_w: Annotated[float, "1/s"]
    n_b: Annotated[float, "m3/m"]


class Observed(NamedTuple):
    """The model over a sample, the filter's gains and what is known before.

    With q = V - b the volume against neutral at depth 0, at the sample before (q0) and now (q1):
    z+ = f_zz z + f_zw w + g_z0 q0 + g_z1 q1, w+ = f_wz z + f_ww w + g_w0 q0 + g_w1 q1, and
    turbulent drag on top.
    """

    f_zz: Annotated[float, ""]
    f_zw: Annotated[float, "s"]
    f_wz: Annotated[float, "1/s"]
    f_ww: Annotated[float, ""]
    g_z0: Annotated[float, "m/m3"]
    g_z1: Annotated[float, "m/m3"]
    g_w0: Annotated[float, "m/s/m3"]
    g_w1: Annotated[float, "m/s/m3"]
    turbulent: Annotated[float, "1/m"]  # S_p k_dt/m
    trust: Trust
    neutral: Annotated[float, "m3"]  # neutral volume at depth 0 as it is known before
    neutral_range: Annotated[float, "m3"]  # farthest that the estimate goes from there
    psi: Annotated[float, "m3/m"]


class Estimate(NamedTuple):
    """What the filter thinks of a sample."""

    depth: float  # m
    speed: float  # m/s
    neutral: float  # m3
    volume: float  # m3, as measured


def limited(x: float, least: float, most: float) -> float:
    """Return x within its limits."""
    return min(max(x, least), most)


def moves(gap: float, moving: float, dead: float) -> float:
    """Return 1 where the motor is to close a gap of volume [m3], else 0.

    It starts beyond the dead zone and stops at a quarter of it, so that noise does not start it.
    """
    if abs(gap) > dead or (moving > 0.0 and abs(gap) > 0.25 * dead):
        return 1.0
    return 0.0


def trusted(moving: Trust, resting: Resting, close: bool) -> Trust:
    """Return the gains near the set-point, `close`, or elsewhere."""
    if close:
        return Trust(resting.n_z, resting.n_w, resting.n_b)
    return moving


def begin_estimate(p: Observed, measurement: Measurement, reference: float) -> Estimate:
    """Return the estimate to begin with: at rest, neutral where it is if that can be."""
    depth = measurement.depth if math.isfinite(measurement.depth) else reference
    volume = measurement.volume if math.isfinite(measurement.volume) else p.neutral + p.psi * depth
    held = volume - p.psi * depth
    if abs(held - p.neutral) <= p.neutral_range:
        return Estimate(depth, 0.0, held, volume)
    return Estimate(depth, 0.0, p.neutral, volume)


def estimate(p: Observed, trust: Trust, before: Estimate, volume: float, depth: float) -> Estimate:
    """Return the estimate after a sample: predicted along the volume, corrected by the depth.

    A depth that is no number corrects nothing.
    """
    q0 = before.volume - before.neutral
    q1 = volume - before.neutral
    z = p.f_zz * before.depth + p.f_zw * before.speed + p.g_z0 * q0 + p.g_z1 * q1
    w = p.f_wz * before.depth + p.f_ww * before.speed + p.g_w0 * q0 + p.g_w1 * q1
    w = w - p.turbulent * before.speed * abs(before.speed)
    b = before.neutral
    if math.isfinite(depth):
        innovation = depth - z
        z = z + trust.l_z * innovation
        w = w + trust.l_w * innovation
        b = b + trust.l_b * innovation
    b = limited(b, p.neutral - p.neutral_range, p.neutral + p.neutral_range)
    return Estimate(z, w, b, volume)


def feedback(s: law.Setting, k: law.TuningParameters) -> dict[str, float]:
    """Return what the laws with such a filter have in common, by name."""
    from swimbladder.control.motion import filter_gains, motion_over_sample

    p, h = s.plant, s.sample_time
    d, a = law.stiffness(p)
    bandwidth = k.sharpness * k.frequency
    acceleration = bandwidth**2 * s.noise * math.sqrt(h)
    drift = k.learning * acceleration * k.frequency / a
    F, G0, G1 = motion_over_sample(p, h)
    L = filter_gains(p, h, depth=s.noise, acceleration=acceleration, random_walk=drift)
    k_z = k.frequency**2 / a
    return {
        "f_zz": F[0, 0],
        "f_zw": F[0, 1],
        "f_wz": F[1, 0],
        "f_ww": F[1, 1],
        "g_z0": G0[0],
        "g_z1": G1[0],
        "g_w0": G0[1],
        "g_w1": G1[1],
        "turbulent": h * p.d_t,
        "l_z": L[0],
        "l_w": L[1],
        "l_b": L[2],
        "neutral": p.V_0,
        "neutral_range": s.neutral_range,
        "psi": p.psi,
        "k_z": k_z,
        "k_w": (2.0 * k.damping * k.frequency - d) / a,
        "k_V": k.inner / p.gain if p.gain > 0.0 else 0.0,
        "dead": k.dead,
        "depth_voltage": p.load_drive,
        "limit": k.volts * s.limit,
        "volume_min": p.V_min,
        "volume_max": p.V_max,
        "S_p": h,
        **law.friction_of(p)._asdict(),
        "farthest": law.STROKE * law.room_of(p) / k_z,  # it asks for half the room, by k_z
    }


def resting_gains(s: law.Setting, band: float, ahead: float) -> dict[str, float]:
    """Return what the laws that rest near the set-point have in common, by name.

    band [m]: of predicted errors that are left alone; ahead [s]: how far ahead they are predicted.
    """
    from swimbladder.control.motion import filter_gains, held_motion

    F, G = held_motion(s.plant, ahead)
    # While nothing moves, the random walk of the neutral volume is all that has to be followed.
    N = filter_gains(
        s.plant, s.sample_time, depth=s.noise, acceleration=0.0, random_walk=s.random_walk
    )
    predicted = {"band": band, "a_z": F[0, 0], "a_w": F[0, 1], "a_V": G[0]}
    return predicted | {"n_z": N[0], "n_w": N[1], "n_b": N[2]}


def jitter(parameters: Any, s: law.Setting) -> float:
    """What the noise makes of the volume asked for [m3], 1 sigma."""
    p, trust = parameters, parameters.model.trust
    return float(math.hypot(p.k_z * trust.l_z, p.k_w * trust.l_w) + trust.l_b) * s.noise


_NEAR = 2.5  # times the band of predicted errors: depth errors in which the motor rests
_REST = 0.2  # of the time that a volume is held for: least time between two starts


class ObserverParameters(NamedTuple):
    """The model, the filter, the feedback and the actuator's limits."""

    model: Observed
    k_z: Annotated[float, "m3/m"]  # volume per depth error
    k_w: Annotated[float, "m3 s/m"]  # volume per speed error
    k_V: Annotated[float, "V/m3"]  # voltage per volume error
    dead: Annotated[float, "m3"]  # volume error below which the motor rests
    near: Annotated[float, "m"]  # depth error within which the motor rests; 0: none
    pause: Annotated[float, "s"]  # least time between two of its starts there
    band: Annotated[float, "m"]  # predicted error that starts it
    a_z: Annotated[float, ""]  # prediction per depth error
    a_w: Annotated[float, "s"]  # per speed
    a_V: Annotated[float, "m/m3"]  # per volume off neutral
    r_z: Annotated[float, "m3/m"]  # as k_z, for a volume that is held
    r_w: Annotated[float, "m3 s/m"]  # as k_w, likewise
    resting: Resting
    farthest: Annotated[float, "m"]  # a depth error beyond which no more volume is asked for
    depth_voltage: Annotated[float, "V/m"]  # load of the sea
    limit: Annotated[float, "V"]
    volume_min: Annotated[float, "m3"]
    volume_max: Annotated[float, "m3"]
    S_p: Annotated[float, "s"]
    balanced: Friction = SMOOTH


class ObserverState(NamedTuple):
    """What the law remembers between samples."""

    estimate: Estimate
    volume_reference: float  # m3, asked for at the sample before
    moving: float  # 1: the motor is on its way, 0: it rests
    rested: float  # s, since the motor was started near the set-point, no more than a pause


def initial(
    parameters: ObserverParameters, measurement: Measurement, reference: float
) -> ObserverState:
    """Start at rest with the volume as it is."""
    p = parameters
    e = begin_estimate(p.model, measurement, reference)
    return ObserverState(e, e.volume, 0.0, p.pause)


def step(
    parameters: ObserverParameters, state: ObserverState, measurement: Measurement, reference: float
) -> tuple[float, ObserverState, float]:
    """Return the voltage [V] that brings the volume to what the estimated state asks for."""
    p = parameters
    volume = measurement.volume if math.isfinite(measurement.volume) else state.estimate.volume
    close = abs(reference - state.estimate.depth) < p.near
    trust = trusted(p.model.trust, p.resting, close)
    e = estimate(p.model, trust, state.estimate, volume, measurement.depth)
    # Volume: neutral there, less what sinks the vehicle towards the reference.
    error = limited(reference - e.depth, -p.farthest, p.farthest)
    resting = abs(error) < p.near
    k_z = p.r_z if resting else p.k_z
    k_w = p.r_w if resting else p.k_w
    wanted = p.model.psi * (e.depth + error) + e.neutral - k_z * error + k_w * e.speed
    wanted = limited(wanted, p.volume_min, p.volume_max)
    rested = p.pause
    if resting:
        rested = min(state.rested + p.S_p, p.pause)
        off = volume - p.model.psi * (e.depth + error) - e.neutral
        ahead = p.a_w * e.speed + p.a_V * off - p.a_z * error
        begins = state.moving == 0.0 and rested >= p.pause and abs(ahead) > p.band
        if not begins:
            wanted = state.volume_reference
        moving = moves(wanted - volume, state.moving, p.dead)
        if begins:
            rested = 0.0
        elif state.moving == 0.0:
            moving = 0.0
    else:
        moving = moves(wanted - volume, state.moving, p.dead)
    drive = moving * p.k_V * (wanted - volume)
    drive = drive + friction_voltage(drive, p.balanced, e.depth)
    voltage = p.depth_voltage * e.depth + drive
    return (limited(voltage, -p.limit, p.limit), ObserverState(e, wanted, moving, rested), p.S_p)


def _gains(s: law.Setting, k: law.TuningParameters) -> ObserverParameters:
    found = feedback(s, k)
    rest = dict.fromkeys(set(leaf_names(ObserverParameters)) - set(found), 0.0)
    if k.pause > 0.0:
        from swimbladder.control.motion import hold_gains

        r_z, r_w = hold_gains(s.plant, k.pause)
        rest = {"near": _NEAR * k.band, "pause": _REST * k.pause, "r_z": r_z, "r_w": r_w}
        rest |= resting_gains(s, k.band, k.pause)
    return from_leaves(ObserverParameters, found | rest)


OBSERVER = law.Law(
    name="observer",
    summary="state feedback on estimates of depth, speed and neutral volume (Le Mezo et al. 2020)",
    command="voltage",
    parameters=ObserverParameters,
    state=ObserverState,
    step=step,
    initial=initial,
    volume_gain="k_V",
    dead_zone="dead",
    near="near",
    band="band",
    roundings=Friction._fields,
    recipe=law.Recipe(
        gains=_gains,
        fast=law.FAST,
        quiet=law.QUIET,
        holds=(0.8, 1.0, 1.2),
        holds_best=True,
        bands=(2.2, 2.35, 2.5, 2.65, 2.8, 2.95, 3.1, 3.4, 3.8),
        example=law.TuningParameters(0.35, 0.9, 1.2, dead=1e-7, pause=6.0, band=0.02),
    ),
)
