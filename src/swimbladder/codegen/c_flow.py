"""What flows where in a function: which variables and fields are read, and where they live.

That follows from what its statements assign, hold and end with.
"""

from __future__ import annotations

import ast
import dataclasses
from collections import Counter
from collections.abc import Iterator, Sequence

from swimbladder.codegen.tree import (
    Assign,
    Call,
    Field,
    For,
    Function,
    If,
    Name,
    Program,
    Return,
    Statement,
)


def is_docstring(node: ast.stmt) -> bool:
    """Say whether a statement is a text by itself."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def stores(tree: ast.AST) -> dict[str, int]:
    """Return how often each name is assigned to."""
    found: dict[str, int] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found[node.id] = found.get(node.id, 0) + 1
    return found


def inside(statements: Sequence[Statement]) -> list[Statement]:
    """Return the statements and those that they hold, however deep."""
    found: list[Statement] = []
    for s in statements:
        found.append(s)
        if isinstance(s, If):
            found += inside(s.yes) + inside(s.no)
        elif isinstance(s, For):
            found += inside(s.body)
    return found


def always_returns(statements: Sequence[Statement]) -> bool:
    """Say whether every way through the statements ends in a return."""
    last = statements[-1] if statements else None
    if isinstance(last, If):
        return always_returns(last.yes) and always_returns(last.no)
    return isinstance(last, Return)


def parts(node: object) -> Iterator[object]:
    """Yield a statement or expression and all that is in it, but no function that it calls."""
    if isinstance(node, tuple):
        for part in node:
            yield from parts(part)
    elif dataclasses.is_dataclass(node) and not isinstance(node, Function):
        yield node
        for f in dataclasses.fields(node):
            if f.name != "type":
                yield from parts(getattr(node, f.name))


def names_read(node: object) -> set[str]:
    """Return the variables that statements or expressions read."""
    return {part.name for part in parts(node) if isinstance(part, Name)}


def calls_of(program: Program) -> Counter[Function]:
    """Return at how many places each function of a law is called."""
    functions = {*program.helpers, program.step, program.initial}
    found = [part for f in functions for part in parts(alive(f.body)) if isinstance(part, Call)]
    return Counter(call.function for call in found)


def assigned(node: object) -> dict[str, int]:
    """Return how often each variable is assigned."""
    found: dict[str, int] = {}
    for part in parts(node):
        if isinstance(part, Assign):
            found[part.name] = found.get(part.name, 0) + 1
    return found


def mentioned(node: object) -> set[str]:
    """Return the variables that are read or assigned."""
    return names_read(node) | set(assigned(node))


def inner_home(statement: Statement, name: str) -> tuple[Statement, ...] | None:
    """Return the one branch or loop of a statement that mentions a variable; None: not just one."""
    if isinstance(statement, For):
        return statement.body
    if not isinstance(statement, If) or name in names_read(statement.condition):
        return None
    branches = [b for b in (statement.yes, statement.no) if name in mentioned(b)]
    return branches[0] if len(branches) == 1 else None


def alive(body: tuple[Statement, ...]) -> tuple[Statement, ...]:
    """Return the statements without variables that nothing reads: they have no other effect."""
    while True:
        kept = _without(body, names_read(body))
        if kept == body:
            return body
        body = kept


def _without(body: tuple[Statement, ...], read: set[str]) -> tuple[Statement, ...]:
    kept: list[Statement] = []
    for s in body:
        one: Statement = s
        if isinstance(s, Assign) and s.name not in read:
            continue
        if isinstance(s, If):
            one = If(s.condition, _without(s.yes, read), _without(s.no, read))
            if not one.yes and not one.no:
                continue
        elif isinstance(s, For):
            one = For(s.counter, s.count, _without(s.body, read))
            if not one.body:
                continue
        kept.append(one)
    return tuple(kept)


def fields_read(program: Program) -> dict[str, set[str]]:
    """Return the fields of each record that are needed: all of the law's own, else those read."""
    read: dict[str, set[str]] = {record.name: set() for record in program.records}
    for function in (*program.helpers, program.step, program.initial):
        for part in parts(alive(function.body)):
            if isinstance(part, Field):
                read[part.of.type.name].add(part.name)
    own = {record.name for record in program.own()}
    for record in program.records:
        if record.name in own or record.kind is None or not read[record.name]:
            read[record.name] = {name for name, _ in record.fields}
    return read
