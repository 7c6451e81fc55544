"""Coordinates in which the search for K2 and T2 is nearly linear.

The motion has K2/T2 and 1/T2 as the factors of buoyancy and drag. Where the data say little of
the drag, as beside a quadratic one, a step in the logarithm of T2 leads to no drag at all, and the
way back is flat; in the rate 1/T2 the same step is right at once.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.motion.problem import Problem

Array = NDArray[np.float64]

_SIZE = 30.0  # s, of the T2 whose rate is 1


class Coordinates:
    """The entries of x, but log(K2/T2) and 1/T2 for log K2 and log T2 where both are fitted."""

    def __init__(self, problem: Problem) -> None:
        both = "K2" in problem.names and "T2" in problem.names
        self._at = (problem.names.index("K2"), problem.names.index("T2")) if both else None
        self._problem = problem

    def of(self, x: Array) -> Array:
        """Return the coordinates of x."""
        y = x.copy()
        if self._at is not None:
            K, T = self._at
            y[K], y[T] = x[K] - x[T], _SIZE * math.exp(-x[T])
        return y

    def back(self, y: Array) -> Array:
        """Return the x of coordinates."""
        x = y.copy()
        if self._at is not None:
            K, T = self._at
            x[T] = math.log(_SIZE / y[T])
            x[K] = y[K] + x[T]
        return x

    def slope(self, y: Array, J: Array) -> Array:
        """Return derivatives by the coordinates y, from those by x [rows, len(x)]."""
        if self._at is None:
            return J
        K, T = self._at
        moved = J.copy()
        moved[:, T] = -(J[:, T] + J[:, K]) / y[T]
        return moved

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and largest coordinates that a permitted x can have."""
        low, high = self._problem.bounds()
        if self._at is not None:
            K, T = self._at
            low[K], high[K] = low[K] - high[T], high[K] - low[T]
            low[T], high[T] = _SIZE * math.exp(-high[T]), _SIZE * math.exp(-low[T])
        return low, high
