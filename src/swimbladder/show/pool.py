"""A day at the pool as it is shown: its verdict, its plan with what it should yield, what is known.

What the plan should yield is the Fisher information of its records, without noise, of the vehicle
as assumed.
"""

import math
from collections.abc import Iterator, Mapping
from functools import cached_property, partial
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from swimbladder.design.experiments.conditions import (
    Conditions,
    Flight,
    Question,
    Release,
    Setting,
    follow,
    ramps,
    shares_after,
)
from swimbladder.design.plan import Move
from swimbladder.design.pool_day import PoolDay
from swimbladder.design.pool_day.day import STATE, Task, done_of, state_text
from swimbladder.design.pool_day.verdict import LEAST, MARGIN
from swimbladder.errors import SwimbladderError
from swimbladder.estimation.motion.problem import default_names, model_of
from swimbladder.show.estimates import rows
from swimbladder.show.identification_plots import PER_PAGE, draw_fits
from swimbladder.show.parts import Drawn, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Picture, one_panel

_NOISE = 2e-3  # m, of a depth where the vehicle states none
_NOT_YET = 3.0  # of a parameter: nothing is known of it
_COLORS = (Ink.BLUE, Ink.VERMILION, Ink.GREEN, Ink.PURPLE)


class Expected(NamedTuple):
    """The records that a plan should yield, and the shares of its parameters' errors after each."""

    flights: list[Flight]
    shares: dict[str, list[float]]
    noise: float  # m, 1 sigma


def expected(day: PoolDay) -> Expected | None:
    """Return what the plan should yield; None where that depends on what is not known."""
    asked, tasks = day.asked, day.tasks
    if any(task.start is None for task in tasks) or not math.isfinite(asked.neutral_std):
        return None
    model = model_of(day.vehicle, law=asked.drag, bottom_depth=math.inf)
    names = asked.free or default_names(model.law, list(asked.fixed))
    question = Question(model, tuple(names), dict(asked.fixed), dict(asked.priors))
    known, sensors, law = day.vehicle.identified, day.vehicle.sensors, day.vehicle.controller
    noise = sensors.depth_noise or (known.depth_noise if known else 0.0)
    shallowest = min(task.shallowest for task in tasks)
    setting = Setting(
        bottom_depth=max(task.deepest for task in tasks) + shallowest,
        clearance=shallowest,
        sample_time=0.3 if law is None else law.sample_time,
        noise=noise or (0.0 if sensors.depth_quantum else _NOISE),
        quantum=sensors.depth_quantum,
        neutral_std=asked.neutral_std,
        drift_std=asked.drift_std,
        delay_std=asked.delay_std,
        settling=0.0,
        rest=day.rules.before,
        longest=min(task.longest for task in tasks),
        largest=math.inf,
        moves=1 + max(len(task.turns) for task in tasks),
    )
    try:
        c = Conditions(question, setting, ramps(day.vehicle, setting), day.vehicle)
        flights = [_ended(follow(_release(task), question.values, c), day) for task in tasks]
    except SwimbladderError:
        return None
    after = zip(*shares_after(flights, question.values, c), strict=True)
    shares = {name: list(row) for name, row in zip(question.names, after, strict=True)}
    return Expected(flights, shares, setting.depth_noise)


def _release(task: Task) -> Release:
    assert task.start is not None
    return Release(task.start, (Move(volume=task.change), *task.turns))


def _ended(flight: Flight, day: PoolDay) -> Flight:
    """Return a record to where the travel of the day's rules ends it."""
    gone = np.abs(flight.depth - flight.release.start) > day.rules.travel
    end = int(np.argmax(gone)) + 1 if gone.any() else len(gone)
    cut = {name: getattr(flight, name)[:end] for name in ("time", "volume", "depth")}
    return flight._replace(**cut)


def draw_plan(plan: Expected) -> Picture:
    """Return the depths to expect in each experiment of the plan."""
    picture, panel = one_panel((8.0, 4.2), y="depth [m]")
    sizes = sorted({abs(flight.release.moves[0].volume) for flight in plan.flights})
    for flight in plan.flights:
        change = flight.release.moves[0].volume
        color = _COLORS[sizes.index(abs(change)) % len(_COLORS)]
        time = flight.time - flight.time[flight.moved[0]]
        dash, label = "-" if change < 0.0 else "--", f"{1e6 * change:+.3g} cm³"
        panel.line(time, flight.depth, color, label.replace("-", "\u2212"), dash=dash)
    panel.x = "time since the release [s]"
    return picture


def draw_precision(day: PoolDay, plan: Expected) -> Picture:
    """Return the expected errors as experiments are done, the targets, and those of now."""
    picture, panel = one_panel((8.0, 4.2), ylog=True, counts="x", legend="beside")
    aims = {target.name: target for target in day.asked.targets}
    for (name, shares), color in zip(plan.shares.items(), _COLORS, strict=False):
        some = np.array([100.0 * x if x < _NOT_YET else np.nan for x in shares])
        how: Any = {"dash": "--", "marker": "o", "size": 4.0, "hollow": True}
        panel.line(np.arange(1, len(shares) + 1), some, color, f"{name}, expected", **how)
        aim, e = aims.get(name), day.found and day.found.parameters.get(name)
        if aim is not None and aim.relative:
            at = 100.0 * aim.std / MARGIN
            panel.rule("y", at, color, f"{name}, target", dash=":", width=1.1)
        if e and e.std and e.value:
            now = len(day.kept), 100.0 * e.std / abs(e.value)
            panel.dots(*now, "D", color, f"{name}, now")
    panel.x, panel.y = "experiments done", "1 sigma [% of the parameter]"
    return picture


