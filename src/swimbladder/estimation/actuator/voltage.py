"""K1, T1, dead zone, asymmetry and rate from voltage steps: output error, maximum likelihood.

What is made small is measured less simulated position, the simulation being exact
(`model.respond`). Each block has its own unknown start and a gain of its own about the common one,
by as much as may be after seeing the log (`gains`); the residual is an autoregression. Gross
outliers are left out. The standard deviations are those of the whitened problem, the interval of T1
comes from its profile likelihood, and what the sensitivities cannot distinguish is not
identifiable.

A fit gives its values, their covariance, and what is not identifiable.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.actuator.blocks import Block, cut
from swimbladder.estimation.actuator.estimate import FINEST, Spread, gains, slope
from swimbladder.estimation.actuator.initial_guess import (
    first_guess,
    guess_from,
    robustly,
    speeds,
    tolerance,
)
from swimbladder.estimation.actuator.model import Problem
from swimbladder.estimation.actuator.noise import autoregression, scale, spikes
from swimbladder.estimation.series import WHITE, Autoregression

Array = NDArray[np.float64]
_OUTLIER = 10.0  # deviance that leaving a sample out costs


@dataclass(frozen=True, kw_only=True)
class VoltageFit:
    """The fit at its best.

    q: free parameters as they are turned; covariance: of q; known, blind: directions of q that are
    identifiable and not, in columns; spread: what is known of how the gains of the blocks differ.
    residual: measured less fitted of every sample in a block [m], its start taken off.
    """

    problem: Problem
    q: Array
    covariance: Array
    known: Array
    blind: Array
    sigma: float  # m, of the innovations
    spread: Spread
    residual: Array

    @property
    def values(self) -> dict[str, float]:
        """All parameters in SI."""
        return self.problem.values(self.q)

    def spread_along(self, direction: Array) -> tuple[float, float]:
        """Return standard deviation and half the 95 % interval along a direction of q."""
        std = math.sqrt(max(float(direction @ self.covariance @ direction), 0.0))
        if not self.known.size or std == 0.0:
            return std, 1.96 * std
        return std, self.spread.reach(self.spread.variances(self.known, direction))

    @property
    def widened(self) -> float:
        """By how much gains that may differ widen the interval of the gain: 1, not at all."""
        if "K1" not in self.problem.free or not self.known.size:
            return 1.0
        K1 = np.array([float(name == "K1") for name in self.problem.free])
        variances = self.spread.variances(self.known, K1)
        return self.spread.reach(variances) / (1.96 * math.sqrt(max(float(variances[0]), 1e-300)))

    @property
    def repeats(self) -> int:
        """How many steps there are beyond those that the gains need."""
        gains = sum(name != "T1" for name in self.problem.free)
        return int((self.problem.whiten.size > 0.0).sum()) - gains if self.problem.whiten else 0

    @property
    def deviance(self) -> float:
        """Minus twice the logarithm of the likelihood, but for a constant."""
        problem, whiten = self.problem, self.problem.whiten
        assert whiten is not None
        n = int(problem.used.sum())
        lost = float(np.sum(problem.white(self.q) ** 2))
        return (
            n * math.log(max(lost / n, 1e-300))
            - 2.0 * float(np.log(whiten.keep).sum())
            - 2.0 * float(np.log(whiten.matrix.diagonal()).sum())
            + int((~problem.used & ~problem.early).sum()) * _OUTLIER
        )

    @property
    def noise(self) -> float:
        """Standard deviation of the residuals, outliers aside [m]."""
        return float(self.residual[self.problem.used].std())


def named(fit: VoltageFit) -> tuple[str, ...]:
    """Return the free parameters that no blind direction touches."""
    if not fit.blind.size:
        return fit.problem.free
    touched = (fit.blind**2).max(axis=1) > 0.02
    return tuple(n for n, hit in zip(fit.problem.free, touched.tolist(), strict=True) if not hit)


_ROUNDS = 4
_FAR = 6.0  # robust standard deviations of all residuals beyond which a sample is an outlier
_LIMIT_SEEN = 6.63  # deviance that a rate limit has to gain: 1 % by chance
_VAGUE, _VAGUE_T1 = 0.15, 0.5  # standard deviations of what is turned without information
_SETTLED = 6.0  # T1 after which nobody knows how a run began
_CLEARLY = 20.0  # squares of sigma by which a start at rest has to be better
_LEVEL = 0.6  # of the steepest gain: the speeds level off


def fit_voltage(benches: Sequence[Bench], fixed: Mapping[str, float]) -> VoltageFit:
    """Return the fit to the voltage steps of all benches.

    fixed: values in SI of what is not fitted. Raises NoAnswerError where there are no steps.
    """
    blocks = [block for log, bench in enumerate(benches) for block in cut(bench, log)]
    names = ("K1", "T1", "dead_zone", "load_voltage", "asymmetry")
    free = tuple(name for name in names if name not in fixed)
    guess = first_guess(benches, free)
    one_way = _one_way(benches, blocks, guess)
    held = {"asymmetry": 1.0, "load_voltage": 0.0} if one_way else {}
    fixed = {**held, **fixed}
    free = tuple(name for name in free if name not in fixed)
    problem = Problem(benches, blocks, free, fixed, _driven_at_once(benches, guess))
    q = robustly(problem, {**guess, **fixed})
    if any(problem.moving.values()):
        _at_rest(problem, q)
        q = robustly(problem, {**problem.values(q), **fixed})
    fit = _refine(problem, q)
    limited = None if "rate" in fixed else _with_limit(fit)
    return fit if limited is None else limited


def _one_way(benches: Sequence[Bench], blocks: Sequence[Block], guess: Mapping[str, float]) -> bool:
    """Return whether the voltages that move the actuator all have one sign."""
    signs = set()
    for block in blocks:
        u = benches[block.log].voltage
        assert u is not None
        over = u[block.samples] - guess["load_voltage"]
        moved = np.abs(over) > guess["dead_zone"] * 1.02
        signs |= set(np.sign(over[moved]).tolist())
    return len(signs - {0.0}) < 2


def _driven_at_once(
    benches: Sequence[Bench], guess: Mapping[str, float]
) -> dict[tuple[int, int], bool]:
    """Return for each run whether it begins under a voltage that moves the actuator."""
    found = {}
    for log, bench in enumerate(benches):
        assert bench.voltage is not None
        for run, (first, _) in enumerate(bench.runs):
            over = abs(float(bench.voltage[first]) - guess["load_voltage"])
            found[(log, run)] = over > guess["dead_zone"] + 0.02 * float(
                np.abs(bench.voltage).max()
            )
    return found


def _at_rest(problem: Problem, q: Array) -> None:
    """Say of the runs that begin under a voltage which begin at rest all the same.

    It has to be far more likely than that the motion was steady: else their start is left out.
    """
    size = max(scale(problem.by_median(problem.residual(q))), tolerance(problem.benches))
    for place in [place for place, moving in problem.moving.items() if moving]:
        own = [k for k, b in enumerate(problem.blocks) if (b.log, b.run) == place]
        first = problem.block == (own[0] if own else -1)

        def loss(first: NDArray[np.bool_] = first) -> float:
            off = problem.by_median(problem.residual(q))[first] / size
            return float(np.sum(np.minimum(off**2, 25.0)))

        steady = loss()
        problem.moving[place] = False
        problem.moving[place] = loss() > steady - _CLEARLY


def _refine(problem: Problem, q: Array) -> VoltageFit:
    """Return the fit with outliers left out, and noise and differing gains as they show."""
    noise = WHITE
    for round_ in range(_ROUNDS):
        _leave_out(problem, q)
        if round_ > 0:
            left, used = problem.centred(problem.residual(q)), problem.used
            left = problem.without_own_gains(q, left)
            ends = np.flatnonzero(np.diff(problem.block[used])) + 1
            noise = autoregression(np.split(left[used], ends))
        spread = _whiten(problem, q, noise)
        before, q = q, solve(problem, q)
        if round_ > 1 and np.abs(q - before).max(initial=0.0) < 1e-5:
            break
    jacobian, residual = slope(problem, q), problem.white(q)
    lost = len(q) + len(np.unique(problem.block[problem.used]))
    sigma = math.sqrt(float(residual @ residual) / max(len(residual) - lost, 1))
    sigma = max(sigma, FINEST * tolerance(problem.benches))
    covariance, known, blind = _covariance(jacobian, sigma, problem.free)
    return VoltageFit(
        problem=problem,
        q=q,
        covariance=covariance,
        known=known,
        blind=blind,
        sigma=sigma,
        spread=spread,
        residual=problem.centred(problem.residual(q)),
    )


def _whiten(problem: Problem, q: Array, noise: Autoregression) -> Spread:
    """Choose the whitener of a noise, and of gains that differ as far as can be known."""
    problem.whitened_with(q, noise, 0.0, 0.0)
    spread = gains(problem, q)
    sigma = float(spread.sigmas @ spread.weights)
    problem.whitened_with(q, noise, spread.typical, sigma)
    return spread


def solve(problem: Problem, q: Array) -> Array:
    """Return the free parameters, as they are turned, that make the whitened residuals small."""
    from scipy.optimize import least_squares

    size = max(tolerance(problem.benches), 1e-12)
    bounds = problem.bounds()

    def residual(x: Array) -> Array:
        return problem.white(x) / size

    def jacobian(x: Array) -> Array:
        return slope(problem, x) / size

    found = least_squares(
        residual, np.clip(q, *bounds), jacobian,
        bounds=bounds, xtol=1e-8, ftol=1e-9, gtol=1e-9, max_nfev=40,
    )  # fmt: skip
    return np.asarray(found.x, float)


def _leave_out(problem: Problem, q: Array) -> None:
    """Mark the samples that are no outliers."""
    residual = problem.by_median(problem.residual(q))
    size = scale(residual)
    for k, block in enumerate(problem.blocks):
        bench, own = problem.benches[block.log], problem.block == k
        least = bench.quantum + 1e-9 * float(np.ptp(bench.position))
        far = np.abs(residual[own]) > max(_FAR * size, least)
        problem.used[own] = ~(spikes(residual[own], least) | far)
        if problem.moving[(block.log, block.run)]:
            time = bench.time[block.samples] - bench.time[bench.runs[block.run][0]]
            problem.early[own] = time <= _SETTLED * problem.values(q)["T1"]
            problem.used[own] &= ~problem.early[own]


def _covariance(jacobian: Array, sigma: float, free: Sequence[str]) -> tuple[Array, Array, Array]:
    """Return the covariance, and the directions that are identifiable and not, in columns.

    A direction is not identifiable where its standard deviation exceeds a seventh of what is
    turned, or for the time constant a half: there the quadratic picture ends.
    """
    limit = np.array([_VAGUE_T1 if name == "T1" else _VAGUE for name in free])
    _, singular, directions = np.linalg.svd(jacobian * limit, full_matrices=False)
    with np.errstate(divide="ignore"):
        std = np.where(singular > 1e-12 * singular[0], sigma / singular, np.inf)
    known = std < 1.0
    kept = directions[known] * std[known, None] * limit
    return kept.T @ kept, (directions[known] * limit).T, directions[~known].T


def _with_limit(fit: VoltageFit) -> VoltageFit | None:
    """Return the fit with a limit of the speed, where the speeds suggest one and it is better."""
    problem = fit.problem
    rows = np.concatenate([speeds(b) for b in problem.benches])
    top = _levels_off(rows, problem.top)
    if top is None:
        return None
    slower = rows[np.abs(rows[:, 1]) < 0.95 * top]
    guess = {**guess_from(slower, problem.top, problem.free), **problem.fixed, "rate": top}
    limited = problem.changed((*problem.free, "rate"), problem.fixed)
    limited.used[:], limited.early[:] = True, False
    found = _refine(limited, robustly(limited, guess))
    return found if found.deviance < fit.deviance - _LIMIT_SEEN else None


def _levels_off(rows: Array, top: float) -> float | None:
    """Return the largest speed [m/s] where the speeds level off towards the largest voltages."""
    for sign in (1.0, -1.0):
        u, v = sign * rows[:, 0], sign * rows[:, 1]
        sizes = np.rint(20.0 * u / top)
        own = [s for s in np.unique(sizes).tolist() if s > 0.0 and np.median(v[sizes == s]) > 0.0]
        if len(own) < 3:
            continue
        x = np.array([np.median(u[sizes == s]) for s in own])
        y = np.array([np.median(v[sizes == s]) for s in own])
        slopes = np.diff(y) / np.diff(x)
        if slopes[-1] < _LEVEL * slopes[:-1].max():
            return float(y.max())
    return None
