"""What an identification says, in words and numbers, and the vehicle that it makes.

How logs of one vehicle differ: the spread of psi, drag, drift and noise between them.

A fit of several logs together says how well a common value is known, not how far the next log's
own may be from it. Here every log has values of its own, drawn from a normal distribution whose
means and deviations are those under which the logs are most probable. Their likelihood, by the
same filters that later predict, is sampled once over a wide distribution; the narrow one is then
found by expectation and maximisation with importance weights (Dempster, Laird and Rubin, J. R.
Stat. Soc. B 39, 1977).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.comparison.ahead import Normal, Tuning, Unknowns, draw, places, unknowns
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.estimates import Estimate, Finding, Prior
from swimbladder.estimation.kalman import log_likelihood
from swimbladder.estimation.motion.fit import autoregression, whiteness
from swimbladder.estimation.motion.posterior import Posterior
from swimbladder.estimation.motion.problem import NAMES, Experiment, Model, Problem
from swimbladder.estimation.motion.process_noise import ProcessNoiseFit
from swimbladder.io.answers import Answer, as_json, plain
from swimbladder.physics.arrays import Array
from swimbladder.vehicle import (
    Between,
    Drag,
    Identified,
    IdentifiedActuator,
    IdentifiedMotion,
    Motion,
    PhysicalMotion,
    Vehicle,
)

ProcessNoise = Literal["auto", "always", "never"]
Psi = Literal["free", "prior", "set", "zero"]


class Asked(NamedTuple):
    """What is to be found, and how."""

    process_noise: ProcessNoise
    profiles: bool
    choices: bool
    posterior: int | None  # seed of draws


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
    psi: Psi
    parameters: int
    rms: float  # m
    log_likelihood: float
    bic: float
    weight: float
    values: dict[str, float]
    reported: bool  # the one whose parameters are given

    @classmethod
    def of(
        cls, problem: Problem, psi: Psi, values: Mapping[str, float], samples: float, **more: Any
    ) -> Choice:
        """Return the model of a problem; samples: independent ones; more: other fields."""
        penalty = problem.shared * math.log(samples)
        return cls(
            drag=problem.model.law,
            psi=psi,
            parameters=problem.shared,
            bic=penalty - 2.0 * more["log_likelihood"],
            weight=math.nan,
            values={n: values[n] for n in problem.names},
            **more,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        keys = "drag psi parameters rms_m log_likelihood bic weight values reported"
        return as_json(self, keys)


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
    residual: Array  # m, nan where no stretch is
    weight: Array
    estimates: dict[str, Estimate]
    drift: Estimate
    noise: float  # m
    rms: float  # m, outliers left out
    ar: tuple[float, ...]
    whiteness_p: float
    step: float  # m3, typical volume against neutral
    own_gain: tuple[float, float] | None = None

    @classmethod
    def of(cls, e: Experiment, own: Array, white: Array, **more: Any) -> ExperimentFit:
        """Return the fit of an experiment.

        own [3, 2]: neutral_error, start_depth and start_speed, each with its deviation; white:
        residuals of one variance at the samples used; more: other fields.
        """
        units = {"neutral_error": "m3", "start_depth": "m", "start_speed": "m/s"}
        pairs = zip(units.items(), own.tolist(), strict=True)
        return cls(
            source=e.source,
            record=e.record,
            reference_depth=e.reference,
            estimates={name: Estimate.of(at[0], at[1], unit) for (name, unit), at in pairs},
            ar=autoregression(white),
            whiteness_p=whiteness(white),
            step=e.step(),
            **more,
        )

    @property
    def predicted(self) -> Array:
        """Depths [m], nan where no stretch is."""
        return self.record.depth - self.residual

    @property
    def outliers(self) -> int:
        """How many of the samples used are outliers."""
        return int((self.weight[np.isfinite(self.residual)] < 0.5).sum())

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        keys = "outliers whiteness_p autoregression=ar reference_depth_m drift step_m3 own_gain"
        return {
            **as_json(self, "log=source rms_m noise_m"),
            "samples": int((self.weight > 0.0).sum()),
            **as_json(self, keys),
            **plain(self.estimates),
        }


@dataclass(frozen=True, kw_only=True)
class Identification(Answer):
    """The parameters of a vehicle's vertical motion, how sure they are, and why.

    parameters: in the order of `names`; covariance [p, p] of their values in SI units. A parameter
    that is not identifiable is in `parameters` with an interval that says so, and among the
    findings of severity no. derived: what follows from them. assumptions: priors and settings, in
    sentences; priors and neutral_std [m3], infinite for none, as numbers. volume_delay: by which
    the stamps of the volumes are later than the depths' [s]. process_noise: where the vehicle
    does not quite move as the model has it, or asked for; posterior: where asked for.
    """

    names: tuple[str, ...]
    law: str
    parameters: dict[str, Estimate]
    derived: dict[str, Estimate]
    covariance: Array
    experiments: tuple[ExperimentFit, ...]
    findings: tuple[Finding, ...]
    choices: tuple[Choice, ...]
    profiles: dict[str, Profile]
    assumptions: tuple[str, ...]
    priors: dict[str, Prior]
    neutral_std: float  # m3
    notes: tuple[str, ...]  # of reading the logs
    depth_noise: float  # m, of the residual: the sensor's and what the model lacks
    sensor_noise: float  # m, the part that neighbouring samples do not share
    result_vehicle: Vehicle = field(repr=False)
    process_noise: ProcessNoiseFit | None = None
    volume_delay: Estimate
    posterior: Posterior | None = None

    @property
    def identified(self) -> bool:
        """Whether the data identify all that was asked."""
        return all(f.severity != "no" for f in self.findings)

    @property
    def correlation(self) -> Array:
        """The covariance over both standard deviations."""
        size = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        with np.errstate(invalid="ignore"):  # nan for what is not identifiable at all
            return np.asarray(self.covariance / np.outer(size, size))

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

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON; without numbers of what is not identifiable."""
        identified = self.identified
        unknown = {} if identified else {"value": None, "std": None, "ci95": None}

        def shown(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
            """Return estimates as JSON, without values where nothing was identified but set."""
            return {
                name: e.to_dict() | ({} if e.origin == "set" else unknown)
                for name, e in estimates.items()
            }

        return {
            "vehicle": self.result_vehicle.name,
            "identified": identified,
            "drag": self.law,
            "parameters": shown(self.parameters),
            "derived": shown(self.derived),
            "names": list(self.names),
            "covariance": self.covariance.tolist() if identified else None,
            **as_json(self, "correlation experiments findings"),
            "choices": [c.to_dict() | ({} if identified else {"values": {}}) for c in self.choices],
            "profiles": {
                name: as_json(p, "values deviance ci95 unit") for name, p in self.profiles.items()
            },
            **as_json(
                self, "assumptions notes depth_noise_m sensor_noise_m process_noise posterior"
            ),
            "volume_delay": self.volume_delay.to_dict(),
        }


def mass_and_drag(
    model: Model, names: Sequence[str], values: Mapping[str, float], covariance: Array
) -> dict[str, Estimate]:
    """Return what follows of mass and laminar drag, by the delta rule; covariance of the names."""
    if model.law == "quadratic":
        return {}

    def of(quantity: Callable[[Mapping[str, float]], float], unit: str) -> Estimate:
        """Return a quantity of the parameters; its gradient is by relative steps of 1e-6."""
        at = quantity(values)
        ahead = [quantity({**values, n: values[n] * (1.0 + 1e-6)}) for n in names]
        steps = np.array([1e-6 * values[n] or 1.0 for n in names])
        slope = (np.array(ahead) - at) / steps
        known = np.isfinite(np.diag(covariance)) | (slope == 0.0)
        spread = np.where(np.isfinite(covariance), covariance, 0.0)
        std = math.sqrt(max(float(slope @ spread @ slope), 0.0)) if known.all() else math.inf
        return Estimate.of(at, std, unit, logarithmic=True)

    k_b = model.specific_weight
    return {"mass": of(model.mass, "kg"), "drag": of(lambda v: k_b / v["K2"], "N s/m")}


def held_values(problem: Problem) -> dict[str, Estimate]:
    """Return what is shown beside the parameters: what was set of the drag law's and psi."""
    shown = ("psi",) if problem.model.law == "quadratic" else ("K2", "T2", "psi")
    others = (name for name in shown if name not in problem.names)
    return {name: Estimate.given(problem.values[name], NAMES[name].unit) for name in others}


def dry_mass(vehicle: Vehicle) -> float | None:
    """Return dry and entrained mass [kg], None where the vehicle does not state them."""
    motion = vehicle.motion
    return motion.dry_mass + motion.entrained_mass if isinstance(motion, PhysicalMotion) else None


def trim_of(each: Sequence[ExperimentFit], vehicle: Vehicle) -> float | None:
    """Return the mean neutral volume at depth 0 [m3], None where no log's volume counts from
    mid-stroke.
    """
    known = [e for e in each if e.record.volume_absolute and e.record.drive == "volume"]
    errors = [e.estimates["neutral_error"].value for e in known]
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


class Values(NamedTuple):
    """What goes into a vehicle: all values of a model in SI by name, and how they were found."""

    names: tuple[str, ...]  # of what was identified
    values: Mapping[str, float]
    covariance: Array  # of those identified, in their order
    logs: tuple[str, ...]
    trim_error: float | None = None  # m3


def identified_vehicle(vehicle: Vehicle, model: Model, found: Values, **noise: float) -> Vehicle:
    """Return the vehicle with its motion, psi and, where known, trim as identified.

    A vehicle given by K2 and T2 stays one where its drag is laminar. Where masses are stated, the
    added mass takes up what was identified; where that would leave less than they are, all of it
    stands as the dry mass. noise: of the filter and between logs, by the names of `Identified`.
    """
    names, values, covariance, logs, trim_error = found
    changes: dict[str, Any] = {
        "hull": vehicle.hull.model_copy(update={"psi": values["psi"]}),
        "motion": _motion(vehicle, model, values),
    }
    if trim_error is not None:
        changes["trim_error"] = trim_error
    if "K1" in names and isinstance(actuator := vehicle.engine, IdentifiedActuator):
        changes["actuator"] = actuator.model_copy(update={n: values[n] for n in ("K1", "T1")})
    changes["provenance"] = _provenance(vehicle, names, logs, trim=trim_error is not None)
    known = tuple(float(values[name]) for name in names)
    rows = tuple(map(tuple, covariance.tolist()))
    changes["identified"] = Identified(
        names=names, values=known, covariance=rows, logs=logs, **noise
    )
    return vehicle.model_copy(update=changes)


def _motion(
    vehicle: Vehicle, model: Model, values: Mapping[str, float]
) -> IdentifiedMotion | PhysicalMotion:
    old = vehicle.motion
    if model.law == "linear" and isinstance(old, IdentifiedMotion):
        return IdentifiedMotion(kind="identified", K2=values["K2"], T2=values["T2"])
    terms: dict[str, Any] = {"law": model.law}
    if model.law != "quadratic":
        terms["k_dl"] = model.specific_weight / values["K2"]
    if model.law != "linear":
        terms["k_dt"] = values["drag_quadratic"]
    if model.law == "blended" and values["drag_quadratic"] <= 0.0:
        terms = {"law": "linear", "k_dl": terms["k_dl"]}
    m = model.mass(values)
    dry, water, drag = m, 0.0, Drag(**terms)
    if isinstance(old, PhysicalMotion) and m >= old.dry_mass + old.entrained_mass:
        dry, water = old.dry_mass, old.entrained_mass
    rest = {"entrained_mass": water, "added_mass": m - dry - water, "drag": drag}
    return PhysicalMotion(kind="physical", dry_mass=dry, **rest)


def _provenance(
    vehicle: Vehicle, names: tuple[str, ...], logs: tuple[str, ...], *, trim: bool
) -> dict[str, str]:
    origin = f"identified: from {logs[0]}"
    if len(logs) > 1:
        origin += f" and {len(logs) - 1} more, which identified.logs names"
    before = vehicle.provenance.items()
    kept = {k: text for k, text in before if not k.startswith("motion") and k != "identified"}
    own = {"psi": ("hull.psi",), "K1": ("actuator.K1", "actuator.T1")}
    kept |= dict.fromkeys(["motion", *(key for name in names for key in own.get(name, ()))], origin)
    if trim:
        kept["trim_error"] = f"{origin}: the mean of their neutral volumes"
    return kept


FEWEST = 4  # logs
_COUNT = 1023  # of filters for each log
_ROUNDS = 200
# How the values identified follow the drag: what a share more of it makes of them.
_OF_DRAG = {"K2": -1.0, "T2": -1.0, "drag_quadratic": 1.0}
_LEAST = 0.2  # of the wide deviation: so narrow one is as good as none to these filters
# Wide: beside what the vehicle's file says where it says little.
_WIDE_PSI = 4e-4  # 1/m, of the displaced volume
_WIDE_DRAG = 0.4
_WIDE_DRIFT = 2e-6  # 1/s, of the displaced volume
_WIDE_NOISE = {"depth_noise": 0.3, "random_walk": 1.5, "acceleration_noise": 1.0}


def between_logs(records: Sequence[Record], vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with the means over the logs, and how these differ, in its [identified].

    vehicle: identified from these logs. Its psi, drag, trim and noise become the means of what the
    logs have each, and the covariance allows for the few logs that they are from.
    Raises InputError where there are too few logs, or the vehicle was not identified.
    """
    known = vehicle.identified
    if len(records) < FEWEST:
        what = f"the between-log variance is not identifiable from {len(records)} logs"
        raise InputError(what, field="LOG", remedy=f"Give {FEWEST} or more")
    if known is None:
        what, remedy = "the vehicle was not identified", "Identify it first"
        raise InputError(what, field="identified", remedy=remedy)
    wide = _wide(vehicle)
    place = places(_COUNT)
    likelihood = np.array([_likelihoods(record, vehicle, wide) for record in records])
    mean, std = _spread(place, likelihood)
    return _with(vehicle, wide, mean, std, len(records))


def _wide(vehicle: Vehicle) -> Unknowns:
    u, _ = unknowns(vehicle, Tuning())
    volume = vehicle.hull.displaced_volume
    return u._replace(
        psi=Normal(u.psi.mean, _WIDE_PSI * volume),
        drag=Normal(0.0, _WIDE_DRAG),
        drift=Normal(0.0, _WIDE_DRIFT * volume),
        **{name: Normal(getattr(u, name).mean, std) for name, std in _WIDE_NOISE.items()},
    )


def _likelihoods(record: Record, vehicle: Vehicle, wide: Unknowns) -> Array:
    """Return the log likelihood of the whole record for every draw [_COUNT]."""
    if record.volume is None:
        raise InputError("a log without volume says nothing of it", field="volume_m3")
    members = draw(wide, vehicle, record, count=_COUNT)
    return np.array([log_likelihood(record.samples, member)[-1] for member in members])


def _spread(place: Array, likelihood: Array) -> tuple[Array, Array]:
    """Return mean and deviation of each unknown over the logs, in deviations of the wide one.

    place [draws, unknowns]: standard normal; likelihood [logs, draws].
    """
    p = place.shape[1]
    mean, std = np.zeros(p), np.ones(p)
    for _ in range(_ROUNDS):
        # the narrow density over the wide one, which drew them
        ratio = -0.5 * ((place - mean) / std) ** 2 - np.log(std) + 0.5 * place**2
        score = likelihood + ratio.sum(axis=1)
        weight = np.exp(score - score.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        own = weight @ place  # [logs, unknowns]
        square = weight @ place**2
        new = own.mean(axis=0)
        wide = np.sqrt(np.maximum((square - 2.0 * own * new + new**2).mean(axis=0), _LEAST**2))
        moved = max(np.abs(new - mean).max(), np.abs(wide - std).max())
        mean, std = new, wide
        if moved < 1e-3:
            break
    return mean, std


def _with(vehicle: Vehicle, wide: Unknowns, mean: Array, std: Array, logs: int) -> Vehicle:
    """Return the vehicle with what was found."""
    each = zip(wide, mean.tolist(), std.tolist(), strict=True)
    found = Unknowns(*(Normal(w.mean + w.std * m, w.std * s) for w, m, s in each))
    known = vehicle.identified
    assert known is not None  # between_logs checks it
    fields = ("depth_noise", "random_walk", "acceleration_noise")
    noises = dict(zip(fields, found[4:], strict=True))
    spread = {name: noise.std for name, noise in noises.items()}
    spread |= {"psi": found.psi.std, "drag": found.drag.std}
    between = Between(neutral_drift=found.drift.mean, neutral_drift_std=found.drift.std, **spread)
    share = math.exp(found.drag.mean)
    values, covariance = _values(known, found, share, logs)
    changes = {"between": between, "values": values, "covariance": covariance}
    changes |= {name: math.exp(noise.mean) for name, noise in noises.items()}
    changes["neutral_std"] = found.neutral.std
    update = {
        "trim_error": found.neutral.mean,
        "hull": vehicle.hull.model_copy(update={"psi": found.psi.mean}),
        "motion": _dragged(vehicle.motion, share),
        "identified": known.model_copy(update=changes),
    }
    return vehicle.model_copy(update=update)


def _values(
    known: Identified, found: Unknowns, share: float, logs: int
) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Return the values at the means, and their covariance: that of means of so many logs too."""
    old = np.array(known.values)
    is_psi = np.array([name == "psi" for name in known.names])
    of_drag = np.array([_OF_DRAG.get(name, 0.0) for name in known.names])
    new = np.where(is_psi, found.psi.mean, old * share**of_drag)
    scale = np.where(is_psi, 1.0, new / np.where(old == 0.0, 1.0, old))
    by_drag = found.drag.std * new * of_drag
    by_psi = found.psi.std * is_psi
    C = np.array(known.covariance) * np.outer(scale, scale)
    C += (np.outer(by_drag, by_drag) + np.outer(by_psi, by_psi)) / logs
    return tuple(new.tolist()), tuple(tuple(row) for row in C.tolist())


def _dragged(motion: Motion, share: float) -> Motion:
    """Return the motion with its drag times a share."""
    if isinstance(motion, IdentifiedMotion):
        return IdentifiedMotion(K2=motion.K2 / share, T2=motion.T2 / share)
    drag = motion.drag
    update = {"k_dl": drag.k_dl * share, "k_dt": drag.k_dt * share}
    return motion.model_copy(update={"drag": drag.model_copy(update=update)})
