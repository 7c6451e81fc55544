"""A Kalman filter for depth, speed and a neutral volume that drifts, driven by a known volume.

Compiled loops go along the samples of a log forward, back, and ahead from each sample. What others
call takes a plant, arrays of one log and the noise. Nothing here knows of files, logs or units.

One step carries depth, speed and neutral volume, their slopes and their noise under a volume that
is known. The state is (z, w, V0) with ``dz/dt = w``, ``dw/dt = a_b (psi z + V0 - V(t)) - F_d(w)/m``
plus the hull's stiffness where it emerges (eqs 13, 15, 16, 31), and ``dV0 = q dB``: the neutral
volume at depth 0 is a random walk. V(t) is linear over a step. White acceleration may stand for
what the model leaves out. Where the water is layered, what its layers add at z, known from a cast,
goes beside psi z: mean and slopes take it as it is, not as a line.

A recorded volume may be off: by a constant for as long as one value stands in the log, as a
coarse sensor's is, and by white noise of each span, as the way between two samples is not known.
The first goes through a neutral volume that is that much off until the next value.

Under laminar drag, without layers, clear of surface and bottom, the step is exact: with G the
velocity's impulse response, G'' = a_b psi G - d_l G', everything is made of G', G and its first two
integrals. Else Runge-Kutta's fourth-order scheme carries the motion with its variational equations.

A bank holds several filters, each with its own guess of what is not known, weighed by how they
fare. While a vehicle floats, its depth says only that it is lighter than neutral, and one linear
filter takes nothing from that. Filters that start from several neutral volumes do: those that
expect the vehicle to sink too early or too late lose their weight when it stays or goes. Drag, psi,
a drift and the noise differ from log to log too, and guesses of them are weighed in the same way:
by what was measured so far, and nothing else (Magill, IEEE Trans. Autom. Control 10, 1965; Alspach
and Sorenson, ibid. 17, 1972).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.series import Index, huber
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.cache import allocating, compiled
from swimbladder.sim.engine.modes import (
    A_B,
    A_S,
    D_B,
    D_L,
    D_T,
    DEEPEST,
    EPSILON,
    NO_LAYERS,
    PSI,
    V_0,
    Z_AIR,
    Z_BOTTOM,
    Z_SURFACE,
    Layers,
    drag,
    layered,
)

# Damping of the emerging hull over critical damping [-]: waves carry its energy away, which the
# plant leaves out; without it a filter would believe in minutes of bobbing.
BOBBING_DAMPING = 0.5

_REACH = 1.0  # step times rate up to which the series of G is summed at once
_FINE = 0.08  # step times rate of the drag, for Runge-Kutta
_FINE_BOBBING = 0.15  # step times frequency of the emerging hull
_MOST = 20_000.0  # steps of Runge-Kutta between two samples
# Gauss-Legendre points and weights on (0, 1), exact for polynomials of degree 9.
_x, _c = np.polynomial.legendre.leggauss(5)
_POINTS, _WEIGHTS = tuple((0.5 * (_x + 1.0)).tolist()), tuple((0.5 * _c).tolist())


EXACT = np.zeros((2, 0))


class Samples(NamedTuple):
    """A log's arrays of one length n, and the layers of the water that it was made in.

    volume_error [2, n]: variance of the one that begins at a sample [m6], -1 where the one before
    goes on; and the density of white noise over the span up to the sample [m6 s].
    """

    time: Array  # s, growing
    volume: Array  # m3, linear between samples
    depth: Array  # m; nan: not measured
    use: NDArray[np.int8]  # 1: counts; 0: in contact, with the contact's noise; -1: not looked at
    layers: Layers = NO_LAYERS
    volume_error: Array = EXACT


class Filtered(NamedTuple):
    """What the filter made of n samples; states are (depth m, speed m/s, neutral volume m3)."""

    predicted: Array  # [n, 3], before each sample
    predicted_covariance: Array  # [n, 3, 3]
    slopes: Array  # [n, 3, 3], of each predicted state by the one before
    mean: Array  # [n, 3], after each sample
    covariance: Array  # [n, 3, 3]
    innovation: Array  # m [n], measured less predicted; nan where not looked at
    variance: Array  # m2 [n], of the innovation
    contribution: Array  # [n], to the log likelihood
    fate: NDArray[np.int8]  # [n], UNSEEN ... RESTARTED

    @property
    def log_likelihood(self) -> float:
        """That of the samples that count."""
        return float(self.contribution.sum())

    def only(self, rows: Index) -> "Filtered":
        """Return some of the samples, of which no states can be smoothed any more."""
        arrays: Any = (values[rows] for values in self)
        return Filtered(*arrays)

    def smoothed(self) -> tuple[Array, Array]:
        """Return states [n, 3] and covariances [n, 3, 3] given all samples, earlier and later.

        By Rauch, Tung and Striebel.
        """
        mean, covariance = self.mean.copy(), self.covariance.copy()
        spread = self.predicted_covariance[1:]
        scale = np.sqrt(np.maximum(np.diagonal(spread, axis1=1, axis2=2), 1e-300))[:, :, None]
        A = spread / (scale * scale.transpose(0, 2, 1)) + 1e-12 * np.eye(3)  # aground no depth errs
        cross = self.slopes[1:] @ covariance[:-1] / scale  # [n, new, old]
        gains = (np.linalg.solve(A, cross) / scale).transpose(0, 2, 1).copy()
        smooth_kernel(self.predicted, self.predicted_covariance, gains, mean, covariance)
        return mean, covariance


class Motion(NamedTuple):
    """A vehicle, its water, and the intensities of the noise that moves it."""

    p: Array  # the plant, by `modes`
    layers: Layers
    walk2: float  # m6/s, random walk of the neutral volume
    jolt2: float  # m2/s3, acceleration


class Span(NamedTuple):
    """The time between two samples [s], and the volumes at its ends [m3]."""

    h: float
    Va: float
    Vb: float


@allocating
def _copy(values: Array, into: Array) -> None:
    """Copy numbers [n]: for an array that is assigned numba compiles texts of errors, 4 s long."""
    for i in range(len(values)):
        into[i] = values[i]


@allocating
def _copy_rows(values: Array, into: Array) -> None:
    """Copy numbers [n, m]."""
    for i in range(len(values)):
        _copy(values[i], into[i])


@allocating
def _response(d: float, kappa: float, h: float) -> tuple[float, float, float, float]:
    """Return (G', G, I1, I2) at h [s] of G'' = kappa G - d G', G(0) = 0, G'(0) = 1.

    I1 and I2 are the first and second integral of G. Meant for h (d + sqrt|kappa|) up to 1 or so.
    """
    before, here = 0.0, 1.0  # derivatives of G at 0, of order n - 1 and n
    power = 1.0  # h^(n-1)/(n-1)!
    slope, g, i1, i2 = 0.0, 0.0, 0.0, 0.0
    for n in range(1, 60):
        p1 = power * h / n
        p2 = p1 * h / (n + 1)
        p3 = p2 * h / (n + 2)
        slope += here * power
        g += here * p1
        i1 += here * p2
        i2 += here * p3
        before, here = here, kappa * before - d * here
        power = p1
        if n > 3 and abs(here) * power <= 1e-17 and abs(before) * power <= 1e-17:
            break
    return slope, g, i1, i2


@allocating
def _add_noise(m: Motion, tau: float, weight: float, Q: Array) -> None:
    """Add to Q what the noise of an instant does tau [s] later."""
    a = m.p[A_B]
    slope, g, i1, _ = _response(m.p[D_L], a * m.p[PSI], tau)
    vz, vw = a * i1, a * g
    q, s = weight * m.walk2, weight * m.jolt2
    Q[0, 0] += q * vz * vz + s * g * g
    Q[0, 1] += q * vz * vw + s * g * slope
    Q[1, 1] += q * vw * vw + s * slope * slope
    Q[0, 2] += q * vz
    Q[1, 2] += q * vw
    Q[2, 2] += q


@allocating
def _turn(F: Array, P: Array) -> None:
    """Replace P [3, 3] by F P."""
    for j in range(3):
        a, b, c = P[0, j], P[1, j], P[2, j]
        for i in range(3):
            P[i, j] = F[i, 0] * a + F[i, 1] * b + F[i, 2] * c


@allocating
def _propagate(P: Array, F: Array, Q: Array) -> None:
    """Replace P [3, 3] by F P F' + Q, symmetric; Q holds its upper triangle."""
    _turn(F, P)
    for i in range(3):
        a, b, c = P[i, 0], P[i, 1], P[i, 2]
        for j in range(i, 3):
            P[i, j] = a * F[j, 0] + b * F[j, 1] + c * F[j, 2] + Q[i, j]
    P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]


