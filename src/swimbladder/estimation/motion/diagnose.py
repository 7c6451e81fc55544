"""What the residuals say against the model, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, linregress

from swimbladder.estimation.estimates import Estimate, Finding, estimate
from swimbladder.estimation.motion.fit import Fit
from swimbladder.estimation.motion.initial_guess import backwards
from swimbladder.estimation.motion.problem import VOLUME, Problem
from swimbladder.estimation.motion.result import ExperimentFit

Array = NDArray[np.float64]

_SURE = 3.0  # standard deviations
_GRAVITY = 9.80665  # m/s2; to within a percent everywhere
_LIGHTEST, _HEAVIEST = 0.9, 4.0  # of the water displaced
_NONE = (0.25, 10.0)  # of it: only other units make a vehicle so light or so heavy
_FOLLOWED = 0.05  # of the depths' deviation: the residual where the model follows
_MANY = 0.02  # share of the samples


def drift(problem: Problem, fit: Fit, j: int) -> Estimate:
    """Return how fast experiment j's neutral volume drifts [m3/s], all else as fitted.

    One step of the fit with the drift as one parameter more, from the residuals' score.
    """
    part = slice(problem.rows[j], problem.rows[j + 1])
    weight = fit.weight[part] / fit.noise[j] ** 2
    s = problem.drift_slope(fit.x, j)
    J = fit.slope[part]
    used = np.flatnonzero(np.abs(J).max(axis=0) > 0.0)
    own = used[used >= problem.shared]  # what belongs to the experiment absorbs part of a drift
    P = problem.prior_rows(fit.x)[1][:, own]
    A = (J[:, own] * weight[:, None]).T @ J[:, own] + P.T @ P
    b = (J[:, own] * weight[:, None]).T @ s
    clean = s - J[:, own] @ np.linalg.lstsq(A, b, rcond=1e-12)[0]
    information = float((weight * clean * s).sum())
    if information <= 0.0:
        return estimate(0.0, math.inf, "m3/s")
    inflation = _inflation(fit.ar[j])
    value = float((weight * clean * fit.residual[part]).sum()) / information
    return estimate(value, math.sqrt(inflation / information), "m3/s")


def single_gains(problem: Problem, fit: Fit) -> list[tuple[float, float, float]]:
    """Return (volume step [m3], logarithm of its own gain over the joint one, std) by experiment.

    One step of a fit of each experiment by itself, all but psi its own, from its residuals. The
    gain is K2; for a quadratic drag the inverse of the drag.
    """
    name = "K2" if "K2" in problem.names else "drag_quadratic"
    if name not in problem.names:
        return []
    i = problem.names.index(name)
    per = 1.0 if problem.logarithmic[i] else problem.scale[i] / max(problem.value(fit.x, i), 1e-300)
    sign = 1.0 if name == "K2" else -1.0
    P = problem.prior_rows(fit.x)[1][len(problem.priors) :]
    found = []
    for j, e in enumerate(problem.experiments):
        part = slice(problem.rows[j], problem.rows[j + 1])
        J, weight = fit.slope[part], fit.weight[part] / fit.noise[j] ** 2
        used = np.flatnonzero(np.abs(J).max(axis=0) > 0.0)
        mine = [k for k in used.tolist() if k >= problem.shared or problem.names[k] != "psi"]
        A = (J[:, mine] * weight[:, None]).T @ J[:, mine] + P[:, mine].T @ P[:, mine]
        size = np.sqrt(np.diag(A))
        inverse = np.linalg.pinv(A / np.outer(size, size), rcond=1e-12) / np.outer(size, size)
        step = inverse @ (J[:, mine].T @ (weight * fit.residual[part]))
        at = mine.index(i)
        std = math.sqrt(inverse[at, at] * _inflation(fit.ar[j])) * per
        found.append((e.step(), sign * float(step[at]) * per, std))
    return found


def diagnose(
    problem: Problem, fit: Fit, experiments: tuple[ExperimentFit, ...], *, dry_mass: float | None
) -> list[Finding]:
    """Return what a person has to know of residuals, nuisances and plausibility."""
    return [
        *_autocorrelated(experiments),
        *_outliers(experiments),
        *_drifts(experiments),
        *_trend(problem, fit),
        *_neutral(problem, fit),
        *_mass(problem, fit, dry_mass),
        *_backwards(problem, fit),
    ]


def _inflation(coefficients: tuple[float, ...]) -> float:
    """Return the variance of a mean of such residuals, over that of white ones."""
    return 1.0 if not coefficients else float(
        max(1.0, (1.0 - _first(coefficients) ** 2) / max(1.0 - sum(coefficients), 1e-2) ** 2)
    )  # fmt: skip


def _first(coefficients: tuple[float, ...]) -> float:
    """Return a first autocorrelation that gives the autoregression's variance, near enough."""
    return min(abs(sum(coefficients)), 0.99)


def _autocorrelated(experiments: tuple[ExperimentFit, ...]) -> Iterator[Finding]:
    bad = [e for e in experiments if e.whiteness_p < 1e-3 / len(experiments)]
    if bad:
        yield Finding(
            "autocorrelated",
            "note",
            f"In {len(bad)} of {len(experiments)} logs the residuals are autocorrelated: the model "
            "is incomplete there, or the sensor is filtered. The intervals allow for it as "
            "autocorrelated noise, not as a model error.",
        )


