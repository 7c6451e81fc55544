"""The interval of T1 from its profile likelihood: everything else at its best for each T1."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from swimbladder.estimation.actuator.voltage import VoltageFit, solve
from swimbladder.estimation.estimates import Z95, Estimate, bounded, crossing, estimate

_ONE_SIDED = 1.6448536269514722
_FASTEST = 1e-3  # of the time between samples: as good as none
_SLOWEST = 1e3  # times the fitted one: as good as a double integrator


def profile_of_T1(fit: VoltageFit) -> Estimate:
    """Return T1 [s] with the interval in which its deviance stays below that of 95 %.

    Where a T1 of nothing is as likely, an upper bound is returned and no value.
    """
    at = fit.problem.free.index("T1")
    best, std = float(fit.q[at]), math.sqrt(float(fit.covariance[at, at])) or 0.3
    step = min(b.step for b in fit.problem.benches)
    root = _Root(fit, at)
    nothing = root(math.log(_FASTEST * step))
    if nothing < Z95:
        begin = max(best, math.log(_FASTEST * step))
        high = _crossing(root, begin, max(std, 0.3), _ONE_SIDED, offset=nothing)
        bound = math.exp(high)
        why = (
            f"T1 is shorter than samples every {step:.3g} s resolve: below {bound:.3g} s with a "
            "confidence of 95 %"
        )
        return bounded(0.0, bound, "s", why)
    low = _crossing(root, best, -std, Z95)
    high = _crossing(root, best, std, Z95)
    value = math.exp(best)
    found = estimate(value, value * std, "s")
    return replace(found, ci95=(math.exp(low), math.exp(high)))


class _Root:
    """The root of the deviance at a T1, everything else fitted anew."""

    def __init__(self, fit: VoltageFit, at: int) -> None:
        self.fit, self.at = fit, at
        problem = fit.problem
        free = tuple(name for name in problem.free if name != "T1")
        self.others = [k for k in range(len(fit.q)) if k != at]
        self.begun = fit.q[self.others]
        self.problem = problem.changed(free, problem.fixed)
        self.least = float(np.sum(problem.white(fit.q) ** 2))

    def __call__(self, log_T1: float) -> float:
        self.problem.fixed = {**self.fit.problem.fixed, "T1": math.exp(log_T1)}
        q = solve(self.problem, self.begun) if self.others else self.begun
        left = float(np.sum(self.problem.white(q) ** 2))
        return math.sqrt(max(left - self.least, 0.0)) / self.fit.sigma


def _crossing(root: _Root, best: float, std: float, level: float, *, offset: float = 0.0) -> float:
    """Return the ln T1 to one side of the best at which the root of the deviance is `level`.

    offset: the root that is taken as the best one. `std` is a first guess, its sign the side.
    Where the root stays below, the farthest ln T1 that is looked at.
    """
    above = math.hypot(level, offset)
    farthest = math.log(_SLOWEST)
    found = crossing(
        lambda x: root(best + x) - above,
        level * std,
        farthest=farthest,
        growth=1.7,
        xtol=1e-3 * abs(std),
    )
    return best + (math.copysign(farthest, std) if found is None else found)
