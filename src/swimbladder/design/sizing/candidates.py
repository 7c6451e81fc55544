"""The parts that a buoyancy engine can be made of, and every drive that they make.

Parts are as catalogues describe them; `combinations` returns the drives as arrays of the unified
actuator's constants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from swimbladder.errors import InputError
from swimbladder.io.config import file_text, read_model
from swimbladder.physics.actuator import unified
from swimbladder.physics.arrays import Array
from swimbladder.vehicle import (
    Driver,
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    HydraulicDrive,
    Motor,
    Parameters,
    ScrewDrive,
    Unit,
    Water,
)

_Name = Annotated[str, Field(min_length=1)]
_Positive = Field(gt=0.0)
_Mass = Annotated[float, Unit("kg"), Field(ge=0.0)]
_Share = Annotated[float, Unit(""), Field(gt=0.0, le=1.0)]
_Speed = Annotated[float, Unit("rad/s"), _Positive]
_Torque = Annotated[float, Unit("N m"), _Positive]
_Volts = Annotated[float, Unit("V"), _Positive]
_Leakage = Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)]
_Viscous = Annotated[float, Unit("N m s/rad"), Field(ge=0.0)]


class Part(Parameters):
    """A part of a drive."""

    name: _Name
    """what it is called"""
    mass: _Mass
    """its mass"""


class MotorPart(Part):
    """A DC motor as its data sheet lists it for one winding."""

    voltage: _Volts
    """nominal voltage of the winding that the numbers are for"""
    resistance: Annotated[float, Unit("ohm"), _Positive]
    """of that winding"""
    torque_constant: Annotated[float, Unit("N m/A"), _Positive]
    """of that winding"""
    rotor_inertia: Annotated[float, Unit("kg m2"), _Positive]
    """of the rotor"""
    viscous_friction: _Viscous = 0.0
    """loss in proportion to speed"""
    friction_torque: Annotated[float, Unit("N m"), Field(ge=0.0)] = 0.0
    """dry friction"""
    rated_torque: _Torque
    """torque that it stands for hours"""
    largest_speed: _Speed
    """speed that it may turn at"""

    def wound(self, voltage: float) -> Motor:
        """Return the motor with a winding for another nominal voltage [V].

        The same copper in more, thinner turns: the torque constant goes with the voltage, the
        resistance with its square, and the losses at a torque stay what they are.
        """
        scale = voltage / self.voltage
        return Motor(
            resistance=self.resistance * scale * scale,
            torque_constant=self.torque_constant * scale,
            rotor_inertia=self.rotor_inertia,
            viscous_friction=self.viscous_friction,
            friction_torque=self.friction_torque,
        )


class Pump(Part):
    """A pump of constant displacement."""

    displacement: Annotated[float, Unit("m3/rev"), _Positive]
    """D_p"""
    efficiency: _Share
    """mechanical efficiency eta_p"""
    leakage: _Leakage = 0.0
    """k_pl"""
    resting_leakage: _Leakage | None = None
    """leakage while it rests, behind its check valve; not given: as while it runs"""
    reflected_inertia: Annotated[float, Unit("kg m2"), Field(ge=0.0)] = 0.0
    """of the pump at its shaft"""
    viscous_friction: _Viscous = 0.0
    """loss in proportion to speed"""
    largest_pressure: Annotated[float, Unit("Pa"), _Positive]
    """pressure it may work against"""
    largest_speed: _Speed
    """speed that it may turn at"""

    @property
    def at_rest(self) -> float:
        """Leakage while it rests [m3/s/Pa]."""
        return self.leakage if self.resting_leakage is None else self.resting_leakage


class Amplifier(Part):
    """Two pistons on a rod between pump and water; area ratio 1 and no mass: none at all."""

    area_ratio: Annotated[float, Unit(""), _Positive]
    """n_h = A1/A2"""
    efficiency: _Share
    """share of the work that its seals let through"""


class Gear(Part):
    """A reduction gear between motor and screw."""

    ratio: Annotated[float, Unit(""), Field(ge=1.0)]
    """motor turns per turn"""
    efficiency: _Share
    """its efficiency"""
    rated_torque: _Torque
    """torque that its output stands"""


class Screw(Part):
    """A spindle with its nut."""

    lead: Annotated[float, Unit("m/rev"), _Positive]
    """travel per turn"""
    efficiency: _Share
    """from turning to travel"""
    largest_force: Annotated[float, Unit("N"), _Positive]
    """axial load"""


class Piston(Part):
    """A piston in contact with the water."""

    area: Annotated[float, Unit("m2"), _Positive]
    """area in the water"""
    mass: _Mass
    """its mass, with its cylinder"""


class BatteryKind(Parameters):
    """Cells of one chemistry, as a pack."""

    name: _Name
    """what it is called"""
    specific_energy: Annotated[float, Unit("J/kg"), _Positive]
    """energy per mass of the pack"""
    usable: _Share
    """share of it that can be taken out at 20 degC"""
    resistance: Annotated[float, Unit("ohm/V"), Field(ge=0.0)] = 0.0
    """internal resistance per open-circuit voltage"""
    cold_share: _Share = 1.0
    """share of what can be taken out at 20 degC that 0 degC leaves"""
    self_discharge: Annotated[float, Unit("1/s"), Field(ge=0.0, le=1e-6)] = 0.0
    """share of what is in it that is lost per time"""


class Parts(Parameters):
    """A list of parts; a vehicle is sized from what is in it and nothing else."""

    schema_version: Literal[1] = 1
    """version of this file's format"""
    provenance: dict[str, str] = Field(default_factory=dict)
    '''where the numbers come from: table = "source"'''
    supplies: Annotated[tuple[_Volts, ...], Field(min_length=1)]
    """battery voltages to try"""
    windings: Annotated[tuple[Annotated[float, Unit(""), _Positive], ...], Field(min_length=1)] = (
        1.0,
    )
    """windings to try, by their nominal voltage over the supply's"""
    motors: Annotated[tuple[MotorPart, ...], Field(min_length=1)]
    """motors"""
    pumps: tuple[Pump, ...] = ()
    """pumps"""
    amplifiers: tuple[Amplifier, ...] = ()
    """pressure amplifiers, or none"""
    gears: tuple[Gear, ...] = ()
    """gears"""
    screws: tuple[Screw, ...] = ()
    """screws"""
    pistons: tuple[Piston, ...] = ()
    """pistons"""
    batteries: Annotated[tuple[BatteryKind, ...], Field(min_length=1)]
    """kinds of batteries"""
    driver: Driver = Driver()
    """the motor's driver; not given: it loses nothing"""

    def with_driver(
        self, efficiency: float | None = None, standby_power: float | None = None
    ) -> Parts:
        """Return the list with another driver, or some of its numbers; raises InputError."""
        asked = {"efficiency": efficiency, "standby_power": standby_power}
        given = {name: value for name, value in asked.items() if value is not None}
        if not given:
            return self
        source = "asked for: " + " and ".join(name.replace("_", " ") for name in given)
        if len(given) < len(asked):
            source += "; the rest " + self.provenance.get("driver", "as in the list of parts")
        driver = Driver(**{**self.driver.model_dump(), **given})
        provenance = {**self.provenance, "driver": source}
        return self.model_copy(update={"driver": driver, "provenance": provenance})


