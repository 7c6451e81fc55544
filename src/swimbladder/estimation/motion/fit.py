"""The fit itself: the most probable parameters, outliers left aside, and their covariance.

A vehicle that its hull's compression makes unstable doubles an error of its start every half minute
or so. Over ten doublings the depths are so bent a function of what is sought that a search ends
anywhere in a long curved valley. So it begins where a fit with process noise ended, whose filter
corrects itself at every sample and sees no such valley. Without a logged volume there is none, and
a fit begins with the values of a regression, which needs none. The equation of motion is multiplied
by a smooth function that vanishes with its slope at both ends of a window and integrated by parts
(Shinbrot's modulating functions), so that no measured depth is differentiated twice and the
equation is linear in what is sought. Noise biases the outcome; the fit that starts there does not
inherit that.

Residuals: their scale, outliers and autocorrelation.

Autocorrelation is corrected for what the fit has taken out of the residuals. A fit follows slow
noise: the residuals are smaller and whiter than the noise was, the more so the fewer samples there
are to a parameter. With e the noise, X the slopes and H = X C X' the fit's own share, the residual
is e - H e, and its mean autocovariance follows from that of e. What is lacking is added, and the
autoregression estimated again.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import matmul_toeplitz, solve_toeplitz
from scipy.ndimage import median_filter
from scipy.optimize import lsq_linear
from scipy.special import chdtrc

from swimbladder.estimation.estimates import bounded_fit
from swimbladder.estimation.motion.problem import (
    DEPTH,
    VOLUME,
    Coordinates,
    Experiment,
    Model,
    Problem,
    Segment,
)
from swimbladder.estimation.series import autoregression as of_blocks
from swimbladder.physics.arrays import Array

# Weight 1 up to _KEPT standard deviations, none from _CUT on. For normal noise this costs
# 0.1 % of the information.
_KEPT, _CUT = 3.5, 6.0
_OUTLIER = 2.0 * math.log(1.0 / 0.01) - math.log(2.0 * math.pi)  # of a density of 0.01/m
_MOST_ORDER = 6
_AT_70 = 1.0364333894937898  # of the absolute value of a normal variable, its 70th percentile
# m; residuals are less only in a simulation without noise, and how the volume goes between two
# samples, which the log does not say, costs as much.
_SMALLEST = 1e-4


def weights(u: Array) -> Array:
    """Return the weight of residuals u, in standard deviations: 1, falling smoothly to 0."""
    beyond = np.clip((np.abs(u) - _KEPT) / (_CUT - _KEPT), 0.0, 1.0)
    return np.asarray((1.0 - beyond**2) ** 2)


def cost(residual: Array, noise: Array) -> Array:
    """Return minus twice the logarithm of each residual's density, up to a constant.

    Normal, or an outlier: one sample in a hundred, anywhere in a metre. An outlier costs the same
    whatever the noise, so that calling samples outliers does not pay by making the noise small.
    """
    return np.asarray(np.minimum((residual / noise) ** 2 + 2.0 * np.log(noise), _OUTLIER))


def scale(residual: Array, weight: Array, lost: float) -> float:
    """Return the standard deviation [m] of weighted residuals; `lost` parameters were fitted.

    Where the weights are all 1: the unbiased estimate.
    """
    count = max(float(weight.sum()) - lost, 1.0)
    return max(math.sqrt(float((weight * residual**2).sum()) / count), _SMALLEST)


def pooled(scales: Array, freedom: Array) -> Array:
    """Return the scales [m] of several residuals, drawn together as far as they may be one.

    freedom: samples less parameters fitted, of each. A scale from few samples is itself uncertain;
    as a weight it costs information that its interval does not show. So the logarithms are shrunk
    towards their mean by the share of their scatter that chance explains (the moment estimator of
    DerSimonian and Laird 1986).
    """
    if len(scales) < 2:
        return scales
    chance = 2.0 / np.maximum(freedom, 2.0)  # variance of the logarithm of a variance
    logs = 2.0 * np.log(scales) + 0.5 * chance
    weight = 1.0 / chance
    mean = float((weight * logs).sum() / weight.sum())
    beyond = float((weight * (logs - mean) ** 2).sum()) - (len(logs) - 1)
    real = max(beyond, 0.0) / float(weight.sum() - (weight**2).sum() / weight.sum())
    mean = float((logs / (chance + real)).sum() / (1.0 / (chance + real)).sum())
    return np.asarray(np.exp(0.5 * (mean + (logs - mean) * real / (chance + real))))


def robust_scale(residual: Array) -> float:
    """Return the standard deviation [m] of normal noise with as large a 70th percentile.

    Three tenths of the residuals may be anything.
    """
    return max(float(np.quantile(np.abs(residual), 0.7)) / _AT_70, _SMALLEST)


def white_part(residual: Array, weight: Array, noise: float) -> float:
    """Return the noise [m, 1 sigma] that neighbouring samples of a residual do not share.

    It is the sensor's: what a model lacks changes slowly. noise [m]: of the whole residual.
    """
    pairs = weight[1:] * weight[:-1]
    square = float((pairs * np.diff(residual) ** 2).sum()) / max(2.0 * float(pairs.sum()), 1.0)
    return min(max(math.sqrt(square), _SMALLEST), noise)


def autoregression(residual: Array) -> tuple[float, ...]:
    """Return the coefficients of the autoregression that describes the residual, none if white."""
    return of_blocks([residual], highest=_MOST_ORDER, samples=10).coefficients


def yule_walker(r: Array) -> tuple[Array, float]:
    """Return the autoregression of autocovariances r, its coefficients and its innovations' power.

    As many coefficients as there are lags; the power is not above 0 where there is no such one.
    """
    a: Array = solve_toeplitz(r[:-1], r[1:])
    return a, float(r[0] - a @ r[1:])


def autocovariance(coefficients: tuple[float, ...], variance: float, n: int) -> Array:
    """Return the autocovariance [n] of an autoregression whose variance is given."""
    if not coefficients:
        return np.asarray(variance * np.eye(1, n)[0])
    whitening = np.fft.rfft([1.0, *(-c for c in coefficients)], 2 * max(n, 4096))
    gamma = np.fft.irfft(1.0 / np.abs(whitening) ** 2)[:n]
    return np.asarray(variance * gamma / gamma[0])


def whiteness(residual: Array) -> float:
    """Return the probability of a residual at least as coloured if it were white (Ljung-Box)."""
    n = len(residual)
    lags = max(1, min(20, n // 5))
    power = float(residual @ residual)
    if power == 0.0 or n < 8:
        return 1.0
    r = np.array([residual[: n - k] @ residual[k:] for k in range(1, lags + 1)]) / power
    Q = n * (n + 2.0) * float((r**2 / (n - np.arange(1, lags + 1))).sum())
    return float(chdtrc(lags, Q))


_CORRECTIONS = 4  # of the correction: more change an interval by less than a hundredth
_NEAR = 0.995  # largest root of an autoregression, beyond which it is as good as a random walk


class ArNoise(NamedTuple):
    """An autoregression: its coefficients and its variance, in squares of the noise."""

    coefficients: tuple[float, ...]
    variance: float


def ar_noises(
    slopes: Sequence[Array],
    residuals: Sequence[Array],
    seen_as: Sequence[tuple[float, ...]],
    inverse: Array,
    prior: Array,
) -> tuple[ArNoise, ...]:
    """Return the autoregression of each experiment's noise.

    slopes: [n, p] and residuals: [n] of each, weighted, in standard deviations of the noise;
    seen_as: the autoregression of each residual, none where it passes for white, and is left so;
    inverse [p, p]: of all information as if the noise were white; prior [p, p]: what of it is known
    before.
    """
    first = [ArNoise(coefficients, 1.0) for coefficients in seen_as]
    seen = [_autocovariances(u, len(c.coefficients)) for u, c in zip(residuals, first, strict=True)]
    found = first
    for _ in range(_CORRECTIONS if any(c.coefficients for c in first) else 0):
        covariance = inverse @ (information(slopes, found) + prior) @ inverse
        found = [
            _mended(X, r, c, inverse, covariance) if c.coefficients else c
            for X, r, c in zip(slopes, seen, found, strict=True)
        ]
    return tuple(found)


def information(slopes: Sequence[Array], found: Sequence[ArNoise]) -> Array:
    """Return the sum of X' G X, with G the covariance of each experiment's noise."""
    total: Array = np.zeros((slopes[0].shape[1],) * 2)
    for X, c in zip(slopes, found, strict=True):
        total = total + X.T @ (_spread(c, X) if c.coefficients else X)
    return total


def _spread(c: ArNoise, X: Array) -> Array:
    gamma = autocovariance(c.coefficients, c.variance, len(X))
    return np.asarray(matmul_toeplitz(gamma, X), np.float64)


def _autocovariances(u: Array, most: int) -> Array:
    return np.array([u[: len(u) - k] @ u[k:] for k in range(most + 1)]) / len(u)


def _mended(X: Array, seen: Array, c: ArNoise, inverse: Array, covariance: Array) -> ArNoise:
    """Return the colour whose residual would look as it does, one step nearer."""
    n, order = len(X), len(c.coefficients)
    gamma = autocovariance(c.coefficients, c.variance, n)
    GX, XC, XV = _spread(c, X), X @ inverse, X @ covariance
    mean = (n - np.arange(order + 1)) * gamma[: order + 1]
    for k in range(order + 1):
        first, later = slice(n - k), slice(k, None)
        mean[k] -= np.sum(XC[first] * GX[later]) + np.sum(XC[later] * GX[first])
        mean[k] += np.sum(XV[first] * X[later])
    wanted = seen + gamma[: order + 1] - mean / n
    if not np.isfinite(wanted).all():  # slopes beyond all bounds: nothing can be mended
        return c
    a, left = yule_walker(wanted)
    roots = np.abs(np.roots([1.0, *(-a)]))
    if left <= 0.0 or not math.isfinite(left) or roots.max() > _NEAR:
        return c
    return ArNoise(tuple(a.tolist()), float(wanted[0]))


_CLEARLY = 8.0  # standard deviations
_WINDOW = 12.0  # s
_SMOOTH = 1.5  # s, over which speeds are taken


def backwards(experiments: Sequence[Experiment]) -> bool:
    """Return whether the vehicles clearly sink as their volume grows, by the same regression."""
    A, b = _rows(experiments, psi=None, law="linear", free_neutral=True)
    if len(b) < 12:
        return False
    size = np.maximum(np.abs(A).max(axis=0), 1e-300)
    X = (A / size)[:, np.abs(A).max(axis=0) > 0.0]
    found, _, rank, _ = np.linalg.lstsq(X, b, rcond=1e-9)
    if rank < X.shape[1]:
        return False
    left = b - X @ found
    spread = float(left @ left) / max(len(b) - X.shape[1], 1)
    std = math.sqrt(max(spread * float(np.linalg.pinv(X.T @ X)[0, 0]), 1e-300))
    return float(found[0]) < -_CLEARLY * std


@np.errstate(invalid="ignore", over="ignore", divide="ignore")  # of what data do not say
def regression(
    experiments: Sequence[Experiment], model: Model, *, psi: float | None, free_neutral: bool
) -> tuple[dict[str, float], Array] | None:
    """Return first values by name and each experiment's neutral-volume error [m3], or None.

    psi [m3/m]: None where it is sought too. free_neutral: whether the neutral volumes are unknown
    by more than the fit's first steps can mend. None where the data give no sensible values.
    """
    A, b = _rows(experiments, psi=psi, law=model.law, free_neutral=free_neutral)
    if len(b) < 6:
        return None
    size = np.abs(A).max(axis=0)
    size[size == 0.0] = 1.0
    least = np.full(A.shape[1], -np.inf)
    least[[0, 2, 3]] = 0.0
    found = lsq_linear(A / size, b, bounds=(least, np.full(A.shape[1], np.inf))).x / size
    a_b, stiff, d_l, d_t = found[:4].tolist()
    if not (a_b > 0.0 and np.isfinite(found).all()):
        return None
    m = model.specific_weight / a_b
    d_l = max(d_l, 1e-3)
    values = {"psi": stiff / a_b if psi is None else psi}
    values["psi"] = float(np.clip(values["psi"], -10.0 * model.psi_scale, 10.0 * model.psi_scale))
    if model.law == "quadratic":
        values |= {"mass": m, "drag_quadratic": max(d_t, 1e-2) * m}
    else:
        values |= {"K2": a_b / d_l, "T2": 1.0 / d_l}
        if model.law == "blended":
            values["drag_quadratic"] = d_t * m
    return values, found[4:] / a_b


def _rows(
    experiments: Sequence[Experiment], *, psi: float | None, law: str, free_neutral: bool
) -> tuple[Array, Array]:
    """Return the regression's matrix [windows, 4 + experiments] and left side [windows].

    None at all where a volume is not known.
    """
    if not all(e.ramps for e in experiments):
        experiments = ()
    stretches = [(j, e, s) for j, e in enumerate(experiments) for s in e.segments]
    found = [(j, *terms) for j, e, s in stretches for terms in _windows(e, s)]
    j, drive, depth, one, laminar, turbulent, left = np.array(found).reshape(-1, 7).T
    A = np.zeros((len(left), 4 + len(experiments)))
    A[:, 0] = -drive if psi is None else psi * depth - drive
    A[:, 1] = depth if psi is None else 0.0
    A[:, 2] = laminar if law != "quadratic" else 0.0
    A[:, 3] = -turbulent if law != "linear" else 0.0
    if free_neutral:
        A[np.arange(len(left)), 4 + j.astype(int)] = one
    return A, left


def _windows(e: Experiment, s: Segment) -> Iterator[list[float]]:
    """Yield, for overlapping windows, the integrals of the equation's terms and of its left side.

    The terms: volume against neutral, depth against the reference, 1, speed (by parts), speed
    squared with its sign.
    """
    part = slice(s.first, s.last + 1)
    time, measured = e.record.time[part], e.record.depth[part]
    depth = median_filter(measured, size=3, mode="nearest")
    volume = e.inputs[part] - e.neutral + e.added - e.record.layers.along(depth)
    depth = depth - e.reference
    span = float(time[-1] - time[0])
    half = 0.5 * min(_WINDOW, span)
    speed = _speed(time, depth)
    for centre in np.arange(time[0] + half, time[-1] - half + 1e-9, half / 2.0):
        inside = np.abs(time - centre) <= half
        if inside.sum() < 6:
            continue
        t = time[inside]
        x = (t - centre) / half
        f = (1.0 - x**2) ** 3
        df = -6.0 * x * (1.0 - x**2) ** 2 / half
        ddf = (-6.0 * (1.0 - x**2) ** 2 + 24.0 * x**2 * (1.0 - x**2)) / half**2
        z, w = depth[inside], speed[inside]
        middle = float(z.mean())  # of no effect but on rounding and the trapezoidal rule
        terms = (f * volume[inside], f * z, f, df * (z - middle), f * w * np.abs(w))
        yield [float(np.trapezoid(term, t)) for term in (*terms, ddf * (z - middle))]


def _speed(time: Array, depth: Array) -> Array:
    """Return speeds [m/s], smoothed over a second or so."""
    step = float(np.median(np.diff(time)))
    width = max(1, round(_SMOOTH / step))
    padded = np.pad(depth, width, mode="reflect", reflect_type="odd")
    smooth = np.convolve(padded, np.ones(2 * width + 1) / (2 * width + 1), mode="valid")
    return np.asarray(np.gradient(smooth, time))


_ROUNDS = 12  # of weights and noise
_FEW_ROUNDS = 4  # that begin next to where they end, or have only to distinguish models
_FINE, _COARSE = 1e-8, 1e-4  # relative change of x and sum, at which least squares end
_FEW_FOLDS, _MOST_FOLDS = 3, 40  # e-folds over a log, beyond which a motion is unstable in it
_ASTRAY = 4.0  # times the noise, a residual of a model that does not follow
_CLEAN = 1.0  # of the residuals, against the noise of neighbours: there is nothing better to find
_OF_70 = 0.5565  # root mean square of a normal variable of deviation 1 without its largest 30 %
_FINEST = 1e-4  # m, below which no sensor measures
# Information on an entry of x of which data and priors say nothing: a deviation of a million.
_NOTHING = 1e-12


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Where the fit ended: x, and what the data say there."""

    x: Array
    residual: Array  # m, measured less predicted, at the samples used
    weight: Array  # 0 to 1
    root: Array  # 1/m, of the weight, over the noise
    noise: Array  # m, of each experiment
    objective: float  # minus twice the logarithm of the posterior, up to a constant
    slope: Array  # [rows, len(x)] m
    ar: tuple[tuple[float, ...], ...]  # autoregression of each experiment's residual
    ar_noise: tuple[ArNoise, ...]  # the same of the noise, of which the fit has followed a part
    information: Array  # [len(x), len(x)], data and priors, as if the residual were white
    covariance: Array  # [len(x), len(x)], the residual as it is
    data: Array  # [len(x), len(x)], information of the data alone, with autocorrelated residuals


