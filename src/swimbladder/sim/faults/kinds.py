"""The catalogue of faults: what may fail, how badly, and how it is drawn.

The ranges are ours: from what a good pre-dive test would still let pass up to what loses most
vehicles. None is fitted to a supervisor or a law.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from swimbladder.vehicle import Vehicle


class Fault(IntEnum):
    """Number of a kind of fault in the kernel; `KINDS` says what each is."""

    DEPTH_NAN = 1
    DEPTH_DROPOUTS = 2
    DEPTH_STUCK = 3
    DEPTH_RANGE = 4
    DEPTH_LATE = 5
    DEPTH_OLD = 6
    DEPTH_JUMP = 7
    DEPTH_DRIFT = 8
    DEPTH_SCALE = 9
    DEPTH_NOISE = 10
    VOLUME_NAN = 11
    VOLUME_STUCK = 12
    VOLUME_DRIFT = 13
    STALLED = 14
    SLOW = 15
    WEAK = 16
    REVERSED = 17
    BLOCKED_OUT = 18
    BLOCKED_IN = 19
    RUNS_ON = 20
    BATTERY_DECLINE = 21
    BATTERY_SAG = 22
    BATTERY_DROP = 23
    BATTERY_CELL = 24
    BATTERY_DEAD = 25
    TICKS_LOST = 26
    PAUSE = 27
    RESETS = 28
    HANG = 29
    LEAK_SMALL = 30
    LEAK_LARGE = 31
    SWITCH_OPEN = 32
    SWITCH_CLOSED = 33


@dataclass(frozen=True, kw_only=True)
class Range:
    """What a severity is drawn from: evenly, or evenly in its logarithm; of either sign or not."""

    least: float
    most: float
    unit: str
    log: bool = True
    either: bool = False

    def draw(self, random: np.random.Generator) -> float:
        """Return one severity, in SI."""
        share = random.random()
        sign = -1.0 if random.random() < 0.5 and self.either else 1.0
        if self.log:
            return float(sign * self.least * (self.most / self.least) ** share)
        return float(sign * (self.least + (self.most - self.least) * share))


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of fault: its name in tables, its family, what it does and its severities."""

    name: str
    family: str
    words: str
    first: Range | None = None
    second: Range | None = None
    may_end: bool = True  # one in seven lasts for 5 to 300 s only
    motor: bool = False  # there is none such where the actuator takes a volume
    switch: bool = False  # there is none such without limit switches


FAMILIES = ("sensor", "actuator", "battery", "timing", "leak")
_SHARE = Range(least=0.5, most=0.995, unit="", log=False)

