"""The compiled loops: along the samples of a log forward, back, and ahead from each sample.

One step carries depth, speed and neutral volume, their slopes and their noise under a volume that
is known. The state is (z, w, V0) with ``dz/dt = w``, ``dw/dt = a_b (psi z + V0 - V(t)) - F_d(w)/m``
plus the hull's stiffness where it emerges (eqs 13, 15, 16, 31), and ``dV0 = q dB``: the neutral
volume at depth 0 is a random walk. V(t) is linear over a step. White acceleration may stand for
what the model leaves out. Where the water is layered, what its layers add at z, known from a cast,
goes beside psi z: mean and slopes take it as it is, not as a line.

Under laminar drag, without layers, clear of surface and bottom, the step is exact: with G the
velocity's impulse response, G'' = a_b psi G - d_l G', everything is made of G', G and its first two
integrals. Else Runge-Kutta's fourth-order scheme carries the motion with its variational equations.
"""

import math

import numpy as np

from swimbladder.sim.engine.cache import allocating, compiled
from swimbladder.sim.engine.layers import layered
from swimbladder.sim.engine.modes import (
    A_B,
    A_S,
    D_B,
    D_L,
    D_T,
    DEEPEST,
    EPSILON,
    PSI,
    V_0,
    Z_AIR,
    Z_BOTTOM,
    Z_SURFACE,
    drag,
)

# Damping of the emerging hull over critical damping [-]: waves carry its energy away, which the
# plant leaves out; without it a filter would believe in minutes of bobbing.
BOBBING_DAMPING = 0.5

_REACH = 1.0  # step times rate up to which the series of G is summed at once
_FINE = 0.05  # step times rate of the drag, for Runge-Kutta
_FINE_BOBBING = 0.15  # step times frequency of the emerging hull
_MOST = 20_000.0  # steps of Runge-Kutta between two samples
# Gauss-Legendre points and weights on (0, 1), exact for polynomials of degree 9.
_x, _c = np.polynomial.legendre.leggauss(5)
_POINTS, _WEIGHTS = tuple((0.5 * (_x + 1.0)).tolist()), tuple((0.5 * _c).tolist())


@allocating
def _response(d, kappa, h):  # type: ignore[no-untyped-def]
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
def _add_noise(a, d, kappa, tau, weight, walk2, jolt2, Q):  # type: ignore[no-untyped-def]
    """Add to Q what the noise of an instant does tau [s] later."""
    slope, g, i1, _ = _response(d, kappa, tau)
    vz, vw = a * i1, a * g
    q, s = weight * walk2, weight * jolt2
    Q[0, 0] += q * vz * vz + s * g * g
    Q[0, 1] += q * vz * vw + s * g * slope
    Q[1, 1] += q * vw * vw + s * slope * slope
    Q[0, 2] += q * vz
    Q[1, 2] += q * vw
    Q[2, 2] += q


@allocating
def _propagate(P, F, Q):  # type: ignore[no-untyped-def]
    """Replace P [3, 3] by F P F' + Q, symmetric; Q holds its upper triangle."""
    T = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            T[i, j] = F[i, 0] * P[0, j] + F[i, 1] * P[1, j] + F[i, 2] * P[2, j]
    for i in range(3):
        for j in range(i, 3):
            value = T[i, 0] * F[j, 0] + T[i, 1] * F[j, 1] + T[i, 2] * F[j, 2] + Q[i, j]
            P[i, j] = value
            P[j, i] = value


@allocating
def _spread(F, Q, f, q):  # type: ignore[no-untyped-def]
    """Advance: F becomes f F, Q becomes f Q f' + q, of which the upper triangle is read."""
    for j in range(3):
        a, b, c = F[0, j], F[1, j], F[2, j]
        for i in range(3):
            F[i, j] = f[i, 0] * a + f[i, 1] * b + f[i, 2] * c
    _propagate(Q, f, q)


@allocating
def _laminar(p, z, w, V0, Va, Vb, h, walk2, jolt2, F, Q):  # type: ignore[no-untyped-def]
    """Advance over h [s] under laminar drag, clear of surface and bottom, exactly."""
    a, d = p[A_B], p[D_L]
    kappa = a * p[PSI]
    n = max(math.ceil(h * (d + math.sqrt(abs(kappa))) / _REACH), 1)
    s = h / n
    slope, g, i1, i2 = _response(d, kappa, s)
    f = np.zeros((3, 3))
    q = np.zeros((3, 3))
    f[0, 0], f[0, 1], f[0, 2] = 1.0 + kappa * i1, g, a * i1
    f[1, 0], f[1, 1], f[1, 2] = kappa * g, slope, a * g
    f[2, 2] = 1.0
    if walk2 > 0.0 or jolt2 > 0.0:
        for i in range(5):
            _add_noise(a, d, kappa, _POINTS[i] * s, _WEIGHTS[i] * s, walk2, jolt2, q)
    rate = (Vb - Va) / h
    F[:, :], Q[:, :] = f, q
    Q[1, 0], Q[2, 0], Q[2, 1] = q[0, 1], q[0, 2], q[1, 2]
    for i in range(n):
        if i:
            _spread(F, Q, f, q)
        V = Va + rate * (i * s)
        # with the neutral volume taken off first: the difference is small, both are not
        force = a * (V0 - V)
        z, w = (
            f[0, 0] * z + g * w + force * i1 - a * rate * i2,
            kappa * g * z + slope * w + force * g - a * rate * i1,
        )
    return z, w


