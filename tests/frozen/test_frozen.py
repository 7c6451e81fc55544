"""Today's answers, files and generated C against those in store/: README.md says how."""

import copy
import shutil

import pytest

from tests.frozen import compare, renamed
from tests.frozen.cases import CASES, DISTRIBUTIONS, LOOSE, Case, Distribution, Tolerance
from tests.frozen.compare import first_difference, rename
from tests.frozen.snapshot import cleaned, code_of, run
from tests.frozen.store import FOLDER, load, path_of

CASE = Case("a-case", ("simulate",))
LONG = (  # `make prove` takes them
    "tune-planned",
    "tune-position-observer",
    "tune-cascade",
    "bench-control",
    "stability-ntnu-bv",
    "mission-ntnu-bv",
    *(f"simulate-law-{n}" for n in ("observer", "pulse", "deadband", "sea-cascade")),
    "simulate-law-position-observer",
    "firmware-example-em",
    "identify-process-noise",
    "energy-example-eh",
    "plan-example-eh",
    "faults-ntnu-bv",
    "reproduce",
    "mission",
    "identify-pool",
    "faults",
    "stability-feup-em",
    "pool",
    "simulate-law-adrc",
    "simulate-law-planned",
    "simulate-ntnu-bv",
)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=pytest.mark.prove if case.name in LONG else ())
        for case in CASES
    ],
)
def test_a_case_is_as_it_was(case):
    if case.compiler and not any(map(shutil.which, ("cc", "gcc", "clang"))):
        pytest.skip("no C compiler")
    assert path_of(case.name).exists(), f"python -m tests.frozen {case.name}"
    difference = first_difference(case, load(case.name), run(case))
    assert difference is None, f"it is not as it was, see tests/frozen/README.md\n{difference}"


def test_every_command_has_a_case_and_every_stored_file_too():
    from swimbladder.cli import COMMANDS

    called = {renamed.COMMANDS.get(case.command, case.command) for case in CASES}
    assert called == set(COMMANDS) - {"board"}  # it takes one
    assert {path.name for path in FOLDER.iterdir()} == {path_of(c.name).name for c in CASES}
    assert sum(path.stat().st_size for path in FOLDER.parent.rglob("*") if path.is_file()) < 1.5e6


def test_a_tolerance_says_why():
    assert all(entry.why for entry in [*LOOSE.values(), *DISTRIBUTIONS.values()])


def snapshot(**answer):
    return {"exit": 0, "answer": answer, "files": {}}


@pytest.mark.parametrize(
    ("old", "new", "path"),
    [
        ({"K2": 7935.0}, {"K2": 7935.0 * (1 + 2e-9)}, "K2"),
        ({"K2": 7935.0}, {"K2": 7935.0 * (1 + 5e-10)}, None),
        ({"depth_m": 0.0}, {"depth_m": 1e-8}, "depth_m"),
        ({"depth_m": 0.0}, {"depth_m": 1e-10}, None),
        ({"volume_m3": 0.0}, {"volume_m3": 1e-12}, "volume_m3"),
        ({"slope_m_s2": 0.0}, {"slope_m_s2": 1e-12}, "slope_m_s2"),
        ({"x": {"value": 0.0, "unit": "m"}}, {"x": {"value": 1e-10, "unit": "m"}}, None),
        ({"row": [1.0, 0.0]}, {"row": [1.0, 5e-10]}, None),
        ({"row": [1.0, 0.0]}, {"row": [1.0, 5e-9]}, "row[1]"),
        ({"row": [1.0]}, {"row": [1.0, 2.0]}, "row"),
        ({"x": None}, {"x": 0.0}, "x"),
        ({"x": True}, {"x": 1}, "x"),
        ({"x": float("nan")}, {"x": float("nan")}, None),
        ({"x": float("nan")}, {"x": 0.0}, "x"),
        ({"x": float("inf")}, {"x": 1e300}, "x"),
        ({"kind": "leak"}, {"kind": "flood"}, "kind"),
        ({"x": 1}, {}, "x"),
        ({}, {"x": 1}, "x"),
    ],
)
def test_what_counts_as_a_difference(old, new, path):
    found = first_difference(CASE, snapshot(**old), snapshot(**new))
    assert (found and found.path) == (path and f"answer.{path}")


