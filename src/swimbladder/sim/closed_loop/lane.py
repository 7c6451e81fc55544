"""One lane of a block at a sample: its layout, what `lanes` calls for it, and its hooks.

A block of vehicles is one array, row by row, lane by lane. A hook stands between plant, sensors,
law and driver of the loop, and is chosen by its type. An empty tuple stands for nothing, and
compiles away. Anything else is a named tuple of a class for which `hook_in` names compiled
functions; it stands in a block of one lane. Faults are such hooks, and so are the phases of a
mission: these say as well how far a lane with pump and valve goes before anybody has to decide, so
that its ticks are as far apart as what is due. A supervisor is chosen the same way, by
`lane.Like.watch`, and stands over the law of every lane.

A leak, a drifting trim and the swell make a vehicle heavier than its neutral volume says (`lose`).
That acts as a volume d that is lost: the engine's V and its end stops are those of the vehicle less
d, which moves the hull just so, and leaves the exponentials as they are. d is held over a tick.
"""

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Measurement
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.closed_loop.dispatch import extent, gather, law_step, scatter_where
from swimbladder.sim.engine import modes
from swimbladder.sim.engine.advance import ModeLane, ensure_chain
from swimbladder.sim.engine.cache import chosen_by_first, inlined, part, shared
from swimbladder.sim.engine.chain import ALPHA, BETA
from swimbladder.sim.engine.modes import BOTTOM, V_MAX, V_MIN, drag_at, resting_volume, split


class Row(IntEnum):
    """Rows of a block's array, each of one number per lane."""

    Q = 0  # state: q, V, z, w
    V = 1
    Z = 2
    W = 3
    COMMAND = 4  # as the law gave it
    APPLIED = 5  # as the actuator got it
    WAIT = 6  # ticks until the law wants to be called
    MODE = 7
    SLOW = 8  # 1: this lane's mode has to be taken by engine.advance
    STOPPED = 9  # why the lane stopped, 0: it did not
    STOP_TICK = 10
    LOW_Q = 11  # bounds within which the mode lasts
    HIGH_Q = 12
    LOW_V = 13
    HIGH_V = 14
    LOW_Z = 15
    HIGH_Z = 16
    DEPTH_NOISE = 17
    DEPTH_QUANTUM = 18
    VOLUME_NOISE = 19
    VOLUME_QUANTUM = 20
    FROM = 21  # depth at which the present set-point was given
    LOW_U = 22  # what the actuator takes
    HIGH_U = 23
    SEEN_DEPTH = 24  # the measurement
    SEEN_VOLUME = 25
    # summaries
    Z_LOWEST = 26
    Z_HIGHEST = 27
    V_LOWEST = 28
    V_HIGHEST = 29
    TRAVEL = 30
    FURTHEST = 31  # largest share of the present step that was travelled
    RISE90 = 32  # s after the set-point, inf: not yet
    OUTSIDE2 = 33  # s after the set-point at which the depth was last outside 2 %, -1: never
    SQUARES = 34  # sum of the squared depth error
    EVENTS = 35  # ticks in which something happened
    TROUBLE = 36  # 1: this tick has to be taken by engine.advance
    REFERENCE = 37  # m, the present set-point
    PER_SPAN = 38  # 1/m, one over the present step, nan: no step
    # what makes the vehicle heavier, see `hooks.lose`
    LOST = 39  # m3 that V, its end stops and bounds are counted less by
    WATER = 40  # m3 that leaked in
    LEAK = 41  # m3/s
    DRIFT = 42  # m3/s, of the neutral volume
    SWELL = 43  # m3, amplitude at the surface
    SWELL_OMEGA = 44  # rad/s
    SWELL_PHASE = 45  # rad
    SWELL_DECAY = 46  # 1/m
    WIDE = 47  # 1: seconds below 0 are of the bypass, not of the valve, see `pumped`
    COMPUTED = 48  # m3, volume as a law of seconds computes it
    STEP = 49  # first coefficient of the tick's exponential: 24 + 12 + 6 + 2
    PLANT = 93
    LAW = 120  # parameters, then state


