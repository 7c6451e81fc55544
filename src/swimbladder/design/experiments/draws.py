"""Vehicles that the one in the water may turn out to be, for a design that suits them all."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.experiments.flight import Question
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]


def covariance_of(question: Question, vehicle: Vehicle, uncertainty: float | None) -> Array:
    """Return the covariance of what is not known of the vehicle yet [p, p], in shares of values.

    uncertainty: share by which each parameter may be off, 1 sigma; where None, the covariance that
    the vehicle was identified with, else 0.3. A prior counts instead where there is one.
    """
    names, values = question.names, question.values
    each = 0.3 if uncertainty is None else uncertainty
    spread = np.array([each * abs(values[n]) / question.size(n) for n in names])
    S = np.diag(spread**2)
    known = vehicle.identified
    if uncertainty is None and known is not None:
        both = [n for n in names if n in known.names]
        at, there = [names.index(n) for n in both], [known.names.index(n) for n in both]
        size = np.array([question.size(n) for n in both])
        C = np.array(known.covariance)
        S[np.ix_(at, at)] = C[np.ix_(there, there)] / np.outer(size, size)
    for i, name in enumerate(names):
        if name in question.priors:
            S[i, :] = S[:, i] = 0.0
            S[i, i] = (question.priors[name].std / question.size(name)) ** 2
    return S


def vehicles(question: Question, covariance: Array) -> list[dict[str, float]]:
    """Return vehicles with the mean and covariance of what is uncertain, two for each direction.

    The points of the third-degree spherical-radial rule (Arasaratnam and Haykin 2009): the mean
    plus and minus sqrt(p) standard deviations along each principal axis. Positive parameters are
    moved by factors.
    """
    size, axes = np.linalg.eigh(covariance)
    inside = size > 1e-12 * max(float(size[-1]), 1e-300)
    if not inside.any() or size[-1] < 1e-12:
        return [question.values]
    steps = axes[:, inside] * np.sqrt(size[inside] * inside.sum())
    found = []
    for step in np.concatenate([steps.T, -steps.T]):
        values = question.values
        for name, by in zip(question.names, step.tolist(), strict=True):
            if question.model.logarithmic(name):
                values[name] *= math.exp(by)
            else:
                values[name] += by * question.size(name)
        values["drag_quadratic"] = max(values["drag_quadratic"], 0.0)
        found.append(values)
    return found
