"""What a vehicle is made of: frozen, keyword-only, validated.

Numbers are SI floats inside; every field also takes a text with its unit (``"350 cm3"``).
The paper's symbols stand in the fields that were identified (K1, T1, K2, T2, psi), words elsewhere.

::

    Vehicle
    |-- water       Water
    |-- actuator    ElectrohydraulicActuator | ElectromechanicalActuator    from datasheets
    |               UnifiedActuator (Table 1) | IdentifiedActuator (eq. 33) | Positioner (stepper)
    |-- supply      Supply           battery voltage and internal resistance
    |-- stroke      Stroke           smallest and largest volume, 0 is mid-stroke
    |-- hull        Hull             displaced volume, compressibility, where it emerges
    |-- motion      PhysicalMotion | IdentifiedMotion (eqs 26-29)
    |-- sensors     Sensors          noise and quantum of depth and volume
    `-- controller  Controller       the name of a law, its sample time and gains
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    ValidationError,
    model_validator,
)
from pydantic_core import core_schema

from swimbladder.errors import InputError
from swimbladder.units import parse_quantity

__all__ = [
    "Actuator",
    "Controller",
    "Drag",
    "ElectrohydraulicActuator",
    "ElectromechanicalActuator",
    "Hull",
    "HydraulicDrive",
    "IdentifiedActuator",
    "IdentifiedMotion",
    "Motion",
    "Motor",
    "Oil",
    "PhysicalMotion",
    "Positioner",
    "ScrewDrive",
    "Sensors",
    "Stroke",
    "Supply",
    "UnifiedActuator",
    "Unit",
    "Vehicle",
    "Water",
    "field_unit",
    "input_error",
]


class Unit:
    """The unit of a field: parses texts on the way in, and stands in messages and templates."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Return pydantic's schema: the text is parsed before the bounds are checked."""
        return core_schema.no_info_before_validator_function(self._parse, handler(source))

    def _parse(self, value: object) -> float:
        try:
            return parse_quantity(value, self.text)
        except InputError as error:
            remedy = f". {error.remedy}" if error.remedy else ""
            raise ValueError(error.what + remedy) from None


_Ratio = Annotated[float, Unit(""), Field(gt=0.0)]
_Efficiency = Annotated[float, Unit(""), Field(gt=0.0, le=1.0)]


class _Metaclass(type(BaseModel)):  # type: ignore[misc]
    """Turns pydantic's report into one InputError where a class is called from outside."""

    def __call__(cls, *args: Any, **fields: Any) -> Any:
        try:
            return super().__call__(*args, **fields)
        except ValidationError as error:
            raise input_error(error, cls) from None


