"""Counts that `make lint` lets fall but not rise: of the source, and of discouraged words.

::

    python scripts/budget.py                 # compare with budget.toml; exit 1 where more
    python scripts/budget.py --lower         # write what is counted now, where it is less
    python scripts/budget.py --where KIND    # list the places of a kind of word of words.toml
"""

import argparse
import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from scripts import words

ROOT = Path(__file__).resolve().parents[1]
BUDGET = "scripts/budget.toml"
SHARED = 6  # lines in a row that make a repetition
_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


@cache
def _nodes(text: str) -> list[ast.AST]:
    return list(ast.walk(ast.parse(text)))


@cache
def code_lines(text: str) -> set[int]:
    """Return the numbers of the lines that hold code: no blank, comment or docstring."""
    docs: set[int] = set()
    for node in _nodes(text):
        held = node.value if isinstance(node, ast.Expr) else None
        if isinstance(held, ast.Constant) and isinstance(held.value, str):
            docs.update(range(held.lineno, (held.end_lineno or held.lineno) + 1))
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            code.update(range(token.start[0], token.end[0] + 1))
    return code - docs


def wide_functions(text: str) -> int:
    """Return how many functions have more than 8 parameters."""
    return sum(
        len(node.args.posonlyargs) + len(node.args.args) + len(node.args.kwonlyargs) > 8
        for node in _nodes(text)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    )


def repeated_lines(texts: Mapping[Path, str]) -> int:
    """Return how many lines stand in a run of `SHARED` lines that stands in another place too.

    The first place of a run does not count. Imports and lone punctuation are passed over.
    """
    seen: set[tuple[str, ...]] = set()
    count = 0
    for text in texts.values():
        lines = list(_telling(text))
        repeated: set[int] = set()
        for n in range(len(lines) - SHARED + 1):
            run = tuple(lines[n : n + SHARED])
            if run in seen:
                repeated.update(range(n, n + SHARED))
            seen.add(run)
        count += len(repeated)
    return count


def _telling(text: str) -> Iterator[str]:
    rows = text.splitlines()
    for n in sorted(code_lines(text)):
        line = " ".join(rows[n - 1].split())
        if re.search(r"\w", line) and not re.match(r"(from|import) |\w+,$|\"\w+\",$", line):
            yield line


def counted(source: Path) -> dict[str, int]:
    """Return the counts of a source tree, by the names that the budget has."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(source.rglob("*.py"))}
    per_file: Mapping[str, Callable[[str], int]] = {
        "code_lines": lambda text: len(code_lines(text)),
        "functions_with_more_than_8_parameters": wide_functions,
        "untyped_functions": lambda text: text.count("no-untyped-def"),
        "unformatted_places": lambda text: text.count("fmt: " + "skip"),
    }
    counts = Counter({"repeated_lines": repeated_lines(texts)})
    for name, count in per_file.items():
        counts[name] = sum(map(count, texts.values()))
    counts["entries_at_the_top"] = sum(not p.name.startswith("__") for p in source.iterdir())
    return dict(counts)


def read(path: Path) -> dict[str, dict[str, int]]:
    """Return the budgets of a file; raise ValueError for what is not a count."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    for table, budgets in tables.items():
        for name, budget in budgets.items():
            if type(budget) is not int or budget < 0:
                raise ValueError(f"{path}: {table}: {name}: a budget is a count (got {budget!r})")
    return tables


def main(arguments: Sequence[str], root: Path = ROOT) -> int:
    """Compare the project with its budget, or lower the budget; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--where", metavar="KIND", help="list the places of a kind of word")
    parser.add_argument("--lower", action="store_true", help="lower budgets to today's counts")
    options = parser.parse_args(arguments)
    where = words.places(root)
    named = {kind.name: kind for kind in where}
    if options.where is not None:
        if options.where not in named:
            parser.error(f"no such kind: {options.where}. There are {', '.join(named)}")
        print("\n".join(where[named[options.where]]) or "none")
        return 0
    counts = {
        "source": counted(root / "src" / "swimbladder"),
        "words": {kind.name: len(found) for kind, found in where.items()},
    }
    budgets, above = read(root / BUDGET), []
    lower: dict[str, dict[str, int]] = {"source": {}, "words": {}}
    for table, now in counts.items():
        for name, count in sorted(now.items()):
            budget = budgets.get(table, {}).get(name, 0)
            lower[table][name] = min(count, budget)
            if count > budget:
                kind = named.get(name) if table == "words" else None
                say = kind and f". Say: {kind.say}. List them: budget.py --where '{name}'"
                above.append(f"{name}: {count}, {BUDGET} allows {budget}{say or ''}")
            elif count < budget and not options.lower:
                print(f"{name}: {count}, {BUDGET} allows {budget}: lower it with --lower")
    if options.lower:
        (root / BUDGET).write_text(_written(root / BUDGET, lower), encoding="utf-8")
    print("\n".join(above), end="\n" if above else "")
    return 1 if above else 0


def _written(path: Path, budgets: Mapping[str, Mapping[str, int]]) -> str:
    """Return the text of a file of budgets, with the comments at its head."""
    rows = [line for line in path.read_text(encoding="utf-8").splitlines() if line[:1] == "#"]
    for table, kept in budgets.items():
        rows += [f"[{table}]", *(f'"{name}" = {n}' for name, n in kept.items() if n), ""]
    return "\n".join(rows)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
