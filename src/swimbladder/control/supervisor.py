"""The supervisor: watches a vehicle under any law and, once it has a reason, brings it up for good.

`step` has the form of a law's, so that it is translated as laws are. In place of a depth asked for
it takes the law's command, and gives it on until it has a reason; from then on it gives the command
that makes the vehicle lightest, by its own count of ticks: no sensor is asked, since any may lie.
What each detector does and why: docs/explanation/supervisor.md.

Counters are whole numbers in floats, exact up to 2^24. Time is counted in two of them.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from swimbladder.control.law import Law
from swimbladder.control.supervisor_records import (
    SUPERVISOR_UNITS,
    SupervisorParameters,
    SupervisorState,
    Watched,
)

__all__ = ["SUPERVISOR", "Reason", "initial", "reasons_in", "step"]

_BLOCK = 4096.0  # ticks that the fine count of time holds
_LONG_AGO = 1.0e6  # ticks
_COUNT = 15
_HIGHEST = 16384.0  # bit of the last reason


class Reason(IntEnum):
    """Why the supervisor took over; of several at one tick the first of this list is the cause."""

    RESTARTED = 1
    LEAK = 2
    DEPTH_LIMIT = 3
    DEPTH_MISSING = 4
    DEPTH_IMPOSSIBLE = 5
    DEPTH_LATE = 6
    DEPTH_FROZEN = 7
    VOLUME_MISSING = 8
    VOLUME_IMPOSSIBLE = 9
    NOT_FOLLOWING = 10
    NOT_MOVING_AS_MODELLED = 11
    BATTERY_LOW = 12
    NO_COMMAND = 13
    TICKS_LOST = 14
    TIME_LIMIT = 15

    @property
    def words(self) -> str:
        """What the sketch logs."""
        return self.name.lower().replace("_", " ")


def reasons_in(bits: float) -> tuple[Reason, ...]:
    """Return the reasons whose bits are set: bit n - 1 of reason n."""
    return tuple(reason for reason in Reason if int(bits) >> (reason - 1) & 1)


class _Depth(NamedTuple):
    """What is known of the depth after a tick."""

    good: bool
    depth: float  # m, of now or the last good one
    since: float  # ticks since the good one before
    blind: float  # ticks


class _Rate(NamedTuple):
    """How the volume follows its commands."""

    lag: float  # m3/s
    asked: float  # m3/s
    ticks: float  # in which it did not


class _Motion(NamedTuple):
    """Two low passes of the depth and of the volume beyond psi z, and what they say."""

    z1: float  # m
    z2: float  # m
    n1: float  # m3
    n2: float  # m3
    settled: float  # ticks
    anchor: float  # m
    still: float  # ticks
    resting: bool  # afloat, or on the bottom
    wrong: float  # ticks


def tally(bad: bool, n: float, most: float) -> float:
    """Return the count of bad ticks; a good one takes two away, `most` stays for good."""
    if n >= most:
        return n
    if bad:
        return n + 1.0
    return max(n - 2.0, 0.0)


def watch_depth(p: SupervisorParameters, s: SupervisorState, seen: Watched, lost: float) -> _Depth:
    """Tell a depth that can be from one that is missing, impossible or late."""
    since = min(s.since + 1.0 + lost, _LONG_AGO)
    late = seen.depth_age > p.late_age
    possible = p.depth_least <= seen.depth <= p.depth_most
    good = possible and abs(seen.depth - s.depth) <= p.fastest * since + p.jump and not late
    blind = tally(not good, s.blind, p.blind)
    if blind >= p.blind and s.blind < p.blind:
        if late:
            blind = blind + 2.0
        elif math.isfinite(seen.depth):
            blind = blind + 1.0
    return _Depth(good, seen.depth if good else s.depth, since, blind)


def expected_rate(p: SupervisorParameters, s: SupervisorState) -> float:
    """Return the volume rate [m3/s] that the last command should give at the last depth."""
    if p.positioner > 0.0:
        return min(max((s.command - s.volume) / p.S_p, -p.rate), p.rate)
    forward = s.command - p.load_drive * s.depth - p.friction
    backward = s.command - p.load_back * s.depth + p.friction
    push = 0.0
    if forward > 0.0:
        push = forward
    elif backward < 0.0:
        push = backward
    return p.rate * push - p.leakage * s.depth


def watch_rate(p: SupervisorParameters, s: SupervisorState, volume: float) -> _Rate:
    """Compare the volume's rate with what the command should give, both smoothed alike."""
    rate = (volume - s.volume) / p.S_p
    asked = expected_rate(p, s)
    if (asked > 0.0 and volume > p.volume_high) or (asked < 0.0 and volume < p.volume_low):
        asked = rate  # at its end, or nearly: it may stop
    lag = s.lag + p.rate_smoothing * (asked - rate - s.lag)
    asked = s.asked + p.rate_smoothing * (asked - s.asked)
    wrong = abs(lag) > p.rate_share * abs(asked) + p.rate_least
    return _Rate(lag, asked, tally(wrong, s.following, p.following))


