"""On which side the motor turns, sample by sample, where load and friction depend on it.

With the sides given, a plan is a convex program. Which to give is not: a plan is improved by
turning samples over, as long as that takes less. Worth turning are those at an edge between the
sides, where a motor that stands may be held by less voltage, and those in which it stands at the
edge of its side and, at a price, would rather be beyond it. What comes out none of these betters.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from swimbladder.design.planning.linear_program import Answer, Flags
from swimbladder.design.planning.nominal_trajectory import (
    NominalTrajectory,
    Program,
    backward,
    settle,
)
from swimbladder.design.planning.task import Task
from swimbladder.errors import NoAnswerError

_STRIDES = (12, 4, 1)  # samples by which an edge is moved
_BETTER = 1e-6  # the share that is less
_WORTH = 1e-6  # of the largest price, below which a sample is where it wants to be


def best_load_direction(task: Task, program: Program, nominal: NominalTrajectory) -> Answer | None:
    """Return the answer whose sides no turn betters, from those of a course; None: there is none.

    Raises NoAnswerError as `settle` does.
    """
    back = backward(nominal)
    answer, nominal = settle(task, program, nominal, back=back)
    if answer is None:  # not on these sides: begin with any that there are
        free, nominal = settle(task, program, nominal)
        if free is None:
            return None
        back = backward(nominal)
        answer, nominal = settle(task, program, nominal, back=back)
        if answer is None:
            return free
    found = _LoadDirections(task, program, answer, nominal, back)
    while found.move_edges() or found.turn_priced():
        pass
    return found.answer


class _LoadDirections:
    """The best answer so far, its course, and the sides [n] that it is for."""

    def __init__(
        self, task: Task, program: Program, answer: Answer, nominal: NominalTrajectory, back: Flags
    ) -> None:
        self.task, self.program = task, program
        self.answer, self.nominal, self.back = answer, nominal, back

    def betters(self, back: Flags) -> bool:
        """Try other sides, and keep them where they take less."""
        try:
            answer, nominal = settle(self.task, self.program, self.nominal, back=back)
        except NoAnswerError:
            return False
        enough = self.answer.objective - _BETTER * abs(self.answer.objective)
        if answer is None or answer.objective >= enough:
            return False
        self.answer, self.nominal, self.back = answer, nominal, back
        return True

    def move_edges(self) -> bool:
        """Move the edges between the sides by ever less; return whether that was any good."""
        moved = False
        for stride in _STRIDES:
            while any(self.betters(back) for back in _moved(self.back, stride)):
                moved = True
        return moved

    def turn_priced(self) -> bool:
        """Turn those over that would rather be beyond, ever fewer; return whether it was good."""
        prices, share = self.answer.prices, 1.0
        assert prices is not None
        wanting = np.flatnonzero(prices > _WORTH * prices.max())
        wanting = wanting[np.argsort(-prices[wanting], kind="stable")]
        while (count := int(share * len(wanting))) > 0:
            back = self.back.copy()
            back[wanting[:count]] = ~back[wanting[:count]]
            if self.betters(back):
                return True
            share *= 0.5
        return False


def _moved(back: Flags, stride: int) -> Iterator[Flags]:
    """Yield the sides with each edge between them moved, either way."""
    for k in np.flatnonzero(back[1:] != back[:-1]) + 1:
        for part, side in (
            (slice(k, k + stride), back[k - 1]),
            (slice(max(k - stride, 0), k), back[k]),
        ):
            other = back.copy()
            other[part] = side
            yield other
