"""The budget of the source: what counts, and that it may fall but not rise."""

from pathlib import Path

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


def test_a_count_may_not_rise_and_needs_a_budget() -> None:
    assert budget.exceeded({"lines": 5}, {"lines": 5}) == []
    assert budget.exceeded({"lines": 4}, {"lines": 5}) == []
    assert len(budget.exceeded({"lines": 5}, {"lines": 3})) == 1
    assert len(budget.exceeded({"lines": 5}, {"files": 5})) == 1


def test_lowering_never_raises(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "src/swimbladder").mkdir(parents=True)
    tree(tmp_path / "src/swimbladder", one=TEXT)
    monkeypatch.setattr(budget, "ROOT", tmp_path)
    monkeypatch.setattr(budget, "BUDGET", tmp_path / "budget.toml")
    budget.BUDGET.write_text("# why\n")
    assert budget.main(["--lower"]) == 0
    assert budget.BUDGET.read_text().startswith("# why\ncode_lines = 5\n")
    assert budget.main([]) == 0
    tree(tmp_path / "src/swimbladder", two=SIX)
    assert budget.main([]) == 1
    assert budget.main(["--lower"]) == 1
    assert "code_lines = 5\n" in budget.BUDGET.read_text()
