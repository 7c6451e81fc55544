"""One mission with faults: what stands between plant, sensors, board and driver of the one loop.

The board's C, called by its address, is the law; the faults act through the hooks of
`closed_loop.lane`, and what leaks in, drifts and swells through `closed_loop.hooks.lose`.
"""

import math
import threading
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Law, Measurement
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.closed_loop.block import Block, work_space
from swimbladder.sim.closed_loop.floats import FloatModel
from swimbladder.sim.closed_loop.lane import N_PLANT, Row, hook_in, limited
from swimbladder.sim.closed_loop.lanes import OVER, Schedule
from swimbladder.sim.closed_loop.supervision import battery_voltage
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.cache import inlined
from swimbladder.sim.engine.chain import base_steps
from swimbladder.sim.engine.modes import Layers, layered
from swimbladder.sim.engine.rodas.records import Doing
from swimbladder.sim.faults import kinds as effects
from swimbladder.sim.faults.c_interface import call_begin, call_tick
from swimbladder.sim.faults.draw import (
    WAVES,
    Condition,
    FaultRow,
    Mission,
    Result,
    Wave,
    record_type,
)
from swimbladder.sim.faults.kinds import MOST, NOTHING_KEPT, On, PumpTable
from swimbladder.vehicle import Sensors

# The board decides; or full buoyancy is commanded from `full_after` the last fault acts on, or from
# `full_after` the first does.
OWN, FULL, EARLY = 0, 1, 2
_RAN, _MISSED, _OFF = 0.0, 1.0, 2.0
MOST_TURNS = 8  # set-points of a mission
_WHOLE = 1.0 - 1e-6  # of a tick: a command so long is one of all of it
_NEARLY = 0.01  # of the stroke: a volume so near its largest is all out


class Board(NamedTuple):
    """A controller that is called by address, as the parameters of a law; see `host.Board`."""

    begin: int
    tick: int
    memory: Any  # bytes that it remembers
    # [8] float32: depth, its age, volume, battery, leak, lost ticks, depth asked for, law waits
    seen: Any
    said: Any  # [4] float32: reason, release, whether its law was called, whether by the bypass


class Nothing(NamedTuple):
    """The state of a board, which is in its memory."""

    nothing: float


@inlined
def _call(board: Board, depth: float, volume: float, reference: float) -> float:
    """Return what the board commands of what it sees now and is asked for."""
    seen = board.seen
    seen[0], seen[2], seen[6] = depth, volume, reference
    command: float = call_tick(  # type: ignore[call-arg]
        board.tick, board.memory.ctypes.data, seen.ctypes.data, board.said.ctypes.data
    )
    return float(command)


def _step(
    board: Board, state: Nothing, measurement: Measurement, reference: float
) -> tuple[float, Nothing, float]:
    return _call(board, measurement.depth, measurement.volume, reference), state, 0.0


def _initial(_board: Board, _measurement: Measurement, _reference: float) -> Nothing:
    return Nothing(0.0)


_LAW = Law(
    name="board",
    summary="the C of a board",
    command="voltage",
    parameters=Board,
    state=Nothing,
    step=_step,
    initial=_initial,
)


class FlightState(NamedTuple):
    """What a flight remembers from tick to tick, beside the rows of its lane."""

    how: float = 0.0  # OWN, FULL or EARLY
    ran: float = 0.0  # 1: the board was called at this tick
    board: float = 0.0  # _RAN, _MISSED or _OFF
    command: float = 0.0  # V or m3, of the board
    lost: float = 0.0  # ticks since its last
    off_until: float = -1.0  # tick
    hung_until: float = -1.0  # tick
    hangs: float = 0.0  # ticks that a call of its law would not come back for
    resets: float = 0.0
    restarted: float = 0.0  # 1: it was reset, and remembers what outlives that
    must_begin: float = 1.0  # 1: its begin is to be called before its tick
    begun: float = 0.0  # tick that its clock counts from
    ahead: float = 0.0  # of a tick, that its clock is fast by
    waits: float = 0.0  # 1: its clock has no tick at this one
    turn: float = 0.0  # set-point
    asked: float = 0.0  # m
    commanded: float = 0.0  # 1: full buoyancy is commanded
    full_at: float = math.inf  # tick from which on it is
    deepest: float = 0.0  # m
    below: float = 0.0  # ticks since it was at the surface
    acts: float = 0.0  # faults that have acted
    noise: float = 0.0  # of the depth at this tick, which the battery's is taken to be as well
    battery: float = 0.0  # V, at the board
    age: float = 0.0  # s, of the depth
    delivery: float = 0.0  # -, of a float's pump in health, over what the law's processor knows
    delivered: float = 0.0  # -, the same under faults, where it last was above 0
    flow: float = 0.0  # -, of its valves