def _outliers(experiments: tuple[ExperimentFit, ...]) -> Iterator[Finding]:
    for e in experiments:
        used = int(np.isfinite(e.residual).sum())
        if e.outliers > max(2, _MANY * used):
            away = e.residual[np.isfinite(e.residual) & (e.weight < 0.5)]
            largest = float(np.abs(away).max()) if away.size else 0.0
            yield Finding(
                "outliers",
                "warning" if e.outliers > 0.1 * used else "note",
                f"{e.source}: {e.outliers} of {used} samples, up to {largest:.3g} m off, are taken "
                "as outliers and given less weight.",
            )


def _drifts(experiments: tuple[ExperimentFit, ...]) -> Iterator[Finding]:
    bound = math.sqrt(float(chi2.isf(0.003 / max(len(experiments), 1), 1)))
    for e in experiments:
        if abs(e.drift.value) > bound * e.drift.std:
            span = float(np.ptp(e.record.time))
            yield Finding(
                "drift",
                "warning",
                f"{e.source}: the neutral volume drifts by {1e6 * e.drift.value * span:+.2g} cm3 "
                f"over the log ({3.6e9 * e.drift.value:+.3g} cm3/h), so it seems: trapped air, a "
                "leak, or a slip of the piston's sensor. The intervals of the other parameters do "
                "not allow for it.",
            )


def _trend(problem: Problem, fit: Fit) -> Iterator[Finding]:
    gains = np.array([g for g in single_gains(problem, fit) if 0.0 < g[2] < 1.0]).reshape(-1, 3)
    sizes, logs, weight = gains[:, 0], gains[:, 1], 1.0 / gains[:, 2] ** 2
    if len(gains) < 4 or np.ptp(sizes) < 0.2 * sizes.mean():
        return
    x = np.log(sizes)
    x = x - (weight * x).sum() / weight.sum()
    slope = float((weight * x * logs).sum() / (weight * x * x).sum())
    std = float(1.0 / math.sqrt((weight * x * x).sum()))
    scatter = linregress(x, logs).stderr if len(gains) > 4 else std
    if abs(slope) < _SURE * max(std, float(scatter)):
        return
    low, high = sizes.min(), sizes.max()
    name = "K2" if "K2" in problem.names else "1/k_dt"
    change = 100.0 * (math.exp(slope * math.log(high / low)) - 1.0)
    why = "the mark of a psi set too large, or of dry friction"
    if slope < 0.0:
        why = (
            "the mark of a psi that is left out or set too small, or of drag that grows faster "
            "than the speed"
        )
    yield Finding(
        "step-size trend",
        "warning",
        f"{name} changes by {change:+.0f} % from volume changes of {1e6 * low:.3g} cm3 to "
        f"{1e6 * high:.3g} cm3: {why}.",
    )


def _neutral(problem: Problem, fit: Fit) -> Iterator[Finding]:
    if not math.isfinite(problem.neutral_std):
        return
    e = fit.x[problem.shared : problem.first_start] * VOLUME / problem.neutral_std
    if float(chi2.sf(float((e**2).sum()), len(e))) <= 1e-3:
        largest = float(np.abs(e).max() * problem.neutral_std)
        rms = float(np.sqrt(np.mean(e**2)) * problem.neutral_std)
        yield Finding(
            "neutral prior",
            "warning",
            f"The neutral volumes are off by up to {1e6 * largest:.2g} cm3, {1e6 * rms:.2g} cm3 "
            f"rms: more than the {1e6 * problem.neutral_std:.2g} cm3 that was assumed. Give "
            "--neutral-std what the vehicle does, or none for no assumption.",
        )


def _mass(problem: Problem, fit: Fit, dry_mass: float | None) -> Iterator[Finding]:
    m = problem.model.mass(problem.named(fit.x))
    of_water = problem.model.specific_weight / _GRAVITY * problem.model.displaced
    least, most = _NONE[0] * of_water, _NONE[1] * of_water
    wrong = ""
    if dry_mass is not None and m < 0.98 * dry_mass:
        wrong = f"less than the vehicle's dry mass of {dry_mass:.3g} kg"
    elif m < _LIGHTEST * of_water:
        wrong = (
            f"less than the {of_water:.3g} kg of water that the hull displaces, with which it "
            "would be neutral"
        )
    elif m > _HEAVIEST * of_water:
        wrong = (
            f"{m / of_water:.2g} times the {of_water:.3g} kg of water that the hull displaces: "
            "entrained and added mass hardly come to that"
        )
    if wrong:
        yield Finding(
            "mass",
            "no" if not least < m < most else "warning",
            f"The mass that follows, rho g T2/K2 = {m:.3g} kg, is {wrong}. Check the units of the "
            "logged volume, depth and time, the piston's area and hull.displaced_volume.",
        )


def _backwards(problem: Problem, fit: Fit) -> Iterator[Finding]:
    total = float(np.std(problem.measured))
    left = float(np.sqrt(np.mean(fit.residual**2)))
    if left >= _FOLLOWED * total and backwards(problem.experiments):
        yield Finding(
            "backwards",
            "no",
            "The vehicle sinks as its volume grows: volume or depth is the wrong way round. Set "
            'piston_positive = "in" or depth_positive = "up" in the [log] table, or turn the '
            "column's sign.",
        )
