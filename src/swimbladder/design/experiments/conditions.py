"""The pool, its sensors and its habits: everything a design depends on beside the vehicle.

`follow` says what the record of a release would hold of a vehicle with given parameters. Its Fisher
information is about the vehicle's parameters, with the record's own eliminated.
Parameters count in shares: a change of 1 is a whole of the parameter, or of what is large for one
that may be 0. Information about them adds up over records, so that of a candidate is found once.

A set of releases evaluated: predicted errors, for which vehicles, after how many releases.

That is what `identify` will say of the records, before there are any, and what becomes of its
estimates where the model leaves something out: psi, a trim, a drift.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from swimbladder.design.plan import Move
from swimbladder.errors import InputError
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.estimates import Estimate, Finding, Prior
from swimbladder.estimation.motion.diagnose import Curvature, not_identifiable
from swimbladder.estimation.motion.fit import eliminated, fit, inverse_of
from swimbladder.estimation.motion.problem import (
    DRIFT,
    NAMES,
    VOLUME,
    Assumed,
    Experiment,
    Model,
    Problem,
    Segment,
)
from swimbladder.estimation.motion.process_noise import (
    EARLY_STD,
    NUISANCES,
    Likelihood,
    with_known_noise,
)
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.sim.closed_loop import drive
from swimbladder.sim.closed_loop.replay import Course
from swimbladder.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Setting:
    """Where and how experiments are made. Depths are those of the pressure sensor."""

    bottom_depth: float  # m
    clearance: float  # m, of all depths of rest and records from surface and bottom
    sample_time: float  # s
    noise: float  # m, white, 1 sigma
    quantum: float  # m
    neutral_std: float  # m3
    drift_std: float  # m3/s, of each neutral volume, 1 sigma
    delay_std: float  # s, of how late the stamps of all volumes are, 1 sigma
    settling: float  # s, until the vehicle is at rest before a release
    rest: float  # s, of that time on record
    longest: float  # s, of a record from the release on
    largest: float  # m3, change of volume against the one at rest
    moves: int  # most changes of volume in a record

    @property
    def shallowest(self) -> float:
        """Depth above which a record ends [m]."""
        return self.clearance

    @property
    def deepest(self) -> float:
        """Depth below which a record ends [m]."""
        return self.bottom_depth - self.clearance

    @property
    def depth_noise(self) -> float:
        """Noise of a logged depth [m, 1 sigma], rounding to the quantum included."""
        return math.hypot(self.noise, self.quantum / math.sqrt(12.0))


class Release(NamedTuple):
    """An experiment: at rest at a depth [m], then its moves."""

    start: float
    moves: tuple[Move, ...]

    @classmethod
    def to_and_fro(cls, start: float, volumes: Sequence[float], depths: Sequence[float]) -> Release:
        """Return the release whose k-th later move happens at depths[k], each the other way."""
        up = volumes[0] > 0.0
        moves = [Move(volume=volumes[0])]
        for volume, depth in zip(volumes[1:], depths, strict=True):
            moves.append(Move(volume=volume, depth=depth, going="up" if up else "down"))
            up = not up
        return cls(start, tuple(moves))


class Ramps(NamedTuple):
    """How an actuator moves from standstill, at samples, and how far it may go [m3]."""

    out: Array  # m3 above the start, to displace more
    back: Array  # m3 below the start, to displace less
    most: float  # m3 above the neutral volume of any depth of the range
    least: float  # m3 below it, negative

    def move(self, start: float, target: float, samples: int) -> Array:
        """Return the volume at `samples` instants from `start` [m3] on its way to `target`."""
        way = self.out if target > start else self.back
        gone = np.minimum(way[:samples], abs(target - start))
        gone = np.pad(gone, (0, samples - len(gone)), constant_values=abs(target - start))
        return np.asarray(start + math.copysign(1.0, target - start) * gone)


def ramps(vehicle: Vehicle, setting: Setting) -> Ramps:
    """Return what the vehicle's actuator does at its limit: of the supply, against the deepest sea.

    Raises InputError where the stroke or the supply leave no change of volume in this pool.
    """
    depths = (setting.shallowest, setting.deepest)
    neutral = [vehicle.neutral_volume(z) for z in depths]
    stroke = vehicle.stroke
    spare = 3.0 * setting.neutral_std if math.isfinite(setting.neutral_std) else 0.0
    most, least = stroke.maximum - max(neutral) - spare, stroke.minimum - min(neutral) + spare
    if not least < 0.0 < most:
        at = [f"{1e6 * V:g} cm3 at {z:g} m" for V, z in zip(neutral, depths, strict=True)]
        ends = f"{1e6 * stroke.minimum:g} to {1e6 * stroke.maximum:g} cm3"
        what = f"the stroke of {ends} leaves no change of volume: neutral is {' and '.join(at)}"
        remedy = "Trim the vehicle (trim_error), or give it a longer stroke"
        raise InputError(what, field="stroke", remedy=remedy)
    most, least = min(most, setting.largest), max(least, -setting.largest)
    p = plant(vehicle)
    span, h = stroke.maximum - stroke.minimum, setting.sample_time
    count = math.ceil(setting.longest / h) + 2
    if p.positioner:
        even = np.minimum(p.rate * h * np.arange(count), span)
        return Ramps(even, even, most, least)
    out = _at_full_voltage(vehicle, setting.deepest, h, count, up=True)
    back = _at_full_voltage(vehicle, setting.shallowest, h, count, up=False)
    for way, limit in ((out, most), (back, -least)):
        if way[-1] < 1e-3 * limit:
            where = f"in {setting.longest:g} s at {setting.deepest:g} m: its supply does not beat"
            what = f"the actuator hardly moves {where} the load of the sea"
            remedy, field = "Give more voltage, or a shallower pool", "supply.voltage"
            raise InputError(what, field=field, value=p.supply, unit="V", remedy=remedy)
    return Ramps(out, back, min(most, float(out[-1])), max(least, -float(back[-1])))


def _at_full_voltage(vehicle: Vehicle, depth: float, h: float, count: int, *, up: bool) -> Array:
    """Return the volume moved from standstill [m3] at samples, at a depth, through the stroke.

    The vehicle lies on the ground there: so heavy that no stroke lifts it.
    """
    heavy = vehicle.model_copy(update={"trim_error": 1.0})
    assert vehicle.supply is not None  # Vehicle checks it
    stroke, sign = vehicle.stroke, 1.0 if up else -1.0
    start = stroke.minimum if up else stroke.maximum
    time, voltage = h * np.arange(count), np.full(count, sign * vehicle.supply.voltage)
    s = drive(
        heavy, time=time, voltage=voltage, start_depth=depth, start_volume=start, bottom_depth=depth
    )
    return np.asarray(np.maximum.accumulate(sign * (s.volume - start)))


CLEAR = 0.05  # m inside of an end of the range that a depth has to be before the end counts
_FIRST_STRETCH = 60.0  # s, followed at first; then twice as long each time


class Flight(NamedTuple):
    """A record, from `rest` before the release to where it ends. Volumes are above the rest's."""

    release: Release
    time: Array  # s, from the first sample
    volume: Array  # m3
    depth: Array  # m
    moved: tuple[int, ...]  # samples at which the moves that happened began
    ended: Literal["shallowest", "deepest", "longest"]

    @property
    def duration(self) -> float:
        """Time from the release to the end of the record [s]."""
        return float(self.time[-1] - self.time[self.moved[0]])

    @property
    def complete(self) -> bool:
        """Whether all moves happened."""
        return len(self.moved) == len(self.release.moves)


