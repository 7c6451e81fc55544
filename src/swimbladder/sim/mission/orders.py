"""What law a phase of a mission is flown with: the vehicle's own, or one made for the phase.

Its numbers come from there too; a supervisor may watch it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from swimbladder.control.deadband import DeadbandParameters, deadband_gains
from swimbladder.control.law import Law, leaf_names, leaves
from swimbladder.control.rate import RATE, RateParameters
from swimbladder.control.registry import bind, check_command, law_by_name
from swimbladder.errors import InputError
from swimbladder.io.mission import Mission, Phase
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import heat_expansion
from swimbladder.sim.closed_loop.checks import turned_round
from swimbladder.sim.closed_loop.floats import board_law
from swimbladder.sim.closed_loop.supervision import Supervision, supervision_of
from swimbladder.units import rounded
from swimbladder.vehicle import Controller, Vehicle


@dataclass(frozen=True)
class PhaseLaw:
    """A law that flies a phase, its parameters and the sample time [s]."""

    law: Law
    parameters: Any
    sample_time: float
    source: str  # where the numbers come from

    @property
    def sampled(self) -> bool:
        """Whether it is called at each sample; a law of volume changes says when it wants to be.

        Made one of seconds for a float's board it is called at each, too.
        """
        return self.law.command != "volume change" or self.law.within is not None

    def continues(self, other: PhaseLaw) -> bool:
        """Return whether nothing changes from another phase's law to this one."""
        same = self.law is other.law and self.sample_time == other.sample_time
        return same and self.parameters == other.parameters


def phase_laws(vehicle: Vehicle, mission: Mission) -> tuple[PhaseLaw, ...]:
    """Return the law of each phase; none where the mission's own rule flies the vehicle.

    That is: a vehicle without a controller, or phases that name the law `rate`.
    Raises InputError where a phase's law, its parameters or what else it asks for do not fit the
    vehicle, and where only some phases name `rate`.
    """
    found: list[PhaseLaw | None] = []
    for index, phase in enumerate(mission.phases):
        try:
            found.append(_law_of(vehicle, phase))
        except InputError as error:
            if phase.law is None and not phase.parameters and phase.sample_time is None:
                raise
            field = (error.field or "law").removeprefix("controller.")
            raise error.but(field=f"phases[{index}].{field}") from None
    flown = tuple(one for one in found if one is not None)
    margin = vehicle.stroke.switch_margin
    if margin and not any(one.sampled for one in flown):
        what = "the mission's own rule and laws of volume changes know no limit switches"
        remedy = "Fly a law: give the vehicle a [controller], or leave the switches out"
        raise InputError(what, field="stroke.switch_margin", value=margin, unit="m3", remedy=remedy)
    if not flown:
        why = (
            f"the mission's own rule ({RATE.name}) flies it, and rests within the tolerance anyway"
        )
        remedy = "Leave it out"
        if vehicle.command == "volume change":
            why = f"{why}; so does its board, whose law says itself when it decides"
        else:
            given = "give the vehicle ([controller]) or every phase (law) a law"
            remedy += f", or {given} that is called at each sample, not {RATE.name!r}"
        _refuse_given(mission, why, remedy, rest_band="m")
        return ()
    first = flown[0].law
    for index, one in enumerate(found):
        if one is None or not (one.sampled or one.law is first):
            what = f"other phases are flown by the law {first.name!r}, and one mission has one way"
            remedy = f'Write law = "{RATE.name}" in every phase, or in none'
            named = mission.phases[index].law
            raise InputError(what, field=f"phases[{index}].law", value=named, remedy=remedy)
    if flown[0].sampled:
        why = "the law of this phase is called at each sample: only the mission's own rule has it"
        remedy = f'Leave it out, or give a sample_time, or write law = "{RATE.name}" in every phase'
        _refuse_given(mission, why, remedy, check_interval="s")
        _check_physics(vehicle, mission)
        return flown
    why = f"the law {first.name!r} flies this phase, and chooses speeds, times and rest itself"
    remedy = "Leave it out: say it by a parameter of the law"
    _refuse_given(mission, why, remedy, speed="m/s", check_interval="s", rest_band="m")
    return flown


