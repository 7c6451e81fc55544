"""The expressions of a law's function, read into the tree."""

from __future__ import annotations

import ast
import math
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swimbladder.codegen.calls import Calls
from swimbladder.codegen.tree import (
    BOOL,
    COUNT,
    FLOAT,
    INT,
    Binary,
    Builtin,
    Choice,
    Compare,
    Expression,
    Field,
    Logic,
    Minus,
    Not,
    Number,
    Record,
    Type,
)
from swimbladder.control.law import NEVER

if TYPE_CHECKING:
    from swimbladder.codegen.statements import Body

_Operator = Literal["+", "-", "*", "/", "&", "|"]
_Comparison = Literal["<", "<=", ">", ">=", "==", "!="]
_ARITHMETIC: dict[type[ast.AST], _Operator] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"
}  # fmt: skip
_COMPARISONS: dict[type[ast.AST], _Comparison] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
_BITS: dict[type[ast.AST], _Operator] = {ast.BitAnd: "&", ast.BitOr: "|"}
_INSTEAD: dict[type[ast.AST], str] = {
    ast.Pow: "Multiply, or use math.sqrt",
    ast.Mod: "Count with a loop, or keep what is left in the state",
    ast.FloorDiv: "Divide with /, and compare",
}


class Expressions:
    """Expressions at one place of a function, where its names mean what they mean there."""

    def __init__(self, body: Body) -> None:
        self.body, self.source = body, body.source

    def number(self, node: ast.expr) -> Expression:
        """Return an expression that is a number."""
        got = self.read(node)
        if got.type == COUNT:
            self.source.refuse(
                node, "this is a count", "Write float(n) for its number, more(n, by) or less(n, by)"
            )
        if got.type not in (FLOAT, INT):
            self.source.refuse(node, "this is no number", "A law calculates with floats and counts")
        return got

    def count(self, node: ast.expr) -> Expression:
        """Return an expression that is a count, which a whole literal can be."""
        if isinstance(node, ast.IfExp):
            yes, no = self.count(node.body), self.count(node.orelse)
            return Choice(self.truth(node.test), yes, no, COUNT)
        value, known = self.outside(node)
        if isinstance(node, ast.Constant):
            value, known = node.value, True
        if known and isinstance(value, int) and not isinstance(value, bool):
            if not 0 <= value <= NEVER:
                self.source.refuse(node, f"not 0 to {NEVER}", "A count stays within 16 bits")
            return Number(float(value), COUNT)
        got = self.read(node)
        if got.type == INT:
            return Builtin("count", (got,), COUNT)
        if got.type != COUNT:
            self.source.refuse(node, "this is no count", "A count is a whole number, 0 to 65535")
        return got

    def of_type(self, node: ast.expr, wanted: Type | None) -> Expression:
        """Return an expression, a count where one is wanted."""
        return self.count(node) if wanted == COUNT else self.read(node)

    def counts(self, nodes: list[ast.expr]) -> bool:
        """Return whether there is a count among them, so that all have to be counts."""
        return any(self.read(node).type == COUNT for node in nodes)

    def truth(self, node: ast.expr) -> Expression:
        """Return an expression that is true or false."""
        got = self.read(node)
        if got.type != BOOL:
            self.source.refuse(node, "this is not true or false", "Write a comparison, as x != 0.0")
        return got

    def turns(self, node: ast.expr) -> int | None:
        """Return N of ``range(N)``, None where it is anything else."""
        if not (isinstance(node, ast.Call) and len(node.args) == 1 and not node.keywords):
            return None
        count, known = self.outside(node.args[0])
        if isinstance(node.args[0], ast.Constant):
            count, known = node.args[0].value, True
        function, _ = self.outside(node.func)
        whole = known and isinstance(count, int) and not isinstance(count, bool)
        return count if function is range and whole else None

    def read(self, node: ast.expr) -> Expression:
        """Return an expression of any type."""
        if isinstance(node, ast.Constant):
            return self._literal(node)
        if isinstance(node, ast.Name | ast.Attribute):
            return self._named(node)
        if isinstance(node, ast.UnaryOp):
            return self._unary(node)
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.Compare):
            return self._compare(node)
        if isinstance(node, ast.BoolOp):
            operator: Literal["and", "or"] = "and" if isinstance(node.op, ast.And) else "or"
            return Logic(operator, tuple(self.truth(value) for value in node.values))
        if isinstance(node, ast.IfExp):
            return self._choice(node)
        if isinstance(node, ast.Call):
            return Calls(self).read(node)
        what = type(node).__name__.lower()
        self.source.refuse(
            node, f"a law has no expression of the kind {what!r}",
            "Use arithmetic, comparisons, min, max, abs, math.sqrt and calls of plain functions",
        )  # fmt: skip

    def _literal(self, node: ast.Constant) -> Expression:
        if isinstance(node.value, bool):
            return Number(float(node.value), BOOL)
        if not isinstance(node.value, int | float):
            self.source.refuse(node, "a law's literals are numbers", "Write a number")
        return Number(self.float32(node, float(node.value)))

    def float32(self, node: ast.expr, value: float) -> float:
        """Return a value that float32 can hold, nearly; refuse any other."""
        with np.errstate(over="ignore", under="ignore"):
            rounded = float(np.float32(value))
        if (math.isinf(rounded) and not math.isinf(value)) or (rounded == 0.0 and value != 0.0):
            self.source.refuse(
                node, f"{value:g} is beyond float32", "Stay within 1e-45 to 3.4e38, or use math.inf"
            )
        return value

    def outside(self, node: ast.expr) -> tuple[Any, bool]:
        """Return (what a name, or a name in a module, means outside the function, known)."""
        if isinstance(node, ast.Name) and node.id not in self.body.meaning:
            if node.id in self.body._stored:
                return None, False
            try:
                return self.source.look_up(node.id), True
            except KeyError:
                return None, False
        if isinstance(node, ast.Attribute):
            module, known = self.outside(node.value)
            if known and isinstance(module, ModuleType) and hasattr(module, node.attr):
                return getattr(module, node.attr), True
        return None, False

    def _named(self, node: ast.Name | ast.Attribute) -> Expression:
        if isinstance(node, ast.Name) and node.id in self.body.meaning:
            return self.body.meaning[node.id]
        value, known = self.outside(node)
        if known:
            if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
                self.source.refuse(
                    node,
                    "this is no constant number",
                    "Name floats of the module, or its functions",
                )
            name = node.id if isinstance(node, ast.Name) else node.attr
            return self.body.reader.constant(name, self.float32(node, float(value)))
        if isinstance(node, ast.Name):
            self.source.refuse(
                node, "this name has no value here, or not for certain",
                "Assign it in every branch that leads here",
            )  # fmt: skip
        of = self.read(node.value)
        kind = of.type.type_of(node.attr) if isinstance(of.type, Record) else None
        if kind is None:
            self.source.refuse(node, "there is no such field", "Name a field of the NamedTuple")
        return Field(of, node.attr, kind)

    def _unary(self, node: ast.UnaryOp) -> Expression:
        if isinstance(node.op, ast.Not):
            return Not(self.truth(node.operand))
        if isinstance(node.op, ast.USub):
            return Minus(self.number(node.operand))
        if isinstance(node.op, ast.UAdd):
            return self.number(node.operand)
        self.source.refuse(node, "a law does not turn bits round", "Use & and | of counts")

    def _binary(self, node: ast.BinOp) -> Expression:
        if type(node.op) in _BITS:
            return Binary(
                _BITS[type(node.op)], self.count(node.left), self.count(node.right), COUNT
            )
        operator = _ARITHMETIC.get(type(node.op))
        if operator is None:
            self.source.refuse(
                node, "this operation is not the same to the bit on every processor",
                _INSTEAD.get(type(node.op), "Use + - * /"),
            )  # fmt: skip
        return Binary(operator, self.number(node.left), self.number(node.right))

    def _compare(self, node: ast.Compare) -> Expression:
        operands = [node.left, *node.comparators]
        pairs: list[Expression] = []
        for left, kind, right in zip(operands[:-1], node.ops, operands[1:], strict=True):
            operator = _COMPARISONS.get(type(kind))
            if operator is None:
                self.source.refuse(node, "a law compares numbers only", "Use < <= > >= == !=")
            take = self.count if self.counts([left, right]) else self.number
            pairs.append(Compare(operator, take(left), take(right)))
        return pairs[0] if len(pairs) == 1 else Logic("and", tuple(pairs))

    def _choice(self, node: ast.IfExp) -> Expression:
        if self.counts([node.body, node.orelse]):
            return self.count(node)
        condition = self.truth(node.test)
        yes, no = self.read(node.body), self.read(node.orelse)
        kinds = {FLOAT if value.type == INT else value.type for value in (yes, no)}
        if len(kinds) != 1:
            self.source.refuse(node, "the two values differ in type", "Make them the same")
        return Choice(condition, yes, no, kinds.pop())
