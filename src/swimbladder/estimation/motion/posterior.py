"""The full posterior of the vehicle's parameters, by sampling (an optional extra: emcee).

What belongs to single experiments is integrated out at every point by Laplace's method, exactly
where the depths are linear in it, so that the sampler moves in the few dimensions of the vehicle.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.motion.fit import Fit
from swimbladder.estimation.motion.problem import Problem
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.vehicle.plugins import optional

_WALKERS = 24
_BURN = 6  # autocorrelation times that are thrown away
_STEPS = 400
_NEWTON = 3
_LINEAR = 0.05  # of an entry of x: 0.5 mm, 0.5 mm/s, 0.05 cm3


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """Draws [n, p] of the parameters in SI units, in the order of names.

    effective: number of independent draws that they are worth.
    """

    names: tuple[str, ...]
    draws: Array
    effective: float

    def interval(self, name: str) -> tuple[float, float, float]:
        """Return (2.5 % quantile, median, 97.5 % quantile) of a parameter."""
        q = np.quantile(self.draws[:, self.names.index(name)], [0.025, 0.5, 0.975])
        return float(q[0]), float(q[1]), float(q[2])

    def to_dict(self) -> dict[str, Any]:
        """Return median and 95 % interval of each parameter, in SI units."""
        found: dict[str, Any] = {"effective_draws": self.effective}
        for name in self.names:
            low, median, high = self.interval(name)
            found[name] = {"median": median, "ci95": [low, high]}
        return found


def sampling_library() -> Any:
    """Return emcee; raise InputError where it is not installed."""
    return optional("emcee", "posterior", "drawing from the posterior", field="posterior")


def sample(
    problem: Problem,
    fit: Fit,
    seed: int,
    advance: Advance = silent,
    *,
    steps: int = _STEPS,
    walkers: int = _WALKERS,
) -> Posterior:
    """Return draws from the posterior around a fit, its noise and outliers' weights as they are.

    The likelihood is flattened by as much as autocorrelated residuals widen the intervals. steps:
    of each of the walkers. advance: called with the share of the work done since last called.
    Raises InputError where emcee is not installed, NoAnswerError where the sampler does not settle.
    """
    emcee = sampling_library()
    p = problem.shared
    density = _Density(problem, fit)
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(fit.covariance[:p, :p])
    walkers = max(walkers, 2 * p + 2)
    low, high = (bound[:p] for bound in problem.bounds())
    begin = fit.x[:p] + rng.normal(size=(walkers, p)) @ root.T
    begin = np.clip(begin, low + 1e-9, high - 1e-9)
    sampler = emcee.EnsembleSampler(walkers, p, density)
    sampler.random_state = np.random.RandomState(seed).get_state()
    for _ in sampler.sample(begin, iterations=steps):
        advance(1.0 / steps)
    times = sampler.get_autocorr_time(tol=0)
    slowest = float(np.max(times))
    if not math.isfinite(slowest) or steps < _BURN * slowest * 2.0:
        raise NoAnswerError(
            f"The sampler did not settle in {steps} steps: the posterior is far from normal. Give "
            "priors, or hold a parameter (`fixed=`)"
        )
    kept = sampler.get_chain(discard=math.ceil(_BURN * slowest), flat=True)
    draws = np.stack([problem.values_of(i, kept[:, i]) for i in range(p)], axis=1)
    effective = float(len(kept) / max(slowest, 1.0))
    return Posterior(names=problem.names, draws=draws, effective=effective)


class _Density:
    """The logarithm of the posterior density of the vehicle's entries of x."""

    def __init__(self, problem: Problem, fit: Fit) -> None:
        p = problem.shared
        self.problem, self.p, self.root, self.centre = problem, p, fit.root, fit.x
        self.low, self.high = (bound[:p] for bound in problem.bounds())
        naive = np.linalg.inv(fit.information)[:p, :p]
        # how much wider, by and large over the directions of the parameters
        self.flat = p / float(np.trace(np.linalg.solve(naive, fit.covariance[:p, :p])))
        # how what belongs to the experiments follows
        self.ridge = -np.linalg.solve(fit.information[p:, p:], fit.information[p:, :p])

    def __call__(self, u: Array) -> float:
        if (u <= self.low).any() or (u >= self.high).any():
            return -math.inf
        x = self.centre.copy()
        x[: self.p] = u
        x[self.p :] += self.ridge @ (u - self.centre[: self.p])
        for _ in range(_NEWTON):
            own = self.problem.weighted_slope(x, self.root)[:, self.p :]
            r = self.problem.weighted(x, self.root)
            H = own.T @ own
            step = np.linalg.solve(H, own.T @ r)
            x[self.p :] += step
            if np.abs(step).max() < _LINEAR:  # the residuals follow from the derivatives
                break
        left = r - own @ step
        sign, logdet = np.linalg.slogdet(H)
        if sign <= 0.0:
            return -math.inf
        return -0.5 * (self.flat * float(left @ left) + float(logdet))