N_STEP = 44
RECORDED = ("depth", "speed", "volume", "motor_rate", "command", "applied", "volume_reference")
N_PLANT = len(Plant._fields)
assert Row.LAW == Row.PLANT + N_PLANT
assert Row.PLANT == Row.STEP + N_STEP


def rows(n_parameters: int, n_state: int) -> int:
    """Return the number of rows of a block's array for a law of so many numbers."""
    return int(Row.LAW) + n_parameters + n_state


@inlined
def _swell(S: Array, W_: int, i: int, t: float) -> Any:
    """Return the volume [m3] whose loss pulls as the swell does at lane i's depth and time t [s].

    A neutral hull moves with the water, and the pressure it sees stays as it is (Airy waves); this
    is what is left of a hull that is long or not neutral. It dies out as exp(-omega^2 z/g).
    """
    fades = math.exp(-S[Row.SWELL_DECAY * W_ + i] * max(S[Row.Z * W_ + i], 0.0))
    angle = S[Row.SWELL_OMEGA * W_ + i] * t + S[Row.SWELL_PHASE * W_ + i]
    return S[Row.SWELL * W_ + i] * fades * math.cos(angle)


@part
def lose(S: Array, W_: int, i: int, p: Any, t: float, dt: float, layers: Any) -> None:
    """Set what is lost in lane i at time t [s], dt [s] after it was set last.

    p: room for the lane's parameters.
    """
    S[Row.WATER * W_ + i] += S[Row.LEAK * W_ + i] * dt
    lost = S[Row.WATER * W_ + i] + S[Row.DRIFT * W_ + i] * t
    if S[Row.SWELL * W_ + i] > 0.0:
        lost += _swell(S, W_, i, t)
    change = lost - S[Row.LOST * W_ + i]
    if change != 0.0:
        S[Row.LOST * W_ + i] = lost
        S[Row.V * W_ + i] -= change
        S[Row.LOW_V * W_ + i] -= change
        S[Row.HIGH_V * W_ + i] -= change
        for own in (V_MIN, V_MAX):
            S[(Row.PLANT + own) * W_ + i] -= change
        if split(int(S[Row.MODE * W_ + i]))[2] == BOTTOM:
            for n in range(N_PLANT):
                p[n] = S[(Row.PLANT + n) * W_ + i]
            S[Row.HIGH_V * W_ + i] = min(p[V_MAX], resting_volume(p, layers, S[Row.Z * W_ + i]))
    S[Row.SEEN_VOLUME * W_ + i] = S[Row.V * W_ + i] + lost


P = ParamSpec("P")
R = TypeVar("R")
_HOOKS: dict[type[Any], dict[str, Callable[..., Any]]] = {}


def hook_in(kind: type[Any], **functions: Callable[..., Any]) -> None:
    """Make the functions of a class of hooks known to the compiler, by the names they have below.

    Each takes its named tuple, and what is written there.
    """
    _HOOKS[kind] = functions


def _chosen(hook: Callable[P, R]) -> Callable[P, R]:
    """Let the class of hooks say what a function does; where it says nothing, as it is written."""

    def own(kind: type[Any]) -> Callable[..., Any]:
        return _HOOKS.get(kind, {}).get(hook.__name__, hook)

    return chosen_by_first(
        lambda hooks: own(type(hooks)), lambda form: own(getattr(form, "instance_class", tuple))
    )


@_chosen
def begin(hooks: Any, S: Any, k: int, built: Any) -> bool:  # noqa: ARG001
    """Begin a tick, before the sensors measure; return whether the run is over."""
    return False


@_chosen
def sense(hooks: Any, S: Any, k: int) -> None:
    """Write what the sensors give."""


@_chosen
def starts(hooks: Any, k: int) -> bool:  # noqa: ARG001
    """Return whether the law begins at this tick, after the sensors have measured."""
    return k == 0


@_chosen
def ask(hooks: Any, S: Any, k: int) -> bool:  # noqa: ARG001
    """Return whether the law is called at this tick."""
    return True


@_chosen
def wanted(hooks: Any, S: Any, k: int, command: float) -> float:  # noqa: ARG001
    """Return what is wanted of the actuator for the law's command, for the supervisor to see."""
    return command


