"""The laws by name, and a vehicle's controller turned into numbers."""

from collections.abc import Callable, Collection, Mapping
from importlib import import_module
from typing import Any

from swimbladder.control.law import SMOOTH, Friction, Law, from_leaves, leaf_names, leaves
from swimbladder.errors import InputError
from swimbladder.physics.actuator import refuse_pump_and_valve
from swimbladder.units import quantity
from swimbladder.vehicle import Controller, Vehicle
from swimbladder.vehicle.plugins import Registry
from swimbladder.vehicle.schema import check_choice, did_you_mean


def _own(module: str) -> Callable[[], Law]:
    """Return how a law of this package is loaded: that of a module, named as the module is."""
    return lambda: getattr(import_module(f"swimbladder.control.{module}"), module.upper())


def _accept(law: Any, name: str) -> Law:
    """Return a law of another package; raises InputError where it is none that can be used."""
    if not isinstance(law, Law):
        raise InputError("it is no Law", remedy="Let the entry point name a swimbladder.Law")
    if law.name != name:
        what = f"the entry point is called {name!r} and the law {law.name!r}"
        raise InputError(what, remedy="Give both one name")
    if law.command not in ("voltage", "volume", "volume change"):
        remedy = "Command a voltage, a volume or a volume change"
        raise InputError(f"no actuator takes a {law.command}", remedy=remedy)
    for kind in (law.parameters, law.state):
        leaf_names(kind)  # refuses what holds no numbers
    for parameter in leaf_names(law.parameters):
        if parameter not in law.units and parameter != "S_p":
            remedy = f'Annotate it: {parameter}: Annotated[float, "m3/s"]'
            raise InputError(f"its parameter {parameter} has no unit", remedy=remedy)
    return law


_BY_VOLTAGE = ("cascade", "sea_cascade", "adrc", "deadband", "observer", "pulse", "planned")
_MODULES = (*_BY_VOLTAGE, "position_pid", "position_observer", "rate", "argo")
_OWN = {module.replace("_", "-"): _own(module) for module in _MODULES}
LAWS: Registry[Law] = Registry("swimbladder.laws", "law", own=_OWN, accept=_accept)
"""The laws: called at a sample when they asked to be; one word each here."""


def law_by_name(name: str) -> Law:
    """Return the law of that name; raises InputError where there is none."""
    check_choice(name, LAWS.names(), "unknown control law", field="controller.law")
    return LAWS[name]


def law_parameters(law: Law, values: Mapping[str, float | str], *, sample_time: float) -> Any:
    """Return the law's parameters from numbers or texts with units, S_p from the sample time [s].

    Raises InputError for a parameter that is unknown, missing or of the wrong unit.
    """
    wanted = [name for name in leaf_names(law.parameters) if name != "S_p"]
    where = "controller.parameters"
    for name in values:
        if name not in wanted:
            what = f"law {law.name!r} has no such parameter"
            remedy = f"{did_you_mean(name, wanted)}It has: {', '.join(wanted)}"
            raise InputError(what, field=f"{where}.{name}", remedy=remedy)
    numbers = leaves(SMOOTH) if law.roundings == Friction._fields else {}
    for name in wanted:
        unit = law.units[name]
        if name not in values and name in numbers:
            continue
        if name not in values:
            what, field = f"law {law.name!r} needs this parameter", f"{where}.{name}"
            raise InputError(what, field=field, unit=unit, remedy="Add it")
        numbers[name] = quantity(values[name], unit, f"{where}.{name}")
    if "S_p" in leaf_names(law.parameters):
        numbers["S_p"] = sample_time
    return from_leaves(law.parameters, numbers)


def bind(controller: Controller) -> tuple[Law, Any]:
    """Return (law, its parameters) of a vehicle's controller; raises InputError as its parts do."""
    law = law_by_name(controller.law)
    return law, law_parameters(law, controller.parameters, sample_time=controller.sample_time)


def controller_of(law: Law, parameters: Any, *, sample_time: float) -> Controller:
    """Return the controller of a vehicle that `bind` takes apart into a law and its parameters."""
    numbers = {name: x for name, x in leaves(parameters).items() if name != "S_p"}
    return Controller(law=law.name, sample_time=sample_time, parameters=numbers)


def own_law(vehicle: Vehicle, *, sampled: bool = True) -> tuple[Law, Any]:
    """Return (law, its parameters) of a vehicle's own controller.

    sampled: refuse a pump and valve, which has no loop of voltages or positions.
    Raises InputError where it has none, where its actuator does not take the law's commands, and as
    `bind` does.
    """
    if sampled:
        refuse_pump_and_valve(vehicle.engine)
    if vehicle.controller is None:
        what = f"the vehicle {vehicle.name!r} has no controller"
        remedy = "Add a [controller] table to the vehicle: `swimbladder tune` writes one"
        raise InputError(what, field="controller", remedy=remedy)
    check_command(law_by_name(vehicle.controller.law), vehicle)
    return bind(vehicle.controller)


def check_command(
    law: Law,
    vehicle: Vehicle,
    *,
    field: str = "controller.law",
    among: Collection[str] | None = None,
    remedy: str | None = None,
) -> None:
    """Raise InputError where a vehicle's actuator does not take what a law commands.

    field: where the law was chosen. among: the names to choose from there; None: all.
    remedy: what to do, where that is not to choose another name.
    """
    if law.command != vehicle.command:
        names = LAWS if among is None else among
        fitting = [name for name in names if law_by_name(name).command == vehicle.command]
        what = f"this law commands a {law.command}, but the actuator takes a {vehicle.command}"
        remedy = remedy or f"Choose one of: {', '.join(fitting)}"
        raise InputError(what, field=field, value=law.name, remedy=remedy)
