"""What swimbladder raises.

::

    SwimbladderError
    |-- InputError            something the user gave is wrong             exit code 2
    |   |-- UnitError         a text that is not a quantity of the asked unit
    |   |-- LogError          a measured log that cannot be read or used
    `-- NoAnswerError         the input is fine, the answer is "no"        exit code 1

Every message names the place, the value, the unit and the remedy, so that it can be acted on
without reading the source. It calls a parameter as Python does, `goal="energy"`; the command line
prints the option of it, --goal energy: by `OPTIONS`, which a command fills while it runs.
"""

from __future__ import annotations

import ast
import json
import math
import re
import sys
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from numbers import Integral
from pathlib import Path
from typing import Any, Self

OPTIONS: dict[str, str] = {}
"""The options of the command that runs, by the parameters that they are in Python."""

_PARAMETER = re.compile(r"`(\w+)=([^`]*)`")


class Parameter(str):
    """A field that is a parameter, where a file stands beside it."""

    __slots__ = ()


def as_asked(text: str, options: Mapping[str, str] = OPTIONS) -> str:
    """Return a text whose parameters are named as the user gave them: `depth=9` as --depth 9."""
    return _PARAMETER.sub(lambda found: _option(found, options), text) if options else text


def column_as(name: str, column: str) -> str:
    """Return how a column of a file is given: `columns={"depth_m": "z@cm"}`."""
    return f"`columns={json.dumps({name: column}, ensure_ascii=False)}`"


def _option(found: re.Match[str], options: Mapping[str, str]) -> str:
    option, text = options.get(found[1]), found[2]
    if option is None:
        return found[0]
    try:
        value = ast.literal_eval(text) if text else True
    except (SyntaxError, ValueError):
        return f"{option} {text}"
    if isinstance(value, bool):
        return option
    if isinstance(value, Mapping):
        return " ".join(f'{option} "{name}={one}"' for name, one in value.items())
    said = ":".join(map(str, value)) if isinstance(value, tuple) else str(value)
    return f'{option} "{said}"' if " " in said else f"{option} {said}"


class SwimbladderError(Exception):
    """The root of all errors that swimbladder raises on purpose."""

    exit_code = 1

    def asked(self, options: Mapping[str, str] = OPTIONS) -> Self:
        """Return the same error, its parameters named by their options."""
        return type(self)(as_asked(str(self), options))


@dataclass(eq=False, repr=False)
class InputError(SwimbladderError):
    """Something the user gave is wrong; the message says where, what and how to mend it.

    what: one sentence on what is wrong. file: the file it stands in. field: the dotted key,
    option, column or argument; line: the line in the file, counted from 1. value: what was
    given. unit: the unit that was expected. remedy: one sentence on what to do.
    """

    exit_code = 2

    what: str
    _: KW_ONLY
    file: str | Path | None = None
    line: int | None = None
    field: str | None = None
    value: object = None
    unit: str | None = None
    remedy: str | None = None

    def __post_init__(self) -> None:
        self.what = self.what.rstrip(".")
        super().__init__(self._text())

    def _text(self) -> str:
        line = None if self.line is None else f"line {self.line}"
        given = None if self.value is None else f"got {_short(self.value)}"
        asked = f"expected unit {self.unit}" if self.unit else None
        place = ", ".join(str(part) for part in (self.file, line, self.field) if part)
        details = ", ".join(part for part in (given, asked) if part)
        text = f"{place}: {self.what}" if place else self.what
        text += f" ({details})." if details else "."
        if not self.remedy:
            return text
        return f"{text} {self.remedy}" + ("" if self.remedy.endswith((".", "?", "!")) else ".")

    def at(
        self, *, file: str | Path | None = None, field: str | None = None, line: int | None = None
    ) -> InputError:
        """Return the same error with the place filled in where it was not known."""
        place = {"file": file, "field": field, "line": line}
        return self.but(**{name: x for name, x in place.items() if getattr(self, name) is None})

    def asked(self, options: Mapping[str, str] = OPTIONS) -> Self:
        """Return the same error, its parameters named by their options."""
        field, remedy = self.field or "", as_asked(self.remedy or "", options) or None
        if self.file is None or isinstance(field, Parameter):
            name, _, item = field.partition("[")
            if field in options:
                field = options[field]
            elif name in options and item.endswith("]"):
                field = f"{options[name]} {item[:-1]}"
        what = as_asked(self.what, options)
        return self.but(what=what, remedy=remedy, field=field or None)

    def but(self, **facts: Any) -> Self:
        """Return the same error with other facts, by the names that its creation has for them."""
        return type(self)(**{**vars(self), **facts})


class UnitError(InputError):
    """A text is not a quantity of the unit that was asked for."""


class LogError(InputError):
    """A measured log cannot be read, or cannot be used for what was asked."""


class NoAnswerError(SwimbladderError):
    """The input is fine and the answer is no: unstable, out of stroke, not identifiable."""

    exit_code = 1


_LARGEST = sys.float_info.max


def check_number(
    value: float | None,
    field: str,
    unit: str = "",
    *,
    least: float = -_LARGEST,
    above: float = -math.inf,
    below: float | None = None,
    most: float = _LARGEST,
    remedy: str = "Check the number and its unit",
) -> None:
    """Raise InputError about `field` for a number that is not within its bounds, or not finite.

    None is no number that is given. most: inf where it may be infinite.
    """
    if value is None:
        return
    if isinstance(value, str) or not hasattr(value, "__float__"):
        raise InputError("not a number", field=field, value=value, unit=unit, remedy=remedy)
    if least <= value <= most and above < value and (below is None or value < below):
        return
    bound = f"above {above:g}" if above > -math.inf else f"{least:g} or more"
    if below is not None:
        bound += f" and below {below:g}"
    elif most < _LARGEST:
        bound += f" and {most:g} at most"
    elif value == math.inf:
        bound += " and finite"
    unbounded = (least, above, below, most) == (-_LARGEST, -math.inf, None, _LARGEST)
    what = "not a finite number" if unbounded else f"it must be {bound}"
    raise InputError(what, field=field, value=value, unit=unit, remedy=remedy)


def check_counts(**given: tuple[int | None, int] | tuple[int | None, int, int]) -> None:
    """Raise InputError where a count is no whole number from the least to the most it may be.

    given: by field, the count, what it is at least and, where there is such a limit, at most.
    """
    for field, (value, least, *most) in given.items():
        whole = isinstance(value, Integral) and not isinstance(value, bool)
        if value is not None and not (whole and least <= value <= min(most, default=value)):
            within = f"from {least} to {most[0]:,}" if most else f"of at least {least}"
            remedy = f"Give {field} as a number like {least + 1}"
            what = f"must be a whole number {within}"
            raise InputError(what, field=field, value=value, remedy=remedy)


def _short(value: object, limit: int = 80) -> str:
    text = repr(value)
    return text if len(text) <= limit else text[: limit - 3] + "..."
