"""The twin of ``swb_controller``: a law called by a counter of ticks, its command limited.

The C is ``templates/swb_controller.c.j2``; both hold the last command while none is to be had.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from swimbladder.control.law import Law, Measurement

__all__ = ["ControllerTwin", "wait_in_ticks"]

_MOST_TICKS = 1_000_000


def wait_in_ticks(next_s: Any, tick_s: Any) -> int:
    """Return how many whole ticks there are until a law's next call, one at least.

    next_s, tick_s: float32 [s]. A thousandth of a tick is rounding.
    """
    with np.errstate(all="ignore"):
        ticks = np.float32(next_s) / np.float32(tick_s)
    if not ticks > np.float32(1.001):
        return 1
    if ticks >= np.float32(_MOST_TICKS):
        return _MOST_TICKS
    whole = int(ticks)
    return whole + 1 if ticks - np.float32(whole) > np.float32(0.001) else whole


class ControllerTwin:
    """What the microcontroller does at every tick, in float32.

    law: a law's `twin`; low, high: limits of the command; first: the command until there is one.
    """

    def __init__(
        self, law: Law, parameters: Any, *, tick_s: float, low: float, high: float,
        first: float = 0.0,
    ) -> None:  # fmt: skip
        self.law, self.parameters = law, parameters
        self.tick_s = np.float32(tick_s)
        self.low, self.high = np.float32(low), np.float32(high)
        self.command = np.float32(first)
        self.state: Any = None
        self.ticks = 0
        self.waiting = 0
        self.missed = 0

    def tick(self, depth: float, volume: float, reference: float) -> Any:
        """Return the command from this tick on, of measurements at it [m, m3] and the depth asked.

        Where the law's command or new state is not finite, only `missed` is changed: it counts
        these.
        """
        if self.waiting == 0:
            time: Any = np.float32(self.ticks) * self.tick_s
            seen: tuple[Any, ...] = (time, np.float32(depth), np.float32(volume))
            self._call(Measurement(*seen), np.float32(reference))
        self.waiting -= 1
        self.ticks += 1
        return self.command

    def sleep(self, ticks: int) -> int:
        """Pass over ticks in which the command held, `waiting` at most; return how many."""
        slept = min(ticks, self.waiting)
        self.waiting -= slept
        self.ticks += slept
        return slept

    def _call(self, seen: Measurement, reference: Any) -> None:
        self.waiting = 1
        state = self.state
        if state is None:
            if not all(map(math.isfinite, (seen.depth, seen.volume, reference))):
                self.missed += 1
                return
            state = self.law.initial(self.parameters, seen, reference)
        command, after, next_s = self.law.step(self.parameters, state, seen, reference)
        if not all(map(math.isfinite, (command, *after))):
            self.missed += 1
            return
        self.state = after
        self.missed = 0
        self.command = min(max(command, self.low), self.high)
        self.waiting = wait_in_ticks(next_s, self.tick_s)
