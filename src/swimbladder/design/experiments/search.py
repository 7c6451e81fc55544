"""The search for the best set: a library on a grid, a choice from it, then off the grid."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from swimbladder.design.experiments.conditions import Ramps, Release, Setting
from swimbladder.design.experiments.fisher_information import Question, fisher_information
from swimbladder.design.experiments.flight import follow
from swimbladder.design.experiments.library import releases, rounded
from swimbladder.design.experiments.selection import Criterion, Table, choose, in_order

Array = NDArray[np.float64]
_TRIES = 40  # of sizes and places, for each kind of release in the set
_NEAR = 0.1  # first step of these: of a volume, of a third of the range
_LATE = 20.0  # of the criterion, for a set that takes twice its time
_ALIKE = 0.02  # of the criterion, that fewer kinds of release may cost


class _Tabulated(NamedTuple):
    gain: Array  # [d, p, p]
    drift: Array  # [d, p, p]
    cost: float  # s, of the vehicle as given or on average, whichever is longer
    complete: bool  # in any of the vehicles


@dataclass(frozen=True, kw_only=True)
class Search:
    """What candidates are judged by, and what is known of them so far."""

    question: Question
    setting: Setting
    ramps: Ramps
    vehicles: Sequence[Mapping[str, float]]
    judge: Criterion
    known: dict[Release, _Tabulated] = field(default_factory=dict)

    def of(self, release: Release) -> _Tabulated:
        """Return the information of a release, on each vehicle."""
        if release not in self.known:
            self.known[release] = self._find(release)
        return self.known[release]

    def table(self, candidates: Sequence[Release]) -> Table:
        """Return the information of all candidates."""
        found = [self.of(release) for release in candidates]
        return Table(
            gain=np.array([f.gain for f in found]), drift=np.array([f.drift for f in found]),
            cost=np.array([f.cost for f in found]), prior=self.question.prior(), judge=self.judge,
        )  # fmt: skip

    def learn(self, family: Sequence[Release]) -> None:
        """Find a family's information: where a release cannot end, neither can one that goes on."""
        for before, release in zip([None, *family], family, strict=False):
            if before is not None and not self.of(before).complete:
                self.known[release] = self.of(before)
            self.of(release)

    def _find(self, release: Release) -> _Tabulated:
        s, q = self.setting, self.question
        gain, drift, time, complete = [], [], 0.0, False
        for values in self.vehicles:
            flight = follow(release, q.model, values, self.ramps, s)
            information = fisher_information(flight, q, values, s)
            gain.append(information.gain)
            drift.append(s.drift_std**2 * np.outer(information.drift, information.drift))
            time += flight.duration / len(self.vehicles)
            complete |= flight.complete
        given = follow(release, q.model, q.values, self.ramps, s)
        return _Tabulated(
            np.array(gain), np.array(drift), s.settling + max(time, given.duration),
            complete or given.complete,
        )  # fmt: skip


def search(s: Search, budget: float, most: int, advance: Callable[[float], None]) -> list[Release]:
    """Return the releases to run, in order, within a pool time [s] and a number of releases.

    advance: called with the share of the work done since last called. Raises InputError where the
    time is too short for any release.
    """
    families = releases(s.question, s.ramps, s.setting)
    for family in families:
        s.learn(family)
        advance(0.6 / len(families))
    candidates = [release for family in families for release in family]
    table = s.table(candidates)
    chosen = [candidates[i] for i in choose(table, budget, most)]
    kinds = Counter(chosen)
    for kind in kinds:
        others = [r for r in chosen if r != kind]
        better = _refined(s, kind, kinds[kind], others, budget)
        chosen = [better if r == kind else r for r in chosen]
        advance(0.35 / len(kinds))
    candidates = [*dict.fromkeys(chosen), *candidates]
    table = s.table(candidates)
    again = choose(table, budget, most)
    place = {release: i for i, release in enumerate(candidates)}
    ours = [place[r] for r in chosen]
    best = ours if table.cost[ours].sum() <= budget and table.of(ours) <= table.of(again) else again
    best = _fewer_kinds(table, best, budget)
    advance(0.05)
    return [_that_happens(s, candidates[i]) for i in in_order(table, best)]


