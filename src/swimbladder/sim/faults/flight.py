"""One mission, tick by tick: the plant of `engine`, the C of the board, and the faults between.

What makes the vehicle heavier (water that leaks in, a drifting trim, the pull of the swell) acts as
a volume d that is lost: the engine's V and its end stops are those of the vehicle less d, which
moves the hull just so, and leaves the exponentials as they are. d is held over a tick.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from swimbladder.io.files import source_hash
from swimbladder.sim.engine.advance import DONE, advance
from swimbladder.sim.engine.cache import compiled, inlined, part
from swimbladder.sim.engine.layers import Layers
from swimbladder.sim.engine.modes import (
    KAPPA,
    MOVING_IN,
    MOVING_OUT,
    POSITIONER,
    PSI,
    RATE,
    SAG,
    SUPPLY,
    V_0,
    V_MAX,
    V_MIN,
    Z_BOTTOM,
    Z_SURFACE,
    first_mode,
)
from swimbladder.sim.faults.call import call_begin, call_tick
from swimbladder.sim.faults.failing import (
    LEAK_LARGE,
    LEAK_SMALL,
    ROOM,
    acted,
    board_misses,
    changes,
    driven,
    emf,
    see_depth,
    see_volume,
    suffer,
)
from swimbladder.sim.faults.rows import CONDITION, RESULT

__all__ = ["EARLY", "FULL", "OWN", "fly"]

# The board decides; or full buoyancy is commanded from `full_after` the last fault acts on, or from
# `full_after` the first does.
OWN, FULL, EARLY = 0, 1, 2
_RAN, _MISSED, _OFF = 0.0, 1.0, 2.0
_NEARLY = 0.01  # of the stroke: a volume so near its largest is all out

(
    END, TICK, START_DEPTH, START_VOLUME, DEPTH_NOISE, DEPTH_QUANTUM, VOLUME_NOISE,
    VOLUME_QUANTUM, BATTERY_NOISE, RAMP, DRIFT, SWELL, SWELL_OMEGA, SWELL_PHASE, GRAVITY,
    LEAK_INPUT, BROWN_OUT, BOOT, BAND, RATED, STAY, QUIET_AT, FULL_AFTER, SEED,
) = CONDITION  # fmt: skip
(
    STOP, LAST, ARRIVED, BEYOND, ON_BOTTOM, DEPTH, DEEPEST, LATCHED, REASON, RELEASED,
    RESETS_, ACTING, UP, FILLED,
) = RESULT  # fmt: skip


@inlined
def _keep(source, target):  # type: ignore[no-untyped-def]
    """Copy a vector into one as long."""
    for n in range(target.shape[0]):
        target[n] = source[n]


@part
def _leaking(harms, k):  # type: ignore[no-untyped-def]
    """Return the water that comes in [m3/s] at tick k."""
    rate = 0.0
    for n in range(harms.shape[0]):
        kind = int(harms[n, 0])
        if kind in (LEAK_SMALL, LEAK_LARGE) and k >= harms[n, 3]:
            rate += harms[n, 1]
    return rate


@part
def _swell(c, z, t):  # type: ignore[no-untyped-def]
    """Return the volume [m3] whose loss pulls as the swell does at depth z [m] and time t [s].

    A neutral hull moves with the water, and the pressure it sees stays as it is (Airy waves); this
    is what is left of a hull that is long or not neutral. It dies out as exp(-omega^2 z/g).
    """
    omega = c[SWELL_OMEGA]
    fades = math.exp(-omega * omega / c[GRAVITY] * max(z, 0.0))
    return c[SWELL] * fades * math.cos(omega * t + c[SWELL_PHASE])


@part
def _filled(base, volume, lifting, z, afloat, before):  # type: ignore[no-untyped-def]
    """Return 1 once a vehicle is heavy with all its volume [m3] out since it was at the surface.

    0: all out, and not heavy; -1: not all out, or not there. lifting [m3]: volume less the water.
    What is filled stays so until it is at the surface again.
    """
    if before > 0.0 and not afloat:
        return before
    if volume < base[V_MAX] - _NEARLY * (base[V_MAX] - base[V_MIN]):
        return -1.0
    if afloat:
        return 0.0
    if before == 0.0 and lifting < base[V_0] + base[PSI] * z:
        return 1.0
    return before


def _fly(  # type: ignore[no-untyped-def]
    base, c, harms, turns, depths, nonlinear, parts, how, begin, tick_, memory, x, p, y, chains,
    built, late, record, result,
):  # fmt: skip
    """Fly one mission; fill result [len(Result)] and, where it has rows, record [n, len(Trace)].

    base [len(Plant)], c [len(Condition)], harms [faults, len(Harm)]. turns [s]: ticks of the
    set-points depths [s] in m. parts: steps of a tick. how: OWN, FULL or EARLY. begin, tick_:
    addresses of the board's functions. memory: of the board. x [5], p [len(Plant)], y [10], chains,
    built, late: room.
    """
    np.random.seed(np.uint32(c[SEED]))  # noqa: NPY002
    tick = c[TICK]
    h = tick / parts
    end = int(c[END])
    _keep(base, p)
    built[:] = 0
    x[:] = 0.0
    x[1], x[2] = c[START_VOLUME], c[START_DEPTH]
    even = Layers(np.empty((0, 2)), 1.0, 0.0, 0.0)  # water without layers
    mode, x[0] = first_mode(p, even, 0.0, x[1], x[2], 0.0, 0.0)
    books, log, count = np.zeros(0), np.zeros((0, 3)), np.zeros(1, np.int64)
    kept = np.zeros(ROOM)
    before = np.zeros_like(memory)
    seen, said = np.zeros(8, np.float32), np.zeros(4, np.float32)
    result[:] = np.nan
    result[STOP], result[ON_BOTTOM], result[REASON], result[RESETS_] = 0.0, 0.0, 0.0, 0.0
    result[FILLED] = -1.0
    positioner = base[POSITIONER] != 0.0
    stroke = base[V_MAX] - base[V_MIN]
    lost, water, shift = 0, 0.0, 0.0
    off_until, hung_until, resets = -1, -1, 0
    must_begin, restarted, begun = True, 0, 0
    u_board, u, turn = 0.0, c[START_VOLUME] if positioner else 0.0, 0
    asked, told = depths[0], False
    deepest, full_at, below, act = c[START_DEPTH], math.inf, 0.0, 0
    for k in range(end + 1):
        t = k * tick
        # what makes the vehicle heavier
        d = water + c[DRIFT] * t
        if c[SWELL] > 0.0:
            d += _swell(c, x[2], t)
        if d != shift:
            change = d - shift
            x[1] -= change
            p[V_MAX] -= change
            p[V_MIN] -= change
            shift = d
        volume = x[1] + shift
        # where it is
        z = x[2]
        deepest = max(deepest, z)
        if z > c[RATED]:
            result[BEYOND] = k
            result[LAST] = k
            break
        quiet = told or k >= c[QUIET_AT] or k > result[LATCHED]
        afloat = z <= base[Z_SURFACE] + c[BAND]
        below = 0.0 if afloat else below + 1.0
        if afloat and quiet and math.isnan(result[UP]):
            result[UP] = k
        result[FILLED] = _filled(base, volume, x[1], z, afloat, result[FILLED])
        if not quiet or below > c[STAY]:  # one that came up fast bobs, and comes back sooner
            result[ARRIVED] = np.nan
        elif afloat and math.isnan(result[ARRIVED]):
            result[ARRIVED] = k
        result[LAST] = k
        if afloat and k - result[ARRIVED] >= c[STAY]:
            break
        # the battery
        if changes(harms, k):
            suffer(base, p, harms, k, volume, shift)
            built[:] = 0
            if mode % 10 == MOVING_OUT:  # a positioner on its way, also one that could not move
                x[0] = p[RATE]
            elif mode % 10 == MOVING_IN:
                x[0] = -p[RATE]
        if act < harms.shape[0]:
            act = acted(base, p, harms, k, tick, x[1], kept)
            if act > 0 and math.isnan(result[ACTING]):
                result[ACTING] = k
                if how == EARLY:
                    full_at = k + c[FULL_AFTER]
            if act == harms.shape[0] and how == FULL:
                full_at = k + c[FULL_AFTER]
        if positioner:
            battery = np.nan
        else:
            p[SUPPLY] = emf(base, harms, k, tick, abs(u) > 0.05 * base[SUPPLY])
            applied = max(-p[SUPPLY], min(p[SUPPLY], u))
            drawn = (applied - p[KAPPA] * x[0]) * (1.0 if applied >= 0.0 else -1.0)
            battery = p[SUPPLY] - max(p[SAG] * drawn, 0.0) / (1.0 + p[SAG])
        # the sensors
        noise, other = np.random.normal(), np.random.normal()  # noqa: NPY002
        depth, age = see_depth(
            harms, k, tick, z + c[DEPTH_NOISE] * noise, c[DEPTH_QUANTUM], kept, late
        )
        volume_seen = see_volume(
            harms, k, tick, volume + c[VOLUME_NOISE] * other, c[VOLUME_QUANTUM],
            stroke, kept,
        )  # fmt: skip
        # the board
        while turn + 1 < turns.shape[0] and turns[turn + 1] <= k - begun:
            turn += 1
        asked += max(-c[RAMP], min(c[RAMP], depths[turn] - asked))
        missed, reset, hangs = board_misses(harms, k, tick)
        if k >= full_at:
            hangs, hung_until = 0, -1  # what misses ticks or is reset does so here as well
        board = _RAN
        if k == hung_until or reset or (battery < c[BROWN_OUT]):
            if k > 0:
                off_until = k + int(c[BOOT])
            hung_until = -1
        if k < off_until:
            board = _OFF
            if not must_begin:
                resets += 1
            must_begin, restarted = True, 1
            begun, turn = k + 1, 0  # its clock begins anew, and what it is to do with it
            lost = 0
            u_board = volume if positioner else 0.0
        elif k < hung_until:
            board = _MISSED
        elif missed:
            board = _MISSED
            lost += 1
        elif k >= full_at:
            u_board, told = base[V_MAX] if positioner else base[SUPPLY], True
        else:
            if must_begin:
                if not restarted:
                    memory[:] = 0  # a reset leaves it as it is
                call_begin(begin, memory.ctypes.data, np.int32(restarted))  # type: ignore[call-arg]
                must_begin = False
            seen[0], seen[1], seen[2] = depth, age, volume_seen
            seen[3] = battery * (1.0 + c[BATTERY_NOISE] * noise)
            seen[4] = 1.0 if water > c[LEAK_INPUT] else 0.0
            seen[5], seen[6] = lost, asked
            _keep(memory, before)
            command = call_tick(  # type: ignore[call-arg,var-annotated]
                tick_, memory.ctypes.data, seen.ctypes.data, said.ctypes.data
            )
            if hangs > 0 and said[2] != 0.0:  # it would not have come back from its law
                _keep(before, memory)
                hung_until = k + hangs
                board = _MISSED
            else:
                u_board = float(command)
                lost = 0
                if said[0] != 0.0 and math.isnan(result[LATCHED]):
                    result[LATCHED], result[REASON] = k, said[0]
                if said[1] != 0.0 and math.isnan(result[RELEASED]):
                    result[RELEASED] = k
        # the actuator
        u = driven(base, p, harms, k, tick, u_board, u, volume, kept)
        if positioner:
            u = max(base[V_MIN], min(base[V_MAX], u))
            goal = u - shift
            if abs(goal - x[1]) < 1e-12 * stroke:
                goal = x[1]
        else:
            u = max(-p[SUPPLY], min(p[SUPPLY], u))
            goal = u
        if record.shape[0] > k:
            row = record[k]
            row[0], row[1], row[2], row[3], row[4] = z, x[3], volume, u_board, u
            row[5], row[6], row[7], row[8], row[9] = battery, asked, depth, age, volume_seen
            row[10], row[11], row[12] = 1.0 if water > c[LEAK_INPUT] else 0.0, lost, board
            row[13], row[14] = result[REASON], water
        if k == end:
            break
        why = DONE
        for n in range(parts):
            if why == DONE:
                mode, why = advance(
                    p, even, nonlinear, mode, x, y, goal, h, t + n * h, chains, built, books, log,
                    count,
                )  # fmt: skip
        if why != DONE:
            result[STOP] = why
            break
        water += _leaking(harms, k) * tick
    if below > 0.0:
        result[ARRIVED] = np.nan
    result[DEPTH], result[DEEPEST], result[RESETS_] = x[2], deepest, resets
    if x[2] >= base[Z_BOTTOM]:
        result[ON_BOTTOM] = 1.0


fly = compiled(_fly, under=f"faults-{source_hash(Path(__file__).parent.glob('*.py'))}")
