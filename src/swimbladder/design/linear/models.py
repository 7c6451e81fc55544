"""State-space models: the plant's, differentiated numerically at rest, and the paper's (17)-(18).

The nonlinear right-hand side is in pieces, so a linear model belongs to one of them. Here that is:
submerged and off the bottom, between the end stops, at rest (a quadratic drag then has no slope, a
switched one the laminar slope), the motor turning slowly against the pressure (or with it, on
request). Dry friction shifts the voltage of rest and leaves the slopes alone, so it is not seen.

The response of a linear system at complex points, compiled.

At each point z the equations (z I - A) X = B are solved by elimination with row exchanges, as
LAPACK does it; a loop's matrix has few elements, and rows that need nothing are left out. No
similarity is applied first: one that mixes states (to Hessenberg or modal form) loses all digits
near multiple poles at 1, where elimination in balanced units keeps them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, State, acceleration, motor_rhs
from swimbladder.sim.engine.cache import compiled, part

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


_TERMS = 19  # of the series: 0.5^19/19! is below the rounding of a double


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSpace:
    """A linear system x' = A x + B u, y = C x + D u; x[k+1] = ... where it has a sample time."""

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sample_time: float | None = None  # s, None: continuous time

    def __post_init__(self) -> None:
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in (("A", (n, n)), ("B", (n, m)), ("C", (p, n)), ("D", (p, m))):
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} is {getattr(self, name).shape}, expected {shape}")

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, the largest real part first [1/s], or [-] in discrete time."""
        found = np.linalg.eigvals(self.A).astype(np.complex128)
        return found[np.lexsort((-found.imag, -found.real))]

    def part(self, *, output: str, input: str) -> StateSpace:
        """Return the system from one input to one output."""
        i, j = self.outputs.index(output), self.inputs.index(input)
        B, C, D = self.B[:, [j]], self.C[[i]], self.D[[i]][:, [j]]
        return replace(self, B=B, C=C, D=D, inputs=(input,), outputs=(output,))

    def at(self, points: ArrayLike) -> NDArray[np.complex128]:
        """Return C (p I - A)^-1 B + D at each complex p, of shape (points, outputs, inputs)."""
        p = np.atleast_1d(np.asarray(points, dtype=np.complex128))
        return resolvent(self.A, self.B, self.C, p) + self.D

    def to_control(self) -> Any:
        """Return the system as a python-control StateSpace."""
        import control

        matrices, dt = (self.A, self.B, self.C, self.D), self.sample_time or 0
        names = {name: [*getattr(self, name)] for name in ("states", "inputs", "outputs")}
        return control.ss(*matrices, dt, **names)


class OperatingPoint(NamedTuple):
    """The rest that a model is linearised about."""

    depth: float  # m
    volume: float  # m3, neutral there
    motor_rate: float  # m3/s, what leaks away
    voltage: float  # V, that turns the motor no further while it drives against the pressure
    voltage_back: float  # V, below which the sea turns the motor back


def operating_point(p: Plant, *, depth: float) -> OperatingPoint:
    """Return the rest at `depth` [m]: its volume, and the voltages the motor stands between."""
    q = p.k_l * depth
    held = q / p.gain if p.gain > 0.0 else 0.0
    return OperatingPoint(
        depth=depth,
        volume=p.psi * depth + p.V_0,
        motor_rate=q,
        voltage=p.load_drive * depth + p.friction + held,
        voltage_back=p.load_back * depth - p.friction + held,
    )


def linearise(p: Plant, *, depth: float = 0.0, back_driving: bool = False) -> StateSpace:
    """Return the linear model of a vehicle at rest at `depth` [m], submerged, by differences.

    Voltage-driven: states (q, V, z, w) and input u [V], from motor_rhs, for a motor that drives
    against the pressure or, with `back_driving`, is driven back. Positioner: states (z, w) and
    input V [m3].
    """
    h_z = 0.5
    z = max(depth, p.z_surface) + 2.0 * h_z
    V = p.psi * z + p.V_0
    h_w = 0.5 * p.epsilon if 0.0 < p.epsilon < math.inf else 1e-2
    h_V = 1e-5
    if p.positioner:
        (a_z,) = _slope(lambda x: (acceleration(V, x, 0.0, p),), z, h_z)
        (a_w,) = _slope(lambda x: (acceleration(V, z, x, p),), 0.0, h_w)
        (a_V,) = _slope(lambda x: (acceleration(x, z, 0.0, p),), V, h_V)
        A, B = np.array([[0.0, 1.0], [a_z, a_w]]), np.array([[0.0], [a_V]])
        return _with_outputs(A, B, states=("z", "w"), input="V", outputs=("z",))
    h_q = p.gain  # what a volt drives
    q = -2.0 * h_q if back_driving else 2.0 * h_q
    x, u = State(q, V, z, 0.0), p.load_drive * z

    def rates(name: str, value: float) -> State:
        return motor_rhs(x._replace(**{name: value}), u, p)

    steps = zip(x._fields, x, (h_q, h_V, h_z, h_w), strict=True)
    A = np.array([_slope(partial(rates, name), at, h) for name, at, h in steps]).T
    B = np.array(_slope(lambda value: motor_rhs(x, value, p), u, 1.0))[:, None]
    return _with_outputs(A, B, states=("q", "V", "z", "w"), input="u", outputs=("z", "V"))


def _slope(f: Callable[[float], tuple[float, ...]], x: float, h: float) -> list[float]:
    """Derivative at x: central differences over h and h/2, extrapolated to h = 0.

    The extrapolation removes the |x| x of a drag: its central difference falls in proportion to h.
    """

    def central(h: float) -> list[float]:
        return [(a - b) / (2.0 * h) for a, b in zip(f(x + h), f(x - h), strict=True)]

    return [2.0 * half - whole for half, whole in zip(central(0.5 * h), central(h), strict=True)]


def _with_outputs(
    A: Array, B: Array, *, states: tuple[str, ...], input: str, outputs: tuple[str, ...]
) -> StateSpace:
    C = np.array([[float(name == output) for name in states] for output in outputs])
    D = np.zeros((len(outputs), 1))
    return StateSpace(A=A, B=B, C=C, D=D, states=states, inputs=(input,), outputs=outputs)


def balancing_scale(A: Array) -> Array:
    """Return units for the states, powers of 2, in which the elements of A are of like size.

    LAPACK's balancing diverges where a state acts on others and none on it; the units stay
    within a factor of 2^60 of each other here.
    """
    from scipy.linalg import matrix_balance

    _, (scale, _) = matrix_balance(A, permute=False, separate=True)
    exponents = np.log2(scale)
    return np.asarray(np.exp2(np.clip(exponents - np.round(np.median(exponents)), -30.0, 30.0)))


def exponential_of(matrices: Array) -> Array:
    """Return e^M of a matrix, or of each of a stack of like size [..., n, n].

    By the series of matrices that are halved first and squared after; as SciPy's `expm`, whose
    import takes longer than a simulation, and which goes through a stack one by one.
    """
    halvings = max(math.frexp(float(np.abs(matrices).sum(axis=-2).max()))[1] + 1, 0)
    term: Array = np.broadcast_to(np.eye(matrices.shape[-1]), matrices.shape)
    found = term
    for k in range(1, _TERMS):
        term = term @ matrices / (k * 2.0**halvings)
        found = found + term
    for _ in range(halvings):
        found = found @ found
    return found


def polynomials(system: StateSpace) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return numerator and monic denominator of a system of one input and one output.

    Descending powers. The adjugate of s I - A is built term by term (Faddeev and Le Verrier) on the
    balanced matrix, so that a coefficient that is zero by structure comes out as zero.
    """
    scale = balancing_scale(system.A)
    balanced = system.A * scale / scale[:, None]
    B, C = system.B / scale[:, None], system.C * scale
    n = len(system.states)
    adjugate, denominator, numerator = np.eye(n), [1.0], []
    for k in range(1, n + 1):
        numerator.append(float((C @ adjugate @ B)[0, 0]))
        product = balanced @ adjugate
        denominator.append(-float(np.trace(product)) / k)
        adjugate = product + denominator[-1] * np.eye(n)
    direct = float(system.D[0, 0])
    full = [direct * a + b for a, b in zip(denominator, [0.0, *numerator], strict=True)]
    while len(full) > 1 and full[0] == 0.0:
        full.pop(0)
    return tuple(full), tuple(denominator)
