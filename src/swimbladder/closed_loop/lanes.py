"""The closed loop over a block of vehicles: law, hold, plant, tick after tick, compiled.

A block is a number of lanes that is known to the compiler (one for a single vehicle). All numbers
of a block lie in one array, row by row, lane by lane, small enough for the first-level cache, and
time runs inside. A tick is taken for all lanes at once by their modes' exponentials; the few lanes
in which something happens (an end stop, the surface, the bottom) are taken again by
`engine.advance`, which finds the event.
"""

from __future__ import annotations

import numpy as np

from swimbladder.closed_loop.dispatch import gather, law_initial, law_step, scatter_where
from swimbladder.closed_loop.rows import (
    APPLIED,
    COMMAND,
    DEPTH_NOISE,
    DEPTH_QUANTUM,
    EVENTS,
    FROM,
    FURTHEST,
    HIGH_Q,
    HIGH_U,
    HIGH_V,
    HIGH_Z,
    LAW,
    LOW_Q,
    LOW_U,
    LOW_V,
    LOW_Z,
    MODE,
    N_PLANT,
    OUTSIDE2,
    PER_SPAN,
    PLANT,
    REFERENCE,
    RISE90,
    SEEN_DEPTH,
    SEEN_VOLUME,
    SLOW,
    SQUARES,
    STEP,
    STOP_TICK,
    STOPPED,
    TRAVEL,
    TROUBLE,
    V_HIGHEST,
    V_LOWEST,
    VOLUME_NOISE,
    VOLUME_QUANTUM,
    WAIT,
    Z_HIGHEST,
    Z_LOWEST,
    Q,
    V,
    W,
    Z,
)
from swimbladder.control.law import Measurement
from swimbladder.engine.advance import DONE, advance
from swimbladder.engine.books import decays, enter
from swimbladder.engine.cache import compiled, inlined, part, wide
from swimbladder.engine.chain import ALPHA, BETA, build_chain, leap
from swimbladder.engine.modes import (
    A_S,
    BACKWARD,
    BOTTOM,
    D_0,
    D_B,
    D_L,
    D_T,
    EMERGING,
    EPSILON,
    FORWARD,
    FRICTION,
    K_L,
    LOAD_BACK,
    LOAD_DRIVE,
    POSITIONER,
    SAG,
    V_MAX,
    V_MIN,
    Z_AIR,
    Z_BOTTOM,
    Z_SURFACE,
    first_mode,
    resting_volume,
    split,
)

LAW_NOT_FINITE = 5

__all__ = ["LAW_NOT_FINITE", "run_block", "start_block"]


@part
def _set_mode(S, token, i, mode, chains, built, h, p):  # type: ignore[no-untyped-def]
    """Write into lane i what a tick in this mode needs: coefficients, bounds, its speed."""
    W_ = len(token)
    S[MODE * W_ + i] = mode
    act, _, where = split(mode)
    plain = act in (FORWARD, BACKWARD)
    S[SLOW * W_ + i] = 0.0 if plain and p[SAG] == 0.0 and p[POSITIONER] == 0.0 else 1.0
    one_way = p[LOAD_DRIVE] != p[LOAD_BACK] or p[FRICTION] != 0.0
    S[LOW_Q * W_ + i] = 0.0 if one_way and act == FORWARD else -np.inf
    S[HIGH_Q * W_ + i] = 0.0 if one_way and act == BACKWARD else np.inf
    S[LOW_V * W_ + i] = p[V_MIN]
    S[HIGH_V * W_ + i] = p[V_MAX]
    S[LOW_Z * W_ + i] = p[Z_SURFACE]
    S[HIGH_Z * W_ + i] = min(p[Z_BOTTOM], 12000.0)
    if where == EMERGING:
        S[LOW_Z * W_ + i] = p[Z_AIR]
        S[HIGH_Z * W_ + i] = min(p[Z_SURFACE], p[Z_BOTTOM])
        if h * h * p[A_S] > 0.25:  # it may bob more than once in a step
            S[SLOW * W_ + i] = 1.0
    elif where == BOTTOM:
        S[LOW_Z * W_ + i] = -np.inf
        S[HIGH_Z * W_ + i] = np.inf
        S[HIGH_V * W_ + i] = min(p[V_MAX], resting_volume(p, S[Z * W_ + i]))
    if built[mode] == 0:
        build_chain(p, mode, h, chains[mode])
        built[mode] = 1
    c = chains[mode, 0]
    half = chains[mode, 1]
    for r in range(4):
        for k in range(4):
            S[(STEP + 6 * r + k) * W_ + i] = c[4 * r + k]
        S[(STEP + 6 * r + 4) * W_ + i] = c[20 + r]
        S[(STEP + 6 * r + 5) * W_ + i] = c[25 + r]
        for k in range(3):
            S[(STEP + 24 + 4 * k + r) * W_ + i] = c[30 + 5 * k + r]
    for k in range(4):
        S[(STEP + 36 + k) * W_ + i] = half[12 + k]
    S[(STEP + 40) * W_ + i] = half[23]
    S[(STEP + 41) * W_ + i] = half[28]
    S[(STEP + 42) * W_ + i] = c[ALPHA]
    S[(STEP + 43) * W_ + i] = c[BETA]


