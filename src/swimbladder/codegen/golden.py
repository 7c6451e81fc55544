"""The golden trace: a mission flown by a law's twin as the microcontroller will fly it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.clock import ControllerTwin
from swimbladder.codegen.float_flight import fly_float
from swimbladder.control.law import Law, Measurement
from swimbladder.errors import NoAnswerError
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Vehicle

_UP = 2.0 / 3.0  # of a float's golden mission, after which it is to come up


class Golden(NamedTuple):
    """What the controller saw and said at each tick, and how far float32 took the vehicle."""

    depth: NDArray[np.float32]  # m, measured
    volume: NDArray[np.float32]  # m3, measured
    reference: NDArray[np.float32]  # m, asked for
    command: NDArray[np.float32]  # V or m3, limited; s of pump and valve
    difference: float  # m, largest from the depths under the law in double precision


def command_limits(vehicle: Vehicle, tick_s: float = math.inf) -> tuple[float, float]:
    """Return the least and the largest command: of the supply [V], of the stroke [m3].

    Of a pump and valve a tick_s [s] each.
    """
    if vehicle.command == "volume change":
        return -tick_s, tick_s
    if vehicle.voltage_driven:
        assert vehicle.supply is not None
        return -vehicle.supply.voltage, vehicle.supply.voltage
    return vehicle.stroke.minimum, vehicle.stroke.maximum


def asked_of_float(target: float, duration: float, tick_s: float) -> NDArray[np.float64]:
    """Return the depth that a float's golden mission asks for at each tick [m]; 0 is the surface.

    target [m], duration [s]: after two thirds of it the float is to come up.
    """
    n = max(math.ceil(duration / tick_s - 1e-9), 1) + 1
    return np.where(np.arange(n) < _UP * n, target, 0.0)


def fly_on_seconds(
    vehicle: Vehicle,
    laws: tuple[Law, Law],
    parameters: Any,
    *,
    tick_s: float,
    start_depth: float,
    asked: NDArray[np.float64],
    seed: int | None,
    progress: Callable[[int], None] | None = None,
) -> Golden:
    """Return the golden trace of a float under a law's twin, for the depths asked for [m] [n].

    As `fly`, for a law that commands seconds of pump and valve: the volume is not measured.
    laws: the twin and the law itself. Raises NoAnswerError where the float does not dive.
    """
    low, high = command_limits(vehicle, tick_s)
    flown = []
    for kind, each in zip(laws, (progress, None), strict=True):
        board = ControllerTwin(kind, parameters, tick_s=tick_s, low=low, high=high, seconds=True)

        def tick(
            seen: Measurement, reference: float, board: ControllerTwin = board
        ) -> tuple[float, bool]:
            command = float(board.tick(seen.depth, seen.volume, reference))
            return command, board.state.drive.wide > 0.0

        flown.append(
            fly_float(
                vehicle,
                tick,
                tick=tick_s,
                start_depth=start_depth,
                asked=asked,
                seed=seed,
                progress=each,
            )
        )
    rows, double = flown
    if not rows[:, 0].max() > parameters.surface.shallow:
        raise NoAnswerError(
            f"the golden mission: asked for {asked.max():g} m the float has not dived after "
            f"{_UP * len(asked) * tick_s:.4g} s. Give a longer --duration, or see what valve and "
            "bypass let in at the surface (actuator.valve.flow, actuator.internal_pressure)"
        )
    depth, command = np.asarray(rows[:, 1], np.float32), np.asarray(rows[:, 3], np.float32)
    nothing = np.full_like(depth, np.nan)
    difference = float(np.abs(rows[:, 0] - double[:, 0]).max())
    return Golden(depth, nothing, np.asarray(asked, np.float32), command, difference)


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
