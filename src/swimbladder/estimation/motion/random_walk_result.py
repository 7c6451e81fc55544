"""An identification whose neutral volumes are random walks: by the innovations' likelihood."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.motion.estimates import Estimate
from swimbladder.estimation.motion.identifiability import LIMIT
from swimbladder.estimation.motion.model import NAMES, Model
from swimbladder.estimation.motion.random_effects import FEWEST, between_logs
from swimbladder.estimation.motion.random_walk import RandomWalkFit
from swimbladder.estimation.motion.result import Finding, Identification
from swimbladder.estimation.motion.vehicle_update import identified_vehicle
from swimbladder.vehicle import Vehicle

_CONSTANT = (
    "trade-off",
    "not identifiable",
    "profile",
    "prior",
    "step-size trend",
    "drift",
    "model",
)


def with_random_walk(
    found: Identification, fit: RandomWalkFit, vehicle: Vehicle, model: Model,
    records: Sequence[Record],
) -> Identification:  # fmt: skip
    """Return the identification with the random walk's parameters, not the output error's.

    With enough records the vehicle has their random effects too, and is that of the means over
    them. Results of single logs stay those of constant neutral volumes. Findings on these are
    dropped; parameters that are not identifiable with random walks are reported.
    """
    values = fit.values
    C = fit.covariance
    findings = [f for f in found.findings if f.kind not in _CONSTANT]
    findings += [*_not_identifiable(fit, model), _summary(fit)]
    identified = all(f.severity != "no" for f in findings)
    size = np.sqrt(np.maximum(np.diag(C), 1e-300))
    noise = fit.noise
    new = found.result_vehicle if not identified else identified_vehicle(
        vehicle, model, values, fit.names, C, trim_error=_trim(found, vehicle),
        depth_noise=noise.depth, neutral_std=_neutral_std(found), neutral_walk=noise.random_walk,
        acceleration_noise=noise.acceleration, logs=tuple(e.source for e in found.experiments),
    )  # fmt: skip
    if identified and len(records) >= FEWEST:
        new = between_logs(records, new)
        findings.append(_differ(new))
    held = {n: e for n, e in found.parameters.items() if e.origin == "set"}
    return replace(
        found, names=fit.names, parameters={**fit.estimates, **held}, derived={},
        covariance=C, correlation=C / np.outer(size, size), profiles={}, choices=(),
        findings=tuple(findings), depth_noise=noise.depth, random_walk=fit, result_vehicle=new,
        assumptions=(
            *found.assumptions,
            "the neutral volume of each log is a random walk; parameters by maximum likelihood of "
            "the innovations. Predictions and residuals of single logs are those of a constant one",
        ),
    )  # fmt: skip


def _trim(found: Identification, vehicle: Vehicle) -> float | None:
    known = [e for e in found.experiments if e.record.volume_absolute]
    if not known:
        return None
    trim = vehicle.trim_error + float(np.mean([e.estimates["neutral_error"].value for e in known]))
    return trim if vehicle.stroke.minimum < trim < vehicle.stroke.maximum else None


def _neutral_std(found: Identification) -> float:
    if math.isfinite(found.neutral_std):
        return found.neutral_std
    errors = [e.estimates["neutral_error"].value for e in found.experiments]
    return float(np.std(errors, ddof=1)) if len(errors) > 1 else 0.0


def _not_identifiable(fit: RandomWalkFit, model: Model) -> list[Finding]:
    found = []
    for name, e in fit.estimates.items():
        if not model.logarithmic(name) or _share(e) <= LIMIT:
            continue
        found.append(
            Finding(
                "not identifiable", "no",
                f"With the neutral volume as a random walk {name} is not identifiable: "
                f"{'any factor' if not _share(e) < 10.0 else f'{100.0 * _share(e):.0f} %'} of "
                "error. Give it a value (--set) or a prior (--prior), or add logs.",
            )
        )  # fmt: skip
    return found


def _differ(vehicle: Vehicle) -> Finding:
    known = vehicle.identified
    assert known is not None  # it was just identified
    assert known.between is not None
    b = known.between
    means = ", ".join(
        f"{name} = {value:.4g} {NAMES[name].unit}"
        for name, value in zip(known.names, known.values, strict=True)
    )
    return Finding(
        "logs differ", "note",
        f"From log to log psi differs by {1e6 * b.psi:.2g} cm3/m and drag by "
        f"{100.0 * b.drag:.2g} % (1 sigma); the neutral volume drifts by "
        f"{3.6e9 * b.neutral_drift:.2g} +- {3.6e9 * b.neutral_drift_std:.2g} cm3/h. vehicle.toml "
        f"holds this and the means over logs: {means}.",
    )  # fmt: skip


def _share(e: Estimate) -> float:
    return e.std / abs(e.value) if e.value else math.inf


def _summary(fit: RandomWalkFit) -> Finding:
    minute = math.sqrt(60.0)
    low, high = (1e6 * minute * end for end in fit.random_walk.ci95)
    farthest = 1e6 * max(fit.travelled, default=0.0)
    sure = "" if fit.drifts else ", which the logs do not require"
    return Finding(
        "random_walk", "note",
        f"The neutral volume as a random walk{sure}: 1 sigma "
        f"{1e6 * minute * fit.random_walk.value:.2g} cm3 after a minute (95 %: {low:.2g} to "
        f"{high:.2g}; p = {fit.p_value:.1g} of a constant one); largest range in a log "
        f"{farthest:.2g} cm3.",
    )  # fmt: skip
