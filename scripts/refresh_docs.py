"""Write anew what examples print: ``python scripts/refresh_docs.py [PAGE ...]``, all pages if none.

The examples of README.md and docs/ are run as `tests/docs/test_examples.py` runs them. Where one
does not print what stands beside it, what it prints is written there: a promised line that still
fits stays as it is, its ``...`` too, and a line that is changed keeps those ``...`` that stand
between words which are still there. What was changed is printed. An example that ends with
another exit code is named and left alone; then the exit code is 1. The picture in the README, and
the tables that `scripts/make_reference.py` makes, are not touched.
"""

import contextlib
import difflib
import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

_ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(_ROOT))

from tests.docs.test_examples import (  # noqa: E402
    PAGES,
    Block,
    blocks_of,
    commands_of,
    needs_programs,
    run_page,
    same,
    warm_programs,
)


def refreshed(printed: str, promised: str) -> str:
    """Return what to promise of what is printed, as near as possible to what was promised."""
    if same(printed, promised):
        return promised
    lines = _merged(promised.strip("\n").splitlines(), _bare(printed), _line_cost, _merged_line)
    if not same(printed, "\n".join(lines)):  # each line may fit and the whole not
        lines = _bare(printed)
    end = promised[len(promised.rstrip("\n")) :] or "\n"
    return "\n".join(lines) + end if lines else end.removeprefix("\n")


def _bare(text: str) -> list[str]:
    return [line.rstrip() for line in text.strip("\n").splitlines()]


def _line_cost(old: str, new: str) -> float:
    """Return 0 where a promised line fits, 1 where it has nothing of what is printed."""
    if same(new, old):
        return 0.0
    return 1.0 - 0.9 * difflib.SequenceMatcher(None, old, new, autojunk=False).ratio()


def _merged_line(old: str, new: str) -> str:
    """Return a promised line that fits, else the printed one with each ``...`` that has a place."""
    if same(new, old):
        return old
    words = partial(re.findall, r"\s*\S+")
    line = "".join(_merged(words(old), words(new), _word_cost, _merged_word))
    return line if same(new, line) else new


def _word_cost(old: str, new: str) -> float:
    return 0.0 if same(new.strip(), old.strip()) else 1.0


def _merged_word(old: str, new: str) -> str:
    blanks = new[: len(new) - len(new.lstrip())]
    return blanks + old.strip() if same(new.strip(), old.strip()) else new


def _merged(
    old: Sequence[str],
    new: Sequence[str],
    cost: Callable[[str, str], float],
    merge: Callable[[str, str], str],
) -> list[str]:
    """Return `new` with the parts of `old` that fit it; a part ``...`` of it stands for many.

    The cheapest alignment: a part more costs 1, a part less 1.5 (so that none is swallowed by a
    part ``...``), a pair that `merge` makes one costs `cost`.
    """
    least = [[0.0] * (len(new) + 1) for _ in range(len(old) + 1)]
    step = [[""] * (len(new) + 1) for _ in range(len(old) + 1)]
    for i in range(len(old) + 1):
        for j in range(len(new) + 1):
            if not (i or j):
                continue
            wild = i > 0 and old[i - 1].strip() == "..."
            ways = []
            if i and j and not wild:
                ways.append((least[i - 1][j - 1] + cost(old[i - 1], new[j - 1]), "both"))
            if i:
                ways.append((least[i - 1][j] + (0.0 if wild else 1.5), "old"))
            if j:
                ways.append((least[i][j - 1] + (0.0 if wild else 1.0), "new"))
            least[i][j], step[i][j] = min(ways)
    parts: list[str] = []
    i, j = len(old), len(new)
    while i or j:
        way = step[i][j]
        wild = i > 0 and old[i - 1].strip() == "..."
        if way == "both":
            parts.append(merge(old[i - 1], new[j - 1]))
        elif way == "old" and wild:
            parts.append(old[i - 1])
        elif way == "new" and not wild:
            parts.append(new[j - 1])
        i, j = i - (way in ("both", "old")), j - (way in ("both", "new"))
    return parts[::-1]


