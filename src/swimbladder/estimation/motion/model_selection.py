"""Which model the data speak for: the drag law, and whether psi belongs in it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np

from swimbladder.estimation.estimates import Finding, finding
from swimbladder.estimation.motion.fit import Fit, refine
from swimbladder.estimation.motion.model import LAWS, Model, default_names, model_of
from swimbladder.estimation.motion.noise import autocovariance
from swimbladder.estimation.motion.problem import Problem
from swimbladder.estimation.motion.result import Choice
from swimbladder.estimation.series import Array
from swimbladder.vehicle import Vehicle

Psi = Literal["free", "prior", "set", "zero"]

_TRACE = 0.02  # of the drag, that a blended one begins with beside a law that was fitted
_REFUSED = 3.0  # times what another drag law leaves over
_DECISIVE = 10.0  # difference of the criterion, "very strong" in Kass and Raftery 1995


def choices(problem: Problem, fit: Fit, models: Mapping[str, Model]) -> tuple[Choice, ...]:
    """Return every drag law with psi as it is and otherwise, best first.

    models: of the vehicle, by law. All see the same samples; autocorrelated residuals count as the
    number of independent samples that it is worth under the model reported.
    """
    counts = np.diff(problem.rows)
    each = np.array([_worth(c, n) for c, n in zip(fit.ar, counts, strict=True)])
    # one for all logs: then the fit is also what is best by the criterion, and a model that holds
    # another is never less likely than it
    worth = float((each * counts).sum() / counts.sum())
    found = []
    for law in LAWS:
        for psi in _psis(problem):
            same = law == problem.model.law and psi == _psi(problem)
            if same:
                other, result = problem, fit
            else:
                other = _problem(problem, models[law], law, psi)
                result = refine(other, _begin(other, problem, fit))
            found.append(_choice(other, result, law, psi, worth, reported=same))
    least = min(c[1] for c in found)
    total = sum(math.exp(-0.5 * (bic - least)) for _, bic in found)
    listed = [
        Choice(**fields, bic=bic, weight=math.exp(-0.5 * (bic - least)) / total)
        for fields, bic in found
    ]
    return tuple(sorted(listed, key=lambda c: c.bic))


def judge(listed: tuple[Choice, ...]) -> Iterator[Finding]:
    """Yield what a person has to know of the evidence."""
    if not listed:
        return
    best, reported = listed[0], next(c for c in listed if c.reported)
    gap = reported.bic - best.bic
    if gap > _DECISIVE:
        refused = reported.rms > _REFUSED * best.rms and reported.drag != best.drag
        texts = {"reported": _words(reported), "best": _words(best), "least": best.rms}
        texts |= {"gap": gap, "rms": reported.rms, "remedy": _remedy(best, reported)}
        yield finding("motion", "refused" if refused else "model", **texts)
    same = [c for c in listed if c.drag == reported.drag]
    zero = next((c for c in same if c.psi == "zero"), None)
    if zero is not None and reported.psi != "zero" and zero.bic - reported.bic > _DECISIVE:
        shifts = [
            f"{name} by {100.0 * (zero.values[name] / reported.values[name] - 1.0):+.0f} %"
            for name in reported.values
            if name in ("K2", "T2", "mass") and name in zero.values
        ]
        shift = " and ".join(shifts)
        yield finding("motion", "psi", shifts=shift, without=zero.rms, rms=reported.rms)


def _words(c: Choice) -> str:
    psi = {"free": "psi estimated", "prior": "psi with its prior", "set": "psi as set",
           "zero": "no psi"}[c.psi]  # fmt: skip
    return f"{c.drag} drag, {psi}"


def _remedy(best: Choice, reported: Choice) -> str:
    parts = []
    if best.drag != reported.drag:
        parts.append(f"--drag {best.drag}")
    if best.psi != reported.psi:
        parts.append('--set "psi=0 m3/m"' if best.psi == "zero" else "leave psi free")
    return f"Consider: {', '.join(parts)}."


def _psi(problem: Problem) -> Psi:
    if "psi" in problem.names:
        return "prior" if "psi" in problem.priors else "free"
    return "set" if problem.values["psi"] != 0.0 else "zero"


def _psis(problem: Problem) -> tuple[Psi, ...]:
    own = _psi(problem)
    return (
        (own, "free") if own == "zero" else (own, "free", "zero") if own == "set" else (own, "zero")
    )


def _problem(problem: Problem, model: Model, law: str, psi: Psi) -> Problem:
    """Return the problem of another model of the same data."""
    actuator = [name for name in problem.names if name in ("K1", "T1")]
    fixed: dict[str, float] = {
        name: problem.values[name] for name in ("K1", "T1") if name in problem.values
    }
    if psi in ("zero", "set"):
        fixed["psi"] = 0.0 if psi == "zero" else problem.values["psi"]
    names = [*default_names(law, list(fixed)), *actuator]
    priors = {n: p for n, p in problem.priors.items() if n in names}
    assumed = problem.assumed._replace(fixed=fixed, priors=priors)
    return Problem(problem.experiments, model, names, assumed)


def _begin(other: Problem, problem: Problem, fit: Fit) -> Array:
    """Return a start for another model where the fit ended, or as near as its drag law can be."""
    values = problem.named(fit.x)
    m = problem.model.mass(values)
    speed = _usual_speed(problem)
    law = problem.model.law
    own_l = 0.0 if law == "quadratic" else problem.model.specific_weight / values["K2"]
    own_t = 0.0 if law == "linear" else values["drag_quadratic"]
    drag = own_l * speed + own_t * speed**2  # N at that speed
    laminar, turbulent = drag / speed, drag / speed**2
    if other.model.law == "blended":  # which holds the law that was fitted
        laminar, turbulent = own_l or _TRACE * laminar, own_t or _TRACE * turbulent
    begin = {
        "mass": m, "K2": other.model.specific_weight / laminar, "T2": m / laminar,
        "drag_quadratic": turbulent, "psi": values["psi"],
    }  # fmt: skip
    x = other.begin(begin)
    x[other.shared :] = fit.x[problem.shared :]
    return x


def _usual_speed(problem: Problem) -> float:
    speeds = [0.0]
    for e in problem.experiments:
        for s in e.segments:
            t, z = e.record.time[s.first : s.last + 1], e.record.depth[s.first : s.last + 1]
            speeds.append(abs(float(z[-1] - z[0])) / float(t[-1] - t[0]))
            half = len(z) // 2
            speeds.append(abs(float(z[half] - z[0])) / float(t[half] - t[0]))
    return max(float(np.mean(speeds[1:])), 1e-3)


def _worth(coefficients: tuple[float, ...], n: int) -> float:
    """Return which share of the samples is independent."""
    gamma = autocovariance(coefficients, 1.0, int(n))
    return float(1.0 / max(2.0 * gamma.sum() - 1.0, 1.0))


def _choice(
    problem: Problem, fit: Fit, law: str, psi: Psi, worth: float, *, reported: bool
) -> tuple[dict[str, Any], float]:
    counts = np.diff(problem.rows)
    likelihood = -0.5 * worth * fit.objective
    samples = worth * float(counts.sum())
    bic = -2.0 * likelihood + problem.shared * math.log(max(samples, 2.0))
    fields = {
        "drag": law, "psi": psi, "parameters": problem.shared,
        "rms": float(np.sqrt((fit.weight * fit.residual**2).sum() / fit.weight.sum())),
        "log_likelihood": likelihood, "values": {n: problem.named(fit.x)[n] for n in problem.names},
        "reported": reported,
    }  # fmt: skip
    return fields, bic


def models_of(vehicle: Vehicle, bottom_depth: float) -> dict[str, Model]:
    """Return the vehicle's model under every law that can be identified."""
    return {law: model_of(vehicle, law=law, bottom_depth=bottom_depth) for law in LAWS}
