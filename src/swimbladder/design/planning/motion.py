"""The vehicle from sample to sample, linear about a course: x+ = A x + B u + c, exact for it.

The linear model is that of `linear.models`; what is not linear is taken along a course: drag by its
tangent at the mean speed of each sample, load and friction by the side on which the motor turns
there. Between samples the command is held, so the matrix exponential is exact (Van Loan, IEEE
Trans. Automatic Control 23, 1978, 395).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from swimbladder.design.linear.models import Array, linearise
from swimbladder.physics.dynamics import Plant, drag_law

STATES = ("q", "V", "z", "w")


class Steps(NamedTuple):
    """What a sample does: A [n, 4, 4], B [n, 4], c [n, 4] over (q, V, z, w) in SI.

    The command is a voltage [V]; of a positioner the volume rate [m3/s], and its q the last one.
    """

    A: Array
    B: Array
    c: Array


def steps_along(p: Plant, h: float, speed: Array, back: NDArray[np.bool_]) -> Steps:
    """Return the steps of h [s] about a course.

    speed [n + 1] in m/s. back: in which samples [n] the motor is driven back.
    """
    w = 0.5 * (speed[1:] + speed[:-1])
    n = len(w)
    M = np.zeros((n, 6, 6))  # (q, V, z, w), the held command, 1
    if p.positioner:
        M[:, :4, :4] = _of_positioner(p)
        M[:, 1, 4] = 1.0
    else:
        for side in (False, True):
            chosen = back == side
            if chosen.any():
                model = linearise(p, back_driving=side)
                friction = -p.friction if side else p.friction
                M[chosen, :4, :4] = model.A
                M[chosen, :4, 4] = model.B[:, 0]
                M[chosen, 0, 5] = -p.gain * friction / p.T1
    drag, slope = drag_along(p, w)
    M[:, 3, 3] = -slope
    M[:, 3, 5] = p.a_b * p.V_0 + slope * w - drag
    E = _exponential(M * h)
    A, B, c = E[:, :4, :4].copy(), E[:, :4, 4].copy(), E[:, :4, 5].copy()
    if p.positioner:
        A[:, 0, :], B[:, 0] = 0.0, 1.0
    return Steps(A, B, c)


def _exponential(M: Array) -> Array:
    """Return the exponentials [n, k, k]; of matrices that are all alike, only one is computed."""
    if (M[0] == M).all():
        return np.broadcast_to(expm(M[0]), M.shape)
    found: Array = expm(M)
    return found


def _of_positioner(p: Plant) -> Array:
    """Return the rates' slopes by (q, V, z, w) of a vehicle whose volume is moved at will."""
    model = linearise(p)  # states (z, w), input V
    A = np.zeros((4, 4))
    A[2:, 2:] = model.A
    A[2:, 1] = model.B[:, 0]
    return A


def drag_along(p: Plant, w: Array) -> tuple[Array, Array]:
    """Return drag over mass [m/s2] and its slope [1/s] at the speeds w [m/s]."""
    terms = (p.d_l, p.d_b, p.d_0, p.d_t, p.epsilon)
    found = np.array([drag_law(x, *terms)[:2] for x in w.tolist()])
    return found[:, 0], found[:, 1]
