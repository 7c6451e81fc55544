"""One vehicle driven by recorded inputs, open loop.

One record through many vehicles at once: depths only, for fits and their sensitivities.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.errors import InputError
from swimbladder.physics.actuator import refuse_pump_and_valve
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.single import check_start
from swimbladder.sim.closed_loop.solution import (
    SingleRun,
    Solution,
    StopReason,
    assemble,
    close_balance,
    name_events,
)
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.sim.engine.advance import Inputs, ModeLane, follow, may_hide, new_lane
from swimbladder.sim.engine.cache import compiled, part
from swimbladder.sim.engine.chain import (
    COEFFICIENTS,
    accept,
    build_chain,
    exponential_step,
    steps_of,
)
from swimbladder.sim.engine.chain import copy as copy_chain
from swimbladder.sim.engine.modes import NO_LAYERS, PRESCRIBED, Z_BOTTOM, Z_SURFACE
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
    cast: Column | None = None,
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
    cast
        The water, as `read_cast` or `cast_column` returns it; none: the vehicle's own.

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
        what = "a positioner is not driven by a voltage"
        raise InputError(what, field="voltage", remedy="Give the volume")
    refuse_pump_and_valve(vehicle.engine)
    medium = medium_of(vehicle, cast, reach=start_depth, bottom_depth=bottom_depth)
    ramps, p, within = volume is not None, medium.plant, medium
    if ramps:
        start_volume = float(inputs[0])
        within = replace(medium, plant=p._replace(V_min=-math.inf, V_max=math.inf))
    start = check_start(within, start_depth, start_volume, start_speed)
    lane = new_lane(np.array(p), medium.layers, start, booked=True)
    spans, place = np.unique(np.diff(t), return_inverse=True)
    parts = steps_of(p, spans, start[3], medium.layers, booked=True)
    record = np.full((7, len(t)), np.nan)
    reached, why = follow(lane, Inputs(t, inputs, ramps, parts[place]), record)
    if ramps:
        record[5] = np.nan
    law, stop = f"none (recorded {'volume' if ramps else 'voltage'})", list(StopReason)[why]
    unasked = np.full(reached, np.nan)
    run = SingleRun(law, stop, t[:reached], unasked, record[:, :reached])
    closed = close_balance(vehicle, medium, lane.accounts, start, lane.x[:4], prescribed=ramps)
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
            what = f"entry {bad[0]} is not a finite number"
            raise InputError(what, field=field, value=float(values[bad[0]]))
    wrong = np.flatnonzero(np.diff(t) <= 0.0)
    if wrong.size:
        what = f"must grow, but entry {wrong[0] + 1} does not"
        raise InputError(what, field="time", value=float(t[wrong[0] + 1]), unit="s")


_FEW = 8  # halvings: without a motor the rates are those of drag and of psi
_DEEPEST = 50.0  # m below the start, for the volume that psi may take
_MOST_STEPS = 1000  # between two samples: a drag that a search has lost


class Spans(NamedTuple):
    """The different spans of a record's intervals, and the exponentials of a ramp over each."""

    length: Array  # s, of each interval [n - 1]
    place: NDArray[np.int64]  # which of the different spans it has [n - 1]
    tables: Array  # [spans, 2, COEFFICIENTS], room for the exponentials
    ready: NDArray[np.uint8]  # [spans], 1: they are made


@part
def _submerged(lane: ModeLane, given: Inputs, spans: Spans, start: Array, depth: Array) -> bool:
    """Follow a volume as long as nothing happens on the way; return whether nothing did."""
    p, layers, x, y, volume = lane.p, lane.layers, lane.x, lane.y, given.values
    drift = start[4]
    # no event is looked for where nothing happens
    chain = lane.chains[PRESCRIBED][: _FEW + 1]
    x[2], x[3] = start[2], start[3]
    n = volume.shape[0]
    spans.ready[:] = 0
    for k in range(n):
        depth[k] = x[2]
        if not (x[2] > p[Z_SURFACE] and x[2] < p[Z_BOTTOM]):
            return False
        if k == n - 1:
            break
        span, place = spans.length[k], spans.place[k]
        x[0] = (volume[k + 1] - volume[k]) / span - drift
        x[1] = volume[k] - drift * given.time[k]
        h, table = span / given.parts[k], spans.tables[place]
        if spans.ready[place] == 0:
            build_chain(p, PRESCRIBED, h, chain)
            copy_chain(chain, table)
            spans.ready[place] = 1
        for _ in range(given.parts[k]):
            bends = exponential_step(table, 0, p, layers, x, 0.0, y)
            if bends or may_hide(p, layers, PRESCRIBED, x, y, h):
                return False
            accept(x, y)
    return True


