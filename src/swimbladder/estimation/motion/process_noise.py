"""Parameters of a vehicle that does not quite move as the model has it, with process noise.

Trapped air, a hull that takes up water or cools, a piston that slips, a wake: the neutral volume is
a random walk, and white acceleration stands for the rest. The innovations of a Kalman filter give
the likelihood (Schweppe, IEEE Trans. Inf. Theory 11, 1965); parameters and the intensities of all
noise maximise it. So what the model lacks widens the intervals by its own spectrum: a fit without
process noise takes it for noise of the sensor, and over a long log of an unstable motion claims
parts per million of parameters that are wrong by tens of percent. Of the sensor's noise a part may
last (a filter in it, waves), which is another spectrum. A steady drift of each record's neutral
volume is estimated beside all of these, and where no noise but the depth's white one is significant
the likelihood is that without. Only stretches clear of surface and bottom
count, and the filter starts anew in each: contact would make the likelihood jump, and says little.

The covariance of a fit is from information, and from the scatter of the scores of blocks.
"""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.comparison.record import (
    adds_warmth,
    as_white,
    early_moves,
    more_warmth,
    volume_errors,
)
from swimbladder.estimation.estimates import Z95, Estimate, Prior, crossing
from swimbladder.estimation.kalman import (
    GATE,
    RESTARTED,
    Filtered,
    Noise,
    Samples,
    Start,
    filter_depth,
)
from swimbladder.estimation.motion.fit import eliminated, inverse_of, regression
from swimbladder.estimation.motion.problem import (
    DEPTH,
    DRIFT,
    NAMES,
    SPEED,
    VOLUME,
    Experiment,
    Problem,
)
from swimbladder.estimation.series import Index
from swimbladder.io.answers import as_json
from swimbladder.physics.arrays import Array
from swimbladder.vehicle import Vehicle

_SPEED_STD = 0.1  # m/s, of the speed at a start: nothing is known
_SHARE = 0.25  # of the stroke, deviation of a neutral volume that nothing is known of
_FINEST = 1e-4  # m; how the volume goes between two samples, which no log says, costs as much
_STEP = 1e-4  # of a quantity's scale, for slopes
_BENT = 0.05  # of a volume's deviation, that it is off a straight line
_INSTANT = 1e-6  # s, between what is one instant
_KEPT = 16  # ways in which the volumes of all stretches are driven


class Quantity(NamedTuple):
    """A quantity that is estimated: x is its logarithm, or the value over its scale."""

    name: str
    logarithmic: bool
    scale: float
    begin: float  # a value, SI
    limits: tuple[float, float] = (-math.inf, math.inf)  # of x

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
    Quantity("correlated", True, 1.0, 2e-3),  # m
    Quantity("correlation_time", True, 1.0, 3.0),  # s
)
NO_NOISE: Mapping[str, float] = {
    "random_walk": 0.0,
    "acceleration": 0.0,
    "correlated": 0.0,
    "correlation_time": NOISES[-1].begin,
}
_CORRELATION_TIME = Prior(3.0, 3.0)  # s: else noise would be white, or an offset
_DELAY = Quantity("volume_delay", False, 0.1, 0.0)  # s, by which the volume's stamps are late
EARLY = Quantity("early_moves", False, 1.0, 0.0)  # share; see `record.early_moves`
EARLY_STD = 0.8
NUISANCES = (_DELAY, EARLY)  # of all records, beside parameters and noise
_HEAT = Quantity("hull_gain", False, 1e-6, 0.0)  # m3/K, of the hull beyond the vehicle's file's
_LAG = Quantity("hull_lag", False, 100.0, 50.0, (0.0, 100.0))  # s, time constant of the hull
_LAG_STD = 200.0  # s


