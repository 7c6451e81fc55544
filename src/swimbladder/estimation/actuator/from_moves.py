"""The estimates that moves at full speed give, where no voltage is logged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.actuator.estimate import Pooled, pool, student
from swimbladder.estimation.actuator.moves import Move, moves
from swimbladder.estimation.actuator.noise import spikes
from swimbladder.estimation.actuator.result import Step
from swimbladder.estimation.actuator.startup import Rate, rate_of, start_up
from swimbladder.estimation.estimates import Estimate, estimate, not_identifiable

_NO_VOLTAGE = "not in the log: it holds no voltage"
_WAYS = {1: "out", -1: "in"}


@dataclass(frozen=True, kw_only=True)
class MovesFit:
    """Estimates from the moves of a log, by name and direction; the moves and their spread."""

    parameters: dict[str, Estimate]
    derived: dict[str, Estimate]
    steps: tuple[Step, ...]
    trend: float  # 1/s, share of the speed that a move gains in a second, the median
    lasting: float  # s, of a move at full speed, the median
    ramps: dict[str, float]  # s, by direction: of a soft start, where that is what the moves show
    between: float  # share by which speeds of one direction differ from move to move
    noise: float  # m
    outliers: int


def fit_moves(bench: Bench) -> MovesFit:
    """Return T1 and the rate of the moves of one log; without any, both say so."""
    out = np.zeros(len(bench.time), bool)
    if bench.reference is None:  # a positioner turns within few samples, which look alike
        out = spikes(bench.position, 4.0 * (bench.noise + bench.quantum))
    bench = bench.only(~out)
    found = moves(bench, 0)
    unit = f"{bench.unit}/s"
    start = start_up(bench, found)
    rates = [rate_of(bench, move, start.T1.value if start.T1.known else 0.0) for move in found]
    derived: dict[str, Estimate] = {}
    pooled: dict[int, Pooled] = {}
    ramps: dict[str, float] = {}
    for way, name in _WAYS.items():
        own = [k for k, move in enumerate(found) if move.direction == way]
        if not own:
            continue
        pooled[way] = pool([rates[k].value for k in own], [rates[k].std for k in own])
        derived[f"rate_{name}"] = pooled[way].estimate(unit)
        begun = start_up(bench, [found[k] for k in own])
        derived[f"T1_{name}"] = begun.T1
        if begun.ramp is not None:
            ramps[f"{name}ward"] = begun.ramp
    parameters = {
        "K1": not_identifiable(f"{unit}/V", _NO_VOLTAGE),
        "T1": start.T1,
        "dead_zone": not_identifiable("V", _NO_VOLTAGE),
        "load_voltage": not_identifiable("V", _NO_VOLTAGE),
        **_both(pooled, unit),
    }
    starts = {k: (samples, fitted) for k, samples, fitted in start.fitted}
    steps = tuple(
        _step(bench, move, rate, starts.get(k))
        for k, (move, rate) in enumerate(zip(found, rates, strict=True))
    )
    kept = [step.residual[step.used] for step in steps]
    return MovesFit(
        parameters=parameters,
        derived=derived,
        steps=steps,
        trend=float(np.median([rate.trend for rate in rates])) if rates else 0.0,
        lasting=float(np.median([s.time[-1] - s.time[0] for s in steps])) if steps else 0.0,
        ramps=ramps,
        between=max((p.between / p.mean for p in pooled.values()), default=0.0),
        noise=float(np.concatenate(kept).std()) if kept else math.nan,
        outliers=int(out.sum()),
    )


def _both(pooled: dict[int, Pooled], unit: str) -> dict[str, Estimate]:
    """Return rate, the geometric mean of both directions, and asymmetry, their ratio."""
    if not pooled:
        why = "no move at full speed is in the log"
        return {"asymmetry": not_identifiable("-", why), "rate": not_identifiable(unit, why)}
    if len(pooled) == 1:
        ((way, one),) = pooled.items()
        why = f"the log has moves {_WAYS[way]}ward only"
        return {"asymmetry": not_identifiable("-", why), "rate": one.estimate(unit)}
    out, in_ = pooled[1], pooled[-1]
    a, b = out.std / out.mean, in_.std / in_.mean
    rate, ratio = math.sqrt(out.mean * in_.mean), out.mean / in_.mean
    both = math.hypot(a, b)
    # Satterthwaite's degrees of freedom of a sum of two variances
    fourth = a**4 / out.df + b**4 / in_.df
    df = both**4 / fourth if fourth > 0.0 else math.inf
    found = {}
    for name, value, share, of in (
        ("asymmetry", ratio, both, "-"),
        ("rate", rate, 0.5 * both, unit),
    ):
        std = share * value
        found[name] = estimate(value, std, of, reach=student(df) * std, logarithmic=True)
    return found


def _step(
    bench: Bench,
    move: Move,
    rate: Rate,
    start: tuple[np.ndarray[tuple[int], np.dtype[np.int64]], np.ndarray] | None,
) -> Step:
    """Return a move with its fit: of the start where there is one, then of the speed."""
    first = move.first if start is None else int(start[0][0])
    samples = np.arange(first, move.last + 1)
    fitted = np.full(len(samples), np.nan)
    used = np.ones(len(samples), bool)
    fitted[rate.samples - first] = rate.fitted
    used[rate.samples - first] = rate.used
    if start is not None:
        fitted[start[0] - first] = start[1]
        used[start[0] - first] = True
    known = np.isfinite(fitted)
    return Step(
        source=bench.source,
        label=f"{_WAYS[move.direction]}ward",
        time=bench.time[samples][known],
        position=bench.position[samples][known],
        fitted=fitted[known],
        voltage=None,
        used=used[known],
        speed=rate.value,
        start=0 if start is None else len(start[0]),
    )


def together(fits: Sequence[dict[str, Estimate]]) -> tuple[dict[str, Estimate], dict[str, float]]:
    """Return the random-effects means over logs, and by name the probability of such differences.

    A parameter that no log identifies is taken from the first, with its reason.
    """
    result: dict[str, Estimate] = {}
    chance: dict[str, float] = {}
    for name in dict.fromkeys(name for fit in fits for name in fit):
        all_ = [fit[name] for fit in fits if name in fit]
        estimates = [e for e in all_ if e.known]
        if len(estimates) < 2:
            result[name] = estimates[0] if estimates else all_[0]
            continue
        pooled = pool([e.value for e in estimates], [e.std for e in estimates])
        positive = all(e.value > 0.0 for e in estimates)
        result[name] = pooled.estimate(estimates[0].unit, positive=positive)
        chance[name] = pooled.p
    return result, chance
