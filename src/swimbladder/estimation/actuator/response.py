"""The exact motion of the actuator under a voltage that is held between samples, eq. (22).

::

    T1 dv/dt + v = K (u - b - d sign(v)),   dx/dt = v,   |right-hand side| <= rate

K is K_out while the piston moves outward and K_in while it moves inward. d is the dead zone: dry
friction, written as the voltage that it takes; b the voltage that a steady load takes. A piston
that stands stays where it is while |u - b| <= d. Without d, b, a limit and with K_out = K_in = K1
it is eq. (22). Between two samples each piece of the motion is an exponential, and the instant at
which it comes to rest a logarithm: nothing is stepped through.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine.cache import compiled

Array = NDArray[np.float64]


class Drive(NamedTuple):
    """The actuator as a voltage sees it; a length may be one of the piston or a volume."""

    K_out: float  # m/s/V, speed per volt while it moves outward
    K_in: float  # m/s/V, while it moves inward
    T1: float  # s
    dead_zone: float  # V, half of the band of voltages that move nothing
    load: float  # V, the middle of that band
    rate: float = math.inf  # m/s, no voltage makes it faster


def respond(
    time: Array, voltage: Array, drive: Drive, *, first_speed: float = 0.0
) -> tuple[Array, Array]:
    """Return the travel since the first sample [m] and the speed [m/s] at each sample.

    time [s], increasing; voltage [V], each held until the next sample; first_speed [m/s].
    """
    travel, speed = np.empty(len(time)), np.empty(len(time))
    _kernel()(time, voltage, *drive, first_speed, travel, speed)
    return travel, speed


def steady_speed(voltage: float, drive: Drive) -> float:
    """Return the speed [m/s] that a voltage [V] reaches when it lasts."""
    over = voltage - drive.load
    if abs(over) <= drive.dead_zone:
        return 0.0
    gain = drive.K_out if over > 0.0 else drive.K_in
    fast = gain * (abs(over) - drive.dead_zone)
    return math.copysign(min(fast, drive.rate), over)


def _advance(time, voltage, K_out, K_in, T1, d, b, rate, first_speed, travel, speed):  # type: ignore[no-untyped-def]
    """Fill travel [n] and speed [n]."""
    x, v = 0.0, first_speed
    travel[0], speed[0] = x, v
    for k in range(len(time) - 1):
        h = time[k + 1] - time[k]
        over = voltage[k] - b
        while h > 0.0:
            if v == 0.0 and abs(over) <= d:
                break
            outward = v > 0.0 or (v == 0.0 and over > 0.0)
            end = K_out * (over - d) if outward else K_in * (over + d)
            end = min(max(end, -rate), rate)
            part = h
            stops = v != 0.0 and end != 0.0 and (end > 0.0) != outward
            if stops:
                part = T1 * math.log(1.0 - v / end)
                stops = part < h
                part = min(part, h)
            gone = -math.expm1(-part / T1)
            x += end * part + (v - end) * T1 * gone
            v = 0.0 if stops else v + (end - v) * gone
            h -= part
        travel[k + 1], speed[k + 1] = x, v


_compiled: list[Any] = []


def _kernel() -> Any:
    """Return the compiled loop, made at its first use."""
    if not _compiled:
        _compiled.append(compiled(_advance, under="identify_actuator"))
    return _compiled[0]
