"""Discouraged words: `scripts/words.toml` lists them, `scripts/budget.py` holds them to a budget.

`[[phrase]]` and `[[identifier]]` have a name, a regular expression and what to say instead (terms
are those of docs/reference/glossary.md). A phrase is looked for in what people read: docs/ and
README.md (inline code left out), the Unreleased part of CHANGELOG.md, the strings, docstrings and
comments of src/, and its templates. An identifier is looked for in the names of the Python of src/
and in its strings of one word, `camelCase` read as `camel_case`. `[renamed]` has whole identifiers
and modules, old = "new".
"""

import ast
import io
import re
import tokenize
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

LIST = "scripts/words.toml"


class Kind(NamedTuple):
    """A kind of discouraged word: where it is looked for, what finds it, what to say."""

    table: str
    name: str
    pattern: re.Pattern[str]
    say: str


class Text(NamedTuple):
    """A piece of text, and where it begins."""

    path: str
    line: int
    text: str


def kinds(path: Path) -> list[Kind]:
    """Return the kinds of a list; raise ValueError where a table is not as it should be."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    found = [
        Kind("identifier", old, re.compile(rf"(?:^|\.){re.escape(_snake(old))}(?:$|\.)"), new)
        for old, new in tables.pop("renamed", {}).items()
    ]
    for table, entries in tables.items():
        if table not in ("phrase", "identifier"):
            raise ValueError(f"{path}: no such table: {table}. There are phrase and identifier")
        for entry in entries:
            if set(entry) != {"name", "pattern", "say"}:
                raise ValueError(f"{path}: {entry}: give name, pattern and say, nothing else")
            pattern = entry["pattern"]
            if table == "identifier":
                pattern = rf"(?<![a-z0-9])(?:{pattern})(?![a-z0-9])"
            name, say = entry["name"], entry["say"]
            found.append(Kind(table, name, re.compile(pattern, re.IGNORECASE), say))
    names = [kind.name for kind in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"{path}: twice: {', '.join(sorted(twice))}. Give each kind its own name")
    return found


def _texts(root: Path) -> Iterator[tuple[str, Text]]:
    """Return every piece of text in which words are counted, with the table it belongs to."""
    for path in (root / "README.md", *sorted((root / "docs").rglob("*.md"))):
        if path.exists():
            yield "phrase", Text(_name(path, root), 1, _without_code(_read(path)))
    changes = root / "CHANGELOG.md"
    if changes.exists():
        yield "phrase", Text("CHANGELOG.md", *_unreleased(_read(changes)))
    for path in sorted((root / "src").rglob("*")):
        name = _name(path, root)
        if path.suffix == ".py":
            yield from _of_python(name, _read(path))
        elif path.suffix in (".j2", ".toml"):
            yield "phrase", Text(name, 1, _read(path))


def _name(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix()


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _without_code(text: str) -> str:
    """Return a page without its inline code, lines kept: it may name keys and options."""
    return re.sub(r"(?<!`)`[^`\n]+`(?!`)", "``", text)


def _unreleased(text: str) -> tuple[int, str]:
    """Return the first line and the text of what a changelog has not released yet."""
    begin = re.search(r"(?m)^## \[Unreleased\]", text)
    if begin is None:
        return 1, ""
    end = re.compile(r"(?m)^## ").search(text, begin.end())
    part = text[begin.start() : end.start() if end else len(text)]
    return text[: begin.start()].count("\n") + 1, _without_code(part)


def _of_python(path: str, source: str) -> Iterator[tuple[str, Text]]:
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield "phrase", Text(path, token.start[0], token.string)
    yield from _of_node(path, ast.parse(source), 1)


def _of_node(path: str, node: ast.AST, line: int) -> Iterator[tuple[str, Text]]:
    """Return strings and names of a node of the syntax tree: the same for every Python."""
    line = getattr(node, "lineno", line)
    if isinstance(node, ast.Constant):
        if isinstance(node.value, str):
            yield _of_string(path, line, node.value)
        return
    if isinstance(node, ast.JoinedStr):
        parts = (p.value if isinstance(p, ast.Constant) else "{}" for p in node.values)
        yield _of_string(path, line, "".join(map(str, parts)))
    for _, value in ast.iter_fields(node):
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, str):
                yield "identifier", Text(path, line, _snake(item))
            elif isinstance(item, ast.AST) and not (
                isinstance(node, ast.JoinedStr) and isinstance(item, ast.Constant)
            ):
                yield from _of_node(path, item, line)


def _of_string(path: str, line: int, text: str) -> tuple[str, Text]:
    """Return a string as prose, or, if it is of one word, as an identifier: a key or an option."""
    if re.search(r"\s", text.strip()):
        return "phrase", Text(path, line, text)
    return "identifier", Text(path, line, _snake(text))


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def places(root: Path) -> dict[Kind, list[str]]:
    """Return the places of each kind of a project's list."""
    where: dict[Kind, list[str]] = {kind: [] for kind in kinds(root / LIST)}
    by_table: dict[str, list[Kind]] = defaultdict(list)
    for kind in where:
        by_table[kind.table].append(kind)

    @cache  # most identifiers stand in hundreds of places
    def found(table: str, text: str) -> list[tuple[Kind, int, str]]:
        return [
            (kind, text.count("\n", 0, match.start()), " ".join(match[0].split()))
            for kind in by_table[table]
            for match in kind.pattern.finditer(text)
        ]

    for table, (path, first, text) in _texts(root):
        for kind, below, match in found(table, text):
            where[kind].append(f"{path}:{first + below}: {match}")
    return where
