"""The search for the best set: a library on a grid, a choice from it, then off the grid.

A design chooses from releases (steps, and to and fro, of sizes and places on a grid) the most
informative set in the available time.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from swimbladder.design.experiments.conditions import (
    Conditions,
    Release,
    Setting,
    fisher_information,
    follow,
)
from swimbladder.design.plan import Move
from swimbladder.errors import InputError
from swimbladder.io.progress import Advance
from swimbladder.physics.arrays import Array

_SIZES = 7
_SECOND = (1.0, 0.5, 0.0)  # of the first volume, with the other sign; 0: coasting
_PLACES = (0.35, 0.5, 0.65)  # of the way through the range at which the volume is reversed
_HALVINGS = 12
_GRIDS = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)  # m, of depths that a person sets
_GRID = 50.0  # of these in the range, at least
_QUICKEST = 60  # samples of the shortest record
_SURE = 4.0  # deviations of the neutral volume, so that the vehicle leaves the way it should


def sizes(c: Conditions) -> list[float]:
    """Return sizes of volume changes [m3], from one that takes half the longest record to cross
    the range, to the largest that the stroke has and whose record is long enough.
    """
    setting, most = c.setting, min(c.ramps.most, -c.ramps.least)

    def duration(size: float) -> float:
        release = Release.to_and_fro(setting.deepest, [size], [])
        return follow(release, c.question.values, c).duration

    large = _where(duration, _QUICKEST * setting.sample_time, 1e-4 * most, most)
    least = _where(duration, 0.5 * setting.longest, 1e-4 * most, most)
    if math.isfinite(setting.neutral_std):
        least = max(least, _SURE * setting.neutral_std)
    found: list[float] = np.geomspace(min(least, 0.5 * large), large, _SIZES).tolist()
    return found


def _where(duration: Callable[[float], float], wanted: float, low: float, high: float) -> float:
    """Return the size at which a step takes the time wanted, or an end of the range of sizes."""
    if duration(high) >= wanted:
        return high
    if duration(low) <= wanted:
        return low
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if duration(middle) > wanted else (low, middle)
    return math.sqrt(low * high)


def releases(c: Conditions) -> list[list[Release]]:
    """Return the candidates, from rest near the bottom and near the surface, in families.

    Each release of a family goes on where the one before it ends.
    """
    setting, found = c.setting, []
    counts = sorted({n for n in (2, 4, 6, 8, setting.moves) if 2 <= n <= setting.moves})
    for size in sizes(c):
        for start, sign in ((setting.deepest, 1.0), (setting.shallowest, -1.0)):
            first = sign * size
            found.append([Release.to_and_fro(start, [first], [])])
            for place in _PLACES if setting.moves > 1 else ():
                turn = start - sign * place * (setting.deepest - setting.shallowest)
                for second in _SECOND:
                    back, lengths = -second * first, counts if second else [2]
                    family = [
                        Release.to_and_fro(start, ([first, back] * n)[:n], [turn] * (n - 1))
                        for n in lengths
                    ]
                    found.append(family)
    return [[rounded(release, setting) for release in family] for family in found]


def rounded(release: Release, setting: Setting) -> Release:
    """Return a release with volumes and depths of moves that a person can set."""
    span = setting.deepest - setting.shallowest
    grid = next((g for g in _GRIDS if g <= span / _GRID), _GRIDS[-1])
    digits = math.floor(math.log10(abs(release.moves[0].volume)))
    step = 10.0 ** (digits - 1)  # two digits of the first volume
    moves = []
    for move in release.moves:
        place = move.depth
        if place is not None:
            inside = min(max(place, setting.shallowest + grid), setting.deepest - grid)
            place = round(grid * round(inside / grid), 6)
        volume = float(f"{step * round(move.volume / step):.6g}")
        moves.append(Move(volume=volume, depth=place, going=move.going))
    return release._replace(moves=tuple(moves))


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
            return np.asarray(0.5 * np.linalg.slogdet(C)[1] / len(at))
        variance = np.diagonal(C, axis1=-2, axis2=-1)
        one = variance.max(axis=-1) if self.kind == "largest" else variance.mean(axis=-1)
        return np.asarray(0.5 * np.log(one))


def criterion(text: str, names: Sequence[str]) -> Criterion:
    """Return the criterion of that name; names of parameters ask for the largest among them.

    Raises InputError for any other text.
    """
    if text in ("largest", "D", "A"):
        return Criterion(kind=text, among=tuple(range(len(names))))
    wanted = [part.strip() for part in text.split(",")]
    if not all(part in names for part in wanted):
        remedy = f"Choose largest, D or A, or name parameters: {', '.join(names)}"
        raise InputError("no such criterion", field="criterion", value=text, remedy=remedy)
    among = tuple(names.index(part) for part in dict.fromkeys(wanted))
    return Criterion(kind="largest", among=among)


@dataclass(frozen=True, kw_only=True)
class Table:
    """Information of candidates [c, d, q, q] about each of d vehicles, as `fisher_information` has
    it, of p parameters and what all records share, and the pool time that they take [c] in s.
    """

    gain: Array
    cost: Array
    prior: Array  # [q, q]
    parameters: int  # p
    judge: Criterion

    def value(self, gain: Array) -> Array:
        """Return the criterion, averaged over the vehicles, of sums of records [..., d, q, q]."""
        p = self.parameters
        C = np.asarray(np.linalg.inv(gain + self.prior + _UNKNOWN * np.eye(len(self.prior))), float)
        return np.asarray(self.judge(C[..., :p, :p]).mean(axis=-1))

    @property
    def whole(self) -> Table:
        """The same, judged by the whole ellipsoid."""
        return replace(self, judge=Criterion(kind="D", among=tuple(range(self.parameters))))

    def of(self, chosen: Sequence[int]) -> float:
        """Return the criterion of a set of candidates."""
        return float(self.value(self.gain[list(chosen)].sum(axis=0)))

    def with_each(self, chosen: Sequence[int]) -> Array:
        """Return the criterion of a set and each of the candidates added to it [c]."""
        return self.value(self.gain[list(chosen)].sum(axis=0) + self.gain)


def choose(table: Table, budget: float, most: int) -> list[int]:
    """Return the candidates to run, some perhaps more than once, within a pool time [s].

    Greedy by what is gained per time, once for the criterion and once for the whole ellipsoid,
    which also counts where one candidate alone is no answer; then exchanges (Fedorov) of up to two
    for another until none helps. most: releases. Raises InputError where the time is too short for
    any.
    """
    if not (table.cost <= budget).any():
        remedy = f"Give at least {table.cost.min() / 60.0:.1f} min, or a shorter `settling=`"
        what, value = "the time is too short for one release", round(budget)
        raise InputError(what, field="pool_time", value=value, unit="s", remedy=remedy)
    found = []
    for guide in (table, table.whole):
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
    left: list[int] = list(chosen)
    order: list[int] = []
    while left:
        values = table.with_each(order)[left]
        if values.min() > _LITTLE:  # nothing is known of some parameter yet, whichever is next
            values = table.whole.with_each(order)[left]
        order.append(left.pop(int(np.argmin(values))))
    return order


_TRIES = 40  # of sizes and places, for each kind of release in the set
_NEAR = 0.1  # first step of these: of a volume, of a third of the range
_LATE = 20.0  # of the criterion, for a set that takes twice its time
_ALIKE = 0.02  # of the criterion, that fewer kinds of release may cost


class _Tabulated(NamedTuple):
    gain: Array  # [d, q, q]
    cost: float  # s, of the vehicle as given or on average, whichever is longer
    complete: bool  # in any of the vehicles


@dataclass(frozen=True, kw_only=True)
class Search:
    """What candidates are judged by, and what is known of them so far."""

    conditions: Conditions
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
        found = zip(*(self.of(release) for release in candidates), strict=True)
        gain, cost, _ = (np.array(values) for values in found)
        question = self.conditions.question
        prior, p = question.prior(self.conditions.setting), len(question.names)
        return Table(gain=gain, cost=cost, prior=prior, parameters=p, judge=self.judge)

    def learn(self, family: Sequence[Release]) -> None:
        """Find a family's information: where a release cannot end, neither can one that goes on."""
        for before, release in zip([None, *family], family, strict=False):
            if before is not None and not self.of(before).complete:
                self.known[release] = self.of(before)
            self.of(release)

    def _find(self, release: Release) -> _Tabulated:
        c = self.conditions
        given, *flights = (follow(release, v, c) for v in (c.question.values, *self.vehicles))
        each = zip(flights, self.vehicles, strict=True)
        gain = [fisher_information(*of, c, central=False) for of in each]
        time = max(sum(f.duration / len(flights) for f in flights), given.duration)
        complete = any(f.complete for f in (given, *flights))
        return _Tabulated(np.array(gain), c.setting.settling + time, complete)


