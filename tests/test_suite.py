"""What the suite says of itself: the same examples in every run, and long proofs apart."""

from pathlib import Path

import hypothesis
import pytest


def test_examples_are_the_same_in_every_run_and_new_where_they_are_hunted(
    pytestconfig: pytest.Config,
) -> None:
    drawn = hypothesis.settings.get_profile("swimbladder")
    hunted = hypothesis.settings.get_profile("prove")
    assert drawn.derandomize
    assert not hunted.derandomize
    assert hunted.max_examples > drawn.max_examples
    if pytestconfig.getoption("--hypothesis-profile") is None:
        assert hypothesis.settings().derandomize


def test_long_proofs_are_left_out_unless_they_are_asked_for(pytestconfig: pytest.Config) -> None:
    assert pytestconfig.getini("addopts")[-2:] == ["-m", "not prove"]
    makefile = (Path(__file__).parent.parent / "Makefile").read_text()
    assert '-m "prove and not hypothesis"' in makefile
