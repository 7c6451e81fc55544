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
from numpy.typing import NDArray

from swimbladder.estimation.kalman.kernels import (
    HELD,
    filter_kernel,
    follow_kernel,
    predict_kernel,
    smooth_kernel,
)
from swimbladder.estimation.series import Array, Index
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.layers import NO_LAYERS, Layers

GATE = 3.0  # standard deviations of an innovation beyond which it is not believed in full


class Noise(NamedTuple):
    """How uncertain measurement and motion are."""

    depth: float  # m, 1 sigma of a measured depth, its quantum's share included
    random_walk: float  # m3/s^0.5, intensity of the neutral volume's random walk
    acceleration: float = 0.0  # m/s^1.5, intensity of white acceleration
    held_depth: float = 0.05  # m, 1 sigma of depths in contact with surface or bottom
    held_speed: float = 0.02  # m/s, the same of the speed

    def variances(self) -> Array:
        """Return the squares for the kernels: depths, random walk, acceleration, held speed."""
        intensities = self.random_walk, self.acceleration
        return np.square([self.depth, self.held_depth, *intensities, self.held_speed])


class Start(NamedTuple):
    """State before the first sample, with standard deviations; the three are independent."""

    depth: float  # m
    speed: float  # m/s
    neutral: float  # m3, neutral volume at depth 0, without what layers of the water add there
    depth_std: float
    speed_std: float
    neutral_std: float


class Samples(NamedTuple):
    """A log's arrays of one length n, and the layers of the water that it was made in."""

    time: Array  # s, growing
    volume: Array  # m3, linear between samples
    depth: Array  # m; nan: not measured
    use: NDArray[np.int8]  # 1: counts; 0: in contact, with the contact's noise; -1: not looked at
    layers: Layers = NO_LAYERS


@dataclass(frozen=True)
class Filtered:
    """What the filter made of n samples; states are (depth m, speed m/s, neutral volume m3)."""

    plant: Plant
    samples: Samples
    noise: Noise
    log_likelihood: float  # of the samples that count
    predicted: Array  # [n, 3], before each sample
    predicted_covariance: Array  # [n, 3, 3]
    mean: Array  # [n, 3], after each sample
    covariance: Array  # [n, 3, 3]
    innovation: Array  # m [n], measured less predicted; nan where not looked at
    variance: Array  # m2 [n], of the innovation
    contribution: Array  # [n], to the log likelihood
    fate: NDArray[np.int8]  # [n], UNSEEN ... RESTARTED of kernels
    slopes: Array  # [n, 3, 3], of each predicted state by the one before

    def smoothed(self) -> tuple[Array, Array]:
        """Return states [n, 3] and covariances [n, 3, 3] given all samples, earlier and later."""
        mean, covariance = self.mean.copy(), self.covariance.copy()
        smooth_kernel(self.predicted, self.predicted_covariance, self.slopes, mean, covariance)
        return mean, covariance


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
    before, spread, slopes = np.empty((n, 3)), np.empty((n, 3, 3)), np.zeros((n, 3, 3))
    mean, covariance = np.empty((n, 3)), np.empty((n, 3, 3))
    error, variance, contribution = np.empty(n), np.empty(n), np.empty(n)
    fate = np.empty(n, np.int8)
    total = filter_kernel(
        np.array(plant),
        samples.layers,
        samples.time,
        samples.volume,
        samples.depth,
        samples.use,
        np.array(start[:3]),
        np.diag(np.square(start[3:])),
        noise.variances(),
        gate,
        before,
        spread,
        slopes,
        mean,
        covariance,
        error,
        variance,
        contribution,
        fate,
    )
    return Filtered(
        plant=plant,
        samples=samples,
        noise=noise,
        log_likelihood=total,
        predicted=before,
        predicted_covariance=spread,
        mean=mean,
        covariance=covariance,
        innovation=error,
        variance=variance,
        contribution=contribution,
        fate=fate,
        slopes=slopes,
    )


def follow(
    plants: Sequence[Plant], layers: Layers, time: Array, volume: Array, starts: Array
) -> Array:
    """Return the depths [lanes, n] in m of several vehicles under one known volume.

    By the filter's own step, without noise, in layered water. volume [n] in m3, straight between
    the instants time [n] in s; starts [lanes, 2]: depth [m] and speed [m/s]. nan from where a
    vehicle left the water.
    """
    depth = np.empty((len(plants), len(time)))
    follow_kernel(
        np.array(plants),
        layers,
        np.ascontiguousarray(time, float),
        np.ascontiguousarray(volume, float),
        np.ascontiguousarray(starts, float),
        depth,
    )
    return depth


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
            at = np.searchsorted(rows, first[worth])
            depth, variance = np.empty(len(worth)), np.empty(len(worth))
            predict_kernel(
                np.array(member.plant),
                self.samples.layers,
                self.samples.time,
                _drifted(self.samples, member).volume,
                states[at],
                covariances[at],
                first[worth],
                last[worth],
                member.noise.variances(),
                depth,
                variance,
            )
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
    loss = np.where(size < gate, 0.5 * size**2, gate * (size - 0.5 * gate))
    each = found.contribution.copy()
    each[held] = -(loss + 0.5 * np.log(2.0 * np.pi * found.variance[held])) / _HELD_ALIKE
    return np.asarray(np.cumsum(each))
