"""What law a phase of a mission is flown with: the vehicle's own, or one made for the phase."""

from __future__ import annotations

import math

from swimbladder.control.rate import RATE, RateParameters
from swimbladder.control.registry import bind
from swimbladder.dynamics import drag_force
from swimbladder.io.mission import Phase
from swimbladder.parameters import Vehicle

__all__ = ["drag_coefficient", "law_parameters"]

# What a phase does where neither it nor the vehicle says so.
_SPEED = 0.1  # m/s, that of Argo floats
_TOLERANCE = 10.0  # m
_LOOKS, _PARKED = 60.0, 600.0  # s between two looks on the way, and parked
_RUN = 15.0  # s in which a speed is measured


def drag_coefficient(vehicle: Vehicle, speed: float) -> float:
    """Return F_d(w)/(rho g w^2) [m3 s2/m2] at a speed [m/s]: what the law `rate` reckons with."""
    return drag_force(vehicle.drag, speed) / (vehicle.water.specific_weight * speed * speed)


def law_parameters(vehicle: Vehicle, phase: Phase) -> RateParameters:
    """Return the parameters of the law `rate` in a phase; a profile keeps its speed to the end.

    Those of the vehicle's controller where it is of this law, with the phase's own in their place;
    else ones that follow from the phase's speed and tolerance as those of floats of the MERMAID
    kind do: half and a quarter of the speed near the target, a fifth as the band.
    """
    found = _law(vehicle, phase)
    if phase.kind == "profile":
        return found._replace(near_speed=found.far_speed, slow_speed=found.far_speed)
    return found


def _law(vehicle: Vehicle, phase: Phase) -> RateParameters:
    speed = phase.speed or _SPEED
    tolerance = phase.tolerance or _TOLERANCE
    interval = phase.check_interval or (_PARKED if phase.kind == "park" else None)
    if vehicle.controller is not None and vehicle.controller.law == RATE.name:
        base: RateParameters = bind(vehicle.controller)[1]
        tolerance = phase.tolerance or base.tolerance
        run = base.run if interval is None else min(base.run, 0.5 * interval)
        given = base._replace(
            tolerance=tolerance, near=max(base.near, tolerance), far=max(base.far, tolerance),
            run=run, dead=base.dead if interval is None else interval - run,
        )  # fmt: skip
        if phase.speed is None:
            return given
        return given._replace(
            far_speed=speed, ascent_speed=speed, near_speed=min(base.near_speed, speed),
            slow_speed=min(base.slow_speed, speed), speed_band=min(base.speed_band, 0.5 * speed),
        )  # fmt: skip
    looks = phase.check_interval or min(interval or _LOOKS, _needed(vehicle, tolerance, speed))
    run = min(_RUN, 0.5 * looks)
    return RateParameters(
        coefficient=drag_coefficient(vehicle, speed), tolerance=tolerance, near=tolerance,
        far=3.0 * tolerance, slow_speed=0.25 * speed, near_speed=0.5 * speed, far_speed=speed,
        ascent_speed=speed, speed_band=0.2 * speed, speed_step=0.1 * speed, volume_step=0.0,
        dead=looks - run, run=run, window=2.0 * looks,
    )  # fmt: skip


def _needed(vehicle: Vehicle, tolerance: float, speed: float) -> float:
    """Return the time between looks [s] in which neither way nor hull runs away from the law.

    It goes half the tolerance at the speed, at least two of its own time constants; where the hull
    gives way more than the water (psi > 0), half the time in which a small error grows e-fold:
    m s^2 + k s = rho g psi, with k the drag over the speed.
    """
    m = vehicle.mass
    k = drag_force(vehicle.drag, speed) / speed
    longest = max(0.5 * tolerance / speed, 2.0 * m / k)
    psi = vehicle.hull.psi
    if psi > 0.0:
        pull = vehicle.water.specific_weight * psi
        longest = min(longest, 0.5 * 2.0 * m / (math.sqrt(k * k + 4.0 * m * pull) - k))
    return longest
