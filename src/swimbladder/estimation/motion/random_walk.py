"""Parameters where the neutral volume is a random walk, whose intensity is estimated too.

Trapped air, a hull that takes up water or cools, a piston that slips: over minutes the neutral
volume moves, and a fit with a constant one biases drag and mass. Here it is a random walk, and the
innovations of a filter give the likelihood (Schweppe, IEEE Trans. Inf. Theory 11, 1965);
parameters, noise and the intensity of the random walk maximise it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.estimates import (
    Z95,
    Estimate,
    Finding,
    Prior,
    crossing,
    estimate,
    given,
)
from swimbladder.estimation.kalman.depth_filter import GATE, Noise
from swimbladder.estimation.motion.identifiability import LIMIT
from swimbladder.estimation.motion.model import NAMES, Model, check_names, default_names, model_of
from swimbladder.estimation.motion.random_effects import FEWEST, between_logs
from swimbladder.estimation.motion.random_walk_likelihood import (
    NOISES,
    Likelihood,
    Maker,
    Quantity,
    covariance,
    without_trace,
)
from swimbladder.estimation.motion.result import Identification
from swimbladder.estimation.motion.vehicle_update import identified_vehicle, neutral_spread, trim_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_SAME = 0.003  # of log likelihood: a step that gains less is the last
_RIDGE = 0.25  # information that bounds a step of a quantity that is not identifiable
_LONGEST = 1.5  # of a logarithm, a step
_ROUNDS = 80
_FARTHEST = 15.0  # of the logarithm of the intensity, where its end is sought
_UNITS = {"depth_noise": "m", "random_walk": "m3/s^0.5", "acceleration": "m/s/s^0.5"}


@dataclass(frozen=True, kw_only=True)
class RandomWalkFit:
    """What maximises the likelihood of the innovations, and how sure it is.

    estimates, covariance: of the names, in their order, SI. random_walk [m3/s^0.5], depth_noise [m,
    its quantum not included], acceleration [m/s^1.5, white]: intensities, with intervals.
    likelihood_ratio: twice the gain in log likelihood over a neutral volume that stays, whose
    chance under it is p_value. travelled [m3]: for each record how far the smoothed neutral
    volume went, largest less smallest.
    """

    names: tuple[str, ...]
    law: str
    estimates: dict[str, Estimate]
    covariance: Array
    random_walk: Estimate
    depth_noise: Estimate
    acceleration: Estimate
    noise: Noise
    values: dict[str, float]
    log_likelihood: float
    likelihood_ratio: float
    p_value: float
    travelled: tuple[float, ...]
    robust: bool  # the covariance is from the scatter of blocks, not from the information alone

    @property
    def drifts(self) -> bool:
        """Whether the random walk of the neutral volume is significant (1 %)."""
        return self.p_value < 0.01

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            "parameters": {name: e.to_json() for name, e in self.estimates.items()},
            "neutral_walk": self.random_walk.to_json(),
            "depth_noise": self.depth_noise.to_json(),
            "acceleration_noise": self.acceleration.to_json(),
            "log_likelihood": self.log_likelihood,
            "likelihood_ratio": self.likelihood_ratio,
            "p_value": self.p_value,
            "travelled_m3": list(self.travelled),
        }


def fit_random_walk(
    records: Sequence[Record], vehicle: Vehicle, *, free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None, priors: Mapping[str, Prior] | None = None,
    drag: str | None = None, neutral_std: float = math.inf, bottom_depth: float = math.inf,
    acceleration: bool = True, gate: float = GATE,
) -> RandomWalkFit:  # fmt: skip
    """Return the parameters, noise and random walk that maximise the likelihood of all innovations.

    free: names of NAMES that are estimated, those of the drag law and psi where not given; fixed:
    values in SI that are held; priors: by name, log-normal for positive quantities. drag: linear,
    quadratic or blended, the vehicle's own where not given. neutral_std: of every record's neutral
    volume about the vehicle's at its start [m3]; inf: nothing is known. acceleration: whether white
    acceleration may stand for what the model leaves out.

    Raises InputError where names, records and vehicle do not go together, NoAnswerError where the
    likelihood has no maximum that can be found.
    """
    fixed, priors = dict(fixed or {}), dict(priors or {})
    if not records:
        raise InputError("no record is given", field="LOG", remedy="Give at least one log")
    model = model_of(vehicle, law=drag, bottom_depth=bottom_depth)
    names = tuple(free) if free is not None else default_names(model.law, list(fixed))
    for named, option in ((names, "--free"), (list(fixed), "--set"), (list(priors), "--prior")):
        check_names(named, model, voltage=False, option=option)
    held = {**model.values, **fixed, **({} if acceleration else {"acceleration": 0.0})}
    noises = [q for q in NOISES if q.name not in held]

    def likelihood(quantities: Sequence[Quantity], values: Mapping[str, float]) -> Likelihood:
        return Likelihood(
            records, model, quantities, values=values, priors=priors, neutral_std=neutral_std,
            vehicle=vehicle, gate=gate,
        )  # fmt: skip

    own = [_quantity(name, model, held, priors) for name in names]
    full = likelihood([*own, *noises], held)
    x, best = _highest(full)
    still = [q for q in noises if q.name != "random_walk"]
    without = likelihood([*own, *still], {**held, "random_walk": 0.0})
    random_walk = [q.name for q in full.quantities].index("random_walk")
    _, least = _highest(without, [np.delete(x, random_walk)])
    ratio = max(2.0 * (best - least), 0.0)
    full, x = without_trace(full, x, likelihood, held)
    C, robust = covariance(full, x)
    return _outcome(full, x, best, C, robust, names, model, likelihood, ratio)


def _quantity(
    name: str, model: Model, held: Mapping[str, float], priors: Mapping[str, Prior]
) -> Quantity:
    begin = priors[name].mean if name in priors else held[name]
    logarithmic = model.logarithmic(name) or name == "drag_quadratic"
    return Quantity(name, logarithmic, 1.0 if logarithmic else model.scale(name), begin)


def _highest(likelihood: Likelihood, begins: Sequence[Array] = ()) -> tuple[Array, float]:
    """Return where the log posterior is highest, and how high.

    Raises NoAnswerError where it cannot be found.
    """
    first = likelihood.begin()
    found = [_climb(likelihood, x) for x in begins or (first, _noisier(likelihood, first))]
    place, height = max(found, key=lambda pair: pair[1])
    if height <= -1e11:
        raise NoAnswerError("the filter cannot follow these logs with this vehicle: check units")
    return place, height


def _climb(likelihood: Likelihood, x: Array) -> tuple[Array, float]:
    """Return where the log posterior ends to rise from x, and how high that is.

    Fisher's scoring, damped as Levenberg and Marquardt do.
    """
    height, damping = likelihood(x), 0.0
    for _ in range(_ROUNDS):
        scores, information = likelihood.scores(x)
        pull, hold = likelihood.prior_slope(x)
        slope = scores.sum(axis=0) + pull
        information += np.diag(hold + _RIDGE)
        while True:
            step = np.linalg.solve(information + damping * np.diag(np.diag(information)), slope)
            step *= min(1.0, _LONGEST / max(float(np.abs(step).max()), 1e-300))
            gain = 0.5 * float(slope @ step)
            if gain < _SAME:
                return x, height
            reached = likelihood(x + step)
            if reached > height + 0.1 * gain:
                x, height, damping = x + step, reached, damping / 5.0
                break
            damping = max(5.0 * damping, 0.3)
            if damping > 1e6:
                return x, height
    return x, height


def _noisier(likelihood: Likelihood, x: Array) -> Array:
    """Return another start: noise of every kind is larger, but the random walk small."""
    y = x.copy()
    for i, q in enumerate(likelihood.quantities):
        if q.name in _UNITS:
            y[i] += -2.0 if q.name == "random_walk" else 1.0
    return y


def _outcome(
    full: Likelihood, x: Array, best: float, C: Array, robust: bool, names: tuple[str, ...],
    model: Model, likelihood: Maker, ratio: float,
) -> RandomWalkFit:  # fmt: skip
    per = np.array([q.slope(float(at)) for q, at in zip(full.quantities, x, strict=True)])
    std = np.sqrt(np.maximum(np.diag(C), 0.0)) * per
    estimates: dict[str, Estimate] = {}
    for i, q in enumerate(full.quantities):
        unit = NAMES[q.name].unit if q.name in NAMES else _UNITS[q.name]
        estimates[q.name] = estimate(
            q.value(float(x[i])), float(std[i]), unit, logarithmic=q.logarithmic
        )
    p = len(names)
    values = full.named(x)
    walk = _interval(full, x, best, ratio, estimates["random_walk"], likelihood)
    paths = [f.smoothed()[0][:, 2] for f in full.filtered(x)]
    travelled = tuple(
        float(np.ptp(np.concatenate([path for i, path in zip(full.record, paths, strict=True)
                                     if i == j])))
        for j in range(len(full.records))
    )  # fmt: skip
    nothing = given(0.0, _UNITS["acceleration"])
    return RandomWalkFit(
        names=names, law=model.law, estimates={name: estimates[name] for name in names},
        covariance=C[:p, :p] * np.outer(per[:p], per[:p]), random_walk=walk,
        depth_noise=estimates["depth_noise"], acceleration=estimates.get("acceleration", nothing),
        noise=full.noise(values), values=values, log_likelihood=best, likelihood_ratio=ratio,
        p_value=0.5 * float(chi2.sf(ratio, 1)) if ratio > 0.0 else 1.0, travelled=travelled,
        robust=robust,
    )  # fmt: skip


def _interval(
    full: Likelihood, x: Array, best: float, ratio: float, found: Estimate, likelihood: Maker
) -> Estimate:
    """Return the random walk with the interval of its likelihood profile, which may include 0."""
    at = [q.name for q in full.quantities].index("random_walk")
    others = [q for q in full.quantities if q.name != "random_walk"]
    middle, begin = float(x[at]), np.delete(x, at)

    def beyond(distance: float) -> float:
        """Return how far the root of the deviance, which grows about evenly, is past 95 %."""
        held = likelihood(others, {**full.values, "random_walk": math.exp(middle + distance)})
        return math.sqrt(max(2.0 * (best - _highest(held, [begin])[1]), 0.0)) - Z95

    step = min(max(Z95 * found.std / found.value, 0.3), 1.5)
    low = crossing(beyond, -step, farthest=_FARTHEST, xtol=0.02) if ratio > Z95**2 else None
    high = crossing(beyond, step, farthest=_FARTHEST, xtol=0.02)
    return replace(found, ci95=(
        0.0 if low is None else math.exp(middle + low),
        math.inf if high is None else math.exp(middle + high),
    ))  # fmt: skip


# Findings on neutral volumes that stay.
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
        vehicle, model, values, fit.names, C, trim_error=trim_of(found.experiments, vehicle),
        depth_noise=noise.depth, neutral_walk=noise.random_walk,
        neutral_std=neutral_spread(found.experiments, found.neutral_std, single=0.0),
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


def _not_identifiable(fit: RandomWalkFit, model: Model) -> Iterator[Finding]:
    for name, e in fit.estimates.items():
        if model.logarithmic(name) and _share(e) > LIMIT:
            share = f"{100.0 * _share(e):.0f} %" if _share(e) < 10.0 else "any factor"
            yield Finding(
                "not identifiable",
                "no",
                f"With the neutral volume as a random walk {name} is not identifiable: {share} of "
                "error. Give it a value (--set) or a prior (--prior), or add logs.",
            )


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
