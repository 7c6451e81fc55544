"""A Kalman filter that knows the volume and finds depth, speed and neutral volume.

The volume is measured, so depth and speed follow from it but for the neutral volume, which nobody
knows to the cubic centimetre: trim, trapped air, water of another density. Le Mezo et al. (IFAC
PapersOnLine 53, 2020, 9143) estimate it, and the compressibility, with an extended Kalman filter on
the profiling float of ENSTA; at one depth the two are one number, so here psi is a parameter and
the neutral volume at depth 0 is estimated. The filter's gains are those it settles to: they are
computed where the law is tuned, as is the transition over a sample, exact for a volume that is
straight between samples.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from swimbladder.control.law import Knobs, Measurement, Setting, stiffness


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


def feedback(s: Setting, k: Knobs) -> dict[str, float]:
    """Return what the laws with such a filter have in common, by name."""
    from swimbladder.control.motion import filter_gains, motion_over_sample

    p, h = s.plant, s.sample_time
    d, a = stiffness(p)
    bandwidth = k.sharpness * k.frequency
    jolt = bandwidth**2 * s.noise * math.sqrt(h)
    walk = k.learning * jolt * k.frequency / a
    F, G0, G1 = motion_over_sample(p, h)
    L = filter_gains(p, h, depth=s.noise, acceleration=jolt, neutral_walk=walk)
    return {
        "f_zz": F[0, 0], "f_zw": F[0, 1], "f_wz": F[1, 0], "f_ww": F[1, 1],
        "g_z0": G0[0], "g_z1": G1[0], "g_w0": G0[1], "g_w1": G1[1], "turbulent": h * p.d_t,
        "l_z": L[0], "l_w": L[1], "l_b": L[2],
        "neutral": p.V_0, "neutral_range": s.neutral_range, "psi": p.psi,
        "k_z": k.frequency**2 / a, "k_w": (2.0 * k.damping * k.frequency - d) / a,
        "k_V": k.inner / p.gain if p.gain > 0.0 else 0.0, "dead": k.dead,
        "depth_voltage": p.load_drive, "limit": k.volts * s.limit,
        "volume_min": p.V_min, "volume_max": p.V_max, "S_p": h,
    }  # fmt: skip


def jitter(parameters: Any, s: Setting) -> float:
    """What the noise makes of the volume asked for [m3], 1 sigma."""
    p, trust = parameters, parameters.model.trust
    return float(math.hypot(p.k_z * trust.l_z, p.k_w * trust.l_w) + trust.l_b) * s.noise
