"""A law's Python functions read into the small typed tree of `tree`.

What a law may be made of is written here, and only here; anything else is an InputError with its
file, its line and what to write instead. Types are inferred from the calls, beginning with those
of `step` and `initial`, so annotations are not needed.

`Source` is the text of a function and the names it can see, `Expressions` reads its expressions at
one place, `Body` its statements.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import re
import textwrap
from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from types import FunctionType, ModuleType
from typing import Any, NoReturn, TypeGuard

import numpy as np

from swimbladder.codegen import tree
from swimbladder.control.law import (
    NEVER,
    Count,
    Law,
    Measurement,
    field_types,
    is_record,
    leaf_names,
    less,
    more,
)
from swimbladder.errors import InputError

_BUILTINS: dict[Any, tuple[tree.Known, int, tree.Type]] = {
    min: ("min", 2, tree.FLOAT),
    max: ("max", 2, tree.FLOAT),
    abs: ("abs", 1, tree.FLOAT),
    math.fabs: ("abs", 1, tree.FLOAT),
    math.sqrt: ("sqrt", 1, tree.FLOAT),
    math.isfinite: ("isfinite", 1, tree.BOOL),
    math.copysign: ("copysign", 2, tree.FLOAT),
    more: ("more", 2, tree.COUNT),
    less: ("less", 2, tree.COUNT),
    float: ("float", 1, tree.FLOAT),
}
_OPERATORS: dict[type[ast.AST], tree.Operator] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.BitAnd: "&",
    ast.BitOr: "|",
}
_COMPARISONS: dict[type[ast.AST], tree.Comparison] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_INSTEAD: dict[type[ast.AST], str] = {
    ast.Pow: "Multiply, or use math.sqrt",
    ast.Mod: "Count with a loop, or keep what is left in the state",
    ast.FloorDiv: "Divide with /, and compare",
}
_MOST_TURNS = 32767  # an int of 16 bits counts them


def stores(of: ast.AST) -> Counter[str]:
    """Return how often each name is assigned to."""
    return _named(of, ast.Store)


def _named(of: ast.AST, use: type[ast.expr_context]) -> Counter[str]:
    names = (node for node in ast.walk(of) if isinstance(node, ast.Name))
    return Counter(name.id for name in names if isinstance(name.ctx, use))


def is_count(function: Callable[..., Any], written: Any) -> bool:
    """Return whether an annotation of a function, or in it, means a count."""
    if isinstance(written, str):
        written = getattr(function, "__globals__", {}).get(written, written)
    return bool(written == Count)


def _plain(value: tree.Expression) -> tree.Type:
    """Return the type of a value, that of a number for the counter of a loop."""
    return tree.FLOAT if value.type == tree.INT else value.type


def _is_whole(value: Any) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool)


class Source:
    """The text of a function, to point at its lines, and the names it can see."""

    def __init__(self, function: Callable[..., Any]) -> None:
        function = getattr(function, "py_func", function)  # what numba made of it
        self.function, self._name = function, getattr(function, "__name__", function)
        try:
            lines, first = inspect.getsourcelines(function)
            self.file = inspect.getsourcefile(function) or "?"
            definition = ast.parse(textwrap.dedent("".join(lines))).body[0]
            if not isinstance(definition, ast.FunctionDef):
                raise TypeError("not a plain function")
        except (OSError, TypeError, SyntaxError) as error:
            what, named = "the source of a law's function cannot be read", self._name
            remedy = "Write it as a plain function in a file"
            raise InputError(what, field="law", value=named, remedy=remedy) from error
        self.tree = definition
        self.before = first - 1
        names = vars(builtins) | function.__globals__
        cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        self.names: Mapping[str, Any] = names | {name: cell.cell_contents for name, cell in cells}

    def refuse(self, node: ast.AST | None, what: str, remedy: str) -> NoReturn:
        """Raise InputError about a node, or about the function as a whole."""
        raise InputError(
            what,
            file=self.file,
            line=self.before + getattr(node or self.tree, "lineno", 1),
            field=f"{self._name}()",
            value=None if node is None or isinstance(node, ast.stmt) else ast.unparse(node),
            remedy=remedy,
        )


class Expressions(Source, ast.NodeVisitor):
    """Expressions at one place of a function, where its names mean what they mean there."""

    def __init__(self, reader: _Reader, function: FunctionType) -> None:
        super().__init__(function)
        self.reader = reader
        self.meaning: dict[str, tree.Expression] = {}
        self.stored = stores(self.tree)

    def read(self, node: ast.expr) -> tree.Expression:
        """Return an expression of any type."""
        got: tree.Expression = self.visit(node)
        return got

    def number(self, node: ast.expr) -> tree.Expression:
        """Return an expression that is a number."""
        got = self.read(node)
        if got.type == tree.COUNT:
            remedy = "Write float(n) for its number, more(n, by) or less(n, by)"
            self.refuse(node, "this is a count", remedy)
        if got.type not in (tree.FLOAT, tree.INT):
            self.refuse(node, "this is no number", "A law calculates with floats and counts")
        return got

    def count(self, node: ast.expr) -> tree.Expression:
        """Return an expression that is a count, which a whole literal can be."""
        if isinstance(node, ast.IfExp):
            yes, no = self.count(node.body), self.count(node.orelse)
            return tree.Choice(self.truth(node.test), yes, no, tree.COUNT)
        value = self.outside(node)
        if _is_whole(value):
            if not 0 <= value <= NEVER:
                self.refuse(node, f"not 0 to {NEVER}", "A count stays within 16 bits")
            return tree.Number(float(value), tree.COUNT)
        got = self.read(node)
        if got.type == tree.INT:
            return tree.Builtin("count", (got,), tree.COUNT)
        if got.type != tree.COUNT:
            self.refuse(node, "this is no count", "A count is a whole number, 0 to 65535")
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
            self.refuse(node, "this is not true or false", "Write a comparison, as x != 0.0")
        return got

    def outside(self, node: ast.expr) -> Any:
        """Return what a literal, a name, or a name in a module means outside the function.

        None where it means nothing there.
        """
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name) and node.id not in (*self.meaning, *self.stored):
            return self.names.get(node.id)
        if isinstance(node, ast.Attribute):
            module = self.outside(node.value)
            return getattr(module, node.attr, None) if isinstance(module, ModuleType) else None
        return None

    def float32(self, node: ast.expr, value: float) -> float:
        """Return a value that float32 can hold, nearly; refuse any other."""
        with np.errstate(over="ignore", under="ignore"):
            rounded = float(np.float32(value))
        if (math.isinf(rounded) and not math.isinf(value)) or (rounded == 0.0 and value != 0.0):
            remedy = "Stay within 1e-45 to 3.4e38, or use math.inf"
            self.refuse(node, f"{value:g} is beyond float32", remedy)
        return value

    def generic_visit(self, node: ast.AST) -> NoReturn:
        """Refuse what a law is not made of."""
        what = type(node).__name__.lower()
        if isinstance(node, ast.stmt):
            remedy = "Use assignments, if, for over a constant range, and return"
            self.refuse(node, f"a law has no {what!r} statement", remedy)
        has = "arithmetic, comparisons, min, max, abs, math.sqrt and calls of plain functions"
        self.refuse(node, f"a law has no expression of the kind {what!r}", f"Use {has}")

    def visit_Constant(self, node: ast.Constant) -> tree.Expression:
        """Return a literal."""
        if isinstance(node.value, bool):
            return tree.Number(float(node.value), tree.BOOL)
        if not isinstance(node.value, int | float):
            self.refuse(node, "a law's literals are numbers", "Write a number")
        return tree.Number(self.float32(node, float(node.value)))

    def visit_Name(self, node: ast.Name) -> tree.Expression:
        """Return what a name means."""
        if node.id in self.meaning:
            return self.meaning[node.id]
        found = self._constant(node, node.id)
        if found is None:
            remedy = "Assign it in every branch that leads here"
            self.refuse(node, "this name has no value here, or not for certain", remedy)
        return found

    def visit_Attribute(self, node: ast.Attribute) -> tree.Expression:
        """Return a constant of a module, or a field."""
        found = self._constant(node, node.attr)
        if found is not None:
            return found
        of = self.read(node.value)
        kind = dict(of.type.fields).get(node.attr) if isinstance(of.type, tree.Record) else None
        if kind is None:
            self.refuse(node, "there is no such field", "Name a field of the NamedTuple")
        return tree.Field(of, node.attr, kind)

    def _constant(self, node: ast.expr, name: str) -> tree.Expression | None:
        value = self.outside(node)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
            remedy = "Name floats of the module, or its functions"
            self.refuse(node, "this is no constant number", remedy)
        return self.reader.constant(name, self.float32(node, float(value)))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> tree.Expression:
        """Return a truth or a number turned round."""
        if isinstance(node.op, ast.Not):
            return tree.Not(self.truth(node.operand))
        if isinstance(node.op, ast.Invert):
            self.refuse(node, "a law does not turn bits round", "Use & and | of counts")
        number = self.number(node.operand)
        return tree.Minus(number) if isinstance(node.op, ast.USub) else number

    def visit_BinOp(self, node: ast.BinOp) -> tree.Expression:
        """Return two numbers, or the bits of two counts, as one."""
        operator = _OPERATORS.get(type(node.op))
        if operator is None:
            what = "this operation is not the same to the bit on every processor"
            self.refuse(node, what, _INSTEAD.get(type(node.op), "Use + - * /"))
        bits = operator in ("&", "|")
        take, kind = (self.count, tree.COUNT) if bits else (self.number, tree.FLOAT)
        return tree.Binary(operator, take(node.left), take(node.right), kind)

    def visit_Compare(self, node: ast.Compare) -> tree.Expression:
        """Return one or several comparisons of numbers."""
        operands = [node.left, *node.comparators]
        pairs: list[tree.Expression] = []
        for left, kind, right in zip(operands[:-1], node.ops, operands[1:], strict=True):
            operator = _COMPARISONS.get(type(kind))
            if operator is None:
                self.refuse(node, "a law compares numbers only", "Use < <= > >= == !=")
            take = self.count if self.counts([left, right]) else self.number
            pairs.append(tree.Compare(operator, take(left), take(right)))
        return pairs[0] if len(pairs) == 1 else tree.Logic("and", tuple(pairs))

    def visit_BoolOp(self, node: ast.BoolOp) -> tree.Expression:
        """Return truths joined."""
        operator: tree.Junction = "and" if isinstance(node.op, ast.And) else "or"
        return tree.Logic(operator, tuple(map(self.truth, node.values)))

    def visit_IfExp(self, node: ast.IfExp) -> tree.Expression:
        """Return one of two values."""
        if self.counts([node.body, node.orelse]):
            return self.count(node)
        condition = self.truth(node.test)
        yes, no = self.read(node.body), self.read(node.orelse)
        if _plain(yes) != _plain(no):
            self.refuse(node, "the two values differ in type", "Make them the same")
        return tree.Choice(condition, yes, no, _plain(yes))

    def visit_Call(self, node: ast.Call) -> tree.Expression:
        """Return a call of any kind."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "_replace":
            return self._replaced(node, node.func.value)
        function = self.outside(node.func)
        if function is None:
            remedy = "Call a plain function, or `_replace` of a NamedTuple"
            self.refuse(node, "a law calls no methods and no variables", remedy)
        if any(isinstance(a, ast.Starred) for a in node.args) or not all(
            keyword.arg for keyword in node.keywords
        ):
            self.refuse(node, "a law has no * and ** in calls", "Write each argument")
        if is_record(function):
            return self._made(node, function)
        if isinstance(function, Hashable) and function in _BUILTINS:
            return self._builtin(node, function)
        plain = getattr(function, "py_func", function)
        if not isinstance(plain, FunctionType):
            what = "this function is not the same to the bit on every processor"
            has = "min, max, abs, math.sqrt, math.isfinite and math.copysign"
            self.refuse(node, what, f"Compute it where the parameters are made; a law has {has}")
        names = plain.__code__.co_varnames[: plain.__code__.co_argcount]
        written = {n: tree.COUNT for n in names if is_count(plain, plain.__annotations__.get(n))}
        values = tuple(self._arguments(node, names, written, {}).values())
        if plain in self.reader.reading:
            self.refuse(node, "a law's functions do not call themselves", "Write it as a loop")
        called = self.reader.function(plain, tuple(map(_plain, values)))
        self.reader.called.add(called.name)
        return tree.Call(called, values, called.returns)

    def _builtin(self, node: ast.Call, function: Any) -> tree.Expression:
        """Return a call of what C and the twin have as well."""
        name, count, kind = _BUILTINS[function]
        if len(node.args) != count or node.keywords:
            self.refuse(node, f"{name} takes {count} numbers here", "Nest the calls")
        if function in (min, max) and self.counts(node.args):
            kind = tree.COUNT
        take = self.count if kind == tree.COUNT or function is float else self.number
        return tree.Builtin(name, tuple(map(take, node.args)), kind)

    def _made(self, node: ast.Call, kind: type[Any]) -> tree.Expression:
        """Return a new record; what is not given of it has the value of the class."""
        record = self.reader.record(kind, self, node)
        kinds = dict(record.fields)
        defaults: dict[str, tree.Expression] = {
            name: tree.Number(self.float32(node, float(value)), kinds[name])
            for name, value in getattr(kind, "_field_defaults", {}).items()
            if isinstance(value, int | float)
        }
        return self._filled(node, record, self._arguments(node, tuple(kinds), kinds, defaults))

    def _replaced(self, node: ast.Call, of_node: ast.expr) -> tree.Expression:
        """Return a copy of a named tuple with some of its fields changed."""
        of = self.read(of_node)
        if not (isinstance(tree.place_of(of)[0], tree.Name) and isinstance(of.type, tree.Record)):
            self.refuse(node, "this is no name of a NamedTuple", "Give it a name first")
        kinds = dict(of.type.fields)
        if node.args or not all(keyword.arg in kinds for keyword in node.keywords):
            self.refuse(node, "the arguments are not its fields", "Write field=value")
        same = {name: tree.Field(of, name, kind) for name, kind in kinds.items()}
        return self._filled(node, of.type, self._arguments(node, tuple(kinds), kinds, same))

    def _filled(
        self, node: ast.Call, record: tree.Record, values: Mapping[str, tree.Expression]
    ) -> tree.Expression:
        for name, wanted in record.fields:
            if _plain(values[name]) != wanted:
                self.refuse(node, f"the field {name!r} has another type", "Give it its own")
        return tree.Make(record, tuple(values.values()))

    def _arguments(
        self,
        node: ast.Call,
        names: tuple[str, ...],
        kinds: Mapping[str, tree.Type],
        defaults: Mapping[str, tree.Expression],
    ) -> dict[str, tree.Expression]:
        """Return the arguments by name, in the order of `names`."""
        given = dict(zip(names, node.args, strict=False))
        given |= {keyword.arg or "": keyword.value for keyword in node.keywords}
        read = {name: self.of_type(value, kinds.get(name)) for name, value in given.items()}
        values = {**defaults, **read}
        if set(values) != set(names) or len(node.args) + len(node.keywords) != len(given):
            what = f"the arguments are not those of ({', '.join(names)})"
            self.refuse(node, what, "Give each one once")
        return {name: values[name] for name in names}


