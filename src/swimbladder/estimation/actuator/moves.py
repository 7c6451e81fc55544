"""Moves at full speed, found in the position itself or from what was asked of it.

Where no voltage is logged they give the rate, and T1 by how they start. A move that is commanded at
an unknown instant t0 from rest, at full voltage, follows eq. (22): ``x = x0 + r (s - T1 (1 -
exp(-s/T1))) + c s^2/2`` with s = t - t0 > 0, r the speed and c how the load changes it. For a given
T1 all but t0 are linear; the best t0 is searched. T1 is common to the moves of a direction,
everything else is each move's own.

A driver with a soft start raises the speed along a ramp instead: ``x = x0 + r s^2/(2 R)`` up to
s = R, from there on ``r (s - R/2)``. That would pass for a T1; so the ramp is fitted as well, and
where it is by far the likelier of the two that is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, stdtrit

from swimbladder.estimation.actuator.bench import Bench, autoregression, spikes
from swimbladder.estimation.actuator.model import Pooled, pool
from swimbladder.estimation.actuator.result import Step
from swimbladder.estimation.estimates import Z95, Estimate, bounded_fit, crossing, sentence
from swimbladder.estimation.series import WHITE, Index, stretches, white_noise
from swimbladder.physics.arrays import Array, Flags

_MOVES = 0.5  # of the full speed: it moves
_FULL = 0.85  # of the full speed of the move: it has started, and does not yet brake
_RESTS = 0.1  # of the full speed: it stands
_FEWEST = 6  # samples at full speed
_FEWEST_ASKED = 4  # where it is known that full speed was asked for
_WIDTHS = (1, 2, 4, 8, 16, 32)  # intervals that a speed is taken over
_BLUR = 0.05  # of the full speed, that noise may make of a speed
_BEFORE = 5  # samples of rest that are kept before it starts


class Move(NamedTuple):
    """A stretch at full speed, with its start where that is in the log.

    samples first..last at full speed; begin: the first sample of the start-up (a few at rest and
    the acceleration), None where the log does not show it. direction: 1 outward, -1 inward.
    """

    direction: int
    begin: int | None
    first: int
    last: int


def moves(bench: Bench) -> list[Move]:
    """Return the moves at full speed of a bench, in order.

    Without a reference: where the speed, over a few samples, is near the largest that the log has
    in that direction. With one: where it is out of reach for the whole of a step of time.
    """
    found: list[Move] = []
    for first, after in bench.runs:
        if after - first >= _FEWEST:
            part = _asked if bench.reference is not None else _seen
            found += part(bench, first, after)
    return found


def _speed(
    bench: Bench, first: int, after: int, widths: tuple[int, ...] = _WIDTHS
) -> tuple[Array, int]:
    """Return the speed of each interval [m/s], and over how many intervals it is taken.

    Over as few as noise and quantum allow, the median of three against outliers.
    """
    x, t = bench.position[first:after], bench.time[first:after]
    for width in widths:
        if after - first < 4 * width:
            break
        raw = (x[width:] - x[:-width]) / (t[width:] - t[:-width])
        # each interval has the speed of the stretch around it
        padded = np.pad(raw, (1 + width // 2, 1 + (width - 1) // 2), mode="edge")
        speed = np.median(np.lib.stride_tricks.sliding_window_view(padded, 3), axis=1)
        full = max(_full(speed), _full(-speed))
        blur = (1.4 * bench.noise + bench.quantum) / (width * bench.step)
        if blur < _BLUR * full:
            break
    return speed, width


def _full(speed: Array) -> float:
    """Return the full speed among speeds of one sign [m/s]: the median of those above its half."""
    fast = np.sort(speed[speed > 0.0])
    if not len(fast):
        return 0.0
    top = float(fast[int(0.95 * (len(fast) - 1))])
    return float(np.median(fast[fast > 0.5 * top]))


def _seen(bench: Bench, first: int, after: int) -> list[Move]:
    speed, width = _speed(bench, first, after)
    least = 4.0 * (bench.noise + bench.quantum)
    found = []
    for direction in (1, -1):
        full = _full(direction * speed)
        for low, high in stretches(direction * speed > _MOVES * full):
            move = _one(direction * speed, low, high, full, width)
            if move is None:
                continue
            begin, start, end = move
            travel = bench.position[end + first] - bench.position[start + first]
            if direction * travel > least:
                begin = None if begin is None else begin + first
                whole = Move(direction, begin, start + first, end + first)
                found.append(_from_rest(bench, whole))
    return sorted(found, key=lambda move: move.first)


def _from_rest(bench: Bench, move: Move) -> Move:
    """Return the move, without its start where that goes to and fro."""
    if move.begin is None:
        return move
    gone = move.direction * bench.position[move.begin : move.first + 1]
    gone = gone - gone[0]
    rests = -_RESTS * gone[-1] <= gone.min() and gone.max() <= (1.0 + _RESTS) * gone[-1]
    return move if rests else move._replace(begin=None)


def _one(
    speed: Array, low: int, high: int, full: float, width: int
) -> tuple[int | None, int, int] | None:
    """Return (begin, first, last) of the move whose intervals low..high are fast.

    width: intervals over which a speed is taken.
    """
    own = float(np.median(speed[low:high]))
    fast = np.flatnonzero(speed[low:high] > _FULL * own)
    if own < _MOVES * full or not len(fast):
        return None
    start = low + int(fast[0])
    slow = speed[start:high] < _FULL * own
    lasting = slow & np.append(slow[1:], True) & np.append(slow[2:], [True, True])
    brake = np.flatnonzero(lasting[: len(slow)])
    brake = brake[brake > (high - start) // 2]
    end = start + int(brake[0]) - 1 if len(brake) else high - 1
    end = max(end - width, start)  # the stretch in which it begins to brake looks fast
    if end - start < _FEWEST:
        return None
    return _begin(speed, low, own, width), start, end


def _begin(speed: Array, low: int, own: float, width: int) -> int | None:
    """Return the first sample of the start of a move whose interval `low` is the first fast one.

    None where it does not come from rest shortly before.
    """
    near = _FEWEST + 2 * width
    rest = np.flatnonzero(np.abs(speed[:low]) < _RESTS * own)
    if len(rest) and low - int(rest[-1]) <= max(near, low // 2):
        last = int(rest[-1]) + 1 - width
        begin = max(last - _BEFORE, 0)
        moved = np.flatnonzero(np.abs(speed[begin : max(last, begin)]) > 2.0 * _RESTS * own)
        return begin + (int(moved[-1]) + 1 if len(moved) else 0)
    return 0 if low <= _FEWEST // 2 + width else None  # it starts with the log


def _asked(bench: Bench, first: int, after: int) -> list[Move]:
    assert bench.reference is not None
    speed, _ = _speed(bench, first, after, (1,))  # its moves may be few samples long
    ahead = bench.reference[first:after] - bench.position[first:after]
    found = []
    for direction in (1, -1):
        full = _full(direction * speed)
        reach = 1.5 * full * bench.step
        if full <= 0.0:
            continue
        goes = direction * np.append(speed, speed[-1]) > _MOVES * full
        far = (direction * ahead > reach) & goes  # it may be at an end stop
        for low, high in stretches(far):
            start, end = low + 1, high - 1  # it may take up an order late
            if end - start + 1 >= _FEWEST_ASKED:
                found.append(Move(direction, None, start + first, end + first))
    return sorted(found, key=lambda move: move.first)


class Rate(NamedTuple):
    """The mean speed of a move at full speed [m/s], its deviation, and how it changes [1/s]."""

    value: float
    std: float
    trend: float  # share of the speed that is gained in a second
    fitted: Array  # m, the position at the samples of the move
    used: Flags


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
        keep = ~spikes(off, 4.0 * (bench.quantum + white_noise(t, x)))
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
    return Rate(speed, std / half, trend, move.direction * (columns @ best), keep)


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

    samples: Index  # of the bench
    time: Array
    travel: Array
    latest: float  # s, by which it has started
    trend: bool  # whether it is long enough to see the speed change

    def only(self, kept: Flags) -> _Window:
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
    fitted: by index into the moves, samples and position [m] of each that shows its start.
    """

    T1: Estimate
    ramp: float | None
    fitted: dict[int, tuple[Index, Array]]


