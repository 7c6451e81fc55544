"""What may be crossed unseen inside a step, and what is done where a limit is crossed."""

from __future__ import annotations

import math

from swimbladder.sim.engine.books import (
    LOAD_Q,
    PUMPED,
    U_Q,
    Z_DV,
    Z_Q,
)
from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.modes import (
    A_B,
    A_S,
    BACKWARD,
    BOTTOM,
    EMERGING,
    FORWARD,
    K_L,
    LOAD_BACK,
    LOAD_DRIVE,
    LOWER,
    LOWER_SPINNING,
    PSI,
    SLOW_BOBBING,
    UPPER,
    V_0,
    V_MAX,
    V_MIN,
    Z_BOTTOM,
    Z_SURFACE,
    resting_volume,
    split,
)


@part
def may_hide(p, layers, mode, x, y, h):  # type: ignore[no-untyped-def]
    """Return whether z or V turned inside the step so near a limit that it may have crossed it."""
    act, _, where = split(mode)
    if where == EMERGING and h * h * p[A_S] > SLOW_BOBBING:  # it may bob more than once
        return layers.table.shape[0] > 0 or _may_submerge(p, x, y)
    if where != BOTTOM and x[3] * y[3] < 0.0:
        reach = h * max(abs(x[3]), abs(y[3]))
        low, high = min(x[2], y[2]) - reach, max(x[2], y[2]) + reach
        if high > p[Z_BOTTOM]:
            return True
        if where == EMERGING and high > p[Z_SURFACE]:
            return True
        if where != EMERGING and low < p[Z_SURFACE]:
            return True
    if act in (FORWARD, BACKWARD):
        before, after = x[0] - p[K_L] * x[2], y[0] - p[K_L] * y[2]
        if before * after < 0.0:
            reach = h * max(abs(before), abs(after))
            low, high = min(x[1], y[1]) - reach, max(x[1], y[1]) + reach
            if high > p[V_MAX] or low < p[V_MIN]:
                return True
            if where == BOTTOM and high > resting_volume(p, layers, x[2]):
                return True
    return False


@part
def _may_submerge(p, x, y):  # type: ignore[no-untyped-def]
    """Return whether an emerged hull that bobs about where it floats may reach the water line."""
    stiffness = p[A_S] - p[A_B] * p[PSI]
    if stiffness <= 0.0:
        return True
    pull = p[A_S] * p[Z_SURFACE]
    floats, floats_next = (
        (pull - p[A_B] * (x[1] - p[V_0])) / stiffness,
        (pull - p[A_B] * (y[1] - p[V_0])) / stiffness,
    )
    swing = math.sqrt((x[2] - floats) ** 2 + x[3] * x[3] / stiffness)
    swing_next = math.sqrt((y[2] - floats_next) ** 2 + y[3] * y[3] / stiffness)
    reach = max(floats, floats_next) + max(swing, swing_next) + abs(floats - floats_next)
    return reach >= p[Z_SURFACE]


@part
def note(log, count, t, old, new):  # type: ignore[no-untyped-def]
    """Record a passage that a reader cares about: end stops, surface, bottom, supply limit."""
    old_act, _, old_where = split(old)
    new_act, _, new_where = split(new)
    at_stop = new_act in (UPPER, LOWER, LOWER_SPINNING)
    was_at_stop = old_act in (UPPER, LOWER, LOWER_SPINNING)
    if (at_stop == was_at_stop) and old_where == new_where:
        return
    if count[0] < log.shape[0]:
        log[count[0], 0] = t
        log[count[0], 1] = old
        log[count[0], 2] = new
    count[0] += 1


@part
def at_stop(p, mode, x):  # type: ignore[no-untyped-def]
    """Return whether a mode is one of an end stop at which the volume stands."""
    act = mode % 10
    if act == UPPER:
        return x[1] == p[V_MAX]
    return act in (LOWER, LOWER_SPINNING) and x[1] == p[V_MIN]


@part
def put_at_limit(p, mode, x, books):  # type: ignore[no-untyped-def]
    """Put V or z at the end stop or the bottom that was reached: less than a tick of the way."""
    act, _, where = split(mode)
    moved = 0.0
    if act == UPPER:
        moved = p[V_MAX] - x[1]
        x[1] = p[V_MAX]
    elif act in (LOWER, LOWER_SPINNING):
        moved = p[V_MIN] - x[1]
        x[1] = p[V_MIN]
    if books.shape[0] > 0 and moved != 0.0:  # as if the motor had worked for it
        raised = x[2] * moved
        load = p[LOAD_DRIVE] if moved > 0.0 else p[LOAD_BACK]
        books[PUMPED] += moved
        books[Z_DV] += raised
        books[Z_Q] += raised
        books[LOAD_Q] += load * raised
        books[U_Q] += load * raised
    if where == BOTTOM:
        x[2] = p[Z_BOTTOM]
