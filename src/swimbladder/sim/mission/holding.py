"""Whether a band can be held: how far a vehicle gets between two looks, and what it can do then."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.rate import RateParameters
from swimbladder.errors import NoAnswerError
from swimbladder.io.mission import Mission, Phase
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.seawater import look_up
from swimbladder.sim.engine.rodas.names import Given, Table
from swimbladder.sim.mission.core.names import Stage
from swimbladder.sim.mission.orders import LEAST_NOISE, hold_parameters, law_parameters, runaway
from swimbladder.sim.mission.prepare import Plan
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

_GROWTH = 0.8  # e-folds between two looks, above which no law of ours holds
# Of what a band holds in volume, in a step: floats a few percent apart held it for 99 % of the time
# with a quarter, for 89 % and up with a half, for 79 % and up with all of it.
_COARSE = 0.25
_TRIES = 60  # a tolerance changes how often is looked, and that what can be held
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
            _check_noise(vehicle, phase, psi, own, plan)
        else:
            law = RateParameters(*map(float, stage[Stage.LAW : Stage.CAPTURE]))
            _check_growth(vehicle, phase, psi, law.dead + law.run, law.far_speed)
            if phase.kind == "hold":  # what is parked is corrected seldom, and told by the flight
                _check_band(vehicle, phase, psi, law, plan)


def coarse_words(mission: Mission, plan: Plan, number: int) -> str:
    """Say where the steps of `rate` are too coarse for the band of a phase; "" where they are not.

    A stable vehicle comes to rest where its volume is neutral. Volumes that lie farther apart than
    a quarter of what the band holds leave it to chance whether one of them rests well inside
    before it moves on.
    """
    phase, stage = mission.phases[number], plan.stages[number]
    if phase.depth is None or stage[Stage.CAPTURE] > 0.0:
        return ""
    psi = look_up(plan.table, float(plan.given[Given.STEP]), Table.NEUTRAL, phase.depth)[1]
    law = RateParameters(*map(float, stage[Stage.LAW : Stage.CAPTURE]))
    if psi >= 0.0 or law.volume_step <= _COARSE * -psi * 2.0 * law.tolerance:
        return ""
    return (
        f". Lessen volume_step: its {law.volume_step * 1e6:.3g} cm3 move the depth of rest by "
        f"{law.volume_step / -psi:.2g} m, and the band is {2.0 * law.tolerance:.3g} m"
    )


def _check_growth(
    vehicle: Vehicle, phase: Phase, psi: float, interval: float, speed: float
) -> None:
    sigma = runaway(vehicle, psi, speed)
    if sigma * interval > _GROWTH:
        raise NoAnswerError(
            f"the vehicle runs away from {phase.depth:g} m e-fold in {1.0 / sigma:.3g} s, as its "
            f"hull gives way by {psi * 1e6:.3g} cm3/m more than the water there, and the phase "
            f"{phase.title!r} looks every {interval:.3g} s. Look every "
            f"{_to(_GROWTH / sigma, 3, ROUND_FLOOR)} s or "
            "oftener (check_interval), or stiffen the hull (hull.psi)"
        )


def _check_noise(
    vehicle: Vehicle, phase: Phase, psi: float, law: DeadbandParameters, plan: Plan
) -> None:
    if _drowned(law) <= law.band:
        return
    depth = 0.0 if phase.depth is None else phase.depth

    def least(tolerance: float) -> float:
        wider = phase.model_copy(update={"tolerance": tolerance})
        rate = min(_rates(plan, depth))
        found = hold_parameters(vehicle, wider, law_parameters(vehicle, wider), psi, rate)
        return 0.0 if found is None else _drowned(found[1])

    stated = law.depth_noise > LEAST_NOISE
    whose = "(sensors)" if stated else "1 sigma, which is assumed where sensors state no more"
    raise NoAnswerError(
        f"the band of the phase {phase.title!r}, {law.band:g} m, drowns in the noise of the "
        f"depth, {law.depth_noise:.3g} m {whose}. Allow {_allowed(least, law.band)} m"
        + (", or take a better sensor" if stated else "")
    )


def _drowned(law: DeadbandParameters) -> float:
    """Return the least band [m] that is seen through the noise of the depth."""
    return _NOISE * law.depth_noise * law.growth


def _rates(plan: Plan, depth: float) -> list[float]:
    step = float(plan.given[Given.STEP])
    return [look_up(plan.table, step, n, depth)[0] for n in (Table.RATE_OUT, Table.RATE_IN)]


def _allowed(least: Callable[[float], float], tolerance: float) -> str:
    """Return a tolerance [m] that `least` says is enough, rounded up: it changes with itself."""
    for _ in range(_TRIES):
        wanted = least(tolerance)
        if wanted <= tolerance:
            break
        tolerance = float(_to(wanted, 2, ROUND_CEILING))
    return _to(tolerance, 2, ROUND_CEILING)


def _to(value: float, digits: int, way: str) -> str:
    """Return a number to so many digits, never below it or never above it."""
    exact = Decimal(repr(float(value)))
    last = Decimal(1).scaleb(exact.adjusted() - digits + 1)
    return rounded(float(exact.quantize(last, rounding=way)), digits)


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
    depth = 0.0 if phase.depth is None else phase.depth
    run = float(plan.given[Given.QUANTUM]) * max(*_rates(plan, depth), 0.0)
    smallest = max(law.volume_step, run)
    least, speed = least_band(vehicle, psi, law, smallest)

    def wider(tolerance: float) -> float:
        given = law_parameters(vehicle, phase.model_copy(update={"tolerance": tolerance}))
        return least_band(vehicle, psi, given, max(given.volume_step, run))[0]

    if least > law.tolerance:
        raise NoAnswerError(
            f"the phase {phase.title!r} cannot be held within {law.tolerance:g} m of {depth:g} m: "
            f"the law `rate` changes the volume by {smallest * 1e6:.3g} cm3 at least and sees no "
            f"speed below {50.0 * law.speed_step:.2g} cm/s, so that it goes at {100.0 * speed:.2g} "
            f"cm/s from look to look, every {law.dead + law.run:.3g} s. Allow "
            f"{_allowed(wider, law.tolerance)} m, look more often (check_interval), or lessen "
            "volume_step, speed_step or actuator.quantum"
        )
