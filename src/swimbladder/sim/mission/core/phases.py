"""Phases and cycles: their records, how they begin, arrive, hold their depth and end.

On the bottom and under ice a phase goes on elsewhere, or ends. A vehicle takes itself to be
grounded where the depth does not change for a time after it let in a volume, or all that it can.
There may be ice where the water in a layer below the surface is as cold on the way up, by the
median of its temperatures: the ice-sensing algorithm of Klatt, Boebel and Fahrbach (2007), J.
Atmos. Oceanic Technol. 24.
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.rate import RateParameters
from swimbladder.physics.arrays import Array
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.drive import FULL, note
from swimbladder.sim.engine.rodas.line import value
from swimbladder.sim.engine.rodas.records import (
    Account,
    Doing,
    Ice,
    Lane,
    Note,
    Stop,
    Table,
    record,
)

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
    ("capture", float),  # m around it that `hold_step` flies; 0: nowhere
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


_WAITS, _COLD, _PASSED = (float(did) for did in Ice)  # in a note
_SPACING = 1.0  # m between two temperatures on a way, at most


@inlined
def goal_of(f: Phases) -> float:
    """Return the depth that the phase goes to [m]: its own, or what grounding made of it."""
    return float(f.stages[f.lane.at.phase].depth - f.lane.x.raised)


@inlined
def grounds(f: Phases, seen: float) -> float:
    """Find whether the vehicle lies on the bottom, at the depth seen [m], and what it does then.

    Return the volume that it let in there [m3] where it leaves the bottom now, else 0.
    """
    return float(_grounds(f, seen) if f.lane.p.ground_volume > 0.0 else 0.0)


@part
def _grounds(f: Phases, seen: float) -> float:
    p, x, at = f.lane.p, f.lane.x, f.lane.at
    if seen <= p.shallow or abs(seen - x.z_moved) >= p.ground_change:
        x.z_moved, x.v_moved = seen, x.v
    x.v_moved = max(x.v_moved, x.v)
    least = x.v <= p.v_min + FULL * (p.v_max - p.v_min)
    if x.v_moved - x.v < p.ground_volume and not (least and seen > p.shallow):
        x.t_still = math.inf
        return 0.0
    x.t_still = min(x.t_still, x.t)
    stage = f.stages[at.phase]
    if stage.kind == Kind.SURFACE or at.alarm != 0 or at.ends == 1:
        return 0.0
    if x.t - x.t_still < p.ground_time or seen >= goal_of(f) - stage.tolerance:
        return 0.0
    note(f.lane, Note.GROUNDED, float(at.phase))
    f.lane.accounts[Account.GROUNDED] += 1.0
    if stage.grounding == Grounding.NEXT:
        at.ends, x.t_end = 1, x.t
        after = f.stages[(at.phase + 1) % f.stages.shape[0]]
        leaves = after.kind == Kind.SURFACE or after.depth < seen
    else:
        goal = seen - p.ground_shift
        leaves = stage.grounding == Grounding.SHIFT and seen >= p.ground_least
        leaves = leaves and goal > p.shallow
        x.raised = stage.depth - (goal if leaves else seen)
        if leaves:
            note(f.lane, Note.SHIFTED, goal)
    return float(x.v_moved - x.v) if leaves else 0.0


@part
def seek_ice(f: Phases, depth: float, h: float) -> None:
    """Enter h [s] on the way up from a depth [m] in the search for ice; turn back under it."""
    p, x, at = f.lane.p, f.lane.x, f.lane.at
    up = f.stages[at.phase].kind == Kind.SURFACE and at.arrived == 0 and at.place != 1
    if not up or at.alarm != 0 or at.ends == 1 or min(depth, x.z) > p.ice_from:
        return
    parts = math.ceil(abs(x.z - depth) / _SPACING) + 1
    for n in range(parts):
        z = depth + (x.z - depth) * (n + 0.5) / parts
        if p.ice_to <= z <= p.ice_from:
            x.t_measured += h / parts
            if value(f.lane.table, p.step, Table.TEMPERATURE, z)[0] <= p.ice_temperature:
                x.t_cold += h / parts
    if x.z > p.ice_to:
        return
    cold = x.t_cold >= 0.5 * x.t_measured  # so it is where nothing was measured
    if not cold and x.t - x.t_ice >= p.ice_wait:
        return
    if x.t - x.t_surfaced > p.ice_longest:
        if depth > p.ice_to:
            note(f.lane, Note.ICE, _PASSED)
            f.lane.accounts[Account.UNDER_ICE] += 1.0
        return
    note(f.lane, Note.ICE, _COLD if cold else _WAITS)
    f.lane.accounts[Account.ICE_TURNS] += 1.0
    if cold:
        x.t_ice = x.t
    at.ends, x.t_end = 1, x.t


ACCOUNTS = len(Account)
HOLDINGS = len(Holding)


@inlined
def row(f: Phases) -> None:
    """Add a row to the trajectory; without room nothing is kept."""
    x, at = f.lane.x, f.lane.at
    n = f.lane.counts[0]
    if n < f.rows.shape[0]:
        new, sums = f.rows[n], f.lane.accounts
        new.t, new.z, new.w, new.v = x.t, x.z, x.w, x.v
        new.phase, new.doing, new.cycle = at.phase, at.doing, at.cycle
        new.pump_energy = sums[Account.PUMP_ENERGY]
        new.valve_energy = sums[Account.VALVE_ENERGY]
        new.holding_energy = sums[Account.HOLDING_ENERGY]
        new.load_energy = sums[Account.LOAD_ENERGY]
        new.surfacing_energy = sums[Account.SURFACING_ENERGY]
        new.self_discharged = sums[Account.SELF_DISCHARGED]
        f.lane.counts[0] = n + 1


@inlined
def begin_row(f: Phases) -> None:
    """Let the last row say what is done from here on; a new one where it is of an earlier time."""
    x, at = f.lane.x, f.lane.at
    if f.rows.shape[0] > 0:
        last = f.lane.counts[0] - 1
        if last < 0 or (f.rows[last].doing != at.doing and f.rows[last].t < x.t):
            row(f)
        else:
            f.rows[last].doing = at.doing


@part
def begin_phase(f: Phases) -> None:
    """Begin the phase that `at` names, with its law anew."""
    x, at = f.lane.x, f.lane.at
    stage = f.stages[at.phase]
    at.new_phase = 0
    at.new_law = 1
    at.arrived = 0
    at.captured = 0
    x.t_phase = x.t
    x.t_sample = x.t if at.doing == Doing.NOTHING else max(x.t, x.t_move)
    x.z_sample = x.z
    x.raised, x.t_measured, x.t_cold, at.ends = 0.0, 0.0, 0.0, 0
    if stage.kind == Kind.PARK:
        x.t_end = x.t + stage.duration
    else:
        x.t_end = x.t + stage.timeout
    note(f.lane, Note.PHASE, float(at.phase))


@inlined
def awaited_level(f: Phases) -> float:
    """Return the depth at which the phase arrives [m], negative from below, 0: not awaited."""
    x, at = f.lane.x, f.lane.at
    stage = f.stages[at.phase]
    if at.arrived == 1 or at.alarm != 0 or at.ends == 1:
        return 0.0
    if stage.kind == Kind.SURFACE:
        sought = f.lane.p.ice_temperature > -math.inf and x.z > f.lane.p.ice_to
        return -float(f.lane.p.ice_to) if sought else 0.0
    goal = goal_of(f)
    if x.z < goal:
        return float(goal - stage.tolerance)
    return -float(goal + stage.tolerance)


@inlined
def enter_hold(f: Phases, z: float, h: float) -> None:
    """Enter h [s] that led from depth z [m] to here in what shows how the phase holds its depth.

    Between the two the depth counts as straight: exact at rest, and steps are short off it.
    """
    x, at = f.lane.x, f.lane.at
    stage = f.stages[at.phase]
    a, b = z - goal_of(f), x.z - goal_of(f)
    low, high, tolerance = min(a, b), max(a, b), stage.tolerance
    if high - low > 0.0:
        share = max(min(high, tolerance) - max(low, -tolerance), 0.0) / (high - low)
    else:
        share = 1.0 if abs(a) <= tolerance else 0.0
    x.t_inside += share * h
    n, sums = ACCOUNTS + HOLDINGS * at.phase, f.lane.accounts
    sums[n + Holding.TIME] += h
    sums[n + Holding.INSIDE] += share * h
    sums[n + Holding.SQUARES] += h * (a * a + a * b + b * b) / 3.0
    sums[n + Holding.MOST] = max(sums[n + Holding.MOST], high, -low)


@part
def arrive(f: Phases) -> None:
    """Say that the phase has come to its depth, and when it is over."""
    x, at = f.lane.x, f.lane.at
    stage = f.stages[at.phase]
    at.arrived = 1
    x.t_arrived, x.t_inside = x.t, 0.0
    first = stage.kind != Kind.SURFACE and x.raised == 0.0
    for n in range(at.phase):
        first = first and f.stages[n].kind == Kind.SURFACE
    if first:
        x.t_arrival = x.t - x.t_cycle
    note(f.lane, Note.ARRIVED, float(at.phase))
    if stage.kind == Kind.HOLD or stage.kind == Kind.SURFACE:
        x.t_end = x.t + stage.duration
    elif stage.kind != Kind.PARK:
        x.t_end = x.t


@part
def afloat(f: Phases, out: bool) -> bool:
    """Say so where the vehicle floats with all its volume out; return whether it is afloat now.

    out: whether its board takes it to be, whatever the volume is.
    """
    x, at = f.lane.x, f.lane.at
    p = f.lane.p
    if at.place != 1 or (x.v < p.v_max - FULL * (p.v_max - p.v_min) and not out):
        return False
    if at.alarm != 0:
        at.stop = Stop.PASSED_DEPTH if at.alarm == 1 else Stop.ALARM
    elif at.arrived == 0 and f.stages[at.phase].kind == Kind.SURFACE:
        note(f.lane, Note.AFLOAT, 0.0)
        x.t_afloat, x.t_surfaced = x.t - x.t_cycle, x.t
        f.lane.accounts[Account.SURFACING_ENERGY] += p.surfacing
        x.charge -= p.surfacing
        arrive(f)
        return True
    return False


@inlined
def settle(f: Phases, out: bool = False) -> bool:
    """See whether it floats, which is returned, or has come to the depth of its phase.

    out: as of `afloat`.
    """
    x, at = f.lane.x, f.lane.at
    floats = bool(at.stop == 0 and at.place == 1 and afloat(f, out))
    if at.stop == 0 and at.arrived == 0 and at.alarm == 0:
        stage = f.stages[at.phase]
        if stage.kind != Kind.SURFACE and abs(x.z - goal_of(f)) <= stage.tolerance:
            arrive(f)
    return floats


@part
def next_phase(f: Phases) -> bool:
    """End the phase; return whether a cycle is over with it."""
    x, at = f.lane.x, f.lane.at
    stage = f.stages[at.phase]
    if at.ends == 1:
        pass  # it did what it does on the bottom, or under ice
    elif at.arrived == 0:
        note(f.lane, Note.OUT_OF_TIME, float(at.phase))
        at.missed |= 1 << at.phase
        if stage.kind == Kind.SURFACE:
            at.stop = Stop.DID_NOT_SURFACE
    elif (stage.kind == Kind.PARK or stage.kind == Kind.HOLD) and x.t_inside < f.lane.p.held * (
        x.t - x.t_arrived
    ):
        at.not_held |= 1 << at.phase
    at.new_phase = 1
    at.phase += 1
    if at.phase < f.stages.shape[0] and at.stop == 0:
        return False
    note(f.lane, Note.CYCLE, float(at.cycle))
    close_cycle(f)
    at.cycle += 1
    at.phase = 0
    if at.stop == 0:
        if at.cycle >= f.lane.p.last_cycle or x.t >= f.lane.p.last_time:
            at.stop = Stop.FINISHED
        elif x.charge <= f.lane.p.reserve:
            at.stop = Stop.RESERVE
    return True


@part
def close_cycle(f: Phases) -> None:
    """Enter the cycle in the table, and begin what is counted for the next."""
    x, at = f.lane.x, f.lane.at
    n = f.lane.counts[2]
    if n < f.cycles.shape[0]:
        c = f.cycles[n]
        c.t_begin, c.t_end, c.deepest = x.t_cycle, x.t, x.z_most
        c.missed, c.v_least, c.v_most = at.missed, x.v_least, x.v_most
        c.arrival, c.surfaced = x.t_arrival, x.t_afloat
        c.not_held = at.not_held
        for k in range(ACCOUNTS):  # no slice: Numba would compile what it says of shapes
            c.accounts[k] = f.lane.accounts[k]
        f.lane.counts[2] = n + 1
    x.t_cycle, x.z_most, at.missed, at.not_held = x.t, x.z, 0, 0
    x.v_least, x.v_most = x.v, -math.inf
    x.t_arrival, x.t_afloat = math.nan, math.nan
