"""The estimate of a parameter, and how those of several steps or logs are pooled."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.units import format_quantity

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A value with its standard deviation and 95 % interval, in `unit`.

    origin: data; set: given by the user; none: not identifiable, and `why` is the sentence
    that says so. Then value and std are None; the interval may still have an end.
    """

    value: float | None
    std: float | None
    ci95: tuple[float, float]
    unit: str
    origin: Literal["data", "set", "none"] = "data"
    why: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            "value": self.value,
            "std": self.std,
            "ci95": list(self.ci95),
            "unit": self.unit,
            "origin": self.origin,
            "why": self.why or None,
        }


def estimated(
    value: float, std: float, unit: str, *, df: float = math.inf, reach: float | None = None,
    logarithmic: bool = False,
) -> Estimate:  # fmt: skip
    """Return the estimate of a normal quantity or, where `logarithmic`, of a log-normal one.

    df: degrees of freedom behind `std`; Student's interval. reach: half the interval, where known.
    """
    reach = _quantile(df) * std if reach is None else reach
    if logarithmic and value > 0.0:
        factor = math.exp(min(reach / value, 700.0))
        return Estimate(value, std, (value / factor, value * factor), unit)
    return Estimate(value, std, (value - reach, value + reach), unit)


def given(value: float, unit: str) -> Estimate:
    """Return what the user set."""
    return Estimate(value, 0.0, (value, value), unit, "set")


def not_identifiable(unit: str, why: str) -> Estimate:
    """Return an estimate without value: not identifiable."""
    return Estimate(None, None, (math.nan, math.nan), unit, "none", why)


def bounded(low: float, high: float, unit: str, why: str) -> Estimate:
    """Return an estimate that is only an interval."""
    return Estimate(None, None, (low, high), unit, "none", why)


_SHOWN = {"m/s/V": "mm/s/V", "m/s": "mm/s", "m3/s/V": "cm3/s/V", "m3/s": "cm3/s"}


def shown_unit(unit: str) -> str:
    """Return the unit in which people read a number that is in `unit`: m/s -> mm/s, else itself."""
    return _SHOWN.get(unit, unit)


def shown(value: float, unit: str, digits: int = 4) -> str:
    """Return a value in SI as people read it: (0.005245, "m/s") -> "5.245 mm/s"."""
    if unit == "-":
        return f"{value:.{digits}g}"
    return format_quantity(value, unit, shown_unit(unit), digits)


def _quantile(df: float) -> float:
    from scipy.stats import t

    return float(t.ppf(0.975, max(df, 1.0)))


class Pooled(NamedTuple):
    """A mean of several estimates that differ by chance, and perhaps by more than chance."""

    mean: float
    std: float  # of the mean
    between: float  # standard deviation between the true values of the several
    df: float  # degrees of freedom for the interval of the mean
    p: float  # probability of such differences by chance alone

    def estimate(self, unit: str, *, positive: bool = False) -> Estimate:
        """Return it as an estimate; what is `positive` has an interval that is."""
        found = estimated(self.mean, self.std, unit, df=self.df)
        low, high = found.ci95
        return replace(found, ci95=(max(low, 0.0), high)) if positive else found


def pool(values: ArrayLike, stds: ArrayLike) -> Pooled:
    """Return the random-effects mean of independent estimates with standard deviations.

    The spread between them is that of Paule and Mandel (J. Res. NBS 87, 1982, 377): it makes the
    weighted sum of squares what chance would make it, and is zero where that is small already.
    The degrees of freedom are Satterthwaite's, between those of the spread and infinity.
    """
    from scipy.optimize import brentq
    from scipy.stats import chi2

    x, var = np.asarray(values, float), np.asarray(stds, float) ** 2
    var = np.maximum(var, 1e-30 * float(np.max(x**2, initial=1e-300)))
    n = len(x)

    def excess(spread: float) -> float:
        w = 1.0 / (var + spread)
        return float(w @ (x - w @ x / w.sum()) ** 2) - (n - 1)

    chance = float(chi2.sf(excess(0.0) + n - 1, n - 1)) if n > 1 else 1.0
    spread = 0.0
    if n > 1 and excess(0.0) > 0.0:
        top = float(np.ptp(x)) ** 2 * n
        spread = float(brentq(excess, 0.0, top, xtol=1e-9 * top))
    w = 1.0 / (var + spread)
    total, within = 1.0 / w.sum(), float((w**2) @ var) / float(w.sum()) ** 2
    share = 1.0 - within / total
    df = (n - 1) / share**2 if share > 1e-6 else math.inf
    return Pooled(float(w @ x / w.sum()), math.sqrt(total), math.sqrt(spread), df, chance)
