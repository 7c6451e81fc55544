"""Gains of each law from a vehicle's numbers and a few knobs that a person can read.

The knobs are natural frequencies and dampings, not gains: they mean the same for every vehicle, and
a search over them is short. What the laws need beyond is computed here exactly: the motion over a
sample under a volume that is straight in it, and the gains to which the Kalman filter settles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

from swimbladder.control.adrc import ADRC, AdrcParameters, adrc_gains
from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.deadband import DEADBAND, DeadbandParameters, deadband_gains
from swimbladder.control.law import Law
from swimbladder.control.observer import OBSERVER, ObserverParameters
from swimbladder.control.planned import PLANNED, PlannedParameters
from swimbladder.control.position_observer import (
    POSITION_OBSERVER,
    PositionObserverParameters,
)
from swimbladder.control.pulse import PULSE, PulseParameters
from swimbladder.control.records import from_leaves
from swimbladder.control.sea_cascade import SEA_CASCADE, SeaCascadeParameters, sea_cascade_gains
from swimbladder.design.tuning.knobs import Knobs, Setting, setting_of
from swimbladder.design.tuning.motion import (
    filter_gains,
    held_motion,
    hold_gains,
    motion_over_sample,
    pulse_gains,
    stiffness,
)
from swimbladder.errors import InputError
from swimbladder.physics.dynamics import Plant
from swimbladder.vehicle.schema import did_you_mean

__all__ = ["TUNABLE", "Knobs", "Recipe", "Setting", "gains", "setting_of", "tunable"]

_STROKE = 0.5  # of the stroke to the nearer end: what a path may take to accelerate
_CRUISE = 0.25  # the same to keep a speed
_THIRD = 0.4  # of the natural frequency: the cascade's third pole
_NEAR = 2.5  # times the band of predicted errors: depth errors in which the motor rests
_REST = 0.2  # of the time that a volume is held for: least time between two starts
_PULSES = 8.0  # the same of pulses, at least
_WRONG = 0.1  # of how far a neutral volume may be from what is known: it mostly is nearer
_LEARNT = 0.2  # of what a sample shows of the motor, that a law believes
_SMALL = 1e-4  # of the stroke: noise of the volume makes that slower where it is more
_AHEAD = 0.2  # of the time that a pulse is for: how far ahead an error is predicted
_SHORTEST = 10.0  # samples, of a target's way
_FADING = 0.25  # of an error, that deadband leaves in an interval
_STEP = 10.0  # times the noise: what a change of the neutral volume moves in an interval


Kind = TypeVar("Kind")


def tunable(name: str) -> Law:
    """Return the law of that name; raises InputError where it is not one that is tuned."""
    if name not in TUNABLE:
        raise InputError(
            "this law is not tuned", field="--law", value=name,
            remedy=f"{did_you_mean(name, TUNABLE)}Choose from {', '.join(TUNABLE)}",
        )  # fmt: skip
    return TUNABLE[name].law


def gains(name: str, setting: Setting, knobs: Knobs) -> Any:
    """Return the parameters of the law of that name."""
    return TUNABLE[name].make(setting, knobs)


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
        "k_V": k.inner / p.gain if p.gain > 0.0 else 0.0, "dead": k.dead,
        "depth_voltage": p.load_drive, "limit": k.volts * s.limit,
        "volume_min": p.V_min, "volume_max": p.V_max, "S_p": h,
    }  # fmt: skip


def _room(p: Plant) -> float:
    """Return the volume from neutral at the surface to the nearer end of the stroke [m3]."""
    return min(p.V_max - p.V_0, p.V_0 - p.V_min)


def _observer(s: Setting, k: Knobs) -> ObserverParameters:
    found = _feedback(s, k)
    names = "near", "pause", "band", "a_z", "a_w", "a_V", "r_z", "r_w", "n_z", "n_w", "n_b"
    rest = dict.fromkeys(names, 0.0)
    if k.pause > 0.0:
        F, G = held_motion(s.plant, k.pause)
        r_z, r_w = hold_gains(s.plant, k.pause)
        # While nothing moves, the walk of the neutral volume is all that has to be followed.
        N = filter_gains(
            s.plant, s.sample_time, depth=s.noise, acceleration=0.0, neutral_walk=s.walk
        )
        rest = {
            "near": _NEAR * k.band, "pause": _REST * k.pause, "band": k.band,
            "a_z": float(F[0, 0]), "a_w": float(F[0, 1]), "a_V": float(G[0]), "r_z": r_z,
            "r_w": r_w, "n_z": float(N[0]), "n_w": float(N[1]), "n_b": float(N[2]),
        }  # fmt: skip
    # A depth error that asks for half the room, by k_z.
    rest["farthest"] = _STROKE * _room(s.plant) / found["k_z"]
    return _record(ObserverParameters, found | rest)


def _pulse(s: Setting, k: Knobs) -> PulseParameters:
    """A pulse is as large as the band: out and back at one rate, its area the speed it gives."""
    p, h = s.plant, s.sample_time
    found = _feedback(s, k)
    names = "near", "band", "a_z", "a_w", "a_V", "homing", "p_z", "rate", "swing", "learn"
    rest = {**dict.fromkeys(names, 0.0), "n_z": found["l_z"], "n_w": found["l_w"]}
    rest |= {"n_b": found["l_b"], "acceleration": stiffness(p)[1]}
    if k.pause > 0.0:
        F, G = held_motion(p, _AHEAD * k.pause)
        w, p_z = pulse_gains(p, k.pause)
        N = filter_gains(p, h, depth=s.noise, acceleration=0.0, neutral_walk=s.walk)
        small = _SMALL * (p.V_max - p.V_min) / s.least_move
        rate = 4.0 * -w * k.band / (stiffness(p)[1] * (k.pulse * k.pause) ** 2)
        rest |= {
            # The feedback leaves the error of a neutral volume that is wrong to them.
            "near": max(_PULSES * k.band, _WRONG * s.neutral_range / found["k_z"]),
            "band": k.band, "a_z": F[0, 0], "a_w": F[0, 1],
            "a_V": G[0], "homing": -w, "p_z": p_z, "rate": rate, "swing": rate / p.gain,
            "learn": _LEARNT * small, "n_z": N[0], "n_w": N[1], "n_b": N[2],
        }  # fmt: skip
    rest["farthest"] = _STROKE * _room(p) / found["k_z"]
    return _record(PulseParameters, found | rest)


def _position_observer(s: Setting, k: Knobs) -> PositionObserverParameters:
    found = _feedback(s, k)
    own = {"rate": s.plant.rate, "farthest": _STROKE * _room(s.plant) / found["k_z"]}
    return _record(PositionObserverParameters, found | own)


def _jerk(s: Setting, k: Knobs) -> float:
    """Return the jerk [m/s3] that a share of the motor's speed gives."""
    return k.share * s.plant.gain * s.limit * k.volts * stiffness(s.plant)[1]


