"""Fault missions: all of a seed in chunks, kept on disk until they are done, or one of them again.

Each is flown three ways: supervised, unsupervised, with ideal detection. As CSV a campaign has a
row per mission, one mission a row per tick.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.golden import BoardProgram
from swimbladder.codegen.library import digest, make_program
from swimbladder.control.registry import own_law
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.errors import check_counts
from swimbladder.io.answers import attributes
from swimbladder.io.files import rows_csv
from swimbladder.io.progress import Advance, silent
from swimbladder.jobs import Store, each
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import at_voltage, running_pump
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.sim.closed_loop.floats import float_model
from swimbladder.sim.engine.modes import SUPPLY, Z_BOTTOM
from swimbladder.sim.faults.c_interface import IDEAL, SUPERVISED, UNSUPERVISED, Board, c_interface
from swimbladder.sim.faults.campaign_result import ROW, FaultResult, Outcome, outcomes, reason_words
from swimbladder.sim.faults.draw import Course, Mission, Result, Trace, course_of, draw
from swimbladder.sim.faults.flight import EARLY, FULL, OWN, Room, fly
from swimbladder.sim.faults.kinds import FAULTS, KINDS, NO_PUMP, PumpTable
from swimbladder.vehicle import DatasheetPump, PumpAndValve, Vehicle

Rows = NDArray[np.void]  # of ROW


def sources(made: BoardProgram) -> dict[str, str]:
    """Return the C files of a vehicle's controller and supervisor, and what calls them here."""
    floats = made.drive is not None
    return made.sources | {"c_interface.c": c_interface(made.first, floats=floats)}


def program_of(course: Course) -> BoardProgram:
    """Return the program that `firmware` writes for the vehicle."""
    return make_program(course.vehicle, depths=(course.depths.least,))


_NO_ROWS = np.zeros((0, len(Trace._fields)))


class Functions(Protocol):
    """A board as a flight calls it: bytes that it remembers, its functions' addresses by name."""

    size: int
    addresses: dict[str, tuple[int, int]]


class FaultCampaign:
    """A board, and the room in which its missions are flown, by any thread."""

    def __init__(self, course: Course, board: Functions) -> None:
        tick = course.tick
        latest = KINDS[FAULTS["DEPTH_LATE"]].first
        assert latest is not None
        self.course, self._board = course, board
        model = None
        if course.floats:
            reach = course.vehicle.hull.depth_limit or BEYOND * course.depths.most
            model = float_model(
                course.vehicle, course.medium, course.column, reach=reach, seconds=True
            )
        late = math.ceil(latest.most / tick) + 2
        self._room = Room(board.size, late, model, pump_table(course.vehicle))
        limits = supervisor_parameters(course.vehicle, tick)
        # a slow actuator needs as many pushes
        self._longer = min(1.0 + limits.push.rest / limits.push.again, _LONGER)

    def flights(self, mission: Mission) -> list[Array]:
        """Return how a mission with faults ends: supervised, not, and twice with ideal detection.

        That is full buoyancy 60 s after the last fault acts, and 60 s after the first does, for
        a mission of two faults that is lost both supervised and with the former.
        """
        ways = ((SUPERVISED, OWN), (UNSUPERVISED, OWN), (IDEAL, FULL))
        flown = [self.flown(mission, who, how) for who, how in ways]
        ended = outcomes(np.array([flown[0], flown[2]]), mission.condition.tick)
        if len(mission.faults) > 1 and not np.any(ended == Outcome.SURFACED):
            flown.append(self.flown(mission, IDEAL, EARLY))
        return flown

    def traced(self, mission: Mission, who: str, how: int) -> tuple[Array, Array]:
        """Return (result, rows [ticks flown, len(Trace)]) of a mission."""
        ticks = int(self._lengthened(mission, who).condition.end) + 1
        rows = np.full((ticks, len(Trace._fields)), np.nan)
        result = self.flown(mission, who, how, rows)
        return result, rows[: int(result[Result._fields.index("last")]) + 1]

    def _lengthened(self, mission: Mission, who: str) -> Mission:
        """Return a mission as it is flown: who rests between pushes has longer to come up."""
        longer = self._longer if who == SUPERVISED else 1.0
        end = math.ceil(longer * mission.condition.end)
        return replace(mission, condition=mission.condition._replace(end=end))

    def flown(self, mission: Mission, who: str, how: int, record: Array = _NO_ROWS) -> Array:
        """Fly a mission with the board's functions `who`; fill record, return its result."""
        functions = self._board.addresses[who]
        return fly(self._lengthened(mission, who), how, functions, self._room, record)


