"""What the fit says of each log by itself."""

from __future__ import annotations

import math

import numpy as np

from swimbladder.estimation.estimates import estimate
from swimbladder.estimation.motion.diagnose import drift, single_gains
from swimbladder.estimation.motion.experiment import Experiment
from swimbladder.estimation.motion.fit import Fit
from swimbladder.estimation.motion.noise import whiteness
from swimbladder.estimation.motion.problem import DEPTH, SPEED, VOLUME, Problem
from swimbladder.estimation.motion.result import ExperimentFit
from swimbladder.estimation.series import rms


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
