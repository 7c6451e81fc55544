"""The twin of a law: the tree of `tree` run in Python with numpy's float32, one rounding per step.

It stands for the compiled C, to the last bit, where C is compiled with IEEE 754 arithmetic and
without contraction; a NaN stands for any NaN.
"""

import dataclasses
from collections import namedtuple
from collections.abc import Callable
from typing import Any

import numpy as np

from swimbladder.codegen import tree
from swimbladder.codegen.subset import read_law
from swimbladder.control.law import NEVER, Law, less, more


def twin(law: Law, program: tree.Program | None = None) -> Law:
    """Return the law in float32: `step` and `initial` take any numbers, and round them first.

    Raises InputError, as `read_law`, where the law cannot be translated.
    """
    made = read_law(law) if program is None else program
    text = _Text(made)
    exec(compile(text.source, f"<float32 twin of {law.name}>", "exec"), text.space)

    def in_float32(function: tree.Function) -> Callable[..., Any]:
        def call(*given: Any) -> Any:
            values = zip(function.parameters, given, strict=True)
            with np.errstate(all="ignore"):
                return text.space[text.names[function]](*(rounded(k, v) for (_, k), v in values))

        return call

    step, initial = in_float32(made.step), in_float32(made.initial)
    return dataclasses.replace(law, step=step, initial=initial)


def rounded(kind: tree.Type, value: Any) -> Any:
    """Return a number, or a named tuple of numbers, as float32, or as the count or truth it is."""
    if isinstance(kind, tree.Record):
        make: Callable[..., Any] = kind.kind or tuple
        return make(*(rounded(k, v) for (_, k), v in zip(kind.fields, value, strict=True)))
    if kind == tree.COUNT:
        return min(max(int(value), 0), NEVER)
    return bool(value) if kind == tree.BOOL else np.float32(value)


def _least(a: Any, b: Any) -> Any:
    return b if b < a else a


def _most(a: Any, b: Any) -> Any:
    return b if b > a else a


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "min": _least,
    "max": _most,
    "abs": abs,
    "sqrt": np.sqrt,
    "isfinite": np.isfinite,
    "copysign": np.copysign,
    "float": np.float32,
    "more": more,
    "less": less,
}
_FORMS: dict[type[Any], str] = {  # of the parts, in brackets wherever one might ask
    tree.Field: "{of}.{name}",
    tree.Minus: "(-{of})",
    tree.Not: "(not {of})",
    tree.Binary: "({left} {operator} {right})",
    tree.Compare: "({left} {operator} {right})",
    tree.Choice: "({yes} if {condition} else {no})",
}


class _Text:
    """A program as Python source, and the names that it needs."""

    def __init__(self, program: tree.Program) -> None:
        self.space: dict[str, Any] = {f"{name}_": known for name, known in _FUNCTIONS.items()}
        self._numbers: dict[str, str] = {}
        for record in program.records:
            kind = record.kind or namedtuple(record.name, [n for n, _ in record.fields])
            self.space[f"{record.name}__"] = kind
        functions = list(dict.fromkeys([*program.helpers, program.initial, program.step]))
        self.names = {f: f"function{n}_{f.name}" for n, f in enumerate(functions)}
        self.source = "\n\n".join(self._function(f) for f in functions) + "\n"

    def _function(self, function: tree.Function) -> str:
        given = ", ".join(name for name, _ in function.parameters)
        lines = [f"def {self.names[function]}({given}):"]
        self._block(lines, function.body, "    ")
        return "\n".join(lines)

    def _block(self, lines: list[str], statements: tuple[tree.Statement, ...], indent: str) -> None:
        if not statements:
            lines.append(f"{indent}pass")
        for s in statements:
            if isinstance(s, tree.Assign):
                lines.append(f"{indent}{s.name} = {self._value(s.value)}")
            elif isinstance(s, tree.Return):
                lines.append(f"{indent}return {self._value(s.value)}")
            elif isinstance(s, tree.For):
                lines.append(f"{indent}for {s.counter} in range({s.count}):")
                self._block(lines, s.body, indent + "    ")
            elif isinstance(s, tree.If):
                lines.append(f"{indent}if {self._value(s.condition)}:")
                self._block(lines, s.yes, indent + "    ")
                lines.append(f"{indent}else:")
                self._block(lines, s.no, indent + "    ")

    def _number(self, value: float) -> str:
        with np.errstate(all="ignore"):
            number = np.float32(value)
        name = self._numbers.setdefault(number.tobytes().hex(), f"number{len(self._numbers)}_")
        self.space[name] = number
        return name

    def _value(self, e: Any) -> str:
        """Return an expression."""
        if type(e) in _FORMS:
            parts = {
                name: part if isinstance(part, str) else self._value(part)
                for name, part in vars(e).items()
                if name != "type"
            }
            return _FORMS[type(e)].format(**parts)
        if isinstance(e, tree.Number) and e.type != tree.FLOAT:
            return str(int(e.value) if e.type == tree.COUNT else bool(e.value))
        if isinstance(e, tree.Number | tree.Constant):
            return self._number(e.value)
        if isinstance(e, tree.Name):
            return f"float_({e.name})" if e.type == tree.INT else e.name
        if isinstance(e, tree.Logic):
            return f"({f' {e.operator} '.join(map(self._value, e.of))})"
        if isinstance(e, tree.Builtin) and e.name == "count":
            (counter,) = e.arguments
            assert isinstance(counter, tree.Name)
            return counter.name
        if isinstance(e, tree.Builtin):
            called, given = f"{e.name}_", e.arguments
        elif isinstance(e, tree.Call):
            called, given = self.names[e.function], e.arguments
        else:
            called, given = f"{e.type.name}__", e.values
        return f"{called}({', '.join(map(self._value, given))})"