def follow(release: Release, values: Mapping[str, float], c: Conditions) -> Flight:
    """Return the record of a release without noise, of a vehicle with these values."""
    setting, ramps, h = c.setting, c.ramps, c.setting.sample_time
    first = math.ceil(setting.rest / h - 1e-9)
    whole = first + math.ceil(setting.longest / h - 1e-9) + 1
    time = h * np.arange(whole, dtype=np.float64)
    volume = np.zeros(whole)
    p = c.question.model.plant(values, -values["psi"] * release.start)
    at, moved, looked = first, [first], min(whole, first + math.ceil(_FIRST_STRETCH / h))
    volume[at:] = ramps.move(0.0, release.moves[0].volume, whole - at)
    while True:
        depth = _depths(p, time[:looked], volume[:looked], release.start)
        end, why = _end(depth, first, setting)
        following = release.moves[len(moved)] if len(moved) < len(release.moves) else None
        if following is not None and following.depth is not None:
            k = _passed(depth, at, following.depth, up=following.going == "up")
            if k is not None and k < end:
                at = k
                moved.append(k)
                volume[k:] = ramps.move(float(volume[k]), following.volume, whole - k)
                looked = min(whole, max(looked, k + math.ceil(_FIRST_STRETCH / h)))
                continue
        if end < looked or looked == whole:
            return Flight(release, time[:end], volume[:end], depth[:end], tuple(moved), why)
        looked = min(whole, 2 * looked)


