"""Parameters given on the command line: values, priors, standard deviations, with their units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

from swimbladder.cli.common import quantity
from swimbladder.cli.logs import pair
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.estimation.motion import Prior

__all__ = ["deviation", "held", "known", "once", "priors", "setting"]

_PLUS_MINUS = re.compile(r"\+-|\+/-|±")
_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_Value = TypeVar("_Value")


def setting(text: str, units: Mapping[str, str]) -> tuple[str, float]:
    """Return name and value, in SI, of "psi=2e-6 m3/m" given to --set.

    units: the names that can be, with their SI units. Raises InputError naming option and value.
    """
    name, value = _named(text, "--set", units)
    return name, _number(value, units[name], f"--set {name}")


def known(text: str, units: Mapping[str, str]) -> tuple[str, Prior]:
    """Return name and prior, in SI, of "psi=2e-6 +- 1e-6 m3/m" given to --prior.

    A unit that stands at one of the numbers only counts for both; a deviation in % is of the mean.
    Raises InputError naming option and value.
    """
    from swimbladder.estimation.motion import Prior

    name, value = _named(text, "--prior", units)
    field, unit = f"--prior {name}", units[name]
    how = f'Write it as --prior "{name}=MEAN +- STD {unit}"'
    parts = _PLUS_MINUS.split(value)
    if len(parts) != 2:
        raise InputError(
            "a prior has a mean and a standard deviation",
            field=field,
            value=value,
            unit=unit,
            remedy=how,
        )
    mean_text, std_text = (part.strip() for part in parts)
    mean_unit, std_unit = _unit(mean_text), _unit(std_text)
    if std_unit == "%":
        mean = _number(mean_text, unit, field)
        std = abs(mean) * _number(std_text, "", field)
    else:
        mean = _number(mean_text if mean_unit else f"{mean_text} {std_unit}", unit, field)
        std = _number(std_text if std_unit else f"{std_text} {mean_unit}", unit, field)
    if not std > 0.0:
        raise InputError(
            "the standard deviation of a prior has to be above 0",
            field=field,
            value=value,
            unit=unit,
            remedy=f'{how}; or --set "{name}=VALUE {unit}" for what is known exactly',
        )
    return name, Prior(mean, std)


def held(texts: Sequence[str] | None) -> dict[str, float]:
    """Return the values, in SI, of all that is given to --set.

    Raises InputError naming option and value.
    """
    units = _units()
    return once([setting(text, units) for text in texts or []], "--set")


def priors(texts: Sequence[str] | None) -> dict[str, Prior]:
    """Return the priors, in SI, of all that is given to --prior.

    Raises InputError naming option and value.
    """
    units = _units()
    return once([known(text, units) for text in texts or []], "--prior")


def deviation(text: str, unit: str, option: str) -> float:
    """Return a standard deviation in `unit`, infinite for ``none``.

    Raises InputError naming the option where it is not above 0.
    """
    if text.strip().lower() == "none":
        return math.inf
    number = _number(text, unit, option)
    if not number > 0.0:
        raise InputError(
            "it must be above 0",
            field=option,
            value=text,
            unit=unit,
            remedy="Give a standard deviation, or none for no assumption",
        )
    return number


def once(pairs: Sequence[tuple[str, _Value]], option: str) -> dict[str, _Value]:
    """Return the pairs as a dictionary; raises InputError where a name stands twice."""
    found: dict[str, _Value] = {}
    for name, value in pairs:
        if name in found:
            raise InputError("given twice", field=option, value=name, remedy="Give it once")
        found[name] = value
    return found


def _units() -> dict[str, str]:
    from swimbladder.estimation.motion.model import NAMES

    return {name: about.unit for name, about in NAMES.items()}


def _named(text: str, option: str, units: Mapping[str, str]) -> tuple[str, str]:
    """Return name and value of NAME=VALUE; raises InputError for a name that cannot be."""
    from swimbladder.vehicle.schema import did_you_mean

    name, value = pair(text, option)
    if name not in units:
        raise InputError(
            "there is no such parameter",
            field=option,
            value=name,
            remedy=f"{did_you_mean(name, units)}Choose from {', '.join(units)}",
        )
    return name, value


def _number(text: str, unit: str, field: str) -> float:
    number = quantity(text, unit, field)
    assert number is not None  # a text is given
    return number


def _unit(text: str) -> str:
    """Return what stands behind a number, "" where nothing does."""
    number = _NUMBER.match(text)
    return "" if number is None else text[number.end() :].strip()
