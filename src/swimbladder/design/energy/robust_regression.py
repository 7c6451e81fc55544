"""Least squares whose uncertainty holds where errors are shared within groups and vary in size.

Runs of one dive share what no column says (the battery, the oil, the weather), and long
runs err otherwise than short ones. So whole dives are left out one by one, and the numbers that
then come out give the covariance (the jackknife over clusters, CR3: R. M. Bell and D. F. McCaffrey,
Survey Methodology 28, 2002, 169). It holds for any correlation within dives and any spread of the
errors. Where few dives determine a number (only two went deep) the spread itself is hardly known:
its degrees of freedom, for the quantiles of Student's t, are Satterthwaite's, as these authors have
it, for errors of equal size that dives share in the proportion found.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import NoAnswerError

Array = NDArray[np.float64]


class Least(NamedTuple):
    """A weighted least-squares solution, and those without each cluster."""

    solution: Array
    std: Array
    freedom: Array  # degrees of freedom of each std
    residual: Array
    without: dict[float, Array]

    @classmethod
    def of(cls, A: Array, y: Array, weight: Array, cluster: Array) -> Least:
        """Return the solution of A x = y [n, k], rows weighted and in clusters [n].

        Raises NoAnswerError where the rows, or those without one cluster, do not determine x.
        """
        root = np.sqrt(weight / weight.mean())
        scale = np.abs(A).max(axis=0)
        B, b = A / scale * root[:, None], y * root
        if np.linalg.matrix_rank(B) < B.shape[1]:
            raise NoAnswerError(
                "the runs do not distinguish power and delivery by pressure and duration: log "
                "runs at several depths and of several lengths"
            )
        inverse = np.linalg.pinv(B)
        numbers = np.unique(cluster)
        member = (cluster[:, None] == numbers).astype(float)  # runs x clusters
        apart = np.empty((len(numbers), B.shape[1], len(b)))  # from the errors to the differences
        for g, number in enumerate(numbers):
            others = cluster != number
            if np.linalg.matrix_rank(B[others]) < B.shape[1]:
                raise NoAnswerError(
                    f"only dive {number:g} shows how the numbers depend on pressure: without "
                    "another one at its depth nothing says how sure they are. Log a second one"
                )
            apart[g] = -inverse
            apart[g][:, others] += np.linalg.pinv(B[others])
        solution = inverse @ b
        residual = b - B @ solution
        moved = apart @ b
        G = len(numbers)
        std = np.sqrt((G - 1.0) / G * np.sum(moved**2, axis=0))
        shared = _shared(residual, member)
        freedom = np.array([_freedom(apart[:, k], member, shared) for k in range(B.shape[1])])
        without = {float(n): (solution + d) / scale for n, d in zip(numbers, moved, strict=True)}
        found = solution / scale
        return cls(found, std / scale, freedom, y - A @ found, without)


def _shared(residual: Array, member: Array) -> float:
    """Return the variance that runs of a dive share over that of each run [-], 0 or above."""
    size = member.sum(axis=0)
    mean = member.T @ residual / size
    within = float(np.sum((residual - member @ mean) ** 2))
    spare = len(residual) - len(size)
    if spare < 1 or within == 0.0:
        return 0.0
    own = within / spare
    between = float(np.sum(size * mean**2)) / max(len(size) - 1, 1)
    return max((between / own - 1.0) / float(size.mean()), 0.0)


def _freedom(apart: Array, member: Array, shared: float) -> float:
    """Return Satterthwaite's degrees of freedom of a number's jackknife variance, at least 1.

    apart: how the number without each cluster depends on the errors [clusters, runs].
    """
    together = apart @ member
    M = apart @ apart.T + shared * together @ together.T
    return max(float(np.trace(M) ** 2 / np.sum(M * M)), 1.0)