def watch_of(
    vehicle: Vehicle, mission: Mission, laws: Sequence[PhaseLaw], supervised: bool | None
) -> Supervision | tuple[()]:
    """Return the supervisor over the laws of a mission; () for none, as of `supervision_of`.

    laws: of each phase, under the supervisor; none: the mission's own rule, which no supervisor
    watches but that of a float's board, see `orders.flown_laws`.
    Raises InputError where it cannot be: over the rule of another vehicle, at several sample times,
    and where it would bring up a healthy vehicle, by its depth or time limit.
    """
    own, floats = vehicle.controller, vehicle.command == "volume change"
    if not any(law.sampled for law in laws) and (own is None or not floats):
        if supervised:
            what = "a supervisor watches a law that is called at each sample, and none flies this"
            raise InputError(what, field="supervised", remedy="Leave it out; see `faults`")
        return ()
    tick = own.sample_time if floats and own is not None else laws[0].sample_time
    watch = supervision_of(
        vehicle, tick, supervised, laws=[(one.law, one.parameters) for one in laws]
    )
    if not watch:
        return ()
    alone = "fly the law alone (`supervised=False`)"
    for index, law in enumerate(() if floats else laws):
        if law.sample_time != tick:
            what = f"the supervisor is called every {tick:g} s, with the law of the first phase"
            field, value = f"phases[{index}].sample_time", law.sample_time
            remedy = f"Leave it out, or {alone}"
            raise InputError(what, field=field, value=value, unit="s", remedy=remedy)
    limit = watch.depth_limit
    for index, phase in enumerate(mission.phases):
        if phase.depth is not None and phase.depth > limit:
            refused = turned_round(phase.depth, limit, f"phases[{index}].depth")
            raise refused.but(remedy=f"{refused.remedy}; or {alone}")
    whole = vehicle.supervisor.time_limit or math.inf
    if (takes := mission.least_duration) > whole:
        what = f"the mission takes {rounded(takes, 3)} s at least, and would be cut short"
        remedy = f"Give more, or ask for less; or {alone}"
        field = "supervisor.time_limit"
        raise InputError(what, field=field, value=whole, unit="s", remedy=remedy)
    return watch


def flown_by(vehicle: Vehicle, phase: Phase) -> Controller | None:
    """Return the controller of a phase: the vehicle's, with what the phase says in its place.

    None: the mission's own rule, with numbers made for the phase. Raises InputError for parameters
    or a sample time without a law, for a sample time that the law has no use for, and for a law
    that the actuator does not take.
    """
    own = vehicle.controller
    if phase.law is None and own is None:
        for name in ("parameters", "sample_time"):
            if value := getattr(phase, name):
                lacks = f"the vehicle {vehicle.name!r} has no controller"
                what = f"the phase gives it and no law, and {lacks}"
                remedy = 'Add a line law = "..." to the phase, or leave this out'
                raise InputError(what, field=name, value=value, remedy=remedy)
        return None
    name = phase.law or ("" if own is None else own.law)
    same, law = own is not None and own.law == name, law_by_name(name)
    if law is not RATE:  # which commands any drive by volumes
        remedy = f'Choose a law for this kind of actuator, or write law = "{RATE.name}"'
        check_command(law, vehicle, remedy=remedy)
    asleep = law.command == "volume change" and "S_p" not in leaf_names(law.parameters)
    if asleep and phase.sample_time is not None:
        what = f"it does nothing: the law {name!r} of this phase says itself when it is called"
        if vehicle.command == "volume change":
            what += ", and a board ticks at the sample_time of the [controller]"
        remedy = f"Leave it out{', or give a check_interval' if law is RATE else ''}"
        field, value = "sample_time", phase.sample_time
        raise InputError(what, field=field, value=value, unit="s", remedy=remedy)
    if name == RATE.name and not same and not phase.parameters:
        return None
    tick = phase.sample_time or (own.sample_time if own else 0.0) or (1.0 if asleep else 0.0)
    if not tick:
        what = f"the law {name!r} needs it, and the vehicle has no controller that has one"
        remedy = 'Add a line sample_time = "0.5 s" to the phase'
        raise InputError(what, field="sample_time", unit="s", remedy=remedy)
    kept = own.parameters if own is not None and same else {}
    return Controller(law=name, sample_time=tick, parameters={**kept, **phase.parameters})


def rate_controller(vehicle: Vehicle, phase: Phase) -> Any | None:
    """Return the parameters of the law `rate` that vehicle or phase give; None: they give none."""
    controller = flown_by(vehicle, phase)
    if controller is None or controller.law != RATE.name:
        return None
    return bind(controller)[1]


def _law_of(vehicle: Vehicle, phase: Phase) -> PhaseLaw | None:
    controller = flown_by(vehicle, phase)
    if controller is None:
        return None
    law, numbers = bind(controller)
    if law.name == RATE.name:
        return None
    return PhaseLaw(law, numbers, controller.sample_time, source_of(vehicle, phase))


def source_of(vehicle: Vehicle, phase: Phase, made: Sequence[str] = ()) -> str:
    """Say where the numbers of a phase's law come from; made: those that the mission makes."""
    own = vehicle.controller
    by = f"for {', '.join(made)}, made by the phase's kind, speed, tolerance and check_interval"
    if own is None or (phase.law not in (None, own.law)):
        return f"the phase, but {by}" if made else "the phase"
    noted = any(key.split(".")[0] == "controller" for key in vehicle.provenance)
    file = "the vehicle's [controller]" + (" (see its [provenance])" if noted else "")
    own_ones = [*phase.parameters, *(["sample_time"] if phase.sample_time else [])]
    given = [name for name in own_ones if name not in made]
    but = [f"for {', '.join(given)} of the phase"] if given else []
    but += [by] if made else []
    return f"{file}, but {' and '.join(but)}" if but else file


