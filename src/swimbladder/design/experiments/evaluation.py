"""A set of releases evaluated: predicted errors, for which vehicles, after how many releases.

That is what `identify` will say of the records, before there are any, and what becomes of its
estimates where the model leaves something out: psi, a trim, a drift.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.experiments.conditions import (
    Flight,
    Question,
    Ramps,
    Release,
    Setting,
    fisher_information,
    follow,
    problem_of,
)
from swimbladder.estimation.estimates import Estimate, Finding, estimate
from swimbladder.estimation.motion.diagnose import not_identifiable
from swimbladder.estimation.motion.fit import Fit, refine
from swimbladder.estimation.motion.model import NAMES
from swimbladder.estimation.motion.noise import ArNoise
from swimbladder.estimation.motion.problem import VOLUME, Problem

Array = NDArray[np.float64]


class OmittedVariable(NamedTuple):
    """A bias in shares of the parameters, by name: linearised, and by a refit where one is made.

    rms: what the refit leaves over [m], noise included; nan without one.
    """

    linear: dict[str, float]
    refit: Mapping[str, float] = {}
    rms: float = math.nan


def without_psi(
    flights: Sequence[Flight], question: Question, setting: Setting
) -> OmittedVariable | None:
    """Return what happens to the others if psi is taken for 0; None where it is, or all there is.

    The linearised bias is J^+ times what psi does to the depths; the refit is the fit of
    `identify`, of records with noise.
    """
    if question.values["psi"] == 0.0 or set(question.names) <= {"psi"}:
        return None
    problem, x = _at_the_truth(flights, question, setting, fixed={"psi": 0.0})
    effect = problem.residual(x)
    linear = _linear(problem, x, effect, question, setting)
    noise = np.random.default_rng(1).normal(scale=setting.depth_noise, size=len(effect))
    problem.measured = problem.measured + noise
    found = refine(problem, x)
    refit = {
        name: (problem.value(found.x, i) - question.values[name]) / question.size(name)
        for i, name in enumerate(problem.names)
    }
    rms = math.sqrt(float(np.average(found.residual**2, weights=found.weight)))
    return OmittedVariable(linear, refit, rms)


def without_trim(
    flights: Sequence[Flight], question: Question, setting: Setting
) -> OmittedVariable | None:
    """Return the bias if every neutral volume is off the same way, by its standard deviation.

    None where nothing is known of neutral volumes, so that nothing can be wrong.
    """
    if not math.isfinite(setting.neutral_std):
        return None
    problem, x = _at_the_truth(flights, question, setting)
    effect = problem.slope(x)[:, problem.shared : problem.first_start].sum(axis=1)
    off = setting.neutral_std / VOLUME
    return OmittedVariable(_linear(problem, x, effect * off, question, setting))


def without_drift(
    flights: Sequence[Flight], question: Question, setting: Setting
) -> OmittedVariable:
    """Return the bias if every neutral volume drifts the same way, by its standard deviation."""
    problem, x = _at_the_truth(flights, question, setting)
    J = problem.slope(x)
    effect = np.zeros(len(problem.measured))
    for j, flight in enumerate(flights):
        rows = slice(problem.rows[j], problem.rows[j + 1])
        middle = float(flight.time.mean() - flight.time[flight.moved[0]])
        shift = J[rows, problem.shared + j] / VOLUME * middle
        effect[rows] = problem.drift_slope(x, j) + shift
    return OmittedVariable(_linear(problem, x, effect * setting.drift_std, question, setting))


def _at_the_truth(
    flights: Sequence[Flight], question: Question, setting: Setting, *,
    fixed: Mapping[str, float] | None = None,
) -> tuple[Problem, Array]:  # fmt: skip
    problem = problem_of(flights, question, setting, fixed=fixed)
    x = problem.begin(question.values)
    for at in problem.starts_at[:-1]:
        x[at + 1] = 0.0
    return problem, x


def _pseudo_inverse(problem: Problem, x: Array, setting: Setting) -> Array:
    """Return what turns a small change of the depths [m] into one of x, [len(x), rows]."""
    J, P = problem.slope(x) / setting.depth_noise, problem.prior_rows(x)[1]
    rows = np.concatenate([J, P])
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    inverse: Array = np.linalg.pinv(rows / size) / size[:, None] / setting.depth_noise
    return inverse[:, : len(J)]


def _linear(
    problem: Problem, x: Array, effect: Array, question: Question, setting: Setting
) -> dict[str, float]:
    """Return by how much a change of the depths [m] moves each parameter, in shares."""
    step = _pseudo_inverse(problem, x, setting) @ effect
    moved = step[: problem.shared] * problem.per_entry(x) / question.sizes(problem.names)
    return dict(zip(problem.names, moved.tolist(), strict=True))


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """The covariance of a set of records, and where it comes from. Arrays in the order of names.

    parameters: as `identify` will report them, its standard deviations and intervals. sources: the
    shares of the variance that are due to the depths' noise, to the neutral volumes and to what was
    known before. drift: what a drift of the neutral volumes adds, 1 sigma, in their units; `share`
    puts both together, as a share of the parameter. open: what the records leave open.
    """

    names: tuple[str, ...]
    parameters: dict[str, Estimate]
    covariance: Array  # [p, p], of the values in SI
    sources: dict[str, dict[str, float]]
    drift: dict[str, float]
    share: dict[str, float]
    open: tuple[Finding, ...]

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters [p, p]."""
        size = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(size, size))


