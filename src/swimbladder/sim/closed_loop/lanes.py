"""The closed loop over a block of vehicles: law, hold, plant, tick after tick, compiled.

A block is a number of lanes that is known to the compiler (one for a single vehicle). All numbers
of a block lie in one array, row by row, lane by lane, small enough for the first-level cache, and
time runs inside. A tick is taken for all lanes at once by their modes' exponentials; the few lanes
in which something happens (an end stop, the surface, the bottom) are taken again by
`engine.advance`, which finds the event.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Measurement
from swimbladder.physics.arrays import Array
from swimbladder.sim.closed_loop.dispatch import extent, gather, law_initial, scatter_where
from swimbladder.sim.closed_loop.lane import (
    N_PLANT,
    Lanes,
    Like,
    Room,
    Row,
    begin,
    commit,
    counted,
    decide,
    judge,
    load_plant,
    lose,
    mode_lane,
    sense,
    set_mode,
    starts,
    state_of,
    step_lane,
)
from swimbladder.sim.closed_loop.pumped import LAW_NOT_FINITE, decide_lanes, move_lanes
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.accounts import decays, enter
from swimbladder.sim.engine.advance import DONE, advance
from swimbladder.sim.engine.cache import compiled, inlined, part, shared, wide
from swimbladder.sim.engine.chain import exponential_step
from swimbladder.sim.engine.modes import first_mode
from swimbladder.sim.engine.sensor import Sensor, measured

OVER = 6  # why a lane stopped, beside engine.advance: by its hooks


class Schedule(NamedTuple):
    """Set-points on the clock of the vehicle."""

    tick: float  # s
    turn: NDArray[np.int64]  # [n + 1], which set-point holds at each tick
    given: NDArray[np.int64]  # the tick of each set-point

    @property
    def ticks(self) -> int:
        """Number of ticks of the run."""
        return len(self.turn) - 1


@shared
def measure_block(lanes: Lanes, noise: Array, k: int) -> None:
    """Write what the sensors give."""
    S, W_ = lanes.S, len(lanes.token)
    for i in range(W_):
        of_depth = Sensor(S[Row.DEPTH_NOISE * W_ + i], S[Row.DEPTH_QUANTUM * W_ + i])
        of_volume = Sensor(S[Row.VOLUME_NOISE * W_ + i], S[Row.VOLUME_QUANTUM * W_ + i])
        S[Row.SEEN_DEPTH * W_ + i] = measured(of_depth, S[Row.Z * W_ + i], noise[k, 0, i])
        volume = S[Row.V * W_ + i] + S[Row.LOST * W_ + i]
        S[Row.SEEN_VOLUME * W_ + i] = measured(of_volume, volume, noise[k, 1, i])


@part
def _set_targets(lanes: Lanes, depths: Array) -> None:
    """Give every lane a set-point, and begin to follow its step response."""
    S, W_ = lanes.S, len(lanes.token)
    for i in range(W_):
        z = S[Row.Z * W_ + i]
        S[Row.REFERENCE * W_ + i] = depths[i]
        S[Row.FROM * W_ + i] = z
        S[Row.PER_SPAN * W_ + i] = 1.0 / (depths[i] - z) if depths[i] != z else np.nan
        S[Row.FURTHEST * W_ + i] = 0.0
        S[Row.RISE90 * W_ + i] = np.inf
        S[Row.OUTSIDE2 * W_ + i] = -1.0
        S[Row.SQUARES * W_ + i] = 0.0


@part
def _tick(lanes: Lanes, law: Like, k: int, since: float, tick: float) -> int:
    """Judge, decide and move every lane by a whole tick; return how many lanes need more.

    Those keep the state they had.
    """
    S, W_, sea = lanes.S, len(lanes.token), lanes.sea
    troubled = 0
    wide()  # type: ignore[call-arg]
    # what is known to the compiler is taken in vectors; a supervisor is not
    for i in range(W_ if len(law.watch) == 0 else counted(lanes)):
        judge(S, W_, i, since)
        u = decide(S, W_, i, (), law, k, tick)
        (q1, v1, z1, w1), ok = step_lane(S, W_, i, u, tick, len(lanes.bend) > 0)
        q, v, z, w = state_of(S, W_, i)
        after = (q1 if ok else q, v1 if ok else v, z1 if ok else z, w1 if ok else w)
        commit(S, W_, i, sea, after)
        S[Row.TROUBLE * W_ + i] = 0.0 if ok else 1.0
        troubled += 0 if ok else 1
    return troubled


@part
def _together(
    token: Any, lanes: Lanes, room: Room, law: Like, k: int, since: float, tick: float
) -> None:
    """Move every lane by a whole tick; not compiled for one: its token is an argument for that."""
    if len(token) > 1 and _tick(lanes, law, k, since, tick) > 0:
        for i in range(counted(lanes)):
            if lanes.S[Row.TROUBLE * len(token) + i] != 0.0:
                _take_slowly(lanes, room, i, k, k * tick, tick)


@part
def _lose(sea: Any, lanes: Lanes, p: Array, t: float, dt: float) -> None:
    """Set what every lane has lost, see `lose`; not compiled where nothing is."""
    if len(sea) > 0:
        for i in range(len(lanes.token)):
            lose(lanes.S, len(lanes.token), i, p, t, dt, lanes.layers)


@part
def _start_laws(lanes: Lanes, like: Any, t: float) -> None:
    S, W_ = lanes.S, len(lanes.token)
    for i in range(W_):
        depth, volume = S[Row.SEEN_DEPTH * W_ + i], S[Row.SEEN_VOLUME * W_ + i]
        seen = Measurement(t, depth, volume, np.nan)
        state = law_initial(gather(like, S, Row.LAW * W_ + i, W_), seen, S[Row.REFERENCE * W_ + i])
        scatter_where(True, state, S, (Row.LAW + extent(like)) * W_ + i, W_)


@compiled
def run_block(
    lanes: Lanes,
    hooks: Any,
    stepper: Any,
    law: Like,
    clock: Schedule,
    span: tuple[int, int],
    noise: Array,
    chains: Array | None,
) -> None:
    """Run a block from the first tick of a span to the last.

    hooks: what stands between the parts, see `lane`. stepper: what moves the lanes, None: their
    modes' exponentials, see `pumped`.
    noise [ticks of this call, 2, lanes] standard normal, or empty.
    chains: see `advance.ModeLane`, of each lane; None with a stepper.
    """
    S, W_, record, live = lanes.S, len(lanes.token), lanes.record, counted(lanes)
    tick, turn, given = clock.tick, clock.turn, clock.given
    first, last = span
    h = tick / lanes.parts
    p, x, y = np.zeros(N_PLANT), np.zeros(5), np.zeros(10)
    kept = np.array([-1, -1])
    decay = np.zeros(5)
    if chains is not None:
        room = Room(p, x, y, chains)
    built, booked = lanes.built, lanes.accounts.shape[1] > 0
    whole = lanes.parts == 1 and record.shape[1] == 0 and not booked and len(hooks) == 0
    for k in range(first, last):
        t = k * tick
        since = (k - given[turn[k]]) * tick
        if k == 0 or turn[k] != turn[k - 1]:
            _set_targets(lanes, lanes.depths[turn[k]])
        if len(lanes.sea) > 0:
            _lose(lanes.sea, lanes, p, t, tick if k > 0 else 0.0)
            kept[0] = -1
        if begin(hooks, S, k, built):
            S[Row.STOPPED] = OVER if S[Row.STOPPED] == 0.0 else S[Row.STOPPED]
            break
        if noise.shape[0] > 0:
            measure_block(lanes, noise, k - first)
        sense(hooks, S, k)
        if starts(hooks, k):
            _start_laws(lanes, law.parameters, t)
        # what tests an argument for None is pruned before types are inferred where it is None
        if stepper is not None:
            decide_lanes(stepper, lanes, hooks, law, k, tick, since)
            if record.shape[1] > 0:
                _record(lanes, law, k)
            if k < turn.shape[0] - 1:
                move_lanes(stepper, lanes, hooks, k, tick, min(last, turn.shape[0] - 1))
            continue
        if chains is None:
            continue
        # one vehicle alone is taken by the parts below
        if W_ > 1 and whole and k < turn.shape[0] - 1:
            _together(lanes.token, lanes, room, law, k, since, tick)
            continue
        for i in range(live):
            judge(S, W_, i, since)
            decide(S, W_, i, hooks, law, k, tick)
        if record.shape[1] > 0:
            _record(lanes, law, k)
        if k == turn.shape[0] - 1:
            break
        for n in range(lanes.parts):
            for i in range(live):
                bent = len(lanes.bend) > 0 and S[(Row.PLANT + modes.EPSILON) * W_ + i] < np.inf
                if not booked:
                    after, ok = step_lane(S, W_, i, S[Row.APPLIED * W_ + i], h, bent)
                    if ok:
                        commit(S, W_, i, lanes.sea, after)
                        continue
                elif _step_with_accounts(lanes, room, i, h, bent, kept, decay):
                    continue
                kept[0] = -1
                _take_slowly(lanes, room, i, k, t + n * h, h)


@inlined
def _step_with_accounts(
    lanes: Lanes, room: Room, i: int, h: float, bent: bool, kept: Any, decay: Array
) -> bool:
    """Take one step of lane i, with its accounts, if nothing happens in it; return whether.

    kept: the lane and the mode whose parameters and transients `decay` are loaded.
    """
    S, W_, p, x, y = lanes.S, len(lanes.token), room.p, room.x, room.y
    mode = int(S[Row.MODE * W_ + i])
    if kept[0] != i or kept[1] != mode:
        load_plant(S, W_, i, p)
        decays(p, mode, h, decay)
        kept[0], kept[1] = i, mode
    if mode // 20 == modes.EMERGING and h * h * p[modes.A_S] > modes.QUICK_BOBBING:
        return False  # the drag's work wants smaller steps
    u = S[Row.APPLIED * W_ + i]
    after, ok = step_lane(S, W_, i, u, h, bent)
    if not ok:
        return False
    x[0], x[1], x[2], x[3] = q, v, z, w = state_of(S, W_, i)
    x[4] = 0.0
    y[0], y[1], y[2], y[3] = after
    if not bent:  # the integral of z, as engine.chain.exponential_step has it
        c = room.chains[i, mode, 0]
        y[4] = c[16] * q + c[17] * v + c[18] * z + c[19] * w + c[24] * u + c[29]
    else:
        exponential_step(room.chains[i, mode], 0, p, lanes.layers, x, u, y)
    enter(p, mode, x, y, u, h, decay, lanes.accounts[i])
    commit(S, W_, i, lanes.sea, after)
    return True


@part
def _take_slowly(lanes: Lanes, room: Room, i: int, k: int, t: float, h: float) -> None:
    """Take one step of lane i by engine.advance, and change its mode if an event did."""
    S, W_, p, x, sea = lanes.S, len(lanes.token), room.p, room.x, lanes.sea
    x[0], x[1], x[2], x[3] = state_of(S, W_, i)
    x[4] = 0.0
    if S[Row.STOPPED * W_ + i] == 0.0:
        load_plant(S, W_, i, p)
        before = int(S[Row.MODE * W_ + i])
        u = S[Row.APPLIED * W_ + i]
        if not abs(u) < 1e30:
            why = LAW_NOT_FINITE
        else:
            if len(sea) > 0 and p[modes.POSITIONER] != 0.0:
                u -= S[Row.LOST * W_ + i]
                if abs(u - x[1]) < 1e-12 * (p[modes.V_MAX] - p[modes.V_MIN]):
                    u = x[1]  # rounding does not set it in motion
            mode, why = advance(mode_lane(lanes, room, i), before, u, h, t)
            if mode != before:
                S[Row.EVENTS * W_ + i] += 1.0
                S[Row.Z * W_ + i] = x[2]
                set_mode(lanes, room, i, mode, h)
        if why != DONE:
            S[Row.STOPPED * W_ + i] = why
            S[Row.STOP_TICK * W_ + i] = k
            S[Row.SLOW * W_ + i] = 1.0
        commit(S, W_, i, sea, (x[0], x[1], x[2], x[3]))


@part
def _record(lanes: Lanes, law: Like, k: int) -> None:
    S, W_, record = lanes.S, len(lanes.token), lanes.record
    reference = Row.LAW + extent(law.parameters) + law.volume_row
    for i in range(counted(lanes)):
        record[0, k, i] = S[Row.Z * W_ + i]
        record[1, k, i] = S[Row.W * W_ + i]
        record[2, k, i] = S[Row.V * W_ + i] + S[Row.LOST * W_ + i]
        record[3, k, i] = S[Row.Q * W_ + i]
        record[4, k, i] = S[Row.COMMAND * W_ + i]
        record[5, k, i] = S[Row.APPLIED * W_ + i]
        if law.volume_row >= 0:
            record[6, k, i] = S[reference * W_ + i]


@compiled
def start_block(lanes: Lanes, chains: Array, h: float) -> None:
    """Set each lane's first mode from its state, its parameters and a base step h [s]."""
    S, W_ = lanes.S, len(lanes.token)
    p, x = np.zeros(N_PLANT), np.zeros(5)
    room = Room(p, x, np.zeros(10), chains)
    for i in range(W_):
        load_plant(S, W_, i, p)
        x[0], x[1], x[2], x[3] = state_of(S, W_, i)
        mode, q = first_mode(p, lanes.layers, x)
        S[Row.Q * W_ + i] = q
        set_mode(lanes, room, i, mode, h)
