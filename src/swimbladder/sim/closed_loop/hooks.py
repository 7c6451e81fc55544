"""What may stand between plant, sensors, law and driver of the loop, chosen by its type.

An empty tuple stands for nothing, and compiles away. Anything else is a named tuple of a class for
which `hook_in` names compiled functions; it stands in a block of one lane.

What makes a vehicle heavier than its neutral volume says: a leak, a drifting trim, the swell.

It acts as a volume d that is lost: the engine's V and its end stops are those of the vehicle less
d, which moves the hull just so, and leaves the exponentials as they are. d is held over a tick.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload

from swimbladder.sim.closed_loop.rows import (
    DRIFT,
    HIGH_V,
    LEAK,
    LOST,
    LOW_V,
    MODE,
    N_PLANT,
    PLANT,
    SEEN_VOLUME,
    SWELL,
    SWELL_DECAY,
    SWELL_OMEGA,
    SWELL_PHASE,
    WATER,
    V,
    Z,
)
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.modes import BOTTOM, V_MAX, V_MIN, resting_volume, split


@inlined
def _swell(S, W_, i, t):  # type: ignore[no-untyped-def]
    """Return the volume [m3] whose loss pulls as the swell does at lane i's depth and time t [s].

    A neutral hull moves with the water, and the pressure it sees stays as it is (Airy waves); this
    is what is left of a hull that is long or not neutral. It dies out as exp(-omega^2 z/g).
    """
    fades = math.exp(-S[SWELL_DECAY * W_ + i] * max(S[Z * W_ + i], 0.0))
    angle = S[SWELL_OMEGA * W_ + i] * t + S[SWELL_PHASE * W_ + i]
    return S[SWELL * W_ + i] * fades * math.cos(angle)


@part
def lose(S, W_, i, p, t, dt, layers):  # type: ignore[no-untyped-def]
    """Set what is lost in lane i at time t [s], dt [s] after it was set last.

    p: room for the lane's parameters.
    """
    S[WATER * W_ + i] += S[LEAK * W_ + i] * dt
    lost = S[WATER * W_ + i] + S[DRIFT * W_ + i] * t
    if S[SWELL * W_ + i] > 0.0:
        lost += _swell(S, W_, i, t)
    change = lost - S[LOST * W_ + i]
    if change != 0.0:
        S[LOST * W_ + i] = lost
        S[V * W_ + i] -= change
        for row in (PLANT + V_MIN, PLANT + V_MAX, LOW_V, HIGH_V):
            S[row * W_ + i] -= change
        if split(int(S[MODE * W_ + i]))[2] == BOTTOM:
            for n in range(N_PLANT):
                p[n] = S[(PLANT + n) * W_ + i]
            S[HIGH_V * W_ + i] = min(p[V_MAX], resting_volume(p, layers, S[Z * W_ + i]))
    S[SEEN_VOLUME * W_ + i] = S[V * W_ + i] + lost


class Hooks(NamedTuple):
    """The compiled functions of a class; each takes its named tuple, the lane's rows, the tick."""

    begin: Callable[..., Any]  # (hooks, S, k, built) -> whether the run is over; before the sensors
    sense: Callable[..., Any]  # (hooks, S, k): writes what the sensors give
    ask: Callable[..., Any]  # (hooks, S, k) -> whether the law is called
    drive: Callable[..., Any]  # (hooks, S, k, command) -> what the driver gives the actuator


_HOOKS: dict[type[Any], Hooks] = {}


def hook_in(kind: type[Any], functions: Hooks) -> None:
    """Make the functions of a class of hooks known to the compiler."""
    _HOOKS[kind] = functions


def begin(hooks: Any, S: Any, k: int, built: Any) -> bool:
    """Begin a tick; return whether the run is over."""
    return bool(_HOOKS[type(hooks)].begin(hooks, S, k, built)) if hooks else False


def sense(hooks: Any, S: Any, k: int) -> None:
    """Write what the sensors give."""
    if hooks:
        _HOOKS[type(hooks)].sense(hooks, S, k)


def ask(hooks: Any, S: Any, k: int) -> bool:
    """Return whether the law is called at this tick."""
    return bool(_HOOKS[type(hooks)].ask(hooks, S, k)) if hooks else True


def drive(hooks: Any, S: Any, k: int, command: float) -> float:
    """Return what the driver gives the actuator for a command."""
    return float(_HOOKS[type(hooks)].drive(hooks, S, k, command)) if hooks else command


def _functions(hooks: Any) -> Hooks | None:
    return _HOOKS[hooks.instance_class] if isinstance(hooks, types.NamedTuple) else None


_OVERLOAD: Any = {"jit_options": {"forceinline": True}, "strict": False}  # strict: no annotations


@overload(begin, **_OVERLOAD)
def _begin(hooks: Any, S: Any, k: Any, built: Any) -> Any:  # noqa: ARG001
    own = _functions(hooks)
    if own is None:
        return lambda hooks, S, k, built: False  # noqa: ARG005
    function = own.begin
    return lambda hooks, S, k, built: function(hooks, S, k, built)


@overload(sense, **_OVERLOAD)
def _sense(hooks: Any, S: Any, k: Any) -> Any:  # noqa: ARG001
    own = _functions(hooks)
    if own is None:
        return lambda hooks, S, k: None  # noqa: ARG005
    function = own.sense
    return lambda hooks, S, k: function(hooks, S, k)


@overload(ask, **_OVERLOAD)
def _ask(hooks: Any, S: Any, k: Any) -> Any:  # noqa: ARG001
    own = _functions(hooks)
    if own is None:
        return lambda hooks, S, k: True  # noqa: ARG005
    function = own.ask
    return lambda hooks, S, k: function(hooks, S, k)


@overload(drive, **_OVERLOAD)
def _drive(hooks: Any, S: Any, k: Any, command: Any) -> Any:  # noqa: ARG001
    own = _functions(hooks)
    if own is None:
        return lambda hooks, S, k, command: command  # noqa: ARG005
    function = own.drive
    return lambda hooks, S, k, command: function(hooks, S, k, command)
