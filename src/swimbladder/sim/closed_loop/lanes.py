"""The closed loop over a block of vehicles: law, hold, plant, tick after tick, compiled.

A block is a number of lanes that is known to the compiler (one for a single vehicle). All numbers
of a block lie in one array, row by row, lane by lane, small enough for the first-level cache, and
time runs inside. A tick is taken for all lanes at once by their modes' exponentials; the few lanes
in which something happens (an end stop, the surface, the bottom) are taken again by
`engine.advance`, which finds the event.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Measurement
from swimbladder.sim.closed_loop.dispatch import extent, gather, law_initial, scatter_where
from swimbladder.sim.closed_loop.hooks import begin, lose, sense, starts
from swimbladder.sim.closed_loop.lane import commit, decide, judge, leap_lane, set_mode
from swimbladder.sim.closed_loop.pumped import LAW_NOT_FINITE, decide_lanes, move_lanes
from swimbladder.sim.closed_loop.rows import N_PLANT, Row
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.advance import DONE, advance
from swimbladder.sim.engine.books import decays, enter
from swimbladder.sim.engine.cache import compiled, inlined, part, shared, wide
from swimbladder.sim.engine.chain import leap
from swimbladder.sim.engine.modes import first_mode
from swimbladder.sim.engine.sensor import Sensor, measured

Array = NDArray[np.float64]


OVER = 6  # why a lane stopped, beside engine.advance: by its hooks


@shared
def measure_block(S: Array, token: Any, noise: Array, k: int) -> None:
    """Write what the sensors give."""
    W_ = len(token)
    for i in range(W_):
        of_depth = Sensor(S[Row.DEPTH_NOISE * W_ + i], S[Row.DEPTH_QUANTUM * W_ + i])
        of_volume = Sensor(S[Row.VOLUME_NOISE * W_ + i], S[Row.VOLUME_QUANTUM * W_ + i])
        S[Row.SEEN_DEPTH * W_ + i] = measured(of_depth, S[Row.Z * W_ + i], noise[k, 0, i])
        volume = S[Row.V * W_ + i] + S[Row.LOST * W_ + i]
        S[Row.SEEN_VOLUME * W_ + i] = measured(of_volume, volume, noise[k, 1, i])


@part
def _set_targets(S: Array, token: Any, depths: Any) -> None:
    """Give every lane a set-point, and begin to follow its step response."""
    W_ = len(token)
    for i in range(W_):
        z = S[Row.Z * W_ + i]
        S[Row.REFERENCE * W_ + i] = depths[i]
        S[Row.FROM * W_ + i] = z
        S[Row.PER_SPAN * W_ + i] = 1.0 / (depths[i] - z) if depths[i] != z else np.nan
        S[Row.FURTHEST * W_ + i] = 0.0
        S[Row.RISE90 * W_ + i] = np.inf
        S[Row.OUTSIDE2 * W_ + i] = -1.0
        S[Row.SQUARES * W_ + i] = 0.0


@part
def _tick(S, token, bend, sea, like, like_state, k, t, since, tick):  # type: ignore[no-untyped-def]
    """Judge, decide and move every lane by a whole tick; return how many lanes need more.

    Those keep the state they had.
    """
    W_ = len(token)
    per_tick = 1.0 / tick
    troubled = 0
    wide()  # type: ignore[call-arg]
    for i in range(W_):
        judge(S, W_, i, since)
        u = decide(S, W_, i, (), like, like_state, k, t, per_tick)
        q1, v1, z1, w1, ok = leap_lane(S, W_, i, u, tick, len(bend) > 0)
        q, v = S[Row.Q * W_ + i], S[Row.V * W_ + i]
        z, w = S[Row.Z * W_ + i], S[Row.W * W_ + i]
        commit(S, W_, i, sea, q1 if ok else q, v1 if ok else v, z1 if ok else z, w1 if ok else w)
        S[Row.TROUBLE * W_ + i] = 0.0 if ok else 1.0
        troubled += 0 if ok else 1
    return troubled


@part
def _start_laws(S: Array, token: Any, like: Any, t: float) -> None:
    W_ = len(token)
    for i in range(W_):
        seen = Measurement(t, S[Row.SEEN_DEPTH * W_ + i], S[Row.SEEN_VOLUME * W_ + i])
        state = law_initial(gather(like, S, Row.LAW * W_ + i, W_), seen, S[Row.REFERENCE * W_ + i])
        scatter_where(True, state, S, (Row.LAW + extent(like)) * W_ + i, W_)


@compiled
def run_block(  # type: ignore[no-untyped-def]
    S,
    token,
    bend,
    sea,
    hooks,
    stepper,
    like,
    like_state,
    first,
    last,
    tick,
    parts,
    turn,
    given,
    depths,
    noise,
    record,
    state_row,
    chains,
    built,
    books,
    log,
    count,
    layers,
):
    """Run a block of len(token) lanes from tick `first` to `last`.

    S: the block's array, rows x lanes, flat. bend, sea: empty where drag is laminar, and where
    nothing is lost, see `lose`. hooks: what stands between the parts, see `hooks`. stepper: what
    moves the lanes, None: their modes' exponentials, see `pumped`. like, like_state: a law's
    parameters and state, for their types. tick [s], divided into `parts`.
    turn [n]: which set-point holds at a tick; given: the tick of each set-point; depths
    [set-points, lanes].
    noise [ticks of this call, 2, lanes] standard normal, or empty.
    record [7, n, lanes] or empty; state_row: row of the volume reference in the law's state, -1
    without. chains, built: see engine.advance, per lane; chains is None with a stepper.
    books [lanes, accounts] or empty.
    layers: of the water, of all lanes; in layers every lane is taken by engine.advance.
    """
    W_ = len(token)
    h = tick / parts
    x = np.zeros(5)
    y = np.zeros(10)
    p = np.zeros(N_PLANT)
    kept = np.array([-1, -1])
    decay = np.zeros(5)
    whole = parts == 1 and record.shape[1] == 0 and books.shape[1] == 0 and len(hooks) == 0
    for k in range(first, last):
        t = k * tick
        since = (k - given[turn[k]]) * tick
        if k == 0 or turn[k] != turn[k - 1]:
            _set_targets(S, token, depths[turn[k]])
        if len(sea) > 0:
            for i in range(W_):
                lose(S, W_, i, p, t, tick if k > 0 else 0.0, layers)
            kept[0] = -1
        if begin(hooks, S, k, built):
            S[Row.STOPPED] = OVER if S[Row.STOPPED] == 0.0 else S[Row.STOPPED]
            break
        if noise.shape[0] > 0:
            measure_block(S, token, noise, k - first)
        sense(hooks, S, k)
        if starts(hooks, k):
            _start_laws(S, token, like, t)
        # what tests an argument for None is pruned before types are inferred where it is None
        if stepper is not None:
            decide_lanes(stepper, S, token, hooks, like, like_state, k, tick, since)
            if record.shape[1] > 0:
                _record(S, token, record, k, extent(like), state_row)
            if k < turn.shape[0] - 1:
                move_lanes(stepper, S, token, hooks, k, tick, min(last, turn.shape[0] - 1))
            continue
        if chains is None:
            continue
        # likewise: one vehicle alone is taken by the parts below
        if len(token) > 1 and whole and k < turn.shape[0] - 1:
            if _tick(S, token, bend, sea, like, like_state, k, t, since, tick) > 0:
                for i in range(W_):
                    if S[Row.TROUBLE * W_ + i] != 0.0:
                        _take_slowly(
                            S,
                            token,
                            i,
                            k,
                            t,
                            h,
                            bend,
                            sea,
                            p,
                            x,
                            y,
                            chains[i],
                            built[i],
                            books[i],
                            log[i],
                            count[i],
                            layers,
                        )
            continue
        for i in range(W_):
            judge(S, W_, i, since)
            decide(S, W_, i, hooks, like, like_state, k, t, 1.0 / tick)
        if record.shape[1] > 0:
            _record(S, token, record, k, extent(like), state_row)
        if k == turn.shape[0] - 1:
            break
        for n in range(parts):
            for i in range(W_):
                bent = len(bend) > 0 and S[(Row.PLANT + modes.EPSILON) * W_ + i] < np.inf
                if books.shape[1] == 0:
                    q1, v1, z1, w1, ok = leap_lane(S, W_, i, S[Row.APPLIED * W_ + i], h, bent)
                    if ok:
                        commit(S, W_, i, sea, q1, v1, z1, w1)
                        continue
                elif _leap_with_books(
                    S, W_, i, h, bent, sea, p, x, y, chains, books, kept, decay, layers
                ):
                    continue
                kept[0] = -1
                _take_slowly(
                    S,
                    token,
                    i,
                    k,
                    t + n * h,
                    h,
                    bend,
                    sea,
                    p,
                    x,
                    y,
                    chains[i],
                    built[i],
                    books[i],
                    log[i],
                    count[i],
                    layers,
                )


@inlined
def _leap_with_books(  # type: ignore[no-untyped-def]
    S, W_, i, h, bent, sea, p, x, y, chains, books, kept, decay, layers
):
    """Take one step of lane i, with its accounts, if nothing happens in it; return whether.

    kept: the lane and the mode whose parameters p and transients `decay` are loaded.
    """
    mode = int(S[Row.MODE * W_ + i])
    if kept[0] != i or kept[1] != mode:
        for n in range(N_PLANT):
            p[n] = S[(Row.PLANT + n) * W_ + i]
        decays(p, mode, h, decay)
        kept[0], kept[1] = i, mode
    if mode // 20 == modes.EMERGING and h * h * p[modes.A_S] > modes.QUICK_BOBBING:
        return False  # the drag's work wants smaller steps
    u = S[Row.APPLIED * W_ + i]
    q1, v1, z1, w1, ok = leap_lane(S, W_, i, u, h, bent)
    if not ok:
        return False
    q, v, z, w = S[Row.Q * W_ + i], S[Row.V * W_ + i], S[Row.Z * W_ + i], S[Row.W * W_ + i]
    x[0], x[1], x[2], x[3], x[4] = q, v, z, w, 0.0
    y[0], y[1], y[2], y[3] = q1, v1, z1, w1
    if not bent:  # the integral of z, as engine.chain.leap has it
        y[4] = (
            chains[i, mode, 0, 16] * q
            + chains[i, mode, 0, 17] * v
            + chains[i, mode, 0, 18] * z
            + chains[i, mode, 0, 19] * w
            + chains[i, mode, 0, 24] * u
            + chains[i, mode, 0, 29]
        )
    else:
        leap(chains[i, mode], 0, p, layers, True, x, u, y)
    enter(p, mode, x, y, u, h, decay, books[i])
    commit(S, W_, i, sea, q1, v1, z1, w1)
    return True


@part
def _take_slowly(  # type: ignore[no-untyped-def]
    S, token, i, k, t, h, bend, sea, p, x, y, chains, built, books, log, count, layers
):
    """Take one step of lane i by engine.advance, and change its mode if an event did."""
    W_ = len(token)
    for n in range(4):
        x[n] = S[(Row.Q + n) * W_ + i]
    x[4] = 0.0
    if S[Row.STOPPED * W_ + i] == 0.0:
        for n in range(N_PLANT):
            p[n] = S[(Row.PLANT + n) * W_ + i]
        before = int(S[Row.MODE * W_ + i])
        u = S[Row.APPLIED * W_ + i]
        if not abs(u) < 1e30:
            why = LAW_NOT_FINITE
        else:
            if len(sea) > 0 and p[modes.POSITIONER] != 0.0:
                u -= S[Row.LOST * W_ + i]
                if abs(u - x[1]) < 1e-12 * (p[modes.V_MAX] - p[modes.V_MIN]):
                    u = x[1]  # rounding does not set it in motion
            nonlinear = len(bend) > 0 and p[modes.EPSILON] < np.inf
            mode, why = advance(
                p, layers, nonlinear, before, x, y, u, h, t, chains, built, books, log, count
            )
            if mode != before:
                S[Row.EVENTS * W_ + i] += 1.0
                S[Row.Z * W_ + i] = x[2]
                set_mode(S, token, i, mode, chains, built, h, p, layers)
        if why != DONE:
            S[Row.STOPPED * W_ + i] = why
            S[Row.STOP_TICK * W_ + i] = k
            S[Row.SLOW * W_ + i] = 1.0
        commit(S, W_, i, sea, x[0], x[1], x[2], x[3])


@part
def _record(S: Array, token: Any, record: Array, k: int, n_par: int, state_row: int) -> None:
    W_ = len(token)
    for i in range(W_):
        record[0, k, i] = S[Row.Z * W_ + i]
        record[1, k, i] = S[Row.W * W_ + i]
        record[2, k, i] = S[Row.V * W_ + i] + S[Row.LOST * W_ + i]
        record[3, k, i] = S[Row.Q * W_ + i]
        record[4, k, i] = S[Row.COMMAND * W_ + i]
        record[5, k, i] = S[Row.APPLIED * W_ + i]
        if state_row >= 0:
            record[6, k, i] = S[(Row.LAW + n_par + state_row) * W_ + i]


@compiled
def start_block(S: Array, token: Any, h: float, chains: Array, built: Any, layers: Any) -> None:
    """Set each lane's first mode from its state, its parameters and a base step h [s]."""
    W_ = len(token)
    p = np.zeros(N_PLANT)
    for i in range(W_):
        for n in range(N_PLANT):
            p[n] = S[(Row.PLANT + n) * W_ + i]
        v, z, w = S[Row.V * W_ + i], S[Row.Z * W_ + i], S[Row.W * W_ + i]
        mode, q = first_mode(p, layers, S[Row.Q * W_ + i], v, z, w, 0.0)
        S[Row.Q * W_ + i] = q
        set_mode(S, token, i, mode, chains[i], built[i], h, p, layers)
