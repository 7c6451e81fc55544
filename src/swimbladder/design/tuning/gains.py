"""Gains of each law that is tuned, as its recipe makes them.

What is tried depends on law and goal. Frequencies are shares of the inner rate, sleeps of the time
in which a held volume lets the vehicle run away, holds of the one in which a neutral volume that
walks takes it off.

`setting_of` is what they need to know of a vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

from swimbladder.control.law import Drive, Knobs, Law, Recipe, Setting
from swimbladder.control.motion import off_in, runaway
from swimbladder.control.registry import LAWS
from swimbladder.design.linear.pump_valve import drive_rates, moved_by_volume, with_supply
from swimbladder.design.tuning.region import neutral_walk
from swimbladder.design.tuning.trial import Trial
from swimbladder.errors import InputError
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import PumpAndValve, Vehicle
from swimbladder.vehicle.schema import did_you_mean

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


_FINEST = 0.5e-3  # m, noise that a filter assumes at least
_LEAST = 1e-4  # of the stroke: volumes below are none


def setting_of(
    vehicle: Vehicle,
    *,
    sample_time: float,
    supply: float,
    neutral_range: float,
    depths: Sequence[float] = (),
) -> Setting:
    """Return what the gains need of a vehicle; supply [V]: the least that it will have.

    depths [m]: between which a pump and valve has to work.
    """
    sensors = vehicle.sensors
    noise = math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
    if vehicle.identified is not None:
        noise = max(noise, vehicle.identified.depth_noise)
    p = plant(moved_by_volume(vehicle))
    volume_noise = math.hypot(sensors.volume_noise, sensors.volume_quantum / math.sqrt(12.0))
    least = max(3.0 * volume_noise, _LEAST * (p.V_max - p.V_min))
    return Setting(
        p,
        sample_time,
        max(noise, _FINEST),
        supply,
        neutral_range,
        least,
        neutral_walk(vehicle),
        _drive(vehicle, supply, depths, neutral_range),
    )


def _drive(
    vehicle: Vehicle, supply: float, depths: Sequence[float], neutral_range: float
) -> Drive | None:
    a, stroke = vehicle.actuator, vehicle.stroke
    if not isinstance(a, PumpAndValve) or not depths:
        return None
    rates = drive_rates(with_supply(vehicle, supply), depths)
    neutral = [vehicle.neutral_volume(z) for z in depths]
    room = min(stroke.maximum - max(neutral), min(neutral) - stroke.minimum)
    return Drive(
        rate_out=min(rates.pump),
        rate_in=min(rates.valve),
        start=max(rates.start_volume),
        tick=a.quantum,
        longest=a.longest_run or math.inf,
        room=room - neutral_range,
    )


def check_depths(depths: tuple[float, float], surface: float = 0.0) -> None:
    """Raise InputError for what is no range of depths [m] that ends below `surface`."""
    if not (0.0 <= depths[0] < depths[1] < math.inf and depths[1] > surface):
        raise InputError(
            "no range of depths", field="--depth", value=f"{depths[0]:g}:{depths[1]:g}", unit="m",
            remedy="Give the least and the greatest, like 0:100",
        )  # fmt: skip


def tunable_names(command: str | None = None) -> list[str]:
    """Return the names of the laws that are tuned, of those that give a command where named."""
    return [
        name
        for name, law in LAWS.items()
        if law.recipe is not None and command in (None, law.command)
    ]


def tunable(name: str) -> Law:
    """Return the law of that name; raises InputError where it is not one that is tuned."""
    law = LAWS.get(name)
    if law is None or law.recipe is None:
        names = tunable_names()
        raise InputError(
            "this law is not tuned", field="--law", value=name,
            remedy=f"{did_you_mean(name, names)}Choose from {', '.join(names)}",
        )  # fmt: skip
    return law


def recipe_of(name: str) -> Recipe:
    """Return how the parameters of that law are made; raises InputError where it is not tuned."""
    recipe = tunable(name).recipe
    assert recipe is not None
    return recipe


def gains(name: str, setting: Setting, knobs: Any) -> Any:
    """Return the parameters of the law of that name."""
    return recipe_of(name).gains(setting, knobs)
