"""Overdispersion of deep dives, by which their likelihood is tempered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class DiveScore(NamedTuple):
    """A dive's score and information on parameters [k], in prior deviations, without the priors."""

    gradient: Array  # of minus the log likelihood, at what fits all dives [k]
    information: Array  # [k, k]


def overdispersion(dives: Sequence[DiveScore]) -> float:
    """Return the ratio of the observed scatter of dives to that which their information implies.

    Each dive alone would have the parameters where I_d (x_d - x) = -g_d. The sum of the squares of
    x_d - x, in its own deviations, over its mean where the information is right, is what Birge
    (*Phys. Rev.* 40, 1932, 207) widens measurements of one quantity by that contradict each other;
    here with priors, so that what a dive hardly determines hardly counts. 1 for a single dive.
    """
    each = sum(_count(dive.information) for dive in dives)
    free = each - _count(np.sum([dive.information for dive in dives], axis=0))
    if free < 0.5:  # no parameter is determined by two of them
        return 1.0
    return sum(_off(dive) for dive in dives) / free


def distances(dives: Sequence[DiveScore]) -> tuple[float, ...]:
    """Return how far each dive by itself is from what fits all, rms in its own deviations."""
    return tuple(float(np.sqrt(_off(d) / max(_count(d.information), 1.0))) for d in dives)


def _count(information: Array) -> float:
    """Return the effective number of parameters that the data determine, without the priors."""
    return float(np.trace(np.linalg.solve(information + np.eye(len(information)), information)))


def _off(dive: DiveScore) -> float:
    prior = np.eye(len(dive.gradient))
    return float(dive.gradient @ np.linalg.solve(dive.information + prior, dive.gradient))
