"""Parameters given on the command line: values, priors, standard deviations, with their units."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swimbladder.cli.common import quantity
from swimbladder.cli.options import Options, valued
from swimbladder.cli.texts import Given, Several, once, pair, unit_of, with_one_unit
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.estimation.motion import Prior

_PLUS_MINUS = re.compile(r"\+-|\+/-|±")


def setting(text: str, units: Mapping[str, str]) -> tuple[str, float]:
    """Return name and value, in SI, of "psi=2e-6 m3/m" given to --set.

    units: the names that can be, with their SI units. Raises InputError naming option and value.
    """
    name, value = _named(text, "--set", units)
    return name, quantity(value, units[name], f"--set {name}")


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
        why = "a prior has a mean and a standard deviation"
        raise InputError(why, field=field, value=value, unit=unit, remedy=how)
    mean_text, std_text = (part.strip() for part in parts)
    if unit_of(std_text) == "%":
        mean = quantity(mean_text, unit, field)
        return name, Prior(mean, abs(mean) * quantity(std_text, "", field))
    both = (with_one_unit([mean_text, std_text])[0], with_one_unit([std_text, mean_text])[0])
    return name, Prior(*(quantity(text, unit, field) for text in both))


def _held(texts: Sequence[str], option: str) -> dict[str, float]:
    return once([setting(text, _units()) for text in texts], option)


def _priors(texts: Sequence[str], option: str) -> dict[str, Prior]:
    return once([known(text, _units()) for text in texts], option)


@dataclass(frozen=True)
class Sought(Options):
    """What is identified, and what is known of it."""

    free: Given = valued(
        "NAME,...",
        "Parameters to identify: K2, T2, psi; mass, drag_quadratic; K1, T1 (those of the "
        "drag law, and psi).",
    )
    fixed: Several = valued(
        "NAME=VALUE", 'Fix at a value: "psi=2e-6 m3/m".', name="--set", read=_held
    )
    priors: Several = valued(
        "NAME=VALUE", 'Prior: "psi=2e-6 +- 1e-6 m3/m".', name="--prior", read=_priors
    )
    drag: Given = valued("LAW", "linear, quadratic or blended (the vehicle's).")


def deviation(unit: str) -> Callable[[str, str], float]:
    """Return what reads a standard deviation in `unit`, infinite for ``none``."""

    def read(text: str, option: str) -> float:
        return math.inf if text.strip().lower() == "none" else quantity(text, unit, option)

    return read


def _units() -> dict[str, str]:
    from swimbladder.estimation.motion.problem import NAMES

    return {name: about.unit for name, about in NAMES.items()}


def _named(text: str, option: str, units: Mapping[str, str]) -> tuple[str, str]:
    """Return name and value of NAME=VALUE; raises InputError for a name that cannot be."""
    from swimbladder.vehicle.schema import did_you_mean

    name, value = pair(text, option)
    if name not in units:
        remedy = f"{did_you_mean(name, units)}Choose from {', '.join(units)}"
        raise InputError("there is no such parameter", field=option, value=name, remedy=remedy)
    return name, value
