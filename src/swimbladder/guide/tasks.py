"""Which experiments are due: those of a plan, or the paper's, cut to the vehicle's stroke."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from swimbladder.parameters import Vehicle

__all__ = ["PAPER", "Task", "next_task", "paper_tasks"]

PAPER = (20e-6, 30e-6, 45e-6, 75e-6)  # m3, section 3.1, each up and down
_SHARE = 0.5  # of the volume that is free to either side of neutral
_ALIKE = 1.25  # factor between two changes of volume that count as the same


class Task(NamedTuple):
    """An experiment to do: from rest, a change of volume."""

    change: float  # m3, positive: it rises
    start: float | None  # m, depth of rest; None: not known

    def sentence(self) -> str:
        """Return what to do, from the beginning."""
        up = self.change > 0.0
        place = f"at {self.start:.2f} m" if self.start is not None else (
            "near the bottom, clear of it" if up else "near the surface, all of it under water"
        )  # fmt: skip
        return f"Bring the vehicle to rest {place}; {self._change()}."

    def release(self) -> str:
        """Return what to do once the vehicle is at rest."""
        text = self._change()
        return f"{text[0].upper()}{text[1:]}."

    def _change(self) -> str:
        up, size = self.change > 0.0, f"{1e6 * abs(self.change):.3g} cm3"
        return (
            f"{'increase' if up else 'decrease'} its volume by {size} from the mean of the last "
            f"minute, and let it {'rise' if up else 'sink'} without moving the piston"
        )


def paper_tasks(
    vehicle: Vehicle, *, pool_depth: float | None, clearance: float = 0.75
) -> tuple[Task, ...]:
    """Return the paper's eight experiments, smaller where the stroke is too short for them.

    pool_depth: depth of the bottom [m], None where it is not known; clearance: Delta_z [m], of the
    depths of rest from bottom and surface.
    """
    top = vehicle.hull.emergence_depth
    deep, shallow = None, None
    if pool_depth is not None:
        clearance = min(clearance, (pool_depth - top) / 4.0)
        deep, shallow = pool_depth - clearance, top + clearance
    stroke = vehicle.stroke
    room = min(
        stroke.maximum - vehicle.neutral_volume(deep if deep is not None else top),
        vehicle.neutral_volume(shallow if shallow is not None else top) - stroke.minimum,
    )
    factor = min(1.0, _SHARE * room / PAPER[-1])
    tasks = []
    for size in PAPER:
        change = float(f"{factor * size:.2g}")
        tasks += [Task(change, deep), Task(-change, shallow)]
    return tuple(tasks)


def next_task(tasks: Sequence[Task], done: Sequence[float]) -> tuple[int, Task]:
    """Return the task that is due: the first of those done least often, with its index.

    done: changes of volume [m3].
    """
    counts = [0] * len(tasks)
    for change in done:
        fitting = [i for i, task in enumerate(tasks) if _alike(task.change, change)]
        if fitting:
            counts[min(fitting, key=lambda i: counts[i])] += 1
    at = counts.index(min(counts))
    return at, tasks[at]


def _alike(a: float, b: float) -> bool:
    return a * b > 0.0 and abs(math.log(a / b)) <= math.log(_ALIKE)
