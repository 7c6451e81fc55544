"""On which side the motor turns, sample by sample, where load and friction depend on it.

With the sides given, a plan is a convex program. Which to give is not: a plan is improved by
turning those samples over in which the motor stands at the edge of its side and, at a price, would
rather be beyond it, as long as that takes less. What comes out no such change betters.
"""

from __future__ import annotations

import numpy as np

from swimbladder.errors import NoAnswerError
from swimbladder.planning.course import Course, Program, backward, settle_course
from swimbladder.planning.programme import Answer
from swimbladder.planning.task import Task

__all__ = ["best_sides"]

_TURNS = 60  # tries
_BETTER = 1e-6  # the share that is less
_WORTH = 1e-6  # of the largest price, below which a sample is where it wants to be


def best_sides(task: Task, program: Program, course: Course) -> Answer | None:
    """Return the answer whose sides no turn betters, from those of a course; None: there is none.

    Raises NoAnswerError as `settle_course` does.
    """
    back = backward(course)
    answer, course = settle_course(task, program, course, back=back)
    if answer is None:  # not on these sides: begin with any that there are
        free, course = settle_course(task, program, course)
        if free is None:
            return None
        back = backward(course)
        answer, course = settle_course(task, program, course, back=back)
        if answer is None:
            return free
    share = 1.0
    for _ in range(_TURNS):
        assert answer.prices is not None
        wanting = np.flatnonzero(answer.prices > _WORTH * answer.prices.max())
        count = int(share * len(wanting))
        if count == 0:
            break
        chosen = wanting[np.argsort(-answer.prices[wanting], kind="stable")[:count]]
        turned = back.copy()
        turned[chosen] = ~turned[chosen]
        enough = answer.objective - _BETTER * abs(answer.objective)
        try:
            other, along = settle_course(task, program, course, back=turned)
        except NoAnswerError:
            other = None
        if other is not None and other.objective < enough:
            answer, course, back, share = other, along, turned, 1.0
        else:
            share *= 0.5
    return answer
