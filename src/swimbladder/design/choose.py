"""Which of many candidates to run: the set that tells most in the time that there is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError

__all__ = ["Criterion", "Table", "choose", "criterion", "in_order"]

Array = NDArray[np.float64]
_UNKNOWN = 1e-4  # information about a share: off by a hundred wholes
_PASSES = 6


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """How good a covariance is, in one number, less is better.

    kind: largest, the logarithm of the largest standard deviation; D, that of the geometric mean of
    the confidence ellipsoid's axes; A, that of the root of the mean variance. Of the parameters
    `among`.
    """

    kind: str
    among: tuple[int, ...]

    def __call__(self, covariance: Array) -> Array:
        """Return it for covariances [..., p, p] of shares."""
        at = np.array(self.among)
        C = covariance[..., at[:, None], at]
        if self.kind == "D":
            result: Array = 0.5 * np.linalg.slogdet(C)[1] / len(at)
            return result
        variance = np.diagonal(C, axis1=-2, axis2=-1)
        one = variance.max(axis=-1) if self.kind == "largest" else variance.mean(axis=-1)
        logs: Array = 0.5 * np.log(one)
        return logs


def criterion(text: str, names: Sequence[str]) -> Criterion:
    """Return the criterion of that name; names of parameters ask for the largest among them.

    Raises InputError for any other text.
    """
    if text in ("largest", "D", "A"):
        return Criterion(kind=text, among=tuple(range(len(names))))
    wanted = [part.strip() for part in text.split(",")]
    if not all(part in names for part in wanted):
        raise InputError(
            "no such criterion", field="--criterion", value=text,
            remedy=f"Choose largest, D or A, or name parameters: {', '.join(names)}",
        )  # fmt: skip
    return Criterion(
        kind="largest", among=tuple(names.index(part) for part in dict.fromkeys(wanted))
    )


@dataclass(frozen=True, kw_only=True)
class Table:
    """What candidates tell: information [c, d, p, p] about each of d vehicles, what a drift does
    [c, d, p, p], and the pool time that they take [c] in s.
    """

    gain: Array
    drift: Array
    cost: Array
    prior: Array  # [p, p]
    judge: Criterion

    def value(self, gain: Array, drift: Array) -> Array:
        """Return the criterion, averaged over the vehicles, of sums of records [..., d, p, p]."""
        p = self.prior.shape[0]
        C = np.linalg.inv(gain + self.prior + _UNKNOWN * np.eye(p))
        result: Array = self.judge(np.add(C, C @ drift @ C)).mean(axis=-1)
        return result

    def of(self, chosen: Sequence[int]) -> float:
        """Return the criterion of a set of candidates."""
        at = list(chosen)
        return float(self.value(self.gain[at].sum(axis=0), self.drift[at].sum(axis=0)))

    def with_each(self, chosen: Sequence[int]) -> Array:
        """Return the criterion of a set and each of the candidates added to it [c]."""
        at = list(chosen)
        return self.value(
            self.gain[at].sum(axis=0) + self.gain, self.drift[at].sum(axis=0) + self.drift
        )


def choose(table: Table, budget: float, most: int) -> list[int]:
    """Return the candidates to run, some perhaps more than once, within a pool time [s].

    Greedy by what is gained per time, then exchanges of one for another until none helps (Fedorov).
    most: releases. Raises InputError where the time is too short for any.
    """
    if not (table.cost <= budget).any():
        raise InputError(
            "the time is too short for one release", field="--time", value=round(budget), unit="s",
            remedy=f"Give at least {table.cost.min() / 60.0:.1f} min, or a shorter --settling",
        )  # fmt: skip
    chosen: list[int] = []
    now = float(table.value(np.zeros_like(table.gain[0]), np.zeros_like(table.drift[0])))
    left = budget
    while len(chosen) < most and (table.cost <= left).any():
        values = np.where(table.cost <= left, table.with_each(chosen), np.inf)
        best = int(np.argmax((now - values) / table.cost))
        if not values[best] < now:
            break
        chosen.append(best)
        now, left = float(values[best]), left - float(table.cost[best])
    for _ in range(_PASSES):
        before = now
        for slot in range(len(chosen)):
            others = chosen[:slot] + chosen[slot + 1 :]
            room = budget - float(table.cost[others].sum())
            values = np.where(table.cost <= room, table.with_each(others), np.inf)
            best = int(np.argmin(values))
            if values[best] < now - 1e-9:
                chosen, now = [*others[:slot], best, *others[slot:]], float(values[best])
        if now > before - 1e-6:
            break
    return chosen


def in_order(table: Table, chosen: Sequence[int]) -> list[int]:
    """Return the chosen ones so that each next tells most with those before it."""
    left: list[int] = list(chosen)
    order: list[int] = []
    while left:
        values = table.with_each(order)[left]
        order.append(left.pop(int(np.argmin(values))))
    return order
