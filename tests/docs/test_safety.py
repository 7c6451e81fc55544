"""docs/reference/safety.md: each promise of the supervisor is shown by a test, as the page says."""

import subprocess
import sys

import pytest

from scripts.make_safety import PAGE, ROOT, Shown, made, promises, shown, wrong


def test_the_page_is_that_of_the_marks():
    words = [sys.executable, ROOT / "scripts" / "make_safety.py", "--check"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


ALL = [Shown(name, "tests/test_a.py", "test_b", ()) for name in promises()]


def test_a_promise_that_no_test_shows_is_named():
    assert list(wrong(promises(), ALL)) == []
    assert list(wrong(promises(), [one for one in ALL if one.promise != "leak"])) == [
        "leak: no test has the mark promise('leak')"
    ]


@pytest.mark.parametrize(
    ("one", "said"),
    [
        (Shown("lake", "a.py", "test_b", ()), "scripts/promises.toml has no promise 'lake'"),
        (Shown("leak", "a.py", "test_b", ("fire",)), "the catalogue has no fault 'fire'"),
    ],
)
def test_a_mark_of_nothing_is_named(one, said):
    assert list(wrong(promises(), [*ALL, one])) == [f"a.py: test_b: {said}"]


def test_a_reason_without_a_promise_and_a_heading_that_is_gone_are_named():
    said = promises()
    del said["leak"]
    said["release"] = said["release"] | {"explained": "Weights"}
    assert list(wrong(said, [one for one in ALL if one.promise != "leak"])) == [
        "scripts/promises.toml has no promise for the reason leak",
        "release: docs/explanation/supervisor.md has no heading 'Weights'",
    ]


def test_a_mark_says_one_promise_and_faults():
    mark = pytest.mark.promise("leak", faults=["small leak"]).mark
    assert shown(mark, "a.py", "T::test_b") == Shown("leak", "a.py", "T, test_b", ("small leak",))
    for bad in (pytest.mark.promise(), pytest.mark.promise("leak", fault="small leak")):
        with pytest.raises(ValueError, match=r"a\.py: test_b: write promise"):
            shown(bad.mark, "a.py", "test_b")


def test_a_page_says_which_tests_and_faults():
    page = made(
        {"leak": promises()["leak"]},
        [
            Shown("leak", "a.py", "T, test_b", ("small leak",)),
            Shown("leak", "a.py", "T, test_b", ()),
        ],
    )
    (item,) = [line for line in page.splitlines() if line.startswith("- **leak** (1): ")]
    assert item.endswith(" Faults: small leak.")
    assert promises()["leak"]["promise"] in item
    assert "\n## [Detectors](../explanation/supervisor.md#detectors)\n" in page
    assert PAGE.read_text(encoding="utf-8").startswith(page.split("\n## ")[0])
