"""How seldom a motor can start that holds a depth while its neutral volume walks.

``python -m studies.starts [--rms 10] [--noise 2] [--quantum 5]`` prints, for the vehicle of the
paper, the fewest starts an hour that any law can do with, whatever it computes.

Between two moves the volume is constant and the vehicle drifts: z' = w, w' = a psi z - d w + f, f
the acceleration by what the volume is off neutral, a random walk. What a law can know of the three
is what a Kalman filter knows: its error does not depend on what the motor does (separation: Wonham,
SIAM J. Control 6, 1968, 312), and the estimate is driven by the innovations. So the estimate is a
state that is known, a move sets its f to anything at a price, and the least of E z^2 + price times
starts is found by dynamic programming (impulse control: Bensoussan and Lions, Impulse Control and
Quasi-Variational Inequalities, 1984). For any price, starts >= (that least - E z^2)/price. K2,
T2 and psi are known, and a move takes no time: it is short against the half minute between two. The
depth's quantum counts as noise of its variance.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from swimbladder.control.law import stiffness
from swimbladder.design.tuning.region import RANDOM_WALK
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.engine.cache import compiled, part

__all__ = ["Drift", "Grid", "drift_of", "fewest", "least_cost", "stage_cost", "transition"]

Array = NDArray[np.float64]

_MILLI = 1e3  # everything is in mm and s
_PRICES = (12e3, 16e3, 24e3, 36e3)  # mm2 s, for 10 mm rms
_SPARE = 0.3  # of the variance that explicit diffusion can stand


class Drift(NamedTuple):
    """A vehicle between two moves, in mm and s, and what is seen of it."""

    stiffness: float  # 1/s2, a psi
    drag: float  # 1/s
    walk: float  # mm/s2.5, intensity of the walk of f
    noise: float  # mm, of a depth that is seen; 0: all three are known
    sample_time: float  # s


class Grid(NamedTuple):
    """Where the costs are kept: points a side and farthest depth error, speed, acceleration."""

    points: int = 61
    depth: float = 80.0  # mm
    speed: float = 4.5  # mm/s
    acceleration: float = 0.22  # mm/s2
    step: float = 1.5  # s


def drift_of(name: str, *, noise: float, sample_time: float, walk: float = RANDOM_WALK) -> Drift:
    """Return a preset's vehicle; noise [m] of a depth, walk [m3/s^0.5] of its neutral volume."""
    p = plant(load_vehicle(name))
    d, a = stiffness(p)
    return Drift(a * p.psi, d, _MILLI * a * walk, _MILLI * noise, sample_time)


def transition(m: Drift, step: float) -> tuple[Array, Array, float]:
    """Return F [3, 3], the covariance [3, 3] that a step [s] adds to what is known, and the
    variance [mm2] of the depth's estimate.
    """
    A = np.array([[0.0, 1.0, 0.0], [m.stiffness, -m.drag, 1.0], [0.0, 0.0, 0.0]])
    if m.noise == 0.0:
        return (*_over(A, m.walk, step), 0.0)
    F, Q = _over(A, m.walk, m.sample_time)
    P = solve_discrete_are(F.T, np.eye(3)[:, :1], Q, np.array([[m.noise**2]]))
    learnt = P[:, :1] @ P[:1] / (P[0, 0] + m.noise**2)  # what an innovation changes, squared
    moved, total = np.eye(3), np.zeros((3, 3))
    for _ in range(round(step / m.sample_time)):
        total += moved @ learnt @ moved.T
        moved = F @ moved
    return moved, total, float((P - learnt)[0, 0])


def _over(A: Array, walk: float, time: float) -> tuple[Array, Array]:
    """Return the motion over a time [s] and the covariance it adds (van Loan, 1978)."""
    n = len(A)
    M = np.zeros((2 * n, 2 * n))
    M[:n, :n], M[n:, n:], M[n - 1, 2 * n - 1] = -A, A.T, walk**2
    E = expm(M * time)
    F = E[n:, n:].T
    return F, F @ E[:n, n:]


