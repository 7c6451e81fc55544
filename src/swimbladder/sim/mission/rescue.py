"""A vehicle that presses out all it has, flown by the mission's own kernel from where it is.

From how deep it still comes up, and how long a start of its pump takes there.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.io.mission import Mission
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.seawater import look_up
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.engine.advance import DONE, advance, begin, new_lane
from swimbladder.sim.engine.chain import base_steps
from swimbladder.sim.engine.modes import Where
from swimbladder.sim.engine.rodas.prepare import first_lane
from swimbladder.sim.engine.rodas.records import Account, Stop, Table, made
from swimbladder.sim.mission.core.hooks import fly
from swimbladder.sim.mission.core.records import Holding
from swimbladder.vehicle import Vehicle

if TYPE_CHECKING:
    from swimbladder.sim.mission.prepare import Plan

_HASTE = 2.0  # times the speed that is asked for: so fast it may sink while nobody looks
_FINE = 0.005  # of the depth at which it could not even rest: so near the return depth is found
_LONGEST = 86400.0  # s to come up in
_HELD = 10.0  # s, of a step with a held input at the longest
_GONE = 2.0  # times the depth at which it could not even rest: it is lost
_START_ROWS = 200  # of a trajectory, in which a start is over
_OUT = 1e-10  # m3: so much pressed out is no rounding


def return_depth(vehicle: Vehicle, mission: Mission, plan: Plan) -> float:
    """Return the depth below which a vehicle could not come up [m]; infinite where it always could.

    There its neutral volume is beyond the stroke less what safety.stroke keeps back, or the drive
    stalls; or, where such a depth is, it sinks through it before all is pressed out, from twice the
    speed of the fastest phase: it is flown from there.
    """
    g, neutral = plan.given, plan.table[:, Table.NEUTRAL]
    step = float(g["step"])
    most = g["v_max"] - mission.safety.stroke * (g["v_max"] - g["v_min"])
    lost = (neutral > most) | (plan.table[:, Table.RATE_OUT] <= 0.0)
    lost[: int(g["z_surface"] / step) + 1] = False
    slope = float(plan.table[-1, Table.NEUTRAL + 1])
    if lost.any():
        limit = float(np.argmax(lost)) * step
    elif slope > 0.0:  # beyond the table the neutral volume goes on straight
        limit = float(step * (len(neutral) - 1) + (most - neutral[-1]) / slope)
    else:
        return math.inf
    speed = _HASTE * float(np.max(plan.stages["speed"]))
    held = drag_force(vehicle.drag, speed) / vehicle.water.specific_weight
    comes_up = partial(_comes_up, plan, speed=speed, less=held)
    if plan.water is not None:
        free = replace(plan.water, plant=plan.water.plant._replace(z_bottom=math.inf))
        comes_up = partial(_emerges, free, speed=speed, less=held, gone=_GONE * limit)
    low, high = 0.0, limit
    if comes_up(limit):
        return limit
    while high - low > _FINE * limit:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if comes_up(middle) else (low, middle)
    return low


def _comes_up(plan: Plan, depth: float, *, speed: float, less: float) -> bool:
    """Return whether a vehicle that sinks at a depth [m] by a speed [m/s] is afloat within a day.

    less [m3]: below the neutral volume.
    """
    plan, state, _ = _pressing(plan, depth, less)
    x, at, _ = state
    x["w"] = speed
    fly(plan.under_way(state))
    return Stop(int(at["stop"])) is Stop.PASSED_DEPTH


def _emerges(medium: Medium, depth: float, *, speed: float, less: float, gone: float) -> bool:
    """Return what `_comes_up` does of a vehicle that sampled laws fly, with its input held.

    By the step that every law's kernel has in it, which need not be compiled for this. gone [m]: so
    deep it is lost.
    """
    p, layers = medium.plant, medium.layers
    volume = max(medium.neutral_volume(depth) - less, p.V_min)
    h, t = _HELD / base_steps(p, _HELD, speed, layers), 0.0
    lane = new_lane(np.array(p), layers, np.array([0.0, volume, depth, speed]))
    mode, full = begin(lane), p.V_max if p.positioner else p.supply
    while t < _LONGEST and lane.x[2] < gone:
        mode, why = advance(lane, mode, full, h, t)
        t += h
        if why != DONE or mode // 20 == Where.EMERGING:
            return bool(why == DONE)
    return False


def start_time(plan: Plan, depth: float) -> float:
    """Return how long the pump runs at a depth [m] before anything is pressed out [s].

    Its line is empty, and its runs have no end; infinite where nothing is pressed out in a day.
    """
    plan, state, volume = _pressing(plan, depth, 0.0)
    plan.given["longest"] = math.inf
    flown = plan.under_way(state, rows=_START_ROWS)
    fly(flown)
    rows = flown.rows[: flown.lane.counts[0]]
    out = rows["v"] - volume
    if not np.any(out > _OUT):
        return math.inf
    n = int(np.argmax(out > _OUT))
    rate = look_up(plan.table, float(plan.given["step"]), Table.RATE_OUT, rows["z"][n])[0]
    return float(rows["t"][n] - out[n] / (rate * plan.given["delivery"]))


def _pressing(plan: Plan, depth: float, less: float) -> tuple[Plan, Any, float]:
    """Return a plan without bottom, waves and battery, and a state in it that begins to press out.

    depth [m]; less [m3]: below the neutral volume; the volume is the last that is returned.
    """
    given = made(plan.given.dtype, plan.given)
    given["z_bottom"], given["deepest"], given["empty"] = math.inf, math.inf, -math.inf
    neutral = look_up(plan.table, float(given["step"]), Table.NEUTRAL, depth)[0]
    volume = max(float(neutral) - less, float(given["v_min"]))
    x, at = first_lane(given, plan.table, depth, volume=volume)
    x["t_end"], at["alarm"] = _LONGEST, 1
    accounts = np.zeros(len(Account) + len(Holding) * len(plan.stages))
    return replace(plan, given=given, waves=plan.waves[:0]), (x, at, accounts), volume
