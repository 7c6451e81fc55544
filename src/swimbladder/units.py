"""Text to SI and back, at the edges only: ``"350 cm3"`` -> 3.5e-4.

A bare number is taken in the unit that the field states, always an SI one (volume per
revolution and lead per revolution excepted: they are stated per ``rev`` as datasheets do).
Angles count as a dimension, so that ``V/rpm`` and ``V s`` cannot be confused.
The grammar: ``mm/s/V``, ``kg m2``, ``V/(rad/s)``, ``m3/rev``, ``1/s``, ``cm^3``, ``s^0.5``, ``%``.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from fractions import Fraction
from functools import cache, lru_cache
from importlib import resources
from string import Formatter
from typing import Any

from swimbladder.errors import UnitError


@dataclass(frozen=True)
class _Unit:
    factor: Fraction
    # powers of metre, kilogram, second, ampere, radian, kelvin, degree Celsius
    dimension: tuple[Fraction | int, ...]

    def times(self, other: _Unit, power: Fraction | int = 1) -> _Unit:
        return _Unit(
            self.factor * Fraction(other.factor**power),
            tuple(a + power * b for a, b in zip(self.dimension, other.dimension, strict=True)),
        )


# Units and their factors by powers of metre, kilogram, second, ampere, radian, kelvin and degree
# Celsius. A temperature in degC and a difference in K are two kinds: 15 degC is no 15 K.
_TABLE = {
    (0, 0, 0, 0, 0, 0, 0): "% 1e-2, ppm 1e-6",
    (1, 0, 0, 0, 0, 0, 0): "m 1, km 1e3, dm 1e-1, cm 1e-2, mm 1e-3, um 1e-6, in 0.0254, ft 0.3048",
    (3, 0, 0, 0, 0, 0, 0): "L 1e-3, l 1e-3, dL 1e-4, mL 1e-6, ml 1e-6, uL 1e-9, cc 1e-6",
    (0, 1, 0, 0, 0, 0, 0): "kg 1, g 1e-3, mg 1e-6, t 1e3, lb 0.45359237",
    (0, 0, 1, 0, 0, 0, 0): "s 1, cs 1e-2, ms 1e-3, us 1e-6, min 60, h 3600, d 86400, year 31557600",
    (0, 0, -1, 0, 0, 0, 0): "Hz 1, kHz 1e3",
    (0, 0, 0, 1, 0, 0, 0): "A 1, mA 1e-3, uA 1e-6",
    (2, 1, -3, -1, 0, 0, 0): "V 1, mV 1e-3, uV 1e-6, kV 1e3",
    (2, 1, -3, -2, 0, 0, 0): "ohm 1, mohm 1e-3, kohm 1e3, Ω 1",
    (2, 1, -2, -2, 0, 0, 0): "H 1, mH 1e-3, uH 1e-6",
    (1, 1, -2, 0, 0, 0, 0): "N 1, mN 1e-3, kN 1e3",
    (-1, 1, -2, 0, 0, 0, 0): "Pa 1, hPa 1e2, kPa 1e3, MPa 1e6, GPa 1e9, bar 1e5, mbar 1e2, "
    "dbar 1e4, atm 101325",
    (2, 1, -3, 0, 0, 0, 0): "W 1, mW 1e-3, kW 1e3",
    (2, 1, -2, 0, 0, 0, 0): "J 1, mJ 1e-3, kJ 1e3, Wh 3600",
    (0, 0, 0, 0, 1, 0, 0): "rad 1",
    (-2, -1, 3, 2, 0, 0, 0): "S 1, mS 1e-3, uS 1e-6",
    (0, 0, 0, 0, 0, 1, 0): "K 1",
    (0, 0, 0, 0, 0, 0, 1): "degC 1",
}
_UNITS = {
    name: _Unit(Fraction(factor), dimension)
    for dimension, units in _TABLE.items()
    for name, factor in map(str.split, units.split(","))
}
_UNITS["deg"] = _Unit(Fraction(math.pi / 180.0), _UNITS["rad"].dimension)
_UNITS["rev"] = _Unit(Fraction(2.0 * math.pi), _UNITS["rad"].dimension)
_UNITS["rpm"] = _Unit(Fraction(2.0 * math.pi / 60.0), (0, 0, -1, 0, 1, 0, 0))
_POUND_FORCE = Fraction("4.4482216152605")  # N
_UNITS["psi"] = _Unit(_POUND_FORCE / Fraction("0.0254") ** 2, _UNITS["Pa"].dimension)
_NONE = _Unit(Fraction(1), (0, 0, 0, 0, 0, 0, 0))

_TOKEN = re.compile(
    r"\s*(?:([A-Za-zΩ%]+)(?:(?:(?:\^|\*\*)?(-?[1-9])|(?:\^|\*\*)(-?0\.5))(?!\d))?|([()*/·])|(1)(?=\s*/))"
)
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\d.,])\s*")
_LONGEST = 100  # characters of a text that is still read as a quantity
_HOW = "Write a unit like mm/s/V, kg m2 or V/(rad/s)"


@cache
def _parse_unit(text: str) -> _Unit:
    cleaned = text.replace("µ", "u").replace("μ", "u").replace("²", "2").replace("³", "3")
    cleaned = cleaned.replace("°C", "degC")
    tokens: list[re.Match[str]] = []
    position = 0
    while cleaned[position:].strip():
        match = _TOKEN.match(cleaned, position) if len(text) <= _LONGEST else None
        if match is None:
            raise UnitError("not a unit", value=text, remedy=_HOW)
        tokens.append(match)
        position = match.end()
    unit, rest = _product(tokens, text) if tokens else (_NONE, [])
    if rest:
        raise UnitError("unbalanced bracket in a unit", value=text, remedy=_HOW)
    return unit


def _product(tokens: list[re.Match[str]], text: str) -> tuple[_Unit, list[re.Match[str]]]:
    """Return the unit up to the end or the closing bracket, and the tokens from there on."""
    result, power = _NONE, 1
    first, open_ended = True, True  # open_ended: a unit has to follow
    while tokens:
        token, *tokens = tokens
        name, whole, half, symbol, one = token.groups()
        if symbol == ")":
            tokens = [token, *tokens]
            break
        if symbol in ("*", "·", "/"):
            if open_ended and not (first and symbol == "/"):
                raise UnitError("an operator without a unit before it", value=text, remedy=_HOW)
            power = -1 if symbol == "/" else 1
            first, open_ended = False, True
            continue
        if symbol == "(":
            inner, tokens = _product(tokens, text)
            if not tokens or tokens[0].group(4) != ")":
                raise UnitError("unbalanced bracket in a unit", value=text, remedy=_HOW)
            tokens = tokens[1:]
            result = result.times(inner, power)
        elif one is None:
            if name not in _UNITS:
                raise UnitError(f"unknown unit {name!r}", value=text, remedy=_hint(name))
            result = result.times(_UNITS[name], power * Fraction(whole or half or 1))
        power, first, open_ended = 1, False, False
    if open_ended:
        raise UnitError("a unit is missing", value=text, remedy=_HOW)
    return result, tokens


def _hint(name: str) -> str:
    """Return what to write instead of an unknown unit."""
    for cut in range(1, len(name)):
        if name[:cut] in _UNITS and name[cut:] in _UNITS:
            return f'Write a product with a space: "{name[:cut]} {name[cut:]}"'
    near = difflib.get_close_matches(name, _UNITS, n=3, cutoff=0.75)
    near += [unit for unit in _UNITS if unit.lower() == name.lower() and unit not in near]
    return f"Did you mean {' or '.join(near)}?" if near else _HOW


def unit_factor(given: str, wanted: str) -> float:
    """Return the factor that turns a number in unit `given` into unit `wanted`.

    Raises UnitError where the dimensions differ: ``unit_factor("cm3", "m3") == 1e-6``.
    """
    return float(_ratio(given, wanted))


def has_kind(given: str, wanted: str) -> bool:
    """Return whether a text is a unit of the same kind as another: cm3 of m3."""
    try:
        return _parse_unit(given).dimension == _parse_unit(wanted).dimension
    except UnitError:
        return False


def _ratio(given: str, wanted: str) -> Fraction:
    source, target = _parse_unit(given), _parse_unit(wanted)
    if source.dimension != target.dimension:
        remedy = f"Give it in {wanted}" if wanted else "Give a number without a unit"
        raise UnitError(f"the unit {given!r} is of another kind", unit=wanted, remedy=remedy)
    return source.factor / target.factor


def parse_quantity(value: object, unit: str) -> float:
    """Return a text such as ``"350 cm3"``, or a bare number, as a float in `unit`.

    The float is the one nearest to what was written: ``"0.444 mm/s/V"`` is 0.000444 to the bit.
    Raises UnitError where the text is no number with a unit of that kind, or is not finite.
    """
    wanted = unit or "none"
    how = f'Write a number in {unit}, or a text like "1.5 {unit}"' if unit else "Write 1.5"
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise UnitError("not a quantity", value=value, unit=wanted, remedy=how)
    try:
        number = _number(value, unit, how) if isinstance(value, str) else float(value)
    except OverflowError:
        number = math.inf
    except UnitError as error:
        remedy = how if error.remedy == _HOW else error.remedy
        raise UnitError(error.what, value=value, unit=wanted, remedy=remedy) from None
    if not math.isfinite(number):
        raise UnitError("not a finite number", value=value, unit=wanted, remedy=how)
    return number


def quantity(value: object, unit: str, field: str) -> float:
    """Return `parse_quantity`; an InputError names the field, or the option, that holds it."""
    try:
        return parse_quantity(value, unit)
    except UnitError as error:
        raise error.at(field=field) from None


@lru_cache(maxsize=1024)
def _number(text: str, unit: str, how: str) -> float:
    match = _NUMBER.match(text) if len(text) <= _LONGEST else None
    if match is None:
        comma = ", with a decimal point" if "," in text else ""
        raise UnitError("not a number followed by a unit", remedy=how + comma)
    rest = text[match.end() :].strip()
    ratio = _ratio(rest, unit) if rest else Fraction(1)
    nearest = float(match.group(1))
    if nearest == 0.0 or not math.isfinite(nearest):  # a Fraction of 1e999999999 would not end
        return nearest
    return float(Fraction(match.group(1)) * ratio)


def format_quantity(value: float, unit: str, shown_in: str | None = None, digits: int = 6) -> str:
    """Return `value` [unit] as text in the unit `shown_in`: (3.5e-4, "m3", "cm3") -> "350 cm3"."""
    shown = shown_in or unit
    return f"{value * unit_factor(unit, shown):.{digits}g} {shown}".rstrip()


_SHOWN = {"m3": "cm3", "m3/s": "cm3/h", "m3/m": "cm3/m"}


def shown_unit(unit: str) -> str:
    """Return the unit in which people read a number that is in `unit`: m3 -> cm3, else itself."""
    return _SHOWN.get(unit, unit)


def length(metres: float, digits: int = 3, small: str = "mm") -> str:
    """Return a length [m] as text, below 1 m in the unit `small`: 0.0123 -> "12.3 mm"."""
    unit = "m" if metres >= 1.0 else small
    return f"{rounded(metres / unit_factor(unit, 'm'), digits)} {unit}"


def rounded(value: float, digits: int = 4) -> str:
    """Return a number to so many digits, without an exponent below ten millions: 339.6 -> "340"."""
    text = f"{value:.{digits}g}"
    return f"{float(text):.{max(digits, 8)}g}" if 1e-4 <= abs(value) < 1e7 else text


def in_unit(unit: str, default: Any = MISSING) -> Any:
    """Return a field of a record that is a number in a unit, or several; see `read_numbers`."""
    return field(default=default, metadata={"unit": unit})


def read_numbers(record: Any) -> None:
    """Replace texts in fields of a frozen record by numbers in the units of their metadata.

    Raises InputError naming the field.
    """
    for one in fields(record):
        value = getattr(record, one.name)
        if isinstance(value, tuple | list):
            read: Any = tuple(_read(x, one) for x in value)
        elif isinstance(value, str):
            read = _read(value, one)
        else:
            continue
        object.__setattr__(record, one.name, read)


def _read(value: Any, about: Field[Any]) -> Any:
    if not isinstance(value, str) or "unit" not in about.metadata:
        return value
    return quantity(value, about.metadata["unit"], about.name)


def unit_of(text: str) -> str:
    """Return what stands behind a number, "" where nothing does."""
    number = _NUMBER.match(text)
    return "" if number is None else text[number.end() :].strip()


def with_one_unit(texts: Sequence[str]) -> list[str]:
    """Return quantities; numbers alone get the unit of the last."""
    unit, parts = unit_of(texts[-1]), [text.strip() for text in texts]
    return [f"{part} {unit}" if unit and _NUMBER.fullmatch(part) else part for part in parts]


@cache
def per_si(unit: str) -> float:
    """Return what a number in SI is multiplied by where it is written in this unit."""
    return float(1 / _parse_unit(unit).factor)


class _Shown(Formatter):
    """Writes {volume:.2g cm3}: an SI number in another unit, which is written after it."""

    def format_field(self, value: Any, format_spec: str) -> str:
        spec, _, unit = format_spec.partition(" ")
        return f"{value * per_si(unit):{spec}} {unit}" if unit else format(value, spec)


@cache
def texts_of(package: str) -> Mapping[str, Any]:
    """Return what a package says: its sentences.toml."""
    file = resources.files(f"swimbladder.{package}").joinpath("sentences.toml")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def say(package: str, /, *place: str, **values: Any) -> str:
    """Return the text at a place of a package's sentences with the values that it names."""
    text: Any = texts_of(package)
    for word in place:
        text = text[word]
    return _Shown().format(text, **values)