def start_up(bench: Bench, moves: Sequence[Move]) -> StartUp:
    """Return T1 [s] of the moves that show their start."""
    shown = [(k, move) for k, move in enumerate(moves) if move.begin is not None]
    if not shown:
        why = "no move begins from rest within the log"
        if bench.reference is not None:
            why = "what follows a reference is judged at full speed only"
        return StartUp(T1=Estimate.unknown("s", why), ramp=None, fitted={})
    fit = _Fit([_window(bench, move) for _, move in shown], bench.step, bench.quantum)
    fitted = {
        k: (w.samples, bench.position[move.begin] + move.direction * (w.travel - left))
        for (k, move), w, left in zip(shown, fit.windows, fit.left(), strict=True)
    }
    T1 = fit.estimate()
    return StartUp(T1=T1, ramp=_ramp(fit) if T1.known else None, fitted=fitted)


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
    samples = np.arange(move.begin, last + 1)
    time = bench.time[samples] - bench.time[move.begin]
    travel = move.direction * (bench.position[samples] - bench.position[move.begin])
    return _Window(samples, time, travel, float(time[taken]), last - move.first >= _LEAST - 3)


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
            for w, r in zip(windows, self.left(), strict=True)
        ]
        for _ in range(2):
            self.best = self._solve(self.best)
            left = self.left()
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

    def left(self) -> list[Array]:
        """Return measured less fitted travel of each window at the best [m]."""
        found = []
        for window, t0 in zip(self.windows, self.best[1:].tolist(), strict=True):
            columns, white = self._white(window, float(self.best[0]), t0)
            linear = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)[0]
            found.append(window.travel - columns @ linear)
        return found

    def _white(self, window: _Window, log_T1: float, t0: float) -> tuple[Array, Array]:
        """Return the columns of a window, and these and its travel whitened."""
        columns = window.columns(t0, math.exp(log_T1), ramp=self.ramp)
        return columns, self.noise.whiten(np.column_stack([columns, window.travel]))

    def _one(self, window: _Window, log_T1: float, t0: float) -> Array:
        """Return the residual of a window, whitened, in units of its standard deviation."""
        _, white = self._white(window, log_T1, t0)
        basis, _ = np.linalg.qr(white[:, :-1])
        y = white[:, -1] / math.sqrt(self.variance)
        return np.asarray(y - basis @ (basis.T @ y))

    def _first(self) -> Array:
        """Return the best of a grid: T1 of all, t0 of each."""
        longest = max(float(w.time[-1]) for w in self.windows)
        tried: list[tuple[float, list[float]]] = []
        for log_T1 in np.log(np.geomspace(0.1 * self.step, 0.5 * longest, _TRIALS)).tolist():
            total, t0 = 0.0, []
            for w in self.windows:
                trials = np.linspace(-self.step, w.latest, _TRIALS).tolist()
                sums = [float(np.abs(self._one(w, log_T1, t)).sum()) for t in trials]
                total += min(sums)
                t0.append(trials[int(np.argmin(sums))])
            tried.append((total, [log_T1, *t0]))
        return np.array(min(tried, key=lambda one: one[0])[1])

    def _solve(self, q: Array, log_T1: float | None = None) -> Array:
        """Return ln T1 and t0 at their best from `q` on; with ln T1 given, t0 alone."""
        skip, start = 0, q
        if log_T1 is not None:
            skip, start = 1, np.array([log_T1, *q[1:]])
        least = np.array([math.log(1e-4 * self.step), *(-self.step for _ in self.windows)])
        most = np.array([math.log(1e6 * self.step), *(w.latest for w in self.windows)])
        size = np.array([1.0, *(self.step for _ in self.windows)])[skip:]

        def residual(x: Array) -> Array:
            return self._residual(np.append(start[:skip], x))

        def slope(x: Array) -> Array:
            return self._slope(np.append(start[:skip], x))[:, skip:]

        ends, limits = (1e-6, 1e-7, 1e-12), (least[skip:], most[skip:])
        begin, edge = start[skip:], 1e-9 * self.step
        _, found = bounded_fit(
            residual, slope, begin, limits, ends=ends, most=20, edge=edge, scale=size
        )
        return np.append(start[:skip], found)

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
        inflation, information = self._information()
        if none - least < _CHI2 * inflation:
            bound = self._crossing(none + _ONE_SIDED * inflation)
            if bound > max(float(w.time[-1]) for w in self.windows):
                return Estimate.unknown("s", _TOO_SHORT)
            why = f"shorter than samples every {self.step:.3g} s resolve; "
            why += f"below {bound:.3g} s with a confidence of 95 %"
            return Estimate.bounded(0.0, bound, "s", why)
        std = math.sqrt(inflation / max(information, 1e-12))
        T1 = math.exp(self.best[0])
        if std > 1.0 or max(float(w.time[-1]) for w in self.windows) < T1:
            return Estimate.unknown("s", _TOO_SHORT)
        return Estimate.of(T1, T1 * std, "s", logarithmic=True)

    def _information(self) -> tuple[float, float]:
        """Return by what the variance of ln T1 exceeds that of the noise, and the information but
        for that.

        Moves that differ by more than noise explains have scores that do: the sandwich, wider by
        what few moves show of it.
        """
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
            return 1.0, information
        ratio = sum(score**2 for score in scores) * count / (count - 1) / information
        likely = float(chdtri(count - 1, 0.05)) / (count - 1)
        few = (float(stdtrit(count - 1, 0.975)) / Z95) ** 2
        return (few * ratio if ratio > likely else 1.0), information

    def _crossing(self, level: float) -> float:
        """Return the T1 [s] above the best at which the deviance reaches a level."""
        low = max(float(self.best[0]), math.log(_NOTHING * self.step))

        def beyond(x: float) -> float:
            return self._deviance(low + x) - level

        found = crossing(beyond, 0.5, farthest=_SLOWEST, xtol=1e-3)
        return math.exp(low + (_SLOWEST if found is None else found))


