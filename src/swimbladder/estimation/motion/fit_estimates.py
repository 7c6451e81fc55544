"""The fit's numbers as estimates: parameters with their intervals, and what follows from them.

Profile likelihoods hold one parameter and fit all others again. Each log has numbers of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from swimbladder.estimation.estimates import Z95, Estimate, Finding, Prior, estimate, finding, given
from swimbladder.estimation.motion.diagnose import drift, single_gains
from swimbladder.estimation.motion.fit import Fit, inverse_of
from swimbladder.estimation.motion.model import NAMES
from swimbladder.estimation.motion.noise import whiteness
from swimbladder.estimation.motion.problem import DEPTH, SPEED, VOLUME, Experiment, Problem
from swimbladder.estimation.motion.result import ExperimentFit, Profile
from swimbladder.estimation.series import Array, rms
from swimbladder.units import format_quantity, shown_unit

_AT = (0.7, 1.4, 2.1, 2.8)  # standard deviations to either side
_EVALUATIONS = 30  # more than ever needed but on long records of an unstable motion
_FURTHER = (4.0, 6.0, 9.0)  # where the interval has not ended by then


def profile(problem: Problem, fit: Fit, i: int) -> Profile:
    """Return the profile of the i-th parameter of the vehicle.

    The weights and the noise stay those of the fit. The deviance is scaled by how much wider
    autocorrelated residuals make the interval (the vertical adjustment of Chandler and Bate 2007).
    """
    spread = math.sqrt(fit.covariance[i, i])
    plain = inverse_of(fit.information)[:, i]
    naive = max(float(plain[i]), 1e-300)
    ratio = naive / spread**2
    others = np.delete(np.arange(len(fit.x)), i)
    low, high = problem.bounds()

    def held(u: float, start: Array) -> tuple[float, Array]:
        def full(y: Array) -> Array:
            x = np.empty(len(fit.x))
            x[i], x[others] = u, y
            return x

        def rows(y: Array) -> Array:
            return problem.weighted(full(y), fit.root)

        def slopes(y: Array) -> Array:
            return -problem.weighted_slope(full(y), fit.root)[:, others]

        done = least_squares(
            rows, np.clip(start, low[others] + 1e-9, high[others] - 1e-9), slopes,
            bounds=(low[others], high[others]), xtol=1e-6, ftol=1e-6, gtol=1e-8,
            max_nfev=_EVALUATIONS,
        )  # fmt: skip
        return 2.0 * float(done.cost), done.x

    at_best, _ = held(fit.x[i], fit.x[others])
    entries, deviance = [fit.x[i]], [0.0]
    ridge = plain[others] / naive
    for side in (-1.0, 1.0):
        x, before = fit.x[others], fit.x[i]
        for k in (*_AT, *_FURTHER):
            u = fit.x[i] + side * k * spread
            if not low[i] < u < high[i] or (k in _FURTHER and deviance[-1] > 1.2 * Z95**2):
                break
            cost, x = held(u, x + ridge * (u - before))
            before = u
            entries.append(u)
            deviance.append(max(cost - at_best, 0.0) * ratio)
    order = np.argsort(entries)
    u, D = np.array(entries)[order], np.array(deviance)[order]
    ends = _interval(u, D, fit.x[i])
    name, (low_end, high_end) = problem.names[i], problem.values_of(i, ends).tolist()
    return Profile(name, NAMES[name].unit, problem.values_of(i, u), D, (low_end, high_end))


def _interval(u: Array, deviance: Array, best: float) -> Array:
    """Return where the signed root of the deviance passes -1.96 and 1.96; infinite if nowhere."""
    root = np.maximum.accumulate(np.sign(u - best) * np.sqrt(deviance)) + 1e-9 * np.arange(len(u))
    inverse = PchipInterpolator(root, u, extrapolate=False)
    low, high = (float(inverse(end)) for end in (-Z95, Z95))
    return np.array(
        [low if math.isfinite(low) else -np.inf, high if math.isfinite(high) else np.inf]
    )


def each_experiment(problem: Problem, found: Fit) -> tuple[ExperimentFit, ...]:
    """Return the fit of each log: residuals, weights, and what belongs to it alone."""
    gains: list[tuple[float, float] | None] = [
        (gain, std) if 0.0 < std < 1.0 else None for _, gain, std in single_gains(problem, found)
    ]
    return tuple(
        _experiment(problem, found, j, e, gain)
        for (j, e), gain in zip(
            enumerate(problem.experiments), gains or [None] * len(problem.experiments), strict=True
        )
    )


def _experiment(
    problem: Problem, found: Fit, j: int, e: Experiment, gain: tuple[float, float] | None
) -> ExperimentFit:
    part = slice(problem.rows[j], problem.rows[j + 1])
    n = len(e.record.time)
    residual, weight, predicted = np.full(n, np.nan), np.zeros(n), np.full(n, np.nan)
    residual[e.used], weight[e.used] = found.residual[part], found.weight[part]
    predicted[e.used] = e.record.depth[e.used] - found.residual[part]
    std = np.sqrt(np.diag(found.covariance))
    at = problem.starts_at[j]
    own = {
        "neutral_error": (problem.shared + j, VOLUME, "m3"),
        "start_depth": (at, DEPTH, "m"),
        "start_speed": (at + 1, SPEED, "m/s"),
    }
    kept = weight[e.used] > 0.0
    left = found.residual[part][kept]
    return ExperimentFit(
        source=e.source, record=e.record, reference_depth=e.reference, predicted=predicted,
        residual=residual, weight=weight,
        estimates={
            name: estimate(float(found.x[i] * per), float(std[i] * per), unit)
            for name, (i, per, unit) in own.items()
        },
        drift=drift(problem, found, j), noise=float(found.noise[j]),
        rms=rms(left) if len(left) else math.nan,
        ar=found.ar[j], whiteness_p=whiteness(np.sqrt(weight[e.used]) * found.residual[part]),
        outliers=int((weight[e.used] < 0.5).sum()), step=e.step(), own_gain=gain,
    )  # fmt: skip


_OFF = 0.1  # of the half interval, from which the profile's interval is given
_PRIOR_ONLY = 0.9  # of the prior's deviation is left
_CONTRADICTED = 3.0  # standard deviations from the prior


def parameters(
    problem: Problem, found: Fit, drawn: Mapping[str, Profile]
) -> tuple[dict[str, Estimate], list[Finding]]:
    """Return the estimates; where a profile's interval differs from the quadratic one, with it."""
    std = np.sqrt(np.diag(found.covariance)[: problem.shared]) * problem.per_entry(found.x)
    estimates: dict[str, Estimate] = {}
    findings: list[Finding] = []
    for i, name in enumerate(problem.names):
        unit, log = NAMES[name].unit, problem.logarithmic[i]
        e = estimate(problem.value(found.x, i), float(std[i]), unit, logarithmic=log)
        prior = problem.priors.get(name)
        if prior is not None:
            findings += _against(name, e, prior)
        if prior is not None and e.std > _PRIOR_ONLY * prior.std:
            e = replace(e, origin="prior")
            findings.append(finding("motion", "adds little", name=name))
        if name in drawn:
            ends = drawn[name].ci95
            half = 0.5 * (e.ci95[1] - e.ci95[0])
            apart = max(abs(a - b) for a, b in zip(ends, e.ci95, strict=True))
            if not apart <= _OFF * half:
                e = replace(e, ci95=ends)
                findings.append(finding("motion", "profile", name=name))
        if name == "drag_quadratic" and not log:  # it is never below 0
            e = replace(e, ci95=(max(e.ci95[0], 0.0), e.ci95[1]))
        estimates[name] = e
    for name, value in problem.values.items():
        if name in ("psi", "K2", "T2") and name not in estimates and (
            name == "psi" or problem.model.law != "quadratic"
        ):  # fmt: skip
            estimates[name] = given(value, NAMES[name].unit)
    return estimates, findings


