"""The frequency response of a system of one input and one output, compiled.

At each point z the equations (z I - A) x = B are solved by elimination with row exchanges, as
LAPACK does it; a loop's matrix has few elements, and rows that need nothing are left out. No
similarity is applied first: one that mixes states (to Hessenberg or modal form) loses all digits
near multiple poles at 1, where elimination in balanced units keeps them.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine.cache import compiled, part

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def resolvent(A: Array, B: Array, C: Array) -> Callable[[Complex], Complex]:
    """Return the function that gives C (z I - A)^-1 B at each of some complex z."""
    A, b, c = np.ascontiguousarray(A), B[:, 0].copy(), C[0].copy()

    def at(points: Complex) -> Complex:
        found = np.empty(len(points), dtype=np.complex128)
        _solve(A, b, c, points, found)
        return found

    return at


@compiled
def _solve(A: Array, b: Array, c: Array, points: Complex, found: Complex) -> None:
    """Fill in c (z I - A)^-1 b at each point z."""
    n = len(A)
    M = np.empty((n, n), dtype=np.complex128)
    x = np.empty(n, dtype=np.complex128)
    for k in range(len(points)):
        for i in range(n):
            x[i] = b[i]
            for j in range(n):
                M[i, j] = -A[i, j]
            M[i, i] += points[k]
        for i in range(n):
            pivot = i
            for row in range(i + 1, n):
                if _size(M[row, i]) > _size(M[pivot, i]):
                    pivot = row
            if pivot != i:
                for j in range(i, n):
                    M[i, j], M[pivot, j] = M[pivot, j], M[i, j]
                x[i], x[pivot] = x[pivot], x[i]
            for row in range(i + 1, n):
                if M[row, i] != 0.0:
                    factor = M[row, i] / M[i, i]
                    for j in range(i + 1, n):
                        M[row, j] -= factor * M[i, j]
                    x[row] -= factor * x[i]
        total = 0j
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                x[i] -= M[i, j] * x[j]
            x[i] /= M[i, i]
            total += c[i] * x[i]
        found[k] = total


@part
def _size(z: complex) -> float:
    return abs(z.real) + abs(z.imag)
