"""Which law `tune` takes where none is named, and why."""

import math
from collections.abc import Mapping

from swimbladder.design.tuning import gains
from swimbladder.design.tuning.result import Tuning
from swimbladder.design.tuning.trial import Trial
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

SOONER = 1.05  # times the time of the fastest law, within which the quietest is taken
MOVED = 10e-3 / 3600.0  # m3/s, that a fast law is to move at most while it holds a depth


def laws_for(vehicle: Vehicle, goal: str) -> list[str]:
    """Return the names of the laws among which one is chosen for a vehicle and a goal.

    For holding a depth those that rest there.
    """
    names = gains.tunable_names(vehicle.command)
    recipes = {name: gains.recipe_of(name) for name in names}
    fit = [name for name, recipe in recipes.items() if goal in gains.goals_of(recipe)]
    resting = [n for n in fit if recipes[n].holds or recipes[n].holds_best]
    return fit if goal == "fast" or not resting else resting


def choose(tunings: Mapping[str, Tuning], goal: str) -> tuple[str, str]:
    """Return the name of the law that is taken, and why in a sentence.

    tunings: one of each law. Those that keep their promises come first, then those that the
    supervisor leaves alone in waves. A fast law: of those that move little, or of all where none
    does, the quietest that is hardly slower than the fastest. For another goal: the best by what
    the goal wants to be small.
    """
    if len(tunings) == 1:
        return next(iter(tunings)), ""
    kept = {name: t for name, t in tunings.items() if not t.unmet} or dict(tunings)
    calm = {name: t for name, t in kept.items() if not t.waves > 0.0} or kept
    if goal != "fast":
        order = sorted(calm, key=lambda name: gains.score(goal, calm[name].region, calm[name].held))
        return order[0], _because(order, tunings, goal, f"is the best for {goal}")
    little = {name: t for name, t in calm.items() if t.region.rate <= MOVED} or calm
    first = min(_time(t.region) for t in little.values())
    near = {name: t for name, t in little.items() if _time(t.region) <= SOONER * first}
    order = sorted(near, key=lambda name: near[name].region.rate)
    taken = tunings[order[0]].region
    limit = f"at most {3.6e6 * MOVED:.3g} L an hour" if taken.rate <= MOVED else "any volume"
    rest = sorted((n for n in tunings if n not in near), key=lambda n: _time(tunings[n].region))
    share = f"{100.0 * (SOONER - 1.0):.0f} %"
    why = f"is the quietest of those within {share} of the fastest that moves {limit}"
    return order[0], _because([*order, *rest], tunings, goal, why)


def _time(t: Trial) -> float:
    return t.settle_95 if math.isfinite(t.settle_95) else math.inf


def _because(order: list[str], tunings: Mapping[str, Tuning], goal: str, why: str) -> str:
    """Return the sentence on a choice; order: the law that is taken, then the runner-up."""
    said = [_figures(tunings[name], goal) for name in order[:2]]
    sentence = f"The law {order[0]} {why} ({said[0]})"
    if len(order) > 1:
        sentence += f"; the runner-up is {order[1]} ({said[1]})"
    return f"{sentence}."


def _figures(t: Tuning, goal: str) -> str:
    r = t.region
    if goal == "fast":
        settle = f"{r.settle_95:.1f} s" if math.isfinite(r.settle_95) else "never settled"
        said = f"{settle}, {3.6e6 * r.rate:.2g} L an hour"
    elif goal == "energy":
        said = f"{rounded(r.energy, 3)} J a trial, {1e3 * r.rms:.2g} mm rms"
    else:
        moved = f"{1e3 * r.rms:.2g} mm rms, {3.6e6 * r.rate:.2g} L"
        said = (
            f"{moved}, {3600.0 * r.starts:.0f} starts and {3600.0 * r.turns:.0f} reversals an hour"
        )
    if t.waves > 0.0:
        said += f", the supervisor takes over in {100.0 * t.waves:.0f} % of half hours in waves"
    return said + (", not as promised" if t.unmet else "")
