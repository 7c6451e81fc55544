"""What a mission is made of, as the kernel takes it, and what it gives back: all plain floats."""

import math
from typing import Any, NamedTuple

import numpy as np


class Condition(NamedTuple):
    """What a mission is flown in."""

    end: float  # ticks of the whole mission
    tick: float  # s
    start_depth: float  # m
    start_volume: float  # m3; nan: a float's that is afloat with all volume out
    depth_noise: float  # m, 1 sigma
    depth_quantum: float  # m
    volume_noise: float  # m3, 1 sigma
    volume_quantum: float  # m3
    battery_noise: float  # 1 sigma, as a share of the voltage
    full: float  # V, m3, or s of the pump, of full buoyancy
    ramp: float  # m that the depth asked for goes in a tick towards the set-point
    drift: float  # m3/s, of the neutral volume
    swell: float  # m3, amplitude of the volume that would pull as the swell does at the surface
    swell_omega: float  # rad/s
    swell_phase: float  # rad
    gravity: float  # m/s2
    leak_input: float  # m3 of water in the hull at which the leak input speaks; inf: it has none
    brown_out: float  # V under which the board stops; 0: it does not depend on this supply
    boot: float  # ticks from a reset until the first tick
    band: float  # m under the surface that count as being there
    rated: float  # m, inf: not stated
    stay: float  # ticks at the surface after which it has stayed there; less below it is bobbing
    quiet_at: float  # tick after which nothing more is asked or fails
    full_after: float  # ticks from the first fault on to full buoyancy, where that is asked for
    seed: float  # of the noise, a whole number below 2^32


class Wave(NamedTuple):
    """A wave of the sea, of which the depth's sensor reads amplitude exp(-k z) cos(w t + phase)."""

    amplitude: float  # m, at the surface
    k: float  # 1/m
    omega: float  # rad/s
    phase: float  # rad


class FaultRow(NamedTuple):
    """A fault as the kernel takes it; kind 0: none."""

    kind: float
    first: float  # severity
    second: float
    begin: float  # tick
    end: float  # tick


class Result(NamedTuple):
    """How a mission ended."""

    stop: float = 0.0  # why the plant stopped, see engine.advance; 0: it did not
    last: float = math.nan  # tick that it ended at
    arrived: float = math.nan  # tick since which it bobs at the surface; nan: it is not there
    beyond: float = math.nan  # tick at which it passed the depth it is rated for; nan: never
    bottom: float = 0.0  # 1: it lies on the bottom at the end
    depth: float = math.nan  # m, at the end
    deepest: float = math.nan  # m
    latched: float = math.nan  # tick at which the supervisor first gave a reason; nan: never
    reason: float = 0.0  # code of that reason
    released: float = math.nan  # tick at which it asked for the release of a weight; nan: never
    resets: float = 0.0  # of the board
    acting: float = math.nan  # tick at which the first fault began to act; nan: none did
    up: float = math.nan  # tick at which it first was at the surface, as asked for; nan: never
    filled: float = -1.0  # 1: heavy with all its volume out since it was there last; 0, -1: not


class Trace(NamedTuple):
    """A row of a mission's record, at a tick."""

    depth: float  # m
    speed: float  # m/s
    volume: float  # m3
    command: float  # V or m3, of the board
    applied: float  # V or m3, what the actuator got
    battery: float  # V, at the board
    reference: float  # m
    depth_seen: float  # m
    depth_age: float  # s
    volume_seen: float  # m3
    leak_seen: float  # 1: the leak input speaks
    lost_ticks: float  # since the last tick of the board
    board: float  # 0: it ran this tick; 1: it missed it; 2: it was off
    reason: float  # code, 0: none
    water: float  # m3 that leaked in


def record_type(kind: type[Any]) -> np.dtype[np.void]:
    """Return the record of a named tuple of floats, for kernels."""
    return np.dtype([(name, np.float64) for name in kind._fields])


RESULT = Result(*range(len(Result._fields)))
TRACE = {name: index for index, name in enumerate(Trace._fields)}
