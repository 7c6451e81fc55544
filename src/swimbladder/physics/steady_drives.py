"""A motor at steady speed behind driver and battery; pumps and valves against a pressure.

What a pump's start costs: eq. (1) with trapped air, from standstill until the check valve opens.

Between pump and check valve stands a line of oil with some air in it. The pump raises its pressure
by eq. (1) with the line's walls at rest,

    dp/dt = beta_e(p)/V Q(p),   V/beta_e = V_l/beta + V_g/(n p),
    V_g = air V (p_0/p)^(1/n),  V_l = V - V_g,

and nothing reaches the bladder before p is the sea's. As both sides depend on nothing but p, time
and energy are integrals over p, taken by Gauss-Legendre in log p. While the pump stands the line
empties through it by its slip, again by eq. (1). The paper takes the oil as incompressible: then
the line is full at once.

Behind a pressure amplifier the line has the sea's pressure over its ratio, and a volume of the
water is its ratio of the oil's the less. Volumes, rates and heads are those of the water here.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import ArrayLike

from swimbladder.physics.actuator import unified
from swimbladder.physics.arrays import Array
from swimbladder.physics.electric import SteadyDrive, largest_voltage, steady_drive, supply_current
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.vehicle import (
    CurvePump,
    DatasheetPump,
    Driver,
    ElectrohydraulicActuator,
    Oil,
    PowerLawPump,
    Pump,
    Supply,
    UnifiedActuator,
    Valve,
    Vehicle,
)

Law = Callable[[Array], Array]
POLYTROPIC = 1.4  # exponent of the air in a line: adiabatic, as a start takes a second
_NODES, _WEIGHTS = leggauss(48)
_FEW_NODES, _FEW_WEIGHTS = leggauss(8)
_STALLS = 1e-3  # share of its delivery below which a pump counts as stalled


class PumpStart(NamedTuple):
    """What happens before the check valve opens, from a line at the reservoir's pressure on."""

    duration: Array  # s; inf where the pump cannot reach the pressure
    volume: Array  # m3, taken in by the line: compressed oil and air
    shortfall: Array  # m3, of rate at the load times the time of running
    energy: Array  # J of the power that was given; 0 where the pump stalls


class OilLine(NamedTuple):
    """A line of oil between pump and check valve."""

    oil: Oil
    reservoir: float = ATMOSPHERIC_PRESSURE  # Pa, absolute, at which line and reservoir rest
    ratio: float = 1.0  # of a pressure amplifier
    polytropic: float = POLYTROPIC  # exponent of the air, 1.4 for a fast start

    def compliance(self, pressure: Array) -> Array:
        """Return V/beta_e [m3/Pa] at absolute `pressure` [Pa] [n]; the volume is constant.

        The air share counts at one atmosphere.
        """
        oil, n = self.oil, self.polytropic
        gas = oil.volume * oil.trapped_air * (ATMOSPHERIC_PRESSURE / pressure) ** (1.0 / n)
        return np.asarray((oil.volume - gas) / oil.bulk_modulus + gas / (n * pressure))


class LineCurves(NamedTuple):
    """A line over y = ln(p/reservoir), rows `step` apart: values, and slopes by y, [n, 2] each."""

    step: float
    top: float  # y at which the pump stalls; inf: it does not within these rows
    time: Array  # s, from the reservoir's pressure on by the pump
    energy: Array  # J that takes
    falling: Array  # s, integral of (C - C_0)/(slip h) over the head h; 0 without slip


def pump_start(line: OilLine, rate: Law, load: Array, *, power: Law | None = None) -> PumpStart:
    """Return what starts against each absolute `load` pressure [Pa] [n] cost.

    rate: what the pump delivers [m3/s] against a difference of pressure to the reservoir's [Pa];
    power: what it draws then [W], not given: no energy.
    """
    reservoir, ratio = line.reservoir, line.ratio
    head = np.maximum(np.asarray(load, float) - reservoir, 0.0)
    middle = 0.5 * np.log1p(head / (ratio * reservoir))
    p = np.exp(np.log(reservoir) + middle[..., None] * (1.0 + _NODES))
    taken = p * line.compliance(p) * middle[..., None] * _WEIGHTS / ratio
    heads = ratio * (p - reservoir)
    flow, at_load = rate(heads), rate(head)
    stalled = np.any(flow <= 0.0, axis=-1) | (at_load <= 0.0)
    slow = np.divide(taken, flow, out=np.zeros_like(taken), where=flow > 0.0)
    duration = np.where(stalled, np.inf, slow.sum(axis=-1))
    drawn = np.zeros_like(slow) if power is None else slow * power(heads)
    missed = at_load * np.where(stalled, 0.0, duration)
    energy = np.where(stalled, 0.0, drawn.sum(axis=-1))
    return PumpStart(duration, taken.sum(axis=-1), missed, energy)


def line_curves(
    line: OilLine, rate: Law, power: Law, highest: float, count: int, *, slip: float = 0.0
) -> LineCurves:
    """Return what the pressure of a line does up to a `highest` head [Pa], in `count` rows.

    slip: what flows back through a pump that stands [m3/s/Pa]; the rest as in `pump_start`.
    """
    reservoir, ratio = line.reservoir, line.ratio
    last = _stall(rate, highest)
    top = math.log1p(last / (ratio * reservoir))
    step = top / (count - 1.0) if top > 0.0 else 1e-3  # no place is reached: any that is finite
    y = step * np.arange(float(count))
    inner = y[:-1, None] + 0.5 * step * (1.0 + _FEW_NODES)

    def slopes(y: Array) -> tuple[Array, Array, Array]:
        """Return time [s], energy [J] and fall per unit of ln(p/p_reservoir), at those places."""
        p = reservoir * np.exp(y)
        head = ratio * reservoir * np.expm1(y)
        flow, taken = np.maximum(rate(head), 0.0), line.compliance(p) * p / ratio
        slow = np.divide(taken, flow, out=np.zeros_like(p), where=flow > 0.0)
        return slow, slow * power(head), _fall(line, p, slip)

    columns = [
        np.stack([np.concatenate(([0.0], np.cumsum(0.5 * step * within @ _FEW_WEIGHTS))), at], 1)
        for within, at in zip(slopes(inner), slopes(y), strict=True)
    ]
    return LineCurves(step, top if last < highest else math.inf, *columns)


def _stall(rate: Law, highest: float) -> float:
    """Return the head [Pa] from which on a pump counts as stalled, `highest` where it does not."""
    from scipy.optimize import bisect

    least = _STALLS * float(rate(np.zeros(1))[0])

    def beyond(head: float) -> float:
        return float(rate(np.array([head]))[0]) - least

    if beyond(highest) > 0.0:
        return highest
    return float(bisect(beyond, 0.0, highest, xtol=1e-12 * highest))


def _fall(line: OilLine, p: Array, slip: float) -> Array:
    """Return (C - C_0)/(slip h) dh/dy [s] at pressures p [Pa], its limit at the reservoir's."""
    if slip == 0.0:
        return np.zeros_like(p)
    # nearer by, where the difference of two C is rounding, its slope there
    at = np.maximum(p, line.reservoir * (1.0 + 1e-6))
    more = line.compliance(at) - line.compliance(np.array(line.reservoir))
    # C and h of the water are the oil's over and times the ratio: C_w = C/ratio^2, dh/h as dp/p-p_0
    return np.asarray(more / ((at - line.reservoir) * slip * line.ratio**2) * p)


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
