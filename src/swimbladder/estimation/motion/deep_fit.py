"""Parameters of a deep vehicle from dives: what makes the measured pressures most likely.

The likelihood is that of the filter in `deep_filter`, so that lag, moving water, a cast that errs
and a volume that drifts count as what they are; how large these are is estimated too. The best
values are found by scoring, with Fisher's information of normal innovations e of variance S, the
sum of de de'/S + dS dS'/(2 S^2), whose inverse, priors included, is the covariance (e.g. Harvey,
*Forecasting, Structural Time Series Models and the Kalman Filter*, 1989, section 3.4). That of
several dives is by how far each, identified by itself, lies from what fits all
(`random_effects`).

Dives of one vehicle differ, and that limits what a set that fits them all is worth. Samples of a
dive share its errors of the model, hours and days long, so that their number says little of the
vehicle. Each dive alone has parameters x_d of its own, with information I_d at m_d::

    m_d ~ N(x_d, I_d^-1)     x_d ~ N(x, diag tau^2)     x ~ N(0, 1)     tau ~ half-Cauchy(TYPICAL)

in deviations of the priors: random effects (e.g. Gelman, *Bayesian Analysis* 1, 2006, 515, on tau
of few groups), which never determine x better than so many dives can. x_d and x are integrated
exactly, tau drawn by Gibbs on a grid (Ritter and Tanner, *J. Am. Stat. Assoc.* 87, 1992, 861).

One set x_0 that fits all samples best predicts dives best, and is no estimate of x where dives
differ: it is pulled to where the misfit is small in mL, towards small volumes. Its mean square
error about x is that of the random effects, and the square of how far they lie from it (Hausman,
*Econometrica* 46, 1978, 1251, compares two such estimates). Where dives are overdispersed, their
likelihood is tempered by it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.estimates import Prior, sentence
from swimbladder.estimation.motion.deep_filter import V0, Noise
from swimbladder.estimation.motion.deep_model import (
    GATE,
    Body,
    DeepDive,
    Filtered,
    Path,
    check_deep_names,
    deep_path,
    drag_volume,
    excess,
    filtered,
)
from swimbladder.estimation.series import Index, huber
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array


class DiveScore(NamedTuple):
    """A dive's score and information on parameters [k], in prior deviations, without the priors."""

    gradient: Array  # of minus the log likelihood, at what fits all dives [k]
    information: Array  # [k, k]


def overdispersion(dives: Sequence[DiveScore]) -> float:
    """Return the ratio of the observed scatter of dives to that which their information implies.

    Each dive alone would have the parameters where I_d (x_d - x) = -g_d. The sum of the squares of
    x_d - x, in its own deviations, over its mean where the information is right, is what Birge
    (*Phys. Rev.* 40, 1932, 207) widens measurements of one quantity by that contradict each other;
    here with priors, so that what a dive hardly determines hardly counts. 1 for a single dive.
    """
    each = sum(_count(dive.information) for dive in dives)
    free = each - _count(np.sum([dive.information for dive in dives], axis=0))
    if free < 0.5:  # no parameter is determined by two of them
        return 1.0
    return sum(_off(dive) for dive in dives) / free


def distances(dives: Sequence[DiveScore]) -> tuple[float, ...]:
    """Return how far each dive by itself is from what fits all, rms in its own deviations."""
    return tuple(float(np.sqrt(_off(d) / max(_count(d.information), 1.0))) for d in dives)


def _count(information: Array) -> float:
    """Return the effective number of parameters that the data determine, without the priors."""
    return float(np.trace(np.linalg.solve(information + np.eye(len(information)), information)))


def _off(dive: DiveScore) -> float:
    prior = np.eye(len(dive.gradient))
    return float(dive.gradient @ np.linalg.solve(dive.information + prior, dive.gradient))


TYPICAL = 0.3  # deviations of a prior by which dives differ; six real ones have 0.06 to 0.6
_GRID = np.append(0.01, np.geomspace(0.03, 3.0, 11))  # of tau
_SWEEPS, _SETTLE = 60, 12  # of the draws; twice as many move deviations by a few percent
_SEED = 1