class Body(Expressions):
    """One function being read: its variables, and which of them have a value for certain."""

    def __init__(
        self, reader: _Reader, function: FunctionType, name: str, types: tuple[tree.Type, ...]
    ) -> None:
        super().__init__(reader, function)
        self.name = name
        given = self.tree.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs or given.defaults:
            self.refuse(None, "a law's function has plain parameters only", "Name each of them")
        names = [a.arg for a in given.args]
        if len(names) != len(types):
            what = f"{len(names)} parameters, but {len(types)} arguments"
            self.refuse(None, what, "Give each parameter its argument")
        self.parameters = dict(zip(names, types, strict=True))
        self.variables: dict[str, tree.Type] = {}
        self.meaning |= {n: tree.Name(n, t) for n, t in self.parameters.items()}
        self.returns: tree.Type | None = None
        if is_count(function, function.__annotations__.get("return")):
            self.returns = tree.COUNT
        walked = list(ast.walk(self.tree))
        self._loaded = set(_named(self.tree, ast.Load))
        # What loops assign: it changes its meaning from turn to turn.
        self._loops = {name for n in walked if isinstance(n, ast.For) for name in stores(n)}
        self._temporaries = 0

    def whole(self) -> tree.Function:
        """Return the function."""
        body: list[tree.Statement] = []
        parameters: list[tuple[str, tree.Type]] = []
        for name, kind in self.parameters.items():
            if name in self.stored and isinstance(kind, tree.Record):  # a variable begins as it
                parameters.append((f"{name}_given", kind))
                body.append(tree.Assign(name, tree.Name(f"{name}_given", kind)))
                self.variables[name] = kind
            else:
                parameters.append((name, kind))
        self.parameters = dict(parameters)
        body += self._block(self.tree.body)
        if not tree.always_returns(body):
            self.refuse(None, "the function may end without a return", "Return everywhere")
        assert self.returns is not None
        words = (ast.get_docstring(self.tree) or "").split("\n\n")[0]
        return tree.Function(
            name=self.name,
            parameters=tuple(parameters),
            variables=tuple(self.variables.items()),
            body=tuple(body),
            returns=self.returns,
            words=" ".join(words.split()),
        )

    def _block(self, statements: list[ast.stmt]) -> list[tree.Statement]:
        done: list[tree.Statement] = []
        for n, statement in enumerate(statements):
            text = getattr(statement, "value", None) if isinstance(statement, ast.Expr) else None
            if n == 0 and isinstance(text, ast.Constant) and isinstance(text.value, str):
                continue
            if tree.always_returns(done):
                self.refuse(statement, "what comes after a return is never done", "Remove it")
            done += self.visit(statement)
        return done

    def visit_Assign(self, node: ast.Assign) -> list[tree.Statement]:
        """Return what a name, or several, get."""
        target, *others = node.targets
        if others:
            self.generic_visit(node)
        if isinstance(target, ast.Tuple):
            return self._unpack(node, target, node.value)
        name = self._target(target)
        wanted = self.variables.get(name) or self.parameters.get(name)
        return self._assign(node, name, self.of_type(node.value, wanted))

    def visit_AnnAssign(self, node: ast.AnnAssign) -> list[tree.Statement]:
        """Return what a name gets whose type is written beside it."""
        if node.value is None:
            self.generic_visit(node)
        counted = is_count(self.function, ast.unparse(node.annotation))
        value = self.of_type(node.value, tree.COUNT if counted else None)
        return self._assign(node, self._target(node.target), value)

    def visit_AugAssign(self, node: ast.AugAssign) -> list[tree.Statement]:
        """Return how a name changes."""
        if not isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div):
            self.generic_visit(node)
        name = self._target(node.target)
        before = ast.copy_location(ast.Name(name, ast.Load()), node.target)
        changed = ast.copy_location(ast.BinOp(before, node.op, node.value), node)
        return self._assign(node, name, self.read(changed))

    def _target(self, node: ast.expr) -> str:
        if not isinstance(node, ast.Name):
            remedy = "Make a new NamedTuple of the values"
            self.refuse(node, "a law assigns to plain names only", remedy)
        return node.id

    def _assign(self, node: ast.AST, name: str, value: tree.Expression) -> list[tree.Statement]:
        root, inner = tree.place_of(value)
        if isinstance(root, tree.Name) and isinstance(value.type, tree.Record):
            once = self.stored.get(name) == 1
            if inner:  # another name for a part of what was given?
                same = root.name in self.parameters and root.name not in self.stored
            else:  # another name for the same record?
                same = self.stored.get(root.name, 0) <= 1
                same = same and name not in self.variables and root.name not in self._loops
            if once and same:
                self.meaning[name] = value
                return []
        if name not in self._loaded:
            return []  # nothing reads it, and no value has an effect of its own
        kind = _plain(value)
        known = self.parameters.get(name) or self.variables.setdefault(name, kind)
        if known != kind:
            remedy = "Give the other value a name of its own"
            self.refuse(node, f"{name!r} changes its type", remedy)
        self.meaning[name] = tree.Name(name, kind)
        return [tree.Assign(name, value)]

    def _temporary(self, value: tree.Expression) -> tuple[list[tree.Statement], tree.Name]:
        self._temporaries += 1
        name = f"value{self._temporaries}"
        while name in self.stored or name in self.parameters:
            name += "_"
        self.variables[name] = value.type
        return [tree.Assign(name, value)], tree.Name(name, value.type)

    def _unpack(self, node: ast.stmt, target: ast.Tuple, value: ast.expr) -> list[tree.Statement]:
        names = [self._target(element) for element in target.elts]
        before: list[tree.Statement] = []
        if isinstance(value, ast.Tuple):
            values = [self.read(element) for element in value.elts]
            later = {n.id for e in value.elts[1:] for n in ast.walk(e) if isinstance(n, ast.Name)}
            if later & set(names[:-1]):  # an old value is asked for after its name has a new one
                for n, one in enumerate(values):
                    if not (isinstance(one, tree.Name) and isinstance(one.type, tree.Record)):
                        kept, values[n] = self._temporary(one)
                        before += kept
        else:
            whole = self.read(value)
            if not isinstance(whole.type, tree.Record):
                self.refuse(value, "this is one value, not several", "Assign it to one name")
            before, at = ([], whole) if isinstance(whole, tree.Name) else self._temporary(whole)
            values = [tree.Field(at, name, kind) for name, kind in whole.type.fields]
        if len(names) != len(values):
            what = f"{len(names)} names for {len(values)} values"
            self.refuse(node, what, "Give each value a name")
        return before + [
            s for n, v in zip(names, values, strict=True) for s in self._assign(node, n, v)
        ]

    def visit_If(self, node: ast.If) -> list[tree.Statement]:
        """Return a choice between two ways."""
        condition = self.truth(node.test)
        before = dict(self.meaning)
        yes = self._block(node.body)
        after_yes, self.meaning = self.meaning, before
        no = self._block(node.orelse)
        if tree.always_returns(no):
            self.meaning = after_yes
        elif not tree.always_returns(yes):  # a name means something only where it does after both
            self.meaning = {n: v for n, v in self.meaning.items() if after_yes.get(n) == v}
        return [tree.If(condition, tuple(yes), tuple(no))]

    def visit_For(self, node: ast.For) -> list[tree.Statement]:
        """Return a loop that counts to a constant."""
        match node:
            case ast.For(iter=ast.Call(func, [turns], []), orelse=[]):
                count = self.outside(turns) if self.outside(func) is range else None
            case _:
                count = None
        if not _is_whole(count):
            what = "a law's loop runs over a constant range"
            remedy = "Write `for i in range(N)` with a number, or a constant of the module, for N"
            self.refuse(node.iter, what, remedy)
        if not 1 <= count <= _MOST_TURNS:
            self.refuse(node.iter, f"not 1 to {_MOST_TURNS} turns", "Choose another count")
        counter = self._target(node.target)
        if counter in stores(ast.Module(node.body, [])) or counter in self.variables:
            self.refuse(node, f"{counter!r} is a variable too", "Give the counter its own name")
        before = self.meaning.get(counter)
        self.meaning[counter] = tree.Name(counter, tree.INT)
        body = tuple(self._block(node.body))
        if any(isinstance(s, tree.Return) for s in tree.parts(body)):
            self.refuse(node, "a law does not return out of a loop", "Return after it")
        self.meaning.pop(counter)
        if before is not None:
            self.meaning[counter] = before
        return [tree.For(counter, count, body)]

    def visit_Return(self, node: ast.Return) -> list[tree.Statement]:
        """Return the end of the function."""
        got: tree.Expression
        if node.value is None:
            self.generic_visit(node)
        if isinstance(node.value, ast.Tuple):
            values = tuple(map(self.read, node.value.elts))
            got = tree.Make(self.reader.result(tuple(map(_plain, values))), values)
        else:
            got = self.of_type(node.value, self.returns)
        self.returns = self.returns or _plain(got)
        if self.returns != _plain(got):
            what = "the function returns values of different types"
            self.refuse(node, what, "Return one type everywhere")
        return [tree.Return(got)]


