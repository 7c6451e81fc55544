"""What the gains of a law need to know of a vehicle."""

from __future__ import annotations

import math

from swimbladder.control.recipe import Setting
from swimbladder.design.tuning.region import neutral_walk
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import Vehicle

__all__ = ["setting_of"]

_FINEST = 0.5e-3  # m, noise that a filter reckons with at least
_LEAST = 1e-4  # of the stroke: volumes below are none


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
