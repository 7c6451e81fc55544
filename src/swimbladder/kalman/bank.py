"""A bank of filters, each with its own guess of the neutral volume, weighed by how they fare.

While a vehicle floats, its depth says only that it is lighter than neutral, and one linear filter
takes nothing from that. Filters that start from several neutral volumes do: those that expect the
vehicle to sink too early or too late lose their weight when it stays or goes. Once it is under way
they soon agree (a Gaussian sum filter: Alspach and Sorenson, IEEE Trans. Autom. Control 17, 1972).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.dynamics import Plant
from swimbladder.kalman.depth_filter import (
    GATE,
    Filtered,
    Noise,
    Samples,
    Start,
    filter_depth,
)
from swimbladder.kalman.kernels import HELD

__all__ = ["Bank", "filter_bank"]

Array = NDArray[np.float64]

_MEMBERS = 9
_REACH = 2.2  # standard deviations to either side
_OWN = 0.7  # of the distance between neighbours: the deviation of each
# Depths in contact are wrong by much the same from sample to sample: so many make one.
_HELD_ALIKE = 3.0


@dataclass(frozen=True)
class Bank:
    """Filters of one log, and the weight [members, n] of each after each sample."""

    members: tuple[Filtered, ...]
    weight: Array

    def ahead(self, first: NDArray[np.int64], last: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return mean and standard deviation of the depth [m] at samples `last`.

        Each given all depths up to the sample `first` and the volumes up to `last`; the deviation
        is of the depth itself, without the measurement's noise.
        """
        mean, square = np.zeros(len(first)), np.zeros(len(first))
        for member, weight in zip(self.members, self.weight[:, first], strict=True):
            worth = weight > 1e-6
            depth, std = member.ahead(first[worth], last[worth])
            mean[worth] += weight[worth] * depth
            square[worth] += weight[worth] * (std**2 + depth**2)
        total = np.where(self.weight[:, first] > 1e-6, self.weight[:, first], 0.0).sum(axis=0)
        mean, square = mean / total, square / total
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    @property
    def best(self) -> Filtered:
        """The member with the largest weight at the end."""
        return self.members[int(np.argmax(self.weight[:, -1]))]


def filter_bank(
    plant: Plant, samples: Samples, *, noise: Noise, start: Start, gate: float = GATE
) -> Bank:
    """Return filters whose neutral volumes cover the start's deviation to either side."""
    place = np.linspace(-_REACH, _REACH, _MEMBERS)
    step = start.neutral_std * float(place[1] - place[0])
    members = tuple(
        filter_depth(
            plant,
            samples,
            noise=noise,
            start=start._replace(
                neutral=start.neutral + float(at) * start.neutral_std, neutral_std=_OWN * step
            ),
            gate=gate,
        )
        for at in place
    )
    likelihood = np.stack([_told(member, gate) for member in members])
    likelihood -= 0.5 * place[:, None] ** 2
    weight = np.exp(likelihood - likelihood.max(axis=0))
    return Bank(members, weight / weight.sum(axis=0))


def _told(member: Filtered, gate: float) -> Array:
    """Return the log likelihood of the depths up to each sample, those in contact included."""
    held = member.fate == HELD
    size = np.abs(member.innovation[held]) / np.sqrt(member.variance[held])
    loss = np.where(size < gate, 0.5 * size**2, gate * (size - 0.5 * gate))
    each = member.contribution.copy()
    each[held] = -(loss + 0.5 * np.log(2.0 * np.pi * member.variance[held])) / _HELD_ALIKE
    total: Array = np.cumsum(each)
    return total
