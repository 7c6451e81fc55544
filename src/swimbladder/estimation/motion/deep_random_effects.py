"""How far dives of one vehicle differ, and what that leaves of a set that fits them all.

Samples of a dive share its errors of the model, hours and days long, so that their number says
little of the vehicle. Each dive alone has parameters x_d of its own, with information I_d at m_d::

    m_d ~ N(x_d, I_d^-1)     x_d ~ N(x, diag tau^2)     x ~ N(0, 1)     tau ~ half-Cauchy(TYPICAL)

in deviations of the priors: random effects (e.g. Gelman, *Bayesian Analysis* 1, 2006, 515, on tau
of few groups), which never determine x better than so many dives can. x_d and x are integrated
exactly, tau drawn by Gibbs on a grid (Ritter and Tanner, *J. Am. Stat. Assoc.* 87, 1992, 861).

One set x_0 that fits all samples best predicts dives best, and is no estimate of x where dives
differ: it is pulled to where the misfit is small in mL, towards small volumes. Its mean square
error about x is that of the random effects, and the square of how far they lie from it (Hausman,
*Econometrica* 46, 1978, 1251, compares two such estimates).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
                square += np.tensordot(
                    share, covariance + mean[:, :, None] * mean[:, None, :], axes=1
                )
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
    evidence = (
        0.5 * np.einsum("dk,gdk->g", score, spread * says)
        + 0.5 * np.einsum("gk,gk->g", total, mean)
        - 0.5 * np.linalg.slogdet(mixed)[1].sum(axis=1)
        + 0.5 * np.linalg.slogdet(covariance)[1]
    )
    return evidence, mean, covariance


def square_error(found: RandomEffects, value: Array) -> Array:
    """Return the mean square error of a set `value` [k] of parameters [k, k]."""
    off = value - found.value
    return np.asarray(found.covariance + np.outer(off, off))