def _refuse_given(mission: Mission, what: str, remedy: str, **units: str) -> None:
    """Raise InputError for numbers that the phases give and that do nothing here."""
    for (index, phase), name in product(enumerate(mission.phases), units):
        if (value := getattr(phase, name)) is not None:
            field = f"phases[{index}].{name}"
            raise InputError(what, field=field, value=value, unit=units[name], remedy=remedy)


def _check_physics(vehicle: Vehicle, mission: Mission) -> None:
    """Raise InputError for what only the mission's own rule is flown with."""
    moves = mission.water_motion.internal_waves or mission.water_motion.swell
    hull, ratio = vehicle.hull, vehicle.drag.rising_ratio
    lags = hull.thermal_time_constant > 0.0 and heat_expansion(vehicle) != 0.0
    uneven = ratio != 1.0
    for there, field, value, what in (
        (bool(moves), "water_motion", None, "water that moves"),
        (lags, "hull.thermal_time_constant", hull.thermal_time_constant, "a hull that warms late"),
        (uneven, "motion.drag.rising_ratio", ratio, "drag that differs up and down"),
    ):
        if there:
            what += " is not flown with a law that is called at each sample"
            remedy = f'Leave it out, or write law = "{RATE.name}" in every phase'
            raise InputError(what, field=field, value=value, remedy=remedy)


def law_words(facts: Sequence[dict[str, Any]]) -> list[str]:
    """Return a line for each law of a mission: which phases it flies, and whose numbers it has."""
    lines: dict[tuple[str, str, str], list[str]] = {}
    for one in facts:
        law, every = f"{one['law']!r} flies", ""
        if one["sample_time_s"] is not None:
            watched = "and supervisor fly" if one["supervised"] else "alone flies"
            law, every = f"{one['law']!r} {watched}", f" every {one['sample_time_s']:g} s"
        lines.setdefault((law, every, one["source"]), []).append(one["phase"])
    return [
        f"law {law} {', '.join(names) if len(lines) > 1 else 'all phases'}{every}; the law's "
        f"numbers: {source}"
        for (law, every, source), names in lines.items()
    ]


# What a phase does where neither it nor the vehicle says so.
_SPEED = 0.1  # m/s, that of Argo floats
_TOLERANCE = 10.0  # m
_SAMPLING, _PARKED = 60.0, 600.0  # s between two samples on the way, and parked
_RUN = 15.0  # s in which a speed is measured
ASLEEP = 0.5  # e-folds that an error may grow by between two samples
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
    sampling = phase.check_interval or min(
        interval or _SAMPLING, _needed(vehicle, tolerance, speed)
    )
    run = min(_RUN, 0.5 * sampling)
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
        dead=sampling - run,
        run=run,
        window=2.0 * sampling,
    )


def _needed(vehicle: Vehicle, tolerance: float, speed: float) -> float:
    """Return the time between samples [s] in which neither way nor hull diverges from the law.

    It goes half the tolerance at the speed, at least two of its own time constants; where the hull
    gives way more than the water (psi > 0), half the time in which a small error grows e-fold.
    """
    k = drag_force(vehicle.drag, speed) / speed
    longest = max(0.5 * tolerance / speed, 2.0 * vehicle.mass / k)
    sigma = growth_rate(vehicle, vehicle.hull.psi, speed)
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


def growth_rate(vehicle: Vehicle, psi: float, speed: float) -> float:
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
    """Return within what distance [m] `hold_step` flies a phase, and its parameters.

    None where the law `rate` does: it is the vehicle's own, the volume is not known but for seconds
    of pump and valve, or the phase goes somewhere and does not stay. A vehicle that diverges within
    minutes is flown by it all the way. psi [m3/m]: slope of the neutral volume at the depth; rate
    [m3/s]: what the drive gives there. A sample comes not before the drive can have done twice what
    the speed takes.
    """
    if rate_controller(vehicle, phase) is not None or vehicle.command == "volume change":
        return None
    speed, tolerance = law.far_speed, law.tolerance
    sigma = growth_rate(vehicle, psi, speed)
    runs = sigma * _SAMPLING > _RUNS
    if not runs and phase.kind not in ("park", "hold"):
        return None
    interval = phase.check_interval or min(
        _SAMPLING, max(tolerance / speed, 1.0), ASLEEP / max(sigma, 1e-9)
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
    longest = phase.check_interval or (_PARKED if phase.kind == "park" else 4.0 * _SAMPLING)
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
