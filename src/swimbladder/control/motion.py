"""What the gains are made of: the motion over a sample or a pause, and the filter that settles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from swimbladder.control.law import stiffness
from swimbladder.physics.arrays import Array

if TYPE_CHECKING:
    from swimbladder.physics.dynamics import Plant


_LEFT = 0.2  # of an error, after a hold


def motion_over_sample(p: Plant, h: float) -> tuple[Array, Array, Array]:
    """Return F [2, 2], G0 [2] and G1 [2]: (z, w)+ = F (z, w) + G0 q0 + G1 q1.

    q0 and q1: volume less neutral volume at depth 0 at both ends of the sample of h [s], straight
    between them.
    """
    d, a = stiffness(p)
    A = np.zeros((4, 4))
    A[0, 1], A[1, 0], A[1, 1], A[1, 2], A[2, 3] = 1.0, a * p.psi, -d, -a, 1.0
    E = expm(A * h)
    return E[:2, :2], E[:2, 2] - E[:2, 3] / h, E[:2, 3] / h


def held_motion(p: Plant, time: float) -> tuple[Array, Array]:
    """Return F [2, 2] and G [2]: (z, w) after a time [s] = F (z, w) + G V, the volume V held.

    Depth and volume count from where the vehicle is neutral.
    """
    d, a = stiffness(p)
    E = expm(np.array([[0.0, 1.0, 0.0], [a * p.psi, -d, -a], [0.0, 0.0, 0.0]]) * time)
    return E[:2, :2], E[:2, 2]


def hold_gains(p: Plant, time: float, *, left: float = _LEFT) -> tuple[float, float]:
    """Return volumes per depth [m3/m] and per speed [m3 s/m], to be held for a time [s].

    Ackermann's formula: two poles at `left`, the share of an error that the time leaves.
    """
    F, G = held_motion(p, time)
    reach = np.column_stack([G, F @ G])
    rest = F - left * np.eye(2)
    r_z, r_w = -np.linalg.solve(reach.T, [0.0, 1.0]) @ rest @ rest
    return float(r_z), float(r_w)


def pulse_gains(p: Plant, time: float) -> tuple[float, float]:
    """Return the speed [1/s] and the volume off neutral [m3/m], per depth error, that are best.

    Of all speeds and held volumes those that make the least of the integral of the squared error
    over a time [s]: with x = (error, y) and x' C x that integral, y = -C22^-1 C21 error.
    """
    d, a = stiffness(p)
    n = 3
    # In units of one size: a volume as the acceleration that it gives, over the time.
    A = np.array([[0.0, 1.0, 0.0], [a * p.psi * time * time, -d * time, 1.0], [0.0, 0.0, 0.0]])
    M = np.zeros((2 * n, 2 * n))
    M[:n, :n], M[0, n], M[n:, n:] = -A.T, 1.0, A
    E = expm(M)
    C = E[n:, n:].T @ E[:n, n:]  # van Loan, IEEE Trans. Automatic Control 23, 1978, 395
    w, f = -np.linalg.solve(C[1:, 1:], C[1:, 0])
    return float(w) / time, -float(f) / (a * time * time)


def e_folding_time(p: Plant, *, asleep: bool = False) -> float:
    """Return the time [s] in which a held volume lets an error of the depth grow e-fold.

    s (s + d) = a psi; where that takes longer than three times the drag's time, that is given.
    asleep: it is a voltage that is held, and the piston gives way, s (s + d) = a psi + a K1 A c/s.
    """
    d, a = stiffness(p)
    creep = p.gain * p.load_drive if asleep else 0.0
    root = max(r.real for r in np.roots([1.0, d, -a * p.psi, -a * creep]))
    return 1.0 / max(float(root), d / 3.0, 1e-9)


def drift_time(p: Plant, distance: float, intensity: float) -> float:
    """Return the time [s] in which a neutral volume on its random walk moves a vehicle away.

    distance [m]: sqrt(20) times as far as it is then off, 1 sigma, without drag and psi: the
    intensity s of the random walk [m3/s^0.5], integrated twice, has the variance (a s)^2 t^5/20.
    """
    return float((distance / (stiffness(p)[1] * intensity)) ** 0.4)


def filter_gains(
    p: Plant, h: float, *, depth: float, acceleration: float, random_walk: float
) -> Array:
    """Return the settled Kalman gains [3] on depth, speed and neutral volume.

    depth [m]: noise of a sample; acceleration [m/s/s^0.5] and random_walk [m3/s^0.5]: intensities.
    """
    F, G0, G1 = motion_over_sample(p, h)
    A = np.eye(3)
    A[:2, :2], A[:2, 2] = F, -(G0 + G1)
    H = np.array([[1.0, 0.0, 0.0]])
    # In units in which the three are of one size: cubic centimetres, millimetres.
    unit = np.array([1e-3, 1e-3, 1e-6])
    Q = np.diag([0.0, acceleration**2 * h, random_walk**2 * h]) / np.outer(unit, unit)
    A_unit = A * np.outer(1.0 / unit, unit)
    R = np.array([[(depth / unit[0]) ** 2]])
    P = solve_discrete_are(A_unit.T, H.T, Q, R)
    return np.asarray((P @ H.T / (H @ P @ H.T + R))[:, 0] * unit / unit[0])
