"""Any actuator as a mission sees it: rates and powers over pressure, steady, at full voltage.

A motor reaches its speed in seconds and a mission takes hours, so that rates follow from the
balance of eqs (11)-(12) at rest. Pressures are above the atmosphere, as a depth sensor's.

What holds the volume while nothing runs: the check valve of a pump and valve; a screw or a pump
without one stays where dry friction or self-locking hold it, otherwise its motor holds it with the
voltage k_z,back z/k_u - T_b/k_u, at the cost of R i^2.
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.errors import NoAnswerError
from swimbladder.physics import steady_drives
from swimbladder.physics.actuator import reduced, unified
from swimbladder.physics.arrays import Array
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.units import say
from swimbladder.vehicle import (
    DatasheetPump,
    ElectrohydraulicActuator,
    IdentifiedActuator,
    Positioner,
    PumpAndValve,
    Supply,
    UnifiedActuator,
    Vehicle,
)

_say = partial(say, "physics", "energy")


class DriveMap(NamedTuple):
    """What an actuator can do at each pressure, and what it draws; powers are the battery's.

    The driver's and the internal resistance's losses are in them, standby power and hotel loads
    are not. A negative power charges the battery. NaN: not known, or more than the battery can.
    """

    pressure: Array  # Pa above the atmosphere [n]
    rate_out: Array  # m3/s, volume pressed out; 0 where the motor or pump stalls
    power_out: Array  # W while it does
    rate_in: Array  # m3/s let or drawn in, positive
    power_in: Array  # W while it does
    leakage: Array  # m3/s inwards at rest
    holding_power: Array  # W at rest
    bypass_in: Array  # m3/s let in through the bypass, 0 without one
    power_bypass: Array  # W while it does
    start_volume: Array  # m3 that each start of the pump falls short of rate_out times its run
    start_saving: Array  # J by which a start takes less than power_out for as long: its line fills


def drive_map(
    vehicle: Vehicle,
    pressure: ArrayLike,
    *,
    temperature: ArrayLike = steady_drives.REFERENCE_TEMPERATURE,
    power: bool = True,
) -> DriveMap:
    """Return the rates and powers of a vehicle's actuator at each `pressure` [Pa] [n].

    temperature: of the water [degC] [n] or one, for a pump whose power depends on it. power: False
    leaves out (NaN) powers that are not known. Raises NoAnswerError where a power is wanted that R
    and k_T, or a power law, do not determine, naming the fields.
    """
    if power:
        check_power_known(vehicle)
    p = np.atleast_1d(np.asarray(pressure, float))
    a = vehicle.engine
    if isinstance(a, PumpAndValve):
        return _pump_and_valve(vehicle, a, p, np.asarray(temperature, float))
    if isinstance(a, Positioner):
        return _positioner(vehicle, a, p)
    motor = _known_motor(vehicle)
    return _rates_only(vehicle, p) if motor is None else _voltage_driven(vehicle, motor, p)


def _known_motor(vehicle: Vehicle) -> UnifiedActuator | None:
    """Return an actuator whose electrical power is known; None for a positioner, or without."""
    if isinstance(vehicle.engine, Positioner | IdentifiedActuator):
        return None
    found = unified(vehicle.engine, vehicle.water)
    return None if found.resistance is None or found.emf_constant is None else found


def check_power_known(vehicle: Vehicle, instead: str = "") -> None:
    """Raise NoAnswerError, naming the fields, where the actuator's electrical power is not known.

    A motor needs its resistance R and k_T (k_emf), a pump and valve has a power law or a motor, a
    positioner needs its power while moving. instead: what else can be asked for.
    """
    a = vehicle.engine
    missing = ""
    if isinstance(a, Positioner) and a.moving_power is None:
        missing = _say("positioner")
    elif isinstance(a, IdentifiedActuator):
        missing = _say("identified")
    elif isinstance(a, UnifiedActuator):
        absent = [f"actuator.{n}" for n in ("resistance", "emf_constant") if getattr(a, n) is None]
        if absent:
            missing = f"give {' and '.join(absent)} from the motor's datasheet"
    if missing:
        missing += instead and f"; or {instead}"
        raise NoAnswerError(f"the electrical power is not known: {missing}")


class Winding(NamedTuple):
    """A motor as its supply sees it."""

    R: float  # ohm
    kappa: float  # V s/m3, back electromotive force per volume rate


def winding(vehicle: Vehicle) -> Winding | None:
    """Return the winding of a vehicle's motor; None without one, or without R and k_T."""
    if vehicle.command == "volume":
        return None
    a = reduced(vehicle.engine, vehicle.water)
    return None if a.resistance is None or a.kappa is None else Winding(a.resistance, a.kappa)


