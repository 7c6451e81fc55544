"""The least time of a step of depth that any controller can have, by linear programs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from threadpoolctl import threadpool_limits

from swimbladder.design.planning.linear_program import Answer, Goal, Near, scale_of, solve
from swimbladder.design.planning.nominal_trajectory import (
    AGREE,
    NominalTrajectory,
    resting,
    settle,
    stretched,
)
from swimbladder.design.planning.task import Steps, Task, task_of
from swimbladder.errors import NoAnswerError
from swimbladder.vehicle import Vehicle

MOST_SAMPLES = 4000
_HOLDS = 1e-6  # scaled slack that counts as none
_ROUGHLY = 3e-3  # agreement of a course while the number of samples is looked for
_TAIL = 2.0  # rest is reached after this many times the least time to it


class LeastTime(NamedTuple):
    """The first sample from which on the demand is met for good, and the proof that none before.

    short: what is lacking one sample earlier, by linear programming's optimum, whose dual bound
    (gap) says that no voltages do better, with drag and friction as they are along that plan:
    distance from the band [m], or of the state at rest from rest over its scale [-].
    """

    time: float  # s
    samples: int
    short: float
    gap: float  # of primal and dual objective there


class Found(NamedTuple):
    """What the search leaves: the least time, the sample at which rest is asked for, the course."""

    least: LeastTime
    rest: int
    nominal: NominalTrajectory


def least_time(
    vehicle: Vehicle, start: float, target: float, *, rest: bool = False,
    sample_time: float | None = None, supply: float | None = None, band: float = 0.02,
    margin: float = 0.0, speed_limit: float | None = None, bottom_depth: float = math.inf,
) -> LeastTime:  # fmt: skip
    """Return the least time [s] from rest at `start` to `target` [m] that the vehicle allows.

    To be within `band` [-] of the step for good; with `rest`, to be at rest there exactly. The
    other arguments are those of `task_of`. A lower bound for every controller that is sampled with
    `sample_time` [s], as the model has the vehicle. Raises InputError and NoAnswerError as
    `task_of` does; NoAnswerError beyond 4000 samples.
    """
    task = task_of(
        vehicle, start, target, sample_time=sample_time, supply=supply, band=band, margin=margin,
        speed_limit=speed_limit, bottom_depth=bottom_depth,
    )  # fmt: skip
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        return search_least(task, rest=rest).least


def search_least(
    task: Task, *, rest: bool, advance: Callable[[float], None] | None = None
) -> Found:
    """Return the least time and the course that takes it, by bisection; advance: as in `plan`."""
    report = advance or (lambda _: None)
    nominal = resting(1)

    def slack(n: int, end: int, relaxed: str, agree: float) -> Answer:
        nonlocal nominal
        goal = Goal(near=n if relaxed == "near" else None, rest=end, relaxed=relaxed)

        def program(steps: Steps, near: Near) -> Answer | None:
            report(1.0)
            return solve(task, steps, goal, near)

        answer, settled = settle(task, program, stretched(nominal, end), agree=agree)
        if answer is None:
            raise NoAnswerError(
                "no motion is within the limits at all: leave less margin, or allow more speed"
            )
        if answer.objective <= _HOLDS:
            nominal = settled
        return answer

    high = _reached(task, lambda n, agree: slack(n, n, "rest", agree))
    at_rest, missed = _bisect(lambda n, agree: slack(n, n, "rest", agree), high // 2, high)
    if rest:
        return Found(_least(task, at_rest, missed, 1.0), at_rest, stretched(nominal, at_rest))
    end = min(math.ceil(_TAIL * at_rest), MOST_SAMPLES)
    settled, missed = _bisect(lambda n, agree: slack(n, end, "near", agree), 0, at_rest)
    size = float(scale_of(task).state[2])
    return Found(_least(task, settled, missed, size), end, stretched(nominal, end))


def _reached(task: Task, slack: Callable[[int, float], Answer]) -> int:
    """Return a number of samples that suffices, at most twice too many."""
    n = max(math.ceil(task.brisk / task.sample_time), 4)
    while n <= MOST_SAMPLES:
        if slack(n, _ROUGHLY).objective <= _HOLDS:
            return n
        n *= 2
    raise NoAnswerError(
        f"the duration: rest at {task.target:g} m is not reached in {MOST_SAMPLES} samples of "
        f"{task.sample_time:g} s. Plan with a longer sample time (--sample-time), a larger stroke, "
        "or a higher supply or speed limit"
    )


def _bisect(slack: Callable[[int, float], Answer], low: int, high: int) -> tuple[int, Answer]:
    """Return the least n without slack, and the answer for n - 1, both on settled courses."""
    while high - low > 1:
        middle = (low + high) // 2
        if slack(middle, _ROUGHLY).objective <= _HOLDS:
            high = middle
        else:
            low = middle
    while slack(high, AGREE).objective > _HOLDS:
        high += 1
    missed = slack(max(high - 1, 1), AGREE)
    while missed.objective <= _HOLDS and high > 1:
        high -= 1
        missed = slack(max(high - 1, 1), AGREE)
    return high, missed


def _least(task: Task, n: int, missed: Answer, size: float) -> LeastTime:
    return LeastTime(n * task.sample_time, n, missed.objective * size, missed.gap)