class Ended(NamedTuple):
    """Where a search ended, as `Fit` has it."""

    x: Array
    residual: Array
    weight: Array
    noise: Array
    objective: float


def fit(problem: Problem, near: list[Array] | None = None) -> Fit:
    """Return the best fit that is reached from x next to it, or from where the data may be.

    near: x next to the best, where it is known; else the vehicle's own values and a regression's.
    """
    starts = _starts(problem) if near is None else near
    return finish(problem, _best_of(problem, starts, _ROUNDS, _FINE))


def compared(problem: Problem, starts: list[Array], *, briefly: bool) -> Ended:
    """Return the best end from some x, to the digits that distinguish models.

    briefly: after a few rounds of weights.
    """
    return _best_of(problem, starts, _FEW_ROUNDS if briefly else _ROUNDS, _COARSE)


def _best_of(problem: Problem, starts: list[Array], rounds: int, fine: float) -> Ended:
    """Return the best solution from the starts, the first that is clean."""
    found: list[Ended] = []
    for start in _begins(problem, starts):
        found.append(_solve(problem, start, rounds, fine))
        best = min(found, key=lambda one: one.objective)
        if _excess(problem, best.noise) < _CLEAN:
            break
    return best


def _begins(problem: Problem, starts: list[Array]) -> Iterator[Array]:
    """Yield the starts, likeliest first, with where those off an unstable motion grow to."""
    found = list(starts)
    for start in starts:
        begun, x = 0, None if _follows(problem, start) else start
        while x is not None and (folds := _folds(problem, x)) > max(begun, _FEW_FOLDS):
            begun, x = folds, _grown(problem, x, 2 * folds)
        if begun and x is not None:
            found.append(x)
    yield from sorted(found, key=lambda x: _ended(problem, x).objective)


