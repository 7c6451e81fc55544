"""What may stand between plant, sensors, law and driver of the loop, chosen by its type.

An empty tuple stands for nothing, and compiles away. Anything else is a named tuple of a class for
which `hook_in` names compiled functions; it stands in a block of one lane. Faults are such hooks,
and so are the phases of a mission: these say as well how far a lane with pump and valve goes before
anybody has to decide, so that its ticks are as far apart as what is due. A supervisor is chosen the
same way, by `lane.Like.watch`, and stands over the law of every lane.

A leak, a drifting trim and the swell make a vehicle heavier than its neutral volume says (`lose`).
That acts as a volume d that is lost: the engine's V and its end stops are those of the vehicle less
d, which moves the hull just so, and leaves the exponentials as they are. d is held over a tick.
"""

import math
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.closed_loop.rows import N_PLANT, Row
from swimbladder.sim.engine.cache import chosen_by_first, inlined, part
from swimbladder.sim.engine.modes import BOTTOM, V_MAX, V_MIN, resting_volume, split

Array = NDArray[np.float64]


@inlined
def _swell(S: Array, W_: int, i: int, t: float) -> Any:
    """Return the volume [m3] whose loss pulls as the swell does at lane i's depth and time t [s].

    A neutral hull moves with the water, and the pressure it sees stays as it is (Airy waves); this
    is what is left of a hull that is long or not neutral. It dies out as exp(-omega^2 z/g).
    """
    fades = math.exp(-S[Row.SWELL_DECAY * W_ + i] * max(S[Row.Z * W_ + i], 0.0))
    angle = S[Row.SWELL_OMEGA * W_ + i] * t + S[Row.SWELL_PHASE * W_ + i]
    return S[Row.SWELL * W_ + i] * fades * math.cos(angle)


@part
def lose(S: Array, W_: int, i: int, p: Any, t: float, dt: float, layers: Any) -> None:
    """Set what is lost in lane i at time t [s], dt [s] after it was set last.

    p: room for the lane's parameters.
    """
    S[Row.WATER * W_ + i] += S[Row.LEAK * W_ + i] * dt
    lost = S[Row.WATER * W_ + i] + S[Row.DRIFT * W_ + i] * t
    if S[Row.SWELL * W_ + i] > 0.0:
        lost += _swell(S, W_, i, t)
    change = lost - S[Row.LOST * W_ + i]
    if change != 0.0:
        S[Row.LOST * W_ + i] = lost
        S[Row.V * W_ + i] -= change
        S[Row.LOW_V * W_ + i] -= change
        S[Row.HIGH_V * W_ + i] -= change
        for own in (V_MIN, V_MAX):
            S[(Row.PLANT + own) * W_ + i] -= change
        if split(int(S[Row.MODE * W_ + i]))[2] == BOTTOM:
            for n in range(N_PLANT):
                p[n] = S[(Row.PLANT + n) * W_ + i]
            S[Row.HIGH_V * W_ + i] = min(p[V_MAX], resting_volume(p, layers, S[Row.Z * W_ + i]))
    S[Row.SEEN_VOLUME * W_ + i] = S[Row.V * W_ + i] + lost


P = ParamSpec("P")
R = TypeVar("R")
_HOOKS: dict[type[Any], dict[str, Callable[..., Any]]] = {}


def hook_in(kind: type[Any], **functions: Callable[..., Any]) -> None:
    """Make the functions of a class of hooks known to the compiler, by the names they have below.

    Each takes its named tuple, and what is written there.
    """
    _HOOKS[kind] = functions


def _chosen(hook: Callable[P, R]) -> Callable[P, R]:
    """Let the class of hooks say what a function does; where it says nothing, as it is written."""

    def own(kind: type[Any]) -> Callable[..., Any]:
        return _HOOKS.get(kind, {}).get(hook.__name__, hook)

    return chosen_by_first(
        lambda hooks: own(type(hooks)), lambda form: own(getattr(form, "instance_class", tuple))
    )


@_chosen
def begin(hooks: Any, S: Any, k: int, built: Any) -> bool:  # noqa: ARG001
    """Begin a tick, before the sensors measure; return whether the run is over."""
    return False


@_chosen
def sense(hooks: Any, S: Any, k: int) -> None:
    """Write what the sensors give."""


@_chosen
def starts(hooks: Any, k: int) -> bool:  # noqa: ARG001
    """Return whether the law begins at this tick, after the sensors have measured."""
    return k == 0


@_chosen
def ask(hooks: Any, S: Any, k: int) -> bool:  # noqa: ARG001
    """Return whether the law is called at this tick."""
    return True


@_chosen
def wanted(hooks: Any, S: Any, k: int, command: float) -> float:  # noqa: ARG001
    """Return what is wanted of the actuator for the law's command, for the supervisor to see."""
    return command


@_chosen
def took_over(watch: Any, i: int) -> bool:  # noqa: ARG001
    """Return whether the supervisor of lane i has taken over, so that the law is left alone."""
    return False


@_chosen
def allowed(watch: Any, i: int, reference: float) -> float:  # noqa: ARG001
    """Return the depth that the law of lane i is asked for, its supervisor allowing."""
    return reference


@_chosen
def supervise(watch: Any, S: Any, W_: int, i: int, k: int, asked: float) -> float:  # noqa: ARG001
    """Return what lane i's supervisor makes of what is wanted at tick k."""
    return asked


@_chosen
def drive(hooks: Any, S: Any, k: int, command: float) -> float:  # noqa: ARG001
    """Return what the driver gives the actuator for a command."""
    return command


@_chosen
def bound(hooks: Any, until: float) -> float:  # noqa: ARG001
    """Return how far a lane with pump and valve goes before the next tick [s]."""
    return until


@_chosen
def set_off(hooks: Any) -> tuple[float, float]:  # noqa: ARG001
    """Return the loads [W] of a step of such a lane, and the depth it is watched for [m]."""
    return 0.0, 0.0


@_chosen
def moved(hooks: Any, event: int, time: float, depth: float) -> None:
    """See what a step of such a lane from a time [s] and depth [m] means, and how it ended."""


@_chosen
def settled(hooks: Any) -> None:
    """See where such a lane is, once its drive has done what it does there."""
