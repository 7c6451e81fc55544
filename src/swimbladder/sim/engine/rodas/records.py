"""The records that RODAS moves, and what stands where in its table and accounts.

Kernels read fields of a record by name (`x.t`), Python also as `x["t"]`.

The accounts of pump, valve and motion as balances: volume, energy, and what does not add up.
"""

from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.deadband import DeadbandState
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater import look_up

Records = NDArray[Any]


class Record(np.record):  # type: ignore[misc]
    """A record that finds what is not a field, such as `data`, without running Python code.

    Numba asks for `data` of each record that a kernel is given, and goes on asking where Ctrl-C
    was raised by then: numpy's own look-up in Python would make an AttributeError of it.
    """

    __getattribute__ = np.void.__getattribute__

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except ValueError:
            raise AttributeError(f"the record has no field {name!r}") from None


def record(*fields: Any) -> np.dtype[np.void]:
    """Return the type of records with these fields: a name, a type and, of vectors, a length."""
    return np.dtype((Record, np.dtype(list(fields), align=True)))


def made(kind: np.dtype[np.void], like: Any = None) -> Record:
    """Return a record of zeros, or with the numbers of another one."""
    found: Record = (np.zeros(1, kind) if like is None else np.array([like], kind))[0]
    return found


def lane_of(one: Any) -> NDArray[Any]:
    """Return the array [1] whose only element is a record of `made`, for what takes lanes."""
    lane: NDArray[Any] = one.base
    assert lane.shape == (1,)
    return lane


class Table(IntEnum):
    """Columns of the table: value, and its slope in the next; over depth but the last.

    Those from FILLING on are over ln(p/reservoir), p being the pressure in the oil line.
    """

    PRESSURE = 0  # Pa above the atmosphere
    NEUTRAL = 2  # m3, volume at which the vehicle rests
    RATE_OUT = 4  # m3/s
    POWER_OUT = 6  # W
    RATE_IN = 8  # m3/s
    POWER_IN = 10  # W
    BYPASS = 12  # m3/s
    POWER_BYPASS = 14  # W
    LEAKAGE = 16  # m3/s
    HOLDING = 18  # W
    START = 20  # m3 that each start of the pump falls short
    LAYERS = 22  # m3, neutral volume less what pressure does to water and hull
    TEMPERATURE = 24  # degC of the water
    FILLING = 26  # s, from the reservoir's pressure to p by the pump
    FILL_ENERGY = 28  # J that takes, in water of 0 degC
    FILL_WARMTH = 30  # J/K more in warmer water
    EMPTYING = 32  # s, see `line`


