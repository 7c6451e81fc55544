"""The generated C shown free of run-time errors, its command within its limits, for any bits."""

import tomllib
from pathlib import Path

import pytest

from swimbladder.codegen.library import Library, firmware, write_library
from swimbladder.control.registry import LAWS
from swimbladder.io.config import load_vehicle
from tests.codegen import eva, fuzz
from tests.codegen.build import run
from tests.codegen.laws import controlled, example
from tests.vehicles import SAMPLED, limited

LIBRARIES = [*LAWS, "pool day"]


def library(name: str) -> Library:
    """Return a law's library without a pool day, or the one with it."""
    if name == "pool day":
        return fuzz.library("cascade")
    if name in SAMPLED:
        return firmware(limited(controlled(name)), duration=100 * example(name).tick)
    return firmware(limited(load_vehicle("example-float")))


def _shown(name: str, folder: Path, chip: str) -> None:
    found = eva.properties(library(name), folder, chip)
    assert eva.left_open(found) == eva.allowed(name)
    reached = {(p.file, p.function) for p in found if p.status == "Valid"}
    assert ("swb_controller.c", "swb_state_known") in reached or name == "pool day"
    said = eva.commands_shown(found)
    assert len(said) == 3
    for text, status in said.items():
        assert "command" in text or "controller.waiting < " in text
        left = f"any_bits.c: main: {text}" in eva.allowed(name)
        assert status == ("Unknown" if left else "Valid")


@pytest.mark.slow
@pytest.mark.usefixtures("frama_c")
@pytest.mark.parametrize(
    "name",
    ["cascade", *(pytest.param(name, marks=pytest.mark.prove) for name in ("planned", "adrc"))],
)
@pytest.mark.promise("command-within-limits")
@pytest.mark.promise("disarmed-holds")
def test_any_bits_for_ever_leave_nothing_undefined_and_the_command_within_its_limits(
    name, tmp_path
):
    """The paper's law, and two that `tune` finds gains for, with an AVR's integers."""
    _shown(name, tmp_path, "8 bit")


@pytest.mark.prove
@pytest.mark.usefixtures("frama_c")
@pytest.mark.parametrize("chip", eva.CHIPS)
@pytest.mark.parametrize("name", LIBRARIES)
@pytest.mark.promise("command-within-limits")
@pytest.mark.promise("disarmed-holds")
def test_so_it_is_for_every_law(name, chip, tmp_path):
    _shown(name, tmp_path, chip)


_BROKEN = {
    "the limit": (
        "swb_controller.c",
        "SWB_COMMAND_MOST < command ? SWB_COMMAND_MOST : command",
        "command",
        "any_bits.c: main: -12.0f ≤ command ≤ 12.0f",
    ),
    "a wait": (
        "swb_controller.c",
        "if (ticks >= 1000000.0f) {",
        "if (ticks >= 1e10f) {",
        "swb_controller.c: swb_wait_in_ticks: ticks < 4294967296",
    ),
    "the hold": (
        "swb_arming.c",
        "state->held : 0.0f",
        "state->held : 1.0f",
        "any_bits.c: hold: command ≡ 0.0f",
    ),
    "a row": (
        "swb_box.c",
        " && b->next < SWB_BOX_ROWS",
        "",
        "swb_box.c: swb_box_write: \\valid(&row->depth)",
    ),
    "an index": (
        "swb_controller.c",
        "at < sizeof *state; at",
        "at <= sizeof *state; at",
        "swb_controller.c: swb_state_known: valid_src: valid_read_or_empty(src, n)",
    ),
}


@pytest.mark.prove
@pytest.mark.usefixtures("frama_c")
@pytest.mark.parametrize(
    "kind", [n if n == "the limit" else pytest.param(n, marks=pytest.mark.prove) for n in _BROKEN]
)
def test_what_is_broken_is_not_shown(kind, tmp_path):
    file, good, bad, said = _BROKEN[kind]
    made = library("deadband" if kind == "a wait" else "cascade")
    text = made.files[f"src/{file}"]
    assert text.count(good) == 1
    broken = fuzz.with_files(made, made.files | {f"src/{file}": text.replace(good, bad)})
    assert said in eva.left_open(eva.properties(broken, tmp_path, "8 bit"))


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
def test_what_eva_is_given_is_so_for_every_number(tmp_path):
    """All 2^32 of them: `swb_known` says what is finite; waits and the box's rows are counts."""
    write_library(library("cascade"), tmp_path)
    src, program = tmp_path / "src", tmp_path / "every"
    run(
        "gcc",
        *("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"),
        *("-fsanitize=float-cast-overflow", "-fno-sanitize-recover=all"),
        *("-I", src, eva.HERE / "every_number.c", "-o", program),
        *(src / f"swb_{name}.c" for name in ("cascade", "vehicle", "arming")),
        "-lm",
    )
    assert run(program, text=True).stdout == "0 wrong\n"


def test_what_is_left_open_has_a_reason_and_a_library():
    entries = tomllib.loads((eva.HERE / "open.toml").read_text(encoding="utf-8"))["open"]
    for entry in entries:
        assert entry.keys() - {"libraries"} == {"property", "reason"}
        assert set(entry.get("libraries", LIBRARIES)) <= set(LIBRARIES)
        assert len(entry["reason"].split()) > 5
    of_all = {entry["property"] for entry in entries if "libraries" not in entry}
    assert eva.allowed("cascade") == eva.allowed("planned") == of_all
    assert not any(one.startswith("any_bits.c") for one in of_all)
