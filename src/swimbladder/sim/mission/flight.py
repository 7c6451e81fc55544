"""A mission flown: from the plan to its end, chunk by chunk, kept on disk in case of a kill.

Whether a mission can be done: by its stroke and depths beforehand, else by its first cycle.

What goes together at all, what the phases take of the stroke, and how deep it may go is known
beforehand. Whether a phase comes to its depth in its time, holds it, and comes up again is read
from the first cycle flown; what would do is found by flying that once more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.law import leaves
from swimbladder.control.rate import RateParameters
from swimbladder.control.registry import own_law
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.mission import Mission, Phase
from swimbladder.io.progress import Advance, silent, so_far
from swimbladder.jobs import Store
from swimbladder.physics.arrays import Array
from swimbladder.physics.hull import check_mass
from swimbladder.physics.seawater import Column, look_up
from swimbladder.physics.seawater.cast import check_cast_unit
from swimbladder.sim.closed_loop.checks import check_dive, check_sample_time
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import Account, Note, Records, Stop, Table, lane_of
from swimbladder.sim.mission import orders, words
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.law_flight import Pilot, pilot_of
from swimbladder.sim.mission.prepare import DriveError, Plan, State, first_state, make_plan
from swimbladder.units import rounded, say
from swimbladder.vehicle import Vehicle

_say = partial(say, "sim", "mission")

_NOISE = 6.0  # standard deviations of the depth that a band takes
_NEAR = 1.25  # a remedy over what does not do, to which it is found by flights
_SPAN = 16.0  # times as often: no vehicle that this does not hold is named an interval


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


def check_flight(vehicle: Vehicle, mission: Mission, column: Column) -> None:
    """Raise InputError where vehicle, mission and water do not go together."""
    if not mission.phases:
        remedy = "Fly it with `swimbladder simulate`, or write [[phases]]"
        what = "the mission has set-points, and this takes phases"
        raise InputError(what, field="setpoints", remedy=remedy)
    check_mass(vehicle)
    if vehicle.controller is not None:
        own_law(vehicle, sampled=False)
    places = [("the start of the mission", mission.start_depth)]
    places += [(f"the phase {p.title!r}", mission.reached(p)) for p in mission.phases]
    if column.cast is not None:
        deepest = max(depth for _, depth in places)
        check_cast_unit(column.cast, deepest, vehicle.hull.depth_limit)
    ends = column.deepest
    for where, depth in places:
        if depth > ends + column.step:
            what = (
                f"{column.source or 'the water'} ends at {ends:.0f} m, {depth - ends:.0f} m above "
                f"the {depth:g} m of {where}"
            )
            remedy = "Take a cast that goes as deep, or ask for a lesser depth"
            raise InputError(what, field="cast", value=round(ends, 1), unit="m", remedy=remedy)


def check_reach(vehicle: Vehicle, mission: Mission, plan: Plan) -> Reach:
    """Return what a mission takes of the stroke.

    Raises NoAnswerError where stroke or depth exclude it: what fails, where, by how much; and
    InputError for a sample time at which a law does not hold the vehicle.
    """
    _check_sampling(vehicle, mission, plan)
    _check_dive(vehicle, mission, plan)
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
            _say("stroke too short", need=need, lack=lack, end=end, reserve=reserve)
        )
    _check_depths(vehicle, mission, plan)
    return found


def reach_of(vehicle: Vehicle, mission: Mission, plan: Plan) -> Reach:
    """Return the smallest and the largest volume that a mission takes, wherever it leads."""
    needs: list[Need] = []
    before = mission.start_depth
    for phase in mission.phases:
        depth = mission.reached(phase)
        needs += _needs(vehicle, phase, before, depth, plan)
        before = depth
    first = mission.reached(mission.phases[0])
    if len(mission.phases) > 1:  # the next cycle begins where this one ends
        needs += _needs(vehicle, mission.phases[0], before, first, plan)
    least = min(needs, key=lambda need: need.volume)
    most = max(needs, key=lambda need: need.volume)
    stroke = vehicle.stroke
    left = min(stroke.maximum - most.volume, least.volume - stroke.minimum)
    return Reach(least, most, left / (stroke.maximum - stroke.minimum))


def _needs(vehicle: Vehicle, phase: Phase, start: float, end: float, plan: Plan) -> list[Need]:
    """Return the extreme volumes of a way from a depth to another at the law's speed."""
    law = orders.law_parameters(vehicle, phase)
    step = float(plan.given["step"])
    grid = step * np.arange(len(plan.table))
    neutral = plan.table[:, Table.NEUTRAL] + float(plan.given["trim"])
    on_way = (grid >= min(start, end)) & (grid <= max(start, end))
    depths = np.unique(np.concatenate((grid[on_way], [start, end])))
    volumes = np.interp(depths, grid, neutral)
    # what the law asks for, or what the drag takes on the way up where that is more
    uneven = 1.0 if end > start else max(vehicle.drag.rising_ratio, 1.0)
    slack = law.coefficient * uneven * law.far_speed**2
    how = f"at {law.far_speed:g} m/s"
    if plan.by_laws and phase.speed is None:  # the law goes as fast as it will
        slack, how = 0.0, "at last"
    rest = Need(phase.title, end, float(np.interp(end, grid, neutral)), "rest")
    if end == start:
        return [rest]
    sign, does = (-1.0, "sink") if end > start else (1.0, "rise")
    k = int(np.argmax(sign * volumes))
    volume = float(volumes[k]) + sign * slack
    return [Need(phase.title, float(depths[k]), volume, f"{does} {how}"), rest]


