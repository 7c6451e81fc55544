"""Parameters where the neutral volume is a random walk, whose intensity is estimated too.

Trapped air, a hull that takes up water or cools, a piston that slips: over minutes the neutral
volume moves, and a fit with a constant one biases drag and mass. Here it is a random walk, and the
innovations of a filter give the likelihood (Schweppe, IEEE Trans. Inf. Theory 11, 1965);
parameters, noise and the intensity of the random walk maximise it. Only stretches clear of surface
and bottom count, and the filter starts anew in each: contact would make the likelihood jump, and
says little.

The covariance of a fit is from information, and from the scatter of the scores of blocks.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.estimates import Z95, Estimate, Finding, crossing, sentence
from swimbladder.estimation.kalman.depth_filter import GATE, Noise, Start, filter_depth
from swimbladder.estimation.kalman.kernels import Filtered, Samples
from swimbladder.estimation.motion.diagnose import LIMIT
from swimbladder.estimation.motion.problem import NAMES, Experiment, Model, Problem
from swimbladder.estimation.motion.random_effects import FEWEST, between_logs
from swimbladder.estimation.motion.result import (
    Identification,
    Values,
    identified_vehicle,
    neutral_spread,
    trim_of,
)
from swimbladder.estimation.series import Array, Index
from swimbladder.io.answers import as_json
from swimbladder.vehicle import Vehicle

_SPEED_STD = 0.1  # m/s, of the speed at a start: nothing is known
_SHARE = 0.25  # of the stroke, deviation of a neutral volume that nothing is known of
_FINEST = 1e-5  # m, no depth is measured better
_STEP = 1e-4  # of a quantity's scale, for slopes


class Quantity(NamedTuple):
    """A quantity that is estimated: x is its logarithm, or the value over its scale."""

    name: str
    logarithmic: bool
    scale: float
    begin: float  # a value, SI

    def value(self, x: float) -> float:
        """Return the value at x."""
        return math.exp(min(max(x, -500.0), 500.0)) if self.logarithmic else x * self.scale

    def place(self, value: float) -> float:
        """Return x of a value."""
        return math.log(max(value, 1e-200)) if self.logarithmic else value / self.scale

    def slope(self, x: float) -> float:
        """Return how the value grows with x."""
        return self.value(x) if self.logarithmic else self.scale


NOISES: tuple[Quantity, ...] = (
    Quantity("depth_noise", True, 1.0, 5e-3),  # m
    Quantity("random_walk", True, 1.0, 0.1e-6),  # m3/s^0.5
    Quantity("acceleration", True, 1.0, 1e-3),  # m/s^1.5
)


class Likelihood:
    """The log posterior of quantities x given several records.

    quantities: what is estimated, names of the model and of NOISES; values: what is held, SI.
    """

    def __init__(
        self,
        problem: Problem,
        vehicle: Vehicle,
        quantities: Sequence[Quantity],
        values: Mapping[str, float],
    ) -> None:
        self.model, self.priors = problem.model, problem.priors
        self.quantities, self.values = tuple(quantities), dict(values)
        self.quantum, stroke = vehicle.sensors.depth_quantum, vehicle.stroke
        self.known = math.isfinite(problem.neutral_std)
        nothing = _SHARE * (stroke.maximum - stroke.minimum)
        self.neutral_std = problem.neutral_std if self.known else nothing
        self.records = tuple(e.record for e in problem.experiments)
        parts = [(i, s) for i, e in enumerate(problem.experiments) for s in _samples(e)]
        self.record = np.array([i for i, _ in parts])  # of each stretch
        self.samples = tuple(s for _, s in parts)
        self.ends = np.cumsum([0, *(len(s.time) for s in self.samples)])
        self.record_of_samples = np.repeat(self.record, np.diff(self.ends))

    def begin(self) -> Array:
        """Return x at the values to begin with."""
        return np.array([q.place(q.begin) for q in self.quantities])

    def named(self, x: Array) -> dict[str, float]:
        """Return all values, estimated and held, by name."""
        found = {q.name: q.value(float(at)) for q, at in zip(self.quantities, x, strict=True)}
        return {**self.values, **found}

    def noise(self, values: Mapping[str, float]) -> Noise:
        """Return the filter's noise of these values."""
        rounding = max(self.quantum / math.sqrt(12.0), _FINEST)
        depth = math.hypot(values["depth_noise"], rounding)
        return Noise(depth, values["random_walk"], values["acceleration"])

    def filtered(self, x: Array) -> list[Filtered]:
        """Return the filter's run along every stretch."""
        values = self.named(x)
        clear = self.model.plant(values, self.model.base.V_0)
        clear = clear._replace(z_surface=-math.inf, z_bottom=math.inf)
        noise = self.noise(values)
        starts = [self._start(i, values, noise) for i in range(len(self.samples))]
        pairs = zip(self.samples, starts, strict=True)
        return [filter_depth(clear, s, noise=noise, start=start) for s, start in pairs]

    def _start(self, stretch: int, values: Mapping[str, float], noise: Noise) -> Start:
        s, record = self.samples[stretch], self.records[self.record[stretch]]
        neutral = float(s.volume[0] - values["psi"] * s.depth[0])
        std = self.neutral_std
        if self.known:
            neutral = self.model.base.V_0
            if not record.volume_absolute:  # neutral at the first sample, whatever psi is
                neutral += (self.model.base.psi - values["psi"]) * float(record.depth[0])
            std = math.hypot(std, noise.random_walk * math.sqrt(float(s.time[0])))
        return Start(float(s.depth[0]), 0.0, neutral, 3.0 * noise.depth, _SPEED_STD, std)

    def prior(self, x: Array) -> float:
        """Return the log density of the priors at x, up to a constant."""
        slope, hold = self.prior_slope(x)
        return -0.5 * float((slope**2 / np.where(hold > 0.0, hold, 1.0)).sum())

    def prior_slope(self, x: Array) -> tuple[Array, Array]:
        """Return gradient of the priors' log density at x, and minus its second derivatives."""
        slope, hold = np.zeros(len(x)), np.zeros(len(x))
        for i, q in enumerate(self.quantities):
            prior = self.priors.get(q.name)
            if prior is not None:
                width = prior.std / (prior.mean if q.logarithmic else q.scale)
                slope[i], hold[i] = (q.place(prior.mean) - float(x[i])) / width**2, width**-2
        return slope, hold

    def __call__(self, x: Array) -> float:
        """Return the log posterior at x."""
        total = sum(f.log_likelihood for f in self.filtered(x)) + self.prior(x)
        return float(total) if math.isfinite(total) else -1e12

    def scores(self, x: Array) -> tuple[Array, Array]:
        """Return the gradient [samples, quantities] of every sample's log likelihood at x, and the
        information [quantities, quantities] of all, priors left out.

        The information is Fisher's for normal innovations e of variance S, e weighted as it counts:
        the sum of de de'/S + dS dS'/(2 S^2).
        """

        def along(x: Array) -> Array:
            """Return innovation, variance and log likelihood of every sample [3, samples]."""
            parts = [(f.innovation, f.variance, f.contribution) for f in self.filtered(x)]
            return np.concatenate(parts, axis=1)

        steps = _STEP * np.eye(len(x))
        sides = [(along(x + h), along(x - h)) for h in steps]
        slopes = np.stack([ahead - back for ahead, back in sides], axis=2) / (2.0 * _STEP)
        e, S, _ = sides[0][0][..., None]
        believed = np.abs(e) <= GATE * np.sqrt(S)
        de, dS = slopes[0] * believed / np.sqrt(S), slopes[1] * believed / S
        parts = [(de[a:b], dS[a:b]) for a, b in pairwise(self.ends)]
        return slopes[2], np.sum([e.T @ e + 0.5 * s.T @ s for e, s in parts], axis=0)


