"""What a fit to voltage steps turns: parameters, predictions, and the residuals of each block.

The motion under a voltage that is held between samples is exact, eq. (22)::

    T1 dv/dt + v = K (u - b - d sign(v)),   dx/dt = v,   |right-hand side| <= rate

K is K_out while the piston moves outward and K_in while it moves inward. d is the dead zone: dry
friction, written as the voltage that it takes; b the voltage that a steady load takes. A piston
that stands stays where it is while |u - b| <= d. Without d, b, a limit and with K_out = K_in = K1
it is eq. (22). Between two samples each piece of the motion is an exponential, and the instant at
which it comes to rest a logarithm: nothing is stepped through.

A fit begins with the speeds of the steps, and finds its first time constant by trial.

Gains differ from block to block, which widens the estimates. Each block's gain is the common one
and a part of its own, normal with a standard deviation that is the same for all: the spread. Few
blocks hardly determine it, and blocks that are no more than the gains need not at all; the
residuals then look like noise alone, however much they differ. So the spread is not estimated and
then believed: it has a prior, the data's restricted likelihood is laid over it, and the intervals
are those of the mixture. Estimates of several steps or logs are pooled with a spread of their own.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, least_squares
from scipy.sparse import csr_array
from scipy.special import chdtrc, erfc

from swimbladder.errors import LogError, NoAnswerError
from swimbladder.estimation.actuator.bench import IDLE, Bench, Block
from swimbladder.estimation.estimates import Z95, Estimate
from swimbladder.estimation.series import Autoregression, Index
from swimbladder.physics.arrays import Array
from swimbladder.sim.engine.cache import compiled
from swimbladder.units import format_quantity


class Drive(NamedTuple):
    """The actuator as a voltage sees it; a length may be one of the piston or a volume."""

    K_out: float  # m/s/V, speed per volt while it moves outward
    K_in: float  # m/s/V, while it moves inward
    T1: float  # s
    dead_zone: float  # V, half of the band of voltages that move nothing
    load: float  # V, the middle of that band
    rate: float = math.inf  # m/s, no voltage makes it faster


def steady_speed(voltage: float, drive: Drive) -> float:
    """Return the speed [m/s] that a voltage [V] reaches when it lasts."""
    over = voltage - drive.load
    if abs(over) <= drive.dead_zone:
        return 0.0
    gain = drive.K_out if over > 0.0 else drive.K_in
    fast = gain * (abs(over) - drive.dead_zone)
    return math.copysign(min(fast, drive.rate), over)


@partial(compiled, under="identify_actuator")
def respond(
    time: Array, voltage: Array, drive: Drive, first_speed: float = 0.0
) -> tuple[Array, Array]:
    """Return the travel since the first sample [m] and the speed [m/s] at each sample.

    time [s], increasing; voltage [V], each held until the next sample; first_speed [m/s].
    """
    d, rate, T1 = drive.dead_zone, drive.rate, drive.T1
    travel, speed = np.zeros(len(time)), np.zeros(len(time))
    x, v = 0.0, first_speed
    speed[0] = v
    for k in range(len(time) - 1):
        h = time[k + 1] - time[k]
        over = voltage[k] - drive.load
        while h > 0.0:
            if v == 0.0 and abs(over) <= d:
                break
            outward = v > 0.0 or (v == 0.0 and over > 0.0)
            end = drive.K_out * (over - d) if outward else drive.K_in * (over + d)
            end = min(max(end, -rate), rate)
            part = h
            stops = v != 0.0 and end != 0.0 and (end > 0.0) != outward
            if stops:
                part = T1 * math.log(1.0 - v / end)
                stops = part < h
                part = min(part, h)
            gone = -math.expm1(-part / T1)
            x += end * part + (v - end) * T1 * gone
            v = 0.0 if stops else v + (end - v) * gone
            h -= part
        travel[k + 1], speed[k + 1] = x, v
    return travel, speed


_TURNS = 0.1  # of the largest voltage: another one
LOGARITHMIC = ("K1", "T1", "asymmetry", "rate")
FIRST = {"K1": 1e-3, "T1": 0.1, "dead_zone": 0.0, "load_voltage": 0.0, "asymmetry": 1.0}


def drive_of(values: Mapping[str, float]) -> Drive:
    """Return the actuator with the values of K1, T1, dead_zone, load_voltage, asymmetry, rate.

    K1 is the geometric mean of the gains outward and inward, asymmetry their ratio.
    """
    ratio = math.sqrt(values["asymmetry"])
    return Drive(
        K_out=values["K1"] * ratio,
        K_in=values["K1"] / ratio,
        T1=values["T1"],
        dead_zone=max(values["dead_zone"], 0.0),
        load=values["load_voltage"],
        rate=values.get("rate", math.inf),
    )


@dataclass(frozen=True)
class Whitener:
    """Makes residuals white, without the start of each block, and less sure of its gain.

    matrix: of the autoregression, block by block; one: the whitened column of the unknown start,
    of length 1 in each block; gain: that of a gain of the block's own, orthogonal to it, likewise;
    size: its length before, less where a block holds several moves, whose gains average; keep: what
    is left of the residual along it; block: of each sample.
    """

    matrix: csr_array
    one: Array
    gain: Array
    size: Array
    keep: Array
    block: Index

    def __call__(self, residual: Array) -> Array:
        """Return the whitened residuals [n]."""
        white: Array = self.matrix @ residual
        white = white - self.one * self.along(self.one, white)[self.block]
        lost = (1.0 - self.keep) * self.along(self.gain, white)
        return white - self.gain * lost[self.block]

    def along(self, column: Array, white: Array) -> Array:
        """Return the inner product of two columns for each block."""
        return _sums(self.block, column * white, len(self.keep))


def _sums(block: Index, values: Array, count: int) -> Array:
    """Return the sum of values in each of so many blocks."""
    return np.bincount(block, values, minlength=count).astype(float)


class Problem:
    """Benches cut into blocks, and the parameters that are free.

    Parameters are turned as numbers near 1: logarithms for what is positive, voltages in units of
    the largest. block: the block of each sample; strokes: how many moves each block holds; early:
    whether a sample comes too soon after an unknown start; used: whether it is neither that nor an
    outlier.
    """

    def __init__(
        self,
        benches: Sequence[Bench],
        blocks: Sequence[Block],
        free: tuple[str, ...],
        fixed: Mapping[str, float],
        moving: Mapping[tuple[int, int], bool],  # (log, run): whether it begins in motion
    ) -> None:
        self.benches, self.blocks, self.free = benches, blocks, free
        self.fixed, self.moving = dict(fixed), dict(moving)
        self.top = max(float(np.abs(b.volts).max()) for b in benches)
        starts = np.cumsum([0, *(len(b.time) for b in benches)])
        self.at = np.concatenate([starts[b.log] + b.samples for b in blocks])
        self.block = np.repeat(np.arange(len(blocks)), [len(b.samples) for b in blocks])
        self.position = np.concatenate([b.position for b in benches])[self.at]
        self.strokes = np.array([self._strokes(b) for b in blocks])
        self.used = np.ones(len(self.at), bool)
        self.early = np.zeros(len(self.at), bool)
        self.whiten: Whitener | None = None

    def changed(self, free: tuple[str, ...], benches: Sequence[Bench] | None = None) -> Problem:
        """Return the problem with other parameters free, or other voltages.

        Outliers and whitener stay.
        """
        other = Problem(benches or self.benches, self.blocks, free, self.fixed, self.moving)
        other.used, other.early, other.whiten = self.used.copy(), self.early.copy(), self.whiten
        return other

    def values(self, q: Array) -> dict[str, float]:
        """Return all parameters in SI."""
        found = dict(self.fixed)
        for name, number in zip(self.free, q.tolist(), strict=True):
            found[name] = math.exp(number) if name in LOGARITHMIC else number * self.top
        return found

    def turned(self, values: Mapping[str, float]) -> Array:
        """Return the free parameters as they are turned."""
        pairs = [(values[name], name in LOGARITHMIC) for name in self.free]
        return np.array([math.log(x) if log else x / self.top for x, log in pairs])

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and the greatest of what is turned."""
        ends = {"load_voltage": (-1.0, 1.0), "dead_zone": (0.0, 1.0)}
        least, most = np.array([ends.get(n, (-46.0, 46.0)) for n in self.free]).reshape(-1, 2).T
        return least, most

    def _strokes(self, block: Block) -> float:
        """Return how many moves a block holds: stretches of a voltage of one sign and size."""
        u = self.benches[block.log].volts[block.samples]
        turned = np.abs(np.diff(u)) > _TURNS * self.top
        turned |= np.sign(u[1:]) != np.sign(u[:-1])
        number = np.append(0, np.cumsum(turned))
        return float(max(len(np.unique(number[np.abs(u) > IDLE * self.top])), 1))

    def travels(self, q: Array) -> Array:
        """Return the predicted travel of every sample [m], from an unknown start in each run."""
        drive = drive_of(self.values(q))
        found = []
        for log, bench in enumerate(self.benches):
            for run, (first, after) in enumerate(bench.runs):
                u = bench.volts[first:after]
                begun = steady_speed(float(u[0]), drive) if self.moving[(log, run)] else 0.0
                found.append(respond(bench.time[first:after], u, drive, begun)[0])
        return np.asarray(np.concatenate(found)[self.at])

    def residual(self, q: Array) -> Array:
        """Return measured less predicted travel of every sample [m], starts not taken off."""
        return np.asarray(self.position - self.travels(q))

    def centred(self, residual: Array) -> Array:
        """Return residuals less the mean of their block, outliers not counted."""
        count = _sums(self.block, self.used, len(self.blocks))
        total = _sums(self.block, residual * self.used, len(self.blocks))
        return residual - (total / np.maximum(count, 1.0))[self.block]

    def without_own_gains(self, q: Array, residual: Array) -> Array:
        """Return centred residuals less what a gain of each block's own explains of them.

        That is left in as far as the whitener takes it for noise.
        """
        travel = self.centred(self.travels(q))
        count = len(self.blocks)
        size = _sums(self.block, travel**2 * self.used, count)
        along = _sums(self.block, travel * residual * self.used, count)
        kept = np.ones(count) if self.whiten is None else self.whiten.keep
        own = (1.0 - kept**2) * along / np.maximum(size, 1e-300)
        return residual - travel * own[self.block]

    def by_median(self, residual: Array) -> Array:
        """Return residuals less the median of their block."""
        ends = np.flatnonzero(np.diff(self.block)) + 1
        return np.concatenate([r - np.median(r) for r in np.split(residual, ends)])

    def white(self, q: Array) -> Array:
        """Return the whitened residuals of all samples used, which a fit makes small."""
        assert self.whiten is not None
        return self.whiten(self.residual(q)[self.used])

    def whitened_with(self, q: Array, noise: Autoregression, spread: float, sigma: float) -> None:
        """Choose the whitener: `noise`, and gains that differ by `spread` (a share) by block."""
        block, count = self.block[self.used], len(self.blocks)
        travel = self.travels(q)[self.used]
        matrix = noise.matrix(np.bincount(block, minlength=count))
        first = np.full(count, 0.0)
        first[block[::-1]] = travel[::-1]
        one: Array = matrix @ np.ones(len(block))
        one /= np.sqrt(np.maximum(_sums(block, one * one, count), 1e-300))[block]
        gain: Array = matrix @ (travel - first[block])
        gain = gain - one * _sums(block, one * gain, count)[block]
        length = np.sqrt(_sums(block, gain * gain, count))
        gain = gain / np.maximum(length, 1e-300)[block]
        size = length / np.sqrt(self.strokes)
        ratio = spread / sigma if sigma > 0.0 else 0.0
        keep = 1.0 / np.sqrt(1.0 + (ratio * size) ** 2)
        self.whiten = Whitener(matrix, one, gain, size, keep, block)


