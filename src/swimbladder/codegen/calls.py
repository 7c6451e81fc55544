"""The calls of a law's function, read into the tree."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Hashable, Mapping
from types import FunctionType
from typing import TYPE_CHECKING, Any, Literal

from swimbladder.codegen.tree import (
    BOOL,
    COUNT,
    FLOAT,
    INT,
    Builtin,
    Call,
    Expression,
    Field,
    Make,
    Name,
    Number,
    Record,
    Type,
    place_of,
)
from swimbladder.control.law import Count, less, more

if TYPE_CHECKING:
    from swimbladder.codegen.expressions import Expressions

_Builtin = Literal["min", "max", "abs", "sqrt", "isfinite", "copysign"]
_ON_COUNTS: dict[Callable[..., Any], Literal["min", "max", "more", "less"]] = {
    min: "min", max: "max", more: "more", less: "less"
}  # fmt: skip
_BUILTINS: dict[Callable[..., Any], tuple[_Builtin, int, Type]] = {
    min: ("min", 2, FLOAT), max: ("max", 2, FLOAT), abs: ("abs", 1, FLOAT),
    math.fabs: ("abs", 1, FLOAT), math.sqrt: ("sqrt", 1, FLOAT),
    math.isfinite: ("isfinite", 1, BOOL), math.copysign: ("copysign", 2, FLOAT),
}  # fmt: skip


def is_count(function: Callable[..., Any], written: Any) -> bool:
    """Return whether an annotation of a function, or in it, means a count."""
    if isinstance(written, str):
        written = getattr(function, "__globals__", {}).get(written, written)
    return bool(written == Count)


class Calls:
    """Calls at the place of a function where `of` reads expressions."""

    def __init__(self, of: Expressions) -> None:
        self.of, self.body, self.source = of, of.body, of.source

    def read(self, node: ast.Call) -> Expression:
        """Return a call of any kind."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "_replace":
            return self._replaced(node, node.func.value)
        function, known = self.of.outside(node.func)
        if not known:
            remedy = "Call a plain function, or `_replace` of a NamedTuple"
            self.source.refuse(node, "a law calls no methods and no variables", remedy)
        if any(isinstance(a, ast.Starred) for a in node.args) or not all(
            keyword.arg for keyword in node.keywords
        ):
            self.source.refuse(node, "a law has no * and ** in calls", "Write each argument")
        if isinstance(function, type) and hasattr(function, "_fields"):
            return self._make(node, function)
        if isinstance(function, Hashable):
            builtin = self._builtin(node, function)
            if builtin is not None:
                return builtin
        plain = getattr(function, "py_func", function)
        if not isinstance(plain, FunctionType):
            self.source.refuse(
                node, "this function is not the same to the bit on every processor",
                "Compute it where the parameters are made; a law has min, max, abs, math.sqrt, "
                "math.isfinite and math.copysign",
            )  # fmt: skip
        names = plain.__code__.co_varnames[: plain.__code__.co_argcount]
        written = {n for n in names if is_count(plain, plain.__annotations__.get(n))}
        values = self._arguments(node, names, {}, dict.fromkeys(written, COUNT))
        kinds = tuple(FLOAT if value.type == INT else value.type for value in values)
        called = self.body.reader.call(self.source, node, plain, kinds)
        return Call(called, values, called.returns)

    def _builtin(self, node: ast.Call, function: Hashable) -> Expression | None:
        """Return a call of what C and the twin have as well, None where it is something else."""
        if function in (more, less) or (function in (min, max) and self.of.counts(node.args)):
            name: Any = _ON_COUNTS[function]
            self._check_arguments(node, name, 2)
            return Builtin(name, tuple(map(self.of.count, node.args)), COUNT)
        if function is float:
            self._check_arguments(node, "float", 1)
            return Builtin("float", (self.of.count(node.args[0]),), FLOAT)
        if function not in _BUILTINS:
            return None
        known, count, kind = _BUILTINS[function]
        self._check_arguments(node, known, count)
        return Builtin(known, tuple(map(self.of.number, node.args)), kind)

    def _check_arguments(self, node: ast.Call, name: str, count: int) -> None:
        if len(node.args) != count or node.keywords:
            self.source.refuse(node, f"{name} takes {count} numbers here", "Nest the calls")

    def _make(self, node: ast.Call, kind: type[Any]) -> Expression:
        record = self.body.reader.record(kind, self.source, node)
        kinds = dict(record.fields)
        defaults = {
            name: Number(self.of.float32(node, float(value)), kinds[name])
            for name, value in getattr(kind, "_field_defaults", {}).items()
            if isinstance(value, int | float)
        }
        values = self._arguments(node, tuple(kinds), defaults, kinds)
        for value, (name, wanted) in zip(values, record.fields, strict=True):
            if (FLOAT if value.type == INT else value.type) != wanted:
                self.source.refuse(node, f"the field {name!r} has another type", "Give it its own")
        return Make(record, values)

    def _replaced(self, node: ast.Call, of_node: ast.expr) -> Expression:
        """Return a copy of a named tuple with some of its fields changed."""
        of = self.of.read(of_node)
        fields = [keyword.arg for keyword in node.keywords]
        if not (isinstance(place_of(of)[0], Name) and isinstance(of.type, Record)):
            self.source.refuse(node, "this is no name of a NamedTuple", "Give it a name first")
        if node.args or not all(field and of.type.type_of(field) for field in fields):
            self.source.refuse(node, "the arguments are not its fields", "Write field=value")
        kinds = dict(of.type.fields)
        given = {k.arg: self.of.of_type(k.value, kinds[k.arg or ""]) for k in node.keywords}
        for name, value in given.items():
            if (FLOAT if value.type == INT else value.type) != of.type.type_of(name or ""):
                self.source.refuse(node, f"the field {name!r} has another type", "Give it its own")
        same = {name: Field(of, name, kind) for name, kind in of.type.fields}
        return Make(of.type, tuple(given.get(name, same[name]) for name in same))

    def _arguments(
        self, node: ast.Call, names: tuple[str, ...], defaults: dict[str, Number],
        kinds: Mapping[str, Type],
    ) -> tuple[Expression, ...]:  # fmt: skip
        given: dict[str, Expression] = {}
        for n, argument in enumerate(node.args):
            if n < len(names):
                given[names[n]] = self.of.of_type(argument, kinds.get(names[n]))
        for keyword in node.keywords:
            if keyword.arg is not None and keyword.arg not in given:
                given[keyword.arg] = self.of.of_type(keyword.value, kinds.get(keyword.arg))
        whole = defaults | given
        if set(whole) != set(names) or len(node.args) + len(node.keywords) != len(given):
            self.source.refuse(
                node, f"the arguments are not those of ({', '.join(names)})", "Give each one once"
            )
        return tuple(whole[name] for name in names)
