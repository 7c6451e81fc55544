"""A set of releases evaluated: predicted errors, for which vehicles, after how many releases.

That is what `identify` will say of the records, before there are any, and what becomes of its
estimates where the model leaves something out: psi, a trim, a drift.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from swimbladder.design.experiments.conditions import (
    Conditions,
    Flight,
    Release,
    fisher_information,
    follow,
    problem_of,
)
from swimbladder.estimation.estimates import Estimate, Finding
from swimbladder.estimation.motion.diagnose import Curvature, not_identifiable
from swimbladder.estimation.motion.fit import fit, inverse_of
from swimbladder.estimation.motion.problem import DRIFT, NAMES, VOLUME, Problem
from swimbladder.physics.arrays import Array


class OmittedVariable(NamedTuple):
    """A bias in shares of the parameters, by name: linearised, and by a refit where one is made.

    rms: what the refit leaves over [m], noise included; nan without one.
    """

    linear: dict[str, float]
    refit: Mapping[str, float] = {}
    rms: float = math.nan


def without_psi(flights: Sequence[Flight], c: Conditions) -> OmittedVariable | None:
    """Return what happens to the others if psi is taken for 0; None where it is, or all there is.

    The linearised bias is J^+ times what psi does to the depths; the refit is the fit of
    `identify`, of records with noise.
    """
    question = c.question
    if question.values["psi"] == 0.0 or set(question.names) <= {"psi"}:
        return None
    problem = problem_of(flights, c, psi=0.0)
    x = problem.begin(question.values)
    effect = problem.residual(x)
    linear = _linear(problem, x, effect, c)
    noise = np.random.default_rng(1).normal(scale=c.setting.depth_noise, size=len(effect))
    problem.measured = problem.measured + noise
    found = fit(problem, [x])
    values = problem.named(found.x)
    off = np.array([values[name] - question.values[name] for name in problem.names])
    rms = math.sqrt(float(np.average(found.residual**2, weights=found.weight)))
    return OmittedVariable(linear, _by_name(problem, off, c), rms)


def without_trim(flights: Sequence[Flight], c: Conditions) -> OmittedVariable | None:
    """Return the bias if every neutral volume is off the same way, by its standard deviation.

    None where nothing is known of neutral volumes, so that nothing can be wrong.
    """
    if not math.isfinite(c.setting.neutral_std):
        return None
    problem = problem_of(flights, c)
    x = problem.begin(c.question.values)
    effect = problem.slope(x)[:, problem.shared : problem.first_start].sum(axis=1)
    return OmittedVariable(_linear(problem, x, effect * c.setting.neutral_std / VOLUME, c))


def without_drift(flights: Sequence[Flight], c: Conditions) -> OmittedVariable:
    """Return the bias if every neutral volume drifts the same way, by its standard deviation."""
    problem = problem_of(flights, c)
    x = problem.begin(c.question.values)
    effect = problem.slope(x)[:, problem.first_drift : problem.delay_at].sum(axis=1)
    return OmittedVariable(_linear(problem, x, effect * c.setting.drift_std / DRIFT, c))


def _linear(problem: Problem, x: Array, effect: Array, c: Conditions) -> dict[str, float]:
    """Return by how much a change of the depths [m] moves each parameter, in shares."""
    J, noise = problem.slope(x), c.setting.depth_noise
    rows = np.concatenate([J / noise, problem.prior_rows(x)[1]])
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    step = (np.linalg.pinv(rows / size) / size[:, None])[:, : len(J)] @ (effect / noise)
    return _by_name(problem, step[: problem.shared] * problem.per_entry(x), c)


def _by_name(problem: Problem, moved: Array, c: Conditions) -> dict[str, float]:
    """Return changes of the parameters [unit] as shares, by name."""
    shares = moved / c.question.sizes(problem.names)
    return dict(zip(problem.names, shares.tolist(), strict=True))


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """The covariance of a set of records, and where it comes from. Arrays in the order of names.

    parameters: as `identify` will report them, its standard deviations and intervals. sources: the
    shares of the variance that are due to the depths' noise, to the neutral volumes, their drift,
    how late the volumes' stamps are, and to what was known before. share: the standard deviation as
    a share of the parameter. open: what the records leave open.
    """

    names: tuple[str, ...]
    parameters: dict[str, Estimate]
    covariance: Array  # [p, p], of the values in SI
    sources: dict[str, dict[str, float]]
    share: dict[str, float]
    open: tuple[Finding, ...]

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters [p, p]."""
        size = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(size, size))


def predict(flights: Sequence[Flight], c: Conditions) -> Prediction:
    """Return the predicted errors of the records of these flights, all fitted together."""
    problem = problem_of(flights, c)
    names, values, p = problem.names, c.question.values, problem.shared
    x = problem.begin(values)
    J, noise = problem.slope(x), c.setting.depth_noise
    data, P = J.T @ J / noise**2, problem.prior_rows(x)[1]
    C = inverse_of(data + P.T @ P)
    covariance = C[:p, :p] * np.outer(problem.per_entry(x), problem.per_entry(x))
    stds = np.sqrt(np.diag(covariance)).tolist()
    shares = np.array(stds) / c.question.sizes(names)
    return Prediction(
        names=names,
        parameters={
            name: Estimate.of(values[name], std, NAMES[name].unit, logarithmic=log)
            for name, std, log in zip(names, stds, problem.logarithmic, strict=True)
        },
        covariance=covariance,
        sources=_sources(problem, C, data, P),
        share=dict(zip(names, shares.tolist(), strict=True)),
        open=tuple(not_identifiable(problem, Curvature(x, C, data))),
    )


