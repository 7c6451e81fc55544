"""Names, numbers and types as C99 has them."""

from __future__ import annotations

import inspect
import math
import re

import numpy as np

from swimbladder.codegen.tree import BOOL, COUNT, Record, Type

# Words of C and C++, and macros of <math.h>, <stdbool.h> and Arduino that a field might meet.
_WORDS = """
    alignas alignof and asm auto bitand bitor bool break case catch char class compl const
    constexpr const_cast continue decltype default delete do double dynamic_cast else enum explicit
    export extern false final float for friend goto if inline int long mutable namespace new
    noexcept not nullptr operator or override private protected public register reinterpret_cast
    restrict return short signed sizeof static static_assert static_cast struct switch template this
    throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t while
    xor NULL NAN INFINITY HUGE_VAL isfinite isnan isinf signbit fpclassify M_PI PI HALF_PI TWO_PI
    EULER HIGH LOW INPUT OUTPUT DEFAULT EXTERNAL INTERNAL CHANGE FALLING RISING DEC HEX OCT BIN F
    SERIAL DISPLAY SP SREG B0 B1 B00 B01 B10 B11 abs min max round radians degrees sq bit byte
    boolean word interrupts constrain yield
"""
_TAKEN = frozenset(_WORDS.split())
_FIELD = re.compile(r"^\s+(\w+)\s*:[^#]*#\s*(.+?)\s*$", re.MULTILINE)


def c_law(name: str) -> str:
    """Return a law's name as a part of a C name: ``position-pid`` -> ``position_pid``."""
    return re.sub(r"\W", "_", name)


def c_field(name: str) -> str:
    """Return a field's name; one that C, C++ or Arduino takes gets an underscore."""
    return f"{name}_" if name in _TAKEN else name


def c_local(name: str, taken: set[str]) -> str:
    """Return a variable's name that is not `taken` yet, and take it."""
    plain = name.strip("_") or "unused"
    while plain in taken or plain in _TAKEN or plain.lower().startswith("swb"):
        plain += "_"
    taken.add(plain)
    return plain


def c_record(law: str, record: Record) -> str:
    """Return the type of a record: ``swb_measurement``, ``swb_cascade_state``."""
    if record.name == "measurement":
        return "swb_measurement"
    return f"swb_{c_law(law)}_{record.name}"


def c_type(law: str, kind: Type) -> str:
    """Return a type."""
    if isinstance(kind, Record):
        return c_record(law, kind)
    return "uint16_t" if kind == COUNT else kind.name


def c_number(value: float, kind: Type) -> str:
    """Return the literal of a number, a count or a truth."""
    if kind == COUNT:
        return f"{int(value)}u"
    if kind == BOOL:
        return "true" if value else "false"
    return c_float(value)


def c_float(value: float) -> str:
    """Return a literal that the compiler reads as exactly the float32 nearest to `value`."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    with np.errstate(all="ignore"):
        return f"{np.float32(value)!s}f"


def remarks(kind: type | None) -> dict[str, str]:
    """Return what stands beside each field in the source of a NamedTuple, its unit mostly."""
    try:
        text = inspect.getsource(kind) if kind is not None else ""
    except (OSError, TypeError):
        text = ""
    return {name: said.replace("*/", "* /") for name, said in _FIELD.findall(text)}


def wrapped(line: str, width: int = 100) -> str:
    """Return a line of C, broken after commas and before operators where it is too long."""
    indent = line[: len(line) - len(line.lstrip())] + "    "
    done = []
    while len(line) > width:
        at = _break(line, len(indent), width)
        if at <= len(indent):
            break
        done.append(line[:at].rstrip())
        line = indent + line[at:].lstrip()
    return "\n".join([*done, line])


def _break(line: str, start: int, end: int) -> int:
    """Return where to break a line, preferring the later of the weaker bonds; 0: nowhere."""
    for marks in ((", ", " && ", " || "), (" ? ", " : ", " + ", " - "), (" * ", " / ")):
        found = [(line.rfind(mark, start, end - 1), mark) for mark in marks]
        at, mark = max(found)
        if at > start:
            return at + 1 if mark == ", " else at
    return line.find(", ", end) + 1
