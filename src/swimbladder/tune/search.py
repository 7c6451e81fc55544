"""The search: knobs whose margins hold over the region, then the best of them in trials.

Margins are cheap and trials are dear. So the knobs are laid out on a grid, kept where the nominal
vehicle has the margins, ordered by what the goal wants of them, kept where the whole region has the
margins, and the first few of these are tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

from swimbladder.control.law import Law
from swimbladder.errors import NoAnswerError
from swimbladder.linear.models import StateSpace
from swimbladder.parameters import Vehicle
from swimbladder.tune.gains import Knobs, Setting, gains
from swimbladder.tune.margins import WANTED, Worst, exactly, falls_short, roughly, worst
from swimbladder.tune.region import Region
from swimbladder.tune.trial import Step, Trial, trial

__all__ = ["Found", "search"]


class _Grid(NamedTuple):
    """What is tried for a goal; frequencies are shares of the inner rate."""

    inner: tuple[float, ...]  # of the volume's error that a sample closes
    frequency: tuple[float, ...]
    damping: tuple[float, ...]
    sharpness: tuple[float, ...]
    learning: tuple[float, ...]


_GRIDS = {
    "fast": _Grid(
        (0.3, 0.45), (0.08, 0.12, 0.14, 0.16, 0.18, 0.2, 0.23), (0.8, 1.0), (5.0, 8.0, 12.0),
        (0.003, 0.01),
    ),
    "quiet": _Grid(
        (0.3,), (0.03, 0.036, 0.042, 0.046, 0.05, 0.06, 0.08, 0.12), (0.6, 0.7, 0.85),
        (3.0, 4.0, 6.0), (0.03, 0.1),
    ),
}  # fmt: skip
_SHARES = (0.85, 0.75)
_DEAD = (1.0, 2.0, 4.0, 6.0, 9.0)  # of what the noise makes of the volume asked for
_TRIED = 4
_TRIED_QUIET = 8
_HELD = 8e-3  # m rms, that a quiet law is to hold a depth to
_OVER = 0.03  # overshoot in 95 % of the runs, that a fast law may have
_MOVED = 0.3e-3 / 3600.0  # m3/s, that it may move meanwhile; then starts of the motor count
_SLACK = 0.97  # of the margins: the linear form is that of differences


class Found(NamedTuple):
    """Knobs with what they give."""

    knobs: Knobs
    parameters: Any
    margins: Worst
    nominal: Trial
    region: Trial


def search(
    name: str, law: Law, vehicle: Vehicle, setting: Setting, region: Region, *, goal: str,
    depths: Sequence[float], delay: float, step: Step, runs: int, wanted: Worst = WANTED,
    advance: Callable[[float], None] | None = None,
) -> Found:  # fmt: skip
    """Return the best knobs found for a goal.

    goal: fast or quiet. depths [m]: where margins are checked. delay [s]: from sample to command.
    Raises NoAnswerError where no knobs have the margins, with the one that is farthest from them.
    """
    tell = advance or (lambda _: None)
    h = setting.sample_time
    asked = _tightened(wanted)

    def over_all(parameters: Any, asked: Worst, look: Callable[[StateSpace], Worst]) -> Worst:
        return worst(
            law, parameters, region.plants, depths=depths, sample_time=h, delay=delay,
            wanted=asked, look=look,
        )  # fmt: skip

    kept: list[tuple[float, Knobs]] = []
    near: tuple[int, tuple[str, ...]] | None = None
    every = list(_grid(name, goal, h))
    for knobs in every:
        tell(0.3 / len(every))
        parameters = gains(name, setting, knobs)
        m = worst(
            law, parameters, region.plants[:1], depths=depths[:1], sample_time=h, delay=delay,
            look=roughly,
        )  # fmt: skip
        short = falls_short(m, asked)
        if not short:
            kept.append((_preference(goal, knobs), knobs))
        elif near is None or len(short) < near[0]:
            near = (len(short), short)
    kept.sort(key=lambda pair: pair[0])
    if goal == "quiet":
        kept = _spread(kept)
    tried: list[tuple[Knobs, Any]] = []
    for _, knobs in kept:
        if len(tried) == (_TRIED if goal == "fast" else _TRIED_QUIET):
            break
        parameters = gains(name, setting, knobs)
        m = over_all(parameters, asked, roughly)
        short = falls_short(m, asked)
        if not short:
            tried.append((knobs, parameters))
            tell(0.1 / _TRIED)
        elif near is None or len(short) <= near[0]:
            near = (len(short), short)
    scored: list[tuple[tuple[float, ...], Knobs, Trial]] = []
    options = list(_options(goal, tried, setting))
    for knobs in options:
        over = trial(
            vehicle, law, gains(name, setting, knobs), step, sample_time=h, region=region,
            runs=runs, supply=setting.limit,
        )  # fmt: skip
        scored.append((_score(goal, over), knobs, over))
        tell(0.45 / len(options))
    for _, knobs, over in sorted(scored, key=lambda one: one[0]):
        # The dead zone is none of the loop's around rest: margins are those of its linear part.
        m = over_all(gains(name, setting, knobs._replace(dead=0.0)), wanted, exactly)
        tell(0.15 / len(scored))
        short = falls_short(m, wanted)
        if not short:
            parameters = gains(name, setting, knobs)
            nominal = trial(vehicle, law, parameters, step, sample_time=h, runs=runs)
            return Found(knobs, parameters, m, nominal, over)
        near = (len(short), short)
    assert near is not None  # something was computed
    raise NoAnswerError(
        f"no gains of the law {name!r} have the margins over the region at a sample time of "
        f"{h:g} s: the nearest has {'; '.join(near[1])}. A shorter sample time, a faster motor "
        "or parameters known better would help"
    )


def _options(goal: str, tried: Sequence[tuple[Knobs, Any]], setting: Setting) -> Iterator[Knobs]:
    """Yield what is left to choose: how much of the motor a path takes, where the motor rests."""
    for knobs, parameters in tried:
        if "dead" not in type(parameters)._fields:
            yield knobs
        elif goal == "fast" and "share" in type(parameters)._fields:
            for share in _SHARES:
                yield knobs._replace(share=share)
        elif goal == "quiet":
            # What the filter's noise makes of the volume asked for.
            p = parameters
            jitter = (math.hypot(p.k_z * p.l_z, p.k_w * p.l_w) + p.l_b) * setting.noise
            for dead in _DEAD:
                yield knobs._replace(dead=dead * jitter)
        else:
            yield knobs


def _score(goal: str, t: Trial) -> tuple[float, ...]:
    """Return what is to be small; first of all that it settles, or holds, at all."""
    if goal == "fast":
        settle = t.settle_95 if math.isfinite(t.settle_95) else 1e9
        # Of those that settle as soon, to a twentieth, the one that moves less.
        return (t.overshoot_95 > _OVER, t.settled < 0.95, round(20.0 * math.log(settle)), t.rate)
    return (max(t.rms / _HELD, 1.0), max(t.rate / _MOVED, 1.0), t.starts)


def _preference(goal: str, knobs: Knobs) -> float:
    """Return what is to be small before trials: for quiet the gains, for fast their slowness."""
    if goal == "quiet":
        return knobs.frequency * knobs.sharpness * knobs.inner
    return -knobs.frequency / (1.0 + 0.02 * knobs.sharpness)


def _grid(name: str, goal: str, h: float) -> Iterator[Knobs]:
    g = _GRIDS[goal]
    filtered = name != "cascade"
    for inner, share, damping, sharpness, learning in product(
        g.inner, g.frequency, g.damping,
        g.sharpness if filtered else (1.0,), g.learning if filtered else (1.0,),
    ):  # fmt: skip
        rate = inner / h
        yield Knobs(
            frequency=share * rate, damping=damping, inner=rate, sharpness=sharpness,
            learning=learning,
        )  # fmt: skip


def _spread(kept: list[tuple[float, Knobs]]) -> list[tuple[float, Knobs]]:
    """Return the first of every frequency and damping: how slow is too slow only a trial tells."""
    first: dict[tuple[float, float], tuple[float, Knobs]] = {}
    for pair in kept:
        knobs = pair[1]
        first.setdefault((round(knobs.frequency / knobs.inner, 6), knobs.damping), pair)
    return list(first.values())


def _tightened(m: Worst) -> Worst:
    return m._replace(
        gain_up=m.gain_up / _SLACK, gain_down=m.gain_down * _SLACK, phase=m.phase / _SLACK,
        peak_sensitivity=1.0 + (m.peak_sensitivity - 1.0) * _SLACK, disk=m.disk / _SLACK,
    )  # fmt: skip
