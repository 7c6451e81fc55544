"""What the source may cost: counts that `make lint` lets fall but not rise, in budget.toml.

::

    python scripts/budget.py            # compare; exit 1 where a count is above the budget
    python scripts/budget.py --lower    # write what is counted now, where it is less
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUDGET = Path(__file__).with_name("budget.toml")
SHARED = 6  # lines in a row that make a repetition
_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def code_lines(text: str) -> set[int]:
    """Return the numbers of the lines that hold code: no blank, comment or docstring."""
    docs: set[int] = set()
    for node in ast.walk(ast.parse(text)):
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
        for node in ast.walk(ast.parse(text))
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
        "unformatted_places": lambda text: text.count("fmt: skip"),
    }
    counts = Counter({"repeated_lines": repeated_lines(texts)})
    for name, count in per_file.items():
        counts[name] = sum(map(count, texts.values()))
    counts["entries_at_the_top"] = sum(not p.name.startswith("__") for p in source.iterdir())
    return dict(counts)


def exceeded(counts: Mapping[str, int], budget: Mapping[str, int]) -> list[str]:
    """Return a line for each count that is above its budget, or has none."""
    return [
        f"{name}: {now}, the budget in {BUDGET.name} is {budget.get(name, 'missing')}"
        for name, now in sorted(counts.items())
        if now > budget.get(name, -1)
    ]


def main(arguments: list[str]) -> int:
    """Compare the tree with its budget, or lower the budget; return the exit code."""
    counts = counted(ROOT / "src" / "swimbladder")
    budget = tomllib.loads(BUDGET.read_text(encoding="utf-8"))
    if arguments == ["--lower"]:
        lower = {name: min(now, budget.get(name, now)) for name, now in counts.items()}
        head = [line for line in BUDGET.read_text(encoding="utf-8").splitlines() if line[:1] == "#"]
        rows = [f"{name} = {value}" for name, value in sorted(lower.items())]
        BUDGET.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
        budget = lower
    above = exceeded(counts, budget)
    below = [f"{name} {now}" for name, now in sorted(counts.items()) if now < budget.get(name, 0)]
    if below:
        print(f"Less than the budget, lower it with --lower: {', '.join(below)}")
    print("\n".join(above), end="\n" if above else "")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
