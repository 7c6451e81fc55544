"""The likelihood of records whose neutral volume is a random walk, by a Kalman filter.

Only stretches clear of surface and bottom count, and the filter starts anew in each: contact would
make the likelihood jump, and says little.

The covariance of a fit is from information, and from the scatter of the scores of blocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.kalman.depth_filter import Filtered, Noise, Samples, Start, filter_depth
from swimbladder.estimation.motion.experiment import experiment
from swimbladder.estimation.motion.model import Model
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

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
        self, records: Sequence[Record], model: Model, quantities: Sequence[Quantity],
        *, values: Mapping[str, float], priors: Mapping[str, Prior], neutral_std: float,
        vehicle: Vehicle, gate: float,
    ) -> None:  # fmt: skip
        self.model, self.quantities, self.values = model, tuple(quantities), dict(values)
        self.priors, self.gate = dict(priors), gate
        self.quantum = vehicle.sensors.depth_quantum
        self.known = math.isfinite(neutral_std)
        stroke = vehicle.stroke
        self.neutral_std = neutral_std if self.known else _SHARE * (stroke.maximum - stroke.minimum)
        self.records = tuple(records)
        parts = [(i, s) for i, record in enumerate(records) for s in _samples(record, vehicle)]
        self.record = np.array([i for i, _ in parts])  # of each stretch
        self.samples = tuple(s for _, s in parts)
        self.ends = np.cumsum([0, *(len(s.time) for s in self.samples)])

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
        return [
            filter_depth(clear, s, noise=noise, start=self._start(i, values, noise), gate=self.gate)
            for i, s in enumerate(self.samples)
        ]

    def _start(self, stretch: int, values: Mapping[str, float], noise: Noise) -> Start:
        s, record = self.samples[stretch], self.records[self.record[stretch]]
        neutral = float(s.volume[0] - values["psi"] * s.depth[0])
        std = self.neutral_std
        if self.known:
            neutral = self.model.base.V_0
            if not record.volume_absolute:  # neutral at the first sample, whatever psi is
                neutral += (self.model.base.psi - values["psi"]) * float(record.depth[0])
            std = math.hypot(std, noise.random_walk * math.sqrt(float(s.time[0])))
        return Start(
            depth=float(s.depth[0]), speed=0.0, neutral=neutral, depth_std=3.0 * noise.depth,
            speed_std=_SPEED_STD, neutral_std=std,
        )  # fmt: skip

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
        p = len(x)
        scores, information, at = np.empty((int(self.ends[-1]), p)), np.zeros((p, p)), 0
        sides = [(self.filtered(x + h), self.filtered(x - h)) for h in _STEP * np.eye(p)]
        for stretch in range(len(self.samples)):
            pairs = [(ahead[stretch], back[stretch]) for ahead, back in sides]
            n = len(self.samples[stretch].time)
            de = np.stack([a.innovation - b.innovation for a, b in pairs], axis=1) / (2.0 * _STEP)
            dS = np.stack([a.variance - b.variance for a, b in pairs], axis=1) / (2.0 * _STEP)
            part = np.stack([a.contribution - b.contribution for a, b in pairs], axis=1)
            scores[at : at + n] = part / (2.0 * _STEP)
            S = pairs[0][0].variance[:, None]
            believed = np.abs(pairs[0][0].innovation[:, None]) <= self.gate * np.sqrt(S)
            de, dS = de * believed / np.sqrt(S), dS * believed / S
            information += de.T @ de + 0.5 * dS.T @ dS
            at += n
        return scores, information


def _samples(record: Record, vehicle: Vehicle) -> list[Samples]:
    """Return what the filter takes of a record: its stretches clear of contact."""
    if record.volume is None or record.drive != "volume":
        raise InputError(
            "a random walk of the neutral volume is seen where only the logged volume drives it",
            field="--drive", value=record.drive, remedy="Drive it with volume",
        )  # fmt: skip
    found = []
    for segment in experiment("the log", record, vehicle).segments:
        part = slice(segment.first, segment.last + 1)
        arrays = (record.time[part], record.volume[part], record.depth[part])
        time, volume, depth = (np.ascontiguousarray(a) for a in arrays)
        found.append(Samples(time, volume, depth, np.ones(len(time), np.int8), record.layers))
    return found


Maker = Callable[[Sequence[Quantity], Mapping[str, float]], Likelihood]

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


def covariance(full: Likelihood, x: Array) -> tuple[Array, bool]:
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
        raise NoAnswerError(
            f"{' and '.join(unknown)} not identifiable from the logs: the vehicle hardly moves"
        )
    size = np.sqrt(np.where(known, np.diag(H), 1.0))
    values, vectors = np.linalg.eigh((H / np.outer(size, size))[np.ix_(known, known)])
    if values.size and values.min() < _SINGULAR:
        raise NoAnswerError(
            "not all parameters are identifiable from the logs: the likelihood is flat along a "
            "combination of them; set one, or give it a prior"
        )
    C = np.diag(np.full(len(x), np.inf))
    bread = (vectors / values) @ vectors.T / np.outer(size[known], size[known])
    blocks, robust = _blocks(full, len(x)), False
    if blocks is not None:
        sums = np.stack([np.bincount(blocks, column) for column in scores[:, known].T], axis=1)
        sums -= sums.mean(axis=0)
        sandwich = bread @ (sums.T @ sums) @ bread * len(sums) / (len(sums) - 1)
        ratio = np.diag(sandwich) / np.diag(bread)
        robust = bool((ratio > 1.0).any())
        if robust:
            grow = np.sqrt(np.maximum(ratio, 1.0) / ratio)
            bread = sandwich * np.outer(grow, grow)
    C[np.ix_(known, known)] = bread
    return C, robust


def _blocks(full: Likelihood, quantities: int) -> NDArray[np.int64] | None:
    """Return the number of the block that each sample is in, None where blocks are too few."""
    if len(full.records) >= _ENOUGH * quantities:
        return np.repeat(full.record, np.diff(full.ends))
    found, last = [], 0
    for s in full.samples:
        within = ((s.time - s.time[0]) // _BLOCK).astype(np.int64)
        found.append(within + last)
        last += int(within[-1]) + 1
    return np.concatenate(found) if last >= _ENOUGH * quantities else None