def load_parts(path: str | Path | None = None) -> Parts:
    """Return the list of parts of a TOML file.

    Parameters
    ----------
    path
        Of the file; none: the list that comes with swimbladder.

    Returns
    -------
    Parts
        What `size` combines.

    Raises
    ------
    InputError
        The file cannot be read, with file, line, field, value, unit and remedy; or neither a pump
        nor a whole screw drive is in it.
    """
    if path is None:
        text = resources.files(__package__).joinpath("parts.toml").read_text(encoding="utf-8")
        return read_model(Parts, text, "parts.toml of swimbladder")
    parts = read_model(Parts, file_text(Path(path)), path)
    if not parts.pumps and not (parts.gears and parts.screws and parts.pistons):
        what = "neither a pump nor a whole screw drive (gear, screw and piston) is in the list"
        remedy = "Add [[pumps]] (and [[amplifiers]]), or [[gears]], [[screws]] and [[pistons]]"
        raise InputError(what, file=path, field="pumps", remedy=remedy)
    return parts


class Hydraulic(NamedTuple):
    """What a motor turns to press oil."""

    pump: Pump
    amplifier: Amplifier

    def driven_by(self, motor: Motor) -> ElectrohydraulicActuator:
        """Return the actuator that these parts make with a motor."""
        pump, amplifier = self
        drive = HydraulicDrive(
            pump_displacement=pump.displacement,
            pump_efficiency=pump.efficiency * amplifier.efficiency,
            area_ratio=amplifier.area_ratio,
            pump_leakage=pump.leakage,
            reflected_inertia=pump.reflected_inertia,
            viscous_friction=pump.viscous_friction,
        )
        return ElectrohydraulicActuator(motor=motor, drive=drive)


