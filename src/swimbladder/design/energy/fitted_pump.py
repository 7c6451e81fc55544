"""A vehicle with the pump identified from runs, at its own battery's voltage."""

from __future__ import annotations

import numpy as np

from swimbladder.design.energy.fit import PumpFit
from swimbladder.errors import InputError
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.vehicle import PowerLawPump, PumpAndValve, Supply, Vehicle


def voltage_factor(supply: Supply | None, fit: PumpFit) -> float:
    """Return a supply's voltage under the runs' median current over the fit's reference [-].

    1 without a supply, and where the voltage does not count. Raises InputError where that current
    takes all of the supply's voltage.
    """
    if supply is None or fit.reference_voltage is None:
        return 1.0
    volts = fit.reference_voltage * fit.voltage_share[fit.kept]
    current = float(np.median(fit.runs.power[fit.kept] / volts))
    left = supply.voltage - supply.internal_resistance * current
    if left <= 0.0:
        raise InputError(
            f"the runs' median current, {current:.3g} A, takes all of the supply's "
            f"{supply.voltage:g} V", field="supply.internal_resistance", unit="ohm",
            value=supply.internal_resistance, remedy="State that of the battery that runs the pump",
        )  # fmt: skip
    return left / fit.reference_voltage


def pump_and_valve(vehicle: Vehicle) -> PumpAndValve:
    """Return the actuator of a vehicle that has a pump; raises InputError for another."""
    if not isinstance(vehicle.actuator, PumpAndValve):
        raise InputError(
            "a pump that runs or not is no part of this actuator", field="actuator.kind",
            value=vehicle.actuator.kind, remedy="Give a vehicle of kind pump-valve, or none",
        )  # fmt: skip
    return vehicle.actuator


def fitted_vehicle(vehicle: Vehicle, fit: PumpFit) -> Vehicle:
    """Return a pump-and-valve vehicle with the pump identified from runs.

    A slip, start loss or warmth below 0 is not distinguishable from none, and taken as 0. Without
    measured volumes delivery, slip and start loss stay, where the vehicle has a power law.
    Logged pressures are the sea's above the atmosphere, and the pump beats besides what the
    reservoir's gas lacks of an atmosphere. Where the power goes with the voltage, so does the
    speed: power and measured delivery are those at the vehicle's supply, see `voltage_factor`;
    slip goes with the pressure alone. Raises InputError for another actuator, and where nothing
    has a delivery.
    """
    a = pump_and_valve(vehicle)
    old = a.pump if isinstance(a.pump, PowerLawPump) else None
    known = "delivery" in fit.parameters
    if not known and old is None:
        raise InputError(
            "without measured volumes the pump of the vehicle keeps its delivery, and one from "
            "datasheets has none to keep", field="volume_m3",
            remedy="Log the volume of each run, give the vehicle's pump as kind power-law, or "
            "leave the vehicle out",
        )  # fmt: skip
    lack = ATMOSPHERIC_PRESSURE - a.internal_pressure
    factor = voltage_factor(vehicle.supply, fit)
    slip, per_pressure = max(fit.value("slip"), 0.0), max(fit.value("power_per_pressure"), 0.0)
    per_pressure, delivery = factor * per_pressure, factor * fit.value("delivery")
    pump = PowerLawPump(
        delivery=delivery + slip * lack if known or old is None else old.delivery,
        slip=slip if known or old is None else old.slip,
        idle_power=factor * fit.value("idle_power") - per_pressure * lack,
        power_per_pressure=per_pressure,
        power_per_temperature=factor * min(fit.value("power_per_temperature"), 0.0),
        stall_pressure=None if old is None else old.stall_pressure,
    )
    start = max(fit.value("start_volume"), 0.0) if known else a.start_volume
    actuator = a.model_copy(update={"pump": pump, "start_volume": start})
    return vehicle.model_copy(update={"actuator": actuator})
