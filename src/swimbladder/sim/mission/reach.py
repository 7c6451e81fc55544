"""What physics tells of a mission before it is flown: stroke, stall, depth, time, the cast."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.registry import own_law
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.mission import Mission, Phase
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.hull import check_mass
from swimbladder.physics.seawater import Column, look_up
from swimbladder.physics.seawater.cast_unit import check_cast_unit
from swimbladder.physics.seawater.column import ATMOSPHERE
from swimbladder.sim.engine.rodas.names import Given, Table
from swimbladder.sim.mission.core.names import Stage
from swimbladder.sim.mission.holding import check_holds
from swimbladder.sim.mission.orders import law_parameters
from swimbladder.sim.mission.prepare import Plan
from swimbladder.sim.mission.rescue import return_depth
from swimbladder.sim.mission.starts import check_starts
from swimbladder.vehicle import PumpAndValve, Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Need:
    """A volume [m3] that a phase takes at a depth [m], and what for."""

    phase: str
    depth: float
    volume: float
    words: str


@dataclass(frozen=True)
class Reach:
    """The smallest and the largest volume that a mission takes, and what is left of the stroke."""

    least: Need
    most: Need
    margin: float  # -, what is left at the nearer end, over the whole stroke


def check_flight(
    vehicle: Vehicle, mission: Mission, column: Column, *, cycles: float | None, span: float | None
) -> None:
    """Raise InputError where vehicle, mission and water do not go together.

    cycles, span [s]: in the place of the mission's.
    """
    if not mission.phases:
        raise InputError(
            "the mission has set-points, and this takes phases", field="setpoints",
            remedy="Fly it with `swimbladder simulate`, or write [[phases]]",
        )  # fmt: skip
    check_mass(vehicle)
    if vehicle.controller is not None:
        own_law(vehicle, sampled=False)
    if cycles is not None and not (cycles >= 1 and cycles == math.floor(cycles)):
        raise InputError(
            "it must be a whole number of at least 1", field="cycles", value=cycles,
            remedy="Give how often the phases are repeated",
        )  # fmt: skip
    if span is not None and not span > 0.0:
        raise InputError("it must be above 0", field="duration", value=span, unit="s",
                         remedy="Check the number and its unit")  # fmt: skip
    if column.cast is not None:
        depths = [mission.start_depth, *(p.depth for p in mission.phases if p.depth is not None)]
        check_cast_unit(column.cast, max(depths), vehicle.hull.depth_limit)
    places = [("the start of the mission", mission.start_depth)]
    places += [(f"the phase {p.title!r}", p.depth) for p in mission.phases if p.depth is not None]
    for what, depth in places:
        if depth > column.deepest + column.step:
            raise InputError(
                f"{column.source or 'the water'} ends at {column.deepest:.0f} m, "
                f"{depth - column.deepest:.0f} m above the {depth:g} m of {what}",
                field="cast", value=round(column.deepest, 1), unit="m",
                remedy="Take a cast that goes as deep, or ask for a lesser depth",
            )  # fmt: skip


def check_reach(vehicle: Vehicle, mission: Mission, plan: Plan) -> Reach:
    """Return what a mission takes of the stroke.

    Raises NoAnswerError where it cannot be done: what fails, where, by how much.
    """
    _check_dive(vehicle, mission, plan)
    _check_stall(mission, plan)
    check_starts(vehicle, mission, plan)
    found = reach_of(vehicle, mission, plan)
    stroke = vehicle.stroke
    length = stroke.maximum - stroke.minimum
    kept = mission.safety.stroke * length
    over = found.most.volume - (stroke.maximum - kept)
    under = stroke.minimum + kept - found.least.volume
    lack, need = max((over, found.most), (under, found.least), key=lambda pair: pair[0])
    if lack > 0.0:
        end = stroke.maximum if over >= under else stroke.minimum
        reserve = f", with {kept * 1e6:.4g} cm3 kept back (safety.stroke)" if kept > 0.0 else ""
        raise NoAnswerError(
            f"the stroke is too short at {need.depth:.0f} m by {lack * 1e6:.3g} cm3: to "
            f"{need.words} there takes {need.volume * 1e6:.4g} cm3 (phase {need.phase!r}), and it "
            f"ends at {end * 1e6:.4g} cm3{reserve}. Trim the vehicle, lengthen its stroke, or go "
            "slower or less deep"
        )
    _check_depths(vehicle, mission, plan)
    _check_times(mission, plan)
    if not plan.laws:
        check_holds(vehicle, mission, plan)
    return found


def reach_of(vehicle: Vehicle, mission: Mission, plan: Plan) -> Reach:
    """Return the smallest and the largest volume that a mission takes, wherever it leads."""
    needs: list[Need] = []
    before = mission.start_depth
    for phase in mission.phases:
        depth = 0.0 if phase.depth is None else phase.depth
        needs += _needs(vehicle, phase, before, depth, plan)
        before = depth
    first = mission.phases[0].depth or 0.0
    if len(mission.phases) > 1:  # the next cycle begins where this one ends
        needs += _needs(vehicle, mission.phases[0], before, first, plan)
    least = min(needs, key=lambda need: need.volume)
    most = max(needs, key=lambda need: need.volume)
    stroke = vehicle.stroke
    left = min(stroke.maximum - most.volume, least.volume - stroke.minimum)
    return Reach(least, most, left / (stroke.maximum - stroke.minimum))


def _needs(vehicle: Vehicle, phase: Phase, start: float, end: float, plan: Plan) -> list[Need]:
    """Return the extreme volumes of a way from a depth to another at the law's speed."""
    law = law_parameters(vehicle, phase)
    step = float(plan.given[Given.STEP])
    grid = step * np.arange(len(plan.table))
    neutral = plan.table[:, Table.NEUTRAL] + float(plan.given[Given.TRIM])
    on_way = (grid >= min(start, end)) & (grid <= max(start, end))
    depths = np.unique(np.concatenate((grid[on_way], [start, end])))
    volumes = np.interp(depths, grid, neutral)
    # what the law asks for, or what the drag takes on the way up where that is more
    uneven = 1.0 if end > start else max(vehicle.drag.rising_ratio, 1.0)
    slack = law.coefficient * uneven * law.far_speed**2
    how = f"at {law.far_speed:g} m/s"
    if plan.laws and phase.speed is None:  # the law goes as fast as it will
        slack, how = 0.0, "at last"
    found = []
    if end > start:
        k = int(np.argmin(volumes))
        words = f"sink {how}"
        found.append(Need(phase.title, float(depths[k]), float(volumes[k]) - slack, words))
    elif end < start:
        k = int(np.argmax(volumes))
        words = f"rise {how}"
        found.append(Need(phase.title, float(depths[k]), float(volumes[k]) + slack, words))
    at_end = float(np.interp(end, grid, neutral))
    found.append(Need(phase.title, end, at_end, "rest"))
    return found