def search(s: Search, budget: float, most: int, advance: Advance) -> list[Release]:
    """Return the releases to run, in order, within a pool time [s] and a number of releases.

    advance: called with the share of the work done since last called. Raises InputError where the
    time is too short for any release.
    """
    families = releases(s.conditions)
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
    vehicles = (s.conditions.question.values, *s.vehicles)
    happened = max(len(follow(release, values, s.conditions).moved) for values in vehicles)
    return release._replace(moves=release.moves[:happened])


def _refined(
    s: Search, kind: Release, count: int, others: Sequence[Release], budget: float
) -> Release:
    """Return a release of the same kind, better in `count` places beside the others."""
    setting, table = s.conditions.setting, s.table([*others, kind])
    gain, time = (of[:-1].sum(axis=0) for of in (table.gain, table.cost))

    def worth(release: Release) -> float:
        t = s.of(release)
        late = max((time + count * t.cost) / budget - 1.0, 0.0)
        return float(table.value(gain + count * t.gain) + _LATE * late)

    volumes = [move.volume for move in kind.moves[:2]]
    depths = [move.depth for move in kind.moves[1:3] if move.depth is not None]
    start = np.array(volumes + depths)
    size = [_NEAR * abs(volumes[0])] * len(volumes)
    size += [_NEAR / 3.0 * (setting.deepest - setting.shallowest)] * len(depths)
    simplex = np.concatenate([start[None], start + np.diag(size)])

    def of_numbers(x: Array) -> float:
        return worth(_release(kind, x.tolist(), s.conditions))

    found = minimize(
        of_numbers,
        start,
        method="Nelder-Mead",
        options={"maxfev": _TRIES, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-3},
    )
    best = _release(kind, found.x.tolist(), s.conditions)
    return best if worth(best) < worth(kind) else kind


def _release(kind: Release, numbers: Sequence[float], c: Conditions) -> Release:
    """Return the release of this kind with other numbers, round ones inside of what is possible."""
    first, setting = len(kind.moves[:2]), c.setting
    volumes = np.clip(numbers[:first], c.ramps.least, c.ramps.most).tolist()
    volumes[0] = math.copysign(max(abs(volumes[0]), 1e-9), kind.moves[0].volume)
    depths = np.clip(numbers[first:], setting.shallowest, setting.deepest).tolist()
    n = len(kind.moves)
    each, places = [volumes[k % 2] for k in range(n)], range(n - 1)
    at = [depths[min(k % 2, len(depths) - 1)] for k in places]
    return rounded(Release.to_and_fro(kind.start, each, at), setting)