def predict(flights: Sequence[Flight], question: Question, setting: Setting) -> Prediction:
    """Return the predicted errors of the records of these flights, all fitted together."""
    problem, x = _at_the_truth(flights, question, setting)
    values, p = question.values, problem.shared
    J = problem.slope(x) / setting.depth_noise
    data, P = J.T @ J, problem.prior_rows(x)[1]
    C = _inverse(data + P.T @ P)
    per = problem.per_entry(x)
    drifts = [fisher_information(flight, question, values, setting).drift for flight in flights]
    return Prediction(
        names=problem.names,
        parameters={
            name: estimate(
                values[name], float(per[i] * math.sqrt(C[i, i])), NAMES[name].unit,
                logarithmic=problem.logarithmic[i],
            )
            for i, name in enumerate(problem.names)
        },
        covariance=C[:p, :p] * np.outer(per, per),
        sources=_sources(problem, C, data, P),
        **_drifted(problem, C, per, drifts, question, setting),
        open=tuple(not_identifiable(problem, _fit(problem, x, J, data, P, C, setting))),
    )  # fmt: skip


def _inverse(M: Array) -> Array:
    """Return the inverse of an information matrix; without information, a huge variance."""
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    values = np.maximum(values, 1e-13 * max(float(values[-1]), 1e-300))
    return np.asarray((vectors / values) @ vectors.T / np.outer(size, size))


def _sources(problem: Problem, C: Array, data: Array, P: Array) -> dict[str, dict[str, float]]:
    """Return each variance's shares: C = C (data + priors) C, a sum over what the errors are of."""
    parts = {
        "noise": data,
        "neutral volume": P[len(problem.priors) :].T @ P[len(problem.priors) :],
        "prior": P[: len(problem.priors)].T @ P[: len(problem.priors)],
    }
    variance = {source: np.diag(C @ part @ C) for source, part in parts.items()}
    whole = np.sum(list(variance.values()), axis=0)
    return {
        name: {source: float(v[i] / whole[i]) for source, v in variance.items()}
        for i, name in enumerate(problem.names)
    }


def _drifted(
    problem: Problem, C: Array, per: Array, drifts: Sequence[Array], question: Question,
    setting: Setting,
) -> dict[str, dict[str, float]]:  # fmt: skip
    """Return what drifts add to the error [unit], and the shares of it all."""
    p = problem.shared
    size = question.sizes(problem.names)
    shares = C[:p, :p] * np.outer(per / size, per / size)
    moved = shares @ np.stack(drifts, axis=1) * setting.drift_std
    off = np.sqrt((moved**2).sum(axis=1))
    both = np.sqrt(np.diag(shares) + off**2)
    return {
        "drift": {n: float(d) for n, d in zip(problem.names, off * size, strict=True)},
        "share": {n: float(s) for n, s in zip(problem.names, both, strict=True)},
    }


def _fit(
    problem: Problem, x: Array, J: Array, data: Array, P: Array, C: Array, setting: Setting
) -> Fit:
    """Return the fit that would be made if the records were as predicted."""
    n, k = len(problem.measured), len(problem.experiments)
    information: Array = data + P.T @ P
    return Fit(
        x=x, residual=np.zeros(n), weight=np.ones(n), noise=np.full(k, setting.depth_noise),
        root=np.full(n, 1.0 / setting.depth_noise), objective=0.0, slope=J * setting.depth_noise,
        ar=((),) * k, ar_noise=(ArNoise((), 1.0),) * k,
        information=information, covariance=C, data=data,
    )  # fmt: skip


_NOT_YET = 3.0  # of a parameter: nothing is known of it
_SIZES = 12
_PLACE = 0.35  # of the way, where to-and-fro releases of the curve turn


@dataclass(frozen=True, kw_only=True)
class EvaluatedSet:
    """A set of releases with its predicted errors for the given vehicle, and for others.

    time: pool time [s], settling included. spread: least and largest share of each parameter's
    error, drift included, over the parameter region. after: the same shares once each
    release is done, None where not yet known. partial: of each release, in how many of the vehicles
    not all its moves happen. psi, trim, drift: what leaving them out does.
    """

    releases: tuple[Release, ...]
    flights: tuple[Flight, ...]
    others: tuple[tuple[Flight, ...], ...]  # of each vehicle of the parameter region
    time: float
    prediction: Prediction
    spread: dict[str, tuple[float, float]]
    after: tuple[dict[str, float | None], ...]
    partial: tuple[int, ...]
    psi: OmittedVariable | None
    trim: OmittedVariable | None
    drift: OmittedVariable

    @property
    def largest(self) -> float:
        """The largest share by which a parameter is uncertain, drift included."""
        return max(self.prediction.share.values())