FLIGHT = np.dtype(
    [
        ("condition", record_type(Condition)),
        ("now", record_type(FlightState)),
        ("result", record_type(Result)),
        ("base", np.float64, (N_PLANT,)),  # the healthy vehicle
        ("faults", np.int64),  # how many
        ("fault_rows", np.float64, (MOST, len(FaultRow._fields))),
        ("acts", np.float64, (len(On), 2)),  # what they do at this tick, see `kinds.act`
        ("kept", np.float64, NOTHING_KEPT.shape),  # what the faults remember
        ("turns", np.float64, (MOST_TURNS,)),  # ticks of the set-points, inf behind the last
        ("depths", np.float64, (MOST_TURNS,)),  # m
        ("waves", np.float64, (WAVES, len(Wave._fields))),
    ]
)


class Faults(NamedTuple):
    """A mission with faults, as the hooks take it."""

    flight: Any  # a record of FLIGHT
    board: Board
    before: Any  # the board's memory at the begin of a tick
    layers: Layers  # of the water
    late: Array  # depths seen before
    stepper: Any  # what moves a float, see `closed_loop.pumped`; None of other vehicles
    pump: PumpTable
    built: Any  # see `advance.ModeLane`, of the lane
    record: Array  # [ticks, len(Trace)] or no rows


@inlined
def _keep(source: Any, target: Any) -> None:
    """Copy a vector into one as long."""
    for n in range(target.shape[0]):
        target[n] = source[n]


@inlined
def _filled(faults: Faults, S: Array, afloat: bool) -> float:
    """Return 1 once a vehicle is heavy with all its volume out since it was at the surface.

    All: as far as the actuator comes, where it is blocked. 0: all out, and not heavy; -1: not all
    out, or not there. What is filled stays so until it is at the surface again.
    """
    base = faults.flight.base
    before: float = faults.flight.result.filled
    if before > 0.0 and not afloat:
        return before
    stroke = base[modes.V_MAX] - base[modes.V_MIN]
    if S[Row.V] + S[Row.LOST] < S[Row.PLANT + modes.V_MAX] - _NEARLY * stroke:
        return -1.0
    if afloat:
        return 0.0
    own = S[Row.PLANT + modes.V_0]  # a weight may have changed it
    neutral = own + base[modes.PSI] * S[Row.Z] + layered(faults.layers, S[Row.Z])[0]
    return 1.0 if before == 0.0 and S[Row.V] < neutral else before


@inlined
def _surfaced(faults: Faults, S: Array, k: int) -> bool:
    """Follow where the vehicle is at tick k; return whether its mission is over."""
    c, now, result = faults.flight.condition, faults.flight.now, faults.flight.result
    z = S[Row.Z]
    now.deepest = max(now.deepest, z)
    if z > c.rated:
        result.beyond = k
        result.last = k
        return True
    quiet = now.commanded != 0.0 or k >= c.quiet_at or k > result.latched
    afloat = z <= faults.flight.base[modes.Z_SURFACE] + c.band
    now.below = 0.0 if afloat else now.below + 1.0
    if afloat and quiet and math.isnan(result.up):
        result.up = k
    result.filled = _filled(faults, S, afloat)
    if not quiet or now.below > c.stay:  # one that came up fast bobs, and comes back sooner
        result.arrived = np.nan
    elif afloat and math.isnan(result.arrived):
        result.arrived = k
    result.last = k
    return bool(afloat and k - result.arrived >= c.stay)


