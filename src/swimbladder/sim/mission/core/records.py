"""The records of a mission: its phases, its cycles and the rows of its trajectory."""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.rate import RateParameters
from swimbladder.sim.engine.rodas.records import Account, Lane, record

Array = NDArray[np.float64]


# A phase.
STAGE = record(
    ("kind", np.int64),
    ("depth", float),  # m
    ("tolerance", float),  # m
    ("speed", float),  # m/s
    ("duration", float),  # s
    ("timeout", float),  # s
    ("loads", float),  # W, standby and loads that are on
    ("law", float, len(RateParameters._fields)),  # the parameters of the law `rate`, in its order
    ("capture", float),  # m around it that `control.hold` flies; 0: nowhere
    ("hold", float, len(DeadbandParameters._fields)),  # its parameters, in order
    ("grounding", np.int64),  # Grounding
)


class Kind(IntEnum):
    """Kinds of phases."""

    DESCEND = 0
    PARK = 1
    PROFILE = 2
    HOLD = 3
    SURFACE = 4


class Grounding(IntEnum):
    """What a phase does where the vehicle takes itself to lie on the bottom."""

    NEXT = 0  # it ends
    STAY = 1  # it lasts, at that depth
    SHIFT = 2  # it goes on above that depth


class Holding(IntEnum):
    """Integrals of a phase since its arrivals; behind `Account`, as many times as phases."""

    TIME = 0  # s
    INSIDE = 1  # s within the tolerance
    SQUARES = 2  # m2 s, of the distance from the phase's depth
    MOST = 3  # m, largest distance


# A cycle that is over.
CYCLE = record(
    ("t_begin", float),
    ("t_end", float),
    ("deepest", float),  # m
    ("missed", float),  # phases that ran out of time, a bit each
    ("v_least", float),  # m3, smallest volume
    ("v_most", float),  # m3, largest volume off the surface
    ("arrival", float),  # s, when the first phase of a depth arrived; nan: never
    ("surfaced", float),  # s, when it was afloat again; nan: never
    ("not_held", float),  # parks and holds out of their tolerance too long, a bit each
    ("accounts", float, len(Account)),  # all accounts at the end of the cycle
)

# A row of the trajectory.
ROW = record(
    ("t", float),
    ("z", float),
    ("w", float),  # m/s through the water
    ("v", float),
    ("phase", float),
    ("doing", float),  # until the next row
    ("cycle", float),
    ("pump_energy", float),  # J so far, as in `Account`, like the next five
    ("valve_energy", float),
    ("holding_energy", float),
    ("load_energy", float),
    ("surfacing_energy", float),
    ("self_discharged", float),
)


class Phases(NamedTuple):
    """A mission on its way; rows, notes and cycles are buffers, an empty one keeps nothing."""

    lane: Lane  # its accounts are followed by `Holding` of each phase
    stages: Any  # [phases] of STAGE
    rows: Any  # [n] of ROW
    cycles: Any  # [n] of CYCLE
    board: Array  # [BOARD]: what the processor assumes at the surface
    numbers: Array  # [phases, n]: parameters of a law in the place of the mission's own rule