class Single(NamedTuple):
    """Estimates from one dive alone of parameters [k], in deviations of their priors."""

    value: Array  # with the priors [k]
    information: Array  # without them [k, k]


class RandomEffects(NamedTuple):
    """Parameters of a vehicle whose dives differ, in deviations of their priors."""

    value: Array  # [k]
    covariance: Array  # [k, k]
    spread: Array  # tau, 1 sigma from dive to dive [k]


def random_effects(dives: Sequence[Single]) -> RandomEffects:
    """Return the parameters that dives differ about, and by how much; for two dives or more."""
    count = len(dives[0].value)
    information = np.array([one.information for one in dives])
    score = np.array([(one.information + np.eye(count)) @ one.value for one in dives])
    rng = np.random.default_rng(_SEED)
    prior = np.log(np.gradient(_GRID) / (1.0 + (_GRID / TYPICAL) ** 2))
    tau, samples = np.full(count, TYPICAL), 0
    value, square, differ = np.zeros(count), np.zeros((count, count)), np.zeros(count)
    for sweep in range(_SWEEPS):
        for j in range(count):
            tried = np.repeat(tau[None], len(_GRID), axis=0)
            tried[:, j] = _GRID
            evidence, mean, covariance = _given(information, score, tried)
            share = np.exp(evidence + prior - np.max(evidence + prior))
            share /= share.sum()
            tau[j] = rng.choice(_GRID, p=share)
            if sweep >= _SETTLE:
                value += share @ mean
                squares = covariance + mean[:, :, None] * mean[:, None, :]
                square += np.tensordot(share, squares, axes=1)
                differ[j] += share @ _GRID
                samples += 1
    value, differ = value / samples, differ * count / samples
    return RandomEffects(value, square / samples - np.outer(value, value), differ)


def _given(information: Array, score: Array, tau: Array) -> tuple[Array, Array, Array]:
    """Return log evidence [g], mean [g, k] and covariance [g, k, k] of x for tau [g, k].

    information [d, k, k]: I_d; score [d, k]: I_d m_d.
    """
    eye, spread = np.eye(tau.shape[1]), tau[:, None, :] ** 2
    mixed = eye + information[None] * spread[:, :, None, :]  # 1 + I_d T
    counts = np.linalg.solve(mixed, np.broadcast_to(information, mixed.shape))  # (I_d^-1 + T)^-1
    says = np.linalg.solve(mixed, np.broadcast_to(score[None, :, :, None], (*mixed.shape[:3], 1)))
    says = says[..., 0]
    covariance = np.linalg.inv(counts.sum(axis=1) + eye)
    total = says.sum(axis=1)
    mean = np.einsum("gij,gj->gi", covariance, total)
    evidence = np.einsum("dk,gdk->g", score, spread * says) + np.einsum("gk,gk->g", total, mean)
    evidence -= np.linalg.slogdet(mixed)[1].sum(axis=1) - np.linalg.slogdet(covariance)[1]
    return 0.5 * evidence, mean, covariance


def square_error(found: RandomEffects, value: Array) -> Array:
    """Return the mean square error of a set `value` [k] of parameters [k, k]."""
    off = value - found.value
    return np.asarray(found.covariance + np.outer(off, off))


