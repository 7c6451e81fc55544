"""A mission flown: from the plan to its end, chunk by chunk, kept on disk in case of a kill."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.control.law import leaves
from swimbladder.errors import NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.io.progress import Advance, silent, so_far
from swimbladder.jobs import Store
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import Records, Stop, lane_of
from swimbladder.sim.mission import plan_check
from swimbladder.sim.mission.law_flight import Pilot, pilot_of
from swimbladder.sim.mission.prepare import DriveError, Plan, State, first_state, make_plan
from swimbladder.vehicle import Vehicle

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
    reach: plan_check.Reach

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
    plan_check.check_flight(vehicle, mission, column)
    mission = mission.limited(cycles=cycles, duration=span)
    how: dict[str, Any] = dict(waves=waves, accuracy=accuracy, drive_error=drive_error)
    how["supervised"] = supervised
    plan = make_plan(vehicle, mission, column, **how)
    judge = plan_check.check_reach if checked else plan_check.reach_of
    reach = judge(vehicle, mission, plan)
    state = first_state(plan, mission, seed=seed, volume=start_volume)
    x, at, accounts = state
    laws = [(source_of(n.law), n.law.name, n.sample_time, leaves(n.parameters)) for n in plan.laws]
    about = (vehicle, mission, column, laws, plan.supervised, seed, start_volume)
    pilot = pilot_of(vehicle, mission, plan, state, seed=seed, volume=start_volume)
    begin = x.copy()
    store = Store(keep, *about, plan.given, plan.table, plan.waves, plan.stages, begin, at.copy())

    def flown(rows: Records, notes: Records, cycles: Records) -> Flight:
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
            plan_check.check_cycle(flown(*parts), first)

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
