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

from swimbladder.vehicle import DatasheetPump, PumpAndValve, Vehicle


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
    VALVE_SHUT = 34
    VALVE_OPEN = 35
    VALVE_LEAKS = 36
    DRIVER_LOST = 37


class On(IntEnum):
    """What a fault acts on; the kernels hold a factor and a summand for each, see `Op`."""

    DEPTH = 0  # m, that the sensor measures
    NOISE = 1  # m, 1 sigma, in the depth beyond its own
    READS = 2  # m, in the place of the depth
    LATE = 3  # s, by which it comes late; factor 0: the driver says so
    OLD = 4  # s, after which a new one comes; factor 0: none does
    DROPOUTS = 5  # share of depths that is not measured
    DEPTH_MISSING = 6
    VOLUME = 7  # strokes, that the sensor measures
    VOLUME_OLD = 8
    VOLUME_MISSING = 9
    SPEED = 10  # of the actuator; of a pump, what it delivers
    LOAD = 11  # of a metre of depth, on the motor
    BLOCK_OUT = 12  # strokes from where the actuator is
    BLOCK_IN = 13
    COMMAND = 14  # as the driver takes it; summand: all in the direction that it last had
    SWITCH_IN = 15  # where limit switches cut: 1 everywhere, -1 nowhere
    SWITCH_OUT = 16
    VALVE = 17  # what valves let in that are open
    OPEN = 18  # share of it that comes in through one that is shut
    CHARGE = 19  # the battery's open-circuit voltage
    CELL = 20  # the same, while the motor is driven
    SAG = 21  # the battery's resistance over the motor's
    TICKS = 22  # share that is lost
    PAUSE = 23
    RESET = 24
    HANG = 25  # s
    WATER = 26  # m3/s that come in


class Op(IntEnum):
    """How: what was a x + b becomes f (a x + b) + s by a factor f and a summand s."""

    PLUS = 0  # s is the severity
    PLUS_RATE = 1  # times the time since it began
    TIMES = 2  # f is the severity
    MORE = 3  # 1 and the severity
    LESS = 4  # 1 less the severity
    FALLS = 5  # 1 less the severity times the time since it began
    DIES = 6  # 1 less that time over the severity
    OFF = 7  # 0
    TURNS = 8  # -1
    RUNS = 9  # 0, with an s of 1, for as long as the severity
    SAYS = 10  # 0 where the second severity is above 0.5, with s as PLUS
    ONCE = 11  # 0 where it begins, with s as PLUS
    DUTY = 12  # 0 for the severity [s], 1 for the second one, and so on
    EVERY = 13  # 0 each time so long [s] has passed
    CUTS = 14  # s is 1, on the next thing in `On` from a severity of 0.5 on
    NEVER_CUTS = 15  # the same, -1


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
    on: On
    op: Op
    first: Range | None = None
    second: Range | None = None
    may_end: bool = True  # one in seven lasts for 5 to 300 s only
    needs: str = ""  # what a vehicle has to have, of `parts_of`


MOTOR, SWITCHES, VALVE = "a motor on a battery", "limit switches", "a pump and a valve"
VOLUME, TURNS = "a measured volume", "a drive that can turn the other way"
FAMILIES = ("sensor", "actuator", "battery", "timing", "leak")
_SHARE = Range(least=0.5, most=0.995, unit="", log=False)