def oil_note(vehicle: Vehicle) -> str | None:
    """Return what an oil that is given, and compresses nothing here, would take; None: nothing."""
    a = vehicle.engine
    if isinstance(a, PumpAndValve):
        if a.line is not None or not isinstance(a.pump, DatasheetPump) or a.pump.drive.oil is None:
            return None
        field, how = "actuator.pump.drive.oil", "give"
    elif isinstance(a, ElectrohydraulicActuator) and a.drive.oil is not None:
        field, how = "actuator.drive.oil", "write the actuator as kind pump-valve and give"
    else:
        return None
    return _say("start lost", field=field, how=how)


def steady_point(
    vehicle: Vehicle, pressure: ArrayLike, *, share: float = 1.0
) -> steady_drives.SteadyPoint | None:
    """Return a motor that presses out at a `share` of the full voltage, at each pressure [Pa] [n].

    None where there is no motor with known R and k_emf: a power law, a positioner.
    """
    a, supply = vehicle.engine, vehicle.supply
    p = np.atleast_1d(np.asarray(pressure, float))
    if isinstance(a, PumpAndValve):
        if supply is None or not isinstance(a.pump, DatasheetPump):
            return None
        head = np.maximum(p + ATMOSPHERIC_PRESSURE - a.internal_pressure, 0.0)
        return steady_drives.datasheet_point(vehicle, a.pump, head, share)
    found = _known_motor(vehicle)
    if supply is None or found is None:
        return None
    z = p / vehicle.water.specific_weight
    u = share * steady_drives.full_voltage(found, supply, found.k_z * z + found.friction_torque)
    return steady_drives.motor_point(vehicle, found, u, z)


def _pump_and_valve(vehicle: Vehicle, a: PumpAndValve, p: Array, T: Array) -> DriveMap:
    head = p + ATMOSPHERIC_PRESSURE - a.internal_pressure
    supply, nothing = vehicle.supply, np.zeros(p.shape)
    run = steady_drives.pump_run(vehicle, a.pump, head, T)
    power_out = _from_battery(run.power, supply, "the pump")
    short, saving = np.full(p.shape, a.start_volume), nothing
    if a.line is not None:
        warm = np.broadcast_to(T, p.shape)[:, None]
        start = steady_drives.pump_start(
            steady_drives.OilLine(a.line, a.internal_pressure, pressure_ratio(a)),
            lambda dp: running_pump(vehicle, a, dp, warm if dp.ndim > 1 else T)[0],
            p + ATMOSPHERIC_PRESSURE,
            power=lambda dp: running_pump(vehicle, a, dp, warm)[1],
        )
        short = short + start.shortfall
        full = np.divide(start.shortfall, run.rate, out=np.zeros(p.shape), where=run.rate > 0.0)
        saving = power_out * full - start.energy
    power_in = steady_drives.battery_power(np.full(p.shape, a.valve.power), supply)
    bypass_in = power_bypass = nothing
    if a.bypass is not None:
        bypass_in = steady_drives.valve_flow(a.bypass, head)
        power_bypass = steady_drives.battery_power(np.full(p.shape, a.bypass.power), supply)
    return DriveMap(
        pressure=p,
        rate_out=run.rate,
        power_out=power_out,
        rate_in=steady_drives.valve_flow(a.valve, head),
        power_in=power_in,
        leakage=a.leakage * np.maximum(head, 0.0) + a.creep,
        holding_power=nothing,
        bypass_in=bypass_in,
        power_bypass=power_bypass,
        start_volume=short,
        start_saving=saving,
    )


