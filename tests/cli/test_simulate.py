"""``swimbladder simulate``: numbers, files, exit codes, and what is refused."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

import swimbladder
from swimbladder.cli import main
from swimbladder.io.presets import preset_text
from swimbladder.io.vehicle_file import KINDS, vehicle_template
from tests.cf import cf_problems
from tests.quoted import numbers

COLUMNS = [
    "time_s",
    "depth_m",
    "speed_m_s",
    "volume_m3",
    "voltage_V",
    "reference_volume_m3",
    "current_A",
    "power_W",
    "reference_depth_m",
]
MISSION = """\
schema_version = 1
name = "down and up"
start_depth = "1.5 m"
bottom_depth = "4.5 m"
duration = "800 s"
[[setpoints]]
time = 0
depth = 3.0
[[setpoints]]
time = 400
depth = 1.5
"""


def answer(capsys, *arguments, code=0):
    assert main(["simulate", *arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def table(path):
    with path.open(newline="", encoding="ascii") as file:
        header, *rows = csv.reader(file)
    return header, dict(zip(header, np.array(rows, float).T, strict=True))


def vehicle_file(folder, old="", new="", *, text=None):
    path = folder / "vehicle.toml"
    text = preset_text("feup-em") if text is None else text
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", ["feup-em", "example-float"])
def test_what_nothing_is_asked_for_is_the_same_in_python(name, capsys, tmp_path):
    theirs = answer(capsys, name, "--out", str(tmp_path))
    ours = json.loads(json.dumps(swimbladder.simulate(name).to_dict()))
    assert {key: theirs[key] for key in ours} == ours


def test_a_float_dives_and_comes_up_again(capsys, tmp_path):
    a = answer(capsys, "example-float", "--plot", "--netcdf", "--out", str(tmp_path))
    assert [step["target_depth_m"] for step in a["steps"]] == [500.0, 0.0]
    assert abs(a["steps"][0]["final_depth_m"] - 500.0) < 10.0  # the tolerance of its law
    assert a["final_depth_m"] == pytest.approx(0.086, abs=2e-3)  # its sensor is below the top
    assert a["completed"]
    header, columns = table(tmp_path / "trajectory.csv")
    assert {"drive", "volume_change_m3", "volume_rate_m3_s"} < set(header)
    assert "voltage_V" not in header
    moved = columns["volume_m3"][-1] - columns["volume_m3"][0]
    assert abs(moved) < 1e-6
    spent = np.sum(columns["power_W"][:-1] * np.diff(columns["time_s"]))
    assert spent == pytest.approx(a["energy_J"], rel=0.05)  # runs end between samples
    assert (tmp_path / "trajectory.png").is_file()
    assert cf_problems(tmp_path / "trajectory.nc") == []


def test_a_float_goes_to_one_depth_where_one_is_given(capsys, tmp_path):
    given = ["--step", "100:150", "--duration", "1 h", "--out", str(tmp_path)]
    a = answer(capsys, "example-float", *given)
    assert len(a["steps"]) == 1
    assert abs(a["final_depth_m"] - 150.0) < 10.0
    assert a["duration_s"] == 3600.0


def test_the_papers_step_has_the_numbers_of_an_independent_simulation(capsys, tmp_path):
    """SciPy's LSODA at rtol 1e-9 gives 14.7 %, 37.8 s, 338 s and -99 to +13 cm3 from rest."""
    step = ["--step", "1.5:3.0", "--duration", "400"]
    a = answer(capsys, "feup-em", *step, "--out", str(tmp_path))
    assert a["overshoot_pct"] == pytest.approx(14.7, abs=0.05)
    assert a["rise90_s"] == pytest.approx(37.8, abs=1e-9)
    assert a["settle2_s"] == pytest.approx(338.0, abs=0.5)
    assert a["volume_range_m3"] == pytest.approx([-99e-6, 13e-6], abs=0.5e-6)
    assert a["peak_volume_m3"] == -a["volume_range_m3"][0]
    assert a["completed"] is True
    assert a["events"] == []
    assert a["stop_reason"] == "The simulation reached its end."
    names = ("report.html", "simulate.json", "trajectory.csv")
    assert a["files"] == [str(tmp_path / name) for name in names]
    assert len(a["steps"]) == 1