class Spindle(NamedTuple):
    """What a motor turns to push a piston."""

    gear: Gear
    screw: Screw
    piston: Piston

    def driven_by(self, motor: Motor) -> ElectromechanicalActuator:
        """Return the actuator that these parts make with a motor."""
        gear, screw, piston = self
        eta = gear.efficiency * screw.efficiency
        drive = ScrewDrive(
            lead=screw.lead, gear_ratio=gear.ratio, efficiency=eta, piston_area=piston.area
        )
        return ElectromechanicalActuator(motor=motor, drive=drive)


_ELECTRIC = ("kind", "motor", "winding", "supply", "battery")
# What a drive is made of, in the order of tables and pictures.
PARTS = (*_ELECTRIC, *Hydraulic._fields, *Spindle._fields)


class Combination(NamedTuple):
    """One drive made of parts."""

    motor: MotorPart
    winding: float  # V, nominal voltage of the winding
    supply: float  # V
    battery: BatteryKind
    drive: Hydraulic | Spindle

    @property
    def kind(self) -> str:
        """The kind of actuator that the vehicle file gets."""
        return "pump-valve" if isinstance(self.drive, Hydraulic) else "electromechanical"

    @property
    def actuator(self) -> ElectrohydraulicActuator | ElectromechanicalActuator:
        """The actuator that these parts make."""
        return self.drive.driven_by(self.motor.wound(self.winding))

    @property
    def choices(self) -> dict[str, str]:
        """The name of each part, by what it is."""
        volts = f"{self.winding:g} V", f"{self.supply:g} V"
        names = (self.kind, self.motor.name, *volts, self.battery.name)
        moved = {what: part.name for what, part in self.drive._asdict().items()}
        return dict(zip(_ELECTRIC, names, strict=True)) | moved

    @property
    def drive_mass(self) -> float:
        """Mass of all parts but the battery [kg]."""
        return sum((part.mass for part in self.drive), self.motor.mass)

    def number(self, part: str, what: str) -> float:
        """Return the number `what` of a part, infinite without one."""
        owner = getattr(self if part in self._fields else self.drive, part, None)
        return math.inf if owner is None else float(getattr(owner, what))


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Combinations and their constants, each array [n, 1], to stand against depths [m]."""

    of: list[Combination]
    k_u: Array
    k_v: Array
    k_q: Array
    k_z: Array
    k_l: Array
    friction_torque: Array
    efficiency: Array
    resistance: Array
    emf_constant: Array
    supply: Array
    battery_resistance: Array
    drive_mass: Array
    driver: Driver
    of_parts: dict[tuple[str, str], Array] = field(default_factory=dict)

    def number(self, part: str, what: str) -> Array:
        """Return the number `what` of each combination's `part`, infinite without one, [n]."""
        if (part, what) not in self.of_parts:
            self.of_parts[part, what] = np.array([c.number(part, what) for c in self.of])
        return self.of_parts[part, what]


def combinations(parts: Parts, water: Water) -> Batch:
    """Return every drive that the list of parts can make: hydraulic ones, then screws."""
    none = Amplifier(name="none", area_ratio=1.0, efficiency=1.0, mass=0.0)
    drives: list[Hydraulic | Spindle] = []
    drives += [Hydraulic(*of) for of in product(parts.pumps, parts.amplifiers or (none,))]
    drives += [Spindle(*of) for of in product(parts.gears, parts.screws, parts.pistons)]
    electric = (parts.motors, parts.windings, parts.supplies, parts.batteries)
    found = [
        Combination(motor, winding * supply, supply, battery, drive)
        for motor, winding, supply, battery, drive in product(*electric, drives)
    ]
    return _batch(found, water, parts.driver)


def _batch(found: list[Combination], water: Water, driver: Driver) -> Batch:
    """Return the combinations' constants; each drive is worked out once, not per battery."""
    known: dict[tuple[Any, ...], list[float]] = {}
    rows = []
    for c in found:
        key = (c.winding, id(c.motor), *map(id, c.drive))
        if key not in known:
            drive = unified(c.actuator, water)
            known[key] = [getattr(drive, name) for name in _CONSTANTS]
        rows.append((*known[key], c.supply, c.supply * c.battery.resistance))
    *constants, supply, resistance = np.array(rows, float).T[..., np.newaxis]
    return Batch(
        of=found,
        **dict(zip(_CONSTANTS, constants, strict=True)),
        supply=supply,
        battery_resistance=resistance,
        drive_mass=np.array([c.drive_mass for c in found]),
        driver=driver,
    )


_TORQUES = ("k_u", "k_v", "k_q", "k_z", "k_l", "friction_torque")
_CONSTANTS = (*_TORQUES, "efficiency", "resistance", "emf_constant")
