"""Actuators: what changes the volume, from datasheets, in the unified form, or as identified.

An electrohydraulic drive also stands here as built: a pump that runs or not, a valve, a check
valve. The electricity on board comes from the battery, through the driver, and goes to hotel loads
too.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import Field, SerializeAsAny, StrictBool, WrapValidator

from swimbladder.errors import InputError
from swimbladder.vehicle.plugins import Registry
from swimbladder.vehicle.schema import (
    Parameters,
    PistonArea,
    Unit,
    carried,
    no_such,
    refusal,
    tags_of,
)

if TYPE_CHECKING:
    from swimbladder.vehicle.vehicle import Water

Phase = Literal["descend", "park", "profile", "hold", "surface"]


class Supply(Parameters):
    """The battery, which every voltage-driven actuator needs."""

    voltage: Annotated[float, Unit("V"), Field(gt=0.0)]
    """open-circuit voltage"""
    internal_resistance: Annotated[float, Unit("ohm"), Field(ge=0.0)] = 0.0
    """of battery and leads"""
    capacity: Annotated[float, Unit("J"), Field(gt=0.0)] | None = None
    """energy when full, at 20 degC"""
    cold_share: Annotated[float, Unit(""), Field(gt=0.0, le=1.0)] = 1.0
    """of the capacity at 0 degC, linear to 20 degC"""
    self_discharge: Annotated[float, Unit("1/s"), Field(ge=0.0, le=1e-6)] = 0.0
    """of the charge"""


class Driver(Parameters):
    """The motor's driver, between battery and motor; default: no loss.

    `energy` and `mission` count it, `simulate` does not.
    """

    efficiency: Annotated[float, Unit(""), Field(gt=0.0, le=1.0)] = 1.0
    """from battery to motor"""
    standby_power: Annotated[float, Unit("W"), Field(ge=0.0)] = 0.0
    """drawn all the time"""
    regenerates: StrictBool = False
    """a motor driven by the sea charges the battery"""


class Load(Parameters):
    """Another consumer, counted by `mission`: a processor, a radio."""

    name: str = Field(min_length=1)
    """of the consumer"""
    power: Annotated[float, Unit("W"), Field(ge=0.0)] = 0.0
    """while on"""
    phases: tuple[Phase, ...] = ()
    """in which it is on; empty: all"""
    energy_per_surfacing: Annotated[float, Unit("J"), Field(ge=0.0)] = 0.0
    """once at each"""


_Efficiency = Annotated[float, Unit(""), Field(gt=0.0, le=1.0)]


class Motor(Parameters):
    """A voltage-driven permanent-magnet DC motor (Figs 2-3)."""

    resistance: Annotated[float, Unit("ohm"), Field(gt=0.0)]
    """of the winding, R"""
    torque_constant: Annotated[float, Unit("N m/A"), Field(gt=0.0)]
    """k_T"""
    emf_constant: Annotated[float, Unit("V s/rad"), Field(gt=0.0)] | None = None
    """k_emf; default: k_T"""
    inductance: Annotated[float, Unit("H"), Field(ge=0.0)] = 0.0
    """of the winding, L"""
    rotor_inertia: Annotated[float, Unit("kg m2"), Field(gt=0.0)]
    """J_m"""
    viscous_friction: Annotated[float, Unit("N m s/rad"), Field(ge=0.0)] = 0.0
    """of the motor, B_m"""
    friction_torque: Annotated[float, Unit("N m"), Field(ge=0.0)] = 0.0
    """dry friction at the motor shaft, T_b"""

    @property
    def k_emf(self) -> float:
        """Back electromotive force constant [V s/rad]."""
        return self.torque_constant if self.emf_constant is None else self.emf_constant


class Oil(Parameters):
    """The oil of an electrohydraulic drive (eqs 1-2)."""

    volume: Annotated[float, Unit("m3"), Field(gt=0.0)]
    """between pump and bladder or piston, V_oil"""
    bulk_modulus: Annotated[float, Unit("Pa"), Field(gt=0.0)] = 1.5e9
    """of the pure oil"""
    trapped_air: Annotated[float, Unit(""), Field(ge=0.0, lt=0.5)] = 0.0
    """share of the volume at atmospheric pressure"""


class HydraulicDrive(Parameters):
    """Pump, pressure amplifier and bladder (Fig. 4, eqs 1-8)."""

    pump_displacement: Annotated[float, Unit("m3/rev"), Field(gt=0.0)]
    """D_p"""
    pump_efficiency: _Efficiency
    """mechanical, eta_p"""
    area_ratio: Annotated[float, Unit(""), Field(gt=0.0)] = 1.0
    """of the pressure amplifier, n_h = A1/A2"""
    pump_leakage: Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)] = 0.0
    """k_pl"""
    reflected_inertia: Annotated[float, Unit("kg m2"), Field(ge=0.0)] = 0.0
    """of transmission and moved water, at the motor shaft"""
    viscous_friction: Annotated[float, Unit("N m s/rad"), Field(ge=0.0)] = 0.0
    """of the transmission, at the motor shaft"""
    oil: Oil | None = None
    """the oil, to see how far it gives way (eqs 1-2)"""


class ScrewDrive(Parameters):
    """Gearbox, spindle and piston (Fig. 6)."""

    lead: Annotated[float, Unit("m/rev"), Field(gt=0.0)]
    """of the spindle"""
    gear_ratio: Annotated[float, Unit(""), Field(ge=1.0)] = 1.0
    """motor over spindle"""
    efficiency: _Efficiency
    """of gearbox and spindle, eta_e"""
    back_efficiency: Annotated[float, Unit(""), Field(ge=-1.0, le=1.0)] | None = None
    """of the load that drives the motor back; 0 or below: self-locking; default: `efficiency`"""
    piston_area: Annotated[float, PistonArea("m2"), Field(gt=0.0)]
    """of the piston, A; also "diameter 60 mm\""""
    reflected_inertia: Annotated[float, Unit("kg m2"), Field(ge=0.0)] = 0.0
    """of transmission and moved water, at the motor shaft"""
    viscous_friction: Annotated[float, Unit("N m s/rad"), Field(ge=0.0)] = 0.0
    """of the transmission, at the motor shaft"""


