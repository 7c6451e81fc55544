"""What a dive asks of a buoyancy engine, and how every candidate does against that.

Asked are volume, rate, pressure and energy. A candidate has a mass and takes energy; its battery is
followed over all cycles: what is drawn, lost in years, kept back by the cold.
"""

import dataclasses
import math
from dataclasses import dataclass, field, fields
from functools import cached_property
from statistics import NormalDist
from typing import Any

import numpy as np

from swimbladder.design.sizing.candidates import Batch
from swimbladder.errors import InputError, check_number
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.battery import needed_capacity, share_in_cold
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.electric import (
    electrical_power,
    largest_voltage,
    stall_depth,
    supply_current,
    winding_current,
)
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import Column
from swimbladder.physics.steady_drives import terminal_power
from swimbladder.units import read_numbers
from swimbladder.vehicle import Vehicle, Water

# Bounds of a dive's numbers, as `check_number` takes them.
_ABOVE, _LEAST, _WATER = {"above": 0.0}, {"least": 0.0}, {"least": -5.0, "most": 60.0}
_SHARE: dict[str, Any] = {"most": 1.0, "remedy": 'Write a share like "10 %", which is 0.1'}
_PART = _SHARE | {"below": 1.0}


@dataclass(frozen=True, kw_only=True)
class Dive:
    """The dive that is asked for, and how well the vehicle is known.

    max_depth [m], speed down and up [m/s], turn_time: from sinking to rising at depth [s],
    trim_std: 1 sigma of the neutral volume [m3], probability that the stroke covers it [-],
    antenna_volume: that lifts the antenna [m3], stroke_reserve [-], cycles, park_time per cycle
    [s], hotel load [W], surface_energy per cycle [J]. battery_low: share of the voltage at which it
    still has to work [-]; stall_reserve: how much deeper than `max_depth` the motor has to hold, as
    a share [-]. corrections: share by which a flown dive takes longer and more energy than the
    straight one [-]; surface_time per cycle [s]; battery_reserve: share of the battery that is not
    flown with [-]. battery_temperature: of the coldest water on the way [degC]; None: as the column
    of water has it. Each may be a text with a unit. Raises InputError where a number cannot be.
    """

    max_depth: float = field(metadata={"unit": "m", **_ABOVE})
    speed: float = field(default=0.1, metadata={"unit": "m/s", **_ABOVE})
    turn_time: float = field(default=600.0, metadata={"unit": "s", **_ABOVE})
    trim_std: float = field(default=20e-6, metadata={"unit": "m3", **_LEAST})
    probability: float = field(default=0.95, metadata=_ABOVE | _PART)
    antenna_volume: float = field(default=0.0, metadata={"unit": "m3", **_LEAST})
    stroke_reserve: float = field(default=0.1, metadata=_LEAST | _SHARE)
    cycles: int = field(default=200, metadata=_ABOVE)
    park_time: float = field(default=0.0, metadata={"unit": "s", **_LEAST})
    hotel: float = field(default=0.02, metadata={"unit": "W", **_LEAST})
    surface_energy: float = field(default=0.0, metadata={"unit": "J", **_LEAST})
    corrections: float = field(default=0.2, metadata=_LEAST | _SHARE)
    surface_time: float = field(default=900.0, metadata={"unit": "s", **_LEAST})
    battery_reserve: float = field(default=0.1, metadata=_LEAST | _PART)
    battery_temperature: float | None = field(default=None, metadata={"unit": "degC", **_WATER})
    battery_low: float = field(default=0.8, metadata=_ABOVE | _SHARE)
    stall_reserve: float = field(default=0.25, metadata=_LEAST)

    def __post_init__(self) -> None:
        read_numbers(self)
        for bounded in fields(self):
            name, value = bounded.name, getattr(self, bounded.name)
            check_number(value, name, **bounded.metadata)

    def to_dict(self) -> dict[str, Any]:
        """Return its numbers, with their units in the names."""
        return {self.called(one.name): getattr(self, one.name) for one in fields(self)}

    def called(self, name: str) -> str:
        """Return what one of its numbers is called in an answer: ``max_depth_m``."""
        unit = self.__dataclass_fields__[name].metadata.get("unit")
        return f"{name}_{unit.replace('/', '_')}" if unit else name

    @property
    def cycle_time(self) -> float:
        """Time of a cycle: down, parked, up and at the surface [s]."""
        way = 2.0 * self.max_depth / self.speed * (1.0 + self.corrections)
        return way + self.park_time + self.surface_time


