"""From the parameters of deep dives to the vehicle's file, and what has no place there."""

import operator
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from swimbladder.estimation.estimates import sentence
from swimbladder.estimation.motion.deep_model import DEEP, body_of
from swimbladder.physics.hull import weighing
from swimbladder.vehicle import (
    HullPart,
    PhysicalMotion,
    PowerLawPump,
    PumpAndValve,
    Vehicle,
    field_unit,
)

_STIFFENS = 1e-20  # 1/Pa2, the least that a vehicle's file has

_HULL = "the cast, and the mass and hull in the vehicle's file"
_WARM = "temperature_degC of the log, its unit, and whether it is of the hull"
_SECONDS = "the {0}'s seconds in the log, and its {1} in the vehicle's file"

# Where a vehicle's file holds each, and what to check when it comes out strange.
_PLACES: dict[str, tuple[str, str]] = {
    "drag": ("motion.drag.k_dt", "the pressures and the mass in the vehicle's file"),
    "drag_up": ("motion.drag.rising_ratio", "whether the water was that of the cast while it rose"),
    "compressibility": ("hull.parts.0.compressibility", _HULL),
    "stiffening": ("hull.parts.0.stiffening", _HULL),
    "thermal_expansion": ("hull.parts.0.thermal_expansion", _WARM),
    "trapped_air": ("hull.trapped_air", "the cast near the surface"),
    "pump_delivery": ("actuator.pump.delivery", _SECONDS.format("pump", "delivery")),
    "pump_slip": ("actuator.pump.slip", _SECONDS.format("pump", "slip")),
    "pump_start": ("actuator.start_volume", "the pump's seconds in the log"),
    "valve": ("actuator.valve.flow", _SECONDS.format("valve", "flow")),
    "bypass": ("actuator.bypass.flow", _SECONDS.format("bypass", "flow")),
    "creep": ("actuator.creep", "the cast, and whether the log leaves out runs"),
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
    return weighing(_filled(vehicle, values), body_of(vehicle).mass)


def _filled(vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
    """Return the vehicle with these values, before its trim_error follows them."""
    body, hull, actuator = body_of(vehicle), vehicle.hull, vehicle.actuator
    assert isinstance(actuator, PumpAndValve)
    pump = actuator.pump
    if isinstance(pump, PowerLawPump):
        pump = pump.model_copy(update={
            "delivery": pump.delivery * values["pump_delivery"],
            "slip": pump.slip * values["pump_delivery"] + pump.delivery * values["pump_slip"],
        })  # fmt: skip
    stiffening = values["stiffening"]
    soft = max(values["compressibility"], 0.0)
    part = HullPart(name="hull", volume=body.volume, compressibility=0.0).model_copy(update={
        "compressibility": soft, "thermal_expansion": values["thermal_expansion"],
        "stiffening": stiffening if abs(stiffening) >= _STIFFENS else 0.0,
    })  # fmt: skip
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
    return vehicle.model_copy(update={
        "actuator": changed,
        "hull": hull.model_copy(update={
            "displaced_volume": body.volume + air, "parts": (part,), "trapped_air": air,
        }),
        "motion": vehicle.motion.model_copy(update=motion),
    })  # fmt: skip


def out_of_place(vehicle: Vehicle, values: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Say of each of `names` whose value no vehicle's file may hold: the number and the bound.

    What `identified_vehicle` holds at 0 has a place, but a compressibility.
    """
    file, found = _filled(vehicle, values), []
    for name in names:
        path, check = _PLACES.get(name, ("", ""))
        *way, field = path.split(".")
        holder: Any = file
        for key in way:
            holder = holder[int(key)] if key.isdigit() else getattr(holder, key)
        model = type(holder)
        if field not in getattr(model, "model_fields", {}):
            continue
        written = values[name] if name == "compressibility" else getattr(holder, field)
        bounds = _broken(model, field, written)
        if bounds:
            unit, stands = field_unit(model, field), ""
            if name in ("pump_delivery", "pump_slip", "valve", "bypass"):
                stands = f"{field} would be {written:.4g} {unit}, and "
            texts = {"name": name, "field": field, "check": check, "stands": stands}
            value = f"{values[name]:.4g} {DEEP[name].unit}".rstrip()
            limits = f"{' and '.join(bounds)} {unit}".rstrip()
            found.append(sentence("deep", "out of place", **texts, value=value, bounds=limits))
    return found


def _broken(model: type[BaseModel], field: str, value: float) -> list[str]:
    """Return the bounds of a field that a value breaks, in words."""
    found = []
    for bound in model.model_fields[field].metadata:
        for key, (keeps, words) in _BOUNDS.items():
            limit = getattr(bound, key, None)
            if limit is not None and not keeps(value, limit):
                found.append(words.format(limit))
    return found
