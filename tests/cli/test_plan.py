"""The command `plan`: its files, its JSON and its refusals."""

import json

import pytest

from swimbladder.cli import main
from swimbladder.io.config import load_mission
from swimbladder.io.logs import read_log
from tests.docs.test_reference import check, rows


def test_it_writes_a_log_a_mission_and_a_picture(capsys, tmp_path):
    out = tmp_path / "planned"
    assert main(["plan", "feup-em", "--step", "1.5:3 m", "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    columns, keys = rows("files-written.md", "plan")
    check(keys, told)
    assert told["least_time_s"] == pytest.approx(14.4)
    names = ["mission.toml", "plan.csv", "plan.json", "plan.png", "report.html"]
    assert sorted(p.name for p in out.iterdir()) == names
    header = (out / "plan.csv").read_text().splitlines()[0].split(",")
    assert set(header) == set(columns) - {"reference_volume_m3"}
    log = read_log(out / "plan.csv")
    assert log.depth[-1] == pytest.approx(3.0, abs=1e-8)
    mission = load_mission(out / "mission.toml")
    assert mission.start_depth == 1.5
    assert mission.setpoints[-1].depth == pytest.approx(3.0, abs=1e-8)
    assert json.loads((out / "plan.json").read_text()).keys() == told.keys() - {"files"}


def test_an_interruption_says_how_to_go_on_and_writes_nothing(capsys, tmp_path, monkeypatch):
    def stopped(*_given, **_more):
        raise KeyboardInterrupt

    monkeypatch.setattr("swimbladder.design.planning.run.search_least", stopped)
    assert main(["plan", "feup-em", "--step", "1.5:3", "--out", str(tmp_path / "out")]) == 130
    assert "begins anew" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--step", "1.5"], 2, "a colon between"),
        (["--step", "1.5:3", "--supply", "12 kg"], 2, "--supply"),
        (["--step", "1.5:3", "--goal", "tim"], 2, "Choose from time"),
        (["--step", "1.5:3", "--goal", "energy"], 1, "torque constant"),
        (["--step", "1.5:95"], 1, "the stroke"),
        (["--step", "1.5:86"], 1, "no plan that the vehicle would follow"),
    ],
)
def test_refusals_name_what_is_wrong_and_write_nothing(capsys, tmp_path, options, code, words):
    assert main(["plan", "feup-em", *options, "--out", str(tmp_path / "out")]) == code
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
