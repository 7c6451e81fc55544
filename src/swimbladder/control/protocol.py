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
from enum import Enum
from typing import Annotated, NamedTuple

from swimbladder.control import cascade
from swimbladder.control.cascade import CascadeParameters, CascadeState
from swimbladder.control.law import Law, Measurement

MARGIN = 0.05  # m, from surface or bottom, that counts as arrived


class Does(Enum):
    """What the machine does in a phase, and when the phase is over."""

    WAIT = "Hold the piston until the start command."
    HOLD = "Close the loop on a depth until the vehicle has been at rest there for a minute."
    HALT = "Hold the piston until the motor stands still."
    PULSE = "Apply a voltage for a time, to change the volume."
    GLIDE = "Hold the piston and wait for the surface or the bottom."
    DONE = "Hold the piston, or come up: the procedure is over."
    GAVE_UP = (
        "Hold the piston, or come up: the vehicle did not come to rest, or did not arrive, in time,"
        " or could not be measured."
    )


class Phase(NamedTuple):
    """A phase: the step of section 3.1 that it belongs to, what it does, and with what number."""

    step: str  # "a" to "d"; "" before the first and at the end
    does: Does
    target: float = 0.0  # HOLD: depth [m]; PULSE: volume of the first round [m3]; GLIDE: depth [m]

    @property
    def words(self) -> str:
        """What the board's log calls it."""
        what = self.does.name.lower().replace("_", " ")
        return f"({self.step}) {what}" if self.step else what

    @property
    def name(self) -> str:
        """What the board's C calls it."""
        return f"{self.step.upper()}_{self.does.name}" if self.step else self.does.name


class PoolParameters(NamedTuple):
    """The procedure, the loop that holds a depth in it, and what it knows of the actuator."""

    loop: CascadeParameters  # which may be tuned coarsely
    deep: Annotated[float, "m"]  # where the vehicle rests in step (a)
    shallow: Annotated[float, "m"]  # and in step (c)
    surface: Annotated[float, "m"]  # where step (b) is over
    bottom: Annotated[float, "m"]  # and step (d)
    change: Annotated[float, "m3"]  # of the volume in the first round, positive
    more: Annotated[float, "m3"]  # by which each round's is larger than that of the one before
    rounds: Annotated[float, ""]  # how often steps (a) to (d) are done
    rate_per_volt: Annotated[float, "m3/s/V"]  # K1 A
    limit: Annotated[float, "V"]  # the largest there is
    load_voltage: Annotated[float, "V/m"]  # that holds the piston against a metre of water, or 0
    minute: Annotated[float, "s"]  # over which rest is judged and the volume averaged
    rest_speed: Annotated[float, "m/s"]  # mean speed over the minute that counts as none
    rest_distance: Annotated[float, "m"]  # of the mean depth from its target that counts as there
    halt: Annotated[float, "s"]  # for the motor to stop
    patience: Annotated[float, "s"]  # longest that a phase may take
    blind: Annotated[float, "s"]  # longest without a measurement that can be
    depth_least: Annotated[float, "m"]  # that can be
    depth_most: Annotated[float, "m"]
    volume_least: Annotated[float, "m3"]
    volume_most: Annotated[float, "m3"]
    end_volume: Annotated[float, "m3"]  # to go to when it is over; infinite: none

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The phases by their number, with the change of volume of the first round."""
        return (
            Phase("a", Does.HOLD, self.deep),
            Phase("b", Does.HALT),
            Phase("b", Does.PULSE, self.change),
            Phase("b", Does.GLIDE, self.surface),
            Phase("c", Does.HOLD, self.shallow),
            Phase("d", Does.HALT),
            Phase("d", Does.PULSE, -self.change),
            Phase("d", Does.GLIDE, self.bottom),
            Phase("", Does.DONE),
            Phase("", Does.GAVE_UP),
        )


def procedure_for(
    loop: CascadeParameters,
    *,
    rate_per_volt: float,
    limit: float,
    load_voltage: float,
    bottom_depth: float,
    clearance: float,
    change: float,
) -> PoolParameters:
    """Return one round for a change of volume [m3], positive, with the times of section 3.1.

    bottom_depth: where the vehicle stands on it [m]; clearance: Delta_z [m], from bottom and
    surface to the depths of rest; rate_per_volt: K1 A [m3/s/V]; limit [V]; load_voltage [V/m].
    Every measurement that is a number counts as possible, and at the end the piston is held.
    """
    return PoolParameters(
        loop=loop,
        deep=bottom_depth - clearance,
        shallow=clearance,
        surface=MARGIN,
        bottom=bottom_depth - MARGIN,
        change=change,
        more=0.0,
        rounds=1.0,
        rate_per_volt=rate_per_volt,
        limit=limit,
        load_voltage=load_voltage,
        minute=60.0,
        rest_speed=5e-4,
        rest_distance=0.02,
        halt=0.6,
        patience=1200.0,
        blind=10.0,
        depth_least=-math.inf,
        depth_most=math.inf,
        volume_least=-math.inf,
        volume_most=math.inf,
        end_volume=math.inf,
    )


class Window(NamedTuple):
    """Sums over consecutive samples, from which come means and a slope.

    Depths and volumes count from some depth and volume near them, and time in samples: so float32
    is enough.
    """

    samples: float  # -
    z: float  # m
    kz: float  # m, each times the number of samples before it
    V: float  # m3


class PoolState(NamedTuple):
    """What the procedure remembers between samples."""

    phase: float  # -, index into PoolParameters.phases; -1: it waits for the start command
    completed: float  # -, rounds that are behind it
    ticks: float  # since the phase began
    blind: float  # ticks since the last measurement that can be
    depth: float  # m, of that one
    loop: CascadeState
    window: Window  # depths count from the target, volumes from `neutral`
    neutral: float  # m3, mean volume of the last minute at rest
    pulse: float  # V
    pulses: float  # ticks of it that are left
    gave_up_in: float  # -, the phase in which it did; -1: it did not


_WAITS = -1.0
_HOLD = 0.0
_HALT = 1.0
_PULSE = 2.0
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
        phase=_HOLD if good and go > 0.0 else _WAITS,
        completed=0.0,
        ticks=0.0,
        blind=0.0,
        depth=measurement.depth if good else 0.0,
        loop=loop,
        window=Window(0.0, 0.0, 0.0, 0.0),
        neutral=measurement.volume if good else 0.0,
        pulse=0.0,
        pulses=0.0,
        gave_up_in=_WAITS,
    )


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
    return (
        command,
        PoolState(
            phase=phase,
            completed=completed,
            ticks=ticks + 1.0,
            blind=0.0 if good else s.blind + 1.0,
            depth=depth,
            loop=loop,
            window=window,
            neutral=neutral,
            pulse=pulse,
            pulses=pulses,
            gave_up_in=gave_up_in,
        ),
        p.loop.S_p,
    )


POOL = Law(
    name="pool",
    summary="the pool procedure (a)-(d) of section 3.1, with a cascade that holds the depth",
    command="voltage",
    parameters=PoolParameters,
    state=PoolState,
    step=step,
    initial=initial,
)
