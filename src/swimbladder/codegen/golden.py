"""The golden trace: a mission flown by a law's twin as the microcontroller will fly it.

A float is flown by the seconds of pump and valve that its board commands at each tick.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.clock import ControllerTwin
from swimbladder.codegen.pump_valve import BoardLaw
from swimbladder.codegen.tree import Program
from swimbladder.codegen.twin import twin
from swimbladder.control.arming import ArmingParameters
from swimbladder.control.law import Law, Measurement
from swimbladder.control.supervisor import SupervisorParameters
from swimbladder.errors import NoAnswerError
from swimbladder.io.progress import Advance, silent
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.closed_loop.block import Block
from swimbladder.sim.closed_loop.floats import float_model
from swimbladder.sim.closed_loop.lanes import Schedule
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.sim.closed_loop.single import as_law, run_function
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
Float32s = NDArray[np.float32]

_UP = 2.0 / 3.0  # of a float's golden mission, after which it is to come up
_LONGER = (
    "Give a longer --duration, or see what valve and bypass let in at the surface "
    "(actuator.valve.flow, actuator.internal_pressure)"
)


class Mission(NamedTuple):
    """A golden mission: from where to where, and for how long."""

    start: float  # m
    target: float  # m
    duration: float  # s


class Golden(NamedTuple):
    """What the controller saw and said at each tick, and how far float32 took the vehicle."""

    depth: Float32s  # m, measured
    volume: Float32s  # m3, measured
    reference: Float32s  # m, asked for
    command: Float32s  # V or m3, limited; s of pump and valve
    difference: float  # m, largest from the depths under the law in double precision


@dataclass(frozen=True, kw_only=True)
class BoardProgram:
    """A controller and its supervisor as a board's program: what a library is made around."""

    law: Law  # as the board runs it
    parameters: Any
    tick_s: float
    first: float  # V, m3 or s: the command until there is one
    limits: tuple[float, float]  # of the command
    supervisor: SupervisorParameters
    arming: ArmingParameters
    drive: BoardLaw | None  # of a pump and valve
    program: Program
    facts: dict[str, Any]  # for templates
    sources: dict[str, str]  # C by its files' names

    def twin(self) -> Law:
        """Return the law in float32."""
        return twin(self.law, self.program)

    def controller(self, law: Law) -> ControllerTwin:
        """Return what calls a law as the board does: the law or its twin."""
        low, high = self.limits
        return ControllerTwin(
            law,
            self.parameters,
            tick_s=self.tick_s,
            low=low,
            high=high,
            first=self.first,
            seconds=self.drive is not None,
        )


def fly(
    vehicle: Vehicle,
    made: BoardProgram,
    mission: Mission,
    seed: int | None,
    advance: Advance = silent,
) -> Golden:
    """Return the golden trace of a depth step from rest under the twin of a board's law.

    A float dives, and is to come up after two thirds of the time; its volume is not measured.
    seed: of the vehicle's sensors' noise; None: ideal sensors. Raises NoAnswerError where the
    vehicle does not come through it, or the float does not dive.
    """
    if made.drive is not None:
        return _fly_on_seconds(vehicle, made, mission, seed, advance)
    board = made.controller(made.twin())
    rows: list[tuple[Any, ...]] = []

    def every_tick(seen: Measurement, reference: float) -> float:
        command = board.tick(seen.depth, seen.volume, reference)
        rows.append((seen.depth, seen.volume, reference, command))
        return float(command)

    given: dict[str, Any] = {
        "setpoints": [(0.0, mission.target)],
        "duration": mission.duration,
        "start_depth": mission.start,
        "seed": seed,
        "sample_time": made.tick_s,
        "supervised": False,
    }
    flown = simulate(vehicle, law=every_tick, advance=advance, **given)
    if not flown.finished:
        way = f"from {mission.start:g} m to {mission.target:g} m"
        ended = f"ended at {flown.time[-1]:g} s: {flown.stop.value}"
        raise NoAnswerError(f"The golden mission {way} {ended}")
    double = simulate(vehicle, law=made.law, parameters=made.parameters, **given)
    depth, volume, reference, command = np.array(rows, np.float32).T
    difference = float(np.abs(flown.depth - double.depth).max())
    return Golden(depth, volume, reference, command, difference)


