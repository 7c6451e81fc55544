"""The tool for mutation testing, on a project of two functions."""

import ast
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib

import pytest

from scripts import mutate

SOURCE = '''\
"""A docstring with 1 + 1."""

LIMIT: float = 2.0


def clipped(x: float) -> float:
    if x < 0.0:
        raise ValueError(f"{1 + 1} is not {x - 1}")
    x += 0.0  # nothing
    return min(x, LIMIT)
'''
TESTS = """\
import pytest
from report import NAME  # a folder of the source, not what is made at the top
from tiny import clipped

def test_clipped():
    assert clipped(1.0) == 1.0
    assert clipped(3.0) == 2.0
    with pytest.raises(ValueError):
        clipped(-0.5)
"""
LISTED = """\
[tests]
"src/*.py" = ["tests/test_tiny.py"]

[[equivalent]]
path = "src/tiny.py"
before = "x += 0.0  # nothing"
after = "x -= 0.0  # nothing"
reason = "0 is added or taken away"
"""


@pytest.fixture
def tree(tmp_path, monkeypatch):
    files = {"src/tiny.py": SOURCE, "tests/test_tiny.py": TESTS, "scripts/mutants.toml": LISTED}
    files |= {"src/report/__init__.py": 'NAME = "report"\n', "report/made.py": "no source\n"}
    for name, text in files.items():
        (tmp_path / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "tree" / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path / "tree"


def run(tree, *words):
    return mutate.main(["--root", str(tree), "--patience", "60", *words])


def test_a_mutant_is_one_change_of_what_is_run():
    found = mutate.mutants_of("tiny.py", SOURCE)
    changes = {(m.before, m.after) for m in found}
    assert ("if x < 0.0:", "if x <= 0.0:") in changes
    assert ("if x < 0.0:", "if x >= 0.0:") in changes
    assert ("return min(x, LIMIT)", "return max(x, LIMIT)") in changes
    assert ("x += 0.0  # nothing", "x -= 0.0  # nothing") in changes
    assert ("LIMIT: float = 2.0", "LIMIT: float = (4.0)") in changes
    assert len({m.text for m in found}) == len(found)
    for m in found:
        ast.parse(m.text)
        ours, theirs = SOURCE.splitlines(), m.text.splitlines()
        assert [k for k in range(len(ours)) if ours[k] != theirs[k]] == [m.line - 1]
        assert "raise" not in m.before  # what only a message is made of
        assert "docstring" not in m.before


def test_operators_signs_and_returns_are_changed():
    source = "def f(a, b):\n    g = -a / b if not (a and b) else a ** b\n    return a - b\n"
    found = mutate.mutants_of("f.py", source)
    assert len(mutate.drawn(found, 100, 1)) == len(found)  # each is Python
    changes = {m.after for m in found}
    assert changes == {
        "g = a / b if not (a and b) else a ** b",
        "g = -a * b if not (a and b) else a ** b",
        "g = -a / b if (a and b) else a ** b",
        "g = -a / b if not (a or b) else a ** b",
        "g = -a / b if not (a and b) else a * b",
        "return a + b",
        "return -(a - b)",
    }


def test_an_edit_elsewhere_draws_the_same_mutants_again():
    source = "".join(f"def f{n}(a, b):\n    return a * {n} + b\n" for n in range(40))
    edited = source.replace("a * 7 + b", "a * 7.5 - b")

    def changes(text):
        found = mutate.mutants_of("f.py", text)
        return len(found), {(m.before, m.after) for m in mutate.drawn(found, 30, 1)}

    (count, first), (_, second) = changes(source), changes(edited)
    assert len(first) == len(second) == 30 < count
    assert len(first & second) >= 28  # of 40 lines one was edited
    assert changes(source)[1] == first


@pytest.mark.prove
def test_survivors_are_listed_and_a_second_run_takes_up_where_the_first_was(tree, capsys):
    before = {path: path.read_bytes() for path in tree.rglob("*") if path.is_file()}
    assert run(tree, "--number", "3", "--seed", "3", "--least", "0", "--jobs", "2") == 0
    record = tree / "build" / "mutants.jsonl"
    some = record.read_text().splitlines()
    assert 2 <= len(some) <= 3  # one may be on the list
    with record.open("a") as file:
        file.write('{"key": "cut sh')  # killed while it wrote
        file.write("\n")
    code = run(tree, "--number", "100")
    said = capsys.readouterr().out
    lines = record.read_text().splitlines()
    assert lines[: len(some)] == some
    rows = [json.loads(line) for line in lines if "cut sh" not in line]
    ended = {(row["before"], row["after"]): row["ended"] for row in rows}
    assert len(ended) == len(rows)  # none twice
    assert ended["return min(x, LIMIT)", "return max(x, LIMIT)"] == "killed"
    # at 0.0 nobody looked
    assert ended["if x < 0.0:", "if x <= 0.0:"] == "survived"
    assert "  - if x < 0.0:\n  + if x <= 0.0:\n" in said
    assert "  + x -= 0.0" not in said  # its reason is on the list
    caught = sum(row["ended"] != "survived" for row in rows)
    assert f"{caught:4d} of {len(rows):4d} caught  src/tiny.py\n" in said
    assert "1 equivalent" in said
    assert code == (0 if caught >= 0.95 * len(rows) else 1)
    # nothing of the user's has changed, and nothing is left behind
    assert all(path.read_bytes() == text for path, text in before.items())
    assert sorted(path.name for path in tree.parent.iterdir()) == ["tree"]


def test_a_mutant_that_never_ends_is_ended(tree):
    source = "def f(n):\n    while n > 0:\n        n -= 1\n    return n\n"
    (tree / "src" / "tiny.py").write_text(source)
    (tree / "tests" / "test_tiny.py").write_text(
        "from tiny import f\ndef test_f():\n    assert f(3) == 0\n"
    )
    (endless,) = (m for m in mutate.mutants_of("src/tiny.py", source) if m.after == "n += 1")
    run = mutate.Run(tree, {"src/tiny.py": ["tests/test_tiny.py"]}, 1.0, [])
    assert run.test(endless)[0] == "timeout"
    assert (run.copy() / "tree" / "src" / "tiny.py").read_text() == source


@pytest.mark.skipif(os.name == "nt", reason="SIGTERM cannot be caught there")
def test_a_run_that_is_ended_leaves_no_copies_behind(tree):
    (tree / "tests" / "test_tiny.py").write_text(
        "import time\ndef test():\n    open('begun', 'w').close()\n    time.sleep(600)\n"
    )
    command = [sys.executable, mutate.__file__, "--root", str(tree), "--number", "2"]
    process = subprocess.Popen(command, env=os.environ | {"TMPDIR": str(tree.parent)})
    until = time.monotonic() + 60.0
    while not list(tree.parent.glob("mutants-*/0/tree/begun")) and time.monotonic() < until:
        time.sleep(0.1)
    process.terminate()
    assert process.wait(30.0) == 143
    assert sorted(path.name for path in tree.parent.iterdir()) == ["tree"]


def test_tests_that_fail_without_a_change_and_stale_entries_are_refused(tree):
    (tree / "scripts" / "mutants.toml").write_text(LISTED.replace("x -= 0.0", "x -= 7.0"))
    with pytest.raises(SystemExit, match="no mutant any more"):
        run(tree, "--number", "1")
    (tree / "scripts" / "mutants.toml").write_text(LISTED)
    (tree / "tests" / "test_tiny.py").write_text("def test():\n    assert False\n")
    with pytest.raises(SystemExit, match="fails without a change"):
        run(tree, "--number", "1")
    assert (tree / "src" / "tiny.py").read_text() == SOURCE


def test_what_is_listed_as_equivalent_is_a_mutant():
    known = tomllib.loads((mutate.ROOT / "scripts" / "mutants.toml").read_text())["equivalent"]
    paths = {entry["path"] for entry in known}
    every = [m for p in paths for m in mutate.mutants_of(p, (mutate.ROOT / p).read_text())]
    assert mutate.stale(known, every) == []


@pytest.mark.prove
def test_what_noticed_a_mutant_is_asked_first_when_tests_are_added(tree, monkeypatch):
    (tree / "tests" / "test_more.py").write_text(
        "from tiny import clipped\ndef test_two():\n    assert clipped(2.5) == 2.0\n"
    )
    listed = LISTED.replace(
        '["tests/test_tiny.py"]', '["tests/test_more.py", "tests/test_tiny.py"]'
    )
    (tree / "scripts" / "mutants.toml").write_text(listed)
    (chosen,) = (m for m in mutate.mutants_of("src/tiny.py", SOURCE) if "max(x" in m.after)
    monkeypatch.setattr(mutate, "drawn", lambda *_: [chosen])
    assert run(tree, "--number", "1") == 0
    record = tree / "build" / "mutants.jsonl"
    assert [json.loads(x)["by"] for x in record.read_text().splitlines()] == [
        "tests/test_more.py::test_two"
    ]
    (tree / "tests" / "test_others.py").write_text("# new\n")  # a neighbour: all is tested again
    asked = []
    pytest_of = mutate.Run.pytest

    def heard(self, arguments, limit):
        asked.append(arguments)
        return pytest_of(self, arguments, limit)

    monkeypatch.setattr(mutate.Run, "pytest", heard)
    assert run(tree, "--number", "1") == 0
    assert asked == ["tests/test_more.py::test_two"] * 2  # of the mutant, and without it
    assert len(record.read_text().splitlines()) == 2


@pytest.mark.prove
def test_a_test_that_is_gone_notices_nothing(tree):
    (mutant,) = (m for m in mutate.mutants_of("src/tiny.py", SOURCE) if "max(x" in m.after)
    run = mutate.Run(tree, {"src/tiny.py": ["tests/test_tiny.py"]}, 60.0, [])
    ended, by, _ = run.test(mutant, "tests/test_tiny.py::test_that_was")
    assert (ended, by) == ("killed", "tests/test_tiny.py::test_clipped")


def test_the_files_and_the_tests_of_the_list_are_there():
    root = mutate.ROOT
    listed = tomllib.loads((root / "scripts" / "mutants.toml").read_text("utf-8"))
    for pattern, commands in (*listed["tests"].items(), *listed["last"].items()):
        assert list(root.glob(pattern)), pattern
        for command in commands:
            assert (root / shlex.split(command)[0].partition("::")[0]).is_file(), command
    for pattern in listed["interpreted"]:
        assert list(root.glob(pattern)), pattern
    assert all(entry["reason"] for entry in listed.get("equivalent", []))