def _fewer_kinds(table: Table, chosen: Sequence[int], budget: float) -> list[int]:
    """Return the set with rare kinds replaced by its frequent ones, where that costs next to
    nothing: a plan is easier to follow the more alike its releases are.
    """
    now, limit = list(chosen), table.of(chosen) + _ALIKE
    for rare, _ in reversed(Counter(chosen).most_common()):
        for kind, _ in Counter(now).most_common():
            other = [kind if i == rare else i for i in now]
            if kind != rare and table.cost[other].sum() <= budget and table.of(other) <= limit:
                now = other
                break
    return now


def _that_happens(s: Search, release: Release) -> Release:
    """Return a release without the moves that happen in none of the vehicles."""
    q = s.question
    flights = [
        follow(release, q.model, values, s.ramps, s.setting) for values in (q.values, *s.vehicles)
    ]
    return release._replace(moves=release.moves[: max(len(f.moved) for f in flights)])


def _refined(
    s: Search, kind: Release, count: int, others: Sequence[Release], budget: float
) -> Release:
    """Return a release of the same kind, better in `count` places beside the others."""
    start = np.array(_numbers(kind))
    rest = s.table(others) if others else None
    p = len(s.question.names)
    zero = np.zeros((len(s.vehicles), p, p))
    gain = zero if rest is None else rest.gain.sum(axis=0)
    drift = zero if rest is None else rest.drift.sum(axis=0)
    time = 0.0 if rest is None else float(rest.cost.sum())
    judge = s.table([kind])

    def worth(release: Release) -> float:
        t = s.of(release)
        late = max((time + count * t.cost) / budget - 1.0, 0.0)
        return float(judge.value(gain + count * t.gain, drift + count * t.drift)) + _LATE * late

    size = np.array(_steps(kind, s.setting))
    simplex = np.concatenate([start[None], start + np.diag(size)])

    def of_numbers(x: Array) -> float:
        return worth(_release(kind, x.tolist(), s))

    found = minimize(
        of_numbers, start, method="Nelder-Mead",
        options={"maxfev": _TRIES, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-3},
    )  # fmt: skip
    best = _release(kind, found.x.tolist(), s)
    return best if worth(best) < worth(kind) else kind


def _numbers(kind: Release) -> list[float]:
    """Return the volumes and depths that make a release of this kind."""
    volumes = [move.volume for move in kind.moves[:2]]
    depths = [move.when.depth for move in kind.moves[1:3] if move.when is not None]
    return volumes + depths


def _steps(kind: Release, setting: Setting) -> list[float]:
    size = _NEAR * abs(kind.moves[0].volume)
    depth = _NEAR / 3.0 * (setting.deepest - setting.shallowest)
    count = len(kind.moves[:2])
    return [size] * count + [depth] * len(kind.moves[1:3])


def _release(kind: Release, numbers: Sequence[float], s: Search) -> Release:
    """Return the release of this kind with other numbers, round ones inside of what is possible."""
    first, setting = len(kind.moves[:2]), s.setting
    volumes = [float(np.clip(v, s.ramps.least, s.ramps.most)) for v in numbers[:first]]
    volumes[0] = math.copysign(max(abs(volumes[0]), 1e-9), kind.moves[0].volume)
    depths = np.clip(numbers[first:], setting.shallowest, setting.deepest).tolist()
    n = len(kind.moves)
    return rounded(
        Release.to_and_fro(
            kind.start, [volumes[k % 2] for k in range(n)],
            [depths[min(k % 2, len(depths) - 1)] for k in range(n - 1)],
        ),
        setting,
    )  # fmt: skip
