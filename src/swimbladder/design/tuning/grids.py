"""What is tried for each law and goal, and what is to be small.

Frequencies are shares of the inner rate, sleeps of the time in which a held volume lets the vehicle
run away, holds of the one in which a neutral volume that walks takes it off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

from swimbladder.control.motion import off_in, runaway
from swimbladder.control.recipe import Knobs, Recipe, Setting
from swimbladder.design.tuning.trial import Trial

GOALS = ("fast", "quiet", "energy")
# m rms, that a depth is held to where nothing is said: 1 cm less what 40 runs may be off, and 5 cm.
HELD = {"quiet": 9.5e-3, "energy": 5e-2}


_DEAD = (1.0, 2.0, 4.0, 6.0, 9.0)  # of what the noise makes of the volume asked for
_SPARE = 1.25  # of the voltage that the load of the sea takes where it is deepest
_OVER = 0.03  # overshoot in 95 % of the runs, that a fast law may have
_MOVED = 0.45e-3 / 3600.0  # m3/s, that it may move meanwhile; then starts and turns count


def goals_of(recipe: Recipe) -> tuple[str, ...]:
    """Return the goals that a law can be tuned for."""
    return GOALS[1:] if recipe.fast is None and recipe.candidates is None else GOALS


def grid(recipe: Recipe, goal: str, setting: Setting, held: float) -> Iterator[Knobs]:
    """Yield the knobs that are looked at; held [m]: rms that a depth is to be held to."""
    h = setting.sample_time
    if recipe.sleeps:
        away = runaway(setting.plant, asleep=True)
        for sleep, band in product(recipe.sleeps, recipe.bands):
            yield Knobs(
                frequency=1.0 / (sleep * away), damping=1.0, inner=0.5 / h, pause=sleep * away,
                band=band * held,
            )  # fmt: skip
        return
    g = recipe.fast if goal == "fast" else recipe.quiet
    for inner, share, damping, sharpness, learning in product(*(g or ())):
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
    recipe: Recipe, goal: str, knobs: Knobs, s: Setting, *, held: float, deepest: float
) -> Iterator[Knobs]:
    """Yield what is left to choose: how much of the motor a path takes, and when it rests.

    held [m]: rms that a depth is to be held to; deepest [m]: where the motor still has to move.
    """
    if goal == "fast":
        for share in recipe.shares or (knobs.share,):
            yield knobs._replace(share=share)
        return
    rests = [knobs]
    if recipe.holds:
        dead, spell = 0.5 * s.least_move, off_in(s.plant, held, s.walk)
        holds, bands = recipe.holds, recipe.bands
        every = product(holds, bands) if goal == "quiet" else product(holds[1:2], bands[::4])
        rests = [knobs._replace(dead=dead, pause=x * spell, band=y * held) for x, y in every]
    elif recipe.jitter is not None:
        noise = recipe.jitter(recipe.gains(s, knobs), s)
        rests = [knobs._replace(dead=max(x * noise, s.least_move)) for x in _DEAD]
    volts = recipe.volts if goal == "energy" else (1.0,)
    needed = _SPARE * s.plant.load_drive * deepest / s.limit
    if len(volts) > 1 and len(rests) > 3:
        rests = rests[::2]
    for rest, share in product(rests, volts):
        if share >= min(needed, 1.0):
            yield rest._replace(volts=share)


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


def float_score(goal: str, t: Trial, held: float) -> tuple[float, ...]:
    """Return what is to be small of a float: the time to its depth, what holding takes, or all.

    Where no energy is known, what is moved counts in its place.
    """
    arrives = t.settle_95 if math.isfinite(t.settle_95) else 1e9
    stays = (round(1.0 - t.settled, 2), max(t.rms / held, 1.0))
    if goal == "fast":
        return (*stays, round(20.0 * math.log(arrives)), t.starts)
    power, energy = (t.power, t.energy) if math.isfinite(t.power) else (t.rate, t.rate)
    return (*stays, energy) if goal == "energy" else (*stays, power, t.starts)
