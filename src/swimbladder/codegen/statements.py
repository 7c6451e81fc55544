"""The statements of a law's function, read into the tree."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Protocol

from swimbladder.codegen.c_flow import always_returns, inside, is_docstring, stores
from swimbladder.codegen.calls import is_count
from swimbladder.codegen.expressions import Expressions
from swimbladder.codegen.tree import (
    COUNT,
    FLOAT,
    INT,
    Assign,
    Binary,
    Expression,
    Field,
    For,
    Function,
    If,
    Make,
    Name,
    Record,
    Return,
    Statement,
    Type,
    place_of,
)

if TYPE_CHECKING:
    from typing import Any

    from swimbladder.codegen.subset import Source
    from swimbladder.codegen.tree import Constant

_OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"
}  # fmt: skip
_MOST_TURNS = 32767  # an int of 16 bits counts them


class Reader(Protocol):
    """What the reader of a whole law does for that of one function."""

    def record(self, kind: type[Any], source: Source | None = None, at: Any = None) -> Record:
        """Return the record of a NamedTuple class."""

    def result(self, types: tuple[Type, ...]) -> Record:
        """Return the record of what a function returns several of."""

    def constant(self, name: str, value: float) -> Constant:
        """Return a module's constant."""

    def call(
        self, source: Source, node: ast.Call, function: Any, types: tuple[Type, ...]
    ) -> Function:
        """Return a function that another one calls."""


