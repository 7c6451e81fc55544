"""Long records of an unstable motion, searched in stretches that are drawn together.

A vehicle that its hull's compression makes unstable doubles an error of its start every half minute
or so. Over ten doublings the depths are so bent a function of what is sought that a search
ends anywhere in a long curved valley. Cut into stretches, each with a start of its own, they are
nearly a linear one; gaps between the stretches are then made to cost ever more, until none is left
and the start of the first is that of the whole (multiple shooting: Bock and Plitt, IFAC Proceedings
17, 1984; Voss, Timmer and Kurths, International Journal of Bifurcation and Chaos 14, 2004).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.motion.experiment import Segment
from swimbladder.estimation.motion.problem import LOST, Problem

Array = NDArray[np.float64]

GAPS = (1.0, 1e-2, 1e-4, 1e-6)  # of the noise: what a gap may be, one search after the other
_MOST = 20.0  # of a logarithm: more stretches than for that help no more
_BESIDE = 1.5  # s, after which the depths must agree again: then the speeds do


def growth(problem: Problem, x: Array) -> float:
    """Return by how much an error of the depth at a start grows at most over a record.

    By the poles of the motion about rest, eq. (34) without the actuator; turbulent drag would only
    slow it.
    """
    p = problem.model.plant(problem.named(x), 0.0)
    fast, slow = np.roots([1.0, p.d_l, -p.a_b * p.psi]).tolist()
    if isinstance(fast, complex) or p.psi <= 0.0:
        return 1.0
    fast, slow = max(fast, slow), min(fast, slow)
    t = longest(problem)
    found = math.log(-slow / (fast - slow)) + fast * t  # the other exponential has died away
    return math.exp(min(found, _MOST)) if found > 0.0 else 1.0


def longest(problem: Problem) -> float:
    """Return how long the longest stretch under way lasts [s]."""
    return max(
        float(e.record.time[s.last] - e.record.time[s.first])
        for e in problem.experiments
        for s in e.segments
    )


class Shooting(Problem):
    """A problem cut into stretches, whose gaps count as residuals of the priors' kind."""

    def __init__(self, whole: Problem, grown: float) -> None:
        """Cut a problem whose errors grow so much in all into stretches that let them grow by e."""
        length = longest(whole) / max(2.0, math.log(grown))
        super().__init__(
            [e.tiles(length) for e in whole.experiments], whole.model, whole.names,
            fixed=whole.held,
            priors=whole.priors, neutral_std=whole.neutral_std, speed_std=whole.speed_std,
        )  # fmt: skip
        self.gap = 1.0  # m, 1 sigma
        self._joints: list[tuple[int, int, Segment]] = []  # experiment, stretch, its overlap
        for j, (own, long) in enumerate(zip(self.experiments, whole.experiments, strict=True)):
            ends = {s.last for s in long.segments}
            time = own.record.time
            for k, (a, b) in enumerate(pairwise(own.segments)):
                if a.last in ends:
                    continue
                last = int(np.searchsorted(time, time[b.first] + _BESIDE))
                self._joints.append((j, k, Segment(b.first, min(last, b.last), b.depth, b.speed)))

    def prior_rows(self, x: Array) -> tuple[Array, Array]:
        """Return the priors' rows, and after them two for each gap."""
        residuals, slopes = super().prior_rows(x)
        gaps, by = self._gaps(x)
        return (
            np.concatenate([residuals, gaps / self.gap]),
            np.concatenate([slopes, by / self.gap]),
        )

    def _gaps(self, x: Array) -> tuple[Array, Array]:
        """Return by how much stretches miss the next ones [2 for each, m], and the derivatives."""
        missed = np.zeros(2 * len(self._joints))
        slopes = np.zeros((len(missed), self.size))
        for i, (j, k, beside) in enumerate(self._joints):
            e = self.experiments[j]
            own = self.shared + j
            shared = [*range(self.shared), own]
            plants = self._plants(x, e, own, shared)
            for sign, part, stretch in (
                (1.0, e.segments[k]._replace(last=beside.last), k),
                (-1.0, beside, k + 1),
            ):
                at = self.starts_at[j] + 2 * stretch
                z, block = self._stretch(x, e, self._course(e, part), at, plants, derivatives=True)
                ends = [beside.first - part.first, beside.last - part.first]
                rows = slice(2 * i, 2 * i + 2)
                missed[rows] -= sign * z[ends]
                columns = [*shared, at, at + 1]
                slopes[rows, columns] += sign * block[ends]
        # a stretch that the vehicle left the water in misses by as much as a residual may
        return np.clip(np.nan_to_num(missed, nan=LOST), -LOST, LOST), slopes

    def begin_like(self, x: Array) -> Array:
        """Return an x of the stretches with what a whole problem's x says but of the starts."""
        found = self.begin()
        found[: self.first_start] = x[: self.first_start]
        return found


def joined(cut: Problem, x: Array, whole: Problem) -> Array:
    """Return the x of the whole problem: each record starts as the first of its stretches does."""
    found = whole.begin()
    found[: whole.first_start] = x[: cut.first_start]
    for j, e in enumerate(whole.experiments):
        parts = {s.first: k for k, s in enumerate(cut.experiments[j].segments)}
        for k, s in enumerate(e.segments):
            at, there = whole.starts_at[j] + 2 * k, cut.starts_at[j] + 2 * parts[s.first]
            found[at : at + 2] = x[there : there + 2]
    return found
