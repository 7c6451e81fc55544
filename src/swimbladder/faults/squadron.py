"""Missions flown three ways on this machine's cores: supervised, unsupervised, told to come up."""

from __future__ import annotations

import math
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.dynamics import Plant
from swimbladder.engine.chain import COEFFICIENTS, LEVELS, base_steps
from swimbladder.engine.modes import COUNT
from swimbladder.faults.draw import Course, Mission
from swimbladder.faults.flight import FULL, OWN, fly
from swimbladder.faults.glue import ALONE, DEAF, SUPERVISED, glue
from swimbladder.faults.host import Board
from swimbladder.faults.kinds import KINDS, Fault
from swimbladder.faults.rows import Result, Trace
from swimbladder.firmware.library import make_library

__all__ = ["Flights", "Squadron", "sources"]

Array = NDArray[np.float64]


class Flights(NamedTuple):
    """How a mission ends, each [len(Result)]."""

    supervised: Array
    alone: Array
    full: Array  # alone, and told to come up 60 s after the first onset


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
    files["glue.c"] = glue(f"{float(np.float32(first))!r}f")
    return files


class _Room(threading.local):
    """What each thread works in."""

    def __init__(self, board: Board, late: int) -> None:
        self.memory = board.memory()
        self.x, self.p, self.y = np.zeros(5), np.zeros(len(Plant._fields)), np.zeros(10)
        self.chains = np.empty((COUNT, LEVELS + 1, COEFFICIENTS))
        self.built = np.zeros(COUNT, np.uint8)
        self.late = np.zeros(late)


class Squadron:
    """A board, and the room in which its missions are flown, by any thread."""

    def __init__(self, course: Course, board: Board) -> None:
        assert course.vehicle.controller is not None
        tick = course.vehicle.controller.sample_time
        latest = KINDS[Fault.DEPTH_LATE].first
        assert latest is not None
        self._board = board
        self._room = _Room(board, math.ceil(latest.most / tick) + 2)
        self._none = np.zeros((0, len(Trace._fields)))

    def flights(self, mission: Mission) -> Flights:
        """Return how a mission with faults ends."""
        return Flights(
            self.flown(mission, SUPERVISED, OWN, self._none),
            self.flown(mission, ALONE, OWN, self._none),
            self.flown(mission, DEAF, FULL, self._none),
        )

    def supervised(self, mission: Mission) -> Array:
        """Return how a supervised mission ends."""
        return self.flown(mission, SUPERVISED, OWN, self._none)

    def traced(self, mission: Mission, who: str, how: int) -> tuple[Array, Array]:
        """Return (result, rows [ticks flown, len(Trace)]) of a mission."""
        rows = np.full((int(mission.condition.end) + 1, len(Trace._fields)), np.nan)
        result = self.flown(mission, who, how, rows)
        return result, rows[: int(result[Result._fields.index("last")]) + 1]

    def flown(self, mission: Mission, who: str, how: int, record: Array) -> Array:
        """Fly a mission with the board's functions `who`; fill record, return its result."""
        room, p = self._room, mission.plant
        plant = Plant(*p)
        parts = base_steps(plant, mission.condition.tick, 0.0)
        nonlinear = bool(np.isfinite(plant.epsilon))
        result = np.zeros(len(Result._fields))
        begin, tick = self._board.addresses[who]
        fly(
            p, np.array(mission.condition), mission.harms, mission.turns, mission.depths,
            nonlinear, parts, how, begin, tick, room.memory, room.x, room.p, room.y, room.chains,
            room.built, room.late, record, result,
        )  # fmt: skip
        return result
