"""What stands where in the arrays of phases, cycles and rows of a mission."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.rate import RateParameters
from swimbladder.sim.engine.rodas.names import Account

Array = NDArray[np.float64]


class Stage(IntEnum):
    """Columns of the phases [n, COUNT]."""

    KIND = 0
    DEPTH = 1  # m
    TOLERANCE = 2  # m
    SPEED = 3  # m/s
    DURATION = 4  # s
    TIMEOUT = 5  # s
    LOADS = 6  # W, standby and loads that are on
    LAW = 7  # the parameters of the law `rate`, in its order
    CAPTURE = LAW + len(RateParameters._fields)  # m around it that `control.hold` flies; 0: nowhere
    HOLD = CAPTURE + 1  # its parameters, those of `deadband`, in that order
    COUNT = HOLD + len(DeadbandParameters._fields)


class Kind(IntEnum):
    """Kinds of phases."""

    DESCEND = 0
    PARK = 1
    PROFILE = 2
    HOLD = 3
    SURFACE = 4


class Holding(IntEnum):
    """Integrals of a phase since its arrivals; behind `Account`, as many times as phases."""

    TIME = 0  # s
    INSIDE = 1  # s within the tolerance
    SQUARES = 2  # m2 s, of the distance from the phase's depth
    MOST = 3  # m, largest distance
    COUNT = 4


class Cycle(IntEnum):
    """Columns of the table of cycles."""

    T_BEGIN = 0
    T_END = 1
    DEEPEST = 2  # m
    MISSED = 3  # phases that ran out of time, a bit each
    V_LEAST = 4  # m3, smallest volume
    V_MOST = 5  # m3, largest volume off the surface
    ARRIVAL = 6  # s, when the first phase of a depth arrived; nan: never
    SURFACED = 7  # s, when it was afloat again; nan: never
    NOT_HELD = 8  # parks and holds out of their tolerance too long, a bit each
    ACCOUNTS = 9  # all accounts at the end of the cycle
    COUNT = ACCOUNTS + Account.COUNT


class Row(IntEnum):
    """Columns of the trajectory."""

    T = 0
    Z = 1
    W = 2  # m/s through the water
    V = 3
    PHASE = 4
    DOING = 5  # until the next row
    CYCLE = 6
    PUMP_ENERGY = 7  # J so far, as in `Account`, like the next five
    VALVE_ENERGY = 8
    HOLDING_ENERGY = 9
    LOAD_ENERGY = 10
    SURFACING_ENERGY = 11
    SELF_DISCHARGED = 12
    COUNT = 13


class Phases(NamedTuple):
    """A mission on its way; rows, notes and cycles are buffers, an empty one keeps nothing."""

    given: Array  # [Given.COUNT]
    table: Array  # [n, Table.WIDTH]
    waves: Array  # [m, 6] of `motion_table`
    stages: Array  # [phases, Stage.COUNT]
    x: Array  # [Now.COUNT]
    at: NDArray[np.int64]  # [At.COUNT]
    accounts: Array  # [Account.COUNT and `Holding` of each phase]
    rows: Array  # [n, Row.COUNT]
    notes: Array  # [n, Drive.COUNT]
    cycles: Array  # [n, Cycle.COUNT]
    counts: NDArray[np.int64]  # [3]: how much is in the buffers
    board: Array  # [BOARD]: what the processor assumes at the surface
