"""Fisher information of a record on a vehicle's parameters, with the record's own eliminated.

Parameters count in shares: a change of 1 is a whole of the parameter, or of what is large for one
that may be 0. Information about them adds up over records, so that of a candidate is found once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.experiments.conditions import Setting
from swimbladder.design.experiments.flight import Flight, experiment_of
from swimbladder.estimation.motion.estimates import Prior
from swimbladder.estimation.motion.model import Model
from swimbladder.estimation.motion.problem import VOLUME, Problem

Array = NDArray[np.float64]

FEWEST = 12  # samples of a record, below which `identify` does not take it


class Question(NamedTuple):
    """What is asked: which parameters, what is known of them, and how large they are."""

    model: Model
    names: tuple[str, ...]
    fixed: dict[str, float]
    priors: dict[str, Prior]

    def size(self, name: str) -> float:
        """Return what counts as a whole of a parameter [its unit]."""
        value = abs(self.values[name])
        return value if self.model.logarithmic(name) else max(value, self.model.scale(name))

    @property
    def values(self) -> dict[str, float]:
        """The assumed vehicle."""
        means = {name: prior.mean for name, prior in self.priors.items()}
        return {**self.model.values, **self.fixed, **means}

    def prior(self) -> Array:
        """Return what is known beforehand, as information about shares [p, p]."""
        known = [
            (self.size(name) / self.priors[name].std) ** 2 if name in self.priors else 0.0
            for name in self.names
        ]
        return np.diag(known)


class Information(NamedTuple):
    """Of one record: information about shares, and what a drift in it does to them.

    gain [p, p]; drift [p]: the score of a steady drift of the neutral volume, per m3/s.
    """

    gain: Array
    drift: Array


def problem_of(
    flights: Sequence[Flight], question: Question, setting: Setting, *,
    fixed: Mapping[str, float] | None = None,
) -> Problem:  # fmt: skip
    """Return the fit that `identify` would make of these records; `fixed` instead of estimated."""
    held = {**question.fixed, **(fixed or {})}
    names = tuple(name for name in question.names if name not in held)
    return Problem(
        [experiment_of(flight, f"release {k}") for k, flight in enumerate(flights, start=1)],
        question.model, names, fixed=held,
        priors={name: p for name, p in question.priors.items() if name in names},
        neutral_std=setting.neutral_std, speed_std=math.inf,
    )  # fmt: skip


def fisher_information(
    flight: Flight, question: Question, values: Mapping[str, float], setting: Setting
) -> Information:
    """Return the information of a record on the vehicle that has these values."""
    p = len(question.names)
    if len(flight.time) < FEWEST:
        return Information(np.zeros((p, p)), np.zeros(p))
    problem = problem_of([flight], question._replace(priors={}), setting)
    x = problem.begin(values)
    x[problem.starts_at[0] + 1] = 0.0
    per_share = [
        1.0 if log else question.size(name) / scale
        for name, log, scale in zip(question.names, problem.logarithmic, problem.scale, strict=True)
    ]
    J = problem.slope(x) / setting.depth_noise
    J[:, :p] *= per_share
    own = problem.prior_rows(x)[1][:, p:]
    inner = J[:, p:].T @ J[:, p:] + own.T @ own
    across = J[:, :p].T @ J[:, p:]
    # What is left of the parameters' columns, once the record's own entries follow them.
    back = np.linalg.solve(inner + 1e-12 * np.diag(np.diag(inner)), across.T)
    gain = J[:, :p].T @ J[:, :p] - across @ back
    # A drift counts from the release: that about the middle, and the shift from there.
    e = problem.experiments[0]
    middle = float(e.record.time.mean() - flight.time[flight.moved[0]])
    s = problem.drift_slope(x, 0) / setting.depth_noise + J[:, p] / VOLUME * middle
    drift = J[:, :p].T @ s - back.T @ (J[:, p:].T @ s)
    return Information(0.5 * (gain + gain.T), drift)
