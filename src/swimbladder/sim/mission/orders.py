"""What law a phase of a mission is flown with: the vehicle's own, or one made for the phase."""

import math
from collections.abc import Sequence
from typing import Any

from swimbladder.control.deadband import DeadbandParameters, deadband_gains
from swimbladder.control.rate import RATE, RateParameters
from swimbladder.control.records import leaves
from swimbladder.io.mission import Mission, Phase
from swimbladder.physics.dynamics import drag_force
from swimbladder.sim.closed_loop.board_law import board_law
from swimbladder.sim.closed_loop.supervision import Supervision
from swimbladder.sim.mission.phase_laws import (
    PhaseLaw,
    phase_laws,
    rate_controller,
    source_of,
    watch_of,
)
from swimbladder.vehicle import Vehicle

# What a phase does where neither it nor the vehicle says so.
_SPEED = 0.1  # m/s, that of Argo floats
_TOLERANCE = 10.0  # m
_LOOKS, _PARKED = 60.0, 600.0  # s between two looks on the way, and parked
_RUN = 15.0  # s in which a speed is measured
ASLEEP = 0.5  # e-folds that an error may grow by between two looks
_RUNS = 0.3  # likewise in a minute, above which a vehicle is not left to the law `rate`
LEAST_NOISE = 1e-3  # m, of any depth


def drag_coefficient(vehicle: Vehicle, speed: float) -> float:
    """Return F_d(w)/(rho g w^2) [m3 s2/m2] at a speed [m/s]: what the law `rate` assumes."""
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
    base: RateParameters | None = rate_controller(vehicle, phase)
    if base is not None:
        tolerance = phase.tolerance or base.tolerance
        run = base.run if interval is None else min(base.run, 0.5 * interval)
        given = base._replace(
            tolerance=tolerance,
            near=max(base.near, tolerance),
            far=max(base.far, tolerance),
            run=run,
            dead=base.dead if interval is None else interval - run,
        )
        if phase.speed is None:
            return given
        return given._replace(
            far_speed=speed,
            ascent_speed=speed,
            near_speed=min(base.near_speed, speed),
            slow_speed=min(base.slow_speed, speed),
            speed_band=min(base.speed_band, 0.5 * speed),
        )
    looks = phase.check_interval or min(interval or _LOOKS, _needed(vehicle, tolerance, speed))
    run = min(_RUN, 0.5 * looks)
    return RateParameters(
        coefficient=drag_coefficient(vehicle, speed),
        tolerance=tolerance,
        near=tolerance,
        far=3.0 * tolerance,
        slow_speed=0.25 * speed,
        near_speed=0.5 * speed,
        far_speed=speed,
        ascent_speed=speed,
        speed_band=0.2 * speed,
        speed_step=0.1 * speed,
        volume_step=0.0,
        dead=looks - run,
        run=run,
        window=2.0 * looks,
    )


def _needed(vehicle: Vehicle, tolerance: float, speed: float) -> float:
    """Return the time between looks [s] in which neither way nor hull runs away from the law.

    It goes half the tolerance at the speed, at least two of its own time constants; where the hull
    gives way more than the water (psi > 0), half the time in which a small error grows e-fold.
    """
    k = drag_force(vehicle.drag, speed) / speed
    longest = max(0.5 * tolerance / speed, 2.0 * vehicle.mass / k)
    sigma = runaway(vehicle, vehicle.hull.psi, speed)
    return min(longest, ASLEEP / sigma) if sigma > 0.0 else longest


def approach_time(law: RateParameters, way: float) -> float:
    """Return the time that a way [m] takes at the speeds that the law asks for on it [s]."""
    near = min(max(law.near, law.tolerance), way)
    far = max(min(law.far, way), near)
    return (
        (way - far) / law.far_speed
        + (far - near) / law.near_speed
        + max(near - law.tolerance, 0.0) / law.slow_speed
    )


def runaway(vehicle: Vehicle, psi: float, speed: float) -> float:
    """Return how fast a small error of the depth grows, sigma [1/s]; 0 where it does not.

    m s^2 + k s = rho g psi, with k the drag over a speed [m/s] and psi [m3/m] at the depth.
    """
    if psi <= 0.0:
        return 0.0
    m, k = vehicle.mass, abs(drag_force(vehicle.drag, speed)) / speed
    pull = vehicle.water.specific_weight * psi
    return 2.0 * pull / (math.sqrt(k * k + 4.0 * m * pull) + k)