def test_a_difference_can_be_read():
    found = first_difference(CASE, snapshot(a=[{"b_m": 2.0}]), snapshot(a=[{"b_m": 3.0}]))
    assert str(found).splitlines() == [
        "case a-case",
        "  at  answer.a[0].b_m",
        "  old 2.0",
        "  new 3.0",
        "  relative difference 0.333",
    ]


def test_renamed_names_stay_comparable(monkeypatch):
    monkeypatch.setattr(
        renamed,
        "KEYS",
        {
            "saved": "recovered",
            "outcomes.alone": "outcomes.unsupervised",
            "told": "flight.found",
            "tune: seed": "draw",
        },
    )
    monkeypatch.setattr(renamed, "KINDS", {"could be saved": "recoverable"})
    monkeypatch.setattr(renamed, "FILES", {"-told.": "-ideal."})
    monkeypatch.setattr(renamed, "C_NAMES", {"tally": "debounce"})
    old = {
        "exit": 0,
        "answer": {
            "rows": [{"saved": 1, "seed": 2}],
            "outcomes": {"alone": 3},
            "alone": 4,
            "told": 5,
            "flight": {"end": 6},
            "kind": "could be saved",
            "files": ["out/m-told.csv"],
        },
        "files": {
            "m-told.csv": {"rows": 0, "columns": {"saved": []}},
            "x.c": {"sha256": "0", "code": ["int tally, tally_s;"]},
        },
    }
    kept = copy.deepcopy(old)
    assert rename(old, "simulate") == {
        "exit": 0,
        "answer": {
            "rows": [{"recovered": 1, "seed": 2}],
            "outcomes": {"unsupervised": 3},
            "alone": 4,
            "flight": {"found": 5, "end": 6},
            "kind": "recoverable",
            "files": ["out/m-ideal.csv"],
        },
        "files": {
            "m-ideal.csv": {"rows": 0, "columns": {"recovered": []}},
            "x.c": {"sha256": "0", "code": ["int debounce, tally_s;"]},
        },
    }
    assert old == kept
    assert rename(old, "tune")["answer"]["rows"] == [{"recovered": 1, "draw": 2}]


def test_a_looser_tolerance_holds_where_it_is_given(monkeypatch):
    monkeypatch.setitem(compare.LOOSE, "a-*: answer.x*", Tolerance(0.1, 0.0, "for this test"))
    assert first_difference(CASE, snapshot(x=[1.0]), snapshot(x=[1.05])) is None
    assert first_difference(CASE, snapshot(y=1.0), snapshot(y=1.05)).path == "answer.y"
    assert first_difference(CASE, snapshot(x=[1.0]), snapshot(x=[1.2])).path == "answer.x[0]"


def test_draws_in_another_order_are_compared_in_distribution(monkeypatch):
    draws = [n / 40 for n in range(40)]
    other = [n / 40 + 0.01 for n in reversed(range(40))]
    shifted = [n / 40 + 0.7 for n in range(40)]
    assert first_difference(CASE, snapshot(x=draws), snapshot(x=other)) is not None
    monkeypatch.setitem(
        compare.DISTRIBUTIONS, "a-case: answer*", Distribution(1e-3, 0.1, 0.0, "for this test")
    )
    assert first_difference(CASE, snapshot(x=draws), snapshot(x=other)) is None
    assert first_difference(CASE, snapshot(x=draws), snapshot(x=shifted)).path == "answer.x"
    assert first_difference(CASE, snapshot(x=1.0), snapshot(x=1.2)).path == "answer.x"
    assert first_difference(CASE, snapshot(x=1.0), snapshot(z=1.0)) is not None


def test_what_is_left_out_of_a_snapshot():
    long = [float(n) for n in range(100)]
    thin = cleaned(
        {
            "sentence": "It came up after an hour.",
            "kind": "two faults at once",
            "seconds": 1.2,
            "begin": "2000-01-01T00:00:00Z",
            "file": "/tmp/x/y.csv",
            "notes": ["a b c d e."],
            "row": long,
        }
    )
    row = thin.pop("row")
    assert thin == {
        "sentence": "<prose>",
        "kind": "two faults at once",
        "begin": "<date>",
        "file": "y.csv",
        "notes": "<prose>",
    }
    assert (row["count"], row["sum"], row["largest"]) == (100, sum(long), 99.0)
    assert (row["kept"][0], row["kept"][1], row["kept"][-1]) == (0.0, 3.0, 99.0)
    assert code_of('int a; // b\n\n/* c\n d */\nchar *s = "// e"; /* f */') == (
        'int a;\nchar *s = "// e";'
    )