@allocating
def _slopes(p, layers, x, V, walk2, jolt2, tau, out):  # type: ignore[no-untyped-def]
    """Right-hand side of x: z, w, then F's columns (z and w rows of each), then Q's five parts.

    V: volume less neutral volume [m3]; tau: time since the step began [s].
    """
    z, w = x[0], x[1]
    taken, bends, _ = drag(p, w)
    added, steeper = layered(layers, z)
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
    out[10] = 2.0 * (pull * zw - damping * ww + a * wV) + jolt2
    out[11] = wV
    out[12] = pull * zV - damping * wV + a * walk2 * tau


@allocating
def _cross(p, x, up):  # type: ignore[no-untyped-def]
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
def _substep(p, layers, x, V, rate, s, t, walk2, jolt2, k, y):  # type: ignore[no-untyped-def]
    """Advance x by one step of s [s]; V: volume less neutral volume at its beginning [m3]."""
    _slopes(p, layers, x, V, walk2, jolt2, t, k[0])
    y[:] = x + 0.5 * s * k[0]
    _slopes(p, layers, y, V + 0.5 * rate * s, walk2, jolt2, t + 0.5 * s, k[1])
    y[:] = x + 0.5 * s * k[1]
    _slopes(p, layers, y, V + 0.5 * rate * s, walk2, jolt2, t + 0.5 * s, k[2])
    y[:] = x + s * k[2]
    _slopes(p, layers, y, V + rate * s, walk2, jolt2, t + s, k[3])
    y[:] = x + s / 6.0 * (k[0] + 2.0 * (k[1] + k[2]) + k[3])


@allocating
def _runge_kutta(p, layers, z, w, V0, Va, Vb, h, n, walk2, jolt2, F, Q):  # type: ignore[no-untyped-def]
    """Advance over h [s] in n steps; the bottom stops the vehicle. Return (z, w, aground)."""
    x = np.zeros(13)
    y = np.empty(13)
    k = np.empty((4, 13))
    x[0], x[1], x[2], x[5] = z, w, 1.0, 1.0
    s = h / n
    rate = (Vb - Va) / h
    surface = p[Z_SURFACE]
    aground = False
    for i in range(n):
        t = i * s
        V = Va - V0 + rate * t
        push = p[A_B] * (p[PSI] * x[0] + layered(layers, x[0])[0] - V)
        aground = x[0] >= p[Z_BOTTOM] and x[1] >= 0.0 and push >= 0.0
        if aground:
            x[0], x[1] = p[Z_BOTTOM], 0.0
            x[2:] = 0.0
            continue
        _substep(p, layers, x, V, rate, s, t, walk2, jolt2, k, y)
        up = y[0] < surface
        if up != (x[0] < surface):  # to the surface, through it, and on
            share = (surface - x[0]) / (y[0] - x[0])
            if share > 0.0:
                _substep(p, layers, x, V, rate, share * s, t, walk2, jolt2, k, y)
                x[:] = y
            _cross(p, x, up)
            left = (1.0 - share) * s
            late = t + share * s
            _substep(p, layers, x, V + rate * share * s, rate, left, late, walk2, jolt2, k, y)
        x[:] = y
        if x[0] > p[Z_BOTTOM]:
            x[0], x[1] = p[Z_BOTTOM], min(x[1], 0.0)
            x[2:] = 0.0
            aground = True
    F[0, 0], F[1, 0], F[2, 0] = x[2], x[3], 0.0
    F[0, 1], F[1, 1], F[2, 1] = x[4], x[5], 0.0
    F[0, 2], F[1, 2], F[2, 2] = x[6], x[7], 1.0
    Q[0, 0], Q[0, 1], Q[1, 1] = x[8], x[9], x[10]
    Q[0, 2], Q[1, 2], Q[2, 2] = x[11], x[12], walk2 * h
    return x[0], x[1], aground


