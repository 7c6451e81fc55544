"""T1 from how moves start where no voltage is logged, and the speed they reach.

A move that is commanded at an unknown instant t0 from rest, at full voltage, follows eq. (22):
``x = x0 + r (s - T1 (1 - exp(-s/T1))) + c s^2/2`` with s = t - t0 > 0, r the speed and c how the
load changes it. For a given T1 all but t0 are linear; the best t0 is searched. T1 is common to the
moves of a direction, everything else is each move's own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.identify_actuator.bench import Bench
from swimbladder.identify_actuator.estimate import Estimate, bounded, estimated, untold
from swimbladder.identify_actuator.moves import Move
from swimbladder.identify_actuator.noise import WHITE, autoregression, changes, spikes

__all__ = ["Rate", "StartUp", "rate_of", "start_up"]

Array = NDArray[np.float64]

_LONG = 3  # times the samples that the start takes are looked at, or
_LEAST = 15  # samples
_STEP = 0.05  # of ln T1, for the derivatives of the deviance
_TRIALS = 24  # of T1
_GROSS = 0.01  # of the travel: what no motor's start is off the model, a sample alone
_CHI2 = 3.841  # of one degree of freedom, 95 %
_ONE_SIDED = 2.706


class Rate(NamedTuple):
    """The mean speed of a move at full speed [m/s], its deviation, and how it changes [1/s]."""

    value: float
    std: float
    trend: float  # share of the speed that is gained in a second
    samples: NDArray[np.int64]
    fitted: Array  # m, the position at these
    used: NDArray[np.bool_]


def rate_of(bench: Bench, move: Move, skip: float = 0.0) -> Rate:
    """Return the mean speed between the first and the last sample of a move at full speed.

    skip: time left out at its beginning [s]. A parabola is fitted; what is left over of it is taken
    as an autoregression beside the quantum.
    """
    first = move.first
    while first < move.last - 3 and bench.time[first] < bench.time[move.first] + skip:
        first += 1
    t = bench.time[first : move.last + 1]
    x = move.direction * bench.position[first : move.last + 1]
    middle, half = 0.5 * (t[0] + t[-1]), 0.5 * (t[-1] - t[0])
    s = (t - middle) / half
    columns = np.stack([np.ones_like(s), s, s * s], axis=1)[:, : 3 if len(s) > 6 else 2]
    keep = np.ones(len(s), bool)
    for _ in range(2):
        best = np.linalg.lstsq(columns[keep], x[keep], rcond=None)[0]
        off = x - columns @ best
        keep = ~spikes(off, 4.0 * (bench.quantum + changes(t, x)))
    noise = autoregression([off[keep]])
    white = noise.whiten(np.column_stack([columns[keep], x[keep]]))
    best, *_ = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)
    left = white[:, -1] - white[:, :-1] @ best
    variance = float(left @ left) / max(len(left) - len(best), 1)
    covariance = variance * np.linalg.inv(white[:, :-1].T @ white[:, :-1])
    # the readings of its two ends are off by up to half a quantum each, whatever lies between
    std = math.hypot(math.sqrt(float(covariance[1, 1])), bench.quantum / math.sqrt(6.0) / 2.0)
    speed = float(best[1]) / half
    trend = 2.0 * float(best[2]) / half**2 / speed if len(best) > 2 else 0.0
    samples = np.arange(first, move.last + 1)
    return Rate(speed, std / half, trend, samples, move.direction * (columns @ best), keep)


class _Window(NamedTuple):
    """The start of a move: time since its first sample, and travel."""

    samples: NDArray[np.int64]  # of the bench
    time: Array
    travel: Array
    latest: float  # s, by which it has started
    trend: bool  # whether it is long enough to see the speed change

    def only(self, kept: NDArray[np.bool_]) -> _Window:
        """Return the window with the samples that are `kept`."""
        return self._replace(
            samples=self.samples[kept], time=self.time[kept], travel=self.travel[kept]
        )


@dataclass(frozen=True, kw_only=True)
class StartUp:
    """T1 of the moves of one direction, and for each move what the fit says it did.

    fitted: for each move that shows its start (index into the moves, samples, position [m]).
    """

    T1: Estimate
    fitted: tuple[tuple[int, NDArray[np.int64], Array], ...]
    step: float  # s, between samples


def start_up(benches: Sequence[Bench], moves: Sequence[Move]) -> StartUp:
    """Return T1 [s] of moves in one direction that show their start."""
    shown = [(k, move) for k, move in enumerate(moves) if move.begin is not None]
    windows = [_window(benches[move.log], move) for _, move in shown]
    step = min((benches[move.log].step for _, move in shown), default=math.nan)
    if not windows:
        why = "no move begins from rest within the log"
        return StartUp(T1=untold("s", why), fitted=(), step=step)
    profile = _Profile(windows, step, max(benches[move.log].quantum for _, move in shown))
    T1 = profile.estimate()
    fitted = []
    for (k, move), window in zip(shown, profile.windows, strict=True):
        assert move.begin is not None
        start = benches[move.log].position[move.begin]
        travel = profile.fitted(window, profile.best)
        fitted.append((k, window.samples, start + move.direction * travel))
    return StartUp(T1=T1, fitted=tuple(fitted), step=step)


def _window(bench: Bench, move: Move) -> _Window:
    assert move.begin is not None
    taken = move.first - move.begin
    last = min(move.first + max(_LONG * taken, _LEAST), move.last)
    t = bench.time[move.begin : last + 1]
    x = move.direction * (bench.position[move.begin : last + 1] - bench.position[move.begin])
    return _Window(
        np.arange(move.begin, last + 1),
        t - t[0],
        x,
        float(bench.time[move.first] - bench.time[move.begin]),
        last - move.first >= _LEAST - 3,
    )


class _Profile:
    """The deviance of T1, everything else at its best for each move."""

    def __init__(self, windows: Sequence[_Window], step: float, quantum: float) -> None:
        self.windows, self.step = list(windows), step
        self.noise, self.variance = WHITE, 1.0
        longest = max(float(w.time[-1]) for w in windows)
        self.grid = np.geomspace(0.02 * step, max(longest, step), _TRIALS)
        self.best = self._least()
        self.windows = [
            w.only(~spikes(self._left(w), 4.0 * quantum + _GROSS * float(np.ptp(w.travel))))
            for w in self.windows
        ]
        for _ in range(2):
            left = [self._left(w) for w in self.windows]
            self.noise = autoregression(left)
            lost = sum(5 if w.trend else 4 for w in self.windows)
            total = sum(len(w.time) for w in self.windows)
            power = sum(float((self.noise.whiten(r[:, None]) ** 2).sum()) for r in left)
            self.variance = max(power / max(total - lost, 1), 1e-300)
            self.best = self._least()

    def _left(self, window: _Window) -> Array:
        """Return what the best fit leaves over of a window's travel."""
        return window.travel - self.fitted(window, self.best)

    def _least(self) -> float:
        from scipy.optimize import minimize_scalar

        scores = [self(T) for T in self.grid.tolist()]
        k = int(np.argmin(scores))
        low, high = self.grid[max(k - 1, 0)], self.grid[min(k + 1, len(self.grid) - 1)]
        found = minimize_scalar(
            lambda x: self(math.exp(x)), bounds=(math.log(low), math.log(high)), method="bounded",
            options={"xatol": 1e-5},
        )  # fmt: skip
        return math.exp(float(found.x)) if found.fun < scores[k] else float(self.grid[k])

    def __call__(self, T1: float) -> float:
        return sum(self.each(T1))

    def each(self, T1: float) -> list[float]:
        """Return the deviance of every move."""
        return [self._one(window, T1)[0] / self.variance for window in self.windows]

    def fitted(self, window: _Window, T1: float) -> Array:
        """Return the travel that fits best, for a T1 [s]."""
        _, t0 = self._one(window, T1)
        columns = _columns(window, np.array([t0]), T1)[0]
        white = self.noise.whiten(np.column_stack([columns, window.travel]))
        best = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)[0]
        result: Array = columns @ best
        return result

    def _one(self, window: _Window, T1: float) -> tuple[float, float]:
        """Return the least sum of squares and the instant t0 [s] at which it is reached."""
        low, high = -self.step, window.latest
        for _ in range(3):
            trial = np.linspace(low, high, 17)
            left = self._sums(window, trial, T1)
            k = int(np.argmin(left))
            low, high = trial[max(k - 1, 0)], trial[min(k + 1, 16)]
        k = min(max(k, 1), 15)  # the parabola through the least and its neighbours
        a, b, c = left[k - 1 : k + 2].tolist()
        bend = a - 2.0 * b + c
        off = 0.5 * (a - c) / bend if bend > 0.0 else 0.0
        if abs(off) > 1.0:
            k = int(np.argmin(left))
            return float(left[k]), float(trial[k])
        t0 = float(trial[k]) + off * float(trial[1] - trial[0])
        return b - 0.25 * (a - c) * off, t0

    def _sums(self, window: _Window, t0: Array, T1: float) -> Array:
        """Return the least sum of squares for each t0."""
        columns = _columns(window, t0, T1)
        m, n, c = columns.shape
        stacked = np.concatenate([columns.transpose(1, 0, 2).reshape(n, -1),
                                  window.travel[:, None]], axis=1)  # fmt: skip
        white = self.noise.whiten(stacked)
        y = white[:, -1]
        basis, _ = np.linalg.qr(white[:, :-1].reshape(n, m, c).transpose(1, 0, 2))
        part = basis.transpose(0, 2, 1) @ y
        result: Array = y @ y - (part**2).sum(axis=1)
        return result

    def estimate(self) -> Estimate:
        """Return T1 with its interval, or the bound that is all the samples tell."""
        none = self(self.grid[0])
        least = self(self.best)
        inflation, df = self._inflation()
        if none - least < _CHI2 * inflation:
            bound = self._crossing(none + _ONE_SIDED * inflation)
            why = (
                f"shorter than samples every {self.step:.3g} s can tell; below {bound:.3g} s with "
                "a confidence of 95 %"
            )
            return bounded(0.0, bound, "s", why)
        up, here, down = (self(self.best * math.exp(s)) for s in (_STEP, 0.0, -_STEP))
        curvature = max((up - 2.0 * here + down) / _STEP**2, 1e-12)
        std = math.sqrt(2.0 * inflation / curvature)
        if std > 1.0:
            return untold("s", "the moves are too short to tell how they approach full speed")
        return estimated(self.best, self.best * std, "s", df=df, logarithmic=True)

    def _inflation(self) -> tuple[float, float]:
        """Return by what the variance of T1 exceeds that of the noise, and degrees of freedom.

        Moves that differ by more than noise explains have scores that do: the sandwich.
        """
        from scipy.stats import chi2

        count = len(self.windows)
        if count < 3:
            return 1.0, math.inf
        up, here, down = (
            np.array(self.each(self.best * math.exp(s))) for s in (_STEP, 0.0, -_STEP)
        )
        score = (up - down) / (2.0 * _STEP)
        curvature = float((up - 2.0 * here + down).sum()) / _STEP**2
        if curvature <= 0.0:
            return 1.0, math.inf
        ratio = float(score @ score) * count / (count - 1) / (2.0 * curvature)
        likely = float(chi2.ppf(0.95, count - 1)) / (count - 1)
        return (ratio, count - 1.0) if ratio > likely else (1.0, math.inf)

    def _crossing(self, level: float) -> float:
        """Return the T1 [s] above which the deviance exceeds a level."""
        from scipy.optimize import brentq

        top = next((T for T in self.grid.tolist() if self.best < T and self(T) > level), math.inf)
        if not math.isfinite(top):
            return float(self.grid[-1])
        found = brentq(
            lambda x: self(math.exp(x)) - level, math.log(self.grid[0]), math.log(top), xtol=1e-3
        )
        return math.exp(float(found))


def _columns(window: _Window, t0: Array, T1: float) -> Array:
    """Return the columns x0, r and c for each t0, [m, n, 2 or 3]."""
    s = np.maximum(window.time[None, :] - t0[:, None], 0.0)
    ramp = s + T1 * np.expm1(-s / T1)
    parts = [np.ones_like(s), ramp]
    if window.trend:
        parts.append(0.5 * s * s)
    return np.stack(parts, axis=2)
