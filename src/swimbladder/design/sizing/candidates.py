"""Every combination of parts that makes a drive, as arrays of the unified actuator's constants."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.sizing.parts import (
    Amplifier,
    BatteryKind,
    Gear,
    MotorPart,
    Parts,
    Piston,
    Pump,
    Screw,
)
from swimbladder.physics.actuator import unified
from swimbladder.vehicle import (
    Driver,
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    HydraulicDrive,
    ScrewDrive,
    Water,
)

Array = NDArray[np.float64]

PARTS = (  # what a drive is made of, in the order of tables and pictures
    "kind", "motor", "winding", "supply", "battery", "pump", "amplifier", "gear", "screw", "piston",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Combination:
    """One drive made of parts: hydraulic (pump, amplifier) or screw (gear, screw, piston)."""

    motor: MotorPart
    winding: float  # V, nominal voltage of the winding
    supply: float  # V
    battery: BatteryKind
    pump: Pump | None = None
    amplifier: Amplifier | None = None
    gear: Gear | None = None
    screw: Screw | None = None
    piston: Piston | None = None

    @property
    def kind(self) -> str:
        """The kind of actuator that the vehicle file gets."""
        return "pump-valve" if self.pump is not None else "electromechanical"

    @property
    def actuator(self) -> ElectrohydraulicActuator | ElectromechanicalActuator:
        """The actuator that these parts make."""
        motor = self.motor.wound(self.winding)
        if self.pump is not None:
            assert self.amplifier is not None
            return ElectrohydraulicActuator(
                motor=motor,
                drive=HydraulicDrive(
                    pump_displacement=self.pump.displacement,
                    pump_efficiency=self.pump.efficiency * self.amplifier.efficiency,
                    area_ratio=self.amplifier.area_ratio,
                    pump_leakage=self.pump.leakage,
                    reflected_inertia=self.pump.reflected_inertia,
                    viscous_friction=self.pump.viscous_friction,
                ),
            )
        assert self.gear is not None
        assert self.screw is not None
        assert self.piston is not None
        return ElectromechanicalActuator(
            motor=motor,
            drive=ScrewDrive(
                lead=self.screw.lead,
                gear_ratio=self.gear.ratio,
                efficiency=self.gear.efficiency * self.screw.efficiency,
                piston_area=self.piston.area,
            ),
        )

    @property
    def choices(self) -> dict[str, str]:
        """The name of each part, by what it is."""
        named = {
            "kind": self.kind,
            "motor": self.motor.name,
            "winding": f"{self.winding:g} V",
            "supply": f"{self.supply:g} V",
            "battery": self.battery.name,
        }
        for what in ("pump", "amplifier", "gear", "screw", "piston"):
            part = getattr(self, what)
            if part is not None:
                named[what] = part.name
        return named

    @property
    def drive_mass(self) -> float:
        """Mass of all parts but the battery [kg]."""
        parts = (self.motor, self.pump, self.amplifier, self.gear, self.screw, self.piston)
        return reduce(lambda mass, part: mass + (0.0 if part is None else part.mass), parts, 0.0)


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
    k_T: Array
    supply: Array
    battery_resistance: Array
    drive_mass: Array
    of_parts: Mapping[tuple[str, str], Array]
    driver: Driver

    def number(self, part: str, what: str) -> Array:
        """Return the number `what` of each combination's `part`, infinite without one, [n]."""
        return self.of_parts[part, what]


def combinations(parts: Parts, water: Water) -> Batch:
    """Return every drive that the list of parts can make: hydraulic ones, then screws."""
    electric = list(product(parts.motors, parts.windings, parts.supplies, parts.batteries))
    none = Amplifier(name="none", area_ratio=1.0, efficiency=1.0, mass=0.0)
    hydraulic = list(product(parts.pumps, parts.amplifiers or (none,)))
    screws = list(product(parts.gears, parts.screws, parts.pistons))
    found: list[Combination] = []
    for motor, winding, supply, battery in electric:
        common: dict[str, Any] = {
            "motor": motor, "winding": winding * supply, "supply": supply, "battery": battery,
        }  # fmt: skip
        found += [Combination(**common, pump=pump, amplifier=amp) for pump, amp in hydraulic]
        found += [
            Combination(**common, gear=gear, screw=screw, piston=piston)
            for gear, screw, piston in screws
        ]
    return _batch(found, water, parts.driver)


def _batch(found: list[Combination], water: Water, driver: Driver) -> Batch:
    """Return the combinations' constants; each drive is worked out once, not per battery."""
    known: dict[tuple[float | int, ...], tuple[float, ...]] = {}
    rows = []
    for c in found:
        key = (c.winding, *(id(getattr(c, part)) for part in _DRIVE))
        if key not in known:
            a = unified(c.actuator, water)
            known[key] = (
                a.k_u, a.k_v, a.k_q, a.k_z, a.k_l, a.friction_torque,
                1.0 if a.efficiency is None else a.efficiency, a.resistance or np.nan,
                a.emf_constant or np.nan,
            )  # fmt: skip
        rows.append((*known[key], c.supply, c.supply * c.battery.resistance))
    columns = np.array(rows, float).T[..., np.newaxis]
    return Batch(
        of=found, **dict(zip(_CONSTANTS, columns, strict=True)),
        drive_mass=np.array([c.drive_mass for c in found]),
        of_parts={(part, what): _number(found, part, what) for part, what in _NUMBERS},
        driver=driver,
    )  # fmt: skip


def _number(found: list[Combination], part: str, what: str) -> Array:
    return np.array(
        [math.inf if (p := getattr(c, part)) is None else getattr(p, what) for c in found]
    )


_NUMBERS = (
    ("motor", "rated_torque"), ("motor", "largest_speed"), ("pump", "largest_pressure"),
    ("pump", "largest_speed"), ("pump", "at_rest"), ("amplifier", "area_ratio"),
    ("gear", "rated_torque"), ("screw", "largest_force"), ("screw", "lead"),
    ("screw", "efficiency"), ("piston", "area"), ("battery", "usable"),
    ("battery", "specific_energy"), ("battery", "cold_share"), ("battery", "self_discharge"),
)  # fmt: skip
_CONSTANTS = (
    "k_u", "k_v", "k_q", "k_z", "k_l", "friction_torque", "efficiency", "resistance", "k_T",
    "supply", "battery_resistance",
)  # fmt: skip
_DRIVE = ("motor", "pump", "amplifier", "gear", "screw", "piston")
