"""A campaign: all missions of a seed in chunks, on all cores, kept on disk until it is done.

Each is flown three ways: supervised, not, with ideal detection.
"""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.golden import BoardProgram
from swimbladder.codegen.library import digest, make_program
from swimbladder.control.registry import own_law
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.errors import InputError
from swimbladder.io.progress import Advance, silent
from swimbladder.jobs import Store, each
from swimbladder.physics.buoyancy_engine import at_voltage, running_pump
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.sim.closed_loop.floats import float_model
from swimbladder.sim.engine.modes import SUPPLY, Z_BOTTOM
from swimbladder.sim.faults.c_interface import IDEAL, SUPERVISED, UNSUPERVISED, Board, c_interface
from swimbladder.sim.faults.campaign_result import ROW, FaultResult, Outcome, outcomes
from swimbladder.sim.faults.draw import Course, Mission, course_of, draw
from swimbladder.sim.faults.fault_effects import NO_PUMP, PumpTable
from swimbladder.sim.faults.flight import EARLY, FULL, OWN, Room, fly
from swimbladder.sim.faults.kinds import FAULTS, KINDS
from swimbladder.sim.faults.mission_records import Result, Trace
from swimbladder.vehicle import DatasheetPump, PumpAndValve, Vehicle

Array = NDArray[np.float64]
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
    depths: tuple[float, float] | None = None,
    column: Column | None = None,
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
    depths
        Least and greatest [m]; none: from below the surface to a share of the depth at which the
        vehicle's supervisor turns it round.
    column
        The water, as `cast_column` returns it; none: the vehicle's own.
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
    for field, count in (("missions", missions), ("healthy", healthy)):
        if not 1 <= count <= 10_000_000:
            what = "must be a whole number from 1 to 10 million"
            remedy = "Give some hundreds to try, 100000 to prove"
            raise InputError(what, field=field, value=count, remedy=remedy)
    course = course_of(vehicle, depths, column)
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