def _samples(e: Experiment) -> list[Samples]:
    """Return what the filter takes of a record: its stretches clear of contact."""
    record = e.record
    if record.volume is None or record.drive != "volume":
        what = "a random walk of the neutral volume is seen where only the logged volume drives it"
        raise InputError(what, field="--drive", value=record.drive, remedy="Drive it with volume")
    found = []
    for segment in e.segments:
        part = slice(segment.first, segment.last + 1)
        arrays = (record.time[part], record.volume[part], record.depth[part])
        time, volume, depth = (np.ascontiguousarray(a) for a in arrays)
        found.append(Samples(time, volume, depth, np.ones(len(time), np.int8), record.layers))
    return found


Maker = Callable[[Sequence[Quantity], Mapping[str, float]], Likelihood]  # of other quantities

_BLOCK = 20.0  # s, of samples that may depend on each other
_ENOUGH = 4  # blocks a quantity, for a covariance from their scatter
_SINGULAR = 1e-7
_LOOSE = 5.0  # deviation of a logarithm, at which the quantity is not identifiable
_NEEDED = ("K2", "T2", "mass")  # without these there is no motion


def without_trace(
    full: Likelihood, x: Array, likelihood: Maker, held: Mapping[str, float]
) -> tuple[Likelihood, Array]:
    """Return the likelihood with a quadratic drag that left no trace at 0, not as a logarithm."""
    names = [q.name for q in full.quantities]
    if "drag_quadratic" not in names or full.model.law != "blended":
        return full, x
    i = names.index("drag_quadratic")
    if full.scores(x)[1][i, i] > _LOOSE**-2:
        return full, x
    quantities = list(full.quantities)
    scale = max(full.model.scale("drag_quadratic"), 1e-3)
    quantities[i] = Quantity("drag_quadratic", False, scale, 0.0)
    y = x.copy()
    y[i] = 0.0
    return likelihood(quantities, held), y


