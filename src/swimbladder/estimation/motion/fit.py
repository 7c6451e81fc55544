"""The fit itself: the most probable parameters, outliers left aside, and their covariance.

Long records of an unstable motion are searched in stretches that are drawn together. A vehicle that
its hull's compression makes unstable doubles an error of its start every half minute or so. Over
ten doublings the depths are so bent a function of what is sought that a search ends anywhere in a
long curved valley. Cut into stretches, each with a start of its own, they are nearly a linear one;
gaps between the stretches are then made to cost ever more, until none is left and the start of the
first is that of the whole (multiple shooting: Bock and Plitt, IFAC Proceedings 17, 1984; Voss,
Timmer and Kurths, International Journal of Bifurcation and Chaos 14, 2004).

A fit begins with the values of a regression, which needs none. The equation of motion is multiplied
by a smooth function that vanishes with its slope at both ends of a window and integrated by parts
(Shinbrot's modulating functions), so that no measured depth is differentiated twice and the
equation is linear in what is sought. Noise biases the outcome; the fit that starts there does not
inherit that.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import lsq_linear

from swimbladder.estimation.estimates import bounded_fit
from swimbladder.estimation.motion.noise import (
    ArNoise,
    ar_noises,
    autoregression,
    cost,
    information,
    pooled,
    robust_scale,
    scale,
    weights,
)
from swimbladder.estimation.motion.problem import (
    LOST,
    VOLUME,
    Coordinates,
    Experiment,
    Model,
    Problem,
    Segment,
)
from swimbladder.estimation.series import Array

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
    size = np.maximum(np.abs(A).max(axis=0), 1e-300)
    least = np.full(A.shape[1], -np.inf)
    least[[0, 2, 3]] = 0.0
    found = lsq_linear(A / size, b, bounds=(least, np.full(A.shape[1], np.inf))).x / size
    a_b, stiff, d_l, d_t = found[:4].tolist()
    if a_b <= 0.0:
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


GAPS = (1.0, 1e-2, 1e-4, 1e-6)  # of the noise: what a gap may be, one search after the other
_MOST = 20.0  # of a logarithm: more stretches than for that help no more
_BESIDE = 1.5  # s, after which the depths must agree again: then the speeds do


def growth(problem: Problem, x: Array) -> float:
    """Return by how much an error of the depth at a start grows at most over a record.

    By the poles of the motion about rest, eq. (34) without the actuator; turbulent drag would only
    slow it.
    """
    p = problem.model.plant(problem.named(x), 0.0)
    fast, slow = np.roots([1.0, p.d_l, -p.a_b * p.psi]).tolist()
    if isinstance(fast, complex) or p.psi <= 0.0:
        return 1.0
    fast, slow = max(fast, slow), min(fast, slow)
    t = longest(problem)
    found = math.log(-slow / (fast - slow)) + fast * t  # the other exponential has died away
    return math.exp(min(found, _MOST)) if found > 0.0 else 1.0


def longest(problem: Problem) -> float:
    """Return how long the longest stretch under way lasts [s]."""
    stretches = [(e.record.time, s) for e in problem.experiments for s in e.segments]
    return max(float(time[s.last] - time[s.first]) for time, s in stretches)


class Shooting(Problem):
    """A problem cut into stretches, whose gaps count as residuals of the priors' kind."""

    def __init__(self, whole: Problem, grown: float) -> None:
        """Cut a problem whose errors grow so much in all into stretches that let them grow by e."""
        length = longest(whole) / max(2.0, math.log(grown))
        tiles = [e.tiles(length) for e in whole.experiments]
        super().__init__(tiles, whole.model, whole.names, whole.assumed)
        self.gap = 1.0  # m, 1 sigma
        self._joints: list[tuple[int, int, Segment]] = []  # experiment, stretch, its overlap
        for j, (own, long) in enumerate(zip(self.experiments, whole.experiments, strict=True)):
            ends = {s.last for s in long.segments}
            time = own.record.time
            for k, (a, b) in enumerate(pairwise(own.segments)):
                if a.last in ends:
                    continue
                last = int(np.searchsorted(time, time[b.first] + _BESIDE))
                self._joints.append((j, k, Segment(b.first, min(last, b.last), b.depth, b.speed)))

    def prior_rows(self, x: Array) -> tuple[Array, Array]:
        """Return the priors' rows, and after them two for each gap."""
        pairs = zip(super().prior_rows(x), self._gaps(x), strict=True)
        residuals, slopes = (np.concatenate([own, gaps / self.gap]) for own, gaps in pairs)
        return residuals, slopes

    def _gaps(self, x: Array) -> tuple[Array, Array]:
        """Return by how much stretches miss the next ones [2 for each, m], and the derivatives."""
        missed = np.zeros(2 * len(self._joints))
        slopes = np.zeros((len(missed), self.size))
        for i, (j, k, beside) in enumerate(self._joints):
            e = self.experiments[j]
            own = self.shared + j
            shared = [*range(self.shared), own]
            plants = self._plants(x, e, own, shared)
            rows = slice(2 * i, 2 * i + 2)
            before = e.segments[k]._replace(last=beside.last)
            for sign, part, stretch in ((1.0, before, k), (-1.0, beside, k + 1)):
                at = self.starts_at[j] + 2 * stretch
                z, block = self._stretch(x, e, self._course(e, part), at, plants)
                ends = [beside.first - part.first, beside.last - part.first]
                missed[rows] -= sign * z[ends]
                slopes[rows, [*shared, at, at + 1]] += sign * block[ends]
        # a stretch that the vehicle left the water in misses by as much as a residual may
        return np.clip(np.nan_to_num(missed, nan=LOST), -LOST, LOST), slopes


