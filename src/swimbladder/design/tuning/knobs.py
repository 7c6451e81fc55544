"""What the gains of a law need to know of a vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence

from swimbladder.control.recipe import Drive, Setting
from swimbladder.design.linear.pump_valve import drive_rates, moved_by_volume
from swimbladder.design.tuning.region import neutral_walk
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import PumpAndValve, Vehicle

_FINEST = 0.5e-3  # m, noise that a filter reckons with at least
_LEAST = 1e-4  # of the stroke: volumes below are none


def setting_of(
    vehicle: Vehicle,
    *,
    sample_time: float,
    supply: float,
    neutral_range: float,
    depths: Sequence[float] = (),
) -> Setting:
    """Return what the gains need of a vehicle; supply [V]: the least that it will have.

    depths [m]: between which a pump and valve has to work.
    """
    sensors = vehicle.sensors
    noise = math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
    if vehicle.identified is not None:
        noise = max(noise, vehicle.identified.depth_noise)
    p = plant(moved_by_volume(vehicle))
    volume_noise = math.hypot(sensors.volume_noise, sensors.volume_quantum / math.sqrt(12.0))
    least = max(3.0 * volume_noise, _LEAST * (p.V_max - p.V_min))
    return Setting(
        p,
        sample_time,
        max(noise, _FINEST),
        supply,
        neutral_range,
        least,
        neutral_walk(vehicle),
        _drive(vehicle, supply, depths, neutral_range),
    )


def with_supply(vehicle: Vehicle, volts: float) -> Vehicle:
    """Return a vehicle whose supply has so many volts; as it is where that is not finite."""
    if vehicle.supply is None or not math.isfinite(volts):
        return vehicle
    low = vehicle.supply.model_copy(update={"voltage": volts})
    return vehicle.model_copy(update={"supply": low})


def _drive(
    vehicle: Vehicle, supply: float, depths: Sequence[float], neutral_range: float
) -> Drive | None:
    a, stroke = vehicle.actuator, vehicle.stroke
    if not isinstance(a, PumpAndValve) or not depths:
        return None
    rates = drive_rates(with_supply(vehicle, supply), depths)
    neutral = [vehicle.neutral_volume(z) for z in depths]
    room = min(stroke.maximum - max(neutral), min(neutral) - stroke.minimum)
    return Drive(
        rate_out=min(rates.pump),
        rate_in=min(rates.valve),
        start=max(rates.start_volume),
        tick=a.quantum,
        longest=a.longest_run or math.inf,
        room=room - neutral_range,
    )