def _follows(problem: Problem, x: Array) -> bool:
    """Return whether the residuals at x are no more than the noise that neighbours differ by."""
    return _excess(problem, _robust_noise(problem, problem.residual(x))) < _CLEAN


def unstable(problem: Problem, x: Array) -> bool:
    """Return whether an error of a start grows so much that no curvature says how sure a fit is.

    The valley in which it ends is long and bent then, and a search may end anywhere in it.
    """
    return _folds(problem, x) > _FEW_FOLDS


def _folds(problem: Problem, x: Array) -> int:
    """Return how many times an error of a depth at a start grows e-fold until the last sample."""
    depths = problem.slope(x)[:, problem.first_start : problem.first_drift : 2] / DEPTH
    return min(math.ceil(math.log(max(float(np.abs(depths).max()), 1.0))), _MOST_FOLDS)


def _grown(problem: Problem, x: Array, parts: int) -> Array | None:
    """Return x from fits of ever longer beginnings of the stretches, of one of so many parts more.

    Along an unstable motion each begins where the next is still nearly linear. Weights are of each
    part by itself: the last may be off as a whole. None where the model follows no beginning.
    """
    low, high = problem.bounds()
    x = np.clip(x, low, high)
    stretches = [(e.record.time, s) for e in problem.experiments for s in e.segments]
    since = np.concatenate([t[s.first : s.last + 1] - t[s.first] for t, s in stretches])
    noise = float(_floors(problem).max())
    window = (since * (parts / (1.001 * float(since.max())))).astype(int)
    for n in range(parts):
        residual = problem.residual(x)
        root = np.zeros(len(residual))
        for at in (window == k for k in range(n + 1)):
            if at.any():
                root[at] = np.sqrt(weights(residual[at] / robust_scale(residual[at])))
        root /= robust_scale(residual[window <= n])
        x = _least(problem, x, root, fine=1e-6, most=15)
        if robust_scale(problem.residual(x)[window <= n]) > _ASTRAY * noise:
            return None
    return x


