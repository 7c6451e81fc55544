"""Write docs/reference/safety.md from the marks of the tests: ``python scripts/make_safety.py``.

A test that shows a promise of the supervisor has the mark ``promise(NAME, faults=[...])``: NAME
stands in scripts/promises.toml, and the faults, where there are any, are kinds of the catalogue
that `swimbladder faults` draws from. ``--check`` writes nothing and ends with 1 where the page is
stale.
"""

import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import pytest

from swimbladder.control.supervisor import Reason
from swimbladder.io.files import write_atomically
from swimbladder.sim.faults.kinds import KINDS

ROOT = Path(__file__).parents[1]
_LONG = " (make prove)"
PAGE = ROOT / "docs" / "reference" / "safety.md"
_HEAD = """\
# Promises of the supervisor

What [the supervisor](../explanation/supervisor.md) guarantees, by how many tests it is shown (mark
`promise("NAME")`), and which [faults](faults.md) they inject. The random missions of `swimbladder
faults` inject all kinds, alone and in pairs. `scripts/promises.toml` has the requirements behind.
"""


class Shown(NamedTuple):
    """A test that shows a promise."""

    promise: str
    file: str
    test: str
    faults: tuple[str, ...]


class _Collector:
    """Gathers the marks of what pytest collects."""

    def __init__(self) -> None:
        self.found: list[Shown] = []
        self.errors: list[str] = []

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.errors.append(str(report.longrepr))

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        for item in session.items:
            file, _, test = item.nodeid.partition("::")
            for mark in item.iter_markers("promise"):
                own = test.partition("[")[0]
                long = item.get_closest_marker("prove") is not None
                self.found.append(shown(mark, file, f"{own}{_LONG}" if long else own))


def shown(mark: pytest.Mark, file: str, test: str) -> Shown:
    """Return what a mark says."""
    if len(mark.args) != 1 or set(mark.kwargs) - {"faults"}:
        raise ValueError(f"{file}: {test}: write promise(NAME) or promise(NAME, faults=[...])")
    return Shown(mark.args[0], file, test.replace("::", ", "), tuple(mark.kwargs.get("faults", ())))


def marked() -> list[Shown]:
    """Return every mark of the tests."""
    files = [p for p in sorted(ROOT.glob("tests/**/test_*.py")) if "mark.promise(" in p.read_text()]
    collector = _Collector()
    words = ["--collect-only", "-q", "-m", "promise", "-p", "no:cacheprovider", "--rootdir", ROOT]
    with redirect_stdout(StringIO()):
        pytest.main([str(word) for word in (*words, *files)], plugins=[collector])
    if collector.errors:
        raise RuntimeError("\n".join(collector.errors))
    return collector.found


def promises() -> dict[str, dict[str, str]]:
    """Return the promises by name."""
    return tomllib.loads((ROOT / "scripts" / "promises.toml").read_text(encoding="utf-8"))


def wrong(said: dict[str, dict[str, str]], found: list[Shown]) -> Iterator[str]:
    """Yield what does not fit between promises, reasons, headings and marks."""
    kinds = {kind.name for kind in KINDS.values()}
    page = (ROOT / "docs" / "explanation" / "supervisor.md").read_text(encoding="utf-8")
    headings = {line.lstrip("# ") for line in page.splitlines() if line.startswith("#")}
    for reason in Reason:
        if reason.name.lower().replace("_", "-") not in said:
            yield f"scripts/promises.toml has no promise for the reason {reason.words}"
    for name, text in said.items():
        if text["explained"] not in headings:
            yield f"{name}: docs/explanation/supervisor.md has no heading {text['explained']!r}"
        if name not in {one.promise for one in found}:
            yield f"{name}: no test has the mark promise({name!r})"
    for one in found:
        if one.promise not in said:
            yield f"{one.file}: {one.test}: scripts/promises.toml has no promise {one.promise!r}"
        for fault in set(one.faults) - kinds:
            yield f"{one.file}: {one.test}: the catalogue has no fault {fault!r}"


def made(said: dict[str, dict[str, str]], found: list[Shown]) -> str:
    """Return the page: a list of the promises under each heading of the explanation."""
    lists: dict[str, list[str]] = defaultdict(list)
    for name, text in said.items():
        mine = [one for one in found if one.promise == name]
        count = len({(one.file, one.test) for one in mine})
        faults = ", ".join(sorted({fault for one in mine for fault in one.faults}))
        item = f"- **{name}** ({count}): {text['promise']}"
        lists[text["explained"]].append(f"{item} Faults: {faults}.\n" if faults else f"{item}\n")
    pages = []
    for heading, items in lists.items():
        where = "" if heading == "The supervisor" else f"#{heading.lower().replace(' ', '-')}"
        pages.append(f"\n## [{heading}](../explanation/supervisor.md{where})\n\n{''.join(items)}")
    return f"{_HEAD}{''.join(pages)}"


def main(arguments: list[str]) -> int:
    """Write the page, or compare it."""
    said, found = promises(), marked()
    faulty = list(wrong(said, found))
    page = made(said, found)
    if not faulty and arguments == ["--check"] and PAGE.read_text(encoding="utf-8") != page:
        faulty = ["docs/reference/safety.md is stale: run python scripts/make_safety.py"]
    for line in faulty:
        print(line, file=sys.stderr)
    if not faulty and not arguments:
        write_atomically(PAGE, page)
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
