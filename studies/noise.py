"""The error of a depth sensor: how it is drawn, and what a sample of it tells of the depth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.special import ndtr

__all__ = ["Noise"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Normal noise of deviation `sigma`, then rounding to `quantum`.

    memory: of a first-order autoregression, from one sample to the next; only without a quantum
    and outliers. outliers: share of samples whose deviation is `outlier_sigma` instead.
    """

    sigma: float  # m
    quantum: float = 0.0  # m
    memory: float = 0.0
    outliers: float = 0.0
    outlier_sigma: float = 0.0  # m

    def __post_init__(self) -> None:
        if self.memory and (self.quantum or self.outliers):
            raise ValueError("memory goes with neither a quantum nor outliers")

    def draw(self, rng: np.random.Generator, depth: Array) -> Array:
        """Return what the sensor says at these depths [m]."""
        wild = rng.random(len(depth)) < self.outliers
        white = rng.normal(size=len(depth)) * np.where(wild, self.outlier_sigma, self.sigma)
        if self.memory:
            fresh = math.sqrt(1.0 - self.memory**2)
            for k in range(1, len(white)):
                white[k] = self.memory * white[k - 1] + fresh * white[k]
        seen = depth + white
        return self.quantum * np.round(seen / self.quantum) if self.quantum else seen

    def information(self, depth: Array, slope: Array) -> Array:
        """Return the Fisher information of parameters, from the depths' slopes (samples x p)."""
        if self.memory:  # whitened, the samples tell as many independent ones
            first = slope[:1] / self.sigma
            rest = slope[1:] - self.memory * slope[:-1]
            white = np.concatenate([first, rest / (self.sigma * math.sqrt(1.0 - self.memory**2))])
            return white.T @ white
        return slope.T @ (slope * self.of_sample(depth)[:, None])

    def of_sample(self, depth: Array) -> Array:
        """Return the information of a sample about its own depth [1/m2]."""
        if not self.quantum:
            return np.full(len(depth), self._unrounded())
        reach = 9.0 * max(self.sigma, self.outlier_sigma)
        cells = np.arange(-math.ceil(reach / self.quantum), math.ceil(reach / self.quantum) + 2)
        # Lower edges of the cells around each depth, and the chance of each cell as it moves.
        edge = (np.round(depth / self.quantum)[:, None] + cells - 0.5) * self.quantum
        at = edge - depth[:, None]
        chance = np.diff(self._mixed(lambda s: ndtr(at / s)), axis=1)
        slope = -np.diff(self._mixed(lambda s: _bell(at, s)), axis=1)
        met = chance > 1e-250
        return np.sum(np.where(met, slope**2 / np.where(met, chance, 1.0), 0.0), axis=1)

    def _mixed(self, of: Callable[[float], Array]) -> Array:
        mixed = (1.0 - self.outliers) * of(self.sigma)
        return mixed + self.outliers * of(self.outlier_sigma) if self.outliers else mixed

    def _unrounded(self) -> float:
        if not self.outliers:
            return self.sigma**-2

        def integrand(x: float) -> float:
            at = np.array([x])
            density = self._mixed(lambda s: _bell(at, s))
            slope = self._mixed(lambda s: -at / s**2 * _bell(at, s))
            return float(slope[0] ** 2 / density[0])

        ends = [6.0 * self.sigma, 12.0 * self.sigma, 9.0 * self.outlier_sigma]
        parts = zip([0.0, *ends], ends, strict=False)
        return 2.0 * sum(quad(integrand, a, b, epsrel=1e-10)[0] for a, b in parts if b > a)


def _bell(at: Array, sigma: float) -> Array:
    return np.exp(-0.5 * (at / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
