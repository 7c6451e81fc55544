"""The branches of the generated C that its tests take: 95 % at least, the rest with reasons."""

import re
import tomllib
from pathlib import Path

import pytest

from swimbladder.control.registry import LAWS
from tests.codegen import coverage, fuzz


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("name", LAWS)
def test_nearly_all_branches_are_taken_and_the_rest_has_reasons(name):
    found = coverage.taken(name)
    files = {branch.file for branch in found.counts}
    page = (Path(__file__).parents[2] / "docs/reference/boards.md").read_text(encoding="utf-8")
    (said,) = re.findall(rf"(?<![-\w]){name} ([\d.]+) %", page, re.MULTILINE)
    assert 100 * found.share == pytest.approx(float(said), abs=1.0), "tests.codegen.coverage"
    floats = LAWS[name].command == "volume change"
    own = {"swb_drive.c", f"swb_{name}.c"} if floats else {"swb_supervisor_step.h"}
    assert files >= {*own, "swb_vehicle.c", "swb_controller.c", "swb_arming.c", "swb_box.c"}
    assert found.share >= coverage.LEAST
    assert set(found.untaken) <= set(coverage.reasons(name))


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
def test_what_is_not_taken_is_not_taken():
    """No reason outlives its branch."""
    untaken = {line for name in LAWS for line in coverage.taken(name).untaken}
    assert untaken == {line for name in LAWS for line in coverage.reasons(name)}


def test_reasons_are_of_laws_and_say_something():
    entries = tomllib.loads((fuzz.HERE / "untaken.toml").read_text(encoding="utf-8"))["untaken"]
    for entry in entries:
        assert entry.keys() - {"laws"} == {"file", "lines", "reason"}
        assert set(entry.get("laws", LAWS)) <= set(LAWS)
        assert len(entry["reason"].split()) > 5