_PLACES = 41  # depths at which the energy of a cycle is summed up


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """What a dive asks of the drive.

    depth [m], pressure [Pa] and moved [m3]: where in a cycle how much volume has to be pressed
    out, all [n]. neutral: the change of the neutral volume from the surface down [m3] [n]. drive:
    volume that keeps the speed, mean of down and up [m3], trim: half-width that is covered [m3],
    stroke: from stop to stop [m3], lowest: where the inner stop is, counted from neutral at the
    surface [m3], rate: while pressing out at `depth` [m3/s], coldest: water on the way [degC].
    """

    dive: Dive
    depth: Array
    pressure: Array
    moved: Array
    neutral: Array
    drive: float
    trim: float
    stroke: float
    lowest: float
    rate: float
    coldest: float

    @property
    def bottom_pressure(self) -> float:
        """Pressure at the depth asked for [Pa above the atmosphere]."""
        return float(self.pressure[-1])

    @property
    def shares(self) -> dict[str, float]:
        """What the stroke is made of [m3]."""
        spread = float(np.ptp(self.neutral))
        total = spread + 2.0 * self.drive + 2.0 * self.trim
        freeboard = self.stroke / (1.0 + self.dive.stroke_reserve) - total
        return {
            "water and hull": spread,
            "speed down and up": 2.0 * self.drive,
            "trim not known": 2.0 * self.trim,
            "freeboard": max(freeboard, 0.0),
            "reserve": self.stroke * (1.0 - 1.0 / (1.0 + self.dive.stroke_reserve)),
        }