class Likelihood:
    """The log posterior of x given several records.

    quantities: what is estimated, names of the model and of NOISES; values: what is held, SI. x has
    them in their order, and then each record's drift of the neutral volume, in deviations of its
    prior, where there is one.
    """

    def __init__(
        self,
        problem: Problem,
        vehicle: Vehicle,
        quantities: Sequence[Quantity],
        values: Mapping[str, float],
    ) -> None:
        self.model = problem.model
        self.priors = {"correlation_time": _CORRELATION_TIME, **problem.priors}
        self.priors[_DELAY.name] = Prior(0.0, problem.delay_std)
        self.priors[EARLY.name] = Prior(0.0, EARLY_STD)
        self.priors[_HEAT.name] = Prior(0.0, problem.heat_std)
        lag = vehicle.hull.thermal_time_constant
        self.priors[_LAG.name] = Prior(lag, _LAG_STD)
        none = {_DELAY.name: 0.0, EARLY.name: 0.0, _HEAT.name: 0.0, _LAG.name: lag}
        self.quantities, self.values = tuple(quantities), {**none, **values}
        self.quantum, stroke = vehicle.sensors.depth_quantum, vehicle.stroke
        self.known = math.isfinite(problem.neutral_std)
        self.speed_std, self.drift_std = problem.speed_std, problem.drift_std
        self.driven = lru_cache(_KEPT)(self._driven)  # most quantities do not change these
        whole = stroke.maximum - stroke.minimum
        self.neutral_std = problem.neutral_std if self.known else _SHARE * whole
        self.records = tuple(e.record for e in problem.experiments)
        self.drifts = len(self.records) * (self.drift_std > 0.0)
        self.early = [early_moves(record) for record in self.records]
        parts = [(i, e.segments) for i, e in enumerate(problem.experiments)]
        self.record = np.array([i for i, segments in parts for _ in segments])  # of each stretch
        self.first = [s.first for _, segments in parts for s in segments]  # sample of the record
        self.samples = tuple(s for e in problem.experiments for s in _samples(e, whole))
        self.ends = np.cumsum([0, *(len(s.time) for s in self.samples)])
        self.record_of_samples = np.repeat(self.record, np.diff(self.ends))

    def begin(self, values: Mapping[str, float] | None = None) -> Array:
        """Return x at the values to begin with, or at others where they are given."""
        known = values or {}
        shared = [q.place(known.get(q.name, q.begin)) for q in self.quantities]
        drifts = [known.get(f"drift {k}", 0.0) / self.drift_std for k in range(self.drifts)]
        return np.append(shared, drifts)

    def within(self, x: Array) -> Array:
        """Return the nearest x that can be."""
        limits = [*(q.limits for q in self.quantities), *[(-math.inf, math.inf)] * self.drifts]
        low, high = np.array(limits).T
        return np.clip(x, low, high)

    def named(self, x: Array) -> dict[str, float]:
        """Return all values by name, estimated and held: "drift 0" [m3/s] of the first record."""
        shared, drifts = self.split(x)
        found = {q.name: q.value(at) for q, at in zip(self.quantities, shared, strict=True)}
        return self.values | found | {f"drift {k}": d for k, d in enumerate(drifts.tolist())}

    def split(self, x: Array) -> tuple[list[float], Array]:
        """Return the quantities' part of x, and the drifts of the neutral volumes [m3/s]."""
        n = len(self.quantities)
        drifts = self.drift_std * x[n:] if self.drifts else np.zeros(len(self.records))
        return x[:n].tolist(), drifts

    def noise(self, values: Mapping[str, float]) -> Noise:
        """Return the filter's noise of these values."""
        rounding = max(self.quantum / math.sqrt(12.0), _FINEST)
        depth = math.hypot(values["depth_noise"], rounding)
        return Noise(depth, **{name: values[name] for name in NO_NOISE})

    def filtered(self, x: Array) -> list[Filtered]:
        """Return the filter's run along every stretch."""
        return [run.only(rows) for run, rows in self._runs(x)]

    def smoothed(self, x: Array) -> list[tuple[Array, Array]]:
        """Return state and covariance at every sample of every stretch, given all samples.

        The depth's correlated noise counts as white there.
        """
        found = [(run.smoothed(), rows) for run, rows in self._runs(x, correlated=False)]
        return [(mean[rows], covariance[rows]) for (mean, covariance), rows in found]

    def _runs(self, x: Array, *, correlated: bool = True) -> Iterator[tuple[Filtered, Index]]:
        """Yield the filter's run along every stretch, and which of its rows are samples."""
        values = self.named(x)
        clear = self.model.plant(values, self.model.base.V_0)
        clear = clear._replace(z_surface=-math.inf, z_bottom=math.inf)
        noise = self.noise(values)
        if not correlated:
            depth = math.hypot(noise.depth, noise.correlated)
            noise = noise._replace(depth=depth, correlated=0.0)
        shared = (values[q.name] for q in (EARLY, _DELAY, _HEAT, _LAG))
        for i, (s, rows) in enumerate(self.driven(*shared, *self.split(x)[1].tolist())):
            if not correlated:
                s = s._replace(volume_error=as_white(s.time, s.volume_error))
            start = self.start(i, values, noise)
            yield filter_depth(clear, s, noise=noise, start=start), rows

    def _driven(
        self, early: float, delay: float, heat: float, lag: float, *drifts: float
    ) -> list[tuple[Samples, Index]]:
        """Return every stretch with the volumes that drive it, and where its samples are in it."""
        found = []
        for stretch, i in zip(self.samples, self.record, strict=True):
            record = self.records[i]
            assert record.volume is not None  # it drives them
            volume = record.volume + early * self.early[i]
            s, rows = self._late(stretch, record.time, volume, delay)
            s = s._replace(volume=s.volume - drifts[i] * s.time)
            if record.warmth is not None and adds_warmth(record, record.gain + heat, lag):
                more = more_warmth(record, record.gain + heat, lag)
                s = s._replace(volume=s.volume + np.interp(s.time, record.time, more))
            found.append((s, rows))
        return found

    @staticmethod
    def _late(s: Samples, stamps: Array, volume: Array, delay: float) -> tuple[Samples, Index]:
        """Return a stretch with the volumes of a record, late by a delay [s], and where its samples
        are in it now.

        Volumes are straight between their stamps: where they bend, there are instants more.
        """
        if delay == 0.0:
            return s._replace(volume=np.interp(s.time, stamps, volume)), np.arange(len(s.time))
        bends = np.abs(np.diff(volume, 2)) > _BENT * float(np.std(volume))
        more = stamps[1:-1][bends] - delay
        more = more[(more > s.time[0]) & (more < s.time[-1])]
        after = s.time[np.searchsorted(s.time, more)]
        before = s.time[np.searchsorted(s.time, more) - 1]
        more = more[np.minimum(after - more, more - before) > _INSTANT]
        time = np.sort(np.append(s.time, more))
        rows = np.searchsorted(time, s.time)
        late = np.interp(time + delay, stamps, volume)
        depth, use = np.full(len(time), np.nan), np.full(len(time), -1, np.int8)
        depth[rows], use[rows] = s.depth, s.use
        volume_error = np.full((2, len(time)), -1.0)
        volume_error[0, rows] = s.volume_error[0]
        volume_error[1] = s.volume_error[1, np.searchsorted(s.time, time)]
        return Samples(time, late, depth, use, s.layers, volume_error), rows

    def start(self, stretch: int, values: Mapping[str, float], noise: Noise) -> Start:
        """Return the state that a stretch begins with, and what is known of it."""
        s, record = self.samples[stretch], self.records[self.record[stretch]]
        neutral = float(s.volume[0] - values["psi"] * s.depth[0])
        std = self.neutral_std
        if self.known:
            neutral = self.model.base.V_0
            if not record.volume_absolute:  # neutral at the first sample, whatever psi is
                neutral += (self.model.base.psi - values["psi"]) * float(record.depth[0])
            std = math.hypot(std, noise.random_walk * math.sqrt(float(s.time[0])))
        begins = stretch == 0 or self.record[stretch] != self.record[stretch - 1]
        speed = min(self.speed_std, _SPEED_STD) if begins else _SPEED_STD
        depth = 3.0 * math.hypot(noise.depth, noise.correlated)
        return Start(float(s.depth[0]), 0.0, neutral, depth, speed, std)

    def prior(self, x: Array) -> float:
        """Return the log density of the priors at x, up to a constant."""
        slope, hold = self.prior_slope(x)
        return -0.5 * float((slope**2 / np.where(hold > 0.0, hold, 1.0)).sum())

    def prior_slope(self, x: Array) -> tuple[Array, Array]:
        """Return gradient of the priors' log density at x, and minus its second derivatives."""
        slope, hold = -x, np.ones(len(x))  # of drifts
        for i, q in enumerate(self.quantities):
            prior = self.priors.get(q.name)
            slope[i] = hold[i] = 0.0
            if prior is not None:
                width = prior.std / (prior.mean if q.logarithmic else q.scale)
                slope[i], hold[i] = (q.place(prior.mean) - float(x[i])) / width**2, width**-2
        return slope, hold

    def __call__(self, x: Array) -> float:
        """Return the log posterior at x."""
        total = sum(f.log_likelihood for f, _ in self._runs(x)) + self.prior(x)
        return float(total) if math.isfinite(total) else -1e12

    def _along(self, x: Array) -> tuple[Array, Array]:
        """Return innovation, variance and log likelihood of every sample [3, samples], and how
        often the filter has started anew in its stretch until then.
        """
        parts = [
            ((f.innovation[rows], f.variance[rows], f.contribution[rows]), _restarts(f.fate[rows]))
            for f, rows in self._runs(x)
        ]
        along, began = zip(*parts, strict=True)
        return np.concatenate(along, axis=1), np.concatenate(began)

    @np.errstate(invalid="ignore", over="ignore")  # of models that no vehicle is
    def scores(self, x: Array, *, central: bool = True) -> tuple[Array, Array]:
        """Return the gradient [samples, len(x)] of every sample's log likelihood at x, and the
        information [len(x), len(x)] of all, priors left out.

        The information is Fisher's for normal innovations e of variance S, e weighted as it counts:
        the sum of de de'/S + dS dS'/(2 S^2). central: differences to both sides. Where the filter
        starts anew elsewhere than a step aside, the likelihood jumps between, which is no slope.
        """
        slopes, de, dS = self._slopes(x, central=central)
        parts = [(de[a:b], dS[a:b]) for a, b in pairwise(self.ends)]
        return slopes, np.sum([e.T @ e + 0.5 * s.T @ s for e, s in parts], axis=0)

    def changed(self, **changes: Any) -> "Likelihood":
        """Return the same, but for some of its attributes."""
        other = copy(self)
        vars(other).update(changes, driven=lru_cache(_KEPT)(other._driven))
        return other

    def _slopes(self, x: Array, *, central: bool) -> tuple[Array, Array, Array]:
        """Return the slopes of every sample's log likelihood, innovation and variance, the last
        two in deviations and shares, by each entry of x.
        """
        here, began = self._along(x)
        n, alike = len(self.quantities), np.arange(len(x)) >= len(self.quantities)
        steps = [*np.eye(len(x))[:n], *[alike] * (self.drifts > 0)]  # a sample has one drift
        slopes, side = np.zeros((*here.shape, len(steps))), np.zeros((here.shape[1], len(steps)))
        for i, h in enumerate(_STEP * np.array(steps)):
            total, sides, lean = np.zeros_like(here), np.zeros(here.shape[1]), side[:, i]
            for sign in (1.0, -1.0):
                if sign < 0.0 and (i == n or (not central and sides.all())):
                    break  # the other side is needed only where the likelihood jumps
                there, again = self._along(x + sign * h)
                same = (again == began) & np.isfinite(there).all(axis=0)
                total += np.where(same, sign * (there - here), 0.0)
                sides += same
                lean += sign * same
            slopes[..., i] = np.nan_to_num(total / (np.maximum(sides, 1.0) * _STEP))
        e, S, _ = here[..., None]
        believed = np.abs(e) <= GATE * np.sqrt(S)
        de = np.where(believed, slopes[0] / np.sqrt(S), 0.0)
        dS = np.where(believed, slopes[1] / S, 0.0)
        # a difference to one side is off by half a step of the curvature, which is about minus that
        parts = (slopes[2] + 0.5 * _STEP * side * (de**2 + 0.5 * dS**2), de, dS)
        own = self.record_of_samples[:, None] == np.arange(self.drifts)
        each = [np.hstack([part[:, :n], part[:, n:] * own]) for part in parts]
        return each[0], each[1], each[2]


