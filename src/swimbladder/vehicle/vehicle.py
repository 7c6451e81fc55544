"""The vehicle as a whole: water and body, motion, what it senses and what controls it.

Beside them stands what identification from logs leaves: how sure the numbers are, and the noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from swimbladder.errors import InputError, check_number
from swimbladder.vehicle import actuators
from swimbladder.vehicle.schema import Parameters, Unit, quantity_in, refusal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROUNDING = 1e-4  # share of the displaced volume by which its parts may miss it: rounded numbers


class Water(Parameters):
    """The water, of constant density."""

    density: Annotated[float, Unit("kg/m3"), Field(ge=900.0, le=1100.0)] = 1000.0
    """rho"""
    gravity: Annotated[float, Unit("m/s2"), Field(ge=9.7, le=9.9)] = 9.80665
    """g"""
    compressibility: Annotated[float, Unit("1/Pa"), Field(ge=0.0, le=1e-9)] = 4.4e-10
    """that psi is relative to; the default is sea water at the surface, fresh water 4.7e-10"""
    temperature: Annotated[float, Unit("degC"), Field(ge=-5.0, le=60.0)] = 15.0
    """in which `trim_error` holds"""

    @property
    def specific_weight(self) -> float:
        """Weight of a volume of water, k_b = rho g [N/m3]."""
        return self.density * self.gravity


class Stroke(Parameters):
    """The volume change that the end stops allow; 0 is mid-stroke, positive is lighter."""

    minimum: Annotated[float, Unit("m3")]
    """with the piston in"""
    maximum: Annotated[float, Unit("m3")]
    """with the piston out"""
    switch_margin: Annotated[float, Unit("m3"), Field(ge=0.0)] | None = None
    """between a limit switch, which cuts the command at the next sample, and its end stop; default:
    no switches"""

    @property
    def lowest(self) -> float:
        """The least volume that a command drives to [m3]: the end stop, or the switch before it."""
        return self.minimum + (self.switch_margin or 0.0)

    @property
    def highest(self) -> float:
        """The largest volume that a command drives to [m3]."""
        return self.maximum - (self.switch_margin or 0.0)

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.minimum >= self.maximum:
            least, most = f"{self.minimum * 1e6:g} cm3", f"{self.maximum * 1e6:g} cm3"
            what = f"the minimum, {least}, is not below the maximum, {most}"
            remedy = "Volumes are counted from mid-stroke: the minimum is usually negative"
            raise refusal(what, remedy, "minimum")
        if self.lowest >= self.highest:
            remedy = "Give the volume between a switch and its end stop"
            raise refusal("the switches leave no stroke between them", remedy, "switch_margin")


class HullPart(Parameters):
    """A component that displaces water: a tube, a dome, foam, oil outside."""

    name: str = Field(min_length=1)
    """of the part"""
    volume: Annotated[float, Unit("m3"), Field(gt=0.0)]
    """at the surface, at `reference_temperature`"""
    compressibility: Annotated[float, Unit("1/Pa"), Field(ge=0.0, le=1e-7)]
    """relative"""
    thermal_expansion: Annotated[float, Unit("1/K"), Field(ge=-1e-3, le=1e-2)] = 0.0
    """of the volume, three times the linear one"""
    stiffening: Annotated[float, Unit("1/Pa2"), Field(ge=-1e-14, le=1e-14)] = 0.0
    """compressibility lost per pressure, down to 0"""


class Hull(Parameters):
    """Displacement, compression and emergence of the body."""

    displaced_volume: Annotated[float, Unit("m3"), Field(gt=0.0)]
    """at mid-stroke, V_p"""
    psi: Annotated[float, Unit("m3/m"), Field(ge=-1e-3, le=1e-3)]
    """compression beyond the water's, eq. (31); negative: stiffer than water"""
    waterplane_area: Annotated[float, Unit("m2"), Field(gt=0.0)]
    """at the water line"""
    emergence_depth: Annotated[float, Unit("m")] = 0.0
    """of the pressure sensor when the hull begins to emerge"""
    height: Annotated[float, Unit("m"), Field(gt=0.0)]
    """of the part that can emerge"""
    depth_limit: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """rating"""
    trapped_air: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """outside the pressure hull, part of `displaced_volume`, compressed beside psi; for ballast,
    mission and casts"""
    reference_temperature: Annotated[float, Unit("degC"), Field(ge=-5.0, le=60.0)] = 15.0
    """of the hull, for `displaced_volume`"""
    thermal_expansion: Annotated[float, Unit("1/K"), Field(ge=-1e-3, le=1e-2)] = 0.0
    """of the volume of a hull without parts"""
    thermal_time_constant: Annotated[float, Unit("s"), Field(ge=0.0, le=1e6)] = 0.0
    """to the water's temperature; for mission, campaign and logs with temperature"""
    parts: tuple[HullPart, ...] = ()
    """components of displaced_volume, for ballast, mission and casts; default: one that follows
    from psi"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.trapped_air >= self.displaced_volume:
            what = f"it is not less than the displaced volume, {self.displaced_volume * 1e6:g} cm3"
            remedy = "Give the air that is caught outside the pressure hull"
            raise refusal(what, remedy, "trapped_air")
        if self.parts and self.thermal_expansion != 0.0:
            what, remedy = "the parts have their own", "Leave it out, or the parts"
            raise refusal(what, remedy, "thermal_expansion")
        names = [part.name for part in self.parts]
        if twice := [n for k, n in enumerate(names) if n in names[:k]]:
            what = f"two parts have the name {twice[0]!r}"
            raise refusal(what, "Give each a name of its own", "parts")
        total = sum(part.volume for part in self.parts) + self.trapped_air
        if self.parts and abs(total - self.displaced_volume) > _ROUNDING * self.displaced_volume:
            parts = f"the parts displace {total * 1e6:.8g} cm3, trapped air included"
            whole = f"the displaced volume of {self.displaced_volume * 1e6:.8g} cm3"
            what = f"{parts}, and not {whole}"
            remedy = "List every part that displaces water, or correct displaced_volume"
            raise refusal(what, remedy, "parts")


class Drag(Parameters):
    """Hydrodynamic drag, eq. (16), symmetric in speed but for `rising_ratio`.

    blended: k_dl w + k_dt w|w|. switched: laminar up to epsilon, turbulent above, continuous.
    switched-literal: eq. (16) as printed, which jumps.
    """

    law: Literal["linear", "quadratic", "switched", "switched-literal", "blended"] = "linear"
    """drag law"""
    k_dl: Annotated[float, Unit("N s/m"), Field(ge=0.0)] = 0.0
    """laminar"""
    k_dt: Annotated[float, Unit("N s2/m2"), Field(ge=0.0)] = 0.0
    """turbulent"""
    epsilon: Annotated[float, Unit("m/s"), Field(ge=0.0)] = 0.0
    """speed at which it turns turbulent"""
    rising_ratio: Annotated[float, Unit(""), Field(ge=0.1, le=10.0)] = 1.0
    """drag rising over sinking; for mission, ballast, energy and size"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        every = ("k_dl", "k_dt", "epsilon")
        few = {"linear": ("k_dl",), "quadratic": ("k_dt",), "blended": ("k_dl", "k_dt")}
        needs = few.get(self.law, every)
        for name in every:
            if name in needs and getattr(self, name) <= 0.0:
                raise refusal(f"the drag law {self.law!r} needs it above 0", f"Add {name}", name)
            if name not in needs and getattr(self, name) != 0.0:
                what = f"the drag law {self.law!r} does not use it"
                raise refusal(what, "Leave it out, or choose another law", name)