@_chosen
def took_over(watch: Any, i: int) -> bool:  # noqa: ARG001
    """Return whether the supervisor of lane i has taken over, so that the law is left alone."""
    return False


@_chosen
def allowed(watch: Any, i: int, reference: float) -> float:  # noqa: ARG001
    """Return the depth that the law of lane i is asked for, its supervisor allowing."""
    return reference


@_chosen
def supervise(watch: Any, S: Any, W_: int, i: int, k: int, asked: float) -> float:  # noqa: ARG001
    """Return what lane i's supervisor makes of what is wanted at tick k."""
    return asked


@_chosen
def drive(hooks: Any, S: Any, k: int, command: float) -> float:  # noqa: ARG001
    """Return what the driver gives the actuator for a command."""
    return command


@_chosen
def bound(hooks: Any, until: float) -> float:  # noqa: ARG001
    """Return how far a lane with pump and valve goes before the next tick [s]."""
    return until


@_chosen
def set_off(hooks: Any) -> tuple[float, float]:  # noqa: ARG001
    """Return the loads [W] of a step of such a lane, and the depth it is watched for [m]."""
    return 0.0, 0.0


@_chosen
def moved(hooks: Any, event: int, time: float, depth: float) -> None:
    """See what a step of such a lane from a time [s] and depth [m] means, and how it ended."""


@_chosen
def settled(hooks: Any) -> None:
    """See where such a lane is, once its drive has done what it does there."""


_WHOLE = [at for r in range(4) for at in (*range(4 * r, 4 * r + 4), 20 + r, 25 + r)]
_WHOLE += [30 + 5 * k + r for k in range(3) for r in range(4)]
_HALF = [12, 13, 14, 15, 23, 28]
_PLACE = np.array([*_WHOLE, *_HALF, ALPHA, BETA])
"""Where each row from Row.STEP on stands in a chain: of a whole step, and of a half one."""
_LEVEL = np.repeat([0, 1, 0], [len(_WHOLE), len(_HALF), 2])


class Lanes(NamedTuple):
    """A block as its kernel takes it, with what comes out of it; see `block.Block`."""

    S: Array  # rows x lanes, flat
    token: tuple[float, ...]  # as many as lanes: their number, known to the compiler
    live: int  # the first so many lanes count, the others only fill the block up
    bend: tuple[float, ...]  # empty where drag is laminar
    sea: tuple[float, ...]  # empty where nothing is lost, see `hooks.lose`
    layers: Any  # of the water, of all lanes; in layers every lane is taken by engine.advance
    parts: int  # steps of a tick
    depths: Array  # [set-points, lanes]
    record: Array  # [7, n, lanes] or empty
    built: NDArray[np.uint8]  # [lanes, COUNT], and the next ones: as of `advance.ModeLane`
    accounts: Array
    log: Array
    noted: NDArray[np.int64]


class Like(NamedTuple):
    """A law's parameters and state, for their types."""

    parameters: Any
    state: Any
    volume_row: int  # of the volume reference in the state, -1 without
    watch: Any = ()  # the supervisor over it, see `supervision`
    wide_row: int = -1  # of what says in the state of a law of seconds that the bypass is open
    computed_row: int = -1  # of the volume that it computes


class Room(NamedTuple):
    """Room for what engine.advance takes of a lane, as in `advance.ModeLane`."""

    p: Array
    x: Array
    y: Array
    chains: Array  # of each lane


@inlined
def counted(lanes: Lanes) -> int:
    """Return how many lanes count."""
    return lanes.live if len(lanes.token) > 1 else 1


@inlined
def mode_lane(lanes: Lanes, room: Room, i: int) -> ModeLane:
    """Return lane i as engine.advance takes it; for what counts no references, see `cache.part`."""
    chains, built, accounts = room.chains[i], lanes.built[i], lanes.accounts[i]
    log, noted = lanes.log[i], lanes.noted[i]
    return ModeLane(room.p, lanes.layers, room.x, room.y, chains, built, accounts, log, noted)