@allocating
def _laminar(m: Motion, x: Array, span: Span, F: Array, Q: Array) -> None:
    """Advance x over a span under laminar drag, clear of surface and bottom, exactly."""
    a, d = m.p[A_B], m.p[D_L]
    kappa = a * m.p[PSI]
    n = max(math.ceil(span.h * (d + math.sqrt(abs(kappa))) / _REACH), 1)
    s = span.h / n
    slope, g, i1, i2 = _response(d, kappa, s)
    f, q = np.zeros((3, 3)), np.zeros((3, 3))
    f[0, 0], f[0, 1], f[0, 2] = 1.0 + kappa * i1, g, a * i1
    f[1, 0], f[1, 1], f[1, 2] = kappa * g, slope, a * g
    f[2, 2] = 1.0
    if m.walk2 > 0.0 or m.jolt2 > 0.0:
        for i in range(5):
            _add_noise(m, _POINTS[i] * s, _WEIGHTS[i] * s, q)
    rate = (span.Vb - span.Va) / span.h
    _copy_rows(f, F)
    _copy_rows(q, Q)
    Q[1, 0], Q[2, 0], Q[2, 1] = q[0, 1], q[0, 2], q[1, 2]
    for i in range(n):
        if i:
            _turn(f, F)
            _propagate(Q, f, q)
        V = span.Va + rate * (i * s)
        # with the neutral volume taken off first: the difference is small, both are not
        force = a * (x[2] - V)
        moved = f[0, 0] * x[0] + g * x[1] + force * i1 - a * rate * i2
        x[1] = kappa * g * x[0] + slope * x[1] + force * g - a * rate * i1
        x[0] = moved


