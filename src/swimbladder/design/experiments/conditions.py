"""The pool, its sensors and its habits: everything a design depends on beside the vehicle.

`follow` says what the record of a release would hold of a vehicle with given parameters. Its Fisher
information is about the vehicle's parameters, with the record's own eliminated.
Parameters count in shares: a change of 1 is a whole of the parameter, or of what is large for one
that may be 0. Information about them adds up over records, so that of a candidate is found once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from swimbladder.design.plan import Move
from swimbladder.errors import InputError
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion.problem import (
    DELAY,
    LEAST_STD,
    Assumed,
    Experiment,
    Model,
    Problem,
    Segment,
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
    rate = (volume[1] - volume[0]) / (time[1] - time[0])
    return np.asarray(course.follow([p], np.array([[rate, volume[0], start, 0.0]]))[0])


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


def experiment_of(flight: Flight, name: str) -> Experiment:
    """Return a flight as `identify` takes a log of it."""
    t, z, V, start = flight.time, flight.depth, flight.volume, flight.release.start
    record = Record(drive="volume", time=t, depth=z, volume=V, compared=np.ones(len(t), np.bool_))
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
        """Return what is known beforehand, as information about shares and delay [p + 1, p + 1]."""
        std = [self.priors[name].std if name in self.priors else math.inf for name in self.names]
        delay = DELAY / max(setting.delay_std, LEAST_STD * DELAY)
        return np.diag(np.append(self.sizes(self.names) / std, delay) ** 2)


class Conditions(NamedTuple):
    """All that a design depends on: what is asked, the pool, and what the actuator does there."""

    question: Question
    setting: Setting
    ramps: Ramps


def problem_of(flights: Sequence[Flight], c: Conditions, **fixed: float) -> Problem:
    """Return the fit that `identify` would make of these records; fixed: instead of estimated."""
    held = c.question.fixed | fixed
    names = tuple(name for name in c.question.names if name not in held)
    priors = {name: p for name, p in c.question.priors.items() if name in names}
    experiments = [experiment_of(flight, f"release {k}") for k, flight in enumerate(flights, 1)]
    setting = c.setting
    assumed = Assumed(
        held, priors, setting.neutral_std, drift_std=setting.drift_std, delay_std=setting.delay_std
    )
    return Problem(experiments, c.question.model, names, assumed)


def fisher_information(flight: Flight, values: Mapping[str, float], c: Conditions) -> Array:
    """Return what a record says [p + 1, p + 1] of the vehicle that has these values.

    Of the shares, and last of how late the stamps of volumes are, in units of DELAY: the record's
    own neutral volume, its drift and its start follow them.
    """
    question, setting = c.question, c.setting
    p = len(question.names)
    if len(flight.time) < FEWEST:
        return np.zeros((p + 1, p + 1))
    problem = problem_of([flight], c._replace(question=question._replace(priors={})))
    x = problem.begin(values)
    per_share = [
        1.0 if log else question.size(name) / scale
        for name, log, scale in zip(question.names, problem.logarithmic, problem.scale, strict=True)
    ]
    J = problem.slope(x) / setting.depth_noise
    J[:, :p] *= per_share
    of_all = [*range(p), problem.delay_at]
    own = [i for i in range(len(x)) if i not in of_all]
    known = problem.prior_rows(x)[1][:, own]
    inner = J[:, own].T @ J[:, own] + known.T @ known
    across = J[:, of_all].T @ J[:, own]
    # What is left of the others' columns, once the record's own entries follow them.
    back = np.linalg.solve(inner + 1e-12 * np.diag(np.diag(inner)), across.T)
    gain = J[:, of_all].T @ J[:, of_all] - across @ back
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
