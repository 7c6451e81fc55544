"""What a design says, in words and numbers, and the plan that it makes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from swimbladder.design.experiments.conditions import Release, Setting, Turn
from swimbladder.design.experiments.evaluation import Curve, EvaluatedSet
from swimbladder.design.experiments.flight import Flight, Question
from swimbladder.design.experiments.predict import OmittedVariable
from swimbladder.estimation.motion.result import Finding
from swimbladder.io.answers import as_json
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
        c = self.curve
        return {
            **as_json(
                self,
                "vehicle criterion identifiable time_budget_s=budget findings assumptions",
            ),
            "drag": self.question.model.law,
            **_set(self.chosen),
            "against": self.against
            and {"name": self.rival, **_set(self.against), "error_ratio": self.gains},
            "curve": as_json(c, "size_m3=sizes steps to_and_fro best_step_m3"),
            "setting": as_json(
                self.setting,
                "pool_depth_m shallowest_m deepest_m sample_time_s depth_noise_m neutral_std_m3 "
                "drift_std_m3_s settling_s",
            ),
        }


def _set(w: EvaluatedSet) -> dict[str, Any]:
    prediction = w.prediction

    def move(one: Turn) -> dict[str, Any]:
        place = one.when and {"depth_m": one.when.depth, "going": one.when.way}
        return {"volume_m3": one.volume, **(place or {"depth_m": None, "going": None})}

    return {
        "time_s": w.time,
        "experiments": [
            {
                "start_depth_m": r.start,
                "moves": [move(m) for m in r.moves],
                **as_json(f, "duration_s ended"),
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
        **as_json(prediction, "names covariance correlation"),
        "bias": {"psi": _bias(w.psi), "trim": _bias(w.trim), "drift": _bias(w.drift)},
    }


def _bias(left: OmittedVariable | None) -> dict[str, Any] | None:
    keys = "linear refit refit_rms_m=rms" if left and left.refit else "linear"
    return left and as_json(left, keys)


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
            else Move(volume=m.volume, depth=m.when.depth, going=m.when.way)
            for m in release.moves
        ),
        trace=Trace(
            time=rounded(time, 3), depth=rounded(flight.depth[first:], 4),
            volume=rounded(flight.volume[first:], 8),
        ),
    )  # fmt: skip
