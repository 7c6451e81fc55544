"""The phases of the pool procedure, found in a log sample by sample.

The procedure of section 3.1 of the paper shows in depth and volume alone: a minute of rest, a
volume that leaves what held the vehicle there and stays, a glide, its end. `Segmenter.feed` takes a
sample and returns what it made happen; the same samples give the same events, whatever the clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.guide.events import Changed, Cut, End, Ended, Event, Ready, Refused, Sample, Why
from swimbladder.guide.rest import Rest, neutral_volume, settled, stillness
from swimbladder.guide.window import DEPTH, SMOOTH, TIME, VOLUME, Window

__all__ = ["Rules", "Segmenter"]

Array = NDArray[np.float64]


class Rules(NamedTuple):
    """By which numbers phases are told apart; the first three are those of control.protocol."""

    minute: float = 60.0  # s, over which rest is judged
    rest_speed: float = 5e-4  # m/s
    rest_distance: float = 0.02  # m
    still_speed: float = 2e-3  # m/s, up to which a release is taken, and said to be hasty
    change: float = 3e-6  # m3, least change of volume that is one
    surface: float = 0.1  # m, where a glide upward is over
    bottom: float = math.inf  # m, depth of the bottom
    margin: float = 0.05  # m, of the bottom that counts as reached
    travel: float = 3.0  # m, after which a glide is over
    least_travel: float = 0.3  # m, of a glide that tells something
    longest: float = 1200.0  # s, of a glide
    gap: float = 5.0  # s without a sample, which ends everything
    before: float = 3.0  # s of rest that an experiment's record begins with


_LOOK = 0.5  # s between two looks at the window
_RECENT = 3.0  # s, over which a volume has to have left, or to stand still
_SURE = 3.0  # standard deviations of the volume's mean over that time
_MOVED = 0.05  # m that the vehicle has to have gone before a change of volume is believed
_MOVING = 60.0  # s that a change of volume may take
_FEWEST = 12  # samples of an experiment
_SHORTEST = 3.0  # s of an experiment
_IDLE = 10.0  # s of standing volume under way, after which a glide from no rest is one


@dataclass
class _Glide:
    """An experiment under way, or a volume that seems to leave what held the rest."""

    rest: Rest
    since: float  # s, when the volume left
    limit: float  # m3, of the mean of a few seconds, that counts as having left
    side: float  # of the change
    level: float | None = None  # m3, at which the volume stands, once that is believed
    scatter: float = 0.0  # m3, about the level
    extreme: float = 0.0  # m3, furthest from neutral
    fastest: float = 0.0  # m/s
    off: int = 0  # samples that the volume is away from its level


class Segmenter:
    """Finds rest, changes of volume and glides in samples that come one by one."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.rest: Rest | None = None
        self.ready = False
        self._window = Window()
        self._glide: _Glide | None = None
        self._look = self._time = -math.inf
        self._stood: float | None = None  # m3, volume of the last glide, or of one told of

    @property
    def under_way(self) -> bool:
        """Whether an experiment is."""
        return self._glide is not None and self._glide.level is not None

    @property
    def speed(self) -> float:
        """Speed over the last minute, or what there is of it [m/s]; nan with too few samples."""
        rows = self._window.since(self._time - self.rules.minute)
        return stillness(rows[:, TIME], rows[:, SMOOTH])[0] if len(rows) >= _FEWEST else math.nan

    def feed(self, sample: Sample) -> list[Event]:
        """Return what a sample makes happen.

        One with a number missing, and one that is not later than those before, are left out.
        """
        if sample.time <= self._time or not all(map(math.isfinite, sample)):
            return []
        events: list[Event] = []
        if sample.time - self._time > self.rules.gap and math.isfinite(self._time):
            events += self.close(End.GAP)
        self._time = sample.time
        self._window.add(sample)
        due = sample.time - self._look >= _LOOK
        if due:
            self._look = sample.time
        if self._glide is None:
            return events + (self._seek() if due else [])
        events += self._follow(self._glide, sample)
        if self._glide is not None and due:
            look = self._believe if self._glide.level is None else self._watch
            events += look(self._glide)
        return events

    def close(self, end: End = End.LOG) -> list[Event]:
        """Return what the end of the log, or of what is known of it, makes happen."""
        g = self._glide
        if g is not None and g.level is not None:
            return self._over(g, end)
        self._forget()
        return []

    def _forget(self) -> None:
        self._window.clear()
        self._glide, self.ready, self.rest, self._look = None, False, None, -math.inf

    # Rest, and what leaves it

    def _seek(self) -> list[Event]:
        """Look at the last minute: is it rest, has the volume left it?"""
        r, now = self.rules, self._time
        self._window.forget_before(now - r.minute - 2.0 * _RECENT - r.before)
        left = self._left()
        if left is not None:
            self._glide = left
            return self._believe(left)
        was, self.rest = self.ready, self._rest(now)
        if self.rest is None or not _still(self.rest, r):
            self.ready = False
            return self._hasty()
        if abs(self.rest.speed) <= r.rest_speed and self.rest.spread <= r.rest_distance:
            self.ready = True
        return [Ready(now, self.rest)] if self.ready and not was else []

    def _minute(self, end: float) -> Array:
        """Return the samples of the minute up to a time [s]."""
        rows = self._window.rows
        first, last = np.searchsorted(
            rows[:, TIME], [end - self.rules.minute - 1e-9, end + 1e-9], side="right"
        )
        return rows[first:last]

    def _rest(self, end: float) -> Rest | None:
        """Return how the minute up to a time was; None where the log does not have it all."""
        rows = self._minute(end)
        if len(rows) < _FEWEST or end - rows[0, TIME] < 0.95 * self.rules.minute:
            return None
        speed, spread, depth = stillness(rows[:, TIME], rows[:, SMOOTH])
        return Rest(end, depth, speed, spread, *neutral_volume(rows[:, VOLUME]))

    def _left(self) -> _Glide | None:
        """Return the beginning of a glide where the volume has left what held a rest."""
        rows, now = self._window.rows, self._time
        recent = rows[int(np.searchsorted(rows[:, TIME], now - _RECENT, side="right")) :]
        if len(recent) < 3 or len(recent) == len(rows):
            return None
        away = float(recent[:, VOLUME].mean()) - float(rows[: -len(recent), VOLUME].mean())
        if abs(away) <= 0.8 * self.rules.change:
            return None
        rest = self._rest(float(rows[-1 - len(recent), TIME]))
        if rest is None or not _still(rest, self.rules):
            return None
        before = self._minute(rest.time)
        blocks = ((rest.time - before[:, TIME]) / _RECENT).astype(np.intp)
        means = np.bincount(blocks, before[:, VOLUME] - rest.neutral) / np.maximum(
            np.bincount(blocks), 1
        )
        limit = max(self.rules.change, _SURE * float(means.std()))
        away = float(np.median(recent[:, VOLUME])) - rest.neutral
        if abs(away) <= limit:
            return None
        return _Glide(rest, float(recent[0, TIME]), limit, math.copysign(1.0, away))

    def _believe(self, g: _Glide) -> list[Event]:
        """Look whether a volume that seems to have left its rest stands, and the vehicle goes."""
        recent = self._window.since(self._time - _RECENT)
        change = float(np.median(recent[:, VOLUME])) - g.rest.neutral
        if g.side * change < 0.5 * g.limit:  # it came back: the controller at work
            self._glide = None
            return []
        if g.side * change > abs(g.extreme):
            g.extreme = change
        gone = float(np.median(recent[:, DEPTH])) - g.rest.depth
        if self._time - g.since > _MOVING:
            self._forget()
            stands = settled(recent[:, VOLUME], change)
            return [Refused(self._time, Why.STUCK if stands else Why.NOT_SETTLED, change)]
        if len(recent) < 4 or not settled(recent[:, VOLUME], change) or -g.side * gone < _MOVED:
            return []
        g.level = float(recent[:, VOLUME].mean())
        g.scatter = float(recent[:, VOLUME].std())
        self._begin(g, change)
        return [Changed(g.since, change, g.rest)]

    def _begin(self, g: _Glide, change: float) -> None:
        """Say when the volume left, and how the minute before was; drop what is older."""
        rows = self._window.rows
        away = g.side * (rows[:, VOLUME] - g.rest.neutral)
        half = np.flatnonzero(away <= 0.5 * abs(change))
        at = int(half[-1]) if len(half) else 0
        near = np.flatnonzero(away[: at + 1] <= max(g.rest.jitter, 0.02 * abs(change)))
        g.since = float(rows[at, TIME])
        g.rest = self._rest(float(rows[near[-1] if len(near) else at, TIME])) or g.rest
        self._window.forget_before(g.since - self.rules.before)

    def _hasty(self) -> list[Event]:
        """Look for a glide that did not begin at rest, to tell of it."""
        r = self.rules
        recent = self._window.since(self._time - _IDLE)
        if len(recent) < _FEWEST or self._time - recent[0, TIME] < 0.9 * _IDLE:
            return []
        level, gone = recent[-1, VOLUME], recent[-1, SMOOTH] - recent[0, SMOOTH]
        if self._stood is not None and abs(level - self._stood) < r.change:
            return []
        if abs(gone) < r.least_travel or np.ptp(recent[:, VOLUME]) > 0.25 * r.change:
            return []
        self._stood = float(level)
        return [Refused(self._time, Why.NOT_AT_REST, float(gone / np.ptp(recent[:, TIME])))]

    # The glide, and what ends it

    def _follow(self, g: _Glide, sample: Sample) -> list[Event]:
        """Look at every sample: has the vehicle arrived, has the piston moved?"""
        r, depth = self.rules, sorted(self._window.rows[-3:, DEPTH].tolist())[-2:][0]
        if depth <= r.surface:
            return self._over(g, End.SURFACE)
        if depth >= r.bottom - r.margin:
            return self._over(g, End.BOTTOM)
        if abs(depth - g.rest.depth) >= r.travel:
            return self._over(g, End.TRAVEL)
        if sample.time - g.since > r.longest:
            return self._over(g, End.LONG)
        if g.level is not None:
            away, change = abs(sample.volume - g.level), abs(g.level - g.rest.neutral)
            g.off = g.off + 1 if away > max(0.25 * change, 6.0 * g.scatter) else 0
            if g.off >= 3:
                return self._over(g, End.PISTON)
        return []

    def _watch(self, g: _Glide) -> list[Event]:
        """Look at the last seconds of a glide: does the vehicle still go, does the volume leak?"""
        recent = self._window.since(self._time - _RECENT)
        third = len(recent) // 3
        if third < 1 or g.level is None:
            return []
        t, z = recent[:, TIME], recent[:, DEPTH]
        speed = abs(
            float((z[-third:].mean() - z[:third].mean()) / (t[-third:].mean() - t[:third].mean()))
        )
        g.fastest = max(g.fastest, speed)
        if speed < 0.3 * g.fastest and g.fastest > 20.0 * self.rules.rest_speed:
            return self._over(g, End.STOPPED)
        if g.off == 0:
            g.level += 0.1 * (float(recent[:, VOLUME].mean()) - g.level)
        return []

    def _over(self, g: _Glide, end: End) -> list[Event]:
        """End an experiment: return it, or why it is none."""
        rows = self._window.rows.copy()
        if end is End.PISTON:
            rows = rows[: -g.off]
        elif end is End.STOPPED:
            away = np.flatnonzero(np.abs(rows[:, SMOOTH] - rows[-1, SMOOTH]) > self.rules.margin)
            rows = rows[: int(away[-1]) + 1] if len(away) else rows[:0]
        rest, now = g.rest, self._time
        self._forget()
        glide = rows[rows[:, TIME] >= g.since]
        if g.level is None:
            g.level = float(rows[-1, VOLUME]) if len(rows) else rest.neutral
            if abs(g.extreme) > 1.1 * abs(g.level - rest.neutral):
                return [Refused(now, Why.NOT_SETTLED, g.extreme)]
            rows = rows[rows[:, TIME] >= g.since - self.rules.before]
        self._stood = g.level
        if len(glide) < _FEWEST or glide[-1, TIME] - glide[0, TIME] < _SHORTEST:
            return [Refused(now, Why.FEW_SAMPLES, float(len(glide)))]
        travel = float(np.median(glide[-3:, DEPTH])) - rest.depth
        if abs(travel) < self.rules.least_travel:
            return [Refused(now, Why.SHORT, travel, end)]
        samples = tuple(Sample(*row) for row in rows[:, :3].tolist())
        return [Ended(now, Cut(rest, samples, g.since, g.level - rest.neutral, travel, end))]


def _still(rest: Rest, rules: Rules) -> bool:
    """Say whether a release from there is taken, even if it is hasty."""
    return abs(rest.speed) <= rules.still_speed and rest.spread <= 2.0 * rules.rest_distance
