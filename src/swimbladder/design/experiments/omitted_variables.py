"""What becomes of the estimates where the model leaves something out: psi, a trim, a drift."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.experiments.conditions import Setting
from swimbladder.design.experiments.fisher_information import Question, problem_of
from swimbladder.design.experiments.flight import Flight
from swimbladder.estimation.motion.fit import refine
from swimbladder.estimation.motion.problem import VOLUME, Problem

Array = NDArray[np.float64]


class OmittedVariable(NamedTuple):
    """A bias in shares of the parameters, by name: linearised, and by a refit where one is made.

    rms: what the refit leaves over [m], noise included; nan without one.
    """

    linear: dict[str, float]
    refit: dict[str, float]
    rms: float


def without_psi(
    flights: Sequence[Flight], question: Question, setting: Setting
) -> OmittedVariable | None:
    """Return what happens to the others if psi is taken for 0; None where it is, or all there is.

    The linearised bias is J^+ times what psi does to the depths; the refit is the fit of
    `identify`, of records with noise.
    """
    others = [name for name in question.names if name != "psi"]
    if question.values["psi"] == 0.0 or not others:
        return None
    problem, x = _at_the_truth(flights, question, setting, fixed={"psi": 0.0})
    effect = problem.residual(x)
    step = _pseudo_inverse(problem, x, setting) @ effect
    noise = np.random.default_rng(1).normal(scale=setting.depth_noise, size=len(effect))
    problem.measured = problem.measured + noise
    found = refine(problem, x)
    size = np.array([question.size(name) for name in others])
    true = np.array([question.values[name] for name in others])
    p = problem.shared
    moved = step[:p] * problem.per_entry(x) / size
    refitted = (np.array([problem.value(found.x, i) for i in range(p)]) - true) / size
    return OmittedVariable(
        linear=dict(zip(others, moved.tolist(), strict=True)),
        refit=dict(zip(others, refitted.tolist(), strict=True)),
        rms=math.sqrt(float(np.average(found.residual**2, weights=found.weight))),
    )


def without_trim(
    flights: Sequence[Flight], question: Question, setting: Setting
) -> OmittedVariable | None:
    """Return the bias if every neutral volume is off the same way, by its standard deviation.

    None where nothing is known of neutral volumes, so that nothing can be wrong.
    """
    if not math.isfinite(setting.neutral_std):
        return None
    problem, x = _at_the_truth(flights, question, setting)
    effect = problem.slope(x)[:, problem.shared : problem.first_start].sum(axis=1)
    step = _pseudo_inverse(problem, x, setting) @ effect * setting.neutral_std / VOLUME
    return _linear(problem, x, step, question)


def without_drift(
    flights: Sequence[Flight], question: Question, setting: Setting
) -> OmittedVariable:
    """Return the bias if every neutral volume drifts the same way, by its standard deviation."""
    problem, x = _at_the_truth(flights, question, setting)
    J = problem.slope(x)
    effect = np.zeros(len(problem.measured))
    for j, flight in enumerate(flights):
        rows = slice(problem.rows[j], problem.rows[j + 1])
        middle = float(flight.time.mean() - flight.time[flight.moved[0]])
        shift = J[rows, problem.shared + j] / VOLUME * middle
        effect[rows] = problem.drift_slope(x, j) + shift
    step = _pseudo_inverse(problem, x, setting) @ effect * setting.drift_std
    return _linear(problem, x, step, question)


def _at_the_truth(
    flights: Sequence[Flight], question: Question, setting: Setting, *,
    fixed: Mapping[str, float] | None = None,
) -> tuple[Problem, Array]:  # fmt: skip
    problem = problem_of(flights, question, setting, fixed=fixed)
    x = problem.begin(question.values)
    for at in problem.starts_at[:-1]:
        x[at + 1] = 0.0
    return problem, x


def _pseudo_inverse(problem: Problem, x: Array, setting: Setting) -> Array:
    """Return what turns a small change of the depths [m] into one of x, [len(x), rows]."""
    J, P = problem.slope(x) / setting.depth_noise, problem.prior_rows(x)[1]
    rows = np.concatenate([J, P])
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    inverse: Array = np.linalg.pinv(rows / size) / size[:, None] / setting.depth_noise
    return inverse[:, : len(J)]


def _linear(problem: Problem, x: Array, step: Array, question: Question) -> OmittedVariable:
    size = np.array([question.size(name) for name in problem.names])
    moved = step[: problem.shared] * problem.per_entry(x) / size
    return OmittedVariable(dict(zip(problem.names, moved.tolist(), strict=True)), {}, math.nan)