def _fastest(p: Plant, jerk: float) -> float:
    """Return a speed [m/s] for which neither accelerating nor keeping it takes the stroke."""
    d, a = stiffness(p)
    room = _room(p)
    force = _CRUISE * room * a
    speed = (_STROKE * room * a) ** 2 / jerk
    if d + p.d_t <= 0.0:
        return speed
    return min(speed, 2.0 * force / (d + math.sqrt(d * d + 4.0 * p.d_t * force)))


def _planned(s: Setting, k: Knobs) -> PlannedParameters:
    p = s.plant
    d, a = stiffness(p)
    own = {
        "inertia": 1.0 / a, "laminar": d, "quadratic": p.d_t, "share": k.share,
        "speed": _fastest(p, _jerk(s, k)), "rate": 1.0 / p.gain,
    }  # fmt: skip
    return _record(PlannedParameters, _feedback(s, k) | own)


def _target(s: Setting, k: Knobs) -> dict[str, float]:
    """Return what sea-cascade and adrc have in common: how the target moves, and the limits."""
    p, jerk = s.plant, _jerk(s, k)
    return {
        "leash": 0.0, "fastest": _fastest(p, jerk), "jerk": jerk,
        "shortest": _SHORTEST * s.sample_time, "psi": p.psi, "depth_voltage": p.load_drive,
        "rate_per_volt": p.gain, "voltage_limit": k.volts * s.limit, "volume_min": p.V_min,
        "volume_max": p.V_max, "S_p": s.sample_time,
    }  # fmt: skip


