"""The compiled loops: along the samples of a log forward, back, and ahead from each sample."""

from __future__ import annotations

import math

import numpy as np

from swimbladder.estimation.kalman.motion import transition
from swimbladder.sim.engine.cache import allocating, compiled
from swimbladder.sim.engine.modes import DEEPEST, V_0, Z_AIR

# What became of a sample.
UNSEEN, HELD, COUNTED, CLIPPED, REJECTED, RESTARTED = 0, 1, 2, 3, 4, 5
_IN_A_ROW = 4  # samples beyond the gate to one side: not outliers, the state is wrong


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
    p, layers, time, volume, depth, use, start, cov, noise, gate, before, spread, F, mean, P, error,
    variance, likelihood, fate,
):  # fmt: skip
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
                p, layers, x[0], x[1], x[2], volume[k - 1], volume[k], time[k] - time[k - 1],
                walk2, jolt2, F[k], Q,
            )  # fmt: skip
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
                p, layers, x[0], x[1], x[2], volume[k - 1], volume[k], time[k] - time[k - 1],
                walk2, jolt2, F, Q,
            )  # fmt: skip
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
                p, layers, z, w, p[V_0], volume[k - 1], volume[k], time[k] - time[k - 1], 0.0, 0.0,
                F, Q,
            )  # fmt: skip
            if not (z > p[Z_AIR] and z < DEEPEST):
                break
            depth[i, k] = z


@compiled
def smooth_kernel(before, spread, F, mean, P):  # type: ignore[no-untyped-def]
    """Replace mean and P by those given all samples (Rauch, Tung and Striebel)."""
    scale = np.ones(3)
    for k in range(mean.shape[0] - 2, -1, -1):
        for i in range(3):
            scale[i] = math.sqrt(max(spread[k + 1, i, i], 1e-300))
        A = np.empty((3, 3))
        for i in range(3):
            for j in range(3):
                A[i, j] = spread[k + 1, i, j] / (scale[i] * scale[j])
            A[i, i] += 1e-12  # aground no depth is uncertain
        cross = F[k + 1] @ P[k]  # [new, old]
        for i in range(3):
            cross[i] /= scale[i]
        G = np.linalg.solve(A, cross)
        for i in range(3):
            G[i] /= scale[i]
        gain = np.ascontiguousarray(G.T)
        mean[k] += gain @ (mean[k + 1] - before[k + 1])
        P[k] += gain @ (P[k + 1] - spread[k + 1]) @ np.ascontiguousarray(gain.T)
