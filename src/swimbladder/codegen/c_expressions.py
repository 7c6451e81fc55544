"""Expressions of a law as C99.

What C lacks stands here too: arithmetic held to one rounding, and small functions to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files

from swimbladder.codegen.c_places import c_field, c_number, c_record
from swimbladder.codegen.tree import (
    COUNT,
    INT,
    Binary,
    Builtin,
    Call,
    Choice,
    Compare,
    Constant,
    Expression,
    Field,
    Function,
    Logic,
    Make,
    Minus,
    Name,
    Not,
    Number,
    Record,
    place_of,
)

_TEXT = files("swimbladder.codegen").joinpath("templates/arithmetic.h").read_text("utf-8")
ARITHMETIC, CALLED, *_BLOCKS = (f"{block.strip()}\n" for block in _TEXT.split("\n\n"))
HELPERS = {block.partition("(")[0].split()[-1]: block for block in _BLOCKS}
"""What a law's file needs to compute as the twin does, and the functions that it may call."""

_CHOICE, _LOGIC, _COMPARE, _SUM, _PRODUCT, _UNARY, _ATOM = range(7)
_LEVEL = {"+": _SUM, "-": _SUM, "*": _PRODUCT, "/": _PRODUCT}
_FUNCTIONS = {
    "min": "swb_min", "max": "swb_max", "abs": "swb_abs", "sqrt": "sqrtf",
    "isfinite": "swb_isfinite", "copysign": "swb_copysign",
}  # fmt: skip
_ON_COUNTS = {"min": "swb_lesser", "max": "swb_greater", "more": "swb_more", "less": "swb_less"}


class ExpressionText:
    """Expressions of one function: `names` of its variables, which of them are `pointers`.

    fields: those of each record that anything reads; keep: writes a record into a variable of its
    own before the statement, and returns its name.
    """

    def __init__(
        self, law: str, functions: dict[Function, str], names: dict[str, str], pointers: set[str],
        fields: dict[str, set[str]], keep: Callable[[str, Record], str],
    ) -> None:  # fmt: skip
        self.law, self.functions = law, functions
        self.names, self.pointers, self.fields, self.keep = names, pointers, fields, keep

    def value(self, e: Expression) -> str:
        """Return an expression as a value."""
        return self._text(e)[0]

    def address(self, e: Expression) -> str:
        """Return where a record stands: a pointer's name, or ``&`` and a place."""
        if isinstance(e, Name):
            return self.names[e.name] if e.name in self.pointers else f"&{self.names[e.name]}"
        if isinstance(e, Field) and isinstance(place_of(e)[0], Name):
            return f"&{self.value(e)}"
        assert isinstance(e.type, Record)
        text = self.braces(e) if isinstance(e, Make) else self.value(e)
        return f"&{self.keep(text, e.type)}"

    def braces(self, e: Make) -> str:
        """Return a new record's values as an initialiser."""
        read = self.fields[e.type.name]
        pairs = [p for p in zip(e.type.fields, e.values, strict=True) if p[0][0] in read]
        return "{" + ", ".join(f".{c_field(n)} = {self.value(v)}" for (n, _), v in pairs) + "}"

    def _at(self, e: Expression, level: int) -> str:
        """Return an expression, in brackets where it binds less than `level`."""
        text, own = self._text(e)
        return text if own >= level else f"({text})"

    def _text(self, e: Expression) -> tuple[str, int]:
        """Return (text, how strongly it binds)."""
        if isinstance(e, Number):
            return c_number(e.value, e.type), _ATOM if e.value >= 0.0 else _UNARY
        if isinstance(e, Constant):
            return f"SWB_{e.name}", _ATOM
        if isinstance(e, Name):
            name = self.names[e.name]
            if e.type == INT:
                return f"(float){name}", _UNARY
            return (f"*{name}", _UNARY) if e.name in self.pointers else (name, _ATOM)
        if isinstance(e, Field):
            if isinstance(e.of, Name) and e.of.name in self.pointers:
                return f"{self.names[e.of.name]}->{c_field(e.name)}", _ATOM
            return f"{self._at(e.of, _ATOM)}.{c_field(e.name)}", _ATOM
        if isinstance(e, Minus):
            return f"-{self._at(e.of, _ATOM)}", _UNARY
        if isinstance(e, Binary) and e.type == COUNT:
            bits = f"{self._at(e.left, _ATOM)} {e.operator} {self._at(e.right, _ATOM)}"
            return f"(uint16_t)({bits})", _UNARY
        if isinstance(e, Binary):
            level = _LEVEL[e.operator]
            return f"{self._at(e.left, level)} {e.operator} {self._at(e.right, level + 1)}", level
        if isinstance(e, Compare):
            return f"{self._at(e.left, _SUM)} {e.operator} {self._at(e.right, _SUM)}", _COMPARE
        if isinstance(e, Logic):
            operator = "&&" if e.operator == "and" else "||"
            return f" {operator} ".join(self._at(o, _COMPARE) for o in e.of), _LOGIC
        if isinstance(e, Not):
            return f"!{self._at(e.of, _ATOM)}", _UNARY
        if isinstance(e, Choice):
            parts = [self._at(x, _LOGIC if x is e.condition else _SUM)
                     for x in (e.condition, e.yes, e.no)]  # fmt: skip
            return f"{parts[0]} ? {parts[1]} : {parts[2]}", _CHOICE
        if isinstance(e, Builtin) and e.name == "float":
            return f"(float){self._at(e.arguments[0], _UNARY)}", _UNARY
        if isinstance(e, Builtin) and e.name == "count":
            (counter,) = e.arguments
            assert isinstance(counter, Name)
            return f"(uint16_t){self.names[counter.name]}", _UNARY
        if isinstance(e, Builtin) and e.type == COUNT:
            return f"{_ON_COUNTS[e.name]}({', '.join(map(self.value, e.arguments))})", _ATOM
        if isinstance(e, Builtin):
            return f"{_FUNCTIONS[e.name]}({', '.join(map(self.value, e.arguments))})", _ATOM
        if isinstance(e, Call):
            given = [
                self.address(a) if isinstance(a.type, Record) else self.value(a)
                for a in e.arguments
            ]
            return f"{self.functions[e.function]}({', '.join(given)})", _ATOM
        return f"({c_record(self.law, e.type)}){self.braces(e)}", _ATOM