_LONGER = 3.0  # times as long as without rests, at most
CHUNK, FLOATS = 200, 5  # missions; of floats, which take hours
BEYOND = 1.5  # of the deepest set-point, to which the water of a float is made


def pump_table(vehicle: Vehicle) -> PumpTable:
    """Return what a float's pump delivers at each voltage of its battery; see `PumpTable`."""
    a, supply = vehicle.engine, vehicle.supply
    if not isinstance(a, PumpAndValve):
        return NO_PUMP
    volts = np.linspace(0.0, 1.0 if supply is None else supply.voltage, _VOLTAGES)
    depth = np.linspace(0.0, _HEADS_TO, _HEADS)
    head = depth * vehicle.water.specific_weight + ATMOSPHERIC_PRESSURE - a.internal_pressure
    rates, currents = np.zeros((2, _VOLTAGES, _HEADS))
    for n, voltage in enumerate(volts[1:], 1):
        run = at_voltage(vehicle, voltage)
        rates[n], power = running_pump(run, a, head, REFERENCE_TEMPERATURE)
        currents[n] = np.maximum(np.nan_to_num(power), 0.0) / voltage
    resistance = 0.0 if supply is None else supply.internal_resistance
    motor = a.pump.motor.resistance if isinstance(a.pump, DatasheetPump) else 0.0
    return PumpTable(
        rate=rates,
        current=currents,
        per_volt=1.0 / volts[1],
        per_metre=1.0 / depth[1],
        nominal=volts[-1],
        resistance=resistance,
        motor=motor,
    )


_VOLTAGES, _HEADS, _HEADS_TO = 49, 481, 12000.0  # of a pump's table; m


def board_of(course: Course) -> Board:
    """Return the vehicle's C, compiled for this machine; raises InputError without a compiler."""
    return Board(sources(program_of(course)), (UNSUPERVISED, SUPERVISED, IDEAL))