def stage_cost(m: Drift, step: float) -> Array:
    """Return C [3, 3]: the integral of z^2 over a step [s] is x C x, without the walk."""
    A = np.array([[0.0, 1.0, 0.0], [m.stiffness, -m.drag, 1.0], [0.0, 0.0, 0.0]])
    M = np.zeros((6, 6))
    M[:3, :3], M[0, 3], M[3:, 3:] = -A.T, 1.0, A
    E = expm(M * step)
    C: Array = E[3:, 3:].T @ E[:3, 3:]
    return C


def least_cost(
    m: Drift,
    price: float,
    *,
    pulse: float = math.inf,
    grid: Grid | None = None,
    cost: Array | None = None,
    tolerance: float = 2e-5,
    most: int = 2000,
) -> float:
    """Return the least mean of z^2 [mm2] plus the price [mm2 s] of each start a second.

    pulse [mm2 s]: price of a volume pulse, there and back, that sets the speed as well. cost
    [3, 3]: of a step, z^2 where not given. Raises ArithmeticError where it does not settle.
    """
    g = grid or Grid()
    F, S, unknown = transition(m, g.step)
    C = stage_cost(m, g.step) if cost is None else cost
    n = g.points
    ends = np.array([g.depth, g.speed, g.acceleration])
    spacing = 2.0 * ends / (n - 1)
    # Diffusion in as many parts as keep it stable.
    parts = max(math.ceil(float(np.max(np.diag(S) / spacing**2)) / _SPARE), 1)
    V, W, spare = np.zeros((n, n, n)), np.empty((n, n, n)), np.empty((n, n, n))
    middle = (n // 2,) * 3
    before, still = math.inf, 0
    for _ in range(most):
        for _ in range(parts):
            _diffuse(V, spare, S / np.outer(spacing, spacing) / parts)
            V, spare = spare, V
        _advance(V, W, F, C, ends, spacing)
        _move(W, V, price, pulse)
        mean = float(V[middle]) / g.step
        V -= V[middle]
        still = still + 1 if abs(mean - before) < tolerance * abs(mean) else 0
        before = mean
        if still == 20:
            return mean + unknown
    raise ArithmeticError(f"the cost did not settle in {most} steps: {before:g}")


def fewest(
    m: Drift,
    rms: float,
    prices: Sequence[float],
    *,
    pulse: float = math.inf,
    grid: Grid | None = None,
) -> float:
    """Return the fewest starts an hour that hold a depth to an rms [mm].

    prices [mm2 s]: tried; the bound of each holds, the highest is given. pulse: price of a pulse in
    starts.
    """
    costs = [least_cost(m, p, pulse=pulse * p, grid=grid) for p in prices]
    return max(3600.0 * (c - rms**2) / p for c, p in zip(costs, prices, strict=True))


@compiled
def _diffuse(V: Array, U: Array, S: Array) -> None:
    """U = V + half of S times the second differences of V."""
    n = V.shape[0]
    for i in range(n):
        a, b = max(i - 1, 0), min(i + 1, n - 1)
        for j in range(n):
            c, d = max(j - 1, 0), min(j + 1, n - 1)
            for k in range(n):
                e, f = max(k - 1, 0), min(k + 1, n - 1)
                v = V[i, j, k]
                own = S[0, 0] * (V[a, j, k] - 2.0 * v + V[b, j, k])
                own += S[1, 1] * (V[i, c, k] - 2.0 * v + V[i, d, k])
                own += S[2, 2] * (V[i, j, e] - 2.0 * v + V[i, j, f])
                mixed = S[0, 1] * (V[b, d, k] + V[a, c, k] - V[b, c, k] - V[a, d, k])
                mixed += S[0, 2] * (V[b, j, f] + V[a, j, e] - V[b, j, e] - V[a, j, f])
                mixed += S[1, 2] * (V[i, d, f] + V[i, c, e] - V[i, d, e] - V[i, c, f])
                U[i, j, k] = v + 0.5 * own + 0.25 * mixed


@part
def _weights(t: float, c: Array) -> None:
    """Lagrange's cubic through -1, 0, 1, 2."""
    c[0] = -t * (t - 1.0) * (t - 2.0) / 6.0
    c[1] = (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0
    c[2] = -(t + 1.0) * t * (t - 2.0) / 2.0
    c[3] = (t + 1.0) * t * (t - 1.0) / 6.0


@compiled
def _advance(V: Array, W: Array, F: Array, C: Array, ends: Array, spacing: Array) -> None:
    """W = cost of a step and V where it leads; f stays."""
    n = V.shape[0]
    cz, cw = np.empty(4), np.empty(4)
    x = np.empty(3)
    for i in range(n):
        for j in range(n):
            for k in range(n):
                x[0] = i * spacing[0] - ends[0]
                x[1] = j * spacing[1] - ends[1]
                x[2] = k * spacing[2] - ends[2]
                total = 0.0
                for r in range(3):
                    for s in range(3):
                        total += C[r, s] * x[r] * x[s]
                z = (F[0, 0] * x[0] + F[0, 1] * x[1] + F[0, 2] * x[2] + ends[0]) / spacing[0]
                w = (F[1, 0] * x[0] + F[1, 1] * x[1] + F[1, 2] * x[2] + ends[1]) / spacing[1]
                z, w = min(max(z, 0.0), n - 1.0), min(max(w, 0.0), n - 1.0)
                p, q = min(max(int(z), 1), n - 3), min(max(int(w), 1), n - 3)
                _weights(z - p, cz)
                _weights(w - q, cw)
                for r in range(4):
                    line = 0.0
                    for s in range(4):
                        line += cw[s] * V[p - 1 + r, q - 1 + s, k]
                    total += cz[r] * line
                W[i, j, k] = total


@compiled
def _move(W: Array, V: Array, price: float, pulse: float) -> None:
    """V = W, or what the best move leaves and its price, if that is less."""
    n = W.shape[0]
    for i in range(n):
        speed = W[i].min() + pulse
        for j in range(n):
            least = min(W[i, j].min() + price, speed)
            for k in range(n):
                V[i, j, k] = min(W[i, j, k], least)


def _table(rms: float, noise: float, quantum: float) -> str:
    """Return a table of bounds for the vehicle of the paper; all in mm."""
    seen = math.hypot(noise, quantum / math.sqrt(12.0)) / _MILLI
    prices = [price * (rms / 10.0) ** 2.4 for price in _PRICES]
    lines = ["| known | a start is | fewest starts an hour |", "|---|---|---|"]
    for words, n in (
        (f"the depth, {noise:g} mm of noise and a quantum of {quantum:g} mm, every 0.3 s", seen),
        ("the same, read ten times a sample", seen / math.sqrt(10.0)),
        ("depth, speed and neutral volume, exactly", 0.0),
    ):
        m = drift_of("feup-em", noise=n, sample_time=0.3)
        for what, pulse in (
            ("a move in one direction", math.inf),
            ("a move or, for two, one there and back", 2.0),
            ("a move, or one there and back for the price of one", 1.0),
        ):
            lines.append(f"| {words} | {what} | {fewest(m, rms, prices, pulse=pulse):.0f} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.starts", description=__doc__)
    parser.add_argument("--rms", type=float, default=10.0, help="depth error that is allowed [mm]")
    parser.add_argument("--noise", type=float, default=2.0, help="of a depth seen [mm]")
    parser.add_argument("--quantum", type=float, default=5.0, help="of a depth seen [mm]")
    given = parser.parse_args(arguments)
    print(_table(given.rms, given.noise, given.quantum))


if __name__ == "__main__":
    main()