_SEEN = 4.0  # times noise and quantum that motion exceeds
_TRIALS = 13  # of the time constant


def speeds(bench: Bench) -> Array:
    """Return (voltage [V], speed [m/s], samples) of stretches of steady voltage, [n, 3].

    The speed is the median over the stretch's second half; a voltage that never lasts is taken in
    windows, with its mean.
    """
    alike = IDLE * float(np.abs(bench.volts).max(initial=0.0))
    rows, brief = [], []
    for first, after in bench.runs:
        u, x, t = (a[first:after] for a in (bench.volts, bench.position, bench.time))
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
    top = max(float(np.abs(b.volts).max()) for b in benches)
    if top == 0.0 or not len(rows):
        raise NoAnswerError(
            "The logs have no voltage steps: the actuator is not identifiable. Apply voltages that "
            "last for several samples, of both signs and of two sizes or more, and log them."
        )
    u, v, n = rows.T
    size = float(np.abs(v).max())
    driven = np.abs(u) > IDLE * top
    if not any(map(_moves, benches)) or not driven.any() or size == 0.0:
        what = "The actuator does not move in these logs, by its position"
        raise NoAnswerError(f"{what}: apply larger voltages, for longer.")
    moving = driven & (np.abs(v) > 0.1 * size)
    if moving.any() and np.sum(n[moving] * np.sign(u[moving]) * v[moving]) < 0.0:
        what = "the piston moves against the voltage: positive volts should move it outward"
        remedy = 'Set piston_positive = "in" in the [log] table, or turn the sign of the voltage'
        raise LogError(what, file=benches[0].source, field="piston_m", remedy=remedy)
    return guess_from(rows, top, free)


