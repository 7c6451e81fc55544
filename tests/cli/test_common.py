"""What the commands share: how each of them ends."""

import json

import pytest

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
