"""`plan`: a step of depth in the least time, with the least volume moved or the least energy."""

import math
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
from threadpoolctl import threadpool_limits

from swimbladder.design.planning.linear_program import (
    Goal,
    Near,
    Solved,
    electrical,
    least_energy,
    scale_of,
    solve,
    winding,
)
from swimbladder.design.planning.nominal_trajectory import (
    LeastTime,
    NominalTrajectory,
    best_load_direction,
    search_least,
    settle,
    sided,
    straight,
    stretched,
)
from swimbladder.design.planning.task import Limits, Steps, Task, task_of
from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import winding as winding_of
from swimbladder.sim.closed_loop import drive
from swimbladder.units import length, rounded
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.schema import no_such

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
            "vehicle": self.task.vehicle.name,
            **as_json(self.task, "start_m target_m sample_time_s band_m margin"),
            **as_json(self.least, "least_time_s=time short_a_sample_sooner=short"),
            **as_json(self, _ANSWER),
            "duration_s": float(self.time[-1]),
        }

    def columns(self) -> dict[str, Array]:
        """Return the columns of a log of the plan."""
        return {
            "time_s": self.time,
            "depth_m": self.depth,
            "speed_m_s": self.speed,
            "volume_m3": self.volume,
            "reference_volume_m3" if self.task.plant.positioner else "voltage_V": self.command,
        }


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
    task = task_of(vehicle, *step, **limits)
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
    if goal not in GOALS:
        raise no_such("no such goal", goal, GOALS, field="goal")
    if arrive is not None and arrive not in ARRIVALS:
        raise no_such("no such arrival", arrive, ARRIVALS, field="arrive")
    if goal == "time":
        if duration is not None:
            what = "the goal time looks for the duration itself"
            remedy = "Leave it out, or choose the goal effort or energy"
            raise InputError(what, field="duration", value=duration, unit="s", remedy=remedy)
        return arrive or "band"
    if arrive == "band":
        what = f"the goal {goal} is for plans that end at rest"
        raise InputError(what, field="arrive", value=arrive, remedy="Leave it out")
    if duration is not None:
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
