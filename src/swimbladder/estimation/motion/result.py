"""What an identification says, in words and numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.estimates import Estimate, Finding, Prior
from swimbladder.estimation.series import Array
from swimbladder.vehicle import Vehicle

if TYPE_CHECKING:
    from swimbladder.estimation.motion.posterior import Posterior
    from swimbladder.estimation.motion.random_walk import RandomWalkFit


class Profile(NamedTuple):
    """How much worse the fit becomes as one parameter is held and all others follow.

    deviance: twice the drop of the log likelihood, for autocorrelated residuals; 3.84 at the ends
    of the 95 % interval.
    """

    name: str
    unit: str
    values: Array
    deviance: Array
    ci95: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A model of the same data: its drag law, what became of psi, and the evidence for it.

    log_likelihood: autocorrelated residuals counted as the fewer independent ones that they are
    worth. weight: probability among the models tried, by the Bayesian information criterion.
    """

    drag: str
    psi: Literal["free", "prior", "set", "zero"]
    parameters: int
    rms: float  # m
    log_likelihood: float
    bic: float
    weight: float
    values: dict[str, float]
    reported: bool  # the one whose parameters are given

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {"rms_m" if name == "rms" else name: value for name, value in vars(self).items()}


@dataclass(frozen=True, kw_only=True)
class ExperimentFit:
    """One log in the fit: measured less predicted depth, and what belongs to this log alone.

    estimates: neutral_error [m3], the true neutral volume at reference_depth [m] less the assumed;
    start_depth [m] and start_speed [m/s] of its first stretch. weight: 0 where a sample is not
    used, less than 1 for outliers. ar: coefficients of the residual's autoregression. drift: of the
    neutral volume over the log [m3/s]. own_gain: logarithm of the gain (K2; of a quadratic drag its
    inverse) of this log alone over that of all together, and its std; None where it has none.
    """

    source: str
    record: Record
    reference_depth: float
    predicted: Array  # m, nan where no stretch is
    residual: Array  # m
    weight: Array
    estimates: dict[str, Estimate]
    drift: Estimate
    noise: float  # m
    rms: float  # m, outliers left out
    ar: tuple[float, ...]
    whiteness_p: float
    outliers: int
    step: float  # m3, typical volume against neutral
    own_gain: tuple[float, float] | None = None

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            "log": self.source,
            "rms_m": self.rms,
            "noise_m": self.noise,
            "samples": int((self.weight > 0.0).sum()),
            "outliers": self.outliers,
            "whiteness_p": self.whiteness_p,
            "autoregression": list(self.ar),
            "reference_depth_m": self.reference_depth,
            "drift": self.drift.to_json(),
            "step_m3": self.step,
            "own_gain": None if self.own_gain is None else list(self.own_gain),
            **{name: e.to_json() for name, e in self.estimates.items()},
        }


@dataclass(frozen=True, kw_only=True)
class Identification:
    """The parameters of a vehicle's vertical motion, how sure they are, and why.

    parameters: in the order of `names`; covariance [p, p] of their values in SI units. A parameter
    that is not identifiable is in `parameters` with an interval that says so, and among the
    findings of severity no. derived: what follows from them. assumptions: priors and settings, in
    sentences; priors and neutral_std [m3], infinite for none, as numbers. random_walk, posterior:
    where they were asked for.
    """

    names: tuple[str, ...]
    law: str
    parameters: dict[str, Estimate]
    derived: dict[str, Estimate]
    covariance: Array
    correlation: Array
    experiments: tuple[ExperimentFit, ...]
    findings: tuple[Finding, ...]
    choices: tuple[Choice, ...]
    profiles: dict[str, Profile]
    assumptions: tuple[str, ...]
    priors: dict[str, Prior]
    neutral_std: float  # m3
    notes: tuple[str, ...]  # of reading the logs
    depth_noise: float  # m
    result_vehicle: Vehicle = field(repr=False)
    random_walk: RandomWalkFit | None = None
    posterior: Posterior | None = None

    @property
    def identified(self) -> bool:
        """Whether the data identify all that was asked."""
        return all(f.severity != "no" for f in self.findings)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle with what was identified; raises NoAnswerError where that is not all."""
        self.check()
        return self.result_vehicle

    def check(self) -> None:
        """Raise NoAnswerError, with every reason, where not all that was asked is identifiable."""
        reasons = [f.sentence for f in self.findings if f.severity == "no"]
        if reasons:
            raise NoAnswerError(" ".join(reasons))

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON; without numbers of what is not identifiable."""
        identified = self.identified
        unknown = {"value": None, "std": None, "ci95": None}
        return {
            "vehicle": self.result_vehicle.name,
            "identified": identified,
            "drag": self.law,
            "parameters": {
                name: e.to_json() if identified or e.origin == "set" else {**e.to_json(), **unknown}
                for name, e in self.parameters.items()
            },
            "derived": {
                name: e.to_json() if identified else {**e.to_json(), **unknown}
                for name, e in self.derived.items()
            },
            "names": list(self.names),
            "covariance": self.covariance.tolist() if identified else None,
            "correlation": self.correlation.tolist(),
            "experiments": [e.to_json() for e in self.experiments],
            "findings": [f._asdict() for f in self.findings],
            "choices": [
                {**c.to_json(), **({} if identified else {"values": {}})} for c in self.choices
            ],
            "profiles": {
                name: {
                    "values": p.values.tolist(),
                    "deviance": p.deviance.tolist(),
                    "ci95": list(p.ci95),
                    "unit": p.unit,
                }
                for name, p in self.profiles.items()
            },
            "assumptions": list(self.assumptions),
            "notes": list(self.notes),
            "depth_noise_m": self.depth_noise,
            "random_walk": None if self.random_walk is None else self.random_walk.to_json(),
            "posterior": None if self.posterior is None else self.posterior.to_json(),
        }