@allocating
def transition(p, layers, z, w, V0, Va, Vb, h, walk2, jolt2, F, Q):  # type: ignore[no-untyped-def]
    """Advance over h [s] while the volume goes from Va to Vb; return (z, w, whether aground).

    layers: what the water adds to the neutral volume. Fills F [3, 3], the slope of the new state
    by the old one, and Q [3, 3], upper triangle, the covariance that the noise of intensities walk2
    [m6/s] and jolt2 [m2/s3] adds.
    """
    taken = drag(p, w)[0]
    steady = p[A_B] * (p[PSI] * z + layered(layers, z)[0] + V0)
    pulls = (steady - p[A_B] * Va - taken, steady - p[A_B] * Vb - taken)
    up = max(-w, 0.0) * h + 0.5 * max(-min(pulls[0], pulls[1]), 0.0) * h * h
    down = max(w, 0.0) * h + 0.5 * max(pulls[0], pulls[1], 0.0) * h * h
    rises = z - up <= p[Z_SURFACE]
    plain = p[EPSILON] == math.inf and layers.table.shape[0] == 0
    if plain and not rises and z + down < p[Z_BOTTOM]:
        z, w = _laminar(p, z, w, V0, Va, Vb, h, walk2, jolt2, F, Q)
        return z, w, False
    # as fast as it may become within the step, where drag does not hold it back
    fastest = abs(w) + max(abs(pulls[0]), abs(pulls[1])) * h
    if p[D_T] > 0.0:
        net = max(abs(steady - p[A_B] * Va), abs(steady - p[A_B] * Vb))
        fastest = min(fastest, max(abs(w), math.sqrt(net / p[D_T])))
    rate = max(p[D_L], p[D_B] + 2.0 * p[D_T] * fastest)
    rate += math.sqrt(p[A_B] * (abs(p[PSI]) + layers.steepest))
    steps = h * rate / _FINE
    if rises:
        steps = max(steps, h * math.sqrt(p[A_S]) / _FINE_BOBBING)
    n = int(min(math.ceil(steps), _MOST)) + 1
    return _runge_kutta(p, layers, z, w, V0, Va, Vb, h, n, walk2, jolt2, F, Q)


# What became of a sample.
UNSEEN, HELD, COUNTED, CLIPPED, REJECTED, RESTARTED = 0, 1, 2, 3, 4, 5
_IN_A_ROW = 4  # samples beyond the gate to one side: not outliers, the state is wrong


@allocating
def _loss(size, gate):  # type: ignore[no-untyped-def]
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
def _update(x, P, error, R, S):  # type: ignore[no-untyped-def]
    """Take in a measured depth: x += K error with K = P H'/S, and P in Joseph's form."""
    k0, k1, k2 = P[0, 0] / S, P[0, 1] / S, P[0, 2] / S
    x[0] += k0 * error
    x[1] += k1 * error
    x[2] += k2 * error
    F = np.zeros((3, 3))
    F[0, 0], F[1, 0], F[2, 0] = 1.0 - k0, -k1, -k2
    F[1, 1], F[2, 2] = 1.0, 1.0
    Q = np.empty((3, 3))
    Q[0, 0], Q[0, 1], Q[0, 2] = k0 * R * k0, k0 * R * k1, k0 * R * k2
    Q[1, 1], Q[1, 2], Q[2, 2] = k1 * R * k1, k1 * R * k2, k2 * R * k2
    _propagate(P, F, Q)


@allocating
def _soften(P, floor2):  # type: ignore[no-untyped-def]
    """On the bottom depth and speed are known, but for what a floor of variance says."""
    P[0, 0] += floor2[0]
    P[1, 1] += floor2[1]


