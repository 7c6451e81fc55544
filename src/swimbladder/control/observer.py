"""State feedback on an observer that knows the volume and finds depth, speed and neutral volume.

The volume is measured, so depth and speed follow from it but for the neutral volume, which nobody
knows to the cubic centimetre: trim, trapped air, water of another density. Le Mezo et al. (IFAC
PapersOnLine 53, 2020, 9143) estimate it, and the compressibility, with an extended Kalman filter on
the profiling float of ENSTA; at one depth the two are one number, so here psi is a parameter and
the neutral volume at depth 0 is estimated. The filter's gains are those it settles to: they are
computed where the law is tuned, as is the transition over a sample, exact for a volume that is
straight between samples.

Inside, the volume follows the one that the state feedback asks for, with the voltage that the load
of the sea takes fed forward, eq. (30).

Near the set-point the motor may rest: the volume stays and the filter goes on, with gains of its
own, until the depth predicted for a time ahead leaves a band; then one move brings the volume to
where gains made for holds of that length want it. Deciding by events takes fewer of them than by
the clock (Astrom and Bernhardsson, IEEE CDC 2002, 2011).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from swimbladder.control.law import Law, Measurement

__all__ = [
    "OBSERVER",
    "Estimate",
    "Observed",
    "ObserverParameters",
    "ObserverState",
    "begin_estimate",
    "estimate",
    "initial",
    "limited",
    "moves",
    "step",
]


class Observed(NamedTuple):
    """The model over a sample and the filter's gains.

    With q = V - b the volume against neutral at depth 0, at the sample before (q0) and now (q1):
    z+ = f_zz z + f_zw w + g_z0 q0 + g_z1 q1, w+ = f_wz z + f_ww w + g_w0 q0 + g_w1 q1, and
    turbulent drag on top.
    """

    f_zz: float  # -
    f_zw: float  # s
    f_wz: float  # 1/s
    f_ww: float  # -
    g_z0: float  # m/m3
    g_z1: float  # m/m3
    g_w0: float  # m/s/m3
    g_w1: float  # m/s/m3
    turbulent: float  # 1/m, S_p k_dt/m
    l_z: float  # -, gains on the depth's innovation
    l_w: float  # 1/s
    l_b: float  # m3/m
    neutral: float  # m3, neutral volume at depth 0 as it is known before
    neutral_range: float  # m3, farthest that the estimate goes from there
    psi: float  # m3/m


class ObserverParameters(NamedTuple):
    """The model, the filter, the feedback and the actuator's limits."""

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
    k_V: float  # V/m3, voltage per volume error
    dead: float  # m3, volume error below which the motor rests
    near: float  # m, depth error within which the motor rests; 0: none
    pause: float  # s, least time between two of its starts there
    band: float  # m, predicted error that starts it
    a_z: float  # -, prediction per depth error
    a_w: float  # s, per speed
    a_V: float  # m/m3, per volume off neutral
    r_z: float  # m3/m, as k_z, for a volume that is held
    r_w: float  # m3 s/m, as k_w, likewise
    n_z: float  # -, the filter's gains near the set-point, as l_z
    n_w: float  # 1/s
    n_b: float  # m3/m
    farthest: float  # m, a depth error beyond which no more volume is asked for
    depth_voltage: float  # V/m, load of the sea
    limit: float  # V
    volume_min: float  # m3
    volume_max: float  # m3
    S_p: float  # s


class Estimate(NamedTuple):
    """What the filter thinks of a moment."""

    depth: float  # m
    speed: float  # m/s
    neutral: float  # m3


class ObserverState(NamedTuple):
    """What the law remembers between samples."""

    depth: float  # m, estimated
    speed: float  # m/s, estimated
    neutral: float  # m3, estimated
    volume: float  # m3, measured at the sample before
    volume_reference: float  # m3, asked for at the sample before
    moving: float  # 1: the motor is on its way, 0: it rests
    rested: float  # s, since the motor was started near the set-point, no more than a pause


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


def begin_estimate(
    neutral: float, neutral_range: float, psi: float, depth: float, volume: float
) -> Estimate:
    """Return the estimate to begin with: at rest, neutral where it is if that can be."""
    held = volume - psi * depth
    if abs(held - neutral) <= neutral_range:
        return Estimate(depth, 0.0, held)
    return Estimate(depth, 0.0, neutral)


