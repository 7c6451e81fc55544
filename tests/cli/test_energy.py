"""`swimbladder energy`: its answer, its files, what it refuses."""

import csv
import json
import re

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.design.energy import Thruster, drive_energy, hovering, profiling
from swimbladder.io.answers import as_json
from swimbladder.io.config import load_vehicle
from swimbladder.physics.seawater import uniform_column


def answer(capsys, *words):
    assert main(["energy", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_answer_and_the_table_agree(capsys, tmp_path):
    told = answer(capsys, "example-float", "--out", str(tmp_path / "out"))
    assert told["vehicle"] == "example-float"
    with (tmp_path / "out" / "energy.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["depth_m"]) == 2000.0
    last = float(rows[-1]["energy_per_volume_J_m3"])
    assert last == pytest.approx(told["depths"]["energy_per_volume_J_m3"][-1], rel=1e-8)
    assert f"takes {last * 1e-6:.3g} J/mL" in told["sentences"][0]
    assert len(told["efficiency_map"]["efficiency"]) == len(told["efficiency_map"]["voltage_share"])
    assert {*map(str, tmp_path.joinpath("out").iterdir())} == set(told["files"])
    assert json.loads((tmp_path / "out" / "energy.json").read_text())["depths"] == told["depths"]


def test_words_for_people(capsys, tmp_path):
    assert (
        main(
            ["energy", "example-em", "--max-depth", "50 m", "--full", "--out", str(tmp_path / "o")]
        )
        == 0
    )
    said = capsys.readouterr().out
    assert "Increasing the volume at 50 m takes" in said
    assert "It stalls at 155.8 m" in said
    assert "Holding the volume there takes" in said
    assert "assumed: the water" in said
    assert "--thruster-diameter" in said


def test_a_depth_beyond_the_rating_is_said_first_and_percent_has_its_blank(capsys, tmp_path):
    out = ["--full", "--out", str(tmp_path / "o")]
    assert main(["energy", "example-float", "--max-depth", "2500 m", *out]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[1] == "2500 m is deeper than the vehicle is rated for, 2000 m."
    assert main(["energy", "example-float", *out]) == 0
    said = capsys.readouterr().out
    assert "rated" not in said
    assert ", an efficiency of 31 %." in said
    assert "35 % of an ideal disc's" in said


def test_every_option_reaches_the_answer(capsys, tmp_path):
    told = answer(
        capsys,
        "example-float",
        "--thruster-diameter",
        "0.2 m",
        "--thruster-efficiency",
        "70 %",
        "--thruster-idle-power",
        "2 W",
        "--thruster-number",
        "3",
        "--weight-error",
        "50 cm3",
        "--speed",
        "0.3 m/s",
        "--max-depth",
        "800 m",
        "--out",
        str(tmp_path / "o"),
    )
    vehicle = load_vehicle("example-float")
    thruster = Thruster(diameter=0.2, efficiency=0.7, number=3, idle_power=2.0)
    assert told["thruster"] == as_json(thruster, "diameter_m efficiency number idle_power_W")
    found = drive_energy(vehicle, uniform_column(vehicle.water, 800.0))
    hover = hovering(found, thruster, weight_error=5e-5)
    dive = profiling(found, thruster, speed=0.3)
    assert told["hovering"]["break_even_s"] == pytest.approx(hover.break_even[-1], rel=1e-9)
    assert told["hovering"]["depth_m"] == 800.0
    assert told["profiling"]["engine_J"][1:] == pytest.approx(list(dive.engine[1:]), rel=1e-9)
    assert told["profiling"]["thruster_J"] == pytest.approx(list(dive.thruster), rel=1e-9)


def test_a_cast_is_the_water(capsys, tmp_path):
    cast = tmp_path / "cast.csv"
    rows = [f"{p},{4.0 + 16.0 * np.exp(-p / 300.0)},35.0,10,-30" for p in range(0, 1501, 10)]
    head = "pressure_dbar,temperature_degC,salinity,latitude,longitude\n"
    cast.write_text(head + "\n".join(rows) + "\n")
    out = ["--out", str(tmp_path / "o")]
    told = answer(capsys, "example-float", "--cast", str(cast), "--max-depth", "1000 m", *out)
    uniform = answer(capsys, "example-float", "--max-depth", "1000 m", *out)
    assert told["hovering"]["depth_m"] == uniform["hovering"]["depth_m"] == 1000.0
    assert any("cast" in line for line in told["assumptions"])
    assert told["profiling"]["engine_J"][-1] != uniform["profiling"]["engine_J"][-1]
    deeper = main(["energy", "example-float", "--cast", str(cast), "--max-depth", "1900 m", *out])
    assert deeper in (1, 2)
    assert "error:" in capsys.readouterr().err


def _cast(path, deepest):
    rows = [f"{p},{4.0 + 16.0 * np.exp(-p / 300.0)},35.0" for p in range(0, deepest + 1, 10)]
    path.write_text("pressure_dbar,temperature_degC,salinity\n" + "\n".join(rows) + "\n")
    return str(path)


def test_a_cast_that_ends_above_the_rating_is_said_first_and_far_above_is_refused(capsys, tmp_path):
    out = ["--out", str(tmp_path / "o")]
    told = answer(capsys, "example-float", "--cast", _cast(tmp_path / "a.csv", 1500), *out)
    assert told["sentences"][0].startswith("a.csv ends at 14")
    assert "the vehicle is rated for 2000 m" in told["sentences"][0]
    far = _cast(tmp_path / "b.csv", 300)
    assert main(["energy", "example-float", "--cast", far, *out]) == 2
    assert 'it is to go: --max-depth "297 m"' in capsys.readouterr().err
    asked = answer(capsys, "example-float", "--cast", far, "--max-depth", "250 m", *out)
    assert not any("ends at" in sentence for sentence in asked["sentences"])
    assert main(["energy", "example-float", "--cast", far, "--max-depth", "900 m", *out]) == 2
    assert "--cast: the cast b.csv ends at 298 m" in capsys.readouterr().err


def test_an_engine_that_has_stalled_is_not_said_to_lose_against_a_thruster(capsys, tmp_path):
    told = answer(capsys, "example-float", "--max-depth", "7000 m", "--out", str(tmp_path / "o"))
    assert any("mL too heavy: not by this engine, it has stalled" in s for s in told["sentences"])


def test_a_thruster_that_is_stated_in_full_is_not_called_usual(capsys, tmp_path):
    stated = ["--thruster-diameter", "0.2 m", "--thruster-efficiency", "70 %"]
    out = ["--out", str(tmp_path / "o")]
    told = answer(capsys, "example-float", *stated, "--thruster-idle-power", "2 W", *out)
    assert not any("T200" in line for line in told["assumptions"])
    assert any("T200" in line for line in answer(capsys, "example-float", *out)["assumptions"])


@pytest.mark.parametrize(
    ("name", "field"),
    [("feup-em", "actuator.motor.resistance"), ("ntnu-bv", "actuator.moving_power")],
)
def test_without_r_and_k_t_it_says_so(name, field, capsys, tmp_path):
    assert main(["energy", name, "--out", str(tmp_path / "o")]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert "the electrical power is not known" in said.err
    assert field in said.err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ([], "VEHICLE"),
        (["example-float", "--speed", "0 m/s"], "--speed"),
        (["example-float", "--weight-error", "-1 cm3"], "--weight-error"),
        (["example-float", "--thruster-efficiency", "120 %"], "--thruster-efficiency"),
        (["example-float", "--max-depth", "-5 m"], "--max-depth: it must be above 0 (got '-5 m'"),
        (["example-float", "--weight-error=-10 cm3"], "got '-10 cm3'"),
        (["example-float", "--thruster-efficiency", "35"], '"35 %" is 0.35'),
        (["example-float", "--where", "a=b"], "--where"),
        (["example-float", "--power-at", "end"], "--power-at"),
        (["example-eh", "--fit", "RUNS"], "actuator.kind"),
        (["--fit", "RUNS", "--power-at", "noon"], "--power-at"),
    ],
)
def test_bad_input_exits_2_and_names_it(words, named, capsys, tmp_path):
    runs = tmp_path / "runs.csv"
    runs.write_text(RUNS)
    given = [str(runs) if word == "RUNS" else word for word in words]
    given += COLUMNS if "RUNS" in words else []
    assert main(["energy", *given, "--out", str(tmp_path / "o")]) == 2
    assert named in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def _runs():
    random = np.random.default_rng(7)
    rows = ["duration_s,pressure_dbar,power_W,volume_mL,dive"]
    for dive in range(8):
        for p in random.choice([20.0, 300.0, 1000.0, 1900.0], 6):
            t = random.uniform(10.0, 90.0)
            power = 8.0 + 0.009 * p + random.normal(0.0, 0.2)
            volume = (1.1 - 1e-4 * p) * t - 3.0 + random.normal(0.0, 0.5)
            rows.append(f"{t:.3f},{p},{power:.4f},{volume:.4f},{dive}")
    return "\n".join(rows) + "\n"


RUNS = _runs()
COLUMNS = ["--column", "pressure_Pa=pressure_dbar@dbar", "--column", "volume_m3=volume_mL@mL"]


def test_a_pump_is_found_in_logged_runs(capsys, tmp_path):
    (tmp_path / "runs.csv").write_text(RUNS)
    runs, out = str(tmp_path / "runs.csv"), tmp_path / "found"
    told = answer(capsys, "example-float", "--fit", runs, *COLUMNS, "--out", str(out))
    for name, true in (
        ("idle_power", 8.0),
        ("power_per_pressure", 9e-7),
        ("delivery", 1.1e-6),
        ("slip", 1e-14),
        ("start_volume", 3e-6),
    ):
        low, high = told["parameters"][name]["ci95"]
        assert low < true < high
    assert len(told["dives"]) == told["clusters"] == 8
    vehicle = load_vehicle(out / "vehicle.toml")
    assert vehicle.actuator.pump.kind == "power-law"
    assert vehicle.actuator.start_volume == told["parameters"]["start_volume"]["value"]
    assert main(["energy", str(out / "vehicle.toml"), "--out", str(tmp_path / "again")]) == 0
    capsys.readouterr()
    assert main(["energy", "--fit", runs, *COLUMNS, "--out", str(tmp_path / "alone")]) == 0
    printed = capsys.readouterr().out
    for name, unit in (
        ("idle_power", "W"),
        ("power_per_pressure", "mW/dbar"),
        ("slip", "mL/s/MPa"),
    ):
        row = rf"{name} +(\S+) +(\S+) +(\S+) to (\S+) {unit}\n"
        decimals = [text.partition(".")[2] for text in re.search(row, printed).groups()]
        assert len({*map(len, decimals)}) == 1
    assert not (tmp_path / "alone" / "vehicle.toml").exists()


def test_runs_of_two_pumps_are_refused_and_leave_no_vehicle(capsys, tmp_path):
    """The last four dives take 1.6 times the power: exit 1, and no vehicle of an earlier run."""
    head, *rows = RUNS.splitlines()
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[2] = f"{float(row[2]) * (1.6 if int(row[4]) > 3 else 1.0):.4f}"
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    one.write_text(RUNS)
    two.write_text("\n".join([head, *map(",".join, cells)]) + "\n")
    out = tmp_path / "found"
    words = [*COLUMNS, "--out", str(out)]
    assert main(["energy", "example-float", "--fit", str(one), *words]) == 0
    assert (out / "vehicle.toml").exists()
    capsys.readouterr()
    assert main(["energy", "example-float", "--fit", str(two), *words]) == 1
    said = capsys.readouterr().out
    assert said.startswith("Not identified: no one power law holds")
    assert not (out / "vehicle.toml").exists()
    assert (out / "runs.csv").exists()
    assert main(["energy", "--fit", str(two), *words, "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["refusal"] in told["sentences"][0]


def test_a_logged_voltage_counts_and_is_told(capsys, tmp_path):
    """A battery that gives 15 to 12 V: the power goes with it, and so does the vehicle's pump."""
    random = np.random.default_rng(8)
    head, *rows = RUNS.splitlines()
    cells = [row.split(",") for row in rows]
    volts = random.uniform(12.0, 15.0, len(cells))
    at = float(np.median(volts))
    for row, u in zip(cells, volts, strict=True):
        row[2] = f"{float(row[2]) * u / at:.5f}"
    text = "\n".join(
        [f"{head},mV", *(f"{','.join(r)},{u * 1e3:.6f}" for r, u in zip(cells, volts, strict=True))]
    )
    runs = tmp_path / "runs.csv"
    runs.write_text(text + "\n")
    words = [*COLUMNS, "--column", "voltage_V=mV@mV"]
    out = tmp_path / "found"
    told = answer(capsys, "example-float", "--fit", str(runs), *words, "--out", str(out))
    without = answer(capsys, "--fit", str(runs), *COLUMNS, "--out", str(tmp_path / "without"))
    assert told["reference_voltage_V"] == pytest.approx(at, rel=1e-6)
    assert without["reference_voltage_V"] is None
    assert told["power_rms_W"] < 0.3
    assert without["power_rms_W"] > 2.0 * told["power_rms_W"]
    low, high = told["parameters"]["idle_power"]["ci95"]
    assert low < 8.0 < high
    said = " ".join(told["sentences"])
    assert f"{at:.4g} V, the median" in said
    assert "The vehicle's supply gives" in said
    pump = load_vehicle(out / "vehicle.toml").actuator.pump
    assert pump.power_per_pressure > told["parameters"]["power_per_pressure"]["value"]  # 14.4 V
    assert "The vehicle's supply gives" in (out / "vehicle.toml").read_text().replace("\n# ", " ")


def test_a_fit_without_volumes_keeps_the_vehicles_delivery_or_says_why_not(capsys, tmp_path):
    (tmp_path / "runs.csv").write_text(RUNS.replace("volume_mL", "unused"))
    runs, out = str(tmp_path / "runs.csv"), str(tmp_path / "o")
    words = ["--fit", runs, *COLUMNS[:2], "--min-run-time", "12 s", "--out", out]
    assert main(["energy", "example-float", *words]) == 2
    assert "volume_m3" in capsys.readouterr().err
    assert main(["energy", *words]) == 0
    capsys.readouterr()
    told = answer(capsys, *words)
    assert told["parameters"]["power_per_pressure"]["value"] is not None
    assert told["parameters"].get("delivery", {}).get("value") is None
