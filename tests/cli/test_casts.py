"""The options that say how to read a cast: the same in every command that takes one."""

import inspect

import gsw
import numpy as np
import pytest

from swimbladder.cli import command_of, main
from swimbladder.cli.reading import CastReading

NAMES = "ballast campaign energy mission size simulate tune compare-laws"
COMMANDS = {name: command_of(name) for name in NAMES.split()}
SAMPLED = ("simulate", "tune", "compare-laws")
OPTIONS = {
    "--cast-column": "salinity=S",
    "--cast-where": "dive=1",
    "--cast-format": "form.toml",
    "--cast-profile": "2",
    "--latitude": "0",
    "--longitude": "0",
    "--salinity": "0",
    "--inversions": "keep",
}
MISSION = """
schema_version = 1
name = "once"
[[phases]]
kind = "descend"
depth = "100 m"
[[phases]]
kind = "surface"
duration = "10 min"
"""


def words(command, tmp_path):
    task = tmp_path / "task.toml"
    task.write_text(MISSION)
    flown = [str(task)] if command in ("campaign", "mission") else []
    vehicle = "feup-em" if command in SAMPLED else "example-float"
    return [command, vehicle, *flown, "--out", str(tmp_path / "out")]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_all_of_them_alike(command):
    assert set(CastReading.named().values()) == {"--cast", *OPTIONS}
    taken, first = (
        inspect.signature(one).parameters for one in (COMMANDS[command], COMMANDS["size"])
    )
    for option in OPTIONS:
        name = option[2:].replace("-", "_")
        ours, theirs = (one[name].annotation.__metadata__[0] for one in (taken, first))
        assert vars(ours) == vars(theirs)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("option", OPTIONS)
def test_none_of_them_is_taken_in_silence_without_a_cast(capsys, tmp_path, command, option):
    assert main([*words(command, tmp_path), option, OPTIONS[option]]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"{option}: it says how to read a cast, and there is none" in said
    assert "Give --cast too" in said
    assert not (tmp_path / "out").exists()


def test_runs_are_no_cast(capsys, tmp_path):
    runs = ["energy", "--fit", str(tmp_path / "runs.csv"), "--out", str(tmp_path / "out")]
    assert main([*runs, "--salinity", "0"]) == 2
    assert "--salinity: it says how to read a cast" in " ".join(capsys.readouterr().err.split())


def asked(path, **options):
    place = options.pop("place", None)
    return CastReading(cast=path, **options).casts(place)[0]


def test_the_equator_is_a_latitude_and_stands_over_that_of_the_mission(tmp_path):
    depth = np.arange(0.0, 500.0, 5.0)
    file = tmp_path / "cast.csv"
    rows = [f"{z},{20.0 * np.exp(-z / 200.0):.5f},35" for z in depth]
    file.write_text("\n".join(["depth_m,temperature_degC,salinity", *rows]) + "\n")
    assert asked(file, latitude="0", place=60.0).latitude == 0.0
    assert asked(file, place=60.0).latitude == 60.0
    at = asked(file, latitude="0 deg", longitude="-30", place=60.0)
    assert at.pressure[-1] == pytest.approx(gsw.p_from_z(-depth[-1], 0.0), rel=2e-3)
    assert at.pressure[-1] < asked(file, place=60.0).pressure[-1] * 0.998  # gravity is 0.4 % less


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_the_table_that_a_format_has(capsys, command):
    assert main([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert "[log]" in said  # rich takes what it does not know for markup
    assert "[[" not in said


def test_several_casts_are_refused_where_one_is_taken(capsys, tmp_path):
    words_of = [*words("mission", tmp_path), "--cast", "cast.csv", "--cast-where", "dive=1,2"]
    assert main(words_of) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "--cast-where: these are several casts, and one is taken" in said