# Before: a typical value, and by which factor it may be off. Oil and runs are held tightly: left to
# themselves they would explain what drag and hull should, and no balance would have to close.
NOISES = Noise(pressure=300.0, water=3e-3, drift=5e-10, runs=3e-3, lasts=300.0)
FACTOR = Noise(*(math.log(factor) for factor in (3.0, 3.0, 1.3, 1.2, 2.0)))
# Below these nothing is believed: resolution, the quietest sea, oil and hull, valves.
_LEAST = Noise(pressure=30.0, water=3e-4, drift=1e-10, runs=1e-3, lasts=30.0)
POSITIVE = ("drag", "drag_up", "inertia")  # without which nothing moves
_NARROWED = 0.8  # of the prior's deviation: a parameter that the data narrow less is from its prior
# For slopes: prior deviations, and after that deviations of what is known, along its own axes. Runs
# of a pump that starts shorter and delivers more are alike, so that slopes of one have to cancel
# those of the other to a percent, while a float at rest feels either within a hundredth of a prior.
_STEP, _WHITE = 1e-2, 0.3
_MOST, _NEAR = 20, 1e-2  # steps of scoring; gain of log likelihood that ends them
_AXES = 2  # times that the axes of what is known are found
# Pressures are noisier by [Pa] first, with the stride of slopes there, and outliers count in full;
# then rounds of noise and parameters, in deviations, until one gains less than `_SETTLED`.
_BLURS = {1e6: 1.0, 1e5: _WHITE, 1e4: _WHITE}
_MILD, _AGAIN = {3e4: _WHITE, 1e4: _WHITE}, 3  # the same from where that leads, so often
_OPEN = 1e6  # a gate that none is beyond
_STRIDES = (3.0, 1.0, _WHITE)
_ROUNDS, _SETTLED = 6, 0.3
_FAR = 8.0  # of minus the log posterior above the best: 0.03 % as probable


@dataclass(frozen=True, kw_only=True)
class DeepFit:
    """What fits: values by name, the drive's volume at the beginning of each dive, covariance.

    covariance: of `names` and, after them, of `starts`, in SI.
    """

    names: tuple[str, ...]
    values: Mapping[str, float]
    starts: Array  # m3 [dives]
    covariance: Array
    noise: Noise
    tempering: float  # power of the likelihood below 1 where the dives are overdispersed
    random_effects: RandomEffects | None  # in deviations of the priors; None: one dive
    distance: tuple[float, ...]  # how far each dive by itself is from this, in its deviations
    priors: Mapping[str, Prior]
    innovations: tuple[Array, ...]  # of each dive, of all samples but one, in their deviations
    residuals: tuple[Array, ...]  # m/s, of each piece: measured less predicted from its begin

    def std(self, name: str) -> float:
        """Return the standard deviation of a parameter, 0 where it was set."""
        if name not in self.names:
            return 0.0
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    def identified(self, name: str) -> bool:
        """Whether the data narrow what was known of a parameter before."""
        return name in self.names and self.std(name) < _NARROWED * self.priors[name].std

    def identified_singly(self, name: str) -> bool:
        """Whether the dives, each by itself, narrow what was known of a parameter before."""
        if self.random_effects is None or name not in self.names:
            return False
        i = self.names.index(name)
        return float(np.sqrt(self.random_effects.covariance[i, i])) < _NARROWED


def least(priors: Mapping[str, Prior], name: str) -> float:
    """Return the least value that a search may have of a parameter, see `POSITIVE`."""
    return 1e-2 * abs(priors[name].mean) if name in POSITIVE else -math.inf


def balance(body: Body, values: Mapping[str, float], start: float, dive: DeepDive) -> Array:
    """Return the imbalance of the volumes, E less what drag and inertia take [m3] [n]."""
    p = dive.pieces
    carried = drag_volume(values, p.speed, p.density, dive.gravity)
    pushed = body.inertia * values["inertia"] * p.acceleration / (p.density * dive.gravity)
    return excess(body, values, start, dive) - carried - pushed


def start_volume(
    body: Body, values: Mapping[str, float], dive: DeepDive, until: float = np.inf
) -> float:
    """Return the drive's volume at the beginning that closes the balance, by the median [m3].

    until [s]: samples later than this after the beginning do not count.
    """
    early = dive.pieces.elapsed <= until
    if not early.any():
        early = dive.pieces.elapsed <= float(dive.pieces.elapsed[0])
    return float(np.median(balance(body, values, 0.0, dive)[early]))


