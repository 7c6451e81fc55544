"""How well the model predicts the depth some seconds ahead, from what was measured up to then.

A whole log open loop asks more than any use of a model does: a neutral volume wrong by a tenth of a
cubic centimetre moves a small float by decimetres in minutes. Here a causal filter follows the log;
at each instant it knows the depths up to it and, the volume being a known input, what the actuator
does afterwards. Its prediction is judged by skill, 1 - rms/rms of a baseline, against a depth that
stays (persistence) and against the same filter without drag and psi (a double integrator).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.estimation.comparison.filter_prior import UNITS, Tuning, draw, unknowns
from swimbladder.estimation.comparison.record import Record, record
from swimbladder.estimation.kalman.bank import Bank, Member, filter_bank
from swimbladder.estimation.kalman.depth_filter import Samples
from swimbladder.io.logs import Log
from swimbladder.physics.seawater import Column
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_Z95 = 1.959963984540054


@dataclass(frozen=True, kw_only=True)
class Horizon:
    """Predictions over one span of time; the arrays stand at the samples that are predicted.

    Only where both the sample from which and the one for which is predicted are clear of surface
    and bottom. rms, bias (predicted less measured) and spread, the predicted standard deviation of
    a measured depth as root mean square, in m. skill: 1 - rms/rms of the baseline, None where that
    is 0. coverage: share of the measured depths inside the predicted 95 % band.
    """

    seconds: float
    origin: Index  # [n] sample from which is predicted
    target: Index  # [n] sample for which
    predicted: Array  # m
    std: Array  # m, of the measured depth
    rms: float
    bias: float
    spread: float
    coverage: float
    persistence_rms: float
    integrator_rms: float

    @property
    def n(self) -> int:
        """How many predictions are judged."""
        return len(self.origin)

    @property
    def skill(self) -> dict[str, float | None]:
        """Skill against persistence and against the double integrator."""
        baselines = {"persistence": self.persistence_rms, "integrator": self.integrator_rms}
        return {name: 1.0 - self.rms / b if b > 0.0 else None for name, b in baselines.items()}

    def to_json(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        return {
            "seconds": self.seconds,
            "n": self.n,
            "rms_m": self.rms,
            "bias_m": self.bias,
            "predicted_std_m": self.spread,
            "coverage95": self.coverage,
            "persistence_rms_m": self.persistence_rms,
            "integrator_rms_m": self.integrator_rms,
            "skill_persistence": self.skill["persistence"],
            "skill_integrator": self.skill["integrator"],
        }


@dataclass(frozen=True, kw_only=True)
class Ahead:
    """Predictions of one log over several spans, and the noise that the filter assumed."""

    source: str
    record: Record
    horizons: tuple[Horizon, ...]
    noise: dict[str, float]  # SI, at the end of the log
    origins: dict[str, str]

    def columns(self) -> dict[str, Array]:
        """Return the columns of the file by name; nan where nothing is predicted."""
        found = {
            "time_s": self.record.time,
            "depth_m": self.record.depth,
            "compared": self.record.compared.astype(float),
        }
        for h in self.horizons:
            for what, values in (("predicted", h.predicted), ("std", h.std)):
                column = np.full(len(self.record.time), np.nan)
                column[h.target] = values
                found[f"depth_{what}_{h.seconds:g}s_m"] = column
        return found

    def to_json(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        noise = {
            name: {"value": value, "unit": UNITS[name], "origin": self.origins[name]}
            for name, value in self.noise.items()
        }
        return {"horizons": [h.to_json() for h in self.horizons], "noise": noise}


def predict_ahead(
    log: Log, vehicle: Vehicle, *, horizons: Sequence[float] = (10.0, 60.0),
    tuning: Tuning | None = None, bottom_depth: float = np.inf, surface_margin: float = 0.1,
    column: Column | None = None, advance: Callable[[float], None] | None = None,
) -> Ahead:  # fmt: skip
    """Return how well the vehicle's model predicts the log's depths over each horizon [s].

    tuning: the noise, where the vehicle's [identified] is not to say it; what neither says is
    learnt from the log, at each instant from what came before. bottom_depth [m]; surface_margin:
    depths less than this below the depth of emergence do not count [m]. column: the water of a
    cast. advance: called with the share of the work done since it was last called.
    Raises LogError or InputError where log, vehicle and horizons do not go together.
    """
    report = advance or (lambda _: None)
    if not horizons or not min(horizons) > 0.0 or len(set(horizons)) < len(horizons):
        raise InputError(
            "these are no times ahead", field="horizons", unit="s",
            value=",".join(f"{seconds:g}" for seconds in horizons),
            remedy='Give one or several, above 0 and different, as "10 s,60 s"',
        )  # fmt: skip
    rec = record(
        log, vehicle, drive="volume", bottom_depth=bottom_depth, surface_margin=surface_margin,
        column=column,
    )  # fmt: skip
    pairs = [_pairs(rec, seconds) for seconds in horizons]
    spread, origins = unknowns(vehicle, tuning or Tuning())
    assert rec.volume is not None  # a record that a volume drives has it
    samples = Samples(rec.time, rec.volume, rec.depth, rec.compared.astype(np.int8), rec.layers)
    members = draw(spread, vehicle, rec)
    bank = filter_bank(samples, members)
    report(0.1)
    free = filter_bank(samples, [_integrator(member) for member in members])
    report(0.1)
    found = []
    for seconds, (origin, target) in zip(horizons, pairs, strict=True):
        found.append(_horizon(rec, bank, free, seconds, origin, target))
        report(0.8 / len(horizons))
    last = [float(values[-1]) for values in _noise(bank)]
    return Ahead(
        source=log.source, record=rec, horizons=tuple(found),
        noise=dict(zip(UNITS, last, strict=True)), origins=origins,
    )  # fmt: skip


def _horizon(
    rec: Record, bank: Bank, free: Bank, seconds: float, origin: Index, target: Index
) -> Horizon:
    measured = rec.depth[target]
    predicted, std = bank.ahead(origin, target)
    std = np.hypot(std, _noise(bank)[0][origin])
    off = predicted - measured
    return Horizon(
        seconds=seconds, origin=origin, target=target, predicted=predicted, std=std,
        rms=_rms(off), bias=float(off.mean()), spread=_rms(std),
        coverage=float(np.mean(np.abs(off) <= _Z95 * std)),
        persistence_rms=_rms(rec.depth[origin] - measured),
        integrator_rms=_rms(free.ahead(origin, target)[0] - measured),
    )  # fmt: skip


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _pairs(rec: Record, seconds: float) -> tuple[Index, Index]:
    """Return the samples from which and for which is predicted: `seconds` apart, to half a sample.

    Raises InputError where there are none.
    """
    time, apart = rec.time, float(np.median(np.diff(rec.time)))
    wanted = time + seconds
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    nearest = np.where(wanted - time[after - 1] < time[after] - wanted, after - 1, after)
    close = np.abs(time[nearest] - wanted) <= 0.5 * apart + 1e-9
    ahead = nearest > np.arange(len(time))
    (origin,) = np.nonzero(close & ahead & rec.compared & rec.compared[nearest])
    if not len(origin):
        raise InputError(
            "no two samples that count are so far apart: of a log of "
            f"{rec.duration:.4g} s with one every {apart:.3g} s, clear of surface and bottom",
            field="--ahead", value=seconds, unit="s", remedy="Give a time between these",
        )  # fmt: skip
    return origin, nearest[origin]


def _noise(bank: Bank) -> tuple[Array, Array, Array]:
    """Return depth noise, random walk and acceleration noise after each sample: weighted."""
    noise = [(m.noise.depth, m.noise.random_walk, m.noise.acceleration) for m in bank.members]
    depth, walk, acceleration = (np.sqrt(bank.weighted(x)) for x in np.square(noise).T)
    return depth, walk, acceleration


def _integrator(member: Member) -> Member:
    """Return the filter of a vehicle of the same mass without drag and psi."""
    free = member.plant._replace(psi=0.0, d_l=0.0, d_b=0.0, d_0=0.0, d_t=0.0, epsilon=math.inf)
    return member._replace(plant=free)
