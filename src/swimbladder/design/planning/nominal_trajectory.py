"""A program solved again and again about its own last answer, until the two agree.

Drag is not linear in the speed, and load and friction change side with the motor: a plan is right
only for the course that its program was made for.

The side on which the motor turns, sample by sample, counts where load and friction depend on it.
With the sides given, a plan is a convex program. Which to give is not: a plan is improved by
turning samples over, as long as that takes less. Worth turning are those at an edge between the
sides, where a motor that stands may be held by less voltage, and those in which it stands at the
edge of its side and, at a price, would rather be beyond it. What comes out none of these betters.

`least_time` is that of a step of depth that any controller can have, by linear programs.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol, Unpack

import numpy as np
from threadpoolctl import threadpool_limits

from swimbladder.design.planning.linear_program import Goal, Near, Solved, scale_of, solve
from swimbladder.design.planning.task import STATES, Limits, Steps, Task, steps_along, task_of
from swimbladder.errors import NoAnswerError
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.dynamics import Plant
from swimbladder.vehicle import Vehicle

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

    def __call__(self, steps: Steps, near: Near, /) -> Solved | None:
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
) -> tuple[Solved | None, NominalTrajectory]:
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
        turns = np.abs(new.rate) > 1e-3 * scale_of(task).state[0]  # and does not just creep
        same = bool(((new.rate < 0.0) == (nominal.rate < 0.0))[turns].all())
        nominal = new
        # The side of a motor that has nothing to do is anybody's: it matters where the plan does.
        if gap < agree and (same or agree > AGREE or back is not None or not sided(p)):
            return answer, nominal
        if turn >= _FREE:
            reach = min(reach * _LEASH, gap * size)
    if answer is None or gap > _NEARLY:
        raise NoAnswerError(
            f"the plan does not settle: after {_ROUNDS} rounds its drag is still for speeds that "
            f"differ by {100.0 * gap:.2g} %. Plan with a shorter sample time (`sample_time=`)"
        )
    return answer, nominal


def sided(p: Plant) -> bool:
    """Whether load and friction depend on the side on which the motor turns."""
    return bool(p.friction > 0.0 or p.load_drive != p.load_back)


def straight(p: Plant) -> bool:
    """Whether drag is linear in the speed."""
    return p.d_t == 0.0 and p.d_0 == 0.0 and p.d_b in (0.0, p.d_l)


_STRIDES = (12, 4, 1)  # samples by which an edge is moved
_BETTER = 1e-6  # the share that is less
_WORTH = 1e-6  # of the largest price, below which a sample is where it wants to be


def best_load_direction(task: Task, program: Program, nominal: NominalTrajectory) -> Solved | None:
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
        self, task: Task, program: Program, answer: Solved, nominal: NominalTrajectory, back: Flags
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
        later, sooner = back.copy(), back.copy()
        later[k : k + stride], sooner[max(k - stride, 0) : k] = back[k - 1], back[k]
        yield from (later, sooner)


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
    vehicle: Vehicle, start: float, target: float, *, rest: bool = False, **limits: Unpack[Limits]
) -> LeastTime:
    """Return the least time [s] from rest at `start` to `target` [m] that the vehicle allows.

    To be within `band` [-] of the step for good; with `rest`, to be at rest there exactly. limits:
    the other arguments of `task_of`. A lower bound for every controller that is sampled with
    `sample_time` [s], as the model has the vehicle. Raises InputError and NoAnswerError as
    `task_of` does; NoAnswerError beyond 4000 samples.
    """
    task = task_of(vehicle, start, target, **limits)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        return search_least(task, rest=rest).least


def search_least(task: Task, *, rest: bool, advance: Advance = silent) -> Found:
    """Return the least time and the course that takes it, by bisection; advance: as in `plan`."""
    nominal = resting(1)

    def slack(n: int, end: int, relaxed: str, agree: float) -> Solved:
        nonlocal nominal
        goal = Goal(near=n if relaxed == "near" else None, rest=end, relaxed=relaxed)

        def program(steps: Steps, near: Near) -> Solved | None:
            advance(1.0)
            return solve(task, steps, goal, near)

        answer, settled = settle(task, program, stretched(nominal, end), agree=agree)
        if answer is None:
            remedy = "leave less margin, or allow more speed"
            raise NoAnswerError(f"no motion is within the limits at all: {remedy}")
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


def _reached(task: Task, slack: Callable[[int, float], Solved]) -> int:
    """Return a number of samples that suffices, at most twice too many."""
    n = max(math.ceil(task.brisk / task.sample_time), 4)
    while n <= MOST_SAMPLES:
        if slack(n, _ROUGHLY).objective <= _HOLDS:
            return n
        n *= 2
    raise NoAnswerError(
        f"the duration: rest at {task.target:g} m is not reached in {MOST_SAMPLES} samples of "
        f"{task.sample_time:g} s. Plan with a longer `sample_time=`, a larger stroke, "
        "or a higher supply or speed limit"
    )


def _bisect(slack: Callable[[int, float], Solved], low: int, high: int) -> tuple[int, Solved]:
    """Return the least n without slack, and the answer for n - 1, both on settled courses."""
    while high - low > 1:
        middle = (low + high) // 2
        enough = slack(middle, _ROUGHLY).objective <= _HOLDS
        low, high = (low, middle) if enough else (middle, high)
    while slack(high, AGREE).objective > _HOLDS:
        high += 1
    missed = slack(max(high - 1, 1), AGREE)
    while missed.objective <= _HOLDS and high > 1:
        high -= 1
        missed = slack(max(high - 1, 1), AGREE)
    return high, missed


def _least(task: Task, n: int, missed: Solved, size: float) -> LeastTime:
    return LeastTime(n * task.sample_time, n, missed.objective * size, missed.gap)
