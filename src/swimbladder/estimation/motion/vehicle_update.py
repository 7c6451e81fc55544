"""The identified vehicle: the one given, with what the logs say of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swimbladder.estimation.motion.model import Model
from swimbladder.estimation.motion.result import ExperimentFit
from swimbladder.estimation.series import Array
from swimbladder.vehicle import (
    Drag,
    Identified,
    IdentifiedActuator,
    IdentifiedMotion,
    PhysicalMotion,
    Vehicle,
)


def dry_mass(vehicle: Vehicle) -> float | None:
    """Return dry and entrained mass [kg], None where the vehicle does not state them."""
    motion = vehicle.motion
    return motion.dry_mass + motion.entrained_mass if isinstance(motion, PhysicalMotion) else None


def trim_of(each: Sequence[ExperimentFit], vehicle: Vehicle) -> float | None:
    """Return the mean neutral volume at depth 0 [m3], None where no log's volume counts from
    mid-stroke.
    """
    errors = [
        e.estimates["neutral_error"].value
        for e in each
        if e.record.volume_absolute and e.record.drive == "volume"
    ]
    trim = vehicle.trim_error + float(np.mean(errors)) if errors else math.inf
    return trim if vehicle.stroke.minimum < trim < vehicle.stroke.maximum else None


def neutral_spread(each: Sequence[ExperimentFit], assumed: float, *, single: float) -> float:
    """Return how far the neutral volume differs between logs [m3, 1 sigma]: as assumed or found.

    single: of one log, where nothing is assumed.
    """
    if math.isfinite(assumed):
        return assumed
    errors = [e.estimates["neutral_error"].value for e in each]
    return float(np.std(errors, ddof=1)) if len(errors) > 1 else single


def identified_vehicle(
    vehicle: Vehicle, model: Model, values: Mapping[str, float], names: tuple[str, ...],
    covariance: Array, *, trim_error: float | None, logs: tuple[str, ...], **noise: float,
) -> Vehicle:  # fmt: skip
    """Return the vehicle with its motion, psi and, where known, trim as identified.

    A vehicle given by K2 and T2 stays one where its drag is laminar. Where masses are stated, the
    added mass takes up what was identified; where that would leave less than they are, all of it
    stands as the dry mass. noise: of the filter and between logs, by the names of `Identified`.
    """
    changes: dict[str, Any] = {
        "hull": vehicle.hull.model_copy(update={"psi": values["psi"]}),
        "motion": _motion(vehicle, model, values),
    }
    if trim_error is not None:
        changes["trim_error"] = trim_error
    if "K1" in names and isinstance(vehicle.actuator, IdentifiedActuator):
        update = {"K1": values["K1"], "T1": values["T1"]}
        changes["actuator"] = vehicle.actuator.model_copy(update=update)
    changes["provenance"] = _provenance(vehicle, names, logs, trim=trim_error is not None)
    changes["identified"] = Identified.model_validate(
        {
            "names": names,
            "values": tuple(float(values[name]) for name in names),
            "covariance": tuple(tuple(map(float, row)) for row in covariance),
            "logs": logs,
            **noise,
        }
    )
    return vehicle.model_copy(update=changes)


def _motion(
    vehicle: Vehicle, model: Model, values: Mapping[str, float]
) -> IdentifiedMotion | PhysicalMotion:
    old = vehicle.motion
    if model.law == "linear" and isinstance(old, IdentifiedMotion):
        return IdentifiedMotion(K2=values["K2"], T2=values["T2"])
    terms: dict[str, Any] = {"law": model.law}
    if model.law != "quadratic":
        terms["k_dl"] = model.specific_weight / values["K2"]
    if model.law != "linear":
        terms["k_dt"] = values["drag_quadratic"]
    if model.law == "blended" and values["drag_quadratic"] <= 0.0:
        terms = {"law": "linear", "k_dl": terms["k_dl"]}
    m = model.mass(values)
    parts = {"dry_mass": m, "entrained_mass": 0.0, "added_mass": 0.0}
    if isinstance(old, PhysicalMotion) and m >= old.dry_mass + old.entrained_mass:
        parts = {
            "dry_mass": old.dry_mass,
            "entrained_mass": old.entrained_mass,
            "added_mass": m - old.dry_mass - old.entrained_mass,
        }
    return PhysicalMotion(**parts, drag=Drag(**terms))


def _provenance(
    vehicle: Vehicle, names: tuple[str, ...], logs: tuple[str, ...], *, trim: bool
) -> dict[str, str]:
    origin = f"identified: from {logs[0]}"
    if len(logs) > 1:
        origin += f" and {len(logs) - 1} more, which identified.logs names"
    kept = {
        key: text
        for key, text in vehicle.provenance.items()
        if not key.startswith("motion") and key not in ("identified", "hull.psi", "trim_error")
    }
    for key in ("hull.psi", "trim_error"):
        if key in vehicle.provenance:
            kept[key] = vehicle.provenance[key]
    kept["motion"] = origin
    if "psi" in names:
        kept["hull.psi"] = origin
    if trim:
        kept["trim_error"] = f"{origin}: the mean of their neutral volumes"
    if "K1" in names:
        kept["actuator.K1"] = kept["actuator.T1"] = origin
    return kept
