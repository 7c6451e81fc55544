"""A target that goes to a new reference smoothly, within a speed and a jerk.

Why the jerk: the motor's rate limits how fast the volume, and with it the acceleration, changes.
From rest over a distance d the fastest way within a jerk j is +j for a quarter of the time T, -j
for two and +j for the last, T^3 = 32 d/j; its largest speed is 2 d/T. The last quarter is also the
polynomial of fifth order that is at rest at the reference when the time is over (of all such
motions the one of least squared jerk: Flash and Hogan, J. Neuroscience 5, 1985, 1688). That
polynomial is solved anew at each sample from where the target is, so that it lands whatever
rounding has left, and it is the way for a target that is not at rest when the reference changes;
from rest its largest jerk would be 60 d/T^3. The time left ends at a shortest one, so that the last
of the way, and every small change, is a linear filter with the poles of
s^3 + 9 s^2/T + 36 s/T^2 + 60/T^3.

What the motor can do is learnt while it is driven hard. A path is planned with a share of the
motor's rate. Where the motor has less than that, because the battery is lower than was assumed,
or of ice or wear, a path at the old rate is not followed: volume and depth come late, more
and more, and large steps may swing without end, as rate limits let them (Stein, IEEE Control
Systems Magazine 23(4), 2003, 12). So the rate is watched where the voltage is high and steady,
paths are planned with what was seen, and one that the vehicle cannot follow begins anew where it
is.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

BEHIND = 5.0  # samples at full rate, that the volume may be behind before a path begins anew
_TRUST = 0.3  # in a sample that shows what the motor has
_SPARE = 1.1  # a motor with 1/1.1 of its rate follows paths as they are
_LEAST = 0.1  # share of its rate that is always assumed
_OTHERS = 0.25  # share of its rate the other way, from which on it was not the motor alone


def estimate_effectiveness(
    effectiveness: float, drive: float, driven: float, moved: float, limit: float
) -> float:
    """Return the share of its rate that the motor was seen to have [-].

    drive and driven [V]: voltage beyond the load of the sea at the sample before and at the one
    before that; moved [V]: what the volume moved since, as the voltage that moves it so; limit [V].
    """
    if abs(drive) < 0.5 * limit or drive * driven < 0.25 * limit * limit:
        return effectiveness
    return effectiveness + _TRUST * (min(max(moved / drive, _LEAST), 1.0) - effectiveness)


def own_drive(drive: float, moved: float) -> float:
    """Return what of a drive [V] was the law's: 0 where the volume went far the other way.

    moved [V], as of `estimate_effectiveness`. A supervisor's push says nothing of the motor, nor
    does the sample after it, in which the motor turns round.
    """
    return 0.0 if moved * drive < -_OTHERS * drive * drive else drive


def usable(effectiveness: float) -> float:
    """Return the share of its jerk that a path is planned with [-]."""
    return min(1.0, _SPARE * effectiveness)


_ROOT_TURNS = 12  # each leaves a quarter of the logarithm's error
_TURNS = 10  # each leaves a quarter to three quarters of it
_LEAST_SHARE = 0.05  # of speed and jerk, that remains whatever is left
_RESTING = 0.02  # share of the way that a motion may be worth and still count as rest


class Target(NamedTuple):
    """Where the target is, how it moves, and how long it still has to go."""

    target: float  # m
    target_speed: float  # m/s
    target_acceleration: float  # m/s2
    left: float  # s
    whole: float  # s, that a way from rest takes in all; 0 for one that began in motion
    jerk: float  # m/s3, of its first quarter, against it in the next two


def cubic_root(x: float) -> float:
    """Return r with r^3 = x, for x of at least 0, by r^4 = x r."""
    r = 1.0
    for _ in range(_ROOT_TURNS):
        r = math.sqrt(math.sqrt(x * r))
    return r


def moves(p: Any) -> bool:
    """Say whether the target of a law moves, and does not jump."""
    moving: bool = p.fastest > 0.0 or p.jerk > 0.0 or p.shortest > 0.0
    return moving


def is_behind(p: Any, asked: float, volume: float) -> bool:
    """Say whether a volume [m3] is too far behind the one asked for, for the target's motion."""
    most = BEHIND * p.S_p * p.rate_per_volt * p.voltage_limit
    behind: bool = moves(p) and p.rate_per_volt > 0.0 and abs(asked - volume) > most
    return behind


