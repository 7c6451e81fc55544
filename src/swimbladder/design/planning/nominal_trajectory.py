"""A program solved again and again about its own last answer, until the two agree.

Drag is not linear in the speed, and load and friction change side with the motor: a plan is right
only for the course that its program was made for.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from swimbladder.design.linear.models import Array
from swimbladder.design.planning.linear_program import Answer, Flags, Near, scale_of
from swimbladder.design.planning.motion import STATES, Steps, steps_along
from swimbladder.design.planning.task import Task
from swimbladder.errors import NoAnswerError
from swimbladder.physics.dynamics import Plant

_FREE = 4  # rounds without a leash: Newton's method mostly needs fewer
_LEASH = 0.6  # what it shrinks by
_ROUNDS = 25
AGREE = 1e-5  # of the scale of speed
_NEARLY = 1e-2  # the same, with which a plan is refused


class NominalTrajectory(NamedTuple):
    """What the steps are linearised about, at each sample [n + 1]."""

    speed: Array  # m/s
    rate: Array  # m3/s, of the motor


class Program(Protocol):
    """What finds the optimum for given steps and, as `posed` has it, where to stay; or None."""

    def __call__(self, steps: Steps, near: Near, /) -> Answer | None:
        """Return the optimum."""


def resting(n: int) -> NominalTrajectory:
    """Return the course of a vehicle that stays where it is for n samples."""
    return NominalTrajectory(np.zeros(n + 1), np.zeros(n + 1))


def stretched(nominal: NominalTrajectory, n: int) -> NominalTrajectory:
    """Return a course drawn out, or pressed together, to n samples."""
    if len(nominal.speed) == n + 1:
        return nominal
    old, new = np.linspace(0.0, 1.0, len(nominal.speed)), np.linspace(0.0, 1.0, n + 1)
    return NominalTrajectory(np.interp(new, old, nominal.speed), np.interp(new, old, nominal.rate))


def backward(nominal: NominalTrajectory) -> Flags:
    """Return in which samples [n] the motor is driven back."""
    return 0.5 * (nominal.rate[1:] + nominal.rate[:-1]) < 0.0


def settle(
    task: Task,
    program: Program,
    nominal: NominalTrajectory,
    *,
    agree: float = AGREE,
    back: Flags | None = None,
) -> tuple[Answer | None, NominalTrajectory]:
    """Return the answer that agrees with its own course, and that course.

    agree: largest difference of their speeds, over the scale of speed [-]. back: in which samples
    [n] the motor is held to be driven back, and to drive in the others; None: where it comes out
    so. None where the program has no answer. Raises NoAnswerError where the rounds do not settle.
    """
    p, h = task.plant, task.sample_time
    w = STATES.index("w")
    size = float(scale_of(task).state[w])
    reach, gap = math.inf, math.inf
    for turn in range(_ROUNDS):
        now = backward(nominal) if back is None else back
        leash = None if math.isinf(reach) else (nominal.speed, reach)
        answer = program(steps_along(p, h, nominal.speed, now), Near(leash, back))
        if answer is None:
            if leash is None:
                return None, nominal
            reach *= 2.0 / _LEASH
            continue
        new = NominalTrajectory(answer.states[:, w], answer.states[:, 0])
        if straight(p) and (back is not None or not sided(p)):
            return answer, new
        gap = float(np.abs(new.speed - nominal.speed).max()) / size
        same = bool(((new.rate < 0.0) == (nominal.rate < 0.0))[_turns(task, new.rate)].all())
        nominal = new
        # The side of a motor that has nothing to do is anybody's: it matters where the plan does.
        if gap < agree and (same or agree > AGREE or back is not None or not sided(p)):
            return answer, nominal
        if turn >= _FREE:
            reach = min(reach * _LEASH, gap * size)
    if answer is None or gap > _NEARLY:
        raise NoAnswerError(
            f"the plan does not settle: after {_ROUNDS} rounds its drag is still for speeds that "
            f"differ by {100.0 * gap:.2g} %. Plan with a shorter sample time (--sample-time)"
        )
    return answer, nominal


def _turns(task: Task, rate: Array) -> Flags:
    """Return where the motor turns, and does not just creep."""
    turning: Flags = np.abs(rate) > 1e-3 * scale_of(task).state[0]
    return turning


def sided(p: Plant) -> bool:
    """Whether load and friction depend on the side on which the motor turns."""
    return bool(p.friction > 0.0 or p.load_drive != p.load_back)


def straight(p: Plant) -> bool:
    """Whether drag is linear in the speed."""
    return p.d_t == 0.0 and p.d_0 == 0.0 and p.d_b in (0.0, p.d_l)
