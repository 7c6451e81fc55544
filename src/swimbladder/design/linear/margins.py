"""How far a sampled loop is from instability: gains, phase, delay, sensitivity.

The plant is unstable in open loop, so no margin is read off one crossing: a gain margin counts only
where the eigenvalues say that the loop is stable on its near side and unstable just beyond it.
The frequency response comes from the state space, on a grid that is refined until neighbours differ
by little and that no crossing hides in; every crossing is polished by root finding.

Where it crosses the real axis or the unit circle is found by eigenvalues. On the unit circle the
conjugate of L(z) is L(1/z), so both questions are eigenvalue problems of matrix pencils: no
crossing can hide between the points of a grid.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.design.linear.models import StateSpace, balancing_scale
from swimbladder.physics.arrays import Array

Complex = NDArray[np.complex128]

_TURN = 0.05  # rad, between two points of a frequency response
_NEAR = 1e-3  # how far from the circle rounding may carry an eigenvalue of a cluster
_MAXIMA, _FLAT = 5, 1e-13  # maxima of a grid that are refined, until a peak is known to so much
_ROUNDS, _PARTS = 20, np.linspace(0.0, 1.0, 9)


def crossing_frequencies(loop: StateSpace) -> Array:
    """Return, roughly, the frequencies [rad/s] at which Im L = 0 or |L| = 1, sorted.

    loop: sampled, one input, one output, no direct feedthrough. Rough near clusters of
    eigenvalues: whoever needs a crossing brackets it between these frequencies.
    """
    assert loop.sample_time is not None
    A, B, C = _balanced(loop)
    largest_B, largest_C = np.abs(B).max(), np.abs(C).max()
    if largest_B > 0.0 and largest_C > 0.0:  # both of one size, their product the same
        unit = math.sqrt(largest_B / largest_C)
        B, C = B / unit, C * unit
    found = np.concatenate([_real_axis(A, B, C), _unit_circle(A, B, C)])
    near = found[np.abs(np.abs(found) - 1.0) < _NEAR]
    angles = np.abs(np.angle(near))
    return np.unique(angles[angles > 0.0]) / loop.sample_time


def _balanced(loop: StateSpace) -> tuple[Array, Array, Array]:
    """A, B and C in units of the states in which A - B C has elements of like size.

    In others the solution of (z I - A) x = B loses all digits near a multiple pole at 1.
    """
    scale = balancing_scale(loop.A - loop.B @ loop.C)
    return loop.A * scale / scale[:, None], loop.B / scale[:, None], loop.C * scale


def _real_axis(A: Array, B: Array, C: Array) -> Complex:
    """Solutions z of L(z) = L(1/z)."""
    n = len(A)
    none, one, nothing = np.zeros((n, n)), np.eye(n), np.zeros((n, 1))
    left = np.block([[-A, none, -B], [none, one, nothing], [C, -C, np.zeros((1, 1))]])
    right = np.block([[-one, none, nothing], [none, A, B], [np.zeros((1, 2 * n + 1))]])
    return _eigenvalues(left, right)


def _unit_circle(A: Array, B: Array, C: Array) -> Complex:
    """Solutions z of L(z) L(1/z) = 1."""
    n = len(A)
    none, one = np.zeros((n, n)), np.eye(n)
    left = np.block([[-A, -B @ C], [none, one]])
    right = np.block([[-one, none], [B @ C, A]])
    return _eigenvalues(left, right)


def _eigenvalues(left: Array, right: Array) -> Complex:
    """Finite eigenvalues of the pencil left - z right."""
    from scipy.linalg import eig

    pairs: Any
    try:
        pairs = eig(left, right, right=False, homogeneous_eigvals=True)
    except np.linalg.LinAlgError:  # LAPACK's QZ iteration does not always converge
        pairs = _inverted(left, right)
    above, below = pairs
    finite = np.abs(below) > 1e-12 * np.abs(above)
    found: Any = above[finite] / below[finite]
    return found  # type: ignore[no-any-return]


def _inverted(left: Array, right: Array) -> tuple[Complex, Complex]:
    """Return numerators and denominators of a pencil's eigenvalues, of a matrix without a pencil.

    With M = left - s right, those of M^-1 right are 1/(z - s): 0 where z is infinite. No z on the
    unit circle is near one of the shifts s, of which the one with the best conditioned M is taken.
    """
    matrices = {s: left - s * right for s in (-3.0, -2.0, -1.5, 1.5, 2.0, 3.0)}
    shift = min(matrices, key=lambda s: float(np.linalg.cond(matrices[s])))
    found = np.linalg.eigvals(np.linalg.solve(matrices[shift], right)).astype(np.complex128)
    return 1.0 + shift * found, found


class Margins(NamedTuple):
    """Margins of a loop L under negative feedback, and the frequencies [rad/s] that limit them.

    Frequencies are nan where nothing limits, and of the worst margins of several loops.
    """

    gain_up: float  # -, factor by which the gain may grow; inf without a limit
    gain_down: float  # -, factor to which it may fall; 0 without a limit
    phase: float  # rad, smallest turn either way that brings L to -1; inf if |L| is never 1
    delay: float  # s, smallest lag over its frequency; inf if |L| is never 1
    peak_sensitivity: float  # -, max |1/(1 + L)|
    disk: float  # -, balanced disk margin alpha, from 0 to 2
    gain_up_frequency: float = math.nan
    gain_down_frequency: float = math.nan
    phase_frequency: float = math.nan
    delay_frequency: float = math.nan
    peak_frequency: float = math.nan
    disk_frequency: float = math.nan

    @property
    def stable(self) -> bool:
        """Whether the loop is stable as it is."""
        return self.disk > 0.0

    @property
    def disk_gain(self) -> float:
        """Factor, up or down, that the gain may change by at the same time as disk_phase [-]."""
        return (2.0 + self.disk) / (2.0 - self.disk) if self.disk < 2.0 else math.inf

    @property
    def disk_phase(self) -> float:
        """Phase that may be lost or gained at the same time as disk_gain [rad]."""
        return 2.0 * math.atan(self.disk / 2.0)


def spectral_radius(matrix: Array) -> float:
    """Return the largest modulus of an eigenvalue [-]; below 1 a sampled loop is stable."""
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))


def equivalent_poles(poles: NDArray[Any], h: float) -> Complex:
    """Return s = ln(z)/h [1/s] of poles z sampled every h [s]; -inf for a pole at 0."""
    z = np.asarray(poles, dtype=np.complex128)
    tiny = np.abs(z) < 1e-9
    return np.where(tiny, -np.inf, np.log(np.where(tiny, 1.0, z)) / h)


def frequency_response(loop: StateSpace) -> tuple[Array, Complex]:
    """Return frequencies [rad/s] up to the Nyquist frequency and L there, one input, one output.

    The grid is refined until L turns by less than 0.05 rad and grows by less than that factor
    from point to point; between any two crossings of the real axis or the unit circle there is one.
    """
    h = _sample_time(loop)
    L = response(loop)
    modes = np.concatenate([np.linalg.eigvals(loop.A), np.linalg.eigvals(loop.A - loop.B @ loop.C)])
    s = equivalent_poles(modes[np.abs(modes) > 1e-6], h)
    rates = np.abs(s[np.abs(s) > 1e-7 / h])
    nyquist = math.pi / h
    lowest = min(float(rates.min()) if rates.size else nyquist, nyquist) * 1e-3
    crossings = crossing_frequencies(loop)
    ends = np.concatenate([[lowest], crossings, [nyquist]])
    marks = np.concatenate([rates, np.abs(s.imag), crossings, 0.5 * (ends[1:] + ends[:-1])])
    # To both sides of a mark: right at a pole on the unit circle L has no value.
    marks = np.concatenate([marks * (1.0 - 1e-6), marks * (1.0 + 1e-6)])
    marks = marks[(marks > lowest) & (marks < nyquist)]
    w = np.unique(np.concatenate([np.geomspace(lowest, nyquist, 200), marks]))
    w[-1] = nyquist
    values = L(w)
    for _ in range(20):
        with np.errstate(divide="ignore", invalid="ignore"):
            change = np.log(values[1:] / values[:-1])
        coarse = ~(np.abs(change) < _TURN) & (np.diff(w) > 1e-9 * w[1:])
        if not coarse.any() or len(w) > 20_000:
            break
        new = np.sqrt(w[:-1] * w[1:])[coarse]
        w, values = np.concatenate([w, new]), np.concatenate([values, L(new)])
        order = np.argsort(w)
        w, values = w[order], values[order]
    return w, values


def loop_margins(loop: StateSpace) -> Margins | None:
    """Return the margins of a sampled loop, None where it is not stable as it is."""
    if spectral_radius(loop.A - loop.B @ loop.C) >= 1.0:
        return None
    w, values = frequency_response(loop)
    L = response(loop)
    sensitivity = _peak(lambda x: np.abs(1.0 / (1.0 + x)), L, w, values)
    # S - T over 2; at infinite gain it is -1/2.
    skew, w_disk = _peak(lambda x: np.abs(0.5 * (1.0 - x) / (1.0 + x)), L, w, values)
    disk = (min(1.0 / skew, 2.0), w_disk)
    found = (*_gains(loop, L, w, values), *_phases(L, w, values), sensitivity, disk)
    return Margins(*(value for value, _ in found), *(frequency for _, frequency in found))


def _sample_time(loop: StateSpace) -> float:
    if loop.sample_time is None or len(loop.inputs) != 1 or len(loop.outputs) != 1:
        raise ValueError("margins are those of a sampled loop of one input and one output")
    return loop.sample_time


Response = Callable[[ArrayLike], Complex]  # L at frequencies [rad/s]


def response(loop: StateSpace) -> Response:
    """L at each of some frequencies [rad/s]."""
    h = _sample_time(loop)
    A, B, C = _balanced(loop)
    balanced = replace(loop, A=A, B=B, C=C)
    return lambda w: balanced.at(np.exp(1j * h * np.asarray(w)))[:, 0, 0]


Limit = tuple[float, float]  # a margin, and its frequency [rad/s]


def _gains(loop: StateSpace, L: Response, w: Array, values: Complex) -> tuple[Limit, Limit]:
    """The nearest gains up and down at which a root of 1 + k L really leaves the unit circle."""
    candidates = [(float(-1.0 / values[-1].real), float(w[-1]))] if values[-1].real < 0.0 else []
    steady = _steady(loop)
    if steady is not None and steady < 0.0:
        candidates.append((-1.0 / steady, 0.0))
    turn = values.imag / np.abs(values)
    for i in np.flatnonzero((turn[:-2] * turn[1:-1] <= 0.0) & (values.real[:-2] < 0.0)):
        if turn[i] == turn[i + 1]:
            continue
        x = _root(lambda x: float(L(x)[0].imag), w[i], w[i + 1])
        real = float(L(x)[0].real)
        if real < 0.0:
            candidates.append((-1.0 / real, x))

    up = _first_unstable(loop, sorted(c for c in candidates if c[0] > 1.0), beyond=10.0)
    falling = sorted((c for c in candidates if c[0] < 1.0), reverse=True)
    down = _first_unstable(loop, falling, beyond=0.1)
    return up or (math.inf, math.nan), down or (0.0, math.nan)


def _first_unstable(loop: StateSpace, candidates: list[Limit], *, beyond: float) -> Limit | None:
    """The first gain, with its frequency, that the loop is unstable behind.

    Between two candidates nothing crosses, so one evaluation halfway decides; right at a crossing
    of slow roots rounding would.
    """
    for i, (k, w) in enumerate(candidates):
        following = next((n for n, _ in candidates[i + 1 :] if abs(n / k - 1.0) > 1e-4), None)
        halfway = math.sqrt(k * (k * beyond if following is None else following))
        if spectral_radius(loop.A - halfway * loop.B @ loop.C) >= 1.0:
            return k, w
    return None


def _steady(loop: StateSpace) -> float | None:
    """L at frequency 0; None where an integrator makes it infinite."""
    matrix = np.eye(len(loop.states)) - loop.A
    if np.linalg.cond(matrix) > 1e13:
        return None
    return float((loop.C @ np.linalg.solve(matrix, loop.B) + loop.D)[0, 0])


def _phases(L: Response, w: Array, values: Complex) -> tuple[Limit, Limit]:
    """Smallest turn that brings L to -1, and smallest delay, each with its frequency."""
    with np.errstate(divide="ignore"):
        log = np.log(np.abs(values))
    phase, delay = (math.inf, math.nan), (math.inf, math.nan)
    for i in np.flatnonzero(np.sign(log[:-1]) != np.sign(log[1:])):
        x = _root(lambda x: math.log(abs(L(x)[0])), w[i], w[i + 1])
        lag = (float(np.angle(L(x)[0])) + math.pi) % (2.0 * math.pi)
        phase = min(phase, (min(lag, 2.0 * math.pi - lag), x))
        delay = min(delay, (lag / x, x))
    return phase, delay


def _root(f: Callable[[float], float], low: float, high: float) -> float:
    """The zero of f in an interval; the nearer end where rounding has hidden the change of sign."""
    from scipy.optimize import brentq

    at_low, at_high = f(low), f(high)
    if at_low * at_high > 0.0:
        return float(low if abs(at_low) < abs(at_high) else high)
    return float(brentq(f, low, high, xtol=1e-15, rtol=1e-14))


def _peak(size: Callable[[Complex], Array], L: Response, w: Array, response: Complex) -> Limit:
    """Largest size of L and where, the grid's largest few maxima refined.

    Each between its neighbours, where there is one maximum, by points that are evenly apart in the
    logarithm, then between the neighbours of the largest of these, until they are as large.
    """
    values = size(response)
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1
    around = np.array(sorted([0, *inner], key=lambda i: -values[i])[:_MAXIMA])
    best = max((float(values[i]), float(w[i])) for i in [*around, -1])
    low, high = np.log(w[np.maximum(around - 1, 0)]), np.log(w[around + 1])
    for _ in range(_ROUNDS):
        x = low[:, None] + (high - low)[:, None] * _PARTS
        found = size(L(np.exp(x.ravel()))).reshape(x.shape)
        rows, at = np.arange(len(x)), np.argmax(found, axis=1)
        largest = found[rows, at]
        top = int(np.argmax(largest))
        best = max(best, (float(largest[top]), math.exp(float(x[top, at[top]]))))
        before, after = np.maximum(at - 1, 0), np.minimum(at + 1, len(_PARTS) - 1)
        missed = largest - np.minimum(found[rows, before], found[rows, after])
        rough = (missed > _FLAT * best[0]) & (largest + missed >= best[0])
        if not rough.any():
            break
        low, high = x[rows, before][rough], x[rows, after][rough]
    return best


def largest_delay(closed: Callable[[float], Array], *, step: float, horizon: float) -> float:
    """Return the delay [s] at which a loop stable without it first loses stability.

    closed: delay [s] -> matrix of the closed loop; step: of the search [s]; horizon: where it ends
    [s], inf is returned then; 0 where the loop is not stable without any delay.
    """
    from scipy.optimize import brentq

    def beyond(delay: float) -> float:
        return spectral_radius(closed(delay)) - 1.0

    for i in range(math.ceil(horizon / step) + 1):
        if beyond(i * step) >= 0.0:
            low = max(i - 1, 0) * step
            return float(brentq(beyond, low, i * step, xtol=1e-12, rtol=1e-12)) if i else 0.0
    return math.inf
