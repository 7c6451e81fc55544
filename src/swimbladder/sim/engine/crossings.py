"""What may be crossed unseen inside a step, and what is done where a limit is crossed."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine import modes
from swimbladder.sim.engine.books import Account
from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.modes import resting_volume, split

Array = NDArray[np.float64]


@part
def may_hide(p: Array, layers: Any, mode: int, x: Array, y: Array, h: float) -> Any:
    """Return whether z or V turned inside the step so near a limit that it may have crossed it."""
    act, _, where = split(mode)
    if where == modes.EMERGING and h * h * p[modes.A_S] > modes.SLOW_BOBBING:
        # it may bob more than once
        return layers.table.shape[0] > 0 or _may_submerge(p, x, y)
    if where != modes.BOTTOM and x[3] * y[3] < 0.0:
        reach = h * max(abs(x[3]), abs(y[3]))
        low, high = min(x[2], y[2]) - reach, max(x[2], y[2]) + reach
        if high > p[modes.Z_BOTTOM]:
            return True
        if where == modes.EMERGING and high > p[modes.Z_SURFACE]:
            return True
        if where != modes.EMERGING and low < p[modes.Z_SURFACE]:
            return True
    if act in (modes.FORWARD, modes.BACKWARD):
        before, after = x[0] - p[modes.K_L] * x[2], y[0] - p[modes.K_L] * y[2]
        if before * after < 0.0:
            reach = h * max(abs(before), abs(after))
            low, high = min(x[1], y[1]) - reach, max(x[1], y[1]) + reach
            if high > p[modes.V_MAX] or low < p[modes.V_MIN]:
                return True
            if where == modes.BOTTOM and high > resting_volume(p, layers, x[2]):
                return True
    return False


@part
def _may_submerge(p: Array, x: Array, y: Array) -> Any:
    """Return whether an emerged hull that bobs about where it floats may reach the water line."""
    stiffness = p[modes.A_S] - p[modes.A_B] * p[modes.PSI]
    if stiffness <= 0.0:
        return True
    pull = p[modes.A_S] * p[modes.Z_SURFACE]
    floats = (pull - p[modes.A_B] * (x[1] - p[modes.V_0])) / stiffness
    floats_next = (pull - p[modes.A_B] * (y[1] - p[modes.V_0])) / stiffness
    swing = math.sqrt((x[2] - floats) ** 2 + x[3] * x[3] / stiffness)
    swing_next = math.sqrt((y[2] - floats_next) ** 2 + y[3] * y[3] / stiffness)
    reach = max(floats, floats_next) + max(swing, swing_next) + abs(floats - floats_next)
    return reach >= p[modes.Z_SURFACE]


@part
def note(log: Array, count: Any, t: float, old: Any, new: Any) -> None:
    """Record a passage that a reader cares about: end stops, surface, bottom, supply limit."""
    old_act, _, old_where = split(old)
    new_act, _, new_where = split(new)
    at_stop = new_act in (modes.UPPER, modes.LOWER, modes.LOWER_SPINNING)
    was_at_stop = old_act in (modes.UPPER, modes.LOWER, modes.LOWER_SPINNING)
    if (at_stop == was_at_stop) and old_where == new_where:
        return
    if count[0] < log.shape[0]:
        log[count[0], 0] = t
        log[count[0], 1] = old
        log[count[0], 2] = new
    count[0] += 1


@part
def at_stop(p: Array, mode: int, x: Array) -> Any:
    """Return whether a mode is one of an end stop at which the volume stands."""
    act = mode % 10
    if act == modes.UPPER:
        return x[1] == p[modes.V_MAX]
    return act in (modes.LOWER, modes.LOWER_SPINNING) and x[1] == p[modes.V_MIN]


@part
def put_volume(p: Array, volume: float, x: Array, accounts: Array) -> None:
    """Put V at a volume less than a tick away, as if the motor had worked for it."""
    moved = volume - x[1]
    x[1] = volume
    if accounts.shape[0] > 0 and moved != 0.0:
        raised = x[2] * moved
        load = p[modes.LOAD_DRIVE] if moved > 0.0 else p[modes.LOAD_BACK]
        accounts[Account.PUMPED] += moved
        accounts[Account.Z_DV] += raised
        accounts[Account.Z_Q] += raised
        accounts[Account.LOAD_Q] += load * raised
        accounts[Account.U_Q] += load * raised


@part
def put_at_limit(p: Array, mode: int, x: Array, books: Array) -> None:
    """Put V or z at the end stop or the bottom that was reached: less than a tick of the way."""
    act, _, where = split(mode)
    if act == modes.UPPER:
        put_volume(p, p[modes.V_MAX], x, books)
    elif act in (modes.LOWER, modes.LOWER_SPINNING):
        put_volume(p, p[modes.V_MIN], x, books)
    if where == modes.BOTTOM:
        x[2] = p[modes.Z_BOTTOM]
