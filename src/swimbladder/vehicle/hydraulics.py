"""An electrohydraulic drive as built: a pump that runs or not, a valve, a check valve."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from swimbladder.vehicle.actuators import HydraulicDrive, Motor, Oil
from swimbladder.vehicle.schema import Parameters, Unit, refusal

_ATMOSPHERE = 101325.0  # Pa, at which the share of trapped air counts
_VACUUM = 1e3  # Pa; a gas rotary pump goes no lower, and oil gives off what it has dissolved


class PowerLawPump(Parameters):
    """A pump as measured: delivery and electrical power, both linear in the pressure it beats.

    The power is that at the supply's terminals while it runs, its driver's loss included.
    `swimbladder energy --fit` finds these numbers in logged runs.
    """

    kind: Literal["power-law"] = "power-law"
    delivery: Annotated[float, Unit("m3/s"), Field(gt=0.0)]
    """volume pressed out per time against no pressure"""
    slip: Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)] = 0.0
    """delivery lost per pressure while it runs; through it `line` empties at rest"""
    idle_power: Annotated[float, Unit("W"), Field(ge=0.0)]
    """electrical power while it runs against no pressure"""
    power_per_pressure: Annotated[float, Unit("W/Pa"), Field(ge=0.0)]
    """what the electrical power grows by per pressure"""
    power_per_temperature: Annotated[float, Unit("W/K"), Field(le=0.0, ge=-10.0)] = 0.0
    """what the electrical power grows by per kelvin above 15 degC, by which warm oil is thinner; 0
    or negative"""
    stall_pressure: Annotated[float, Unit("Pa"), Field(gt=0.0)] | None = None
    """pressure at which the motor stops or a relief valve opens; not given: where the slip takes
    all of the delivery"""


class DatasheetPump(Parameters):
    """A pump from the datasheets of motor and pump (eqs 3-8); it slips while it runs.

    Its mechanical efficiency over pressure follows from `pump_efficiency` (the part in proportion
    to pressure), the viscous friction and the dry friction, the volumetric one from the leakage.
    """

    kind: Literal["datasheet"] = "datasheet"
    motor: Motor
    """the motor"""
    drive: HydraulicDrive
    """pump and pressure amplifier"""
    speed: Annotated[float, Unit("rad/s"), Field(gt=0.0)] | None = None
    """motor speed that the driver holds while the supply's voltage allows; not given: full voltage
    """


Pump = Annotated[PowerLawPump | DatasheetPump, Field(discriminator="kind")]


class Valve(Parameters):
    """A valve that lets oil back into the hull: an orifice, its flow the root of the pressure."""

    flow: Annotated[float, Unit("m3/s/Pa^0.5"), Field(gt=0.0)]
    """volume let in per time and root of the pressure difference, C_d A (2/rho_oil)^0.5"""
    power: Annotated[float, Unit("W"), Field(ge=0.0)] = 0.0
    """electrical power while it is open"""


class PumpAndValve(Parameters):
    """A pump presses oil into the bladder, a valve lets it back, a check valve holds the volume.

    Its command is a change of volume, by the law `rate` or one like it; `faults` does not take it.
    """

    kind: Literal["pump-valve"] = "pump-valve"
    pump: Pump
    """the pump with its motor"""
    valve: Valve
    """the valve for small changes of volume"""
    bypass: Valve | None = None
    """a wide valve that empties the bladder at the surface"""
    line: Oil | None = None
    """the oil between pump and check valve, which has to come to the sea's pressure before anything
    is pressed out, and empties through the pump while it stands"""
    internal_pressure: Annotated[float, Unit("Pa"), Field(ge=0.0, le=2e5)] = 101325.0
    """absolute pressure of the gas around the oil reservoir in the hull"""
    leakage: Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)] = 0.0
    """volume that seeps in per time and pressure while nothing runs"""
    creep: Annotated[float, Unit("m3/s"), Field(ge=0.0, le=1e-6)] = 0.0
    """volume lost per time while nothing runs, whatever the pressure: oil that seeps back or cools,
    seals that settle; what is pumped out makes up for it"""
    quantum: Annotated[float, Unit("s"), Field(ge=0.0)] = 0.0
    """step of the time that pump and valve are on; also the shortest one"""
    start_volume: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """volume that each start of the pump falls short of its delivery, beside what `line` takes:
    running up, valves that close late"""
    longest_run: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """longest time the pump is on in one action; not given: no limit"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.longest_run is not None and self.longest_run < self.quantum:
            what = f"the longest run is below the quantum, {self.quantum:g} s"
            raise refusal(what, "Check both times", "longest_run")
        if self.line is not None:
            least = self.line.trapped_air * _ATMOSPHERE
            if self.internal_pressure <= max(least, _VACUUM):
                raise refusal(
                    "the line at rest would be full of the air in its oil, or of its vapour",
                    f"Give a pressure above {max(least, _VACUUM):g} Pa, or leave out actuator.line",
                    "internal_pressure",
                )
        pump = self.pump
        if isinstance(pump, DatasheetPump) and self.leakage > pump.drive.pump_leakage > 0.0:
            what = "more seeps in at rest than the pump lets through while it runs"
            remedy = "Check the leakage against actuator.pump.drive.pump_leakage"
            raise refusal(what, remedy, "leakage")