def _check_depths(vehicle: Vehicle, mission: Mission, plan: Plan) -> None:
    deepest = float(plan.given[Given.DEEPEST])
    step = float(plan.given[Given.STEP])
    back = return_depth(vehicle, mission, plan.table, step)
    if mission.safety.deepest is not None and mission.safety.deepest > back:
        raise NoAnswerError(
            f"safety.deepest is {mission.safety.deepest:g} m, and below {back:.0f} m the vehicle "
            "could not come up: its neutral volume is beyond the stroke, or the drive stalls. "
            f"Write {back:.0f} m at most, or leave it out"
        )
    limit = vehicle.hull.depth_limit or np.inf
    why = "below which it could not come up" if back < limit else "hull.depth_limit"
    if mission.safety.deepest is not None:
        why = "safety.deepest"
    ways = [(f"the phase {p.title!r} goes to", p.depth) for p in mission.phases]
    for what, depth in [("the mission begins at", mission.start_depth), *ways]:
        if depth is not None and depth > deepest:
            raise NoAnswerError(
                f"{what} {depth:g} m, {depth - deepest:.4g} m below the {deepest:g} m that "
                f"{vehicle.name!r} may go to ({why}). Ask for less"
            )


def _check_dive(vehicle: Vehicle, mission: Mission, plan: Plan) -> None:
    """Raise NoAnswerError where a vehicle that floats can let nothing in."""
    afloat = mission.start_depth == 0.0 or any(p.kind == "surface" for p in mission.phases[:-1])
    afloat |= mission.phases[-1].kind == "surface" and plan.given[Given.LAST_CYCLE] > 1.0
    if not afloat or all(phase.kind == "surface" for phase in mission.phases):
        return
    top = max(vehicle.hull.emergence_depth, 0.0)
    pressure = look_up(plan.table, float(plan.given[Given.STEP]), Table.PRESSURE, top)[0]
    drive = drive_map(vehicle, pressure, power=False)
    flows = (float(drive.rate_in[0]), float(drive.bypass_in[0]))
    if max(flows) > 0.0:
        return
    a = vehicle.actuator
    why = "its drive draws nothing in there"
    if isinstance(a, PumpAndValve):
        over = a.internal_pressure - ATMOSPHERE
        why = (
            f"the gas in the hull (actuator.internal_pressure) is {over / 1e5:.2g} bar above the "
            "atmosphere, and nothing presses the oil back. Close the hull at a lower pressure"
        )
    raise NoAnswerError(f"the vehicle {vehicle.name!r} floats and does not dive: {why}")


def _check_stall(mission: Mission, plan: Plan) -> None:
    table, step = plan.table, float(plan.given[Given.STEP])
    rates = table[:, Table.RATE_OUT]
    stalled = np.flatnonzero(rates <= 0.0)
    if stalled.size == 0:
        return
    stall = float(stalled[0]) * step
    for phase in mission.phases:
        if phase.depth is not None and phase.depth >= stall:
            raise NoAnswerError(
                f"the drive stalls at {stall:.0f} m, {phase.depth - stall:.0f} m above the "
                f"{phase.depth:g} m of the phase {phase.title!r}: below it nothing can be pressed "
                "out, and the vehicle does not come up. Take a stronger motor, a smaller pump or "
                "a pressure amplifier, or ask for less depth"
            )


def _check_times(mission: Mission, plan: Plan) -> None:
    before = mission.start_depth
    for phase, stage in zip(mission.phases, plan.stages, strict=True):
        depth, speed = float(stage[Stage.DEPTH]), float(stage[Stage.SPEED])
        least = max(abs(depth - before) - float(stage[Stage.TOLERANCE]), 0.0) / speed
        if plan.laws and phase.speed is None:
            least = 0.0  # the law goes as fast as it will
        limit = float(stage[Stage.DURATION if phase.kind == "park" else Stage.TIMEOUT])
        if least > limit:
            what = "duration" if phase.kind == "park" else "timeout"
            raise NoAnswerError(
                f"the {what} of the phase {phase.title!r}, {limit:g} s, is too short by "
                f"{least - limit:.0f} s: from {before:g} to {depth:g} m it "
                f"takes {least:.0f} s at {speed:g} m/s. Lengthen it, or go faster"
            )
        before = depth
