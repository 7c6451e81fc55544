"""One record through many vehicles at once: depths only, for fits and their sensitivities."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.advance import follow
from swimbladder.sim.engine.cache import allocating, compiled
from swimbladder.sim.engine.chain import (
    COEFFICIENTS,
    LEVELS,
    accept,
    base_steps,
    build_chain,
    copy,
    leap,
)
from swimbladder.sim.engine.crossings import may_hide
from swimbladder.sim.engine.layers import NO_LAYERS
from swimbladder.sim.engine.modes import COUNT, Z_BOTTOM, Z_SURFACE, Act, first_mode

Array = NDArray[np.float64]
_PRESCRIBED = int(Act.PRESCRIBED)
_FEW = 8  # halvings: without a motor the rates are those of drag and of psi
_DEEPEST = 50.0  # m below the start, for the volume that psi may take


@allocating
def _submerged(p, layers, start, parts, nonlinear, spans, place, volume, chain, tables, depth):  # type: ignore[no-untyped-def]
    """Follow a volume as long as nothing happens on the way; return whether nothing did.

    place [n - 1]: which of the different spans an interval has; tables [spans, 2, COEFFICIENTS]:
    room for their exponentials.
    """
    x, y = np.zeros(5), np.zeros(10)
    x[2], x[3] = start[2], start[3]
    n = volume.shape[0]
    ready = np.zeros(tables.shape[0], np.uint8)
    for k in range(n):
        depth[k] = x[2]
        if not (x[2] > p[Z_SURFACE] and x[2] < p[Z_BOTTOM]):
            return False
        if k == n - 1:
            break
        x[0], x[1] = (volume[k + 1] - volume[k]) / spans[k], volume[k]
        h = spans[k] / parts[k]
        table = tables[place[k]]
        if ready[place[k]] == 0:
            build_chain(p, _PRESCRIBED, h, chain)
            copy(chain, table)
            ready[place[k]] = 1
        for _ in range(parts[k]):
            bends = leap(table, 0, p, layers, nonlinear, x, 0.0, y)
            if bends or may_hide(p, layers, _PRESCRIBED, x, y, h):
                return False
            accept(x, y)
    return True


@compiled
def _bundle(  # type: ignore[no-untyped-def]
    plants,
    layers,
    starts,
    parts,
    nonlinear,
    time,
    spans,
    place,
    inputs,
    ramps,
    tables,
    chains,
    built,
    depth,
):
    """Follow the record with every vehicle; depth [lanes, n] stays NaN where one stopped."""
    record = np.empty((7, time.shape[0]))
    nothing = np.zeros(0)
    log, noted = np.zeros((0, 3)), np.zeros(1, np.int64)
    few = np.empty((_FEW + 1, COEFFICIENTS))  # no event is looked for where nothing happens
    x = np.zeros(5)
    for i in range(plants.shape[0]):
        p = plants[i]
        if ramps and _submerged(
            p, layers, starts[i], parts, nonlinear, spans, place, inputs, few, tables, depth[i]
        ):
            continue
        depth[i] = np.nan
        mode, q = first_mode(p, layers, starts[i, 0], starts[i, 1], starts[i, 2], starts[i, 3], 0.0)
        x[0], x[1], x[2], x[3], x[4] = q, starts[i, 1], starts[i, 2], starts[i, 3], 0.0
        if ramps:
            mode = mode - mode % 10 + _PRESCRIBED
            x[0] = starts[i, 0]
        built[:] = 0
        reached, _ = follow(
            p,
            layers,
            parts,
            nonlinear,
            mode,
            x,
            time,
            inputs,
            ramps,
            record,
            nothing,
            log,
            noted,
            chains,
            built,
        )
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
        self.least, self.most = float(np.min(inputs)), float(np.max(inputs))
        self.inputs, self.ramps = np.ascontiguousarray(inputs, float), ramps

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
            reach = base._replace(V_min=self.least - lost, V_max=self.most + lost, psi=0.0)
        else:
            reach = base
        nonlinear = math.isfinite(base.epsilon)
        fastest = float(np.abs(starts[:, 3]).max())
        depth = np.full((len(plants), len(self.time)), np.nan)
        try:
            steps = np.array(
                [base_steps(reach, h, fastest) for h in self.different.tolist()], np.int64
            )
        except InputError:  # far from any vehicle: a search looks elsewhere
            return depth
        _bundle(
            np.array(plants),
            NO_LAYERS,
            starts,
            steps[self.place],
            nonlinear,
            self.time,
            self.spans,
            self.place,
            self.inputs,
            self.ramps,
            np.empty((len(self.different), 2, COEFFICIENTS)),
            np.empty((COUNT, LEVELS + 1, COEFFICIENTS)),
            np.zeros(COUNT, np.uint8),
            depth,
        )
        return depth