def test_the_csv_has_the_solution_to_the_bit(capsys, tmp_path):
    a = answer(capsys, "feup-em", "--out", str(tmp_path))
    header, columns = table(tmp_path / "trajectory.csv")
    # An identified actuator does not tell its current.
    assert header == [c for c in COLUMNS if c not in ("current_A", "power_W")]
    vehicle = swimbladder.load_vehicle("feup-em")
    s = swimbladder.simulate(vehicle, setpoints=[(0.0, 3.0)], duration=400.0, start_depth=1.5)
    for name, values in {
        "time_s": s.time,
        "depth_m": s.depth,
        "speed_m_s": s.speed,
        "volume_m3": s.volume,
        "voltage_V": s.voltage,
        "reference_volume_m3": s.volume_reference,
        "reference_depth_m": s.reference,
    }.items():
        assert np.array_equal(columns[name], values), name
    assert len(s.time) == a["samples"] == 1335
    travel = np.abs(np.diff(columns["volume_m3"])).sum()
    assert a["actuator_travel_m3"] == pytest.approx(travel, rel=1e-12)
    assert a["final_depth_m"] == columns["depth_m"][-1]


def test_current_and_power_are_there_where_the_motor_is_known(capsys, tmp_path):
    answer(capsys, "example-em", "--duration", "30", "--out", str(tmp_path))
    header, columns = table(tmp_path / "trajectory.csv")
    assert header == COLUMNS
    assert np.all(np.isfinite(columns["current_A"]))


def test_a_positioner_has_no_voltage(capsys, tmp_path):
    path = vehicle_file(tmp_path, text=vehicle_template("positioner"))
    answer(capsys, path, "--duration", "30", "--out", str(tmp_path))
    assert table(tmp_path / "trajectory.csv")[0] == [
        "time_s",
        "depth_m",
        "speed_m_s",
        "volume_m3",
        "reference_volume_m3",
        "reference_depth_m",
    ]


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "pump-valve"])
def test_every_template_is_a_vehicle_that_reaches_its_depth(capsys, tmp_path, kind):
    path = vehicle_file(tmp_path, text=vehicle_template(kind))
    a = answer(capsys, path, "--out", str(tmp_path))
    assert a["completed"] is True
    assert a["final_depth_m"] == pytest.approx(3.0, abs=0.05)
    assert a["settle2_s"] is not None


@pytest.mark.parametrize(("share", "warned"), [(1.01, False), (1.03, True)])
def test_a_dry_mass_that_the_trim_does_not_carry_is_told(capsys, tmp_path, share, warned):
    text = vehicle_template("electromechanical").replace("27.5 kg", f"{27.5 * share} kg")
    file = tmp_path / "mine.toml"
    file.write_text(text)
    out = str(tmp_path / "out")
    assert main(["simulate", str(file), "--duration", "3 s", "--out", out, "--json"]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert ({float(f"{27.5 * share:.6g}"), 27.5} <= numbers(said)) is warned  # kg
    assert ("trim_error" in said) is warned


def test_a_depth_that_is_not_reached_is_null_not_a_number(capsys, tmp_path):
    a = answer(capsys, "feup-em", "--duration", "20", "--out", str(tmp_path))
    assert a["rise90_s"] is None
    assert a["settle2_s"] is None
    assert a["overshoot_pct"] == 0.0


def test_options_take_units(capsys, tmp_path):
    one = answer(
        capsys,
        "feup-em",
        "--step",
        "150 cm:3000 mm",
        "--duration",
        "1 min",
        "--bottom-depth",
        "450 cm",
        "--out",
        str(tmp_path),
    )
    two = answer(
        capsys,
        "feup-em",
        "--step",
        "1.5:3",
        "--duration",
        "60",
        "--bottom-depth",
        "4.5",
        "--out",
        str(tmp_path),
    )
    assert one == two


def test_a_mission_gives_each_step_and_the_last_on_top(capsys, tmp_path):
    path = tmp_path / "mission.toml"
    path.write_text(MISSION)
    a = answer(capsys, "feup-em", str(path), "--out", str(tmp_path))
    first, second = a["steps"]
    assert (first["time_s"], first["start_depth_m"], first["target_depth_m"]) == (0.0, 1.5, 3.0)
    assert (second["time_s"], second["start_depth_m"], second["target_depth_m"]) == (400, 3.0, 1.5)
    assert a["mission"] == "down and up"
    for name in ("overshoot_pct", "rise90_s", "settle2_s", "final_depth_m", "peak_volume_m3"):
        assert a[name] == second[name]
    # The first 400 s are those of the single step.
    alone = answer(capsys, "feup-em", "--out", str(tmp_path))
    assert first["overshoot_pct"] == pytest.approx(alone["overshoot_pct"], rel=1e-12)
    assert first["rise90_s"] == alone["rise90_s"]
    # Section 3.2: the overshoot is slightly lower when ascending.
    assert 10.0 < second["overshoot_pct"] < first["overshoot_pct"]
    assert 30.0 < second["rise90_s"] < 45.0


def test_the_table_says_the_same_as_the_json(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "feup-em"]) == 0
    shown = capsys.readouterr().out
    words = ("1.5 to 3 m", "14.7 %", "37.8 s", "337.8 s", "99.2 cm3", "221.8 cm3", "trajectory.csv")
    for word in words:
        assert word in shown
    assert (tmp_path / "swimbladder-simulate" / "trajectory.csv").is_file()


