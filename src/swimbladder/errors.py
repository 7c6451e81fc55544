"""What swimbladder raises.

::

    SwimbladderError
    |-- InputError            something the user gave is wrong             exit code 2
    |   |-- UnitError         a text that is not a quantity of the asked unit
    |   |-- LogError          a measured log that cannot be read or used
    `-- NoAnswerError         the input is fine, the answer is "no"        exit code 1

Every message names the place, the value, the unit and the remedy, so that it can be acted on
without reading the source.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any, Self


class SwimbladderError(Exception):
    """The root of all errors that swimbladder raises on purpose."""

    exit_code = 1


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


def check_number(
    value: float,
    field: str,
    unit: str = "",
    *,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
    finite: bool = True,
    remedy: str = "Check the number and its unit",
) -> None:
    """Raise InputError about `field` for a number that is not within its bounds, or not finite."""
    if isinstance(value, str) or not hasattr(value, "__float__"):
        raise InputError("not a number", field=field, value=value, unit=unit, remedy=remedy)
    if value >= least and value > above and value <= most and (math.isfinite(value) or not finite):
        return
    bound = f"above {above:g}" if above > -math.inf else f"{least:g} or more"
    if most < math.inf:
        bound += f" and {most:g} at most"
    elif value == math.inf:
        bound += " and finite"
    unbounded = max(least, above) == -math.inf and most == math.inf
    what = "not a finite number" if unbounded else f"it must be {bound}"
    raise InputError(what, field=field, value=value, unit=unit, remedy=remedy)


def _short(value: object, limit: int = 80) -> str:
    text = repr(value)
    return text if len(text) <= limit else text[: limit - 3] + "..."
