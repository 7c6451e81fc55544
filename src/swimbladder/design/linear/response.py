"""The response of a linear system at complex points, compiled.

At each point z the equations (z I - A) X = B are solved by elimination with row exchanges, as
LAPACK does it; a loop's matrix has few elements, and rows that need nothing are left out. No
similarity is applied first: one that mixes states (to Hessenberg or modal form) loses all digits
near multiple poles at 1, where elimination in balanced units keeps them.
"""

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine.cache import compiled, part

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def resolvent(A: Array, B: Array, C: Array, points: Complex) -> Complex:
    """Return C (z I - A)^-1 B at each of some complex z, of shape (points, outputs, inputs)."""
    found = np.zeros((len(points), len(C), B.shape[1]), dtype=np.complex128)
    _solve(*map(np.ascontiguousarray, (A, B, C, points)), found)
    return found


@compiled
def _solve(A: Array, B: Array, C: Array, points: Complex, found: Complex) -> None:
    """Add C (z I - A)^-1 B at each point z."""
    n, inputs, outputs = len(A), B.shape[1], len(C)
    M = np.empty((n, n), dtype=np.complex128)
    X = np.empty((n, inputs), dtype=np.complex128)
    for k in range(len(points)):
        for i in range(n):
            for m in range(inputs):
                X[i, m] = B[i, m]
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
                for m in range(inputs):
                    X[i, m], X[pivot, m] = X[pivot, m], X[i, m]
            for row in range(i + 1, n):
                if M[row, i] != 0.0:
                    factor = M[row, i] / M[i, i]
                    for j in range(i + 1, n):
                        M[row, j] -= factor * M[i, j]
                    for m in range(inputs):
                        X[row, m] -= factor * X[i, m]
        for m in range(inputs):
            for i in range(n - 1, -1, -1):
                for j in range(i + 1, n):
                    X[i, m] -= M[i, j] * X[j, m]
                X[i, m] /= M[i, i]
                for output in range(outputs):
                    found[k, output, m] += C[output, i] * X[i, m]


@part
def _size(z: complex) -> float:
    return abs(z.real) + abs(z.imag)
