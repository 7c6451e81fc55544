"""docs/explanation/equations.md: nothing of the paper is missing, all that it names exists."""

import ast
import inspect
import re
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "explanation" / "equations.md"
EXPECTED = (
    *(f"({n})" for n in range(1, 38)),
    *(f"Figure {n}" for n in range(1, 18)),
    *(f"Table {n}" for n in range(1, 4)),
)


class Row(NamedTuple):
    number: str
    says: str
    functions: tuple[str, ...]
    tests: tuple[str, ...]


def rows():
    line = re.compile(r"- \*\*(.+?)\*\* (.+?): (`.+`) \((`tests/.+`)\)")
    text = PAGE.read_text(encoding="utf-8")
    return [Row(n, says, names(f), names(te)) for n, says, f, te in line.findall(text)]


def names(cell):
    return tuple(re.findall(r"`([^`]+)`", cell))


@cache
def defined_in(path):
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def look_up(name):
    """The object of a dotted name under swimbladder."""
    parts = ["swimbladder", *name.split(".")]
    for end in range(len(parts) - 1, 0, -1):
        try:
            found = import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for part in parts[end:]:
            found = getattr(found, part)
        return found
    raise AssertionError(name)


def test_every_equation_figure_and_table_has_its_row_in_order():
    assert tuple(row.number for row in rows()) == EXPECTED


@pytest.mark.parametrize("row", rows(), ids=lambda row: row.number)
def test_what_a_row_names_exists(row):
    assert row.says
    assert row.functions
    assert row.tests
    for name in row.functions:
        found = look_up(name)
        assert callable(found), name
        assert inspect.getdoc(found), f"{name} has no docstring"
    for test in row.tests:
        path, _, name = test.partition("::")
        assert name.startswith("test_")
        assert name in defined_in(path), test


@pytest.mark.parametrize("row", rows()[:37], ids=lambda row: row.number)
def test_an_equation_is_cited_where_it_is(row):
    """The paper's number stands in the docstring of a function of its row, or of its module."""
    number = int(row.number.strip("()"))
    assert any(number in cited_by(name) for name in row.functions), (
        f"none of {', '.join(row.functions)} says that it is eq. ({number})"
    )


def cited_by(name):
    found = look_up(name)
    text = f"{inspect.getsource(found)} {inspect.getdoc(import_module(found.__module__))}"
    cited = set()
    for first, last in re.findall(r"\((\d+)\)(?:[-–]\((\d+)\))?", text):
        cited |= set(range(int(first), int(last or first) + 1))
    for first, last in re.findall(r"\beqs? \(?(\d+)\)?[-–]\(?(\d+)\)?", text):
        cited |= set(range(int(first), int(last) + 1))
    return cited


def test_links_to_the_errata_lead_somewhere():
    assert "](errata.md)" in PAGE.read_text(encoding="utf-8")
    assert (PAGE.parent / "errata.md").is_file()