def _depths(p: Plant, time: Array, volume: Array, start: float) -> Array:
    course = Course(time, volume, ramps=True)
    return np.asarray(course.follow([p], np.array([[0.0, start, 0.0, 0.0]]))[0])


def _end(
    depth: Array, first: int, setting: Setting
) -> tuple[int, Literal["shallowest", "deepest", "longest"]]:
    """Return how many samples the record has, and what ended it."""
    low = np.maximum.accumulate(depth < setting.deepest - CLEAR) & (depth > setting.deepest)
    high = np.maximum.accumulate(depth > setting.shallowest + CLEAR) & (depth < setting.shallowest)
    out = low | high | np.isnan(depth)
    out[: first + 1] = False
    if not out.any():
        return len(depth), "longest"
    end = int(np.argmax(out))
    return end, "deepest" if low[end] else "shallowest"


def _passed(depth: Array, since: int, place: float, *, up: bool) -> int | None:
    """Return the first sample beyond the place, once the depth was on this side of it."""
    beyond = depth[since:] < place if up else depth[since:] > place
    crossed = beyond & np.maximum.accumulate(~beyond)
    return since + int(np.argmax(crossed)) if crossed.any() else None


def experiment_of(flight: Flight, name: str, base: Plant) -> Experiment:
    """Return a flight as `identify` takes a log of it; base: the plant of the vehicle's file."""
    t, z, V, start = flight.time, flight.depth, flight.volume, flight.release.start
    volume = V + base.V_0 + base.psi * start
    compared = np.ones(len(t), np.bool_)
    record = Record(drive="volume", time=t, depth=z, volume=volume, compared=compared)
    whole = Segment(0, len(t) - 1, start, 0.0)
    return Experiment(name, record, V, ramps=True, segments=(whole,), reference=start, neutral=0.0)


FEWEST = 12  # samples of a record, below which `identify` does not take it


class Question(NamedTuple):
    """What is asked: which parameters, what is known of them, and how large they are."""

    model: Model
    names: tuple[str, ...]
    fixed: dict[str, float]
    priors: dict[str, Prior]

    def size(self, name: str) -> float:
        """Return what counts as a whole of a parameter [its unit]."""
        value = abs(self.values[name])
        return value if self.model.logarithmic(name) else max(value, self.model.scale(name))

    def sizes(self, names: Sequence[str]) -> Array:
        """Return what counts as a whole of several parameters."""
        return np.array([self.size(name) for name in names])

    @property
    def values(self) -> dict[str, float]:
        """The assumed vehicle."""
        means = {name: prior.mean for name, prior in self.priors.items()}
        return {**self.model.values, **self.fixed, **means}

    def prior(self, setting: Setting) -> Array:
        """Return what is known beforehand, as information about the shares and `NUISANCES`."""
        std = [self.priors[name].std if name in self.priors else math.inf for name in self.names]
        others = [setting.delay_std / NUISANCES[0].scale, EARLY_STD] * (setting.delay_std > 0.0)
        return np.diag(np.append(std / self.sizes(self.names), others) ** -2.0)


class Conditions(NamedTuple):
    """All that a design depends on: what is asked, the pool, what the actuator does there, and the
    vehicle as its file has it.
    """

    question: Question
    setting: Setting
    ramps: Ramps
    vehicle: Vehicle


def problem_of(flights: Sequence[Flight], c: Conditions, **fixed: float) -> Problem:
    """Return the fit that `identify` would make of these records; fixed: instead of estimated."""
    held = c.question.fixed | fixed
    names = tuple(name for name in c.question.names if name not in held)
    priors = {name: p for name, p in c.question.priors.items() if name in names}
    setting, base = c.setting, c.question.model.base
    experiments = [experiment_of(f, f"release {k}", base) for k, f in enumerate(flights, 1)]
    assumed = Assumed(
        held, priors, setting.neutral_std, drift_std=setting.drift_std, delay_std=setting.delay_std
    )
    return Problem(experiments, c.question.model, names, assumed)


def _likelihood(p: Problem, at: Mapping[str, float], c: Conditions) -> tuple[Likelihood, Array]:
    full, x = with_known_noise(p, c.vehicle, c.setting.noise, at)
    return full.changed(quantum=c.setting.quantum), x