def _sea_cascade(s: Setting, k: Knobs) -> SeaCascadeParameters:
    p, h = s.plant, s.sample_time
    d, a = stiffness(p)
    own = sea_cascade_gains(a, d, p.gain, k.frequency, h)._replace(k_pV=k.inner / p.gain)
    return SeaCascadeParameters(
        gains=own, **_target(s, k), target_weight=1.0,
        smoothing=1.0 - math.exp(-k.sharpness * k.frequency * h), volume_per_speed=d / a,
        volume_per_acceleration=1.0 / a, dead_zone=k.dead,
    )  # fmt: skip


def _adrc(s: Setting, k: Knobs) -> AdrcParameters:
    p, w = s.plant, k.frequency
    d, a = stiffness(p)
    own = adrc_gains(w, k.sharpness * w, s.sample_time, k.learning * w)
    return AdrcParameters(gains=own, **_target(s, k), b=a, drag=d, k_pV=k.inner / p.gain)


def _deadband(s: Setting, k: Knobs) -> DeadbandParameters:
    """Wake every `pause`; leave errors of `band` alone, and what they are made of in a pause."""
    p, h = s.plant, s.sample_time
    d, a = stiffness(p)
    if d <= 0.0:
        raise InputError(
            "the law deadband reckons with laminar drag, and the vehicle has none",
            field="motion.drag", remedy="Choose the law observer",
        )  # fmt: skip
    interval = max(round(k.pause / h), 2) * h
    speed = k.band / interval
    own = deadband_gains(a / d, 1.0 / d, p.psi, interval, _FADING, creep=p.gain * p.load_drive)
    return DeadbandParameters(
        **own._asdict(), K2=a / d, T2=1.0 / d, psi=p.psi, depth_noise=s.noise,
        neutral_step=_STEP * s.noise / (a * interval * interval), band=k.band, speed_band=speed,
        fastest=max(5.0 * speed, 0.01), interval=interval, k_pV=k.inner / p.gain,
        tolerance=max(k.dead, s.least_move), depth_voltage=p.load_drive,
        rate_per_volt=p.gain, voltage_limit=k.volts * s.limit, volume_min=p.V_min,
        volume_max=p.V_max, S_p=h,
    )  # fmt: skip


def _record(kind: type[Kind], found: Mapping[str, Any]) -> Kind:
    return from_leaves(kind, {name: float(value) for name, value in found.items()})


class Recipe(NamedTuple):
    """A law and how its parameters are made.

    linear: around rest it has margins. rests: near the set-point it can leave the motor alone.
    """

    law: Law
    make: Callable[[Setting, Knobs], Any]
    linear: bool = True
    rests: bool = False


TUNABLE: Mapping[str, Recipe] = {
    "planned": Recipe(PLANNED, _planned),
    "observer": Recipe(OBSERVER, _observer, rests=True),
    "pulse": Recipe(PULSE, _pulse, rests=True),
    "cascade": Recipe(CASCADE, _cascade),
    "sea-cascade": Recipe(SEA_CASCADE, _sea_cascade),
    "adrc": Recipe(ADRC, _adrc),
    "position-observer": Recipe(POSITION_OBSERVER, _position_observer),
    "deadband": Recipe(DEADBAND, _deadband, linear=False),
}