class PhysicalMotion(Parameters):
    """Masses and drag."""

    kind: Literal["physical"] = "physical"
    dry_mass: Annotated[float, Unit("kg"), Field(gt=0.0)]
    """in air"""
    entrained_mass: Annotated[float, Unit("kg"), Field(ge=0.0)] = 0.0
    """water in flooded spaces"""
    added_mass: Annotated[float, Unit("kg"), Field(ge=0.0)] = 0.0
    """of the water around the hull"""
    drag: Drag
    """hydrodynamic drag, eq. (16)"""


class IdentifiedMotion(Parameters):
    """The vertical motion as identified in shallow water (eqs 26-29); drag is laminar."""

    kind: Literal["identified"] = "identified"
    K2: Annotated[float, Unit("1/m2/s"), Field(gt=0.0)]
    """rho g/k_dl, eq. (28)"""
    T2: Annotated[float, Unit("s"), Field(gt=0.0)]
    """m/k_dl, eq. (29)"""


Motion = Annotated[PhysicalMotion | IdentifiedMotion, Field(discriminator="kind")]


# As identify calls them: K1, T1, K2, T2 of eqs (22), (28), (29); masses and drag where they stand
# for these.
IdentifiedName = Literal["K1", "T1", "K2", "T2", "mass", "drag_quadratic", "psi"]
_Number = Annotated[float, Field(strict=True)]