# What does not change in a mission: the vehicle, its processor, the tolerances.
_VEHICLE: tuple[tuple[str, type], ...] = (
    ("step", float),  # m, of the table
    ("mass", float),  # kg, accelerated
    ("d_l", float),  # 1/s, laminar drag over mass; as physics.dynamics.Plant, like the next four
    ("d_b", float),
    ("d_0", float),
    ("d_t", float),
    ("epsilon", float),
    ("a_s", float),  # 1/s2, stiffness of the emerging hull, rho g A_w/m
    ("z_surface", float),  # m, where the hull begins to emerge
    ("z_air", float),  # m, where it would have left the water
    ("z_bottom", float),  # m
    ("v_min", float),  # m3
    ("v_max", float),  # m3
    ("trim", float),  # m3, added to the table's neutral volume
    ("give", float),  # m3/m, added to its slope
    ("by_volume", float),  # 1: a move ends at a volume, which is measured; 0: after a time
    ("quantum", float),  # s, step of the time of a run
    ("longest", float),  # s, of a run
    ("delivery", float),  # -, what is pumped over what the table says and the processor assumes
    ("noise", float),  # m, of a measured depth, 1 sigma
    ("resolution", float),  # m, its quantum
    ("deepest", float),  # m, below which everything is pumped out
    ("neutral_top", float),  # m3, neutral volume at the surface as the processor knows it
    ("shallow", float),  # m, above which it is about to dive, or has come up
    ("empty", float),  # J of charge at which nothing more can be drawn; -inf: not known
    ("reserve", float),  # J of charge with which no new cycle begins
    ("last_time", float),  # s, after which no new cycle begins
    ("last_cycle", float),  # how many cycles at most
    ("surfacing", float),  # J at each surfacing
    ("self_discharge", float),  # 1/s
    ("rtol", float),  # -
    ("atol_z", float),  # m
    ("atol_w", float),  # m/s
    ("atol_v", float),  # m3
    ("rest_deep", float),  # m, an oscillation smaller than this counts as rest
    ("rest_afloat", float),  # m, the same of the bobbing at the surface
    ("longest_step", float),  # s
    ("z_lost", float),  # m, below which nothing is known of the water
    ("charge", float),  # J in the battery at the start
    ("held", float),  # -, share of its time that a park or hold has to be in its tolerance
    ("rising", float),  # -, drag while rising over that while sinking
    ("flow", float),  # -, what valve and bypass let in over what the processor assumes
    ("makes_up", float),  # 1: a run is longer by what its start falls short of
    ("follows", float),  # 1/s, how fast the hull takes the water's temperature; 0: at once
    ("expansion", float),  # m3/K, of a hull that does not take it at once
    ("volume_noise", float),  # m3, of a measured volume, 1 sigma
    ("volume_quantum", float),  # m3, its quantum
    ("open", float),  # -, of the valve's flow that comes in whatever is commanded
    ("open_running", float),  # -, the same while the pump runs
    ("ground_volume", float),  # m3 let in without sinking, by which it takes itself to be grounded
    ("ground_change", float),  # m; a lesser change of depth is none
    ("ground_time", float),  # s after that without one
    ("ground_shift", float),  # m above the bottom, of the depth that it then goes to
    ("ground_least", float),  # m; above it, it stays on the bottom
    ("ice_temperature", float),  # degC, median at or below which there is ice; -inf: none is sought
    ("ice_from", float),  # m, where it begins to measure on its way up
    ("ice_to", float),  # m, where it decides
    ("ice_wait", float),  # s after ice in which it does not surface
    ("ice_longest", float),  # s without surfacing after which ice does not keep it down
)
# Its oil line between pump and check valve; without one the oil is incompressible.
_LINE: tuple[tuple[str, type], ...] = (
    ("line", float),  # m3
    ("line_gas", float),  # m3 of air in it at the reservoir's pressure
    ("line_modulus", float),  # Pa, of its oil
    ("line_power", float),  # -, one over the polytropic exponent of its air
    ("line_ratio", float),  # -, the water's pressure over the line's
    ("reservoir", float),  # Pa, absolute
    ("head_afloat", float),  # Pa, of the atmosphere over the reservoir
    ("slip", float),  # m3/s/Pa by which the line empties through a pump that stands
    ("run_up", float),  # m3 that a start falls short beside what the line takes
    ("line_step", float),  # of ln(p/reservoir) from row to row
    ("line_top", float),  # ln(p/reservoir) at which the pump stalls; inf: above all that is assumed
)
# The line's come first: Numba takes a record that only has more at its end for one of the other.
GIVEN, GIVEN_WITH_LINE = record(*_VEHICLE), record(*_LINE, *_VEHICLE)

# The state, as far as it is real numbers.
NOW = record(
    ("t", float),  # s
    ("z", float),  # m
    ("w", float),  # m/s, relative to the water
    ("v", float),  # m3
    ("h", float),  # s, length that the next step may have
    ("t_phase", float),  # s, begin of the phase
    ("t_end", float),  # s, at which the phase is over, or out of time
    ("t_sample", float),  # s, of the next sample
    ("t_move", float),  # s, latest end of the run
    ("v_move", float),  # m3, at which the run ends; inf or -inf: at a time
    ("charge", float),  # J in the battery
    ("z_most", float),  # m, greatest depth of the cycle
    ("v_least", float),  # m3, of the cycle
    ("v_most", float),  # m3, of the cycle, off the surface
    ("t_arrival", float),  # s, of the cycle's first phase at a depth; nan: not yet
    ("t_cycle", float),  # s, begin of the cycle
    ("t_afloat", float),  # s, of the cycle; nan: not yet
    ("v_begin", float),  # m3, at the begin of the run
    ("t_begin", float),  # s, of the run
    ("z_sample", float),  # m, depth seen last while about to dive
    ("t_primed", float),  # s, when a pump that has started begins to deliver
    ("t_inside", float),  # s within the tolerance since the phase arrived
    ("t_arrived", float),  # s, when it did
    ("w_seen", float),  # m/s, speed as the processor knew it last
    ("law", float, len(DeadbandState._fields)),  # what `rate` or `hold` remembers
    ("hull", float),  # degC of the hull
    ("line_level", float),  # -, ln(p/reservoir) of the oil line
    ("t_level", float),  # s, when it was that
    ("raised", float),  # m by which grounding raised the depth of the phase
    ("z_moved", float),  # m, depth seen when it last changed
    ("v_moved", float),  # m3, greatest volume since
    ("t_still", float),  # s, since when it has let in too much for that
    ("t_measured", float),  # s in the layer in which ice shows, of the phase
    ("t_cold", float),  # s of them at the temperature of ice
    ("t_ice", float),  # s, when ice last turned it back
    ("t_surfaced", float),  # s, when it was last afloat
)