@inlined
def _begin(faults: Faults, S: Array, k: int, built: Any) -> bool:
    """Let the faults act on plant and battery; return whether the mission is over."""
    if S[Row.STOPPED] != 0.0:
        return True
    m, now, result = faults.flight, faults.flight.now, faults.flight.result
    c, fault_rows, p = m.condition, m.fault_rows[: m.faults], S[Row.PLANT : Row.PLANT + N_PLANT]
    if k == 0:
        np.random.seed(np.uint32(c.seed))  # noqa: NPY002
    if _surfaced(faults, S, k):
        return True
    effects.act(fault_rows, k, c.tick, m.acts)
    S[Row.SLOW] = 1.0  # the plant changes between ticks
    S[Row.LEAK] = m.acts[On.WATER, 1]
    changed = effects.changes(fault_rows, k)
    if changed:
        effects.change_plant(m.base, p, m.acts, S[Row.V] + S[Row.LOST], S[Row.LOST], m.kept)
    if now.acts < fault_rows.shape[0]:
        now.acts = effects.acted(m.base, p, fault_rows, k, c.tick, S[Row.V], m.kept)
        if now.acts > 0 and math.isnan(result.acting):
            result.acting = k
            if now.how == EARLY:
                now.full_at = k + c.full_after
        if now.acts == fault_rows.shape[0] and now.how == FULL:
            now.full_at = k + c.full_after
    _act_on_drive(faults, faults.stepper, S, p, built, changed)
    return False


@inlined
def _act_on_drive(
    faults: Faults, stepper: Any, S: Array, p: Array, built: Any, changed: bool
) -> None:
    """Let the faults act on what changes the volume, and on its battery."""
    if stepper is None:  # pruned before types are inferred, here and below
        _act_on_motor(faults, S, p, built, changed)
    else:
        _act_on_pump(faults, stepper.given[0], stepper.x[0], stepper.at[0], S, p, changed)


@inlined
def _go_on(S: Array, p: Array) -> None:
    """Give a positioner on its way its speed of now, also one that could not move."""
    moves = int(S[Row.MODE]) % 10
    if moves == modes.MOVING_OUT:
        S[Row.Q] = p[modes.RATE]
    elif moves == modes.MOVING_IN:
        S[Row.Q] = -p[modes.RATE]


@inlined
def _act_on_motor(faults: Faults, S: Array, p: Array, built: Any, changed: bool) -> None:
    """Let the faults act on a motor or positioner, and on its battery."""
    m, now = faults.flight, faults.flight.now
    if changed:
        built[:] = 0
        _go_on(S, p)
        if int(S[Row.MODE]) % 10 == modes.UPPER and S[Row.Q] < p[modes.K_L] * S[Row.Z]:
            S[Row.MODE] -= modes.UPPER - modes.FORWARD  # what leaks now comes off the end stop
    if m.base[modes.POSITIONER] != 0.0:
        now.battery = np.nan
        return
    u = S[Row.APPLIED]
    p[modes.SUPPLY] = effects.emf(m.base, m.acts, abs(u) > 0.05 * m.base[modes.SUPPLY])
    S[Row.LOW_U], S[Row.HIGH_U] = -p[modes.SUPPLY], p[modes.SUPPLY]
    applied = max(-p[modes.SUPPLY], min(p[modes.SUPPLY], u))
    now.battery = battery_voltage(p[modes.SUPPLY], p[modes.SAG], p[modes.KAPPA], applied, S[Row.Q])