class Between(Parameters):
    """Variation between logs of one vehicle, 1 sigma."""

    psi: Annotated[float, Unit("m3/m"), Field(ge=0.0)]
    """of psi"""
    drag: Annotated[float, Unit(""), Field(ge=0.0)]
    """as a share"""
    neutral_drift: Annotated[float, Unit("m3/s")] = 0.0
    """mean growth of the neutral volume"""
    neutral_drift_std: Annotated[float, Unit("m3/s"), Field(ge=0.0)]
    """of that growth"""
    depth_noise: Annotated[float, Unit(""), Field(ge=0.0)] = 0.0
    """of its logarithm"""
    random_walk: Annotated[float, Unit(""), Field(ge=0.0)]
    """of its logarithm"""
    acceleration_noise: Annotated[float, Unit(""), Field(ge=0.0)]
    """of its logarithm"""


class Identified(Parameters):
    """Covariance of identified parameters, and noise for filters and predictions."""

    names: tuple[IdentifiedName, ...] = Field(min_length=1)
    """identified parameters"""
    values: tuple[_Number, ...]
    """in SI"""
    covariance: tuple[tuple[_Number, ...], ...]
    """in SI, a list for each row"""
    depth_noise: Annotated[float, Unit("m"), Field(ge=0.0)] = 0.0
    """1 sigma, with its quantum"""
    neutral_std: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """1 sigma of the neutral volume between experiments"""
    random_walk: Annotated[float, Unit("m3/s^0.5"), Field(ge=0.0)] = 0.0
    """1 sigma after a second"""
    acceleration_noise: Annotated[float, Unit("m/s/s^0.5"), Field(ge=0.0)] = 0.0
    """1 sigma of the speed after a second"""
    logs: tuple[str, ...] = ()
    """from which it was identified"""
    between: Between | None = None
    """how logs of this vehicle differ"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        count = len(self.names)
        if len(set(self.names)) < count:
            raise refusal("a name stands here twice", "Name each once", "names")
        if len(self.values) != count:
            what = f"there are {len(self.values)} values for {count} names"
            raise refusal(what, "Give one value for each name", "values")
        if [len(row) for row in self.covariance] != [count] * count:
            what = f"the covariance of {count} values has {count} rows of {count}"
            raise refusal(what, "Give a list of rows", "covariance")
        self._check_covariance()

    def _check_covariance(self) -> None:
        """Refuse a matrix that is no covariance: not symmetric, or a correlation beyond 1."""
        variance = [row[i] for i, row in enumerate(self.covariance)]
        for i, row in enumerate(self.covariance):
            for j, value in enumerate(row):
                largest = (max(variance[i], 0.0) * max(variance[j], 0.0)) ** 0.5
                alike = abs(value - self.covariance[j][i]) <= 1e-6 * largest
                if variance[i] < 0.0 or not alike or abs(value) > largest * (1.0 + 1e-6):
                    what = f"no covariance: look at {self.names[i]} and {self.names[j]}"
                    diagonal = "with variances of 0 or more on its diagonal"
                    between = "correlations between -1 and 1"
                    remedy = f"A covariance is symmetric, {diagonal} and {between}"
                    raise refusal(what, remedy, "covariance")


def _number_or_text(value: object) -> float | str:
    how = 'Write a number, or a text like "1002 V/dm3"'
    return value if isinstance(value, str) else quantity_in(value, "", how)


@lru_cache
def _laminar(k_dl: float) -> Drag:
    return Drag(law="linear", k_dl=k_dl)


LawNumbers = dict[str, Annotated[float | str, BeforeValidator(_number_or_text)]]
"""Parameters of a law by name, texts with units allowed."""


class Sensors(Parameters):
    """White noise (1 sigma) and resolution of what the controller measures."""

    depth_noise: Annotated[float, Unit("m"), Field(ge=0.0, lt=1e3)] = 0.0
    """white noise, 1 sigma"""
    depth_quantum: Annotated[float, Unit("m"), Field(ge=0.0, lt=1e3)] = 0.0
    """resolution"""
    volume_noise: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """white noise, 1 sigma"""
    volume_quantum: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """resolution"""


class Controller(Parameters):
    """A control law by name, its sample time and its parameters."""

    law: str = Field(min_length=1)
    """control law"""
    sample_time: Annotated[float, Unit("s"), Field(gt=0.0)]
    """between two calls"""
    parameters: LawNumbers = Field(default_factory=dict)
    """of the law, with a unit or as bare numbers"""
    depths: tuple[Annotated[float, Unit("m"), Field(ge=0.0)], ...] | None = None
    """least and greatest that the law was tuned for"""

    def check(self) -> None:
        """Refuse depths that are no range."""
        if self.depths is not None and not (
            len(self.depths) == 2 and self.depths[0] < self.depths[1]
        ):
            remedy = 'Give the least and the greatest, like ["0 m", "10 m"], or leave it out'
            raise refusal("no range of depths", remedy, "depths")


class Supervisor(Parameters):
    """Limits of the firmware's supervisor; defaults follow from the vehicle.

    `swimbladder firmware` prints all.
    """

    depth_limit: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """default: 0.9 of where full buoyancy, hull and motor at `battery_low` suffice, less the
    uncertainty of the trim"""
    time_limit: Annotated[float, Unit("s"), Field(gt=0.0, le=3e9)] | None = None
    """since arming; default: none"""
    battery_low: Annotated[float, Unit("V"), Field(gt=0.0)] | None = None
    """under load, for 10 s; default: 0.8 of the supply, positioners none"""
    bottom_depth: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """where the vehicle may lie; default: nowhere"""
    neutral_range: Annotated[float, Unit("m3"), Field(gt=0.0)] | None = None
    """about `trim_error`, with drift and layers; default: a quarter of half the stroke, at most
    half of what is left above `trim_error` (pump and valve: that half)"""
    neutral_change: Annotated[float, Unit("m3"), Field(gt=0.0)] | None = None
    """within a dive, with layers; default: a fifth of `neutral_range`"""
    model_error: Annotated[float, Unit(""), Field(gt=0.0, lt=1.0)] = 0.3
    """relative, of force and psi"""
    patience: Annotated[float, Unit("s"), Field(gt=0.0, le=60.0)] = 5.0
    """time that a sensor may fail, or the actuator not follow"""
    late: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """age of a depth; default: two samples, at least 1 s"""
    frozen: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """time of an identical depth; default: from noise and quantum"""
    prove_after: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """age of outward motion that allows a deeper set-point, and of an identical depth, before a
    test push; default: 30 s, never for psi not above 0"""
    hold_voltage: Annotated[float, Unit("V"), Field(ge=0.0)] | None = None
    """to hold the largest volume; 0: the drive holds by itself; default: the sea's load at the
    recovery depth"""
    release_time: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """full buoyancy without rising 1 m, before the drop weight; default: two strokes and a
    minute"""
    arm_depth: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """default: 1 m below emergence, or half way to `bottom_depth`"""
    arm_after: Annotated[float, Unit("s"), Field(gt=0.0, le=60.0)] = 3.0
    """beyond `arm_depth`; at least three samples"""


class Vehicle(Parameters):
    """A vehicle: everything that the simulator, the analysis and the controller need."""

    schema_version: Literal[1] = 1
    """of this format"""
    name: str = Field(min_length=1)
    """of the vehicle"""
    description: str = ""
    """one sentence"""
    provenance: dict[str, str] = Field(default_factory=dict)
    '''where each number comes from: dotted field = "source"'''
    water: Water = Water()
    """the water around the vehicle"""
    actuator: actuators.AnyActuator
    """what changes the volume"""
    supply: actuators.Supply | None = None
    """the battery; a positioner does without"""
    driver: actuators.Driver | None = None
    """the motor's driver; without it the driver loses nothing"""
    loads: tuple[actuators.Load, ...] = ()
    """what else draws from the battery"""
    stroke: Stroke
    """end stops of the volume, counted from mid-stroke"""
    hull: Hull
    """the body"""
    motion: Motion
    """mass and drag"""
    trim_error: Annotated[float, Unit("m3")] = 0.0
    """neutral volume at the surface"""
    sensors: Sensors = Sensors()
    """what the controller sees"""
    controller: Controller | None = None
    """what closes the loop"""
    supervisor: Supervisor = Supervisor()
    """when the firmware brings the vehicle up whatever the law says"""
    identified: Identified | None = None
    """covariance of identified numbers, and the noise of the logs"""

    def __repr__(self) -> str:
        """Return what it is in some lines; `vehicle_file` has every number."""
        stroke, hull, law = self.stroke, self.hull, self.controller
        rated = "" if hull.depth_limit is None else f", rated for {hull.depth_limit:g} m"
        closed = "none" if law is None else f"{law.law}, every {law.sample_time:g} s"
        psi, displaced = f"{1e6 * hull.psi:.4g} cm3/m", f"{1e3 * hull.displaced_volume:.4g} L"
        volumes = f"{1e6 * stroke.minimum:.4g} to {1e6 * stroke.maximum:.4g} cm3"
        return "\n".join(
            [
                f"Vehicle {self.name!r}",
                f"  {self.description}",
                f"  actuator: {self.actuator.kind}, {volumes}",
                f"  hull: {displaced}, psi {psi}{rated}",
                f"  motion: {self.mass:.4g} kg accelerated, {self.drag.law} drag",
                f"  controller: {closed}",
            ]
        )

    __str__ = __repr__

    def _repr_html_(self) -> str:
        return str(_shown().html(self))

    def plot(self) -> Figure:
        """Return a matplotlib Figure: neutral volume, terminal speed and rate of the volume."""
        figure: Figure = _shown().figure(self)
        return figure

    def report(self, path: str | Path) -> Path:
        """Write it as one HTML page: every number with its source, its reach; return the path.

        The page holds all that it needs. Raises InputError where the file cannot be written.
        """
        return Path(_shown().report(self, Path(path)))

    @property
    def engine(self) -> actuators.Actuator:
        """The actuator itself, or what one of another package acts as."""
        return actuators.engine_of(self.actuator, self.water)

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

    def replace(self, changes: Mapping[str, Any]) -> Vehicle:
        """Return the vehicle with other values of fields, ``{"motion.K2": 6500.0}``.

        Parameters
        ----------
        changes
            Values by the field's path, as the vehicle's file has it; a number is in SI, a text has
            its unit (``"42 s"``), and the elements of a list are numbered from 0
            (``"hull.parts.0.volume"``).

        Returns
        -------
        Vehicle
            As if read from a file with these values; its provenance says which were set so.

        Raises
        ------
        InputError
            There is no such field, or the value cannot be, alone or with the others.
        """
        found = self.model_dump(exclude_unset=True)
        changes = dict(changes)
        for path, value in changes.items():
            *tables, name = path.split(".")
            at: Any = found
            for table in tables:
                at = _within(at, table, path)
            if not isinstance(at, dict):
                raise _no_field(path)
            at[name] = value
        own = [path for path in changes if path.split(".")[0] != "provenance"]
        found["provenance"] = found.get("provenance", {}) | dict.fromkeys(own, "set by hand")
        return Vehicle(**found)

    def with_sensors(self, **given: float) -> Vehicle:
        """Return the vehicle with other numbers of its sensors; raises InputError for bad ones."""
        sensors = Sensors(**{**self.sensors.model_dump(), **given})
        return self.model_copy(update={"sensors": sensors})

    def sampled_every(self, given: float | None) -> float:
        """Return a sample time [s], that of the controller where none is given.

        Raises InputError where there is neither, or it is no time.
        """
        if given is None and self.controller is not None:
            return self.controller.sample_time
        if given is None:
            what = "no sample time is given, and the vehicle has no controller to take it from"
            remedy = 'Give one, like "0.3 s"'
            raise InputError(what, field="sample_time", unit="s", remedy=remedy)
        check_number(given, "sample_time", "s", above=0.0)
        return given

    def but(self, part: str, **values: Any) -> Vehicle:
        """Return the vehicle with other values in a part, not checked: ``but("hull", psi=0.0)``."""
        return self.model_copy(update={part: getattr(self, part).model_copy(update=values)})

    @property
    def command(self) -> Literal["voltage", "volume", "volume change"]:
        """What a control law commands: a positioner's volume, a change for pump and valve."""
        if isinstance(self.engine, actuators.PumpAndValve):
            return "volume change"
        return "volume" if isinstance(self.engine, actuators.Positioner) else "voltage"

    @property
    def voltage_driven(self) -> bool:
        """Whether a command is a voltage."""
        return self.command == "voltage"

    @property
    def piston_area(self) -> float | None:
        """Area of the piston [m2], also of a kind from elsewhere; None: none, or not known."""
        return actuators.area_of(self.engine) or actuators.area_of(self.actuator)

    def neutral_volume(self, depth: float) -> float:
        """Return the volume at which the vehicle rests at `depth` [m], psi z + trim error [m3]."""
        return self.hull.psi * depth + self.trim_error

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if self.voltage_driven and self.supply is None:
            what = "a voltage-driven actuator needs a supply"
            raise refusal(what, "Add a table [supply] with the battery's voltage", "supply")
        if isinstance(self.engine, actuators.PumpAndValve) and self.stroke.switch_margin:
            what = "a pump and a valve have no limit switches before the ends of their stroke here"
            remedy = "Leave it out; the pump stops at the end of its stroke"
            raise refusal(what, remedy, "stroke.switch_margin")
        self._electricity_fits()
        neutral = self.neutral_volume(max(self.hull.emergence_depth, 0.0))
        if not self.stroke.minimum < neutral < self.stroke.maximum:
            stroke = f"{self.stroke.minimum * 1e6:g} to {self.stroke.maximum * 1e6:g} cm3"
            outside = f"{neutral * 1e6:g} cm3, is outside the stroke of {stroke}"
            sinks = "the vehicle can not both sink and rise"
            what = f"the neutral volume at the surface, {outside}: {sinks}"
            remedy = "Trim the vehicle (trim_error), or give it a longer stroke"
            raise refusal(what, remedy, "trim_error")

    def _electricity_fits(self) -> None:
        """Refuse pumps without a supply and loads of the same name."""
        pump = self.engine.pump if isinstance(self.engine, actuators.PumpAndValve) else None
        if isinstance(pump, actuators.DatasheetPump) and self.supply is None:
            what = "a pump from datasheets needs a supply"
            raise refusal(what, "Add a table [supply] with the battery's voltage", "supply")
        names = [load.name for load in self.loads]
        for i, name in enumerate(names):
            if name in names[:i]:
                remedy = "Give each load its own name"
                raise refusal("two loads have the same name", remedy, "loads", i, "name")


def _shown() -> Any:
    """Return the module that shows answers, which stands above all that make them."""
    return import_module("swimbladder.show.answers")


def _within(at: Any, table: str, path: str) -> Any:
    """Return a table of a table, or an element of a list; raises InputError where there is none."""
    if isinstance(at, dict):
        return at.setdefault(table, {})
    if isinstance(at, (list, tuple)) and table.isdecimal() and int(table) < len(at):
        return at[int(table)]
    raise _no_field(path)


def _no_field(path: str) -> InputError:
    remedy = "`swimbladder vehicle show VEHICLE --json` lists all"
    return InputError("the vehicle has no such field", field=path, remedy=remedy)