KINDS: Mapping[Fault, Kind] = {
    Fault.DEPTH_NAN: Kind(
        name="depth NaN", family="sensor", words="no depth comes any more (NaN)",
    ),
    Fault.DEPTH_DROPOUTS: Kind(
        name="depth dropouts", family="sensor", words="this share of depths is NaN",
        first=_SHARE,
    ),
    Fault.DEPTH_STUCK: Kind(
        name="depth stuck", family="sensor", words="the depth stays at its last value",
    ),
    Fault.DEPTH_RANGE: Kind(
        name="depth out of range", family="sensor", words="the depth reads a value that cannot be",
        first=Range(least=150.0, most=1e5, unit="m", either=True),
    ),
    Fault.DEPTH_LATE: Kind(
        name="depth late", family="sensor",
        words="each depth comes late; the driver says so (half of them) or does not know",
        first=Range(least=3.0, most=100.0, unit="s"),
        second=Range(least=0.0, most=1.0, unit="", log=False),
    ),
    Fault.DEPTH_OLD: Kind(
        name="depth old", family="sensor",
        words="a new depth comes only after so long; the driver gives the old one and its age",
        first=Range(least=10.0, most=600.0, unit="s"),
    ),
    Fault.DEPTH_JUMP: Kind(
        name="depth jump", family="sensor", words="the depth jumps and stays off by so much",
        first=Range(least=5.0, most=40.0, unit="m", either=True),
    ),
    Fault.DEPTH_DRIFT: Kind(
        name="depth drift", family="sensor", words="the depth drifts away at this rate",
        first=Range(least=0.02, most=0.5, unit="m/s", either=True),
    ),
    Fault.DEPTH_SCALE: Kind(
        name="depth wrong scale", family="sensor", words="the depth is off by this share of it",
        first=Range(least=0.2, most=0.9, unit="", either=True),
    ),
    Fault.DEPTH_NOISE: Kind(
        name="depth noise burst", family="sensor", words="white noise of this deviation is added",
        first=Range(least=1.0, most=10.0, unit="m"),
    ),
    Fault.VOLUME_NAN: Kind(
        name="volume NaN", family="sensor", words="no volume comes any more (NaN)",
    ),
    Fault.VOLUME_STUCK: Kind(
        name="volume stuck", family="sensor", words="the volume stays at its last value",
    ),
    Fault.VOLUME_DRIFT: Kind(
        name="volume drift", family="sensor",
        words="the volume drifts away at this rate, in strokes (both halves) a second",
        first=Range(least=1e-3, most=0.1, unit="1/s", either=True),
    ),
    Fault.STALLED: Kind(
        name="actuator stalled", family="actuator", words="the actuator does not move",
    ),
    Fault.SLOW: Kind(
        name="actuator slow", family="actuator", words="the actuator has this share of its speed",
        first=Range(least=0.002, most=0.05, unit=""),
    ),
    Fault.WEAK: Kind(
        name="actuator weak at depth", family="actuator", motor=True, may_end=False,
        words="the load of a metre of depth on the motor is so many times as large",
        first=Range(least=2.0, most=12.0, unit=""),
    ),
    Fault.REVERSED: Kind(
        name="actuator reversed", family="actuator", words="the actuator goes the wrong way",
    ),
    Fault.BLOCKED_OUT: Kind(
        name="blocked outward", family="actuator", may_end=False,
        words="the actuator cannot go further out than this share of the stroke from where it is",
        first=Range(least=1e-3, most=0.3, unit=""),
    ),
    Fault.BLOCKED_IN: Kind(
        name="blocked inward", family="actuator", may_end=False,
        words="the actuator cannot go further in than this share of the stroke from where it is",
        first=Range(least=1e-3, most=0.3, unit=""),
    ),
    Fault.RUNS_ON: Kind(
        name="actuator runs on", family="actuator", may_end=False,
        words="the driver stays fully on in the direction it last had, for so long",
        first=Range(least=3.0, most=300.0, unit="s"),
    ),
    Fault.BATTERY_DECLINE: Kind(
        name="battery declines", family="battery", motor=True, may_end=False,
        words="the battery's voltage falls steadily, by this share of it a second",
        first=Range(least=3e-4, most=1e-2, unit="1/s"),
    ),
    Fault.BATTERY_SAG: Kind(
        name="battery sags", family="battery", motor=True, may_end=False,
        words="the battery's resistance grows to this share of the motor's",
        first=Range(least=0.4, most=1.0, unit=""),
    ),
    Fault.BATTERY_DROP: Kind(
        name="battery drops", family="battery", motor=True,
        words="the battery's voltage falls by this share at once",
        first=Range(least=0.2, most=0.8, unit="", log=False),
    ),
    Fault.BATTERY_CELL: Kind(
        name="dying cell", family="battery", motor=True, may_end=False,
        words="the battery loses this share of its voltage whenever the motor is driven",
        first=Range(least=0.15, most=0.7, unit="", log=False),
    ),
    Fault.BATTERY_DEAD: Kind(
        name="battery dead", family="battery", motor=True, may_end=False,
        words="the battery's voltage falls to nothing within so long",
        first=Range(least=10.0, most=600.0, unit="s"),
    ),
    Fault.TICKS_LOST: Kind(
        name="ticks lost", family="timing", words="this share of ticks is lost", first=_SHARE,
    ),
    Fault.PAUSE: Kind(
        name="pauses", family="timing",
        words="the board does nothing for so long (its watchdog would end more), again and again",
        first=Range(least=5.0, most=60.0, unit="s"),
        second=Range(least=5.0, most=600.0, unit="s"),
    ),
    Fault.RESETS: Kind(
        name="board resets", family="timing",
        words="the board is reset, again and again after so long",
        first=Range(least=3.0, most=60.0, unit="s"),
    ),
    Fault.HANG: Kind(
        name="law hangs", family="timing",
        words="the law never comes back; the watchdog resets the board after so long",
        first=Range(least=1.0, most=16.0, unit="s"),
    ),
    Fault.LEAK_SMALL: Kind(
        name="small leak", family="leak", may_end=False, words="water comes in, a little",
        first=Range(least=2e-6 / 60.0, most=20e-6 / 60.0, unit="m3/s"),
    ),
    Fault.LEAK_LARGE: Kind(
        name="large leak", family="leak", may_end=False, words="water comes in, much",
        first=Range(least=20e-6 / 60.0, most=300e-6 / 60.0, unit="m3/s"),
    ),
    Fault.SWITCH_OPEN: Kind(
        name="limit switch open", family="actuator", motor=True, switch=True,
        words="a limit switch cuts its direction everywhere; below 0.5 the inner, else the outer",
        first=Range(least=0.0, most=1.0, unit="", log=False),
    ),
    Fault.SWITCH_CLOSED: Kind(
        name="limit switch closed", family="actuator", motor=True, switch=True,
        words="a limit switch never cuts; below 0.5 the inner, else the outer",
        first=Range(least=0.0, most=1.0, unit="", log=False),
    ),
}  # fmt: skip

_ENDS, _LASTS = 0.15, Range(least=5.0, most=300.0, unit="s")


def kinds_of(vehicle: Vehicle) -> tuple[Fault, ...]:
    """Return the kinds of faults that a vehicle can have."""
    switches = vehicle.stroke.switch_margin is not None
    return tuple(
        fault
        for fault, kind in KINDS.items()
        if (vehicle.voltage_driven or not kind.motor) and (switches or not kind.switch)
    )


def draw_fault(fault: Fault, random: np.random.Generator) -> tuple[float, float, float]:
    """Return (severity, second severity, how long it lasts [s]) of a kind of fault."""
    kind = KINDS[fault]
    first = kind.first.draw(random) if kind.first is not None else 0.0
    second = kind.second.draw(random) if kind.second is not None else 0.0
    ends, lasts = random.random() < _ENDS, _LASTS.draw(random)
    return first, second, lasts if ends and kind.may_end else math.inf
