"""Exponentials of a mode over h, h/2, h/4, ... h/2^21, from one Taylor series by doubling.

Between events ``dx/dt = A x + b_u u + b_1 + e_w N(z, w)`` with x = (q, V, z, w), augmented by the
integral of z. The linear part is advanced exactly; N, what is nonlinear in the drag and what layers
of the water add to the neutral volume, by the fourth-order exponential Runge-Kutta scheme of Cox
and Matthews (J. Comput. Phys. 176, 2002, 430-455), whose vectors are columns of the exponential of
an augmented matrix. ``D = exp(A h) - I`` is doubled instead of the exponential, so that nothing
small is lost against 1: ``D(2h) = 2 D + D D``.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.cache import compiled, inlined, part, shared
from swimbladder.sim.engine.modes import A_B, EPSILON, NO_LAYERS, Layers, drag, layered, linear_part

_MOST_STEPS = 10_000  # a tick is divided into
LEVELS = 21  # of halving: events are found to h/2^20
TICKS = 1 << 20

# Coefficients of one level: D row by row (5 x 4), b_u (5), b_1 (5), then f1, f2, f3 (5 each) of the
# nonlinear drag, and two numbers of its stages.
_BU, _B1, _F1, _F2, _F3 = 20, 25, 30, 35, 40
ALPHA, BETA = 45, 46
COEFFICIENTS = 47


# Loops, and no assignments of whole arrays: with one of those Numba compiles all of its text about
# shapes that differ, 4 s of a first kernel's 20.
@inlined
def copy(source: Array, target: Array) -> None:
    """Copy the rows of a matrix that `target` has into it."""
    for r in range(target.shape[0]):
        for c in range(target.shape[1]):
            target[r, c] = source[r, c]


@inlined
def _add(term: Array, total: Array) -> None:
    for r in range(total.shape[0]):
        for c in range(total.shape[1]):
            total[r, c] += term[r, c]


@inlined
def accept(x: Array, y: Array) -> None:
    """Make x the state (q, V, z, w, integral of z) that `exponential_step` wrote into y."""
    for n in range(5):
        x[n] = y[n]


@compiled
def build_chain(p: Array, mode: int, h: float, chain: Array) -> None:
    """Fill chain [levels + 1, COEFFICIENTS]; level k is for a step of h/2^k [s].

    The last level's exponential is a Taylor series: the rates times its step have to be small.
    """
    levels = chain.shape[0] - 1
    A = np.empty((4, 4))
    b_u = np.empty(4)
    b_1 = np.empty(4)
    e_w = linear_part(p, mode, A, b_u, b_1)
    # columns 0-3: D; 4: b_u; 5: b_1; 6-8: V1, V2, V3 of the nonlinear drag. Row 4: integral of z.
    M = np.zeros((5, 9))
    T = np.zeros((5, 9))
    k = h / 2.0**levels
    for r in range(4):
        for c in range(4):
            T[r, c] = A[r, c] * k
        T[r, 4] = b_u[r] * k
        T[r, 5] = b_1[r] * k
    T[4, 2] = k
    T[3, 6] = e_w * k
    T[3, 7] = e_w * k * k / 2.0
    T[3, 8] = e_w * k * k * k / 6.0
    _add(T, M)
    P = np.zeros((5, 9))
    for n in range(2, 9):  # the Taylor series: term n is A k/n times term n - 1
        for r in range(5):
            for c in range(9):
                s = 0.0
                if r < 4:
                    for j in range(4):
                        s += A[r, j] * T[j, c]
                else:
                    s = T[2, c]
                m = n if c < 7 else (n + 1 if c == 7 else n + 2)
                P[r, c] = s * k / m
        copy(P, T)
        _add(T, M)
    step = k
    for level in range(levels, -1, -1):
        if level < levels:
            for r in range(5):
                for c in range(9):
                    s = 2.0 * M[r, c]
                    for j in range(4):
                        s += M[r, j] * M[j, c]
                    if c == 7:
                        s += step * M[r, 6]
                    elif c == 8:
                        s += step * M[r, 7] + 0.5 * step * step * M[r, 6]
                    P[r, c] = s
            # stages of the nonlinear drag need the half step: M is still that of level + 1
            alpha = M[3, 6]
            beta = M[3, 6]
            for j in range(4):
                beta += M[3, j] * M[j, 6]
            chain[level, ALPHA] = alpha
            chain[level, BETA] = beta
            copy(P, M)
            step *= 2.0
        row = chain[level]
        for r in range(5):
            for c in range(4):
                row[4 * r + c] = M[r, c]
            row[_BU + r] = M[r, 4]
            row[_B1 + r] = M[r, 5]
            phi1, phi2, phi3 = M[r, 6], M[r, 7] / step, M[r, 8] / (step * step)
            row[_F1 + r] = phi1 - 3.0 * phi2 + 4.0 * phi3
            row[_F2 + r] = 2.0 * phi2 - 4.0 * phi3
            row[_F3 + r] = 4.0 * phi3 - phi2


@part
def _branch(p: Array, w: float) -> int:
    """Return the branch of a switched drag law: 0 laminar, 1 and -1 turbulent; 0 of other laws."""
    epsilon = p[EPSILON]
    if epsilon <= 0.0 or abs(w) <= epsilon:
        return 0
    return 1 if w > 0.0 else -1


@part
def _branches(p: Array, w: float, wa: float, wb: float, wc: float, w1: float) -> bool:
    """Return whether the speeds of a step are on more than one branch of a switched drag law."""
    branch = _branch(p, w)
    if _branch(p, wa) != branch or _branch(p, wb) != branch:
        return True
    return bool(_branch(p, wc) != branch or _branch(p, w1) != branch)


@inlined
def _row(c: Any, r: int, q: float, V: float, z: float, w: float, u: float) -> Any:
    """Return row r of a level's exponential, less 1, times the state and the input."""
    i = 4 * r
    return c[i] * q + c[i + 1] * V + c[i + 2] * z + c[i + 3] * w + c[_BU + r] * u + c[_B1 + r]