def _fly_on_seconds(
    vehicle: Vehicle, made: BoardProgram, mission: Mission, seed: int | None, advance: Advance
) -> Golden:
    n = max(math.ceil(mission.duration / made.tick_s - 1e-9), 1) + 1
    asked = np.where(np.arange(n) < _UP * n, mission.target, 0.0)
    given: dict[str, Any] = {"tick": made.tick_s, "start_depth": mission.start, "asked": asked}

    def flown(law: Law, advance: Advance) -> Array:
        board = made.controller(law)

        def tick(seen: Measurement, reference: float) -> tuple[float, bool]:
            command = float(board.tick(seen.depth, seen.volume, reference))
            return command, board.state.drive.wide > 0.0

        return fly_float(vehicle, tick, seed=seed, advance=advance, **given)

    rows, double = flown(made.twin(), advance), flown(made.law, silent)
    if not rows[:, 0].max() > made.parameters.surface.shallow:
        waited = f"has not dived after {_UP * len(asked) * made.tick_s:.4g} s"
        raise NoAnswerError(
            f"the golden mission: asked for {asked.max():g} m the float {waited}. {_LONGER}"
        )
    _, depth, _, command = rows.T.astype(np.float32)
    difference = float(np.abs(rows[:, 0] - double[:, 0]).max())
    return Golden(depth, np.full_like(depth, np.nan), asked.astype(np.float32), command, difference)


def fly_float(
    vehicle: Vehicle,
    board: Callable[[Measurement, float], tuple[float, bool]],
    *,
    tick: float,
    start_depth: float,
    asked: Array,
    seed: int | None = None,
    advance: Advance = silent,
) -> Array:
    """Return what a float does tick by tick [n, 4]: depth, measured depth, volume [m3], seconds.

    It is the float of `simulate`; at depth 0 it begins afloat with all volume out.
    board: (measured, depth asked for) -> (seconds of this tick, by the bypass). asked: the depth
    asked for at each tick [m] [n]. seed: of the depth sensor's noise; None: an ideal one.
    Raises NoAnswerError where the float leaves the water or goes deeper than any sea.
    """
    deepest, n = max(start_depth, *asked), len(asked)
    medium = medium_of(vehicle, None, reach=deepest)
    plants = np.array(medium.plant)[:, None]
    stepper, start = float_model(vehicle, medium, None, reach=deepest).lanes(
        {}, plants, np.array([[0.0], [math.nan], [start_depth], [0.0]])
    )
    stepper, measured = stepper._replace(wide=np.zeros(1)), []

    def commanded(seen: Measurement, reference: float) -> float:
        """Return the board's command, for a volume that is not measured."""
        measured.append(seen.depth)
        command, stepper.wide[0] = board(seen._replace(volume=math.nan), reference)
        return command

    law, held, _ = as_law(vehicle, commanded, tick)
    ticks = np.arange(n, dtype=np.int64)
    block = Block(
        plants=plants,
        law=law,
        parameters=held._asdict(),
        clock=Schedule(tick=tick, turn=ticks, given=ticks),
        parts=1,
        depths=asked[:, None],
        start=start,
        sensors=vehicle.sensors,
        seeds=None if seed is None else [[seed, 0]],
        recorded=True,
        stepper=stepper,
    )
    run_function(block, commanded, advance)
    if block.work[Row.STOPPED, 0] != 0.0:
        at = block.work[Row.STOP_TICK, 0] * tick
        where = f"at {at:g} s, at {block.work[Row.Z, 0]:.4g} m"
        why = "the float left the water, or went deeper than any sea"
        raise NoAnswerError(f"The golden mission ended {where}: {why}")
    depth, _, volume, _, command = block.record[:5, :, 0]
    return np.stack([depth, measured, volume, command], axis=1)
