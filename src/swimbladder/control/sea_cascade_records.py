"""What the cascade fit for sea goes by and remembers: named tuples of floats."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["SEA_CASCADE_UNITS", "SeaCascadeGains", "SeaCascadeParameters", "SeaCascadeState"]


class SeaCascadeGains(NamedTuple):
    """The cascade's own gains."""

    k_pV: float  # V/m3
    k_pz: float  # m3/m
    k_iz: float  # m3/s/m
    k_dz: float  # m3 s/m


class SeaCascadeParameters(NamedTuple):
    """The paper's gains and what the sea adds; an addition whose number is 0 is left out."""

    gains: SeaCascadeGains
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
    volume: float  # m3, last one seen
    drive: float  # V, beyond the load of the sea, at the sample before
    driven: float  # V, at the one before that
    ability: float  # -, share of its rate that the motor was seen to have
    volume_reference: float  # m3


SEA_CASCADE_UNITS = {
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
}