_NO_VOLTAGE = "not in the log: it holds no voltage"
_WAYS = {1: "out", -1: "in"}


@dataclass(frozen=True, kw_only=True)
class MovesFit:
    """Estimates from the moves of a log, by name and direction; the moves and their spread."""

    parameters: dict[str, Estimate]
    derived: dict[str, Estimate]
    steps: tuple[Step, ...]
    trend: float  # 1/s, share of the speed that a move gains in a second, the median
    lasting: float  # s, of a move at full speed, the median
    ramps: dict[str, float]  # s, by direction: of a soft start, where that is what the moves show
    between: float  # share by which speeds of one direction differ from move to move
    noise: float  # m
    outliers: int


def fit_moves(bench: Bench) -> MovesFit:
    """Return T1 and the rate of the moves of one log; without any, both say so."""
    out = np.zeros(len(bench.time), bool)
    if bench.reference is None:  # a positioner turns within few samples, which look alike
        out = spikes(bench.position, 4.0 * (bench.noise + bench.quantum))
    bench = bench.only(~out)
    found = moves(bench)
    unit = f"{bench.unit}/s"
    start = start_up(bench, found)
    rates = [rate_of(bench, move, start.T1.value if start.T1.known else 0.0) for move in found]
    derived: dict[str, Estimate] = {}
    pooled: dict[int, Pooled] = {}
    ramps: dict[str, float] = {}
    hidden = Estimate.unknown("s", sentence("actuator", "ramp", "why"))
    for way, name in _WAYS.items():
        own = [k for k, move in enumerate(found) if move.direction == way]
        if not own:
            continue
        pooled[way] = pool([rates[k].value for k in own], [rates[k].std for k in own])
        derived[f"rate_{name}"] = pooled[way].estimate(unit)
        begun = start_up(bench, [found[k] for k in own])
        derived[f"T1_{name}"] = begun.T1 if begun.ramp is None else hidden
        if begun.ramp is not None:
            ramps[f"{name}ward"] = begun.ramp
    parameters = {
        "K1": Estimate.unknown(f"{unit}/V", _NO_VOLTAGE),
        "T1": hidden if ramps else start.T1,
        "dead_zone": Estimate.unknown("V", _NO_VOLTAGE),
        "load_voltage": Estimate.unknown("V", _NO_VOLTAGE),
        **_both(pooled, unit),
    }
    steps = tuple(
        _step(bench, move, rate, start.fitted.get(k))
        for k, (move, rate) in enumerate(zip(found, rates, strict=True))
    )
    kept = [step.residual[step.used] for step in steps]
    return MovesFit(
        parameters=parameters,
        derived=derived,
        steps=steps,
        trend=float(np.median([rate.trend for rate in rates])) if rates else 0.0,
        lasting=float(np.median([s.time[-1] - s.time[0] for s in steps])) if steps else 0.0,
        ramps=ramps,
        between=max((p.between / p.mean for p in pooled.values()), default=0.0),
        noise=float(np.concatenate(kept).std()) if kept else math.nan,
        outliers=int(out.sum()),
    )


