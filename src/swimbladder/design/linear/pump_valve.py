"""A pump and valve beside the body that it moves: its rates by depth, and how the body goes on.

No voltage turns such a drive by degrees: it runs or not. So the loop has no transfer function from
a voltage. What is linear is the body under a volume; the drive says how soon that can change. About
a steady speed w0 the body is

    z' = w,   w' = a (psi z + V_0 - V) - F_d(w)/m,   about w0: dw' = a (psi dz - dV) - d(w0) dw

with d the slope of the drag over mass: at rest 0 where the drag is quadratic.

Under a law that changes the volume at moments of its own there is a map from one decision to the
next. About a steady speed w0 the body has the excess of weight e = psi z + V_0 - V [m3] and

    dw' = a e - d(w0) dw,   e' = psi dw,   z' = w

between decisions. A decision k sees the depths at a few samples and asks for a change of volume
u_k, a function of these; pump or valve have delivered the share eta of it after a time T_d. So

    x_{k+1} = M x_k,   x = (dw, e, u),   e jumps by -eta u_k at T_d,   u_{k+1} = sum_i s_i z(t_i)

with M from matrix exponentials, exactly, and the slopes s_i from the law's own step by differences,
its bands and steps left out: they are nonlinear, and make limit cycles. Small errors of the speed
decay if and only if the eigenvalues of M lie within the unit circle. Where the speed follows at
once and psi is 0, M has the one eigenvalue 1 - eta c/c_true, with c the law's volume per speed
squared and c_true = F_d(w)/(rho g w^2) that of the drag: 0 < eta c/c_true < 2.
"""

import cmath
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Law, Measurement, Way, smooth
from swimbladder.control.rate import RATE
from swimbladder.design.linear.depths import Stall
from swimbladder.design.linear.models import exponential_of
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import drive_map, running_pump
from swimbladder.physics.dynamics import Plant, drag_law, even_drag
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.vehicle import Positioner, PumpAndValve, Vehicle

_SPEEDS = (0.02, 0.05, 0.1)  # m/s, of a vehicle whose law asks for none
_DEEPEST = 20_000.0  # m, below any sea


class DriveRates(NamedTuple):
    """What pump and valves give and take over depth, each [n]; nan: a power that is not known."""

    depths: tuple[float, ...]  # m
    pump: tuple[float, ...]  # m3/s pressed out
    pump_power: tuple[float, ...]  # W of the battery meanwhile
    valve: tuple[float, ...]  # m3/s let in
    bypass: tuple[float, ...]  # m3/s let in by the wide valve, 0 without one
    leakage: tuple[float, ...]  # m3/s inwards while nothing runs
    start_volume: tuple[float, ...]  # m3 by which each start of the pump falls short


class Motion(NamedTuple):
    """The body about a steady speed, its volume kept."""

    speed: float  # m/s, either way
    time_constant: float  # s, in which a speed follows its volume; inf at rest with quadratic drag
    poles: tuple[complex, ...]  # 1/s, the largest real part first
    growth_time: float  # s, e-fold of what grows; inf where nothing does
    period: float  # s, of what oscillates; inf where nothing does


def moved_by_volume(vehicle: Vehicle) -> Vehicle:
    """Return a pump and valve as a vehicle whose volume is the input, at its pump's fastest rate.

    Its drag is that of sinking, both ways. Another vehicle is returned as it is.
    """
    a = vehicle.engine
    if not isinstance(a, PumpAndValve):
        return vehicle
    fastest = max(_pump_rate(vehicle, a, 0.0), 1e-15)
    moved = Positioner(kind="positioner", piston_area=1.0, speed=fastest)
    return even_drag(vehicle).model_copy(update={"actuator": moved})


def drive_rates(vehicle: Vehicle, depths: Sequence[float]) -> DriveRates:
    """Return what the drive of a pump and valve does at depths [m] of the vehicle's own water."""
    z = np.asarray(depths, float)
    d = drive_map(vehicle, vehicle.water.specific_weight * z)
    columns = (d.rate_out, d.power_out, d.rate_in, d.bypass_in, d.leakage, d.start_volume)
    return DriveRates(*(tuple(map(float, c)) for c in (z, *columns)))