@shared
def exponential_step(
    chain: Array, level: int, p: Array, layers: Any, x: Array, u: float, y: Array
) -> Any:
    """Advance x = (q, V, z, w, integral of z) by one step of a level into y; u is held.

    Return whether the step met more than one branch of a switched drag law.
    """
    c = chain[level]
    q, V, z, w = x[0], x[1], x[2], x[3]
    for r in range(5):
        y[r] = x[r] + _row(c, r, q, V, z, w, u)
    if layers.table.shape[0] > 0:
        return _bend_in_layers(chain, level, p, layers, x, u, y)
    if p[EPSILON] < np.inf:
        half = chain[level + 1]
        w_half = w + _row(half, 3, q, V, z, w, u)
        N0 = drag(p, w)[2]
        wa = w_half + c[ALPHA] * N0
        Na = drag(p, wa)[2]
        wb = w_half + c[ALPHA] * Na
        Nb = drag(p, wb)[2]
        wc = y[3] + c[BETA] * N0 + c[ALPHA] * (2.0 * Nb - N0)
        Nc = drag(p, wc)[2]
        for r in range(5):
            y[r] += c[_F1 + r] * N0 + c[_F2 + r] * (Na + Nb) + c[_F3 + r] * Nc
        return _branches(p, w, wa, wb, wc, y[3])
    return False


@part
def _rest(p: Array, layers: Any, z: float, w: float) -> Any:
    """Return N(z, w) [m/s2]: nonlinear drag, and the pull of what layers add at depth z."""
    return drag(p, w)[2] + p[A_B] * layered(layers, z)[0]


