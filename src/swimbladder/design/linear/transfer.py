"""The paper's transfer functions, eqs (9), (19), (20), (30) and (32)-(35), and Routh's table.

Each transfer function returns numerator and denominator in descending powers of s, in the paper's
own normalisation, from the symbols the paper uses. They are plain arithmetic: SymPy symbols pass
through them too.

Routh's table says how many roots of a polynomial grow, without finding them. Its arithmetic is
exact (every float is a ratio of whole numbers), so "zero" means zero. A zero at the head of a row
is replaced by a positive epsilon, a row of zeros by the derivative of the row above (the auxiliary
polynomial). The two methods disturb each other when both are needed: the part of the polynomial
that is symmetric about the origin is therefore split off first, and the epsilon only ever stands
where no root lies on the imaginary axis.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polydiv, polymul

from swimbladder.physics.dynamics import Plant

Ratio = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True, kw_only=True)
class TransferFunction:
    """A transfer function with its numbers and what they stand for."""

    equations: tuple[str, ...]  # the paper's numbers
    input: str
    output: str
    symbols: str  # the formula
    numerator: tuple[float, ...]  # descending powers of s
    denominator: tuple[float, ...]

    @property
    def poles(self) -> tuple[complex, ...]:
        """Roots of the denominator [1/s], the largest real part first."""
        roots = [complex(r) for r in np.roots(self.denominator)]
        return tuple(sorted(roots, key=lambda r: (-r.real, -r.imag)))

    def to_control(self) -> Any:
        """Return it as a python-control TransferFunction."""
        import control

        ratio = [*self.numerator], [*self.denominator]
        return control.tf(*ratio, inputs=self.input, outputs=self.output)


def volume_per_voltage(*, inertia: float, k_u: float, k_q: float, k_v: float) -> Ratio:
    """V/U of the unified actuator, eqs (9) and (19), first term [m3/V].

    inertia: lambda [kg m2]; k_u [N m/V]; k_q [m3/rad]; k_v [N m s/rad].
    """
    return (k_u * k_q / k_v,), (inertia / k_v, 1, 0)


def volume_per_depth(*, inertia: float, k_v: float, k_q: float, k_z: float, k_l: float) -> Ratio:
    """V/Z of the unified actuator, eqs (9) and (19), second term [m3/m]: the depth load.

    inertia: lambda [kg m2]; k_v [N m s/rad]; k_q [m3/rad]; k_z [N m/m]; k_l [m2/s].
    """
    return (-inertia * k_l / k_v, -(k_l + k_q * k_z / k_v)), (inertia / k_v, 1, 0)


def depth_per_volume_physical(*, k_b: float, k_def: float, k_dl: float, m: float) -> Ratio:
    """Z/V in physical constants, eq. (20) [m/m3]; has no meaning for k_def = 0.

    k_b [N/m3]; k_def [N/m]; k_dl [N s/m]; m [kg].
    """
    return (-k_b / k_def,), (m / k_def, k_dl / k_def, -1)


def depth_per_volume_identified(*, K2: float, T2: float, k_def: float, k_dl: float) -> Ratio:
    """Z/V with K2 and T2, eq. (30) [m/m3]. K2 [1/m2/s]; T2 [s]; k_def [N/m]; k_dl [N s/m]."""
    return (-K2,), (T2, 1, -k_def / k_dl)


def depth_per_volume(*, K2: float, T2: float, psi: float) -> Ratio:
    """Z/V with K2, T2 and psi, eq. (32) [m/m3]. K2 [1/m2/s]; T2 [s]; psi [m3/m]."""
    return (-K2,), (T2, 1, -psi * K2)


def volume_per_voltage_identified(*, K1: float, A: float, T1: float) -> Ratio:
    """V/U in identified parameters, eq. (33), first term [m3/V]. K1 [m/s/V]; A [m2]; T1 [s]."""
    return (K1 * A,), (T1, 1, 0)


def volume_per_depth_identified(
    *, K1: float, A: float, T1: float, depth_voltage: float, k_l: float
) -> Ratio:
    """V/Z in identified parameters, eq. (33), second and third term over one denominator [m3/m].

    K1 [m/s/V]; A [m2]; T1 [s]; depth_voltage: k_z/k_u [V/m]; k_l [m2/s].
    """
    return (-k_l * T1, -(K1 * A * depth_voltage + k_l)), (T1, 1, 0)


def depth_per_voltage(
    *,
    K1: float,
    K2: float,
    A: float,
    T1: float,
    T2: float,
    psi: float,
    depth_voltage: float,
    k_l: float,
) -> Ratio:
    """Z/U in open loop, eq. (34) [m/V].

    K1 [m/s/V]; K2 [1/m2/s]; A [m2]; T1, T2 [s]; psi [m3/m]; depth_voltage: k_z/k_u [V/m];
    k_l [m2/s].
    """
    return (-K1 * K2 * A,), (
        T1 * T2,
        T1 + T2,
        1 - psi * K2 * T1,
        -(psi + k_l * T1) * K2,
        -K2 * (K1 * A * depth_voltage + k_l),
    )


def depth_per_voltage_without_loads(
    *, K1: float, K2: float, A: float, T1: float, T2: float
) -> Ratio:
    """Z/U where psi, k_l and k_z vanish, eq. (35): a double integrator and two lags [m/V].

    K1 [m/s/V]; K2 [1/m2/s]; A [m2]; T1, T2 [s].
    """
    return (-K1 * K2 * A,), (T1 * T2, T1 + T2, 1, 0, 0)


def transfer_functions(p: Plant, *, m: float, k_b: float) -> tuple[TransferFunction, ...]:
    """Return every transfer function of the paper that a vehicle has, with its numbers.

    m: accelerated mass [kg]; k_b: specific weight of the water [N/m3]. Only ratios of the
    actuator's constants enter (9) and (19). Without a laminar drag K2 and T2 do not exist, nor do
    (30), (32), (34) and (35); without a compressible hull (20) does not.
    """
    k_dl, k_def = p.d_l * m, k_b * p.psi
    K2, T2 = (k_b / k_dl, m / k_dl) if k_dl > 0.0 else (math.inf, math.inf)
    found: dict[str, Ratio] = {}
    if k_def != 0.0:
        found["20 Z/V"] = depth_per_volume_physical(k_b=k_b, k_def=k_def, k_dl=k_dl, m=m)
    if k_dl > 0.0:
        found["30 Z/V"] = depth_per_volume_identified(K2=K2, T2=T2, k_def=k_def, k_dl=k_dl)
        found["32 Z/V"] = depth_per_volume(K2=K2, T2=T2, psi=p.psi)
    if not p.positioner:
        ratios = dict(inertia=p.T1, k_v=1.0, k_q=p.gain)  # those of k_u = k_v = 1
        drive = dict(K1=p.gain, A=1.0, T1=p.T1)  # only the product K1 A enters
        loads = dict(depth_voltage=p.load_drive, k_l=p.k_l)
        found["9 V/U"] = volume_per_voltage(k_u=1.0, **ratios)
        found["9 V/Z"] = volume_per_depth(k_z=p.load_drive, k_l=p.k_l, **ratios)
        found["33 V/U"] = volume_per_voltage_identified(**drive)
        found["33 V/Z"] = volume_per_depth_identified(**drive, **loads)
        if k_dl > 0.0:
            motion = dict(K2=K2, T2=T2, **drive)
            found["34 Z/U"] = depth_per_voltage(psi=p.psi, **motion, **loads)
            found["35 Z/U"] = depth_per_voltage_without_loads(**motion)
    return tuple(_transfer_function(key, found[key]) for key in _SYMBOLS if key in found)


_SYMBOLS = {
    "9 V/U": "k_u k_q/k_v / (s (lambda/k_v s + 1))",
    "9 V/Z": "-(lambda k_l/k_v s + k_l + k_q k_z/k_v) / (s (lambda/k_v s + 1))",
    "20 Z/V": "-(k_b/k_def) / (m/k_def s^2 + k_dl/k_def s - 1)",
    "30 Z/V": "-K2 / (T2 s^2 + s - k_def/k_dl)",
    "32 Z/V": "-K2 / (T2 s^2 + s - psi K2)",
    "33 V/U": "K1 A / (s (T1 s + 1))",
    "33 V/Z": "-(K1 A k_z/k_u / (s (T1 s + 1)) + k_l/s)",
    "34 Z/U": "-K1 K2 A / (T1 T2 s^4 + (T1 + T2) s^3 + (1 - psi K2 T1) s^2 "
    "- (psi + k_l T1) K2 s - K2 (K1 A k_z/k_u + k_l))",
    "35 Z/U": "-K1 K2 A / (s^2 (T1 T2 s^2 + (T1 + T2) s + 1)), where psi = k_l = k_z = 0",
}


def _transfer_function(key: str, ratio: Ratio) -> TransferFunction:
    number, pair = key.split()
    output, input = pair.split("/")
    numerator = [float(c) for c in ratio[0]]
    while len(numerator) > 1 and numerator[0] == 0.0:
        numerator.pop(0)
    return TransferFunction(
        equations=("9", "19") if number == "9" else (number,),
        input=input,
        output=output,
        symbols=_SYMBOLS[key],
        numerator=tuple(numerator),
        denominator=tuple(float(c) for c in ratio[1]),
    )


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
