"""The golden trace: a mission flown by the twin of law and supervisor as the board will fly it.

A float is flown by the seconds of pump and valve that its board commands at each tick. At the end
of what is checked the sensors fail, so that a board shows that it brings the vehicle up.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.tree import Program
from swimbladder.codegen.twin import ControllerTwin, VehicleTwin, supervisor_twin, twin
from swimbladder.control.arming import ArmingParameters
from swimbladder.control.law import Law, Measurement, leaves
from swimbladder.control.supervisor import Reason, SupervisorParameters, Watched
from swimbladder.errors import NoAnswerError
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.closed_loop.block import Block
from swimbladder.sim.closed_loop.floats import BoardLaw, float_model
from swimbladder.sim.closed_loop.lane import Row
from swimbladder.sim.closed_loop.lanes import Schedule
from swimbladder.sim.closed_loop.single import as_law, run_function
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Vehicle

Float32s = NDArray[np.float32]
UNPLUGGED = 15  # ticks of full buoyancy at the end of what is checked

_NEAR = 0.1  # of a step, within which float32 and double precision have to end it
_UP = 2.0 / 3.0  # of a float's golden mission, after which it is to come up
_LONGER = (
    "Give a longer `duration=`, or see what valve and bypass let in at the surface "
    "(actuator.valve.flow, actuator.internal_pressure)"
)


class Mission(NamedTuple):
    """A golden mission: from where to where, and for how long."""

    start: float  # m
    target: float  # m
    duration: float  # s

    def ticks(self, tick_s: float) -> int:
        """Return how many ticks it has at an interval [s], its first and its last among them."""
        return max(math.ceil(self.duration / tick_s - 1e-9), 1) + 1


class Golden(NamedTuple):
    """What the vehicle saw and said at each tick of its mission, and how far float32 took it."""

    depth: Float32s  # m, measured
    volume: Float32s  # m3, measured
    reference: Float32s  # m, asked for
    command: Float32s  # V or m3, limited; s of pump and valve
    difference: float  # m, largest from the depths in double precision
    apart: float  # m, the same at the end of the mission, of a float's dive
    checked: list[tuple[Any, ...]]  # the first four and the reason; at last the sensors fail


class _InDouble(ControllerTwin):
    number = np.float64


@dataclass(frozen=True, kw_only=True)
class BoardProgram:
    """A controller and its supervisor as a board's program: what a library is made around."""

    law: Law  # as the board runs it
    parameters: Any
    tick_s: float
    first: float  # V, m3 or s: the command until there is one
    most_wait: int  # ticks
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

    def controller(
        self, law: Law, made_of: type[ControllerTwin] = ControllerTwin
    ) -> ControllerTwin:
        """Return what calls a law as the board does: the law or its twin."""
        made = made_of(
            law,
            self.parameters,
            tick_s=self.tick_s,
            limits=self.limits,
            first=self.first,
            seconds=self.drive is not None,
        )
        made.most = self.most_wait
        return made

    def board(self, law: Law | None = None, **begun: Any) -> VehicleTwin:
        """Return what the board is: the twin of law and supervisor.

        law: its `twin`, where it was made before; begun: as `VehicleTwin` has it.
        """
        controller = self.controller(law or self.twin())
        return VehicleTwin(controller, self.supervisor, supervisor=supervisor_twin(), **begun)

    def in_double(self) -> VehicleTwin:
        """Return the same in double precision."""
        return VehicleTwin(self.controller(self.law, _InDouble), self.supervisor)


def fly(
    vehicle: Vehicle,
    made: BoardProgram,
    mission: Mission,
    seed: int | None,
    advance: Advance = silent,
) -> Golden:
    """Return the golden trace of a depth step from rest under the twin of law and supervisor.

    A float dives, and is to come up after two thirds of the time; its volume is not measured.
    seed: of the vehicle's sensors' noise; None: ideal sensors. Raises NoAnswerError where the
    vehicle does not come through it, the supervisor brings it up, or the float does not dive.
    """
    if made.drive is not None:
        return _fly_on_seconds(vehicle, made, mission, seed, advance)
    board = made.board()
    rows: list[tuple[Any, ...]] = []

    def every_tick(seen: Measurement, reference: float) -> float:
        """Return the board's command, and keep a row of what it measured and answered."""
        command = board(seen, reference)
        reason = _healthy(board, mission)
        rows.append((seen.depth, seen.volume, reference, command, reason))
        return command

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
    with np.errstate(all="ignore"):
        double = simulate(vehicle, law=made.in_double(), **given)
    depth, volume, reference, command, _ = np.array(rows, np.float32).T
    near = _NEAR * abs(mission.target - mission.start)
    moved = _moved(flown.depth, double.depth, near)
    return Golden(depth, volume, reference, command, *moved, unplugged(board, rows))


