"""Layered water as a vehicle or a filter meets it: what it adds to the neutral volume, over depth.

In water of constant density the neutral volume is psi z + V0, eq. (31). What layers of salt and
heat, and a hull that is not linear, make of it beside that stands in a table over depth.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.seawater import look_up
from swimbladder.physics.seawater.column import look_up_bent, slopes
from swimbladder.sim.engine.cache import part

Array = NDArray[np.float64]


class Layers(NamedTuple):
    """What layers of the water add to the neutral volume psi z + V0 over depth; kernels take it."""

    table: Array  # [n, 2], m3 and its slope m3/m, at depths from 0; no rows: no layers
    step: float  # m, from row to row
    steepest: float  # m3/m, no slope is steeper: for the length of a step
    largest: float  # m3, no volume of the table is larger

    def at(self, depth: float) -> float:
        """Return what is added at a depth [m3]."""
        return look_up(self.table, self.step, 0, depth)[0] if len(self.table) else 0.0

    def along(self, depth: Array) -> Array:
        """Return what is added at depths [m3] [n]."""
        return np.array([self.at(float(z)) for z in depth])

    def integral(self, depth: float) -> float:
        """Return the integral of what is added from depth 0 to `depth` [m4], exactly."""
        if not len(self.table):
            return 0.0
        h = self.step
        v, dv = self.table[:, 0], self.table[:, 1]
        # a cubic over a row: the trapezoid and a term of its slopes
        whole = h * (v[:-1] + v[1:]) / 2.0 + h * h * (dv[:-1] - dv[1:]) / 12.0
        k = int(min(max(depth / h, 0.0), len(v) - 1))
        added, slope = look_up(self.table, h, 0, depth)
        rest = depth - k * h
        part_of_row = rest * (v[k] + added) / 2.0 + rest * rest * (dv[k] - slope) / 12.0
        return float(whole[:k].sum() + part_of_row)


NO_LAYERS = Layers(np.empty((0, 2)), 1.0, 0.0, 0.0)

_look_up_bent = part(look_up_bent)


def layers_from(volume: Array, step: float) -> Layers:
    """Return layers of volumes [m3] [n] at depths 0, step, 2 step, ... [m]."""
    slope = slopes(volume, step)
    # between two rows no slope of theirs is beyond 3 secants (Fritsch and Carlson, 1980)
    secant = 3.0 * np.abs(np.diff(volume)).max() / step
    steepest = max(float(secant), float(np.abs(slope).max()))
    table = np.ascontiguousarray(np.stack([volume, slope], axis=1))
    return Layers(table, step, steepest, float(np.abs(volume).max()))


@part
def layered(layers: Any, z: float) -> Any:
    """Return what layers add to the neutral volume [m3] at depth z [m], and its slope [m3/m]."""
    if layers.table.shape[0] == 0:
        return 0.0, 0.0
    added, slope, _ = _look_up_bent(layers.table, layers.step, 0, z)
    return added, slope