KINDS: Mapping[Fault, Kind] = {
    Fault.DEPTH_NAN: Kind(
        name="depth NaN", family="sensor", on=On.DEPTH_MISSING, op=Op.OFF,
        words="no depth comes any more (NaN)",
    ),
    Fault.DEPTH_DROPOUTS: Kind(
        name="depth dropouts", family="sensor", on=On.DROPOUTS, op=Op.PLUS,
        words="this share of depths is NaN",
        first=_SHARE,
    ),
    Fault.DEPTH_STUCK: Kind(
        name="depth stuck", family="sensor", on=On.OLD, op=Op.OFF,
        words="the depth stays at its last value",
    ),
    Fault.DEPTH_RANGE: Kind(
        name="depth out of range", family="sensor", on=On.READS, op=Op.PLUS,
        words="the depth reads a value that cannot be",
        first=Range(least=150.0, most=1e5, unit="m", either=True),
    ),
    Fault.DEPTH_LATE: Kind(
        name="depth late", family="sensor", on=On.LATE, op=Op.SAYS,
        words="each depth comes late; the driver says so (half of them) or does not know",
        first=Range(least=3.0, most=100.0, unit="s"),
        second=Range(least=0.0, most=1.0, unit="", log=False),
    ),
    Fault.DEPTH_OLD: Kind(
        name="depth old", family="sensor", on=On.OLD, op=Op.PLUS,
        words="a new depth comes only after so long; the driver gives the old one and its age",
        first=Range(least=10.0, most=600.0, unit="s"),
    ),
    Fault.DEPTH_JUMP: Kind(
        name="depth jump", family="sensor", on=On.DEPTH, op=Op.PLUS,
        words="the depth jumps and stays off by so much",
        first=Range(least=5.0, most=40.0, unit="m", either=True),
    ),
    Fault.DEPTH_DRIFT: Kind(
        name="depth drift", family="sensor", on=On.DEPTH, op=Op.PLUS_RATE,
        words="the depth drifts away at this rate",
        first=Range(least=0.02, most=0.5, unit="m/s", either=True),
    ),
    Fault.DEPTH_SCALE: Kind(
        name="depth wrong scale", family="sensor", on=On.DEPTH, op=Op.MORE,
        words="the depth is off by this share of it",
        first=Range(least=0.2, most=0.9, unit="", either=True),
    ),
    Fault.DEPTH_NOISE: Kind(
        name="depth noise burst", family="sensor", on=On.NOISE, op=Op.PLUS,
        words="white noise of this deviation is added",
        first=Range(least=1.0, most=10.0, unit="m"),
    ),
    Fault.VOLUME_NAN: Kind(
        name="volume NaN", family="sensor", on=On.VOLUME_MISSING, op=Op.OFF, needs=VOLUME,
        words="no volume comes any more (NaN)",
    ),
    Fault.VOLUME_STUCK: Kind(
        name="volume stuck", family="sensor", on=On.VOLUME_OLD, op=Op.OFF, needs=VOLUME,
        words="the volume stays at its last value",
    ),
    Fault.VOLUME_DRIFT: Kind(
        name="volume drift", family="sensor", on=On.VOLUME, op=Op.PLUS_RATE, needs=VOLUME,
        words="the volume drifts away at this rate, in strokes (both halves) a second",
        first=Range(least=1e-3, most=0.1, unit="1/s", either=True),
    ),
    Fault.STALLED: Kind(
        name="actuator stalled", family="actuator", on=On.SPEED, op=Op.OFF,
        words="the actuator does not move",
    ),
    Fault.SLOW: Kind(
        name="actuator slow", family="actuator", on=On.SPEED, op=Op.TIMES,
        words="the actuator has this share of its speed",
        first=Range(least=0.002, most=0.05, unit=""),
    ),
    Fault.WEAK: Kind(
        name="actuator weak at depth", family="actuator", on=On.LOAD, op=Op.TIMES,
        needs=MOTOR, may_end=False,
        words="the load of a metre of depth on the motor is so many times as large",
        first=Range(least=2.0, most=12.0, unit=""),
    ),
    Fault.REVERSED: Kind(
        name="actuator reversed", family="actuator", on=On.COMMAND, op=Op.TURNS, needs=TURNS,
        words="the actuator goes the wrong way",
    ),
    Fault.BLOCKED_OUT: Kind(
        name="blocked outward", family="actuator", on=On.BLOCK_OUT, op=Op.ONCE,
        may_end=False,
        words="the actuator cannot go further out than this share of the stroke from where it is",
        first=Range(least=1e-3, most=0.3, unit=""),
    ),
    Fault.BLOCKED_IN: Kind(
        name="blocked inward", family="actuator", on=On.BLOCK_IN, op=Op.ONCE,
        may_end=False,
        words="the actuator cannot go further in than this share of the stroke from where it is",
        first=Range(least=1e-3, most=0.3, unit=""),
    ),
    Fault.RUNS_ON: Kind(
        name="actuator runs on", family="actuator", on=On.COMMAND, op=Op.RUNS,
        may_end=False,
        words="the driver stays fully on in the direction it last had, for so long",
        first=Range(least=3.0, most=300.0, unit="s"),
    ),
    Fault.BATTERY_DECLINE: Kind(
        name="battery declines", family="battery", on=On.CHARGE, op=Op.FALLS,
        needs=MOTOR, may_end=False,
        words="the battery's voltage falls steadily, by this share of it a second",
        first=Range(least=3e-4, most=1e-2, unit="1/s"),
    ),
    Fault.BATTERY_SAG: Kind(
        name="battery sags", family="battery", on=On.SAG, op=Op.PLUS,
        needs=MOTOR, may_end=False,
        words="the battery's resistance grows to this share of the motor's",
        first=Range(least=0.4, most=1.0, unit=""),
    ),
    Fault.BATTERY_DROP: Kind(
        name="battery drops", family="battery", on=On.CHARGE, op=Op.LESS,
        needs=MOTOR,
        words="the battery's voltage falls by this share at once",
        first=Range(least=0.2, most=0.8, unit="", log=False),
    ),
    Fault.BATTERY_CELL: Kind(
        name="dying cell", family="battery", on=On.CELL, op=Op.LESS,
        needs=MOTOR, may_end=False,
        words="the battery loses this share of its voltage whenever the motor is driven",
        first=Range(least=0.15, most=0.7, unit="", log=False),
    ),
    Fault.BATTERY_DEAD: Kind(
        name="battery dead", family="battery", on=On.CHARGE, op=Op.DIES,
        needs=MOTOR, may_end=False,
        words="the battery's voltage falls to nothing within so long",
        first=Range(least=10.0, most=600.0, unit="s"),
    ),
    Fault.TICKS_LOST: Kind(
        name="ticks lost", family="timing", on=On.TICKS, op=Op.PLUS,
        words="this share of ticks is lost", first=_SHARE,
    ),
    Fault.PAUSE: Kind(
        name="pauses", family="timing", on=On.PAUSE, op=Op.DUTY,
        words="the board does nothing for so long (its watchdog would end more), again and again",
        first=Range(least=5.0, most=60.0, unit="s"),
        second=Range(least=5.0, most=600.0, unit="s"),
    ),
    Fault.RESETS: Kind(
        name="board resets", family="timing", on=On.RESET, op=Op.EVERY,
        words="the board is reset, again and again after so long",
        first=Range(least=3.0, most=60.0, unit="s"),
    ),
    Fault.HANG: Kind(
        name="law hangs", family="timing", on=On.HANG, op=Op.PLUS,
        words="the law never comes back; the watchdog resets the board after so long",
        first=Range(least=1.0, most=16.0, unit="s"),
    ),
    Fault.LEAK_SMALL: Kind(
        name="small leak", family="leak", on=On.WATER, op=Op.PLUS,
        may_end=False, words="water comes in, a little",
        first=Range(least=2e-6 / 60.0, most=20e-6 / 60.0, unit="m3/s"),
    ),
    Fault.LEAK_LARGE: Kind(
        name="large leak", family="leak", on=On.WATER, op=Op.PLUS,
        may_end=False, words="water comes in, much",
        first=Range(least=20e-6 / 60.0, most=300e-6 / 60.0, unit="m3/s"),
    ),
    Fault.SWITCH_OPEN: Kind(
        name="limit switch open", family="actuator", on=On.SWITCH_IN, op=Op.CUTS,
        needs=SWITCHES,
        words="a limit switch cuts its direction everywhere; below 0.5 the inner, else the outer",
        first=Range(least=0.0, most=1.0, unit="", log=False),
    ),
    Fault.SWITCH_CLOSED: Kind(
        name="limit switch closed", family="actuator", on=On.SWITCH_IN, op=Op.NEVER_CUTS,
        needs=SWITCHES,
        words="a limit switch never cuts; below 0.5 the inner, else the outer",
        first=Range(least=0.0, most=1.0, unit="", log=False),
    ),
    Fault.VALVE_SHUT: Kind(
        name="valve stuck shut", family="actuator", on=On.VALVE, op=Op.OFF, needs=VALVE,
        words="valve and bypass let nothing in",
    ),
    Fault.VALVE_OPEN: Kind(
        name="valve stuck open", family="actuator", on=On.OPEN, op=Op.PLUS, needs=VALVE,
        words="the valve lets this share of its flow in, whatever is commanded",
        first=Range(least=0.1, most=1.0, unit=""),
    ),
    Fault.VALVE_LEAKS: Kind(
        name="valve leaks", family="actuator", on=On.OPEN, op=Op.PLUS, needs=VALVE, may_end=False,
        words="the valve lets this share of its flow in where it is shut",
        first=Range(least=1e-4, most=0.1, unit=""),
    ),
    Fault.DRIVER_LOST: Kind(
        name="driver lost", family="actuator", on=On.COMMAND, op=Op.OFF, needs=VALVE,
        words="neither pump nor valve gets its command",
    ),
}  # fmt: skip
EFFECTS = np.array([(-1, -1), *((kind.on, kind.op) for _, kind in sorted(KINDS.items()))])
"""What a kind of fault acts on and how [Fault], for the kernels."""