def aim(
    p: Any,
    now: Target,
    wanted: float,
    depth: float,
    effectiveness: float,
    damping: float,
    inertia: float,
) -> Target:
    """Return the target `now`, set on its way to `wanted` [m], of a vehicle at a depth [m].

    What of speed and jerk is there: deep down the sea's load takes some of the voltage, and the
    compression of the hull some of the stroke, from neutral to its nearer end. damping [m3 s/m] and
    inertia [m3 s2/m]: volume per speed and per acceleration, 0 where not known. To keep the speed
    takes a quarter of the room at most; a way d from rest has an acceleration of j T/4,
    T^3 = 32 d/j, which takes half of it.
    """
    deeper = max(depth, wanted)
    higher = min(depth, wanted)
    voltage = 1.0 - (p.depth_voltage * deeper + p.balanced.friction) / p.voltage_limit
    left = max(min(p.volume_max - p.psi * deeper, p.psi * higher - p.volume_min), 0.0)
    jerk = p.jerk * min(max(voltage, _LEAST_SHARE), 1.0)
    fastest = p.fastest
    if damping > 0.0 and fastest > 0.0:
        fastest = max(min(fastest, 0.25 * left / damping), _LEAST_SHARE * fastest)
    gap = abs(wanted - now.target)
    if inertia > 0.0 and gap > 0.0:
        quarter = 2.0 * left / inertia
        jerk = max(min(jerk, quarter * math.sqrt(quarter / (32.0 * gap))), _LEAST_SHARE * jerk)
    return depart(now, wanted, fastest, usable(effectiveness) * jerk, p.shortest)


def depart(now: Target, wanted: float, fastest: float, jerk: float, shortest: float) -> Target:
    """Return the target with a new reference `wanted` [m], to be reached in `shortest` [s] or more.

    fastest [m/s] and jerk [m/s3] are limits, 0 where there is none. They hold exactly from rest;
    a target on its way is given the time that its speed and acceleration may cost on top.
    """
    gap = abs(wanted - now.target)
    speed, acceleration = abs(now.target_speed), abs(now.target_acceleration)
    time = shortest
    if fastest > 0.0:
        time = max(time, 2.0 * gap / fastest)
    if jerk > 0.0:
        time = max(time, cubic_root(32.0 * gap / jerk))
    if time > 2.0 * shortest and (speed + acceleration * time) * time <= _RESTING * gap:
        first = 32.0 * (wanted - now.target) / (time * time * time)
        return Target(now.target, now.target_speed, now.target_acceleration, time, time, first)
    if jerk > 0.0:
        longer = max(1.2331 * time, math.sqrt(36.0 * speed / jerk))
        longer = max(longer, 9.0 * acceleration / jerk)
        for _ in range(_TURNS):
            way = gap + (0.6 * speed + 0.15 * acceleration * longer) * longer
            longer = math.sqrt(math.sqrt(60.0 * way / jerk * longer))
        time = max(time, longer)
    return Target(now.target, now.target_speed, now.target_acceleration, time, 0.0, 0.0)


def pushed(now: Target, jerk: float, t: float) -> Target:
    """Return the target after a time t [s] of a constant jerk [m/s3]."""
    acceleration = now.target_acceleration + jerk * t
    speed = now.target_speed + t * (now.target_acceleration + 0.5 * jerk * t)
    depth = now.target + t * (
        now.target_speed + t * (0.5 * now.target_acceleration + jerk * t / 6.0)
    )
    return Target(depth, speed, acceleration, now.left - t, now.whole, now.jerk)


def approach(now: Target, wanted: float, shortest: float, S_p: float) -> Target:
    """Return the target a sample S_p [s] later on its way to rest at `wanted` [m].

    The time left [s] is never less than `shortest`, nor than a sample.
    """
    last = 0.25 * now.whole
    start = now
    rest = S_p
    if last < now.left <= now.whole:
        first = min(max(now.left - 0.75 * now.whole, 0.0), S_p)
        second = min(now.left - last, S_p) - first
        start = pushed(pushed(now, now.jerk, first), -now.jerk, second)
        rest = S_p - first - second
        if rest <= 0.0:
            return start
    least = max(shortest, S_p)
    T = max(start.left, least)
    s = rest / T
    e, v, a = start.target - wanted, start.target_speed * T, start.target_acceleration * T * T
    c3 = -0.5 * (20.0 * e + 12.0 * v + 3.0 * a)
    c4 = 0.5 * (30.0 * e + 16.0 * v + 3.0 * a)
    c5 = -0.5 * (12.0 * e + 6.0 * v + a)
    depth = wanted + (e + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5)))))
    speed = (v + s * (a + s * (3.0 * c3 + s * (4.0 * c4 + s * (5.0 * c5))))) / T
    acceleration = (a + s * (6.0 * c3 + s * (12.0 * c4 + s * (20.0 * c5)))) / (T * T)
    return Target(depth, speed, acceleration, max(T - rest, least), 0.0, 0.0)
