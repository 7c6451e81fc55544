"""What a pump that was identified from runs means: for its vehicle, and for each run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.energy.fit import PumpFit
from swimbladder.errors import InputError
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.vehicle import PowerLawPump, PumpAndValve, Supply, Vehicle

Array = NDArray[np.float64]
_BANDS, _FEWEST = 8, 3  # bands of pressure at most, and runs in each at least


class Band(NamedTuple):
    """Runs of neighbouring pressures together; fitted: by the law, nan without volumes."""

    runs: int
    pressure: float  # Pa, mean
    volume: float  # m3 a run
    energy: float  # J a run
    efficiency: float  # -, work on the sea p dV over the electrical energy, sums of both
    fitted: float  # -


def fitted_power(fit: PumpFit) -> Array:
    """Return what the law says of each run's power [W] [n]; nan where it lacks something."""
    r = fit.runs
    power = fit.value("idle_power") + fit.value("power_per_pressure") * r.pressure
    if "power_per_temperature" in fit.parameters and r.temperature is not None:
        power = power + fit.value("power_per_temperature") * (r.temperature - REFERENCE_TEMPERATURE)
    lost = fit.value("lost_energy")
    start = np.divide(lost, r.duration, out=np.zeros(r.duration.size), where=r.duration > 0.0)
    return np.asarray((power - start) * fit.voltage_share)


def fitted_volume(fit: PumpFit) -> Array:
    """Return the volume of each run by the fitted law [m3] [n]; nan where it has none."""
    r = fit.runs
    if "delivery" not in fit.parameters:
        return np.full(r.duration.size, np.nan)
    rate = fit.value("delivery") - fit.value("slip") * r.pressure
    return np.asarray(rate * r.duration - fit.value("start_volume"))


def run_columns(fit: PumpFit) -> dict[str, Array]:
    """Return a row a run, in the order of the log: its numbers, and what the law says of them.

    energy_J is power times duration; efficiency the work on the sea, pressure times volume, over
    it. Of a power that was read at the end of a run both hold as far as it was steady.
    """
    r = fit.runs
    nothing = np.full(r.duration.size, np.nan)
    volume = nothing if r.volume is None else r.volume
    energy, fitted = r.power * r.duration, fitted_power(fit) * r.duration
    return {
        "time_s": nothing if r.time is None else r.time,
        "dive": nothing if r.dive is None else r.dive,
        "pressure_Pa": r.pressure,
        "duration_s": r.duration,
        "volume_m3": volume,
        "energy_J": energy,
        "efficiency": _ratio(r.pressure * volume, energy),
        "fitted_volume_m3": fitted_volume(fit),
        "fitted_energy_J": fitted,
        "fitted_efficiency": _ratio(r.pressure * fitted_volume(fit), fitted),
        "counts": fit.kept.astype(float),
    }


def efficiency_bands(fit: PumpFit) -> list[Band]:
    """Return volume, energy and efficiency over pressure: bands of as many runs each.

    Only runs that count and have a volume; none where they are too few.
    """
    columns = run_columns(fit)
    good = np.flatnonzero(fit.kept & np.isfinite(columns["volume_m3"]))
    order = good[np.argsort(columns["pressure_Pa"][good], kind="stable")]
    count = min(_BANDS, len(order) // _FEWEST)
    found = []
    for rows in np.array_split(order, count) if count else ():
        p, v, e = (columns[name][rows] for name in ("pressure_Pa", "volume_m3", "energy_J"))
        fitted = columns["fitted_volume_m3"][rows], columns["fitted_energy_J"][rows]
        work, spent = np.array([p @ v, p @ fitted[0]]), np.array([e.sum(), fitted[1].sum()])
        share = _ratio(work, spent)
        found.append(
            Band(
                len(rows), float(p.mean()), float(v.mean()), float(e.mean()), float(share[0]),
                float(share[1]),
            )
        )  # fmt: skip
    return found


def _ratio(a: Array, b: Array) -> Array:
    return np.asarray(np.divide(a, b, out=np.full(b.shape, np.nan), where=b > 0.0))


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
