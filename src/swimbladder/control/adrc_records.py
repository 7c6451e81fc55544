"""What active disturbance rejection goes by and remembers: named tuples of floats."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ADRC_UNITS", "AdrcGains", "AdrcParameters", "AdrcState", "Observed"]


class AdrcGains(NamedTuple):
    """Gains of the feedback and of the observer."""

    k_p: float  # 1/s2
    k_d: float  # 1/s
    l_z: float  # -
    l_w: float  # 1/s
    l_f: float  # 1/s2


class AdrcParameters(NamedTuple):
    """One number of the vehicle, gains, limits; see `adrc_gains`."""

    b: float  # 1/m2/s2, acceleration per volume, K2/T2
    drag: float  # 1/s, deceleration per speed, 1/T2; 0: part of the disturbance
    psi: float  # m3/m, neutral volume per depth; 0: part of the disturbance
    gains: AdrcGains
    k_pV: float  # V/m3
    leash: float  # m, largest error that counts; 0: any
    fastest: float  # m/s, of the target; 0: no limit
    jerk: float  # m/s3, of the target; 0: no limit
    shortest: float  # s, that the target takes for any change
    depth_voltage: float  # V/m, k_z/k_u
    rate_per_volt: float  # m3/s/V, K1 A
    voltage_limit: float  # V
    volume_min: float  # m3
    volume_max: float  # m3
    S_p: float  # s


class AdrcState(NamedTuple):
    """What the law remembers between samples."""

    begun: float  # -, 1 once a depth and a volume have been seen
    depth: float  # m, estimated
    speed: float  # m/s, estimated
    disturbance: float  # m/s2, estimated f
    missed: float  # -, 1 where the depth of the sample before was missing
    volume: float  # m3, of the sample before
    voltage: float  # V, of the sample before, as limited
    target: float  # m
    target_speed: float  # m/s
    target_acceleration: float  # m/s2
    left: float  # s, that the target is still on its way
    whole: float  # s, that this way takes in all; 0 for one that began in motion
    jerk: float  # m/s3, of its first quarter
    goal: float  # m, where it goes
    driven: float  # V, beyond the load of the sea, at the sample before the last
    ability: float  # -, share of its rate that the motor was seen to have
    volume_reference: float  # m3


class Observed(NamedTuple):
    """What the observer says."""

    depth: float  # m
    speed: float  # m/s
    disturbance: float  # m/s2


ADRC_UNITS = {
    "b": "1/m2/s2",
    "drag": "1/s",
    "psi": "m3/m",
    "k_p": "1/s2",
    "k_d": "1/s",
    "l_z": "",
    "l_w": "1/s",
    "l_f": "1/s2",
    "k_pV": "V/m3",
    "leash": "m",
    "fastest": "m/s",
    "jerk": "m/s3",
    "shortest": "s",
    "depth_voltage": "V/m",
    "rate_per_volt": "m3/s/V",
    "voltage_limit": "V",
    "volume_min": "m3",
    "volume_max": "m3",
    "S_p": "s",
}
