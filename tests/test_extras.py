"""Without the library of an extra: one line that names the extra, in Python and as a command."""

import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

import swimbladder as sb
from scripts import dist
from swimbladder.cli import main
from swimbladder.errors import InputError
from swimbladder.vehicle.plugins import optional

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text("utf-8"))
LIBRARIES = {extra: library for extra, (library, _) in dist.EXTRAS.items()}


@dataclass
class Folder:
    """A folder with a log and a mission, and the functions that need the extras."""

    path: Path

    def cluster(self) -> object:
        """Let dask do the work of a campaign."""
        return sb.Workers(executor="dask")

    def parquet(self) -> object:
        """Read a log in Parquet."""
        return sb.read_log(self.path / "log.parquet")

    def posterior(self) -> object:
        """Draw from a posterior."""
        return sb.identify([sb.read_log(self.path / "log.csv")], "feup-em", posterior=1)

    def serial(self) -> object:
        """Speak to a board."""
        vehicle = sb.load_vehicle("feup-em").replace({"supervisor.time_limit": "2 h"})
        return sb.board(vehicle, "COM1", out=self.path / "out")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    dist.give_files(tmp_path)
    monkeypatch.chdir(tmp_path)
    return Folder(tmp_path)


def hide(library, monkeypatch):
    """Let a library be as if it were not installed."""
    for name in [library, *(n for n in sys.modules if n.startswith(f"{library}."))]:
        monkeypatch.setitem(sys.modules, name, None)


def test_these_are_the_extras():
    extras = PROJECT["project"]["optional-dependencies"].keys() - {"dev", "docs"}
    assert extras == LIBRARIES.keys()


@pytest.mark.parametrize("extra", LIBRARIES)
def test_a_command_says_in_one_line_what_to_install(extra, folder, monkeypatch, capsys):
    hide(LIBRARIES[extra], monkeypatch)
    assert main([*dist.EXTRAS[extra][1].split(), "--out", "out"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    *before, line = said.err.splitlines()
    assert not [text for text in before if "error" in text]
    assert f"needs the library {LIBRARIES[extra]}, which is not installed" in line
    assert f'pip install "swimbladder[{extra}]"' in line
    assert not (folder.path / "out").exists()


@pytest.mark.parametrize("extra", LIBRARIES)
def test_a_function_says_in_one_line_what_to_install(extra, folder, monkeypatch):
    hide(LIBRARIES[extra], monkeypatch)
    with pytest.raises(InputError) as caught:
        getattr(folder, extra)()
    assert caught.value.exit_code == 2
    assert f'pip install "swimbladder[{extra}]"' in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (folder.path / "out").exists()


@pytest.mark.parametrize("library", LIBRARIES.values())
def test_what_is_installed_is_imported(library):
    assert optional(library, "extra", "this").__name__ == library