_ENDS, _LASTS = 0.15, Range(least=5.0, most=300.0, unit="s")


def parts_of(vehicle: Vehicle) -> frozenset[str]:
    """Return what a vehicle has, of what kinds of faults may need."""
    a = vehicle.actuator
    if isinstance(a, PumpAndValve):
        return frozenset({VALVE, MOTOR} if isinstance(a.pump, DatasheetPump) else {VALVE})
    parts = {VOLUME, TURNS}
    if vehicle.voltage_driven:
        parts.add(MOTOR)
        if vehicle.stroke.switch_margin is not None:
            parts.add(SWITCHES)
    return frozenset(parts)


def kinds_of(vehicle: Vehicle) -> tuple[Fault, ...]:
    """Return the kinds of faults that a vehicle can have."""
    parts = {"", *parts_of(vehicle)}
    return tuple(fault for fault, kind in KINDS.items() if kind.needs in parts)


def not_drawn(vehicle: Vehicle) -> dict[str, list[str]]:
    """Return the names of the kinds that a vehicle cannot have, by what it does not have."""
    parts, found = {"", *parts_of(vehicle)}, dict[str, list[str]]()
    for kind in KINDS.values():
        if kind.needs not in parts:
            found.setdefault(kind.needs, []).append(kind.name)
    return found


def draw_fault(fault: Fault, random: np.random.Generator) -> tuple[float, float, float]:
    """Return (severity, second severity, how long it lasts [s]) of a kind of fault."""
    kind = KINDS[fault]
    first = kind.first.draw(random) if kind.first is not None else 0.0
    second = kind.second.draw(random) if kind.second is not None else 0.0
    ends, lasts = random.random() < _ENDS, _LASTS.draw(random)
    return first, second, lasts if ends and kind.may_end else math.inf
