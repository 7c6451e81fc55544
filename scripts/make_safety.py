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

Each promise of [the supervisor](../explanation/supervisor.md), the requirement behind it, the tests
that show it, and which kinds of [the catalogue of faults](../how-to/faults.md) these inject one by
one. Tests that take long run in `make prove` only, and say so. The page is made from marks in the
tests by `scripts/make_safety.py`; a test fails where no test shows a promise.
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
    """Return the page."""
    parts = [_HEAD]
    for name, text in said.items():
        rows: dict[tuple[str, str], set[str]] = defaultdict(set)
        for one in found:
            if one.promise == name:
                rows[one.file, one.test] |= set(one.faults)
        for file, test in [key for key in rows if key[1].endswith(_LONG)]:
            quick = file, test.removesuffix(_LONG)
            if quick in rows:  # `make test` runs it as well, with other parameters
                rows[quick] |= rows.pop((file, test))
        anchor = text["explained"].lower().replace(" ", "-")
        where = "" if text["explained"] == "The supervisor" else f"#{anchor}"
        parts += [
            f"## {name.replace('-', ' ').capitalize()}\n",
            f"{text['promise']} *Because:* {text['requirement']}"
            f" [Why so](../explanation/supervisor.md{where})\n",
            "| shown by | faults |\n|---|---|",
            *(
                f"| `{file}`: {test.replace('_', ' ').replace('test ', '')} "
                f"| {', '.join(sorted(faults))} |"
                for (file, test), faults in sorted(rows.items())
            ),
            "",
        ]
    alone = {fault for one in found for fault in one.faults}
    rest = [kind.name for kind in KINDS.values() if kind.name not in alone]
    parts += [
        "## Faults that only random missions inject\n",
        f"{', '.join(rest)}. `swimbladder faults` draws all kinds, alone and in pairs.",
    ]
    return "\n".join(parts) + "\n"


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