def faults(
    vehicle: Vehicle,
    *,
    missions: int = 100_000,
    healthy: int | None = None,
    seed: int = 1,
    depth_range: tuple[float, float] | None = None,
    cast: Column | None = None,
    keep: Path | None = None,
    advance: Advance = silent,
) -> FaultResult:
    """Fly missions with faults and missions without, and return what happened.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it, with a controller and a time limit of its supervisor.
    missions
        How many with faults, 1 to 10 million.
    healthy
        How many without, 1 to 10 million; none: a tenth as many.
    seed
        Of what is drawn for the missions.
    depth_range
        Least and greatest [m]; none: from below the surface to a share of the depth at which the
        vehicle's supervisor turns it round.
    cast
        The water, as `read_cast` or `cast_column` returns it; none: the vehicle's own.
    keep
        A folder for what is done, so that a run that was killed goes on there; none: nothing is
        kept.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    FaultResult
        The missions with faults and without, a row each.

    Raises
    ------
    InputError
        The vehicle has no controller, it cannot hold the depths, the water ends above them, or
        there is no C compiler.
    NoAnswerError
        The vehicle floats and cannot dive.
    """
    own_law(vehicle, sampled=False)
    if healthy is None:
        healthy = max(missions // 10, 1)
    check_counts(missions=(missions, 1, 10_000_000), healthy=(healthy, 1, 10_000_000))
    course = course_of(vehicle, depth_range, cast)
    made = program_of(course)
    files = sources(made)
    with Board(files, (UNSUPERVISED, SUPERVISED, IDEAL)) as board:
        kept = Store(keep, course, seed, files)
        campaign, size = FaultCampaign(course, board), FLOATS if course.floats else CHUNK
        tables = np.empty(missions, ROW), np.empty(healthy, ROW)
        for table, well in zip(tables, (False, True), strict=True):
            chunks = (range(n, min(n + size, len(table))) for n in range(0, len(table), size))
            for numbers, rows in each(partial(_chunk, campaign, seed, kept, well), chunks):
                table[numbers.start : numbers.stop] = rows
                advance(len(rows) / (missions + healthy))
    program = digest(made).hex()
    return FaultResult(
        course=course, seed=seed, faulty=tables[0], healthy=tables[1], program=program
    )


def _chunk(campaign: FaultCampaign, seed: int, kept: Store, healthy: bool, numbers: range) -> Rows:
    """Return the rows of missions by their numbers, flown unless they are kept."""
    fly = partial(_rows, campaign, seed, healthy, numbers)
    return kept.get(fly, "healthy" if healthy else "faulty", numbers.start, numbers.stop)


def _rows(campaign: FaultCampaign, seed: int, healthy: bool, numbers: range) -> Rows:
    rows = np.full(len(numbers), np.nan, ROW)
    rows["faults"][:, :, 0] = 0.0
    for row, number in zip(rows, numbers, strict=True):
        mission = draw(campaign.course, seed=seed, number=number, healthy=healthy)
        row["start"], row["deepest"] = mission.condition.start_depth, max(mission.depths)
        row["bottom"], row["supply"] = mission.plant[Z_BOTTOM], mission.plant[SUPPLY]
        row["faults"][: len(mission.fault_rows)] = mission.fault_rows
        flown = [campaign.flown(mission, SUPERVISED, OWN)] if healthy else campaign.flights(mission)
        row["flights"][: len(flown)] = flown
    return rows


_MOTION = ("time_s", "depth_m", "speed_m_s", "volume_m3")
_DRIVE = ("command", "applied", "battery_V", "reference_depth_m")
_WHICH = "vehicle=course.vehicle.name water=course.water mission=mission.number healthy"
_SEEN = ("depth_seen_m", "depth_age_s", "volume_seen_m3", "leak_seen")
TRACE_COLUMNS = (*_MOTION, *_DRIVE, *_SEEN, "lost_ticks", "board", "reason", "water_m3")
assert len(TRACE_COLUMNS) == 1 + len(Trace._fields)


def missions_csv(flown: FaultResult) -> str:
    """Return a row for each mission with faults; times in s from its start."""
    tick, facts = flown.tick, flown.faulty
    columns: dict[str, Iterable[str]] = {"mission": map(str, range(len(facts)))}
    for n in (1, 2):
        kinds = [KINDS.get(int(code)) for code in flown.fault_row(n - 1, "kind")]
        sizes = zip(kinds, map(_number, flown.fault_row(n - 1, "first")), strict=True)
        columns[f"fault_{n}"] = [kind.name if kind else "" for kind in kinds]
        columns[f"severity_{n}"] = [size if kind and kind.first else "" for kind, size in sizes]
        for name, field in (("onset", "begin"), ("end", "end")):
            times = map(_number, flown.fault_row(n - 1, field) * tick)
            columns[f"{name}_{n}_s"] = [
                time if kind else "" for kind, time in zip(kinds, times, strict=True)
            ]
    columns |= {
        "start_depth_m": map(_number, facts["start"]),
        "deepest_setpoint_m": map(_number, facts["deepest"]),
        "bottom_m": map(_number, facts["bottom"]),
        "supply_V": map(_number, facts["supply"]),
        "recoverable": map(_number, flown.recoverable),
        "supervised": [Outcome(int(how)).words for how in flown.outcome(0)],
        "reason": map(flown.reason, range(len(facts))),
        "latched_s": map(_number, flown.result(0, "latched") * tick),
        "release_s": map(_number, flown.result(0, "released") * tick),
        "deepest_m": map(_number, flown.result(0, "deepest")),
        "resets": map(_number, flown.result(0, "resets")),
        "unsupervised": [Outcome(int(how)).words for how in flown.outcome(1)],
        "unsupervised_deepest_m": map(_number, flown.result(1, "deepest")),
    }
    return rows_csv(columns, zip(*columns.values(), strict=True))


def trace_csv(rows: Array, tick: float) -> str:
    """Return a row per tick [n, len(Trace)] of one mission."""
    whole = np.column_stack((np.arange(len(rows)) * tick, rows))
    return rows_csv(TRACE_COLUMNS, np.where(np.isfinite(whole), whole, np.nan).tolist())


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "nan"


NAMES = ("supervised", "unsupervised", "ideal_detection")


@dataclass(frozen=True, kw_only=True)
class Flown:
    """A mission: supervised, with the law alone, and with ideal detection after 60 s."""

    course: Course
    mission: Mission
    healthy: bool
    results: tuple[Result, ...]
    rows: tuple[Array, ...]  # [ticks, len(Trace)] of each

    @property
    def tick(self) -> float:
        """The controller's sample time [s]."""
        return self.mission.condition.tick

    @property
    def latched(self) -> float:
        """Time [s] at which the supervisor took over; nan: never."""
        return self.results[0].latched * self.tick

    @property
    def reason(self) -> str:
        """Its reason in words; empty without one."""
        return reason_words(self.results[0].reason)

    def outcome(self, flight: int) -> Outcome:
        """Return how a flight ended."""
        return Outcome(int(outcomes(np.array([self.results[flight]]), self.tick)[0]))

    def lines(self) -> list[str]:
        """Return what happened, for a reader."""
        m, label = self.mission, "h" if self.healthy else ""
        said = [
            f"mission {label}{m.number}: set-points "
            + ", ".join(
                f"{z:.1f} m at {k * self.tick:.0f} s"
                for k, z in zip(m.turns, m.depths, strict=True)
            )
        ]
        for fault, (_, first, _, *times) in zip(m.faults, m.fault_rows, strict=True):
            kind, (begin, end) = KINDS[fault], (tick * self.tick for tick in times)
            how = ": ".join(filter(None, (kind.words, kind.size(first))))
            until = f" to {end:.0f} s" if math.isfinite(end) else " on"
            said.append(f"from {begin:.0f} s{until}: {kind.name}, {how}")
        if self.reason:
            said.append(f"the supervisor took over at {self.latched:.0f} s: {self.reason}")
        else:
            said.append("the supervisor detected no fault")
        names = ("with the supervisor", "without it", "with full buoyancy 60 s after fault onset")
        for n, (name, r) in enumerate(zip(names, self.results, strict=False)):
            ends = f"deepest {r.deepest:.1f} m, at the end {max(r.depth, 0.0):.1f} m"
            said.append(f"{name}: {self.outcome(n).words}, {ends}")
        return said

    def to_dict(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        tick, names = self.tick, NAMES[: len(self.results)]
        return {
            **attributes(self, _WHICH),
            "faults": [
                {"kind": KINDS[int(kind)].name, "severity": first}
                | {"onset_s": begin * tick, "end_s": end * tick}
                for kind, first, _, begin, end in self.mission.fault_rows
            ],
            **attributes(self, "latched_s reason"),
            "outcomes": {name: self.outcome(n).words for n, name in enumerate(names)},
        }


def fly_one(
    vehicle: Vehicle,
    number: int,
    *,
    healthy: bool = False,
    seed: int = 1,
    depth_range: tuple[float, float] | None = None,
    cast: Column | None = None,
) -> Flown:
    """Return mission `number` of a seed, as a campaign flew it, with its trajectories.

    Raises InputError as `faults` does.
    """
    own_law(vehicle, sampled=False)
    course = course_of(vehicle, depth_range, cast)
    mission = draw(course, seed=seed, number=number, healthy=healthy)
    ways = [(SUPERVISED, OWN), (UNSUPERVISED, OWN), (IDEAL, FULL)][: 2 if healthy else 3]
    with board_of(course) as board:
        campaign = FaultCampaign(course, board)
        flown = [campaign.traced(mission, who, how) for who, how in ways]
    return Flown(
        course=course,
        mission=mission,
        healthy=healthy,
        results=tuple(Result(*result) for result, _ in flown),
        rows=tuple(rows for _, rows in flown),
    )