class Parameters(BaseModel, metaclass=_Metaclass):
    """Base of all parameter classes: frozen, no unknown fields, nothing infinite."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True
    )


class Water(Parameters):
    """The water the vehicle moves in, of constant density."""

    density: Annotated[float, Unit("kg/m3"), Field(ge=900.0, le=1100.0)] = Field(1000.0, description="density rho")
    gravity: Annotated[float, Unit("m/s2"), Field(ge=9.7, le=9.9)] = Field(9.80665, description="gravity g")

    @property
    def specific_weight(self) -> float:
        """Weight of a volume of water, k_b = rho g [N/m3]."""
        return self.density * self.gravity


class Motor(Parameters):
    """A voltage-driven permanent-magnet DC motor (Figs 2-3)."""

    resistance: Annotated[float, Unit("ohm"), Field(gt=0.0)] = Field(description="winding resistance R")
    torque_constant: Annotated[float, Unit("N m/A"), Field(gt=0.0)] = Field(description="k_T")
    emf_constant: Annotated[float, Unit("V s/rad"), Field(gt=0.0)] | None = Field(
        None, description="k_emf; equal to k_T where not given"
    )
    inductance: Annotated[float, Unit("H"), Field(ge=0.0)] = Field(0.0, description="winding inductance L")
    rotor_inertia: Annotated[float, Unit("kg m2"), Field(gt=0.0)] = Field(description="J_m")
    viscous_friction: Annotated[float, Unit("N m s/rad"), Field(ge=0.0)] = Field(0.0, description="B_m")
    friction_torque: Annotated[float, Unit("N m"), Field(ge=0.0)] = Field(
        0.0, description="T_b: bearing and brush friction, eddy currents"
    )

    @property
    def k_emf(self) -> float:
        """Back electromotive force constant [V s/rad]."""
        return self.torque_constant if self.emf_constant is None else self.emf_constant


class Oil(Parameters):
    """The oil of an electrohydraulic drive (eqs 1-2)."""

    volume: Annotated[float, Unit("m3"), Field(gt=0.0)] = Field(description="oil between pump and bladder or piston V_oil")
    bulk_modulus: Annotated[float, Unit("Pa"), Field(gt=0.0)] = Field(1.5e9, description="bulk modulus of the pure oil")
    trapped_air: Annotated[float, Unit(""), Field(ge=0.0, lt=0.5)] = Field(
        0.0, description="share of air by volume at atmospheric pressure"
    )


class HydraulicDrive(Parameters):
    """Pump, pressure amplifier and bladder (Fig. 4, eqs 1-8)."""

    pump_displacement: Annotated[float, Unit("m3/rev"), Field(gt=0.0)] = Field(description="D_p")
    pump_efficiency: _Efficiency = Field(description="mechanical efficiency of the pump eta_p")
    area_ratio: _Ratio = Field(1.0, description="pressure amplifier n_h = A1/A2; 1 without one")
    pump_leakage: Annotated[float, Unit("m3/s/Pa"), Field(ge=0.0)] = Field(
        0.0, description="leakage flow per unit pump pressure k_pl"
    )
    reflected_inertia: Annotated[float, Unit("kg m2"), Field(ge=0.0)] = Field(
        0.0, description="pump, oil, piston and displaced water, at the motor shaft"
    )
    viscous_friction: Annotated[float, Unit("N m s/rad"), Field(ge=0.0)] = Field(
        0.0, description="pump and piping, at the motor shaft"
    )
    oil: Oil | None = None


class ScrewDrive(Parameters):
    """Gearbox, spindle and piston (Fig. 6)."""

    lead: Annotated[float, Unit("m/rev"), Field(gt=0.0)] = Field(description="travel of the piston per turn of the spindle")
    gear_ratio: Annotated[float, Unit(""), Field(ge=1.0)] = Field(1.0, description="turns of the motor per turn of the spindle")
    efficiency: _Efficiency = Field(description="gearbox and spindle eta_e")
    piston_area: Annotated[float, Unit("m2"), Field(gt=0.0)] = Field(description="area in contact with the water A")
    reflected_inertia: Annotated[float, Unit("kg m2"), Field(ge=0.0)] = Field(
        0.0, description="gearbox, spindle, piston and displaced water, at the motor shaft"
    )
    viscous_friction: Annotated[float, Unit("N m s/rad"), Field(ge=0.0)] = Field(
        0.0, description="mechanical transmission, at the motor shaft"
    )

    @property
    def transmission_pitch(self) -> float:
        """Travel of the piston per turn of the motor, alpha [m/rev]."""
        return self.lead / self.gear_ratio


class ElectrohydraulicActuator(Parameters):
    """Motor and hydraulic drive, both from datasheets (column a of Table 1)."""

    kind: Literal["electrohydraulic"] = "electrohydraulic"
    motor: Motor
    drive: HydraulicDrive
    literal_efficiency: bool = Field(
        False, description="divide the load by the efficiency in both directions, as eq. (7) prints"
    )


class ElectromechanicalActuator(Parameters):
    """Motor and screw drive, both from datasheets (column b of Table 1)."""

    kind: Literal["electromechanical"] = "electromechanical"
    motor: Motor
    drive: ScrewDrive
    literal_efficiency: bool = Field(
        False, description="divide the load by the efficiency in both directions, as k_ze prints"
    )


class UnifiedActuator(Parameters):
    """The unified actuator of Fig. 8, Table 1 and eqs 11-12, its constants given directly."""

    kind: Literal["unified"] = "unified"
    inertia: Annotated[float, Unit("kg m2"), Field(gt=0.0)] = Field(description="lambda")
    k_u: Annotated[float, Unit("N m/V"), Field(gt=0.0)] = Field(description="stall torque per volt")
    k_v: Annotated[float, Unit("N m s/rad"), Field(gt=0.0)] = Field(description="torque lost per motor speed")
    k_q: Annotated[float, Unit("m3/rad"), Field(gt=0.0)] = Field(description="volume per motor angle")
    k_z: Annotated[float, Unit("N m/m"), Field(ge=0.0)] = Field(description="load torque per depth while driving")
    k_l: Annotated[float, Unit("m2/s"), Field(ge=0.0)] = Field(0.0, description="volume leaked per time and depth")
    efficiency: _Efficiency | None = Field(
        None, description="of the transmission; back-driving multiplies by it. None: unknown"
    )
    friction_torque: Annotated[float, Unit("N m"), Field(ge=0.0)] = Field(0.0, description="dry friction at the shaft T_b")
    resistance: Annotated[float, Unit("ohm"), Field(gt=0.0)] | None = Field(None, description="R, for current and power")
    emf_constant: Annotated[float, Unit("V s/rad"), Field(gt=0.0)] | None = Field(None, description="k_emf, for current")
    literal_efficiency: bool = False


class IdentifiedActuator(Parameters):
    """The actuator as identified in shallow water (eqs 21-24, 33)."""

    kind: Literal["identified"] = "identified"
    K1: Annotated[float, Unit("m/s/V"), Field(gt=0.0)] = Field(description="piston speed per volt, eq. (23)")
    T1: Annotated[float, Unit("s"), Field(gt=0.0)] = Field(description="time constant lambda/k_v, eq. (24)")
    piston_area: Annotated[float, Unit("m2"), Field(gt=0.0)] = Field(description="A")
    depth_voltage: Annotated[float, Unit("V/m"), Field(ge=0.0)] = Field(0.0, description="k_z/k_u: voltage that holds a metre")
    k_l: Annotated[float, Unit("m2/s"), Field(ge=0.0)] = Field(0.0, description="volume leaked per time and depth")


class Positioner(Parameters):
    """A stepper-driven piston that goes to a commanded position at a constant speed."""

    kind: Literal["positioner"] = "positioner"
    speed: Annotated[float, Unit("m/s"), Field(gt=0.0)] = Field(description="piston speed")
    piston_area: Annotated[float, Unit("m2"), Field(gt=0.0)] = Field(description="A")


Actuator = Annotated[
    ElectrohydraulicActuator
    | ElectromechanicalActuator
    | UnifiedActuator
    | IdentifiedActuator
    | Positioner,
    Field(discriminator="kind"),
]


class Supply(Parameters):
    """The battery: the voltage that limits the motor."""

    voltage: Annotated[float, Unit("V"), Field(gt=0.0)] = Field(description="open-circuit voltage")
    internal_resistance: Annotated[float, Unit("ohm"), Field(ge=0.0)] = Field(0.0, description="of battery and leads")


class Stroke(Parameters):
    """The volume change that the end stops allow; 0 is mid-stroke, positive is lighter."""

    minimum: Annotated[float, Unit("m3")] = Field(description="piston fully in")
    maximum: Annotated[float, Unit("m3")] = Field(description="piston fully out")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.minimum >= self.maximum:
            raise ValueError(
                f"minimum {self.minimum:g} m3 is not below maximum {self.maximum:g} m3"
            )
        return self


class Hull(Parameters):
    """The body: how much it displaces, how it compresses, where it emerges."""

    displaced_volume: Annotated[float, Unit("m3"), Field(gt=0.0)] = Field(description="V_p at mid-stroke")
    psi: Annotated[float, Unit("m3/m"), Field(ge=-1e-3, le=1e-3)] = Field(
        description="volume lost per metre against the water's, eq. (31); negative: stiffer than water"
    )
    waterplane_area: Annotated[float, Unit("m2"), Field(gt=0.0)] = Field(description="cross-section at the water line")
    emergence_depth: Annotated[float, Unit("m")] = Field(
        0.0, description="depth of the pressure sensor at which the hull starts to emerge"
    )
    height: Annotated[float, Unit("m"), Field(gt=0.0)] = Field(description="of the part that can emerge")
    depth_limit: Annotated[float, Unit("m"), Field(gt=0.0)] | None = Field(None, description="rating; None: not stated")


class Drag(Parameters):
    """Hydrodynamic drag, eq. (16), symmetric in speed.

    linear: k_dl w. quadratic: k_dt w|w|. switched: laminar up to epsilon, turbulent above,
    continuous there. switched-literal: eq. (16) as printed, which jumps at epsilon.
    blended: k_dl w + k_dt w|w|.
    """

    law: Literal["linear", "quadratic", "switched", "switched-literal", "blended"] = "linear"
    k_dl: Annotated[float, Unit("N s/m"), Field(ge=0.0)] = Field(0.0, description="laminar coefficient")
    k_dt: Annotated[float, Unit("N s2/m2"), Field(ge=0.0)] = Field(0.0, description="turbulent coefficient")
    epsilon: Annotated[float, Unit("m/s"), Field(ge=0.0)] = Field(0.0, description="speed of the transition")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needs = {
            "linear": ("k_dl",),
            "quadratic": ("k_dt",),
            "switched": ("k_dl", "k_dt", "epsilon"),
            "switched-literal": ("k_dl", "k_dt", "epsilon"),
            "blended": ("k_dl", "k_dt"),
        }[self.law]
        for name in ("k_dl", "k_dt", "epsilon"):
            if name in needs and getattr(self, name) <= 0.0:
                raise ValueError(f"drag law {self.law!r} needs {name} above 0")
            if name not in needs and getattr(self, name) != 0.0:
                raise ValueError(f"drag law {self.law!r} does not use {name}: leave it out")
        return self


class PhysicalMotion(Parameters):
    """Masses and drag, each from where it comes."""

    kind: Literal["physical"] = "physical"
    dry_mass: Annotated[float, Unit("kg"), Field(gt=0.0)] = Field(description="of the vehicle in air")
    entrained_mass: Annotated[float, Unit("kg"), Field(ge=0.0)] = Field(0.0, description="water enclosed in free-flooded spaces")
    added_mass: Annotated[float, Unit("kg"), Field(ge=0.0)] = Field(0.0, description="water accelerated around the hull")
    drag: Drag


class IdentifiedMotion(Parameters):
    """The vertical motion as identified in shallow water (eqs 26-29); drag is laminar."""

    kind: Literal["identified"] = "identified"
    K2: Annotated[float, Unit("1/m2/s"), Field(gt=0.0)] = Field(description="speed per volume, eq. (28)")
    T2: Annotated[float, Unit("s"), Field(gt=0.0)] = Field(description="time constant m/k_dl, eq. (29)")


Motion = Annotated[PhysicalMotion | IdentifiedMotion, Field(discriminator="kind")]


class Sensors(Parameters):
    """What the controller sees: white noise (1 sigma), then the quantum of the converter."""

    depth_noise: Annotated[float, Unit("m"), Field(ge=0.0)] = 0.0
    depth_quantum: Annotated[float, Unit("m"), Field(ge=0.0)] = 0.0
    volume_noise: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    volume_quantum: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0


class Controller(Parameters):
    """A control law by name, its sample time and its parameters (texts with units allowed)."""

    law: str
    sample_time: Annotated[float, Unit("s"), Field(gt=0.0)]
    parameters: dict[str, float | str] = {}


class Vehicle(Parameters):
    """A vehicle: everything that the simulator, the analysis and the controller need."""

    schema_version: Literal[1] = 1
    name: str = Field(min_length=1)
    description: str = ""
    provenance: dict[str, str] = Field(
        default_factory=dict, description="dotted field -> where its number comes from"
    )
    water: Water = Water()
    actuator: Actuator
    supply: Supply | None = Field(None, description="needed by voltage-driven actuators")
    stroke: Stroke
    hull: Hull
    motion: Motion
    trim_error: Annotated[float, Unit("m3")] = Field(
        0.0, description="neutral volume at the surface, against mid-stroke"
    )
    sensors: Sensors = Sensors()
    controller: Controller | None = None

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
            return Drag(law="linear", k_dl=self.water.specific_weight / self.motion.K2)
        return self.motion.drag

    @property
    def voltage_driven(self) -> bool:
        """Whether a command is a voltage; a positioner's is a volume."""
        return not isinstance(self.actuator, Positioner)

    def neutral_volume(self, depth: float) -> float:
        """Return the volume at which the vehicle rests at `depth` [m], psi z + trim error [m3]."""
        return self.hull.psi * depth + self.trim_error

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.voltage_driven and self.supply is None:
            raise ValueError("a voltage-driven actuator needs [supply] voltage")
        neutral = self.neutral_volume(max(self.hull.emergence_depth, 0.0))
        if not self.stroke.minimum < neutral < self.stroke.maximum:
            raise ValueError(
                f"the neutral volume at the surface, {neutral * 1e6:g} cm3, is outside the stroke of "
                f"{self.stroke.minimum * 1e6:g} to {self.stroke.maximum * 1e6:g} cm3: the vehicle can "
                "not both sink and rise"
            )
        return self


