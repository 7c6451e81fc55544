"""`swimbladder mission` from the outside: files, exit codes, JSON, and a kill in the middle."""

import datetime
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.sim.mission.words import _percent
from tests.quoted import numbers

MISSION = """
schema_version = 1
name = "a short dive"

[[phases]]
kind = "descend"
depth = "60 m"
tolerance = "5 m"

[[phases]]
kind = "park"
depth = "60 m"
tolerance = "20 m"
duration = "30 min"

[[phases]]
kind = "profile"
depth = "15 m"
tolerance = "5 m"

[[phases]]
kind = "surface"
duration = "10 min"
"""


@pytest.fixture
def task(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mission.toml"
    path.write_text(MISSION)
    return path


def test_files_json_and_sentence(task, capsys):
    code = main(
        [
            "mission",
            "example-float",
            str(task),
            "--cycles",
            "3",
            "--plot",
            "--netcdf",
            "--out",
            "flown",
            "--json",
        ]
    )
    answer = json.loads(capsys.readouterr().out)
    assert code == 0
    assert answer["cycles"] == 3
    assert float(answer["battery_cycles"]) in numbers(answer["sentence"])
    assert answer["energy_residue"] < 1e-3
    for path in answer["files"]:
        assert os.path.getsize(path) > 0
    with open("flown/cycles.csv") as file:
        assert len(file.readlines()) == 4
    energy = np.genfromtxt("flown/trajectory.csv", delimiter=",", names=True)["energy_J"]
    assert energy[-1] == pytest.approx(answer["drawn_J"], rel=1e-9)


def test_og1_and_the_float_for_lagrangian_tools(task, capsys):
    import xarray

    assert (
        main(
            [
                "mission",
                "example-float",
                str(task),
                "--netcdf",
                "--out",
                "flown",
                "--begin",
                "2026-03-01T12:00:00Z",
            ]
        )
        == 0
    )
    capsys.readouterr()
    with xarray.open_dataset("flown/mission.nc", decode_times=False) as data:
        assert data.sizes["N_MEASUREMENTS"] == data.TIME.size
        assert float(data.TIME[0]) == 1772366400.0
        assert data.attrs["featureType"] == "trajectory"
        assert "OG-1.0" in data.attrs["Conventions"]
        assert data.DEPTH.attrs["standard_name"] == "depth"
        assert data.PHASE.attrs["phase_vocabulary"].endswith("phase.md")
    with xarray.open_dataset("flown/mission.nc") as data:
        assert {1, 2, 3, 4} <= set(np.unique(data.PHASE.values[~np.isnan(data.PHASE.values)]))
        assert str(data.TIME.values[0]).startswith("2026-03-01T12:00")
    config = json.loads(Path("flown/float.json").read_text())
    values = {item["name"]: item["value"] for item in config["parameters"]}
    assert set(values) == {
        "cycle_duration",
        "life_expectancy",
        "parking_depth",
        "profile_depth",
        "vertical_speed",
    }
    assert values["parking_depth"] == 60.0
    table = np.genfromtxt("flown/vertical-speed.csv", delimiter=",", names=True)
    rising = table["rising_m_s"][np.isfinite(table["rising_m_s"])]
    # as its kernel climbs: the layers' thickness over the sum of their times
    assert values["vertical_speed"] == pytest.approx(1.0 / np.mean(1.0 / rising), rel=1e-9)
    _as_virtualfleet_reads_it(config)


# Of VirtualFleet 0.5.3: the parameters that its default configuration has, with their units.
VIRTUAL_FLEET = {
    "cycle_duration": ("hours", float, "CONFIG_CycleTime_hours"),
    "life_expectancy": ("cycle", int, "CONFIG_MaxCycles_NUMBER"),
    "parking_depth": ("m", float, "CONFIG_ParkPressure_dbar"),
    "profile_depth": ("m", float, "CONFIG_ProfilePressure_dbar"),
    "vertical_speed": ("m/s", float, ""),
}


def _as_virtualfleet_reads_it(config):
    """What FloatConfiguration of VirtualFleet 0.5.3 and the schema beside it ask of a file.

    It was read by that release itself as well, which takes 600 MB to install. ArgoParticle keeps
    hours, depths and cycles in int32, which cuts off the rest.
    """
    assert set(config) >= {"created", "version", "name", "parameters"}
    assert config["version"] == "2.0"
    assert datetime.datetime.fromisoformat(config["created"]).utcoffset() == datetime.timedelta()
    assert [item["name"] for item in config["parameters"]] == [*VIRTUAL_FLEET]
    for item in config["parameters"]:
        assert set(item) == {"name", "value", "description", "meta"}
        unit, kind, key = VIRTUAL_FLEET[item["name"]]
        assert item["meta"] == {"unit": unit, "dtype": kind.__name__, "techkey": key}
        assert isinstance(item["description"], str)
        assert type(item["value"]) is kind  # it casts to this
        if item["name"] != "vertical_speed":
            assert item["value"] == np.int32(item["value"]) > 0


def test_a_mission_that_only_comes_up_is_one(task, capsys):
    task.write_text("""schema_version = 1
start_depth = "200 m"
[[phases]]
kind = "surface"
duration = "10 min"
""")
    assert main(["mission", "example-float", str(task), "--out", "flown"]) == 0
    capsys.readouterr()
    values = {
        item["name"]: item["value"]
        for item in json.loads(Path("flown/float.json").read_text())["parameters"]
    }
    assert values["parking_depth"] == values["profile_depth"] == 200.0


def test_what_cannot_be_met_is_said_before_flying(task, capsys):
    text = MISSION.replace('depth = "60 m"', 'depth = "2500 m"')
    task.write_text(text)
    assert main(["mission", "example-float", str(task), "--out", "flown"]) == 1
    assert "500 m below the 2000 m" in capsys.readouterr().err
    assert not os.path.exists("flown")


def test_set_points_are_for_simulate(task, capsys):
    task.write_text("""schema_version = 1
start_depth = 1
duration = 10
[[setpoints]]
time = 0
depth = 2
""")
    assert main(["mission", "example-float", str(task)]) == 2
    assert "swimbladder simulate" in " ".join(capsys.readouterr().err.split())


def test_a_hold_that_does_not_hold_is_exit_1(task, capsys, monkeypatch):
    """The gain of the depth is a fifth of the vehicle's own."""
    task.write_text("""schema_version = 1
[[phases]]
kind = "hold"
depth = "3 m"
tolerance = "0.2 m"
speed = "5 cm/s"
duration = "10 min"
parameters = { k_pz = "-0.02 dm3/m" }
""")
    drawn = []
    monkeypatch.setattr("swimbladder.show.static.save", lambda figure, _: drawn.append(figure))
    code = main(["mission", "feup-em", str(task), "--out", "flown", "--plot", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert code == 1
    (note,) = drawn[0].panels[-1].marks  # where others have energy or battery: no line at 0 kJ
    assert "electrical power is not known" in " ".join(note.text.split())
    assert answer["held"]["hold"]["share"] < 0.9
    assert any("is no holding" in reason for reason in answer["reasons"])
    assert answer["energy_unknown"]
    assert answer["sinks_J"] is None
    assert answer["drawn_J"] is None
    table = np.genfromtxt("flown/trajectory.csv", delimiter=",", names=True)
    inside = np.abs(table["depth_m"] - 3.0) <= 0.2
    first = int(np.argmax(inside))
    dt, middle = np.diff(table["time_s"]), 0.5 * (inside[1:].astype(float) + inside[:-1])
    share = np.sum((dt * middle)[first:]) / np.sum(dt[first:])
    assert answer["held"]["hold"]["share"] == pytest.approx(share, abs=0.03)
    farthest = np.max(np.abs(table["depth_m"] - 3.0)[first:])
    assert answer["held"]["hold"]["farthest"] == pytest.approx(farthest, rel=1e-6)


def test_a_hold_that_cannot_be_is_refused_and_leaves_nothing(task, capsys):
    """A hull that gives way more than the water runs away between two samples."""
    task.write_text("""schema_version = 1
[[phases]]
kind = "hold"
depth = "30 m"
tolerance = "1 m"
check_interval = "60 s"
duration = "1 h"
law = "rate"
[[phases]]
kind = "surface"
duration = "10 min"
law = "rate"
""")
    assert main(["mission", "feup-em", str(task), "--out", "flown"]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "sample every" in said
    assert "is kept in" not in said
    assert not os.path.exists("flown")


def test_a_band_that_reaches_to_the_surface_is_said_to_say_nothing(task, capsys):
    task.write_text("""schema_version = 1
[[phases]]
kind = "descend"
depth = "4 m"
[[phases]]
kind = "surface"
duration = "5 min"
""")
    main(["mission", "example-float", str(task), "--out", "flown", "--json"])
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert sum(4.0 in numbers(note) for note in notes) == 1


def test_pictures_of_an_earlier_flight_do_not_stay(task, capsys):
    words = ["mission", "example-float", str(task), "--out", "flown"]
    assert main([*words, "--plot", "--netcdf"]) == 0
    Path("flown/mine.txt").write_text("kept")
    assert main(words) == 0
    capsys.readouterr()
    left = {path.name for path in Path("flown").iterdir()}
    assert not left & {"mission.nc", "mission.png"}
    assert "mine.txt" in left


def test_a_share_is_cut_off_rather_than_rounded():
    assert [_percent(share) for share in (1.0, 0.99996, 0.9, 0.8999, 0.29)] == [
        "100",
        "99.9",
        "90",
        "89.9",
        "29",
    ]


def test_a_first_depth_that_is_missed_is_not_said_to_be_reached(task, capsys):
    late = 'depth = "60 m"\ntolerance = "5 m"\ntimeout = "900 s"\n'
    task.write_text(MISSION.replace('depth = "60 m"\ntolerance = "5 m"\n', late, 1))
    code = main(["mission", "example-float", str(task), "--out", "flown", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert code == 1
    assert answer["missed"]["descend"] == 1
    assert answer["arrival_s"] is None
    assert 60.0 in numbers(answer["sentence"])
    assert any("descend" in reason and 1.0 in numbers(reason) for reason in answer["reasons"])
    assert os.path.exists("flown/mission.json")


def test_a_battery_that_does_not_last_is_exit_1(task, tmp_path, capsys):
    from swimbladder.io.presets import preset_text

    small = preset_text("example-float").replace('"1500 Wh"', '"12 Wh"')
    (tmp_path / "small.toml").write_text(small)
    code = main(["mission", "small.toml", str(task), "--cycles", "50", "--out", "flown", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert (code, answer["stop"]) == (1, "reserve")
    assert answer["battery_cycles"] == answer["cycles"] < 50
    assert f"after {answer['cycles']} of 50 cycles" in answer["reasons"][0]


def test_of_many_cycles_the_first_and_last_are_printed_and_all_are_written(task, capsys):
    flown = ["mission", "example-float", str(task), "--cycles", "26", "--out", "flown", "--full"]
    assert main(flown) == 0
    said = capsys.readouterr().out.splitlines()
    first = [line.split()[0] for line in said if line[:5].strip().isdigit()]
    assert first == [str(n) for n in (*range(1, 12), 26)]
    assert "(14 cycles more in cycles.csv)" in said
    assert len(Path("flown/cycles.csv").read_text().splitlines()) == 27


def test_options_of_a_cast_need_one(task, capsys):
    for option in (["--salinity", "3"], ["--cast-profile", "2"], ["--inversions", "keep"]):
        assert main(["mission", "example-float", str(task), *option]) == 2
        assert option[0] in capsys.readouterr().err
        assert main(["campaign", "example-float", str(task), "--latitude", "30"]) == 2
    capsys.readouterr()
    task.write_text(MISSION.replace('name = "a short dive"', "latitude = 30"))
    assert main(["mission", "example-float", str(task)]) == 2
    assert "it says where a cast was taken" in " ".join(capsys.readouterr().err.split())


@pytest.mark.prove
def test_a_killed_flight_goes_on_to_the_same_end_bit_for_bit(task, tmp_path):
    def command(out):
        return [
            sys.executable,
            "-m",
            "swimbladder",
            "mission",
            "example-float",
            str(task),
            "--cycles",
            "120",
            "--seed",
            "3",
            "--out",
            str(tmp_path / out),
        ]

    def run(out):
        subprocess.run(command(out), check=True, capture_output=True, cwd=tmp_path)

    run("whole")
    kept = tmp_path / ".killed-unfinished"
    process = subprocess.Popen(
        command("killed"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=tmp_path
    )
    while process.poll() is None and len(list(kept.rglob("*.npz"))) < 3:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "killed").exists(), "it was done before it could be killed"
    parts = len(list(kept.rglob("*.npz")))
    assert parts >= 3
    run("killed")
    assert not kept.exists()
    for name in ("trajectory.csv", "events.csv", "cycles.csv", "vertical-speed.csv"):
        assert (tmp_path / "whole" / name).read_bytes() == (
            tmp_path / "killed" / name
        ).read_bytes(), name


def test_a_date_that_og1_has_not_is_refused_before_flying(task, capsys):
    given = ["mission", "example-float", str(task), "--begin", "1999-01-01", "--out", "flown"]
    assert main([*given, "--netcdf"]) == 2
    assert "--begin: OG 1.0 has times from 2001-09-09" in capsys.readouterr().err
    assert not os.path.exists("flown")
    assert main(given) == 0
    config = json.loads(Path("flown/float.json").read_text())
    assert config["created"] == "1999-01-01T00:00:00+00:00"