def covariance(full: Likelihood, x: Array) -> Array:
    """Return the covariance of x: a sandwich of information and scatter of the scores.

    The scores are summed over whole records where there are enough of them, which allows for
    records that differ, else over blocks of 20 s. Where there are too few of these too, and where
    the scatter is smaller than the information says, the information stands. A quantity whose
    logarithm is not identifiable, as of a random walk of 0, has an infinite variance and no part
    in the others'.
    """
    scores, H = full.scores(x)
    H += np.diag(full.prior_slope(x)[1])
    known = np.diag(H) > np.where([q.logarithmic for q in full.quantities], _LOOSE**-2, 0.0)
    unknown = [q.name for q, known in zip(full.quantities, known, strict=True) if not known]
    if set(unknown) & set(_NEEDED):
        why = "not identifiable from the logs: the vehicle hardly moves"
        raise NoAnswerError(f"{' and '.join(unknown)} {why}")
    size = np.sqrt(np.where(known, np.diag(H), 1.0))
    values, vectors = np.linalg.eigh((H / np.outer(size, size))[np.ix_(known, known)])
    if values.size and values.min() < _SINGULAR:
        raise NoAnswerError(
            "not all parameters are identifiable from the logs: the likelihood is flat along a "
            "combination of them; set one, or give it a prior"
        )
    C = np.diag(np.full(len(x), np.inf))
    bread = (vectors / values) @ vectors.T / np.outer(size[known], size[known])
    blocks = _blocks(full, len(x))
    if blocks is not None:
        sums = np.stack([np.bincount(blocks, column) for column in scores[:, known].T], axis=1)
        sums -= sums.mean(axis=0)
        sandwich = bread @ (sums.T @ sums) @ bread * len(sums) / (len(sums) - 1)
        ratio = np.diag(sandwich) / np.diag(bread)
        if (ratio > 1.0).any():
            grow = np.sqrt(np.maximum(ratio, 1.0) / ratio)
            bread = sandwich * np.outer(grow, grow)
    C[np.ix_(known, known)] = bread
    return C


