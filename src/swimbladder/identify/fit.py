"""The fit itself: the most probable parameters, outliers left aside, and their covariance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from swimbladder.identify.colour import Colour, colours, information
from swimbladder.identify.coordinates import Coordinates
from swimbladder.identify.noise import (
    autoregression,
    cost,
    pooled,
    robust_scale,
    scale,
    weights,
)
from swimbladder.identify.problem import VOLUME, Problem
from swimbladder.identify.start import regression

__all__ = ["Fit", "fit", "refine"]

Array = NDArray[np.float64]

_ROUNDS = 12  # of weights and noise
_TILES = (15.0, 30.0, 60.0, 120.0)  # s
# Of what is left over, against the noise of neighbouring samples:
_CLEAN = 1.0  # there is nothing better to find
_POOR = 3.0  # more starts are tried than a few
_ENOUGH = 2  # starts, where what is left over is no worse than that
_OF_70 = 0.5565  # root mean square of a normal variable of deviation 1 without its largest 30 %
_FINEST = 1e-4  # m, below which no sensor measures


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Where the fit ended: x, and what the data say there."""

    x: Array
    residual: Array  # m, measured less predicted, at the samples used
    weight: Array  # 0 to 1
    noise: Array  # m, of each experiment
    objective: float  # minus twice the logarithm of the posterior, up to a constant
    slope: Array  # [rows, len(x)] m
    colour: tuple[tuple[float, ...], ...]  # autoregression of each experiment's residual
    noise_colour: tuple[Colour, ...]  # the same of the noise, of which the fit has followed a part
    information: Array  # [len(x), len(x)], data and priors, as if the residual were white
    covariance: Array  # [len(x), len(x)], the residual as it is
    data: Array  # [len(x), len(x)], information of the data alone, coloured residuals allowed for


def fit(problem: Problem) -> Fit:
    """Return the best of the fits from the vehicle's own values and from a regression's.

    Where what is left over is above the noise of neighbouring samples, starts from fits to short
    stretches are tried too: over a long one an error of the start grows, and the search strays.
    """
    return _search(problem, _starts(problem), clean=_CLEAN, most=len(_TILES))


def _search(problem: Problem, starts: list[Array], *, clean: float, most: int) -> Fit:
    """Return the best fit from the starts and, until one is clean, from `most` pieced together."""
    costs = [_cost(problem, x) for x in starts]
    best: tuple[float, Array, Array] | None = None
    for k in np.argsort(costs).tolist():
        found = _solve(problem, starts[k])
        if best is None or found[0] < best[0]:
            best = found
        if _excess(problem, best[2]) < clean:
            break
    assert best is not None
    if _excess(problem, best[2]) >= clean:
        for tried, x in enumerate(islice(_others(problem, starts), most), start=1):
            found = _solve(problem, x)
            if found[0] < best[0]:
                best = found
            if _excess(problem, best[2]) < (clean if tried < _ENOUGH else _POOR):
                break
    return finish(problem, best[1])


def refine(problem: Problem, x: Array) -> Fit:
    """Return the fit that is reached from x, or a better one if that is poor."""
    return _search(problem, [x], clean=_POOR, most=1)


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
    if free:
        other[problem.shared : problem.first_start] = errors / VOLUME
        own[problem.shared : problem.first_start] = errors / VOLUME
    return [own, other]


def _others(problem: Problem, starts: list[Array]) -> Iterator[Array]:
    """Yield starts from fits to short stretches, each begun where the one before ended."""
    longest = max(
        float(e.record.time[s.last] - e.record.time[s.first])
        for e in problem.experiments
        for s in e.segments
    )
    shared = starts[-1][: problem.first_start]
    for length in _TILES:
        if length > 0.7 * longest:
            return
        tiled = problem.tiled(length)
        x = tiled.begin()
        x[: problem.first_start] = shared
        x = _solve(tiled, x)[1]
        shared = x[: problem.first_start]
        yield _joined(tiled, x, problem)


def _joined(tiled: Problem, found: Array, problem: Problem) -> Array:
    """Return a start from a fit to short stretches: each long one begins as its first part did."""
    x = problem.begin()
    x[: problem.first_start] = found[: problem.first_start]
    for j, e in enumerate(problem.experiments):
        parts = {s.first: k for k, s in enumerate(tiled.experiments[j].segments)}
        for k, s in enumerate(e.segments):
            at, there = problem.starts_at[j] + 2 * k, tiled.starts_at[j] + 2 * parts[s.first]
            x[at : at + 2] = found[there : there + 2]
    return x


def _cost(problem: Problem, x: Array) -> float:
    return float(np.abs(problem.residual(x)).sum())


