"""A bank of filters, each with its own guess of what is not known, weighed by how they fare.

While a vehicle floats, its depth says only that it is lighter than neutral, and one linear filter
takes nothing from that. Filters that start from several neutral volumes do: those that expect the
vehicle to sink too early or too late lose their weight when it stays or goes. Drag, psi, a drift
and the noise differ from log to log too, and guesses of them are weighed in the same way: by what
was measured so far, and nothing else (Magill, IEEE Trans. Autom. Control 10, 1965; Alspach and
Sorenson, ibid. 17, 1972).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.kalman.depth_filter import (
    GATE,
    Filtered,
    Noise,
    Samples,
    Start,
    filter_depth,
)
from swimbladder.estimation.kalman.kernels import HELD, predict_kernel
from swimbladder.physics.dynamics import Plant

Array = NDArray[np.float64]
Index = NDArray[np.int64]

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
    rows: tuple[Index, ...]  # of each member, the samples at which its state is kept
    mean: tuple[Array, ...]  # [rows, 3]
    covariance: tuple[Array, ...]  # [rows, 3, 3]

    def ahead(self, first: Index, last: Index) -> tuple[Array, Array]:
        """Return mean and standard deviation of the depth [m] at samples `last`.

        Each given all depths up to the sample `first`, which counts, and the volumes up to `last`;
        the deviation is of the depth itself, without the measurement's noise.
        """
        mean, square, total = np.zeros(len(first)), np.zeros(len(first)), np.zeros(len(first))
        for i, member in enumerate(self.members):
            weight = self.weight[i, first]
            (worth,) = np.nonzero(weight > _WORTH)
            if not len(worth):
                continue
            at = np.searchsorted(self.rows[i], first[worth])
            depth, variance = np.empty(len(worth)), np.empty(len(worth))
            predict_kernel(
                np.array(member.plant), self.samples.layers, self.samples.time,
                _drifted(self.samples, member).volume, self.mean[i][at], self.covariance[i][at],
                first[worth], last[worth], member.noise.variances(), depth, variance,
            )  # fmt: skip
            mean[worth] += weight[worth] * depth
            square[worth] += weight[worth] * (variance + depth**2)
            total[worth] += weight[worth]
        mean, square = mean / total, square / total
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    def weighted(self, values: Array) -> Array:
        """Return the weighed mean [n] of values [members] after each sample."""
        result: Array = values @ self.weight
        return result


def filter_bank(samples: Samples, members: Sequence[Member], *, gate: float = GATE) -> Bank:
    """Return what the members make of a log; equal weights before its first sample."""
    likelihood = np.stack([log_likelihood(samples, member, gate=gate) for member in members])
    weight = np.exp(likelihood - likelihood.max(axis=0))
    weight /= weight.sum(axis=0)
    rows, mean, covariance = [], [], []
    for i, member in enumerate(members):  # once more: all states of all would not fit
        (kept,) = np.nonzero((weight[i] > _WORTH) & (samples.use == 1))
        rows.append(kept)
        if len(kept):
            found = _run(samples, member, gate)
            mean.append(found.mean[kept])
            covariance.append(found.covariance[kept])
        else:
            mean.append(np.empty((0, 3)))
            covariance.append(np.empty((0, 3, 3)))
    return Bank(samples, tuple(members), weight, tuple(rows), tuple(mean), tuple(covariance))


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
    total: Array = np.cumsum(each)
    return total