def _least(problem: Problem, x: Array, root: Array, *, fine: float, most: int) -> Array:
    """Return the x next to one at which the weighted residuals are least."""
    coordinates = Coordinates(problem)

    def rows(y: Array) -> Array:
        return problem.weighted(coordinates.back(y), root)

    def slopes(y: Array) -> Array:
        return -coordinates.slope(y, problem.weighted_slope(coordinates.back(y), root))

    limits, ends = coordinates.bounds(), (fine, fine, 1e-10)
    _, y = bounded_fit(rows, slopes, coordinates.of(x), limits, ends=ends, most=most, edge=1e-9)
    return np.clip(coordinates.back(y), *problem.bounds())


def _starts(problem: Problem) -> list[Array]:
    own = problem.begin()
    psi = None if "psi" in problem.names else problem.values["psi"]
    if "psi" in problem.priors:
        psi = problem.priors["psi"].mean
    free = problem.neutral_std > 5e-6
    found = regression(problem.experiments, problem.model, psi=psi, free_neutral=free)
    if found is None:
        return [own]
    values, errors = found
    low, high = problem.bounds()
    other = np.clip(problem.begin(values), low + 1e-6, high - 1e-6)
    for x in (own, other) if free else ():
        x[problem.shared : problem.first_start] = errors / VOLUME
    return [own, other]


