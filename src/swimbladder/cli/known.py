"""What the commands are told of parameters: held at a value, or known with a deviation."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from swimbladder.cli.common import quantity
from swimbladder.cli.logs import pair
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.identify import Prior

__all__ = ["held", "known"]

_PLUS_MINUS = re.compile(r"\+-|\+/-|±")
_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


def held(texts: list[str] | None) -> dict[str, float]:
    """Return the values in SI of NAME=VALUE texts given to --set.

    Raises InputError naming the parameter where one cannot be read.
    """
    found = {}
    for text in texts or []:
        name, value, unit = _named(text, "--set")
        number = quantity(value, unit, f"--set {name}")
        assert number is not None
        found[name] = number
    return found


def known(texts: list[str] | None) -> dict[str, Prior]:
    """Return the priors in SI of "NAME=MEAN +- STD UNIT" texts given to --prior.

    A unit that stands at one of the numbers only counts for both; a deviation in % is of the mean.
    Raises InputError naming the parameter where one cannot be read.
    """
    from swimbladder.identify import Prior

    found = {}
    for text in texts or []:
        name, value, unit = _named(text, "--prior")
        field = f"--prior {name}"
        parts = [part.strip() for part in _PLUS_MINUS.split(value)]
        if len(parts) != 2:
            raise InputError(
                "no prior: it has a mean and a standard deviation", field=field, value=value,
                unit=unit, remedy=f'Write it as "{name}=MEAN +- STD {unit}"',
            )  # fmt: skip
        mean_text, std_text = parts
        share = _NUMBER.sub("", std_text).strip() == "%"
        if not share:
            own = [_NUMBER.sub("", part, count=1).strip() for part in parts]
            mean_text += "" if own[0] else f" {own[1]}"
            std_text += "" if own[1] else f" {own[0]}"
        mean, std = (
            quantity(mean_text, unit, field),
            quantity(std_text, "" if share else unit, field),
        )
        assert mean is not None
        assert std is not None
        found[name] = Prior(mean, abs(mean) * std if share else std)
    return found


def _named(text: str, option: str) -> tuple[str, str, str]:
    """Return name, value and unit of NAME=VALUE; raises InputError for a name that cannot be."""
    from swimbladder.identify import NAMES
    from swimbladder.parameters.schema import did_you_mean

    name, value = pair(text, option)
    if name not in NAMES:
        raise InputError(
            "there is no such parameter", field=option, value=name,
            remedy=f"{did_you_mean(name, NAMES)}Choose from {', '.join(NAMES)}",
        )  # fmt: skip
    return name, value, NAMES[name].unit
