"""The fit's numbers as estimates: parameters with their intervals, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from swimbladder.estimation.estimates import Estimate, Finding, Prior, estimate, given
from swimbladder.estimation.motion.fit import Fit
from swimbladder.estimation.motion.model import NAMES
from swimbladder.estimation.motion.problem import Problem
from swimbladder.estimation.motion.result import Profile
from swimbladder.units import format_quantity, shown_unit

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
            findings.append(
                Finding("prior", "note", f"The data add little to the prior of {name}.")
            )
        if name in drawn:
            ends = drawn[name].ci95
            half = 0.5 * (e.ci95[1] - e.ci95[0])
            apart = max(abs(a - b) for a, b in zip(ends, e.ci95, strict=True))
            if not apart <= _OFF * half:
                e = replace(e, ci95=ends)
                findings.append(
                    Finding(
                        "profile",
                        "note",
                        f"The interval of {name} is that of its likelihood profile: a normal "
                        "distribution does not describe it.",
                    )
                )
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
        yield Finding(
            "prior",
            "warning",
            f"The data contradict the prior of {name}: {_read(e.value, e.unit)} comes out, where "
            f"{_read(prior.mean, e.unit)} +- {_read(prior.std, e.unit)} was said. Check its unit.",
        )


def _read(value: float, unit: str) -> str:
    return format_quantity(value, unit, shown_unit(unit), digits=3)


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
