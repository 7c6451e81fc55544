"""How the texts that options take are read: names, pairs NAME=VALUE, depths and their units."""

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

from swimbladder.errors import InputError
from swimbladder.units import quantity, with_one_unit

Given = str | None  # a text that need not be given
Several = list[str] | None  # likewise, more than one
_Value = TypeVar("_Value")


def names(text: str) -> tuple[str, ...]:
    """Return the names of NAME,NAME; none of ``none``."""
    found = tuple(name.strip() for name in text.split(",") if name.strip())
    return () if found in ((), ("none",)) else found


def depth_pair(text: str, option: str) -> tuple[float, float]:
    """Return two depths [m] of LEAST:MOST, with one unit for both or one each.

    Raises InputError naming the option.
    """
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 2 or not all(parts):
        why, remedy = "two depths are given with a colon between", 'Write it like "0:10 m"'
        raise InputError(why, field=option, value=text, unit="m", remedy=remedy)
    first, last = (quantity(part, "m", option) for part in with_one_unit(parts))
    return first, last


def pair(text: str, option: str) -> tuple[str, str]:
    """Return NAME and VALUE of a text NAME=VALUE given to `option`.

    Raises InputError naming the option where it is none.
    """
    name, sign, value = text.partition("=")
    if not sign or not name.strip() or not value.strip():
        remedy = f"Write it as {option} NAME=VALUE"
        raise InputError("not a pair", field=option, value=text, remedy=remedy)
    return name.strip(), value.strip()


def once(pairs: Sequence[tuple[str, _Value]], option: str) -> dict[str, _Value]:
    """Return the pairs as a dictionary; raises InputError where a name stands twice."""
    found: dict[str, _Value] = {}
    for name, value in pairs:
        if name in found:
            raise InputError("given twice", field=option, value=name, remedy="Give it once")
        found[name] = value
    return found


def pairs(texts: Sequence[str], option: str) -> dict[str, str]:
    """Return the pairs NAME=VALUE of an option; raises InputError where a name stands twice."""
    return once([pair(text, option) for text in texts], option)


def deviation(unit: str) -> Callable[[str, str], float]:
    """Return what reads a standard deviation in `unit`, infinite for ``none``."""

    def read(text: str, option: str) -> float:
        return math.inf if text.strip().lower() == "none" else quantity(text, unit, option)

    return read