def guess_from(rows: Array, top: float, free: Sequence[str]) -> dict[str, float]:
    """Return the same from (voltage [V], speed [m/s], samples), the largest voltage being `top`."""
    u, v, n = rows.T
    size = float(np.abs(v).max())
    moving = (np.abs(u) > IDLE * top) & (np.abs(v) > 0.1 * size)
    gain = float(np.median(np.abs(v[moving] / u[moving]))) if moving.any() else size / top

    open_ = [True, "dead_zone" in free, "load_voltage" in free, "asymmetry" in free]

    def full(x: Array) -> Array:
        q = np.zeros(4)
        q[open_] = x
        return q

    def off(x: Array) -> Array:
        """Return the weighted residuals of the speeds; each speed counts as 50 samples at most."""
        q = full(x)
        K, d, b, ratio = math.exp(q[0]), max(q[1], 0.0) * top, q[2] * top, math.exp(q[3])
        over = u - b
        each = np.where(over > 0.0, K * math.sqrt(ratio), K / math.sqrt(ratio))
        calm = np.sign(over) * each * np.maximum(np.abs(over) - d, 0.0) - v
        return np.asarray(calm / (0.02 * size) * np.sqrt(np.minimum(n, 50.0)))

    ends = []
    for share in (0.0, 0.05, 0.2):
        q = np.array([math.log(gain / (1.0 - share)), share, 0.0, 0.0])[open_]
        ends.append(least_squares(off, q, loss="soft_l1", max_nfev=50))
    K, d, b, ratio = full(min(ends, key=lambda end: float(end.cost)).x).tolist()
    zone, load = min(max(d, 0.0), 0.9) * top, min(max(b, -0.9), 0.9) * top
    ratio = math.exp(min(max(ratio, -3.0), 3.0))
    return {"K1": math.exp(K), "dead_zone": zone, "load_voltage": load, "asymmetry": ratio}


