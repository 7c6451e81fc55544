"""From the parameters of deep dives to the vehicle's file, and what has no place there."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from swimbladder.estimation.motion.deep_model import DEEP, body_of
from swimbladder.physics.hull import weighing
from swimbladder.vehicle import (
    Drag,
    Hull,
    HullPart,
    PhysicalMotion,
    PowerLawPump,
    PumpAndValve,
    Valve,
    Vehicle,
    field_unit,
)

_STIFFENS = 1e-20  # 1/Pa2, the least that a vehicle's file has

_HULL = "the cast, and the mass and hull in the vehicle's file"
_WARM = "temperature_degC of the log, its unit, and whether it is of the hull"
_SECONDS = "the {0}'s seconds in the log, and its {1} in the vehicle's file"

# Where a vehicle's file holds each, and what to check when it comes out strange.
_PLACES: dict[str, tuple[type[BaseModel], str, str]] = {
    "drag": (Drag, "k_dt", "the pressures and the mass in the vehicle's file"),
    "drag_up": (Drag, "rising_ratio", "whether the water was that of the cast while it rose"),
    "compressibility": (HullPart, "compressibility", _HULL),
    "stiffening": (HullPart, "stiffening", _HULL),
    "thermal_expansion": (HullPart, "thermal_expansion", _WARM),
    "trapped_air": (Hull, "trapped_air", "the cast near the surface"),
    "pump_delivery": (PowerLawPump, "delivery", _SECONDS.format("pump", "delivery")),
    "pump_slip": (PowerLawPump, "slip", _SECONDS.format("pump", "slip")),
    "pump_start": (PumpAndValve, "start_volume", "the pump's seconds in the log"),
    "valve": (Valve, "flow", _SECONDS.format("valve", "flow")),
    "bypass": (Valve, "flow", _SECONDS.format("bypass", "flow")),
    "creep": (PumpAndValve, "creep", "the cast, and whether the log leaves out runs"),
}
_BOUNDS = {
    "gt": (operator.gt, "more than {:g}"),
    "ge": (operator.ge, "{:g} or more"),
    "lt": (operator.lt, "less than {:g}"),
    "le": (operator.le, "{:g} or less"),
}


def identified_vehicle(vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
    """Return the vehicle of these values, but for what its file has no place for.

    That is the delivery of a pump that is described by its motor. Mass and hull without trapped air
    are those of `body_of`, so trim_error moves with trapped air, and with the hull's warmth where
    [water] is not as warm as reference_temperature.
    """
    body, hull, actuator = body_of(vehicle), vehicle.hull, vehicle.actuator
    assert isinstance(actuator, PumpAndValve)
    pump = actuator.pump
    if isinstance(pump, PowerLawPump):
        pump = pump.model_copy(update={
            "delivery": pump.delivery * values["pump_delivery"],
            "slip": pump.slip * values["pump_delivery"] + pump.delivery * values["pump_slip"],
        })  # fmt: skip
    stiffening = values["stiffening"]
    part = HullPart(
        name="hull", volume=body.volume, compressibility=max(values["compressibility"], 0.0),
        thermal_expansion=values["thermal_expansion"],
        stiffening=stiffening if abs(stiffening) >= _STIFFENS else 0.0,
    )  # fmt: skip
    bypass = actuator.bypass
    if bypass is not None:
        bypass = bypass.model_copy(update={"flow": bypass.flow * values["bypass"]})
    changed = actuator.model_copy(update={
        "pump": pump,
        "valve": actuator.valve.model_copy(
            update={"flow": actuator.valve.flow * values["valve"]}
        ),
        "bypass": bypass,
        "start_volume": max(actuator.start_volume + values["pump_start"], 0.0),
        "creep": max(values["creep"], 0.0),
    })  # fmt: skip
    motion: dict[str, Any] = {"drag": vehicle.drag.model_copy(
        update={"k_dt": values["drag"], "rising_ratio": values["drag_up"]}
    )}  # fmt: skip
    if isinstance(vehicle.motion, PhysicalMotion):
        more = (values["inertia"] - 1.0) * vehicle.mass
        motion["added_mass"] = max(vehicle.motion.added_mass + more, 0.0)
    air = values["trapped_air"]
    found = vehicle.model_copy(update={
        "actuator": changed,
        "hull": hull.model_copy(update={
            "displaced_volume": body.volume + air, "parts": (part,), "trapped_air": air,
        }),
        "motion": vehicle.motion.model_copy(update=motion),
    })  # fmt: skip
    return weighing(found, body.mass)


def out_of_place(vehicle: Vehicle, values: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Say of each of `names` whose value no vehicle's file may hold: the number and the bound.

    What `identified_vehicle` holds at 0 has a place, but a compressibility.
    """
    found = []
    for name in names:
        written = _written(vehicle, values, name)
        if written is None:
            continue
        model, field, check = _PLACES[name]
        bounds = _broken(model, field, written)
        if bounds:
            unit = DEEP[name].unit
            stands = ""
            if name in ("pump_delivery", "pump_slip", "valve", "bypass"):
                stands = f"{field} would be {written:.4g} {field_unit(model, field)}, and "
            found.append(
                f"{name} comes out {values[name]:.4g} {unit}".rstrip()
                + f", which vehicle.toml cannot hold: {stands}{field} has to be "
                f"{' and '.join(bounds)} {field_unit(model, field)}".rstrip()
                + f". Check {check}, or hold it by what you know with --set {name}=VALUE."
            )
    return found


def _written(vehicle: Vehicle, values: Mapping[str, float], name: str) -> float | None:
    """Return what the vehicle's file gets for a parameter; None where it has no place for it."""
    value, actuator = values[name], vehicle.actuator
    assert isinstance(actuator, PumpAndValve)
    if name in ("valve", "bypass"):
        device = actuator.valve if name == "valve" else actuator.bypass
        return None if device is None else device.flow * value
    if name in ("pump_delivery", "pump_slip"):
        pump = actuator.pump
        if not isinstance(pump, PowerLawPump):
            return None
        if name == "pump_delivery":
            return pump.delivery * value
        return pump.slip * values["pump_delivery"] + pump.delivery * value
    if name == "creep":
        return max(value, 0.0)
    if name == "pump_start":
        return max(actuator.start_volume + value, 0.0)
    return None if name == "inertia" else value


def _broken(model: type[BaseModel], field: str, value: float) -> list[str]:
    """Return the bounds of a field that a value breaks, in words."""
    found = []
    for bound in model.model_fields[field].metadata:
        for key, (keeps, words) in _BOUNDS.items():
            limit = getattr(bound, key, None)
            if limit is not None and not keeps(value, limit):
                found.append(words.format(limit))
    return found