# The state, as far as it is whole numbers.
AT = record(
    ("phase", np.int64),
    ("cycle", np.int64),  # cycles done
    ("doing", np.int64),  # Doing
    ("place", np.int64),  # 0 submerged, 1 emerging, 2 on the bottom
    ("rests", np.int64),  # 1: at rest; no steps are needed
    ("arrived", np.int64),
    ("new_law", np.int64),  # 1: the law is to begin anew
    ("calls", np.int64),  # samples at which the law, or what is in its place, is called
    ("draws", np.int64),  # random numbers drawn
    ("seed", np.int64),  # -1: sensors without noise
    ("alarm", np.int64),  # 1: too deep, all is pumped out; 2: the supervisor took over
    ("steps", np.int64),
    ("rejected", np.int64),
    ("stop", np.int64),
    ("missed", np.int64),  # phases of the cycle that ran out of time
    ("new_phase", np.int64),  # 1: a phase is to begin
    ("not_held", np.int64),  # parks and holds of the cycle out of their tolerance too long
    ("captured", np.int64),  # 1: `hold_step` flies
    ("shut", np.int64),  # 1: the check valve behind the oil line is
    ("idle", np.int64),  # ticks without time passing
    ("ends", np.int64),  # 1: the bottom or ice ended what the phase was to do
)


class Doing(IntEnum):
    """What the drive does."""

    NOTHING = 0
    PUMPING = 1
    LETTING_IN = 2
    BYPASSING = 3
    PRIMING = 4  # the pump runs and does not deliver yet


class Account(IntEnum):
    """Integrals since the start; those of `Holding` follow for each phase."""

    PUMPED = 0  # m3
    LET_IN = 1  # m3
    LEAKED = 2  # m3, at rest
    PUMP_ENERGY = 3  # J from the battery
    VALVE_ENERGY = 4  # J, while volume is let or drawn in
    HOLDING_ENERGY = 5  # J
    LOAD_ENERGY = 6  # J, standby and loads
    SURFACING_ENERGY = 7  # J
    SELF_DISCHARGED = 8  # J
    PUMP_WORK = 9  # J done on the sea, of p dV
    LET_IN_WORK = 10  # J got from the sea
    LEAK_WORK = 11  # J got from the sea
    DRAG = 12  # J
    IMPACTS = 13  # J, against the bottom
    SETTLED = 14  # J of oscillations that were taken for rest
    FORCED = 15  # J that the moving water took
    PUMP_TIME = 16  # s
    VALVE_TIME = 17  # s
    PUMP_RUNS = 18
    VALVE_RUNS = 19
    STALLED = 20  # s of pumping without delivery
    HEAT = 21  # J that a hull warmer or colder than the water took
    T_DESCEND = 22  # s in each kind of phase
    T_PARK = 23
    T_PROFILE = 24
    T_HOLD = 25
    T_SURFACE = 26
    GROUNDED = 27  # times that it took itself to lie on the bottom
    ICE_TURNS = 28  # times that it turned back for ice
    UNDER_ICE = 29  # times that it came up although there may have been ice


OF_DRIVE = (Account.PUMP_ENERGY, Account.VALVE_ENERGY, Account.HOLDING_ENERGY)
OF_LOADS = (Account.LOAD_ENERGY, Account.SURFACING_ENERGY)


class Note(IntEnum):
    """What is noted with its time, depth, volume and a number."""

    PHASE = 0  # begins; its number
    ARRIVED = 1  # of the phase
    OUT_OF_TIME = 2
    PUMP = 3  # a run begins; volume wanted [m3]
    VALVE = 4
    BYPASS = 5
    RUN_OVER = 6  # its length [s]
    EMERGED = 7
    SUBMERGED = 8
    BOTTOM = 9
    LEFT_BOTTOM = 10
    UPPER_STOP = 11
    LOWER_STOP = 12
    TOO_DEEP = 13
    CYCLE = 14  # is over; its number
    AFLOAT = 15  # with all volume out
    ALARM = 16  # the supervisor takes over; its reason
    GROUNDED = 17  # it takes itself to lie on the bottom; number of the phase
    ICE = 18  # ice keeps it from the surface; as of `Ice`
    SHIFTED = 19  # it goes on above the bottom; its new depth [m]


class Ice(IntEnum):
    """What it does where there may be ice."""

    WAITS = 0  # it turns back as there was ice not long ago
    COLD = 1  # it turns back by the temperature
    PASSED = 2  # it comes up all the same, after so long without surfacing


# A note of something that happened.
NOTE = record(("t", float), ("what", np.int64), ("z", float), ("v", float), ("number", float))


class Stop(IntEnum):
    """Why the kernel returns."""

    GOES_ON = 0  # the buffers are full, or a cycle is over
    FINISHED = 1
    RESERVE = 2
    DID_NOT_SURFACE = 3
    PASSED_DEPTH = 4
    LOST = 5
    BATTERY_EMPTY = 6
    LEFT_WATER = 7
    STUCK = 8
    ALARM = 9  # the supervisor took over, and it came up


