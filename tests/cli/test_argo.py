"""An Argo float from the command line: its configuration flown, and what cannot be done with it."""

import json

import numpy as np
import pytest

from swimbladder.cli import main
from tests.io.test_argo_config import CONFIG


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "it.json").write_text(json.dumps(CONFIG))
    p = np.arange(0.0, 4001.0, 20.0)
    table = np.column_stack([p, 1.5 + 14.0 * np.exp(-p / 600.0), 34.5 + 0.2 * np.exp(-p / 300.0)])
    header = "pressure_dbar,temperature_degC,salinity"
    np.savetxt("cast.csv", table, delimiter=",", fmt="%.4f", header=header, comments="")


@pytest.mark.usefixtures("files")
def test_a_cycle_by_its_configuration(capsys) -> None:
    asked = ["mission", "deep-arvor", "it.json", "--cast", "cast.csv", "--out", "out", "--json"]
    assert main(asked) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [law["law"] for law in answer["laws"]] == ["argo"] * 3
    assert answer["laws"][0]["parameters"]["ascent_interval"] == 180.0
    events = np.genfromtxt("out/events.csv", delimiter=",", names=True, dtype=None, encoding=None)
    pumps = events[(events["what"] == "pump") & (events["depth_m"] > 20.0)]
    assert 10 < len(pumps) < 60
    checks = np.diff(pumps["time_s"]) / 180.0  # every 3 min, and nowhere else
    assert checks == pytest.approx(np.round(checks), abs=1e-6)


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (["mission", "example-float", "it.json"], "give it a [controller] of this law"),
        (["mission", "feup-em", "it.json"], "it.json, phases[0].law: this law commands a volume"),
        (["simulate", "feup-em", "it.json"], "it.json, phases: the mission has phases"),
        (["stability", "deep-arvor"], "controller.law: it waits for what the vehicle does"),
        (["tune", "deep-arvor", "--law", "argo"], "this law is not tuned"),
    ],
)
def test_what_cannot_be_done_is_refused(asked, says, capsys) -> None:
    assert main([*asked, "--out", "out"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert says in said
    assert "Traceback" not in said