@allocating
def _slopes(m: Motion, x: Array, V: float, tau: float, out: Array) -> None:
    """Right-hand side of x: z, w, then F's columns (z and w rows of each), then Q's five parts.

    V: volume less neutral volume [m3]; tau: time since the step began [s].
    """
    p, z, w = m.p, x[0], x[1]
    taken, bends, _ = drag(p, w)
    added, steeper = layered(m.layers, z)
    force = p[A_B] * (p[PSI] * z + added - V) - taken
    pull, damping = p[A_B] * (p[PSI] + steeper), bends
    if z < p[Z_SURFACE]:
        bobbing = 2.0 * BOBBING_DAMPING * math.sqrt(p[A_S])
        force += p[A_S] * (p[Z_SURFACE] - z) - bobbing * w
        pull -= p[A_S]
        damping += bobbing
    out[0], out[1] = w, force
    for j in range(3):
        out[2 + 2 * j] = x[3 + 2 * j]
        out[3 + 2 * j] = pull * x[2 + 2 * j] - damping * x[3 + 2 * j]
    a = p[A_B]
    out[7] += a
    zz, zw, ww, zV, wV = x[8], x[9], x[10], x[11], x[12]
    out[8] = 2.0 * zw
    out[9] = ww + pull * zz - damping * zw + a * zV
    out[10] = 2.0 * (pull * zw - damping * ww + a * wV) + m.jolt2
    out[11] = wV
    out[12] = pull * zV - damping * wV + a * m.walk2 * tau


@allocating
def _cross(p: Array, x: Array, up: bool) -> None:
    """Change slopes and noise of x where the vehicle passes through the surface.

    The damping begins or ends there at once, and a vehicle that is higher gets there earlier: by
    the saltation matrix, dw gains -+ damping times dz.
    """
    jump = 2.0 * BOBBING_DAMPING * math.sqrt(p[A_S]) * (-1.0 if up else 1.0)
    for j in range(3):
        x[3 + 2 * j] += jump * x[2 + 2 * j]
    x[10] += jump * (2.0 * x[9] + jump * x[8])
    x[9] += jump * x[8]
    x[12] += jump * x[11]


@allocating
def _substep(m: Motion, x: Array, V: float, rate: float, t: float, s: float, k: Array) -> None:
    """Fill the last row of k [5, 13] with x after a step of s [s], t [s] after the span began.

    V: volume less neutral volume then [m3], which grows at a rate [m3/s].
    """
    y, middle, late, n = k[4], V + 0.5 * rate * s, V + rate * s, x.shape[0]
    _slopes(m, x, V, t, k[0])
    for i in range(n):
        y[i] = x[i] + 0.5 * s * k[0, i]
    _slopes(m, y, middle, t + 0.5 * s, k[1])
    for i in range(n):
        y[i] = x[i] + 0.5 * s * k[1, i]
    _slopes(m, y, middle, t + 0.5 * s, k[2])
    for i in range(n):
        y[i] = x[i] + s * k[2, i]
    _slopes(m, y, late, t + s, k[3])
    for i in range(n):
        y[i] = x[i] + s / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])


