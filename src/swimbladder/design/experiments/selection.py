"""Which of many candidates to run: the most informative set in the available time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError

Array = NDArray[np.float64]
_UNKNOWN = 1e-4  # information about a share: off by a hundred wholes
_LITTLE = 0.0  # of the criterion: a whole of a parameter
_PASSES = 40
_WORTH = 1e-6  # of the criterion, that an exchange has to bring


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
    """Information of candidates [c, d, p, p] about each of d vehicles, what a drift does
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

    Greedy by what is gained per time, once for the criterion and once for the whole ellipsoid,
    which also counts where one candidate alone is no answer; then exchanges (Fedorov) of up to two
    for another until none helps. most: releases. Raises InputError where the time is too short for
    any.
    """
    if not (table.cost <= budget).any():
        raise InputError(
            "the time is too short for one release", field="--time", value=round(budget), unit="s",
            remedy=f"Give at least {table.cost.min() / 60.0:.1f} min, or a shorter --settling",
        )  # fmt: skip
    whole = replace(table, judge=Criterion(kind="D", among=tuple(range(len(table.prior)))))
    found = []
    for guide in (table, whole):
        chosen = _greedy(guide, budget, most)
        for _ in range(_PASSES):
            better = _exchanged(table, chosen, budget, most)
            if better == chosen:
                break
            chosen = better
        found.append(chosen)
    return min(found, key=table.of)


def _greedy(table: Table, budget: float, most: int) -> list[int]:
    chosen: list[int] = []
    now, left = table.of(chosen), budget
    while len(chosen) < most and (table.cost <= left).any():
        values = np.where(table.cost <= left, table.with_each(chosen), np.inf)
        best = int(np.argmax((now - values) / table.cost))
        if not values[best] < now and chosen:
            break
        chosen.append(best)
        now, left = float(values[best]), left - float(table.cost[best])
    return chosen


def _exchanged(table: Table, chosen: list[int], budget: float, most: int) -> list[int]:
    """Return the best set that none, one or two of the chosen and another make, or fewer."""
    best, least = chosen, table.of(chosen) - _WORTH
    kinds = sorted(set(chosen))
    out: list[tuple[int, ...]] = [(), *((kind,) for kind in kinds)]
    out += list(combinations(kinds, 2)) + [(k, k) for k in kinds]
    for gone in out:
        others = list(chosen)
        for kind in gone:
            if kind in others:
                others.remove(kind)
        if len(others) > len(chosen) - len(gone):
            continue
        if others and table.of(others) < least:
            best, least = others, table.of(others)
        room = budget - float(table.cost[others].sum())
        if len(others) < most and (table.cost <= room).any():
            values = np.where(table.cost <= room, table.with_each(others), np.inf)
            k = int(np.argmin(values))
            if values[k] < least:
                best, least = [*others, k], float(values[k])
    return best


def in_order(table: Table, chosen: Sequence[int]) -> list[int]:
    """Return the chosen ones so that each next adds most to those before it."""
    whole = replace(table, judge=Criterion(kind="D", among=tuple(range(len(table.prior)))))
    left: list[int] = list(chosen)
    order: list[int] = []
    while left:
        values = table.with_each(order)[left]
        if values.min() > _LITTLE:  # nothing is known of some parameter yet, whichever is next
            values = whole.with_each(order)[left]
        order.append(left.pop(int(np.argmin(values))))
    return order
