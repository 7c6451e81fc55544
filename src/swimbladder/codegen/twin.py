"""The twin of a law: the tree of `tree` run in Python with numpy's float32, one rounding per step.

It stands for the compiled C, to the last bit, where C is compiled with IEEE 754 arithmetic and
without contraction; a NaN stands for any NaN.
"""

from __future__ import annotations

import dataclasses
from collections import namedtuple
from collections.abc import Callable
from typing import Any

import numpy as np

from swimbladder.codegen.subset import read_law
from swimbladder.codegen.tree import (
    BOOL,
    COUNT,
    FLOAT,
    INT,
    Assign,
    Binary,
    Builtin,
    Call,
    Choice,
    Compare,
    Constant,
    Expression,
    Field,
    For,
    Function,
    If,
    Logic,
    Make,
    Minus,
    Name,
    Not,
    Number,
    Program,
    Record,
    Return,
    Statement,
    Type,
)
from swimbladder.control.law import NEVER, Law, less, more


def twin(law: Law, program: Program | None = None) -> Law:
    """Return the law in float32: `step` and `initial` take any numbers, and round them first.

    Raises InputError, as `read_law`, where the law cannot be translated.
    """
    tree = read_law(law) if program is None else program
    text = _Text(tree)
    space = text.space
    exec(compile(text.source, f"<float32 twin of {law.name}>", "exec"), space)
    step, initial = space[text.names[tree.step]], space[text.names[tree.initial]]

    def float32_step(parameters: Any, state: Any, measurement: Any, reference: float) -> Any:
        with np.errstate(all="ignore"):
            command, after, next_s = step(
                rounded(tree.parameters, parameters), rounded(tree.state, state),
                rounded(tree.measurement, measurement), np.float32(reference),
            )  # fmt: skip
        return command, after, next_s

    def float32_initial(parameters: Any, measurement: Any, reference: float) -> Any:
        with np.errstate(all="ignore"):
            return initial(
                rounded(tree.parameters, parameters), rounded(tree.measurement, measurement),
                np.float32(reference),
            )  # fmt: skip

    return dataclasses.replace(law, step=float32_step, initial=float32_initial)


def rounded(kind: Type, value: Any) -> Any:
    """Return a number, or a named tuple of numbers, as float32, or as the count or truth it is."""
    if isinstance(kind, Record):
        make: Callable[..., Any] = kind.kind or tuple
        return make(*(rounded(k, v) for (_, k), v in zip(kind.fields, value, strict=True)))
    if kind == COUNT:
        return min(max(int(value), 0), NEVER)
    return bool(value) if kind == BOOL else np.float32(value)


def _least(a: Any, b: Any) -> Any:
    return b if b < a else a


def _most(a: Any, b: Any) -> Any:
    return b if b > a else a


_FUNCTIONS = {"min": "least_", "max": "most_", "abs": "abs", "sqrt": "sqrt_",
              "isfinite": "isfinite_", "copysign": "copysign_", "more": "more_", "less": "less_",
              "float": "float32_"}  # fmt: skip


class _Text:
    """A program as Python source, and the names that it needs."""

    def __init__(self, program: Program) -> None:
        self.space: dict[str, Any] = {
            "least_": _least, "most_": _most, "sqrt_": np.sqrt, "isfinite_": np.isfinite,
            "copysign_": np.copysign, "float32_": np.float32, "more_": more, "less_": less,
        }  # fmt: skip
        self._numbers: dict[str, str] = {}
        for record in program.records:
            kind = record.kind or namedtuple(record.name, [n for n, _ in record.fields])
            self.space[f"{record.name}__"] = kind
        functions = list(dict.fromkeys([*program.helpers, program.initial, program.step]))
        self.names = {f: f"function{n}_{f.name}" for n, f in enumerate(functions)}
        self.source = "\n\n".join(self._function(f) for f in functions) + "\n"

    def _function(self, function: Function) -> str:
        given = ", ".join(name for name, _ in function.parameters)
        lines = [f"def {self.names[function]}({given}):"]
        self._block(lines, function.body, "    ")
        return "\n".join(lines)

    def _block(self, lines: list[str], statements: tuple[Statement, ...], indent: str) -> None:
        if not statements:
            lines.append(f"{indent}pass")
        for s in statements:
            if isinstance(s, Assign):
                lines.append(f"{indent}{s.name} = {self._value(s.value)}")
            elif isinstance(s, Return):
                lines.append(f"{indent}return {self._value(s.value)}")
            elif isinstance(s, For):
                lines.append(f"{indent}for {s.counter} in range({s.count}):")
                self._block(lines, s.body, indent + "    ")
            elif isinstance(s, If):
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

    def _value(self, e: Expression) -> str:
        """Return an expression, in brackets wherever one might ask."""
        of = self._value
        if isinstance(e, Number) and e.type != FLOAT:
            return str(int(e.value) if e.type == COUNT else bool(e.value))
        if isinstance(e, Number | Constant):
            return self._number(e.value)
        if isinstance(e, Name):
            return f"float32_({e.name})" if e.type == INT else e.name
        if isinstance(e, Field):
            return f"{of(e.of)}.{e.name}"
        if isinstance(e, Minus):
            return f"(-{of(e.of)})"
        if isinstance(e, Binary | Compare):
            return f"({of(e.left)} {e.operator} {of(e.right)})"
        if isinstance(e, Logic):
            return f"({f' {e.operator} '.join(map(of, e.of))})"
        if isinstance(e, Not):
            return f"(not {of(e.of)})"
        if isinstance(e, Choice):
            return f"({of(e.yes)} if {of(e.condition)} else {of(e.no)})"
        if isinstance(e, Builtin) and e.name == "count":
            (counter,) = e.arguments
            assert isinstance(counter, Name)
            return counter.name
        if isinstance(e, Builtin):
            return f"{_FUNCTIONS[e.name]}({', '.join(map(of, e.arguments))})"
        if isinstance(e, Call):
            return f"{self.names[e.function]}({', '.join(map(of, e.arguments))})"
        assert isinstance(e, Make)
        return f"{e.type.name}__({', '.join(map(of, e.values))})"
