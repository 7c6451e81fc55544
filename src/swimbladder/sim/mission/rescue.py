"""From how deep a vehicle still comes up once it presses out all it has."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.mission import Mission
from swimbladder.physics.dynamics import drag_force
from swimbladder.sim.engine.rodas.names import Table
from swimbladder.sim.mission.orders import law_parameters
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_HASTE = 2.0  # times the speed that is asked for: so fast it may sink while nobody looks
_LANES = 41  # depths that are tried between the surface and where it could not even rest
_STEP = 0.5  # s
_LONGEST = 7200.0  # s, after which a vehicle that still sinks counts as lost
_RISES = 1.0  # m above where it was: it comes up


def return_depth(vehicle: Vehicle, mission: Mission, table: Array, step: float) -> float:
    """Return the depth below which a vehicle could not come up [m]; infinite where it always could.

    There its neutral volume is beyond the stroke less what safety.stroke keeps back, or the drive
    stalls; or, where such a depth is, it sinks through it before all is pressed out, from twice the
    speed of the fastest phase.
    """
    stroke = vehicle.stroke
    most = stroke.maximum - mission.safety.stroke * (stroke.maximum - stroke.minimum)
    lost = (table[:, Table.NEUTRAL] > most) | (table[:, Table.RATE_OUT] <= 0.0)
    lost[: int(vehicle.hull.emergence_depth / step) + 1] = False
    depth = np.arange(len(table)) * step
    neutral = table[:, Table.NEUTRAL]
    if lost.any():
        limit = float(np.argmax(lost)) * step
    else:
        # beyond the table the neutral volume goes on straight, and so may go out of reach
        slope = float(table[-1, Table.NEUTRAL + 1])
        if slope <= 0.0:
            return math.inf
        limit = float(depth[-1] + (most - neutral[-1]) / slope)
    speed = _HASTE * max(law_parameters(vehicle, phase).far_speed for phase in mission.phases)
    comes_up = _comes_up(vehicle, table, step, np.linspace(0.0, limit, _LANES), speed)
    if comes_up.all():
        return limit
    return float(limit / (_LANES - 1) * max(int(np.argmin(comes_up)) - 1, 0))


def _comes_up(
    vehicle: Vehicle, table: Array, step: float, starts: Array, speed: float
) -> NDArray[np.bool_]:
    """Return which of some vehicles come up that sink steadily [n], and then press out all.

    Euler's rule, implicit in the drag: what is asked is told by metres.
    """
    m, top = vehicle.mass, vehicle.hull.emergence_depth
    grid = np.arange(len(table)) * step
    slope = float(table[-1, Table.NEUTRAL + 1])
    weight = vehicle.water.specific_weight

    def neutral(z: Array) -> Array:
        below = np.maximum(z - grid[-1], 0.0)
        return np.asarray(np.interp(z, grid, table[:, Table.NEUTRAL]) + slope * below)

    speeds = np.linspace(0.0, 20.0 * speed, 400)
    drags = np.array([drag_force(vehicle.drag, w) for w in speeds])
    z, w = starts.copy(), np.full(starts.shape, speed)
    volume = np.maximum(
        neutral(z) - drag_force(vehicle.drag, speed) / weight, vehicle.stroke.minimum
    )
    short = np.interp(z, grid, table[:, Table.START])
    up = np.zeros(starts.shape, dtype=bool)
    for _ in range(int(_LONGEST / _STEP)):
        rate = np.interp(z, grid, table[:, Table.RATE_OUT]) * _STEP
        primed = np.minimum(short, rate)
        short -= primed
        volume = np.minimum(volume + rate - primed, vehicle.stroke.maximum)
        # drag over speed, taken at the end of the step: no step is too long for it
        held = np.interp(np.abs(w), speeds, drags) / np.maximum(np.abs(w), 1e-6)
        held *= np.where(w < 0.0, vehicle.drag.rising_ratio, 1.0)
        w = (w + _STEP * weight * (neutral(z) - volume) / m) / (1.0 + _STEP * held / m)
        z = np.maximum(z + _STEP * w, top)
        up |= (z < starts - _RISES) | (z <= top)
        if np.all(up | (z > 2.0 * starts[-1] + 100.0)):
            break
    return up