def _restarts(fate: NDArray[np.int8]) -> Array:
    """Return a number [n] that two runs share where they have started anew at the same samples."""
    again = fate == RESTARTED
    if not again.any():
        return np.zeros(len(again))
    return np.cumsum(np.where(again, np.sqrt(np.arange(2.0, len(again) + 2.0)), 0.0))


def _samples(e: Experiment, stroke: float) -> list[Samples]:
    """Return what the filter takes of a record: its stretches clear of contact; stroke [m3]."""
    record = e.record
    if record.volume is None or record.drive != "volume":
        what = "a random walk of the neutral volume is seen where only the logged volume drives it"
        raise InputError(what, field="drive", value=record.drive, remedy="Drive it with volume")
    found, off = [], volume_errors(record, stroke)
    for segment in e.segments:
        part = slice(segment.first, segment.last + 1)
        arrays = (record.time[part], record.volume[part], record.depth[part])
        time, volume, depth = (np.ascontiguousarray(a) for a in arrays)
        use, own = np.ones(len(time), np.int8), off[:, part].copy()
        own[0, 0] = off[0][: segment.first + 1].max()
        found.append(Samples(time, volume, depth, use, record.layers, own))
    return found


Maker = Callable[[Sequence[Quantity], Mapping[str, float]], Likelihood]  # of other quantities

