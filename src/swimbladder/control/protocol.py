"""The pool procedure (a)-(d) of section 3.1 as a state machine: phases are data, a step is pure.

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
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from swimbladder.control import cascade
from swimbladder.control.cascade import CascadeParameters, CascadeState
from swimbladder.control.law import Measurement

__all__ = [
    "Does",
    "Phase",
    "PoolParameters",
    "PoolState",
    "Window",
    "at_rest",
    "begin",
    "extend",
    "pool_phases",
    "step",
    "timed_voltage",
]


class Does(Enum):
    """What the machine does in a phase, and when the phase is over."""

    HOLD = "Close the loop on a depth until the vehicle has been at rest there for a minute."
    HALT = "Hold the piston until the motor stands still."
    PULSE = "Apply a voltage for a time, to change the volume."
    GLIDE = "Hold the piston and wait for the surface or the bottom."
    DONE = "Hold the piston: the procedure is over."
    GAVE_UP = "Hold the piston: the vehicle did not come to rest, or did not arrive, in time."


class Phase(NamedTuple):
    """A phase: the step of section 3.1 that it belongs to, what it does, and with what number."""

    step: str  # "a" to "d"; "" at the end
    does: Does
    target: float = 0.0  # HOLD: depth [m]; PULSE: volume [m3]; GLIDE: last depth [m]


class PoolParameters(NamedTuple):
    """The procedure and what it knows of the actuator."""

    phases: tuple[Phase, ...]
    loop: CascadeParameters  # may be tuned coarsely
    K1: float  # m/s/V, piston speed per volt in steady state
    piston_area: float  # m2
    limit: float  # V, largest voltage of a pulse
    load_voltage: float  # V/m, that holds the piston against a metre of water; 0: none is applied
    minute: float  # s, over which rest is judged and the volume averaged
    rest_speed: float  # m/s, mean speed over the minute that counts as none
    rest_distance: float  # m, of the mean depth from its target that counts as there
    halt: float  # s, for the motor to stop
    patience: float  # s, longest that a phase may take


class Window(NamedTuple):
    """Sums over a stretch of samples, from which come means and a slope."""

    samples: int = 0
    t: float = 0.0  # s, since the first sample
    tt: float = 0.0  # s2
    z: float = 0.0  # m
    tz: float = 0.0  # m s
    V: float = 0.0  # m3
    start: float = 0.0  # s

    @property
    def depth(self) -> float:
        """Mean depth [m]."""
        return self.z / self.samples

    @property
    def volume(self) -> float:
        """Mean volume [m3]."""
        return self.V / self.samples

    @property
    def speed(self) -> float:
        """Slope of the straight line through the depths [m/s]."""
        n = self.samples
        return (n * self.tz - self.t * self.z) / (n * self.tt - self.t * self.t)


class PoolState(NamedTuple):
    """What the procedure remembers between samples."""

    phase: int  # index into PoolParameters.phases
    began: float  # s, when the phase did
    loop: CascadeState
    window: Window
    neutral: float  # m3, mean volume of the last minute at rest
    pulse: float  # V
    pulses: int  # samples of it that are left


def pool_phases(
    *, pool_depth: float, clearance: float, dV: float, margin: float = 0.05
) -> tuple[Phase, ...]:
    """Return steps (a) to (d) for a change of volume dV [m3], positive.

    pool_depth: where the vehicle stands on the bottom [m]; clearance: Delta_z [m], from bottom and
    surface to the depths of rest; margin: distance from either that counts as arrived [m].
    """
    return (
        Phase("a", Does.HOLD, pool_depth - clearance),
        Phase("b", Does.HALT),
        Phase("b", Does.PULSE, dV),
        Phase("b", Does.GLIDE, margin),
        Phase("c", Does.HOLD, clearance),
        Phase("d", Does.HALT),
        Phase("d", Does.PULSE, -dV),
        Phase("d", Does.GLIDE, pool_depth - margin),
        Phase("", Does.DONE),
        Phase("", Does.GAVE_UP),
    )


def timed_voltage(dx: float, *, K1: float, limit: float, sample_time: float) -> tuple[float, int]:
    """Return (u [V], samples): the voltage that moves the piston by dx [m] in whole samples.

    dt = dx/(K1 u), section 3.1, with the largest u up to `limit` [V] that makes dt a multiple of
    the sample time [s]. K1 [m/s/V].
    """
    samples = max(1, math.ceil(abs(dx) / (K1 * limit * sample_time) - 1e-9))
    return dx / (K1 * samples * sample_time), samples


def extend(window: Window, measurement: Measurement) -> Window:
    """Return the window with one more measurement in it."""
    start = window.start if window.samples else measurement.time
    t = measurement.time - start
    return Window(
        window.samples + 1,
        window.t + t,
        window.tt + t * t,
        window.z + measurement.depth,
        window.tz + t * measurement.depth,
        window.V + measurement.volume,
        start,
    )


def at_rest(parameters: PoolParameters, window: Window, target: float) -> bool:
    """Say whether a full window shows nearly no speed, near the target depth [m]."""
    return (
        abs(window.speed) <= parameters.rest_speed
        and abs(window.depth - target) <= parameters.rest_distance
    )


def begin(parameters: PoolParameters, measurement: Measurement) -> PoolState:
    """Return the state at the start of the first phase."""
    first = parameters.phases[0]
    return PoolState(
        phase=0,
        began=measurement.time,
        loop=cascade.initial(parameters.loop, measurement, first.target),
        window=Window(),
        neutral=measurement.volume,
        pulse=0.0,
        pulses=0,
    )


def step(
    parameters: PoolParameters, state: PoolState, measurement: Measurement
) -> tuple[float, PoolState, float]:
    """Return the voltage [V], the state, and the time to the next sample [s]."""
    p, S_p = parameters, parameters.loop.S_p
    state = _move_on(p, state, measurement)
    phase = p.phases[state.phase]
    if phase.does is Does.HOLD:
        u, loop, _ = cascade.step(p.loop, state.loop, measurement, phase.target)
        state = state._replace(loop=loop, window=extend(state.window, measurement))
        return u, state, S_p
    if phase.does is Does.PULSE:
        return state.pulse, state._replace(pulses=state.pulses - 1), S_p
    return p.load_voltage * measurement.depth, state, S_p


def _move_on(p: PoolParameters, state: PoolState, seen: Measurement) -> PoolState:
    """Return the state in the phase that this measurement belongs to."""
    phase = p.phases[state.phase]
    late = seen.time - state.began > p.patience
    if phase.does is Does.HOLD:
        if state.window.samples * p.loop.S_p < p.minute - 1e-9:
            return state
        if at_rest(p, state.window, phase.target):
            return _enter(p, state._replace(neutral=state.window.volume), seen)
        return _give_up(p, state, seen) if late else state._replace(window=Window())
    if phase.does is Does.HALT:
        over = seen.time - state.began >= p.halt - 1e-9
    elif phase.does is Does.PULSE:
        over = state.pulses <= 0
    elif phase.does is Does.GLIDE:
        rising = p.phases[state.phase - 1].target > 0.0
        over = seen.depth <= phase.target if rising else seen.depth >= phase.target
        if late and not over:
            return _give_up(p, state, seen)
    else:
        return state
    return _enter(p, state, seen) if over else state


def _enter(p: PoolParameters, state: PoolState, seen: Measurement) -> PoolState:
    """Return the state at the start of the next phase."""
    phase = p.phases[state.phase + 1]
    state = state._replace(phase=state.phase + 1, began=seen.time)
    if phase.does is Does.HOLD:
        loop = cascade.initial(p.loop, seen, phase.target)
        return state._replace(loop=loop, window=Window())
    if phase.does is Does.PULSE:
        dx = (state.neutral + phase.target - seen.volume) / p.piston_area
        u, samples = timed_voltage(dx, K1=p.K1, limit=p.limit, sample_time=p.loop.S_p)
        return state._replace(pulse=u, pulses=samples)
    return state


def _give_up(p: PoolParameters, state: PoolState, seen: Measurement) -> PoolState:
    last = next(i for i, phase in enumerate(p.phases) if phase.does is Does.GAVE_UP)
    return state._replace(phase=last, began=seen.time)
