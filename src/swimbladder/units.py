"""Text to SI and back, at the edges only: ``"350 cm3"`` -> 3.5e-4.

A bare number is taken in the unit that the field states, always an SI one (volume per
revolution and lead per revolution excepted: they are stated per ``rev`` as datasheets do).
Angles count as a dimension, so that ``V/rpm`` and ``V s`` cannot be confused.
The grammar: ``mm/s/V``, ``kg m2``, ``V/(rad/s)``, ``m3/rev``, ``1/s``, ``cm^3``, ``%``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache

from swimbladder.errors import UnitError

__all__ = ["format_quantity", "parse_quantity", "to_si", "unit_factor"]


@dataclass(frozen=True)
class _Unit:
    factor: float
    dimension: tuple[int, ...]  # powers of metre, kilogram, second, ampere, radian

    def times(self, other: _Unit, power: int = 1) -> _Unit:
        return _Unit(
            self.factor * other.factor**power,
            tuple(
                a + power * b for a, b in zip(self.dimension, other.dimension, strict=True)
            ),
        )


def _u(factor: float, metre: int = 0, kilogram: int = 0, second: int = 0, ampere: int = 0,
       radian: int = 0) -> _Unit:  # fmt: skip
    return _Unit(factor, (metre, kilogram, second, ampere, radian))


_NONE = _u(1.0)
_ATMOSPHERE = 101325.0
_POUND_FORCE_PER_SQUARE_INCH = 4.4482216152605 / 0.0254**2
_UNITS: dict[str, _Unit] = {
    "%": _u(1e-2), "ppm": _u(1e-6),
    "m": _u(1.0, 1), "km": _u(1e3, 1), "dm": _u(1e-1, 1), "cm": _u(1e-2, 1), "mm": _u(1e-3, 1),
    "um": _u(1e-6, 1), "in": _u(0.0254, 1), "ft": _u(0.3048, 1),
    "L": _u(1e-3, 3), "l": _u(1e-3, 3), "dL": _u(1e-4, 3), "mL": _u(1e-6, 3), "ml": _u(1e-6, 3),
    "uL": _u(1e-9, 3), "cc": _u(1e-6, 3),
    "kg": _u(1.0, 0, 1), "g": _u(1e-3, 0, 1), "mg": _u(1e-6, 0, 1), "t": _u(1e3, 0, 1),
    "lb": _u(0.45359237, 0, 1),
    "s": _u(1.0, 0, 0, 1), "ms": _u(1e-3, 0, 0, 1), "us": _u(1e-6, 0, 0, 1),
    "min": _u(60.0, 0, 0, 1), "h": _u(3600.0, 0, 0, 1), "d": _u(86400.0, 0, 0, 1),
    "Hz": _u(1.0, 0, 0, -1), "kHz": _u(1e3, 0, 0, -1),
    "A": _u(1.0, 0, 0, 0, 1), "mA": _u(1e-3, 0, 0, 0, 1),
    "V": _u(1.0, 2, 1, -3, -1), "mV": _u(1e-3, 2, 1, -3, -1), "kV": _u(1e3, 2, 1, -3, -1),
    "ohm": _u(1.0, 2, 1, -3, -2), "mohm": _u(1e-3, 2, 1, -3, -2), "kohm": _u(1e3, 2, 1, -3, -2),
    "Ω": _u(1.0, 2, 1, -3, -2),
    "H": _u(1.0, 2, 1, -2, -2), "mH": _u(1e-3, 2, 1, -2, -2), "uH": _u(1e-6, 2, 1, -2, -2),
    "N": _u(1.0, 1, 1, -2), "mN": _u(1e-3, 1, 1, -2), "kN": _u(1e3, 1, 1, -2),
    "Pa": _u(1.0, -1, 1, -2), "hPa": _u(1e2, -1, 1, -2), "kPa": _u(1e3, -1, 1, -2),
    "MPa": _u(1e6, -1, 1, -2), "GPa": _u(1e9, -1, 1, -2), "bar": _u(1e5, -1, 1, -2),
    "mbar": _u(1e2, -1, 1, -2), "dbar": _u(1e4, -1, 1, -2), "atm": _u(_ATMOSPHERE, -1, 1, -2),
    "psi": _u(_POUND_FORCE_PER_SQUARE_INCH, -1, 1, -2),
    "W": _u(1.0, 2, 1, -3), "mW": _u(1e-3, 2, 1, -3), "kW": _u(1e3, 2, 1, -3),
    "J": _u(1.0, 2, 1, -2), "mJ": _u(1e-3, 2, 1, -2), "kJ": _u(1e3, 2, 1, -2),
    "Wh": _u(3600.0, 2, 1, -2),
    "rad": _u(1.0, 0, 0, 0, 0, 1), "deg": _u(math.pi / 180.0, 0, 0, 0, 0, 1),
    "rev": _u(2.0 * math.pi, 0, 0, 0, 0, 1),
    "rpm": _u(2.0 * math.pi / 60.0, 0, 0, -1, 0, 1),
}  # fmt: skip

_TOKEN = re.compile(r"\s*(?:([A-Za-zΩ%]+)(?:\^|\*\*)?(-?\d+)?|([()*/·])|(1)(?=\s*/))")
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\d.,])\s*")


@cache
def _parse_unit(text: str) -> _Unit:
    cleaned = text.replace("µ", "u").replace("μ", "u").replace("²", "2").replace("³", "3")
    tokens: list[re.Match[str]] = []
    position = 0
    while cleaned[position:].strip():
        match = _TOKEN.match(cleaned, position)
        if match is None:
            raise UnitError("not a unit", value=text, remedy="Write it like mm/s/V or kg m2")
        tokens.append(match)
        position = match.end()
    unit, rest = _product(tokens, text)
    if rest:
        raise UnitError("unbalanced bracket in a unit", value=text)
    return unit


def _product(tokens: list[re.Match[str]], text: str) -> tuple[_Unit, list[re.Match[str]]]:
    result, power = _NONE, 1
    expect_factor = False
    while tokens:
        token, *tokens = tokens
        name, exponent, symbol, one = token.groups()
        if symbol == ")":
            tokens = [token, *tokens]
            break
        if symbol in ("*", "·", "/"):
            power = -1 if symbol == "/" else 1
            expect_factor = True
            continue
        if symbol == "(":
            inner, tokens = _product(tokens, text)
            if not tokens or tokens[0].group(3) != ")":
                raise UnitError("unbalanced bracket in a unit", value=text)
            tokens = tokens[1:]
            result = result.times(inner, power)
        elif one is None:
            if name not in _UNITS:
                raise UnitError(
                    f"unknown unit {name!r}",
                    value=text,
                    remedy=f"Known units: {', '.join(sorted(_UNITS))}",
                )
            result = result.times(_UNITS[name], power * int(exponent or 1))
        power, expect_factor = 1, False
    if expect_factor:
        raise UnitError("a unit ends in an operator", value=text)
    return result, tokens


def unit_factor(given: str, wanted: str) -> float:
    """Return the factor that turns a number in unit `given` into unit `wanted`.

    Raises UnitError where the dimensions differ: ``unit_factor("cm3", "m3") == 1e-6``.
    """
    source, target = _parse_unit(given), _parse_unit(wanted)
    if source.dimension != target.dimension:
        raise UnitError(
            f"unit {given!r} is of another kind", unit=wanted, remedy=f"Give it in {wanted}"
        )
    return source.factor / target.factor


def parse_quantity(value: object, unit: str) -> float:
    """Return a text such as ``"350 cm3"``, or a bare number, as a float in `unit`.

    Raises UnitError where the text is no number with a unit of that kind, or is not finite.
    """
    wanted = unit or "a bare number"
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise UnitError("not a quantity", value=value, unit=wanted)
    if isinstance(value, str):
        match = _NUMBER.match(value)
        if match is None:
            raise UnitError(
                "not a number followed by a unit",
                value=value,
                unit=wanted,
                remedy=f'Write it like "1.5 {unit}"' if unit else "Write it like 1.5",
            )
        number, rest = float(match.group(1)), value[match.end() :].strip()
        try:
            number *= unit_factor(rest, unit) if rest else 1.0
        except UnitError as error:
            raise UnitError(error.what, value=value, unit=wanted, remedy=error.remedy) from None
    else:
        number = float(value)
    if not math.isfinite(number):
        raise UnitError("not a finite number", value=value, unit=wanted)
    return number


def to_si(text: str, unit: str) -> float:
    """Return a text that must carry its own unit, as a float in `unit` (``"5 mm"``, "m" -> 0.005).

    Raises UnitError where the unit is missing or of another kind.
    """
    match = _NUMBER.match(text)
    if unit and match is not None and not text[match.end() :].strip():
        raise UnitError("the unit is missing", value=text, unit=unit)
    return parse_quantity(text, unit)


def format_quantity(value: float, unit: str, shown_in: str | None = None, digits: int = 6) -> str:
    """Return `value` [unit] as text in the unit `shown_in`: (3.5e-4, "m3", "cm3") -> "350 cm3"."""
    shown = shown_in or unit
    return f"{value * unit_factor(unit, shown):.{digits}g} {shown}".rstrip()