class ElectrohydraulicActuator(Parameters):
    """Motor and hydraulic drive from datasheets (column a of Table 1)."""

    kind: Literal["electrohydraulic"] = "electrohydraulic"
    motor: Motor
    """its motor"""
    drive: HydraulicDrive
    """pump, pressure amplifier and bladder"""
    literal_efficiency: StrictBool = False
    """divide the load by the efficiency in both directions, as the paper prints"""


class ElectromechanicalActuator(Parameters):
    """Motor and screw drive from datasheets (column b of Table 1)."""

    kind: Literal["electromechanical"] = "electromechanical"
    motor: Motor
    """its motor"""
    drive: ScrewDrive
    """gearbox, spindle and piston"""
    literal_efficiency: StrictBool = False
    """divide the load by the efficiency in both directions, as the paper prints"""


class UnifiedActuator(Parameters):
    """The unified actuator of Fig. 8, Table 1 and eqs 11-12, by its constants."""

    kind: Literal["unified"] = "unified"
    inertia: Annotated[float, Unit("kg m2"), Field(gt=0.0)]
    """of all that turns, at the motor shaft, lambda"""
    k_u: Annotated[float, Unit("N m/V"), Field(gt=0.0)]
    """stall torque per volt"""
    k_v: Annotated[float, Unit("N m s/rad"), Field(gt=0.0)]
    """torque lost per motor speed"""
    k_q: Annotated[float, Unit("m3/rad"), Field(gt=0.0)]
    """volume per motor angle"""
    k_z: Annotated[float, Unit("N m/m"), Field(ge=0.0)]
    """torque per depth while driving against the pressure"""
    k_l: Annotated[float, Unit("m2/s"), Field(ge=0.0)] = 0.0
    """leakage per depth"""
    efficiency: _Efficiency | None = None
    """of the transmission"""
    back_efficiency: Annotated[float, Unit(""), Field(ge=-1.0, le=1.0)] | None = None
    """of the load that drives the motor back; 0 or below: self-locking; default: `efficiency`"""
    friction_torque: Annotated[float, Unit("N m"), Field(ge=0.0)] = 0.0
    """dry friction at the motor shaft, T_b"""
    resistance: Annotated[float, Unit("ohm"), Field(gt=0.0)] | None = None
    """of the winding, for current and power"""
    emf_constant: Annotated[float, Unit("V s/rad"), Field(gt=0.0)] | None = None
    """k_emf, for current"""
    literal_efficiency: StrictBool = False
    """divide the load by the efficiency in both directions, as the paper prints"""

    @property
    def k_z_back(self) -> float:
        """Load torque per depth [N m/m] with which the sea turns the motor back.

        The lossless torque k_z eta times `back_efficiency`, or times eta where that is not given.
        A screw of efficiency eta has about 2 - 1/eta (tan(lead - friction angle)/tan(lead angle)):
        negative below a half, it locks and the motor has to turn it back. The same as while driving
        where no efficiency is known.
        """
        if self.efficiency is None or self.literal_efficiency:
            return self.k_z
        back = self.efficiency if self.back_efficiency is None else self.back_efficiency
        return self.k_z * self.efficiency * back

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.back_efficiency is not None and self.efficiency is None:
            what = "what turns the motor back is not known without the efficiency of the drive"
            raise refusal(what, "Give both, or neither", "back_efficiency")