def estimate(
    p: Observed, before: Estimate, volume_before: float, volume: float, depth: float
) -> Estimate:
    """Return the estimate after a sample: predicted along the volume, corrected by the depth.

    A depth that is no number corrects nothing.
    """
    q0 = volume_before - before.neutral
    q1 = volume - before.neutral
    z = p.f_zz * before.depth + p.f_zw * before.speed + p.g_z0 * q0 + p.g_z1 * q1
    w = p.f_wz * before.depth + p.f_ww * before.speed + p.g_w0 * q0 + p.g_w1 * q1
    w = w - p.turbulent * before.speed * abs(before.speed)
    b = before.neutral
    if math.isfinite(depth):
        innovation = depth - z
        z = z + p.l_z * innovation
        w = w + p.l_w * innovation
        b = b + p.l_b * innovation
    b = limited(b, p.neutral - p.neutral_range, p.neutral + p.neutral_range)
    return Estimate(z, w, b)


def initial(
    parameters: ObserverParameters, measurement: Measurement, reference: float
) -> ObserverState:
    """Start at rest with the volume as it is."""
    p = parameters
    depth = measurement.depth if math.isfinite(measurement.depth) else reference
    volume = measurement.volume if math.isfinite(measurement.volume) else p.neutral + p.psi * depth
    e = begin_estimate(p.neutral, p.neutral_range, p.psi, depth, volume)
    return ObserverState(e.depth, e.speed, e.neutral, volume, volume, 0.0, p.pause)


def step(
    parameters: ObserverParameters,
    state: ObserverState,
    measurement: Measurement,
    reference: float,
) -> tuple[float, ObserverState, float]:
    """Return the voltage [V] that brings the volume to what the estimated state asks for."""
    p = parameters
    volume = measurement.volume if math.isfinite(measurement.volume) else state.volume
    close = abs(reference - state.depth) < p.near
    model = Observed(
        p.f_zz, p.f_zw, p.f_wz, p.f_ww, p.g_z0, p.g_z1, p.g_w0, p.g_w1, p.turbulent,
        p.n_z if close else p.l_z, p.n_w if close else p.l_w, p.n_b if close else p.l_b,
        p.neutral, p.neutral_range, p.psi,
    )  # fmt: skip
    e = estimate(
        model,
        Estimate(state.depth, state.speed, state.neutral),
        state.volume,
        volume,
        measurement.depth,
    )
    # Volume: neutral there, less what sinks the vehicle towards the reference.
    error = limited(reference - e.depth, -p.farthest, p.farthest)
    resting = abs(error) < p.near
    k_z = p.r_z if resting else p.k_z
    k_w = p.r_w if resting else p.k_w
    wanted = p.psi * (e.depth + error) + e.neutral - k_z * error + k_w * e.speed
    wanted = limited(wanted, p.volume_min, p.volume_max)
    rested = p.pause
    if resting:
        rested = min(state.rested + p.S_p, p.pause)
        off = volume - p.psi * (e.depth + error) - e.neutral
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
    voltage = p.depth_voltage * e.depth + moving * p.k_V * (wanted - volume)
    return (
        limited(voltage, -p.limit, p.limit),
        ObserverState(e.depth, e.speed, e.neutral, volume, wanted, moving, rested),
        p.S_p,
    )


OBSERVER = Law(
    name="observer",
    summary="state feedback on estimates of depth, speed and neutral volume (Le Mezo et al. 2020)",
    command="voltage",
    parameters=ObserverParameters,
    state=ObserverState,
    units={
        "f_zz": "", "f_zw": "s", "f_wz": "1/s", "f_ww": "",
        "g_z0": "m/m3", "g_z1": "m/m3", "g_w0": "m/s/m3", "g_w1": "m/s/m3",
        "turbulent": "1/m", "l_z": "", "l_w": "1/s", "l_b": "m3/m",
        "neutral": "m3", "neutral_range": "m3", "psi": "m3/m",
        "k_z": "m3/m", "k_w": "m3 s/m", "k_V": "V/m3", "dead": "m3",
        "near": "m", "pause": "s", "band": "m", "a_z": "", "a_w": "s", "a_V": "m/m3",
        "r_z": "m3/m", "r_w": "m3 s/m", "n_z": "", "n_w": "1/s", "n_b": "m3/m", "farthest": "m",
        "depth_voltage": "V/m", "limit": "V", "volume_min": "m3", "volume_max": "m3", "S_p": "s",
    },
    step=step,
    initial=initial,
)  # fmt: skip
