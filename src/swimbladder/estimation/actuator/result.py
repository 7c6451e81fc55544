"""What is found: parameters of all logs together and of each, the steps, and what it means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.actuator.bench import Driven, Quantity
from swimbladder.estimation.actuator.nine_parameters import Known
from swimbladder.estimation.estimates import Estimate, Finding
from swimbladder.estimation.series import rms
from swimbladder.physics.actuator import to_identified
from swimbladder.vehicle import Actuator, Identified, Positioner, Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Step:
    """A stretch that was fitted: time since the log's first sample, measured and fitted position.

    voltage: held from each sample on; None where it is not known. used: False for an outlier.
    start: how many of the first samples show how it comes to full speed, where no voltage is known.
    """

    source: str
    label: str
    time: Array  # s
    position: Array  # m, or m3
    fitted: Array
    voltage: Array | None  # V
    used: NDArray[np.bool_]
    speed: float | None  # m/s, at full speed, where no voltage is known
    start: int

    @property
    def residual(self) -> Array:
        """Measured less fitted."""
        return self.position - self.fitted

    @property
    def rms(self) -> float:
        """Root mean square of the residual, outliers aside."""
        kept = self.residual[self.used]
        return rms(kept) if len(kept) else 0.0


@dataclass(frozen=True, kw_only=True)
class LogFit:
    """The estimates from one log alone; refusal: why there are none."""

    source: str
    parameters: dict[str, Estimate]
    refusal: str | None = None


@dataclass(frozen=True, kw_only=True)
class ActuatorIdentification:
    """The actuator as identified from the logs.

    parameters: K1, T1, dead_zone, load_voltage, asymmetry, rate, and derived: the same by
    direction. asked: what has to be identifiable for `identified`. nine: the parameters of section
    2.3 and where each comes from. assumptions: what the numbers rest on, as sentences.
    """

    driven: Driven
    quantity: Quantity
    parameters: dict[str, Estimate]
    derived: dict[str, Estimate]
    asked: tuple[str, ...]
    noise: float  # m, 1 sigma of the residual
    correlation: dict[str, dict[str, float]]
    covariance: dict[str, dict[str, float]]  # SI
    logs: tuple[LogFit, ...]
    steps: tuple[Step, ...]
    nine: tuple[Known, ...]
    findings: tuple[Finding, ...]
    assumptions: tuple[str, ...]
    notes: tuple[str, ...]
    given: Vehicle | None

    @property
    def identified(self) -> bool:
        """Whether all that was asked for is identified."""
        return all(self.parameters[name].known for name in self.asked)

    @property
    def refusal(self) -> str:
        """The sentences on what was asked for and is not identifiable, with the reason."""
        return " ".join(f.sentence for f in self.findings if f.severity == "no")

    @property
    def vehicle(self) -> Vehicle:
        """The given vehicle with what was identified in it, its provenance saying so.

        Raises NoAnswerError where nothing that a vehicle holds was identified, or none was given.
        """
        if self.given is None:
            raise NoAnswerError("No vehicle was given to put the identified numbers into.")
        actuator, changed = self._actuator(self.given)
        if not changed:
            raise NoAnswerError(f"Nothing of the actuator of {self.given.name} was identified.")
        same_kind = actuator.kind == self.given.actuator.kind
        kept = {
            place: origin
            for place, origin in self.given.provenance.items()
            if same_kind or not place.startswith("actuator")
        }
        origin = "identified from " + ", ".join(dict.fromkeys(fit.source for fit in self.logs))
        for name, place in changed.items():
            low, high = self.parameters[name].ci95
            kept[place] = f"{origin}; 95 % interval {low:.4g} to {high:.4g}"
        if not same_kind:
            kept["actuator"] = f"reduced to shallow-water parameters from {self.given.name}"
        return self.given.model_copy(
            update={
                "actuator": actuator,
                "provenance": kept,
                "identified": self._identified(self.given),
            }
        )

    def _actuator(self, vehicle: Vehicle) -> tuple[Actuator, dict[str, str]]:
        """Return the actuator with the identified parameters, and {parameter: field} of them."""
        estimates = {n: e.value for n, e in self.parameters.items() if e.known}
        if isinstance(vehicle.actuator, Positioner):
            if self.quantity != "piston" or "rate" not in estimates:
                return vehicle.actuator, {}
            faster = vehicle.actuator.model_copy(update={"speed": estimates["rate"]})
            return faster, {"rate": "actuator.speed"}
        names = {"K1": "K1", "K1A": "K1", "T1": "T1"}
        if {"K1", "K1A"} & set(estimates):
            names["dead_zone"] = "dead_zone"
        changed = {name: names[name] for name in estimates if name in names}
        if not changed:
            return vehicle.actuator, {}
        area = vehicle.piston_area or 1.0  # no piston: K1 is then a volume rate
        plain = to_identified(vehicle.actuator, vehicle.water, piston_area=area)
        numbers = {field: max(estimates[name], 0.0) for name, field in changed.items()}
        places = {name: f"actuator.{field}" for name, field in changed.items()}
        return plain.model_copy(update=numbers), places

    def _identified(self, vehicle: Vehicle) -> Identified | None:
        """Return the table of covariances with those of K1 and T1 in it."""
        own = [n for n in ("K1", "K1A", "T1") if n in self.covariance]
        before = vehicle.identified
        if not own or isinstance(vehicle.actuator, Positioner):
            return before
        names = ["K1" if n == "K1A" else n for n in own]
        others = [n for n in (before.names if before else ()) if n not in ("K1", "T1")]
        values = [self.parameters[n].value for n in own]
        rows = [[self.covariance[a][b] for b in own] + [0.0] * len(others) for a in own]
        if before is not None:
            at = [before.names.index(n) for n in others]
            values += [before.values[k] for k in at]
            rows += [[0.0] * len(own) + [before.covariance[i][j] for j in at] for i in at]
        sources = tuple(dict.fromkeys(fit.source for fit in self.logs))
        fields = {} if before is None else before.model_dump()
        fields |= {
            "names": (*names, *others),
            "values": tuple(values),
            "covariance": tuple(map(tuple, rows)),
            "logs": (*(before.logs if before else ()), *sources),
        }
        return Identified(**fields)

    def columns(self) -> dict[str, Array]:
        """Return the columns of steps.csv by name, the steps one after the other."""
        unit = "m" if self.quantity == "piston" else "m3"
        name = "piston" if self.quantity == "piston" else "volume"
        sources = list(dict.fromkeys(step.source for step in self.steps))
        parts = [
            {
                "log": np.full(len(s.time), float(sources.index(s.source) + 1)),
                "step": np.full(len(s.time), float(number)),
                "time_s": s.time,
                "voltage_V": np.full(len(s.time), np.nan) if s.voltage is None else s.voltage,
                f"{name}_{unit}": s.position,
                f"{name}_fitted_{unit}": s.fitted,
                f"residual_{unit}": s.residual,
                "used": s.used.astype(float),
            }
            for number, s in enumerate(self.steps, start=1)
        ]
        return {head: np.concatenate([part[head] for part in parts]) for head in parts[0]}

    def to_json(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        return {
            "identified": self.identified,
            "driven_by": self.driven,
            "position": self.quantity,
            "parameters": _json(self.parameters),
            "derived": _json(self.derived),
            "asked": list(self.asked),
            "residual_std": self.noise,
            "correlation": self.correlation,
            "nine": [known._asdict() for known in self.nine],
            "logs": [
                {
                    "log": fit.source,
                    "parameters": _json(fit.parameters),
                    "refusal": fit.refusal,
                }
                for fit in self.logs
            ],
            "steps": [
                {
                    "log": s.source,
                    "step": number,
                    "what": s.label,
                    "start_s": float(s.time[0]),
                    "duration_s": float(s.time[-1] - s.time[0]),
                    "samples": len(s.time),
                    "outliers": int((~s.used).sum()),
                    "rms": s.rms,
                    "speed": s.speed,
                }
                for number, s in enumerate(self.steps, start=1)
            ],
            "findings": [f._asdict() for f in self.findings],
            "assumptions": list(self.assumptions),
            "notes": list(self.notes),
        }


def _json(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    return {name: {**e.to_json(), "why": e.why or None} for name, e in estimates.items()}
