"""Missions flown three ways on this machine's cores: supervised, not, with ideal detection."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.library import make_library
from swimbladder.codegen.safety import supervisor_parameters
from swimbladder.sim.faults.c_interface import IDEAL, SUPERVISED, UNSUPERVISED, c_interface
from swimbladder.sim.faults.campaign_result import Outcome, outcomes
from swimbladder.sim.faults.draw import Course, Mission
from swimbladder.sim.faults.flight import EARLY, FULL, OWN, Room, fly
from swimbladder.sim.faults.host import Board
from swimbladder.sim.faults.kinds import KINDS, Fault
from swimbladder.sim.faults.mission_records import Condition, Result, Trace

Array = NDArray[np.float64]


class Flights(NamedTuple):
    """How a mission ends, each [len(Result)]."""

    supervised: Array
    unsupervised: Array
    full: Array  # ideal detection: full buoyancy 60 s after the last fault acts
    early: Array  # 60 s after the first does; nan unless it is of two, and lost in both above


def sources(course: Course) -> dict[str, str]:
    """Return the C files of a vehicle's controller and supervisor, and what calls them here."""
    depth = course.depths.least
    tick = course.vehicle.controller.sample_time if course.vehicle.controller else 1.0
    made = make_library(
        course.vehicle, start_depth=depth, target=depth, duration=10.0 * tick, seed=None
    )
    files = {
        name.removeprefix("src/"): text
        for name, text in made.files.items()
        if name.startswith("src/")
    }
    first = 0.0 if made.law.command == "voltage" else made.vehicle.stroke.maximum
    files["c_interface.c"] = c_interface(f"{float(np.float32(first))!r}f")
    return files


class FaultCampaign:
    """A board, and the room in which its missions are flown, by any thread."""

    def __init__(self, course: Course, board: Board) -> None:
        assert course.vehicle.controller is not None
        tick = course.vehicle.controller.sample_time
        latest = KINDS[Fault.DEPTH_LATE].first
        assert latest is not None
        self._board = board
        self._room = Room(board.size, math.ceil(latest.most / tick) + 2)
        self._none = np.zeros((0, len(Trace._fields)))
        limits = supervisor_parameters(course.vehicle, tick)
        # a slow actuator needs as many pushes
        self._longer = 1.0 + limits.push.rest / limits.push.again

    def flights(self, mission: Mission) -> Flights:
        """Return how a mission with faults ends."""
        supervised = self.flown(mission, SUPERVISED, OWN, self._none)
        unsupervised = self.flown(mission, UNSUPERVISED, OWN, self._none)
        full = self.flown(mission, IDEAL, FULL, self._none)
        early = np.full(len(Result._fields), np.nan)
        tick = mission.condition.tick
        ended = outcomes(
            np.array([supervised, full]), tick=tick, stay=mission.condition.stay * tick
        )
        if len(mission.faults) > 1 and not np.any(ended == Outcome.SURFACED):
            early = self.flown(mission, IDEAL, EARLY, self._none)
        return Flights(supervised, unsupervised, full, early)

    def supervised(self, mission: Mission) -> Array:
        """Return how a supervised mission ends."""
        return self.flown(mission, SUPERVISED, OWN, self._none)

    def traced(self, mission: Mission, who: str, how: int) -> tuple[Array, Array]:
        """Return (result, rows [ticks flown, len(Trace)]) of a mission."""
        rows = np.full((int(self._condition(mission, who).end) + 1, len(Trace._fields)), np.nan)
        result = self.flown(mission, who, how, rows)
        return result, rows[: int(result[Result._fields.index("last")]) + 1]

    def _condition(self, mission: Mission, who: str) -> Condition:
        """Return what a mission is flown in; who rests between pushes has longer to come up."""
        condition = mission.condition
        longer = self._longer if who == SUPERVISED else 1.0
        return condition._replace(end=math.ceil(longer * condition.end))

    def flown(self, mission: Mission, who: str, how: int, record: Array) -> Array:
        """Fly a mission with the board's functions `who`; fill record, return its result."""
        condition, functions = self._condition(mission, who), self._board.addresses[who]
        return fly(mission, condition, how, functions, self._room, record)
