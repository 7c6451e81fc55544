"""Named tuples within named tuples, as parameters and states of laws may be, seen as flat numbers.

A number that is not a record itself is a leaf. Files, commands and reports name the leaves of a
law's parameters, wherever they stand; the names of the records between are for its source.
"""

import sys
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar

from swimbladder.control.law import Count
from swimbladder.errors import InputError

Kind = TypeVar("Kind")
Found = TypeVar("Found")


def _once(find: Callable[[type[Any]], Found]) -> Callable[[type[Any]], Found]:
    """Find something of a class of records once."""
    remembered: Any = cache
    found: Callable[[type[Any]], Found] = remembered(find)
    return found


def is_record(kind: type[Any]) -> bool:
    """Return whether a field's type is a named tuple."""
    return isinstance(kind, type) and hasattr(kind, "_fields")


def field_types(kind: type[Any]) -> Mapping[str, Any]:
    """Return the type of each field of a named tuple as it is annotated, float where it is not.

    Without its unit: that of `Annotated[float, "m3"]` is float.
    """
    return {name: written for name, (written, _) in _fields(kind).items()}


@_once
def units(kind: type[Any]) -> Mapping[str, str]:
    """Return the units of the fields and leaves of a record that are annotated with one."""
    found: dict[str, str] = {}
    for name, (written, unit) in _fields(kind).items():
        found |= units(written) if is_record(written) else {}
        found |= {name: unit} if unit is not None else {}
    return MappingProxyType(found)


@_once
def _fields(kind: type[Any]) -> Mapping[str, tuple[Any, str | None]]:
    """Return type and unit of each field."""
    module, found = vars(sys.modules[kind.__module__]), {}
    for field in kind._fields:
        written = getattr(kind, "__annotations__", {}).get(field, float)
        if isinstance(written, typing.ForwardRef):
            written = written.__forward_arg__
        if isinstance(written, str):
            with suppress(NameError):  # a class within a function: its names are not at hand
                written = eval(written, dict(module))
        unit = None
        if typing.get_origin(written) is typing.Annotated:
            base, *said = typing.get_args(written)
            counted = [base, *said[:1]] == list(typing.get_args(Count))
            unit = next(iter(said[counted:]), None)
            written = Count if counted else base
        found[field] = (written, unit)
    return found


@_once
def leaf_names(kind: type[Any]) -> tuple[str, ...]:
    """Return the names of a law's parameters, in their order.

    Raises InputError where two of them share a name.
    """
    found: list[str] = []
    for field, written in field_types(kind).items():
        found.extend(leaf_names(written) if is_record(written) else (field,))
    twice = next((name for n, name in enumerate(found) if name in found[:n]), None)
    if twice is not None:
        what = f"the field {twice!r} stands in {kind.__name__} twice"
        remedy = "Give each number a name of its own, also across nested NamedTuples"
        raise InputError(what, field=kind.__qualname__, remedy=remedy)
    return tuple(found)


def numbers(record: Any) -> Iterator[Any]:
    """Yield the leaves of a record, in their order."""
    for value in record:
        if isinstance(value, tuple):
            yield from numbers(value)
        else:
            yield value


def leaves(record: Any) -> dict[str, Any]:
    """Return the leaves of a record by name."""
    return dict(zip(leaf_names(type(record)), numbers(record), strict=True))


def from_numbers(kind: type[Kind], given: Iterable[Any]) -> Kind:
    """Return a record of its leaves in their order."""
    left = iter(given)

    def made(kind: type[Any]) -> Any:
        return kind(*(made(t) if is_record(t) else next(left) for t in field_types(kind).values()))

    found: Kind = made(kind)
    return found


def from_leaves(kind: type[Kind], values: Mapping[str, Any]) -> Kind:
    """Return a record of the values of its leaves; more of them than it has do no harm."""
    return from_numbers(kind, (values[name] for name in leaf_names(kind)))