def fit_deep(
    body: Body,
    dives: Sequence[DeepDive],
    priors: Mapping[str, Prior],
    *,
    free: Sequence[str],
    fixed: Mapping[str, float] | None = None,
    advance: Advance = silent,
) -> DeepFit:
    """Return the parameters `free` and each dive's start; the rest are `fixed` or as their priors.

    advance: called with shares of the work. Raises InputError for a name that is not one, or none
    that is free.
    """
    check_deep_names(free, "free")
    check_deep_names(list(fixed or {}), "fixed")
    names = tuple(name for name in free if name not in (fixed or {}))
    if not names:
        remedy = "Leave one parameter free"
        raise InputError("nothing is left to identify", field="free", remedy=remedy)
    paths, count = [deep_path(d, body, priors) for d in dives], len(names)
    held = {name: prior.mean for name, prior in priors.items()} | dict(fixed or {})
    problem = _Problem(body, paths, priors, names, held)
    apiece = 0.5 if len(paths) > 1 else 1.0  # and each by itself, which takes as long together
    differing: RandomEffects | None = None
    with threadpool_limits(limits=1):
        x, found = _searched(problem, lambda share: advance(apiece * share))
        covariance = found.covariance()
        if len(paths) > 1:
            part = apiece / len(paths)
            alone = [replace(problem, paths=[path]) for path in paths]
            differing = random_effects([_alone(one, advance, part, x) for one in alone])
            covariance = square_error(differing, x[:count])
    tempering = min(1.0, 1.0 / overdispersion(found.scores))
    # Of the starts: what the filter does not know, and what the parameters do not.
    moves = found.starts[:, :count]
    moved = moves @ covariance @ moves.T
    moved = moved + np.diag([float(f.covariance[V0, V0]) for f in found.filtered])
    scale = np.array([priors[name].std for name in names])
    mixed = (moves @ covariance) * scale
    of_names = covariance[:count, :count] * np.outer(scale, scale)
    whole = np.block([[of_names, mixed.T], [mixed, moved]])
    return DeepFit(
        names=names,
        values=problem.values(x),
        covariance=whole,
        noise=problem.noise(x),
        starts=np.array([f.start for f in found.filtered]),
        tempering=tempering,
        random_effects=differing,
        distance=distances(found.scores),
        priors=dict(priors),
        innovations=tuple(f.innovation / np.sqrt(f.variance) for f in found.filtered),
        residuals=tuple(map(_residuals, paths, found.filtered)),
    )


def _residuals(path: Path, found: Filtered) -> Array:
    pieces = path.dive.pieces
    sample = np.searchsorted(path.time, pieces.time + 0.5 * pieces.duration - 1e-3)
    weight = pieces.density * path.dive.gravity
    return np.asarray(found.innovation[sample - 1] / (weight * pieces.duration))


class _Slopes(NamedTuple):
    """The likelihood at a place: its filters, gradient, information, slopes of the starts."""

    filtered: list[Filtered]
    variance: Array  # Pa2, of the innovations
    gradient: Array
    information: Array
    starts: Array  # m3 [dives, x]
    scores: list[DiveScore]  # of each dive, of the parameters
    valleys: Array  # covariance by other valleys, of the parameters [k, k]

    def covariance(self) -> Array:
        """Return that of the parameters from the first dive, or the only one [k, k]."""
        return np.linalg.inv(self.scores[0].information + np.eye(len(self.valleys))) + self.valleys


def _joined(found: Sequence[Filtered]) -> tuple[Array, Array, Array]:
    """Return innovations and their variances of all dives, and the start of each."""
    innovation = np.concatenate([f.innovation for f in found])
    variance = np.concatenate([f.variance for f in found])
    return innovation, variance, np.array([f.start for f in found])


