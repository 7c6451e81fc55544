"""Gains of each law from a vehicle's numbers and a few knobs that a person can read.

The knobs are natural frequencies and dampings, not gains: they mean the same for every vehicle, and
a search over them is short. What the laws need beyond is computed here exactly: the motion over a
sample under a volume that is straight in it, and the gains to which the Kalman filter settles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.law import Law
from swimbladder.control.observer import OBSERVER, ObserverParameters
from swimbladder.control.planned import PLANNED, PlannedParameters
from swimbladder.dynamics import Plant, plant
from swimbladder.errors import InputError
from swimbladder.parameters import Vehicle
from swimbladder.parameters.schema import did_you_mean

__all__ = [
    "TUNABLE",
    "Knobs",
    "filter_gains",
    "gains",
    "motion_over_sample",
    "stiffness",
    "tunable",
]

Array = NDArray[np.float64]

_STROKE = 0.5  # of the stroke to the nearer end: what a path may take to accelerate
_CRUISE = 0.25  # the same to keep a speed
_THIRD = 0.4  # of the natural frequency: the cascade's third pole
_FINEST = 0.5e-3  # m, noise that a filter reckons with at least


class Knobs(NamedTuple):
    """What a law is tuned with.

    frequency [rad/s] and damping [-] of the depth under feedback; inner [1/s]: rate at which the
    volume follows; sharpness [-]: bandwidth of the filter over `frequency`; learning [-]: how fast
    the neutral volume is learnt, as a share of what the filter could; share [-]: of the motor's
    speed that a path takes; dead [m3]: volume error that the motor rests at.
    """

    frequency: float
    damping: float
    inner: float
    sharpness: float = 6.0
    learning: float = 0.01
    share: float = 0.8
    dead: float = 0.0


class Setting(NamedTuple):
    """The vehicle as the gains see it: nominal, with the least of the supply."""

    plant: Plant
    sample_time: float  # s
    noise: float  # m, of a measured depth, quantum included
    limit: float  # V, least supply
    neutral_range: float  # m3, how far the neutral volume may be from what is known


def stiffness(p: Plant) -> tuple[float, float]:
    """Return (drag [1/s], buoyancy [1/m2/s2]): w' = a (psi z - V) - d w about rest."""
    return (p.d_l if p.epsilon > 0.0 else p.d_b), p.a_b


def motion_over_sample(p: Plant, h: float) -> tuple[Array, Array, Array]:
    """Return F [2, 2], G0 [2] and G1 [2]: (z, w)+ = F (z, w) + G0 q0 + G1 q1.

    q0 and q1: volume less neutral volume at depth 0 at both ends of the sample of h [s], straight
    between them.
    """
    d, a = stiffness(p)
    A = np.zeros((4, 4))
    A[0, 1], A[1, 0], A[1, 1], A[1, 2], A[2, 3] = 1.0, a * p.psi, -d, -a, 1.0
    E = expm(A * h)
    return E[:2, :2], E[:2, 2] - E[:2, 3] / h, E[:2, 3] / h


def filter_gains(
    p: Plant, h: float, *, depth: float, acceleration: float, neutral_walk: float
) -> Array:
    """Return the settled Kalman gains [3] on depth, speed and neutral volume.

    depth [m]: noise of a sample; acceleration [m/s/s^0.5] and neutral_walk [m3/s^0.5]: intensities.
    """
    F, G0, G1 = motion_over_sample(p, h)
    A = np.eye(3)
    A[:2, :2], A[:2, 2] = F, -(G0 + G1)
    H = np.array([[1.0, 0.0, 0.0]])
    # In units in which the three are of one size: cubic centimetres, millimetres.
    unit = np.array([1e-3, 1e-3, 1e-6])
    Q = np.diag([0.0, acceleration**2 * h, neutral_walk**2 * h]) / np.outer(unit, unit)
    A_unit = A * np.outer(1.0 / unit, unit)
    R = np.array([[(depth / unit[0]) ** 2]])
    P = solve_discrete_are(A_unit.T, H.T, Q, R)
    L: Array = (P @ H.T / (H @ P @ H.T + R))[:, 0] * unit / unit[0]
    return L


def tunable(name: str) -> Law:
    """Return the law of that name; raises InputError where it is not one that is tuned."""
    if name not in TUNABLE:
        raise InputError(
            "this law is not tuned", field="--law", value=name,
            remedy=f"{did_you_mean(name, TUNABLE)}Choose from {', '.join(TUNABLE)}",
        )  # fmt: skip
    return TUNABLE[name][0]


def gains(name: str, setting: Setting, knobs: Knobs) -> Any:
    """Return the parameters of the law of that name."""
    return TUNABLE[name][1](setting, knobs)


def setting_of(
    vehicle: Vehicle, *, sample_time: float, supply: float, neutral_range: float
) -> Setting:
    """Return what the gains need of a vehicle; supply [V]: the least that it will have."""
    sensors = vehicle.sensors
    noise = math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
    if vehicle.identified is not None:
        noise = max(noise, vehicle.identified.depth_noise)
    return Setting(plant(vehicle), sample_time, max(noise, _FINEST), supply, neutral_range)


def _cascade(s: Setting, k: Knobs) -> CascadeParameters:
    """Poles of the depth at the natural frequency, and a third one for the integral."""
    d, a = stiffness(s.plant)
    w, zeta = k.frequency, k.damping
    third = _THIRD * w
    return CascadeParameters(
        k_pV=k.inner / s.plant.gain,
        k_pz=-(w * w + 2.0 * zeta * w * third + a * s.plant.psi) / a,
        k_iz=-w * w * third / a,
        k_dz=-(2.0 * zeta * w + third - d) / a,
        S_p=s.sample_time,
    )


def _feedback(s: Setting, k: Knobs) -> dict[str, float]:
    """Return what observer and planned have in common."""
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
        "k_V": k.inner / p.gain, "dead": k.dead, "depth_voltage": p.load_drive, "limit": s.limit,
        "volume_min": p.V_min, "volume_max": p.V_max, "S_p": h,
    }  # fmt: skip


def _room(p: Plant) -> float:
    """Return the volume from neutral at the surface to the nearer end of the stroke [m3]."""
    return min(p.V_max - p.V_0, p.V_0 - p.V_min)


def _observer(s: Setting, k: Knobs) -> ObserverParameters:
    found = _feedback(s, k)
    # A depth error that asks for half the room, by k_z.
    return ObserverParameters(**_floats(found), farthest=_STROKE * _room(s.plant) / found["k_z"])


def _planned(s: Setting, k: Knobs) -> PlannedParameters:
    p = s.plant
    d, a = stiffness(p)
    jerk = k.share * p.gain * s.limit * a
    room = _room(p)
    # Fast enough that neither accelerating nor keeping the speed takes the stroke.
    speed = (_STROKE * room * a) ** 2 / jerk
    force = _CRUISE * room * a
    steady = (
        2.0 * force / (d + math.sqrt(d * d + 4.0 * p.d_t * force)) if d + p.d_t > 0.0 else speed
    )
    return PlannedParameters(
        **_floats(_feedback(s, k)), inertia=1.0 / a, laminar=d, quadratic=p.d_t, share=k.share,
        speed=min(speed, steady), rate=1.0 / p.gain,
    )  # fmt: skip


def _floats(found: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(value) for name, value in found.items()}


TUNABLE: Mapping[str, tuple[Law, Callable[[Setting, Knobs], Any]]] = {
    "planned": (PLANNED, _planned),
    "observer": (OBSERVER, _observer),
    "cascade": (CASCADE, _cascade),
}
