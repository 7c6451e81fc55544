"""Where the fit to voltage steps begins: speeds of the steps, then the time constant by trial."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError, NoAnswerError
from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.actuator.blocks import Block
from swimbladder.estimation.actuator.model import FIRST, Problem

Array = NDArray[np.float64]

_IDLE = 0.02  # of the largest voltage: the same
_SEEN = 4.0  # times noise and quantum that motion exceeds
_TRIALS = 13  # of the time constant


def speeds(bench: Bench) -> Array:
    """Return (voltage [V], speed [m/s], samples) of stretches of steady voltage, [n, 3].

    The speed is the median over the stretch's second half; a voltage that never lasts is taken in
    windows, with its mean.
    """
    assert bench.voltage is not None
    alike = _IDLE * float(np.abs(bench.voltage).max(initial=0.0))
    rows, brief = [], []
    for first, after in bench.runs:
        u, x, t = (a[first:after] for a in (bench.voltage, bench.position, bench.time))
        turns = np.flatnonzero(np.abs(np.diff(u)) > alike) + 1
        edges = [0, *turns.tolist(), len(u)]
        for low, high in itertools.pairwise(edges):
            if high - low >= 5:
                rows.append((float(np.median(u[low:high])), _speed(t, x, low, high), high - low))
        for low in range(0, len(u) - 10, 10):
            part = slice(low, low + 10)
            slope = float(np.polyfit(t[part] - t[low], x[part], 1)[0])
            brief.append((float(u[part].mean()), slope, 10))
    return np.array(rows if len(rows) >= 2 else brief, float).reshape(-1, 3)


def _moves(bench: Bench) -> bool:
    """Return whether the position changes by clearly more than noise and quantum."""
    low, high = np.quantile(bench.position, (0.1, 0.9))
    return bool(high - low > _SEEN * (bench.noise + bench.quantum))


def _speed(t: Array, x: Array, low: int, high: int) -> float:
    """Return the median slope [m/s] over the second half of a stretch."""
    half = (low + high) // 2
    gap = max((high - half) // 2, 1)
    first = np.arange(half - gap, high - gap)
    return float(np.median((x[first + gap] - x[first]) / (t[first + gap] - t[first])))


def first_guess(benches: Sequence[Bench], free: Sequence[str]) -> dict[str, float]:
    """Return K1, dead zone, load and asymmetry from the speeds of steady voltages.

    Raises NoAnswerError where nothing moves, LogError where it moves against the voltage.
    """
    rows = np.concatenate([speeds(b) for b in benches])
    top = max(float(np.abs(b.voltage).max()) for b in benches if b.voltage is not None)
    if top == 0.0 or not len(rows):
        raise NoAnswerError(
            "The logs have no voltage steps: the actuator is not identifiable. Apply voltages that "
            "last for several samples, of both signs and of two sizes or more, and log them."
        )
    u, v, n = rows.T
    size = float(np.abs(v).max())
    driven = np.abs(u) > _IDLE * top
    if not any(map(_moves, benches)) or not driven.any() or size == 0.0:
        raise NoAnswerError(
            "The actuator does not move in these logs, by its position: apply larger "
            "voltages, for longer."
        )
    moving = driven & (np.abs(v) > 0.1 * size)
    if moving.any() and np.sum(n[moving] * np.sign(u[moving]) * v[moving]) < 0.0:
        raise LogError(
            "the piston moves against the voltage: positive volts should move it outward",
            file=benches[0].source,
            field="piston_m",
            remedy='Set piston_positive = "in" in the [log] table, or turn the sign of the voltage',
        )
    return guess_from(rows, top, free)


def guess_from(rows: Array, top: float, free: Sequence[str]) -> dict[str, float]:
    """Return the same from (voltage [V], speed [m/s], samples), the largest voltage being `top`."""
    from scipy.optimize import least_squares

    u, v, n = rows.T
    size = float(np.abs(v).max())
    moving = (np.abs(u) > _IDLE * top) & (np.abs(v) > 0.1 * size)
    gain = float(np.median(np.abs(v[moving] / u[moving]))) if moving.any() else size / top

    def off(q: Array) -> Array:
        K, d, b, ratio = math.exp(q[0]), max(q[1], 0.0) * top, q[2] * top, math.exp(q[3])
        over = u - b
        each = np.where(over > 0.0, K * math.sqrt(ratio), K / math.sqrt(ratio))
        calm = np.sign(over) * each * np.maximum(np.abs(over) - d, 0.0) - v
        result: Array = calm / (0.02 * size) * np.sqrt(np.minimum(n, 50.0))
        return result

    open_ = [True, "dead_zone" in free, "load_voltage" in free, "asymmetry" in free]
    best = None
    for share in (0.0, 0.05, 0.2):
        q = np.array([math.log(gain / (1.0 - share)), share if open_[1] else 0.0, 0.0, 0.0])

        def partly(x: Array, q: Array = q) -> Array:
            full = q.copy()
            full[open_] = x
            return off(full)

        found = least_squares(partly, q[open_], loss="soft_l1", max_nfev=50)
        if best is None or found.cost < best[0]:
            full = q.copy()
            full[open_] = found.x
            best = (found.cost, full)
    assert best is not None
    K, d, b, ratio = best[1].tolist()
    return {
        "K1": math.exp(K),
        "dead_zone": min(max(d, 0.0), 0.9) * top,
        "load_voltage": min(max(b, -0.9), 0.9) * top,
        "asymmetry": math.exp(min(max(ratio, -3.0), 3.0)),
    }


def tolerance(benches: Sequence[Bench]) -> float:
    """Return what a residual may be by noise and quantum alone [m], at most over the benches."""
    smallest = max(1e-9 * float(np.ptp(b.position)) for b in benches)
    return max(smallest, *(math.hypot(b.noise, b.quantum / math.sqrt(12.0)) for b in benches))


def robustly(problem: Problem, guess: dict[str, float]) -> Array:
    """Return the free parameters, as they are turned, that bring most samples near.

    The time constant is tried over the range that the log resolves; the fit goes on from the best
    two.
    """
    from scipy.optimize import least_squares

    size = tolerance(problem.benches)
    values = {**FIRST, **guess, **problem.fixed}
    least, most = problem.bounds()

    def off(q: Array) -> Array:
        return problem.by_median(problem.residual(q)) / size

    def cost(q: Array) -> float:
        return float(np.sum(np.sqrt(1.0 + off(q) ** 2) - 1.0))

    def inside(q: Array) -> Array:
        result: Array = np.clip(q, least + 1e-6, most - 1e-6)
        return result

    begins = [inside(problem.turned(values))]
    if "T1" in problem.free:
        step = min(b.step for b in problem.benches)
        longest = max(_longest(problem.benches, block) for block in problem.blocks)
        trials = np.geomspace(0.1 * step, max(longest, step), _TRIALS)
        begins = [inside(problem.turned({**values, "T1": T})) for T in trials.tolist()]
        begins = sorted(begins, key=cost)[:2]
    ends = [
        least_squares(
            off, q, loss="soft_l1", bounds=(least, most), max_nfev=30, xtol=1e-4, ftol=1e-4
        )
        for q in begins
    ]
    return np.asarray(min(ends, key=lambda end: float(end.cost)).x, float)


def _longest(benches: Sequence[Bench], block: Block) -> float:
    time = benches[block.log].time[block.samples]
    return 0.3 * float(time[-1] - time[0])