def tolerance(benches: Sequence[Bench]) -> float:
    """Return what a residual may be by noise and quantum alone [m], at most over the benches."""
    smallest = max(1e-9 * float(np.ptp(b.position)) for b in benches)
    return max(smallest, *(math.hypot(b.noise, b.quantum / math.sqrt(12.0)) for b in benches))


def robustly(problem: Problem, guess: dict[str, float]) -> Array:
    """Return the free parameters, as they are turned, that bring most samples near.

    The time constant is tried over the range that the log resolves; the fit goes on from the best
    two.
    """
    size = tolerance(problem.benches)
    values = {**FIRST, **guess, **problem.fixed}
    least, most = problem.bounds()

    def off(q: Array) -> Array:
        return problem.by_median(problem.residual(q)) / size

    def cost(q: Array) -> float:
        return float(np.sum(np.sqrt(1.0 + off(q) ** 2) - 1.0))

    def inside(q: Array) -> Array:
        return np.asarray(np.clip(q, least + 1e-6, most - 1e-6))

    begins = [inside(problem.turned(values))]
    if "T1" in problem.free:
        step = min(b.step for b in problem.benches)
        longest = max(_longest(problem.benches, block) for block in problem.blocks)
        trials = np.geomspace(0.1 * step, max(longest, step), _TRIALS)
        begins = [inside(problem.turned({**values, "T1": T})) for T in trials.tolist()]
        begins = sorted(begins, key=cost)[:2]
    search = partial(least_squares, off, loss="soft_l1", bounds=(least, most), max_nfev=30)
    ends = [search(q, xtol=1e-4, ftol=1e-4) for q in begins]
    return np.asarray(min(ends, key=lambda end: float(end.cost)).x, float)


def _longest(benches: Sequence[Bench], block: Block) -> float:
    time = benches[block.log].time[block.samples]
    return 0.3 * float(time[-1] - time[0])


