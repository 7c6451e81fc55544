"""The phases of the pool procedure, found in a log sample by sample.

The procedure of section 3.1 of the paper shows in depth and volume alone: a minute of rest, a
volume that leaves what held the vehicle there and stays, a glide, its end. `Segmenter.feed` takes a
sample and returns what it made happen; the same samples give the same events, whatever the clock.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.pool_day.glide import RECENT, Glide
from swimbladder.design.pool_day.growing_log import Changed, End, Event, Ready, Refused, Sample, Why
from swimbladder.design.pool_day.rest import Rest, neutral_volume, stillness
from swimbladder.design.pool_day.rules import FEWEST, Rules
from swimbladder.design.pool_day.window import SMOOTH, TIME, VOLUME, Window

Array = NDArray[np.float64]

_PERIOD = 0.5  # s between two evaluations of the window
_SURE = 3.0  # standard deviations of the volume's mean over a few seconds
_IDLE = 10.0  # s of standing volume under way, after which a glide from no rest is one


class Segmenter:
    """Finds rest, changes of volume and glides in samples that come one by one."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.rest: Rest | None = None
        self.ready = False
        self._window = Window()
        self._glide: Glide | None = None
        self._evaluated = self._time = -math.inf
        self._last_volume: float | None = None  # m3, volume of the last glide, or of one reported

    @property
    def under_way(self) -> bool:
        """Whether an experiment is."""
        return self._glide is not None and self._glide.volume is not None

    @property
    def speed(self) -> float:
        """Speed over the last minute, or what there is of it [m/s]; nan with too few samples."""
        rows = self._window.since(self._time - self.rules.minute)
        return stillness(rows[:, TIME], rows[:, SMOOTH])[0] if len(rows) >= FEWEST else math.nan

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
        due = sample.time - self._evaluated >= _PERIOD
        if due:
            self._evaluated = sample.time
        if self._glide is None:
            return events + (self._seek() if due else [])
        events += self._glide.feed(sample)
        if due and not self._glide.over:
            events += self._glide.evaluate()
        return events + self._after(self._glide, events)

    def close(self, end: End = End.LOG) -> list[Event]:
        """Return what the end of the log, or of what is known of it, makes happen."""
        events = self._glide.end(end) if self.under_way and self._glide is not None else []
        self._forget()
        return events

    def _forget(self) -> None:
        if self._glide is not None:
            self._last_volume = self._glide.volume
        self._window.clear()
        self._glide, self.ready, self.rest, self._evaluated = None, False, None, -math.inf

    def _after(self, g: Glide, events: list[Event]) -> list[Event]:
        """Do what follows from what a glide said."""
        if any(isinstance(event, Changed) for event in events):
            self._date(g)
        if g.over:
            if events:
                self._forget()
            else:  # it never was one: the rest goes on
                self._glide = None
        return []

    def _seek(self) -> list[Event]:
        """Look at the last minute: is it rest, has the volume left it?"""
        r, now = self.rules, self._time
        self._window.forget_before(now - r.minute - 2.0 * RECENT - r.before)
        left = self._left()
        if left is not None:
            self._glide = left
            events = left.feed(Sample(*self._window.rows[-1, :3].tolist())) or left.evaluate()
            return events + self._after(left, events)
        was, self.rest = self.ready, self._rest(now)
        if self.rest is None or not _still(self.rest, r):
            self.ready = False
            return self._hasty()
        if abs(self.rest.speed) <= r.rest_speed and 2.0 * self.rest.spread <= r.rest_distance:
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
        if len(rows) < FEWEST or end - rows[0, TIME] < 0.95 * self.rules.minute:
            return None
        speed, spread, depth = stillness(rows[:, TIME], rows[:, SMOOTH])
        return Rest(end, depth, speed, spread, *neutral_volume(rows[:, VOLUME]))

    def _left(self) -> Glide | None:
        """Return the beginning of a glide where the volume has left what held a rest."""
        rows, now = self._window.rows, self._time
        recent = self._window.since(now - RECENT)
        if len(recent) < 3 or len(recent) == len(rows):
            return None
        away = float(recent[:, VOLUME].mean()) - float(rows[: -len(recent), VOLUME].mean())
        if abs(away) <= 0.8 * self.rules.change:
            return None
        rest = self._rest(float(rows[-1 - len(recent), TIME]))
        if rest is None or not _still(rest, self.rules):
            return None
        before = self._minute(rest.time)
        blocks = ((rest.time - before[:, TIME]) / RECENT).astype(np.intp)
        count = np.maximum(np.bincount(blocks), 1)
        means = np.bincount(blocks, before[:, VOLUME] - rest.neutral) / count
        limit = max(self.rules.change, _SURE * float(means.std()))
        away = float(np.median(recent[:, VOLUME])) - rest.neutral
        if abs(away) <= limit:
            return None
        return Glide(
            self.rules, self._window, rest, since=float(recent[0, TIME]), limit=limit,
            side=math.copysign(1.0, away),
        )  # fmt: skip

    def _date(self, g: Glide) -> None:
        """Give a glide the time when the volume left, and the minute before; drop what is older."""
        assert g.volume is not None
        rows, change = self._window.rows, g.volume - g.rest.neutral
        padded = np.pad(rows[:, VOLUME], 1, mode="edge")  # medians of three: no single fault
        volume = np.median(np.lib.stride_tricks.sliding_window_view(padded, 3), axis=-1)
        away = math.copysign(1.0, change) * (volume - g.rest.neutral)
        half = np.flatnonzero(away <= 0.5 * abs(change))
        at = int(half[-1]) if len(half) else 0
        near = np.flatnonzero(away[: at + 1] <= max(g.rest.jitter, 0.02 * abs(change)))
        since = float(rows[at, TIME])
        rest = self._rest(float(rows[near[-1] if len(near) else at, TIME]))
        g.begin_at(since, rest or g.rest)
        self._window.forget_before(since - self.rules.before)

    def _hasty(self) -> list[Event]:
        """Look for a glide that did not begin at rest, to report it."""
        r = self.rules
        recent = self._window.since(self._time - _IDLE)
        if len(recent) < FEWEST or self._time - recent[0, TIME] < 0.9 * _IDLE:
            return []
        level, gone = recent[-1, VOLUME], recent[-1, SMOOTH] - recent[0, SMOOTH]
        if self._last_volume is not None and abs(level - self._last_volume) < r.change:
            return []
        if abs(gone) < r.least_travel or np.ptp(recent[:, VOLUME]) > 0.25 * r.change:
            return []
        self._last_volume = float(level)
        return [Refused(self._time, Why.NOT_AT_REST, float(gone / np.ptp(recent[:, TIME])))]


def _still(rest: Rest, rules: Rules) -> bool:
    """Say whether a release from there is taken, even if it is hasty."""
    return abs(rest.speed) <= rules.still_speed and rest.spread <= rules.rest_distance