_BLOCK = 20.0  # s, of samples that may depend on each other
_ENOUGH = 4  # blocks a quantity, for a covariance from their scatter
_SINGULAR = 1e-7
_LOOSE = 5.0  # deviation of a logarithm, at which the quantity is not identifiable


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
    quantities[i] = Quantity("drag_quadratic", False, scale, 0.0, (0.0, math.inf))
    y = x.copy()
    y[i] = 0.0
    return likelihood(quantities, held), y


def covariance(full: Likelihood, x: Array) -> Array:
    """Return the covariance of the quantities: the inverse of their information, what the drifts
    follow taken off, with the deviations of a sandwich with the scatter of the scores.

    The scores are summed over whole records where there are enough of them, which allows for
    records that differ, else over blocks of 20 s. Where there are too few of these too, and where
    the scatter is smaller than the information says, that stands. Correlations are always of the
    information: those of so few sums are noise. A quantity whose logarithm is not identifiable, as
    of a random walk of 0, has an infinite variance and no part in the others'. Along a combination
    of which nothing is known the variance is huge.
    """
    n = len(full.quantities)
    scores, H = full.scores(x)
    H += np.diag(full.prior_slope(x)[1])
    H, follows = eliminated(H, n)
    scores = scores[:, :n] - scores[:, n:] @ follows
    known = np.diag(H) > np.where([q.logarithmic for q in full.quantities], _LOOSE**-2, 0.0)
    C = np.diag(np.full(n, np.inf))
    bread = inverse_of(H[np.ix_(known, known)], _SINGULAR)
    blocks = _blocks(full, n)
    if blocks is not None:
        sums = np.stack([np.bincount(blocks, column) for column in scores[:, known].T], axis=1)
        sums -= sums.mean(axis=0)
        sandwich = bread @ (sums.T @ sums) @ bread * len(sums) / (len(sums) - 1)
        grow = np.sqrt(np.maximum(np.diag(sandwich) / np.diag(bread), 1.0))
        bread = bread * np.outer(grow, grow)
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
_AGREE = 0.05  # of log likelihood, within which two searches have ended on the same hill
_RIDGE = 0.25  # information that bounds a step of a quantity that is not identifiable, at first
_LEAST_RIDGE = 1e-3  # with which a search may end
_CLOSE = 0.5  # of log likelihood: a step that gains less is near the end
_FAR = 100.0  # scales, from which no search begins
_SETTLES = 0.2  # of the time between samples, the least T2
_LONGEST = 1.5  # of a logarithm, a step
_ROUNDS = 60
_FEW = 12  # rounds that begin next to where they end
_REACHES_0 = 0.025  # chance of a random walk's evidence, above which its interval reaches 0
_NEAR = 0.1  # of the logarithm of the intensity, to which its end is found
_FARTHEST = 15.0  # of the logarithm of the intensity, where its end is sought
_UNITS = {
    "depth_noise": "m",
    "random_walk": "m3/s^0.5",
    "acceleration": "m/s/s^0.5",
    "correlated": "m",
    "correlation_time": "s",
    "volume_delay": "s",
    "early_moves": "1",
    "hull_gain": "m3/K",
    "hull_lag": "s",
}
_WIDER = 1.2  # times an interval, from where the volumes' errors have to be in it
_MOVES = 0.5  # deviations of a value: likewise
_CLEAR = 1.96  # deviations from 0
SIGNIFICANT = 1e-3  # chance of as much evidence for process noise without any


