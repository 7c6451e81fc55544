"""What is found: parameters of all logs together and of each, the steps, and what it means.

Of the nine parameters of section 2.3 it says which the logs fixed, and where the others come from.
The paper counts nine and names four of them, which shallow-water experiments give: K1, T1, K2, T2.
Eqs (32) and (33) hold, beside these, A, k_z/k_u, k_l and psi; eq. (28) needs rho g.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.actuator.bench import Driven, Quantity
from swimbladder.estimation.estimates import Estimate, Finding
from swimbladder.estimation.series import rms
from swimbladder.io.answers import Answer, as_json
from swimbladder.physics.actuator import reduced, to_identified
from swimbladder.physics.arrays import Array, Flags
from swimbladder.vehicle import (
    AnyActuator,
    Identified,
    IdentifiedActuator,
    IdentifiedMotion,
    Positioner,
    Vehicle,
)

Source = Literal["logs", "set", "vehicle", "not known"]

PARAMETERS: Mapping[str, str] = {
    "K1": "m/s/V",
    "T1": "s",
    "dead_zone": "V",
    "load_voltage": "V",
    "asymmetry": "",
    "rate": "m/s",
}
"""Name and unit of what is identified."""

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
    found, of_vehicle = [], {} if vehicle is None else _of_vehicle(vehicle)
    for symbol, (unit, meaning) in NINE.items():
        value, origin = of_vehicle.get(symbol, (None, "no vehicle was given"))
        source: Source = "not known" if value is None else "vehicle"
        estimate = parameters.get(symbol)
        if estimate is not None and estimate.known:
            value, source = estimate.value, "logs" if estimate.origin == "data" else "set"
            origin = logs if source == "logs" else "given with `fixed=`"
        found.append(Known(symbol, value, unit, meaning, source, origin))
    return tuple(found)


def _of_vehicle(vehicle: Vehicle) -> dict[str, tuple[float | None, str]]:
    """Return by symbol what the vehicle's file says of it, and where it has it from."""
    actuator, motion, drag = vehicle.engine, vehicle.motion, vehicle.drag
    area, k_b = vehicle.piston_area, vehicle.water.specific_weight
    inner = "drive.piston_area" if actuator.kind == "electromechanical" else "piston_area"
    of_area = f"an actuator of kind {actuator.kind} has no piston area in its file"
    found: dict[str, tuple[float | None, str]] = {
        "psi": (vehicle.hull.psi, _origin(vehicle, "hull.psi")),
        "rho g": (k_b, _origin(vehicle, "water.density")),
        "A": (area, of_area if area is None else _origin(vehicle, f"actuator.{inner}")),
    }
    if isinstance(actuator, Positioner):
        why = "a positioner has none: it goes to positions at a constant speed"
        found |= dict.fromkeys(("K1", "T1", "k_z/k_u", "k_l"), (None, why))
    else:
        a = reduced(actuator, vehicle.water)
        values = {"K1": None if area is None else a.gain / area, "T1": a.T1}
        for symbol, value in {**values, "k_z/k_u": a.load_drive, "k_l": a.k_l}.items():
            place = "depth_voltage" if symbol == "k_z/k_u" else symbol
            origin = _origin(vehicle, f"actuator.{place}")
            if not isinstance(actuator, IdentifiedActuator):
                origin = "follows from motor and drive: " + _origin(vehicle, "actuator")
            found[symbol] = value, origin
    for symbol, upper in (("K2", k_b), ("T2", vehicle.mass)):
        if isinstance(motion, IdentifiedMotion):
            found[symbol] = getattr(motion, symbol), _origin(vehicle, f"motion.{symbol}")
        elif drag.k_dl <= 0.0:
            found[symbol] = None, f"the drag law of the vehicle, {drag.law}, has no laminar part"
        else:
            origin = "follows from masses and drag: " + _origin(vehicle, "motion.drag")
            found[symbol] = upper / drag.k_dl, origin
    return found


def _origin(vehicle: Vehicle, place: str) -> str:
    """Return what the vehicle's provenance says of a field, or of the nearest table above it."""
    while place:
        if place in vehicle.provenance:
            return vehicle.provenance[place]
        place = place.rpartition(".")[0]
    return f"the file of {vehicle.name}, which does not say where from"


@dataclass(frozen=True)
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
    used: Flags
    voltage: Array | None = None  # V
    speed: float | None = None  # m/s, at full speed, where no voltage is known
    start: int = 0

    @property
    def residual(self) -> Array:
        """Measured less fitted."""
        return self.position - self.fitted

    @property
    def rms(self) -> float:
        """Root mean square of the residual, outliers aside."""
        kept = self.residual[self.used]
        return rms(kept) if len(kept) else 0.0


@dataclass(frozen=True)
class LogFit:
    """The estimates from one log alone; refusal: why there are none."""

    source: str
    parameters: dict[str, Estimate]
    refusal: str | None = None


