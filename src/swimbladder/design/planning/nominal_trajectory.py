"""A program solved again and again about its own last answer, until the two agree.

Drag is not linear in the speed, and load and friction change side with the motor: a plan is right
only for the course that its program was made for.

On which side the motor turns, sample by sample, where load and friction depend on it.

With the sides given, a plan is a convex program. Which to give is not: a plan is improved by
turning samples over, as long as that takes less. Worth turning are those at an edge between the
sides, where a motor that stands may be held by less voltage, and those in which it stands at the
edge of its side and, at a price, would rather be beyond it. What comes out none of these betters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from swimbladder.design.linear.models import Array
from swimbladder.design.planning.linear_program import Answer, Flags, Near, scale_of
from swimbladder.design.planning.task import STATES, Steps, Task, steps_along
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
