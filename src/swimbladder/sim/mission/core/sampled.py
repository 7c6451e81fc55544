"""The phases of a mission by laws that sample, as hooks of the closed loop: `closed_loop.lane`.

At each sample the last one is entered in the accounts of the mission, the phases go on, and it is
decided whether the law is called. Where it is not, an input is held in the place of its command,
which a supervisor then sees: all volume out to surface or after an alarm, at rest within a
`rest_band`, and to dive from afloat, until the vehicle has no more volume than makes it neutral at
the surface: a law takes the volume that it begins with for the neutral one.

The phases of a mission that a float's board flies, as hooks of the closed loop.

Its law is called at every tick and commands seconds of pump and valve, as flashed; a supervisor
watches it. Phases end at ticks.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop.lane import Row, hook_in
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.accounts import Account as Sums
from swimbladder.sim.engine.advance import LEFT_WATER, TOO_DEEP
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.drive import FULL, note
from swimbladder.sim.engine.rodas.records import Account, Doing, Lane, Note, Stop
from swimbladder.sim.engine.rodas.step import enter, enter_energy
from swimbladder.sim.engine.sensor import measured_depth
from swimbladder.sim.mission.core.hooks import (
    begin_tick,
    enter_time,
    full,
    raise_alarm,
    too_deep,
    turn,
)
from swimbladder.sim.mission.core.phases import (
    Kind,
    Phases,
    awaited_level,
    begin_row,
    goal_of,
    grounds,
    row,
    settle,
)


class Boarded(NamedTuple):
    """A mission by its board on its way, as the hooks take it."""

    phases: Phases
    tick: float  # s
    span: float  # s, of a row of the trajectory at the longest
    last: Array  # [1] s, when the last row was written
    reason: Array  # [1], why the supervisor took over, 0: it has not
    knows: Array  # [1], of its law's state, 1: all volume is out once its run is over


@inlined
def _begin_board(f: Boarded, S: Array, k: int, built: Any) -> bool:  # noqa: ARG001
    g = f.phases
    if begin_tick(g, S):
        return True
    if g.lane.at.alarm == 0 and f.reason[0] != 0.0:
        raise_alarm(g, f.reason[0])
    return False


@inlined
def _sense_board(f: Boarded, S: Array, k: int) -> None:  # noqa: ARG001
    lane, stage = f.phases.lane, f.phases.stages[f.phases.lane.at.phase]
    lane.at.calls += 1
    seen = measured_depth(lane.p, lane.waves, lane.x, lane.at)
    grounds(f.phases, seen)
    S[Row.SEEN_DEPTH] = seen
    S[Row.SEEN_VOLUME] = lane.x.v  # its law begins with it, and measures none after
    S[Row.REFERENCE] = 0.0 if stage.kind == Kind.SURFACE else goal_of(f.phases)


@inlined
def _drive(f: Boarded, S: Array, k: int, command: float) -> float:  # noqa: ARG001
    """Move the volume to its upper limit where it is deeper than the mission allows."""
    return float(f.tick if f.phases.lane.at.alarm == 1 else command)


@inlined
def _bound(f: Boarded, until: float) -> float:
    x = f.phases.lane.x
    return float(x.t if x.charge <= f.phases.lane.p.empty else until)


@inlined
def _set_off(f: Boarded) -> tuple[float, float]:
    g = f.phases
    begin_row(g)
    return g.stages[g.lane.at.phase].loads, awaited_level(g)


@inlined
def _moved(f: Boarded, event: int, time: float, depth: float) -> None:
    """Enter a step in what is known of the phase, and see whether it arrived or is too deep."""
    g = f.phases
    x, at = g.lane.x, g.lane.at
    arrived = at.arrived == 1
    ends = too_deep(g, event)
    if ends and at.alarm == 0:
        raise_alarm(g, 0.0)
    if ends or arrived != (at.arrived == 1) or x.t - f.last[0] >= f.span:
        f.last[0] = x.t
        row(g)
    enter_time(g, depth, x.t - time, arrived)
    if x.t > time:
        at.idle = 0


@inlined
def _settled(f: Boarded) -> None:
    g = f.phases
    at = g.lane.at
    # its volume is computed: it is at the surface when its board takes it to be
    settle(g, at.alarm == 0 and at.doing == Doing.NOTHING and f.knows[0] > 0.0)


hook_in(
    Boarded,
    begin=_begin_board,
    sense=_sense_board,
    drive=_drive,
    bound=_bound,
    set_off=_set_off,
    moved=_moved,
    settled=_settled,
)


CHECK = 10.0  # s between two checks of the depth where a law may rest, at least
_STILL = 0.01  # share of its band that a vehicle may drift between two of them, to be let rest
_LAW, _BAND, _SPEED = range(3)  # columns of `Sampled.tasks`
_ROOM = 64  # rows or notes that a sample may add
_SAME = 1e-6  # of a sample: time that rounding makes


class Numbers(NamedTuple):
    """What does not change while one law flies."""

    tick: float  # s, of a sample
    weight: float  # N/m3, rho g
    neutral_top: float  # m3, neutral volume where the hull begins to emerge
    row_samples: float  # from row to row of the trajectory
    longest: float  # s between two checks of a law that rests
    unseen: float  # m that the depth seems to change by the sensor's noise
    moving: float = 0.0  # W from the cells, of a positioner; 0 where it is not known, as below
    holding: float = 0.0  # W
    conductance: float = 0.0  # 1/ohm, of a motor's winding
    kappa: float = 0.0  # V s/m3, of the motor
    given: float = 1.0  # -, power at the terminals over that into the motor
    back: float = 1.0  # -, likewise where the motor gives it back
    emf: float = 1.0  # V, of the battery
    resistance: float = 0.0  # ohm, of the battery


class Way(NamedTuple):
    """What is remembered from sample to sample, beside the phases and the rows of the lane."""

    law: float = -1.0  # which law flies; as in `Sampled.tasks`
    begun: float = 0.0  # s, when it was laid out
    parts: float = 0.0  # steps of a sample
    tick: float = 0.0  # sample that is due
    flew: float = 0.0  # 1: a sample was flown that is not entered yet
    drawn: float = 0.0  # samples whose noise is used up
    called: float = 0.0  # 1: the law is called
    begins: float = 0.0  # 1: it begins anew
    held: float = 0.0  # V or m3 in its place
    rests: float = 0.0  # 1: it rests
    dives: float = 0.0  # 1: it floats, or has not got rid yet of what lets it
    seen: float = math.nan  # m, depth at the last check, nan: there was none
    check: float = 0.0  # s, time of the next
    pause: float = CHECK  # s between the two
    phase_begin: float = math.nan  # s, of the phase whose reference moves
    phase_from: float = 0.0  # m, where the way to it began
    way_begin: float = 0.0  # s, when that did
    raised: float = 0.0  # m, as in NOW
    since: float = 0.0  # samples since the last row
    row_out: float = 0.0  # m3 pumped up to it
    row_in: float = 0.0  # m3 let in up to it


WAY = np.dtype([(name, np.float64) for name in Way._fields])


class Sampled(NamedTuple):
    """A mission by sampled laws on its way, as the hooks take it."""

    phases: Phases
    own: Numbers
    now: Any  # a record of WAY
    tasks: Array  # [phases, 3]: number of its law, rest band [m] and speed [m/s], 0: none
    sums: Array  # [1, Sums] of the block's lane, emptied at each sample
    log: Array  # [1, n, 3], its passages from mode to mode, likewise
    noted: NDArray[np.int64]  # [1, 1], how many
    reason: Array  # [1], why the supervisor took over, 0: it has not


@part
def _begin(f: Sampled, S: Array, k: int, built: Any) -> bool:  # noqa: ARG001
    """Enter the last sample, let the phases go on, and set what the law is to follow."""
    g, now = f.phases, f.now
    x, at = g.lane.x, g.lane.at
    now.tick = k
    if now.flew != 0.0:
        now.flew = 0.0
        _enter(f, S, k)
    if S[Row.STOPPED] != 0.0 and at.stop == 0:
        at.stop = Stop.STUCK
    if turn(g) and at.stop == 0:
        turn(g)
    if g.lane.counts[0] == 0 and g.rows.shape[0] > 0:
        row(g)
    task = f.tasks[at.phase]
    if at.stop != 0 or task[_LAW] != now.law or full(g, _ROOM):
        return True
    end = goal_of(g)
    if task[_SPEED] > 0.0:
        if now.phase_begin != x.t_phase or now.raised != x.raised:
            now.phase_begin, now.phase_from = x.t_phase, x.z
            now.way_begin, now.raised = x.t, x.raised
        way = end - now.phase_from
        end -= math.copysign(max(abs(way) - task[_SPEED] * (x.t - now.way_begin), 0.0), way)
    S[Row.REFERENCE] = end
    now.flew, now.tick = 1.0, k + 1.0
    return False


@part
def _enter(f: Sampled, S: Array, k: int) -> None:
    """Enter the sample that led to the state S, and see what it means for the phase."""
    g, now, sums, h = f.phases, f.now, f.sums[0], f.own.tick
    x, at, a = g.lane.x, g.lane.at, g.lane.accounts
    z, arrived, alarm, place = x.z, at.arrived, at.alarm, at.place
    change = S[Row.V] - x.v
    x.t = now.begun + k * h
    if abs(x.t_end - x.t) < _SAME * h:
        x.t = x.t_end
    x.v, x.z, x.w = S[Row.V], S[Row.Z], S[Row.W]
    at.place = int(S[Row.MODE]) // 20
    at.steps += 1
    if S[Row.STOPPED] == LEFT_WATER:
        at.stop = Stop.LEFT_WATER
    elif S[Row.STOPPED] == TOO_DEEP:
        at.stop = Stop.LOST
    x.z_most, x.v_least = max(x.z_most, x.z), min(x.v_least, x.v)
    if at.place == modes.SUBMERGED:
        x.v_most = max(x.v_most, x.v)
    energy = _energy(f.own, S, sums)
    _enter_drive(f, sums, change, energy)
    a[Account.LEAKED] += sums[Sums.LEAKED]
    a[Account.LEAK_WORK] += f.own.weight * sums[Sums.LEAK_Z]
    a[Account.DRAG] += g.lane.p.mass * sums[Sums.DRAG]
    a[Account.IMPACTS] += g.lane.p.mass * sums[Sums.BOTTOM_W]
    sums[:] = 0.0
    _note_passages(f, S[Row.PLANT + modes.Z_SURFACE])
    enter_energy(g.lane.p, x, a, energy, g.stages[at.phase].loads, h)
    enter_time(g, z, h, arrived == 1)
    now.since += 1.0
    checks, rests = _is_due(f), now.rests != 0.0
    due = checks if rests else now.since >= f.own.row_samples
    due = due or at.place != place or x.t >= x.t_end or x.charge <= g.lane.p.empty
    rows = g.lane.counts[0]
    row(g)
    settle(g)
    if at.stop == 0 and at.alarm == 0 and (f.reason[0] != 0.0 or x.z > g.lane.p.deepest):
        raise_alarm(g, f.reason[0])
    if due or at.stop != 0 or at.arrived != arrived or at.alarm != alarm:
        _close_row(f, rows - 1)
    else:
        g.lane.counts[0] = rows


@inlined
def _enter_drive(f: Sampled, sums: Array, change: float, energy: float) -> None:
    """Enter what the drive did in a sample that changed the volume by `change` [m3]."""
    at, a = f.phases.lane.at, f.phases.lane.accounts
    net = sums[Sums.PUMPED]
    out = max(0.5 * (sums[Sums.TRAVEL] + change), net, 0.0)
    doing = Doing.NOTHING
    if out > 0.0 or out - net > 0.0:
        doing = Doing.PUMPING if net >= 0.0 else Doing.LETTING_IN
        if doing != at.doing:
            a[Account.PUMP_RUNS if doing == Doing.PUMPING else Account.VALVE_RUNS] += 1.0
    at.doing = doing
    a[Account.PUMPED] += out
    a[Account.LET_IN] += out - net
    on, work = min(sums[Sums.MOTOR_ON], f.own.tick), f.own.weight * sums[Sums.Z_Q]
    enter(a, doing, 0.0, work, energy, on)  # the volumes stand there already


@inlined
def _energy(own: Numbers, S: Array, sums: Array) -> float:
    """Return what the drive draws from the battery's cells in a sample [J]."""
    h = own.tick
    if S[Row.PLANT + modes.POSITIONER] != 0.0:
        on = min(sums[Sums.MOTOR_ON], h)
        return float(own.moving * on + own.holding * (h - on))
    motor = own.conductance * (sums[Sums.U_U] - own.kappa * sums[Sums.U_Q]) / h
    power = motor * (own.given if motor > 0.0 else own.back)
    # `physics.electric.supply_current` times E; nan beyond what the battery can give
    root = math.sqrt(own.emf * own.emf - 4.0 * own.resistance * power)
    return float(own.emf * 2.0 * power / (own.emf + root) * h)


