"""The check of words, on a project of a page, a changelog and a module."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from scripts import check_words

LIST = """\
# kept
[[phrase]]
name = "told"
pattern = '\\b(?:un)?told\\b'
say = "identified"
budget = {told}

[[phrase]]
name = "walk"
pattern = '(?<!random\\s)walk'
say = "random walk"
budget = 1

[[identifier]]
name = "told_"
pattern = '(?:un)?told'
say = "identified"
budget = {names}
"""
FILES = {
    "README.md": "K2 is not told, `told` is a key.\n",
    "docs/explanation/page.md": "A random\nwalk and\na walk.\n```text\nwhat is untold\n```\n",
    "CHANGELOG.md": "# Changelog\n\n## [Unreleased]\n\n- `told` is told\n\n## [0.1]\n\n- told\n",
    "src/thing/one.py": '''\
"""What the data told."""

KEY = "told"  # told before


def isTold(untold, bold):
    return f"it told {untold.told} of {bold:.2f}", b"was told", "retold"
''',
    "src/thing/page.html.j2": "<p>not told</p>\n",
}
TOLD = 7  # README, page, changelog, docstring, comment, f-string, template
NAMES = 5  # KEY's value, isTold, untold twice, .told


@pytest.fixture
def project(tmp_path):
    def made(told=TOLD, names=NAMES):
        files = {**FILES, "scripts/words.toml": LIST.format(told=told, names=names)}
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path

    return made


def test_what_is_within_its_budget_passes_in_silence(project, capsys):
    assert check_words.main([], project()) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("less", [{"told": TOLD - 1}, {"names": NAMES - 1}])
def test_one_word_more_than_the_budget_fails_and_says_what_to_write(project, capsys, less):
    assert check_words.main([], project(**less)) == 1
    printed = capsys.readouterr().out
    assert "Say: identified" in printed
    assert "--where" in printed


def test_a_budget_that_is_too_large_is_to_be_lowered(project, capsys):
    root = project(told=TOLD + 3, names=NAMES + 1)
    assert check_words.main([], root) == 0
    printed = capsys.readouterr().out
    assert f"set its budget to {TOLD}," in printed
    assert f"set its budget to {NAMES}," in printed
    assert check_words.main(["--lower"], root) == 0
    assert (root / "scripts/words.toml").read_text() == LIST.format(told=TOLD, names=NAMES)


def test_a_budget_is_never_raised(project):
    root = project(told=TOLD - 1, names=NAMES + 1)
    assert check_words.main(["--lower"], root) == 1
    written = (root / "scripts/words.toml").read_text()
    assert written == LIST.format(told=TOLD - 1, names=NAMES)


def test_places_have_file_and_line(project, capsys):
    assert check_words.main(["--where", "told"], project()) == 0
    places = capsys.readouterr().out.splitlines()
    assert places == [
        "README.md:1: told",
        "docs/explanation/page.md:5: untold",
        "CHANGELOG.md:5: told",
        "src/thing/one.py:3: told",
        "src/thing/one.py:1: told",
        "src/thing/one.py:7: told",
        "src/thing/page.html.j2:1: told",
    ]
    assert check_words.main(["--where", "walk"], project()) == 0
    assert capsys.readouterr().out == "docs/explanation/page.md:3: walk\n"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('[[words]]\nname = "a"\n', "no such table: words"),
        (
            "[[phrase]]\nname = 'a'\npattern = 'a'\nsay = 'b'\n",
            "give name, pattern, say and budget",
        ),
        ("[[phrase]]\nname = 'a'\npattern = 'a'\nsay = 'b'\nbudget = -1\n", "(got -1)"),
        (2 * "[[phrase]]\nname = 'a'\npattern = 'a'\nsay = 'b'\nbudget = 1\n", "twice: a"),
    ],
)
def test_a_list_that_is_wrong_is_refused(tmp_path, text, reason):
    path = tmp_path / "words.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=re.escape(reason)):
        check_words.kinds(path)


def test_the_glossary_is_the_place_of_the_words_to_say():
    root = Path(__file__).parents[1]
    glossary = (root / "docs/reference/glossary.md").read_text(encoding="utf-8")
    found = [
        k for k in check_words.kinds(root / "scripts/words.toml") if k.pattern.search(glossary)
    ]
    assert not [k.name for k in found if k.table == "phrase"]
