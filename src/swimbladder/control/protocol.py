"""The pool procedure (a)-(d) of section 3.1 as a state machine: a step is pure.

Hold the vehicle still near the bottom (a), displace more and record how it rises (b), hold it still
near the surface (c), displace less and record how it sinks (d). The paper's (b) says that it then
reaches the bottom: with more buoyancy it reaches the surface.

The volume changes as the paper changed it: a voltage u for the time dt = dx/(K1 u), from the volume
of the moment to that of the last minute's mean plus the change asked for. Noise makes the volume
jitter while the loop holds the depth, so the mean is the neutral volume and the moment is not.
The voltage is chosen so that dt is a whole number of samples. What the paper leaves open, and is
done here: before it the motor stops for `halt` seconds, and after it the voltage is the one that
holds the piston against the sea (`load_voltage` times depth). With 0 V the model's piston, which
nothing locks, would be pushed in.

`step` and `initial` have the form of a law's, so that they are translated as laws are: the board
does what the simulated pool does. In place of a depth asked for they take whether to go on: above 0
to do the procedure, 0 to wait at its beginning, below 0 to end it. A measurement that is missing,
or cannot be, holds the piston and begins the minute of rest anew; a timed voltage goes on, as it
asks no sensor. Times are counted in samples, to the nearest.
"""

from __future__ import annotations

import math

from swimbladder.control import cascade
from swimbladder.control.cascade import CascadeState
from swimbladder.control.law import Law, Measurement
from swimbladder.control.protocol_records import (
    POOL_UNITS,
    PoolParameters,
    PoolState,
    Window,
)

_WAITS = -1.0
_HOLD = 0.0
_HALT = 1.0
_PULSE = 2.0
_GLIDE = 3.0
_HALF = 4.0  # phases of a way up, and of a way down
_LAST = 7.0
_DONE = 8.0
_GAVE_UP = 9.0
_BITS = 24
_HIGHEST = 8388608.0  # 2^23
_HAIR = 1e-9  # of a sample, by which rounding may be off in double precision

EMPTY = Window(0.0, 0.0, 0.0, 0.0)


def whole_up(x: float) -> float:
    """Return the least whole number that is not below x, for 0 to 2^24."""
    rest = x
    whole = 0.0
    bit = _HIGHEST
    for _ in range(_BITS):
        if rest >= bit:
            rest = rest - bit
            whole = whole + bit
        bit = bit * 0.5
    return whole + 1.0 if rest > 0.0 else whole


def timed(change: float, rate: float, limit: float, S_p: float) -> tuple[float, float]:
    """Return (u [V], samples): the voltage that makes a change in whole samples of S_p [s].

    dt = dx/(K1 u), section 3.1, with the largest u up to `limit` [V] that makes dt a multiple of
    the sample time; rate: of what changes, per volt.
    """
    samples = max(1.0, whole_up(abs(change) / (rate * limit * S_p) - _HAIR))
    return change / (rate * samples * S_p), samples


def timed_voltage(dx: float, *, K1: float, limit: float, sample_time: float) -> tuple[float, int]:
    """Return (u [V], samples) that move the piston by dx [m]; K1 [m/s/V], sample_time [s]."""
    voltage, samples = timed(dx, K1, limit, sample_time)
    return voltage, int(samples)


def extend(window: Window, z: float, V: float) -> Window:
    """Return the window with one more sample in it: depth [m] and volume [m3] from their zeros."""
    return Window(window.samples + 1.0, window.z + z, window.kz + window.samples * z, window.V + V)


def slope(window: Window, S_p: float) -> float:
    """Return the slope [m/s] of the straight line through the depths of two samples or more."""
    n = window.samples
    return 12.0 * (window.kz - 0.5 * (n - 1.0) * window.z) / (n * (n * n - 1.0)) / S_p


def at_rest(p: PoolParameters, window: Window) -> bool:
    """Say whether a full window shows nearly no speed, near the depth that it counts from."""
    return (
        abs(slope(window, p.loop.S_p)) <= p.rest_speed
        and abs(window.z / window.samples) <= p.rest_distance
    )


def full(p: PoolParameters, window: Window) -> bool:
    """Say whether a window is a minute long."""
    return window.samples * p.loop.S_p > p.minute - 0.5 * p.loop.S_p


def can_be(p: PoolParameters, seen: Measurement) -> bool:
    """Say whether a measurement is one, and neither depth nor volume is impossible."""
    return (
        math.isfinite(seen.depth)
        and math.isfinite(seen.volume)
        and p.depth_least <= seen.depth <= p.depth_most
        and p.volume_least <= seen.volume <= p.volume_most
    )