@inlined
def _close_row(f: Sampled, last: int) -> None:
    """Let the row before the present one say what was done in between."""
    g, now, a = f.phases, f.now, f.phases.lane.accounts
    out, back = a[Account.PUMPED] - now.row_out, a[Account.LET_IN] - now.row_in
    now.since, now.row_out, now.row_in = 0.0, a[Account.PUMPED], a[Account.LET_IN]
    if 0 <= last < g.rows.shape[0]:
        doing = Doing.PUMPING if out >= back else Doing.LETTING_IN
        doing = doing if out > 0.0 or back > 0.0 else Doing.NOTHING
        g.rows[last].doing = doing.value


@part
def _note_passages(f: Sampled, top: float) -> None:
    """Note where the vehicle came to the surface [m], the bottom or an end stop."""
    g, log = f.phases, f.log[0]
    x, at = g.lane.x, g.lane.at
    rocks = at.arrived == 1 and g.stages[at.phase].kind == Kind.SURFACE
    for n in range(min(f.noted[0, 0], log.shape[0])):
        t, old, new = f.now.begun + log[n, 0], int(log[n, 1]), int(log[n, 2])
        stop = _stop_of(new)
        if stop >= 0 and stop != _stop_of(old) and not rocks:
            _note(g.lane, t, stop, x.z)
        where, was = new // 20, old // 20
        if where != was:
            if where == modes.BOTTOM:
                _note(g.lane, t, Note.BOTTOM, x.z)
            elif was == modes.BOTTOM:
                _note(g.lane, t, Note.LEFT_BOTTOM, x.z)
            else:
                _note(g.lane, t, Note.EMERGED if where == modes.EMERGING else Note.SUBMERGED, top)
    f.noted[0, 0] = 0


