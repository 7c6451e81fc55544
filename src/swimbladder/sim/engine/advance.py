"""One vehicle over one step with a held input, events located to 2^-20 of the step.

A step is tried whole; where a limit is crossed inside it, it is halved by table look-up until the
event stands between two ticks. A blow (end stop, bottom) takes the state before the crossing, put
at the limit, so that none is passed; what is continuous (surface, direction of the motor, supply)
the one after.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine import modes
from swimbladder.sim.engine.books import PUMPED, decays, enter, enter_bend, enter_blow
from swimbladder.sim.engine.cache import compiled, shared
from swimbladder.sim.engine.chain import TICKS, accept, build_chain, leap
from swimbladder.sim.engine.crossings import at_stop, may_hide, note, put_at_limit
from swimbladder.sim.engine.modes import event, first_mode

Array = NDArray[np.float64]


DONE, LEFT_WATER, TOO_DEEP, CHATTERS, NOT_FINITE = 0, 1, 2, 3, 4
_TRANSITIONS = 500  # in one step: more is no motion but chatter
_FINE = 6  # level from which on turns inside a step cannot hide a crossing that matters
_LEAPS = 50_000  # in one step: likewise
_BENDS = 8  # in one step: from then on the bend of the drag is no longer searched for


@shared
def advance(p, layers, nonlinear, mode, x, y, u, h, t, chains, built, books, log, count):  # type: ignore[no-untyped-def]
    """Advance x = (q, V, z, w, integral of z) in place by h [s]; return (mode, why it stopped).

    p: the vehicle's parameters [len(Plant)]; layers: of the water. u: the held input. y: ten floats
    of work space.
    chains [COUNT, LEVELS + 1, COEFFICIENTS], built [COUNT]: exponentials made so far for this h.
    books: accounts to add to, or empty. log [n, 3], count [1]: passages from mode to mode.
    """
    remaining = TICKS
    cap = TICKS
    searching = False
    last_look = False  # the search is over, and what it looked for is in the tick to come
    smallest = 1  # more where rounding hides what is looked for
    transitions = 0
    leaps = 0
    bent = 0
    act = mode % 10
    if (act == modes.MOVING_OUT and u < x[1]) or (act == modes.MOVING_IN and u > x[1]):
        x[0] = -x[0]  # a positioner that is asked to turn back
        mode += (modes.MOVING_IN if act == modes.MOVING_OUT else modes.MOVING_OUT) - act
    while remaining > 0:
        while True:
            new, q, w, reset = event(p, layers, mode, x[0], x[1], x[2], x[3], u)
            if new == -1:
                break
            if new == -2:
                return mode, LEFT_WATER
            if new == -3:
                return mode, TOO_DEEP
            transitions += 1
            if transitions > _TRANSITIONS:
                return mode, CHATTERS
            if books.shape[0] > 0 and (reset or q != x[0]):
                enter_blow(x[0], q, x[3], w, books)
            note(log, count, t + h * (TICKS - remaining) / TICKS, mode, new)
            if new % 10 == modes.HOLDING:  # the last part of a tick
                target = max(p[modes.V_MIN], min(p[modes.V_MAX], u))
                if books.shape[0] > 0:
                    books[PUMPED] += target - x[1]
                x[1] = target
            x[0], x[3], mode = q, w, new
        if built[mode] == 0:
            build_chain(p, mode, h, chains[mode])
            built[mode] = 1
        applied = u
        if (mode // 10) % 2 == 1:
            applied = math.copysign(p[modes.SUPPLY], u)
        size = cap
        while size > remaining:
            size >>= 1
        level = 0
        while (TICKS >> level) > size:
            level += 1
        while True:
            leaps += 1
            if leaps > _LEAPS:
                return mode, CHATTERS
            bend = leap(chains[mode], level, p, layers, nonlinear, x, applied, y)
            span = h * size / TICKS
            if not abs(y[2]) + abs(y[3]) + abs(y[1]) < 1e12:
                return mode, NOT_FINITE
            new, q, w, reset = event(p, layers, mode, y[0], y[1], y[2], y[3], u)
            if new == -1:
                search = size > smallest and bend and bent < _BENDS
                bobs = mode // 20 == modes.EMERGING and (nonlinear or books.shape[0] > 0)
                bobs = bobs and span * span * p[modes.A_S] > modes.QUICK_BOBBING
                if search or (
                    level < _FINE and (bend or bobs or may_hide(p, layers, mode, x, y, span))
                ):
                    size >>= 1
                    level += 1
                    cap = size
                    searching = searching or search
                    continue
                if bend:
                    bent += 1
                    searching, last_look, smallest, cap = False, False, 1, TICKS
                if books.shape[0] > 0:
                    decays(p, mode, span, y[5:])
                    enter(p, mode, x, y, u, span, y[5:], books)
                    if bend:
                        enter_bend(p, layers, x, y, span, books)
                accept(x, y)
                remaining -= size
                if searching:
                    cap = size >> 1
                    if last_look:
                        cap, searching, last_look = TICKS, False, False
                        smallest = min(2 * smallest, TICKS)
                    elif cap < smallest:
                        cap, last_look = smallest, True
                break
            if size > smallest:
                size >>= 1
                level += 1
                cap = size
                searching = True
                continue
            # the event lies within this one tick
            searching, last_look, smallest, cap = False, False, 1, TICKS
            # Where the volume stands at the stop already and the motor turns back to it within this
            # tick, the state before would leave it again, without end: the one after is taken.
            back = reset and new // 20 == mode // 20 and at_stop(p, new, x)
            if reset and not back:
                transitions += 1
                if transitions > _TRANSITIONS:
                    return mode, CHATTERS
                q_new = x[0] if new % 10 in (mode % 10, modes.LOWER_SPINNING) else q
                w_new = 0.0 if new // 20 == modes.BOTTOM and mode // 20 != modes.BOTTOM else x[3]
                if books.shape[0] > 0:
                    enter_blow(x[0], q_new, x[3], w_new, books)
                note(log, count, t + h * (TICKS - remaining) / TICKS, mode, new)
                x[0], x[3], mode = q_new, w_new, new
                put_at_limit(p, mode, x, books)
            else:
                if books.shape[0] > 0:
                    decays(p, mode, span, y[5:])
                    enter(p, mode, x, y, u, span, y[5:], books)
                    if back:
                        enter_blow(y[0], q, y[3], y[3], books)
                accept(x, y)
                remaining -= size
                if back:
                    note(log, count, t + h * (TICKS - remaining) / TICKS, mode, new)
                    x[0], mode = q, new
                    put_at_limit(p, mode, x, books)
            break
    return mode, DONE


@compiled
def follow(  # type: ignore[no-untyped-def]
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
    books,
    log,
    count,
    chains,
    built,
):
    """Drive x = (q, V, z, w, integral of z) by recorded inputs; return (instants reached, why).

    time [n], inputs [n]: a voltage held until the next instant or, where `ramps`, a volume that
    goes linearly to the next. parts [n - 1]: steps in each interval. record [7, n].
    """
    y = np.zeros(10)
    h_before = -1.0
    n = time.shape[0]
    why = DONE
    for k in range(n):
        if ramps:
            x[1] = inputs[k]
            if k < n - 1:
                x[0] = (inputs[k + 1] - inputs[k]) / (time[k + 1] - time[k])
        record[0, k], record[1, k], record[2, k], record[3, k] = x[2], x[3], x[1], x[0]
        record[4, k], record[5, k] = inputs[k], inputs[k]
        if k == n - 1:
            break
        h = (time[k + 1] - time[k]) / parts[k]
        if h != h_before:
            built[:] = 0
            h_before = h
        u = 0.0 if ramps else max(-p[modes.SUPPLY], min(p[modes.SUPPLY], inputs[k]))
        record[5, k] = inputs[k] if ramps else u
        for n_part in range(parts[k]):
            t = time[k] + n_part * h
            mode, why = advance(
                p, layers, nonlinear, mode, x, y, u, h, t, chains, built, books, log, count
            )
            if why != DONE:
                return k + 1, why
    return n, why


@compiled
def begin(p: Array, layers: Any, q: float, V: float, z: float, w: float) -> Any:
    """Return (mode, q) that a state starts in; see `modes.first_mode`."""
    return first_mode(p, layers, q, V, z, w, 0.0)