class PoolDayShown(Shown[PoolDay]):
    """The verdict, what is next and what is known; the plan, when to stop, what it should yield."""

    name, kind = "pool", "day at the pool"

    @cached_property
    def plan(self) -> Expected | None:
        """What the plan should yield."""
        return expected(self.found)

    @property
    def good(self) -> bool:
        """Whether the parameters are good enough, where there are any."""
        return self.found.verdict.good or self.found.found is None

    @property
    def exit_code(self) -> int:
        """0 where the parameters are good enough."""
        return 0 if self.found.verdict.good else 1

    def files(self) -> Mapping[str, object]:
        """Return pool.json, as it is written as the day goes."""
        return {STATE: state_text(self.found.state())}

    def table(self) -> Any:
        """Return the columns of the experiments."""
        day = self.found
        words = "number released_s change_m3 travel_m rest_depth_m rest_speed_m_s"
        return {word: np.array([getattr(k, word) for k in day.kept]) for word in words.split()}

    def parts(self) -> Iterator[Part]:
        """Give the verdict, what is next, what is known, and the plan."""
        day = self.found
        yield day.verdict.sentence
        if not day.verdict.good:
            yield f"Next: {day.next.sentence()}"
        if day.found is not None:
            yield parameter_table(day)
            yield experiment_table(day)
            for first in range(0, len(day.kept), PER_PAGE):
                name = f"fits-{first // PER_PAGE + 1}"
                yield Drawn(name, partial(draw_fits, day.found, first), "fits")
        yield task_table(day)
        if self.plan is not None:
            yield Drawn("plan", partial(draw_plan, self.plan), "pool-plan")
            yield Drawn("precision", partial(draw_precision, day, self.plan))
        yield from labelled("note", _rules(day, self.plan))
        yield from labelled("note", (f"refused: {one.sentence}" for one in day.refused))
        yield from labelled(
            "note", (f"set aside: experiment {k.number}: {k.set_aside}" for k in day.aside)
        )


def _rules(day: PoolDay, plan: Expected | None) -> Iterator[str]:
    """Give when to stop, when an experiment is over, and what the plan was computed with."""
    aims, r = " and ".join(target.text() for target in day.asked.targets), day.rules
    enough = f"after at least {LEAST} experiments without a warning"
    yield f"stop when {aims} are known, with a margin of {MARGIN:g}, {enough}"
    ends = f"after {r.travel:g} m" if math.isfinite(r.travel) else "at the end of the plan's range"
    yield f"an experiment is over {ends}, at surface or bottom, or after {r.longest:g} s"
    if plan is not None:
        yield f"expected with {1e3 * plan.noise:.2g} mm of noise of the depth (1 sigma)"


def task_table(day: PoolDay) -> Table:
    """Return the plan: what to do, and how often it is done."""
    counts = done_of(day.tasks, [k.change_m3 for k in day.kept])
    rows = []
    for number, (task, count) in enumerate(zip(day.tasks, counts, strict=True), 1):
        turns = "; ".join(f"{1e6 * t.volume:+.3g} cm3 at {t.depth:g} m" for t in task.turns)
        where = "" if task.start is None else f"{task.start:.2f} m"
        rows.append((str(number), where, f"{1e6 * task.change:+.3g} cm3", turns, str(count)))
    heads = ("", "rest at", "change", "then", "done")
    return Table(heads, rows, left=("then",), title="The plan", later=True)


def experiment_table(day: PoolDay) -> Table:
    """Return the experiments so far."""
    fits = day.found.experiments if day.found is not None else ()
    rows = []
    for k, fit in zip_longest(day.kept, fits[: len(day.kept)]):
        off = fit and f"{1e6 * fit.estimates['neutral_error'].value:+.2f} cm3"
        change, travel = f"{1e6 * k.change_m3:+.3g} cm3", f"{k.travel_m:+.2f} m"
        rows.append((str(k.number), change, travel, str(len(k.log)), off or ""))
    heads = ("", "change", "travel", "samples", "neutral off by")
    return Table(heads, rows, left=(), title="Experiments so far", later=True)


def parameter_table(day: PoolDay) -> Table:
    """Return the parameters with their intervals, beside how well they are to be known."""
    assert day.found is not None
    aims = {t.name: t for t in day.asked.targets}
    listed = []
    for r in rows(day.found):
        e = day.found.parameters.get(r.name)
        if e is None:
            continue
        aim = aims.get(r.name)
        goal = known = ""
        if aim is not None:
            goal = f"{100.0 * aim.std:.3g} %" if aim.relative else f"{aim.std:.3g} {e.unit}"
        if r.std and e.value:
            known = f"{100.0 * e.std / abs(e.value):.2g} %"
        listed.append((r.name, r.value, r.std, r.ci95, r.unit, known, goal))
    headings = ("", "value", "1 sigma", "95 % interval", "unit", "known to", "target")
    return Table(headings, listed)