def _both(pooled: dict[int, Pooled], unit: str) -> dict[str, Estimate]:
    """Return rate, the geometric mean of both directions, and asymmetry, their ratio."""
    if not pooled:
        why = "no move at full speed is in the log"
        return {"asymmetry": Estimate.unknown("-", why), "rate": Estimate.unknown(unit, why)}
    if len(pooled) == 1:
        ((way, one),) = pooled.items()
        why = f"the log has moves {_WAYS[way]}ward only"
        return {"asymmetry": Estimate.unknown("-", why), "rate": one.estimate(unit)}
    out, in_ = pooled[1], pooled[-1]
    both = math.hypot(out.std / out.mean, in_.std / in_.mean)
    rate, ratio = math.sqrt(out.mean * in_.mean), out.mean / in_.mean
    return {
        "asymmetry": Estimate.of(ratio, both * ratio, "-", logarithmic=True),
        "rate": Estimate.of(rate, 0.5 * both * rate, unit, logarithmic=True),
    }


def _step(bench: Bench, move: Move, rate: Rate, start: tuple[Index, Array] | None) -> Step:
    """Return a move with its fit: of the start where there is one, then of the speed."""
    first = move.first if start is None else min(move.first, int(start[0][0]))
    samples = np.arange(first, move.last + 1)
    fitted = np.full(len(samples), np.nan)
    used = np.ones(len(samples), bool)
    fitted[move.first - first :] = rate.fitted
    used[move.first - first :] = rate.used
    if start is not None:
        fitted[start[0] - first] = start[1]
        used[start[0] - first] = True
    known = np.isfinite(fitted)
    seen, fitted, used = samples[known], fitted[known], used[known]
    label, shown = f"{_WAYS[move.direction]}ward", 0 if start is None else len(start[0])
    time, x = bench.time[seen], bench.position[seen]
    return Step(bench.source, label, time, x, fitted, used, speed=rate.value, start=shown)


_SPEEDS = ("K1", "rate", "asymmetry")
WIDE = 10.0  # times, that all else may differ more between logs than speeds do


def together(fits: Sequence[dict[str, Estimate]]) -> tuple[dict[str, Estimate], dict[str, float]]:
    """Return the random-effects means over logs, and by name the probability of such differences.

    A parameter that no log identifies is taken from the first, with its reason.
    """
    result: dict[str, Estimate] = {}
    chance: dict[str, float] = {}
    for name in dict.fromkeys(name for fit in fits for name in fit):
        all_ = [fit[name] for fit in fits if name in fit]
        estimates = [e for e in all_ if e.known]
        result[name] = (estimates or all_)[0]
        if len(estimates) > 1:
            wide = 1.0 if name.startswith(_SPEEDS) else WIDE
            pooled = pool([e.value for e in estimates], [e.std for e in estimates], wide)
            least = 0.0 if all(e.value > 0.0 for e in estimates) else -math.inf
            result[name] = pooled.estimate(estimates[0].unit, least)
            chance[name] = pooled.p
    return result, chance
