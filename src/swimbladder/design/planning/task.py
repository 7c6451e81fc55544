"""What is planned: a vehicle from rest at one depth to rest at another, within its limits.

From sample to sample the vehicle is linear about a course, x+ = A x + B u + c, exact for it. The
linear model is that of `linear.models`; what is not linear is taken along a course: drag by its
tangent at the mean speed of each sample, load and friction by the side on which the motor turns
there. Between samples the command is held, so the matrix exponential is exact (Van Loan, IEEE
Trans. Automatic Control 23, 1978, 395).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, TypedDict

import numpy as np

from swimbladder.control.registry import own_law
from swimbladder.design.linear.depths import stall
from swimbladder.design.linear.models import exponential_of, linearise, operating_point
from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.buoyancy_engine import at_voltage
from swimbladder.physics.dynamics import Plant, drag_law, plant
from swimbladder.vehicle import Vehicle

STATES = ("q", "V", "z", "w")


class Steps(NamedTuple):
    """What a sample does: A [n, 4, 4], B [n, 4], c [n, 4] over (q, V, z, w) in SI.

    The command is a voltage [V]; of a positioner the volume rate [m3/s], and its q the last one.
    """

    A: Array
    B: Array
    c: Array


def steps_along(p: Plant, h: float, speed: Array, back: Flags) -> Steps:
    """Return the steps of h [s] about a course.

    speed [n + 1] in m/s. back: in which samples [n] the motor is driven back.
    """
    w = 0.5 * (speed[1:] + speed[:-1])
    n = len(w)
    M = np.zeros((n, 6, 6))  # (q, V, z, w), the held command, 1
    if p.positioner:
        M[:, :4, :4] = _of_positioner(p)
        M[:, 1, 4] = 1.0
    else:
        for side in (False, True):
            chosen = back == side
            if chosen.any():
                model = linearise(p, back_driving=side)
                friction = -p.friction if side else p.friction
                M[chosen, :4, :4] = model.A
                M[chosen, :4, 4] = model.B[:, 0]
                M[chosen, 0, 5] = -p.gain * friction / p.T1
    drag, slope = drag_along(p, w)
    M[:, 3, 3] = -slope
    M[:, 3, 5] = p.a_b * p.V_0 + slope * w - drag
    E = exponential_of(M * h)
    A, B, c = E[:, :4, :4].copy(), E[:, :4, 4].copy(), E[:, :4, 5].copy()
    if p.positioner:
        A[:, 0, :], B[:, 0] = 0.0, 1.0
    return Steps(A, B, c)


def _of_positioner(p: Plant) -> Array:
    """Return the rates' slopes by (q, V, z, w) of a vehicle whose volume is moved at will."""
    model = linearise(p)  # states (z, w), input V
    A = np.zeros((4, 4))
    A[2:, 2:] = model.A
    A[2:, 1] = model.B[:, 0]
    return A


def drag_along(p: Plant, w: Array) -> tuple[Array, Array]:
    """Return drag over mass [m/s2] and its slope [1/s] at the speeds w [m/s]."""
    terms = (p.d_l, p.d_b, p.d_0, p.d_t, p.epsilon)
    found = np.array([drag_law(x, *terms)[:2] for x in w.tolist()])
    return found[:, 0], found[:, 1]


class Limits(TypedDict, total=False):
    """What `task_of` takes beside the vehicle and the two depths."""

    sample_time: float | None
    supply: float | None
    band: float
    feedback_reserve: float
    max_speed: float | None
    bottom_depth: float


@dataclass(frozen=True, kw_only=True)
class Task:
    """A step of depth, sampled, with what limits it; low and high of a limit in SI."""

    vehicle: Vehicle
    plant: Plant
    start: float  # m
    target: float  # m
    sample_time: float  # s
    band: float  # m, to either side of the target
    command: tuple[float, float]  # V, or m3/s for a positioner
    volume: tuple[float, float]  # m3
    speed: tuple[float, float]  # m/s
    depth: tuple[float, float]  # m
    margin: float  # -, of supply and stroke, kept back

    @property
    def distance(self) -> float:
        """Depth between start and target [m]."""
        return abs(self.target - self.start)

    @property
    def brisk(self) -> float:
        """Least time of the step without drag, psi and load [s]: (32 d/j)^(1/3) for a jerk j."""
        p = self.plant
        rate = p.rate if p.positioner else p.gain * self.command[1]
        return math.cbrt(32.0 * self.distance / (p.a_b * rate))

    def state_of_rest(self, depth: float) -> tuple[float, float, float, float]:
        """Return (q, V, z, w) of the vehicle at rest, neutral, at a depth [m]."""
        at = operating_point(self.plant, depth=depth)
        return (at.motor_rate, at.volume, depth, 0.0)