@inlined
def _stop_of(mode: int) -> int:
    """Return the note of an end stop that the drive stands at in a mode; -1: at none."""
    act = mode % 10
    if act == modes.UPPER:
        return Note.UPPER_STOP
    return Note.LOWER_STOP if act in (modes.LOWER, modes.LOWER_SPINNING) else -1


@part
def _note(lane: Lane, t: float, what: int, depth: float) -> None:
    """Note a passage at a time [s] and depth [m]; without room nothing is kept."""
    n = lane.counts[1]
    note(lane, what, lane.x.w)
    if lane.counts[1] > n:
        lane.notes[n].t, lane.notes[n].z = t, depth


@part
def _sense(f: Sampled, S: Array, k: int) -> None:  # noqa: ARG001
    """See whether the law is called, or which input is held."""
    g, now = f.phases, f.now
    x, at, p = g.lane.x, g.lane.at, g.lane.p
    called, moves = now.called != 0.0, S[Row.PLANT + modes.POSITIONER] != 0.0
    now.called, now.begins = 0.0, 0.0
    surface, nearly = g.stages[at.phase].kind == Kind.SURFACE, FULL * (p.v_max - p.v_min)
    more = x.v - f.own.neutral_top
    grounds(g, S[Row.SEEN_DEPTH])
    dives = now.dives != 0.0 or (not called and at.place == modes.EMERGING)
    now.dives = 0.0
    if at.alarm != 0 or (surface and (x.z <= p.shallow or at.arrived == 1)):
        now.rests, now.dives = 0.0, 1.0
        if moves:
            now.held = p.v_max
        else:
            now.held = _holding(S) if x.v >= p.v_max - nearly else S[Row.PLANT + modes.SUPPLY]
    elif dives and more > nearly:
        now.dives = 1.0  # also where it bobs under: the law takes what it begins with for neutral
        # all of it in a sample, but for what the supply lacks
        u = S[Row.PLANT + modes.FRICTION] + more / (f.own.tick * S[Row.PLANT + modes.GAIN])
        now.held = f.own.neutral_top if moves else -min(u, S[Row.PLANT + modes.SUPPLY])
    elif _rests(f, S[Row.SEEN_DEPTH]):
        now.held = x.v if moves else _holding(S)
    else:
        now.called, at.calls = 1.0, at.calls + 1
        if not called:
            now.begins, S[Row.WAIT] = 1.0, 0.0


