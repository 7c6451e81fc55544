"""A pool that shares no code with the package: laminar drag, integrated by its own exponential."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter, ss2tf

K_B = 1000.0 * 9.80665  # N/m3
RATE = 0.444e-3 * 12.0 * 75e-4  # m3/s, about what the paper's actuator does


@dataclass(frozen=True)
class Vehicle:
    K2: float
    T2: float
    psi: float

    def stepper(self, h):
        """Return the matrix that takes (z - z0, w, V, rate, neutral, drift) on by h seconds.

        T2 dw/dt = K2 (psi (z - z0) + neutral - V) - w, the volume and the neutral one linear in
        time.
        """
        A = np.zeros((6, 6))
        A[0, 1] = 1.0
        a = self.K2 / self.T2
        A[1] = [a * self.psi, -1.0 / self.T2, -a, 0.0, a, 0.0]
        A[2, 3] = 1.0
        A[4, 5] = 1.0
        return expm(A * h)


def depths(vehicle, volume, start, h, *, neutral=0.0, speed=0.0, drift=0.0, depth=None):
    """Return depths under a volume that is linear between samples h [s] apart.

    neutral: true neutral volume at the first sample, at the depth `start`, less that of the
    record's zero; drift: its rate [m3/s]. With x the state and u the volume less the neutral one,
    x[k+1] = P x[k] + g u[k] + r (u[k+1] - u[k]); y = x - r u has no u[k+1] in it, and is filtered.
    """
    step = vehicle.stepper(h)
    P, g, r = step[:2, :2], step[:2, 2], step[:2, 3] / h
    u = volume - neutral - drift * h * np.arange(len(volume))
    b, a = ss2tf(P, (P @ r + g - r)[:, None], np.array([[1.0, 0.0]]), np.array([[r[0]]]))
    first = np.array([0.0 if depth is None else depth - start, speed]) - r * u[0]
    size, modes = np.linalg.eig(P)
    powers = size ** np.arange(len(u))[:, None]
    free = (modes[0] * np.linalg.solve(modes, first) * powers).sum(axis=1)
    return start + lfilter(b[0], a, u) + free.real


def run(plan, one, vehicle, rng, *, noise, quantum, neutral, drift=0.0, late=0.0):
    """Return (time, depth as measured, volume) of an experiment of a plan, as its page says it.

    What happens is decided on measured depths, as in a pool. The motor knows one speed, and a move
    begins at any time between two samples. neutral: the error of the neutral volume at the
    release; drift: its rate [m3/s]; late: the stamps of volumes [s].
    """
    h = plan.sample_time
    step = cache(vehicle.stepper)
    first = math.ceil(plan.rest / h - 1e-9)
    corners = [(-1.0, 0.0)]
    x = np.array([0.0, 0.0, 0.0, 0.0, neutral - drift * first * h, drift])
    moves, target, begun, was_here, wait = list(one.moves), 0.0, -1, False, 0.0
    rows, clear = [], {"shallowest": False, "deepest": False}
    for k in range(first + math.ceil(one.longest / h) + 1):
        seen = one.start_depth + x[0] + rng.normal(scale=noise)
        if quantum:
            seen = quantum * round(seen / quantum)
        if begun >= 0 and k > first:
            clear["deepest"] |= seen < plan.deepest - 0.05
            clear["shallowest"] |= seen > plan.shallowest + 0.05
            low = clear["deepest"] and seen > plan.deepest
            if low or (clear["shallowest"] and seen < plan.shallowest):
                break
        if moves:
            move = moves[0]
            if move.depth is None:
                due = k == first
            else:
                beyond = seen < move.depth if move.going == "up" else seen > move.depth
                was_here |= not beyond
                due = beyond and was_here
            if due:
                target, begun, was_here, wait = move.volume, k, False, h * rng.random()
                moves.pop(0)
        rows.append((k * h, seen))
        gap, now = target - x[2], k * h
        going = min(h - wait, abs(gap) / RATE)
        for span, rate in ((wait, 0.0), (going, math.copysign(RATE, gap)), (h - wait - going, 0.0)):
            if span > 0.0:
                x[3] = rate
                x = step(span) @ x
                now += span
                corners.append((now, x[2]))
        wait = 0.0
    time, depth = np.array(rows).T
    return time, depth, np.interp(time - late, *np.array(corners).T)
