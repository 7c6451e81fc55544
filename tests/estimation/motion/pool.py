"""Pool experiments whose truth comes from SciPy alone: eq. (13) with F_def of eq. (31)."""

from bisect import bisect_right

import numpy as np
from scipy.integrate import odeint

from swimbladder.io.logs import Log

G = 9.80665e3  # N/m3, rho g
FEUP = {"m": G * 36.3 / 7935.54, "k_dl": G / 7935.54, "psi": 4.04e-6}
STEPS = tuple(sign * dV * 1e-6 for dV in (20.0, 30.0, 45.0, 75.0) for sign in (1.0, -1.0))


def trace(time, volume, *, z0, w0=0.0, V0=0.0, m, k_dl=0.0, k_dt=0.0, psi=0.0):
    """Return the depths at `time` under volumes that are straight between samples."""
    k_b, times, volumes = G / m, time.tolist(), volume.tolist()

    def rates(x, t):
        z, w = x
        k = min(max(bisect_right(times, t) - 1, 0), len(times) - 2)
        share = (t - times[k]) / (times[k + 1] - times[k])
        V = volumes[k] + share * (volumes[k + 1] - volumes[k])
        return (w, k_b * (psi * z + V0 - V) - (k_dl * w + k_dt * w * abs(w)) / m)

    return odeint(rates, (z0, w0), time, tcrit=time, rtol=1e-12, atol=1e-13)[:, 0]


def pool_log(
    dV,
    *,
    rng=None,
    noise=2e-3,
    quantum=0.0,
    error=0.0,
    step=0.3,
    travel=3.0,
    longest=120.0,
    rest=3.0,
    name=None,
    **truth,
):
    """Return the log of one experiment: rest, a change of volume, a glide of `travel` [m].

    error: of the neutral volume at the start [m3].
    """
    truth = truth or FEUP
    z0 = 3.75 if dV > 0 else 0.75
    time = np.arange(0.0, longest, step)
    volume = np.clip((time - rest) * 40e-6 * np.sign(dV), min(dV, 0.0), max(dV, 0.0))
    z = trace(time, volume, z0=z0, V0=error - truth.get("psi", 0.0) * z0, **truth)
    gone = np.abs(z - z0) > travel
    n = int(np.argmax(gone)) if gone.any() else len(z)
    z = z[:n]
    if rng is not None:
        z = z + noise * rng.normal(size=n)
    if quantum:
        z = quantum * np.round(z / quantum)
    return Log(
        source=name or f"{1e6 * dV:+.0f} cm3",
        time=time[:n],
        depth=z,
        volume=volume[:n],
        line=np.arange(n),
    )


def campaign(seed, *, noise=2e-3, quantum=0.0, errors=0.5e-6, steps=STEPS, **truth):
    """Return eight logs with noise and errors of their neutral volumes."""
    rng = np.random.default_rng(seed)
    return [
        pool_log(dV, rng=rng, noise=noise, quantum=quantum, error=rng.normal(0.0, errors), **truth)
        for dV in steps
    ]