def joined(cut: Problem, x: Array, whole: Problem) -> Array:
    """Return the x of the whole problem: each record starts as the first of its stretches does."""
    found = whole.begin_like(x)
    for j, e in enumerate(whole.experiments):
        parts = {s.first: k for k, s in enumerate(cut.experiments[j].segments)}
        for k, s in enumerate(e.segments):
            at, there = whole.starts_at[j] + 2 * k, cut.starts_at[j] + 2 * parts[s.first]
            found[at : at + 2] = x[there : there + 2]
    return found


Found = tuple[float, Array, Array]  # objective, x, noise [m] of each experiment

_ROUNDS = 12  # of weights and noise
_OF_STRETCHES = 4  # rounds of stretches with gaps of one size
_HOPELESS = 10.0  # against the noise of neighbouring samples: a model that is not the vehicle's
_GROWN = 20.0  # times that an error grows over a record, from where on stretches are searched
_TILES = (15.0, 30.0, 60.0, 120.0)  # s
# Of the residuals, against the noise of neighbouring samples:
_CLEAN = 1.0  # there is nothing better to find
_POOR = 3.0  # more starts are tried than a few
_ENOUGH = 2  # starts, where the residuals are no worse than that
_OF_70 = 0.5565  # root mean square of a normal variable of deviation 1 without its largest 30 %
_FINEST = 1e-4  # m, below which no sensor measures


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


def fit(problem: Problem) -> Fit:
    """Return the best of the fits from the vehicle's own values and from a regression's.

    Where an error of the start grows over a record, and where the residuals are above the noise
    of neighbouring samples, the records are searched in stretches too.
    """
    starts = _starts(problem)
    best = _in_stretches(problem, _best_of(problem, starts), starts[-1], clean=_CLEAN)
    return finish(problem, _pieced(problem, best, starts[-1], clean=_CLEAN, most=len(_TILES))[1])


def refine(problem: Problem, x: Array) -> Fit:
    """Return the fit that is reached from x, or a better one if that is poor."""
    best = _in_stretches(problem, _solve(problem, x), x, clean=math.inf)
    return finish(problem, _pieced(problem, best, x, clean=_POOR, most=1)[1])


def _best_of(problem: Problem, starts: list[Array]) -> Found:
    """Return the best solution from the starts, the first that is clean."""
    found: list[Found] = []
    for start in sorted(starts, key=lambda x: float(np.abs(problem.residual(x)).sum())):
        found.append(_solve(problem, start))
        best = min(found, key=lambda one: one[0])
        if _excess(problem, best[2]) < _CLEAN:
            break
    return best


def _in_stretches(problem: Problem, best: Found, start: Array, *, clean: float) -> Found:
    """Return the best, or what stretches drawn together lead to from a start, if they are needed
    and it is better.
    """
    grown = max(growth(problem, best[1]), growth(problem, start))
    if grown <= _GROWN and _excess(problem, best[2]) < clean:
        return best
    cut = Shooting(problem, grown)
    noise = float(np.median(_floors(problem)))
    x = cut.begin_like(start)
    for gap in GAPS:
        cut.gap = gap * noise
        _, x, left = _solve(cut, x, rounds=_OF_STRETCHES)
        if _excess(cut, left) > _HOPELESS:
            return best
    return min(best, _solve(problem, joined(cut, x, problem)), key=lambda found: found[0])


