"""Covariance of a random walk's fit: information, and the scatter of the scores of blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.motion.random_walk_likelihood import Likelihood, Quantity

Array = NDArray[np.float64]
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
