"""T1 from how moves start, where no voltage is logged.

A move that is commanded at an unknown instant t0 from rest, at full voltage, follows eq. (22):
``x = x0 + r (s - T1 (1 - exp(-s/T1))) + c s^2/2`` with s = t - t0 > 0, r the speed and c how the
load changes it. For a given T1 all but t0 are linear; the best t0 is searched. T1 is common to the
moves of a direction, everything else is each move's own.

A driver with a soft start raises the speed along a ramp instead: ``x = x0 + r s^2/(2 R)`` up to
s = R, from there on ``r (s - R/2)``. That would pass for a T1; so the ramp is fitted as well, and
where it is by far the likelier of the two that is said.

It needs the speed of a move once it is at full speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.actuator.estimate import student
from swimbladder.estimation.actuator.moves import Move
from swimbladder.estimation.actuator.noise import autoregression, changes, spikes
from swimbladder.estimation.estimates import Estimate, bounded, crossing, estimate, not_identifiable
from swimbladder.estimation.series import WHITE

Array = NDArray[np.float64]


class Rate(NamedTuple):
    """The mean speed of a move at full speed [m/s], its deviation, and how it changes [1/s]."""

    value: float
    std: float
    trend: float  # share of the speed that is gained in a second
    samples: NDArray[np.int64]
    fitted: Array  # m, the position at these
    used: NDArray[np.bool_]


def rate_of(bench: Bench, move: Move, T1: float = 0.0) -> Rate:
    """Return the mean speed between the first and the last sample of a move at full speed.

    A parabola is fitted, and an exponential of time constant T1 [s], with which the speed is still
    on its way; the residual is taken as an autoregression beside the quantum.
    """
    first = move.first
    t = bench.time[first : move.last + 1]
    x = move.direction * bench.position[first : move.last + 1]
    middle, half = 0.5 * (t[0] + t[-1]), 0.5 * (t[-1] - t[0])
    s = (t - middle) / half
    parts = [np.ones_like(s), s]
    if len(s) > 6:
        parts.append(s * s)
    if 0.3 * bench.step < T1 < half:
        parts.append(np.exp(-(t - t[0]) / T1))
    columns = np.stack(parts, axis=1)
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
    # readings that the quantum alone puts off do so independently, at best
    least = bench.quantum / math.sqrt(12.0) / float(np.linalg.norm(s))
    std = max(math.sqrt(float(covariance[1, 1])), least)
    speed = float(best[1]) / half
    trend = 2.0 * float(best[2]) / half**2 / speed if len(s) > 6 else 0.0
    samples = np.arange(first, move.last + 1)
    return Rate(speed, std / half, trend, samples, move.direction * (columns @ best), keep)


_LONG = 3  # times the samples that the start takes are looked at, or
_LEAST = 15  # samples
_NOTHING = 0.02  # of the time between samples: a T1 that is none
_TRIALS = 9  # of T1, and of t0
_SLOWEST = 10.0  # of ln T1 above the best: as good as none
_GROSS = 0.01  # of the travel: what no motor's start is off the model, a sample alone
_TOO_SHORT = "the moves are too short to show how they come to full speed"
_RAMP_SEEN = 10.0  # deviance by which a ramp has to be better: very strong evidence
_CHI2 = 3.841  # of one degree of freedom, 95 %
_ONE_SIDED = 2.706


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

    def columns(self, t0: float, T1: float, *, ramp: bool) -> Array:
        """Return the columns of x0, r and c for a start at t0 [s], [n, 2 or 3].

        T1 is the length of the ramp where it starts along one.
        """
        s = np.maximum(self.time - t0, 0.0)
        if ramp:
            on = np.minimum(s, T1)
            gone = 0.5 * on * on / T1 + (s - on)
        else:
            gone = s + T1 * np.expm1(-s / T1)
        parts = [np.ones_like(s), gone]
        if self.trend:
            parts.append(0.5 * s * s)
        return np.stack(parts, axis=1)


@dataclass(frozen=True, kw_only=True)
class StartUp:
    """T1 of some moves, and for each move what the fit says it did.

    ramp: length of a ramp [s] that is by far likelier than an exponential, None where it is not.
    fitted: for each move that shows its start (index into the moves, samples, position [m]).
    """

    T1: Estimate
    ramp: float | None
    fitted: tuple[tuple[int, NDArray[np.int64], Array], ...]


def start_up(bench: Bench, moves: Sequence[Move]) -> StartUp:
    """Return T1 [s] of the moves that show their start."""
    shown = [(k, move) for k, move in enumerate(moves) if move.begin is not None]
    if not shown:
        why = "no move begins from rest within the log"
        if bench.reference is not None:
            why = "what follows a reference is judged at full speed only"
        return StartUp(T1=not_identifiable("s", why), ramp=None, fitted=())
    fit = _Fit([_window(bench, move) for _, move in shown], bench.step, bench.quantum)
    fitted = []
    for (k, move), window, travel in zip(shown, fit.windows, fit.travels(), strict=True):
        assert move.begin is not None
        start = bench.position[move.begin]
        fitted.append((k, window.samples, start + move.direction * travel))
    T1 = fit.estimate()
    return StartUp(T1=T1, ramp=_ramp(fit) if T1.known else None, fitted=tuple(fitted))


def _ramp(fit: _Fit) -> float | None:
    """Return the length of the ramp [s] along which moves start, None where an exponential does."""
    other = _Fit(fit.windows, fit.step, math.inf, ramp=True)
    length = math.exp(float(other.best[0]))
    likelier = other.deviance < fit.deviance - _RAMP_SEEN
    return length if likelier and length > 2.0 * fit.step else None


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


class _Fit:
    """ln T1, common, and t0 of each window, at their best; what is linear is projected out."""

    def __init__(
        self, windows: list[_Window], step: float, quantum: float, *, ramp: bool = False
    ) -> None:
        self.windows, self.step, self.ramp = windows, step, ramp
        self.noise, self.variance = WHITE, 1.0
        self.best = self._solve(self._first())
        self.windows = [
            w.only(~spikes(r, 4.0 * quantum + _GROSS * float(np.ptp(w.travel))))
            for w, r in zip(windows, self._left(), strict=True)
        ]
        for _ in range(2):
            self.best = self._solve(self.best)
            left = self._left()
            self.noise = autoregression(left)
            lost = sum(5 if w.trend else 4 for w in self.windows)
            total = sum(len(w.time) for w in self.windows)
            power = sum(float((self.noise.whiten(r[:, None]) ** 2).sum()) for r in left)
            self.variance = max(power / max(total - lost, 1), 1e-300)
        self.best = self._solve(self.best)
        self.deviance = self._deviance_of(total - lost)

    def _deviance_of(self, free: int) -> float:
        """Return minus twice the logarithm of the likelihood at the best, but for a constant."""
        power = self.variance * float(np.sum(self._residual(self.best) ** 2))
        first = sum(math.log(v) for v in self.noise.variances[:-1])
        return max(free, 1) * math.log(max(power, 1e-300)) + len(self.windows) * first

    def travels(self) -> list[Array]:
        """Return the travel that fits best, for each window [m]."""
        return [w.travel - r for w, r in zip(self.windows, self._left(), strict=True)]

    def _left(self) -> list[Array]:
        found = []
        T1 = math.exp(self.best[0])
        for window, t0 in zip(self.windows, self.best[1:].tolist(), strict=True):
            columns = window.columns(t0, T1, ramp=self.ramp)
            white = self.noise.whiten(np.column_stack([columns, window.travel]))
            linear = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)[0]
            found.append(window.travel - columns @ linear)
        return found

    def _one(self, window: _Window, log_T1: float, t0: float) -> Array:
        """Return the residual of a window, whitened, in units of its standard deviation."""
        columns = window.columns(t0, math.exp(log_T1), ramp=self.ramp)
        white = self.noise.whiten(np.column_stack([columns, window.travel]))
        basis, _ = np.linalg.qr(white[:, :-1])
        y = white[:, -1] / math.sqrt(self.variance)
        left: Array = y - basis @ (basis.T @ y)
        return left

    def _first(self) -> Array:
        """Return the best of a grid: T1 of all, t0 of each."""
        longest = max(float(w.time[-1]) for w in self.windows)
        best: tuple[float, Array] | None = None
        for log_T1 in np.log(np.geomspace(0.1 * self.step, 0.5 * longest, _TRIALS)).tolist():
            total, t0 = 0.0, []
            for w in self.windows:
                trials = np.linspace(-self.step, w.latest, _TRIALS).tolist()
                sums = [float(np.abs(self._one(w, log_T1, t)).sum()) for t in trials]
                total += min(sums)
                t0.append(trials[int(np.argmin(sums))])
            if best is None or total < best[0]:
                best = (total, np.array([log_T1, *t0]))
        assert best is not None
        return best[1]

    def _solve(self, q: Array, log_T1: float | None = None) -> Array:
        """Return ln T1 and t0 at their best from `q` on; with ln T1 given, t0 alone."""
        from scipy.optimize import least_squares

        fixed = log_T1 is not None
        start = q.copy() if log_T1 is None else np.array([log_T1, *q[1:]])
        least = np.array([math.log(1e-4 * self.step), *(-self.step for _ in self.windows)])
        most = np.array([math.log(1e6 * self.step), *(w.latest for w in self.windows)])
        edge = 1e-9 * self.step
        skip = int(fixed)

        def full(x: Array) -> Array:
            return np.array([start[0], *x]) if fixed else x

        def residual(x: Array) -> Array:
            return self._residual(full(x))

        def slope(x: Array) -> Array:
            return self._slope(full(x))[:, skip:]

        found = least_squares(
            residual, np.clip(start, least + edge, most - edge)[skip:], slope,
            bounds=(least[skip:], most[skip:]),
            x_scale=np.array([1.0, *(self.step for _ in self.windows)])[skip:],
            xtol=1e-6, ftol=1e-7, gtol=1e-12, max_nfev=20,
        )  # fmt: skip
        return full(np.asarray(found.x, float))

    def _residual(self, q: Array) -> Array:
        pairs = zip(self.windows, q[1:].tolist(), strict=True)
        return np.concatenate([self._one(w, float(q[0]), t0) for w, t0 in pairs])

    def _slope(self, q: Array) -> Array:
        """Return the derivative of the residuals [n, 1 + windows], t0's in its own window only."""
        log_T1, rows = float(q[0]), []
        h, k_h = 1e-4, 1e-4 * self.step
        for k, (w, t0) in enumerate(zip(self.windows, q[1:].tolist(), strict=True)):
            part = np.zeros((len(w.time), len(q)))
            here = self._one(w, log_T1, t0)
            part[:, 0] = (self._one(w, log_T1 + h, t0) - here) / h
            part[:, 1 + k] = (self._one(w, log_T1, t0 + k_h) - here) / k_h
            rows.append(part)
        return np.concatenate(rows)

    def _deviance(self, log_T1: float) -> float:
        """Return the deviance at a T1, each t0 at its best."""
        return float(np.sum(self._residual(self._solve(self.best, log_T1)) ** 2))

    def estimate(self) -> Estimate:
        """Return T1 with its interval, or its bound where the samples give no more."""
        least = float(np.sum(self._residual(self.best) ** 2))
        none = self._deviance(math.log(_NOTHING * self.step))
        inflation, df, information = self._information()
        if none - least < _CHI2 * inflation:
            bound = self._crossing(none + _ONE_SIDED * inflation)
            if bound > max(float(w.time[-1]) for w in self.windows):
                return not_identifiable("s", _TOO_SHORT)
            why = (
                f"shorter than samples every {self.step:.3g} s resolve; below {bound:.3g} s with "
                "a confidence of 95 %"
            )
            return bounded(0.0, bound, "s", why)
        std = math.sqrt(inflation / max(information, 1e-12))
        if std > 1.0:
            return not_identifiable("s", _TOO_SHORT)
        T1 = math.exp(self.best[0])
        return estimate(T1, T1 * std, "s", reach=student(df) * T1 * std, logarithmic=True)

    def _information(self) -> tuple[float, float, float]:
        """Return by what the variance of ln T1 exceeds that of the noise, its degrees of freedom,
        and the information on ln T1 but for that.

        Moves that differ by more than noise explains have scores that do: the sandwich.
        """
        from scipy.stats import chi2

        slope, residual = self._slope(self.best), self._residual(self.best)
        scores, parts, start = [], [], 0
        for k, window in enumerate(self.windows):
            rows = slice(start, start + len(window.time))
            start += len(window.time)
            own, mine = slope[rows, 1 + k], slope[rows, 0]
            size = float(own @ own)
            alone = mine - own * (float(own @ mine) / size) if size > 0.0 else mine
            scores.append(float(alone @ residual[rows]))
            parts.append(float(alone @ alone))
        information, count = sum(parts), len(parts)
        if count < 3 or information <= 0.0:
            return 1.0, math.inf, information
        ratio = sum(score**2 for score in scores) * count / (count - 1) / information
        likely = float(chi2.ppf(0.95, count - 1)) / (count - 1)
        return (ratio, count - 1.0, information) if ratio > likely else (1.0, math.inf, information)

    def _crossing(self, level: float) -> float:
        """Return the T1 [s] above the best at which the deviance reaches a level."""
        low = max(float(self.best[0]), math.log(_NOTHING * self.step))
        found = crossing(
            lambda x: self._deviance(low + x) - level, 0.5, farthest=_SLOWEST, xtol=1e-3
        )
        return math.exp(low + (_SLOWEST if found is None else found))