def requirements(body: Vehicle, column: Column, dive: Dive) -> Requirements:
    """Return what a dive of a body through a column of water asks of its drive.

    The stroke covers: the neutral volume from the surface to the depth; the volume that drives the
    body down and up at the wanted speed, F_d(w)/(rho g), eq. (16); the trim that is not known, with
    the wanted probability (it is normal and known by its deviation); the freeboard. In a cycle, 2
    drive volumes are pressed out at the depth (one to stop, one to rise), what the neutral volume
    grows by on the way down and on the way up, where it does, and the freeboard at the surface. The
    rate is that of the turn, or that of a neutral volume that grows on the way down: a vehicle that
    does not keep up with it sinks ever faster. Raises InputError where the
    column ends above the depth.
    """
    if column.depth[-1] < dive.max_depth * (1.0 - 1e-9):
        what = f"the water is known down to {column.depth[-1]:.6g} m only"
        remedy = "Give a cast that reaches the depth, or a smaller depth"
        raise InputError(what, field="max_depth", value=dive.max_depth, unit="m", remedy=remedy)
    grid = np.linspace(0.0, dive.max_depth, _PLACES)
    at = np.interp(grid, column.depth, neutral_volume(body, column))
    neutral = at - at[0]
    pressure = np.interp(grid, column.depth, column.pressure)
    density = np.interp(grid, column.depth, column.density)
    light = float(density.min()) * column.gravity
    down, up = (abs(drag_force(body.drag, w)) / light for w in (dive.speed, -dive.speed))
    drive = 0.5 * (down + up)
    trim = NormalDist().inv_cdf(0.5 + 0.5 * dive.probability) * dive.trim_std
    lowest = float(neutral.min()) - down - trim
    highest = max(float(neutral.max()) + up, dive.antenna_volume) + trim
    stroke = (highest - lowest) * (1.0 + dive.stroke_reserve)
    moved = np.zeros_like(grid)
    moved[-1] = 2.0 * drive
    change = np.diff(neutral)
    moved[1:] += np.maximum(change, 0.0)  # on the way down: a hull that gives way, trapped air
    moved[:-1] += np.maximum(-change, 0.0)  # on the way up
    moved[0] += max(dive.antenna_volume - up, 0.0)
    way = column.temperature[column.depth <= dive.max_depth]
    return Requirements(
        dive=dive,
        coldest=float(way.min()) if dive.battery_temperature is None else dive.battery_temperature,
        depth=grid,
        pressure=pressure,
        moved=moved,
        neutral=neutral,
        drive=drive,
        trim=trim,
        stroke=stroke,
        lowest=lowest - (highest - lowest) * dive.stroke_reserve / 2.0,
        rate=max(2.0 * drive / dive.turn_time, float(np.max(change / np.diff(grid))) * dive.speed),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Budget:
    """The energy of new cells at 20 degC that is carried, and its parts [J] [n].

    carried is the sum of drawn by drive and loads, of it driver_loss and driver_standby;
    self_discharged over all cycles; cold: what the coldest water keeps back; reserve, not flown
    with; unusable at any temperature. life: what self-discharge alone leaves over what has to be
    left [-]; no battery is large enough where it is below 1.
    """

    carried: Array
    drawn: Array
    driver_loss: Array
    driver_standby: Array
    self_discharged: Array
    cold: Array
    reserve: Array
    unusable: Array
    life: Array


def budget(b: Batch, asked: Requirements, *, cycle: Array, driver_loss: Array) -> Budget:
    """Return what a battery has to carry for all cycles, by the battery of missions.

    cycle: energy of the drive in one, driver_loss in it [J] [n]. The charge C obeys
    dC/dt = -P - s C from the full capacity, which the charge that cannot be drawn in the coldest
    water and the reserve of what can are left of (`swimbladder.physics.battery`).
    """
    dive = asked.dive
    duration = dive.cycles * dive.cycle_time
    standby = np.full(len(b.of), b.driver.standby_power * duration)
    hotel = dive.cycles * (dive.hotel * dive.cycle_time + dive.surface_energy)
    drawn = dive.cycles * cycle + hotel + standby
    warm = share_in_cold(b.number("battery", "cold_share"), asked.coldest)
    flown = warm * (1.0 - dive.battery_reserve)
    lost = b.number("battery", "self_discharge")
    capacity = needed_capacity(drawn, duration, flown, lost)
    usable = b.number("battery", "usable")
    with np.errstate(invalid="ignore", divide="ignore"):
        return Budget(
            carried=capacity / usable,
            drawn=drawn,
            driver_loss=dive.cycles * driver_loss,
            driver_standby=standby,
            self_discharged=capacity * flown - drawn,
            cold=capacity * (1.0 - warm),
            reserve=capacity * warm * dive.battery_reserve,
            unusable=capacity / usable - capacity,
            life=np.where(flown > 0.0, np.exp(-lost * duration) / (1.0 - flown), 0.0),
        )


_PACES = (1.0, 2.0, 4.0, 8.0)

REQUIREMENTS = {
    "battery power": "the power that the battery can give",
    "voltage": "the voltage that the wanted rate takes at the depth, from a low battery",
    "stall": "the depth that a low battery can still hold, against the depth and its reserve",
    "motor torque": "the torque that the motor stands for hours",
    "motor speed": "the speed that the motor may turn at",
    "pump pressure": "the pressure that the pump may work against",
    "pump speed": "the speed that the pump may turn at",
    "screw force": "the axial load of the screw",
    "gear torque": "the torque of the gear's output",
    "piston travel": "the longest travel that there is room for",
    "battery life": "the charge that time alone leaves, against what cold and reserve keep back",
    "stroke": "the room that the body has for the stroke, half of what it displaces",
    "mass": "the mass that drive and battery may have together, that of the body at most",
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Evaluation:
    """Candidates against requirements, arrays [n].

    margins: what a candidate can over what is asked, by requirement; at least 1 is good enough.
    rate [m3/s] at the depth, motor speed [rad/s], voltage [V] and current [A] there, energy per
    volume [J/m3], energy per cycle of the drive [J], spent: where the battery goes,
    battery_mass and mass [kg], stall [m], travel of the piston [m] (0 for none).
    """

    margins: dict[str, Array]
    rate: Array
    speed: Array
    voltage: Array
    current: Array
    energy_per_volume: Array
    cycle_energy: Array
    holding_power: Array
    spent: Budget
    battery_mass: Array
    mass: Array
    stall: Array
    turn_time: Array
    travel: Array

    @property
    def battery_energy(self) -> Array:
        """Energy of new cells at 20 degC that has to be carried [J] [n]."""
        return self.spent.carried

    @cached_property
    def worst(self) -> Array:
        """The smallest margin of each candidate [n]."""
        return np.asarray(np.min(np.stack(list(self.margins.values())), axis=0))

    def tightest(self, index: int) -> str:
        """Return the requirement of which a candidate has the smallest margin."""
        return min(self.margins, key=lambda name: self.margins[name][index])

    @property
    def feasible(self) -> Flags:
        """Whether a candidate meets every requirement [n]."""
        return self.worst >= 1.0


def evaluate(
    batch: Batch, asked: Requirements, water: Water, limits: tuple[float, float, float]
) -> Evaluation:
    """Return how each candidate meets what is asked, at the pace that makes it lightest.

    A pace is a multiple of the wanted rate: a faster motor holds its load for a shorter time, until
    friction and the battery's resistance take more than that saves. The driver holds the speed at
    that rate q: u = (k_v omega + k_z z + T_b)/k_u with omega = (q + k_l z)/k_q, eqs (11)-(12) at
    rest; z stands for the pressure. limits: longest travel of the piston [m]; largest mass of drive
    and battery [kg] and largest stroke [m3], what the body has room for.
    """
    each = np.ones(len(batch.of))
    paces = [_at_pace(batch, asked, water, pace * each, limits) for pace in _PACES]
    scores = np.array([np.where(p.feasible, p.mass, np.inf) for p in paces])
    lightest, nearest = np.argmin(scores, axis=0), np.argmax([p.worst for p in paces], axis=0)
    which = np.where(np.isfinite(scores).any(axis=0), lightest, nearest)
    return _at_pace(batch, asked, water, np.array(_PACES)[which], limits)


def _at_pace(
    batch: Batch, asked: Requirements, water: Water, pace: Array, limits: tuple[float, float, float]
) -> Evaluation:
    """Return how each does at its pace [n]; largest rate and stall do not depend on it."""
    dive = asked.dive
    piston_stroke, max_mass, largest_stroke = limits
    b: Any = batch  # the functions of `electric` take arrays for constants too
    rate = pace[:, np.newaxis] * asked.rate
    z = asked.pressure[np.newaxis, :] / water.specific_weight
    omega = (rate + b.k_l * z) / b.k_q
    torque = b.k_v * omega + b.k_z * z + b.friction_torque
    u = torque / b.k_u
    i = winding_current(u=u, omega=omega, R=b.resistance, k_emf=b.emf_constant)
    with np.errstate(invalid="ignore"):
        P = electrical_power(u=u, i=i)
        P = terminal_power(P, b.driver)
        i_b = supply_current(P=P, E=b.supply, R_b=b.battery_resistance)
    per_volume = b.supply * i_b / rate
    bottom = z[:, -1]
    E_low, sag = dive.battery_low * b.supply, b.battery_resistance / b.resistance
    emf = (b.emf_constant * omega)[:, -1]
    available = largest_voltage(E=E_low[:, 0], sag=sag[:, 0], emf=emf)
    load, friction = (b.k_z / b.k_u)[:, 0], (b.friction_torque / b.k_u)[:, 0]
    deepest = stall_depth(E=E_low[:, 0], sag=sag[:, 0], load=load, friction=friction)
    speed = omega[:, -1]
    shaft = b.emf_constant[:, 0] * i[:, -1]
    stroke, pressure = asked.stroke, asked.bottom_pressure
    area = b.number("piston", "area")
    travel = stroke / area
    screw = np.isfinite(area)
    force = pressure * np.where(screw, area, 0.0)
    output = force * np.where(screw, b.number("screw", "lead"), 0.0) / (2.0 * math.pi)
    output = output / np.where(screw, b.number("screw", "efficiency"), 1.0)
    amplified = b.number("amplifier", "area_ratio")
    pump_pressure = np.where(np.isfinite(amplified), pressure / amplified, 0.0)
    holding = _holding(b, z[:, -1])
    resting = np.where(screw, 0.0, b.number("pump", "at_rest"))
    seeps = resting * pressure / np.where(screw, 1.0, amplified**2)

    def per_cycle(energy: Array, held: Array) -> Array:
        """Return what a cycle takes [J] of an energy per volume [J/m3] and of holding [W]."""
        pressed: Array = np.sum(asked.moved * energy, axis=1)
        return pressed * (1.0 + dive.corrections) + (held + seeps * energy[:, -1]) * dive.park_time

    cycle = per_cycle(per_volume, holding)
    lost = 1.0 - b.driver.efficiency
    spent = budget(b, asked, cycle=cycle, driver_loss=lost * per_cycle(P / rate, holding))
    battery_mass = spent.carried / b.number("battery", "specific_energy")
    mass = b.drive_mass + battery_mass
    with np.errstate(divide="ignore", invalid="ignore"):
        margins = {
            "battery power": b.supply[:, 0] ** 2
            / (4.0 * b.battery_resistance[:, 0] * np.maximum(P[:, -1], 1e-12)),
            "voltage": available / u[:, -1],
            "stall": deepest / (bottom * (1.0 + dive.stall_reserve)),
            "motor torque": b.number("motor", "rated_torque") / shaft,
            "motor speed": b.number("motor", "largest_speed") / speed,
            "pump pressure": b.number("pump", "largest_pressure") / pump_pressure,
            "pump speed": b.number("pump", "largest_speed") / speed,
            "screw force": b.number("screw", "largest_force") / force,
            "gear torque": b.number("gear", "rated_torque") / output,
            "piston travel": piston_stroke / travel,
            "battery life": spent.life,
            "stroke": np.full(len(mass), largest_stroke / stroke),
            # with a battery that cannot be, it is that which is in the way
            "mass": np.where(np.isfinite(mass), max_mass / mass, np.inf),
        }
    fastest = _largest_rate(b, z[:, -1], available)
    return Evaluation(
        margins=margins,
        rate=rate[:, 0],
        speed=speed,
        voltage=u[:, -1],
        current=i[:, -1],
        energy_per_volume=per_volume[:, -1],
        cycle_energy=cycle,
        holding_power=holding,
        spent=spent,
        battery_mass=battery_mass,
        mass=mass,
        stall=deepest,
        turn_time=np.where(fastest > 0.0, 2.0 * asked.drive / np.maximum(fastest, 1e-300), np.inf),
        travel=travel,
    )


def _holding(b: Batch, z: Array) -> Array:
    """Power [W] that holds a back-drivable screw at the depth's pressure; pumps have valves.

    The sea turns the motor back with eta^2 k_z z, less dry friction; holding it takes that torque
    over k_T as a current, which is all lost in the winding, and in the driver before.
    """
    back = b.efficiency[:, 0] ** 2 * b.k_z[:, 0] * z - b.friction_torque[:, 0]
    current = np.maximum(back, 0.0) / b.emf_constant[:, 0]
    screw = np.isfinite(b.number("piston", "area"))
    return np.where(screw, terminal_power(current**2 * b.resistance[:, 0], b.driver), 0.0)


def _largest_rate(b: Batch, z: Array, available: Array) -> Array:
    """Rate [m3/s] at the depth at the voltage of a low battery and within the speeds allowed."""
    spare = b.k_u[:, 0] * available - b.k_z[:, 0] * z - b.friction_torque[:, 0]
    omega = np.maximum(spare, 0.0) / b.k_v[:, 0]
    omega = np.minimum(omega, b.number("motor", "largest_speed"))
    omega = np.minimum(omega, b.number("pump", "largest_speed"))
    return np.asarray(b.k_q[:, 0] * omega - b.k_l[:, 0] * z)