def task_of(
    vehicle: Vehicle,
    start: float,
    target: float,
    *,
    sample_time: float | None = None,
    supply: float | None = None,
    band: float = 0.02,
    feedback_reserve: float = 0.0,
    max_speed: float | None = None,
    bottom_depth: float = math.inf,
) -> Task:
    """Return the task, checked.

    start, target [m]. sample_time [s] and supply [V]: the vehicle's where not given. band [-]: of
    the step, to either side of the target. feedback_reserve [-]: share of supply (a
    positioner: of its speed) and stroke left for feedback. max_speed [m/s]. bottom_depth [m].

    Raises InputError for what cannot be meant; NoAnswerError where stroke or supply do not hold
    the vehicle at one of the two depths.
    """
    sample_time = vehicle.sampled_every(sample_time)
    if vehicle.controller is not None:
        own_law(vehicle)
    if max_speed is not None:
        check_number(max_speed, "max_speed", "m/s", above=0.0)
    for name, share, fits, least in (
        ("band", band, 0.0 < band < 1.0, "more than 0"),
        ("feedback_reserve", feedback_reserve, 0.0 <= feedback_reserve < 1.0, "0 or more"),
    ):
        if not fits:
            what, remedy = f"must be {least}, and less than the whole", 'Write it like "5 %"'
            raise InputError(what, field=name, value=100.0 * share, unit="%", remedy=remedy)
    if supply is not None:
        if vehicle.supply is None:
            what = "the vehicle's actuator takes a volume, not a voltage"
            raise InputError(what, field="supply", value=supply, remedy="Leave the supply out")
        check_number(supply, "supply", "V", above=0.0)
        vehicle = at_voltage(vehicle, supply)
    p = plant(vehicle, bottom_depth=bottom_depth)
    shallowest = max(p.z_surface, 0.0)
    rating = vehicle.hull.depth_limit
    deepest = min(bottom_depth, math.inf if rating is None else rating)
    for name, depth in (("the start", start), ("the target", target)):
        if not shallowest <= depth <= deepest:
            what = f"{name} is beyond {shallowest:g} m, where it begins to emerge"
            if depth > deepest:
                end = "the bottom" if bottom_depth == deepest else "its rating (hull.depth_limit)"
                what = f"{name} is beyond {deepest:g} m, {end}"
            remedy = f"Stay between {shallowest:g} and {deepest:g} m"
            raise InputError(what, field="step", value=depth, unit="m", remedy=remedy)
    if start == target:
        what, remedy = "start and target are the same depth", 'Give two depths, like "1.5:3 m"'
        raise InputError(what, field="step", value=start, unit="m", remedy=remedy)
    most = (p.rate if p.positioner else p.supply) * (1.0 - feedback_reserve)
    low, high = vehicle.stroke.lowest, vehicle.stroke.highest
    middle, half = 0.5 * (high + low), 0.5 * (high - low) * (1.0 - feedback_reserve)
    fastest = math.inf if max_speed is None else max_speed
    task = Task(
        vehicle=vehicle,
        plant=p,
        start=start,
        target=target,
        sample_time=sample_time,
        band=band * abs(target - start),
        command=(-most, most),
        volume=(middle - half, middle + half),
        speed=(-fastest, fastest),
        depth=(shallowest, deepest),
        margin=feedback_reserve,
    )
    for depth in (start, target):
        _check_held(task, depth)
    return task


def _check_held(task: Task, depth: float) -> None:
    """Raise NoAnswerError where stroke or supply, less the margin, do not hold a depth."""
    p = task.plant
    less = f" less the margin of {100.0 * task.margin:g} %" if task.margin else ""
    neutral = task.state_of_rest(depth)[1]
    low, high = task.volume
    if not low <= neutral <= high:
        what = f"the stroke{less}, {1e6 * low:.4g} to {1e6 * high:.4g} cm3, does not reach"
        volume = f"the volume at which the vehicle is neutral at {depth:g} m"
        remedy = "trim it otherwise, give it more stroke, or stay shallower"
        raise NoAnswerError(f"{what} {volume}, {1e6 * neutral:.4g} cm3: {remedy}")
    if p.positioner:
        return
    limit = stall(p._replace(supply=task.command[1]), depth=depth, depth_limit=None).holding_depth
    if depth >= limit:
        supply = f"with {task.command[1]:.4g} V{less}"
        what = f"the depth load: {supply} the motor cannot hold its volume below {limit:.4g} m"
        remedy = "It takes a higher supply, or less depth"
        raise NoAnswerError(f"{what}, and {depth:g} m is asked for. {remedy}")