@compiled
def _bundle(
    lane: ModeLane, given: Inputs, spans: Spans, plants: Array, starts: Array, depth: Array
) -> None:
    """Follow the record with every vehicle; depth [lanes, n] stays NaN where one stopped.

    lane: room for each of them.
    """
    record = np.empty((7, given.time.shape[0]))
    for i in range(plants.shape[0]):
        for n in range(plants.shape[1]):
            lane.p[n] = plants[i, n]
        if given.ramps and _submerged(lane, given, spans, starts[i], depth[i]):
            continue
        depth[i] = np.nan
        for n in range(4):
            lane.x[n] = starts[i, n]
        lane.x[4] = 0.0
        own = given.values - starts[i, 4] * given.time
        inputs = Inputs(given.time, own, given.ramps, given.parts)
        reached, _ = follow(lane, inputs, record)
        for k in range(reached):
            depth[i, k] = record[0, k]


class Course:
    """A record that vehicles are driven along: time [n] in s, and inputs [n].

    Where `ramps` the inputs are volumes [m3], linear between instants, else voltages [V], held.
    """

    def __init__(
        self, time: Array, inputs: Array, *, ramps: bool, since: float | None = None
    ) -> None:
        # An even clock's spans differ by rounding; unrounded, each would need exponentials.
        self.spans = np.round(np.diff(time), 9)
        self.different, self.place = np.unique(self.spans, return_inverse=True)
        begun = 0.0 if since is None else float(time[0]) - since
        self.time = begun + np.concatenate([[0.0], np.cumsum(self.spans)])
        self.inputs, self.ramps = np.ascontiguousarray(inputs, float), ramps

    def follow(self, plants: Sequence[Plant], starts: Array) -> Array:
        """Return the depths [lanes, n] in m of several vehicles along this record.

        starts [lanes, 4]: volume, where a voltage drives, depth and speed at the first instant,
        and how fast what is neutral grows from `since` on [m3/s], where a volume drives. After an
        instant at which a vehicle cannot be followed further its depths are NaN, and all are
        where its drag asks for more steps than can be. All lanes take the steps of the first, so
        that the differences between them are smooth.
        """
        base = reach = plants[0]
        fastest = float(np.abs(starts[:, 2]).max())
        if self.ramps:  # the speeds that this volume can drive, not those of the whole stroke
            lost = abs(base.psi) * (float(np.abs(starts[:, 1]).max()) + _DEEPEST)
            moved = self.inputs - starts[0, 3] * self.time
            least, most = float(np.min(moved)), float(np.max(moved))
            reach = base._replace(V_min=least - lost, V_max=most + lost, psi=0.0)
        depth = np.full((len(plants), len(self.time)), np.nan)
        try:
            steps = steps_of(reach, self.different, fastest)
        except InputError:  # far from any vehicle: a search looks elsewhere
            return depth
        if steps.max() > _MOST_STEPS:
            return depth
        count = len(self.different)
        tables, ready = np.empty((count, 2, COEFFICIENTS)), np.zeros(count, np.uint8)
        spans = Spans(self.spans, self.place, tables, ready)
        given = Inputs(self.time, self.inputs, self.ramps, steps[self.place])
        begin = np.zeros((len(plants), 5))  # the volume's rate before
        begin[:, 1:] = starts
        if self.ramps:
            begin[:, 0] = (self.inputs[1] - self.inputs[0]) / self.spans[0] - starts[:, 3]
            begin[:, 1] = self.inputs[0] - starts[:, 3] * self.time[0]
        lane = new_lane(np.array(base), NO_LAYERS, begin[0, :4])
        _bundle(lane, given, spans, np.array(plants), begin, depth)
        return depth