def watch_motion(
    p: SupervisorParameters, s: SupervisorState, depth: float, volume: float, gap: bool
) -> _Motion:
    """Ask which neutral volume the motion means, eq. (13), and whether the vehicle can have it."""
    n = volume - p.psi * depth
    room = p.neutral_range + p.psi_range * abs(depth)
    anchor = s.anchor
    still = s.still + 1.0
    if abs(depth - anchor) > p.still_distance:
        anchor = depth
        still = 0.0
    stays = still >= p.still
    resting = (depth <= p.surface and n >= p.neutral - room) or (
        depth >= p.aground and n <= p.neutral + room
    )
    if resting or gap:
        wrong = tally(s.wrong < 0.0, s.wrong, p.wrong)
        return _Motion(depth, depth, n, n, 0.0, anchor, still, resting, wrong)
    z1 = s.z1 + p.smoothing * (depth - s.z1)
    z2 = s.z2 + p.smoothing * (z1 - s.z2)
    n1 = s.n1 + p.smoothing * (n - s.n1)
    n2 = s.n2 + p.smoothing * (n1 - s.n2)
    speed = (z1 - z2) / p.tau
    drag = p.d_l * speed
    if abs(speed) > p.epsilon:
        drag = p.d_b * speed + math.copysign(p.d_0 + p.d_t * speed * speed, speed)
    push = (((depth - z1) / p.tau - speed) / p.tau + drag) / p.a_b
    off = n2 + push - p.neutral
    bad = stays and abs(n - p.neutral) > room
    room = room + p.model_error * abs(push)
    settled = s.settled + 1.0
    bad = bad or (settled >= p.settle and abs(off) > room)
    wrong = tally(bad, s.wrong, p.wrong)
    return _Motion(z1, z2, n1, n2, settled, anchor, still, resting, wrong)


def watch_sameness(
    p: SupervisorParameters, s: SupervisorState, seen: Watched, depth: float
) -> float:
    """Return for how many ticks the depth was the very same; a sample that is not new says none."""
    if seen.depth_age >= p.S_p:
        return s.same
    if depth != s.depth:
        return 0.0
    return s.same + 1.0


def watch_deep(
    p: SupervisorParameters, s: SupervisorState, depth: float, speed: float, volume: float
) -> float:
    """Return the ticks in which the vehicle was too deep, or was to be before it can turn round."""
    turn = max(p.neutral_deepest - volume, 0.0) / p.turn_rate + p.coast
    ahead = depth + max(speed, 0.0) * turn
    return tally(depth > p.depth_limit or ahead > p.deepest, s.deep, p.deep)


def first_of(bits: float) -> float:
    """Return the number of the lowest bit, 1 for that of 1; 0 where there is none."""
    number = 0.0
    rest = bits
    bit = _HIGHEST
    for i in range(_COUNT):
        if rest >= bit:
            rest = rest - bit
            number = _COUNT - i
        bit = bit * 0.5
    return number


def depth_bits(p: SupervisorParameters, blind: float, frozen: float, deep: float) -> float:
    """Return the bits of the reasons that the depth gives."""
    bits = 0.0
    if deep >= p.deep:
        bits = bits + 4.0
    if blind >= p.blind:
        kind = blind - p.blind
        bits = bits + (8.0 if kind == 0.0 else (16.0 if kind == 1.0 else 32.0))
    if frozen > 0.0:
        bits = bits + 64.0
    return bits


def volume_bits(p: SupervisorParameters, blind: float, following: float, wrong: float) -> float:
    """Return the bits of the reasons that the volume gives."""
    bits = 0.0
    if blind >= p.blind:
        bits = bits + (128.0 if blind == p.blind else 256.0)
    if following >= p.following:
        bits = bits + 512.0
    if wrong >= p.wrong:
        bits = bits + 1024.0
    return bits


def initial(parameters: SupervisorParameters, seen: Watched, restarted: float) -> SupervisorState:
    """Return the state at the start; restarted: 1 after a watchdog's reset or a brown-out."""
    return SupervisorState(
        restarted=restarted, tick=0.0, block=0.0, lost=0.0, since=_LONG_AGO, depth=0.0, blind=0.0,
        same=0.0, same_volume=0.0, frozen=0.0, volume=0.0, measured=0.0, volume_blind=0.0,
        command=0.0, lag=0.0, asked=0.0, following=0.0, z1=0.0, z2=0.0, n1=0.0, n2=0.0,
        settled=0.0, anchor=0.0, still=0.0,  wrong=0.0, deep=0.0, battery=0.0, leak=0.0,
        missed=0.0, reason=0.0, reasons=0.0, phase=0.0, window=0.0, from_depth=0.0, release=0.0,
    )  # fmt: skip