_DIFFER = 2.71  # deviance that differing gains have to gain: 5 % by chance
PRIOR, _PRIOR_DF = 0.015, 3.0  # scale and degrees of freedom of Student's half t
# Six series of ten moves of a measured motor have spreads of 0.2 to 1.7 %
# (docs/how-to/identify-actuator.md); the prior's median is 1.1 %, and one in twenty is above 4.8 %.
FINEST = 1e-2  # of the tolerance of a position: less is no noise that a sensor has
_LEAST, _MOST, _SHARES = 1e-5, 1.0, 41  # shares that are tried


@dataclass(frozen=True)
class Spread:
    """What is known of the spread, a share, after seeing the data.

    shares: those tried; weights: their probabilities; sigmas: of the innovations [m]; information:
    on what is turned, in units of the innovations, [trials, p, p]. significant: whether the data
    show one; likely: their estimate of it.
    """

    shares: Array
    weights: Array
    sigmas: Array
    information: Array
    significant: bool
    likely: float

    @property
    def typical(self) -> float:
        """Root mean square of the spread: at it the variances are those of the mixture."""
        return math.sqrt(float(self.weights @ self.shares**2))

    def variances(self, basis: Array, direction: Array) -> Array:
        """Return for each share the variance along a direction.

        Only what lies in the columns of `basis` [p, known] is known.
        """
        w = basis.T @ direction
        inner = basis.T @ self.information @ basis
        along = [float(w @ np.linalg.solve(H, w)) for H in inner]
        return np.asarray(self.sigmas**2 * np.array(along))


def half_width(weights: Array, variances: Array) -> float:
    """Return half the width of the 95 % interval of a mixture of normals about one mean."""
    std = np.sqrt(np.maximum(variances, 1e-300))

    def beyond(x: float) -> float:
        return float(weights @ erfc(x / (math.sqrt(2.0) * std))) - 0.05

    most = 1.96 * float(std.max())
    return float(brentq(beyond, 0.0, 1.01 * most, xtol=1e-9 * most))


def _trials(df: float) -> tuple[Array, Array]:
    """Return shares that gains may differ by, and the prior's log density of their logarithms."""
    shares = np.geomspace(_LEAST, _MOST, _SHARES)
    return shares, np.log(shares) - 0.5 * (df + 1.0) * np.log1p((shares / PRIOR) ** 2 / df)


def _weights(score: Array) -> Array:
    """Return probabilities from their logarithms, which lack a constant."""
    weights = np.exp(score - score.max())
    return np.asarray(weights / weights.sum())


def slope(problem: Problem, q: Array) -> Array:
    """Return the derivative of the whitened residuals [n, p], by central differences."""
    steps = 1e-5 * np.eye(len(q))
    return np.stack([(problem.white(q + h) - problem.white(q - h)) / 2e-5 for h in steps], axis=1)


def gains(problem: Problem, q: Array) -> Spread:
    """Return the estimate of the spread, of the problem made linear at q.

    The problem's whitener is that of equal gains. The variance along each block's own gain is
    1 + (spread size/sigma)^2 times that of the noise; a block of several moves counts as so many.
    """
    J, r, whiten = slope(problem, q), problem.white(q), problem.whiten
    assert whiten is not None
    a = whiten.along(whiten.gain, r)
    A = np.stack([whiten.along(whiten.gain, column) for column in J.T], axis=1)
    p = len(q)
    if not J.size or not np.abs(J).max() > 0.0:
        raise NoAnswerError(
            "the position does not follow the voltage at all: check which columns are which "
            "(`columns=`), and whether the motor ran"
        )
    moved = int((whiten.size > 0.0).sum())
    JJ, Jr, rr = J.T @ J, J.T @ r, float(r @ r)
    lost = max(len(r) - p - len(whiten.size), 1)

    # A log without noise, as of a simulation, says nothing of the spread by its last digits.
    finest = lost * (FINEST * tolerance(problem.benches)) ** 2

    def parts(less: Array) -> tuple[float, Array]:
        """Return (residual sum of squares, information [p, p]) of the parameters.

        less [blocks]: how far each block's own gain is free, from 0 (fixed) to 1 (any).
        """
        ridge = np.maximum(1e-10 * np.trace(JJ) / p, 1e-12 * np.diag(JJ))
        H = JJ - (A.T * less) @ A + ridge * np.eye(p)
        b = Jr - A.T @ (less * a)
        left = rr - float(less @ a**2) - float(b @ np.linalg.solve(H, b))
        return max(left, 0.0) + finest, H

    free, _ = parts(np.ones(len(a)))  # any gain for each block
    sigma = math.sqrt(free / max(lost - moved + _gains_of(problem), 1))
    shares, prior = _trials(_PRIOR_DF)
    scores, sigmas, information = [], [], []
    for share in shares.tolist():
        more = (share / sigma * whiten.size) ** 2
        left, H = parts(more / (1.0 + more))
        spread_out = float(np.log1p(more).sum())
        scores.append(lost * math.log(left) + spread_out + float(np.linalg.slogdet(H)[1]))
        sigmas.append(math.sqrt(left / lost))
        information.append(H)
    score = np.array(scores)
    best = int(np.argmin(score))
    weights = _weights(prior - 0.5 * score)
    significant = bool(moved > _gains_of(problem) and score[best] < score[0] - _DIFFER)
    found, likely = (np.array(sigmas), np.stack(information)), float(shares[best])
    return Spread(shares, weights, *found, significant, likely)