def with_drag(p: Plant, share: float) -> Plant:
    """Return a plant with so many times its drag."""
    return p._replace(d_l=share * p.d_l, d_b=share * p.d_b, d_0=share * p.d_0, d_t=share * p.d_t)


def drag_slope(p: Plant, speed: float) -> float:
    """Return the slope of the drag over mass d(w) [1/s] at a speed [m/s]."""
    return drag_law(speed, p.d_l, p.d_b, p.d_0, p.d_t, p.epsilon)[1]


def motions(vehicle: Vehicle, p: Plant) -> tuple[Motion, ...]:
    """Return the body at rest and about the speeds that its law `rate` asks for."""
    own = vehicle.controller
    speeds: set[float] = set()
    if own is not None and own.law == RATE.name:
        from swimbladder.control.registry import bind

        numbers = bind(own)[1]
        speeds = {numbers.slow_speed, numbers.near_speed, numbers.far_speed, numbers.ascent_speed}
    return tuple(_motion(p, w) for w in (0.0, *sorted(speeds or set(_SPEEDS))))


def _motion(p: Plant, speed: float) -> Motion:
    d, b = drag_slope(p, speed), p.a_b * p.psi
    root = cmath.sqrt(0.25 * d * d + b)
    poles = tuple(sorted((-0.5 * d + root, -0.5 * d - root), key=lambda s: (-s.real, -s.imag)))
    fastest, turning = max(s.real for s in poles), max(abs(s.imag) for s in poles)
    return Motion(
        speed=speed,
        time_constant=1.0 / d if d > 0.0 else math.inf,
        poles=poles,
        growth_time=1.0 / fastest if fastest > 1e-15 else math.inf,
        period=2.0 * math.pi / turning if turning > 0.0 else math.inf,
    )


def pump_stall(vehicle: Vehicle, *, depth: float) -> Stall:
    """Return where the pump no longer presses anything out, and how fast it does at `depth` [m].

    The holding depth is where it only just makes up for what leaks back. A check valve holds the
    volume, so that nothing turns the pump back.
    """
    a, supply = vehicle.engine, vehicle.supply
    assert isinstance(a, PumpAndValve)  # analyse
    stiff = vehicle if supply is None else vehicle.but("supply", internal_resistance=0.0)

    def leaks(z: float) -> float:
        return a.leakage * max(_head(vehicle, a, z), 0.0) + a.creep

    return Stall(
        depth=_last(lambda z: _pump_rate(vehicle, a, z) > 0.0),
        depth_without_sag=_last(lambda z: _pump_rate(stiff, a, z) > 0.0),
        holding_depth=_last(lambda z: _pump_rate(vehicle, a, z) > leaks(z)),
        back_drive_depth=math.inf,
        voltage=math.nan if supply is None else supply.voltage,
        extending_rate=_pump_rate(vehicle, a, depth),
        limit=vehicle.hull.depth_limit,
    )


def _head(vehicle: Vehicle, a: PumpAndValve, depth: float) -> float:
    return vehicle.water.specific_weight * depth + ATMOSPHERIC_PRESSURE - a.internal_pressure


def _pump_rate(vehicle: Vehicle, a: PumpAndValve, depth: float) -> float:
    rate = float(running_pump(vehicle, a, np.array([_head(vehicle, a, depth)]), 15.0)[0][0])
    return rate if math.isfinite(rate) else 0.0


def _last(goes: Callable[[float], bool]) -> float:
    """Return the greatest depth [m] down to which something goes; inf beyond any sea."""
    from scipy.optimize import bisect

    if goes(_DEEPEST):
        return math.inf
    if not goes(0.0):
        return 0.0
    return float(bisect(lambda z: 1.0 if goes(z) else -1.0, 0.0, _DEEPEST))


_OFF = 1e-4  # of a speed, by which the law is made to act
_SMALL = 1e-6  # of the way between two decisions: a step of the differences
_CALLS = 64  # of a law within which it has to decide twice
_DEEP = 1000.0  # m, where the law is asked: what it decides depends on distances


