"""Routh's table: how many roots of a polynomial grow, without finding them.

The arithmetic is exact (every float is a ratio of whole numbers), so "zero" means zero. A zero at
the head of a row is replaced by a positive epsilon, a row of zeros by the derivative of the row
above (the auxiliary polynomial). The two methods disturb each other when both are needed: the part
of the polynomial that is symmetric about the origin is therefore split off first, and the epsilon
only ever stands where no root lies on the imaginary axis.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise

from numpy.polynomial.polynomial import polydiv, polymul

# Smaller than any quotient of products of floats that a table of reasonable degree can hold.
_EPSILON_BITS = 1 << 15
_EPSILON = Fraction(1, 1 << _EPSILON_BITS)

_Poly = list[Fraction]  # descending powers, no leading zeros; [] is the zero polynomial


@dataclass(frozen=True, kw_only=True)
class RouthTable:
    """Routh's table of a polynomial and what it says."""

    powers: tuple[int, ...]  # of s, one a row
    rows: tuple[tuple[str, ...], ...]  # as text; epsilon stands in it by name
    first_column: tuple[int, ...]  # signs
    notes: tuple[str, ...]  # one a row: "", "epsilon" or "auxiliary"
    right: int  # roots with a positive real part
    axis: int  # roots on the imaginary axis, those at 0 included
    at_zero: int  # roots at 0

    @property
    def stable(self) -> bool:
        """Whether every root decays."""
        return self.right == 0 and self.axis == 0

    @property
    def sentence(self) -> str:
        """What the table says, in a sentence."""
        changes = _count(self.right, "sign change")
        if self.right:
            text = (
                f"The first column has {changes}: {_count(self.right, 'root')} with a positive "
                "real part, so the system is unstable"
            )
        elif self.axis:
            text = "The first column does not change sign: no root has a positive real part"
        else:
            return "The first column does not change sign: every root decays, the system is stable."
        if self.axis:
            where = "at 0" if self.at_zero == self.axis else "on the imaginary axis"
            lie = "lies" if self.axis == 1 else "lie"
            text += f", and {_count(self.axis, 'root')} {lie} {where}"
            if not self.right:
                text += ": disturbances do not decay"
                if self.axis > 1:
                    text += " and, where these roots coincide, grow"
        return text + "."


def routh_table(coefficients: Sequence[float]) -> RouthTable:
    """Return Routh's table of a real polynomial, coefficients in descending powers.

    Raises ValueError where the polynomial is zero, constant, or not finite.
    """
    if not all(math.isfinite(c) for c in coefficients):
        raise ValueError(f"coefficients must be finite, got {tuple(coefficients)}")
    p = _trimmed([Fraction(c) for c in coefficients])
    if len(p) < 2:
        raise ValueError(f"not a polynomial with a root: {tuple(coefficients)}")
    at_zero = 0
    while p[-1] == 0:
        p.pop()
        at_zero += 1
    rows: list[_Poly] = []
    notes: list[str] = []
    even, odd = _parity(p, 0), _parity(p, 1)
    if len(p) > 1:
        symmetric = _pair(even, odd, rows, notes)
        while symmetric:
            auxiliary = rows.pop()
            mark, start = notes.pop(), len(rows)
            symmetric = _pair(auxiliary, _derivative(auxiliary), rows, notes)
            notes[start : start + 2] = [mark, "auxiliary"]
    else:
        rows, notes = [p], [""]
    signs = [1 if row[0] > 0 else -1 for row in rows]
    right = _changes(signs)
    # Below the row that the first auxiliary polynomial stands in, roots come in pairs +-s.
    first = next((i for i, note in enumerate(notes) if note == "auxiliary"), None)
    on_axis = 0
    if first is not None:
        degree = len(rows) - first
        on_axis = degree - 2 * _changes(signs[first - 1 :])
    n = len(rows) - 1
    return RouthTable(
        powers=tuple(range(n + at_zero, at_zero - 1, -1)),
        rows=tuple(tuple(map(_text, row[: n - i + 1 : 2])) for i, row in enumerate(rows)),
        first_column=tuple(signs),
        notes=tuple(notes),
        right=right,
        axis=on_axis + at_zero,
        at_zero=at_zero,
    )


def _pair(upper: _Poly, lower: _Poly, rows: list[_Poly], notes: list[str]) -> bool:
    """Append the rows that follow from two polynomials of opposite parity; say if they end early.

    The rows are those of both divided by their greatest common divisor, multiplied by it again, so
    the last of them is the divisor up to a factor: the auxiliary polynomial, where not a constant.
    """
    divisor = _divisor(upper, lower)
    a, b = (_division(row, divisor)[0] for row in (upper, lower))
    degree = len(a) - 1
    table, marks = [a], [""]
    for power in range(degree - 1, -1, -1):
        mark = ""
        if len(b) - 1 < power:  # the head of the row is zero
            b = [_EPSILON, *[Fraction(0)] * (power - len(b)), *b]
            mark = "epsilon"
        table.append(b)
        marks.append(mark)
        factor = a[0] / b[0]
        shifted = [factor * c for c in b] + [Fraction(0)]
        a, b = b, _trimmed([x - y for x, y in zip(a, shifted, strict=True)])
    # NumPy has the lowest power first, and leaves out zeros at the highest
    rows += [[*polymul(row[::-1], divisor[::-1])[::-1]] for row in table]
    notes += marks
    return len(divisor) > 1


def _parity(p: _Poly, parity: int) -> _Poly:
    """The polynomial of every second power, from the highest (0) or the one below it (1)."""
    return _trimmed([c if i % 2 == parity else Fraction(0) for i, c in enumerate(p)])


def _trimmed(p: _Poly) -> _Poly:
    first = next((i for i, c in enumerate(p) if c != 0), len(p))
    return p[first:]


def _derivative(p: _Poly) -> _Poly:
    n = len(p) - 1
    return [c * (n - i) for i, c in enumerate(p[:-1])]


def _division(p: _Poly, q: _Poly) -> tuple[_Poly, _Poly]:
    """Quotient and rest; NumPy's powers ascend."""
    if len(p) < len(q):
        return [], p
    quotient, rest = polydiv(p[::-1], q[::-1])
    return [*quotient[::-1]], _trimmed([*rest[::-1]])


def _divisor(p: _Poly, q: _Poly) -> _Poly:
    """Greatest common divisor with a leading coefficient of 1."""
    while q:
        p, q = q, _division(p, q)[1]
    return [c / p[0] for c in p]


def _changes(signs: Sequence[int]) -> int:
    return sum(a != b for a, b in pairwise(signs))


def _text(value: Fraction) -> str:
    """A number, or a number times a power of epsilon."""
    if value == 0:
        return "0"
    bits = value.numerator.bit_length() - value.denominator.bit_length()
    power = -round(bits / _EPSILON_BITS)
    lead = value / _EPSILON**power
    try:
        number = f"{float(lead):.6g}"
    except OverflowError:
        number = f"{Decimal(lead.numerator) / Decimal(lead.denominator):.6g}"
    if power == 0:
        return number
    symbol = "epsilon" if power == 1 else f"epsilon^{power}"
    return symbol if lead == 1 else f"{number} {symbol}"


def _count(number: int, noun: str) -> str:
    words = {1: "one", 2: "two", 3: "three", 4: "four"}
    return f"{words.get(number, number)} {noun}{'' if number == 1 else 's'}"
