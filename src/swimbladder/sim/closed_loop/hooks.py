"""What may stand between plant, sensors, law and driver of the loop, chosen by its type.

An empty tuple stands for nothing, and compiles away. Anything else is a named tuple of a class for
which `hook_in` names compiled functions; it stands in a block of one lane.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload


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
