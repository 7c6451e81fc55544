"""The catalogue of faults, `kinds.toml`: what may fail, how badly, and how it is drawn."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from importlib.resources import files
from typing import Any

import numpy as np

from swimbladder.vehicle import DatasheetPump, PumpAndValve, Vehicle


class On(IntEnum):
    """What a fault acts on; the kernels hold a factor and a summand for each, see `Op`."""

    DEPTH = 0  # m, that the sensor measures
    NOISE = 1  # m, 1 sigma, in the depth beyond its own
    READS = 2  # m, in the place of the depth
    LATE = 3  # s, by which it comes late; factor 0: the driver says so
    OLD = 4  # s, after which a new one comes; factor 0: none does
    DROPOUTS = 5  # share of depths that is measured
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
    TICKS = 22  # share that comes
    PAUSE = 23
    RESET = 24
    HANG = 25  # s
    WATER = 26  # m3/s that come in
    OPEN_RUNNING = 27  # as OPEN, while the pump runs
    PORT_OUT = 28  # flow of the port outward; what is closed of it adds to the load
    PORT_IN = 29
    CREEP = 30  # strokes/(m s), by which the pressure drives the actuator in
    SLIP = 31  # share of the motion outward that the volume sensor misses; below 0: inward
    WEIGHT = 32  # strokes, that the neutral volume is larger by
    CLOCK = 33  # share by which the board's ticks come too often
    FLIP = 34  # 0: a bit of what the board remembers flips
    ASKED = 35  # m, in the place of the depth asked for; 0: not a number
    WAITS = 36  # 0: the law wants to wait for ever, which is no command


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
    SETTLES = 16  # s goes to the severity within a time constant, the second one


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
    also: On | None = None  # a second thing that it acts on in the same way
    why: str = ""  # the severities have this range
    first: Range | None = None
    second: Range | None = None
    may_end: bool = True  # one in seven lasts for 5 to 300 s only
    from_start: bool = False  # it is there when the mission begins
    needs: str = ""  # what a vehicle has to have, of `parts_of`

    def size(self, severity: float) -> str:
        """Return a severity as a reader has it; empty where the kind has none."""
        return "" if self.first is None else f"{severity:.3g} {self.first.unit}".rstrip()


MOTOR, SWITCHES, VALVE = "a motor on a battery", "limit switches", "a pump and a valve"
VOLUME, TURNS = "a measured volume", "a drive that can turn the other way"
DRIVEN_BACK = "a motor that the pressure drives back"


def _kind(row: dict[str, Any]) -> Kind:
    """Return a kind as a table of the catalogue has it."""
    made: dict[str, Any] = {end: Range(**row[end]) for end in ("first", "second") if end in row}
    made |= {name: On[row[name]] for name in ("on", "also") if name in row}
    made |= {"op": Op[row["op"]]}
    return Kind(**row | made)


_CATALOGUE = files("swimbladder.sim.faults").joinpath("kinds.toml").read_text("utf-8")
_TABLES = tomllib.loads(_CATALOGUE)
FAULTS: Mapping[str, int] = {name: number for number, name in enumerate(_TABLES, 1)}
"""Number of a kind of fault in the kernel, by its name in the catalogue."""
KINDS: Mapping[int, Kind] = dict(enumerate(map(_kind, _TABLES.values()), 1))
EFFECTS = np.array(
    [
        (-1, -1, -1),
        *((k.on, k.op, -1 if k.also is None else k.also) for k in KINDS.values()),
    ]
)
"""What a kind of fault acts on, how, and on what else, by its number, for the kernels."""

_ENDS, _LASTS = 0.15, Range(least=5.0, most=300.0, unit="s")


def parts_of(vehicle: Vehicle) -> frozenset[str]:
    """Return what a vehicle has, of what kinds of faults may need."""
    a = vehicle.engine
    if isinstance(a, PumpAndValve):
        return frozenset({VALVE, MOTOR} if isinstance(a.pump, DatasheetPump) else {VALVE})
    parts = {VOLUME, TURNS}
    if vehicle.voltage_driven:
        parts |= {MOTOR, DRIVEN_BACK}
        if vehicle.stroke.switch_margin is not None:
            parts.add(SWITCHES)
    return frozenset(parts)


def kinds_of(vehicle: Vehicle) -> tuple[int, ...]:
    """Return the numbers of the kinds of faults that a vehicle can have."""
    parts = {"", *parts_of(vehicle)}
    return tuple(fault for fault, kind in KINDS.items() if kind.needs in parts)


def not_drawn(vehicle: Vehicle) -> dict[str, list[str]]:
    """Return the names of the kinds that a vehicle cannot have, by what it does not have."""
    parts, found = {"", *parts_of(vehicle)}, dict[str, list[str]]()
    for kind in KINDS.values():
        if kind.needs not in parts:
            found.setdefault(kind.needs, []).append(kind.name)
    return found


def draw_fault(fault: int, random: np.random.Generator) -> tuple[float, float, float]:
    """Return (severity, second severity, how long it lasts [s]) of a kind of fault."""
    kind = KINDS[fault]
    first = kind.first.draw(random) if kind.first is not None else 0.0
    second = kind.second.draw(random) if kind.second is not None else 0.0
    ends, lasts = random.random() < _ENDS, _LASTS.draw(random)
    return first, second, lasts if ends and kind.may_end else math.inf
