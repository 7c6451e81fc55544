"""A law made around another one: its records hold those of that one, and its step calls it.

`around` makes it of a step and a first state that are written once, for any law within. In these
`law_step` and `law_initial` are the functions of the law within, and `State` is the class of the
new law's state. They stand in the functions' own names, not in a closure, so that the compiler and
the translation to C find them as they find any other function.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import FunctionType
from typing import Any, NamedTuple

from swimbladder.control.law import Law, Measurement

_MADE: dict[tuple[str, type[Any]], Law] = {}


def law_step(
    parameters: Any, state: Any, measurement: Measurement, reference: float
) -> tuple[float, Any, float]:
    """Stand for the step of the law within."""
    raise NotImplementedError


def law_initial(parameters: Any, measurement: Measurement, reference: float) -> Any:
    """Stand for the first state of the law within."""
    raise NotImplementedError


def State(law: Any, *more: Any) -> Any:  # a class in the functions that are made
    """Stand for the state of the new law: that of the law within, then what `around` is given."""
    raise NotImplementedError


def around(
    law: Law,
    kind: str,
    step: Callable[..., Any],
    initial: Callable[..., Any],
    *,
    parameters: Mapping[str, Any],
    state: Mapping[str, Any],
    **changed: Any,
) -> Law:
    """Return a law made around another, always the same one.

    kind: what the classes of its records begin with; they stand in the module of `step`, so that
    its compiled kernel is found again. parameters, state: fields and their types beyond `law`, that
    of the law within. changed: of the other fields of the law.
    """
    key = kind, law.parameters
    if key not in _MADE:
        module = step.__module__
        name = kind + "".join(part.title() for part in law.name.split("-"))
        Parameters = _record(module, f"{name}Parameters", law.parameters, parameters)
        Made = _record(module, f"{name}State", law.state, state)
        own = {"law_step": law.step, "law_initial": law.initial, "State": Made}
        _MADE[key] = replace(
            law,
            parameters=Parameters,
            state=Made,
            step=_with(step, own),
            initial=_with(initial, own),
            recipe=None,
            within=law,
            **changed,
        )
    return _MADE[key]


def _record(module: str, name: str, within: type[Any], more: Mapping[str, Any]) -> Any:
    """Return a class of named tuples in a module: the law's own, and more."""
    make: Any = NamedTuple
    made = make(name, [("law", within), *more.items()])
    made.__module__ = module
    setattr(sys.modules[module], name, made)
    return made


def _with(function: Callable[..., Any], names: Mapping[str, Any]) -> Callable[..., Any]:
    """Return a function to which some names mean something else."""
    assert isinstance(function, FunctionType)
    space = {**function.__globals__, **names}
    made = FunctionType(function.__code__, space, function.__name__, function.__defaults__)
    made.__doc__, made.__module__ = function.__doc__, function.__module__
    made.__annotations__ = function.__annotations__
    return made