@inlined
def load_plant(S: Array, W_: int, i: int, p: Array) -> None:
    """Fill p with the parameters of lane i."""
    for n in range(N_PLANT):
        p[n] = S[(Row.PLANT + n) * W_ + i]


@inlined
def state_of(S: Array, W_: int, i: int) -> tuple[float, float, float, float]:
    """Return q, V, z, w of lane i."""
    return S[Row.Q * W_ + i], S[Row.V * W_ + i], S[Row.Z * W_ + i], S[Row.W * W_ + i]


@shared
def set_mode(lanes: Lanes, room: Room, i: int, mode: int, h: float) -> None:
    """Write into lane i what a tick in this mode needs: coefficients, bounds, its speed."""
    S, lane = lanes.S, mode_lane(lanes, room, i)
    p, layers = lane.p, lane.layers
    W_ = len(lanes.token)
    S[Row.MODE * W_ + i] = mode
    act, _, where = split(mode)
    plain = act in (modes.FORWARD, modes.BACKWARD) and layers.table.shape[0] == 0
    plain = plain and p[modes.SAG] == 0.0 and p[modes.POSITIONER] == 0.0
    S[Row.SLOW * W_ + i] = 0.0 if plain else 1.0
    one_way = p[modes.LOAD_DRIVE] != p[modes.LOAD_BACK] or p[modes.FRICTION] != 0.0
    S[Row.LOW_Q * W_ + i] = 0.0 if one_way and act == modes.FORWARD else -np.inf
    S[Row.HIGH_Q * W_ + i] = 0.0 if one_way and act == modes.BACKWARD else np.inf
    S[Row.LOW_V * W_ + i] = p[modes.V_MIN]
    S[Row.HIGH_V * W_ + i] = p[modes.V_MAX]
    S[Row.LOW_Z * W_ + i] = p[modes.Z_SURFACE]
    S[Row.HIGH_Z * W_ + i] = min(p[modes.Z_BOTTOM], 12000.0)
    if where == modes.EMERGING:
        S[Row.LOW_Z * W_ + i] = p[modes.Z_AIR]
        S[Row.HIGH_Z * W_ + i] = min(p[modes.Z_SURFACE], p[modes.Z_BOTTOM])
        bobbing = modes.SLOW_BOBBING if p[modes.EPSILON] == np.inf else modes.QUICK_BOBBING
        if h * h * p[modes.A_S] > bobbing:  # it may bob more than once in a step
            S[Row.SLOW * W_ + i] = 1.0
    elif where == modes.BOTTOM:
        S[Row.LOW_Z * W_ + i] = -np.inf
        S[Row.HIGH_Z * W_ + i] = np.inf
        S[Row.HIGH_V * W_ + i] = min(p[modes.V_MAX], resting_volume(p, layers, S[Row.Z * W_ + i]))
    ensure_chain(lane, mode, h)
    for n in range(N_STEP):
        S[(Row.STEP + n) * W_ + i] = lane.chains[mode, _LEVEL[n], _PLACE[n]]


@inlined
def judge(S: Array, W_: int, i: int, since: float) -> None:
    """Follow the step response of lane i at a sample `since` [s] after the set-point."""
    z = S[Row.Z * W_ + i]
    error = S[Row.REFERENCE * W_ + i] - z
    S[Row.SQUARES * W_ + i] += error * error
    share = (z - S[Row.FROM * W_ + i]) * S[Row.PER_SPAN * W_ + i]
    furthest = S[Row.FURTHEST * W_ + i]
    S[Row.FURTHEST * W_ + i] = share if share > furthest else furthest
    first = (share > 0.9) & (S[Row.RISE90 * W_ + i] == np.inf)
    S[Row.RISE90 * W_ + i] = since if first else S[Row.RISE90 * W_ + i]
    S[Row.OUTSIDE2 * W_ + i] = since if abs(share - 1.0) > 0.02 else S[Row.OUTSIDE2 * W_ + i]


