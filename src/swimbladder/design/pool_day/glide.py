"""An experiment under way, from the volume that leaves its rest to what ends the glide."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.pool_day.growing_log import (
    Changed,
    Cut,
    End,
    Ended,
    Event,
    Refused,
    Sample,
    Turned,
    Why,
)
from swimbladder.design.pool_day.rest import Rest, settled
from swimbladder.design.pool_day.rules import FEWEST, Rules
from swimbladder.design.pool_day.window import DEPTH, SMOOTH, TIME, VOLUME, Window

Array = NDArray[np.float64]

RECENT = 3.0  # s, over which a volume has to have left, or to stand still
_MOVED = 0.05  # m that the vehicle has to have gone before a change of volume is believed
_MOVING = 60.0  # s that a change of volume may take
_TURNING = 20.0  # s that one under way may take
_INSIDE = 0.1  # m from where a glide is over, that it has to have been before
_HALTED = (10.0, 0.015)  # s and m: a vehicle that turns round goes further in that time
_SLOWER = 0.3  # of the largest speed, below which something stops a vehicle that does not turn
_SLOW_SAMPLES = 3  # one after the other that have to say so
_SHORTEST = 3.0  # s of an experiment


class Glide:
    """What is known of a glide. `over` says that it is, or that it never was one."""

    def __init__(
        self, rules: Rules, window: Window, rest: Rest, *, since: float, limit: float, side: float
    ) -> None:
        """Begin with a volume that seems to have left its rest at the time `since` [s].

        limit: mean distance from it that counts as having left [m3]; side: its sign.
        """
        self.rules, self.rest = rules, rest
        self.over = False
        self.volume: float | None = None  # m3, at which the piston stands; None: not believed yet
        self._window, self._since, self._limit, self._side = window, since, limit, side
        self._now = since
        self._change = self._size = 0.0  # m3, of the first and of the last change
        self._extreme = 0.0  # m3, furthest from the rest before it is believed
        self._scatter = 0.0  # m3, about `volume`
        self._left: float | None = None  # s, when the piston moved again
        self._off = self._turns = 0
        self._fastest = 0.0  # m/s
        self._speeds: list[float] = []  # m/s, at the latest looks
        self._slow_samples = 0
        self._least, self._greatest = math.inf, -math.inf  # m, depths so far

    def feed(self, sample: Sample) -> list[Event]:
        """Look at a sample, the window's latest: has the vehicle arrived, has the piston moved?"""
        r, self._now = self.rules, sample.time
        depth = float(self._window.rows[-1, SMOOTH])
        self._least, self._greatest = min(self._least, depth), max(self._greatest, depth)
        if depth <= r.surface < self._greatest - _INSIDE:
            return self.end(End.TRAVEL if r.turns else End.SURFACE)
        if depth >= r.bottom > self._least + _INSIDE:
            return self.end(End.TRAVEL if r.turns else End.BOTTOM)
        if abs(depth - self.rest.depth) >= r.travel:
            return self.end(End.TRAVEL)
        if sample.time - self._since > r.longest:
            return self.end(End.LONG)
        if self.volume is not None and self._left is None:
            away = abs(sample.volume - self.volume)
            self._off = self._off + 1 if away > max(0.25 * abs(self._size), self._noise) else 0
            if self._off == 3:
                self._left = float(self._window.rows[-3, TIME])
                if not r.turns:
                    return self.end(End.PISTON)
        return []

    @property
    def _noise(self) -> float:
        return 6.0 * self._scatter

    def evaluate(self) -> list[Event]:
        """Look at the last seconds: does the volume stand, does the vehicle still go?"""
        if self.volume is None:
            return self._believe()
        if self._left is not None:
            return self._turn(self._left)
        recent = self._window.since(self._now - RECENT)
        if len(recent) < 3:
            return []
        if self._halted(recent):
            return self.end(End.STOPPED)
        if self._off == 0:  # follows a leak
            self.volume += 0.1 * (float(recent[:, VOLUME].mean()) - self.volume)
        return []

    def _believe(self) -> list[Event]:
        """Look whether a volume that seems to have left its rest stands, and the vehicle goes."""
        recent = self._window.since(self._now - RECENT)
        change = float(np.median(recent[:, VOLUME])) - self.rest.neutral
        if self._side * change < 0.5 * self._limit:  # it came back: the controller at work
            self.over = True
            return []
        if self._side * change > abs(self._extreme):
            self._extreme = change
        stands = len(recent) >= 4 and settled(recent[:, VOLUME], change)
        if self._now - self._since > _MOVING:
            self.over = True
            return [Refused(self._now, Why.STUCK if stands else Why.NOT_SETTLED, change)]
        gone = float(np.median(recent[:, DEPTH])) - self.rest.depth
        if not stands or -self._side * gone < _MOVED:
            return []
        self.volume = float(recent[:, VOLUME].mean())
        self._scatter = float(recent[:, VOLUME].std())
        self._change = self._size = change
        return [Changed(self._now, change, self.rest)]

    def begin_at(self, since: float, rest: Rest) -> None:
        """Say when the volume left [s], and how the minute before was, once that is known."""
        self._since, self.rest = since, rest

    def _turn(self, left: float) -> list[Event]:
        """Look whether the volume has come to stand elsewhere, or is controlled."""
        assert self.volume is not None
        recent = self._window.since(max(self._now - RECENT, left))
        if len(recent) < 4 or np.ptp(recent[:, TIME]) < 0.6 * RECENT:
            return []
        level = float(np.median(recent[:, VOLUME]))
        size = level - self.volume
        if settled(recent[:, VOLUME], size):
            self._turns += abs(size) > self.rules.change
            self.volume, self._size = level, size
            self._off, self._left, self._fastest = 0, None, 0.0
            self._scatter = float(recent[:, VOLUME].std())
            return [Turned(self._now, level - self.rest.neutral)]
        return self.end(End.PISTON) if self._now - left > _TURNING else []

    def _halted(self, recent: Array) -> bool:
        """Say whether something has stopped the vehicle: its own speed only grows, or turns."""
        if self._turns:
            longest, least = _HALTED
            part = self._window.since(self._now - longest)
            long = np.ptp(part[:, TIME]) > 0.9 * longest
            return bool(long and np.ptp(part[:, SMOOTH]) < least)
        t, z, third = recent[:, TIME], recent[:, SMOOTH], len(recent) // 3
        gone = float(np.median(z[-third:]) - np.median(z[:third]))
        speed = abs(gone / float(t[-third:].mean() - t[:third].mean()))
        slow = speed < _SLOWER * self._fastest and self._fastest > 20.0 * self.rules.rest_speed
        self._slow_samples = self._slow_samples + 1 if slow else 0
        if not slow:
            self._speeds = [*self._speeds[-4:], speed]
            self._fastest = max(self._fastest, float(np.median(self._speeds)))
        return self._slow_samples >= _SLOW_SAMPLES

    def end(self, end: End) -> list[Event]:
        """End the experiment: return it, or why it is none."""
        self.over = True
        rows, rest = self._window.rows.copy(), self.rest
        if self._left is not None:
            rows = rows[rows[:, TIME] < self._left]
        elif end is End.STOPPED:
            away = np.flatnonzero(np.abs(rows[:, SMOOTH] - rows[-1, SMOOTH]) > self.rules.margin)
            rows = rows[: int(away[-1]) + 1] if len(away) else rows[:0]
        rows = rows[rows[:, TIME] >= self._since - self.rules.before]
        glide = rows[rows[:, TIME] >= self._since]
        if self.volume is None:
            self.volume = float(rows[-1, VOLUME]) if len(rows) else rest.neutral
            self._change = self.volume - rest.neutral
            if abs(self._extreme) > 1.1 * abs(self._change):
                return [Refused(self._now, Why.NOT_SETTLED, self._extreme)]
        if len(glide) < FEWEST or np.ptp(glide[:, TIME]) < _SHORTEST:
            return [Refused(self._now, Why.FEW_SAMPLES, float(len(glide)))]
        gone = glide[:, SMOOTH] - rest.depth
        travel = float(gone[int(np.argmax(np.abs(gone)))])
        if abs(travel) < self.rules.least_travel:
            return [Refused(self._now, Why.SHORT, travel, end)]
        samples = tuple(Sample(*row) for row in rows[:, :3].tolist())
        cut = Cut(rest, samples, self._since, self._change, travel, end, self._turns)
        return [Ended(self._now, cut)]