@part
def _bend_in_layers(
    chain: Array, level: int, p: Array, layers: Any, x: Array, u: float, y: Array
) -> Any:
    """Add to y, where the linear part leads, what N(z, w) makes of the step."""
    c, half = chain[level], chain[level + 1]
    q, V, z, w = x[0], x[1], x[2], x[3]
    # e_w's column of the half step, from what the three weights of a step are made of
    phi_q = half[_F1] + 2.0 * half[_F2] + half[_F3]
    phi_V = half[_F1 + 1] + 2.0 * half[_F2 + 1] + half[_F3 + 1]
    phi_z = half[_F1 + 2] + 2.0 * half[_F2 + 2] + half[_F3 + 2]
    phi_w = c[ALPHA]
    twice_z = phi_z + half[8] * phi_q + half[9] * phi_V + half[10] * phi_z + half[11] * phi_w
    z_half = z + _row(half, 2, q, V, z, w, u)
    w_half = w + _row(half, 3, q, V, z, w, u)
    N0 = _rest(p, layers, z, w)
    wa = w_half + phi_w * N0
    Na = _rest(p, layers, z_half + phi_z * N0, wa)
    wb = w_half + phi_w * Na
    Nb = _rest(p, layers, z_half + phi_z * Na, wb)
    last = 2.0 * Nb - N0
    wc = y[3] + c[BETA] * N0 + phi_w * last
    Nc = _rest(p, layers, y[2] + twice_z * N0 + phi_z * last, wc)
    for r in range(5):
        y[r] += c[_F1 + r] * N0 + c[_F2 + r] * (Na + Nb) + c[_F3 + r] * Nc
    return _branches(p, w, wa, wb, wc, y[3])


def base_steps(
    p: Plant, tick: float, speed: float, layers: Layers = NO_LAYERS, *, booked: bool = False
) -> int:
    """Return how many steps a tick [s] is divided into: one, where drag is laminar and water even.

    The nonlinear drag's rate, at the terminal speed of the whole stroke or at `speed` [m/s],
    whichever is larger, times the step stays under 1/8; so does the rate at which the steepest of
    the layers would make a vehicle swing. A step is at most 10 s, so that no dip through the
    surface goes unseen.

    booked: accounts are kept, where the drag's rate times the step stays under 1/4 for laminar drag
    too: the motion is exact at any step, but the work of the drag is integrated by Simpson's rule.

    Raises InputError where it would take more than 10000 steps: drag far too large for the mass.
    """
    return int(steps_of(p, np.array([tick]), speed, layers, booked=booked)[0])


def steps_of(
    p: Plant, ticks: Array, speed: float, layers: Layers = NO_LAYERS, *, booked: bool = False
) -> NDArray[np.int64]:
    """Return `base_steps` of each of several ticks [s]."""
    most = 8.0 * math.sqrt(p.a_b * layers.steepest)
    if p.epsilon != math.inf:
        pull = p.a_b * max(abs(p.V_max - p.V_0), abs(p.V_min - p.V_0)) + p.a_b * abs(p.psi) * 1e3
        pull += p.a_b * layers.largest
        terminal = max((pull / p.d_t) ** 0.5 if p.d_t > 0.0 else 0.0, abs(speed))
        most = max(most, 8.0 * max(2.0 * p.d_t * terminal, p.d_l, p.d_b))
    most = max(most, 4.0 * p.d_l) if booked else most
    steps = np.maximum(ticks / 10.0, most * ticks)
    for k in np.flatnonzero(~(steps <= _MOST_STEPS)):
        raise InputError(
            f"the drag is so large against the mass that one sample of {ticks[k]:g} s would take "
            f"{steps[k]:.2g} steps (laminar {p.d_l:.3g} 1/s, turbulent {p.d_t:.3g} 1/m)",
            field="motion.drag",
            remedy="Check drag, masses and their units, and the times between the samples of a log",
        )
    return np.maximum(np.ceil(steps), 1.0).astype(np.int64)
