"""A pump and valve beside the body that it moves: its rates by depth, and how the body goes on.

No voltage turns such a drive by degrees: it runs or not. So the loop has no transfer function from
a voltage. What is linear is the body under a volume; the drive says how soon that can change. About
a steady speed w0 the body is

    z' = w,   w' = a (psi z + V_0 - V) - F_d(w)/m,   about w0: dw' = a (psi dz - dV) - d(w0) dw

with d the slope of the drag over mass: at rest 0 where the drag is quadratic.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from swimbladder.control.rate import RATE
from swimbladder.design.linear.depths import Stall
from swimbladder.physics.buoyancy_engine import drive_map, running_pump
from swimbladder.physics.dynamics import Plant, drag_law, even_drag
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.vehicle import Positioner, PumpAndValve, Vehicle

_SPEEDS = (0.02, 0.05, 0.1)  # m/s, of a vehicle whose law asks for none
_DEEPEST = 20_000.0  # m, below any sea
_HALVINGS = 60


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
    a = vehicle.actuator
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
    a, supply, limit = vehicle.actuator, vehicle.supply, vehicle.hull.depth_limit
    assert isinstance(a, PumpAndValve)  # analyse_linear
    stiff = vehicle
    if supply is not None and supply.internal_resistance > 0.0:
        stiff = vehicle.model_copy(
            update={"supply": supply.model_copy(update={"internal_resistance": 0.0})}
        )
    weight = vehicle.water.specific_weight

    def leaks(z: float) -> float:
        head = weight * z + ATMOSPHERIC_PRESSURE - a.internal_pressure
        return a.leakage * max(head, 0.0) + a.creep

    deepest = _last(lambda z: _pump_rate(vehicle, a, z) > 0.0)
    return Stall(
        depth=deepest,
        depth_without_sag=_last(lambda z: _pump_rate(stiff, a, z) > 0.0),
        holding_depth=_last(lambda z: _pump_rate(vehicle, a, z) > leaks(z)),
        back_drive_depth=math.inf,
        voltage=math.nan if supply is None else supply.voltage,
        extending_rate=_pump_rate(vehicle, a, depth),
        margin=deepest - (math.nan if limit is None else limit),
    )


def _pump_rate(vehicle: Vehicle, a: PumpAndValve, depth: float) -> float:
    head = vehicle.water.specific_weight * depth + ATMOSPHERIC_PRESSURE - a.internal_pressure
    rate = float(running_pump(vehicle, a, np.array([head]), 15.0)[0][0])
    return rate if math.isfinite(rate) else 0.0


def _last(goes: Callable[[float], bool]) -> float:
    """Return the greatest depth [m] down to which something goes; inf beyond any sea."""
    if goes(_DEEPEST):
        return math.inf
    low, high = 0.0, _DEEPEST
    if not goes(low):
        return 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if goes(middle) else (low, middle)
    return low
