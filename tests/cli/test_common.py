"""What the commands share: how each of them ends."""

import json
import signal
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest
from rich.table import Table

from swimbladder.cli import common, main
from swimbladder.errors import InputError, NoAnswerError


def ends(error):
    def command():
        raise error

    return command


@pytest.mark.parametrize(
    ("error", "code", "field"),
    [
        (NoAnswerError("it cannot float"), 1, None),
        (InputError("no depth", field="--depth", value="x"), 2, "--depth"),
        (KeyboardInterrupt(), 130, None),
        (SystemExit(130), 130, None),
    ],
)
def test_a_command_that_ends_early_says_why_as_json(capsys, error, code, field):
    assert common.run(ends(error), json=True) == code
    said = capsys.readouterr()
    told = json.loads(said.out)
    assert told["exit_code"] == code
    assert told["field"] == field
    assert told["error"] in " ".join(said.err.split())
    assert common.run(ends(error)) == code
    assert capsys.readouterr().out == ""


def test_an_answer_that_is_no_is_printed_once(capsys):
    def command():
        common.emit_json({"stable": False})
        raise NoAnswerError("unstable")

    assert common.run(command, json=True) == 1
    assert json.loads(capsys.readouterr().out) == {"stable": False}


def test_every_command_with_json_says_on_stdout_what_is_wrong(capsys):
    assert main(["plan", "no-such-vehicle", "--step", "1:2", "--json"]) == 2
    said = capsys.readouterr()
    assert json.loads(said.out)["error"] in " ".join(said.err.split())


@pytest.mark.parametrize(
    ("typed", "field", "what"),
    [
        (["mission", "example-float", "m.toml", "--cycles", "0"], "--cycles", "greater than"),
        (["size", "--cycles", "x"], "--cycles", "integer"),
        (["ballast", "example-eh", "--bananas"], "--bananas", "No such option"),
        (["ballast"], "vehicle", "Missing argument"),
        (["no-such-command"], None, "No such command"),
        (["simulate", "feup-em", "--duration"], "--duration", "argument"),
    ],
)
def test_a_command_line_that_is_wrong_is_said_as_json(capsys, typed, field, what):
    assert main([typed[0], "--json", *typed[1:]]) == 2
    told = json.loads(capsys.readouterr().out)
    assert what in told["error"]
    assert (told["exit_code"], told["file"], told["field"]) == (2, None, field)
    assert main(typed) == 2
    assert capsys.readouterr().out == ""


def test_options_about_completion_stand_in_the_help_of_the_whole(capsys):
    assert main(["--help"]) == 0
    assert "--install-completion" in capsys.readouterr().out


@pytest.mark.parametrize("error", [KeyboardInterrupt(), InputError("no space left")])
def test_what_is_kept_is_said_and_nothing_is_not_kept(capsys, tmp_path, error):
    folder = tmp_path / ".out-parts"
    (folder / "a").mkdir(parents=True)
    with pytest.raises(type(error)), common.kept(folder):
        raise error
    assert not folder.exists()
    assert capsys.readouterr().err == ""
    folder.mkdir()
    (folder / "done.json").write_text("{}", encoding="utf-8")
    with pytest.raises(type(error)), common.kept(folder):
        raise error
    assert (folder / "done.json").exists()
    said = "".join(capsys.readouterr().err.split())
    assert "".join(str(folder).split()) in said
    assert "thesamecommandagaingoeson" in said


NUMBERS = [f"{12345678 + k}.{k:04d}" for k in range(12)]  # 168 columns with the spaces between


def printed(**options):
    """What stands in a file after a table of long numbers and a text."""
    table = Table(box=None, pad_edge=False)
    for k in range(len(NUMBERS)):
        table.add_column(f"number {k}", justify="right")
    table.add_column("words")
    table.add_row(*NUMBERS, "what is said of them, in so many words that a line is long")
    file = StringIO()
    common.Output(file=file, **options).print(table)
    return file.getvalue()


@pytest.mark.parametrize("width", [30, 80, 100])
def test_no_number_of_a_table_is_cut_in_a_terminal(width):
    text = printed(force_terminal=True, color_system=None, width=width)
    assert all(number in text for number in NUMBERS)
    assert chr(0x2026) not in text  # the dots that rich ends what it cuts in
    assert not any("that a line is long" in line for line in text.splitlines())  # words do wrap


def test_in_a_pipe_a_row_of_a_table_is_a_line(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    rows = printed().splitlines()
    assert len(rows) == 2
    assert rows[1].split()[: len(NUMBERS)] == NUMBERS
    assert rows[1].rstrip().endswith("that a line is long")
    monkeypatch.setenv("COLUMNS", "100")  # as asked for: words wrap, and numbers are whole
    text = printed()
    assert len(text.splitlines()) > 2
    assert all(number in text for number in NUMBERS)


def test_a_reader_that_has_seen_enough_is_no_answer():
    """As of `swimbladder vehicle list | head -1`: 141 as shells have it, not the 1 that says no."""
    with subprocess.Popen(
        [Path(sys.executable).parent / "swimbladder", "vehicle", "list"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as command:
        command.stdout.close()
        said = command.stderr.read()
        assert command.wait() == 141
    assert "Traceback" not in said


@pytest.mark.parametrize("made_of_it", [AttributeError("no data"), SystemExit(1)])
def test_what_a_library_makes_of_an_interruption_is_one(made_of_it, monkeypatch):
    def ends():
        raise made_of_it

    monkeypatch.setattr(common, "_stopped", [signal.SIGINT])
    assert common.run(ends) == 130
    monkeypatch.setattr(common, "_stopped", [signal.SIGTERM])
    assert common.run(ends) == 143
