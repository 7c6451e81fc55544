"""A float flown by the seconds of pump and valve that its board commands at each tick."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Measurement
from swimbladder.errors import NoAnswerError
from swimbladder.sim.closed_loop.block import Block, Schedule
from swimbladder.sim.closed_loop.floats import float_model
from swimbladder.sim.closed_loop.function import as_law, run_function
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]


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

    It is the float of `simulate`; at depth 0 it begins afloat with all volume out.
    board: (measured, depth asked for) -> (seconds of this tick, by the bypass). asked: the depth
    asked for at each tick [m] [n]. seed: of the depth sensor's noise; None: an ideal one.
    Raises NoAnswerError where the float leaves the water or goes deeper than any sea.
    """
    deepest, n = max(start_depth, *asked), len(asked)
    medium = medium_of(vehicle, None, reach=deepest)
    plants = np.array(medium.plant)[:, None]
    stepper, start = float_model(vehicle, medium, None, reach=deepest).lanes(
        {}, plants, np.array([start_depth]), np.array([math.nan]), np.zeros(1)
    )
    stepper, measured = stepper._replace(wide=np.zeros(1)), []

    def commanded(seen: Measurement, reference: float) -> float:
        """Return the board's command, for a volume that is not measured."""
        measured.append(seen.depth)
        command, stepper.wide[0] = board(seen._replace(volume=math.nan), reference)
        return command

    law, held, _ = as_law(vehicle, commanded, tick)
    ticks = np.arange(n, dtype=np.int64)
    block = Block.lay_out(
        plants=plants, law=law, parameters=held._asdict(),
        clock=Schedule(tick=tick, turn=ticks, given=ticks), parts=1, depths=asked[:, None],
        start=start, sensors=vehicle.sensors, seeds=None if seed is None else [[seed, 0]],
        record=True, stepper=stepper,
    )  # fmt: skip
    run_function(block, commanded, progress)
    if block.work[Row.STOPPED, 0] != 0.0:
        at = block.work[Row.STOP_TICK, 0] * tick
        raise NoAnswerError(
            f"The golden mission ended at {at:g} s, at {block.work[Row.Z, 0]:.4g} m: the float "
            "left the water, or went deeper than any sea"
        )
    depth, _, volume, _, command = block.record[:5, :, 0]
    return np.stack([depth, measured, volume, command], axis=1)
