"""A float flown by the seconds of pump and valve that its board commands at each tick.

The vehicle is that of `simulate` and `mission`, moved by RODAS from tick to tick, so that the
drive's starts, the head at each depth and the emerging hull are theirs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Measurement
from swimbladder.errors import NoAnswerError
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.cache import compiled
from swimbladder.sim.engine.rodas import NAME
from swimbladder.sim.engine.rodas.drive import (
    end_run,
    end_turn,
    move,
    next_turn,
    start_run,
    turn_line,
)
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Drive, Now
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.sensing import measured
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
T, T_MOVE, DOING, STOP = int(Now.T), int(Now.T_MOVE), int(At.DOING), int(At.STOP)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
_DOES = {1: PUMPING, -1: int(Doing.LETTING_IN), 0: NOTHING}
_ROOM = 100.0  # m of water below the deepest that is asked for


class _Lane(NamedTuple):
    """A vehicle as RODAS moves it; `engine.rodas.names` says what stands where."""

    given: Array
    table: Array
    waves: Array
    x: Array
    at: NDArray[np.int64]
    accounts: Array
    notes: Array
    counts: NDArray[np.int64]
    work: Array


def _tick(lane: _Lane, doing: int, length: float, until: float) -> float:
    """Move until a time [s] with pump or valve, `length` [s] of it or all where that is inf.

    Return the depth that the sensor gives then [m].
    """
    p, table, x, at, accounts = lane.given, lane.table, lane.x, lane.at, lane.accounts
    notes, counts = lane.notes, lane.counts
    now = PUMPING if at[DOING] == PRIMING else at[DOING]
    if now != doing and now != NOTHING:
        end_run(x, at, notes, counts)
    if doing != NOTHING and now != doing:
        end = math.inf if doing == PUMPING else -math.inf
        start_run(p, table, x, at, accounts, notes, counts, doing, 0.0, end, length)
    elif at[DOING] != NOTHING:
        x[T_MOVE] = x[T] + length
    while x[T] < until and at[STOP] == 0:
        goal = next_turn(p, table, x, at, until)
        if goal > x[T]:
            move(p, table, lane.waves, x, at, accounts, notes, counts, 0.0, 0.0, goal, lane.work)
        end_turn(x, at, notes, counts)
        turn_line(p, table, lane.waves, x, at)
    return float(measured(p, lane.waves, x, at))


_tick_kernel = compiled(_tick, under=NAME, allocates=False)


class FloatPlant:
    """A float in its water, under commands of seconds; at depth 0 it floats with all volume out.

    seed: of the noise of its depth sensor; None: an ideal one.
    """

    def __init__(
        self, vehicle: Vehicle, *, start_depth: float, deepest: float, seed: int | None = None
    ) -> None:
        column = uniform_column(vehicle.water, deepest + _ROOM)
        given = given_of(vehicle, column, bottom=math.inf, accuracy=Accuracy())
        table = make_table(vehicle, column)[0]
        x, at = first_lane(given, table, start_depth, seed=seed)
        self._lane = _Lane(
            given,
            table,
            np.zeros((0, 6)),
            x,
            at,
            np.zeros(int(Account.COUNT)),
            np.zeros((0, int(Drive.COUNT))),
            np.zeros(3, np.int64),
            np.zeros((6, 8)),
        )
        self.time = 0.0
        self.seen = float(_tick_kernel(self._lane, NOTHING, 0.0, 0.0))  # m, by the sensor

    @property
    def depth(self) -> float:
        """Depth of the pressure sensor [m]."""
        return float(self._lane.x[Now.Z])

    @property
    def volume(self) -> float:
        """Volume [m3]."""
        return float(self._lane.x[Now.V])

    def move(self, command: float, tick: float, *, wide: bool = False) -> None:
        """Move by a tick [s] under its command [s]; wide: a negative one opens the bypass."""
        doing = _DOES[int(np.sign(command))]
        if wide and command < 0.0:
            doing = int(Doing.BYPASSING)
        whole = abs(command) >= (1.0 - 1e-6) * tick
        self.time += tick
        self.seen = _tick_kernel(self._lane, doing, math.inf if whole else abs(command), self.time)
        if self._lane.at[STOP] != 0:
            raise NoAnswerError(
                f"The golden mission ended at {self.time:g} s, at {self.depth:.4g} m: the float "
                "left the water, or went deeper than any sea"
            )


def fly_float(
    vehicle: Vehicle,
    board: Callable[[Measurement, float], tuple[float, bool]],
    *,
    tick: float,
    start_depth: float,
    asked: Array,
    seed: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Array:
    """Return what a float does tick by tick [n, 4]: depth, measured depth, volume [m3], seconds.

    board: (measured, depth asked for) -> (seconds of this tick, by the bypass). asked: the depth
    asked for at each tick [m] [n]. seed: of the depth sensor's noise; None: an ideal one.
    Raises NoAnswerError where the float leaves the water or goes deeper than any sea.
    """
    deepest = max(start_depth, *asked)
    plant = FloatPlant(vehicle, start_depth=start_depth, deepest=deepest, seed=seed)
    rows = np.zeros((len(asked), 4))
    for n, reference in enumerate(asked):
        seen = plant.seen
        command, wide = board(Measurement(n * tick, seen, math.nan), float(reference))
        rows[n] = plant.depth, seen, plant.volume, command
        plant.move(command, tick, wide=wide)
        if progress is not None:
            progress(n + 1)
    return rows