def _check_depths(vehicle: Vehicle, mission: Mission, plan: Plan) -> None:
    deepest, back = float(plan.given["deepest"]), plan.back
    if mission.safety.deepest is not None and mission.safety.deepest > back:
        raise NoAnswerError(_say("too deep for it", mission=mission, back=back))
    limit = vehicle.hull.depth_limit or np.inf
    why = "below which it could not come up" if back < limit else "hull.depth_limit"
    if mission.safety.deepest is not None:
        why = "safety.deepest"
    ways = [(f"the phase {p.title!r} goes to", p.depth) for p in mission.phases]
    for what, depth in [("the mission begins at", mission.start_depth), *ways]:
        if depth is not None and depth > deepest:
            flow = look_up(plan.table, float(plan.given["step"]), Table.RATE_OUT, depth)[0]
            remedy = "Ask for less"
            if flow <= 0.0 and back <= deepest:
                why += ": its drive stalls"
                remedy = "Take a stronger motor or a pressure amplifier, or ask for less"
            raise NoAnswerError(
                f"{what} {depth:g} m, {depth - deepest:.4g} m below the {deepest:.4g} m that "
                f"{vehicle.name!r} may go to ({why}). {remedy}"
            )


def _check_sampling(vehicle: Vehicle, mission: Mission, plan: Plan) -> None:
    for n, (phase, law) in enumerate(zip(mission.phases, plan.laws, strict=False)):
        if law.law.command != "volume change" and phase.depth is not None:
            by = law.law, law.parameters, law.sample_time
            try:
                check_sample_time(vehicle, *by, depths=[phase.depth])
            except InputError as error:
                own = phase.sample_time is not None
                raise (error.but(field=f"phases[{n}].sample_time") if own else error) from None


def _check_dive(vehicle: Vehicle, mission: Mission, plan: Plan) -> None:
    """Raise NoAnswerError where a vehicle that floats can let nothing in."""
    afloat = mission.start_depth == 0.0 or any(p.kind == "surface" for p in mission.phases[:-1])
    afloat |= mission.phases[-1].kind == "surface" and plan.given["last_cycle"] > 1.0
    if not afloat or all(phase.kind == "surface" for phase in mission.phases):
        return
    check_dive(vehicle)


def check_cycle(flight: Flight, fly: Callable[[Mission], Flight]) -> None:
    """Raise NoAnswerError where the first cycle flown shows that the mission cannot be done.

    Where a phase of it had too little time for its way, or runs of its pump too short to press out;
    where a hold was not held, nor a park from which the vehicle diverges, or a band is too narrow
    for the noise of the depth. fly: flies the first cycle of another mission of the same vehicle.
    """
    begun = flight.notes[flight.notes["what"] == Note.PHASE]
    grounded = flight.notes["number"][flight.notes["what"] == Note.GROUNDED]
    for n, phase in enumerate(flight.mission.phases):
        if n in grounded:
            continue  # what it came to is said with the rest
        if int(flight.cycles["missed"][0]) >> n & 1:
            _refuse_way(flight, n, float(begun["z"][n]))
        elif phase.kind in ("park", "hold") and not flight.plan.by_laws and not _met(flight, n):
            _refuse_band(flight, n, fly)


