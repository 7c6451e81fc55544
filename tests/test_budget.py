"""The budget of the source: what counts, and that it may fall but not rise."""

from pathlib import Path

import pytest

from scripts import budget

SIX = "".join(f"value_{n} = compute({n})\n" for n in range(6))
TEXT = '''"""A docstring
of two lines."""

import os  # a comment

# another


def wide(a, b, c, d, e, *, f, g, h, i):  # type: ignore[no-untyped-def]
    """One line."""
    return [  # fmt: skip
        a,
    ]
'''


def tree(folder: Path, **texts: str) -> Path:
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    return folder


def test_code_lines_are_those_without_blanks_comments_and_docstrings() -> None:
    assert budget.code_lines(TEXT) == {4, 9, 11, 12, 13}


def test_what_is_counted(tmp_path: Path) -> None:
    found = budget.counted(tree(tmp_path, one=TEXT, two=SIX, __init__=""))
    assert found == {
        "code_lines": 11,
        "entries_at_the_top": 2,
        "functions_with_more_than_8_parameters": 1,
        "repeated_lines": 0,
        "unformatted_places": 1,
        "untyped_functions": 1,
    }


def test_six_lines_that_stand_twice_count_once(tmp_path: Path) -> None:
    five = SIX.splitlines(keepends=True)[:5]
    assert budget.counted(tree(tmp_path, a=SIX, b="x = 1\n" + SIX))["repeated_lines"] == 6
    assert budget.counted(tree(tmp_path, b="x = 1\n" + "".join(five)))["repeated_lines"] == 0


@pytest.fixture
def project(tmp_path):
    """A project of one module, without budgets of words."""
    (tmp_path / "src/swimbladder").mkdir(parents=True)
    (tmp_path / "scripts").mkdir()
    tree(tmp_path / "src/swimbladder", one=TEXT)
    (tmp_path / "scripts/words.toml").write_text("")
    return tmp_path


def budgets(root: Path, **counts: int) -> Path:
    path = root / budget.BUDGET
    path.write_text("# why\n[source]\n" + "".join(f"{k} = {n}\n" for k, n in counts.items()))
    return path


def test_a_count_may_not_rise_and_needs_a_budget(project, capsys) -> None:
    counts = budget.counted(project / "src/swimbladder")
    budgets(project, **counts)
    assert budget.main([], project) == 0
    assert capsys.readouterr().out == ""
    budgets(project, **counts | {"code_lines": counts["code_lines"] - 1})
    assert budget.main([], project) == 1
    budgets(project, **{name: n for name, n in counts.items() if name != "code_lines"})
    assert budget.main([], project) == 1
    assert "code_lines: 5" in capsys.readouterr().out


def test_lowering_never_raises(project) -> None:
    path = budgets(project, **budget.counted(project / "src/swimbladder") | {"code_lines": 7})
    assert budget.main(["--lower"], project) == 0
    assert path.read_text().startswith('# why\n[source]\n"code_lines" = 5\n')
    assert budget.main([], project) == 0
    tree(project / "src/swimbladder", two=SIX)
    assert budget.main(["--lower"], project) == 1
    assert '"code_lines" = 5\n' in path.read_text()


def test_a_budget_is_a_count(project) -> None:
    budgets(project, code_lines=-1)
    with pytest.raises(ValueError, match="got -1"):
        budget.main([], project)