@inlined
def _holding(S: Array) -> float:
    """Return the voltage that holds the volume against the sea [V]."""
    load = S[Row.PLANT + modes.LOAD_BACK] * max(S[Row.Z], 0.0)
    return float(max(load - S[Row.PLANT + modes.FRICTION], 0.0))


@inlined
def _is_due(f: Sampled) -> bool:
    """Return whether the next sample would be too late for the next check."""
    return bool(f.phases.lane.x.t + (1.0 - _SAME) * f.own.tick > f.now.check)


@inlined
def _rests(f: Sampled, seen: float) -> bool:
    """Return whether the law rests, the depth being seen [m] where a check is due."""
    g, now, own = f.phases, f.now, f.own
    x, at = g.lane.x, g.lane.at
    band = f.tasks[at.phase, _BAND]
    if band == 0.0 or at.arrived == 0:
        now.rests, now.seen, now.check = 0.0, math.nan, x.t
        return False
    if not _is_due(f):
        return bool(now.rests != 0.0)
    left = band - abs(seen - goal_of(g))
    drift = math.inf if math.isnan(now.seen) else abs(seen - now.seen)
    rests = left >= 0.5 * band and drift <= max(_STILL * band, own.unseen)
    if now.rests != 0.0:
        rests = left >= 0.0
    if rests:  # at constant acceleration from rest it is then at the edge of its band at most
        speed = max(drift / now.pause, 1e-9)
        now.pause = max(min(0.25 * left / speed, 2.0 * now.pause, own.longest), CHECK)
    else:
        now.pause = CHECK
    now.rests, now.seen, now.check = 1.0 if rests else 0.0, seen, x.t + now.pause
    return bool(rests)


@inlined
def _starts(f: Sampled, k: int) -> bool:  # noqa: ARG001
    return bool(f.now.begins != 0.0)


@inlined
def _ask(f: Sampled, S: Array, k: int) -> bool:  # noqa: ARG001
    return bool(f.now.called != 0.0)


@inlined
def _wanted(f: Sampled, S: Array, k: int, command: float) -> float:  # noqa: ARG001
    return float(command if f.now.called != 0.0 else f.now.held)


hook_in(Sampled, begin=_begin, sense=_sense, ask=_ask, wanted=_wanted, starts=_starts)
