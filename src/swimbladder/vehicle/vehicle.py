"""The vehicle as a whole: its parts, what it senses and what controls it."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from swimbladder.vehicle.actuators import (
    Driver,
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    IdentifiedActuator,
    Load,
    Positioner,
    Supply,
    UnifiedActuator,
)
from swimbladder.vehicle.body import (
    Drag,
    Hull,
    IdentifiedMotion,
    Motion,
    Stroke,
    Water,
)
from swimbladder.vehicle.hydraulics import DatasheetPump, PumpAndValve
from swimbladder.vehicle.identified import Identified
from swimbladder.vehicle.schema import Parameters, Unit, quantity_in, refusal

Actuator = Annotated[
    ElectrohydraulicActuator
    | ElectromechanicalActuator
    | UnifiedActuator
    | IdentifiedActuator
    | Positioner
    | PumpAndValve,
    Field(discriminator="kind"),
]


def _number_or_text(value: object) -> float | str:
    how = 'Write a number, or a text like "1002 V/dm3"'
    return value if isinstance(value, str) else quantity_in(value, "", how)


@lru_cache
def _laminar(k_dl: float) -> Drag:
    return Drag(law="linear", k_dl=k_dl)


LawNumbers = dict[str, Annotated[float | str, BeforeValidator(_number_or_text)]]
"""Parameters of a law by name, texts with units allowed."""


class Sensors(Parameters):
    """What the controller sees: white noise (1 sigma), then the quantum of the converter."""

    depth_noise: Annotated[float, Unit("m"), Field(ge=0.0, lt=1e3)] = 0.0
    """white noise of the measured depth, 1 sigma"""
    depth_quantum: Annotated[float, Unit("m"), Field(ge=0.0, lt=1e3)] = 0.0
    """step between two depths that the converter resolves"""
    volume_noise: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """white noise of the measured volume, 1 sigma"""
    volume_quantum: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """step between two volumes that the converter resolves"""


class Controller(Parameters):
    """A control law by name, its sample time and its parameters (texts with units allowed)."""

    law: str = Field(min_length=1)
    """name of the control law"""
    sample_time: Annotated[float, Unit("s"), Field(gt=0.0)]
    """time between two samples"""
    parameters: LawNumbers = Field(default_factory=dict)
    """parameters of the law, as it names them"""


class Supervisor(Parameters):
    """When the firmware's supervisor brings the vehicle up; what is not given follows from others.

    How each is derived: docs/explanation/supervisor.md. `swimbladder firmware` prints them all.
    """

    depth_limit: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """depth at which it does; not given: 0.9 of where full buoyancy, hull and motor (at
    `battery_low`) still do their part, less what is not known of the trim"""
    time_limit: Annotated[float, Unit("s"), Field(gt=0.0, le=3e9)] | None = None
    """time since the start at which it does; not given: never"""
    battery_low: Annotated[float, Unit("V"), Field(gt=0.0)] | None = None
    """voltage under load that is too low, for 10 s; not given: 0.8 of the supply's, or none for a
    positioner"""
    bottom_depth: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """where the vehicle may lie on the bottom; not given: nowhere, since a vehicle that lies there
    looks like one whose depth sensor has stopped"""
    neutral_range: Annotated[float, Unit("m3"), Field(gt=0.0)] | None = None
    """how far the neutral volume may be from `trim_error`, drift and layers of the water included;
    not given: a quarter of half the stroke, half of what is left above `trim_error` at most"""
    neutral_change: Annotated[float, Unit("m3"), Field(gt=0.0)] | None = None
    """how far the neutral volume may change in a dive from what its first minute showed, layers of
    the water included; not given: a fifth of `neutral_range`"""
    model_error: Annotated[float, Unit(""), Field(gt=0.0, lt=1.0)] = 0.3
    """share of the force on the vehicle, and of psi, that the model may miss"""
    patience: Annotated[float, Unit("s"), Field(gt=0.0, le=60.0)] = 5.0
    """how long a sensor may fail, or the actuator not follow"""
    late: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """age of a depth that is late; not given: two samples, at least 1 s"""
    frozen: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """time in which the very same depth means a frozen sensor; not given: what noise and quantum of
    the sensor make as good as impossible"""
    prove_after: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """a vehicle that begins to sink is pushed outward for a moment where its actuator has not shown
    for so long that it can, and so is one whose depth was the very same for so long; not given: 30
    s, or never where psi is not above 0"""
    hold_voltage: Annotated[float, Unit("V"), Field(ge=0.0)] | None = None
    """voltage that keeps the volume at its largest; not given: what the sea's load takes where it
    can just come up. 0 for a drive that holds by itself"""
    release_time: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """time of full buoyancy in which it has to rise by 1 m before the drop weight is released; not
    given: twice that of the whole stroke and a minute"""


class Vehicle(Parameters):
    """A vehicle: everything that the simulator, the analysis and the controller need."""

    schema_version: Literal[1] = 1
    """version of this file's format"""
    name: str = Field(min_length=1)
    """what the vehicle is called"""
    description: str = ""
    """one sentence on the vehicle"""
    provenance: dict[str, str] = Field(default_factory=dict)
    '''where each number comes from: dotted field = "source"'''
    water: Water = Water()
    """the water around the vehicle"""
    actuator: Actuator
    """what changes the volume"""
    supply: Supply | None = None
    """the battery; a positioner does without"""
    driver: Driver | None = None
    """the motor's driver; without it the driver loses nothing"""
    loads: tuple[Load, ...] = ()
    """what else draws from the battery"""
    stroke: Stroke
    """end stops of the volume, counted from mid-stroke"""
    hull: Hull
    """the body"""
    motion: Motion
    """mass and drag"""
    trim_error: Annotated[float, Unit("m3")] = 0.0
    """volume at which the vehicle is neutral at the surface; 0 is mid-stroke"""
    sensors: Sensors = Sensors()
    """what the controller sees"""
    controller: Controller | None = None
    """what closes the loop"""
    supervisor: Supervisor = Supervisor()
    """when the firmware brings the vehicle up whatever the law says"""
    identified: Identified | None = None
    """how sure the identified numbers are, and the noise of the logs"""

    @property
    def mass(self) -> float:
        """Mass that is accelerated: dry, entrained and added [kg]."""
        if isinstance(self.motion, IdentifiedMotion):
            return self.water.specific_weight * self.motion.T2 / self.motion.K2
        return self.motion.dry_mass + self.motion.entrained_mass + self.motion.added_mass

    @property
    def drag(self) -> Drag:
        """The drag law; laminar with k_dl = rho g/K2 where identified, eq. (28)."""
        if isinstance(self.motion, IdentifiedMotion):
            return _laminar(self.water.specific_weight / self.motion.K2)
        return self.motion.drag

    def with_sensors(self, **given: float) -> Vehicle:
        """Return the vehicle with other numbers of its sensors; raises InputError for bad ones."""
        sensors = Sensors(**{**self.sensors.model_dump(), **given})
        return self.model_copy(update={"sensors": sensors})

    @property
    def command(self) -> Literal["voltage", "volume", "volume change"]:
        """What a control law commands: a positioner's volume, a change for pump and valve."""
        if isinstance(self.actuator, PumpAndValve):
            return "volume change"
        return "volume" if isinstance(self.actuator, Positioner) else "voltage"

    @property
    def voltage_driven(self) -> bool:
        """Whether a command is a voltage."""
        return self.command == "voltage"

    @property
    def piston_area(self) -> float | None:
        """Area of the piston [m2]; None where there is none or it is not known."""
        actuator = self.actuator
        if isinstance(actuator, ElectromechanicalActuator):
            return actuator.drive.piston_area
        if isinstance(actuator, (Positioner, IdentifiedActuator)):
            return actuator.piston_area
        return None

    def neutral_volume(self, depth: float) -> float:
        """Return the volume at which the vehicle rests at `depth` [m], psi z + trim error [m3]."""
        return self.hull.psi * depth + self.trim_error

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.voltage_driven and self.supply is None:
            what = "a voltage-driven actuator needs a supply"
            raise refusal(what, "Add a table [supply] with the battery's voltage", "supply")
        if isinstance(self.actuator, PumpAndValve) and self.stroke.switch_margin:
            what = "a pump and a valve have no limit switches before the ends of their stroke here"
            remedy = "Leave it out; the pump stops at the end of its stroke"
            raise refusal(what, remedy, "stroke.switch_margin")
        self._electricity_fits()
        neutral = self.neutral_volume(max(self.hull.emergence_depth, 0.0))
        if not self.stroke.minimum < neutral < self.stroke.maximum:
            what = (
                f"the neutral volume at the surface, {neutral * 1e6:g} cm3, is outside the stroke "
                f"of {self.stroke.minimum * 1e6:g} to {self.stroke.maximum * 1e6:g} cm3: the "
                "vehicle can not both sink and rise"
            )
            remedy = "Trim the vehicle (trim_error), or give it a longer stroke"
            raise refusal(what, remedy, "trim_error")

    def _electricity_fits(self) -> None:
        """Refuse pumps without a supply and loads of the same name."""
        pump = self.actuator.pump if isinstance(self.actuator, PumpAndValve) else None
        if isinstance(pump, DatasheetPump) and self.supply is None:
            what = "a pump from datasheets needs a supply"
            raise refusal(what, "Add a table [supply] with the battery's voltage", "supply")
        names = [load.name for load in self.loads]
        for i, name in enumerate(names):
            if name in names[:i]:
                what = "two loads have the same name"
                raise refusal(what, "Give each load its own name", "loads", i, "name")
