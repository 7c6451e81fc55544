"""A target that goes to a new reference smoothly, within a speed and a jerk.

From any depth, speed and acceleration the target follows the polynomial of fifth order that is at
rest at the reference T seconds later (Flash and Hogan, J. Neuroscience 5, 1985, 1688: of all such
motions the one of least squared jerk). From rest over a distance d its largest speed is (15/8) d/T
and its largest jerk 60 d/T^3, so T follows from these limits. The polynomial is solved anew at each
sample from where the target is: nothing but the time left has to be remembered, and rounding does
not pile up. The time left ends at a shortest one, so that the last of the way, and every small
change, is a linear filter with the poles of s^3 + 9 s^2/T + 36 s/T^2 + 60/T^3.

Why the jerk: the motor's rate limits how fast the volume, and with it the acceleration, changes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["Target", "approach", "duration"]

_SPEED = 1.875  # largest speed of the polynomial over d/T
_JERK = 60.0  # largest jerk of it over d/T^3
_TURNS = 16


class Target(NamedTuple):
    """Where the target is, how it moves, and how long it still has to go."""

    depth: float  # m
    speed: float  # m/s
    acceleration: float  # m/s2
    left: float  # s


def duration(now: Target, wanted: float, fastest: float, jerk: float, shortest: float) -> float:
    """Return the time [s] to take to `wanted` [m], at least `shortest` [s].

    fastest [m/s] and jerk [m/s3] are limits, 0 where there is none. They hold exactly from rest;
    a target on its way is given the time that its speed and acceleration may cost on top.
    """
    gap, speed, acceleration = abs(wanted - now.depth), abs(now.speed), abs(now.acceleration)
    least = max(shortest, _SPEED * gap / fastest) if fastest > 0.0 else shortest
    if jerk <= 0.0:
        return least
    T = max(least, 1.0)
    for _ in range(_TURNS):  # T^4 = c T: from rest a turn leaves a quarter of log T's error
        way = gap + (0.6 * speed + 0.15 * acceleration * T) * T
        T = math.sqrt(math.sqrt(_JERK * way / jerk * T))
    return max(T, least)


def approach(now: Target, wanted: float, shortest: float, S_p: float) -> Target:
    """Return the target a sample S_p [s] later on its way to rest at `wanted` [m].

    The time left [s] is never less than `shortest`, nor than a sample.
    """
    least = max(shortest, S_p)
    T = max(now.left, least)
    s = S_p / T
    e, v, a = now.depth - wanted, now.speed * T, now.acceleration * T * T
    c3 = -0.5 * (20.0 * e + 12.0 * v + 3.0 * a)
    c4 = 0.5 * (30.0 * e + 16.0 * v + 3.0 * a)
    c5 = -0.5 * (12.0 * e + 6.0 * v + a)
    depth = wanted + (e + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5)))))
    speed = (v + s * (a + s * (3.0 * c3 + s * (4.0 * c4 + s * (5.0 * c5))))) / T
    acceleration = (a + s * (6.0 * c3 + s * (12.0 * c4 + s * (20.0 * c5)))) / (T * T)
    return Target(depth, speed, acceleration, max(T - S_p, least))