@part
def _measure(S, token, noise, k):  # type: ignore[no-untyped-def]
    """Write what noisy sensors say: the state, noise, then the quantum."""
    W_ = len(token)
    for i in range(W_):
        z = S[Z * W_ + i] + S[DEPTH_NOISE * W_ + i] * noise[k, 0, i]
        v = S[V * W_ + i] + S[VOLUME_NOISE * W_ + i] * noise[k, 1, i]
        dz = S[DEPTH_QUANTUM * W_ + i]
        dv = S[VOLUME_QUANTUM * W_ + i]
        S[SEEN_DEPTH * W_ + i] = dz * np.floor(z / dz + 0.5) if dz > 0.0 else z
        S[SEEN_VOLUME * W_ + i] = dv * np.floor(v / dv + 0.5) if dv > 0.0 else v


@part
def _set_targets(S, token, depths):  # type: ignore[no-untyped-def]
    """Give every lane a set-point, and begin to follow its step response."""
    W_ = len(token)
    for i in range(W_):
        z = S[Z * W_ + i]
        S[REFERENCE * W_ + i] = depths[i]
        S[FROM * W_ + i] = z
        S[PER_SPAN * W_ + i] = 1.0 / (depths[i] - z) if depths[i] != z else np.nan
        S[FURTHEST * W_ + i] = 0.0
        S[RISE90 * W_ + i] = np.inf
        S[OUTSIDE2 * W_ + i] = -1.0
        S[SQUARES * W_ + i] = 0.0


@inlined
def _judge(S, W_, i, since):  # type: ignore[no-untyped-def]
    """Follow the step response of lane i at a sample `since` [s] after the set-point."""
    z = S[Z * W_ + i]
    error = S[REFERENCE * W_ + i] - z
    S[SQUARES * W_ + i] += error * error
    share = (z - S[FROM * W_ + i]) * S[PER_SPAN * W_ + i]
    furthest = S[FURTHEST * W_ + i]
    S[FURTHEST * W_ + i] = share if share > furthest else furthest
    first = (share > 0.9) & (S[RISE90 * W_ + i] == np.inf)
    S[RISE90 * W_ + i] = since if first else S[RISE90 * W_ + i]
    S[OUTSIDE2 * W_ + i] = since if abs(share - 1.0) > 0.02 else S[OUTSIDE2 * W_ + i]


@inlined
def _decide(S, W_, i, like, like_state, t, per_tick):  # type: ignore[no-untyped-def]
    """Call the law of lane i, keep what it says where it is due; return the input as applied."""
    row = (LAW + len(like)) * W_ + i
    seen = Measurement(t, S[SEEN_DEPTH * W_ + i], S[SEEN_VOLUME * W_ + i])
    parameters = gather(like, S, LAW * W_ + i, W_)
    state = gather(like_state, S, row, W_)
    command, state, next_s = law_step(parameters, state, seen, S[REFERENCE * W_ + i])
    waiting = S[WAIT * W_ + i]
    due = waiting <= 0.0
    ticks = np.ceil(next_s * per_tick - 1e-9) - 1.0
    S[WAIT * W_ + i] = (ticks if ticks > 0.0 else 0.0) if due else waiting - 1.0
    command = command if due else S[COMMAND * W_ + i]
    S[COMMAND * W_ + i] = command
    scatter_where(due, state, S, row, W_)
    low, high = S[LOW_U * W_ + i], S[HIGH_U * W_ + i]
    u = command if command < high else high
    u = low if u < low else u
    u += command - command  # nan where the command is not finite
    S[APPLIED * W_ + i] = u
    return u