@inlined
def decide(S: Array, W_: int, i: int, hooks: Any, law: Like, k: int, tick: float) -> Any:
    """Call lane i's law at tick k, keep what it says where it is due; return what is applied."""
    kept = S[Row.COMMAND * W_ + i]
    if ask(hooks, S, k):
        row = (Row.LAW + extent(law.parameters)) * W_ + i
        depth, volume = S[Row.SEEN_DEPTH * W_ + i], S[Row.SEEN_VOLUME * W_ + i]
        seen = Measurement(k * tick, depth, volume, np.nan)
        parameters = gather(law.parameters, S, Row.LAW * W_ + i, W_)
        state = gather(law.state, S, row, W_)
        reference = allowed(law.watch, i, S[Row.REFERENCE * W_ + i])
        command, state, next_s = law_step(parameters, state, seen, reference)
        waiting = S[Row.WAIT * W_ + i]
        due = waiting <= 0.0 and not took_over(law.watch, i)
        ticks = np.ceil(next_s * (1.0 / tick) - 1e-9) - 1.0
        S[Row.WAIT * W_ + i] = (ticks if ticks > 0.0 else 0.0) if due else waiting - 1.0
        kept = command if due else kept
        S[Row.COMMAND * W_ + i] = kept
        scatter_where(due, state, S, row, W_)
        if law.computed_row >= 0:
            S[Row.COMPUTED * W_ + i] = S[row + law.computed_row * W_]
    kept = supervise(law.watch, S, W_, i, k, wanted(hooks, S, k, kept))
    u = limited(S, W_, i, drive(hooks, S, k, kept))
    S[Row.APPLIED * W_ + i] = u
    return u


@inlined
def limited(S: Any, W_: int, i: int, command: float) -> float:
    """Return what lane i's driver gives of a command: within its limits, cut by limit switches.

    A switch that is pressed takes the voltage that would drive on; a positioner takes no volume
    beyond, so that its limits are its switches.
    """
    low, high = S[Row.LOW_U * W_ + i], S[Row.HIGH_U * W_ + i]
    if S[(Row.PLANT + modes.POSITIONER) * W_ + i] == 0.0:
        volume = S[Row.V * W_ + i] + S[Row.LOST * W_ + i]
        high = 0.0 if volume >= S[(Row.PLANT + modes.SWITCH_OUT) * W_ + i] else high
        low = 0.0 if volume <= S[(Row.PLANT + modes.SWITCH_IN) * W_ + i] else low
    u = command if command < high else high
    u = low if u < low else u
    return u + (command - command)  # nan where the command is not finite


@inlined
def step_lane(S: Array, W_: int, i: int, u: float, h: float, bent: float) -> Any:
    """Return lane i's state after one step by its mode's exponential, and whether that is all.

    bent: whether the drag may be other than laminar.
    """
    q, v, z, w = before = state_of(S, W_, i)
    c = Row.STEP * W_ + i
    q1 = q + _row(S, W_, c, q, v, z, w, u)
    v1 = v + _row(S, W_, c + 6 * W_, q, v, z, w, u)
    z1 = z + _row(S, W_, c + 12 * W_, q, v, z, w, u)
    w1 = w + _row(S, W_, c + 18 * W_, q, v, z, w, u)
    if bent:
        half = w + _row(S, W_, c + 36 * W_, q, v, z, w, u)
        alpha, beta = S[c + 42 * W_], S[c + 43 * W_]
        N0 = _rest(S, W_, i, w)
        wa = half + alpha * N0
        Na = _rest(S, W_, i, wa)
        wb = half + alpha * Na
        Nb = _rest(S, W_, i, wb)
        wc = w1 + beta * N0 + alpha * (2.0 * Nb - N0)
        Nc = _rest(S, W_, i, wc)
        Nab = Na + Nb
        q1 += S[c + 24 * W_] * N0 + S[c + 28 * W_] * Nab + S[c + 32 * W_] * Nc
        v1 += S[c + 25 * W_] * N0 + S[c + 29 * W_] * Nab + S[c + 33 * W_] * Nc
        z1 += S[c + 26 * W_] * N0 + S[c + 30 * W_] * Nab + S[c + 34 * W_] * Nc
        w1 += S[c + 27 * W_] * N0 + S[c + 31 * W_] * Nab + S[c + 35 * W_] * Nc
    after = (q1, v1, z1, w1)
    ok = within(S, W_, i, before, after, h)
    if bent:  # all on one branch of a switched drag law
        epsilon = S[(Row.PLANT + modes.EPSILON) * W_ + i]
        fast = abs(w) > epsilon
        one = ((abs(wa) > epsilon) == fast) & ((abs(wb) > epsilon) == fast)
        one = one & ((abs(wc) > epsilon) == fast) & ((abs(w1) > epsilon) == fast)
        one = one & ((abs(w) <= epsilon) | (w * w1 >= 0.0))
        ok = ok & ((epsilon <= 0.0) | one)
    return after, ok


