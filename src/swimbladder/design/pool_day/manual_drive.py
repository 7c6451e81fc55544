"""How an operator moves a piston with the loop open: by a timed voltage, a servo, or directly."""

from __future__ import annotations

import math
from typing import Protocol

from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.law import Measurement
from swimbladder.control.protocol import timed_voltage
from swimbladder.control.registry import bind
from swimbladder.errors import InputError
from swimbladder.vehicle import IdentifiedActuator, Vehicle

_NEAR = 0.002  # of the stroke, that counts as there
_SLOW = 120.0  # s, after which a move counts as over


class ManualDrive(Protocol):
    """Moves the piston, and keeps it where it is."""

    def stay(self, seen: Measurement) -> None:
        """Keep the piston from now on where it is."""

    def go(self, volume: float, seen: Measurement) -> None:
        """Move it from now on to a volume [m3]."""

    def done(self, seen: Measurement) -> bool:
        """Say whether it has arrived."""

    def command(self, seen: Measurement) -> float:
        """Return the command of this sample [V, or m3 for a positioner]."""


class _Timed:
    """A voltage for a time, as the paper has it; between them, what holds against the sea."""

    def __init__(self, actuator: IdentifiedActuator, limit: float, sample_time: float) -> None:
        self._a, self._limit, self._tick = actuator, limit, sample_time
        self._pulse, self._left = 0.0, 0
        self._depth = math.nan  # m, at the last sample

    def stay(self, seen: Measurement) -> None:  # noqa: ARG002 - a spindle stays by itself
        self._left = 0

    def go(self, volume: float, seen: Measurement) -> None:
        dx = (volume - seen.volume) / self._a.piston_area
        self._pulse, self._left = timed_voltage(
            dx, K1=self._a.K1, limit=self._limit, sample_time=self._tick
        )

    def done(self, seen: Measurement) -> bool:  # noqa: ARG002
        return self._left <= 0

    def command(self, seen: Measurement) -> float:
        before = seen.depth if math.isnan(self._depth) else self._depth
        self._depth = seen.depth
        if self._left > 0:
            self._left -= 1
            return self._pulse
        # Held until the next sample: the depth half way there, or the piston creeps as it goes.
        return self._a.depth_voltage * (seen.depth + 0.5 * (seen.depth - before))


class _Servo:
    """The inner loop of the vehicle's cascade, on the volume alone."""

    def __init__(self, k_pV: float, limit: float, near: float) -> None:
        self._k_pV, self._limit, self._near = k_pV, limit, near
        self._volume, self._until = 0.0, 0.0

    def stay(self, seen: Measurement) -> None:
        self._volume = seen.volume

    def go(self, volume: float, seen: Measurement) -> None:
        self._volume, self._until = volume, seen.time + _SLOW

    def done(self, seen: Measurement) -> bool:
        return abs(seen.volume - self._volume) <= self._near or seen.time > self._until

    def command(self, seen: Measurement) -> float:
        u = self._k_pV * (self._volume - seen.volume)
        return math.copysign(min(abs(u), self._limit), u)


class _Direct:
    """A positioner takes the volume itself."""

    def __init__(self, near: float) -> None:
        self._near, self._volume, self._until = near, 0.0, 0.0

    def stay(self, seen: Measurement) -> None:
        self._volume = seen.volume

    def go(self, volume: float, seen: Measurement) -> None:
        self._volume, self._until = volume, seen.time + _SLOW

    def done(self, seen: Measurement) -> bool:
        return abs(seen.volume - self._volume) <= self._near or seen.time > self._until

    def command(self, seen: Measurement) -> float:  # noqa: ARG002
        return self._volume


def manual_drive_of(vehicle: Vehicle) -> ManualDrive:
    """Return what moves the piston of a vehicle with a controller.

    Raises InputError where nothing known can: a voltage-driven one without a cascade.
    """
    near = _NEAR * (vehicle.stroke.maximum - vehicle.stroke.minimum)
    assert vehicle.controller is not None
    if not vehicle.voltage_driven:
        return _Direct(near)
    assert vehicle.supply is not None
    limit = vehicle.supply.voltage
    if isinstance(vehicle.actuator, IdentifiedActuator):
        return _Timed(vehicle.actuator, limit, vehicle.controller.sample_time)
    law, parameters = bind(vehicle.controller)
    if not isinstance(parameters, CascadeParameters):
        raise InputError(
            "a rehearsal moves the piston with the inner loop of a cascade",
            field="controller.law", value=law.name, remedy="Give the vehicle that controller",
        )  # fmt: skip
    return _Servo(parameters.k_pV, limit, near)