@inlined
def _leap(S, W_, i, u, h, bend):  # type: ignore[no-untyped-def]
    """Return lane i's state after one step by its mode's exponential, and whether that is all."""
    q, v, z, w = S[Q * W_ + i], S[V * W_ + i], S[Z * W_ + i], S[W * W_ + i]
    c = STEP * W_ + i
    q1 = q + _row(S, W_, c, q, v, z, w, u)
    v1 = v + _row(S, W_, c + 6 * W_, q, v, z, w, u)
    z1 = z + _row(S, W_, c + 12 * W_, q, v, z, w, u)
    w1 = w + _row(S, W_, c + 18 * W_, q, v, z, w, u)
    if len(bend) > 0:
        half = w + _row(S, W_, c + 36 * W_, q, v, z, w, u)
        alpha, beta = S[c + 42 * W_], S[c + 43 * W_]
        N0 = _rest(S, W_, i, w)
        Na = _rest(S, W_, i, half + alpha * N0)
        Nb = _rest(S, W_, i, half + alpha * Na)
        Nc = _rest(S, W_, i, w1 + beta * N0 + alpha * (2.0 * Nb - N0))
        Nab = Na + Nb
        q1 += S[c + 24 * W_] * N0 + S[c + 28 * W_] * Nab + S[c + 32 * W_] * Nc
        v1 += S[c + 25 * W_] * N0 + S[c + 29 * W_] * Nab + S[c + 33 * W_] * Nc
        z1 += S[c + 26 * W_] * N0 + S[c + 30 * W_] * Nab + S[c + 34 * W_] * Nc
        w1 += S[c + 27 * W_] * N0 + S[c + 31 * W_] * Nab + S[c + 35 * W_] * Nc
    return q1, v1, z1, w1, _within(S, W_, i, q, v, z, w, q1, v1, z1, w1, h, bend)


@inlined
def _within(S, W_, i, q, v, z, w, q1, v1, z1, w1, h, bend):  # type: ignore[no-untyped-def]
    """Return whether the mode of lane i lasted through a step from one state to another."""
    # how far inside a step that turns the state may go beyond its ends
    dz = h * (abs(w) + abs(w1)) if w * w1 < 0.0 else 0.0
    leaks = S[(PLANT + K_L) * W_ + i] > 0.0
    dv = h * (abs(q) + abs(q1)) if (q * q1 < 0.0) | leaks else 0.0
    ok = (
        (q1 >= S[LOW_Q * W_ + i])
        & (q1 <= S[HIGH_Q * W_ + i])
        & (v - dv >= S[LOW_V * W_ + i])
        & (v1 - dv >= S[LOW_V * W_ + i])
        & (v + dv <= S[HIGH_V * W_ + i])
        & (v1 + dv <= S[HIGH_V * W_ + i])
        & (z1 - dz >= S[LOW_Z * W_ + i])
        & (z1 + dz <= S[HIGH_Z * W_ + i])
        & (z - dz >= S[LOW_Z * W_ + i])
        & (z + dz <= S[HIGH_Z * W_ + i])
        & (S[SLOW * W_ + i] == 0.0)
    )
    if len(bend) > 0:
        epsilon = S[(PLANT + EPSILON) * W_ + i]
        fast, fast1 = abs(w) > epsilon, abs(w1) > epsilon
        same = (fast == fast1) & ((abs(w) <= epsilon) | (w * w1 >= 0.0))
        ok = ok & ((epsilon <= 0.0) | same)
    return ok


@inlined
def _row(S, W_, c, q, v, z, w, u):  # type: ignore[no-untyped-def]
    """Return one row of the tick's exponential, less 1, times the state and the input."""
    return (
        S[c] * q
        + S[c + W_] * v
        + S[c + 2 * W_] * z
        + S[c + 3 * W_] * w
        + S[c + 4 * W_] * u
        + S[c + 5 * W_]
    )


@inlined
def _rest(S, W_, i, w):  # type: ignore[no-untyped-def]
    """Return N(w) of lane i, see engine.chain.drag_rest."""
    d_l, d_b = S[(PLANT + D_L) * W_ + i], S[(PLANT + D_B) * W_ + i]
    d_0, d_t = S[(PLANT + D_0) * W_ + i], S[(PLANT + D_T) * W_ + i]
    m = abs(w)
    rest = d_l * m - (d_b * m + d_0 + d_t * m * m)
    rest = rest if w > 0.0 else -rest
    return 0.0 if (m <= S[(PLANT + EPSILON) * W_ + i]) | (m == 0.0) else rest


