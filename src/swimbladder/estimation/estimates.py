"""An estimated number with what is known of its error, what was known before, and what to say."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from swimbladder.errors import InputError
from swimbladder.io.answers import as_json
from swimbladder.physics.arrays import Array
from swimbladder.units import (
    parse_quantity,
    quantity,
    say,
    texts_of,
    unit_of,
    with_one_unit,
)
from swimbladder.vehicle.schema import did_you_mean

Origin = Literal["data", "prior", "set", "none"]
Severity = Literal["note", "warning", "no"]

Z95 = 1.959963984540054  # of the normal distribution, two-sided
DRIFT_STD = 0.1 / 6e7  # m3/s, of a neutral volume before a log: 0.1 cm3 a minute to the last bit


class Prior(NamedTuple):
    """What is known of a quantity before the data: normal, mean and standard deviation in SI."""

    mean: float
    std: float


_PLUS_MINUS = re.compile(r"\+-|\+/-|±")


def read_values(given: Mapping[str, Any] | None, units: Mapping[str, str]) -> dict[str, float]:
    """Return what is `fixed` in SI, of which each may be a text with a unit, ``"0.5 V"``.

    units: the names that can be, with their SI units. Raises InputError for what is none.
    """
    return {name: _quantity(x, units, "fixed", name) for name, x in (given or {}).items()}


def read_priors(given: Mapping[str, Any] | None, units: Mapping[str, str]) -> dict[str, Prior]:
    """Return `priors` in SI, of which each may be a text, ``"2e-6 +- 1e-6 m3/m"``.

    A unit that stands at one of the numbers only counts for both; a deviation in % is of the mean.
    units: the names that can be, with their SI units. Raises InputError for what is none.
    """
    found = {}
    for name, value in (given or {}).items():
        check_names([name], units, "priors", "there is no such parameter")
        parts = _PLUS_MINUS.split(value) if isinstance(value, str) else value
        if isinstance(parts, float | int) or len(parts) != 2:
            what, unit = "a prior has a mean and a standard deviation", units[name]
            how = f'Write it as `priors={{"{name}": "{f"MEAN +- STD {unit}".rstrip()}"}}`'
            field = f"priors[{name}]"
            raise InputError(what, field=field, value=value, unit=unit, remedy=how)
        mean, std = parts
        if isinstance(value, str) and unit_of(std) == "%":
            middle = _quantity(mean, units, "priors", name)
            found[name] = Prior(middle, abs(middle) * parse_quantity(std, ""))
            continue
        if isinstance(value, str):
            mean, std = with_one_unit([mean, std])[0], with_one_unit([std, mean])[0]
        found[name] = Prior(*(_quantity(x, units, "priors", name) for x in (mean, std)))
    return found


def _quantity(value: Any, units: Mapping[str, str], option: str, name: str) -> float:
    """Return a number as it is, and a text in the unit of its name."""
    check_names([name], units, option, "there is no such parameter")
    if not isinstance(value, str):
        return float(value)
    return quantity(value, units[name], f"{option}[{name}]")


class Finding(NamedTuple):
    """Something a person has to know; severity no: a question that the data do not answer."""

    kind: str
    severity: Severity
    sentence: str

    @classmethod
    def of(
        cls, room: str, key: str, severity: Severity | None = None, /, **values: Any
    ) -> "Finding":
        """Return the finding whose text is at that place in sentences.toml."""
        known = texts_of("estimation")[room][key]
        kind = known.get("kind", key)
        return cls(kind, severity or known["severity"], sentence(room, key, **values))


_TOO_MANY = 0.1  # of the samples


def too_many(outliers: int, samples: int) -> bool:
    """Return whether more than a tenth of a log are outliers, beyond chance: it says nothing."""
    chance = 3.0 * math.sqrt(_TOO_MANY * (1.0 - _TOO_MANY) * samples)
    return outliers > _TOO_MANY * samples + chance


def sentence(room: str, key: str, text: str = "text", /, **values: Any) -> str:
    """Return a text of sentences.toml with the values that it names."""
    return say("estimation", room, key, text, **values)


def check_names(
    names: Sequence[str], known: Iterable[str], option: str, what: str, more: str = ""
) -> None:
    """Raise InputError for a name that is not known, saying `what`, or that is there twice."""
    for name in names:
        if name not in known:
            remedy = f"{did_you_mean(name, known)}Choose from {', '.join(known)}{more}"
            raise InputError(what, field=option, value=name, remedy=remedy)
        if names.count(name) > 1:
            raise InputError("named twice", field=option, value=name, remedy="Name it once")


_SERIES = ("time", "depth", "pressure", "volume", "piston", "voltage")


def check_distinct(logs: Sequence[Any]) -> None:
    """Raise InputError where the samples of a log are there twice: they would count for two."""
    seen: dict[tuple[bytes, ...], str] = {}
    for log in logs:
        series = [values for name in _SERIES if (values := getattr(log, name, None)) is not None]
        key = tuple(values.tobytes() for values in series)
        if key in seen:
            what = f"its samples are those of {seen[key]}, and would count twice"
            remedy = "Give each log once"
            raise InputError(what, field="LOG", value=log.source, remedy=remedy)
        seen[key] = log.source


@dataclass(frozen=True)
class Estimate:
    """A value with its standard deviation and 95 % interval, in `unit`.

    origin: data; prior: the data hardly narrow what was known before; set: given, not estimated;
    none: not identifiable, and `why` is the sentence that says so. Then value and std are NaN; the
    interval may still have an end.
    """

    value: float
    std: float
    ci95: tuple[float, float]
    unit: str
    origin: Origin = "data"
    why: str = ""

    @property
    def known(self) -> bool:
        """Whether there is a number."""
        return self.origin != "none"

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return as_json(self, "value std ci95 unit origin")

    @classmethod
    def of(
        cls,
        value: float,
        std: float,
        unit: str,
        *,
        logarithmic: bool = False,
        origin: Origin = "data",
        reach: float | None = None,
    ) -> "Estimate":
        """Return the estimate of a normal quantity or, where `logarithmic`, of a log-normal one.

        std: of the value [unit], in the logarithmic case value times that of the logarithm. reach:
        half the interval, where it is not that of a normal distribution.
        """
        reach = Z95 * std if reach is None else reach
        if logarithmic and value > 0.0:
            factor = math.exp(min(reach / value, 700.0))
            return cls(value, std, (value / factor, value * factor), unit, origin)
        return cls(value, std, (value - reach, value + reach), unit, origin)

    @classmethod
    def given(cls, value: float, unit: str) -> "Estimate":
        """Return what the user set."""
        return cls(value, 0.0, (value, value), unit, "set")

    @classmethod
    def bounded(cls, low: float, high: float, unit: str, why: str) -> "Estimate":
        """Return an estimate that is only an interval."""
        return cls(math.nan, math.nan, (low, high), unit, "none", why)

    @classmethod
    def unknown(cls, unit: str, why: str) -> "Estimate":
        """Return an estimate without value: not identifiable."""
        return cls.bounded(math.nan, math.nan, unit, why)


_CLAIMED = 1e-4  # of a value: no log knows it better where a model error makes the residual
MODEL_ERROR = 5.0  # times the sensor's noise, such a residual


def claims_too_much(std: float, size: float, misfit: float) -> bool:
    """Return whether a deviation says only how bent a function is, whose residual is no noise.

    size: of the quantity; misfit: the residual over the sensor's noise.
    """
    return misfit > MODEL_ERROR and std < _CLAIMED * size


def undetermined(
    e: Estimate, limits: tuple[float, float] = (-math.inf, math.inf), misfit: float = 1.0
) -> str:
    """Return why an estimate is no number to go on with, empty where it is one.

    It is one where its interval ends on both sides, inside the limits where a search has to stay,
    and does not claim too much (see `claims_too_much`).
    """
    low, high = e.ci95
    open_ends = not limits[0] < low, not high < limits[1]
    if any(open_ends) or not low <= e.value <= high:
        side = "above" if not open_ends[0] else "below" if not open_ends[1] else "on either side"
        return sentence("undetermined", "open", side=side)
    if claims_too_much(e.std, abs(e.value), misfit):
        return sentence("undetermined", "claims", times=misfit)
    return ""


_GRAVITY = 9.80665  # m/s2; to within a percent everywhere
_LIGHTEST, _HEAVIEST = 0.9, 4.0  # of the water displaced
_NONE = (0.25, 10.0)  # of it: only other units make a vehicle so light or so heavy
_STEEPEST = 0.5  # kg/m3 that water is denser a metre down, where no cast says so


def impossible_mass(m: Estimate, weight: float, dry_mass: float | None) -> Iterator[Finding]:
    """Yield where no hull has such a mass [kg]: for sure a no, by the value alone a warning.

    weight: of the water that the hull displaces [N].
    """
    of_water = weight / _GRAVITY
    least = max(_LIGHTEST * of_water, 0.98 * (dry_mass or 0.0))
    most = _HEAVIEST * of_water
    if least <= m.value <= most:
        return
    wrong = "heavy"
    if m.value < least:
        wrong = "dry" if dry_mass is not None and m.value < 0.98 * dry_mass else "light"
    sure = m.ci95[1] < least or m.ci95[0] > most
    sure = sure or not _NONE[0] * of_water < m.value < _NONE[1] * of_water
    masses = {"dry": dry_mass, "water": of_water, "times": m.value / of_water}
    why = sentence("motion", "mass", wrong, **masses)
    yield Finding.of("motion", "mass", "no" if sure else "warning", mass=m.value, wrong=why)


def impossible_psi(psi: Estimate, specific_weight: float, displaced: float) -> Iterator[Finding]:
    """Yield where no water has such a psi [m3/m]; of the water [N/m3], and the hull [m3]."""
    per = -specific_weight / _GRAVITY / displaced  # kg/m4 over m3/m
    if per * psi.ci95[1] > _STEEPEST:
        yield Finding.of("motion", "stratified", psi=psi.value, gradient=per * psi.value)


def crossing(
    beyond: Callable[[float], float],
    step: float,
    *,
    farthest: float,
    growth: float = 2.0,
    xtol: float,
) -> float | None:
    """Return where a profile rises above 0 on one side of its best place, which is at 0.

    step: the first, whose sign is the side; later places are `growth` times as far. None where it
    does not up to `farthest`.
    """
    from scipy.optimize import brentq

    near, far = 0.0, step
    while beyond(far) < 0.0:
        near, far = far, growth * far
        if abs(far) >= farthest:
            return None
    return float(brentq(beyond, near, far, xtol=xtol))


def bounded_fit(
    residual: Callable[[Array], Array],
    slope: Callable[[Array], Array],
    begin: Array,
    limits: tuple[Array, Array],
    *,
    ends: tuple[float, float, float],
    most: int,
    edge: float = 0.0,
    scale: float | Array = 1.0,
) -> tuple[float, Array]:
    """Return half the least sum of squares that is found from `begin` on, and its place.

    ends: relative changes of place and sum that end the search, and the size of the gradient;
    most: evaluations; edge: by how much it begins inside the limits; scale: of a place.
    """
    from scipy.optimize import least_squares

    xtol, ftol, gtol = ends
    x = np.clip(begin, limits[0] + edge, limits[1] - edge)
    found = least_squares(
        residual, x, slope, limits, "trf", ftol, xtol, gtol, x_scale=scale, max_nfev=most
    )
    return float(found.cost), np.asarray(found.x, float)
