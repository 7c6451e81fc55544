"""The layers of a cast as a vehicle meets them: what they add to psi z + trim_error."""

import math
from collections.abc import Sequence

import numpy as np

from swimbladder.errors import InputError
from swimbladder.estimation.kalman.depth_filter import follow
from swimbladder.estimation.series import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.hull import along_hull, neutral_volume
from swimbladder.physics.seawater import Column
from swimbladder.sim.engine.layers import Layers, layers_from
from swimbladder.vehicle import Vehicle

_QUICKEST = 5.0  # of a span between samples times the rate of the motion: a hundred steps
_LOST = 50.0  # m off, where a search has lost the log


def water_of_each(logs: int, columns: Sequence[Column]) -> tuple[Column | None, ...]:
    """Return the water of each of so many logs: that of the only cast, or of each its own.

    Raises InputError where there are several casts and not as many as logs.
    """
    if len(columns) <= 1:
        return (columns[0] if columns else None,) * logs
    if len(columns) != logs:
        what = f"{len(columns)} casts for {logs} log{'s' if logs > 1 else ''}"
        remedy = "Give one cast for all logs, or one for each in their order"
        raise InputError(what, field="--cast", remedy=remedy)
    return tuple(columns)


def layers_of(vehicle: Vehicle, column: Column) -> Layers:
    """Return what the water of a column adds to the neutral volume psi z + trim_error.

    Nothing in the vehicle's own [water]: trim_error keeps its meaning, neutral at the surface of
    that, and psi is what the hull loses beyond the column's water. Parts of the hull and trapped
    air are left to psi, as the motion has them. The density is that of `along_hull`.
    """
    bare = vehicle.hull.model_copy(update={"psi": 0.0, "parts": (), "trapped_air": 0.0})
    plain = vehicle.model_copy(update={"hull": bare})
    volume = neutral_volume(plain, along_hull(column, vehicle.hull)) - vehicle.trim_error
    return layers_from(volume, column.step)


def follow_in(
    layers: Layers, plants: Sequence[Plant], time: Array, volume: Array, starts: Array
) -> Array:
    """Return the depths [lanes, n] in m of vehicles in layered water, as `kalman` has it.

    starts [lanes, 2]: depth [m] and speed [m/s]. nan from where a vehicle left the water, and
    throughout where the first of them is quicker than any: a search that tried it looks elsewhere.
    """
    p = plants[0]
    spare = float(np.abs(volume - p.V_0).max() + np.abs(layers.table[:, 0]).max())
    net = p.a_b * (spare + abs(p.psi) * _LOST)
    fastest = max(math.sqrt(net / p.d_t) if p.d_t > 0.0 else 0.0, float(np.abs(starts[:, 1]).max()))
    rate = max(p.d_l, p.d_b + 2.0 * p.d_t * fastest)
    rate += math.sqrt(p.a_b * (abs(p.psi) + layers.steepest))
    if not float(np.diff(time).max()) * rate < _QUICKEST:
        return np.full((len(plants), len(time)), np.nan)
    return follow(plants, layers, time, volume, starts)
