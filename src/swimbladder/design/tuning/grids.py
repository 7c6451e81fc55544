"""What is tried for each law and goal, and what is to be small.

Frequencies are shares of the inner rate, sleeps of the time in which a held volume lets the vehicle
run away, holds of the one in which a neutral volume that walks takes it off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple

from swimbladder.design.tuning.knobs import Knobs, Setting
from swimbladder.design.tuning.motion import off_in, runaway
from swimbladder.design.tuning.trial import Trial

__all__ = ["GOALS", "HELD", "goals_of", "grid", "options", "preference", "score"]

GOALS = ("fast", "quiet", "energy")
# m rms, that a depth is held to where nothing is said: 1 cm less what 40 runs may be off, and 5 cm.
HELD = {"quiet": 9.5e-3, "energy": 5e-2}


class Grid(NamedTuple):
    """Knobs that are combined."""

    inner: tuple[float, ...]  # of the volume's error that a sample closes
    frequency: tuple[float, ...]
    damping: tuple[float, ...] = (1.0,)
    sharpness: tuple[float, ...] = (1.0,)
    learning: tuple[float, ...] = (1.0,)


_FAST = Grid(
    (0.3, 0.45), (0.08, 0.12, 0.14, 0.16, 0.18, 0.2, 0.23), (0.8, 1.0), (5.0, 8.0, 12.0),
    (0.003, 0.01),
)  # fmt: skip
_QUIET = Grid(
    (0.3,), (0.042, 0.046, 0.05, 0.06, 0.07, 0.08, 0.12), (0.7, 0.85, 1.0), (3.0, 4.0, 5.0, 6.0),
    (1.0, 0.7, 0.4, 0.2, 0.1, 0.03),
)  # fmt: skip
_PLAIN = Grid((0.3, 0.45), (0.05, 0.08, 0.12, 0.14, 0.16, 0.18, 0.2, 0.23), (0.6, 0.8, 1.0))
_GRIDS: Mapping[str, tuple[Grid, Grid]] = {  # fast, and quiet or energy
    "planned": (_FAST, _QUIET),
    "observer": (_FAST, _QUIET),
    "pulse": (_QUIET, _QUIET),
    "position-observer": (_FAST, _QUIET),
    "cascade": (_PLAIN, _PLAIN._replace(inner=(0.3,), frequency=_QUIET.frequency)),
    "sea-cascade": (
        Grid((0.4, 0.5), (0.13, 0.16, 0.19, 0.21, 0.23), (1.0,), (4.0, 6.5, 10.0)),
        Grid((0.4,), (0.05, 0.06, 0.075, 0.09, 0.12), (1.0,), (2.0, 3.0, 5.0)),
    ),
    "adrc": (
        Grid((0.4, 0.5), (0.08, 0.1, 0.12, 0.14, 0.16), (1.0,), (4.0, 6.0, 8.0), (0.1, 0.25, 0.4)),
        Grid((0.4,), (0.03, 0.04, 0.05, 0.06, 0.08), (1.0,), (4.0, 6.0), (0.1, 0.25)),
    ),
}
_SLEEPERS = ("deadband",)
_HOLDERS = (*_SLEEPERS, "pulse")  # laws for holding a depth
_SHARES = (0.85, 0.75)
_DEAD = (1.0, 2.0, 4.0, 6.0, 9.0)  # of what the noise makes of the volume asked for
_HOLDS = (0.8, 1.0, 1.2)
_PREDICTED = (2.2, 2.35, 2.5, 2.65, 2.8, 2.95, 3.1, 3.4, 3.8)  # times the rms that is allowed
# Of laws that rest near the set-point: for how long a volume is held, in times of `off_in`, and
# the band. A pulse sets the speed too: it is for nearly three times as long.
_RESTS = {
    "observer": (_HOLDS, _PREDICTED),
    "pulse": ((2.5, 2.8, 3.1), (2.3, 2.5, 2.7, 2.9)),
}
_SLEEPS = (0.2, 0.3, 0.4, 0.5, 0.6)
_BANDS = (1.0, 2.0, 3.5)  # of the depth error that is allowed
_VOLTS = (0.25, 0.5, 1.0)
_SPARE = 1.25  # of the voltage that the load of the sea takes where it is deepest
_OVER = 0.03  # overshoot in 95 % of the runs, that a fast law may have
_MOVED = 0.45e-3 / 3600.0  # m3/s, that it may move meanwhile; then starts and turns count


def goals_of(name: str) -> tuple[str, ...]:
    """Return the goals that a law can be tuned for."""
    return GOALS[1:] if name in _HOLDERS else GOALS


def grid(name: str, goal: str, setting: Setting, held: float) -> Iterator[Knobs]:
    """Yield the knobs that are looked at; held [m]: rms that a depth is to be held to."""
    h = setting.sample_time
    if name in _SLEEPERS:
        away = runaway(setting.plant, asleep=True)
        for sleep, band in product(_SLEEPS, _BANDS):
            yield Knobs(
                frequency=1.0 / (sleep * away), damping=1.0, inner=0.5 / h, pause=sleep * away,
                band=band * held,
            )  # fmt: skip
        return
    g = _GRIDS[name][0 if goal == "fast" else 1]
    for inner, share, damping, sharpness, learning in product(*g):
        rate = inner / h
        yield Knobs(
            frequency=share * rate, damping=damping, inner=rate, sharpness=sharpness,
            learning=learning,
        )  # fmt: skip


def preference(goal: str, knobs: Knobs) -> float:
    """Return what is to be small before trials: of gains, or for fast of their slowness."""
    if goal == "fast":
        return -knobs.frequency / (1.0 + 0.02 * knobs.sharpness)
    return knobs.frequency * knobs.sharpness * knobs.inner / (1.0 + knobs.learning)


def options(
    name: str, goal: str, knobs: Knobs, parameters: Any, s: Setting, *, held: float, deepest: float
) -> Iterator[Knobs]:
    """Yield what is left to choose: how much of the motor a path takes, and when it rests.

    held [m]: rms that a depth is to be held to; deepest [m]: where the motor still has to move.
    """
    if goal == "fast":
        shares = _SHARES if name in ("planned", "sea-cascade", "adrc") else (knobs.share,)
        for share in shares:
            yield knobs._replace(share=share)
        return
    rests = [knobs]
    if name in ("observer", "pulse"):
        dead, spell = 0.5 * s.least_move, off_in(s.plant, held, s.walk)
        holds, bands = _RESTS[name]
        every = product(holds, bands) if goal == "quiet" else product(holds[1:2], bands[::4])
        rests = [knobs._replace(dead=dead, pause=x * spell, band=y * held) for x, y in every]
    elif name in ("planned", "sea-cascade", "position-observer"):
        noise = _jitter(name, parameters, s)
        rests = [knobs._replace(dead=max(x * noise, s.least_move)) for x in _DEAD]
    volts = _VOLTS if goal == "energy" and name != "cascade" else (1.0,)
    needed = _SPARE * s.plant.load_drive * deepest / s.limit
    if len(volts) > 1 and len(rests) > 3:
        rests = rests[::2]
    for rest, share in product(rests, volts):
        if share >= min(needed, 1.0):
            yield rest._replace(volts=share)


def _jitter(name: str, p: Any, s: Setting) -> float:
    """Return what the noise makes of the volume asked for [m3], 1 sigma."""
    if name == "sea-cascade":
        return math.hypot(p.k_pz, p.k_dz * p.smoothing / p.S_p) * s.noise
    return float(math.hypot(p.k_z * p.l_z, p.k_w * p.l_w) + p.l_b) * s.noise


def score(goal: str, t: Trial, held: float) -> tuple[float, ...]:
    """Return what is to be small; first of all that it settles, or holds, at all."""
    if goal == "fast":
        settle = t.settle_95 if math.isfinite(t.settle_95) else 1e9
        # Of those that settle as soon, to a twentieth, the one that moves less.
        return (t.overshoot_95 > _OVER, t.settled < 0.95, round(20.0 * math.log(settle)), t.rate)
    off = max(t.rms / held, 1.0)
    if goal == "energy":
        return (off, t.energy)
    # A tenth of overshoot on the way there counts like a tenth more of starts.
    return (off, max(t.rate / _MOVED, 1.0), (t.starts + t.turns) * (1.0 + t.overshoot_95))