def field_unit(model: type[BaseModel], name: str) -> str | None:
    """Return the unit of field `name` of a parameter class, None where it has none."""
    info = model.model_fields[name]
    found = [item for item in info.metadata if isinstance(item, Unit)]
    for argument in getattr(info.annotation, "__args__", ()):
        found += [i for i in getattr(argument, "__metadata__", ()) if isinstance(i, Unit)]
    return found[0].text if found else None


def input_error(error: ValidationError, model: type[BaseModel]) -> InputError:
    """Return pydantic's first complaint as an InputError with field, value, unit and remedy."""
    found = error.errors(include_url=False)
    first = next((item for item in found if item["type"] == "extra_forbidden"), found[0])
    path = [str(part) for part in first["loc"]]
    current: Any = model
    unit: str | None = None
    known: list[str] = []
    shown: list[str] = []
    for part in path:
        fields = _fields_of(current, part)
        if fields is None:  # the tag of a union, not a field
            current = _member(current, part)
            continue
        shown.append(part)
        known = sorted(fields)
        if part in fields:
            unit = field_unit(current, part)
            current = fields[part].annotation
    kind, value = first["type"], first["input"]
    what = str(first["msg"]).removeprefix("Value error, ")
    remedy = None
    if kind == "extra_forbidden":
        what, remedy, unit = "unknown field", f"Known here: {', '.join(known)}", None
        value = None
    elif kind == "missing":
        what, remedy, value = "a required field is missing", "Add it", None
    elif kind.startswith("union_tag"):
        remedy = f"Allowed kinds: {first.get('ctx', {}).get('expected_tags', '')}"
        what = "unknown or missing kind"
    elif isinstance(value, dict) or hasattr(value, "model_fields"):
        value = None
    elif kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        what = what.replace("Input should", "must")
        remedy = "Check the number and its unit"
    name = ".".join(shown)
    return InputError(what, field=name or model.__name__, value=value, unit=unit, remedy=remedy)


def _fields_of(model: Any, part: str) -> Any:
    members = _members(model)
    if len(members) != 1:
        return None
    fields = getattr(members[0], "model_fields", None)
    if fields is None or (part not in fields and part in _kinds(members[0])):
        return None
    return fields


def _members(annotation: Any) -> list[Any]:
    if hasattr(annotation, "model_fields"):
        return [annotation]
    arguments = getattr(annotation, "__args__", ())
    return [m for a in arguments for m in _members(a)]


def _kinds(model: Any) -> tuple[str, ...]:
    info = model.model_fields.get("kind")
    return () if info is None else tuple(getattr(info.annotation, "__args__", ()))


def _member(annotation: Any, tag: str) -> Any:
    return next((m for m in _members(annotation) if tag in _kinds(m)), annotation)