@allocating
def _runge_kutta(m: Motion, state: Array, span: Span, n: int, F: Array, Q: Array) -> bool:
    """Advance a state over a span in n steps; the bottom stops the vehicle. Return if aground."""
    p, x, k = m.p, np.zeros(13), np.empty((5, 13))
    y = k[4]
    x[0], x[1], x[2], x[5] = state[0], state[1], 1.0, 1.0
    s = span.h / n
    rate = (span.Vb - span.Va) / span.h
    surface = p[Z_SURFACE]
    aground = False
    for i in range(n):
        t = i * s
        V = span.Va - state[2] + rate * t
        push = p[A_B] * (p[PSI] * x[0] + layered(m.layers, x[0])[0] - V)
        aground = x[0] >= p[Z_BOTTOM] and x[1] >= 0.0 and push >= 0.0
        if aground:
            x[0], x[1] = p[Z_BOTTOM], 0.0
            x[2:] = 0.0
            continue
        _substep(m, x, V, rate, t, s, k)
        up = y[0] < surface
        if up != (x[0] < surface):  # to the surface, through it, and on
            share = (surface - x[0]) / (y[0] - x[0])
            part = share * s
            if share > 0.0:
                _substep(m, x, V, rate, t, part, k)
                _copy(y, x)
            _cross(p, x, up)
            _substep(m, x, V + rate * part, rate, t + part, (1.0 - share) * s, k)
        _copy(y, x)
        if x[0] > p[Z_BOTTOM]:
            x[0], x[1] = p[Z_BOTTOM], min(x[1], 0.0)
            x[2:] = 0.0
            aground = True
    for j in range(3):
        F[0, j], F[1, j], F[2, j] = x[2 + 2 * j], x[3 + 2 * j], 0.0
    F[2, 2] = 1.0
    Q[0, 0], Q[0, 1], Q[1, 1] = x[8], x[9], x[10]
    Q[0, 2], Q[1, 2], Q[2, 2] = x[11], x[12], m.walk2 * span.h
    state[0], state[1] = x[0], x[1]
    return aground


@allocating
def transition(m: Motion, x: Array, span: Span, F: Array, Q: Array) -> bool:
    """Advance the state x [3] over a span; return whether it is aground.

    Fills F [3, 3], the slope of the new state by the old one, and Q [3, 3], upper triangle, the
    covariance that the noise adds.
    """
    p, z, w, h = m.p, x[0], x[1], span.h
    taken = drag(p, w)[0]
    steady = p[A_B] * (p[PSI] * z + layered(m.layers, z)[0] + x[2])
    first, last = steady - p[A_B] * span.Va, steady - p[A_B] * span.Vb
    least, most = min(first, last) - taken, max(first, last) - taken
    up = max(-w, 0.0) * h + 0.5 * max(-least, 0.0) * h * h
    down = max(w, 0.0) * h + 0.5 * max(most, 0.0) * h * h
    rises = z - up <= p[Z_SURFACE]
    plain = p[EPSILON] == math.inf and m.layers.table.shape[0] == 0
    if plain and not rises and z + down < p[Z_BOTTOM]:
        _laminar(m, x, span, F, Q)
        return False
    # as fast as it may become within the step, where drag does not hold it back
    fastest = abs(w) + max(abs(least), abs(most)) * h
    if p[D_T] > 0.0:
        fastest = min(fastest, max(abs(w), math.sqrt(max(abs(first), abs(last)) / p[D_T])))
    rate = max(p[D_L], p[D_B] + 2.0 * p[D_T] * fastest)
    rate += math.sqrt(p[A_B] * (abs(p[PSI]) + m.layers.steepest))
    steps = h * rate / _FINE
    if rises:
        steps = max(steps, h * math.sqrt(p[A_S]) / _FINE_BOBBING)
    n = max(int(min(math.ceil(steps), _MOST)), 1)
    aground: bool = _runge_kutta(m, x, span, n, F, Q)
    return aground