def step(
    parameters: SupervisorParameters, state: SupervisorState, seen: Watched, wanted: float
) -> tuple[float, SupervisorState, float]:
    """Return the command [V or m3]: `wanted`, the law's, or full buoyancy for a reason."""
    p = parameters
    s = state
    lost = 0.0
    if seen.lost > 0.0:
        lost = min(seen.lost, _BLOCK - 1.0)
    tick = s.tick + lost
    block = s.block
    if tick >= _BLOCK:
        tick = tick - _BLOCK
        block = block + 1.0
    overtime = block > p.time_blocks or (block == p.time_blocks and tick >= p.time_ticks)
    ticks_lost = s.lost
    if ticks_lost < p.lost:
        ticks_lost = max(ticks_lost - 0.25, 0.0) if lost == 0.0 else ticks_lost + lost

    now = watch_depth(p, s, seen, lost)
    measured = p.volume_least <= seen.volume <= p.volume_most
    volume = seen.volume if measured else s.volume
    volume_blind = tally(not measured, s.volume_blind, p.blind)
    if volume_blind >= p.blind and s.volume_blind < p.blind and math.isfinite(seen.volume):
        volume_blind = volume_blind + 1.0

    rate = _Rate(s.lag, s.asked, s.following)
    if measured and s.measured > 0.0 and lost == 0.0:
        rate = watch_rate(p, s, volume)
    motion = _Motion(
        s.z1,
        s.z2,
        s.n1,
        s.n2,
        s.settled,
        s.anchor,
        s.still,
        now.good and measured,
        s.wrong,
    )
    speed = 0.0
    if now.good and measured:
        gap = now.since > p.gap or s.volume_blind > p.gap
        motion = watch_motion(p, s, now.depth, volume, gap)
        speed = (now.depth - motion.z1) / p.tau

    same = s.same
    same_volume = s.same_volume
    frozen = s.frozen
    deep = s.deep
    if now.good:
        same = watch_sameness(p, s, seen, now.depth)
        deep = watch_deep(p, s, now.depth, speed, volume)
        if same <= p.same_begun:
            same_volume = motion.n1
        if same >= p.same:
            frozen = 1.0
        moved = abs(motion.n1 - same_volume) > p.moved and not motion.resting
        if same >= p.same_moved and moved:
            frozen = 1.0
    battery = tally(seen.battery < p.battery_low, s.battery, p.battery)
    leak = tally(seen.leak > 0.0, s.leak, p.leak)
    missed = s.missed
    if missed < p.missed:
        missed = min(seen.missed, p.missed) if seen.missed > 0.0 else 0.0

    bits = s.restarted
    if leak >= p.leak:
        bits = bits + 2.0
    bits = bits + depth_bits(p, now.blind, frozen, deep)
    bits = bits + volume_bits(p, volume_blind, rate.ticks, motion.wrong)
    if battery >= p.battery:
        bits = bits + 2048.0
    if missed >= p.missed:
        bits = bits + 4096.0
    if ticks_lost >= p.lost:
        bits = bits + 8192.0
    if overtime:
        bits = bits + 16384.0

    reason = s.reason
    phase = s.phase
    window = s.window
    from_depth = s.from_depth
    release = s.release
    command = wanted
    if bits > 0.0:
        if reason == 0.0:
            reason = first_of(bits)
            from_depth = now.depth
        command = p.surface_command if phase < p.push else p.hold_command
        phase = phase + 1.0
        if phase >= p.push + p.rest:
            phase = p.push - p.again
        window = window + 1.0
        if window >= p.release:
            risen = now.good and (now.depth <= p.surface or now.depth <= from_depth - p.rise)
            if not risen:
                release = 1.0
            window = 0.0
            from_depth = now.depth
    return command, SupervisorState(
        restarted=s.restarted, tick=tick + 1.0, block=block, lost=ticks_lost,
        since=0.0 if now.good else now.since, depth=now.depth, blind=now.blind,
        same=same, same_volume=same_volume, frozen=frozen,
        volume=volume, measured=1.0 if measured else 0.0, volume_blind=volume_blind,
        command=command, lag=rate.lag, asked=rate.asked, following=rate.ticks,
        z1=motion.z1, z2=motion.z2, n1=motion.n1, n2=motion.n2, settled=motion.settled,
        anchor=motion.anchor, still=motion.still, wrong=motion.wrong,
        deep=deep, battery=battery, leak=leak, missed=missed, reason=reason, reasons=bits,
        phase=phase, window=window, from_depth=from_depth, release=release,
    ), p.S_p  # fmt: skip


SUPERVISOR = Law(
    name="supervisor",
    summary="gives a law's command on until there is a reason to bring the vehicle up",
    command="voltage",
    parameters=SupervisorParameters,
    state=SupervisorState,
    units=SUPERVISOR_UNITS,
    step=step,
    initial=initial,
)