@inlined
def _act_on_pump(
    faults: Faults, given: Any, x: Any, at: Any, S: Array, p: Array, changed: bool
) -> None:
    """Let the faults act on a float's pump, valve and end stops, and on its battery."""
    m, now = faults.flight, faults.flight.now
    if changed:
        at.rests = 0
        x.h = min(x.h, 1.0)
        given.v_min, given.v_max = p[modes.V_MIN] + S[Row.LOST], p[modes.V_MAX] + S[Row.LOST]
        given.flow = now.flow * m.acts[On.VALVE, 0] * m.acts[On.PORT_IN, 0]
        given.open, given.open_running = m.acts[On.OPEN, 1], m.acts[On.OPEN_RUNNING, 1]
    share, loaded, unloaded = effects.pump_share(faults.pump, m.base, m.acts, max(S[Row.Z], 0.0))
    given.delivery = now.delivery * share
    if share <= 0.0:
        x.t_primed += m.condition.tick  # it primes when it delivers again
    elif given.delivery != now.delivered:
        x.t_primed = x.t + (x.t_primed - x.t) * now.delivered / given.delivery
        now.delivered = given.delivery
    runs = at.doing == Doing.PUMPING or at.doing == Doing.PRIMING
    now.battery = loaded if runs else unloaded


@inlined
def _read_of_waves(waves: Array, depth: float, t: float) -> float:
    """Return what the depth's sensor reads of the sea [m] at a depth [m] and time [s]."""
    read = 0.0
    if waves[0, 0] != 0.0:
        for n in range(waves.shape[0]):
            fades = math.exp(-waves[n, 1] * max(depth, 0.0))
            read += waves[n, 0] * fades * math.cos(waves[n, 2] * t + waves[n, 3])
    return read


@inlined
def _sense(faults: Faults, S: Array, k: int) -> None:
    """Write what the sensors give, with their faults."""
    m = faults.flight
    c, now, kept = m.condition, m.now, m.kept
    noise, other = np.random.normal(), np.random.normal()  # noqa: NPY002
    depth = S[Row.Z] + _read_of_waves(m.waves, S[Row.Z], k * c.tick) + S[Row.DEPTH_NOISE] * noise
    S[Row.SEEN_DEPTH], now.age = effects.see_depth(
        m.acts, k, c.tick, depth, S[Row.DEPTH_QUANTUM], kept, faults.late
    )
    volume = S[Row.V] + S[Row.LOST]
    volume += effects.slipped(m.acts, volume, kept) + S[Row.VOLUME_NOISE] * other
    stroke = m.base[modes.V_MAX] - m.base[modes.V_MIN]
    seen = effects.see_volume(m.acts, k, c.tick, volume, S[Row.VOLUME_QUANTUM], stroke, kept)
    S[Row.SEEN_VOLUME] = seen if faults.stepper is None else math.nan  # not measured by a float
    now.noise = noise


@inlined
def _ask(faults: Faults, S: Array, k: int) -> bool:
    """Return whether the board runs at tick k; where it does not, set what it commands."""
    m = faults.flight
    c, now, turns = m.condition, m.now, m.turns
    ticks, now.ahead = effects.ticks_now(m.acts, now.ahead)
    now.waits = 0.0
    now.begun -= ticks - 1
    effects.flip(m.acts, faults.board.memory)
    while now.turn + 1 < turns.shape[0] and turns[int(now.turn) + 1] <= k - now.begun:
        now.turn += 1
    now.asked += max(-c.ramp, min(c.ramp, m.depths[int(now.turn)] - now.asked))
    S[Row.REFERENCE] = effects.asked(m.acts, now.asked)
    missed, reset, now.hangs = effects.board_misses(m.acts, c.tick)
    if k >= now.full_at:
        now.hangs, now.hung_until = 0, -1  # what misses ticks or is reset does so here as well
    now.board, now.ran = _RAN, 0.0
    if k == now.hung_until or reset or now.battery < c.brown_out:
        if k > 0:
            now.off_until = k + int(c.boot)
        now.hung_until = -1
    if k < now.off_until:
        now.board = _OFF
        if now.must_begin == 0.0:
            now.resets += 1
        now.must_begin, now.restarted = 1.0, 1.0
        now.begun, now.turn = k + 1, 0  # its clock begins anew, and what it is to do with it
        now.lost = 0
        now.command = S[Row.V] + S[Row.LOST] if m.base[modes.POSITIONER] != 0.0 else 0.0
    elif k < now.hung_until:
        now.board = _MISSED
    elif missed:
        now.board = _MISSED
        now.lost += 1
    elif ticks == 0:
        now.board, now.waits = _MISSED, 1.0
    elif k >= now.full_at:
        now.command, now.commanded = c.full, 1.0
    else:
        _prepare(faults, S)
        if ticks > 1 and now.hangs == 0:
            _call(faults.board, S[Row.SEEN_DEPTH], S[Row.SEEN_VOLUME], S[Row.REFERENCE])
            faults.board.seen[5] = 0.0
        now.ran = 1.0
    return bool(now.ran != 0.0)


