"""Compiled laws: dispatched on the type of their parameters, so nothing is closed over.

A kernel calls `law_step(parameters, state, measurement, reference)`; numba picks the law by the
class of `parameters`, and the kernel's code on disk is found again by the same type.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from numba import types
from numba.extending import overload

from swimbladder.control.law import Law
from swimbladder.engine.cache import inlined
from swimbladder.errors import InputError

__all__ = ["compilable", "enroll", "gather", "law_initial", "law_step", "scatter_where"]

_INLINE: Any = {"forceinline": True}
_LAWS: dict[type[Any], Law] = {}


def enroll(law: Law) -> None:
    """Make a law known to the compiler by the class of its parameters.

    Raises InputError where that class belongs to another law already.
    """
    known = _LAWS.setdefault(law.parameters, law)
    if known.step is not law.step or known.initial is not law.initial:
        raise InputError(
            f"the class {law.parameters.__name__} is that of the parameters of the law "
            f"{known.name!r}, and a compiled law is found by this class",
            field="law",
            value=law.name,
            remedy="Give the law a NamedTuple of its own for its parameters",
        )


def compilable(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a law's function that calls compiled ones where it calls plain functions."""
    if not isinstance(function, FunctionType):
        return function
    names = dict(function.__globals__)
    for name in function.__code__.co_names:
        if isinstance(names.get(name), FunctionType):
            names[name] = _helper(names[name])
    answer = FunctionType(
        function.__code__, names, function.__name__, function.__defaults__, function.__closure__
    )
    answer.__module__ = function.__module__
    return answer


@cache
def _helper(function: FunctionType) -> Any:
    return inlined(compilable(function))


def law_step(parameters: Any, state: Any, measurement: Any, reference: float) -> Any:
    """Return the step of the law that `parameters` belong to."""
    return _LAWS[type(parameters)].step(parameters, state, measurement, reference)


def law_initial(parameters: Any, measurement: Any, reference: float) -> Any:
    """Return the first state of the law that `parameters` belong to."""
    return _LAWS[type(parameters)].initial(parameters, measurement, reference)


@overload(law_step, jit_options=_INLINE)
def _law_step(parameters, state, measurement, reference):  # type: ignore[no-untyped-def]  # noqa: ARG001
    step = inlined(compilable(_LAWS[parameters.instance_class].step))
    return lambda parameters, state, measurement, reference: step(
        parameters, state, measurement, reference
    )


@overload(law_initial, jit_options=_INLINE)
def _law_initial(parameters, measurement, reference):  # type: ignore[no-untyped-def]  # noqa: ARG001
    initial = inlined(compilable(_LAWS[parameters.instance_class].initial))
    return lambda parameters, measurement, reference: initial(parameters, measurement, reference)


def gather(like: Any, work: Any, start: int, stride: int) -> Any:
    """Return a named tuple of the class of `like` from work[start], work[start + stride], ..."""
    kind = type(like)
    return kind(*(work[start + n * stride] for n in range(len(kind._fields))))


def scatter_where(due: bool, values: Any, work: Any, start: int, stride: int) -> None:
    """Write a named tuple's fields to work[start], work[start + stride], ... where `due`."""
    for n, value in enumerate(values):
        if due:
            work[start + n * stride] = value


def _function(source: str, **names: Any) -> Any:
    space = dict(names)
    exec(source, space)  # the field count is known to the compiler only as source
    return space["f"]


@overload(gather, jit_options=_INLINE)
def _gather(like, work, start, stride):  # type: ignore[no-untyped-def]  # noqa: ARG001
    if not isinstance(like, types.NamedTuple | types.NamedUniTuple):
        return None
    if any(isinstance(field, types.Array) for field in like):  # not of a lane: handed through
        return lambda like, work, start, stride: like  # noqa: ARG005
    fields = ", ".join(
        f"work[start + {n} * stride]" for n in range(len(like.instance_class._fields))
    )
    return _function(
        f"def f(like, work, start, stride):\n    return Kind({fields})", Kind=like.instance_class
    )


@overload(scatter_where, jit_options=_INLINE)
def _scatter_where(due, values, work, start, stride):  # type: ignore[no-untyped-def]  # noqa: ARG001
    if not isinstance(values, types.NamedTuple | types.NamedUniTuple):
        return None
    lines = "".join(
        f"    i = start + {n} * stride\n    work[i] = values[{n}] if due else work[i]\n"
        for n in range(len(values.instance_class._fields))
    )
    return _function(f"def f(due, values, work, start, stride):\n{lines}")