def _against(name: str, e: Estimate, prior: Prior) -> Iterator[Finding]:
    """Yield a warning where data and prior can hardly both be right."""
    shift = math.sqrt(max(prior.std**2 - e.std**2, 0.0))  # of the estimate, if the prior is right
    if abs(e.value - prior.mean) > _CONTRADICTED * max(shift, 0.1 * prior.std):
        found, mean, std = (
            format_quantity(value, e.unit, shown_unit(e.unit), digits=3)
            for value in (e.value, prior.mean, prior.std)
        )
        yield finding("motion", "contradicts", name=name, found=found, mean=mean, std=std)


def derived(problem: Problem, found: Fit) -> dict[str, Estimate]:
    """Return what follows of mass and laminar drag, by the delta rule."""
    p = problem.shared
    C = found.covariance[:p, :p]

    def of(quantity: Callable[[Mapping[str, float]], float], unit: str) -> Estimate:
        at = quantity(problem.named(found.x))
        slope = np.zeros(p)
        for i in range(p):
            moved = found.x.copy()
            moved[i] += 1e-5
            slope[i] = (quantity(problem.named(moved)) - at) / 1e-5
        return estimate(at, math.sqrt(max(float(slope @ C @ slope), 0.0)), unit, logarithmic=True)

    k_b = problem.model.specific_weight
    result = {}
    if problem.model.law != "quadratic":
        result["mass"] = of(problem.model.mass, "kg")
        result["drag"] = of(lambda v: k_b / v["K2"], "N s/m")
    return result