def refresh(page: Path, say: Callable[[str], None] = print) -> tuple[bool, bool]:
    """Run a page and write what its examples print; return whether it changed, and went well."""
    text = page.read_text(encoding="utf-8")
    bodies: dict[Block, str] = {}
    well = True
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        programs = []
        if needs_programs(page):
            beside = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            programs = [stack.enter_context(warm_programs(beside))]
        stack.enter_context(contextlib.chdir(folder))
        for ran in run_page(page, folder, *programs):
            place = f"{page.name}, line {ran.block.line}: {ran.command.strip()}"
            if ran.code != ran.expected:
                say(f"{place}: exit code {ran.code}, not {ran.expected}\n{ran.printed}")
                well = False
            elif ran.promised is not None and not same(ran.printed, ran.promised):
                output = partial(refreshed, ran.printed)
                body = bodies.get(ran.block, ran.block.body)
                console = ran.block.language == "console"
                bodies[ran.block] = (
                    _with_output(body, ran.number, output) if console else output(body)
                )
                say(f"{place}\n{_changes(ran.promised, output(ran.promised))}")
    return _write(page, text, bodies), well


def _with_output(body: str, number: int, output: Callable[[str], str]) -> str:
    """Return the body of a console block with another output of its command of that number."""
    parts = re.split(r"(?m)^(?=\$ )", body)
    command = re.match(r"(?:.*\\\n)*.*\n", parts[number + 1])
    assert command is not None
    parts[number + 1] = command[0] + output(parts[number + 1][command.end() :])
    return "".join(parts)


def _changes(old: str, new: str) -> str:
    lines = difflib.unified_diff(old.splitlines(), new.splitlines(), lineterm="", n=0)
    return "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))


def _write(page: Path, text: str, bodies: dict[Block, str]) -> bool:
    new = text
    for block in sorted(bodies, key=lambda block: -block.at):
        new = new[: block.at] + bodies[block] + new[block.at + len(block.body) :]
    if new != text:
        page.write_text(new, encoding="utf-8")
    return new != text


def refresh_quoted(page: Path, root: Path, say: Callable[[str], None] = print) -> bool:
    """Bring the blocks of a page that stand there as on another page up to date with that page."""
    text = page.read_text(encoding="utf-8")
    bodies: dict[Block, str] = {}
    for block in blocks_of(page, "as in "):
        there = [b for b in blocks_of(root / block.mark.split()[-1]) if b.language == "console"]
        prints = dict(pair for other in there for pair in commands_of(other))
        for number, (command, quoted) in enumerate(commands_of(block)):
            whole = prints.get(command)
            if whole is None:
                say(f"{page.name}, line {block.line}: {block.mark}: not there: {command}")
                continue
            lines = [line for line in quoted.splitlines() if line != "..."]
            if set(lines) <= set(whole.splitlines()):
                continue
            kept = _quoted(quoted.splitlines(), whole.splitlines())
            say(f"{page.name}, line {block.line}\n{_changes(quoted, kept)}")
            bodies[block] = _with_output(
                bodies.get(block, block.body), number, lambda _, kept=kept: kept
            )
    return _write(page, text, bodies)


def _quoted(lines: Iterable[str], whole: Sequence[str]) -> str:
    """Return quoted lines, each that is no longer there replaced by the one that is nearest."""
    kept = []
    for line in lines:
        if line != "..." and line not in whole:
            line = min(whole, key=partial(_line_cost, line))
        kept.append(line)
    return "".join(f"{line}\n" for line in kept)


def main(names: Sequence[str]) -> int:
    """Refresh the pages of that name, or all."""
    pages = [Path(name).resolve() for name in names] or PAGES
    done = [(page, *refresh(page)) for page in pages]
    changed = [page.name for page, new, _ in done if new]
    changed += [page.name for page in PAGES if refresh_quoted(page, _ROOT)]
    print(f"changed: {', '.join(changed) or 'nothing'}")
    return 0 if all(well for _, _, well in done) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
