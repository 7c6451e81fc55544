"""One lane of a block at a sample: judged, decided, moved; what `lanes` calls for every lane."""

from __future__ import annotations

from typing import Any

import numpy as np

from swimbladder.control.law import Measurement
from swimbladder.sim.closed_loop.dispatch import extent, gather, law_step, scatter_where
from swimbladder.sim.closed_loop.hooks import ask, drive
from swimbladder.sim.closed_loop.rows import (
    APPLIED,
    COMMAND,
    FROM,
    FURTHEST,
    HIGH_Q,
    HIGH_U,
    HIGH_V,
    HIGH_Z,
    LAW,
    LOST,
    LOW_Q,
    LOW_U,
    LOW_V,
    LOW_Z,
    MODE,
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
    TRAVEL,
    V_HIGHEST,
    V_LOWEST,
    WAIT,
    Z_HIGHEST,
    Z_LOWEST,
    Q,
    V,
    W,
    Z,
)
from swimbladder.sim.engine.cache import inlined, shared
from swimbladder.sim.engine.chain import ALPHA, BETA, build_chain
from swimbladder.sim.engine.modes import (
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
    QUICK_BOBBING,
    SAG,
    SLOW_BOBBING,
    SWITCH_IN,
    SWITCH_OUT,
    V_MAX,
    V_MIN,
    Z_AIR,
    Z_BOTTOM,
    Z_SURFACE,
    drag_at,
    resting_volume,
    split,
)


@shared
def set_mode(S, token, i, mode, chains, built, h, p, layers):  # type: ignore[no-untyped-def]
    """Write into lane i what a tick in this mode needs: coefficients, bounds, its speed."""
    W_ = len(token)
    S[MODE * W_ + i] = mode
    act, _, where = split(mode)
    plain = act in (FORWARD, BACKWARD) and layers.table.shape[0] == 0
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
        bobbing = SLOW_BOBBING if p[EPSILON] == np.inf else QUICK_BOBBING
        if h * h * p[A_S] > bobbing:  # it may bob more than once in a step
            S[SLOW * W_ + i] = 1.0
    elif where == BOTTOM:
        S[LOW_Z * W_ + i] = -np.inf
        S[HIGH_Z * W_ + i] = np.inf
        S[HIGH_V * W_ + i] = min(p[V_MAX], resting_volume(p, layers, S[Z * W_ + i]))
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


@inlined
def judge(S, W_, i, since):  # type: ignore[no-untyped-def]
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
def decide(S, W_, i, hooks, like, like_state, k, t, per_tick):  # type: ignore[no-untyped-def]
    """Call the law of lane i, keep what it says where it is due; return the input as applied."""
    kept = S[COMMAND * W_ + i]
    if ask(hooks, S, k):
        row = (LAW + extent(like)) * W_ + i
        seen = Measurement(t, S[SEEN_DEPTH * W_ + i], S[SEEN_VOLUME * W_ + i])
        parameters = gather(like, S, LAW * W_ + i, W_)
        state = gather(like_state, S, row, W_)
        command, state, next_s = law_step(parameters, state, seen, S[REFERENCE * W_ + i])
        waiting = S[WAIT * W_ + i]
        due = waiting <= 0.0
        ticks = np.ceil(next_s * per_tick - 1e-9) - 1.0
        S[WAIT * W_ + i] = (ticks if ticks > 0.0 else 0.0) if due else waiting - 1.0
        kept = command if due else kept
        S[COMMAND * W_ + i] = kept
        scatter_where(due, state, S, row, W_)
    u = limited(S, W_, i, drive(hooks, S, k, kept))
    S[APPLIED * W_ + i] = u
    return u


@inlined
def limited(S: Any, W_: int, i: int, command: float) -> float:
    """Return what lane i's driver gives of a command: within its limits, cut by limit switches.

    A switch that is pressed takes the voltage that would drive on; a positioner takes no volume
    beyond, so that its limits are its switches.
    """
    low, high = S[LOW_U * W_ + i], S[HIGH_U * W_ + i]
    if S[(PLANT + POSITIONER) * W_ + i] == 0.0:
        volume = S[V * W_ + i] + S[LOST * W_ + i]
        high = 0.0 if volume >= S[(PLANT + SWITCH_OUT) * W_ + i] else high
        low = 0.0 if volume <= S[(PLANT + SWITCH_IN) * W_ + i] else low
    u = command if command < high else high
    u = low if u < low else u
    return u + (command - command)  # nan where the command is not finite


