"""K2 and T2 as the paper finds them: eqs (26) and (27), fitted to one experiment, then averaged.

Both equations leave out psi. `psi` may be given to see what that does.
"""

import cmath
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from swimbladder.sim.pool.procedure import Array, Record


class Fit(NamedTuple):
    """K2 and T2 of one experiment, of several together, or their average."""

    K2: float  # 1/m2/s
    T2: float  # s
    rms: float  # of what the model leaves over: m for depth, m/s for speed


def response(
    time: ArrayLike, volume: ArrayLike, *, K2: float, T2: float, psi: float = 0.0
) -> tuple[Array, Array]:
    """Return (travel [m], speed [m/s]) from rest under a volume above neutral, eqs (25)-(27).

    time [s], even; volume [m3], taken as linear between samples, for which the result is exact;
    psi [m3/m]: of eq. (32), 0 in (26) and (27). A psi that makes both poles equal is not handled.
    """
    t, v = np.asarray(time, float), np.asarray(volume, float)
    h = float(t[1] - t[0])
    root = cmath.sqrt(1.0 + 4.0 * psi * K2 * T2)
    fast = -(1.0 + root) / (2.0 * T2)
    slow = -psi * K2 / T2 / fast  # from the product of the poles: no cancellation
    a, b = _mode(slow, v, h), _mode(fast, v, h)
    factor = -K2 / T2 / (slow - fast)
    return (factor * (a - b)).real, (factor * (slow * a - fast * b)).real


def _mode(pole: complex, v: Array, h: float) -> NDArray[np.complex128]:
    """Return y of y' = pole y + v from y = 0, v linear between samples h apart."""
    x = pole * h
    if abs(x) < 1e-3:
        end = h * (1.0 / 2.0 + x / 6.0 + x * x / 24.0 + x**3 / 120.0)
        both = h * (1.0 + x / 2.0 + x * x / 6.0 + x**3 / 24.0)
    else:
        both = (cmath.exp(x) - 1.0) / pole
        end = (both - h) / x
    driven = np.zeros(len(v), np.complex128)
    driven[1:] = (both - end) * v[:-1] + end * v[1:]
    return np.asarray(lfilter([1.0], [1.0, -cmath.exp(x)], driven), np.complex128)


def centred_differences(values: ArrayLike, step: float) -> Array:
    """Return the rate of change [1/s] of samples `step` [s] apart, one-sided at either end."""
    return np.asarray(np.gradient(np.asarray(values, float), step))


def fit_depth(record: Record, *, psi: float = 0.0) -> Fit:
    """Return K2 and T2 of eq. (27), V to z, by least squares; of eq. (32) with psi [m3/m] given."""
    return fit_jointly([record], psi=psi)


def fit_jointly(records: Sequence[Record], *, psi: float = 0.0) -> Fit:
    """Return one K2 and T2 for several experiments together, eq. (27) or, with psi, (32)."""

    def left_over(K2: float, T2: float) -> Array:
        return np.concatenate(
            [
                r.start + response(r.time, r.volume, K2=K2, T2=T2, psi=psi)[0] - r.depth
                for r in records
            ]
        )

    return _fit(left_over)


def fit_speed(record: Record) -> Fit:
    """Return K2 and T2 of eq. (26), V to dz/dt, to the centred differences of the depth."""
    speed = centred_differences(record.depth, float(record.time[1] - record.time[0]))

    def left_over(K2: float, T2: float) -> Array:
        return response(record.time, record.volume, K2=K2, T2=T2)[1] - speed

    return _fit(left_over)


def _fit(left_over: Callable[[float, float], Array]) -> Fit:
    def of_logarithms(x: NDArray[np.float64]) -> Array:  # in which both stay positive
        return left_over(math.exp(x[0]), math.exp(x[1]))

    found = least_squares(
        of_logarithms, [math.log(1e4), math.log(40.0)], xtol=1e-10, ftol=1e-12, gtol=1e-12
    )
    K2, T2 = (math.exp(float(value)) for value in found.x)
    return Fit(K2, T2, float(np.sqrt(np.mean(found.fun**2))))


def average(fits: Sequence[Fit]) -> Fit:
    """Return the means of K2, T2 and rms, as Table 2 gives them."""
    return Fit(*(float(np.mean(values)) for values in zip(*fits, strict=True)))