@inlined
def _prepare(faults: Faults, S: Array) -> None:
    """Begin the board's program where it must, and write what it sees beside its law."""
    c, now, board = faults.flight.condition, faults.flight.now, faults.board
    if now.must_begin != 0.0:
        if now.restarted == 0.0:
            for n in range(board.memory.shape[0]):
                board.memory[n] = 0  # a reset leaves it as it is
        call_begin(  # type: ignore[call-arg]
            board.begin, board.memory.ctypes.data, np.int32(now.restarted)
        )
        now.must_begin = 0.0
    board.seen[1] = now.age
    board.seen[3] = now.battery * (1.0 + c.battery_noise * now.noise)
    board.seen[4] = 1.0 if S[Row.WATER] > c.leak_input else 0.0
    board.seen[5] = now.lost
    board.seen[7] = 1.0 if faults.flight.acts[On.WAITS, 0] == 0.0 else 0.0
    if now.hangs > 0:
        _keep(board.memory, faults.before)


@inlined
def _drive(faults: Faults, S: Array, k: int, command: float) -> float:
    """Return what the driver gives the actuator of what the board commands, with its faults."""
    c, now, result = faults.flight.condition, faults.flight.now, faults.flight.result
    m, said = faults.flight, faults.board.said
    if now.ran != 0.0 and now.hangs > 0 and said[2] != 0.0:  # it has not come back from its law
        _keep(faults.before, faults.board.memory)
        now.hung_until = k + now.hangs
        now.board = _MISSED
    elif now.ran != 0.0:
        now.command, now.lost = command, 0
        if said[0] != 0.0 and math.isnan(result.latched):
            result.latched, result.reason = k, said[0]
        if said[1] != 0.0 and math.isnan(result.released):
            result.released = k
    _hand_on(now, faults.stepper, said, S, c.tick)
    volume = S[Row.V] + S[Row.LOST]
    way = S[Row.APPLIED] - (volume if m.base[modes.POSITIONER] != 0.0 else 0.0)
    u = effects.driven(m.acts, S[Row.LOW_U], S[Row.HIGH_U], now.command, way, m.kept)
    u = limited(S, 1, 0, u)
    _throttle(faults, faults.stepper, S, u)
    if faults.record.shape[0] > k:
        row = faults.record[k]
        wet = 1.0 if S[Row.WATER] > c.leak_input else 0.0
        row[0], row[1], row[2], row[3], row[4] = S[Row.Z], S[Row.W], volume, now.command, u
        row[5], row[6], row[7] = now.battery, S[Row.REFERENCE], S[Row.SEEN_DEPTH]
        row[8] = now.age
        row[9], row[10], row[11], row[12] = S[Row.SEEN_VOLUME], wet, now.lost, now.board
        row[13], row[14] = result.reason, S[Row.WATER]
    return float(u)


@inlined
def _throttle(faults: Faults, stepper: Any, S: Array, u: float) -> None:
    """Let a throttled port take the flow of what the driver gives."""
    if stepper is None:
        m, p = faults.flight, S[Row.PLANT : Row.PLANT + N_PLANT]
        effort = (u - m.base[modes.LOAD_DRIVE] * S[Row.Z]) / m.base[modes.SUPPLY]
        if m.base[modes.POSITIONER] != 0.0:
            way = u - S[Row.V] - S[Row.LOST]
            still = 1e-12 * (m.base[modes.V_MAX] - m.base[modes.V_MIN])
            effort = 0.0 if abs(way) < still else math.copysign(1.0, way)
        if effects.turn_flow(m.base, p, m.acts, effort, m.kept):
            faults.built[:] = 0
            _go_on(S, p)