class IdentifiedActuator(Parameters):
    """The actuator as identified in shallow water (eqs 21-24, 33)."""

    kind: Literal["identified"] = "identified"
    K1: Annotated[float, Unit("m/s/V"), Field(gt=0.0)]
    """piston speed per volt, eq. (23)"""
    T1: Annotated[float, Unit("s"), Field(gt=0.0)]
    """lambda/k_v, eq. (24)"""
    piston_area: Annotated[float, PistonArea("m2"), Field(gt=0.0)]
    """of the piston, A; also "diameter 60 mm\""""
    depth_voltage: Annotated[float, Unit("V/m"), Field(ge=0.0)] = 0.0
    """to hold the piston, per metre, k_z/k_u"""
    dead_zone: Annotated[float, Unit("V"), Field(ge=0.0)] = 0.0
    """T_b/k_u"""
    k_l: Annotated[float, Unit("m2/s"), Field(ge=0.0)] = 0.0
    """leakage per depth"""


class Positioner(Parameters):
    """A stepper-driven piston that goes to a commanded position at a constant speed."""

    kind: Literal["positioner"] = "positioner"
    speed: Annotated[float, Unit("m/s"), Field(gt=0.0)]
    """of the piston"""
    piston_area: Annotated[float, PistonArea("m2"), Field(gt=0.0)]
    """of the piston, A; also "diameter 60 mm\""""
    moving_power: Annotated[float, Unit("W"), Field(ge=0.0)] | None = None
    """of the motor, without the driver"""
    holding_power: Annotated[float, Unit("W"), Field(ge=0.0)] = 0.0
    """of the motor"""


_ATMOSPHERE = 101325.0  # Pa, at which the share of trapped air counts
_VACUUM = 1e3  # Pa; a gas rotary pump goes no lower, and oil gives off what it has dissolved


class PowerLawPump(Parameters):
    """A pump with delivery and electrical power linear in the pressure.

    The power is that of the supply, with the driver. `energy --fit` fits these to logged runs.
    """

    kind: Literal["power-law"] = "power-law"
    delivery: Annotated[float, Unit("m3/s"), Field(gt=0.0)]
    """against no pressure"""
    slip: Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)] = 0.0
    """delivery lost per pressure; `line` empties through it at rest"""
    idle_power: Annotated[float, Unit("W"), Field(ge=0.0)]
    """against no pressure"""
    power_per_pressure: Annotated[float, Unit("W/Pa"), Field(ge=0.0)]
    """growth of the power per pressure"""
    power_per_temperature: Annotated[float, Unit("W/K"), Field(le=0.0, ge=-10.0)] = 0.0
    """change of the power per kelvin above 15 degC"""
    stall_pressure: Annotated[float, Unit("Pa"), Field(gt=0.0)] | None = None
    """where the motor stops or a relief valve opens; default: by slip"""


class DatasheetPump(Parameters):
    """A pump from the datasheets of motor and pump (eqs 3-8).

    Its efficiency follows from `pump_efficiency`, friction and leakage.
    """

    kind: Literal["datasheet"] = "datasheet"
    motor: Motor
    """its motor"""
    drive: HydraulicDrive
    """pump and pressure amplifier"""
    speed: Annotated[float, Unit("rad/s"), Field(gt=0.0)] | None = None
    """of the motor, while the supply allows; default: full voltage"""