@allocating
def _span(time: Array, volume: Array, k: int) -> Span:
    """Return what is between the sample before k and k."""
    return Span(time[k] - time[k - 1], volume[k - 1], volume[k])


@allocating
def _predict(m: Motion, x: Array, C: Array, span: Span, F: Array, noise: Array) -> None:
    """Advance the state x [3] and its covariance C over a span; fills F, as `transition` does.

    On the bottom depth and speed are known, but for what the noise in contact says.
    """
    Q = np.empty((3, 3))
    aground = transition(m, x, span, F, Q)
    _propagate(C, F, Q)
    if aground:
        C[0, 0] += noise[1]
        C[1, 1] += noise[4]


# What became of a sample.
UNSEEN, HELD, COUNTED, CLIPPED, REJECTED, RESTARTED = 0, 1, 2, 3, 4, 5
_IN_A_ROW = 4  # samples beyond the gate to one side: not outliers, the state is wrong


@allocating
def _loss(size: float, gate: float) -> tuple[float, float]:
    """Return minus the log density of an innovation of so many deviations, and its weight.

    Normal up to the gate; beyond it falls as 1/size, which no longer asks for larger deviations.
    The weight is 1 up to the gate; what is far beyond is as good as left out.
    """
    if size <= gate:
        return 0.5 * size * size, 1.0
    u = (gate / size) ** 2
    loss = 0.5 * gate * gate * (2.0 - u) - 0.5 * (1.0 - u) + math.log(size / gate)
    return loss, (gate * gate * u + 1.0 - u) / (size * size)


@allocating
def _update(x: Array, P: Array, error: float, R: float, S: float) -> None:
    """Take in a measured depth: x += K error with K = P H'/S, and P in Joseph's form."""
    k0, k1, k2 = P[0, 0] / S, P[0, 1] / S, P[0, 2] / S
    x[0], x[1], x[2] = x[0] + k0 * error, x[1] + k1 * error, x[2] + k2 * error
    F = np.zeros((3, 3))
    F[0, 0], F[1, 0], F[2, 0] = 1.0 - k0, -k1, -k2
    F[1, 1], F[2, 2] = 1.0, 1.0
    Q = np.empty((3, 3))
    Q[0, 0], Q[0, 1], Q[0, 2] = k0 * R * k0, k0 * R * k1, k0 * R * k2
    Q[1, 1], Q[1, 2], Q[2, 2] = k1 * R * k1, k1 * R * k2, k2 * R * k2
    _propagate(P, F, Q)


# Rows of `besides`, what is known beside the state: its mean, its variance, its covariances with
# the state [3], and that of both.
_LASTS, _ERROR = 0, 1


@allocating
def _begin(besides: Array, noise: Array) -> None:
    """Begin with what is known before any sample: the depth's correlated noise, no volume error."""
    besides[:] = 0.0
    besides[_LASTS, 1] = noise[5]


@allocating
def _fade(F: Array, besides: Array, h: float, noise: Array) -> None:
    """Advance over h [s] what is known beside the state: the depth's correlated noise fades."""
    kept = math.exp(-h * noise[6])
    for row in range(2):
        one = besides[row]
        a, b, c = one[2], one[3], one[4]
        share = kept if row == _LASTS else 1.0
        for i in range(3):
            one[2 + i] = share * (F[i, 0] * a + F[i, 1] * b + F[i, 2] * c)
    lasts = besides[_LASTS]
    lasts[0] *= kept
    lasts[1] = kept * kept * lasts[1] + noise[5] * (1.0 - kept * kept)
    lasts[5] *= kept


@allocating
def _renew(x: Array, P: Array, besides: Array, variance: float) -> None:
    """Let the volume's error be another, of a variance [m6]; the neutral volume has it in it."""
    error, lasts = besides[_ERROR], besides[_LASTS]
    x[2] -= error[0]
    P[2, 2] += error[1] - 2.0 * error[4] + variance
    for i in range(2):
        P[i, 2] -= error[2 + i]
        P[2, i] = P[i, 2]
    lasts[4] -= lasts[5]
    lasts[5] = 0.0
    error[:] = 0.0
    error[1], error[4] = variance, variance