def _blocks(full: Likelihood, quantities: int) -> Index | None:
    """Return the number of the block that each sample is in, None where blocks are too few."""
    if len(full.records) >= _ENOUGH * quantities:
        return full.record_of_samples
    found, last = [], 0
    for s in full.samples:
        within = ((s.time - s.time[0]) // _BLOCK).astype(np.int64)
        found.append(within + last)
        last += int(within[-1]) + 1
    return np.concatenate(found) if last >= _ENOUGH * quantities else None


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

    @property
    def drifts(self) -> bool:
        """Whether the random walk of the neutral volume is significant (1 %)."""
        return self.p_value < 0.01

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        keys = "parameters=estimates neutral_walk=random_walk depth_noise"
        more = "log_likelihood likelihood_ratio p_value travelled_m3"
        return as_json(self, f"{keys} acceleration_noise=acceleration {more}")


def fit_random_walk(
    problem: Problem, vehicle: Vehicle, *, acceleration: bool = True
) -> RandomWalkFit:
    """Return the parameters, noise and random walk that maximise the likelihood of all innovations.

    Priors are log-normal for positive quantities; `neutral_std` is that of every record's neutral
    volume about the vehicle's at its start. acceleration: whether white acceleration may stand for
    what the model leaves out.

    Raises InputError where the volume does not drive a record, NoAnswerError where the likelihood
    has no maximum that can be found.
    """
    names = problem.names
    held = problem.values | ({} if acceleration else {"acceleration": 0.0})
    likelihood = partial(Likelihood, problem, vehicle)
    noises = [q for q in NOISES if q.name not in held]
    full = likelihood([*(_quantity(name, problem) for name in names), *noises], held)
    x, best = _highest(full)
    at, others = _besides(full)
    without = likelihood(others, {**held, "random_walk": 0.0})
    _, least = _highest(without, [np.delete(x, at)])
    ratio = max(2.0 * (best - least), 0.0)
    full, x = without_trace(full, x, likelihood, held)
    C = covariance(full, x)
    per = np.array([q.slope(float(at)) for q, at in zip(full.quantities, x, strict=True)])
    std = np.sqrt(np.maximum(np.diag(C), 0.0)) * per
    estimates: dict[str, Estimate] = {}
    p, values = len(names), full.named(x)
    for q, deviation in zip(full.quantities, std.tolist(), strict=True):
        unit, log = _UNITS.get(q.name) or NAMES[q.name].unit, q.logarithmic
        estimates[q.name] = Estimate.of(values[q.name], deviation, unit, logarithmic=log)
    walk = _interval(full, x, best, ratio, estimates["random_walk"], likelihood)
    path = np.concatenate([f.smoothed()[0][:, 2] for f in full.filtered(x)])
    of_each = [path[full.record_of_samples == j] for j in range(len(full.records))]
    nothing = Estimate.given(0.0, _UNITS["acceleration"])
    return RandomWalkFit(
        names=names,
        estimates={name: estimates[name] for name in names},
        covariance=C[:p, :p] * np.outer(per[:p], per[:p]),
        random_walk=walk,
        depth_noise=estimates["depth_noise"],
        acceleration=estimates.get("acceleration", nothing),
        noise=full.noise(values),
        values=values,
        log_likelihood=best,
        likelihood_ratio=ratio,
        p_value=0.5 * float(chi2.sf(ratio, 1)) if ratio > 0.0 else 1.0,
        travelled=tuple(float(np.ptp(each)) for each in of_each),
    )


def _besides(full: Likelihood) -> tuple[int, list[Quantity]]:
    """Return the place of the random walk among the quantities, and the others."""
    names = [q.name for q in full.quantities]
    return names.index("random_walk"), [q for q in full.quantities if q.name != "random_walk"]


def _quantity(name: str, problem: Problem) -> Quantity:
    model, priors = problem.model, problem.priors
    begin = priors[name].mean if name in priors else problem.values[name]
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
    shifts = {"random_walk": -2.0, "depth_noise": 1.0, "acceleration": 1.0}
    return np.asarray(x + [shifts.get(q.name, 0.0) for q in likelihood.quantities])


def _interval(
    full: Likelihood, x: Array, best: float, ratio: float, found: Estimate, likelihood: Maker
) -> Estimate:
    """Return the random walk with the interval of its likelihood profile, which may include 0."""
    at, others = _besides(full)
    middle, begin = float(x[at]), np.delete(x, at)

    def beyond(distance: float) -> float:
        """Return how far the root of the deviance, which grows about evenly, is past 95 %."""
        held = likelihood(others, {**full.values, "random_walk": math.exp(middle + distance)})
        return math.sqrt(max(2.0 * (best - _highest(held, [begin])[1]), 0.0)) - Z95

    step = min(max(Z95 * found.std / found.value, 0.3), 1.5)
    low = crossing(beyond, -step, farthest=_FARTHEST, xtol=0.02) if ratio > Z95**2 else None
    high = crossing(beyond, step, farthest=_FARTHEST, xtol=0.02)
    least = 0.0 if low is None else math.exp(middle + low)
    most = math.inf if high is None else math.exp(middle + high)
    return replace(found, ci95=(least, most))


# Findings on neutral volumes that stay.
_STILL = ("trade-off", "not identifiable", "profile", "prior", "step-size trend", "drift", "model")


def with_random_walk(
    found: Identification, fit: RandomWalkFit, vehicle: Vehicle, problem: Problem
) -> Identification:
    """Return the identification with the random walk's parameters, not the output error's.

    With enough records the vehicle has their random effects too, and is that of the means over
    them. Results of single logs stay those of constant neutral volumes. Findings on these are
    dropped; parameters that are not identifiable with random walks are reported.
    """
    records, new, noise = [e.record for e in problem.experiments], found.result_vehicle, fit.noise
    findings = [f for f in found.findings if f.kind not in _STILL]
    findings += [*_not_identifiable(fit, problem.model), _summary(fit)]
    if all(f.severity != "no" for f in findings):
        logs, trim = tuple(r.source for r in records), trim_of(found.experiments, vehicle)
        new = identified_vehicle(
            vehicle,
            problem.model,
            Values(fit.names, fit.values, fit.covariance, logs, trim),
            depth_noise=noise.depth,
            neutral_walk=noise.random_walk,
            neutral_std=neutral_spread(found.experiments, found.neutral_std, single=0.0),
            acceleration_noise=noise.acceleration,
        )
        if len(records) >= FEWEST:
            new = between_logs(records, new)
            findings.append(_differ(new))
    held = {n: e for n, e in found.parameters.items() if e.origin == "set"}
    return replace(
        found,
        names=fit.names,
        parameters={**fit.estimates, **held},
        derived={},
        covariance=fit.covariance,
        profiles={},
        choices=(),
        findings=tuple(findings),
        depth_noise=noise.depth,
        sensor_noise=noise.depth,
        random_walk=fit,
        result_vehicle=new,
        assumptions=(*found.assumptions, sentence("motion", "is random")),
    )


def _not_identifiable(fit: RandomWalkFit, model: Model) -> Iterator[Finding]:
    for name, e in fit.estimates.items():
        if model.logarithmic(name) and _share(e) > LIMIT:
            share = f"{100.0 * _share(e):.0f} %" if _share(e) < 10.0 else "any factor"
            yield Finding.of("motion", "unidentified with it", name=name, share=share)


def _differ(vehicle: Vehicle) -> Finding:
    known = vehicle.identified
    assert known is not None  # it was just identified
    assert known.between is not None
    b = known.between
    values = zip(known.names, known.values, strict=True)
    means = ", ".join(f"{name} = {value:.4g} {NAMES[name].unit}" for name, value in values)
    drift = f"{3.6e9 * b.neutral_drift:.2g} +- {3.6e9 * b.neutral_drift_std:.2g}"
    return Finding.of("motion", "logs differ", psi=b.psi, drag=b.drag, drift=drift, means=means)


def _share(e: Estimate) -> float:
    return e.std / abs(e.value) if e.value else math.inf


def _summary(fit: RandomWalkFit) -> Finding:
    minute = math.sqrt(60.0)
    low, high = (f"{1e6 * minute * end:.2g}" for end in fit.random_walk.ci95)
    unsure = ", which the logs do not require"
    texts = {"low": low, "high": high, "sure": "" if fit.drifts else unsure}
    numbers = {"minute": minute * fit.random_walk.value, "p": fit.p_value}
    numbers["farthest"] = max(fit.travelled, default=0.0)
    return Finding.of("motion", "random_walk", **texts, **numbers)
