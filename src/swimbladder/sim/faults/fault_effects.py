"""What faults do to sensors, plant, battery and driver: the compiled parts of a flight.

Each takes the faults of a mission, `fault_rows` [faults, len(FaultRow)], and the tick k. Random
numbers come from the generator that compiled code has in each thread; a flight seeds it.
"""

from __future__ import annotations

import math

import numpy as np

from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.modes import (
    GAIN,
    KAPPA,
    LOAD_BACK,
    LOAD_DRIVE,
    POSITIONER,
    RATE,
    SAG,
    SUPPLY,
    SWITCH_IN,
    SWITCH_OUT,
    V_MAX,
    V_MIN,
)
from swimbladder.sim.engine.sensor import quantised
from swimbladder.sim.faults.kinds import Fault

_KIND, _FIRST, _SECOND, _BEGIN, _END = range(5)
MOST = 4  # faults of a mission
_HELD, _HELD_AT, _VOLUME, _LOOSE, _STUCK, _BLOCKED = range(6)
_ACTED = _BLOCKED + MOST  # from these two on a number for each fault
ROOM = _ACTED + MOST  # numbers that are kept from tick to tick
_HELD_BACK = 1.0  # s on end, that a block stops the actuator before it counts as acting

(
    DEPTH_NAN, DEPTH_DROPOUTS, DEPTH_STUCK, DEPTH_RANGE, DEPTH_LATE, DEPTH_OLD, DEPTH_JUMP,
    DEPTH_DRIFT, DEPTH_SCALE, DEPTH_NOISE, VOLUME_NAN, VOLUME_STUCK, VOLUME_DRIFT, STALLED, SLOW,
    WEAK, REVERSED, BLOCKED_OUT, BLOCKED_IN, RUNS_ON, BATTERY_DECLINE, BATTERY_SAG, BATTERY_DROP,
    BATTERY_CELL, BATTERY_DEAD, TICKS_LOST, PAUSE, RESETS, HANG, LEAK_SMALL, LEAK_LARGE,
    SWITCH_OPEN, SWITCH_CLOSED,
) = (int(fault) for fault in Fault)  # fmt: skip


@part
def _on(fault_row, k):  # type: ignore[no-untyped-def]
    return fault_row[_BEGIN] <= k < fault_row[_END]


@part
def see_depth(fault_rows, k, tick, depth, quantum, kept, late):  # type: ignore[no-untyped-def]
    """Return (depth [m], its age [s]) as the driver gives them, of what the sensor measured.

    kept [ROOM], late [n]: what was seen before; late[k % n] is written.
    """
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if not _on(fault_row, k):
            continue
        kind = int(fault_row[_KIND])
        if kind == DEPTH_JUMP:
            depth += fault_row[_FIRST]
        elif kind == DEPTH_DRIFT:
            depth += fault_row[_FIRST] * tick * (k - fault_row[_BEGIN])
        elif kind == DEPTH_SCALE:
            depth *= 1.0 + fault_row[_FIRST]
        elif kind == DEPTH_NOISE:
            depth += fault_row[_FIRST] * np.random.normal()  # noqa: NPY002
    depth = quantised(depth, quantum)
    late[k % late.shape[0]] = depth
    age = 0.0
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if not _on(fault_row, k):
            continue
        kind = int(fault_row[_KIND])
        if kind == DEPTH_STUCK:
            if k == fault_row[_BEGIN]:
                kept[_STUCK] = depth
            depth = kept[_STUCK]
        elif kind == DEPTH_RANGE:
            depth = fault_row[_FIRST]
        elif kind == DEPTH_LATE:
            behind = min(int(fault_row[_FIRST] / tick), late.shape[0] - 1, k)
            depth = late[(k - behind) % late.shape[0]]
            if fault_row[_SECOND] > 0.5:
                age = behind * tick
        elif kind == DEPTH_OLD:
            if k == fault_row[_BEGIN] or (k - kept[_HELD_AT]) * tick >= fault_row[_FIRST]:
                kept[_HELD], kept[_HELD_AT] = depth, k
            depth = kept[_HELD]
            age = (k - kept[_HELD_AT]) * tick
        elif kind == DEPTH_NAN:  # noqa: SIM114
            depth = math.nan
        elif kind == DEPTH_DROPOUTS and np.random.random() < fault_row[_FIRST]:  # noqa: NPY002
            depth = math.nan
    return depth, age