@allocating
def _take_besides(x: Array, P: Array, besides: Array, error: float, S: float) -> None:
    """Take in a measured depth where something is known beside the state.

    S [m2]: the innovation's variance.
    """
    lasts, volume = besides[_LASTS], besides[_ERROR]
    k = (P[0, 0] + lasts[2]) / S, (P[1, 0] + lasts[3]) / S, (P[2, 0] + lasts[4]) / S
    own, off = (lasts[1] + lasts[2]) / S, (lasts[5] + volume[2]) / S
    for i in range(3):
        x[i] += k[i] * error
        lasts[2 + i] -= k[i] * own * S
        volume[2 + i] -= k[i] * off * S
        for j in range(3):
            P[i, j] -= k[i] * k[j] * S
    lasts[0] += own * error
    lasts[1] -= own * own * S
    lasts[5] -= own * off * S
    volume[0] += off * error
    volume[1] -= off * off * S


@compiled
def filter_kernel(
    p: Array, samples: Samples, start: Array, cov: Array, noise: Array, gate: float, out: Filtered
) -> None:
    """Filter n measured depths [m].

    start [3], cov [3, 3]: state and covariance at the first instant, before its sample. noise:
    variance of the depth [m2], of the depth in contact [m2], random walk^2 [m6/s], acceleration^2
    [m2/s3], variance of the speed in contact [m2/s2], of the depth's correlated noise [m2], and the
    rate at which that fades [1/s].
    """
    R, R_held, inexact = noise[0], noise[1], samples.volume_error.shape[1] > 0
    m, beside = Motion(p, samples.layers, noise[2], noise[3]), noise[5] > 0.0 or inexact
    x, C = start.copy(), cov.copy()
    besides = np.empty((2, 6))
    lasts = besides[_LASTS]
    _begin(besides, noise)
    if inexact:  # what is known of the first neutral volume is against the volume as recorded
        besides[_ERROR, 1] = samples.volume_error[0, 0]
    row, side = 0, 0.0
    for k in range(samples.time.shape[0]):
        if k:
            if inexact:
                m = Motion(
                    p, m.layers, m.walk2, noise[3] + p[A_B] ** 2 * samples.volume_error[1, k]
                )
            _predict(m, x, C, _span(samples.time, samples.volume, k), out.slopes[k], noise)
            if beside:
                _fade(out.slopes[k], besides, samples.time[k] - samples.time[k - 1], noise)
            if inexact and samples.volume_error[0, k] >= 0.0:
                _renew(x, C, besides, samples.volume_error[0, k])
        _copy(x, out.predicted[k])
        _copy_rows(C, out.predicted_covariance[k])
        out.fate[k], out.contribution[k] = UNSEEN, 0.0
        out.innovation[k], out.variance[k] = np.nan, np.nan
        if samples.use[k] >= 0 and math.isfinite(samples.depth[k]):
            e = samples.depth[k] - x[0] - lasts[0]
            known = C[0, 0] + 2.0 * lasts[2] + lasts[1]
            S = known + (R_held if samples.use[k] == 0 else R)
            size = abs(e) / math.sqrt(S)
            out.innovation[k], out.variance[k] = e, S
            if samples.use[k] == 0:
                out.fate[k], row = HELD, 0
                if size > gate:
                    S *= size / gate
            else:
                loss, pull = _loss(size, gate)
                out.contribution[k] = -loss - 0.5 * math.log(2.0 * math.pi * S)
                S /= pull
                if size > gate:
                    out.fate[k] = CLIPPED if size < 2.0 * gate else REJECTED
                    row, side = (row + 1 if row and (e > 0.0) == (side > 0.0) else 1), e
                else:
                    out.fate[k], row = COUNTED, 0
            if row == _IN_A_ROW:
                out.fate[k], row = RESTARTED, 0
                x[0], x[1] = samples.depth[k], 0.0
                neutral = max(cov[2, 2], C[2, 2])
                C[:, :] = 0.0
                C[0, 0], C[1, 1], C[2, 2] = R + noise[5], cov[1, 1], neutral
                _begin(besides, noise)
            elif beside:
                _take_besides(x, C, besides, e, S)
            else:
                _update(x, C, e, S - known, S)
        _copy(x, out.mean[k])
        _copy_rows(C, out.covariance[k])


