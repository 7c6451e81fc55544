"""The command line's frame: help, version, exit codes, JSON, start-up."""

import dataclasses
import enum
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

from swimbladder import __version__, cli
from swimbladder.cli import COMMANDS, GROUPS, common, main
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.units import quantity

HEAVY = ("scipy", "pandas", "xarray", "matplotlib", "control", "numba", "numpy", "pydantic")


def imported_by(code):
    """The modules that a new process has after running `code`."""
    script = f"{code}\nimport sys; print(*sorted(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


def test_help_lists_every_command_with_a_line_on_it(capsys):
    assert main(["--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for panel, commands in GROUPS.items():
        place = shown.index(f"─ {panel} ─")
        for name, summary in commands.items():
            found = shown.index(f"│ {name} {summary}")
            assert place < found, "each in its group, one after the other"
            place = found


def test_no_arguments_is_a_question_for_help(capsys):
    main([])
    captured = capsys.readouterr()
    assert "simulate" in captured.out + captured.err


def test_help_imports_nothing_heavy():
    loaded = imported_by("from swimbladder.cli import main; main(['--help'])")
    assert not loaded.intersection(HEAVY)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command_imports_nothing_heavy(name):
    loaded = imported_by(f"from swimbladder.cli import main; main(['{name}', '--help'])")
    assert not loaded.intersection(HEAVY)
    groups = {f"swimbladder.cli.{module}" for module in cli.MODULES.values()}
    assert loaded & groups == {f"swimbladder.cli.{cli.MODULES[cli.PANELS[name]]}"}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_there_under_its_name(name, capsys):
    assert main([name, "--help"]) == 0
    assert f"swimbladder {name}" in capsys.readouterr().out


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"swimbladder {__version__}\n"


def test_the_module_runs_too():
    done = subprocess.run(
        [sys.executable, "-m", "swimbladder", "--version"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == f"swimbladder {__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulat"], "Did you mean 'simulate'"),
        (["vehicle", "shwo"], "No such command"),
        (["simulate"], "VEHICLE"),
        (["simulate", "feup-em", "--strat", "1"], "--strat"),
        (["simulate", "feup-em", "--seed", "x"], "--seed"),
        (["--nonsense"], "--nonsense"),
    ],
)
def test_a_wrong_command_line_is_exit_code_2_and_stdout_stays_empty(capsys, arguments, words):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err


@pytest.fixture
def with_command(monkeypatch):
    """Give the command line a command `test` that runs a function."""

    def give(function):
        def test() -> None:
            """Test."""
            function()

        monkeypatch.setattr("swimbladder.cli.check_us.test", test, raising=False)
        monkeypatch.setitem(cli.COMMANDS, "test", "Test.")
        monkeypatch.setitem(cli.PANELS, "test", "Check us")

    return give


def raising(error):
    def function():
        raise error

    return function


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InputError("the mass is negative", field="motion.dry_mass", remedy="Weigh it"), 2),
        (NoAnswerError("the loop is unstable"), 1),
    ],
)
def test_an_error_is_one_paragraph_on_stderr_and_its_exit_code(with_command, capsys, error, code):
    with_command(raising(error))
    assert main(["test"]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"error: {error}\n"


def test_a_message_is_not_taken_for_markup_and_not_broken_into_lines(with_command, capsys):
    error = InputError("x" * 300, field="setpoints[0].depth", value="[red]")
    with_command(raising(error))
    assert main(["test"]) == 2
    assert capsys.readouterr().err == f"error: {error}\n"


def test_an_interruption_is_exit_code_130_without_a_traceback(with_command, capsys):
    with_command(raising(KeyboardInterrupt()))
    assert main(["test"]) == 130
    assert "Traceback" not in capsys.readouterr().err


def test_a_defect_keeps_its_traceback(with_command):
    with_command(raising(ZeroDivisionError("a defect")))
    with pytest.raises(ZeroDivisionError, match="a defect"):
        main(["test"])


def test_a_command_can_end_with_a_code(with_command):
    with_command(raising(typer.Exit(1)))
    assert main(["test"]) == 1


class Colour(enum.Enum):
    RED = "red, in a sentence"


@dataclasses.dataclass
class Point:
    x: float
    y: np.ndarray


def test_json_is_one_object_of_plain_types(capsys):
    common.emit_json(
        {
            "nan": math.nan,
            "inf": -math.inf,
            "numpy": np.float64(0.1),
            "array": np.array([[1.0, np.nan]]),
            "truth": np.bool_(True),
            "count": np.int64(3),
            "pole": 1 - 2j,
            "reason": Colour.RED,
            "path": Path("a") / "b",
            "point": Point(1.0, np.array([2.0])),
            "pair": (1, None),
            "text": "ψ",
        }
    )
    captured = capsys.readouterr()
    assert captured.err == ""
    assert json.loads(captured.out) == {
        "nan": None,
        "inf": None,
        "numpy": 0.1,
        "array": [[1.0, None]],
        "truth": True,
        "count": 3,
        "pole": [1.0, -2.0],
        "reason": "red, in a sentence",
        "path": os.path.join("a", "b"),
        "point": {"x": 1.0, "y": [2.0]},
        "pair": [1, None],
        "text": "ψ",
    }


def test_json_refuses_what_has_no_place_in_it():
    with pytest.raises(TypeError, match="object has no place"):
        common.emit_json({"x": object()})


def test_progress_draws_nothing_where_there_is_no_terminal(capsys):
    with common.progress("working", 10, after_s=0.0) as advance:
        advance(5)
    captured = capsys.readouterr()
    assert captured.out + captured.err == ""


def test_progress_shows_a_bar_on_a_terminal_once_it_takes_long(monkeypatch):
    import io
    import time

    from rich.console import Console

    stream = io.StringIO()
    monkeypatch.setattr(common, "console", Console(file=stream, force_terminal=True, width=80))
    with common.progress("quick work", after_s=60.0):
        pass
    assert stream.getvalue() == ""
    with common.progress("slow work", 10, after_s=0.0) as advance:
        advance(5)
        time.sleep(0.3)
    assert "slow work" in stream.getvalue()


def test_a_quantity_of_an_option_takes_a_unit_and_names_the_option():
    assert quantity("150 cm", "m", "--start") == 1.5
    with pytest.raises(InputError, match=r"^--start: .*Give it in m\.$"):
        quantity("3 s", "m", "--start")