def _met(flight: Flight, n: int) -> bool:
    """Return whether a phase arrived in the first cycle, and held a band that can be seen."""
    cycle = flight.cycles[0]
    failed = int(cycle["missed"]) | int(cycle["not_held"])
    sank = flight.whole["cycle"] == 0 and flight.stop in (Stop.PASSED_DEPTH, Stop.LOST)
    if failed >> n & 1 or (sank and flight.whole["phase"] == n):
        return False
    stage = flight.plan.stages[n]
    return bool(stage["capture"] == 0.0 or _seen(stage) <= stage["tolerance"])


def _seen(stage: np.record) -> float:
    """Return the least band [m] that `hold_step` sees through the noise of the depth."""
    law = DeadbandParameters(*map(float, stage["hold"]))
    return _NOISE * law.depth_noise * law.growth


def _refuse_way(flight: Flight, n: int, begin: float) -> None:
    """Refuse a phase that began at a depth [m] and could not come to its own in its time."""
    title, stage = flight.mission.titles[n], flight.plan.stages[n]
    came = words.timeout_words(flight, n)
    if starts := words.starts_words(flight, n):
        raise NoAnswerError(
            f"the phase {title!r} does not come up from {begin:.0f} m: {came}. {starts}, or ask "
            "for less depth"
        )
    phase, speed = flight.mission.phases[n], float(stage["speed"])
    what = "duration" if phase.kind == "park" else "timeout"
    limit = float(stage[what])
    ends = words.late_notes(flight, n)["z"][0]
    way, left = words.shortage(flight, n, np.array([begin, ends]))
    if way > speed * limit and not (flight.plan.by_laws and phase.speed is None):
        raise NoAnswerError(
            f"the {what} of the phase {title!r}, {limit:g} s, is too short by {left / speed:.0f} s "
            f"at {speed:g} m/s: {came}. Lengthen it, or go faster"
        )


def _refuse_band(flight: Flight, n: int, fly: Callable[[Mission], Flight]) -> None:
    """Refuse a hold that was not held, or a phase from whose depth the vehicle ran away."""
    phase, plan, stage = flight.mission.phases[n], flight.plan, flight.plan.stages[n]
    depth, band = float(stage["depth"]), float(stage["tolerance"])
    rate = RateParameters(*map(float, stage["law"]))
    interval, speed, drowned = rate.dead + rate.run, rate.far_speed, False
    why = f", with changes of volume of {rate.volume_step * 1e6:.3g} cm3 at least"
    remedies = ["go slower (speed)"]
    if stage["capture"] > 0.0:
        own = DeadbandParameters(*map(float, stage["hold"]))
        interval, speed, why, drowned = own.interval, own.fastest, "", _seen(stage) > band
    if drowned:
        stated = own.depth_noise > orders.LEAST_NOISE
        whose = "(sensors)" if stated else "1 sigma, which is assumed where sensors state no more"
        why = f", and drowns in the noise of the depth, {own.depth_noise:.3g} m {whose}"
        remedies = ["take a better sensor"] if stated else []
    psi = look_up(plan.table, float(plan.given["step"]), Table.NEUTRAL, depth)[1]
    sigma = orders.growth_rate(flight.vehicle, psi, speed)
    if sigma > 0.0:
        why += _say("unstable there", sigma=1.0 / sigma, psi=psi)
        remedies += ["stiffen the hull (hull.psi)"]
    elif phase.kind != "hold" and not drowned:
        return  # a park at its cost
    time, inside, _, most = flight.accounts[len(Account) :].reshape(-1, len(Holding))[n]
    went = "it never arrived"
    if time > 0.0:
        share = 100.0 * inside / time
        went = (
            f"it was within for {share:.3g} % of the time since it came, {most:.3g} m off at most"
        )
    if flight.stop in (Stop.PASSED_DEPTH, Stop.LOST):
        went += f", and sank below the {plan.given['deepest']:.4g} m that it may go to"

    def does(field: str, value: float) -> bool:
        phases = list(flight.mission.phases)
        phases[n] = phase.model_copy(update={field: value})
        other = fly(flight.mission.model_copy(update={"phases": tuple(phases)}))
        return other.stop in (Stop.FINISHED, Stop.RESERVE) and _met(other, n)

    first = " for the first cycle at least" if plan.given["last_cycle"] > 1.0 else ""
    for said, field, bad, good in (
        ("sample every {} s (check_interval)", "check_interval", interval, interval / _SPAN),
        ("allow {} m", "tolerance", band, min(max(1.5 * most, 2.0 * band), 0.9 * depth)),
    ):
        found = _nearest(bad, good, partial(does, field))
        remedies = ([] if found is None else [said.format(found) + first]) + remedies
    remedy = ", or ".join(remedies)
    raise NoAnswerError(
        f"the phase {phase.title!r} cannot be held within {band:g} m of {depth:g} m: {went}. It is "
        f"sampled every {interval:.3g} s{why}. {remedy[:1].upper()}{remedy[1:]}"
        f"{words.coarse_words(flight.mission, plan, n)}"
    )


