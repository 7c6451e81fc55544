"""The pool, its sensors and its habits: everything a design depends on beside the vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import drive
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """Where and how experiments are made. Depths are those of the pressure sensor."""

    pool_depth: float  # m
    clearance: float  # m, of all depths of rest and records from surface and bottom
    sample_time: float  # s
    noise: float  # m, white, 1 sigma
    quantum: float  # m
    neutral_std: float  # m3
    drift_std: float  # m3/s, of the neutral volume from the release on, 1 sigma
    settling: float  # s, until the vehicle is at rest before a release
    rest: float  # s, of that time on record
    longest: float  # s, of a record from the release on
    largest: float  # m3, change of volume against the one at rest
    moves: int  # most changes of volume in a record

    @property
    def shallowest(self) -> float:
        """Depth above which a record ends [m]."""
        return self.clearance

    @property
    def deepest(self) -> float:
        """Depth below which a record ends [m]."""
        return self.pool_depth - self.clearance

    @property
    def depth_noise(self) -> float:
        """Noise of a logged depth [m, 1 sigma], rounding to the quantum included."""
        return math.hypot(self.noise, self.quantum / math.sqrt(12.0))


class Passing(NamedTuple):
    """When a move happens: as the depth passes a place, on the way up or down."""

    depth: float  # m
    up: bool

    @property
    def way(self) -> Literal["up", "down"]:
        """The way, in a word."""
        return "up" if self.up else "down"


class Turn(NamedTuple):
    """A move: the volume above the one at rest [m3], and when; None: at the release."""

    volume: float
    when: Passing | None = None


class Release(NamedTuple):
    """An experiment: at rest at a depth [m], then its moves."""

    start: float
    moves: tuple[Turn, ...]

    @classmethod
    def to_and_fro(cls, start: float, volumes: Sequence[float], depths: Sequence[float]) -> Release:
        """Return the release whose k-th later move happens at depths[k], each the other way."""
        up = volumes[0] > 0.0
        moves = [Turn(volumes[0])]
        for volume, depth in zip(volumes[1:], depths, strict=True):
            moves.append(Turn(volume, Passing(depth, up)))
            up = not up
        return cls(start, tuple(moves))


class Ramps(NamedTuple):
    """How an actuator moves from standstill, at samples, and how far it may go [m3]."""

    out: Array  # m3 above the start, to displace more
    back: Array  # m3 below the start, to displace less
    most: float  # m3 above the neutral volume of any depth of the range
    least: float  # m3 below it, negative

    def move(self, start: float, target: float, samples: int) -> Array:
        """Return the volume at `samples` instants from `start` [m3] on its way to `target`."""
        way = self.out if target > start else self.back
        gone = np.minimum(way[:samples], abs(target - start))
        gone = np.pad(gone, (0, samples - len(gone)), constant_values=abs(target - start))
        result: Array = start + math.copysign(1.0, target - start) * gone
        return result


def ramps(vehicle: Vehicle, setting: Setting) -> Ramps:
    """Return what the vehicle's actuator does at its limit: of the supply, against the deepest sea.

    Raises InputError where the stroke or the supply leave no change of volume in this pool.
    """
    depths = (setting.shallowest, setting.deepest)
    neutral = [vehicle.neutral_volume(z) for z in depths]
    stroke = vehicle.stroke
    spare = 3.0 * setting.neutral_std if math.isfinite(setting.neutral_std) else 0.0
    most, least = stroke.maximum - max(neutral) - spare, stroke.minimum - min(neutral) + spare
    if not least < 0.0 < most:
        raise InputError(
            f"the stroke of {1e6 * stroke.minimum:g} to {1e6 * stroke.maximum:g} cm3 leaves no "
            f"change of volume: neutral is {1e6 * neutral[0]:g} cm3 at {depths[0]:g} m and "
            f"{1e6 * neutral[1]:g} cm3 at {depths[1]:g} m",
            field="stroke", remedy="Trim the vehicle (trim_error), or give it a longer stroke",
        )  # fmt: skip
    most, least = min(most, setting.largest), max(least, -setting.largest)
    p = plant(vehicle)
    span, h = stroke.maximum - stroke.minimum, setting.sample_time
    count = math.ceil(setting.longest / h) + 2
    if p.positioner:
        even = np.minimum(p.rate * h * np.arange(count), span)
        return Ramps(even, even, most, least)
    out = _at_full_voltage(vehicle, setting.deepest, h, count, up=True)
    back = _at_full_voltage(vehicle, setting.shallowest, h, count, up=False)
    for way, limit in ((out, most), (back, -least)):
        if way[-1] < 1e-3 * limit:
            raise InputError(
                f"the actuator hardly moves in {setting.longest:g} s at {setting.deepest:g} m: its "
                "supply does not beat the load of the sea",
                field="supply.voltage", value=p.supply, unit="V",
                remedy="Give more voltage, or a shallower pool",
            )  # fmt: skip
    return Ramps(out, back, min(most, float(out[-1])), max(least, -float(back[-1])))


def _at_full_voltage(vehicle: Vehicle, depth: float, h: float, count: int, *, up: bool) -> Array:
    """Return the volume moved from standstill [m3] at samples, at a depth, through the stroke.

    The vehicle lies on the ground there: so heavy that no stroke lifts it.
    """
    heavy = vehicle.model_copy(update={"trim_error": 1.0})
    assert vehicle.supply is not None  # Vehicle checks it
    stroke, sign = vehicle.stroke, 1.0 if up else -1.0
    start = stroke.minimum if up else stroke.maximum
    s = drive(
        heavy, time=h * np.arange(count), voltage=np.full(count, sign * vehicle.supply.voltage),
        start_depth=depth, start_volume=start, bottom_depth=depth,
    )  # fmt: skip
    moved: Array = np.maximum.accumulate(sign * (s.volume - start))
    return moved
