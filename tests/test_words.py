"""The check of words and of their budgets, on a project of a page, a changelog and a module."""

import re
from pathlib import Path

import pytest

from scripts import budget, words

LIST = """\
[[phrase]]
name = "told"
pattern = '\\b(?:un)?told\\b'
say = "identified"

[[phrase]]
name = "walk"
pattern = '(?<!random\\s)walk'
say = "random walk"

[[identifier]]
name = "told_"
pattern = '(?:un)?told'
say = "identified"

[renamed]
oldName = "new_name"
"thing.older" = "newer"
"""
BUDGETS = """\
# kept
[source]
"code_lines" = 3
"entries_at_the_top" = 1

[words]
"told" = {told}
"told_" = {names}
"walk" = 1
"""
FILES = {
    "README.md": "K2 is not told, `told` is a key.\n",
    "docs/explanation/page.md": "A random\nwalk and\na walk.\n```text\nwhat is untold\n```\n",
    "CHANGELOG.md": "# Changelog\n\n## [Unreleased]\n\n- `told` is told\n\n## [0.1]\n\n- told\n",
    "src/swimbladder/one.py": '''\
"""What the data told."""

KEY = "told"  # told before


def isTold(untold, bold):
    return f"it told {untold.told} of {bold:.2f}", b"was told", "retold"
''',
    "src/page.html.j2": "<p>not told</p>\n",
}
TOLD = 7  # README, page, changelog, docstring, comment, f-string, template
NAMES = 5  # KEY's value, isTold, untold twice, .told


@pytest.fixture
def project(tmp_path):
    def made(told=TOLD, names=NAMES):
        files = {
            **FILES,
            "scripts/words.toml": LIST,
            budget.BUDGET: BUDGETS.format(told=told, names=names),
        }
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path

    return made


def test_what_is_within_its_budget_passes_in_silence(project, capsys):
    assert budget.main([], project()) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("less", [{"told": TOLD - 1}, {"names": NAMES - 1}])
def test_one_word_more_than_the_budget_fails_and_says_what_to_write(project, capsys, less):
    assert budget.main([], project(**less)) == 1
    printed = capsys.readouterr().out
    assert "Say: identified" in printed
    assert "--where" in printed


def test_a_budget_that_is_too_large_is_to_be_lowered(project, capsys):
    root = project(told=TOLD + 3, names=NAMES + 1)
    assert budget.main([], root) == 0
    printed = capsys.readouterr().out
    assert f"told: {TOLD}, " in printed
    assert f"told_: {NAMES}, " in printed
    assert budget.main(["--lower"], root) == 0
    assert (root / budget.BUDGET).read_text() == BUDGETS.format(told=TOLD, names=NAMES)


def test_a_budget_is_never_raised(project):
    root = project(told=TOLD - 1, names=NAMES + 1)
    assert budget.main(["--lower"], root) == 1
    written = (root / budget.BUDGET).read_text()
    assert written == BUDGETS.format(told=TOLD - 1, names=NAMES)


def test_places_have_file_and_line(project, capsys):
    assert budget.main(["--where", "told"], project()) == 0
    places = capsys.readouterr().out.splitlines()
    assert places == [
        "README.md:1: told",
        "docs/explanation/page.md:5: untold",
        "CHANGELOG.md:5: told",
        "src/page.html.j2:1: told",
        "src/swimbladder/one.py:3: told",
        "src/swimbladder/one.py:1: told",
        "src/swimbladder/one.py:7: told",
    ]
    assert budget.main(["--where", "walk"], project()) == 0
    assert capsys.readouterr().out == "docs/explanation/page.md:3: walk\n"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('[[words]]\nname = "a"\n', "no such table: words"),
        ("[[phrase]]\nname = 'a'\npattern = 'a'\n", "give name, pattern and say"),
        (2 * "[[phrase]]\nname = 'a'\npattern = 'a'\nsay = 'b'\n", "twice: a"),
    ],
)
def test_a_list_that_is_wrong_is_refused(tmp_path, text, reason):
    path = tmp_path / "words.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=re.escape(reason)):
        words.kinds(path)


@pytest.mark.parametrize(
    ("line", "new"),
    [("oldName = 1", "new_name"), ("from thing.older import x", "newer"), ("older = 1", None)],
)
def test_what_was_renamed_may_not_come_back(project, capsys, line, new):
    root = project()
    (root / "src/swimbladder/one.py").write_text(f"{line}\n")
    assert budget.main([], root) == (0 if new is None else 1)
    assert (f"Say: {new}" in capsys.readouterr().out) == (new is not None)


def test_the_glossary_is_the_place_of_the_words_to_say():
    root = Path(__file__).parents[1]
    glossary = (root / "docs/reference/glossary.md").read_text(encoding="utf-8")
    found = [k for k in words.kinds(root / "scripts/words.toml") if k.pattern.search(glossary)]
    assert not [k.name for k in found if k.table == "phrase"]