def _excess(problem: Problem, noise: Array) -> float:
    """Return the residuals, over the noise that neighbouring samples differ by.

    Of the experiment that is worst; 1 is as much more as chance may make it.
    """
    # of which both are uncertain
    chance = 1.0 + 5.0 / np.sqrt(np.maximum(np.diff(problem.rows) - 1.0, 1.0))
    return float((noise / _floors(problem) / chance).max())


def _floors(problem: Problem) -> Array:
    """Return the noise of neighbouring samples [m], of each experiment."""
    floors = []
    for first, last in pairwise(problem.rows):
        bend = np.sort(np.abs(np.diff(problem.measured[first:last], 2)))
        kept = bend[: max(1, round(0.7 * len(bend)))]  # hardly a spike among them
        floors.append(max(float(np.sqrt(np.mean(kept**2) / 6.0)) / _OF_70, _FINEST))
    return np.array(floors)


def _each(problem: Problem, values: Array) -> Array:
    """Return an experiment's value at each of its samples."""
    return np.asarray(np.repeat(values, np.diff(problem.rows)))


def _robust_noise(problem: Problem, residual: Array) -> Array:
    """Return the noise of each experiment [m], whatever outliers there are."""
    return np.array([robust_scale(residual[a:b]) for a, b in pairwise(problem.rows)])