@part
def see_volume(fault_rows, k, tick, volume, quantum, stroke, kept):  # type: ignore[no-untyped-def]
    """Return the volume [m3] as the driver gives it; stroke: from end to end [m3]."""
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if _on(fault_row, k) and int(fault_row[_KIND]) == VOLUME_DRIFT:
            volume += fault_row[_FIRST] * stroke * tick * (k - fault_row[_BEGIN])
    volume = quantised(volume, quantum)
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if not _on(fault_row, k):
            continue
        kind = int(fault_row[_KIND])
        if kind == VOLUME_STUCK:
            if k == fault_row[_BEGIN]:
                kept[_VOLUME] = volume
            volume = kept[_VOLUME]
        elif kind == VOLUME_NAN:
            volume = math.nan
    return volume


@part
def changes(fault_rows, k):  # type: ignore[no-untyped-def]
    """Return whether a fault begins or ends at this tick."""
    for n in range(fault_rows.shape[0]):
        if fault_rows[n, _BEGIN] == k or fault_rows[n, _END] == k:
            return True
    return False


@part
def acted(base, p, fault_rows, k, tick, engine_volume, kept):  # type: ignore[no-untyped-def]
    """Return how many faults have acted by tick k: a block once it has stopped the actuator.

    Noise alone makes a piston touch a block, for a tick, that it is not held back by.

    engine_volume [m3]: the volume as the limits in p count it, see `flight`.
    """
    narrow = p[V_MAX] - p[V_MIN] < (1.0 - 1e-9) * (base[V_MAX] - base[V_MIN])
    count = 0
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if _on(fault_row, k) and kept[_ACTED + n] == 0.0:
            kind = int(fault_row[_KIND])
            if kind == BLOCKED_OUT:
                acts = narrow and engine_volume >= p[V_MAX]
            elif kind == BLOCKED_IN:
                acts = narrow and engine_volume <= p[V_MIN]
            else:
                acts = True
            kept[_BLOCKED + n] = kept[_BLOCKED + n] + 1.0 if acts else 0.0
            long = kept[_BLOCKED + n] * tick >= _HELD_BACK
            if long or (acts and kind != BLOCKED_OUT and kind != BLOCKED_IN):
                kept[_ACTED + n] = 1.0
        if kept[_ACTED + n] == 1.0:
            count += 1
    return count