def _moved(board: Array, double: Array, near: float, end: int = -1) -> tuple[float, float]:
    """Return how far float32 takes a vehicle from its depths in double precision [m].

    At most, and at a tick `end`, where it is to have arrived. Rounding moves when a law decides,
    and with that the way; raises NoAnswerError where it is not even within `near` [m] in the end.
    """
    apart = np.abs(board - double)
    if apart[end] > near:
        raise NoAnswerError(
            f"The golden mission ends at {board[end]:.4g} m on the board (float32), and at "
            f"{double[end]:.4g} m in double precision: its law decides by a hair. Tune it anew, or "
            "take another one"
        )
    return float(apart.max()), float(apart[end])


def _healthy(board: VehicleTwin, mission: Mission) -> int:
    """Return the reason of a vehicle without a fault, 0 or that its time is over.

    Raises NoAnswerError where the supervisor brings it up for another.
    """
    if board.reason is None or board.reason is Reason.TIME_LIMIT:
        return int(board.reason or 0)
    way = f"from {mission.start:g} m to {mission.target:g} m"
    at = f"at {board.ticks * float(board.limits.S_p):.4g} s"
    raise NoAnswerError(
        f"The golden mission {way}: the supervisor brings the vehicle up {at} "
        f"({board.reason.words}), and nothing is wrong with it. Give limits that the law keeps to "
        "in [supervisor], or a mission that the vehicle can do"
    )


def unplugged(board: VehicleTwin, rows: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """Return rows (depth, volume, depth asked for, command, reason), and those that follow them.

    board: has just seen them. From there on its sensors fail, until it brings the vehicle up.
    """
    reference = rows[-1][2]
    blind = Watched(math.nan, 0.0, math.nan, math.nan, False, 0, 0)
    after = []
    for _ in range(int(board.limits.depth.gap) + UNPLUGGED):
        command = board.tick(blind, reference)
        after.append((math.nan, math.nan, reference, command, int(board.reason or 0)))
    return rows + after


def first_rows(made: BoardProgram, golden: Golden, most: int) -> list[tuple[Any, ...]]:
    """Return `most` rows for a board with little room: the mission's first, then the sensors fail.

    A row of the mission is there at least.
    """
    count = max(most - made.supervisor.depth.gap - UNPLUGGED, 1)
    board, rows = made.board(), golden.checked[:count]
    for depth, volume, reference, *_ in rows:
        board.tick(Watched(depth, 0.0, volume, math.nan, False, 0, 0), reference)
    return unplugged(board, rows)


def _fly_on_seconds(
    vehicle: Vehicle, made: BoardProgram, mission: Mission, seed: int | None, advance: Advance
) -> Golden:
    n = mission.ticks(made.tick_s)
    asked = np.where(np.arange(n) < _UP * n, mission.target, 0.0)
    given: dict[str, Any] = {"tick": made.tick_s, "start_depth": mission.start, "asked": asked}

    reasons: list[int] = []

    def flown(board: VehicleTwin, advance: Advance) -> Array:
        """Return the rows of a flight with a board; what the supervisor reports joins `reasons`."""

        def tick(seen: Measurement, reference: float) -> tuple[float, bool]:
            command = board(seen, reference)
            reasons.append(_healthy(board, mission))
            return command, board.wide

        return fly_float(vehicle, tick, seed=seed, advance=advance, **given)

    board = made.board()
    rows = flown(board, advance)
    with np.errstate(all="ignore"):
        double = flown(made.in_double(), silent)
    if not rows[:, 0].max() > made.parameters.surface.shallow:
        waited = f"has not dived after {_UP * len(asked) * made.tick_s:.4g} s"
        raise NoAnswerError(
            f"the golden mission: asked for {asked.max():g} m the float {waited}. {_LONGER}"
        )
    _, depth, _, command = rows.T.astype(np.float32)
    dived = int(np.flatnonzero(asked == asked.max())[-1])
    near = 2.0 * leaves(made.parameters)[made.law.band]
    moved = _moved(rows[:, 0], double[:, 0], near, dived)
    volume, asked = np.full_like(depth, np.nan), asked.astype(np.float32)
    checked = unplugged(board, [*zip(depth, volume, asked, command, reasons[:n], strict=True)])
    return Golden(depth, volume, asked, command, *moved, checked)


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
    stepper, start = float_model(vehicle, medium, None, reach=deepest, seconds=True).lanes(
        {}, plants, np.array([[0.0], [math.nan], [start_depth], [0.0]])
    )
    measured: list[float] = []

    def commanded(seen: Measurement, reference: float) -> float:
        """Return the board's command, for a volume that is not measured."""
        measured.append(seen.depth)
        command, block.work[Row.WIDE, 0] = board(seen._replace(volume=math.nan), reference)
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