def fisher_information(
    flight: Flight, values: Mapping[str, float], c: Conditions, *, central: bool = True
) -> Array:
    """Return what a record says [q, q] of the vehicle that has these values.

    Of the shares, and last of `NUISANCES`, which all records share: the record's own neutral
    volume, its drift and its start follow them. central: by differences to both sides; to one, it
    is good to about a percent.
    """
    question = c.question
    if len(flight.time) < FEWEST:
        return np.zeros_like(question.prior(c.setting))
    problem = problem_of([flight], c)
    full, x = _likelihood(problem, values, c)
    H, n, p = full.scores(x, central=central)[1], len(full.quantities), problem.shared
    per = np.ones(n)
    per[:p] = np.where(problem.logarithmic, 1.0, question.sizes(question.names) / problem.scale)
    H[n:, n:] += np.eye(full.drifts)  # the record's own drift, which follows the others
    gain = eliminated(H, n)[0] * np.outer(per, per)
    return np.asarray(0.5 * (gain + gain.T))


def covariance_of(question: Question, vehicle: Vehicle, uncertainty: float | None) -> Array:
    """Return the covariance of what is not known of the vehicle yet [p, p], in shares of values.

    uncertainty: share by which each parameter may be off, 1 sigma; where None, the covariance that
    the vehicle was identified with, else 0.3. A prior counts instead where there is one.
    """
    names, size = question.names, question.sizes(question.names)
    each = 0.3 if uncertainty is None else uncertainty
    S = np.diag((each * np.array([question.values[n] for n in names]) / size) ** 2)
    known = vehicle.identified
    if uncertainty is None and known is not None:
        both = [n for n in names if n in known.names]
        at, there = [names.index(n) for n in both], [known.names.index(n) for n in both]
        C = np.array(known.covariance)
        S[np.ix_(at, at)] = C[np.ix_(there, there)] / np.outer(size[at], size[at])
    for i, name in enumerate(names):
        if name in question.priors:
            S[i, :] = S[:, i] = 0.0
            S[i, i] = (question.priors[name].std / size[i]) ** 2
    return S


def vehicles(question: Question, covariance: Array) -> list[dict[str, float]]:
    """Return vehicles with the mean and covariance of what is uncertain, two for each direction.

    The points of the third-degree spherical-radial rule (Arasaratnam and Haykin 2009): the mean
    plus and minus sqrt(p) standard deviations along each principal axis. Positive parameters are
    moved by factors.
    """
    size, axes = np.linalg.eigh(covariance)
    inside = size > 1e-12 * max(float(size[-1]), 1e-300)
    if not inside.any() or size[-1] < 1e-12:
        return [question.values]
    steps = axes[:, inside] * np.sqrt(size[inside] * inside.sum())
    found = []
    for step in np.concatenate([steps.T, -steps.T]):
        values = question.values
        for name, by in zip(question.names, step.tolist(), strict=True):
            if question.model.logarithmic(name):
                values[name] *= math.exp(by)
            else:
                values[name] += by * question.size(name)
        values["drag_quadratic"] = max(values["drag_quadratic"], 0.0)
        found.append(values)
    return found


_SLIGHT = 0.1  # of the depths' noise, a change that the likelihood is linear in


class OmittedVariable(NamedTuple):
    """A bias in shares of the parameters, by name: linearised, and by a refit where one is made.

    rms: what the refit leaves over [m], noise included; nan without one.
    """

    linear: dict[str, float]
    refit: Mapping[str, float] = {}
    rms: float = math.nan


def without_psi(flights: Sequence[Flight], c: Conditions) -> OmittedVariable | None:
    """Return what happens to the others if psi is taken for 0; None where it is, or all there is.

    The linearised bias is what a step of the fit makes of what psi does to the depths; the refit is
    a fit that takes volumes as exact, of records with noise.
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
    depth, values = problem.predict(x), problem.named(x)
    by = _SLIGHT * c.setting.depth_noise / max(float(np.abs(effect).max()), 1e-300)

    def pull(sign: float) -> tuple[Array, Array]:
        """Return where the likelihood of moved depths would rise, and its information."""
        moved = np.split(depth + sign * by * effect, problem.rows[1:-1])
        each = zip(problem.experiments, moved, strict=True)
        records = [replace(e, record=replace(e.record, depth=depth)) for e, depth in each]
        there = Problem(records, problem.model, problem.names, problem.assumed)
        full, at = _likelihood(there, values, c)
        slopes, H = full.scores(at)
        return slopes.sum(axis=0), H + np.diag(full.prior_slope(at)[1])

    (above, H), (below, _) = pull(1.0), pull(-1.0)
    step = (inverse_of(H) @ (above - below))[: problem.shared] / (2.0 * by)
    return _by_name(problem, step * problem.per_entry(x), c)


def _by_name(problem: Problem, moved: Array, c: Conditions) -> dict[str, float]:
    """Return changes of the parameters [unit] as shares, by name."""
    shares = moved / c.question.sizes(problem.names)
    return dict(zip(problem.names, shares.tolist(), strict=True))


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """The covariance of a set of records, and where it comes from. Arrays in the order of names.

    parameters: as `identify` will report them, its standard deviations and intervals. sources: the
    shares of the variance that are due to the depths' noise, to the neutral volumes, their drift,
    how late the volumes' stamps are, how they go between these, and to what was known before.
    share: the standard deviation as a share of the parameter. open: what the records leave open.
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
    full, x = _likelihood(problem, values, c)
    H, known = full.scores(x)[1], full.prior_slope(x)[1]
    C, per = inverse_of(H + np.diag(known)), problem.per_entry(x)
    covariance = C[:p, :p] * np.outer(per, per)
    stds = np.sqrt(np.diag(covariance)).tolist()
    H[p:, p:] += np.diag(known[p:])
    return Prediction(
        names=names,
        parameters={
            name: Estimate.of(values[name], std, NAMES[name].unit, logarithmic=log)
            for name, std, log in zip(names, stds, problem.logarithmic, strict=True)
        },
        covariance=covariance,
        sources=_sources(full, x, p, known, C),
        share=dict(zip(names, (stds / c.question.sizes(names)).tolist(), strict=True)),
        open=tuple(not_identifiable(problem, Curvature(x, C, H))),
    )