def _noise(problem: Problem, residual: Array, weight: Array) -> Array:
    """Return the noise of each experiment [m] from weighted residuals."""
    found, freedom = [], []
    for e, (a, b) in zip(problem.experiments, pairwise(problem.rows), strict=True):
        lost = 1 + 2 * len(e.segments) + problem.shared / len(problem.experiments)
        found.append(scale(residual[a:b], weight[a:b], lost))
        freedom.append(float(weight[a:b].sum()) - lost)
    return pooled(np.array(found), np.array(freedom))


def _solve(problem: Problem, x: Array, rounds: int, fine: float) -> Ended:
    """Return the end of rounds of weights, noise and least squares.

    Where it began, if that is better: along an unstable vehicle no step may lead further.
    """
    low, high = problem.bounds()
    x = np.clip(x, low, high)
    begun = _ended(problem, x)
    residual = problem.residual(x)
    noise = _robust_noise(problem, residual)
    settled = False
    for n in range(rounds):
        weight = weights(residual / _each(problem, noise))
        if settled:  # no outlier is near any more: the efficient estimate of the noise
            noise = _noise(problem, residual, weight)
        root = np.sqrt(weight) / _each(problem, noise)
        ends = fine if n > 1 else _COARSE  # weights are not final at first
        before, x = x, _least(problem, x, root, fine=ends, most=40 if n == 0 else 12)
        step = float(np.abs(x - before).max())
        residual = problem.residual(x)
        if settled and step < 1e-3:
            break
        settled = settled or step < 0.03
        if not settled:
            noise = _robust_noise(problem, residual)
    return min(begun, _ended(problem, x), key=lambda one: one.objective)