def read_law(law: Law, seen: type[Any] = Measurement) -> tree.Program:
    """Return a law as a tree; seen: the NamedTuple that it sees at a sample.

    Raises InputError with file, line, construct and remedy where it is not in the subset.
    """
    reader = _Reader()
    if law.parameters is law.state:
        what = "the parameters and the state are the same class"
        remedy = "Give each a NamedTuple of its own"
        raise InputError(what, field=f"law {law.name!r}", remedy=remedy)
    parameters = reader.record(law.parameters, name="parameters")
    state = reader.record(law.state, name="state")
    measurement = reader.record(seen, name="measurement" if seen is Measurement else "seen")
    leaf_names(law.parameters)  # refuses two of the same name
    step = reader.function(law.step, (parameters, state, measurement, tree.FLOAT))
    initial = reader.function(law.initial, (parameters, measurement, tree.FLOAT))
    entries = (
        ("step", step, law.step, reader.result((tree.FLOAT, state, tree.FLOAT))),
        ("initial", initial, law.initial, state),
    )
    for what, function, source, returns in entries:
        if function.returns != returns:
            wanted = "(command, state, next_sample_s)" if what == "step" else "the state"
            said = f"{what} of the law {law.name!r} does not return {wanted}"
            remedy = f"Return {wanted}, the state as a {law.state.__name__}"
            Source(source).refuse(None, said, remedy)
    return tree.Program(
        name=law.name,
        parameters=parameters,
        state=state,
        measurement=measurement,
        records=tuple(reader.records.values()),
        constants=tuple(reader.constants.values()),
        helpers=tuple(f for f in reader.functions.values() if f.name in reader.called),
        step=step,
        initial=initial,
        words=law.summary,
    )


