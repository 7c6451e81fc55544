"""Where a frequency response crosses the real axis or the unit circle, by eigenvalues.

On the unit circle the conjugate of L(z) is L(1/z), so both questions are eigenvalue problems of
matrix pencils: no crossing can hide between the points of a grid.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.linear.models import Array, StateSpace, balancing_scale

_NEAR = 1e-3  # how far from the circle rounding may carry an eigenvalue of a cluster


def crossing_frequencies(loop: StateSpace) -> Array:
    """Return, roughly, the frequencies [rad/s] at which Im L = 0 or |L| = 1, sorted.

    loop: sampled, one input, one output, no direct feedthrough. Rough near clusters of
    eigenvalues: whoever needs a crossing brackets it between these frequencies.
    """
    assert loop.sample_time is not None
    scale = balancing_scale(loop.A - loop.B @ loop.C)
    A, B, C = loop.A * scale / scale[:, None], loop.B / scale[:, None], loop.C * scale
    largest_B, largest_C = np.abs(B).max(), np.abs(C).max()
    if largest_B > 0.0 and largest_C > 0.0:  # both of one size, their product the same
        unit = math.sqrt(largest_B / largest_C)
        B, C = B / unit, C * unit
    found = np.concatenate([_real_axis(A, B, C), _unit_circle(A, B, C)])
    near = found[np.abs(np.abs(found) - 1.0) < _NEAR]
    angles = np.abs(np.angle(near))
    return np.unique(angles[angles > 0.0]) / loop.sample_time


def _real_axis(A: Array, B: Array, C: Array) -> NDArray[np.complex128]:
    """Solutions z of L(z) = L(1/z)."""
    n = len(A)
    none, one, nothing = np.zeros((n, n)), np.eye(n), np.zeros((n, 1))
    left = np.block([[-A, none, -B], [none, one, nothing], [C, -C, np.zeros((1, 1))]])
    right = np.block([[-one, none, nothing], [none, A, B], [np.zeros((1, 2 * n + 1))]])
    return _eigenvalues(left, right)


def _unit_circle(A: Array, B: Array, C: Array) -> NDArray[np.complex128]:
    """Solutions z of L(z) L(1/z) = 1."""
    n = len(A)
    none, one = np.zeros((n, n)), np.eye(n)
    left = np.block([[-A, -B @ C], [none, one]])
    right = np.block([[-one, none], [B @ C, A]])
    return _eigenvalues(left, right)


def _eigenvalues(left: Array, right: Array) -> NDArray[np.complex128]:
    """Finite eigenvalues of the pencil left - z right."""
    from scipy.linalg import eig

    above, below = eig(left, right, right=False, homogeneous_eigvals=True)
    finite = np.abs(below) > 1e-12 * np.abs(above)
    found: Any = above[finite] / below[finite]
    return found  # type: ignore[no-any-return]