def hold_parameters(
    vehicle: Vehicle, phase: Phase, law: RateParameters, psi: float, rate: float
) -> tuple[float, DeadbandParameters] | None:
    """Return within what distance [m] `control.hold` flies a phase, and its parameters.

    None where the law `rate` does: it is the vehicle's own, the volume is not known but for seconds
    of pump and valve, or the phase goes somewhere and does not stay. A vehicle that runs away
    within minutes is flown by it all the way. psi [m3/m]: slope of the neutral volume at the
    depth; rate [m3/s]: what the drive gives there. A look comes not before the drive can have done
    twice what the speed takes.
    """
    if rate_controller(vehicle, phase) is not None or vehicle.command == "volume change":
        return None
    speed, tolerance = law.far_speed, law.tolerance
    sigma = runaway(vehicle, psi, speed)
    runs = sigma * _LOOKS > _RUNS
    if not runs and phase.kind not in ("park", "hold"):
        return None
    interval = phase.check_interval or min(
        _LOOKS, max(tolerance / speed, 1.0), ASLEEP / max(sigma, 1e-9)
    )
    if phase.check_interval is None and rate > 0.0:
        interval = max(interval, 2.0 * drag_coefficient(vehicle, speed) * speed**2 / rate)
    fastest = min(speed, tolerance / interval)
    # between that of the way and that of rest, where drag is not in proportion
    k = abs(drag_force(vehicle.drag, 0.5 * fastest)) / (0.5 * fastest)
    K2, T2 = vehicle.water.specific_weight / k, vehicle.mass / k
    gains = deadband_gains(K2, T2, psi, interval)
    sensors, stroke = vehicle.sensors, vehicle.stroke
    noise = math.hypot(sensors.depth_noise, sensors.depth_quantum / math.sqrt(12.0))
    longest = phase.check_interval or (_PARKED if phase.kind == "park" else 4.0 * _LOOKS)
    lag = interval - T2 * (1.0 - math.exp(-interval / T2))
    found = DeadbandParameters(
        K2=K2,
        T2=T2,
        psi=psi,
        depth_noise=max(noise, LEAST_NOISE),
        # the neutral volume goes along with layers and with a psi that changes on the way
        neutral_step=max(abs(psi) * fastest * interval, LEAST_NOISE / (K2 * lag)),
        band=tolerance,
        speed_band=0.3 * fastest,
        fastest=fastest,
        k_z=gains.k_z,
        k_w=gains.k_w,
        growth=gains.growth,
        interval=interval,
        longest=max(min(gains.longest, longest), interval),
        k_pV=0.0,
        # moves it by little in an interval, and is less than what it may ask for
        tolerance=min(0.02 * tolerance / (K2 * lag), 0.5 * fastest / K2),
        depth_voltage=0.0,
        rate_per_volt=0.0,
        voltage_limit=0.0,
        volume_min=stroke.minimum,
        volume_max=stroke.maximum,
        S_p=1.0,
    )
    return (math.inf if runs else law.far), found


def flown_laws(
    vehicle: Vehicle, mission: Mission, supervised: bool | None
) -> tuple[tuple[PhaseLaw, ...], Supervision | tuple[()]]:
    """Return the law of each phase, none for the mission's own rule, and what watches them.

    supervised: as of `phase_laws.watch_of`. Under a supervisor the laws of a float are those of its
    board: where the mission's own rule would fly, `rate` with the numbers of each phase. Raises
    InputError as `phase_laws`, `watch_of` and `board_law` do.
    """
    under = laws = phase_laws(vehicle, mission)
    own, phases = vehicle.controller, mission.phases
    if own is None or vehicle.command != "volume change":
        return laws, watch_of(vehicle, mission, laws, supervised)
    if not laws:
        numbers = [law_parameters(vehicle, phase) for phase in phases]
        under = tuple(PhaseLaw(RATE, n, own.sample_time, "") for n in numbers)
    watch = watch_of(vehicle, mission, under, supervised)
    if not watch:
        return laws, watch
    found = []
    for phase, one in zip(phases, under, strict=True):
        made = board_law(vehicle, one.law, one.parameters, own.sample_time, deepest=watch.reach)
        source = one.source or _rate_source(vehicle, phase)
        found.append(PhaseLaw(made.law, made.parameters, own.sample_time, source))
    return tuple(found), watch


def law_facts(
    vehicle: Vehicle, mission: Mission, *, supervised: bool = False
) -> list[dict[str, Any]]:
    """Return the law of each phase as plain values: name, sample time, parameters, their source.

    supervised: whether a supervisor watches it.
    """
    found = []
    laws: Sequence[PhaseLaw | None] = phase_laws(vehicle, mission) or [None] * len(mission.phases)
    for title, phase, law in zip(mission.titles, mission.phases, laws, strict=True):
        name, tick, numbers, source = RATE.name, None, law_parameters(vehicle, phase), ""
        if law is not None:
            name, numbers, source = law.law.name, law.parameters, law.source
            tick = law.sample_time if law.sampled else None
        if supervised and vehicle.command == "volume change" and vehicle.controller is not None:
            tick = vehicle.controller.sample_time  # of its board
        facts = {"phase": title, "law": name, "sample_time_s": tick, "parameters": leaves(numbers)}
        source = source or _rate_source(vehicle, phase)
        found.append({**facts, "supervised": supervised, "source": source})
    return found


def _rate_source(vehicle: Vehicle, phase: Phase) -> str:
    """Say where the numbers of the law `rate` come from in a phase of the mission's own rule."""
    if (base := rate_controller(vehicle, phase)) is not None:
        flown, said = leaves(law_parameters(vehicle, phase)), leaves(base)
        return source_of(vehicle, phase, [name for name in said if flown[name] != said[name]])
    source = "made by the mission from the vehicle's drag and the phase"
    if vehicle.controller is None:
        return f"{source}; {vehicle.name!r} has no [controller]"
    if phase.law is None:
        return source
    return f"{source}; the vehicle's [controller], of the law {vehicle.controller.law!r}, rests"