def _excess(problem: Problem, noise: Array) -> float:
    """Return what is left over, over the noise that neighbouring samples differ by.

    Of the experiment that is worst; 1 is as much more as chance may make it.
    """
    ratios = []
    for sigma, (first, last) in zip(noise, pairwise(problem.rows), strict=True):
        bend = np.sort(np.abs(np.diff(problem.measured[first:last], 2)))
        kept = bend[: max(1, round(0.7 * len(bend)))]  # hardly a spike among them
        floor = float(np.sqrt(np.mean(kept**2) / 6.0)) / _OF_70
        chance = 1.0 + 5.0 / math.sqrt(len(bend) + 1.0)  # of which both are uncertain
        ratios.append(float(sigma) / max(floor, _FINEST) / chance)
    return max(ratios)


def _each(problem: Problem, values: Array) -> Array:
    """Return an experiment's value at each of its samples."""
    result: Array = np.repeat(values, np.diff(problem.rows))
    return result


def _noise(problem: Problem, residual: Array, weight: Array | None) -> Array:
    found, freedom = [], []
    for j in range(len(problem.experiments)):
        part = slice(problem.rows[j], problem.rows[j + 1])
        own = 1 + 2 * len(problem.experiments[j].segments)
        lost = own + problem.shared / len(problem.experiments)
        if weight is None:
            found.append(robust_scale(residual[part]))
        else:
            found.append(scale(residual[part], weight[part], lost))
            freedom.append(float(weight[part].sum()) - lost)
    return np.array(found) if weight is None else pooled(np.array(found), np.array(freedom))


def _solve(problem: Problem, x: Array) -> tuple[float, Array, Array]:
    """Return (objective, x, noise) at the end of rounds of weights, noise and least squares."""
    low, high = problem.bounds()
    x = np.clip(x, low, high)
    coordinates = Coordinates(problem)
    least, most = coordinates.bounds()
    residual = problem.residual(x)
    noise = _noise(problem, residual, None)
    settled = False
    for n in range(_ROUNDS):
        weight = weights(residual / _each(problem, noise))
        if settled:  # no outlier is near any more: the efficient estimate of the noise
            noise = _noise(problem, residual, weight)
        root = np.sqrt(weight) / _each(problem, noise)

        def rows(y: Array, root: Array = root) -> Array:
            x = coordinates.back(y)
            result: Array = np.concatenate([root * problem.residual(x), problem.prior_rows(x)[0]])
            return result

        def slopes(y: Array, root: Array = root) -> Array:
            x = coordinates.back(y)
            J = np.concatenate([root[:, None] * problem.slope(x), problem.prior_rows(x)[1]])
            return -coordinates.slope(y, J)

        fine = 1e-8 if n > 1 else 1e-4  # the weights are not final yet
        begin = np.clip(coordinates.of(x), least + 1e-9, most - 1e-9)
        done = least_squares(
            rows, begin, slopes, bounds=(least, most), xtol=fine, ftol=fine, gtol=1e-10,
            max_nfev=40 if n == 0 else 12,
        )  # fmt: skip
        before, x = x, np.clip(coordinates.back(done.x), low, high)
        step = float(np.abs(x - before).max())
        residual = problem.residual(x)
        if settled and step < 1e-3:
            break
        settled = settled or step < 0.03
        if not settled:
            noise = _noise(problem, residual, None)
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


def finish(problem: Problem, x: Array) -> Fit:
    """Return everything that is known at x."""
    residual = problem.residual(x)
    noise = _final_noise(problem, residual, _noise(problem, residual, None))
    weight = weights(residual / _each(problem, noise))
    slope = problem.slope(x)
    P = problem.prior_rows(x)[1]
    rows = [slice(a, b) for a, b in pairwise(problem.rows)]
    root = np.sqrt(weight) / _each(problem, noise)
    slopes = [root[part, None] * slope[part] for part in rows]
    A = sum((X.T @ X for X in slopes), np.zeros((len(x), len(x))))
    prior = P.T @ P
    inverse = _inverse(A + prior)
    left = [root[part] * residual[part] for part in rows]
    seen = tuple(autoregression(u) for u in left)
    found = colours(slopes, left, seen, inverse, prior)
    B = information(slopes, found)
    covariance = inverse @ (B + prior) @ inverse
    covariance = 0.5 * (covariance + covariance.T)  # so to the last digit
    return Fit(
        x=x, residual=residual, weight=weight, noise=noise,
        objective=_objective(problem, x, residual, noise), slope=slope,
        colour=seen, noise_colour=found,
        information=A + prior, covariance=covariance, data=A @ _inverse(B) @ A,
    )  # fmt: skip


def _inverse(M: NDArray[np.float64]) -> Array:
    """Return the inverse of a symmetric matrix, through entries of one size each.

    Directions of which nothing is known get a variance that is huge, not infinite.
    """
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    values = np.maximum(values, 1e-13 * max(float(values[-1]), 1e-300))
    result: Array = (vectors / values) @ vectors.T / np.outer(size, size)
    return result