class Track(NamedTuple):
    """How the filter went along one record, at its samples; NaN where they do not count."""

    innovation: Array  # m, measured less predicted from the samples before
    deviation: Array  # m, that it should have
    smoothed: Array  # [n, 3], depth m, speed m/s, neutral volume m3, given all samples
    covariance: Array  # [n, 3, 3], of that
    start: Start  # what was known of the state at its first sample

    @property
    def weight(self) -> Array:
        """How much each sample counts: 0 where it does not, less than 1 for outliers."""
        size = np.abs(self.innovation) / self.deviation
        return np.nan_to_num(np.minimum(1.0, (GATE / np.maximum(size, 1e-9)) ** 2))

    @property
    def used(self) -> Index:
        """Numbers of the samples that count."""
        return np.flatnonzero(np.isfinite(self.innovation))

    @property
    def neutral_off(self) -> float:
        """The neutral volume at the start against what was known [its standard deviations]."""
        first = float(self.smoothed[self.used[0], 2])
        return (first - self.start.neutral) / self.start.neutral_std


class Heat(NamedTuple):
    """What the hull gains per kelvin beyond the vehicle's file [m3/K], after a lag [s]."""

    gain: Estimate
    lag: Estimate
    covariance: Array  # [2, 2], m3/K and s

    @property
    def aside(self) -> Array:
        """Gain and lag off by the columns of the covariance's root, one after the other [2, 2]."""
        root = np.linalg.cholesky(self.covariance).T
        return np.asarray(np.array([self.gain.value, self.lag.value]) + root)


