"""Count discouraged words: ``python scripts/check_words.py [--where KIND] [--lower]``.

`scripts/words.toml` has one table for each kind: a regular expression, what to say instead (terms
are those of docs/reference/glossary.md), and a budget. A `[[phrase]]` is looked for in what people
read: docs/ and README.md (inline code left out), the Unreleased part of CHANGELOG.md, the strings,
docstrings and comments of src/, and its templates. An `[[identifier]]` is looked for in the names
of the Python of src/ and in its strings of one word, `camelCase` read as `camel_case`.

A budget may only fall. The exit code is 1 where a count is above its budget; where it is below,
the budget to enter is printed, and `--lower` enters it. `--where` lists the places of one kind.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

_ROOT = Path(__file__).parents[1]
_LIST = "scripts/words.toml"


class Kind(NamedTuple):
    """A kind of discouraged word: what finds it, what to say, how many may still stand."""

    table: str
    name: str
    pattern: re.Pattern[str]
    say: str
    budget: int


class Text(NamedTuple):
    """A piece of text, and where it begins."""

    path: str
    line: int
    text: str


def kinds(path: Path) -> list[Kind]:
    """Return the kinds of a list; raise ValueError where a table is not as it should be."""
    found = []
    for table, entries in tomllib.loads(path.read_text(encoding="utf-8")).items():
        if table not in ("phrase", "identifier"):
            raise ValueError(f"{path}: no such table: {table}. There are phrase and identifier")
        found += [_kind(path, table, entry) for entry in entries]
    names = [kind.name for kind in found]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"{path}: twice: {', '.join(sorted(twice))}. Give each kind its own name")
    return found


def _kind(path: Path, table: str, entry: dict[str, Any]) -> Kind:
    if set(entry) != {"name", "pattern", "say", "budget"}:
        raise ValueError(f"{path}: {entry}: give name, pattern, say and budget, nothing else")
    budget = entry["budget"]
    if not isinstance(budget, int) or isinstance(budget, bool) or budget < 0:
        raise ValueError(f"{path}: {entry['name']}: the budget is a count (got {budget!r})")
    pattern = entry["pattern"]
    if table == "identifier":
        pattern = rf"(?<![a-z0-9])(?:{pattern})(?![a-z0-9])"
    return Kind(table, entry["name"], re.compile(pattern, re.IGNORECASE), entry["say"], budget)


def texts(root: Path) -> Iterator[tuple[str, Text]]:
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


def places(found: Sequence[Kind], pieces: Iterable[tuple[str, Text]]) -> dict[str, list[str]]:
    """Return the places of each kind, by its name."""
    where: dict[str, list[str]] = defaultdict(list)
    by_table = {t: [k for k in found if k.table == t] for t in ("phrase", "identifier")}
    for table, (path, first, text) in pieces:
        for kind in by_table[table]:
            for match in kind.pattern.finditer(text):
                line = first + text.count("\n", 0, match.start())
                where[kind.name].append(f"{path}:{line}: {' '.join(match[0].split())}")
    return where


def lowered(text: str, name: str, count: int) -> str:
    """Return the list's text with another budget for the kind of that name."""
    pattern = rf'(?ms)(^name = "{re.escape(name)}"\n(?:(?!^\[\[).)*?^budget = )\d+'
    return re.sub(pattern, rf"\g<1>{count}", text, count=1)


def main(arguments: Sequence[str], root: Path = _ROOT) -> int:
    """Count and compare with the budgets; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--where", metavar="KIND", help="list the places of one kind")
    parser.add_argument("--lower", action="store_true", help="lower budgets to today's counts")
    options = parser.parse_args(arguments)
    found = kinds(root / _LIST)
    where = places(found, texts(root))
    if options.where is not None:
        if options.where not in {kind.name for kind in found}:
            parser.error(f"no such kind: {options.where}. There are "
                         f"{', '.join(kind.name for kind in found)}")  # fmt: skip
        print("\n".join(where[options.where]) or "none")
        return 0
    over = [kind for kind in found if len(where[kind.name]) > kind.budget]
    under = [kind for kind in found if len(where[kind.name]) < kind.budget]
    for kind in over:
        print(
            f"{kind.table} '{kind.name}': {len(where[kind.name])}, and {_LIST} allows "
            f"{kind.budget}. Say: {kind.say}. List them: "
            f"python scripts/check_words.py --where '{kind.name}'"
        )
    text = _read(root / _LIST)
    for kind in under:
        count = len(where[kind.name])
        text = lowered(text, kind.name, count)
        if not options.lower:
            print(
                f"{kind.table} '{kind.name}': {count}, fewer than the {kind.budget} that "
                f"{_LIST} allows: set its budget to {count}, or run check_words.py --lower"
            )
    if options.lower and under:
        (root / _LIST).write_text(text, encoding="utf-8")
        print(f"lowered: {', '.join(kind.name for kind in under)}")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