@dataclass(frozen=True, kw_only=True)
class ActuatorIdentification(Answer):
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
    covariance: dict[str, dict[str, float]]  # SI
    logs: tuple[LogFit, ...]
    steps: tuple[Step, ...]
    nine: tuple[Known, ...]
    findings: tuple[Finding, ...]
    assumptions: tuple[str, ...]
    notes: tuple[str, ...]
    given: Vehicle | None

    @property
    def correlation(self) -> dict[str, dict[str, float]]:
        """The covariance over both standard deviations."""
        std = {name: math.sqrt(max(row[name], 1e-150)) for name, row in self.covariance.items()}
        return {
            a: {b: value / std[a] / std[b] for b, value in row.items()}
            for a, row in self.covariance.items()
        }

    @property
    def identified(self) -> bool:
        """Whether all that was asked for is identified, from logs that are no wreck."""
        return all(f.severity != "no" for f in self.findings)

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
        for finding in self.findings:
            if finding.severity == "no" and finding.kind != "not identifiable":
                raise NoAnswerError(finding.sentence)
        actuator, changed = self._actuator(self.given)
        if not changed:
            raise NoAnswerError(f"Nothing of the actuator of {self.given.name} was identified.")
        same_kind = actuator.kind == self.given.actuator.kind
        before = self.given.provenance.items()
        kept = {at: by for at, by in before if same_kind or not at.startswith("actuator")}
        origin = "identified from " + ", ".join(dict.fromkeys(fit.source for fit in self.logs))
        for name, place in changed.items():
            low, high = self.parameters[name].ci95
            kept[place] = f"{origin}; 95 % interval {low:.4g} to {high:.4g}"
        if not same_kind:
            kept["actuator"] = f"reduced to shallow-water parameters from {self.given.name}"
        changes = {"actuator": actuator, "provenance": kept}
        return self.given.model_copy(update=changes | {"identified": self._identified(self.given)})

    def _actuator(self, vehicle: Vehicle) -> tuple[AnyActuator, dict[str, str]]:
        """Return the actuator with the identified parameters, and {parameter: field} of them."""
        estimates = {n: e.value for n, e in self.parameters.items() if e.known}
        if vehicle.command == "volume":
            if self.quantity != "piston" or "rate" not in estimates:
                return vehicle.actuator, {}
            faster = vehicle.engine.model_copy(update={"speed": estimates["rate"]})
            return faster, {"rate": "actuator.speed"}
        names = {"K1": "K1", "K1A": "K1", "T1": "T1"}
        if {"K1", "K1A"} & set(estimates):
            names["dead_zone"] = "dead_zone"
        changed = {name: names[name] for name in estimates if name in names}
        if not changed:
            return vehicle.actuator, {}
        area = vehicle.piston_area or 1.0  # no piston: K1 is then a volume rate
        plain = to_identified(vehicle.engine, vehicle.water, piston_area=area)
        numbers = {field: max(estimates[name], 0.0) for name, field in changed.items()}
        places = {name: f"actuator.{field}" for name, field in changed.items()}
        return plain.model_copy(update=numbers), places

    def _identified(self, vehicle: Vehicle) -> Identified | None:
        """Return the table of covariances with those of K1 and T1 in it."""
        own = [n for n in ("K1", "K1A", "T1") if n in self.covariance]
        before = vehicle.identified
        if not own or vehicle.command == "volume":
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
        fields |= {"names": (*names, *others), "logs": (*fields.get("logs", ()), *sources)}
        fields |= {"values": tuple(values), "covariance": tuple(map(tuple, rows))}
        return Identified(**fields)

    def columns(self) -> dict[str, Array]:
        """Return the columns of steps.csv by name, the steps one after the other."""
        unit = "m" if self.quantity == "piston" else "m3"
        sources = list(dict.fromkeys(step.source for step in self.steps))
        parts = [
            {
                "log": np.full(len(s.time), float(sources.index(s.source) + 1)),
                "step": np.full(len(s.time), float(number)),
                "time_s": s.time,
                "voltage_V": np.full(len(s.time), np.nan) if s.voltage is None else s.voltage,
                f"{self.quantity}_{unit}": s.position,
                f"{self.quantity}_fitted_{unit}": s.fitted,
                f"residual_{unit}": s.residual,
                "used": s.used.astype(float),
            }
            for number, s in enumerate(self.steps, start=1)
        ]
        return {head: np.concatenate([part[head] for part in parts]) for head in parts[0]}

    def to_dict(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        return {
            **as_json(self, "identified driven_by=driven position=quantity"),
            "parameters": _json(self.parameters),
            "derived": _json(self.derived),
            **as_json(self, "asked residual_std=noise correlation nine"),
            "logs": [
                {"log": fit.source, "parameters": _json(fit.parameters), "refusal": fit.refusal}
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
                    **as_json(s, "rms speed"),
                }
                for number, s in enumerate(self.steps, start=1)
            ],
            **as_json(self, "findings assumptions notes"),
        }


def _json(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    return {name: {**e.to_dict(), "why": e.why or None} for name, e in estimates.items()}