def _gains_of(problem: Problem) -> int:
    """Return how many of the parameters the gains of blocks have to determine."""
    return sum(n in ("K1", "asymmetry", "dead_zone", "load_voltage") for n in problem.free)


_SHOWN = {"m/s/V": "mm/s/V", "m/s": "mm/s", "m3/s/V": "cm3/s/V", "m3/s": "cm3/s"}


def shown_unit(unit: str) -> str:
    """Return the unit in which people read a number that is in `unit`: m/s -> mm/s, else itself."""
    return _SHOWN.get(unit, unit)


def shown(value: float, unit: str, digits: int = 4) -> str:
    """Return a value in SI as people read it: (0.005245, "m/s") -> "5.245 mm/s"."""
    if unit == "-":
        return f"{value:.{digits}g}"
    return format_quantity(value, unit, shown_unit(unit), digits)


class Pooled(NamedTuple):
    """A mean of several estimates that differ by chance, and perhaps by more than chance."""

    mean: float
    std: float  # of the mean: the 95 % interval is that of a normal distribution
    between: float  # standard deviation between the true values of the several
    p: float  # probability of such differences by chance alone

    def estimate(self, unit: str, least: float = -math.inf) -> Estimate:
        """Return it as an estimate; `least` is what it is for sure."""
        found = Estimate.of(self.mean, self.std, unit)
        return replace(found, ci95=(max(found.ci95[0], least), found.ci95[1]))


# Before several estimates are seen: probability of one true value; degrees of freedom of the
_AGREE, _TAIL = 0.5, 0.7  # spread's half t else: a tail so heavy that it rules out no difference


def pool(values: ArrayLike, stds: ArrayLike, wide: float = 1.0) -> Pooled:
    """Return the random-effects mean of independent estimates with standard deviations.

    Two or three hardly determine the spread between them, so it has a prior: none with even odds,
    else a half t density, its scale PRIOR times the largest value, times `wide`. Over it is laid
    the restricted likelihood (Roever, J. Stat. Softw. 93, 2020, 6), as in `gains`.
    """
    x, std = np.asarray(values, float), np.asarray(stds, float)
    if len(x) == 1:
        return Pooled(float(x[0]), float(std[0]), 0.0, 1.0)
    largest = max(float(np.abs(x).max()), 1e-135)
    shares, prior = _trials(_TAIL)
    odds = np.append(_AGREE, (1.0 - _AGREE) * _weights(prior))
    spreads = wide * largest * np.append(0.0, shares)
    w = 1.0 / (np.maximum(std, 1e-15 * largest) ** 2 + spreads[:, None] ** 2)
    total = w.sum(axis=1)
    means = w @ x / total
    squares = (w * (x - means[:, None]) ** 2).sum(axis=1)
    weights = _weights(np.log(odds) + 0.5 * (np.log(w).sum(axis=1) - np.log(total) - squares))
    mean = float(weights @ means)
    half = half_width(weights, 1.0 / total + (means - mean) ** 2)
    between = float(spreads[np.searchsorted(weights.cumsum(), 0.5)])  # the median
    return Pooled(mean, half / Z95, between, float(chdtrc(len(x) - 1, squares[0])))