@dataclass(frozen=True, kw_only=True)
class ProcessNoiseFit:
    """What maximises the likelihood of the innovations, and how sure it is.

    estimates, covariance: of the names, in their order, SI. noises: depth_noise [m, its quantum
    not included], random_walk [m3/s^0.5], acceleration [m/s^1.5, white], correlated [m], what of
    the depth's noise is so, over a correlation_time [s]: with intervals. p_value: chance of as
    much evidence for the random walk where the neutral volume stays; p_any: for all noise but the
    depth's white one. white: there is none of that. delay: of the volumes' stamps [s]. heat: of the
    hull, where its temperature was logged. tracks: of each record.
    """

    names: tuple[str, ...]
    estimates: dict[str, Estimate]
    covariance: Array
    noises: dict[str, Estimate]
    white: bool
    delay: Estimate
    heat: Heat | None
    noise: Noise
    values: dict[str, float]
    log_likelihood: float
    p_value: float
    p_any: float
    tracks: tuple[Track, ...]

    @property
    def drifts(self) -> bool:
        """Whether the random walk of the neutral volume is significant (1 %)."""
        return self.p_value < 0.01

    @property
    def travelled(self) -> tuple[float, ...]:
        """For each record how far the smoothed neutral volume went [m3], largest less smallest."""
        return tuple(
            float(np.nanmax(n) - np.nanmin(n)) for n in (t.smoothed[:, 2] for t in self.tracks)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return as_json(
            self, "parameters=estimates noises log_likelihood p_value p_any travelled_m3"
        )


def with_heat(vehicle: Vehicle, heat: Heat | None) -> Vehicle:
    """Return a vehicle whose hull expands so much more, where that is clear."""
    hull = vehicle.hull
    if heat is None or hull.parts or abs(heat.gain.value) < _CLEAR * heat.gain.std:
        return vehicle
    total = hull.thermal_expansion + heat.gain.value / hull.displaced_volume
    more = {"thermal_expansion": total, "thermal_time_constant": heat.lag.value}
    origin = "identified: from the temperatures of the logs that identified.logs names"
    provenance = vehicle.provenance | {f"hull.{name}": origin for name in more}
    changes = {"hull": hull.model_copy(update=more), "provenance": provenance}
    return vehicle.model_copy(update=changes)


class Highest(NamedTuple):
    """Where the likelihood of all innovations is highest, before it is known how sure that is."""

    problem: Problem
    full: Likelihood
    x: Array
    height: float  # log posterior there
    p_value: float
    p_any: float
    likelihood: Maker
    absent: frozenset[str]  # noises that there are none of
    white: "Highest | None" = None  # likewise where no noise but the depth's white one is estimated

    @property
    def values(self) -> dict[str, float]:
        """All values by name."""
        return self.full.named(self.x)

    @property
    def depth_noise(self) -> float:
        """The noise of a measured depth, correlated or not [m]."""
        noise = self.full.noise(self.values)
        return math.hypot(noise.depth, noise.correlated)

    @property
    def significant(self) -> bool:
        """Whether there is more than white noise of the depth: the model lacks something."""
        return self.p_any < SIGNIFICANT

    @property
    def inexact(self) -> bool:
        """Whether what volumes may be off by clearly widens an interval, or moves a value.

        To be asked of `white`: process noise would stand for what they are off by.
        """
        n, early = len(self.problem.names), [q == EARLY for q in self.full.quantities]
        kept = ~np.pad(early, (0, self.full.drifts))
        samples = tuple(s._replace(volume_error=0.0 * s.volume_error) for s in self.full.samples)
        exact, x = self.full.changed(samples=samples), np.where(kept, self.x, 0.0)
        hold = np.diag(self.full.prior_slope(x)[1])
        wide = inverse_of(self.full.scores(self.x)[1] + hold)
        scores, information = exact.scores(x)
        known = (information + hold)[np.ix_(kept, kept)]
        narrow = inverse_of(known)
        slope = (scores.sum(axis=0) + self.full.prior_slope(x)[0])[kept]
        step = np.linalg.solve(known + _LEAST_RIDGE * np.eye(len(slope)), slope)
        less, more = (np.sqrt(np.diag(one)[:n]) for one in (narrow, wide))
        return bool(((more > _WIDER * less) | (np.abs(step[:n]) > _MOVES * less)).any())

    def begin(self) -> Array:
        """Return where a fit with exact volumes begins: by the smoothed states of each record."""
        problem, psi = self.problem, self.values["psi"]
        x, full = problem.begin(self.values), self.full
        starts = np.array([mean[0] for mean, _ in full.smoothed(self.x)])  # of each stretch
        firsts = starts[np.searchsorted(full.record, np.arange(len(full.records))), 2].tolist()
        errors = [e.error(V, psi) for e, V in zip(problem.experiments, firsts, strict=True)]
        x[problem.shared : problem.first_start] = np.array(errors) / VOLUME
        x[problem.first_start : problem.first_drift] = np.ravel(starts[:, :2] / (DEPTH, SPEED))
        x[problem.first_drift : problem.delay_at] = full.split(self.x)[1] / DRIFT
        return x


def highest_with_noise(
    problem: Problem, vehicle: Vehicle, *, without: Collection[str] = ()
) -> Highest:
    """Return where the likelihood of all innovations is highest.

    Priors are log-normal for positive quantities; `neutral_std` is that of every record's neutral
    volume about the vehicle's at its start. without: noises of NO_NOISE that there are none of.

    Raises InputError where the volume does not drive a record, NoAnswerError where the likelihood
    has no maximum that can be found.
    """
    absent = frozenset({*without, *(("correlation_time",) if "correlated" in without else ())})
    full = _likelihood_of(problem, vehicle, absent)
    x, best = _highest(full, _begins(full, problem))
    likelihood = partial(Likelihood, problem, vehicle)
    return _tested(Highest(problem, full, x, best, 1.0, 1.0, likelihood, absent))


def _likelihood_of(problem: Problem, vehicle: Vehicle, absent: Collection[str]) -> Likelihood:
    """Return the likelihood of all that is estimated; absent: noises that there are none of."""
    held = problem.values | {name: NO_NOISE[name] for name in absent}
    others = [q for q in NOISES if q.name not in absent] + _nuisances(problem)
    quantities = [*(_quantity(name, problem) for name in problem.names), *others]
    return Likelihood(problem, vehicle, quantities, held)


def _tested(at: Highest) -> Highest:
    """Return where the likelihood is highest with the evidence for the noises there."""
    less = [_without(at, names) for names in (("random_walk",), _ANY)]
    if max(one.height for one, _ in less) > at.height + _SAME:  # it had ended on a lesser hill
        x, height = _highest(at.full, [at.x, *(place for _, place in less)])
        at = at._replace(x=x, height=height)
        less = [_without(at, names) for names in (("random_walk",), _ANY)]
    steady, white = (one for one, _ in less)
    p_any = _chance(at.height - white.height, 4)
    white = white._replace(p_any=p_any)
    return at._replace(p_value=_chance(at.height - steady.height, 1), p_any=p_any, white=white)


def _nuisances(problem: Problem) -> list[Quantity]:
    """Return what all records have in common beside parameters and noise, where there is any."""
    return [*NUISANCES] * (problem.delay_std > 0.0) + [_HEAT, _LAG] * (problem.heat_std > 0.0)


def with_known_noise(
    problem: Problem, vehicle: Vehicle, depth_noise: float, values: Mapping[str, float]
) -> tuple[Likelihood, Array]:
    """Return the likelihood of all but noise, of records without process noise, and x at values.

    depth_noise: of a depth, beside its quantum [m].
    """
    sized = zip(problem.names, problem.logarithmic, problem.scale, strict=True)
    quantities = [*(Quantity(*of, problem.values[of[0]]) for of in sized), *_nuisances(problem)]
    held = {**problem.values, **NO_NOISE, "depth_noise": depth_noise}
    full = Likelihood(problem, vehicle, quantities, held)
    return full, full.begin(values)


def fit_process_noise(
    problem: Problem, vehicle: Vehicle, *, without: Collection[str] = ()
) -> ProcessNoiseFit:
    """Return the parameters and the noise that maximise the likelihood, and how sure they are.

    See `highest_with_noise`.
    """
    return described(highest_with_noise(problem, vehicle, without=without))


def described(at: Highest) -> ProcessNoiseFit:
    """Return what is known where the likelihood is highest."""
    names = at.problem.names
    full, x = without_trace(at.full, at.x, at.likelihood, at.full.values)
    C = covariance(full, x)
    shared, _ = full.split(x)
    per = np.array([q.slope(place) for q, place in zip(full.quantities, shared, strict=True)])
    std = np.sqrt(np.maximum(np.diag(C), 0.0)) * per
    found: dict[str, Estimate] = {}
    p, values = len(names), full.named(x)
    for q, deviation in zip(full.quantities, std.tolist(), strict=True):
        unit, log = _UNITS.get(q.name) or NAMES[q.name].unit, q.logarithmic
        found[q.name] = Estimate.of(values[q.name], deviation, unit, logarithmic=log)
    heat, named = None, [q.name for q in full.quantities]
    if _HEAT.name in named:
        i = [named.index(q.name) for q in (_HEAT, _LAG)]
        both = C[np.ix_(i, i)] * np.outer(per[i], per[i])
        heat = Heat(found[_HEAT.name], found[_LAG.name], both)
    for name in at.absent:
        found[name] = Estimate.given(NO_NOISE[name], _UNITS[name])
    if "random_walk" not in at.absent:
        own = found["random_walk"]
        found["random_walk"] = _interval(full, x, at.height, at.p_value, own, at.likelihood)
    return ProcessNoiseFit(
        names=names,
        estimates={name: found[name] for name in names},
        covariance=C[:p, :p] * np.outer(per[:p], per[:p]),
        noises={q.name: found[q.name] for q in NOISES},
        white=at.absent >= NO_NOISE.keys(),
        delay=found.get(_DELAY.name, Estimate.given(0.0, "s")),
        heat=heat,
        noise=full.noise(values),
        values=values,
        log_likelihood=at.height,
        p_value=at.p_value,
        p_any=at.p_any,
        tracks=_tracks(full, x),
    )


class Height(NamedTuple):
    """Where a model is most probable: all values, its log posterior, and its innovations [m]."""

    values: dict[str, float]
    height: float
    innovation: Array
    deviation: Array  # m, that each should have


def height_of(
    problem: Problem,
    vehicle: Vehicle,
    begins: Sequence[Mapping[str, float]],
    *,
    white: bool = False,
) -> Height:
    """Return where another model is most probable.

    begins: values of parameters and noises near which to begin; white: there is no noise but the
    depth's white one.
    """
    full = _likelihood_of(problem, vehicle, NO_NOISE if white else ())
    near = [full.within(full.begin(values)) for values in begins]
    x, height = _highest(full, [*near, *_begins(full, problem)])
    parts = [(f.innovation, np.sqrt(f.variance)) for f in full.filtered(x)]
    return Height(full.named(x), height, *np.concatenate(parts, axis=1))


_TRACE = 3.0  # of a logarithm: a twentieth of a noise is as good as none
_ANY = ("random_walk", "acceleration", "correlated", "correlation_time")


def _without(at: Highest, names: Sequence[str]) -> tuple[Highest, Array]:
    """Return where the log posterior is highest without some noises, and x of all with a trace of
    these there.
    """
    full, x = at.full, at.x
    gone = [i for i, q in enumerate(full.quantities) if q.name in names]
    others = [q for q in full.quantities if q.name not in names]
    less = at.likelihood(others, {**full.values, **{name: NO_NOISE[name] for name in names}})
    begin = np.delete(x, gone)
    place, height = _highest(less, [begin, _noisier(less, begin)])
    found = x - np.isin(np.arange(len(x)), gone) * _TRACE
    found[np.delete(np.arange(len(x)), gone)] = place
    absent = at.absent.union(names)
    return at._replace(full=less, x=place, height=height, p_value=1.0, absent=absent), found


def _chance(gain: float, noises: int) -> float:
    """Return the chance of such a gain in log likelihood where there are none of these noises.

    A noise is at the end of what it can be then: half the chance of one that may be negative. For
    several at once this is more than it is.
    """
    if gain <= 0.0:
        return 1.0
    return (0.5 if noises == 1 else 1.0) * float(chdtrc(noises, 2.0 * gain))


def _tracks(full: Likelihood, x: Array) -> tuple[Track, ...]:
    """Return how the filter went along each record."""
    runs, smooth = full.filtered(x), full.smoothed(x)
    values, n = full.named(x), len(full.quantities)
    variance = np.zeros(len(full.records))  # of the drifts
    variance[: full.drifts] = full.drift_std**2 / (1.0 + np.diag(full.scores(x)[1])[n:])
    found = []
    for i, record in enumerate(full.records):
        n = len(record.time)
        innovation, deviation = np.full((2, n), np.nan)
        mean, spread = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
        own = np.flatnonzero(full.record == i).tolist()
        for j in own:
            at = slice(full.first[j], full.first[j] + len(full.samples[j].time))
            innovation[at], deviation[at] = runs[j].innovation, np.sqrt(runs[j].variance)
            mean[at], spread[at] = smooth[j]
        mean[:, 2] += full.split(x)[1][i] * record.time  # the filter's goes without its drift
        spread[:, 2, 2] += variance[i] * record.time**2
        start = full.start(own[0], values, full.noise(values))
        found.append(Track(innovation, deviation, mean, spread, start))
    return tuple(found)


def _quantity(name: str, problem: Problem) -> Quantity:
    model, priors = problem.model, problem.priors
    begin = priors[name].mean if name in priors else problem.values[name]
    logarithmic = model.logarithmic(name) or name == "drag_quadratic"
    if not logarithmic:
        scale = model.scale(name)
        return Quantity(name, False, scale, min(max(begin, -_FAR * scale), _FAR * scale))
    low, high = NAMES[name].limits
    if name == "T2":  # a speed that settles within a sample is one
        low = max(
            low,
            _SETTLES * min(float(np.median(np.diff(e.record.time))) for e in problem.experiments),
        )
    return Quantity(name, True, 1.0, begin, (math.log(low), math.log(high)))


def _highest(
    likelihood: Likelihood, begins: Iterable[Array], *, rounds: int = _ROUNDS
) -> tuple[Array, float]:
    """Return where the log posterior is highest of where searches end, and how high.

    Raises NoAnswerError where it cannot be found.
    """
    found: list[tuple[Array, float]] = []
    for x in sorted(begins, key=likelihood, reverse=True):  # so none ends below where one begins
        found.append(_climb(likelihood, x, rounds))
        heights = sorted(height for _, height in found)
        if len(found) > 1 and heights[-1] - heights[-2] < _AGREE:
            break
    place, height = max(found, key=lambda pair: pair[1])
    if height <= -1e11:
        raise NoAnswerError("the filter cannot follow these logs with this vehicle: check units")
    return place, height


def _climb(likelihood: Likelihood, x: Array, rounds: int) -> tuple[Array, float]:
    """Return where the log posterior ends to rise from x, and how high that is.

    Fisher's scoring, damped as Levenberg and Marquardt do.
    """
    height, damping, ridge = likelihood(x), 0.0, _RIDGE
    for _ in range(rounds):
        scores, information = likelihood.scores(x, central=False)
        pull, hold = likelihood.prior_slope(x)
        slope = scores.sum(axis=0) + pull
        information += np.diag(hold)
        while True:
            held = damping * np.diag(information) + ridge
            step = np.linalg.solve(information + np.diag(held), slope)
            step *= min(1.0, _LONGEST / max(float(np.abs(step).max()), 1e-300))
            gain = 0.5 * float(slope @ step)
            if gain < _SAME:
                if ridge <= _LEAST_RIDGE:
                    return x, height
                ridge /= 10.0
                continue
            new = likelihood.within(x + step)
            reached = likelihood(new)
            if reached > height + 0.1 * gain:
                x, height, damping = new, reached, damping / 5.0
                ridge = max(ridge * (0.2 if gain < _CLOSE else 1.0), _LEAST_RIDGE)
                break
            damping = max(5.0 * damping, 0.3)
            if damping > 1e6:
                return x, height
    return x, height


def _begins(full: Likelihood, problem: Problem) -> Iterator[Array]:
    """Yield where to begin: the vehicle's own values, twice, and a regression's."""
    own = full.begin()
    yield from (own, _noisier(full, own))
    psi = None if "psi" in problem.names else problem.values["psi"]
    found = regression(problem.experiments, problem.model, psi=psi, free_neutral=True)
    if found is not None:
        yield full.within(full.begin(found[0]))


def _noisier(likelihood: Likelihood, x: Array) -> Array:
    """Return another start: noise of every kind is larger, but the random walk small."""
    shifts = {"random_walk": -2.0, "depth_noise": 1.0, "acceleration": 1.0}
    each = [shifts.get(q.name, 0.0) for q in likelihood.quantities]
    return np.asarray(x + np.pad(each, (0, likelihood.drifts)))


def _interval(
    full: Likelihood, x: Array, best: float, chance: float, found: Estimate, likelihood: Maker
) -> Estimate:
    """Return the random walk with the interval of its likelihood profile, which may include 0."""
    at = [q.name for q in full.quantities].index("random_walk")
    others = [*full.quantities[:at], *full.quantities[at + 1 :]]
    middle = float(x[at])
    near = {-1.0: np.delete(x, at), 1.0: np.delete(x, at)}  # where the last search to a side ended

    @cache  # a search that begins elsewhere may end elsewhere
    def beyond(distance: float) -> float:
        """Return how far the root of the deviance, which grows about evenly, is past 95 %."""
        if distance == 0.0:
            return -Z95
        held = likelihood(others, {**full.values, "random_walk": math.exp(middle + distance)})
        side = math.copysign(1.0, distance)
        near[side], height = _highest(held, [near[side]], rounds=_FEW)
        return math.sqrt(max(2.0 * (best - height), 0.0)) - Z95

    step = min(max(Z95 * found.std / found.value, 0.3), 1.5)
    low = crossing(beyond, -step, farthest=_FARTHEST, xtol=_NEAR) if chance < _REACHES_0 else None
    high = crossing(beyond, step, farthest=_FARTHEST, xtol=_NEAR)
    least = 0.0 if low is None else math.exp(middle + low)
    most = math.inf if high is None else math.exp(middle + high)
    return replace(found, ci95=(least, most))
