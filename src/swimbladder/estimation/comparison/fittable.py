"""What can be adjusted in a vehicle and in the start of a run, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from swimbladder.estimation.comparison.predict import Start
from swimbladder.vehicle import IdentifiedMotion, Vehicle


class Fittable(NamedTuple):
    """A quantity that can be fitted: its unit, and a difference that a log shows."""

    unit: str
    scale: float
    meaning: str


FITTABLE: Mapping[str, Fittable] = {
    "neutral_volume": Fittable("m3", 1e-7, "neutral volume at depth 0, against mid-stroke"),
    "neutral_drift": Fittable("m3/s", 1e-10, "how fast the neutral volume grows"),
    "mass": Fittable("kg", 0.1, "all that is accelerated"),
    "drag": Fittable("N s/m", 0.05, "laminar coefficient k_dl"),
    "drag_quadratic": Fittable("N s2/m2", 0.5, "turbulent coefficient k_dt"),
    "psi": Fittable("m3/m", 1e-8, "volume lost per metre against the water's"),
    "start_depth": Fittable("m", 0.01, "depth at the first sample"),
    "start_speed": Fittable("m/s", 0.01, "speed at the first sample, positive down"),
}


def first_value(name: str, vehicle: Vehicle, start: Start) -> float:
    """Return the value that a fit of `name` begins with."""
    values = {
        "neutral_volume": vehicle.trim_error,
        "neutral_drift": start.drift,
        "mass": vehicle.mass,
        "drag": vehicle.drag.k_dl,
        "drag_quadratic": vehicle.drag.k_dt,
        "psi": vehicle.hull.psi,
        "start_depth": 0.0 if start.depth is None else start.depth,
        "start_speed": start.speed,
    }
    return values[name]


def limits(name: str, vehicle: Vehicle, start: Start) -> tuple[float, float]:
    """Return the bounds of `name`: where physics ends, or so far off that the log is another's."""
    span = vehicle.stroke.maximum - vehicle.stroke.minimum
    least_mass = 1e-2 * vehicle.mass
    if not isinstance(vehicle.motion, IdentifiedMotion):
        least_mass = vehicle.motion.dry_mass + vehicle.motion.entrained_mass
    depth = 0.0 if start.depth is None else start.depth
    return {
        "neutral_volume": (vehicle.stroke.minimum - span, vehicle.stroke.maximum + span),
        "neutral_drift": (-span / 10.0, span / 10.0),
        "mass": (least_mass, 100.0 * vehicle.mass),
        "drag": (1e-3 * vehicle.drag.k_dl, 1e3 * vehicle.drag.k_dl),
        "drag_quadratic": (0.0, 1e3 * vehicle.drag.k_dt),
        "psi": (-span, span),
        "start_depth": (depth - 1.0, depth + 1.0),
        "start_speed": (start.speed - 1.0, start.speed + 1.0),
    }[name]


def put(name: str, value: float, vehicle: Vehicle, start: Start) -> tuple[Vehicle, Start]:
    """Return vehicle and start with `name` at `value`, everything else as it was."""
    if name == "neutral_volume":
        return vehicle.model_copy(update={"trim_error": value}), start
    if name == "psi":
        hull = vehicle.hull.model_copy(update={"psi": value})
        return vehicle.model_copy(update={"hull": hull}), start
    if name in ("mass", "drag", "drag_quadratic"):
        motion = vehicle.motion.model_copy(update=_motion(name, value, vehicle))
        return vehicle.model_copy(update={"motion": motion}), start
    field = {"neutral_drift": "drift", "start_depth": "depth", "start_speed": "speed"}[name]
    return vehicle, start._replace(**{field: value})


def _motion(name: str, value: float, vehicle: Vehicle) -> dict[str, Any]:
    motion = vehicle.motion
    if isinstance(motion, IdentifiedMotion):  # K2 = k_b/k_dl and T2 = m/k_dl, eqs (28)-(29)
        m = value if name == "mass" else vehicle.mass
        k_dl = value if name == "drag" else vehicle.drag.k_dl
        return {"K2": vehicle.water.specific_weight / k_dl, "T2": m / k_dl}
    if name == "mass":
        return {"added_mass": value - motion.dry_mass - motion.entrained_mass}
    field = "k_dl" if name == "drag" else "k_dt"
    return {"drag": motion.drag.model_copy(update={field: value})}
