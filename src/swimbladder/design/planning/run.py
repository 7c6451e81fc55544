"""`plan`: a step of depth in the least time, with the least volume moved or the least energy.

A program solved again and again about its own last answer, until the two agree.

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
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Unpack

import numpy as np
from threadpoolctl import threadpool_limits

from swimbladder.design.planning.task import (
    STATES,
    Goal,
    Limits,
    Near,
    Solved,
    Steps,
    Task,
    electrical,
    least_energy,
    scale_of,
    solve,
    steps_along,
    task_of,
    winding,
)
from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.io.answers import Answer, as_json, attributes
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.buoyancy_engine import winding as winding_of
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.closed_loop import drive
from swimbladder.units import length, rounded
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.schema import check_choice

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
    task = task_of(vehicle, (start, target), **limits)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        return search_least(task, rest=rest).least


def search_least(task: Task, *, rest: bool, advance: Advance = silent) -> Found:
    """Return the least time and the course that takes it, by bisection; advance: as in `plan`."""
    nominal = resting(1)

    def slack(n: int, end: int, relaxed: str, agree: float) -> Solved:
        """Return the motion that exceeds what is `relaxed` least; up to `_HOLDS` it is feasible.

        n: samples until it is near the target; end: until it rests; agree: as in `settle`.
        """
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


_ANSWER = "goal arrive arrival_s moved_m3 energy_J at_limit gap proven residual_m sentences"
_LOST = 0.1  # of the step: a motion that far from the plan is another


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan(Answer):
    """The plan at each sample [n + 1], the command held from there on."""

    task: Task
    goal: str
    arrive: str
    time: Array  # s
    depth: Array  # m
    speed: Array  # m/s
    volume: Array  # m3
    command: Array  # V; m3 to go to, for a positioner
    arrival: float  # s, from which on the demand is met
    least: LeastTime  # of the same demand: the least time there is
    moved: float  # m3, to and fro
    energy: float  # J, electrical into the motor; nan where not known
    gap: float  # of primal and dual objective, over 1 + their size
    proven: bool  # whether no motion is better; else none near by
    residual: float  # m, farthest that the simulator, given the commands, is from the plan
    at_limit: dict[str, float]  # share of the samples at each limit

    @property
    def sentences(self) -> tuple[str, ...]:
        """What there is to say."""
        t, h = self.task, self.task.sample_time
        step = f"from {t.start:g} to {t.target:g} m"
        into = f"inside {length(t.band)} of the target for good"
        every = "every plan" if self.proven else "every plan near it"
        where, sooner = "at rest there", f"no {every.removeprefix('every ')} comes to rest"
        if self.arrive == "band":
            where, sooner = into, f"{every} misses by {length(self.least.short)} or more"
        said = [
            f"The least time {step} is {self.least.time:.4g} s ({where}), sampled every {h:g} s"
            f"{_limits(t)}: a sample sooner {sooner}."
        ]
        if self.goal != "time":
            what = "volume moved" if self.goal == "effort" else "electrical energy"
            rest = "" if self.proven else " of all plans near it; others were not ruled out"
            said.append(f"In {self.arrival:.4g} s it takes the least {what}{rest}.")
        energy = "" if math.isnan(self.energy) else f", {self.energy:.4g} J into the motor"
        fastest = f"at its fastest it goes {100.0 * float(abs(self.speed).max()):.3g} cm/s"
        said.append(f"It moves {1e6 * self.moved:.4g} cm3 to and fro{energy}; {fastest}.")
        busy = [f"{n} in {100.0 * s:.0f} %" for n, s in self.at_limit.items() if s > 0.0]
        limits = f"At their limits: {', '.join(busy)} of the samples."
        near = f"keeps within {length(self.residual, 2)} of it"
        said += [
            limits if busy else "No limit is reached.",
            f"The simulator, given the plan's commands, {near}.",
        ]
        if self.residual > t.band:
            blind = "That is more than the band: followed blindly this plan does not arrive"
            said.append(f"{blind}. Let a controller follow it, or {self.nearer}.")
        return tuple(said)

    @property
    def lost(self) -> bool:
        """Whether the simulator, given the commands, leaves the plan by far: it is none then."""
        t = self.task
        return self.residual > max(t.band, _LOST * abs(t.target - t.start))

    @property
    def nearer(self) -> str:
        """What to ask for instead where the simulator does not keep to the plan."""
        if self.goal != "time":
            return "plan a shorter step"
        smoother = "plan it with `goal='effort'`, of a smoother motion"
        return smoother if self.arrive == "rest" else f"{smoother}, or with `arrive='rest'`"

    def to_dict(self) -> dict[str, Any]:
        """Return the answer in SI units."""
        return {
            **as_json(
                self.task, "vehicle=vehicle.name start_m target_m sample_time_s band_m margin"
            ),
            **as_json(self.least, "least_time_s=time short_a_sample_sooner=short"),
            **as_json(self, _ANSWER),
            "duration_s": float(self.time[-1]),
        }

    def columns(self) -> dict[str, Array]:
        """Return the columns of a log of the plan."""
        command = "reference_volume_m3" if self.task.plant.positioner else "voltage_V"
        return attributes(self, f"time_s depth_m speed_m_s volume_m3 {command}=command")


def _limits(task: Task) -> str:
    if task.plant.positioner:
        return f", the volume moved by up to {1e6 * task.command[1]:.4g} cm3/s"
    kept = f" ({100.0 * task.margin:g} % kept back)" if task.margin else ""
    return f", with up to {task.command[1]:.4g} V{kept}"


GOALS = ("time", "effort", "energy")
ARRIVALS = ("band", "rest")

_UNHURRIED = 2.0  # times the least time, where a goal other than time is given none
_SPARE = 1.0 + 1e-3  # of a limit that is said to do: at the edge itself no solver is sure
_AT_LIMIT = 2e-3  # of what is large, that counts as at a limit: tangents stop a little short of it


def plan(
    vehicle: Vehicle,
    step: tuple[float, float],
    *,
    goal: str = "time",
    arrive: str | None = None,
    duration: float | None = None,
    advance: Advance = silent,
    **limits: Unpack[Limits],
) -> Plan:
    """Find the best motion from rest at one depth to rest at another.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    step
        Depths at which it rests, from and to [m].
    goal
        time (the least until it has arrived; of the plans that do, one that moves least volume),
        effort (least volume moved) or energy (least electrical energy into the motor), both at rest
        after `duration`.
    arrive
        What arrival is for the goal time: band (within `band` of the step for good) or rest. None:
        band.
    duration
        Of the goals effort and energy [s]; none: twice the least time.
    advance
        Called with 1 for every program that was solved.
    **limits
        The other arguments of `task_of`: sample_time [s] and supply [V], the vehicle's where not
        given; band [-], of the step, to either side of the target, 0.02 unless given;
        feedback_reserve [-], share of supply (a positioner: of its speed) and stroke left for
        feedback; max_speed [m/s]; bottom_depth [m].

    Returns
    -------
    Plan
        The motion at each sample, the command held from there on.

    Raises
    ------
    InputError
        What is asked cannot be meant.
    NoAnswerError
        It cannot be done, with the limit in the way; or the energy of the motor is not known.
    """
    arrive = _check(goal, arrive, duration)
    task = task_of(vehicle, step, **limits)
    if goal == "energy":
        winding(task)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        least, end, nominal = search_least(task, rest=arrive == "rest", advance=advance)
        near = least.samples if arrive == "band" else None
        if goal != "time":
            end, near = math.ceil(_UNHURRIED * least.samples), None
            if duration is not None:
                end = max(math.floor(duration / task.sample_time + 1e-9), 1)
        linear = None if goal == "energy" else Goal(near=near, rest=end)
        answer = _best(task, linear, stretched(nominal, end), advance)
        if answer is None:
            raise _impossible(task, end, least, nominal)
    found = _plan_of(task, goal, arrive, answer, least, near if near is not None else end)
    if found.lost:
        raise _lost(found)
    return found


def _lost(found: Plan) -> NoAnswerError:
    """Return why a plan is none that the simulator, given its commands, leaves by far."""
    t = found.task
    away = "stops before its end"
    if math.isfinite(found.residual):
        away = f"is up to {rounded(found.residual, 2)} m from it"
    grows = " At these depths what little it is off grows"
    if t.vehicle.hull.psi > 0.0:
        grows += ", for the deeper the vehicle, the more volume it needs"
    given = f"given the commands found from {t.start:g} to {t.target:g} m, the simulator {away}"
    what = f"no plan that the vehicle would follow: {given}"
    return NoAnswerError(f"{what}.{grows}. Rather {found.nearer}")


def _check(goal: str, arrive: str | None, duration: float | None) -> str:
    check_choice(goal, GOALS, "no such goal", field="goal")
    check_choice(arrive, ARRIVALS, "no such arrival", field="arrive")
    if goal == "time":
        if duration is not None:
            what = "the goal time looks for the duration itself"
            remedy = "Leave it out, or choose the goal effort or energy"
            raise InputError(what, field="duration", value=duration, unit="s", remedy=remedy)
        return arrive or "band"
    if arrive == "band":
        what = f"the goal {goal} is for plans that end at rest"
        raise InputError(what, field="arrive", value=arrive, remedy="Leave it out")
    check_number(duration, "duration", "s", above=0.0)
    return "rest"


def _best(
    task: Task, goal: Goal | None, begin: NominalTrajectory, advance: Advance
) -> Solved | None:
    """Return the best answer for a linear goal, or of least energy to the end of a course."""

    def program(steps: Steps, beside: Near) -> Solved | None:
        advance(1.0)
        if goal is None:
            return least_energy(task, steps, len(steps.A), beside)
        return solve(task, steps, goal, beside)

    if goal is None and sided(task.plant):
        answer = best_load_direction(task, program, begin)
    else:
        answer = settle(task, program, begin)[0]
    if answer is None or (straight(task.plant) and not sided(task.plant)):
        return answer
    return answer._replace(proven=False)


def _impossible(
    task: Task, end: int, least: LeastTime, nominal: NominalTrajectory
) -> NoAnswerError:
    """Return what is in the way, and how much more of each limit alone would do."""
    sizes, kept, half = scale_of(task), 1.0 - task.margin, 0.5 * (task.volume[1] - task.volume[0])
    drive = ("the voltage", "V", 1.0)
    if task.plant.positioner:
        drive = ("the piston's speed", "cm3/s", 1e6)
    ways = [
        ("command", *drive, task.command[1], sizes.command, kept),
        ("volume", "the stroke", "cm3 to either side", 1e6, half, sizes.state[1], kept),
        ("speed", "the speed limit", "m/s", 1.0, task.speed[1], sizes.state[3], 1.0),
    ]
    found = []
    for name, words, shown, factor, limit, size, share in ways:
        if not math.isfinite(limit):
            continue

        def program(steps: Steps, beside: Near, name: str = name) -> Solved | None:
            return solve(task, steps, Goal(near=None, rest=end, relaxed=name), beside)

        answer, _ = settle(task, program, stretched(nominal, end))
        if answer is not None:
            need = _no_less(factor * (limit + answer.objective * size) / share)
            found.append(f"{words} {need:g} {shown} instead of {factor * limit / share:.4g}")
    wider = f"; or, one of them alone: {', or '.join(found)}" if found else ""
    asked = f"at rest at {task.target:g} m in {end * task.sample_time:g} s"
    what = f"the duration: {asked} is beyond this vehicle's limits"
    return NoAnswerError(f"{what}. It takes {least.time:.4g} s at least{wider}")


def _no_less(value: float) -> float:
    """Return a number above 0 with three digits, rounded up and a little more: it has to do."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.ceil(value * _SPARE / unit) * unit


