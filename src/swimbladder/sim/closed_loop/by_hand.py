"""The compiled plant under a controller that is any Python function."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Law, Measurement
from swimbladder.errors import InputError
from swimbladder.sim.closed_loop.block import Block
from swimbladder.sim.closed_loop.lanes import LAW_NOT_FINITE
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.sim.engine.advance import DONE, begin, step_once
from swimbladder.sim.engine.chain import COEFFICIENTS, LEVELS
from swimbladder.sim.engine.modes import COUNT
from swimbladder.vehicle import Vehicle

__all__ = ["as_law", "run_by_hand"]


class _Nothing(NamedTuple):
    """What a Python function has for parameters and state, as far as the kernels know."""

    nothing: float = 0.0


def as_law(
    vehicle: Vehicle, function: Callable[..., Any], sample_time: float | None
) -> tuple[Law, _Nothing, float]:
    """Return (law, parameters, sample time [s]) that stand for a Python function.

    The sample time is the vehicle's controller's where not given; raises InputError without one.
    """
    if sample_time is None:
        if vehicle.controller is None:
            raise InputError("a Python law needs a sample time", field="sample_time", unit="s")
        sample_time = vehicle.controller.sample_time
    if not (math.isfinite(sample_time) and sample_time > 0.0):
        raise InputError(
            "must be a finite time above 0", field="sample_time", value=sample_time, unit="s"
        )
    law = Law(
        name=getattr(function, "__name__", type(function).__name__),
        summary="a Python function",
        command="voltage" if vehicle.voltage_driven else "volume",
        parameters=_Nothing,
        state=_Nothing,
        units={},
        step=function,
        initial=function,
    )
    return law, _Nothing(), sample_time


def run_by_hand(
    block: Block, function: Callable[..., Any], progress: Callable[[int], None] | None = None
) -> None:
    """Run a block of one lane under ``function(measurement, reference)``.

    It returns the command, or (command, next_sample_s).
    """
    work, tick, p = block.work[:, 0], block.clock.tick, block.work[Row.PLANT :, 0].copy()
    h = tick / block.parts
    x = np.zeros(5)
    x[:4] = work[Row.Q : Row.Q + 4]
    y = np.zeros(10)
    chains = np.empty((COUNT, LEVELS + 1, COEFFICIENTS))
    built = np.zeros(COUNT, np.uint8)
    mode, x[0] = begin(p, block.layers, x[0], x[1], x[2], x[3])
    command, wait = 0.0, 0.0
    noise = np.zeros((0, 2, 1))
    for k, turn in enumerate(block.clock.turn):
        if block.noise is not None:
            if k % 4096 == 0:
                noise = block._noise(4096)
            seen = _seen(work, x, noise[k % 4096, :, 0])
        else:
            seen = (x[2], x[1])
        if wait <= 0:
            said = function(
                Measurement(k * tick, float(seen[0]), float(seen[1])), float(block.depths[turn, 0])
            )
            command, wait = _understood(function, said, tick)
        wait -= 1
        applied = min(max(command, work[Row.LOW_U]), work[Row.HIGH_U])
        block.record[:, k, 0] = (x[2], x[3], x[1], x[0], command, applied, math.nan)
        if k == block.clock.ticks:
            break
        why = DONE if math.isfinite(command) else LAW_NOT_FINITE
        for part in range(block.parts):
            if why == DONE:
                mode, why = step_once(
                    p, block.layers, block.nonlinear, mode, x, y, applied, h, k * tick + part * h,
                    chains, built, block.books[0], block.log[0], block.noted[0],
                )  # fmt: skip
        if why != DONE:
            work[Row.STOPPED], work[Row.STOP_TICK] = why, k
            break
        if progress is not None and k % 256 == 0:
            progress(k)
    work[Row.Q : Row.Q + 4] = x[:4]


def _understood(function: Callable[..., Any], said: Any, tick: float) -> tuple[float, float]:
    """Return (command, ticks until the next call) of what a function returned."""
    try:
        command, following = said if isinstance(said, tuple) else (said, tick)
        command, ticks = float(command), float(following) / tick
    except (TypeError, ValueError):
        raise InputError(
            f"{getattr(function, '__name__', 'the function')} returned neither a command nor "
            "(command, next_sample_s)",
            field="law",
            value=said,
            remedy="Return volts (a positioner: m3), or these and the seconds until the next call",
        ) from None
    return command, math.ceil(ticks - 1e-9) if 1.0 < ticks < math.inf else max(1.0, ticks)


def _seen(work: Any, x: Any, noise: Any) -> tuple[float, float]:
    z = x[2] + work[Row.DEPTH_NOISE] * noise[0]
    v = x[1] + work[Row.VOLUME_NOISE] * noise[1]
    dz, dv = work[Row.DEPTH_QUANTUM], work[Row.VOLUME_QUANTUM]
    return (
        dz * math.floor(z / dz + 0.5) if dz > 0.0 else z,
        dv * math.floor(v / dv + 0.5) if dv > 0.0 else v,
    )