def test_events_are_told(capsys, tmp_path):
    path = vehicle_file(tmp_path, 'minimum = "-350 cm3"', 'minimum = "-20 cm3"')
    a = answer(capsys, path, "--step", "1.5:2.9", "--out", str(tmp_path))
    kinds = [event["kind"] for event in a["events"]]
    assert "reached the lower end stop" in kinds
    assert a["volume_range_m3"][0] == pytest.approx(-20e-6, abs=1e-10)
    assert a["steps"][0]["events"] == a["events"]
    assert main(["simulate", path, "--step", "1.5:2.9", "--out", str(tmp_path)]) == 0
    assert "reached the lower end stop" in capsys.readouterr().out


def test_a_simulation_that_stops_early_is_exit_code_1_with_its_files(capsys, tmp_path):
    # With the outer loop's sign turned the vehicle sinks for good.
    text = preset_text("feup-em")
    for gain in ("-0.1043", "-7.486e-4", "-2.341"):
        text = text.replace(f'"{gain}', f'"{gain[1:]}')
    path = vehicle_file(tmp_path, text=text)
    arguments = ["--step", "1.5:1.0", "--duration", "12 h", "--out", str(tmp_path)]
    a = answer(capsys, path, *arguments, code=1)
    assert a["completed"] is False
    assert "12000 m" in a["stop_reason"]
    assert a["duration_s"] < 12 * 3600
    _, columns = table(tmp_path / "trajectory.csv")
    assert columns["time_s"][-1] == a["duration_s"]
    assert main(["simulate", path, *arguments]) == 1
    assert f"\nstopped at {a['duration_s']:.6g} s" in capsys.readouterr().out


def test_noise_comes_from_the_seed(capsys, tmp_path):
    path = vehicle_file(
        tmp_path, "[controller]\n", '[sensors]\ndepth_noise = "2 mm"\n[controller]\n'
    )
    depths = []
    for arguments in ([], ["--seed", "1"], ["--seed", "1"], ["--seed", "2"]):
        answer(capsys, path, *arguments, "--out", str(tmp_path))
        depths.append(table(tmp_path / "trajectory.csv")[1]["depth_m"])
    assert np.array_equal(depths[1], depths[2])
    assert not np.array_equal(depths[0], depths[1])
    assert not np.array_equal(depths[1], depths[3])


@pytest.mark.parametrize("sensor", ['depth_noise = "2 mm"', 'volume_quantum = "1 cm3"'])
def test_a_seed_without_noise_is_said_to_change_nothing(capsys, tmp_path, sensor):
    noisy = vehicle_file(tmp_path, "[controller]\n", f"[sensors]\n{sensor}\n[controller]\n")
    given = ("--duration", "30", "--seed", "1", "--out", str(tmp_path))
    assert answer(capsys, noisy, *given)["notes"] == []
    notes = answer(capsys, "feup-em", *given)["notes"]
    assert [note.partition(":")[0] for note in notes] == ["--seed 1 changes nothing"]
    assert answer(capsys, "feup-em", *given[:2], *given[4:])["notes"] == []
    assert main(["simulate", "feup-em", *given]) == 0
    assert "--seed 1 changes nothing" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("arguments", "place", "words"),
    [
        (["--step", "1.5:-1"], "--step", "above the surface"),
        (["--step", "-0.5:3 m"], "--step", "above the surface"),
        (["--step", "1.5:5", "--bottom-depth", "4.5"], "--step", "below the bottom at 4.5 m"),
        (["--step", "5:3 m", "--bottom-depth", "450 cm"], "--step", "or a deeper bottom"),
        (["--step", "1.5:101"], "--step", "rated for 100 m"),
        (["--step", "1.5:90"], "--step", "passes that depth sinks"),
        (["--step", "1.5:3 kg"], "--step", "Give it in m"),
        (["--step", "1.5:nan"], "--step", "not a number"),
        (["--duration", "0"], "--duration", "greater than 0"),
        (["--duration", "-5 min"], "--duration", "greater than 0"),
        (["--duration", "100 ms"], "--duration", "shorter than one sample of 0.3 s"),
        (["--duration", "1e12"], "--duration", "at most 100 million samples"),
        (["--bottom-depth", "0"], "--bottom-depth", "greater than 0"),
        (["none.toml"], "none.toml", "there is no such file"),
    ],
)
def test_bad_input_is_one_paragraph_and_nothing_is_written(
    capsys, tmp_path, monkeypatch, arguments, place, words
):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "feup-em", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"error: {place}")
    assert words in captured.err
    assert captured.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_an_error_in_a_mission_is_placed_in_its_file(capsys, tmp_path):
    path = tmp_path / "mission.toml"
    path.write_text(MISSION.replace("depth = 1.5", "depth = 5.5"))
    assert main(["simulate", "feup-em", str(path), "--out", str(tmp_path / "out")]) == 2
    shown = capsys.readouterr().err
    assert f"{path}, line 11, setpoints[1].depth: the depth is below the bottom at 4.5 m" in shown
    assert not (tmp_path / "out").exists()


