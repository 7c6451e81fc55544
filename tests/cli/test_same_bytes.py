"""Two runs of one command write the same bytes, whenever and in whatever order hashes come."""

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from swimbladder.cli import main

MISSION = """schema_version = 1
cycles = 2
[[phases]]
kind = "descend"
depth = "200 m"
[[phases]]
kind = "surface"
duration = "10 min"
"""
COMMANDS = {
    "mission": ["mission", "example-float", "task.toml", "--seed", "3", "--netcdf", "--plot"],
    "campaign": ["campaign", "example-float", "task.toml", "--floats", "3"],
    "simulate": ["simulate", "feup-em", "--duration", "30", "--seed", "3", "--netcdf", "--plot"],
}


@pytest.mark.parametrize(
    "name",
    ["simulate", *(pytest.param(n, marks=pytest.mark.prove) for n in ("mission", "campaign"))],
)
def test_two_runs_write_the_same_bytes(name, tmp_path):
    answers = []
    for seed in ("1", "2"):
        folder = tmp_path / seed
        folder.mkdir()
        (folder / "task.toml").write_text(MISSION)
        done = subprocess.run(
            [sys.executable, "-m", "swimbladder", *COMMANDS[name], "--out", "out", "--json"],
            cwd=folder,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        )
        written = [p for p in (folder / "out").rglob("*") if p.is_file()]
        files = {p.relative_to(folder): p.read_bytes() for p in written}
        assert {p.parts[:2] for p in files} == {
            Path(name).parts for name in json.loads(done.stdout)["files"]
        }
        answers.append((done.stdout, files))
    assert answers[0] == answers[1]


def test_the_time_of_writing_is_the_mission_s_begin_or_what_the_environment_says(
    tmp_path, monkeypatch, capsys
):
    (tmp_path / "task.toml").write_text(MISSION)
    monkeypatch.chdir(tmp_path)
    words = [*COMMANDS["mission"], "--begin", "2026-03-01T13:00:00+01:00", "--out", "out"]
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    for epoch, created, stamp in (
        (None, "2026-03-01T12:00:00+00:00", "20260301T120000"),
        ("86400", "1970-01-02T00:00:00+00:00", "19700102T000000"),
    ):
        if epoch is not None:
            monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
        assert main(words) == 0
        assert json.loads((tmp_path / "out/float.json").read_text())["created"] == created
        with h5py.File(tmp_path / "out/mission.nc") as file:
            assert str(file.attrs["date_created"]) == stamp
            assert str(file.attrs["start_date"]) == "20260301T120000"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    capsys.readouterr()
    assert main(words) == 2
    assert "SOURCE_DATE_EPOCH: not a number of seconds" in capsys.readouterr().err
