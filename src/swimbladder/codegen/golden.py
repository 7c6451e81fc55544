"""The golden trace: a mission flown by a law's twin as the microcontroller will fly it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.clock import ControllerTwin
from swimbladder.control.law import Law, Measurement
from swimbladder.errors import NoAnswerError
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Vehicle

__all__ = ["Golden", "command_limits", "fly"]


class Golden(NamedTuple):
    """What the controller saw and said at each tick, and how far float32 took the vehicle."""

    depth: NDArray[np.float32]  # m, measured
    volume: NDArray[np.float32]  # m3, measured
    reference: NDArray[np.float32]  # m, asked for
    command: NDArray[np.float32]  # V or m3, limited
    difference: float  # m, largest from the depths under the law in double precision


def command_limits(vehicle: Vehicle) -> tuple[float, float]:
    """Return the least and the largest command: of the supply [V], or of the stroke [m3]."""
    if vehicle.voltage_driven:
        assert vehicle.supply is not None
        return -vehicle.supply.voltage, vehicle.supply.voltage
    return vehicle.stroke.minimum, vehicle.stroke.maximum


def fly(
    vehicle: Vehicle, law: Law, twin: Law, parameters: Any, *, tick_s: float, start_depth: float,
    target: float, duration: float, seed: int | None, first: float,
    progress: Callable[[int], None] | None = None,
) -> Golden:  # fmt: skip
    """Return the golden trace of a depth step [m] under a law's twin, from rest.

    seed: of the vehicle's sensors' noise; None: ideal sensors. first: the command before there is
    one. Raises NoAnswerError where the vehicle does not come through it.
    """
    low, high = command_limits(vehicle)
    controller = ControllerTwin(twin, parameters, tick_s=tick_s, low=low, high=high, first=first)
    rows: list[tuple[Any, ...]] = []

    def every_tick(seen: Measurement, reference: float) -> float:
        command = controller.tick(seen.depth, seen.volume, reference)
        rows.append((seen.depth, seen.volume, reference, command))
        return float(command)

    mission: dict[str, Any] = dict(
        setpoints=[(0.0, target)], duration=duration, start_depth=start_depth, seed=seed,
        sample_time=tick_s,
    )  # fmt: skip
    flown = simulate(vehicle, law=every_tick, progress=progress, **mission)
    if not flown.finished:
        raise NoAnswerError(
            f"The golden mission from {start_depth:g} m to {target:g} m ended at "
            f"{flown.time[-1]:g} s: {flown.stop.value}"
        )
    double = simulate(vehicle, law=law, parameters=parameters, **mission)
    depth, volume, reference, command = np.array(rows, np.float32).T
    difference = float(np.abs(flown.depth - double.depth).max())
    return Golden(depth, volume, reference, command, difference)