@inlined
def _hand_on(now: Any, stepper: Any, said: Any, S: Array, tick: float) -> None:
    """Give a float's drive its command; what is on goes off where none comes.

    What is on for a whole tick of a slow clock is so until its next one.
    """
    if stepper is not None:
        on = now.waits != 0.0 and abs(now.command) >= _WHOLE * tick
        if now.board != _RAN and not on:
            now.command = 0.0
        S[Row.WIDE] = said[3] if now.ran != 0.0 or on else 0.0


class Room(threading.local):
    """What a thread flies in."""

    def __init__(self, memory: int, late: int, model: FloatModel | None, pump: PumpTable) -> None:
        self.memory, self.before = np.zeros(memory, np.uint8), np.zeros(memory, np.uint8)
        self.chains = work_space(1)
        self.late = np.zeros(late)
        self.model, self.pump = model, pump


hook_in(Faults, begin=_begin, sense=_sense, ask=_ask, drive=_drive)


def fly(mission: Mission, how: int, functions: tuple[int, int], room: Room, record: Array) -> Array:
    """Fly one mission; fill record where it has rows [n, len(Trace)], return [len(Result)].

    how: OWN, FULL or EARLY. functions: addresses of the board's begin and tick.
    """
    c, p = mission.condition, Plant(*mission.plant.tolist())
    pump, valve = mission.drive
    flights = np.zeros(1, FLIGHT)
    m: Any = flights[0]
    m["condition"], m["base"] = c, mission.plant
    state = FlightState(how=how, delivery=pump, delivered=pump, flow=valve)
    m["now"] = state._replace(asked=mission.depths[0], deepest=c.start_depth)
    m["kept"], m["result"] = NOTHING_KEPT, Result()
    m["turns"], m["faults"] = math.inf, len(mission.fault_rows)
    m["fault_rows"][: len(mission.fault_rows)] = mission.fault_rows
    m["turns"][: len(mission.turns)] = mission.turns
    m["depths"][: len(mission.depths)] = mission.depths
    m["waves"] = mission.waves
    board = Board(*functions, room.memory, np.zeros(8, np.float32), np.zeros(4, np.float32))
    stepper, start = None, np.array([[0.0], [c.start_volume], [c.start_depth], [0.0]])
    if room.model is not None:
        rates = np.array(mission.drive)[:, None]
        stepper, start = room.model.lanes({}, mission.plant[:, None], start, rates=rates)
    sensors = {name: getattr(c, name) for name in Sensors.model_fields}
    turn = np.zeros(int(c.end) + 1, np.int64)
    block = Block(
        plants=mission.plant[:, None],
        law=_LAW,
        parameters=dict.fromkeys(Board._fields, 0.0),
        clock=Schedule(tick=c.tick, turn=turn, given=np.zeros(1, np.int64)),
        parts=base_steps(p, c.tick, 0.0) if stepper is None else 1,
        depths=mission.depths[:1, None],
        start=start,
        stepper=stepper,
        sensors=Sensors.model_construct(**sensors),
        layers=mission.layers,
        loses=True,
    )
    block.parameters = board
    block.hooks = Faults(
        m, board, room.before, mission.layers, room.late, stepper, room.pump, block.built, record
    )
    work = block.work[:, 0]
    work[Row.APPLIED] = c.start_volume if p.positioner != 0.0 else 0.0
    work[Row.DRIFT], work[Row.SWELL] = c.drift, c.swell
    work[Row.SWELL_OMEGA], work[Row.SWELL_PHASE] = c.swell_omega, c.swell_phase
    work[Row.SWELL_DECAY] = c.swell_omega * c.swell_omega / c.gravity
    block.run(chains=room.chains)
    stopped, z, now = int(work[Row.STOPPED]), float(work[Row.Z]), m["now"]
    ended = Result(*m["result"].tolist())
    if now["below"] > 0.0:
        ended = ended._replace(arrived=math.nan)
    return np.array(
        ended._replace(
            stop=0.0 if stopped == OVER else stopped,
            bottom=1.0 if z >= p.z_bottom else 0.0,
            depth=z,
            deepest=now["deepest"],
            resets=now["resets"],
        )
    )
