"""Identifiability: directions of the parameters on which the data have too little information."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.estimates import Finding
from swimbladder.estimation.motion.fit import Fit
from swimbladder.estimation.motion.problem import Problem

Array = NDArray[np.float64]

LIMIT = 0.3  # of a parameter, or of what is large for one that may be 0: more is not known
_PART = 0.35  # of a direction of length 1, at which a parameter takes part in it
_KNOWN = 0.1


class Direction(NamedTuple):
    """A combination of the parameters, and how well the data alone determine it."""

    parts: Array  # [p] of length 1
    std: float  # in shares of the parameters, or of their scales


def directions(problem: Problem, fit: Fit) -> list[Direction]:
    """Return the directions of the vehicle's parameters, best known first.

    From the singular values of the sensitivity, everything that belongs to single experiments
    eliminated, with the priors of the neutral volumes and without those of the parameters.
    """
    p = problem.shared
    _, P = problem.prior_rows(fit.x)
    own = P[len(problem.priors) :]
    D = fit.data + own.T @ own
    size = np.sqrt(np.maximum(np.diag(D), 1e-300))
    D = D / np.outer(size, size)
    inner = D[p:, p:] + 1e-13 * np.eye(len(D) - p)
    S = D[:p, :p] - D[:p, p:] @ np.linalg.solve(inner, D[p:, :p])
    values, vectors = np.linalg.eigh(S * np.outer(size[:p], size[:p]))
    floor = 1e-14 * max(float(values[-1]), 1e-300)
    return [
        Direction(vectors[:, i], float(1.0 / np.sqrt(max(values[i], floor))))
        for i in range(p - 1, -1, -1)
    ]


def not_identifiable(problem: Problem, fit: Fit) -> Iterator[Finding]:
    """Yield a finding of severity no for every question that data and priors leave open."""
    p = problem.shared
    std = np.sqrt(np.diag(fit.covariance)[:p])
    limits = np.array([_limit(problem, fit, i) for i in range(p)])
    left = {i for i in range(p) if std[i] > limits[i]}

    def of(parts: list[int]) -> Finding:
        names = [problem.names[i] for i in parts]
        kind = "trade-off" if len(names) > 1 else "not identifiable"
        return Finding(kind, "no", _say(names, float(std[parts[0]]), problem))

    for direction in reversed(directions(problem, fit)) if left else ():
        scaled = np.abs(direction.parts) / limits
        parts = np.flatnonzero(scaled > _PART * scaled.max()).tolist()
        if left.isdisjoint(parts) or direction.std * float(scaled.max()) < 0.5:
            continue
        left -= set(parts)
        yield of(parts)
    for i in sorted(left):
        yield of([i])


def _limit(problem: Problem, fit: Fit, i: int) -> float:
    """Return how uncertain the i-th entry of x may be [in its own unit]."""
    if problem.logarithmic[i]:
        return LIMIT
    if problem.names[i] == "psi":
        return 10.0
    # a turbulent drag that may be none: identified, where it is small against the drag there is
    values = problem.named(fit.x)
    k_dl = problem.model.specific_weight / values["K2"]
    fastest = max(_fastest(problem), 1e-3)
    return max(1.0, k_dl / fastest / problem.scale[i])


def _fastest(problem: Problem) -> float:
    """Return the largest speed of the experiments, by and large [m/s]."""
    found = [0.0]
    for e in problem.experiments:
        for s in e.segments:
            t, z = e.record.time[s.first : s.last + 1], e.record.depth[s.first : s.last + 1]
            n = max(2, len(t) // 10)
            found.append(float(np.abs((z[n:] - z[:-n]) / (t[n:] - t[:-n])).max()))
    return max(found)


def _say(names: list[str], std: float, problem: Problem) -> str:
    """Say that a parameter, with its standard deviation, or several are not identifiable."""
    if len(names) == 1:
        name = names[0]
        if problem.logarithmic[problem.names.index(name)]:
            by = f"{100.0 * std:.0f} %" if std < 10.0 else "over 1000 %"
            what = f"{name} is not identifiable from these logs: its standard error is {by}"
        else:
            what = f"{name} is not identifiable from these logs"
    else:
        what = (
            f"{', '.join(names[:-1])} and {names[-1]} are not identifiable separately: the logs "
            "determine only a combination of them"
        )
    return f"{what}. {_remedy(names, problem)}"


def _remedy(names: list[str], problem: Problem) -> str:
    known = "give psi a prior or a value (--prior, --set)"
    if "psi" in names:
        other = "run a longer dive, or several with volume changes of different size"
        return f"G{known[1:]}, or {other}."
    if "drag_quadratic" in names and problem.model.law == "blended":
        return "Choose --drag linear or quadratic, or run at speeds that differ more."
    if "drag_quadratic" in names or "K2" in names:
        also = f", or {known}" if "psi" in problem.names else ""
        return f"Run longer, so that the speed settles, and with larger changes of volume{also}."
    if "mass" in names or "T2" in names:
        return "Record how the speed builds up: more samples soon after a change of volume."
    return "Give a value (--set) or a prior (--prior), or record steps that excite it."