class CurvePump(Parameters):
    """A pump by its measured curve: delivery and electrical power over pressure.

    A smooth curve without overshoot; constant below the first pressure, no delivery beyond the
    last. The power is that of the supply, with the driver.
    """

    kind: Literal["curve"] = "curve"
    pressure: tuple[Annotated[float, Unit("Pa"), Field(ge=0.0)], ...] = Field(min_length=2)
    """rising"""
    delivery: tuple[Annotated[float, Unit("m3/s"), Field(ge=0.0)], ...]
    """at each, falling or level"""
    power: tuple[Annotated[float, Unit("W"), Field(ge=0.0)], ...]
    """at each"""
    slip: Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)] = 0.0
    """delivery lost per pressure; `line` empties through it at rest"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        for name in ("delivery", "power"):
            if len(getattr(self, name)) != len(self.pressure):
                raise refusal("not as many as pressures", "Give one at each pressure", name)
        if list(self.pressure) != sorted(set(self.pressure)):
            raise refusal("the pressures do not rise", "Begin with the least", "pressure")
        if list(self.delivery) != sorted(self.delivery, reverse=True) or self.delivery[0] == 0.0:
            what = "a pump delivers something, and no more against more pressure"
            raise refusal(what, "Check the order of pressures and deliveries", "delivery")


Pump = Annotated[PowerLawPump | DatasheetPump | CurvePump, Field(discriminator="kind")]


class Valve(Parameters):
    """A valve that lets oil back into the hull, and its pipe.

    Q = flow ((dp + laminar_pressure)^0.5 - laminar_pressure^0.5): an orifice, laminar at small dp.
    """

    flow: Annotated[float, Unit("m3/s/Pa^0.5"), Field(gt=0.0)]
    """C_d A (2/rho_oil)^0.5"""
    laminar_pressure: Annotated[float, Unit("Pa"), Field(ge=0.0, le=1e8)] = 0.0
    """far below it the flow is laminar"""
    power: Annotated[float, Unit("W"), Field(ge=0.0)] = 0.0
    """while open"""


class PumpAndValve(Parameters):
    """A pump fills the bladder, a valve lets oil back, a check valve holds the volume.

    Its command is a change of volume, by the law `rate` or one like it.
    """

    kind: Literal["pump-valve"] = "pump-valve"
    pump: Pump
    """the pump with its motor"""
    valve: Valve
    """the valve for small changes of volume"""
    bypass: Valve | None = None
    """a wide valve that empties the bladder at the surface"""
    line: Oil | None = None
    """oil between pump and check valve, which must reach the sea's pressure before delivery"""
    internal_pressure: Annotated[float, Unit("Pa"), Field(ge=0.0, le=2e5)] = 101325.0
    """absolute, of the gas around the oil reservoir"""
    leakage: Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)] = 0.0
    """inward, at rest"""
    creep: Annotated[float, Unit("m3/s"), Field(ge=0.0, le=1e-6)] = 0.0
    """volume lost at rest at any pressure (cooling oil, settling seals), made up by pumping"""
    quantum: Annotated[float, Unit("s"), Field(ge=0.0)] = 0.0
    """step of run times, and the shortest"""
    start_volume: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """lost at each start of the pump, beside `line`"""
    longest_run: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """of the pump, in one action; default: no limit"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.longest_run is not None and self.longest_run < self.quantum:
            what = f"the longest run is below the quantum, {self.quantum:g} s"
            raise refusal(what, "Check both times", "longest_run")
        if self.line is not None:
            least = self.line.trapped_air * _ATMOSPHERE
            if self.internal_pressure <= max(least, _VACUUM):
                what = "the line at rest would be full of the air in its oil, or of its vapour"
                above = f"Give a pressure above {max(least, _VACUUM):g} Pa"
                raise refusal(what, f"{above}, or leave out actuator.line", "internal_pressure")
        pump = self.pump
        if isinstance(pump, DatasheetPump) and self.leakage > pump.drive.pump_leakage > 0.0:
            what = "more seeps in at rest than the pump lets through while it runs"
            remedy = "Check the leakage against actuator.pump.drive.pump_leakage"
            raise refusal(what, remedy, "leakage")


_Motored = ElectrohydraulicActuator | ElectromechanicalActuator | UnifiedActuator
_Actuator = _Motored | IdentifiedActuator | Positioner | PumpAndValve
Actuator = Annotated[_Actuator, Field(discriminator="kind")]
"""The actuators that simulation, analysis and firmware know."""


class ActuatorKind(Parameters, ABC):
    """Base of a kind of actuator of another package: its own fields, and what it acts as.

    A class of it has a field ``kind: Literal["..."]``, and the entry point of the group
    `swimbladder.actuators` that names it is called the same.
    """

    kind: str
    """name of the kind"""

    @abstractmethod
    def acts_as(self, water: Water) -> _Actuator:
        """Return the same actuator in one of swimbladder's own forms.

        water: that of the vehicle, for a load that goes with its weight. What is raised here
        refuses the vehicle.
        """


def _accept(kind: Any, name: str) -> type[ActuatorKind]:
    """Return a kind of another package; raises InputError where it is none that can be used."""
    if not (isinstance(kind, type) and issubclass(kind, ActuatorKind)):
        remedy = "Let the entry point name a class of swimbladder.vehicle.ActuatorKind"
        raise InputError("it is no ActuatorKind", remedy=remedy)
    if inspect.isabstract(kind):
        raise InputError("it does not say what it acts as", remedy="Give it a method acts_as")
    if tags_of(kind) != (name,):
        what = f"the entry point is called {name!r} and its kind {' or '.join(tags_of(kind))!r}"
        raise InputError(what, remedy=f'Give it a field kind: Literal["{name}"] = "{name}"')
    return kind


def _own(model: type[Parameters]) -> Callable[[], type[Parameters]]:
    """Return how a kind of this package is loaded."""
    return lambda: model


ACTUATORS: Registry[type[Parameters]] = Registry(
    "swimbladder.actuators",
    "actuator kind",
    own={tags_of(model)[0]: _own(model) for model in get_args(_Actuator)},
    accept=_accept,
)
"""The kinds of actuator."""


def _of_any_kind(value: object, own: Callable[[object], _Actuator]) -> _Actuator | ActuatorKind:
    """Return an actuator of this package or of another."""
    if isinstance(value, ActuatorKind):
        return value
    if not isinstance(value, Mapping) or not isinstance(kind := value.get("kind"), str):
        return own(value)
    try:
        if kind not in ACTUATORS:
            raise no_such("unknown kind", kind, ACTUATORS, field="kind")
        found = ACTUATORS[kind]  # refuses a name that two have
    except InputError as error:
        raise carried(error.but(field="kind")) from None
    if not issubclass(found, ActuatorKind):
        return own(value)
    try:
        return found(**value)
    except InputError as error:
        raise carried(error.but(field=None) if error.field == found.__name__ else error) from None
    except Exception as error:
        raise carried(_no_actuator(found, error).but(field=None)) from None


def area_of(given: _Actuator | ActuatorKind) -> float | None:
    """Return the area of an actuator's piston [m2]; None where it has none, or none is known."""
    area: Any = getattr(getattr(given, "drive", given), "piston_area", None)
    return area if isinstance(area, float) else None


def engine_of(given: _Actuator | ActuatorKind, water: Water) -> _Actuator:
    """Return an actuator itself, or what one of another package acts as in a vehicle's water.

    Raises InputError where that is no actuator.
    """
    if not isinstance(given, ActuatorKind):
        return given
    try:
        found: object = given.acts_as(water)
        if isinstance(found, _Actuator):
            return found
        raise TypeError(f"it acts as a {type(found).__name__}")
    except Exception as error:
        raise _no_actuator(type(given), error) from None


def _no_actuator(kind: type[Parameters], error: Exception) -> InputError:
    """Return what an error of another package, whatever it is, means for an actuator."""
    name = "".join(tags_of(kind)) or kind.__name__
    package = (name in ACTUATORS and ACTUATORS.package(name)) or kind.__module__
    why = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
    what = f"with these numbers it is no actuator: {' '.join(why.split())}"
    remedy = f"Check its numbers, or update {package}, which has the kind {name}"
    return InputError(what, field="actuator", remedy=remedy)


if TYPE_CHECKING:
    AnyActuator = _Actuator | ActuatorKind
else:
    AnyActuator = SerializeAsAny[Annotated[Actuator, WrapValidator(_of_any_kind)]]