@dataclass(frozen=True)
class _Problem:
    """Minus the log posterior of x: deviations of the parameters, of the logarithms of noises."""

    body: Body
    paths: Sequence[Path]
    priors: Mapping[str, Prior]
    names: tuple[str, ...]
    held: Mapping[str, float]  # values of what is not sought
    blur: float = 0.0  # Pa, by which the pressures are taken to be noisier
    gate: float = GATE

    def values(self, x: Array) -> dict[str, float]:
        """Return the parameters at x, by name."""
        found = dict(self.held)
        for name, at in zip(self.names, x.tolist(), strict=False):
            found[name] = self.priors[name].mean + self.priors[name].std * at
        return found | {name: max(found[name], least(self.priors, name)) for name in POSITIVE}

    def noise(self, x: Array) -> Noise:
        """Return the noises at x."""
        parts = zip(NOISES, FACTOR, x[len(self.names) :].tolist(), _LEAST, strict=True)
        found = Noise(*(math.hypot(u * math.exp(w * a), least) for u, w, a, least in parts))
        return found._replace(pressure=math.hypot(found.pressure, self.blur))

    def filtered(self, x: Array) -> list[Filtered]:
        """Return what the filter makes of each dive at x."""
        values, noise = self.values(x), self.noise(x)
        return [filtered(self.body, values, noise, path, self.gate) for path in self.paths]

    def cost(self, x: Array, variance: Array | None = None) -> float:
        """Return minus the log posterior at x, up to a constant; infinite where it has none.

        variance: of the innovations [Pa2], that of the filter unless given.
        """
        v, S, _ = _joined(self.filtered(x))
        S = S if variance is None else variance
        if not (S > 0.0).all():
            return math.inf
        off = huber(np.abs(v) / np.sqrt(S), self.gate)
        total = 0.5 * float(x @ x) + float(np.sum(off + 0.5 * np.log(S)))
        return total if math.isfinite(total) else math.inf

    def slopes(
        self, x: Array, free: Index, information: Array | None = None, stride: float = _WHITE
    ) -> _Slopes:
        """Return the likelihood at x with its slopes along the places `free` of x.

        information: near there, whose axes are gone along by `stride` deviations [x, x].
        """
        here = self.filtered(x)
        v, S, _ = _joined(here)
        if not (S > 0.0).all():
            raise NoAnswerError(sentence("deep", "no filter"))
        dv, dS = np.zeros((len(v), len(x))), np.zeros((len(v), len(x)))
        starts = np.zeros((len(here), len(x)))
        axes = _STEP * np.eye(len(free))
        if information is not None:
            size, ways = np.linalg.eigh(information[np.ix_(free, free)])
            axes = stride * ways / np.sqrt(size)
        changes = []  # of innovations, variances and starts along each axis
        for axis in axes.T:
            far = np.zeros(len(x))
            far[free] = axis
            sides = (_joined(self.filtered(x + h)) for h in (far, -far))
            changes.append([0.5 * (ahead - behind) for ahead, behind in zip(*sides, strict=True)])
        per = np.linalg.inv(axes)
        for target, along in zip((dv, dS, starts), zip(*changes, strict=True), strict=True):
            target[:, free] = np.stack(along, axis=1) @ per
        counts = np.minimum(1.0, self.gate * np.sqrt(S) / np.maximum(np.abs(v), 1e-300))
        dS[:, : len(self.names)] = 0.0
        gradient = (counts * v / S) @ dv + (0.5 * (1.0 - counts * v * v / S) / S) @ dS + x
        information = (dv * (counts / S)[:, None]).T @ dv
        information += 0.5 * (dS * (counts / S**2)[:, None]).T @ dS + np.eye(len(x))
        ends = np.cumsum([len(f.innovation) for f in here])[:-1]
        off, known = counts * v / np.sqrt(S), dv[:, : len(self.names)] / np.sqrt(S)[:, None]
        scores = [
            DiveScore(z @ d, (d * share[:, None]).T @ d)
            for z, d, share in zip(*(np.split(a, ends) for a in (off, known, counts)), strict=True)
        ]
        none = np.zeros((len(self.names), len(self.names)))
        return _Slopes(here, S, gradient, information, starts, scores, none)


