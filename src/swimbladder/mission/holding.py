"""Whether a band can be held: how far a vehicle gets between two looks, and what it can do then."""

from __future__ import annotations

import math

from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.rate import RateParameters
from swimbladder.dynamics import drag_force
from swimbladder.errors import NoAnswerError
from swimbladder.io.mission import Mission, Phase
from swimbladder.mission.core.names import Given, Stage, Table
from swimbladder.mission.orders import runaway
from swimbladder.mission.prepare import Plan
from swimbladder.parameters import Vehicle
from swimbladder.seawater import look_up

__all__ = ["check_holds", "least_band"]

_GROWTH = 0.8  # e-folds between two looks, above which no law of ours holds
_NOISE = 6.0  # standard deviations of the depth that a band takes


def check_holds(vehicle: Vehicle, mission: Mission, plan: Plan) -> None:
    """Raise NoAnswerError where a vehicle cannot keep the band of a phase, with what would help.

    A vehicle whose hull gives way more than the water runs away e-fold in a time 1/sigma, and has
    to be looked at before. One that is left to the law `rate` goes as far between two looks as the
    smallest change of volume, or the smallest speed that is seen, makes it.
    """
    for phase, stage in zip(mission.phases, plan.stages, strict=True):
        if phase.depth is None:
            continue
        psi = look_up(plan.table, float(plan.given[Given.STEP]), Table.NEUTRAL, phase.depth)[1]
        if stage[Stage.CAPTURE] > 0.0:
            own = DeadbandParameters(*map(float, stage[Stage.HOLD :]))
            _check_growth(vehicle, phase, psi, own.interval, own.fastest)
            _check_noise(phase, own)
        else:
            law = RateParameters(*map(float, stage[Stage.LAW : Stage.CAPTURE]))
            _check_growth(vehicle, phase, psi, law.dead + law.run, law.far_speed)
            if phase.kind == "hold":  # what is parked is corrected seldom, and told by the flight
                _check_band(vehicle, phase, psi, law, plan)


def _check_growth(
    vehicle: Vehicle, phase: Phase, psi: float, interval: float, speed: float
) -> None:
    sigma = runaway(vehicle, psi, speed)
    if sigma * interval > _GROWTH:
        raise NoAnswerError(
            f"the vehicle runs away from {phase.depth:g} m e-fold in {1.0 / sigma:.3g} s, as its "
            f"hull gives way by {psi * 1e6:.3g} cm3/m more than the water there, and the phase "
            f"{phase.title!r} looks every {interval:.3g} s. Look every {_GROWTH / sigma:.3g} s or "
            "oftener (check_interval), or stiffen the hull (hull.psi)"
        )


def _check_noise(phase: Phase, law: DeadbandParameters) -> None:
    least = _NOISE * law.depth_noise * law.growth
    if least > law.band:
        raise NoAnswerError(
            f"the band of the phase {phase.title!r}, {law.band:g} m, drowns in the noise of the "
            f"depth, {law.depth_noise:.3g} m (sensors). Allow {least:.2g} m, or take a better "
            "sensor"
        )


def least_band(
    vehicle: Vehicle, psi: float, law: RateParameters, volume_step: float
) -> tuple[float, float]:
    """Return the least tolerance [m] that the law `rate` keeps, and the speed behind it [m/s].

    volume_step: the smallest change of volume [m3]; it makes a speed w by c w^2, or as slow a one
    as is not seen, and between two looks, h, the vehicle goes w h. Where it runs away it does so
    over the look that sees it and the one that mends it, e^(2 sigma h); where it is stable it rests
    within volume_step/|psi|.
    """
    look = law.dead + law.run
    speed = max(0.5 * law.speed_step, math.sqrt(volume_step / law.coefficient))
    if speed <= 0.0:
        return 0.0, 0.0
    least = speed * look * math.exp(2.0 * runaway(vehicle, psi, speed) * look)
    if psi < 0.0:
        least = min(least, max(volume_step / -psi, drift(vehicle, psi, 0.5 * law.speed_step)))
    return least, speed


def drift(vehicle: Vehicle, psi: float, speed: float) -> float:
    """Return how far from rest a stable vehicle is that still moves at a speed [m/s], in metres."""
    if speed <= 0.0:
        return 0.0
    return abs(drag_force(vehicle.drag, speed)) / (vehicle.water.specific_weight * abs(psi))


def _check_band(
    vehicle: Vehicle, phase: Phase, psi: float, law: RateParameters, plan: Plan
) -> None:
    quantum, step = float(plan.given[Given.QUANTUM]), float(plan.given[Given.STEP])
    depth = 0.0 if phase.depth is None else phase.depth
    rates = [look_up(plan.table, step, n, depth)[0] for n in (Table.RATE_OUT, Table.RATE_IN)]
    smallest = max(law.volume_step, quantum * max(*rates, 0.0))
    least, speed = least_band(vehicle, psi, law, smallest)
    if least > law.tolerance:
        raise NoAnswerError(
            f"the phase {phase.title!r} cannot be held within {law.tolerance:g} m of {depth:g} m: "
            f"the law `rate` changes the volume by {smallest * 1e6:.3g} cm3 at least and sees no "
            f"speed below {50.0 * law.speed_step:.2g} cm/s, so that it goes at {100.0 * speed:.2g} "
            f"cm/s from look to look, every {law.dead + law.run:.3g} s. Allow {least:.2g} m, look "
            "more often (check_interval), or lessen volume_step, speed_step or actuator.quantum"
        )