def _pieced(problem: Problem, best: Found, start: Array, *, clean: float, most: int) -> Found:
    """Return the best solution from `most` starts pieced together, until one is clean."""
    if _excess(problem, best[2]) < clean:
        return best
    for tried, x in enumerate(islice(_others(problem, start), most), start=1):
        best = min(best, _solve(problem, x), key=lambda found: found[0])
        if _excess(problem, best[2]) < (clean if tried < _ENOUGH else _POOR):
            break
    return best


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


def _others(problem: Problem, start: Array) -> Iterator[Array]:
    """Yield starts from fits to short stretches, each begun where the one before ended."""
    for length in _TILES:
        if length > 0.7 * longest(problem):
            return
        tiled = problem.tiled(length)
        start = _solve(tiled, tiled.begin_like(start))[1]
        yield joined(tiled, start, problem)


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


def _solve(problem: Problem, x: Array, *, rounds: int = _ROUNDS) -> Found:
    """Return (objective, x, noise) at the end of rounds of weights, noise and least squares."""
    low, high = problem.bounds()
    x = np.clip(x, low, high)
    coordinates = Coordinates(problem)
    limits = coordinates.bounds()
    residual = problem.residual(x)
    noise = _robust_noise(problem, residual)
    settled = False
    for n in range(rounds):
        weight = weights(residual / _each(problem, noise))
        if settled:  # no outlier is near any more: the efficient estimate of the noise
            noise = _noise(problem, residual, weight)
        root = np.sqrt(weight) / _each(problem, noise)

        def rows(y: Array, root: Array = root) -> Array:
            return problem.weighted(coordinates.back(y), root)

        def slopes(y: Array, root: Array = root) -> Array:
            return -coordinates.slope(y, problem.weighted_slope(coordinates.back(y), root))

        fine, most = 1e-8 if n > 1 else 1e-4, 40 if n == 0 else 12  # weights are not final at first
        _, y = bounded_fit(
            rows, slopes, coordinates.of(x), limits, ends=(fine, fine, 1e-10), most=most, edge=1e-9
        )
        before, x = x, np.clip(coordinates.back(y), low, high)
        step = float(np.abs(x - before).max())
        residual = problem.residual(x)
        if settled and step < 1e-3:
            break
        settled = settled or step < 0.03
        if not settled:
            noise = _robust_noise(problem, residual)
    noise = _final_noise(problem, residual, noise)
    return _objective(problem, x, residual, noise), x, noise


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


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # slopes beyond all bounds
def finish(problem: Problem, x: Array) -> Fit:
    """Return everything that is known at x."""
    residual = problem.residual(x)
    noise = _final_noise(problem, residual, _robust_noise(problem, residual))
    weight = weights(residual / _each(problem, noise))
    slope = problem.slope(x)
    P = problem.prior_rows(x)[1]
    rows = [slice(a, b) for a, b in pairwise(problem.rows)]
    root = np.sqrt(weight) / _each(problem, noise)
    slopes = [root[part, None] * slope[part] for part in rows]
    left = [root[part] * residual[part] for part in rows]
    A = sum((X.T @ X for X in slopes), np.zeros((len(x), len(x))))
    prior = P.T @ P
    inverse = inverse_of(A + prior)
    seen = tuple(autoregression(u) for u in left)
    found = ar_noises(slopes, left, seen, inverse, prior)
    B = information(slopes, found)
    covariance = inverse @ (B + prior) @ inverse
    covariance = 0.5 * (covariance + covariance.T)  # so to the last digit
    return Fit(
        x=x,
        residual=residual,
        weight=weight,
        root=root,
        noise=noise,
        objective=_objective(problem, x, residual, noise),
        slope=slope,
        ar=seen,
        ar_noise=found,
        information=A + prior,
        covariance=covariance,
        data=A @ inverse_of(B) @ A,
    )


def inverse_of(M: Array) -> Array:
    """Return the inverse of a symmetric matrix, through entries of one size each.

    Directions of which nothing is known get a variance that is huge, not infinite.
    """
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    values = np.maximum(values, 1e-13 * max(float(values[-1]), 1e-300))
    return np.asarray((vectors / values) @ vectors.T / np.outer(size, size))
