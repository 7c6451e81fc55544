"""What the deadband law goes by, remembers and decides: named tuples of floats."""

from __future__ import annotations

from typing import NamedTuple

__all__ = [
    "DEADBAND_UNITS",
    "DeadbandGains",
    "DeadbandParameters",
    "DeadbandState",
    "Decision",
    "Predicted",
]


class DeadbandGains(NamedTuple):
    """What follows from the model for a time between wakes."""

    k_z: float  # 1/s
    k_w: float  # -
    growth: float  # -
    longest: float  # s


class DeadbandParameters(NamedTuple):
    """The model, the bands, the times and the motor."""

    K2: float  # 1/m2/s, speed per volume
    T2: float  # s
    psi: float  # m3/m, neutral volume per depth
    depth_noise: float  # m, 1 sigma
    neutral_step: float  # m3, 1 sigma of what the neutral volume changes from wake to wake
    band: float  # m, depth errors that are left alone
    speed_band: float  # m/s, speeds that are left alone
    fastest: float  # m/s, speed that is asked for at most
    k_z: float  # 1/s
    k_w: float  # -
    growth: float  # -, of a deviation from rest over an interval; 1 where psi is not above 0
    interval: float  # s, shortest sleep
    longest: float  # s, longest sleep
    k_pV: float  # V/m3
    tolerance: float  # m3, nearer than this the volume counts as reached
    depth_voltage: float  # V/m, k_z/k_u
    rate_per_volt: float  # m3/s/V, of the volume, K1 A
    voltage_limit: float  # V
    volume_min: float  # m3
    volume_max: float  # m3
    S_p: float  # s


class DeadbandState(NamedTuple):
    """What the law remembers between wakes."""

    begun: float  # -, 1 once a depth and a volume have been seen
    depth: float  # m, as predicted or seen
    speed: float  # m/s, estimated
    depth_slope: float  # m/m3, of the depth against the neutral volume since a depth was used
    speed_slope: float  # m/s/m3, of the speed against it
    neutral: float  # m3, estimated at depth 0
    volume: float  # m3, at the wake before
    voltage: float  # V, since then
    share: float  # -, what a voltage was seen to do of what it should
    acting: float  # -, 1 while the vehicle is brought back
    moving: float  # s, since the motor was started; 0 while it rests
    sleep: float  # s, from when the motor started to the next look at the depth
    waited: float  # s, until the wake to come
    goal: float  # m, the reference
    volume_reference: float  # m3


class Predicted(NamedTuple):
    """Where the model says that the vehicle is, and how that depends on the neutral volume."""

    depth: float  # m
    speed: float  # m/s
    depth_slope: float  # m/m3
    speed_slope: float  # m/s/m3


class Decision(NamedTuple):
    """What is done with what a wake has shown."""

    speed: float  # m/s, estimated
    neutral: float  # m3, estimated at depth 0
    acting: float  # -, 1 while the vehicle is brought back
    moves: float  # -, 1 where the volume is to be moved
    sleep: float  # s, to the next look at the depth
    volume_reference: float  # m3


DEADBAND_UNITS = {
    "K2": "1/m2/s",
    "T2": "s",
    "psi": "m3/m",
    "depth_noise": "m",
    "neutral_step": "m3",
    "band": "m",
    "speed_band": "m/s",
    "fastest": "m/s",
    "k_z": "1/s",
    "k_w": "",
    "growth": "",
    "interval": "s",
    "longest": "s",
    "k_pV": "V/m3",
    "tolerance": "m3",
    "depth_voltage": "V/m",
    "rate_per_volt": "m3/s/V",
    "voltage_limit": "V",
    "volume_min": "m3",
    "volume_max": "m3",
    "S_p": "s",
}