def _final_noise(problem: Problem, residual: Array, noise: Array) -> Array:
    """Return the noise that agrees with the weights that it gives, from a first one."""
    for _ in range(20):
        before, noise = noise, _noise(problem, residual, weights(residual / _each(problem, noise)))
        if (np.abs(noise / before - 1.0) < 1e-6).all():
            break
    return noise


def _objective(problem: Problem, x: Array, residual: Array, noise: Array) -> float:
    """Return minus twice the log posterior, up to a constant."""
    prior = problem.prior_rows(x)[0]
    return float(cost(residual, _each(problem, noise)).sum() + (prior**2).sum())


def _ended(problem: Problem, x: Array) -> Ended:
    residual = problem.residual(x)
    noise = _final_noise(problem, residual, _robust_noise(problem, residual))
    weight = weights(residual / _each(problem, noise))
    return Ended(x, residual, weight, noise, _objective(problem, x, residual, noise))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # slopes beyond all bounds
def finish(problem: Problem, end: Ended) -> Fit:
    """Return everything that is known where a search ended."""
    x, residual, weight, noise, _ = end
    slope = problem.slope(x)
    P = problem.prior_rows(x)[1]
    rows = [slice(a, b) for a, b in pairwise(problem.rows)]
    root = np.sqrt(weight) / _each(problem, noise)
    slopes = [root[part, None] * slope[part] for part in rows]
    left = [root[part] * residual[part] for part in rows]
    A = sum((X.T @ X for X in slopes), np.zeros((len(x), len(x))))
    prior = P.T @ P + _NOTHING * np.eye(len(x))
    inverse = inverse_of(A + prior)
    seen = tuple(autoregression(u) for u in left)
    found = ar_noises(slopes, left, seen, inverse, prior)
    B = information(slopes, found)
    covariance = inverse @ (B + prior) @ inverse
    covariance = _positive(0.5 * (covariance + covariance.T))
    return Fit(
        **end._asdict(),
        root=root,
        slope=slope,
        ar=seen,
        ar_noise=found,
        information=A + prior,
        covariance=covariance,
        data=A @ inverse_of(B) @ A,
    )


def _positive(C: Array) -> Array:
    """Return a symmetric matrix without what rounding makes of directions that are not known."""
    if (np.diag(C) > 0.0).all():
        return C
    size = np.sqrt(np.abs(np.diag(C)))
    values, vectors = np.linalg.eigh(C / np.outer(size, size))
    return np.asarray((vectors * np.abs(values)) @ vectors.T * np.outer(size, size))


def eliminated(M: Array, n: int) -> tuple[Array, Array]:
    """Return the information [n, n] about the first entries, the others following them, and by how
    much these do [others, n]: the Schur complement of a symmetric matrix.
    """
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    D = M / np.outer(size, size)
    follows = np.linalg.solve(D[n:, n:] + 1e-13 * np.eye(len(M) - n), D[n:, :n])
    S = (D[:n, :n] - D[:n, n:] @ follows) * np.outer(size[:n], size[:n])
    return S, follows * size[:n] / size[n:, None]


def inverse_of(M: Array, least: float = 0.0) -> Array:
    """Return the inverse of a symmetric matrix, through entries of one size each.

    Directions of which nothing is known get a variance that is huge, not infinite; least: their
    information then.
    """
    size = np.sqrt(np.maximum(np.diag(M), 1e-200))
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    values = np.maximum(values, max(1e-13 * float(values[-1]), 1e-300, least))
    return np.asarray((vectors / values) @ vectors.T / np.outer(size, size))