def _nearest(bad: float, good: float, does: Callable[[float], bool]) -> str | None:
    """Return a value that a flight shows to do, of two digits and near the one that does not.

    None where not even `good` does.
    """
    inwards, outwards = (ROUND_FLOOR, ROUND_CEILING)[:: 1 if good > bad else -1]
    good = _digits(good, inwards)
    if good == bad or not does(good):
        return None
    while max(good / bad, bad / good) > _NEAR:
        middle = _digits(math.sqrt(bad * good), outwards)
        if middle in (bad, good):
            break
        bad, good = (bad, middle) if does(middle) else (middle, good)
    return rounded(good, 2)


def _digits(value: float, way: str) -> float:
    """Return a number to two digits, never below it or never above it."""
    exact = Decimal(repr(float(value)))
    return float(exact.quantize(Decimal(1).scaleb(exact.adjusted() - 1), rounding=way))


_MOST = 1e6  # rows of steps that are kept in all; those where something changes come on top
_NOTES, _CYCLES = 8_000, 8


@dataclass(frozen=True, kw_only=True)
class Flight:
    """What was flown: see `engine.rodas.records` and `mission.core.records`.

    rows [n] of ROW, notes [k] of NOTE, cycles [c] of CYCLE; begin and end: of NOW, whole: of AT,
    accounts: of `Account`, the last three at the end. reach: what it takes of the stroke.
    """

    vehicle: Vehicle
    mission: Mission
    column: Column
    plan: Plan
    rows: Records
    notes: Records
    cycles: Records
    begin: np.record
    end: np.record
    whole: np.record
    accounts: Array
    stop: Stop
    reach: Reach

    def __repr__(self) -> str:
        flown = f"{len(self.cycles)} cycles, {len(self.rows)} steps, {self.duration:g} s"
        return f"Flight({self.vehicle.name!r}, {self.mission.name!r}: {flown}, {self.stop.name})"

    @property
    def duration(self) -> float:
        """Time flown [s]."""
        return float(self.end["t"])


def fly_mission(
    vehicle: Vehicle,
    mission: Mission,
    column: Column,
    *,
    waves: Array | None = None,
    cycles: int | None = None,
    span: float | None = None,
    seed: int | None = None,
    accuracy: Accuracy | None = None,
    drive_error: DriveError | None = None,
    supervised: bool | None = None,
    start_volume: float | None = None,
    keep: Path | None = None,
    checked: bool = True,
    advance: Advance = silent,
) -> Flight:
    """Fly a mission with phases to its end.

    waves: of `seawater.motion_table`; waves, cycles, span [s]: in the place of the mission's. seed:
    of the sensors' noise, None: they have neither noise nor quantum. drive_error: what the drive
    gives over what its processor assumes. supervised: whether its supervisor watches the vehicle,
    as of `phase_laws.watch_of`. start_volume [m3]: at a start_depth other than 0, in the place of
    the neutral one. keep: a folder for what is flown, so that a flight that was killed goes on
    there, to the same end bit for bit. checked: refuse what cannot be done, by stroke and depths or
    by the first cycle flown; else it is flown to whatever end it has. advance: called with the
    share of the mission that was flown.

    Raises InputError where vehicle, mission and water do not go together, NoAnswerError for a
    mission that cannot be done and as `buoyancy_engine.drive_map` does.
    """
    check_flight(vehicle, mission, column)
    mission = mission.limited(cycles=cycles, duration=span)
    how: dict[str, Any] = dict(waves=waves, accuracy=accuracy, drive_error=drive_error)
    how["supervised"] = supervised
    plan = make_plan(vehicle, mission, column, **how)
    judge = check_reach if checked else reach_of
    reach = judge(vehicle, mission, plan)
    state = first_state(plan, mission, seed=seed, volume=start_volume)
    x, at, accounts = state
    laws = [(source_of(n.law), n.law.name, n.sample_time, leaves(n.parameters)) for n in plan.laws]
    about = (vehicle, mission, column, laws, plan.supervised, seed, start_volume)
    pilot = pilot_of(vehicle, mission, plan, state, seed=seed, volume=start_volume)
    begin = x.copy()
    store = Store(keep, *about, plan.given, plan.table, plan.waves, plan.stages, begin, at.copy())

    def flown(rows: Records, notes: Records, cycles: Records) -> Flight:
        """Return the flight so far, with these rows, notes and cycles."""
        return Flight(
            vehicle=vehicle,
            mission=mission,
            column=column,
            plan=plan,
            rows=rows,
            notes=notes,
            cycles=cycles,
            begin=begin,
            end=x,
            whole=at,
            accounts=accounts,
            stop=Stop(int(at["stop"])),
            reach=reach,
        )

    def first(mission: Mission) -> Flight:
        asked = how | {"seed": seed, "start_volume": start_volume}
        return fly_mission(vehicle, mission, column, cycles=1, checked=False, **asked)

    def check(*parts: Array) -> None:
        if checked:
            check_cycle(flown(*parts), first)

    try:
        return flown(*_fly(plan, state, pilot, store, advance, check))
    except NoAnswerError:
        store.forget()  # of a mission that cannot be done
        raise


