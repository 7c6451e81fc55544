"""One record through many vehicles at once: depths only, for fits and their sensitivities."""

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.advance import Inputs, ModeLane, follow, new_lane
from swimbladder.sim.engine.cache import compiled, part
from swimbladder.sim.engine.chain import COEFFICIENTS, accept, base_steps, build_chain, leap
from swimbladder.sim.engine.chain import copy as copy_chain
from swimbladder.sim.engine.crossings import may_hide
from swimbladder.sim.engine.layers import NO_LAYERS
from swimbladder.sim.engine.modes import PRESCRIBED, Z_BOTTOM, Z_SURFACE

Array = NDArray[np.float64]
_FEW = 8  # halvings: without a motor the rates are those of drag and of psi
_DEEPEST = 50.0  # m below the start, for the volume that psi may take


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
        x[0], x[1] = (volume[k + 1] - volume[k]) / span, volume[k]
        h, table = span / given.parts[k], spans.tables[place]
        if spans.ready[place] == 0:
            build_chain(p, PRESCRIBED, h, chain)
            copy_chain(chain, table)
            spans.ready[place] = 1
        for _ in range(given.parts[k]):
            bends = leap(table, 0, p, layers, x, 0.0, y)
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
        reached, _ = follow(lane, given, record)
        for k in range(reached):
            depth[i, k] = record[0, k]


class Course:
    """A record that vehicles are driven along: time [n] in s, and inputs [n].

    Where `ramps` the inputs are volumes [m3], linear between instants, else voltages [V], held.
    """

    def __init__(self, time: Array, inputs: Array, *, ramps: bool) -> None:
        # An even clock's spans differ by rounding; told apart, each would need exponentials.
        self.spans = np.round(np.diff(time), 9)
        self.different, self.place = np.unique(self.spans, return_inverse=True)
        self.time = np.concatenate([[0.0], np.cumsum(self.spans)])
        self.inputs, self.ramps = np.ascontiguousarray(inputs, float), ramps

    def along(self, inputs: Array) -> Self:
        """Return the same instants with other inputs."""
        other = copy(self)
        other.inputs = np.ascontiguousarray(inputs, float)
        return other

    def follow(self, plants: Sequence[Plant], starts: Array) -> Array:
        """Return the depths [lanes, n] in m of several vehicles along this record.

        starts [lanes, 4]: volume rate, volume, depth and speed at the first instant. After an
        instant at which a vehicle cannot be followed further its depths are NaN, and all are
        where its drag asks for more steps than can be. All lanes take the steps of the first, so
        that the differences between them are smooth.
        """
        base = plants[0]
        if self.ramps:  # the speeds that this volume can drive, not those of the whole stroke
            lost = abs(base.psi) * (float(np.abs(starts[:, 2]).max()) + _DEEPEST)
            least, most = float(np.min(self.inputs)), float(np.max(self.inputs))
            reach = base._replace(V_min=least - lost, V_max=most + lost, psi=0.0)
        else:
            reach = base
        fastest = float(np.abs(starts[:, 3]).max())
        depth = np.full((len(plants), len(self.time)), np.nan)
        try:
            steps = np.array(
                [base_steps(reach, h, fastest) for h in self.different.tolist()], np.int64
            )
        except InputError:  # far from any vehicle: a search looks elsewhere
            return depth
        count = len(self.different)
        tables, ready = np.empty((count, 2, COEFFICIENTS)), np.zeros(count, np.uint8)
        spans = Spans(self.spans, self.place, tables, ready)
        given = Inputs(self.time, self.inputs, self.ramps, steps[self.place])
        lane = new_lane(np.array(base), NO_LAYERS, starts[0])
        _bundle(lane, given, spans, np.array(plants), starts, depth)
        return depth