def _plan_of(
    task: Task, goal: str, arrive: str, answer: Solved, least: LeastTime, arrival: int
) -> Plan:
    h, n = task.sample_time, len(answer.commands)
    time: Array = np.arange(n + 1, dtype=np.float64) * h
    _, volume, depth, speed = answer.states.T
    command = np.append(answer.commands, task.plant.load_drive * task.target)
    driven: dict[str, Any] = {"voltage": command}
    if task.plant.positioner:
        command, driven = np.append(volume[1:], volume[-1]), {"volume": volume}
    bottom = task.plant.z_bottom
    run = drive(task.vehicle, time=time, start_depth=task.start, bottom_depth=bottom, **driven)
    same = len(run.depth) == n + 1
    residual = float(np.abs(run.depth - depth).max()) if same else math.inf
    known = winding_of(task.vehicle) is not None
    return Plan(
        task=task,
        goal=goal,
        arrive=arrive,
        time=time,
        depth=depth,
        speed=speed,
        volume=volume,
        command=command,
        arrival=arrival * h,
        least=least,
        moved=float(np.abs(np.diff(volume)).sum()),
        energy=electrical(task, answer) if known else math.nan,
        gap=answer.gap,
        proven=answer.proven,
        residual=residual,
        at_limit=_at_limit(task, answer),
    )


def _at_limit(task: Task, answer: Solved) -> dict[str, float]:
    """Return the share of the samples at each limit."""
    _, V, z, w = answer.states.T
    command = "piston speed" if task.plant.positioner else "voltage"
    sizes, shares = scale_of(task), {}
    for name, x, (low, high), size in (
        (command, answer.commands, task.command, sizes.command),
        ("stroke", V[1:], task.volume, sizes.state[1]),
        ("speed", w[1:], task.speed, sizes.state[3]),
        ("depth", z[1:], task.depth, sizes.state[2]),
    ):
        at = (x <= low + _AT_LIMIT * size) | (x >= high - _AT_LIMIT * size)
        shares[name] = float(np.mean(at))
    return shares