def _fly(
    plan: Plan,
    state: State,
    pilot: Pilot,
    store: Store,
    advance: Advance,
    check: Callable[..., None],
) -> tuple[Records, Records, Records]:
    """Fly to the end, part by part; return rows, notes and cycles.

    check: called with them once the first cycle is over.
    """
    x, at, accounts = state
    parts: list[tuple[Records, Records, Records]] = []
    kept: dict[str, Any] | None = None
    while (found := store.read("part", len(parts))) is not None:
        kept = found
        parts.append((kept["rows"], kept["notes"], kept["cycles"]))
    if kept is not None:
        lane_of(x)[:], lane_of(at)[:], accounts[:] = kept["x"], kept["at"], kept["accounts"]
        pilot.resume(kept)
    whole, report, spacing = _whole(plan), so_far(advance), plan.longest / _MOST
    checked = at["cycle"] > 0
    while at["stop"] == 0:
        cycles = _CYCLES if checked else 1
        flown = plan.under_way(state, rows=pilot.rows, notes=_NOTES, cycles=cycles)
        counts, room = flown.lane.counts, True
        while room and pilot.fly(flown) is Stop.GOES_ON:
            report(min(whole(x, at), 1.0))
            room = counts[0] < pilot.rows // 2 and counts[1] < _NOTES // 2
            room = room and counts[2] < cycles
        part = (
            thinned(flown.rows[: counts[0]], spacing),
            flown.lane.notes[: counts[1]].copy(),
            flown.cycles[: counts[2]].copy(),
        )
        parts.append(part)
        if not checked and counts[2] > 0:
            checked = True
            check(*_joined(parts))
        named = dict(zip(("rows", "notes", "cycles"), part, strict=True)) | pilot.kept()
        now = {"x": lane_of(x), "at": lane_of(at), "accounts": accounts}
        store.write(named | now, "part", len(parts) - 1)
    return _joined(parts)


def _joined(parts: list[tuple[Records, Records, Records]]) -> tuple[Records, Records, Records]:
    rows, notes, cycles = (np.concatenate([part[n] for part in parts]) for n in range(3))
    return rows, notes, cycles


def thinned(rows: Records, spacing: float) -> Records:
    """Return rows without those that come sooner than `spacing` [s] after another.

    The first and the last stay, and those on both sides of a change of what is done.
    """
    if len(rows) < 3 or spacing <= 0.0:
        return rows.copy()
    state = rows[["phase", "doing", "cycle"]]
    changes = state[1:] != state[:-1]
    ticks = np.diff(np.floor(rows["t"] / spacing)) > 0.0
    keep = np.ones(len(rows), dtype=bool)
    keep[1:-1] = changes[:-1] | changes[1:] | ticks[:-1]
    return np.asarray(rows[keep])


def _whole(plan: Plan) -> Callable[[np.record, np.record], float]:
    """Return the function that computes which share of a mission is flown."""
    cycles, span = float(plan.given["last_cycle"]), float(plan.given["last_time"])
    full, reserve = float(plan.given["charge"]), float(plan.given["reserve"])

    def share(x: np.record, at: np.record) -> float:
        drawn = (full - x["charge"]) / (full - reserve) if full > reserve > 0.0 else 0.0
        return float(max(at["cycle"] / cycles, x["t"] / span, drawn))

    return share