def _searched(
    problem: _Problem, advance: Advance, begin: Array | None = None
) -> tuple[Array, _Slopes]:
    """Return the x of least cost that is found, and the likelihood there along the parameters.

    There are many valleys, and the search goes through several: that into which it leads from the
    priors, those into which it leads from there, and that of `begin`. Others that are hardly less
    probable than the best widen its covariance: `_Slopes.valleys`.
    """
    known = np.arange(len(problem.names))
    first = _settled(problem, _led(problem, np.zeros(len(known) + len(NOISES)), _BLURS))
    found = [(problem.cost(first), first)]
    advance(0.5)
    for _ in range(_AGAIN):
        cost, x = found[-1]
        enough = min(cost for cost, _ in found) + _FAR
        other = _settled(problem, _led(problem, x, _MILD), enough)
        found.append((problem.cost(other), other))
        if not found[-1][0] < cost - _SETTLED:
            break
    if begin is not None:
        other = _settled(problem, begin)
        found.append((problem.cost(other), other))
    advance(0.5)
    cost, x = min(found, key=lambda one: one[0])
    slopes = problem.slopes(x, known)
    for _ in range(_AXES):
        slopes = problem.slopes(x, known, slopes.information)
    share = np.exp([cost - one for one, _ in found])
    off = np.stack([other[known] - x[known] for _, other in found])
    return x, slopes._replace(valleys=(off.T * (share / share.sum())) @ off)


def _led(problem: _Problem, x: Array, blurs: Mapping[float, float]) -> Array:
    """Return where x leads while pressures are noisier by `blurs` [Pa], each with its stride.

    The parameters are then those of the whole way of a dive rather than of each step of it.
    """
    known = np.arange(len(problem.names))
    for blur, stride in blurs.items():
        x = _best(replace(problem, blur=blur, gate=_OPEN), x, known, stride)
    x = x.copy()
    x[len(known)] = math.log(blur / NOISES.pressure) / FACTOR.pressure  # as noisy as it was last
    return x


def _settled(problem: _Problem, x: Array, enough: float = math.inf) -> Array:
    """Return the x of least cost near one, noises and parameters in turn.

    enough: cost above which it is not sought to the last.
    """
    count, cost = len(problem.names), math.inf
    known, noises = np.arange(count), np.arange(count, len(x))
    for stride in (*_STRIDES, *(_WHITE,) * _ROUNDS):
        x = _best(problem, _best(problem, x, noises, stride), known, stride)
        before, cost = cost, problem.cost(x)
        if stride == _WHITE and (before - cost < _SETTLED or cost > enough):
            break
    return x


def _alone(problem: _Problem, advance: Advance, part: float, begin: Array) -> Single:
    """Return the estimates from one dive alone; `part` of the work; begin: what fits all."""
    x, found = _searched(problem, lambda share: advance(part * share), begin)
    size, axes = np.linalg.eigh(np.linalg.inv(found.covariance()) - np.eye(len(problem.names)))
    return Single(x[: len(problem.names)], (axes * np.maximum(size, 0.0)) @ axes.T)


def _best(problem: _Problem, x: Array, free: Index, stride: float) -> Array:
    """Return the x of least cost along the places `free`, by damped scoring.

    Parameters are chosen for the innovations alone, whose variances are held in each step: the size
    of the noise has no information on them.
    """
    held = bool((free < len(problem.names)).all())
    damping, information = 1e-3, None
    for _ in range(_MOST):
        found = problem.slopes(x, free, information, stride)
        information = found.information
        variance = found.variance if held else None
        cost = problem.cost(x, variance)
        at = np.ix_(free, free)
        hold = np.diag(np.diag(found.information[at]))
        while True:
            step = np.linalg.solve(found.information[at] + damping * hold, found.gradient[free])
            ahead = x.copy()
            ahead[free] -= np.clip(step, -3.0, 3.0)
            less = cost - problem.cost(ahead, variance)
            if less > 0.0 or damping > 1e6:
                break
            damping *= 10.0
        if less <= 0.0:
            break
        x, damping = ahead, max(damping / 10.0, 1e-6)
        if less < _NEAR:
            break
    return x