class _Reader:
    """Functions, records and constants found so far."""

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, tuple[tree.Type, ...]], tree.Function] = {}
        self.records: dict[str, tree.Record] = {}
        self.constants: dict[str, tree.Constant] = {}
        self.called: set[str] = set()
        self.reading: list[Any] = []
        self._names: set[str] = set()

    def record(
        self, kind: type[Any], source: Source | None = None, at: Any = None, name: str = ""
    ) -> tree.Record:
        """Return the record of a NamedTuple class: of floats, counts, truths or such records."""
        for known in self.records.values():
            if known.kind is kind:
                return known
        fields: list[tuple[str, tree.Type]] = []
        for field, written in field_types(kind).items():
            if is_record(written):
                fields.append((field, self.record(written, source, at)))
            elif written in _SCALARS:
                fields.append((field, _SCALARS[written]))
            else:
                what = f"the field {field!r} of {kind.__name__} is no float"
                remedy = "Make it a float, a Count, a bool, or a NamedTuple of such"
                if source is not None:
                    source.refuse(at, what, remedy)
                raise InputError(what, field=kind.__qualname__, remedy=remedy)
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
        while name in self.constants and str(self.constants[name].value) != str(value):
            name += "_"
        return self.constants.setdefault(name, tree.Constant(name, value))

    def function(self, function: Callable[..., Any], types: tuple[tree.Type, ...]) -> tree.Function:
        """Return a function read with arguments of these types."""
        plain = getattr(function, "py_func", function)
        if (plain, types) in self.functions:
            return self.functions[plain, types]
        if not isinstance(plain, FunctionType):
            remedy = "Write the law's functions with def, at the top of a module"
            raise InputError("not a plain function", field="law", value=function, remedy=remedy)
        name = plain.__name__.strip("_")
        while name in self._names:
            name += "_"
        self._names.add(name)
        self.reading.append(plain)
        read = self.functions[plain, types] = Body(self, plain, name, types).whole()
        self.reading.pop()
        return read


_SCALARS: dict[Any, tree.Scalar] = {float: tree.FLOAT, bool: tree.BOOL, Count: tree.COUNT}
