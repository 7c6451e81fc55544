"""The least error that any estimate can have: Cramer-Rao, with what was known before.

The slopes are central differences of the truth's integrator; a prior adds its precision to the
information (van Trees). The model's volume is the one that the vehicle had, unless the voltage
drives the model too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.noise import Noise
from studies.truth import Array, Body, Motor, Step, follow, with_changes

__all__ = ["EACH", "Experiment", "bounds", "slopes"]

EACH = ("neutral_error", "start_depth", "start_speed")  # that every experiment has of its own
# Steps of the differences: of logarithms, or in SI units.
_STEPS = {"psi": 2e-9, "neutral_error": 1e-8, "start_depth": 1e-4, "start_speed": 1e-5}


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A step as it went, to the last sample that was kept."""

    step: Step
    depth: Array  # m, true
    volume: Array  # m3, true, above that of the rest


def slopes(body: Body, motor: Motor, experiment: Experiment, names: Sequence[str]) -> Array:
    """Return d depth/d parameter, samples x names; of logarithms where `with_changes` says so."""
    sizes = [_STEPS.get(name, 1e-4) for name in names]
    lanes = [
        with_changes(body, motor, experiment.step, name, sign * size)
        for name, size in zip(names, sizes, strict=True)
        for sign in (1.0, -1.0)
    ]
    bodies, motors, steps = (list(x) for x in zip(*lanes, strict=True))
    depth, _ = follow(bodies, motors, steps, len(experiment.depth))
    return ((depth[::2] - depth[1::2]) / (2.0 * np.array(sizes)[:, None])).T


def bounds(
    body: Body,
    motor: Motor,
    experiments: Sequence[Experiment],
    noise: Noise,
    names: Sequence[str],
    deviations: Mapping[str, float],
) -> dict[str, float]:
    """Return the least standard deviation of each of `names`, all fitted together.

    deviations: of what was known before, in SI units or of a logarithm, under the parameter's name;
    0 fixes it, none leaves it free. Infinite where the information is singular.
    """
    each = [name for name in EACH if deviations.get(name, math.inf) > 0.0]
    count, p = len(experiments), len(names)
    total = p + count * len(each)
    known = np.zeros((total, total))
    for j, experiment in enumerate(experiments):
        slope = slopes(body, motor, experiment, [*names, *each])
        own = p + j * len(each) + np.arange(len(each))
        where = np.concatenate([np.arange(p), own])
        known[np.ix_(where, where)] += noise.information(experiment.depth, slope)
        for name, at in zip(each, own, strict=True):
            known[at, at] += deviations.get(name, math.inf) ** -2
    for i, name in enumerate(names):
        known[i, i] += deviations.get(name, math.inf) ** -2
    size = np.sqrt(np.diag(known))
    if not (size > 0.0).all():
        return dict.fromkeys(names, math.inf)
    scaled = known / np.outer(size, size)
    if np.linalg.cond(scaled) > 1e13:
        return dict.fromkeys(names, math.inf)
    deviation = np.sqrt(np.diag(np.linalg.inv(scaled))) / size
    return dict(zip(names, deviation[:p].tolist(), strict=True))
