"""Limit cycles by harmonic balance: one nonlinearity in a sampled loop, F = 1 + N(A) L(w) = 0.

L is the exact frequency response of the sampled loop, opened at the nonlinearity. F turns once
around a zero, so the zeros are found by how F turns around the cells of a grid; they are then
polished. Loeb's criterion says which cycle is stable (Gelb and Vander Velde 1968, section 3.4):
more amplitude must make it decay, Im(conj(F_A) F_w) > 0, which is the sense in which F turns.

What the balance neglects is the third harmonic that comes back to the nonlinearity. Taken as an
error of F of that size and of any phase, it moves the zero by

    (dA/A, dw/w) <= third |rows of J^-1|,   J = d(Re F, Im F)/d(ln A, ln w)

and that is the error to be expected: large where the loop filters badly, where N is steep, and
where L runs along -1/N.

A cycle of a sampled loop need not be a whole number of samples long; if it is not, it is not
periodic but lies on a closed curve, and the balance gives its mean period.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from swimbladder.design.linear.models import StateSpace
from swimbladder.design.stability.describing import Nonlinearity

Array = NDArray[np.float64]

BELIEVED = 0.15  # expected error of amplitude or period up to which it is a prediction
_AMPLITUDES, _FREQUENCIES = 1200, 600
_DECADES = 4.5  # of frequency, below the Nyquist frequency
_SMALL = 1e-5  # of ln A and ln w, for derivatives


class Cycle(NamedTuple):
    """A limit cycle that the harmonic balance predicts."""

    amplitude: float  # of what enters the nonlinearity, in its unit
    frequency: float  # rad/s
    stable: bool  # other motions nearby come to it; if not, it is the edge of what decays
    third: float  # -, third harmonic that comes back to the nonlinearity, over the first
    amplitude_error: float  # -, to be expected from it
    period_error: float  # -

    @property
    def period(self) -> float:
        """Period [s]."""
        return 2.0 * math.pi / self.frequency

    @property
    def believed(self) -> bool:
        """Whether the neglected harmonic leaves it a prediction."""
        return max(self.amplitude_error, self.period_error) <= BELIEVED


def balance(loop: StateSpace, nonlinearity: Nonlinearity) -> tuple[Cycle, ...]:
    """Return the limit cycles of a nonlinearity that stands where the loop is broken."""
    assert loop.sample_time is not None  # a sampled loop
    nyquist = math.pi / loop.sample_time
    w = np.geomspace(nyquist * 10.0**-_DECADES, 0.98 * nyquist, _FREQUENCIES)
    A = nonlinearity.amplitudes(_AMPLITUDES)
    F = 1.0 + nonlinearity.gain(A)[:, None] * _response(loop, w)[None, :]
    found: list[Cycle] = []
    for i, j in _turning(F):
        log_A, log_w = math.log(A[i] * A[i + 1]) / 2.0, math.log(w[j] * w[j + 1]) / 2.0
        polished = root(partial(_parts, loop, nonlinearity), [log_A, log_w], tol=1e-12)
        inside = abs(polished.x[1] - log_w) < 2.0 * math.log(w[1] / w[0])
        if not (polished.success and inside and math.exp(polished.x[0]) > nonlinearity.onset):
            continue
        cycle = _cycle(loop, nonlinearity, polished.x)
        if all(abs(math.log(cycle.frequency / c.frequency)) > 1e-6
               or abs(math.log(cycle.amplitude / c.amplitude)) > 1e-9 for c in found):  # fmt: skip
            found.append(cycle)
    return tuple(sorted(found))


def _turning(F: NDArray[np.complex128]) -> list[tuple[int, int]]:
    """Return the cells of a grid around which F turns."""
    corners = np.stack([F[:-1, :-1], F[1:, :-1], F[1:, 1:], F[:-1, 1:], F[:-1, :-1]])
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.angle(corners[1:] / corners[:-1]).sum(axis=0) / (2.0 * math.pi)
    cells = np.nonzero(np.abs(np.nan_to_num(turns)) > 0.5)
    return [(int(i), int(j)) for i, j in zip(*cells, strict=True)]


def _response(loop: StateSpace, w: Array) -> NDArray[np.complex128]:
    assert loop.sample_time is not None
    found: NDArray[np.complex128] = loop.at(np.exp(1j * w * loop.sample_time))[:, 0, 0]
    return found


def _F(loop: StateSpace, nonlinearity: Nonlinearity, log_A: float, log_w: float) -> complex:
    N = nonlinearity.gain(np.array([math.exp(log_A)]))[0]
    return complex(1.0 + N * _response(loop, np.array([math.exp(log_w)]))[0])


def _parts(loop: StateSpace, nonlinearity: Nonlinearity, x: Array) -> list[float]:
    if math.exp(x[0]) <= nonlinearity.onset:
        return [1.0, 1.0]  # nothing is nonlinear there
    F = _F(loop, nonlinearity, *x.tolist())
    return [F.real, F.imag]


def _cycle(loop: StateSpace, nonlinearity: Nonlinearity, x: Array) -> Cycle:
    log_A, log_w = x.tolist()
    A, w = math.exp(log_A), math.exp(log_w)
    step = min(_SMALL, 0.1 * (1.0 - nonlinearity.onset / A))

    def slope(d: tuple[float, float]) -> complex:
        more = _F(loop, nonlinearity, log_A + d[0], log_w + d[1])
        less = _F(loop, nonlinearity, log_A - d[0], log_w - d[1])
        return (more - less) / (2.0 * max(d))

    F_A, F_w = slope((step, 0.0)), slope((0.0, _SMALL))
    third = _returning(loop, nonlinearity, A, w)
    J = np.array([[F_A.real, F_w.real], [F_A.imag, F_w.imag]])
    rows = np.linalg.norm(np.linalg.inv(J), axis=1)
    return Cycle(
        amplitude=A, frequency=w, stable=(F_A.conjugate() * F_w).imag > 0.0, third=third,
        amplitude_error=third * float(rows[0]), period_error=third * float(rows[1]),
    )  # fmt: skip


def _returning(loop: StateSpace, nonlinearity: Nonlinearity, A: float, w: float) -> float:
    """Third harmonic made by the nonlinearity times what the loop lets through of it."""
    assert loop.sample_time is not None
    # Beyond the Nyquist frequency a sampled harmonic is seen as a slower one.
    angle = abs((3.0 * w * loop.sample_time + math.pi) % (2.0 * math.pi) - math.pi)
    both = np.abs(_response(loop, np.array([w, angle / loop.sample_time])))
    return float(nonlinearity.third(A) * both[1] / both[0])
