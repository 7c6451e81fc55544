"""The filter as others call it: a plant, arrays of one log, the noise; what it estimated.

A bank holds several filters, each with its own guess of what is not known, weighed by how they
fare. While a vehicle floats, its depth says only that it is lighter than neutral, and one linear
filter takes nothing from that. Filters that start from several neutral volumes do: those that
expect the vehicle to sink too early or too late lose their weight when it stays or goes. Drag, psi,
a drift and the noise differ from log to log too, and guesses of them are weighed in the same way:
by what was measured so far, and nothing else (Magill, IEEE Trans. Autom. Control 10, 1965; Alspach
and Sorenson, ibid. 17, 1972).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swimbladder.estimation.kalman.kernels import (
    HELD,
    Filtered,
    Samples,
    filter_kernel,
    follow_kernel,
    predict_kernel,
)
from swimbladder.estimation.series import Index, huber
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.modes import Layers

GATE = 3.0  # standard deviations of an innovation beyond which it is not believed in full


class Noise(NamedTuple):
    """How uncertain measurement and motion are."""

    depth: float  # m, 1 sigma of a measured depth, its quantum's share included
    random_walk: float  # m3/s^0.5, intensity of the neutral volume's random walk
    acceleration: float = 0.0  # m/s^1.5, intensity of white acceleration
    held_depth: float = 0.05  # m, 1 sigma of depths in contact with surface or bottom
    held_speed: float = 0.02  # m/s, the same of the speed
    correlated: float = 0.0  # m, 1 sigma of a part of the measured depth's noise that lasts
    correlation_time: float = 1.0  # s, time constant of that

    def variances(self) -> Array:
        """Return what the kernels take: squares, and how fast correlated noise fades [1/s]."""
        intensities = self.random_walk, self.acceleration
        deviations = self.depth, self.held_depth, *intensities, self.held_speed, self.correlated
        return np.append(np.square(deviations), 1.0 / self.correlation_time)


class Start(NamedTuple):
    """State before the first sample, with standard deviations; the three are independent."""

    depth: float  # m
    speed: float  # m/s
    neutral: float  # m3, neutral volume at depth 0, without what layers of the water add there
    depth_std: float
    speed_std: float
    neutral_std: float


def filter_depth(
    plant: Plant, samples: Samples, *, noise: Noise, start: Start, gate: float = GATE
) -> Filtered:
    """Return what the extended Kalman filter makes of a log's depths.

    gate: innovations beyond so many standard deviations lose weight, the faster the farther they
    are: with a gate of 3, one of 6 counts as 0.5 and one of 30 as 0.04. Four in a row to one
    side show that the state is wrong, and the filter starts anew from
    the depth measured, with the speed's and the neutral volume's first deviations.
    """
    n = len(samples.time)
    states, matrices = np.empty((2, n, 3)), np.zeros((3, n, 3, 3))
    before, after = (states[0], matrices[0], matrices[1]), (states[1], matrices[2])
    error, variance, contribution = np.empty((3, n))
    out = Filtered(*before, *after, error, variance, contribution, np.empty(n, np.int8))
    first, covariance = np.array(start[:3]), np.diag(np.square(start[3:]))
    filter_kernel(np.array(plant), samples, first, covariance, noise.variances(), gate, out)
    return out


def follow(
    plants: Sequence[Plant], layers: Layers, time: Array, volume: Array, starts: Array
) -> Array:
    """Return the depths [lanes, n] in m of several vehicles under one known volume.

    By the filter's own step, without noise, in layered water. volume [n] in m3, straight between
    the instants time [n] in s; starts [lanes, 3]: depth [m], speed [m/s], and how fast what is
    neutral grows from time 0 on [m3/s]. nan from where a vehicle left the water.
    """
    arrays = [np.ascontiguousarray(a, float) for a in (time, volume, starts)]
    return np.asarray(follow_kernel(np.array(plants), layers, *arrays))


# Depths in contact are wrong by much the same from sample to sample: so many make one.
_HELD_ALIKE = 3.0
_WORTH = 1e-3  # of the weight, below which a member is left out


class Member(NamedTuple):
    """A guess of all unknowns, as likely as any other before the log begins."""

    plant: Plant
    noise: Noise
    start: Start
    drift: float  # m3/s, steady growth of the neutral volume, beside its random walk


@dataclass(frozen=True)
class Bank:
    """What the members made of a log: their weights, and their states where these count."""

    samples: Samples
    members: tuple[Member, ...]
    weight: Array  # [members, n], given all depths up to each sample
    # By member: samples at which its state counts, the state [rows, 3] and its covariance there.
    states: dict[int, tuple[Index, Array, Array]]

    def ahead(self, first: Index, last: Index) -> tuple[Array, Array]:
        """Return mean and standard deviation of the depth [m] at samples `last`.

        Each given all depths up to the sample `first`, which counts, and the volumes up to `last`;
        the deviation is of the depth itself, without the measurement's noise.
        """
        mean, square, total = np.zeros(len(first)), np.zeros(len(first)), np.zeros(len(first))
        for i, (rows, states, covariances) in self.states.items():
            member, weight = self.members[i], self.weight[i, first]
            (worth,) = np.nonzero(weight > _WORTH)
            at, ends = np.searchsorted(rows, first[worth]), (first[worth], last[worth])
            plant, noise = np.array(member.plant), member.noise.variances()
            known, samples = (states[at], covariances[at]), _drifted(self.samples, member)
            depth, variance = predict_kernel(plant, samples, known, ends, noise)
            mean[worth] += weight[worth] * depth
            square[worth] += weight[worth] * (variance + depth**2)
            total[worth] += weight[worth]
        mean, square = mean / total, square / total
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    def weighted(self, values: Array) -> Array:
        """Return the weighed mean [n] of values [members] after each sample."""
        return np.asarray(values @ self.weight)


def filter_bank(samples: Samples, members: Sequence[Member], *, gate: float = GATE) -> Bank:
    """Return what the members make of a log; equal weights before its first sample."""
    likelihood = np.stack([log_likelihood(samples, member, gate=gate) for member in members])
    weight = np.exp(likelihood - likelihood.max(axis=0))
    weight /= weight.sum(axis=0)
    states = {}
    for i, member in enumerate(members):  # once more: all states of all would not fit
        (kept,) = np.nonzero((weight[i] > _WORTH) & (samples.use == 1))
        if len(kept):
            found = _run(samples, member, gate)
            states[i] = kept, found.mean[kept], found.covariance[kept]
    return Bank(samples, tuple(members), weight, states)


def _run(samples: Samples, member: Member, gate: float) -> Filtered:
    return filter_depth(
        member.plant, _drifted(samples, member), noise=member.noise, start=member.start, gate=gate
    )


def _drifted(samples: Samples, member: Member) -> Samples:
    """Return the samples with the drift taken off the volume: only the difference moves."""
    since = samples.time - samples.time[0]
    return samples._replace(volume=samples.volume - member.drift * since)


def log_likelihood(samples: Samples, member: Member, *, gate: float = GATE) -> Array:
    """Return the log likelihood [n] of the depths up to each sample, those in contact included."""
    found = _run(samples, member, gate)
    held = found.fate == HELD
    size = np.abs(found.innovation[held]) / np.sqrt(found.variance[held])
    each = found.contribution.copy()
    loss = huber(size, gate) + 0.5 * np.log(2.0 * np.pi * found.variance[held])
    each[held] = -loss / _HELD_ALIKE
    return np.asarray(np.cumsum(each))