_MORE = 1.001  # times an error, that a variance is seen to grow by


def _sources(
    full: Likelihood, x: Array, p: int, known: Array, C: Array
) -> dict[str, dict[str, float]]:
    """Return each variance's shares: by how much of itself it grows with the square of an error.

    They are 1 in all; the depths' noise has what is left of that.
    """
    variance, n = np.diag(C)[:p], len(full.quantities)
    parts = (C[:p] ** 2 * known / variance[:, None]).T  # of each prior
    delay, early = parts[p:n] if n > p else np.zeros((2, p))

    def grown(**changes: Any) -> Array:
        """Return the share of an error that is a little larger with these changes."""
        H = full.changed(**changes).scores(x)[1] + np.diag(known)
        return (np.diag(inverse_of(H))[:p] / variance - 1.0) / (_MORE**2 - 1.0)

    off = tuple(s._replace(volume_error=_MORE**2 * s.volume_error) for s in full.samples)
    found = {
        "neutral volume": grown(neutral_std=_MORE * full.neutral_std) * full.known,
        "prior": parts[:p].sum(axis=0),
        "drift": parts[n:].sum(axis=0),
        "delay": delay,
        "between samples": early + grown(samples=off),
    }
    found = {"noise": 1.0 - sum(found.values()), **found}
    return {
        q.name: {source: float(part[i]) for source, part in found.items()}
        for i, q in enumerate(full.quantities[:p])
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
    shares = [shares_after(f, v, c)[-1] for f, v in zip(others, vehicles, strict=True)]
    return EvaluatedSet(
        releases=tuple(releases),
        flights=flights,
        others=tuple(others),
        time=sum(f.duration + c.setting.settling for f in flights),
        prediction=predict(flights, c),
        spread={n: (min(s), max(s)) for n, *s in zip(names, *shares, strict=True)},
        after=tuple(
            {name: s if s < _NOT_YET else None for name, s in zip(names, row, strict=True)}
            for row in shares_after(flights, values, c)
        ),
        partial=tuple(sum(not f[k].complete for f in others) for k in range(len(releases))),
        psi=without_psi(flights, c),
        trim=without_trim(flights, c),
        drift=without_drift(flights, c),
    )


def shares_after(
    flights: Sequence[Flight], values: Mapping[str, float], c: Conditions, times: float = 1.0
) -> list[list[float]]:
    """Return the shares of all parameters after each of the records, each made so many times."""
    found: list[list[float]] = []
    known = c.question.prior(c.setting)
    gain, p = np.zeros_like(known), len(c.question.names)
    for flight in flights:
        gain += times * fisher_information(flight, values, c)
        C = np.linalg.inv(gain + known + 1e-9 * np.eye(len(known)))
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
        """Return the largest share of uncertainty after as many flights as the time allows.

        size [m3] to either side of neutral; moves: volume changes of a flight.
        """
        flights = []
        for start, sign in ((setting.deepest, 1.0), (setting.shallowest, -1.0)):
            volumes, turns = [sign * size, -sign * size], [start - sign * _PLACE * span]
            release = Release.to_and_fro(start, volumes[:moves], turns[: moves - 1])
            flights.append(follow(release, values, c))
        times = time / sum(f.duration + setting.settling for f in flights)
        return max(shares_after(flights, values, c, times)[-1])

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