class Decision(NamedTuple):
    """What a law that goes at a speed does from one decision to the next."""

    way: Way
    speed: float  # m/s, positive down
    faster: bool  # what it acts on: the vehicle is too fast, not too slow
    samples: tuple[float, ...]  # s since the last decision; the last one is the decision
    slopes: tuple[float, ...]  # m3/m, of the change by the depth at each of them
    largest: float  # m3, of the change from rest

    @property
    def period(self) -> float:
        """Time between two decisions [s]."""
        return self.samples[-1]

    @property
    def pumps(self) -> bool:
        """Whether what it acts on takes the pump: too fast a sinking, too slow a rise."""
        return (self.speed > 0.0) == self.faster


class Delivery(NamedTuple):
    """How pump or valve give a change of volume."""

    share: float  # -, of what was asked for
    delay: float  # s, until a change that is a little larger is there


def decision_of(
    law: Law, parameters: Any, way: Way, *, down: bool, faster: bool = False
) -> Decision | None:
    """Return what a law does on a way, from its own step; None where it does not act on that.

    parameters: as they are; bands and steps are left out. faster: it goes a little too fast.
    """
    numbers = smooth(law, parameters)
    up = math.isinf(way.distance)
    sign = 1.0 if down and not up else -1.0
    speed = sign * way.speed * (1.0 + (_OFF if faster else -_OFF))

    def ask(moved: dict[int, float], until: int, pace: float = speed) -> list[tuple[float, float]]:
        """Return times and changes of `until` calls, the depth at some of them moved [m]."""
        found: list[tuple[float, float]] = []
        state, time = None, 0.0
        for call in range(until):
            depth = _DEEP + pace * time + moved.get(call, 0.0)
            reference = 0.0 if up else _DEEP + pace * last + sign * way.distance
            seen = Measurement(time, depth, math.nan)
            if state is None:
                state = law.initial(numbers, seen, reference)
            change, state, wait = law.step(numbers, state, seen, reference)
            found.append((time, change))
            time += wait
        return found

    last = 0.0
    decided: list[int] = []
    for calls in range(2, _CALLS):  # until it has decided twice, the distance that of the second
        last = ask({}, calls)[-1][0]
        called = ask({}, calls)
        decided = [n for n, (_, change) in enumerate(called) if change != 0.0]
        if len(decided) == 2:
            break
    else:
        return None
    first, second = decided
    begin, end = called[first][0], called[second][0]
    step = _SMALL * abs(speed) * (end - begin)
    slopes = []
    for call in range(first, second + 1):
        more, less = (ask({call: x}, second + 1)[-1][1] for x in (step, -step))
        slopes.append((more - less) / (2.0 * step))
    samples = tuple(called[n][0] - begin for n in range(first, second + 1))
    largest = max(abs(change) for _, change in ask({}, second + 1, 0.0))
    return Decision(way, sign * way.speed, faster, samples, tuple(slopes), largest)


def decision_maps(plants: Sequence[Plant], d: Decision, deliveries: Sequence[Delivery]) -> Array:
    """Return M [n, 3, 3] of (dw, e, u) from just after one decision to just after the next.

    Of each plant with its delivery.
    """
    a = np.array([p.a_b for p in plants])
    A = np.zeros((len(a), 1, 3, 3))  # of (dw, a e, the way since the decision)
    A[:, 0, 0, 0] = [-drag_slope(p, d.speed) for p in plants]
    A[:, 0, 0, 1] = A[:, 0, 2, 0] = 1.0
    A[:, 0, 1, 0] = [p.a_b * p.psi for p in plants]
    t = np.array(d.samples)[None, :, None, None]
    late = np.minimum([one.delay for one in deliveries], d.period)[:, None, None, None]
    given = np.zeros((len(a), 1, 3, 3))
    given[:, 0, 1, 2] = -a * [one.share for one in deliveries]
    before = exponential_of(A * np.minimum(t, late)) @ np.diag([1.0, 1.0, 0.0])
    found = exponential_of(A * np.maximum(t - late, 0.0)) @ (
        before + np.where(t < late, 0.0, given)
    )
    M = found[:, -1]
    M[:, 2] = np.array(d.slopes) @ found[:, :, 2]
    M[:, 1] /= a[:, None]
    M[:, :, 1] *= a[:, None]
    return M