class Body:
    """One function being read: its variables, and which of them have a value for certain."""

    def __init__(self, reader: Reader, source: Source, name: str, types: tuple[Type, ...]) -> None:
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
        self.variables: dict[str, Type] = {}
        self.meaning: dict[str, Expression] = {n: Name(n, t) for n, t in self.parameters}
        self.returns: Type | None = None
        if is_count(source.function, source.function.__annotations__.get("return")):
            self.returns = COUNT
        self._stored = stores(definition)
        self._loaded = {
            n.id for n in ast.walk(definition)
            if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)
        }  # fmt: skip
        self._temporaries = 0

    def read(self) -> Function:
        """Return the function."""
        definition = self.source.tree
        body: list[Statement] = []
        for name, kind in self.parameters:
            if name in self._stored and isinstance(kind, Record):  # a variable begins as it
                inner = f"{name}_given"
                self.parameters = tuple((inner if n == name else n, t) for n, t in self.parameters)
                body.append(Assign(name, Name(inner, kind)))
                self.variables[name] = kind
        body += self._block(definition.body)
        if not always_returns(body):
            self.source.refuse(None, "the function may end without a return", "Return everywhere")
        assert self.returns is not None
        words = (ast.get_docstring(definition) or "").split("\n\n")[0]
        return Function(
            name=self.name, parameters=self.parameters, variables=tuple(self.variables.items()),
            body=tuple(body), returns=self.returns, words=" ".join(words.split()),
        )  # fmt: skip

    def _block(self, statements: list[ast.stmt]) -> list[Statement]:
        done: list[Statement] = []
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

    def _statement(self, node: ast.stmt) -> list[Statement]:
        evaluate = Expressions(self)
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target = node.targets[0]
            if isinstance(target, ast.Tuple):
                return self._unpack(node, target, node.value)
            name = self._target(target)
            wanted = self.variables.get(name) or dict(self.parameters).get(name)
            return self._assign(node, name, evaluate.of_type(node.value, wanted))
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            kind = COUNT if is_count(self.source.function, ast.unparse(node.annotation)) else None
            value = evaluate.of_type(node.value, kind)
            return self._assign(node, self._target(node.target), value)
        if isinstance(node, ast.AugAssign) and type(node.op) in _OPERATORS:
            name = self._target(node.target)
            before = evaluate.number(ast.copy_location(ast.Name(name, ast.Load()), node.target))
            operator: Any = _OPERATORS[type(node.op)]
            changed = Binary(operator, before, evaluate.number(node.value))
            return self._assign(node, name, changed)
        if isinstance(node, ast.If):
            return self._if(node)
        if isinstance(node, ast.For):
            return self._for(node)
        if isinstance(node, ast.Return) and node.value is not None:
            return [Return(self._returned(node, node.value))]
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

    def _assign(self, node: ast.AST, name: str, value: Expression) -> list[Statement]:
        if isinstance(value, Name) and isinstance(value.type, Record):
            once = self._stored.get(name) == 1 and self._stored.get(value.name, 0) <= 1
            if once and name not in self.variables and value.name not in self._loops():
                self.meaning[name] = value  # another name for the same record
                return []
        root, inner = place_of(value)
        if inner and isinstance(value.type, Record) and isinstance(root, Name):
            fixed = root.name in dict(self.parameters) and root.name not in self._stored
            if fixed and self._stored.get(name) == 1:
                self.meaning[name] = value  # another name for a part of what was given
                return []
        if name not in self._loaded:
            return []  # nothing reads it, and no value has an effect of its own
        kind: Type = FLOAT if value.type == INT else value.type
        known = dict(self.parameters).get(name) or self.variables.setdefault(name, kind)
        if known != kind:
            self.source.refuse(
                node, f"{name!r} changes its type", "Give the other value a name of its own"
            )
        self.meaning[name] = Name(name, kind)
        return [Assign(name, value)]

    def _loops(self) -> set[str]:
        """Names that loops assign: what they mean changes from turn to turn."""
        found: set[str] = set()
        for node in ast.walk(self.source.tree):
            if isinstance(node, ast.For):
                found |= set(stores(node))
        return found

    def _temporary(self, value: Expression) -> tuple[list[Statement], Name]:
        self._temporaries += 1
        name = f"value{self._temporaries}"
        while name in self._stored or name in dict(self.parameters):
            name += "_"
        self.variables[name] = value.type
        return [Assign(name, value)], Name(name, value.type)

    def _unpack(self, node: ast.stmt, target: ast.Tuple, value: ast.expr) -> list[Statement]:
        names = [self._target(element) for element in target.elts]
        evaluate = Expressions(self)
        if isinstance(value, ast.Tuple):
            values = [evaluate.read(element) for element in value.elts]
            before: list[Statement] = []
            later = {n.id for e in value.elts[1:] for n in ast.walk(e) if isinstance(n, ast.Name)}
            if later & set(names[:-1]):  # an old value is asked for after its name has a new one
                for n, one in enumerate(values):
                    if not (isinstance(one, Name) and isinstance(one.type, Record)):
                        kept, values[n] = self._temporary(one)
                        before += kept
        else:
            whole = evaluate.read(value)
            if not isinstance(whole.type, Record):
                self.source.refuse(value, "this is one value, not several", "Assign it to one name")
            before, at = ([], whole) if isinstance(whole, Name) else self._temporary(whole)
            values = [Field(at, name, kind) for name, kind in whole.type.fields]
        if len(names) != len(values):
            self.source.refuse(
                node, f"{len(names)} names for {len(values)} values", "Give each value a name"
            )
        return before + [
            s for n, v in zip(names, values, strict=True) for s in self._assign(node, n, v)
        ]

    def _if(self, node: ast.If) -> list[Statement]:
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
        return [If(condition, tuple(yes), tuple(no))]

    def _for(self, node: ast.For) -> list[Statement]:
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
        self.meaning[counter] = Name(counter, INT)
        body = self._block(node.body)
        if any(isinstance(s, Return) for s in inside(body)):
            source.refuse(node, "a law does not return out of a loop", "Return after it")
        self.meaning.pop(counter)
        if before is not None:
            self.meaning[counter] = before
        return [For(counter, count, tuple(body))]

    def _returned(self, node: ast.Return, value: ast.expr) -> Expression:
        evaluate = Expressions(self)
        got: Expression
        if isinstance(value, ast.Tuple):
            values = tuple(evaluate.read(element) for element in value.elts)
            kinds = tuple(FLOAT if v.type == INT else v.type for v in values)
            got = Make(self.reader.result(kinds), values)
        else:
            got = evaluate.of_type(value, self.returns)
        kind: Type = FLOAT if got.type == INT else got.type
        if self.returns is None:
            self.returns = kind
        if self.returns != kind:
            self.source.refuse(
                node, "the function returns values of different types", "Return one type everywhere"
            )
        return got
