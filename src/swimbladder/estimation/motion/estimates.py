"""An estimated number with what is known of its error, and what was known before."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

Origin = Literal["data", "prior", "set"]

Z95 = 1.959963984540054  # of the normal distribution, two-sided


class Prior(NamedTuple):
    """What is known of a quantity before the data: normal, mean and standard deviation in SI."""

    mean: float
    std: float


@dataclass(frozen=True)
class Estimate:
    """A value with its standard deviation and 95 % interval, in `unit`.

    origin: data; prior: the data hardly narrow what was known before; set: given, not estimated.
    """

    value: float
    std: float
    ci95: tuple[float, float]
    unit: str
    origin: Origin = "data"

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            "value": self.value,
            "std": self.std,
            "ci95": list(self.ci95),
            "unit": self.unit,
            "origin": self.origin,
        }


def estimate(
    value: float, std: float, unit: str, *, logarithmic: bool = False, origin: Origin = "data"
) -> Estimate:
    """Return the estimate of a normal quantity or, where `logarithmic`, of a log-normal one.

    std: of the value [unit], in the logarithmic case value times that of the logarithm.
    """
    if logarithmic and value > 0.0:
        factor = math.exp(min(Z95 * std / value, 700.0))
        return Estimate(value, std, (value / factor, value * factor), unit, origin)
    return Estimate(value, std, (value - Z95 * std, value + Z95 * std), unit, origin)
