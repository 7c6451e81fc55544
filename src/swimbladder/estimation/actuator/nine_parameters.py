"""The nine parameters of section 2.3: which the logs fixed, and where the others come from.

The paper counts nine and names four of them, which shallow-water experiments give: K1, T1, K2, T2.
Eqs (32) and (33) hold, beside these, A, k_z/k_u, k_l and psi; eq. (28) needs rho g.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

from swimbladder.estimation.estimates import Estimate
from swimbladder.physics.actuator import reduced
from swimbladder.vehicle import IdentifiedActuator, IdentifiedMotion, Positioner, Vehicle

Source = Literal["logs", "set", "vehicle", "not known"]

NINE: Mapping[str, tuple[str, str]] = {
    "K1": ("m/s/V", "piston speed per volt, eq. (23)"),
    "T1": ("s", "time constant of the motor, eq. (24)"),
    "K2": ("1/m2/s", "vehicle speed per volume, eq. (28)"),
    "T2": ("s", "time constant of the vehicle, eq. (29)"),
    "A": ("m2", "area of the piston"),
    "k_z/k_u": ("V/m", "voltage that holds a metre of water"),
    "k_l": ("m2/s", "leakage, eq. (6)"),
    "psi": ("m3/m", "volume that the hull loses per metre, eq. (31)"),
    "rho g": ("N/m3", "weight of the water"),
}
"""Symbol: unit and meaning of the nine."""


class Known(NamedTuple):
    """One of the nine: its value, None where nobody knows it, and where that comes from."""

    symbol: str
    value: float | None
    unit: str
    meaning: str
    source: Source
    origin: str


def nine(
    parameters: Mapping[str, Estimate], vehicle: Vehicle | None, logs: str
) -> tuple[Known, ...]:
    """Return the nine parameters in the paper's order.

    parameters: as identified; vehicle: where the others may stand; logs: what the logs are called.
    """
    found = []
    for symbol, (unit, meaning) in NINE.items():
        estimate = parameters.get(symbol)
        if estimate is not None and estimate.known:
            source: Source = "logs" if estimate.origin == "data" else "set"
            origin = logs if source == "logs" else "given with --set"
            found.append(Known(symbol, estimate.value, unit, meaning, source, origin))
            continue
        value, origin = _of_vehicle(symbol, vehicle)
        source = "not known" if value is None else "vehicle"
        found.append(Known(symbol, value, unit, meaning, source, origin))
    return tuple(found)


_PLACES = {
    "A": "actuator.piston_area",
    "k_z/k_u": "actuator.depth_voltage",
    "psi": "hull.psi",
    "rho g": "water.density",
}


def _of_vehicle(symbol: str, vehicle: Vehicle | None) -> tuple[float | None, str]:
    """Return what the vehicle's file says of a parameter, and where it has it from."""
    if vehicle is None:
        return None, "no vehicle was given"
    place = _PLACES.get(symbol, f"actuator.{symbol}")
    if symbol in ("K2", "T2"):
        return _of_motion(symbol, vehicle)
    if symbol == "psi":
        return vehicle.hull.psi, _origin(vehicle, place)
    if symbol == "rho g":
        return vehicle.water.specific_weight, _origin(vehicle, place)
    actuator = vehicle.actuator
    if symbol == "A":
        area = vehicle.piston_area
        if area is None:
            return None, f"an actuator of kind {actuator.kind} has no piston area in its file"
        inner = "actuator.drive.piston_area"
        return area, _origin(vehicle, inner if actuator.kind == "electromechanical" else place)
    if isinstance(actuator, Positioner):
        return None, "a positioner has none: it goes to positions at a constant speed"
    a = reduced(actuator, vehicle.water)
    if symbol == "K1":
        area = vehicle.piston_area
        value = None if area is None else a.gain / area
    else:
        value = {"T1": a.T1, "k_z/k_u": a.load_drive, "k_l": a.k_l}[symbol]
    if isinstance(actuator, IdentifiedActuator):
        return value, _origin(vehicle, place)
    return value, "follows from motor and drive: " + _origin(vehicle, "actuator")


def _of_motion(symbol: str, vehicle: Vehicle) -> tuple[float | None, str]:
    if isinstance(vehicle.motion, IdentifiedMotion):
        value = vehicle.motion.K2 if symbol == "K2" else vehicle.motion.T2
        return value, _origin(vehicle, f"motion.{symbol}")
    drag = vehicle.drag.k_dl
    if drag <= 0.0:
        return None, f"the drag law of the vehicle, {vehicle.drag.law}, has no laminar part"
    upper = vehicle.water.specific_weight if symbol == "K2" else vehicle.mass
    return upper / drag, "follows from masses and drag: " + _origin(vehicle, "motion.drag")


def _origin(vehicle: Vehicle, place: str) -> str:
    """Return what the vehicle's provenance says of a field, or of the nearest table above it."""
    while place:
        if place in vehicle.provenance:
            return vehicle.provenance[place]
        place = place.rpartition(".")[0]
    return f"the file of {vehicle.name}, which does not say where from"
