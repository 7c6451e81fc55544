"""K1, T1, dead zone, asymmetry and rate from voltage steps: output error, maximum likelihood.

What is made small is measured less simulated position, the simulation being exact (`response`).
Each block has its own unknown start and, as far as the log shows such differences, a gain of its
own about the common one; what is left over is an autoregression. Gross outliers are left out. The
standard deviations are those of the whitened problem, the interval of T1 comes from its profile
likelihood, and what the sensitivities cannot tell apart is not told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.identify_actuator.begin import first_guess, robustly, tolerance
from swimbladder.identify_actuator.bench import Bench
from swimbladder.identify_actuator.blocks import Block, cut
from swimbladder.identify_actuator.model import Problem
from swimbladder.identify_actuator.noise import WHITE, autoregression, scale, spikes

__all__ = ["VoltageFit", "fit_voltage", "named", "solve"]

Array = NDArray[np.float64]

_ROUNDS = 4
_FAR = 6.0  # robust standard deviations of all residuals beyond which a sample is an outlier
_LIMIT_SEEN = 6.63  # deviance that a rate limit has to gain: 1 % by chance
_DIFFER = 2.71  # deviance that differing gains have to gain: 5 % by chance


@dataclass(frozen=True, kw_only=True)
class VoltageFit:
    """The fit at its best.

    q: free parameters as they are turned; covariance: of q; blind: directions of q that the logs
    do not tell, in columns; spread: of the gains of the blocks, a share; df: for the gains.
    residual: measured less fitted of every sample in a block [m], its start taken off.
    """

    problem: Problem
    q: Array
    covariance: Array
    blind: Array
    sigma: float  # m, of the innovations
    spread: float
    df: float
    residual: Array

    @property
    def values(self) -> dict[str, float]:
        """All parameters in SI."""
        return self.problem.values(self.q)

    @property
    def noise(self) -> float:
        """Standard deviation of what is left over, outliers aside [m]."""
        return float(self.residual[self.problem.used].std())


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
    moving = _moving(benches, guess)
    problem = Problem(benches, blocks, free, fixed, moving)
    q = robustly(problem, {**guess, **fixed})
    fit = _refine(problem, q)
    if "rate" in fixed:
        return fit
    limited = _with_limit(fit)
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


def _moving(benches: Sequence[Bench], guess: Mapping[str, float]) -> dict[tuple[int, int], bool]:
    """Return for each run whether it begins in steady motion, rather than at rest."""
    found = {}
    for log, bench in enumerate(benches):
        assert bench.voltage is not None
        for run, (first, after) in enumerate(bench.runs):
            early = slice(first, min(first + 4, after))
            x, t, u = bench.position[early], bench.time[early], bench.voltage[first]
            over = max(abs(u - guess["load_voltage"]) - guess["dead_zone"], 0.0)
            steady = guess["K1"] * over * float(t[-1] - t[0])
            least = 3.0 * math.hypot(bench.noise, bench.quantum)
            found[(log, run)] = abs(float(x[-1] - x[0])) > max(0.7 * steady, least) and steady > 0.0
    return found


def _refine(problem: Problem, q: Array) -> VoltageFit:
    """Return the fit with outliers left out, and noise and differing gains as they show."""
    sigma = spread = 0.0
    df = math.inf
    for round_ in range(_ROUNDS):
        _leave_out(problem, q)
        problem.whitened_with(q, WHITE, 0.0, 0.0)
        if round_ > 0:
            left, used = problem.centred(problem.residual(q)), problem.used
            ends = np.flatnonzero(np.diff(problem.block[used])) + 1
            noise = autoregression(np.split(left[used], ends))
            problem.whitened_with(q, noise, 0.0, 0.0)
            spread, sigma, df = _gains(problem, q)
            problem.whitened_with(q, noise, spread, sigma)
        before, q = q, solve(problem, q)
        if round_ > 1 and np.abs(q - before).max(initial=0.0) < 1e-5:
            break
    jacobian, residual = _slope(problem, q), problem.white(q)
    lost = len(q) + len(np.unique(problem.block[problem.used]))
    sigma = math.sqrt(float(residual @ residual) / max(len(residual) - lost, 1))
    sigma = max(sigma, 1e-6 * tolerance(problem.benches))
    covariance, blind = _covariance(jacobian, sigma)
    return VoltageFit(
        problem=problem,
        q=q,
        covariance=covariance,
        blind=blind,
        sigma=sigma,
        spread=spread,
        df=df,
        residual=problem.centred(problem.residual(q)),
    )


def solve(problem: Problem, q: Array) -> Array:
    """Return the free parameters, as they are turned, that make the whitened residuals small."""
    from scipy.optimize import least_squares

    size = max(tolerance(problem.benches), 1e-12)
    bounds = problem.bounds()

    def residual(x: Array) -> Array:
        return problem.white(x) / size

    def slope(x: Array) -> Array:
        return _slope(problem, x) / size

    found = least_squares(
        residual, np.clip(q, *bounds), slope,
        bounds=bounds, xtol=1e-8, ftol=1e-9, gtol=1e-9, max_nfev=40,
    )  # fmt: skip
    return np.asarray(found.x, float)


def _slope(problem: Problem, q: Array) -> Array:
    """Return the derivative of the whitened residuals [n, p], by central differences."""
    columns = []
    for k in range(len(q)):
        h = np.zeros(len(q))
        h[k] = 1e-5
        columns.append((problem.white(q + h) - problem.white(q - h)) / 2e-5)
    return np.stack(columns, axis=1)


def _leave_out(problem: Problem, q: Array) -> None:
    """Mark the samples that are no outliers."""
    residual = problem.by_median(problem.residual(q))
    size = scale(residual)
    for k, block in enumerate(problem.blocks):
        bench, own = problem.benches[block.log], problem.block == k
        least = bench.quantum + 1e-9 * float(np.ptp(bench.position))
        far = np.abs(residual[own]) > max(_FAR * size, least)
        problem.used[own] = ~(spikes(residual[own], least) | far)


def _gains(problem: Problem, q: Array) -> tuple[float, float, float]:
    """Return how much the gains of blocks differ (a share), sigma [m], and degrees of freedom.

    By restricted maximum likelihood of the problem made linear at q: the variance along each
    block's own gain is 1 + (spread size/sigma)^2 times that of the noise.
    """
    from scipy.optimize import minimize_scalar

    J, r, whiten = _slope(problem, q), problem.white(q), problem.whiten
    assert whiten is not None
    size, a = whiten.size, whiten.along(whiten.gain, r)
    A = np.stack([whiten.along(whiten.gain, column) for column in J.T], axis=1)
    p, count = len(q), len(size)
    gain_like = sum(
        name in ("K1", "asymmetry", "dead_zone", "load_voltage") for name in problem.free
    )
    free = int((size > 0.0).sum()) - gain_like
    JJ, Jr, rr = J.T @ J, J.T @ r, float(r @ r)
    lost = max(len(r) - p - count, 1)
    plain = math.sqrt(rr / lost)
    if free < 1 or rr <= 0.0:
        return 0.0, plain, math.inf

    def parts(ratio: float) -> tuple[float, float, Array]:
        less = 1.0 - 1.0 / (1.0 + (ratio * size) ** 2)
        H = JJ - (A.T * less) @ A + 1e-12 * np.diag(np.diag(JJ))
        b = Jr - A.T @ (less * a)
        left = rr - float(less @ a**2) - float(b @ np.linalg.solve(H, b))
        return max(left, 1e-300), float(-np.log1p(-less).sum()), H

    def score(log_ratio: float) -> float:
        left, spread_out, H = parts(math.exp(log_ratio))
        return lost * math.log(left) + spread_out + float(np.linalg.slogdet(H)[1])

    typical = float(np.median(size[size > 0.0]))
    low, high = math.log(1e-3 / typical), math.log(1e4 / typical)
    grid = np.linspace(low, high, 30)
    scores = [score(x) for x in grid.tolist()]
    k = int(np.argmin(scores))
    found = minimize_scalar(
        score, bounds=(grid[max(k - 1, 0)], grid[min(k + 1, 29)]), method="bounded"
    )
    if found.fun > score(low) - _DIFFER:
        return 0.0, plain, math.inf
    ratio = math.exp(float(found.x))
    left, _, H = parts(ratio)
    sigma = math.sqrt(left / lost)
    first = problem.free.index("K1") if "K1" in problem.free else 0
    alone = np.linalg.pinv(JJ)[first, first]
    share = 1.0 - min(alone / max(np.linalg.pinv(H)[first, first], 1e-300), 1.0)
    return ratio * sigma, sigma, free / share**2 if share > 1e-6 else math.inf


def _covariance(jacobian: Array, sigma: float) -> tuple[Array, Array]:
    """Return the covariance of what is told, and the directions that are not, in columns.

    A direction is not told where its standard deviation exceeds a half: of a logarithm, or of the
    largest voltage.
    """
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    with np.errstate(divide="ignore"):
        std = np.where(singular > 1e-12 * singular[0], sigma / singular, np.inf)
    told = std < 0.5
    kept = directions[told] * std[told, None]
    return kept.T @ kept, directions[~told].T


def _with_limit(fit: VoltageFit) -> VoltageFit | None:
    """Return the fit with a limit of the speed, where that is clearly better."""
    problem, values = fit.problem, fit.values
    top = problem.top - abs(values["load_voltage"]) - values["dead_zone"]
    fastest = values["K1"] * max(top, 0.0)
    if fastest <= 0.0 or fit.blind.size or _sizes(problem) < 3:
        return None
    base = float(np.sum(problem.white(fit.q) ** 2)) / fit.sigma**2
    best = None
    for share in (0.95, 0.7):
        limited = problem.changed((*problem.free, "rate"), problem.fixed)
        begun = limited.turned({**values, "rate": share * fastest})
        q = solve(limited, begun)
        gained = base - float(np.sum(limited.white(q) ** 2)) / fit.sigma**2
        if best is None or gained > best[0]:
            best = (gained, limited, q)
    assert best is not None
    if best[0] < _LIMIT_SEEN:
        return None
    found = _refine(best[1], best[2])
    return None if found.blind.size else found


def _sizes(problem: Problem) -> int:
    """Return how many sizes of voltage there are, to a twentieth of the largest."""
    u = np.concatenate([b.voltage for b in problem.benches if b.voltage is not None])
    return len(np.unique(np.rint(20.0 * np.abs(u) / problem.top))) - 1


def named(fit: VoltageFit) -> tuple[str, ...]:
    """Return the free parameters that no blind direction touches."""
    if not fit.blind.size:
        return fit.problem.free
    touched = (fit.blind**2).max(axis=1) > 0.02
    return tuple(n for n, hit in zip(fit.problem.free, touched.tolist(), strict=True) if not hit)