@inlined
def _commit(S, W_, i, q1, v1, z1, w1):  # type: ignore[no-untyped-def]
    """Make the new state of lane i its state."""
    S[TRAVEL * W_ + i] += abs(v1 - S[V * W_ + i])
    S[Q * W_ + i] = q1
    S[V * W_ + i] = v1
    S[Z * W_ + i] = z1
    S[W * W_ + i] = w1
    S[SEEN_DEPTH * W_ + i] = z1
    S[SEEN_VOLUME * W_ + i] = v1
    z_low, z_high = S[Z_LOWEST * W_ + i], S[Z_HIGHEST * W_ + i]
    S[Z_LOWEST * W_ + i] = z1 if z1 < z_low else z_low
    S[Z_HIGHEST * W_ + i] = z1 if z1 > z_high else z_high
    v_low, v_high = S[V_LOWEST * W_ + i], S[V_HIGHEST * W_ + i]
    S[V_LOWEST * W_ + i] = v1 if v1 < v_low else v_low
    S[V_HIGHEST * W_ + i] = v1 if v1 > v_high else v_high


@part
def _tick(S, token, bend, like, like_state, t, since, tick):  # type: ignore[no-untyped-def]
    """Judge, decide and move every lane by a whole tick; return how many lanes need more.

    Those keep the state they had.
    """
    W_ = len(token)
    per_tick = 1.0 / tick
    troubled = 0
    wide()  # type: ignore[call-arg]
    for i in range(W_):
        _judge(S, W_, i, since)
        u = _decide(S, W_, i, like, like_state, t, per_tick)
        q1, v1, z1, w1, ok = _leap(S, W_, i, u, tick, bend)
        q, v = S[Q * W_ + i], S[V * W_ + i]
        z, w = S[Z * W_ + i], S[W * W_ + i]
        _commit(
            S, W_, i, q1 if ok else q, v1 if ok else v, z1 if ok else z, w1 if ok else w
        )  # fmt: skip
        S[TROUBLE * W_ + i] = 0.0 if ok else 1.0
        troubled += 0 if ok else 1
    return troubled


@part
def _start_laws(S, token, like, t):  # type: ignore[no-untyped-def]
    W_ = len(token)
    for i in range(W_):
        seen = Measurement(t, S[SEEN_DEPTH * W_ + i], S[SEEN_VOLUME * W_ + i])
        state = law_initial(gather(like, S, LAW * W_ + i, W_), seen, S[REFERENCE * W_ + i])
        scatter_where(True, state, S, (LAW + len(like)) * W_ + i, W_)


@compiled
def run_block(  # type: ignore[no-untyped-def]
    S, token, bend, like, like_state, first, last, tick, parts, turn, given, depths, noise,
    record, state_row, chains, built, books, log, count,
):  # fmt: skip
    """Run a block of len(token) lanes from tick `first` to `last`.

    S: the block's array, rows x lanes, flat. like, like_state: a law's parameters and state, for
    their types. tick [s], divided into `parts`. turn [n]: which set-point holds at a tick;
    given: the tick of each set-point; depths [set-points, lanes].
    noise [ticks of this call, 2, lanes] standard normal, or empty.
    record [7, n, lanes] or empty; state_row: row of the volume reference in the law's state, -1
    without. chains, built: see engine.advance, per lane. books [lanes, accounts] or empty.
    """
    W_ = len(token)
    h = tick / parts
    x = np.zeros(5)
    y = np.zeros(10)
    p = np.zeros(N_PLANT)
    kept = np.array([-1, -1])
    decay = np.zeros(5)
    whole = parts == 1 and record.shape[1] == 0 and books.shape[1] == 0
    for k in range(first, last):
        t = k * tick
        since = (k - given[turn[k]]) * tick
        if k == 0 or turn[k] != turn[k - 1]:
            _set_targets(S, token, depths[turn[k]])
        if noise.shape[0] > 0:
            _measure(S, token, noise, k - first)
        if k == 0:
            _start_laws(S, token, like, t)
        if whole and k < turn.shape[0] - 1:
            if _tick(S, token, bend, like, like_state, t, since, tick) > 0:
                for i in range(W_):
                    if S[TROUBLE * W_ + i] != 0.0:
                        _take_slowly(
                            S, token, i, k, t, h, bend, p, x, y,
                            chains[i], built[i], books[i], log[i], count[i],
                        )  # fmt: skip
            continue
        for i in range(W_):
            _judge(S, W_, i, since)
            _decide(S, W_, i, like, like_state, t, 1.0 / tick)
        if record.shape[1] > 0:
            _record(S, token, record, k, len(like), state_row)
        if k == turn.shape[0] - 1:
            break
        for n in range(parts):
            for i in range(W_):
                if books.shape[1] == 0:
                    q1, v1, z1, w1, ok = _leap(S, W_, i, S[APPLIED * W_ + i], h, bend)
                    if ok:
                        _commit(S, W_, i, q1, v1, z1, w1)
                        continue
                elif _leap_with_books(S, W_, i, h, bend, p, x, y, chains, books, kept, decay):
                    continue
                kept[0] = -1
                _take_slowly(
                    S, token, i, k, t + n * h, h, bend, p, x, y,
                    chains[i], built[i], books[i], log[i], count[i],
                )  # fmt: skip


