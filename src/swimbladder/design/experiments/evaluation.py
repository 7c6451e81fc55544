"""A set of releases evaluated: predicted errors, for which vehicles, after how many releases."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.experiments.conditions import Passing, Ramps, Release, Setting, Turn
from swimbladder.design.experiments.flight import Flight, Question, fisher_information, follow
from swimbladder.design.experiments.predict import (
    OmittedVariable,
    Prediction,
    predict,
    without_drift,
    without_psi,
    without_trim,
)

Array = NDArray[np.float64]
_NOT_YET = 3.0  # of a parameter: nothing is known of it
_SIZES = 12
_PLACE = 0.35  # of the way, where to-and-fro releases of the curve turn


@dataclass(frozen=True, kw_only=True)
class EvaluatedSet:
    """A set of releases with its predicted errors for the given vehicle, and for others.

    time: pool time [s], settling included. spread: least and largest share of each parameter's
    error, drift included, over the parameter region. after: the same shares once each
    release is done, None where not yet known. partial: of each release, in how many of the vehicles
    not all its moves happen. psi, trim, drift: what leaving them out does.
    """

    releases: tuple[Release, ...]
    flights: tuple[Flight, ...]
    others: tuple[tuple[Flight, ...], ...]  # of each vehicle of the parameter region
    time: float
    prediction: Prediction
    spread: dict[str, tuple[float, float]]
    after: tuple[dict[str, float | None], ...]
    partial: tuple[int, ...]
    psi: OmittedVariable | None
    trim: OmittedVariable | None
    drift: OmittedVariable

    @property
    def largest(self) -> float:
        """The largest share by which a parameter is uncertain, drift included."""
        return max(self.prediction.share.values())


def evaluate(
    releases: Sequence[Release], question: Question, setting: Setting, ramps: Ramps,
    vehicles: Sequence[Mapping[str, float]],
) -> EvaluatedSet:  # fmt: skip
    """Return a set of releases with all that can be said of it beforehand."""
    flights = [follow(r, question.model, question.values, ramps, setting) for r in releases]
    others = [[follow(r, question.model, v, ramps, setting) for r in releases] for v in vehicles]
    shares = np.array(
        [
            _after(flights_of, question, v, setting)[-1]
            for flights_of, v in zip(others, vehicles, strict=True)
        ]
    )
    return EvaluatedSet(
        releases=tuple(releases), flights=tuple(flights),
        others=tuple(tuple(flights_of) for flights_of in others),
        time=sum(f.duration + setting.settling for f in flights),
        prediction=predict(flights, question, setting),
        spread={
            name: (float(column.min()), float(column.max()))
            for name, column in zip(question.names, shares.T, strict=True)
        },
        after=tuple(
            {
                name: float(s) if s < _NOT_YET else None
                for name, s in zip(question.names, row, strict=True)
            }
            for row in _after(flights, question, question.values, setting)
        ),
        partial=tuple(sum(not f[k].complete for f in others) for k in range(len(releases))),
        psi=without_psi(flights, question, setting),
        trim=without_trim(flights, question, setting),
        drift=without_drift(flights, question, setting),
    )  # fmt: skip


def _after(
    flights: Sequence[Flight], question: Question, values: Mapping[str, float], setting: Setting
) -> list[Array]:
    """Return the shares of all parameters after each of the records."""
    known = [fisher_information(flight, question, values, setting) for flight in flights]
    gain, found = question.prior() + 1e-9 * np.eye(len(question.names)), []
    drift = np.zeros_like(gain)
    for information in known:
        gain = gain + information.gain
        drift = drift + setting.drift_std**2 * np.outer(information.drift, information.drift)
        C = np.linalg.inv(gain)
        found.append(np.sqrt(np.diag(C + C @ drift @ C)))
    return found


@dataclass(frozen=True, kw_only=True)
class Curve:
    """How well parameters would be known if the pool time went to releases of one size, up and
    down in turns: the largest share, drift included, for single steps and for to and fro.
    """

    sizes: Array  # m3
    steps: Array
    to_and_fro: Array

    @property
    def best_step(self) -> float:
        """The size of single steps beyond which a larger one is less informative [m3]."""
        return float(self.sizes[int(np.argmin(self.steps))])


def curve(
    question: Question, setting: Setting, ramps: Ramps, sizes: tuple[float, float], time: float
) -> Curve:
    """Return what sizes [m3] between two buy in a pool time [s]."""
    grid = np.geomspace(*sizes, _SIZES)
    span = setting.deepest - setting.shallowest
    found: list[list[float]] = [[], []]
    for size in grid.tolist():
        for way, shares in zip((False, True), found, strict=True):
            pair = []
            for start, sign in ((setting.deepest, 1.0), (setting.shallowest, -1.0)):
                volumes = [sign * size, -sign * size] if way else [sign * size]
                turn = start - sign * _PLACE * span
                pair.append(Release.to_and_fro(start, volumes, [turn] * (len(volumes) - 1)))
            shares.append(_repeated(pair, question, setting, ramps, time))
    return Curve(sizes=grid, steps=np.array(found[0]), to_and_fro=np.array(found[1]))


def _repeated(
    pair: Sequence[Release], question: Question, setting: Setting, ramps: Ramps, time: float
) -> float:
    """Return the largest share if releases are repeated for a time."""
    values = question.values
    flights = [follow(r, question.model, values, ramps, setting) for r in pair]
    known = [fisher_information(f, question, values, setting) for f in flights]
    times = time / sum(f.duration + setting.settling for f in flights)
    gain = times * sum(k.gain for k in known) + question.prior()
    drift = times * sum(np.outer(k.drift, k.drift) for k in known) * setting.drift_std**2
    C = np.linalg.inv(gain + 1e-9 * np.eye(len(gain)))
    return math.sqrt(float(np.diag(C + C @ drift @ C).max()))


def deeper(
    releases: Sequence[Release], question: Question, setting: Setting, ramps: Ramps, factor: float
) -> dict[str, float]:
    """Return the shares in a pool that leaves `factor` times the travel, the depths stretched."""
    more = (factor - 1.0) * (setting.deepest - setting.shallowest)
    pool = replace(setting, pool_depth=setting.pool_depth + more)

    def to(depth: float) -> float:
        return setting.shallowest + factor * (depth - setting.shallowest)

    stretched = [
        Release(
            to(r.start),
            tuple(
                Turn(m.volume, None if m.when is None else Passing(to(m.when.depth), m.when.up))
                for m in r.moves
            ),
        )
        for r in releases
    ]
    flights = [follow(r, question.model, question.values, ramps, pool) for r in stretched]
    return predict(flights, question, pool).share