WORK = (12, 8)  # y, its error, k1, k2 of the cubic, two rows of guards, and the stages of a step


class Lane(NamedTuple):
    """A vehicle that RODAS moves, with what it is moved in and what is booked of it."""

    p: Any  # a record of GIVEN
    table: Array  # [n, 2 len(Table)]
    waves: Array  # [m, 6] of `motion_table`
    x: Any  # a record of NOW
    at: Any  # a record of AT
    accounts: Array  # [len(Account)] at least
    notes: Any  # [k] of NOTE; nothing is noted where k is 0
    counts: NDArray[np.int64]  # [3]: how many rows, notes and cycles there are
    work: Array  # [WORK] to write in


HOLDING = "holding"


@dataclass(frozen=True, kw_only=True)
class Balance:
    """Volume [m3] and energy [J] of a run.

    drive: electrical energy into pump and valve. sinks: what became of it, stored energy included;
    their sum is `drive` but for the residual, which the steps' errors leave. throughput: work that
    drive and sea did on each other to and fro, to judge it by.
    """

    volume: dict[str, float]
    drive: float
    sinks: dict[str, float]
    throughput: float
    volume_residue: float


def balance(
    given: np.record, accounts: Array, first: np.record, last: np.record, *, stored: float
) -> Balance:
    """Return the balance between two states; stored [J]: what the sea gained."""
    a = {key: float(accounts[key]) for key in list(Account)[: int(Account.T_DESCEND)]}
    m = float(given["mass"])
    work = a[Account.PUMP_WORK] - a[Account.LET_IN_WORK] - a[Account.LEAK_WORK]
    sinks = {
        "pump and its driver": a[Account.PUMP_ENERGY] - a[Account.PUMP_WORK],
        "valve and its flow": a[Account.VALVE_ENERGY] + a[Account.LET_IN_WORK],
        HOLDING: a[Account.HOLDING_ENERGY],
        "leakage": a[Account.LEAK_WORK],
        "drag": a[Account.DRAG],
        "bottom": a[Account.IMPACTS],
        "moving water": a[Account.FORCED],
        "heat of the hull": a[Account.HEAT],
        "oscillations at rest": a[Account.SETTLED],
        "vehicle motion": 0.5 * m * float(last["w"] ** 2 - first["w"] ** 2),
        "sea": stored,
    }
    change = float(last["v"] - first["v"])
    volume = {
        "pumped": a[Account.PUMPED],
        "let in": a[Account.LET_IN],
        "leaked": a[Account.LEAKED],
        "change": change,
    }
    passed = a[Account.PUMP_WORK] + a[Account.LET_IN_WORK]
    return Balance(
        volume=volume,
        drive=a[Account.PUMP_ENERGY] + a[Account.VALVE_ENERGY] + a[Account.HOLDING_ENERGY],
        sinks=sinks,
        throughput=max(passed + a[Account.LEAK_WORK], abs(work), a[Account.DRAG]),
        volume_residue=change - volume["pumped"] + volume["let in"] + volume["leaked"],
    )


def potential(given: np.record, table: Array, z: float) -> float:
    """Return the integral of p' V_neutral from the surface to depth z [J]: exact for the table."""
    step = float(given["step"])
    trim, give = float(given["trim"]), float(given["give"])
    # Gauss' rule of three points, exact to degree 5, which p' V_neutral has in a cell
    nodes, weights = np.polynomial.legendre.leggauss(3)

    def cell(a: float, b: float) -> float:
        """Return the integral from depth a to b [J], exact within a cell of the table."""
        total = 0.0
        for node, weight in zip(nodes, weights, strict=True):
            at = 0.5 * (a + b) + 0.5 * (b - a) * float(node)
            slope = look_up(table, step, Table.PRESSURE, at)[1]
            neutral = look_up(table, step, Table.NEUTRAL, at)[0] + trim + give * at
            total += 0.5 * (b - a) * float(weight) * slope * neutral
        return total

    if z <= 0.0:
        return cell(0.0, z)
    edges = [*np.arange(0.0, min(z, step * (len(table) - 1)), step).tolist(), z]
    return sum(cell(a, b) for a, b in pairwise(edges))


def stored_energy(given: np.record, table: Array, x: Any, *, emerging: bool) -> float:
    """Return p V less the potential of the weight, and that of the emerged hull [J]."""
    z = float(x["z"])
    pressure = look_up(table, float(given["step"]), Table.PRESSURE, z)[0]
    emerged = max(float(given["z_surface"]) - z, 0.0) if emerging else 0.0
    spring = 0.5 * float(given["mass"] * given["a_s"]) * emerged**2
    return pressure * float(x["v"]) - potential(given, table, z) + spring
