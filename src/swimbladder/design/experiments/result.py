"""What a design says, in words and numbers, and the plan that it makes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from swimbladder.design.experiments.conditions import Release, Setting
from swimbladder.design.experiments.evaluation import Curve, EvaluatedSet
from swimbladder.design.experiments.flight import Flight, Question
from swimbladder.design.experiments.predict import OmittedVariable
from swimbladder.estimation.motion.result import Finding
from swimbladder.io.plan import Expected, Move, Plan, PlannedExperiment, Trace

_TRACE = 1.0  # s between the points of an expected trace, at the least
_POINTS = 60


@dataclass(frozen=True, kw_only=True)
class Design:
    """Which experiments to run, their predicted errors, and how these compare.

    chosen: the set to run, in order; against: another one, named `rival`. curve: what sizes of
    volume changes buy. piston_area [m2], None where the vehicle has no piston. assumptions: all
    that the prediction rests on, as sentences.
    """

    vehicle: str
    setting: Setting
    question: Question
    criterion: str
    budget: float  # s
    chosen: EvaluatedSet
    against: EvaluatedSet | None
    rival: str
    curve: Curve
    piston_area: float | None
    findings: tuple[Finding, ...]
    assumptions: tuple[str, ...]

    @property
    def identifiable(self) -> bool:
        """Whether the set identifies all that is asked."""
        return all(f.severity != "no" for f in self.findings)

    @property
    def gains(self) -> dict[str, float]:
        """How many times larger the errors of the rival set are, drift included, by name."""
        if self.against is None:
            return {}
        ours, theirs = self.chosen.prediction.share, self.against.prediction.share
        return {name: theirs[name] / ours[name] for name in ours}

    def plan(self, evaluated: EvaluatedSet | None = None) -> Plan:
        """Return the plan to follow at the pool: of the chosen set, or of another one."""
        w = evaluated or self.chosen
        s, prediction = self.setting, w.prediction
        pairs = zip(w.releases, w.flights, strict=True)
        return Plan(
            name=f"experiments for {self.vehicle}", vehicle=self.vehicle, pool_depth=s.pool_depth,
            shallowest=s.shallowest, deepest=s.deepest, sample_time=s.sample_time, rest=s.rest,
            depth_noise=s.noise, depth_quantum=s.quantum,
            neutral_std=s.neutral_std if math.isfinite(s.neutral_std) else None,
            expected=tuple(
                Expected(name=name, value=e.value, std=e.std, unit=e.unit)
                for name, e in prediction.parameters.items()
            ),
            experiments=tuple(_planned(release, flight, s) for release, flight in pairs),
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        s = self.setting
        return {
            "vehicle": self.vehicle,
            "drag": self.question.model.law,
            "criterion": self.criterion,
            "identifiable": self.identifiable,
            "time_budget_s": self.budget,
            **_set(self.chosen),
            "against": None
            if self.against is None
            else {"name": self.rival, **_set(self.against), "error_ratio": self.gains},
            "curve": {
                "size_m3": self.curve.sizes.tolist(),
                "steps": self.curve.steps.tolist(),
                "to_and_fro": self.curve.to_and_fro.tolist(),
                "best_step_m3": self.curve.best_step,
            },
            "setting": {
                "pool_depth_m": s.pool_depth,
                "shallowest_m": s.shallowest,
                "deepest_m": s.deepest,
                "sample_time_s": s.sample_time,
                "depth_noise_m": s.depth_noise,
                "neutral_std_m3": s.neutral_std,
                "drift_std_m3_s": s.drift_std,
                "settling_s": s.settling,
            },
            "findings": [f._asdict() for f in self.findings],
            "assumptions": list(self.assumptions),
        }


def _set(w: EvaluatedSet) -> dict[str, Any]:
    prediction = w.prediction
    return {
        "time_s": w.time,
        "experiments": [
            {
                "start_depth_m": r.start,
                "moves": [
                    {
                        "volume_m3": m.volume,
                        "depth_m": None if m.when is None else m.when.depth,
                        "going": None if m.when is None else ("up" if m.when.up else "down"),
                    }
                    for m in r.moves
                ],
                "duration_s": f.duration,
                "ended": f.ended,
                "share_after": after,
            }
            for r, f, after in zip(w.releases, w.flights, w.after, strict=True)
        ],
        "parameters": {
            name: {
                **e.to_json(),
                "drift_error": prediction.drift[name],
                "share": prediction.share[name],
                "share_range": list(w.spread[name]),
                "sources": prediction.sources[name],
            }
            for name, e in prediction.parameters.items()
        },
        "names": list(prediction.names),
        "covariance": prediction.covariance.tolist(),
        "correlation": prediction.correlation.tolist(),
        "bias": {"psi": _bias(w.psi), "trim": _bias(w.trim), "drift": _bias(w.drift)},
    }


def _bias(left: OmittedVariable | None) -> dict[str, Any] | None:
    if left is None:
        return None
    if not left.refit:
        return {"linear": left.linear}
    return {"linear": left.linear, "refit": left.refit, "refit_rms_m": left.rms}


def _planned(release: Release, flight: Flight, s: Setting) -> PlannedExperiment:
    first = flight.moved[0]
    time = flight.time[first:] - flight.time[first]
    step = max(1, math.ceil(max(_TRACE, float(time[-1]) / _POINTS) / s.sample_time))
    kept = np.unique(np.append(np.arange(0, len(time), step), len(time) - 1))

    def rounded(values: Any, digits: int) -> tuple[float, ...]:
        return tuple(np.round(values[kept], digits).tolist())

    return PlannedExperiment(
        start_depth=release.start, longest=s.longest, settling=round(s.settling, 1),
        duration=round(flight.duration, 1),
        moves=tuple(
            Move(volume=m.volume)
            if m.when is None
            else Move(volume=m.volume, depth=m.when.depth, going="up" if m.when.up else "down")
            for m in release.moves
        ),
        trace=Trace(
            time=rounded(time, 3), depth=rounded(flight.depth[first:], 4),
            volume=rounded(flight.volume[first:], 8),
        ),
    )  # fmt: skip