@compiled
def predict_kernel(
    p: Array, samples: Samples, known: tuple[Array, Array], ends: tuple[Index, Index], noise: Array
) -> tuple[Array, Array]:
    """Return depths at samples ends[1] [n], predicted from after samples ends[0], and variances.

    known: states [n, 3] and covariances there. The volume on the way is known. The variances [m2]
    are of the true depth, without the measurement's.
    """
    m, F = Motion(p, samples.layers, noise[2], noise[3]), np.empty((3, 3))
    x, C = known[0].copy(), known[1].copy()
    for i in range(len(x)):
        for k in range(ends[0][i] + 1, ends[1][i] + 1):
            _predict(m, x[i], C[i], _span(samples.time, samples.volume, k), F, noise)
    return x[:, 0], C[:, 0, 0]


@compiled
def follow_kernel(
    plants: Array, layers: Layers, time: Array, volume: Array, starts: Array
) -> Array:
    """Follow a volume [n] with several vehicles; depths [lanes, n] are nan once one left the water.

    plants [lanes, fields]; starts [lanes, 3]: depth [m] and speed [m/s] at the first instant, and
    how fast what is neutral grows from time 0 on [m3/s].
    """
    F, Q, x = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    depth = np.full((len(plants), len(time)), np.nan)
    for i in range(len(plants)):
        p, own = plants[i], volume - starts[i, 2] * time
        x[0], x[1], x[2] = starts[i, 0], starts[i, 1], p[V_0]
        depth[i, 0] = x[0]
        for k in range(1, len(time)):
            transition(Motion(p, layers, 0.0, 0.0), x, _span(time, own, k), F, Q)
            if not (x[0] > p[Z_AIR] and x[0] < DEEPEST):
                break
            depth[i, k] = x[0]
    return depth


@compiled
def smooth_kernel(before: Array, spread: Array, gains: Array, mean: Array, P: Array) -> None:
    """Replace mean and P by those given all samples; gains [n - 1, 3, 3]: of each by the next."""
    more = np.empty((3, 3))
    for k in range(mean.shape[0] - 2, -1, -1):
        for i in range(3):
            for j in range(3):
                mean[k, i] += gains[k, i, j] * (mean[k + 1, j] - before[k + 1, j])
                more[i, j] = P[k + 1, i, j] - spread[k + 1, i, j]
        _propagate(more, gains[k], P[k])
        _copy_rows(more, P[k])


GATE = 3.0  # standard deviations of an innovation beyond which it is not believed in full


class Noise(NamedTuple):
    """How uncertain measurement and motion are."""

    depth: float  # m, 1 sigma of a measured depth, its quantum's share included
    random_walk: float  # m3/s^0.5, intensity of the neutral volume's random walk
    acceleration: float = 0.0  # m/s^1.5, intensity of white acceleration
    held_depth: float = 0.05  # m, 1 sigma of depths in contact with surface or bottom
    held_speed: float = 0.02  # m/s, the same of the speed
    correlated: float = 0.0  # m, 1 sigma of a part of the measured depth's noise that lasts
    correlation_time: float = 1.0  # s, time constant of that

    def variances(self) -> Array:
        """Return what the kernels take: squares, and how fast correlated noise fades [1/s]."""
        intensities = self.random_walk, self.acceleration
        deviations = self.depth, self.held_depth, *intensities, self.held_speed, self.correlated
        return np.append(np.square(deviations), 1.0 / self.correlation_time)


class Start(NamedTuple):
    """State before the first sample, with standard deviations; the three are independent."""

    depth: float  # m
    speed: float  # m/s
    neutral: float  # m3, neutral volume at depth 0, without what layers of the water add there
    depth_std: float
    speed_std: float
    neutral_std: float


def filter_depth(
    plant: Plant, samples: Samples, *, noise: Noise, start: Start, gate: float = GATE
) -> Filtered:
    """Return what the extended Kalman filter makes of a log's depths.

    gate: innovations beyond so many standard deviations lose weight, the faster the farther they
    are: with a gate of 3, one of 6 counts as 0.5 and one of 30 as 0.04. Four in a row to one
    side show that the state is wrong, and the filter starts anew from
    the depth measured, with the speed's and the neutral volume's first deviations.
    """
    n = len(samples.time)
    states, matrices = np.empty((2, n, 3)), np.zeros((3, n, 3, 3))
    before, after = (states[0], matrices[0], matrices[1]), (states[1], matrices[2])
    error, variance, contribution = np.empty((3, n))
    out = Filtered(*before, *after, error, variance, contribution, np.empty(n, np.int8))
    first, covariance = np.array(start[:3]), np.diag(np.square(start[3:]))
    filter_kernel(np.array(plant), samples, first, covariance, noise.variances(), gate, out)
    return out