def test_a_mission_and_options_contradict_each_other(capsys, tmp_path):
    path = tmp_path / "mission.toml"
    path.write_text(MISSION)
    assert main(["simulate", "feup-em", str(path), "--step", "1.5:2"]) == 2
    assert "--step: the mission file says this already" in capsys.readouterr().err


def test_a_vehicle_without_a_controller_is_told_so(capsys, tmp_path):
    text = preset_text("feup-em")
    path = vehicle_file(tmp_path, text=text[: text.index("[controller]")])
    assert main(["simulate", path, "--out", str(tmp_path / "out")]) == 2
    assert "Add a [controller] table" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("out", ["file", "file/out"])
def test_a_folder_that_cannot_be_made_is_refused_before_anything_is_simulated(
    capsys, tmp_path, monkeypatch, out
):
    def run(*_):
        raise AssertionError("simulated")

    monkeypatch.setattr("swimbladder.cli.predict._simulated", run)
    (tmp_path / "file").write_text("x")
    assert main(["simulate", "feup-em", "--out", str(tmp_path / out)]) == 2
    assert "Choose another folder with --out" in capsys.readouterr().err


def test_netcdf_has_the_same_numbers_and_names_them(capsys, tmp_path):
    a = answer(capsys, "feup-em", "--netcdf", "--out", str(tmp_path))
    file = a["files"][-1]
    assert file == str(tmp_path / "trajectory.nc")
    _, columns = table(tmp_path / "trajectory.csv")
    with xarray.open_dataset(file, engine="h5netcdf", decode_times=False) as data:
        assert np.array_equal(data.depth, columns["depth_m"])
        assert np.array_equal(data.time, columns["time_s"])
        assert data.attrs["Conventions"] == "CF-1.11"
        # CF: a featureType promises coordinates of place, which a simulated step has none of.
        assert "featureType" not in data.attrs
        assert data.depth.attrs["standard_name"] == "depth"
        assert all("units" in data[name].attrs for name in data.variables)
        assert data.attrs["title"] == "feup-em: step, simulated in closed loop"
        assert "date is arbitrary" in data.time.attrs["comment"]
    assert cf_problems(file) == []


def test_the_begin_of_a_run_makes_its_times_dates(capsys, tmp_path):
    given = ["feup-em", "--duration", "30", "--netcdf", "--out", str(tmp_path)]
    a = answer(capsys, *given, "--begin", "2026-03-01T12:00:00+02:00")
    with xarray.open_dataset(a["files"][-1]) as data:
        assert data.time.values[0] == np.datetime64("2026-03-01T10:00")
        assert "comment" not in data.time.attrs
    assert cf_problems(a["files"][-1]) == []
    assert main(["simulate", *given, "--begin", "tomorrow"]) == 2
    assert "--begin: this is no time" in capsys.readouterr().err