@inlined
def leap_lane(S, W_, i, u, h, bent):  # type: ignore[no-untyped-def]
    """Return lane i's state after one step by its mode's exponential, and whether that is all.

    bent: whether the drag may be other than laminar.
    """
    q, v, z, w = S[Q * W_ + i], S[V * W_ + i], S[Z * W_ + i], S[W * W_ + i]
    c = STEP * W_ + i
    q1 = q + _row(S, W_, c, q, v, z, w, u)
    v1 = v + _row(S, W_, c + 6 * W_, q, v, z, w, u)
    z1 = z + _row(S, W_, c + 12 * W_, q, v, z, w, u)
    w1 = w + _row(S, W_, c + 18 * W_, q, v, z, w, u)
    if bent:
        half = w + _row(S, W_, c + 36 * W_, q, v, z, w, u)
        alpha, beta = S[c + 42 * W_], S[c + 43 * W_]
        N0 = _rest(S, W_, i, w)
        wa = half + alpha * N0
        Na = _rest(S, W_, i, wa)
        wb = half + alpha * Na
        Nb = _rest(S, W_, i, wb)
        wc = w1 + beta * N0 + alpha * (2.0 * Nb - N0)
        Nc = _rest(S, W_, i, wc)
        Nab = Na + Nb
        q1 += S[c + 24 * W_] * N0 + S[c + 28 * W_] * Nab + S[c + 32 * W_] * Nc
        v1 += S[c + 25 * W_] * N0 + S[c + 29 * W_] * Nab + S[c + 33 * W_] * Nc
        z1 += S[c + 26 * W_] * N0 + S[c + 30 * W_] * Nab + S[c + 34 * W_] * Nc
        w1 += S[c + 27 * W_] * N0 + S[c + 31 * W_] * Nab + S[c + 35 * W_] * Nc
    ok = within(S, W_, i, q, v, z, w, q1, v1, z1, w1, h)
    if bent:  # all on one branch of a switched drag law
        epsilon = S[(PLANT + EPSILON) * W_ + i]
        fast = abs(w) > epsilon
        one = ((abs(wa) > epsilon) == fast) & ((abs(wb) > epsilon) == fast)
        one = one & ((abs(wc) > epsilon) == fast) & ((abs(w1) > epsilon) == fast)
        one = one & ((abs(w) <= epsilon) | (w * w1 >= 0.0))
        ok = ok & ((epsilon <= 0.0) | one)
    return q1, v1, z1, w1, ok


@inlined
def within(S, W_, i, q, v, z, w, q1, v1, z1, w1, h):  # type: ignore[no-untyped-def]
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
    """Return N(w) of lane i, see engine.modes.drag."""
    d_l, d_b = S[(PLANT + D_L) * W_ + i], S[(PLANT + D_B) * W_ + i]
    d_0, d_t = S[(PLANT + D_0) * W_ + i], S[(PLANT + D_T) * W_ + i]
    return drag_at(w, d_l, d_b, d_0, d_t, S[(PLANT + EPSILON) * W_ + i])[2]


@inlined
def commit(S, W_, i, sea, q1, v1, z1, w1):  # type: ignore[no-untyped-def]
    """Make the new state of lane i its state."""
    lost = S[LOST * W_ + i] if len(sea) > 0 else 0.0
    S[TRAVEL * W_ + i] += abs(v1 - S[V * W_ + i])
    S[Q * W_ + i] = q1
    S[V * W_ + i] = v1
    S[Z * W_ + i] = z1
    S[W * W_ + i] = w1
    S[SEEN_DEPTH * W_ + i] = z1
    v1 += lost
    S[SEEN_VOLUME * W_ + i] = v1
    z_low, z_high = S[Z_LOWEST * W_ + i], S[Z_HIGHEST * W_ + i]
    S[Z_LOWEST * W_ + i] = z1 if z1 < z_low else z_low
    S[Z_HIGHEST * W_ + i] = z1 if z1 > z_high else z_high
    v_low, v_high = S[V_LOWEST * W_ + i], S[V_HIGHEST * W_ + i]
    S[V_LOWEST * W_ + i] = v1 if v1 < v_low else v_low
    S[V_HIGHEST * W_ + i] = v1 if v1 > v_high else v_high
