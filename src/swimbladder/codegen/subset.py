"""A law's Python functions read into the small typed tree of `tree`.

What a law may be made of is written here, and only here; anything else is an InputError with its
file, its line and what to write instead. Types are inferred from the calls, beginning with those
of `step` and `initial`, so annotations are not needed.

`Body` reads the statements of a function, `Expressions` its expressions and `Calls` its calls.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import re
from collections.abc import Callable, Hashable, Mapping
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import numpy as np

from swimbladder.codegen import tree
from swimbladder.codegen.c_places import always_returns, inside, is_docstring, stores
from swimbladder.control.law import NEVER, Count, Law, Measurement, less, more
from swimbladder.control.records import field_types, is_record, leaf_names
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from typing import Any


_Builtin = Literal["min", "max", "abs", "sqrt", "isfinite", "copysign"]
_ON_COUNTS: dict[Callable[..., Any], Literal["min", "max", "more", "less"]] = {
    min: "min", max: "max", more: "more", less: "less"
}  # fmt: skip
_BUILTINS: dict[Callable[..., Any], tuple[_Builtin, int, tree.Type]] = {
    min: ("min", 2, tree.FLOAT), max: ("max", 2, tree.FLOAT), abs: ("abs", 1, tree.FLOAT),
    math.fabs: ("abs", 1, tree.FLOAT), math.sqrt: ("sqrt", 1, tree.FLOAT),
    math.isfinite: ("isfinite", 1, tree.BOOL), math.copysign: ("copysign", 2, tree.FLOAT),
}  # fmt: skip


def is_count(function: Callable[..., Any], written: Any) -> bool:
    """Return whether an annotation of a function, or in it, means a count."""
    if isinstance(written, str):
        written = getattr(function, "__globals__", {}).get(written, written)
    return bool(written == Count)


def _plain(value: tree.Expression) -> tree.Type:
    """Return the type of a value, that of a number for the counter of a loop."""
    return tree.FLOAT if value.type == tree.INT else value.type


class Calls:
    """Calls at the place of a function where `of` reads expressions."""

    def __init__(self, of: Expressions) -> None:
        self.of, self.body, self.source = of, of.body, of.source

    def read(self, node: ast.Call) -> tree.Expression:
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
        values = self._arguments(node, names, {}, dict.fromkeys(written, tree.COUNT))
        kinds = tuple(_plain(value) for value in values)
        called = self.body.reader.call(self.source, node, plain, kinds)
        return tree.Call(called, values, called.returns)

    def _builtin(self, node: ast.Call, function: Hashable) -> tree.Expression | None:
        """Return a call of what C and the twin have as well, None where it is something else."""
        if function in (more, less) or (function in (min, max) and self.of.counts(node.args)):
            name: Any = _ON_COUNTS[function]
            self._check_arguments(node, name, 2)
            return tree.Builtin(name, tuple(map(self.of.count, node.args)), tree.COUNT)
        if function is float:
            self._check_arguments(node, "float", 1)
            return tree.Builtin("float", (self.of.count(node.args[0]),), tree.FLOAT)
        if function not in _BUILTINS:
            return None
        known, count, kind = _BUILTINS[function]
        self._check_arguments(node, known, count)
        return tree.Builtin(known, tuple(map(self.of.number, node.args)), kind)

    def _check_arguments(self, node: ast.Call, name: str, count: int) -> None:
        if len(node.args) != count or node.keywords:
            self.source.refuse(node, f"{name} takes {count} numbers here", "Nest the calls")

    def _make(self, node: ast.Call, kind: type[Any]) -> tree.Expression:
        record = self.body.reader.record(kind, self.source, node)
        kinds = dict(record.fields)
        defaults = {
            name: tree.Number(self.of.float32(node, float(value)), kinds[name])
            for name, value in getattr(kind, "_field_defaults", {}).items()
            if isinstance(value, int | float)
        }
        values = self._arguments(node, tuple(kinds), defaults, kinds)
        for value, (name, wanted) in zip(values, record.fields, strict=True):
            if _plain(value) != wanted:
                self.source.refuse(node, f"the field {name!r} has another type", "Give it its own")
        return tree.Make(record, values)

    def _replaced(self, node: ast.Call, of_node: ast.expr) -> tree.Expression:
        """Return a copy of a named tuple with some of its fields changed."""
        of = self.of.read(of_node)
        fields = [keyword.arg for keyword in node.keywords]
        if not (isinstance(tree.place_of(of)[0], tree.Name) and isinstance(of.type, tree.Record)):
            self.source.refuse(node, "this is no name of a NamedTuple", "Give it a name first")
        if node.args or not all(field and of.type.type_of(field) for field in fields):
            self.source.refuse(node, "the arguments are not its fields", "Write field=value")
        kinds = dict(of.type.fields)
        given = {k.arg: self.of.of_type(k.value, kinds[k.arg or ""]) for k in node.keywords}
        for name, value in given.items():
            if _plain(value) != of.type.type_of(name or ""):
                self.source.refuse(node, f"the field {name!r} has another type", "Give it its own")
        same = {name: tree.Field(of, name, kind) for name, kind in of.type.fields}
        return tree.Make(of.type, tuple(given.get(name, same[name]) for name in same))

    def _arguments(
        self, node: ast.Call, names: tuple[str, ...], defaults: dict[str, tree.Number],
        kinds: Mapping[str, tree.Type],
    ) -> tuple[tree.Expression, ...]:  # fmt: skip
        given: dict[str, tree.Expression] = {}
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

    def number(self, node: ast.expr) -> tree.Expression:
        """Return an expression that is a number."""
        got = self.read(node)
        if got.type == tree.COUNT:
            self.source.refuse(
                node, "this is a count", "Write float(n) for its number, more(n, by) or less(n, by)"
            )
        if got.type not in (tree.FLOAT, tree.INT):
            self.source.refuse(node, "this is no number", "A law calculates with floats and counts")
        return got

    def count(self, node: ast.expr) -> tree.Expression:
        """Return an expression that is a count, which a whole literal can be."""
        if isinstance(node, ast.IfExp):
            yes, no = self.count(node.body), self.count(node.orelse)
            return tree.Choice(self.truth(node.test), yes, no, tree.COUNT)
        value, known = self.outside(node)
        if isinstance(node, ast.Constant):
            value, known = node.value, True
        if known and isinstance(value, int) and not isinstance(value, bool):
            if not 0 <= value <= NEVER:
                self.source.refuse(node, f"not 0 to {NEVER}", "A count stays within 16 bits")
            return tree.Number(float(value), tree.COUNT)
        got = self.read(node)
        if got.type == tree.INT:
            return tree.Builtin("count", (got,), tree.COUNT)
        if got.type != tree.COUNT:
            self.source.refuse(node, "this is no count", "A count is a whole number, 0 to 65535")
        return got

    def of_type(self, node: ast.expr, wanted: tree.Type | None) -> tree.Expression:
        """Return an expression, a count where one is wanted."""
        return self.count(node) if wanted == tree.COUNT else self.read(node)

    def counts(self, nodes: list[ast.expr]) -> bool:
        """Return whether there is a count among them, so that all have to be counts."""
        return any(self.read(node).type == tree.COUNT for node in nodes)

    def truth(self, node: ast.expr) -> tree.Expression:
        """Return an expression that is true or false."""
        got = self.read(node)
        if got.type != tree.BOOL:
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

    def read(self, node: ast.expr) -> tree.Expression:
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
            return tree.Logic(operator, tuple(self.truth(value) for value in node.values))
        if isinstance(node, ast.IfExp):
            return self._choice(node)
        if isinstance(node, ast.Call):
            return Calls(self).read(node)
        what = type(node).__name__.lower()
        self.source.refuse(
            node, f"a law has no expression of the kind {what!r}",
            "Use arithmetic, comparisons, min, max, abs, math.sqrt and calls of plain functions",
        )  # fmt: skip

    def _literal(self, node: ast.Constant) -> tree.Expression:
        if isinstance(node.value, bool):
            return tree.Number(float(node.value), tree.BOOL)
        if not isinstance(node.value, int | float):
            self.source.refuse(node, "a law's literals are numbers", "Write a number")
        return tree.Number(self.float32(node, float(node.value)))

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

    def _named(self, node: ast.Name | ast.Attribute) -> tree.Expression:
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
        kind = of.type.type_of(node.attr) if isinstance(of.type, tree.Record) else None
        if kind is None:
            self.source.refuse(node, "there is no such field", "Name a field of the NamedTuple")
        return tree.Field(of, node.attr, kind)

    def _unary(self, node: ast.UnaryOp) -> tree.Expression:
        if isinstance(node.op, ast.Not):
            return tree.Not(self.truth(node.operand))
        if isinstance(node.op, ast.USub):
            return tree.Minus(self.number(node.operand))
        if isinstance(node.op, ast.UAdd):
            return self.number(node.operand)
        self.source.refuse(node, "a law does not turn bits round", "Use & and | of counts")

    def _binary(self, node: ast.BinOp) -> tree.Expression:
        if type(node.op) in _BITS:
            return tree.Binary(
                _BITS[type(node.op)], self.count(node.left), self.count(node.right), tree.COUNT
            )
        operator = _ARITHMETIC.get(type(node.op))
        if operator is None:
            self.source.refuse(
                node, "this operation is not the same to the bit on every processor",
                _INSTEAD.get(type(node.op), "Use + - * /"),
            )  # fmt: skip
        return tree.Binary(operator, self.number(node.left), self.number(node.right))

    def _compare(self, node: ast.Compare) -> tree.Expression:
        operands = [node.left, *node.comparators]
        pairs: list[tree.Expression] = []
        for left, kind, right in zip(operands[:-1], node.ops, operands[1:], strict=True):
            operator = _COMPARISONS.get(type(kind))
            if operator is None:
                self.source.refuse(node, "a law compares numbers only", "Use < <= > >= == !=")
            take = self.count if self.counts([left, right]) else self.number
            pairs.append(tree.Compare(operator, take(left), take(right)))
        return pairs[0] if len(pairs) == 1 else tree.Logic("and", tuple(pairs))

    def _choice(self, node: ast.IfExp) -> tree.Expression:
        if self.counts([node.body, node.orelse]):
            return self.count(node)
        condition = self.truth(node.test)
        yes, no = self.read(node.body), self.read(node.orelse)
        kinds = {_plain(value) for value in (yes, no)}
        if len(kinds) != 1:
            self.source.refuse(node, "the two values differ in type", "Make them the same")
        return tree.Choice(condition, yes, no, kinds.pop())


_OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"
}  # fmt: skip
_MOST_TURNS = 32767  # an int of 16 bits counts them


class Body:
    """One function being read: its variables, and which of them have a value for certain."""

    def __init__(
        self, reader: _Reader, source: Source, name: str, types: tuple[tree.Type, ...]
    ) -> None:
        self.reader, self.source, self.name = reader, source, name
        definition = source.tree
        given = definition.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs or given.defaults:
            source.refuse(None, "a law's function has plain parameters only", "Name each of them")
        names = [a.arg for a in given.args]
        if len(names) != len(types):
            source.refuse(
                None, f"{len(names)} parameters, but {len(types)} arguments",
                "Give each parameter its argument",
            )  # fmt: skip
        self.parameters = tuple(zip(names, types, strict=True))
        self.variables: dict[str, tree.Type] = {}
        self.meaning: dict[str, tree.Expression] = {n: tree.Name(n, t) for n, t in self.parameters}
        self.returns: tree.Type | None = None
        if is_count(source.function, source.function.__annotations__.get("return")):
            self.returns = tree.COUNT
        self._stored = stores(definition)
        self._loaded = {
            n.id for n in ast.walk(definition)
            if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)
        }  # fmt: skip
        self._temporaries = 0

    def read(self) -> tree.Function:
        """Return the function."""
        definition = self.source.tree
        body: list[tree.Statement] = []
        for name, kind in self.parameters:
            if name in self._stored and isinstance(kind, tree.Record):  # a variable begins as it
                inner = f"{name}_given"
                self.parameters = tuple((inner if n == name else n, t) for n, t in self.parameters)
                body.append(tree.Assign(name, tree.Name(inner, kind)))
                self.variables[name] = kind
        body += self._block(definition.body)
        if not always_returns(body):
            self.source.refuse(None, "the function may end without a return", "Return everywhere")
        assert self.returns is not None
        words = (ast.get_docstring(definition) or "").split("\n\n")[0]
        return tree.Function(
            name=self.name, parameters=self.parameters, variables=tuple(self.variables.items()),
            body=tuple(body), returns=self.returns, words=" ".join(words.split()),
        )  # fmt: skip

    def _block(self, statements: list[ast.stmt]) -> list[tree.Statement]:
        done: list[tree.Statement] = []
        for n, statement in enumerate(statements):
            if n == 0 and is_docstring(statement):
                continue
            done += self._statement(statement)
            if always_returns(done):
                if n + 1 < len(statements):
                    self.source.refuse(
                        statements[n + 1], "what comes after a return is never done", "Remove it"
                    )
                break
        return done

    def _statement(self, node: ast.stmt) -> list[tree.Statement]:
        evaluate = Expressions(self)
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target = node.targets[0]
            if isinstance(target, ast.Tuple):
                return self._unpack(node, target, node.value)
            name = self._target(target)
            wanted = self.variables.get(name) or dict(self.parameters).get(name)
            return self._assign(node, name, evaluate.of_type(node.value, wanted))
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            kind = (
                tree.COUNT if is_count(self.source.function, ast.unparse(node.annotation)) else None
            )
            value = evaluate.of_type(node.value, kind)
            return self._assign(node, self._target(node.target), value)
        if isinstance(node, ast.AugAssign) and type(node.op) in _OPERATORS:
            name = self._target(node.target)
            before = evaluate.number(ast.copy_location(ast.Name(name, ast.Load()), node.target))
            operator: Any = _OPERATORS[type(node.op)]
            changed = tree.Binary(operator, before, evaluate.number(node.value))
            return self._assign(node, name, changed)
        if isinstance(node, ast.If):
            return self._if(node)
        if isinstance(node, ast.For):
            return self._for(node)
        if isinstance(node, ast.Return) and node.value is not None:
            return [tree.Return(self._returned(node, node.value))]
        what = type(node).__name__.lower()
        self.source.refuse(
            node, f"a law has no {what!r} statement",
            "Use assignments, if, for over a constant range, and return",
        )  # fmt: skip

    def _target(self, node: ast.expr) -> str:
        if not isinstance(node, ast.Name):
            self.source.refuse(
                node, "a law assigns to plain names only", "Make a new NamedTuple of the values"
            )
        return node.id

    def _assign(self, node: ast.AST, name: str, value: tree.Expression) -> list[tree.Statement]:
        if isinstance(value, tree.Name) and isinstance(value.type, tree.Record):
            once = self._stored.get(name) == 1 and self._stored.get(value.name, 0) <= 1
            if once and name not in self.variables and value.name not in self._loops():
                self.meaning[name] = value  # another name for the same record
                return []
        root, inner = tree.place_of(value)
        if inner and isinstance(value.type, tree.Record) and isinstance(root, tree.Name):
            fixed = root.name in dict(self.parameters) and root.name not in self._stored
            if fixed and self._stored.get(name) == 1:
                self.meaning[name] = value  # another name for a part of what was given
                return []
        if name not in self._loaded:
            return []  # nothing reads it, and no value has an effect of its own
        kind: tree.Type = _plain(value)
        known = dict(self.parameters).get(name) or self.variables.setdefault(name, kind)
        if known != kind:
            self.source.refuse(
                node, f"{name!r} changes its type", "Give the other value a name of its own"
            )
        self.meaning[name] = tree.Name(name, kind)
        return [tree.Assign(name, value)]

    def _loops(self) -> set[str]:
        """Names that loops assign: what they mean changes from turn to turn."""
        found: set[str] = set()
        for node in ast.walk(self.source.tree):
            if isinstance(node, ast.For):
                found |= set(stores(node))
        return found

    def _temporary(self, value: tree.Expression) -> tuple[list[tree.Statement], tree.Name]:
        self._temporaries += 1
        name = f"value{self._temporaries}"
        while name in self._stored or name in dict(self.parameters):
            name += "_"
        self.variables[name] = value.type
        return [tree.Assign(name, value)], tree.Name(name, value.type)

    def _unpack(self, node: ast.stmt, target: ast.Tuple, value: ast.expr) -> list[tree.Statement]:
        names = [self._target(element) for element in target.elts]
        evaluate = Expressions(self)
        if isinstance(value, ast.Tuple):
            values = [evaluate.read(element) for element in value.elts]
            before: list[tree.Statement] = []
            later = {n.id for e in value.elts[1:] for n in ast.walk(e) if isinstance(n, ast.Name)}
            if later & set(names[:-1]):  # an old value is asked for after its name has a new one
                for n, one in enumerate(values):
                    if not (isinstance(one, tree.Name) and isinstance(one.type, tree.Record)):
                        kept, values[n] = self._temporary(one)
                        before += kept
        else:
            whole = evaluate.read(value)
            if not isinstance(whole.type, tree.Record):
                self.source.refuse(value, "this is one value, not several", "Assign it to one name")
            before, at = ([], whole) if isinstance(whole, tree.Name) else self._temporary(whole)
            values = [tree.Field(at, name, kind) for name, kind in whole.type.fields]
        if len(names) != len(values):
            self.source.refuse(
                node, f"{len(names)} names for {len(values)} values", "Give each value a name"
            )
        return before + [
            s for n, v in zip(names, values, strict=True) for s in self._assign(node, n, v)
        ]

    def _if(self, node: ast.If) -> list[tree.Statement]:
        condition = Expressions(self).truth(node.test)
        before = dict(self.meaning)
        yes = self._block(node.body)
        after_yes = self.meaning
        self.meaning = dict(before)
        no = self._block(node.orelse)
        if always_returns(no):
            self.meaning = after_yes
        elif not always_returns(yes):  # a name means something only where it does after both
            self.meaning = {
                name: value for name, value in self.meaning.items() if after_yes.get(name) == value
            }
        return [tree.If(condition, tuple(yes), tuple(no))]

    def _for(self, node: ast.For) -> list[tree.Statement]:
        source = self.source
        count = Expressions(self).turns(node.iter)
        if count is None or node.orelse:
            source.refuse(
                node.iter, "a law's loop runs over a constant range",
                "Write `for i in range(N)` with a number, or a constant of the module, for N",
            )  # fmt: skip
        if not 1 <= count <= _MOST_TURNS:
            source.refuse(node.iter, f"not 1 to {_MOST_TURNS} turns", "Choose another count")
        counter = self._target(node.target)
        if counter in stores(ast.Module(node.body, [])) or counter in self.variables:
            source.refuse(node, f"{counter!r} is a variable too", "Give the counter its own name")
        before = self.meaning.get(counter)
        self.meaning[counter] = tree.Name(counter, tree.INT)
        body = self._block(node.body)
        if any(isinstance(s, tree.Return) for s in inside(body)):
            source.refuse(node, "a law does not return out of a loop", "Return after it")
        self.meaning.pop(counter)
        if before is not None:
            self.meaning[counter] = before
        return [tree.For(counter, count, tuple(body))]

    def _returned(self, node: ast.Return, value: ast.expr) -> tree.Expression:
        evaluate = Expressions(self)
        got: tree.Expression
        if isinstance(value, ast.Tuple):
            values = tuple(evaluate.read(element) for element in value.elts)
            kinds = tuple(_plain(v) for v in values)
            got = tree.Make(self.reader.result(kinds), values)
        else:
            got = evaluate.of_type(value, self.returns)
        kind: tree.Type = _plain(got)
        if self.returns is None:
            self.returns = kind
        if self.returns != kind:
            self.source.refuse(
                node, "the function returns values of different types", "Return one type everywhere"
            )
        return got


def read_law(law: Law, seen: type[Any] = Measurement) -> tree.Program:
    """Return a law as a tree; seen: the NamedTuple that it sees at a sample.

    Raises InputError with file, line, construct and remedy where it is not in the subset.
    """
    reader = _Reader()
    if law.parameters is law.state:
        raise InputError(
            "the parameters and the state are the same class", field=f"law {law.name!r}",
            remedy="Give each a NamedTuple of its own",
        )  # fmt: skip
    parameters = reader.record(law.parameters, name="parameters")
    state = reader.record(law.state, name="state")
    measurement = reader.record(seen, name="measurement" if seen is Measurement else "seen")
    leaf_names(law.parameters)  # refuses two of the same name
    step = reader.function(law.step, (parameters, state, measurement, tree.FLOAT))
    initial = reader.function(law.initial, (parameters, measurement, tree.FLOAT))
    _check_entry(law, "step", step, law.step, (tree.FLOAT, state, tree.FLOAT))
    _check_entry(law, "initial", initial, law.initial, state)
    return tree.Program(
        name=law.name, parameters=parameters, state=state, measurement=measurement,
        records=tuple(reader.records.values()), constants=tuple(reader.constants.values()),
        helpers=tuple(f for f in reader.functions.values() if f.name in reader.called),
        step=step, initial=initial, words=law.summary,
    )  # fmt: skip


def _check_entry(
    law: Law, what: str, function: tree.Function, source: Callable[..., Any],
    returns: tree.Type | tuple[tree.Type, ...],
) -> None:  # fmt: skip
    got: Any = function.returns
    if isinstance(returns, tuple) and isinstance(got, tree.Record) and got.kind is None:
        got = tuple(kind for _, kind in got.fields)
    if got != returns:
        wanted = "(command, state, next_sample_s)" if what == "step" else "the state"
        Source(source).refuse(
            None, f"{what} of the law {law.name!r} does not return {wanted}",
            f"Return {wanted}, the state as a {law.state.__name__}",
        )  # fmt: skip


class Source:
    """The text of a function, to point at its lines, and the names it can see."""

    def __init__(self, function: Callable[..., Any]) -> None:
        function = getattr(function, "py_func", function)  # what numba made of it
        self.function = function
        try:
            lines, first = inspect.getsourcelines(function)
            self.file = inspect.getsourcefile(function) or "?"
            self.tree = _definition("".join(lines))
        except (OSError, TypeError, SyntaxError) as error:
            raise InputError(
                "the source of a law's function cannot be read",
                field="law",
                value=getattr(function, "__name__", function),
                remedy="Write it as a plain function in a file",
            ) from error
        self.before = first - 1
        names = dict(function.__globals__)
        cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        self.names: Mapping[str, Any] = names | {name: cell.cell_contents for name, cell in cells}

    def refuse(self, node: ast.AST | None, what: str, remedy: str) -> NoReturn:
        """Raise InputError about a node, or about the function as a whole."""
        at = self.tree if node is None else node
        raise InputError(
            what, file=self.file, line=self.before + getattr(at, "lineno", 1),
            field=f"{self.function.__name__}()",
            value=None if node is None or isinstance(node, ast.stmt) else ast.unparse(node),
            remedy=remedy,
        )  # fmt: skip

    def look_up(self, name: str) -> Any:
        """Return what a name means outside the function; KeyError where it means nothing."""
        if name in self.names:
            return self.names[name]
        return vars(builtins)[name]


def _definition(text: str) -> ast.FunctionDef:
    found = ast.parse(inspect.cleandoc("\n" + text) if text[:1].isspace() else text).body[0]
    if not isinstance(found, ast.FunctionDef):
        raise TypeError("not a plain function")
    return found


class _Reader:
    """Functions, records and constants found so far."""

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, tuple[tree.Type, ...]], tree.Function] = {}
        self.records: dict[str, tree.Record] = {}
        self.constants: dict[str, tree.Constant] = {}
        self.called: set[str] = set()
        self._names: set[str] = set()
        self._reading: list[Any] = []

    def record(
        self, kind: type[Any], source: Source | None = None, at: Any = None, name: str = ""
    ) -> tree.Record:
        """Return the record of a NamedTuple class: of floats, counts, truths or such records."""

        def refuse(what: str) -> NoReturn:
            remedy = "Make it a float, a Count, a bool, or a NamedTuple of such"
            if source is not None:
                source.refuse(at, what, remedy)
            raise InputError(what, field=kind.__qualname__, remedy=remedy)

        for known in self.records.values():
            if known.kind is kind:
                return known
        fields: list[tuple[str, tree.Type]] = []
        for field, written in field_types(kind).items():
            if written is float:
                fields.append((field, tree.FLOAT))
            elif written is bool:
                fields.append((field, tree.BOOL))
            elif written == Count:
                fields.append((field, tree.COUNT))
            elif is_record(written):
                fields.append((field, self.record(written, source, at)))
            else:
                refuse(f"the field {field!r} of {kind.__name__} is no float")
        name = name or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__.strip("_")).lower()
        while name in self.records:
            name += "_"
        return self.records.setdefault(name, tree.Record(name, tuple(fields), kind))

    def result(self, types: tuple[tree.Type, ...]) -> tree.Record:
        """Return the record of what a function returns several of; the same for the same types."""
        fields = tuple((f"item{n}", kind) for n, kind in enumerate(types))
        unnamed = [record for record in self.records.values() if record.kind is None]
        for record in unnamed:
            if record.fields == fields:
                return record
        made = tree.Record(f"result{len(unnamed) + 1}", fields)
        return self.records.setdefault(made.name, made)

    def constant(self, name: str, value: float) -> tree.Constant:
        """Return a module's constant; one of the same name and another value gets another name."""
        name = name.strip("_")
        while name in self.constants and not _same(self.constants[name].value, value):
            name += "_"
        return self.constants.setdefault(name, tree.Constant(name, value))

    def call(
        self, source: Source, node: ast.Call, function: Any, types: tuple[tree.Type, ...]
    ) -> tree.Function:
        """Return a function that another one calls."""
        if function in self._reading:
            source.refuse(node, "a law's functions do not call themselves", "Write it as a loop")
        found = self.function(function, types)
        self.called.add(found.name)
        return found

    def function(self, function: Callable[..., Any], types: tuple[tree.Type, ...]) -> tree.Function:
        """Return a function read with arguments of these types."""
        plain = getattr(function, "py_func", function)
        if (plain, types) in self.functions:
            return self.functions[plain, types]
        if not isinstance(plain, FunctionType):
            raise InputError(
                "not a plain function", field="law", value=function,
                remedy="Write the law's functions with def, at the top of a module",
            )  # fmt: skip
        source = Source(plain)
        name = plain.__name__.strip("_")
        while name in self._names:
            name += "_"
        self._names.add(name)
        self._reading.append(plain)
        read = Body(self, source, name, types).read()
        self._reading.pop()
        self.functions[plain, types] = read
        return read


def _same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))