@inlined
def within(S: Array, W_: int, i: int, before: Any, after: Any, h: float) -> Any:
    """Return whether the mode of lane i lasted through a step from one state to another."""
    q, v, z, w = before
    q1, v1, z1, w1 = after
    # how far inside a step that turns the state may go beyond its ends
    dz = h * (abs(w) + abs(w1)) if w * w1 < 0.0 else 0.0
    leaks = S[(Row.PLANT + modes.K_L) * W_ + i] > 0.0
    dv = h * (abs(q) + abs(q1)) if (q * q1 < 0.0) | leaks else 0.0
    ok = (q1 >= S[Row.LOW_Q * W_ + i]) & (q1 <= S[Row.HIGH_Q * W_ + i])
    low, high = S[Row.LOW_V * W_ + i], S[Row.HIGH_V * W_ + i]
    ok = ok & (v - dv >= low) & (v1 - dv >= low) & (v + dv <= high) & (v1 + dv <= high)
    low, high = S[Row.LOW_Z * W_ + i], S[Row.HIGH_Z * W_ + i]
    ok = ok & (z1 - dz >= low) & (z1 + dz <= high) & (z - dz >= low) & (z + dz <= high)
    return ok & (S[Row.SLOW * W_ + i] == 0.0)


@inlined
def _row(S: Array, W_: int, c: int, q: float, v: float, z: float, w: float, u: float) -> Any:
    """Return one row of the tick's exponential, less 1, times the state and the input."""
    of_state = S[c] * q + S[c + W_] * v + S[c + 2 * W_] * z + S[c + 3 * W_] * w
    return of_state + S[c + 4 * W_] * u + S[c + 5 * W_]


@inlined
def _rest(S: Array, W_: int, i: int, w: float) -> Any:
    """Return N(w) of lane i, see engine.modes.drag."""
    d_l, d_b = S[(Row.PLANT + modes.D_L) * W_ + i], S[(Row.PLANT + modes.D_B) * W_ + i]
    d_0, d_t = S[(Row.PLANT + modes.D_0) * W_ + i], S[(Row.PLANT + modes.D_T) * W_ + i]
    return drag_at(w, d_l, d_b, d_0, d_t, S[(Row.PLANT + modes.EPSILON) * W_ + i])[2]


@inlined
def commit(S: Array, W_: int, i: int, sea: Any, after: Any) -> None:
    """Make the new state of lane i its state."""
    q1, v1, z1, w1 = after
    lost = S[Row.LOST * W_ + i] if len(sea) > 0 else 0.0
    S[Row.TRAVEL * W_ + i] += abs(v1 - S[Row.V * W_ + i])
    S[Row.Q * W_ + i] = q1
    S[Row.V * W_ + i] = v1
    S[Row.Z * W_ + i] = z1
    S[Row.W * W_ + i] = w1
    S[Row.SEEN_DEPTH * W_ + i] = z1
    v1 += lost
    S[Row.SEEN_VOLUME * W_ + i] = v1
    z_low, z_high = S[Row.Z_LOWEST * W_ + i], S[Row.Z_HIGHEST * W_ + i]
    S[Row.Z_LOWEST * W_ + i] = z1 if z1 < z_low else z_low
    S[Row.Z_HIGHEST * W_ + i] = z1 if z1 > z_high else z_high
    v_low, v_high = S[Row.V_LOWEST * W_ + i], S[Row.V_HIGHEST * W_ + i]
    S[Row.V_LOWEST * W_ + i] = v1 if v1 < v_low else v_low
    S[Row.V_HIGHEST * W_ + i] = v1 if v1 > v_high else v_high
