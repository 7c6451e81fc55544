"""Any Python function as the law of the one loop: it is asked between ticks, the law holds it."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from swimbladder.control.law import Law, Measurement
from swimbladder.errors import InputError, check_number
from swimbladder.sim.closed_loop.block import Block
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.vehicle import Vehicle


class Held(NamedTuple):
    """What a Python function commands, as the kernels know it: a law's parameters, and its state.

    In the state it means nothing.
    """

    command: float = 0.0  # V or m3
    pause: float = 0.0  # s until the next call, of changes of volume, which are not held


def _step(
    parameters: Held, state: Held, _seen: Measurement, _reference: float
) -> tuple[float, Held, float]:
    return parameters.command, state, parameters.pause


def _initial(parameters: Held, _seen: Measurement, _reference: float) -> Held:
    return parameters


def as_law(
    vehicle: Vehicle, function: Callable[..., Any], sample_time: float | None
) -> tuple[Law, Held, float]:
    """Return (law, parameters, sample time [s]) that stand for a Python function.

    The sample time is the vehicle's controller's where not given; raises InputError without one.
    """
    if sample_time is None:
        if vehicle.controller is None:
            raise InputError("a Python law needs a sample time", field="sample_time", unit="s")
        sample_time = vehicle.controller.sample_time
    check_number(sample_time, "sample_time", "s", above=0.0)
    law = Law(
        name=getattr(function, "__name__", type(function).__name__),
        summary="a Python function",
        command=vehicle.command,
        parameters=Held,
        state=Held,
        step=_step,
        initial=_initial,
    )
    return law, Held(), sample_time


def run_function(
    block: Block, function: Callable[..., Any], progress: Callable[[int], None] | None = None
) -> None:
    """Run a block of one lane, of `as_law`, under ``function(measurement, reference)``.

    It returns the command, or (command, next_sample_s).
    """
    work, clock, wait = block.work[:, 0], block.clock, 0.0
    pumped = block.stepper is not None

    def ask(k: int) -> None:
        nonlocal wait
        if (work[Row.WAIT] if pumped else wait) <= 0.0:
            seen = Measurement(
                k * clock.tick, float(work[Row.SEEN_DEPTH]), float(work[Row.SEEN_VOLUME])
            )
            said = function(seen, float(block.depths[clock.turn[k], 0]))
            work[Row.LAW], wait = _understood(function, said, clock.tick)
            work[Row.LAW + 1] = wait * clock.tick if pumped else 0.0
        wait -= 1.0

    block.run(progress, ask=ask)


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
            remedy="Return volts (a positioner: m3; a pump and valve: a change of it, in m3), or "
            "these and the seconds until the next call",
        ) from None
    return command, math.ceil(ticks - 1e-9) if 1.0 < ticks < math.inf else max(1.0, ticks)
