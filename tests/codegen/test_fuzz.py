"""A short run of the fuzzer, and every input that it once was of use with."""

import pytest

from swimbladder.control.registry import LAWS
from tests.codegen import fuzz
from tests.codegen.build import run


@pytest.mark.usefixtures("clang")
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("adrc", marks=pytest.mark.slow),
        *(pytest.param(name, marks=pytest.mark.prove) for name in ("cascade", "rate")),
    ],
)
@pytest.mark.promise("first-reason")
@pytest.mark.promise("command-within-limits")
@pytest.mark.promise("disarmed-holds")
@pytest.mark.promise("stays-armed")
@pytest.mark.promise("power-under-water")
@pytest.mark.promise("black-box")
def test_a_short_run_breaks_nothing(name, tmp_path):
    _breaks_nothing(name, tmp_path, runs=2000)


@pytest.mark.prove
@pytest.mark.usefixtures("clang")
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.promise("command-within-limits")
def test_a_long_run_breaks_nothing(name, tmp_path):
    _breaks_nothing(name, tmp_path, runs=100_000)


def _breaks_nothing(name, tmp_path, runs):
    """By libFuzzer where clang has it, else with as many random inputs; the seed is fixed."""
    made = fuzz.library(name)
    if fuzz.has_libfuzzer():
        done = fuzz.fuzz(made, tmp_path, runs=runs)
        assert done.crash is None, done.said[-4000:]
        assert done.runs >= runs
        reached, lines = map(int, done.covered.split(" of "))
        assert reached > 0.7 * lines  # the inputs that are kept reach far
    else:
        program = fuzz.build(made, tmp_path, "random")
        assert f"{runs} runs".encode() in run(program, str(runs), "1").stdout


@pytest.mark.usefixtures("gcc")
@pytest.mark.prove
def test_without_libfuzzer_random_inputs_do(tmp_path):
    program = fuzz.build(fuzz.library("cascade"), tmp_path, "random")
    assert run(program, "2000", "1").stdout == b"2000 runs\n"
    run(program, *fuzz.kept_inputs("cascade", tmp_path / "kept"))


_BROKEN = [
    (
        "swb_controller.c",
        "SWB_COMMAND_MOST < command ? SWB_COMMAND_MOST : command",
        "command",
        "the command is within its limits",
    ),
    ("swb_controller.c", "!swb_known(command) || ", "", "the command is finite"),
    (
        "swb_controller.c",
        " || c->waiting > SWB_MOST_WAIT",
        "",
        "the law is called again, in time",
    ),
    (
        "swb_vehicle.c",
        "v->reason = (uint8_t)(first < 255u ? first : 255u);",
        "v->reason = seen->leak ? 2u : 0u;",
        "a reason is among the reasons",
    ),
    (
        "swb_arming.c",
        "state->held : 0.0f",
        "state->held : 1.0f",
        "is held",
    ),
    (
        "swb_vehicle.c",
        "if (after_reset && v->arming.deck != SWB_DISARMED) {",
        "if (after_reset && v->kept == 0u) {",
        "a power-off disarms, and nothing else does",
    ),
    (
        "swb_arming.c",
        "state->restarted = !state->surfaced;",
        "",
        "power that came under water brings it up",
    ),
    (
        "swb_box.c",
        "        if (b->reason == 0u) {\n",
        "        if (true) {\n",
        "the first reason in the box stays",
    ),
    (
        "swb_box.c",
        "if (b->armed != 0u && swb_vehicle_surfaced(v)) {",
        "if (b->armed != 0u) {",
        "the box keeps what was armed until it is at the surface",
    ),
    (
        "swb_controller.c",
        "if (!(next_s > 1.001f * SWB_TICK_S)) {",
        "if (next_s <= 1.001f * SWB_TICK_S && next_s > -1e3f) {",
        "is outside the range of representable values of type",
    ),
]


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize(
    ("file", "good", "bad", "said"),
    [c if n % 6 == 0 else pytest.param(*c, marks=pytest.mark.prove) for n, c in enumerate(_BROKEN)],
)
def test_what_is_broken_is_found(file, good, bad, said, tmp_path):
    """The harness and the sanitizers see what was broken on purpose."""
    made = fuzz.library("cascade")
    text = made.files[f"src/{file}"]
    assert text.count(good) == 1
    broken = made.files | {f"src/{file}": text.replace(good, bad)}
    program = fuzz.build(fuzz.with_files(made, broken), tmp_path, "random")
    with pytest.raises(AssertionError, match=said):
        run(program, "20000", "1")


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize(
    ("good", "bad", "said"),
    [
        ("d->on = d->wanted;", "d->on = d->wanted | d->last;", "one of them is on at a time"),
        *(
            pytest.param(*broken, marks=pytest.mark.prove)
            for broken in (
                ("(d->off_us == 0u || d->last", "(true || d->last", "after the hold-off only"),
                ("-(int32_t)SWB_GRACE_US", "-3 * (int32_t)SWB_TICK_US", "goes off where no"),
            )
        ),
    ],
)
@pytest.mark.promise("pump-and-valve")
def test_what_is_broken_of_pump_and_valve_is_found(good, bad, said, tmp_path):
    made, name = fuzz.library("rate"), "src/swb_drive.c"
    assert made.files[name].count(good) == 1
    broken = made.files | {name: made.files[name].replace(good, bad)}
    program = fuzz.build(fuzz.with_files(made, broken), tmp_path, "random")
    with pytest.raises(AssertionError, match=said):
        run(program, "20000", "1")