def pressure_ratio(a: PumpAndValve) -> float:
    """Return the ratio of the pressure amplifier behind a pump [-], 1 without one."""
    return a.pump.drive.area_ratio if isinstance(a.pump, DatasheetPump) else 1.0


def at_voltage(vehicle: Vehicle, voltage: float) -> Vehicle:
    """Return the vehicle with another voltage of its supply [V].

    As it is without a supply, or where the voltage is not finite.
    """
    if vehicle.supply is None or not math.isfinite(voltage):
        return vehicle
    return vehicle.but("supply", voltage=voltage)


def running_pump(
    vehicle: Vehicle, a: PumpAndValve, head: Array, temperature: ArrayLike
) -> tuple[Array, Array]:
    """Return delivery [m3/s] and what leaves the cells [W] against each `head` [Pa] [n].

    temperature: of the water [degC] [n] or one.
    """
    run = steady_drives.pump_run(vehicle, a.pump, head, temperature)
    return run.rate, steady_drives.battery_power(run.power, vehicle.supply)


def _from_battery(power: Array, supply: Supply | None, what: str) -> Array:
    """Return what leaves the cells [W]; raises NoAnswerError where the battery cannot give it."""
    drawn = steady_drives.battery_power(power, supply)
    if supply is not None and np.isnan(drawn).any():
        most = supply.voltage**2 / (4.0 * supply.internal_resistance)
        raise NoAnswerError(_say("too much", what=what, power=np.max(power), most=most))
    return drawn


def _positioner(vehicle: Vehicle, a: Positioner, p: Array) -> DriveMap:
    moving = held = np.full(p.shape, np.nan)
    if a.moving_power is not None:
        drawn = np.full((2, *p.shape), np.array([[a.moving_power], [a.holding_power]]))
        of_motor, of_holding = steady_drives.terminal_power(drawn, vehicle.driver)
        moving = _from_battery(of_motor, vehicle.supply, "the positioner's motor")
        held = _from_battery(of_holding, vehicle.supply, "holding the positioner")
    rate, nothing = np.full(p.shape, a.speed * a.piston_area), np.zeros(p.shape)
    return DriveMap(p, rate, moving, rate, moving, nothing, held, *4 * (nothing,))


def _rates_only(vehicle: Vehicle, p: Array) -> DriveMap:
    """Return the rates of an actuator whose R is not known; its battery cannot sag either."""
    assert vehicle.supply is not None  # Vehicle checks it
    a, E = reduced(vehicle.engine, vehicle.water), vehicle.supply.voltage
    z = p / vehicle.water.specific_weight
    leak = a.k_l * z
    pressed = np.maximum(a.gain * (E - a.load_drive * z - a.friction), 0.0)
    drawn = np.maximum(a.gain * (E + a.load_back * z - a.friction), 0.0)
    unknown, nothing = np.full(p.shape, np.nan), np.zeros(p.shape)
    out = np.maximum(pressed - leak, 0.0)
    return DriveMap(p, out, unknown, drawn + leak, unknown, leak, unknown, *4 * (nothing,))


def _voltage_driven(vehicle: Vehicle, a: UnifiedActuator, p: Array) -> DriveMap:
    supply = vehicle.supply
    assert supply is not None  # Vehicle checks it
    z = p / vehicle.water.specific_weight

    def drawn(voltage: Array) -> tuple[Array, Array]:
        at = steady_drives.motor_point(vehicle, a, voltage, z)
        return np.asarray(at.drive.volume_rate), at.cells

    full = partial(steady_drives.full_voltage, a, supply)
    rate_out, power_out = drawn(full(a.k_z * z + a.friction_torque))
    rate_in, power_in = drawn(-full(a.friction_torque - a.k_z_back * z))
    hold = np.maximum(a.k_z_back * z - a.friction_torque, 0.0) / a.k_u
    _, holding = drawn(hold)
    leak, nothing = np.asarray(a.k_l * z), np.zeros(p.shape)
    rate_out = np.maximum(rate_out, 0.0)
    rate_in = np.maximum(-rate_in, 0.0)
    return DriveMap(p, rate_out, power_out, rate_in, power_in, leak, holding, *4 * (nothing,))