def evaluate(
    releases: Sequence[Release], question: Question, setting: Setting, ramps: Ramps,
    vehicles: Sequence[Mapping[str, float]],
) -> EvaluatedSet:  # fmt: skip
    """Return a set of releases with all that can be said of it beforehand."""
    flights = [follow(r, question.model, question.values, ramps, setting) for r in releases]
    others = [[follow(r, question.model, v, ramps, setting) for r in releases] for v in vehicles]
    shares = np.array(
        [
            _after(flights_of, question, v, setting)[-1]
            for flights_of, v in zip(others, vehicles, strict=True)
        ]
    )
    return EvaluatedSet(
        releases=tuple(releases), flights=tuple(flights),
        others=tuple(tuple(flights_of) for flights_of in others),
        time=sum(f.duration + setting.settling for f in flights),
        prediction=predict(flights, question, setting),
        spread={
            name: (float(column.min()), float(column.max()))
            for name, column in zip(question.names, shares.T, strict=True)
        },
        after=tuple(
            {
                name: float(s) if s < _NOT_YET else None
                for name, s in zip(question.names, row, strict=True)
            }
            for row in _after(flights, question, question.values, setting)
        ),
        partial=tuple(sum(not f[k].complete for f in others) for k in range(len(releases))),
        psi=without_psi(flights, question, setting),
        trim=without_trim(flights, question, setting),
        drift=without_drift(flights, question, setting),
    )  # fmt: skip


def _after(
    flights: Sequence[Flight], question: Question, values: Mapping[str, float], setting: Setting
) -> list[Array]:
    """Return the shares of all parameters after each of the records."""
    known = [fisher_information(flight, question, values, setting) for flight in flights]
    gain = np.cumsum([one.gain for one in known], axis=0)
    drift = np.cumsum([np.outer(one.drift, one.drift) for one in known], axis=0)
    return [_shares(*both, question, setting) for both in zip(gain, drift, strict=True)]


def _shares(gain: Array, drift: Array, question: Question, setting: Setting) -> Array:
    """Return the shares of the parameters with what records say, and what a drift does to them."""
    C = np.linalg.inv(gain + question.prior() + 1e-9 * np.eye(len(gain)))
    return np.sqrt(np.diag(C + setting.drift_std**2 * C @ drift @ C))


@dataclass(frozen=True, kw_only=True)
class Curve:
    """How well parameters would be known if the pool time went to releases of one size, up and
    down in turns: the largest share, drift included, for single steps and for to and fro.
    """

    sizes: Array  # m3
    steps: Array
    to_and_fro: Array

    @property
    def best_step(self) -> float:
        """The size of single steps beyond which a larger one is less informative [m3]."""
        return float(self.sizes[int(np.argmin(self.steps))])


def curve(
    question: Question, setting: Setting, ramps: Ramps, sizes: tuple[float, float], time: float
) -> Curve:
    """Return what sizes [m3] between two buy in a pool time [s]."""
    grid = np.geomspace(*sizes, _SIZES)
    span = setting.deepest - setting.shallowest
    found: list[list[float]] = [[], []]
    for size in grid.tolist():
        for way, shares in zip((False, True), found, strict=True):
            pair = []
            for start, sign in ((setting.deepest, 1.0), (setting.shallowest, -1.0)):
                volumes = [sign * size, -sign * size] if way else [sign * size]
                turn = start - sign * _PLACE * span
                pair.append(Release.to_and_fro(start, volumes, [turn] * (len(volumes) - 1)))
            shares.append(_repeated(pair, question, setting, ramps, time))
    return Curve(sizes=grid, steps=np.array(found[0]), to_and_fro=np.array(found[1]))


def _repeated(
    pair: Sequence[Release], question: Question, setting: Setting, ramps: Ramps, time: float
) -> float:
    """Return the largest share if releases are repeated for a time."""
    values = question.values
    flights = [follow(r, question.model, values, ramps, setting) for r in pair]
    known = [fisher_information(f, question, values, setting) for f in flights]
    times = time / sum(f.duration + setting.settling for f in flights)
    gain = times * np.sum([k.gain for k in known], axis=0)
    drift = times * np.sum([np.outer(k.drift, k.drift) for k in known], axis=0)
    return float(_shares(gain, drift, question, setting).max())


def deeper(
    releases: Sequence[Release], question: Question, setting: Setting, ramps: Ramps, factor: float
) -> dict[str, float]:
    """Return the shares in a pool that leaves `factor` times the travel, the depths stretched."""
    more = (factor - 1.0) * (setting.deepest - setting.shallowest)
    pool = replace(setting, pool_depth=setting.pool_depth + more)

    def to(depth: float) -> float:
        return setting.shallowest + factor * (depth - setting.shallowest)

    stretched = [
        Release(
            to(r.start),
            tuple(
                m if m.depth is None else m.model_copy(update={"depth": to(m.depth)})
                for m in r.moves
            ),
        )
        for r in releases
    ]
    flights = [follow(r, question.model, question.values, ramps, pool) for r in stretched]
    return predict(flights, question, pool).share
