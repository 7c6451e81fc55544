"""An Argo float from the command line: its configuration flown, and what cannot be done with it."""

import json
from pathlib import Path

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.io.config import load_mission
from tests.io.test_argo_config import BEHAVIOUR, CONFIG, meta, standard
from tests.io.test_argo_trajectory import RUNS, put


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "it.json").write_text(json.dumps(CONFIG))
    phases = ['kind = "park"\ndepth = 500\nduration = 86400', 'kind = "surface"\nduration = 60']
    (tmp_path / "own.toml").write_text(
        "schema_version = 1\n" + "".join(f"[[phases]]\n{phase}\n" for phase in phases)
    )
    meta(tmp_path, standard(CONFIG))
    put(tmp_path / "it_tech.nc", "Argo technical data", RUNS)
    p = np.arange(0.0, 4001.0, 20.0)
    table = np.column_stack([p, 1.5 + 14.0 * np.exp(-p / 600.0), 34.5 + 0.2 * np.exp(-p / 300.0)])
    header = "pressure_dbar,temperature_degC,salinity"
    np.savetxt("cast.csv", table, delimiter=",", fmt="%.4f", header=header, comments="")


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize("name", ["it.json", "7900001_meta.nc"])
def test_a_cycle_by_its_configuration(name, capsys) -> None:
    asked = ["mission", "deep-arvor", name, "--cast", "cast.csv", "--out", "out", "--json"]
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
@pytest.mark.parametrize("deepest", ["3500", "2000"])
def test_a_configuration_is_written_as_it_was_read(deepest) -> None:
    """The mission of the configuration that is written is that of the one that was read."""
    ice = {"CONFIG_PG06_SlowDownPressure": "150", "CONFIG_PG09_PumpActionDuration": "500"}
    names = CONFIG | BEHAVIOUR | ice | {"CONFIG_PM09_ProfileDepth": deepest}
    names |= {"CONFIG_PT03_PumpMaxDurationDuringAscent": "1120"}
    Path("it.json").write_text(json.dumps(names))
    asked = ["mission", "deep-arvor", "it.json", "--cast", "cast.csv", "--config", "--out", "out"]
    assert main(asked) == 0
    written = json.loads(Path("out/argo-config.json").read_text())
    for name in names:
        if name not in (
            "CONFIG_PM01_CyclePeriod",  # by another mean speed, it stays as long
            "CONFIG_PT23_AverageAscentSpeed",
            "CONFIG_PT18_AverageDescentSpeed",
            "CONFIG_PG15_OilVolumeMinForGroundingDetection",  # not read
        ):
            assert float(written[name]) == pytest.approx(float(names[name]), rel=2e-3), name
    read, again = load_mission("it.json"), load_mission("out/argo-config.json")
    assert len(again.phases) == len(read.phases)
    assert again.grounding.model_dump() == pytest.approx(read.grounding.model_dump())
    assert again.ice.model_dump() == pytest.approx(read.ice.model_dump())
    for one, other in zip(read.phases, again.phases, strict=True):
        assert other.depth == pytest.approx(one.depth)
        assert other.duration == pytest.approx(one.duration)
        assert other.grounding == one.grounding
        assert dict(other.parameters) == pytest.approx(dict(one.parameters))
    assert main([*asked[:5], "--out", "out"]) == 0
    assert not Path("out/argo-config.json").exists()  # that of another flight


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (["mission", "example-float", "it.json"], "give it a [controller] of this law"),
        (["mission", "feup-em", "it.json"], "it.json, phases[0].law: this law commands a volume"),
        (["mission", "feup-em", "7900001_meta.nc"], "meta.nc, phases[0].law: this law commands"),
        (
            ["mission", "example-float", "own.toml", "--config"],
            "--config: no mission that an Argo float",
        ),
        (["simulate", "feup-em", "it.json"], "it.json, phases: the mission has phases"),
        (
            ["identify", "it_tech.nc", "--vehicle", "deep-arvor", "--cast", "cast.csv"],
            "it_tech.nc, DATA_TYPE: this netCDF file is none of the type Argo trajectory",
        ),
        (["stability", "deep-arvor"], "controller.law: it waits for what the vehicle does"),
        (["tune", "deep-arvor", "--law", "argo"], "this law is not tuned"),
    ],
)
def test_what_cannot_be_done_is_refused(asked, says, capsys) -> None:
    assert main([*asked, "--out", "out"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert says in said
    assert "Traceback" not in said
