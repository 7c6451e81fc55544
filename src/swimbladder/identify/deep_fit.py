"""Parameters of a deep vehicle from dives: a robust fit of speeds, with an honest covariance.

What is fitted is the speed between two looks, since that is where the error is: the water itself
moves by some mm/s (internal waves), for tens of minutes at a time. Residuals are therefore not
independent, and the covariance is that of blocks of `BLOCK` (a cluster-robust "sandwich"; Cameron
and Miller, J. Human Resources 50, 2015, 317), which the tests hold against simulated dives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from swimbladder.errors import InputError
from swimbladder.identify.deep_dive import DeepDive
from swimbladder.identify.deep_model import (
    Body,
    check_deep_names,
    drag_volume,
    excess,
    steady_speed,
)
from swimbladder.identify.estimates import Prior

__all__ = ["DeepFit", "balance", "fit_deep", "start_volume"]

Array = NDArray[np.float64]
Misfit = Callable[[Array], list[Array]]

BLOCK = 3600.0  # s, of speeds that may be off together
_VOLUME = 1e-5  # m3, in which the volumes at the beginning are counted
_LEAST_NOISE = 5e-4  # m/s; below it the resolution of the pressure counts
# m/s: noise that is reckoned with first, so that what is known before leads into the right valley.
_COOLING = (0.1, 0.03)
_ROUNDS = 3  # of fit and noise; the noise settles to a percent
_TOLD = 0.8  # of the prior's deviation: a parameter that the data narrow less is from its prior


@dataclass(frozen=True, kw_only=True)
class DeepFit:
    """What fits: values by name, the drive's volume at the beginning of each dive, covariance.

    covariance: of `names` and, after them, of `starts`, in SI. noise [m/s]: of a speed.
    """

    names: tuple[str, ...]
    values: Mapping[str, float]
    starts: Array  # m3 [dives]
    covariance: Array
    noise: float
    priors: Mapping[str, Prior]
    residuals: tuple[Array, ...]  # m/s, measured less modelled speed, of each dive

    def std(self, name: str) -> float:
        """Return the standard deviation of a parameter, 0 where it was set."""
        if name not in self.names:
            return 0.0
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    def told(self, name: str) -> bool:
        """Whether the data narrow what was known of a parameter before."""
        return name in self.names and self.std(name) < _TOLD * self.priors[name].std


def balance(body: Body, values: Mapping[str, float], start: float, dive: DeepDive) -> Array:
    """Return what the book of volumes is off by, E less what drag carries [m3] [n]."""
    p = dive.pieces
    heavy = excess(body, values, start, p)
    return heavy - drag_volume(values, p.speed, p.density, dive.gravity)


def start_volume(
    body: Body, values: Mapping[str, float], dive: DeepDive, until: float = np.inf
) -> float:
    """Return the drive's volume at the beginning that closes a dive's book, by the median [m3].

    until [s]: what comes later than this after the beginning is not looked at.
    """
    early = dive.pieces.elapsed <= until
    if not early.any():
        early = dive.pieces.elapsed <= float(dive.pieces.elapsed[0])
    return float(np.median(balance(body, values, 0.0, dive)[early]))


def fit_deep(
    body: Body, dives: Sequence[DeepDive], priors: Mapping[str, Prior], *,
    free: Sequence[str], fixed: Mapping[str, float] | None = None,
) -> DeepFit:  # fmt: skip
    """Return the parameters `free` and each dive's start; the rest are `fixed` or as their priors.

    Raises InputError for a name that is not one, or none that is free.
    """
    check_deep_names(free, "--free")
    check_deep_names(list(fixed or {}), "--set")
    names = tuple(name for name in free if name not in (fixed or {}))
    if not names:
        raise InputError(
            "nothing is left to identify", field="--free", remedy="Leave one parameter free"
        )
    held = {name: prior.mean for name, prior in priors.items()} | dict(fixed or {})
    scale = np.array([priors[name].std for name in names])
    mean = np.array([priors[name].mean for name in names])

    def values_of(x: Array) -> dict[str, float]:
        told = mean + scale * x[: len(names)]
        found = held | dict(zip(names, told.tolist(), strict=True))
        for name in ("drag", "drag_up"):
            found[name] = max(found[name], 1e-3 * abs(priors[name].mean))
        return found

    def misfit(x: Array) -> list[Array]:
        values, starts = values_of(x), x[len(names) :] * _VOLUME
        return [
            dive.pieces.speed
            - steady_speed(
                values, excess(body, values, float(start), dive.pieces), dive.pieces.density,
                dive.gravity,
            )
            for start, dive in zip(starts, dives, strict=True)
        ]  # fmt: skip

    first = values_of(np.zeros(len(names)))
    begins = [start_volume(body, first, dive) / _VOLUME for dive in dives]
    x = np.append(np.zeros(len(names)), begins)
    with threadpool_limits(limits=1):
        for noise in _COOLING:
            x, found = _solve(misfit, x, len(names), noise)
        for _ in range(_ROUNDS):
            x, found = _solve(misfit, x, len(names), found)
    noise = found
    residuals = misfit(x)
    starts = x[len(names) :] * _VOLUME
    per = np.append(scale, np.full(len(dives), _VOLUME))
    covariance = _covariance(misfit, x, len(names), noise, dives) * np.outer(per, per)
    return DeepFit(
        names=names, values=values_of(x), starts=starts, covariance=covariance, noise=noise,
        priors=dict(priors), residuals=tuple(residuals),
    )  # fmt: skip


def _solve(misfit: Misfit, x: Array, count: int, noise: float) -> tuple[Array, float]:
    """Return the best x under a noise, and the noise that its residuals have (robustly)."""

    def together(x: Array) -> Array:
        return np.concatenate([*(r / noise for r in misfit(x)), x[:count]])

    found = least_squares(together, x, loss="soft_l1", x_scale="jac", max_nfev=200)
    speeds = np.concatenate(misfit(found.x))
    return found.x, max(1.4826 * float(np.median(np.abs(speeds))), _LEAST_NOISE)


def _covariance(
    misfit: Misfit, x: Array, count: int, noise: float, dives: Sequence[DeepDive]
) -> Array:
    """Return the cluster-robust covariance of x, blocks of `BLOCK`, priors included."""
    r = np.concatenate(misfit(x)) / noise
    jacobian = np.empty((len(r), len(x)))
    for i in range(len(x)):
        step = 1e-4 * max(abs(x[i]), 1.0)
        up, down = x.copy(), x.copy()
        up[i] += step
        down[i] -= step
        jacobian[:, i] = np.concatenate(misfit(up)) - np.concatenate(misfit(down))
        jacobian[:, i] /= 2.0 * step * noise
    # soft_l1: rho' = (1 + r^2)^-1/2, the weight of a residual.
    weight = 1.0 / np.sqrt(1.0 + r * r)
    bread = jacobian.T @ (weight[:, None] * jacobian)
    prior = np.diag(np.append(np.ones(count), np.zeros(len(x) - count)))
    blocks = np.concatenate(
        [100_000 * k + np.floor(dive.pieces.elapsed / BLOCK) for k, dive in enumerate(dives)]
    )
    _, member = np.unique(blocks, return_inverse=True)
    score = np.zeros((member.max() + 1, len(x)))
    np.add.at(score, member, (weight * r)[:, None] * jacobian)
    n = len(score)
    meat = score.T @ score * (n / max(n - 1.0, 1.0)) + prior
    inverse = np.linalg.pinv(bread + prior)
    return np.asarray(inverse @ meat @ inverse)
