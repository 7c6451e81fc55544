"""One vehicle driven by recorded inputs, open loop."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.errors import InputError
from swimbladder.physics.actuator import refuse_pump_and_valve
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.single import check_start
from swimbladder.sim.closed_loop.solution import (
    SingleRun,
    Solution,
    StopReason,
    assemble,
    close_books,
    name_events,
)
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.sim.engine.advance import Inputs, follow, new_lane
from swimbladder.sim.engine.chain import book_steps
from swimbladder.vehicle import Vehicle


def drive(
    vehicle: Vehicle,
    *,
    time: ArrayLike,
    volume: ArrayLike | None = None,
    voltage: ArrayLike | None = None,
    start_depth: float,
    start_speed: float = 0.0,
    start_volume: float | None = None,
    bottom_depth: float = math.inf,
    column: Column | None = None,
) -> Solution:
    """Simulate the motion under a recorded volume or voltage, at the record's own instants.

    Exactly one of `volume` and `voltage` is given.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it, without pump and valve.
    time
        Instants [n] in s, growing, at any spacing.
    volume
        [n] in m3: linear between instants, as if the actuator followed it exactly; none: a voltage
        drives.
    voltage
        [n] in V: held until the next instant; none: a volume drives.
    start_depth
        Depth at the first instant [m].
    start_speed
        Speed there [m/s], positive down.
    start_volume
        Of a voltage: volume from which the motor starts [m3]; none: neutral.
    bottom_depth
        Depth of the bottom [m]; infinite: there is none.
    column
        The water, see `closed_loop.water`; none: the vehicle's own.

    Returns
    -------
    Solution
        The run at the record's instants, until it ends or stops.

    Raises
    ------
    InputError
        Not exactly one input is given, or it is not of the length of time and finite; or vehicle,
        start and input do not go together.
    """
    t = np.ascontiguousarray(time, float)
    given = {"volume": volume, "voltage": voltage}
    named = [name for name, values in given.items() if values is not None]
    if len(named) != 1:
        raise InputError("give either a volume or a voltage", field="volume, voltage")
    if volume is not None and start_volume is not None:
        what = "a prescribed volume brings its own start"
        remedy = "Leave start_volume out: the first entry of volume is the start"
        raise InputError(what, field="start_volume", value=start_volume, unit="m3", remedy=remedy)
    inputs = np.ascontiguousarray(given[named[0]], float)
    _check(t, inputs, named[0])
    if voltage is not None and not vehicle.voltage_driven:
        raise InputError(
            "a positioner is not driven by a voltage", field="voltage", remedy="Give the volume"
        )
    refuse_pump_and_valve(vehicle.engine)
    medium = medium_of(vehicle, column, reach=start_depth, bottom_depth=bottom_depth)
    if volume is not None:
        start_volume = float(inputs[0])
        unbound = replace(medium, plant=medium.plant._replace(V_min=-math.inf, V_max=math.inf))
        start = check_start(unbound, start_depth, start_volume, start_speed)
    else:
        start = check_start(medium, start_depth, start_volume, start_speed)
    ramps, p = volume is not None, medium.plant
    lane = new_lane(np.array(p), medium.layers, start, booked=True)
    spans, place = np.unique(np.diff(t), return_inverse=True)
    parts = [book_steps(p, h, start[3], medium.layers) for h in spans.tolist()]
    record = np.full((7, len(t)), np.nan)
    reached, why = follow(lane, Inputs(t, inputs, ramps, np.array(parts, np.int64)[place]), record)
    if ramps:
        record[5] = np.nan
    law, stop = f"none (recorded {'volume' if ramps else 'voltage'})", list(StopReason)[why]
    unasked = np.full(reached, np.nan)
    run = SingleRun(law, stop, t[:reached], unasked, record[:, :reached])
    closed = close_books(vehicle, medium, lane.books, start, lane.x[:4], prescribed=ramps)
    return assemble(vehicle, p, run, name_events(lane.log, int(lane.noted[0])), closed)


def _check(t: Any, inputs: Any, name: str) -> None:
    if t.ndim != 1 or len(t) < 2:
        raise InputError("needs at least two instants", field="time", unit="s")
    if inputs.shape != t.shape:
        what = f"has the shape {inputs.shape}, time has {t.shape}"
        raise InputError(what, field=name, remedy="Give one value per instant")
    for field, values in (("time", t), (name, inputs)):
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(
                f"entry {bad[0]} is not a finite number", field=field, value=float(values[bad[0]])
            )
    wrong = np.flatnonzero(np.diff(t) <= 0.0)
    if wrong.size:
        what = f"must grow, but entry {wrong[0] + 1} does not"
        raise InputError(what, field="time", value=float(t[wrong[0] + 1]), unit="s")
