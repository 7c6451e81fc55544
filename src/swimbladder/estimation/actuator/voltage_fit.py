"""The fit to voltage steps: its values, their covariance, and what is not identifiable."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.gain_spread import Spread
from swimbladder.estimation.actuator.model import Problem

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
