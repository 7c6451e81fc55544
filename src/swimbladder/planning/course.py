"""A program solved again and again about its own last answer, until the two agree.

Drag is not linear in the speed, and load and friction change side with the motor: a plan is right
only for the course that its program was made for.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from swimbladder.dynamics import Plant
from swimbladder.errors import NoAnswerError
from swimbladder.linear.models import Array
from swimbladder.planning.motion import STATES, Steps, steps_along
from swimbladder.planning.programme import Answer, scale_of
from swimbladder.planning.task import Task

__all__ = ["AGREE", "Course", "Program", "resting", "settle_course", "stretched"]

_FREE = 4  # rounds without a leash: Newton's method mostly needs fewer
_LEASH = 0.6  # what it shrinks by
_ROUNDS = 25
AGREE = 1e-5  # of the scale of speed
_NEARLY = 1e-2  # the same, with which a plan is refused


class Course(NamedTuple):
    """What the steps are linearised about, at each sample [n + 1]."""

    speed: Array  # m/s
    rate: Array  # m3/s, of the motor


class Program(Protocol):
    """What finds the optimum for given steps, speeds kept near `around`; None: there is none."""

    def __call__(self, steps: Steps, around: tuple[Array, float] | None) -> Answer | None:
        """Return the optimum."""


def resting(n: int) -> Course:
    """Return the course of a vehicle that stays where it is for n samples."""
    return Course(np.zeros(n + 1), np.zeros(n + 1))


def stretched(course: Course, n: int) -> Course:
    """Return a course drawn out, or pressed together, to n samples."""
    if len(course.speed) == n + 1:
        return course
    old, new = np.linspace(0.0, 1.0, len(course.speed)), np.linspace(0.0, 1.0, n + 1)
    return Course(np.interp(new, old, course.speed), np.interp(new, old, course.rate))


def settle_course(
    task: Task, program: Program, course: Course, *, agree: float = AGREE
) -> tuple[Answer | None, Course]:
    """Return the answer that agrees with its own course, and that course.

    agree: largest difference of their speeds, over the scale of speed [-]. None where the program
    has no answer. Raises NoAnswerError where the rounds do not settle.
    """
    p, h = task.plant, task.sample_time
    w = STATES.index("w")
    size = float(scale_of(task).state[w])
    reach, gap = math.inf, math.inf
    for turn in range(_ROUNDS):
        steps = steps_along(p, h, course.speed, course.rate)
        around = None if math.isinf(reach) else (course.speed, reach)
        answer = program(steps, around)
        if answer is None:
            if around is None:
                return None, course
            reach *= 2.0 / _LEASH
            continue
        new = Course(answer.states[:, w], answer.states[:, 0])
        if _one_course(p):
            return answer, new
        gap = float(np.abs(new.speed - course.speed).max()) / size
        same = bool(((new.rate < 0.0) == (course.rate < 0.0))[_turns(task, new.rate)].all())
        course = new
        # The side of a motor that has nothing to do is anybody's: it matters where the plan does.
        if gap < agree and (same or agree > AGREE or not _sided(p)):
            return answer, course
        if turn >= _FREE:
            reach = min(reach * _LEASH, gap * size)
    if answer is None or gap > _NEARLY:
        raise NoAnswerError(
            f"the plan does not settle: after {_ROUNDS} rounds its drag is still for speeds that "
            f"differ by {100.0 * gap:.2g} %. Plan with a shorter sample time (--sample-time)"
        )
    return answer, course


def _turns(task: Task, rate: Array) -> Array:
    """Return where the motor turns, and not just creeps."""
    turning: Array = np.abs(rate) > 1e-3 * scale_of(task).state[0]
    return turning


def _sided(p: Plant) -> bool:
    return bool(p.friction > 0.0 or p.load_drive != p.load_back)


def _one_course(p: Plant) -> bool:
    """Whether the steps are the same along every course."""
    return p.d_t == 0.0 and p.d_0 == 0.0 and p.d_b in (0.0, p.d_l) and not _sided(p)
