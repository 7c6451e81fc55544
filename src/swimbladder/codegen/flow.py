"""What the statements of a function assign, hold and end with."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from swimbladder.codegen.tree import For, If, Return, Statement


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
