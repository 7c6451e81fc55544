"""What a law is tuned with, and what its gains need to know of the vehicle."""

from __future__ import annotations

import math
from typing import NamedTuple

from swimbladder.design.tuning.region import neutral_walk
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.vehicle import Vehicle

__all__ = ["Knobs", "Setting", "setting_of"]

_FINEST = 0.5e-3  # m, noise that a filter reckons with at least
_LEAST = 1e-4  # of the stroke: volumes below are none


class Knobs(NamedTuple):
    """What a law is tuned with.

    frequency [rad/s] and damping [-] of the depth under feedback; inner [1/s]: rate at which the
    volume follows; sharpness [-]: bandwidth of the filter over `frequency`; learning [-]: how fast
    the neutral volume is learnt, as a share of what the filter could (adrc: bandwidth of the
    disturbance's estimate over `frequency`); share [-]: of the motor's speed that a path takes;
    dead [m3]: volume error that the motor rests at; pause [s]: how long a volume is made to be held
    and an error is predicted ahead near the set-point (deadband: sleep); band [m]: predicted depth
    errors that are left alone (deadband: depth errors); pulse [-]: time that a pulse of the law
    pulse takes, as a share of `pause`; volts [-]: share of the supply in use.
    """

    frequency: float
    damping: float
    inner: float
    sharpness: float = 6.0
    learning: float = 0.01
    share: float = 0.8
    dead: float = 0.0
    pause: float = 0.0
    band: float = 0.0
    pulse: float = 0.1
    volts: float = 1.0


class Setting(NamedTuple):
    """The vehicle as the gains see it: nominal, with the least of the supply."""

    plant: Plant
    sample_time: float  # s
    noise: float  # m, of a measured depth, quantum included
    limit: float  # V, least supply
    neutral_range: float  # m3, how far the neutral volume may be from what is known
    least_move: float  # m3, below which a volume is not told from noise
    walk: float  # m3/s^0.5, intensity of the neutral volume's random walk


def setting_of(
    vehicle: Vehicle, *, sample_time: float, supply: float, neutral_range: float
) -> Setting:
    """Return what the gains need of a vehicle; supply [V]: the least that it will have."""
    sensors = vehicle.sensors
    noise = math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
    if vehicle.identified is not None:
        noise = max(noise, vehicle.identified.depth_noise)
    p = plant(vehicle)
    volume_noise = math.hypot(sensors.volume_noise, sensors.volume_quantum / math.sqrt(12.0))
    least = max(3.0 * volume_noise, _LEAST * (p.V_max - p.V_min))
    return Setting(
        p, sample_time, max(noise, _FINEST), supply, neutral_range, least, neutral_walk(vehicle)
    )