def next_phase(
    p: PoolParameters, s: PoolState, window: Window, depth: float, good: bool, go: float
) -> float:
    """Return the phase that a measurement belongs to; a good one only begins another."""
    if s.phase >= _DONE:
        return s.phase
    missing = 0.0 if good else (s.blind + 1.0) * p.loop.S_p
    if go < 0.0 or (s.phase >= _HOLD and missing > p.blind):
        return _GAVE_UP
    if s.phase < _HOLD:
        return _HOLD if good and go > 0.0 else s.phase
    up = s.phase < _HALF
    does = s.phase if up else s.phase - _HALF
    late = s.ticks * p.loop.S_p > p.patience
    if does == _HOLD:
        over = good and full(p, window) and at_rest(p, window)
        late = late and full(p, window)
    elif does == _HALT:
        over = good and s.ticks * p.loop.S_p > p.halt - 0.5 * p.loop.S_p
    elif does == _PULSE:
        over = s.pulses <= 0.0
    else:
        over = good and (depth <= p.surface if up else depth >= p.bottom)
    if not over:
        return _GAVE_UP if late else s.phase
    if s.phase == _LAST:
        return _HOLD if s.completed + 1.0 < p.rounds else _DONE
    return s.phase + 1.0


def initial(parameters: PoolParameters, measurement: Measurement, go: float) -> PoolState:
    """Return the state at the start of the first phase, or of waiting for it."""
    p = parameters
    good = can_be(p, measurement)
    loop = CascadeState(0.0, 0.0, 0.0)
    if good:
        loop = cascade.initial(p.loop, measurement, p.deep)
    return PoolState(
        phase=_HOLD if good and go > 0.0 else _WAITS, completed=0.0, ticks=0.0, blind=0.0,
        depth=measurement.depth if good else 0.0,
        loop=loop, window=Window(0.0, 0.0, 0.0, 0.0), neutral=measurement.volume if good else 0.0,
        pulse=0.0, pulses=0.0, gave_up_in=_WAITS,
    )  # fmt: skip


def step(
    parameters: PoolParameters, state: PoolState, measurement: Measurement, go: float
) -> tuple[float, PoolState, float]:
    """Return the voltage [V], the state, and the time to the next sample [s]."""
    p = parameters
    s = state
    seen = measurement
    loop = s.loop
    window = s.window
    good = can_be(p, seen)
    phase = next_phase(p, s, window, seen.depth, good, go)
    up = phase < _HALF
    does = phase if up else phase - _HALF
    target = p.deep if up else p.shallow

    ticks = s.ticks
    completed = s.completed
    neutral = s.neutral
    pulse = s.pulse
    pulses = s.pulses
    gave_up_in = s.gave_up_in
    if phase != s.phase:
        ticks = 0.0
        if phase == _GAVE_UP:
            gave_up_in = s.phase
        elif does == _HOLD:
            loop = cascade.initial(p.loop, seen, target)
            if s.phase == _LAST:
                completed = s.completed + 1.0
        elif does == _HALT:
            neutral = s.neutral + window.V / window.samples
        elif does == _PULSE:
            change = p.change + p.more * s.completed
            asked = neutral + (change if up else -change) - seen.volume
            pulse, pulses = timed(asked, p.rate_per_volt, p.limit, p.loop.S_p)
        elif phase == _DONE:
            completed = s.completed + 1.0
    if phase != s.phase or not good or full(p, window):
        window = Window(0.0, 0.0, 0.0, 0.0)

    depth = seen.depth if good else s.depth
    command = p.load_voltage * depth
    if phase >= _DONE:
        if good and math.isfinite(p.end_volume):
            command = command + p.loop.k_pV * (p.end_volume - seen.volume)
    elif phase >= _HOLD and does == _HOLD:
        if good:
            command, loop, _ = cascade.step(p.loop, loop, seen, target)
            window = extend(window, seen.depth - target, seen.volume - neutral)
    elif does == _PULSE:
        command = pulse
        pulses = pulses - 1.0
    command = max(-p.limit, min(p.limit, command))  # upward, should it be no number
    return command, PoolState(
        phase=phase, completed=completed, ticks=ticks + 1.0, blind=0.0 if good else s.blind + 1.0,
        depth=depth, loop=loop, window=window, neutral=neutral, pulse=pulse, pulses=pulses,
        gave_up_in=gave_up_in,
    ), p.loop.S_p  # fmt: skip


POOL = Law(
    name="pool",
    summary="the pool procedure (a)-(d) of section 3.1, with a cascade that holds the depth",
    command="voltage",
    parameters=PoolParameters,
    state=PoolState,
    units=POOL_UNITS,
    step=step,
    initial=initial,
)