def follow(
    plants: Sequence[Plant], layers: Layers, time: Array, volume: Array, starts: Array
) -> Array:
    """Return the depths [lanes, n] in m of several vehicles under one known volume.

    By the filter's own step, without noise, in layered water. volume [n] in m3, straight between
    the instants time [n] in s; starts [lanes, 3]: depth [m], speed [m/s], and how fast what is
    neutral grows from time 0 on [m3/s]. nan from where a vehicle left the water.
    """
    arrays = [np.ascontiguousarray(a, float) for a in (time, volume, starts)]
    return np.asarray(follow_kernel(np.array(plants), layers, *arrays))


# Depths in contact are wrong by much the same from sample to sample: so many make one.
_HELD_ALIKE = 3.0
_WORTH = 1e-3  # of the weight, below which a member is left out


class Member(NamedTuple):
    """A guess of all unknowns, as likely as any other before the log begins."""

    plant: Plant
    noise: Noise
    start: Start
    drift: float  # m3/s, steady growth of the neutral volume, beside its random walk


@dataclass(frozen=True)
class Bank:
    """What the members made of a log: their weights, and their states where these count."""

    samples: Samples
    members: tuple[Member, ...]
    weight: Array  # [members, n], given all depths up to each sample
    # By member: samples at which its state counts, the state [rows, 3] and its covariance there.
    states: dict[int, tuple[Index, Array, Array]]

    def ahead(self, first: Index, last: Index) -> tuple[Array, Array]:
        """Return mean and standard deviation of the depth [m] at samples `last`.

        Each given all depths up to the sample `first`, which counts, and the volumes up to `last`;
        the deviation is of the depth itself, without the measurement's noise.
        """
        mean, square, total = np.zeros(len(first)), np.zeros(len(first)), np.zeros(len(first))
        for i, (rows, states, covariances) in self.states.items():
            member, weight = self.members[i], self.weight[i, first]
            (worth,) = np.nonzero(weight > _WORTH)
            at, ends = np.searchsorted(rows, first[worth]), (first[worth], last[worth])
            plant, noise = np.array(member.plant), member.noise.variances()
            known, samples = (states[at], covariances[at]), _drifted(self.samples, member)
            depth, variance = predict_kernel(plant, samples, known, ends, noise)
            mean[worth] += weight[worth] * depth
            square[worth] += weight[worth] * (variance + depth**2)
            total[worth] += weight[worth]
        mean, square = mean / total, square / total
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    def weighted(self, values: Array) -> Array:
        """Return the weighed mean [n] of values [members] after each sample."""
        return np.asarray(values @ self.weight)


def filter_bank(samples: Samples, members: Sequence[Member], *, gate: float = GATE) -> Bank:
    """Return what the members make of a log; equal weights before its first sample."""
    likelihood = np.stack([log_likelihood(samples, member, gate=gate) for member in members])
    weight = np.exp(likelihood - likelihood.max(axis=0))
    weight /= weight.sum(axis=0)
    states = {}
    for i, member in enumerate(members):  # once more: all states of all would not fit
        (kept,) = np.nonzero((weight[i] > _WORTH) & (samples.use == 1))
        if len(kept):
            found = _run(samples, member, gate)
            states[i] = kept, found.mean[kept], found.covariance[kept]
    return Bank(samples, tuple(members), weight, states)


def _run(samples: Samples, member: Member, gate: float) -> Filtered:
    return filter_depth(
        member.plant, _drifted(samples, member), noise=member.noise, start=member.start, gate=gate
    )


def _drifted(samples: Samples, member: Member) -> Samples:
    """Return the samples with the drift taken off the volume: only the difference moves."""
    since = samples.time - samples.time[0]
    return samples._replace(volume=samples.volume - member.drift * since)


def log_likelihood(samples: Samples, member: Member, *, gate: float = GATE) -> Array:
    """Return the log likelihood [n] of the depths up to each sample, those in contact included."""
    found = _run(samples, member, gate)
    held = found.fate == HELD
    size = np.abs(found.innovation[held]) / np.sqrt(found.variance[held])
    each = found.contribution.copy()
    loss = huber(size, gate) + 0.5 * np.log(2.0 * np.pi * found.variance[held])
    each[held] = -loss / _HELD_ALIKE
    return np.asarray(np.cumsum(each))
