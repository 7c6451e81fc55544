"""One vehicle under its controller (Fig. 15), sampled, with the input held between samples.

The law may be any Python function: it is asked between ticks, and a law of the loop holds what it
said.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Law, Measurement, leaf_names, leaves
from swimbladder.control.registry import check_command, own_law
from swimbladder.errors import InputError, check_counts, check_number
from swimbladder.io.mission import Mission, of_step, step_mission
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.actuator import refuse_pump_and_valve
from swimbladder.physics.arrays import Array
from swimbladder.physics.hull import check_mass
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.cast import check_cast_unit
from swimbladder.sim.closed_loop.block import Block, schedule
from swimbladder.sim.closed_loop.checks import check_depths, check_dive, check_sample_time
from swimbladder.sim.closed_loop.floats import float_model, flown_law, run_float
from swimbladder.sim.closed_loop.lane import Row
from swimbladder.sim.closed_loop.solution import (
    SingleRun,
    Solution,
    StopReason,
    assemble,
    close_balance,
    name_events,
)
from swimbladder.sim.closed_loop.water import Medium, medium_of
from swimbladder.sim.engine.chain import base_steps
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


def run_function(block: Block, function: Callable[..., Any], advance: Advance = silent) -> None:
    """Run a block of one lane, of `as_law`, under ``function(measurement, reference)``.

    It returns the command, or (command, next_sample_s).
    """
    work, clock, wait = block.work[:, 0], block.clock, 0.0
    pumped = block.stepper is not None

    def ask(k: int) -> None:
        """Call the function at tick k if its time has come, and put its command into the block."""
        nonlocal wait
        if (work[Row.WAIT] if pumped else wait) <= 0.0:
            seen = Measurement(
                k * clock.tick, float(work[Row.SEEN_DEPTH]), float(work[Row.SEEN_VOLUME])
            )
            reference = float(block.depths[clock.turn[k], 0])
            said = function(seen, block.watch.allowed(reference) if block.watch else reference)
            work[Row.LAW], wait = _understood(function, said, clock.tick)
            work[Row.LAW + 1] = wait * clock.tick if pumped else 0.0
        wait -= 1.0

    block.run(advance, ask=ask)


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


def simulate(
    vehicle: Vehicle,
    mission: Mission | None = None,
    *,
    step: tuple[float, float] | None = None,
    setpoints: Sequence[tuple[float, float]] | None = None,
    duration: float | None = None,
    start_depth: float | None = None,
    start_volume: float | None = None,
    start_speed: float = 0.0,
    bottom_depth: float = math.inf,
    seed: int | None = None,
    law: Law | Callable[..., Any] | None = None,
    parameters: Any = None,
    sample_time: float | None = None,
    parts: int | None = None,
    cast: Column | None = None,
    checked: bool = True,
    supervised: bool | None = None,
    advance: Advance = silent,
) -> Solution:
    """Simulate the vehicle's motion under its controller, from rest unless a speed is given.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    mission
        Set-points, start, duration and bottom from a file, in place of the following.
    step
        Depths (from, to) [m]; none, without set-points: 1.5 to 3 m, of a float with pump and valve
        a dive from the surface to 500 m at most and back.
    setpoints
        (time [s], depth [m]), the first at 0, in the order of their times.
    duration
        How long it goes on [s], rounded up to whole samples; none: 400 s, a float's dive as long as
        it needs.
    start_depth
        Depth at the start [m]; none: that of the step.
    start_volume
        Volume at the start [m3]; none: neutral at start_depth.
    start_speed
        Speed at the start [m/s], positive down.
    bottom_depth
        Depth of the bottom [m]; infinite: there is none.
    seed
        Of noise and quanta of the vehicle's sensors; none: ideal sensors.
    law
        A Law, or any Python function ``law(measurement, reference) -> command`` (volts, or m3 for a
        positioner; of a pump and valve a change of volume in m3); none: the vehicle's own
        controller.
    parameters
        Of a Law that is given.
    sample_time
        Of the law [s]; none: that of the vehicle's controller. Needed with a law that the vehicle
        does not have.
    parts
        Steps that a sample is divided into; none: chosen from the drag. Refused for a pump and
        valve.
    cast
        The water, as `read_cast` or `cast_column` returns it; none: the vehicle's own.
    checked
        Whether to refuse depths beyond rating or stroke, a mass that no water carries, and a sample
        time at which the vehicle's own law does not hold it.
    supervised
        Whether the law flies under the vehicle's supervisor, as flashed; none: if the vehicle has a
        table of it and the law is no Python function.
    advance
        Called with the share of the time that was simulated since.

    Returns
    -------
    Solution
        The run at its samples, until it ends or stops.

    Raises
    ------
    InputError
        What is refused as above, a start outside water or stroke, unordered set-points, no
        controller, or a column that ends above a depth asked for.
    NoAnswerError
        A vehicle that floats cannot dive.
    """
    if not callable(law) or isinstance(law, Law):
        chosen, numbers, tick = choose_law(vehicle, law, parameters, sample_time, pumped=True)
        function = None
    else:
        chosen, numbers, tick = as_law(vehicle, law, sample_time)
        function, supervised = law, bool(supervised)
    check_counts(seed=(seed, 0), parts=(parts, 1))
    asked = {"step": step, "setpoints": setpoints, "duration": duration}
    asked |= {"start_depth": start_depth, "bottom_depth": bottom_depth}
    task = _task(vehicle, mission, asked)
    with of_step(setpoints is None and mission is None):
        times, depths = check_setpoints(task.setpoints, task.duration, tick)
        reach = max(task.start_depth, *depths)
        medium = medium_of(vehicle, cast, reach=reach, bottom_depth=task.bottom_depth)
        p, layers = medium.plant, medium.layers
        if checked:
            check_mass(vehicle)
            if cast is not None and cast.cast is not None:
                check_cast_unit(cast.cast, reach, vehicle.hull.depth_limit)
            neutral_at = task.start_depth if start_volume is None else None
            check_depths(vehicle, medium, setpoints=depths, start_depth=neutral_at)
            shallowest = min([task.start_depth, *depths[:-1]])
            if vehicle.command == "volume change" and shallowest <= 0.0 < reach:
                check_dive(vehicle)
            if law is None and vehicle.command != "volume change":
                every = [task.start_depth, *depths]
                check_sample_time(vehicle, chosen, numbers, tick, depths=every)
        start = check_start(medium, task.start_depth, start_volume, start_speed)
    clock = schedule(times, task.duration, tick)
    pumped = vehicle.command == "volume change"
    if pumped and supervised and function is not None:
        what = "the board under a supervisor takes seconds of pump and valve, from its own law"
        remedy = "Leave it out, or fly a Law"
        raise InputError(what, field="supervised", value=supervised, remedy=remedy)
    chosen, numbers, watch = flown_law(vehicle, chosen, numbers, tick, supervised)
    values = {name: np.array([value]) for name, value in leaves(numbers).items()}
    lay_out = partial(
        Block,
        plants=np.array(p)[:, None],
        law=chosen,
        parameters=values,
        clock=clock,
        depths=np.array(depths)[:, None],
        sensors=vehicle.sensors,
        seeds=None if seed is None else [[seed, 0]],
        recorded=True,
        layers=layers,
        watch=watch,
    )
    fly = partial(run_single, function=function, advance=advance)
    if pumped:
        if parts is not None:
            what = "the steps of a float are as long as its motion lets"
            raise InputError(what, field="parts", value=parts, remedy="Leave it out")
        model = float_model(vehicle, medium, cast, reach=reach, seconds=bool(watch))
        start[1] = math.nan if start_volume is None else start_volume
        with of_step(setpoints is None and mission is None):
            return run_float(model, values, start[:, None], clock.ticks, lay_out, fly)
    parts = parts or base_steps(p, tick, start_speed, layers, booked=True)
    block = lay_out(parts=parts, start=start[:, None], booked=True, logged=True)
    run = fly(block)
    balance = close_balance(
        vehicle, medium, block.accounts[0], start, block.work[Row.Q : Row.Q + 4, 0]
    )
    return assemble(vehicle, p, run, name_events(block.log[0], int(block.noted[0, 0])), balance)


def run_single(block: Block, function: Callable[..., Any] | None, advance: Advance) -> SingleRun:
    """Run a block of one vehicle to its end, by its law or by a function in its place."""
    if function is None:
        block.run(advance)
    else:
        run_function(block, function, advance)
    stop, clock = list(StopReason)[int(block.work[Row.STOPPED, 0])], block.clock
    n = clock.ticks + 1 if stop is StopReason.FINISHED else int(block.work[Row.STOP_TICK, 0]) + 1
    time = np.arange(n, dtype=np.float64) * clock.tick
    reference = block.depths[clock.turn[:n], 0]
    record, supervised = block.record[:, :n, 0], bool(block.watch)
    alarm = block.watch.alarm(clock.tick) if block.watch else None
    return SingleRun(block.law.name, stop, time, reference, record, supervised, alarm)


def choose_law(
    vehicle: Vehicle,
    law: Law | None,
    parameters: Any,
    sample_time: float | None,
    *,
    pumped: bool = False,
) -> tuple[Law, Any, float]:
    """Return (law, parameters, sample time [s]): those given, or the vehicle's controller.

    pumped: take a pump and valve too. Raises InputError where there is none, or where the law
    commands what the actuator cannot do.
    """
    if law is not None and not isinstance(law, Law):
        remedy = "Give a Law, a Python function, or nothing for the vehicle's own controller"
        raise InputError("not a control law", field="law", value=law, remedy=remedy)
    if law is None:
        own = vehicle.controller
        if own is not None and sample_time is not None:
            own = own.model_copy(update={"sample_time": sample_time})
            vehicle = vehicle.model_copy(update={"controller": own})
        law, bound = own_law(vehicle, sampled=not pumped)
        assert own is not None  # own_law
        tick = own.sample_time
        parameters = bound if parameters is None else parameters
    elif parameters is None or sample_time is None:
        raise InputError(
            "a law needs its parameters and its sample time",
            field="parameters" if parameters is None else "sample_time",
            remedy=f"Give parameters={law.parameters.__name__}(...) and sample_time in seconds",
        )
    else:
        tick = sample_time
    check_number(tick, "sample_time", "s", above=0.0)
    if not isinstance(parameters, law.parameters):
        what = f"not the parameters of the law {law.name!r}"
        remedy = f"Give a {law.parameters.__name__}: {', '.join(leaf_names(law.parameters))}"
        raise InputError(what, field="parameters", value=parameters, remedy=remedy)
    if not pumped:
        refuse_pump_and_valve(vehicle.engine)
    check_command(law, vehicle)
    return law, parameters, tick


def check_start(medium: Medium, depth: float, volume: float | None, speed: float) -> Array:
    """Return the first state (q, V, z, w); raises InputError where it cannot be."""
    p = medium.plant
    neutral = medium.neutral_volume(depth) if volume is None else volume
    check_number(depth, "start_depth", "m")
    check_number(neutral, "start_volume", "m3")
    check_number(speed, "start_speed", "m/s")
    if math.isnan(p.z_bottom):
        what = "not a number"
        remedy = "Give the depth of the bottom, or leave it out"
        raise InputError(what, field="bottom_depth", value=p.z_bottom, unit="m", remedy=remedy)
    problem = partial(InputError, field="start_depth", value=depth, unit="m")
    if depth > p.z_bottom:
        raise problem(
            f"the start is below the bottom at {p.z_bottom:g} m", remedy="Start above the bottom"
        )
    if depth <= p.z_air:
        raise problem(
            "the vehicle starts outside the water", remedy="Start at the surface or below"
        )
    if not p.V_min <= neutral <= p.V_max:
        raise problem(
            f"the stroke, {p.V_min * 1e6:g} to {p.V_max * 1e6:g} cm3, does not hold "
            + ("this volume" if volume is not None else f"the neutral volume at {depth:g} m"),
            field="start_volume" if volume is not None else "start_depth",
            value=neutral,
            unit="m3",
            remedy="Start where the stroke can balance the vehicle, or give a start volume",
        )
    return np.array([0.0, neutral, depth, speed])


class _Task(NamedTuple):
    """What a run is asked to do."""

    setpoints: Sequence[tuple[float, float]]
    duration: float  # s
    start_depth: float  # m
    bottom_depth: float  # m


def _task(vehicle: Vehicle, mission: Mission | None, asked: dict[str, Any]) -> _Task:
    """Return what is asked for, in one of three ways; raises InputError where two say it."""
    bottom = asked["bottom_depth"]
    given = {**asked, "bottom_depth": None if bottom == math.inf else bottom}
    given = {name: value for name, value in given.items() if value is not None}
    said = {} if mission is None else dict.fromkeys(asked, "the mission says this already")
    if mission is None and "setpoints" in given:
        said = {"step": "the set-points say this already"}
    elif mission is None and "step" in given:
        said = {"start_depth": "the step begins there"}
    for name in sorted(said.keys() & given):
        raise InputError(said[name], field=name, value=given[name], remedy="Leave one of them out")
    if "setpoints" not in given:
        task = step_mission(vehicle, **given) if mission is None else mission
        return _Task(task.pairs, task.span, task.start_depth, task.bottom)
    for name, unit in (("duration", "s"), ("start_depth", "m")):
        if name not in given:
            raise InputError(
                "with set-points it is needed", field=name, unit=unit, remedy="Give it"
            )
    return _Task(given["setpoints"], given["duration"], given["start_depth"], bottom)


def check_setpoints(
    setpoints: Sequence[tuple[float, float]], duration: float, tick: float
) -> tuple[list[float], list[float]]:
    """Return times [s] and depths [m]; raises InputError where they are not a schedule."""
    check_number(duration, "duration", "s", above=0.0)
    too = partial(InputError, field="duration", value=duration, unit="s")
    if duration < tick:
        what = f"the duration is shorter than one sample of {tick:g} s"
        raise too(what, remedy="Lengthen it, or shorten the sample time")
    if duration / tick > 1e8:
        what = f"this is {duration / tick:.2g} samples"
        raise too(what, remedy="Simulate at most 100 million samples at a time")
    problem = partial(InputError, field="setpoints")
    if not setpoints:
        raise problem("no set-point", remedy="Give at least (0, depth)")
    try:
        times = [float(time) for time, _ in setpoints]
        depths = [float(depth) for _, depth in setpoints]
    except (TypeError, ValueError):
        remedy = "Give pairs of numbers: [(0.0, 3.0), (200.0, 1.5)]"
        raise problem(
            "not a list of (time, depth)", value=setpoints, unit="s, m", remedy=remedy
        ) from None
    if not all(map(math.isfinite, times + depths)):
        raise problem("not a finite number", value=list(setpoints))
    if times[0] != 0.0:
        raise problem("the first set-point must be given at time 0", value=times[0], unit="s")
    if any(b <= a for a, b in itertools.pairwise(times)):
        raise problem("the times of the set-points must grow", value=times, unit="s")
    return times, depths
