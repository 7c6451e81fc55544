"""What TAB offers, by the environment variables that a shell's completion sets."""

import os
import shutil
import subprocess
import sys
from typing import get_args

import pytest
import typer

from swimbladder.cli import COMMANDS, _app, main
from swimbladder.cli.completion import OFFERS, with_offers
from swimbladder.control.registry import LAWS
from swimbladder.design.energy.fit import PowerAt
from swimbladder.design.planning.run import ARRIVALS
from swimbladder.design.planning.run import GOALS as PLAN_GOALS
from swimbladder.design.sizing.run import Least
from swimbladder.design.tuning.gains import GOALS as TUNE_GOALS
from swimbladder.estimation.comparison.record import DRIVES
from swimbladder.estimation.motion.problem import LAWS as DRAG_LAWS
from swimbladder.estimation.motion.result import ProcessNoise
from swimbladder.io.casts import Inversions
from swimbladder.io.log_formats import FORMATS
from swimbladder.io.presets import preset_names
from swimbladder.io.vehicle_file import KINDS
from swimbladder.jobs import EXECUTORS


@pytest.fixture
def offered(tmp_path, monkeypatch, capsys):
    """A function that returns what TAB offers behind a line, in a folder with some files."""
    (tmp_path / "pool/day").mkdir(parents=True)
    (tmp_path / "empty").mkdir()
    for name in ("mine.toml", "log.csv", "cast.nc", "page.html", ".hidden.toml", "pool/day/a.csv"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)

    def ask(line):
        monkeypatch.setenv("_SWIMBLADDER_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", f"swimbladder {line}")
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" "))))
        assert main([]) == 0
        return capsys.readouterr().out.split()

    return ask


def test_commands_and_options(offered):
    assert offered("sim") == ["simulate"]
    assert offered("vehicle ") == ["list", "show", "new", "set"]
    assert "--step" in offered("simulate feup-em --st")


def test_vehicles_are_presets_files_and_folders(offered):
    assert offered("simulate ") == [*preset_names(), "empty/", "mine.toml", "pool/"]
    assert offered("simulate feu") == offered("vehicle show feu") == ["feup-em"]
    assert offered("identify log.csv --vehicle m") == ["mine.toml"]
    assert offered("simulate .h") == [".hidden.toml"]
    assert offered("simulate no-such") == []


def test_laws_kinds_and_formats(offered):
    assert offered("tune feup-em --law ") == offered("firmware feup-em --law ") == LAWS.names()
    assert offered("tune feup-em --law pos") == ["position-pid", "position-observer"]
    assert offered("compare-laws feup-em --laws adrc,cas") == ["adrc,cascade"]
    assert offered("vehicle new x.toml --kind ") == list(KINDS)
    assert offered("compare log.csv --log-format n") == FORMATS.names()


def test_files_are_of_the_type_that_is_read(offered):
    assert offered("identify ") == ["cast.nc", "empty/", "log.csv", "pool/"]
    assert offered("identify po") == ["pool/day/a.csv"]  # past folders that are alone
    assert offered("identify log.csv ca") == ["cast.nc"]
    assert offered("identify em") == ["empty/"]
    assert offered("mission feup-em m") == ["mine.toml"]
    assert offered("simulate feup-em --out ") == []  # the shell's own


def test_words_are_those_that_are_taken():
    taken = {
        "compare --drive": DRIVES,
        "plan --arrive": ARRIVALS,
        "plan --goal": PLAN_GOALS,
        "tune --goal": TUNE_GOALS,
        "--drag": DRAG_LAWS,
        "--executor": EXECUTORS,
        "--inversions": get_args(Inversions),
        "size --goal": get_args(Least),
        "--power-at": get_args(PowerAt),
        "--process-noise": get_args(ProcessNoise),
        "identify --drive": [name for name in DRIVES if name != "setpoint"],
    }
    assert OFFERS["words"] == {option: list(words) for option, words in taken.items()}


def test_words_are_offered_where_their_command_takes_them(offered):
    assert offered("plan feup-em --goal ") == list(PLAN_GOALS)
    assert offered("tune feup-em --goal q") == ["quiet"]
    assert offered("campaign example-float mine.toml --executor d") == ["dask"]


def leaves(group, name=""):
    for own, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, own)
        else:
            yield f"{name} {own}".strip(), command


def test_what_is_listed_is_an_option_or_a_word_of_a_command():
    group = with_offers(typer.main.get_command(_app(set(COMMANDS), before=True)))
    met = set()
    for name, command in leaves(group):
        for parameter in command.params:
            found = {parameter.opts[0], parameter.metavar, f"{name} {parameter.opts[0]}"}
            met |= found
            if found & {"VEHICLE", "BODY", "LAW", "LAW,LAW", "KIND", "FORMAT"}:
                assert parameter.shell_complete(None, ""), (name, parameter.opts)
    assert OFFERS["files"].keys() | OFFERS["words"].keys() <= met


def test_bash_completes_once_it_is_installed(tmp_path):
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("there is no bash")
    # without the look at the process above, which is no shell here
    own = {"HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    call = f'"{sys.executable}" -m swimbladder "$@"'
    (tmp_path / "swimbladder").write_text(f"#!{bash}\n{call}\n")
    (tmp_path / "swimbladder").chmod(0o755)
    env = os.environ | own | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    subprocess.run(["swimbladder", "--install-completion", "bash"], env=env, check=True)
    line = "COMP_WORDS=(swimbladder vehicle show feu); COMP_CWORD=3"
    script = (
        f"source ~/.bashrc; {line}; _swimbladder_completion swimbladder; echo ${{COMPREPLY[*]}}"
    )
    done = subprocess.run([bash, "-c", script], env=env, capture_output=True, text=True, check=True)
    assert done.stdout == "feup-em\n"


@pytest.mark.parametrize(
    ("shell", "said"), [("zsh", """_arguments '*: :(("feup-em"))'\n"""), ("fish", "feup-em\n")]
)
def test_zsh_and_fish_are_offered_the_same(shell, said, monkeypatch, capsys):
    monkeypatch.setenv("_SWIMBLADDER_COMPLETE", f"complete_{shell}")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", "swimbladder vehicle show feu")
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
    assert main([]) == 0
    assert capsys.readouterr().out == said