def test_a_picture_is_drawn_where_it_is_asked_for(capsys, tmp_path):
    a = answer(capsys, "feup-em", "--plot", "--out", str(tmp_path))
    names = ["report.html", "simulate.json", "trajectory.csv", "trajectory.png"]
    assert a["files"] == [str(tmp_path / name) for name in names]
    assert (tmp_path / "trajectory.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(names)


def test_a_warm_run_imports_nothing_that_it_does_not_need(tmp_path):
    code = (
        "import sys; from swimbladder.cli import main; "
        f"assert main(['simulate', 'feup-em', '--json', '--out', {str(tmp_path)!r}]) == 0; "
        "print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stderr.split())
    assert "numba" in loaded
    heavy = {"pandas", "xarray", "h5py", "control", "scipy.linalg"}
    assert not loaded.intersection(heavy)
    assert json.loads(done.stdout)["vehicle"] == "feup-em"


def test_going_below_the_rating_is_said_and_answers_no(tmp_path: Path) -> None:
    """From 1 m down to 999 m the electrohydraulic example cannot stop in time."""
    command = ["simulate", "example-eh", "--step", "1:999", "--duration", "4000"]
    run = subprocess.run(
        [sys.executable, "-m", "swimbladder", *command, "--json", "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 1
    assert "below its depth limit of 1000 m" in run.stderr
    answer = json.loads(run.stdout)
    assert answer["completed"] is True
    assert answer["within_depth_limit"] is False
    assert answer["deepest_m"] > 1000.0
    assert "passed its depth limit of 1000 m" in [event["kind"] for event in answer["events"]]
    assert answer["energy_J"] > 0.0


def test_the_supervisor_of_the_file_is_flown_and_its_alarm_answers_no(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """2.5 m is the depth limit: the vehicle is brought up before it is at 3 m."""
    limited = '[supervisor]\ndepth_limit = "2.5 m"\n\n[controller]'
    file = vehicle_file(tmp_path, "[controller]", limited)
    out = ("--out", str(tmp_path / "out"))
    told = answer(capsys, file, *out, code=1)
    assert told["supervised"] is True
    assert told["law"] == "cascade"
    reason = "depth limit or too fast to turn"
    assert told["alarm"]["reason"] == reason
    at = {event["kind"]: event["time_s"] for event in told["events"]}
    assert at[f"the supervisor took over: {reason}"] == told["alarm"]["time_s"] < 60.0
    assert told["deepest_m"] < 3.0
    assert main(["simulate", file, *out]) == 1
    said = capsys.readouterr()
    assert said.out.startswith("feup-em, law cascade and supervisor, 400.2 s in")
    assert f"took over at {told['alarm']['time_s']:.6g} s: {reason}" in said.out
    alone = answer(capsys, file, "--unsupervised", *out)
    assert (alone["supervised"], alone["alarm"]) == (False, None)
    assert alone["deepest_m"] > 3.0
    assert "law cascade alone" in preset_line(capsys, out)


def preset_line(capsys: pytest.CaptureFixture[str], out: tuple[str, str]) -> str:
    """Return the first line of the paper's preset."""
    assert main(["simulate", "feup-em", *out]) == 0
    return capsys.readouterr().out.partition("\n")[0]


def test_a_float_with_a_table_of_it_is_flown_under_its_supervisor(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = preset_text("example-float") + "\n[supervisor]\n"
    given = ["--step", "0:50", "--duration", "2 h", "--out", str(tmp_path / "out")]
    told = answer(capsys, vehicle_file(tmp_path, text=text), *given)
    assert told["supervised"] is True
    assert told["alarm"] is None
    header, columns = table(tmp_path / "out" / "trajectory.csv")
    assert "volume_change_m3" not in header
    pumps, lets_in = columns["run_s"] > 0.0, columns["run_s"] < 0.0
    assert set(columns["drive"][pumps]) <= {1.0, 4.0}
    assert set(columns["drive"][lets_in]) <= {2.0, 3.0}
    assert np.all(columns["drive"][~(pumps | lets_in)] == 0.0)
    assert np.abs(columns["run_s"]).max() == 1.0  # a sample
    alone = answer(capsys, vehicle_file(tmp_path, text=text), "--unsupervised", *given)
    assert alone["supervised"] is False
    # where its board takes all volume for out, it let in as much and overshot by a quarter
    shallow = ["--step", "0.5:50", "--duration", "60", "--out", str(tmp_path / "none")]
    assert main(["simulate", str(vehicle_file(tmp_path, text=text)), *shallow]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "--step: the board of a float takes all volume for out up there" in said
    assert "Begin afloat, at 0 m, or below 5 m." in said
    assert not (tmp_path / "none").exists()
    unsupervised = [str(vehicle_file(tmp_path, text=text)), "--unsupervised", *shallow]
    assert main(["simulate", *unsupervised]) == 0
