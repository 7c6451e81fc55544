"""Which experiments are due: those of a plan, or the paper's, cut to the vehicle's stroke."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from swimbladder.design.plan import Move, Plan
from swimbladder.vehicle import Vehicle

PAPER = (20e-6, 30e-6, 45e-6, 75e-6)  # m3, section 3.1, each up and down
_SHARE = 0.5  # of the volume that is free to either side of neutral
_ALIKE = 1.25  # factor between two changes of volume that count as the same
_MARGIN = 0.05  # m, of surface and bottom that counts as arrived


class Task(NamedTuple):
    """An experiment to do: from rest, changes of volume, until the depth leaves a range."""

    change: float  # m3, positive: it rises
    start: float | None  # m, depth of rest; None: not known
    turns: tuple[Move, ...] = ()  # changes of volume under way
    shallowest: float = 0.0  # m
    deepest: float = math.inf  # m
    longest: float = 1200.0  # s

    def sentence(self) -> str:
        """Return what to do, from the beginning."""
        place = "near the surface, all of it under water"
        if self.start is not None:
            place = f"at {self.start:.2f} m"
        elif self.change > 0.0:
            place = "near the bottom, clear of it"
        return f"Bring the vehicle to rest {place}; {self._change()}."

    def release(self) -> str:
        """Return what to do once the vehicle is at rest."""
        text = self._change()
        return f"{text[0].upper()}{text[1:]}."

    def _change(self) -> str:
        how, way = ("increase", "rise") if self.change > 0.0 else ("decrease", "sink")
        size = f"{1e6 * abs(self.change):.3g} cm3 from the mean of the last minute"
        first = f"{how} its volume by {size}"
        if not self.turns:
            return f"{first}, and let it {way} without moving the piston"
        then = "; ".join(
            f"when it passes {turn.depth:g} m on its way {turn.going}, go to "
            f"{1e6 * turn.volume:+.3g} cm3 of that mean"
            for turn in self.turns
        )
        return f"{first}; {then}"


def paper_tasks(
    vehicle: Vehicle, *, pool_depth: float | None, clearance: float = 0.75
) -> tuple[Task, ...]:
    """Return the paper's eight experiments, smaller where the stroke is too short for them.

    pool_depth: depth of the bottom [m], None where it is not known; clearance: Delta_z [m], of the
    depths of rest from bottom and surface.
    """
    top = vehicle.hull.emergence_depth
    deep, shallow, end = None, None, math.inf
    if pool_depth is not None:
        clearance = min(clearance, (pool_depth - top) / 4.0)
        deep, shallow, end = pool_depth - clearance, top + clearance, pool_depth - _MARGIN
    stroke = vehicle.stroke
    most, least = (vehicle.neutral_volume(top if z is None else z) for z in (deep, shallow))
    room = min(stroke.maximum - most, least - stroke.minimum)
    factor = min(1.0, _SHARE * room / PAPER[-1])
    tasks = []
    for size in PAPER:
        change = float(f"{factor * size:.2g}")
        for sign, start in ((1.0, deep), (-1.0, shallow)):
            tasks.append(Task(sign * change, start, shallowest=top + _MARGIN, deepest=end))
    return tuple(tasks)


def plan_tasks(plan: Plan) -> tuple[Task, ...]:
    """Return the experiments of a plan."""
    ends = plan.shallowest, plan.deepest
    return tuple(
        Task(one.moves[0].volume, one.start_depth, one.moves[1:], *ends, one.longest)
        for one in plan.experiments
    )


def next_task(tasks: Sequence[Task], done: Sequence[float]) -> Task:
    """Return the task that is due: the first of those done least often.

    done: first changes of volume of the experiments so far [m3].
    """
    counts = _counts(tasks, done)
    return tasks[counts.index(min(counts))]


def undone(tasks: Sequence[Task], done: Sequence[float]) -> int:
    """Return how many tasks have not been done yet; done: as for next_task."""
    return _counts(tasks, done).count(0)


def _counts(tasks: Sequence[Task], done: Sequence[float]) -> list[int]:
    counts = [0] * len(tasks)
    for change in done:
        alike = [change and 1.0 / _ALIKE <= task.change / change <= _ALIKE for task in tasks]
        fitting = [i for i, fits in enumerate(alike) if fits]
        if fitting:
            counts[min(fitting, key=lambda i: counts[i])] += 1
    return counts