@part
def apply_faults(base, p, fault_rows, k, volume, shift):  # type: ignore[no-untyped-def]
    """Set what faults change in the plant p of the healthy one `base`, where one begins or ends.

    volume [m3]: where the actuator is. shift [m3]: what volumes are counted less by, see `flight`.
    """
    p[GAIN], p[RATE] = base[GAIN], base[RATE]
    p[LOAD_DRIVE], p[LOAD_BACK] = base[LOAD_DRIVE], base[LOAD_BACK]
    p[SAG], p[KAPPA] = base[SAG], base[KAPPA]
    p[SWITCH_IN], p[SWITCH_OUT] = base[SWITCH_IN], base[SWITCH_OUT]
    stroke = base[V_MAX] - base[V_MIN]
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if not _on(fault_row, k):
            continue
        kind = int(fault_row[_KIND])
        if kind >= SWITCH_OPEN:  # or closed
            sign = 1.0 if kind == SWITCH_OPEN else -1.0
            if fault_row[_FIRST] < 0.5:
                p[SWITCH_IN] = sign * math.inf
            else:
                p[SWITCH_OUT] = -sign * math.inf
        elif kind == STALLED:
            p[GAIN], p[RATE] = 0.0, 0.0
        elif kind == SLOW:
            p[GAIN] *= fault_row[_FIRST]
            p[RATE] *= fault_row[_FIRST]
        elif kind == WEAK:
            p[LOAD_DRIVE] *= fault_row[_FIRST]
            p[LOAD_BACK] *= fault_row[_FIRST]
        elif kind == BATTERY_SAG:
            p[SAG] = max(p[SAG], fault_row[_FIRST])
            if p[KAPPA] <= 0.0:  # not known: all that is lost with speed is taken for it
                p[KAPPA] = 1.0 / base[GAIN]
        elif kind == BLOCKED_OUT and fault_row[_BEGIN] == k:
            p[V_MAX] = min(p[V_MAX], volume + fault_row[_FIRST] * stroke - shift)
        elif kind == BLOCKED_IN and fault_row[_BEGIN] == k:
            p[V_MIN] = max(p[V_MIN], volume - fault_row[_FIRST] * stroke - shift)


@part
def emf(base, fault_rows, k, tick, driving):  # type: ignore[no-untyped-def]
    """Return the battery's open-circuit voltage [V]; driving: whether the motor has a voltage."""
    share = 1.0
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if not _on(fault_row, k):
            continue
        kind = int(fault_row[_KIND])
        since = (k - fault_row[_BEGIN]) * tick
        if kind == BATTERY_DECLINE:
            share *= max(0.0, 1.0 - fault_row[_FIRST] * since)
        elif kind == BATTERY_DEAD:
            share *= max(0.0, 1.0 - since / fault_row[_FIRST])
        elif kind == BATTERY_DROP or (kind == BATTERY_CELL and driving):
            share *= 1.0 - fault_row[_FIRST]
    return base[SUPPLY] * share


@part
def driven(base, p, fault_rows, k, tick, u, before, volume, kept):  # type: ignore[no-untyped-def]
    """Return what the actuator gets where the board commands u [V, or m3 from mid-stroke].

    before: what it got a tick ago; volume [m3]: where it is, from mid-stroke.
    """
    positioner = base[POSITIONER] != 0.0
    way = before - (volume if positioner else 0.0)
    if way != 0.0:
        kept[_LOOSE] = math.copysign(1.0, way)
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if not _on(fault_row, k):
            continue
        kind = int(fault_row[_KIND])
        if kind == REVERSED:
            u = -u
        elif kind == RUNS_ON and (k - fault_row[_BEGIN]) * tick < fault_row[_FIRST]:
            if positioner:
                u = base[V_MAX] if kept[_LOOSE] > 0.0 else base[V_MIN]
            else:
                u = math.copysign(p[SUPPLY], kept[_LOOSE])
    return u


@part
def board_misses(fault_rows, k, tick):  # type: ignore[no-untyped-def]
    """Return (whether this tick is lost, whether the board is reset, ticks a law hangs for)."""
    lost, reset, hangs = False, False, 0
    for n in range(fault_rows.shape[0]):
        fault_row = fault_rows[n]
        if not _on(fault_row, k):
            continue
        kind = int(fault_row[_KIND])
        since = k - fault_row[_BEGIN]
        if kind == TICKS_LOST:
            lost = lost or np.random.random() < fault_row[_FIRST]  # noqa: NPY002
        elif kind == PAUSE:
            lost = (
                lost
                or (since * tick) % (fault_row[_FIRST] + fault_row[_SECOND]) < fault_row[_FIRST]
            )
        elif kind == RESETS:
            reset = reset or since % max(1.0, math.floor(fault_row[_FIRST] / tick)) == 0.0
        elif kind == HANG:
            hangs = max(hangs, math.ceil(fault_row[_FIRST] / tick))
    return lost, reset, hangs
