"""A motor at steady speed behind driver and battery; pumps and valves against a pressure."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.physics.actuator import unified
from swimbladder.physics.arrays import Array
from swimbladder.physics.electric import SteadyDrive, largest_voltage, steady_drive, supply_current
from swimbladder.vehicle import (
    CurvePump,
    DatasheetPump,
    Driver,
    ElectrohydraulicActuator,
    PowerLawPump,
    Pump,
    Supply,
    UnifiedActuator,
    Valve,
    Vehicle,
)

REFERENCE_TEMPERATURE = 15.0  # degC at which the power of a pump is stated


class PumpRun(NamedTuple):
    """A pump while it runs, steadily; the power is that at the supply's terminals."""

    rate: Array  # m3/s into the water
    power: Array  # W


class SteadyPoint(NamedTuple):
    """A motor that presses out at steady speed: where its power goes."""

    voltage: Array  # V
    drive: SteadyDrive  # of motor and transmission, without driver and battery
    terminals: Array  # W, at the battery's terminals
    cells: Array  # W, from the battery's cells


def delivered(rate: Any, duration: Any, start_volume: Any = 0.0) -> Any:
    """Return the volume that one run of a pump presses out [m3]; arrays too.

    rate [m3/s], duration [s]; start_volume: what each start falls short of their product [m3].
    """
    return np.maximum(np.asarray(rate) * duration - start_volume, 0.0)[()]


def valve_flow(valve: Valve, head: Array) -> Array:
    """Return the flow through a valve [m3/s] at each pressure difference [Pa] [n].

    0 where the pressure inside is the greater one: the oil would have to be sucked out.
    """
    return valve.flow * valve_root(valve.laminar_pressure**0.5, head)


def valve_root(laminar: float, head: Array) -> Array:
    """Return the flow through a valve over its `flow` [Pa^0.5] at pressure differences [Pa] [n].

    laminar: the root of its `laminar_pressure` [Pa^0.5].
    """
    return np.asarray(np.sqrt(laminar * laminar + np.maximum(head, 0.0)) - laminar)


def pump_run(
    vehicle: Vehicle, pump: Pump, head: Array, temperature: ArrayLike = REFERENCE_TEMPERATURE
) -> PumpRun:
    """Return what a pump delivers and draws against each pressure difference `head` [Pa] [n].

    Of the vehicle's water only the weight counts, to turn a head into the depth that eqs (7)-(8)
    are written in. temperature: [degC] [n] or one. Slip beyond the delivery stops at the check
    valve: nothing flows inwards.
    """
    if isinstance(pump, PowerLawPump):
        rate = np.maximum(pump.delivery - pump.slip * head, 0.0)
        beaten = np.maximum(head, 0.0)
        if pump.stall_pressure is not None:
            rate = np.where(head >= pump.stall_pressure, 0.0, rate)
            beaten = np.minimum(beaten, pump.stall_pressure)
        warmer = np.asarray(temperature, float) - REFERENCE_TEMPERATURE
        drawn = pump.idle_power + pump.power_per_pressure * beaten
        return PumpRun(rate, np.maximum(drawn + pump.power_per_temperature * warmer, 0.0))
    if isinstance(pump, CurvePump):
        from scipy.interpolate import PchipInterpolator

        beaten = np.clip(head, pump.pressure[0], pump.pressure[-1])
        curves = PchipInterpolator(pump.pressure, [pump.delivery, pump.power], axis=1)
        rate, drawn = curves(beaten)
        return PumpRun(np.where(head > pump.pressure[-1], 0.0, rate), drawn)
    at = datasheet_point(vehicle, pump, np.maximum(head, 0.0))
    return PumpRun(np.maximum(at.drive.volume_rate, 0.0), at.terminals)


def datasheet_point(
    vehicle: Vehicle, pump: DatasheetPump, head: Array, share: float = 1.0
) -> SteadyPoint:
    """Return a pump's motor at a `share` of the voltage that it gets against each head [Pa] [n]."""
    assert vehicle.supply is not None  # Vehicle checks it
    a = unified(ElectrohydraulicActuator(motor=pump.motor, drive=pump.drive), vehicle.water)
    z = head / vehicle.water.specific_weight
    load = a.k_z * z + a.friction_torque
    u = full_voltage(a, vehicle.supply, load)
    if pump.speed is not None:
        u = np.minimum(u, (a.k_v * pump.speed + load) / a.k_u)
    return motor_point(vehicle, a, share * u, z)


def motor_point(vehicle: Vehicle, a: UnifiedActuator, u: Array, z: Array) -> SteadyPoint:
    """Return a motor at each voltage u [V] and depth z [m] [n], through driver and battery."""
    d = steady_drive(a, vehicle.water, voltage=u, depth=z)
    terminals = terminal_power(np.asarray(d.supply), vehicle.driver)
    return SteadyPoint(u, d, terminals, battery_power(terminals, vehicle.supply))


def full_voltage(a: UnifiedActuator, supply: Supply, load: Array) -> Array:
    """Return the largest |u| [V] that the supply holds at steady speed under a load [N m] [n].

    With k_v omega = k_u u - load and u = (E + (R_b/R) k_emf omega)/(1 + R_b/R), see
    electric.largest_voltage; E where the sea turns the motor faster than E does.
    """
    assert a.resistance is not None
    assert a.emf_constant is not None
    E, sag, k_emf = supply.voltage, supply.internal_resistance / a.resistance, a.emf_constant
    omega = (a.k_u * E / (1.0 + sag) - load) / (a.k_v - a.k_u * sag * k_emf / (1.0 + sag))
    full: Any = largest_voltage(E=E, sag=sag, emf=k_emf * np.maximum(omega, 0.0))
    return np.asarray(full)


def battery_power(power: Array, supply: Supply | None) -> Array:
    """Return what leaves the battery's cells [W] for a `power` at its terminals [W] [n].

    Its internal resistance takes R_b i^2 more; NaN where that is beyond the battery.
    """
    if supply is None or supply.internal_resistance == 0.0:
        return np.asarray(power, float)
    E, R_b = supply.voltage, supply.internal_resistance
    return np.asarray(E * supply_current(P=np.asarray(power, float), E=E, R_b=R_b))


def terminal_power(motor: Array, driver: Driver | None) -> Array:
    """Return the power at the battery's terminals [W] for that at the motor's [n]."""
    if driver is None:
        return motor
    back = driver.efficiency if driver.regenerates else 0.0
    return np.where(motor > 0.0, motor / driver.efficiency, motor * back)