def _sources(problem: Problem, C: Array, data: Array, P: Array) -> dict[str, dict[str, float]]:
    """Return each variance's shares: C = C (data + priors) C, a sum over what the errors are of."""
    prior, own = np.split(P, [len(problem.priors)])
    entry, drift, delay = np.abs(own).argmax(axis=1), problem.first_drift, problem.delay_at
    rows = {"neutral volume": own[entry < problem.first_start], "prior": prior}
    rows |= {"drift": own[(entry >= drift) & (entry < delay)], "delay": own[entry == delay]}
    parts = {"noise": data, **{source: known.T @ known for source, known in rows.items()}}
    variance = {source: np.diag(C @ part @ C) for source, part in parts.items()}
    whole = np.sum(list(variance.values()), axis=0)
    return {
        name: {source: float(v[i] / whole[i]) for source, v in variance.items()}
        for i, name in enumerate(problem.names)
    }


_NOT_YET = 3.0  # of a parameter: nothing is known of it
_SIZES = 12
_PLACE = 0.35  # of the way, where to-and-fro releases of the curve turn


@dataclass(frozen=True, kw_only=True)
class EvaluatedSet:
    """A set of releases with its predicted errors for the given vehicle, and for others.

    time: pool time [s], settling included. spread: least and largest share of each parameter's
    error over the parameter region. after: the same shares once each
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
        """The largest share by which a parameter is uncertain."""
        return max(self.prediction.share.values())


def evaluate(
    releases: Sequence[Release], c: Conditions, vehicles: Sequence[Mapping[str, float]]
) -> EvaluatedSet:
    """Return a set of releases with all that can be said of it beforehand."""
    names, values = c.question.names, c.question.values
    flights, *others = (tuple(follow(r, v, c) for r in releases) for v in (values, *vehicles))
    shares = [_after(f, v, c)[-1] for f, v in zip(others, vehicles, strict=True)]
    return EvaluatedSet(
        releases=tuple(releases),
        flights=flights,
        others=tuple(others),
        time=sum(f.duration + c.setting.settling for f in flights),
        prediction=predict(flights, c),
        spread={n: (min(s), max(s)) for n, *s in zip(names, *shares, strict=True)},
        after=tuple(
            {name: s if s < _NOT_YET else None for name, s in zip(names, row, strict=True)}
            for row in _after(flights, values, c)
        ),
        partial=tuple(sum(not f[k].complete for f in others) for k in range(len(releases))),
        psi=without_psi(flights, c),
        trim=without_trim(flights, c),
        drift=without_drift(flights, c),
    )


def _after(
    flights: Sequence[Flight], values: Mapping[str, float], c: Conditions, times: float = 1.0
) -> list[list[float]]:
    """Return the shares of all parameters after each of the records, each made so many times."""
    found: list[list[float]] = []
    known = c.question.prior(c.setting)
    gain, p = np.zeros_like(known), len(c.question.names)
    for flight in flights:
        gain += times * fisher_information(flight, values, c)
        C = np.linalg.inv(gain + known + 1e-9 * np.eye(p + 1))
        found.append(np.sqrt(np.diag(C)[:p]).tolist())
    return found


@dataclass(frozen=True, kw_only=True)
class Curve:
    """How well parameters would be known if the pool time went to releases of one size, up and
    down in turns: the largest share, for single steps and for to and fro.
    """

    sizes: Array  # m3
    steps: Array
    to_and_fro: Array

    @property
    def best_step(self) -> float:
        """The size of single steps beyond which a larger one is less informative [m3]."""
        return float(self.sizes[int(np.argmin(self.steps))])


def curve(c: Conditions, sizes: tuple[float, float], time: float) -> Curve:
    """Return what sizes [m3] between two buy in a pool time [s]."""
    setting, grid = c.setting, np.geomspace(*sizes, _SIZES)
    span, values = setting.deepest - setting.shallowest, c.question.values

    def largest(size: float, moves: int) -> float:
        flights = []
        for start, sign in ((setting.deepest, 1.0), (setting.shallowest, -1.0)):
            volumes, turns = [sign * size, -sign * size], [start - sign * _PLACE * span]
            release = Release.to_and_fro(start, volumes[:moves], turns[: moves - 1])
            flights.append(follow(release, values, c))
        times = time / sum(f.duration + setting.settling for f in flights)
        return max(_after(flights, values, c, times)[-1])

    steps, fro = (np.array([largest(size, n) for size in grid.tolist()]) for n in (1, 2))
    return Curve(sizes=grid, steps=steps, to_and_fro=fro)


def deeper(releases: Sequence[Release], c: Conditions, factor: float) -> dict[str, float]:
    """Return the shares in a pool that leaves `factor` times the travel, the depths stretched."""
    s = c.setting
    more = (factor - 1.0) * (s.deepest - s.shallowest)
    pool = c._replace(setting=replace(s, bottom_depth=s.bottom_depth + more))

    def to(depth: float) -> float:
        return s.shallowest + factor * (depth - s.shallowest)

    flights = []
    for r in releases:
        places = [to(m.depth) for m in r.moves if m.depth is not None]
        volumes = [m.volume for m in r.moves]
        stretched = Release.to_and_fro(to(r.start), volumes, places)
        flights.append(follow(stretched, c.question.values, pool))
    return predict(flights, pool).share