@inlined
def _leap_with_books(S, W_, i, h, bend, p, x, y, chains, books, kept, decay):  # type: ignore[no-untyped-def]
    """Take one step of lane i, with its accounts, if nothing happens in it; return whether.

    kept: the lane and the mode whose parameters p and transients `decay` are loaded.
    """
    mode = int(S[MODE * W_ + i])
    if kept[0] != i or kept[1] != mode:
        for n in range(N_PLANT):
            p[n] = S[(PLANT + n) * W_ + i]
        decays(p, mode, h, decay)
        kept[0], kept[1] = i, mode
    u = S[APPLIED * W_ + i]
    q1, v1, z1, w1, ok = _leap(S, W_, i, u, h, bend)
    if not ok:
        return False
    q, v, z, w = S[Q * W_ + i], S[V * W_ + i], S[Z * W_ + i], S[W * W_ + i]
    x[0], x[1], x[2], x[3], x[4] = q, v, z, w, 0.0
    y[0], y[1], y[2], y[3] = q1, v1, z1, w1
    if p[EPSILON] == np.inf:  # the integral of z, as engine.chain.leap has it
        y[4] = (
            chains[i, mode, 0, 16] * q
            + chains[i, mode, 0, 17] * v
            + chains[i, mode, 0, 18] * z
            + chains[i, mode, 0, 19] * w
            + chains[i, mode, 0, 24] * u
            + chains[i, mode, 0, 29]
        )
    else:
        leap(chains[i, mode], 0, p, True, x, u, y)
    enter(p, mode, x, y, u, h, decay, books[i])
    _commit(S, W_, i, q1, v1, z1, w1)
    return True


@part
def _take_slowly(S, token, i, k, t, h, bend, p, x, y, chains, built, books, log, count):  # type: ignore[no-untyped-def]  # fmt: skip
    """Take one step of lane i by engine.advance, and change its mode if an event did."""
    W_ = len(token)
    for n in range(4):
        x[n] = S[(Q + n) * W_ + i]
    x[4] = 0.0
    if S[STOPPED * W_ + i] == 0.0:
        for n in range(N_PLANT):
            p[n] = S[(PLANT + n) * W_ + i]
        before = int(S[MODE * W_ + i])
        u = S[APPLIED * W_ + i]
        if not abs(u) < 1e30:
            why = LAW_NOT_FINITE
        else:
            mode, why = advance(
                p, len(bend) > 0, before, x, y, u, h, t, chains, built, books, log, count
            )
            if mode != before:
                S[EVENTS * W_ + i] += 1.0
                S[Z * W_ + i] = x[2]
                _set_mode(S, token, i, mode, chains, built, h, p)
        if why != DONE:
            S[STOPPED * W_ + i] = why
            S[STOP_TICK * W_ + i] = k
            S[SLOW * W_ + i] = 1.0
        _commit(S, W_, i, x[0], x[1], x[2], x[3])


@part
def _record(S, token, record, k, n_par, state_row):  # type: ignore[no-untyped-def]
    W_ = len(token)
    for i in range(W_):
        record[0, k, i] = S[Z * W_ + i]
        record[1, k, i] = S[W * W_ + i]
        record[2, k, i] = S[V * W_ + i]
        record[3, k, i] = S[Q * W_ + i]
        record[4, k, i] = S[COMMAND * W_ + i]
        record[5, k, i] = S[APPLIED * W_ + i]
        if state_row >= 0:
            record[6, k, i] = S[(LAW + n_par + state_row) * W_ + i]


@compiled
def start_block(S, token, h, chains, built):  # type: ignore[no-untyped-def]
    """Set each lane's first mode from its state, its parameters and a base step h [s]."""
    W_ = len(token)
    p = np.zeros(N_PLANT)
    for i in range(W_):
        for n in range(N_PLANT):
            p[n] = S[(PLANT + n) * W_ + i]
        mode, q = first_mode(p, S[Q * W_ + i], S[V * W_ + i], S[Z * W_ + i], S[W * W_ + i], 0.0)
        S[Q * W_ + i] = q
        _set_mode(S, token, i, mode, chains[i], built[i], h, p)
