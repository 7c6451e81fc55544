"""A float's log: where it was, what it decided, how long pump and valve ran, on what.

Pressures are above what the float's sensor reads at the surface [Pa]; times count from the log's
first line [s], which is at `start`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.arrays import Array

Device = Literal["pump", "valve", "bypass"]
DEVICES: tuple[Device, ...] = ("pump", "valve", "bypass")


@dataclass(frozen=True, kw_only=True)
class Target:
    """What the float's controller wanted: a speed, and the volume that it computed."""

    time: float  # s
    speed_from: float  # Pa/s, positive down
    speed_to: float  # Pa/s
    change: float  # m3, positive: lighter
    seconds: float  # s, computed for the device


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Battery voltage [V] and current [A] at a time [s]."""

    time: float
    voltage: float
    current: float


@dataclass(frozen=True, kw_only=True)
class Action:
    """A run of the pump, or an opening of valve or bypass.

    asked [s]: how long; seconds [s]: how long it was, less where it was broken off. pressure [Pa]:
    as the log says beside it, the last one measured; NaN where it says none.
    """

    device: Device
    time: float  # s, the beginning
    asked: float
    seconds: float
    pressure: float = np.nan
    before: Reading | None = None
    after: Reading | None = None
    target: Target | None = None
    stage: int | None = None


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A part of the float's mission: to hold a pressure, or to come up (pressure 0)."""

    number: int
    pressure: float  # Pa
    tolerance: float  # Pa
    duration: float  # s


@dataclass(frozen=True, kw_only=True)
class FloatLog:
    """A float's log, in SI units.

    stage: number of the mission's stage at each sample; -1 while it leaves the surface, -2 where
    no stage is under way. settings: the controller's, as texts. report: what was not understood.
    time_step, pressure_step: what times and pressures were rounded to; empty: to nothing.
    """

    source: str
    name: str = ""
    firmware: str = ""
    start: str = ""  # ISO 8601
    time: Array  # s [n]
    pressure: Array  # Pa [n]
    temperature: Array  # degC [n], NaN where it is not logged
    stage: NDArray[np.int64]  # - [n]
    time_step: Array = field(default_factory=lambda: np.zeros(0))  # s [n]
    pressure_step: Array = field(default_factory=lambda: np.zeros(0))  # Pa [n]
    actions: tuple[Action, ...]
    stages: tuple[Stage, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    position: tuple[float, float] | None = None  # latitude, longitude [deg]
    internal_pressure: float = np.nan  # Pa, absolute, as logged last
    battery_voltage: float = np.nan  # V, after the dive
    battery_least: float = np.nan  # V, during it
    report: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        runs = f"{len(self)} pressures, {len(self.actions)} actions"
        return f"FloatLog({self.source!r}: {self.name or 'no name'}, {runs})"

    def of(self, *devices: Device) -> tuple[Action, ...]:
        """Return the actions of these devices, in order."""
        return tuple(action for action in self.actions if action.device in devices)


def table_log(
    time: Array, pressure: Array, runs: Iterable[tuple[float, Device, float]], **more: Any
) -> FloatLog:
    """Return the log of pressures [Pa] at times [s], in order, and runs: begin [s], device, [s].

    Times then count from the first of all. more: other fields.
    """
    ordered = sorted(runs, key=itemgetter(0))
    first = min([float(time[0]), *(begin for begin, _, _ in ordered)])
    known = {
        "time": time - first,
        "pressure": pressure,
        "temperature": np.full(len(time), np.nan),
        "stage": np.full(len(time), -2, dtype=np.int64),
        "actions": tuple(
            Action(device=device, time=begin - first, asked=lasts, seconds=lasts)
            for begin, device, lasts in ordered
        ),
    }
    return FloatLog(**{**known, **more})
