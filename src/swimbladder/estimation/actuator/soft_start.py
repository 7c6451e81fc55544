"""Whether a driver starts softly: the motor then gets less than the logged voltage for a while.

The fit to voltage steps is repeated with a voltage that can change only so fast. That has one
number more than the fit has; where it is by far the likelier, T1 is the ramp's as well.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.actuator.model import Problem
from swimbladder.estimation.actuator.voltage import solve
from swimbladder.estimation.actuator.voltage_fit import VoltageFit, named

Array = NDArray[np.float64]

_RAMPS = (0.3, 0.6, 1.0, 1.5, 2.0, 3.0)  # of the fitted T1: a ramp to the largest voltage
_SEEN = 15.0  # deviance by which it has to be better, of one parameter more and six trials


class SoftStart(NamedTuple):
    """How long the voltage takes to rise to the largest [s], and T1 [s] if it does."""

    ramp: float
    T1: float


def soft_start(fit: VoltageFit) -> SoftStart | None:
    """Return the soft start that makes the fit by far the likelier, None where there is none."""
    problem = fit.problem
    if "T1" not in named(fit):
        return None
    values = fit.values
    n = int(problem.used.sum())
    least = float(np.sum(problem.white(fit.q) ** 2))
    best, found = n * math.log(max(least, 1e-300)) - _SEEN, None
    for share in _RAMPS:
        ramp = share * values["T1"]
        other = _with_voltage(problem, [slewed(b, problem.top / ramp) for b in problem.benches])
        guess = {**values, "T1": max(values["T1"] - 0.4 * ramp, 0.1 * values["T1"])}
        q = solve(other, other.turned(guess))
        left = n * math.log(max(float(np.sum(other.white(q) ** 2)), 1e-300))
        if left < best:
            best, found = left, SoftStart(ramp, other.values(q)["T1"])
    return found


def _with_voltage(problem: Problem, benches: list[Bench]) -> Problem:
    """Return the problem with other voltages; outliers and whitener stay."""
    other = Problem(benches, problem.blocks, problem.free, problem.fixed, problem.moving)
    other.used, other.early, other.whiten = problem.used, problem.early, problem.whiten
    return other


def slewed(bench: Bench, most: float) -> Bench:
    """Return the bench with a voltage that changes by at most `most` [V/s].

    What a sample has is the mean until the next, as the voltage is taken to be held.
    """
    assert bench.voltage is not None
    asked, step = bench.voltage, np.diff(bench.time)
    mean, now = asked.copy(), float(asked[0])
    for k, (goal, h) in enumerate(zip(asked[:-1].tolist(), step.tolist(), strict=True)):
        way = goal - now
        taken = min(abs(way) / most, h)
        then = now + math.copysign(most * taken, way) if abs(way) > most * h else goal
        mean[k] = (0.5 * (now + then) * taken + then * (h - taken)) / h
        now = then
    return replace(bench, voltage=mean)
