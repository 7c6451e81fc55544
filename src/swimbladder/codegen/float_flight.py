"""A float flown by the seconds of pump and valve that its board commands at each tick.

The vehicle is that of `simulate` and `mission`, moved by `closed_loop.pumped` from tick to tick, so
that the drive's starts, the head at each depth and the emerging hull are theirs.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Measurement
from swimbladder.errors import NoAnswerError
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.closed_loop.pumped import Pumped, move_lanes, one_lane
from swimbladder.sim.closed_loop.rows import rows
from swimbladder.sim.engine.cache import compiled
from swimbladder.sim.engine.rodas import NAME
from swimbladder.sim.engine.rodas.drive import (
    end_run,
    start_run,
)
from swimbladder.sim.engine.rodas.names import At, Doing, Now
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.sensing import measured
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
T, T_MOVE, DOING, STOP = int(Now.T), int(Now.T_MOVE), int(At.DOING), int(At.STOP)
NOTHING, PUMPING, PRIMING = int(Doing.NOTHING), int(Doing.PUMPING), int(Doing.PRIMING)
_DOES = {1: PUMPING, -1: int(Doing.LETTING_IN), 0: NOTHING}
_ROOM = 100.0  # m of water below the deepest that is asked for


def _tick(stepper: Pumped, S: Array, doing: int, length: float, until: float) -> float:
    """Move until a time [s] with pump or valve, `length` [s] of it or all where that is inf.

    Return the depth that the sensor gives then [m].
    """
    p, table, x, at = stepper.given[0], stepper.table, stepper.x[0], stepper.at[0]
    accounts, notes, counts = stepper.accounts[0], stepper.notes[0], stepper.counts[0]
    now = PUMPING if at[DOING] == PRIMING else at[DOING]
    if now != doing and now != NOTHING:
        end_run(x, at, notes, counts)
    if doing != NOTHING and now != doing:
        end = math.inf if doing == PUMPING else -math.inf
        start_run(p, table, x, at, accounts, notes, counts, doing, 0.0, end, length)
    elif at[DOING] != NOTHING:
        x[T_MOVE] = x[T] + length
    move_lanes(stepper, S, (0.0,), (), 0, until, 1)
    return float(measured(p, stepper.waves, x, at))


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
        self._stepper, self._rows = one_lane(given, table, x, at), np.zeros(rows(0, 0))
        self._x, self._at = x, at
        self.time = 0.0
        self.seen = float(
            _tick_kernel(self._stepper, self._rows, NOTHING, 0.0, 0.0)
        )  # m, by the sensor

    @property
    def depth(self) -> float:
        """Depth of the pressure sensor [m]."""
        return float(self._x[Now.Z])

    @property
    def volume(self) -> float:
        """Volume [m3]."""
        return float(self._x[Now.V])

    def move(self, command: float, tick: float, *, wide: bool = False) -> None:
        """Move by a tick [s] under its command [s]; wide: a negative one opens the bypass."""
        doing = _DOES[int(np.sign(command))]
        if wide and command < 0.0:
            doing = int(Doing.BYPASSING)
        whole = abs(command) >= (1.0 - 1e-6) * tick
        self.time += tick
        length = math.inf if whole else abs(command)
        self.seen = _tick_kernel(self._stepper, self._rows, doing, length, self.time)
        if self._at[STOP] != 0:
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
    found = np.zeros((len(asked), 4))
    for n, reference in enumerate(asked):
        seen = plant.seen
        command, wide = board(Measurement(n * tick, seen, math.nan), float(reference))
        found[n] = plant.depth, seen, plant.volume, command
        plant.move(command, tick, wide=wide)
        if progress is not None:
            progress(n + 1)
    return found