@compiled
def filter_kernel(  # type: ignore[no-untyped-def]
    p,
    layers,
    time,
    volume,
    depth,
    use,
    start,
    cov,
    noise,
    gate,
    before,
    spread,
    F,
    mean,
    P,
    error,
    variance,
    likelihood,
    fate,
):
    """Filter n measured depths [m]; return the log likelihood of those that count.

    use [n]: 1 counts, 0 is held with the contact's noise, -1 is not looked at. start [3], cov
    [3, 3]: state and covariance at the first instant, before its sample. noise: variance of the
    depth [m2], of the depth in contact [m2], random walk^2 [m6/s], acceleration^2 [m2/s3], variance
    of the speed in contact [m2/s2]. Fills the states before (`before` [n, 3], `spread` [n, 3, 3])
    and after (`mean`, `P`) each sample, F [n, 3, 3] into sample k, and for each sample error [m],
    variance [m2], log likelihood and fate.
    """
    R, R_held, walk2, jolt2 = noise[0], noise[1], noise[2], noise[3]
    floor2 = (R_held, noise[4])
    x = start.copy()
    C = cov.copy()
    Q = np.empty((3, 3))
    total, row, side = 0.0, 0, 0.0
    for k in range(time.shape[0]):
        if k:
            x[0], x[1], aground = transition(
                p,
                layers,
                x[0],
                x[1],
                x[2],
                volume[k - 1],
                volume[k],
                time[k] - time[k - 1],
                walk2,
                jolt2,
                F[k],
                Q,
            )
            _propagate(C, F[k], Q)
            if aground:
                _soften(C, floor2)
        before[k] = x
        spread[k] = C
        fate[k], error[k], variance[k], likelihood[k] = UNSEEN, np.nan, np.nan, 0.0
        if use[k] >= 0 and math.isfinite(depth[k]):
            e = depth[k] - x[0]
            error[k] = e
            if use[k] == 0:
                S = C[0, 0] + R_held
                variance[k], fate[k] = S, HELD
                size = abs(e) / math.sqrt(S)
                if size > gate:
                    S *= size / gate
                _update(x, C, e, S - C[0, 0], S)
                row = 0
            else:
                S = C[0, 0] + R
                size = abs(e) / math.sqrt(S)
                variance[k] = S
                loss, pull = _loss(size, gate)
                likelihood[k] = -loss - 0.5 * math.log(2.0 * math.pi * S)
                total += likelihood[k]
                if size > gate:
                    fate[k] = CLIPPED if size < 2.0 * gate else REJECTED
                    row, side = (row + 1 if row and (e > 0.0) == (side > 0.0) else 1), e
                else:
                    fate[k], row = COUNTED, 0
                if row == _IN_A_ROW:
                    fate[k], row = RESTARTED, 0
                    x[0], x[1] = depth[k], 0.0
                    C[:, :] = 0.0
                    C[0, 0], C[1, 1] = R, cov[1, 1]
                    C[2, 2] = max(cov[2, 2], spread[k, 2, 2])
                else:
                    S /= pull
                    _update(x, C, e, S - C[0, 0], S)
        mean[k] = x
        P[k] = C
    return total


@compiled
def predict_kernel(  # type: ignore[no-untyped-def]
    p, layers, time, volume, mean, P, first, last, noise, depth, variance
):
    """Predict the depth at sample last[i] from the state mean[i], P[i] after sample first[i].

    The volume on the way is known. variance [m2] is of the true depth, without the measurement's.
    """
    walk2, jolt2 = noise[2], noise[3]
    floor2 = (noise[1], noise[4])
    F, Q = np.empty((3, 3)), np.empty((3, 3))
    for i in range(first.shape[0]):
        x = mean[i].copy()
        C = P[i].copy()
        for k in range(first[i] + 1, last[i] + 1):
            x[0], x[1], aground = transition(
                p,
                layers,
                x[0],
                x[1],
                x[2],
                volume[k - 1],
                volume[k],
                time[k] - time[k - 1],
                walk2,
                jolt2,
                F,
                Q,
            )
            _propagate(C, F, Q)
            if aground:
                _soften(C, floor2)
        depth[i] = x[0]
        variance[i] = C[0, 0]


@compiled
def follow_kernel(plants, layers, time, volume, starts, depth):  # type: ignore[no-untyped-def]
    """Follow a volume [n] with several vehicles; depth [lanes, n] is nan once one left the water.

    plants [lanes, fields]; starts [lanes, 2]: depth [m] and speed [m/s] at the first instant.
    """
    F, Q = np.empty((3, 3)), np.empty((3, 3))
    for i in range(plants.shape[0]):
        p = plants[i]
        z, w = starts[i, 0], starts[i, 1]
        depth[i] = math.nan
        depth[i, 0] = z
        for k in range(1, time.shape[0]):
            z, w, _ = transition(
                p,
                layers,
                z,
                w,
                p[V_0],
                volume[k - 1],
                volume[k],
                time[k] - time[k - 1],
                0.0,
                0.0,
                F,
                Q,
            )
            if not (z > p[Z_AIR] and z < DEEPEST):
                break
            depth[i, k] = z


@compiled
def smooth_kernel(before, spread, F, mean, P):  # type: ignore[no-untyped-def]
    """Replace mean and P by those given all samples (Rauch, Tung and Striebel)."""
    for k in range(mean.shape[0] - 2, -1, -1):
        scale = np.sqrt(np.maximum(np.diag(spread[k + 1]), 1e-300))
        A = spread[k + 1] / np.outer(scale, scale) + 1e-12 * np.eye(3)  # aground no depth errs
        cross = (F[k + 1] @ P[k]) / scale.reshape(3, 1)  # [new, old]
        G = np.linalg.solve(A, cross) / scale.reshape(3, 1)
        gain = np.ascontiguousarray(G.T)
        mean[k] += gain @ (mean[k + 1] - before[k + 1])
        P[k] += gain @ (P[k + 1] - spread[k + 1]) @ np.ascontiguousarray(gain.T)
