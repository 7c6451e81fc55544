"""`swimbladder identify --cast`: deep dives of a pump and valve, from files to files."""

import csv
import json

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.estimation.motion.deep_model import body_of
from swimbladder.io.config import load_vehicle
from tests.docs.test_reference import check, rows
from tests.estimation.motion.deep import dived, made_up_column, made_up_vehicle
from tests.estimation.motion.test_deep import RUNS, TRUTH, begin_of
from tests.quoted import numbers


def write_dive(path, vehicle, column, seed):
    """Write a dive of the vehicle with noise of its own as a table."""
    body = body_of(vehicle)
    log, _ = dived(
        vehicle,
        body,
        column,
        TRUTH,
        np.random.default_rng(seed),
        runs=RUNS,
        hours=12.0,
        start=begin_of(body, TRUTH, column, 0.05),
    )
    lines = ["time_s,pressure_Pa,pump_s,valve_s"]
    told = [(t, f"{p:.0f},,") for t, p in zip(log.time, log.pressure, strict=True)]
    told += [
        (a.time, f",{a.seconds:g}," if a.device == "pump" else f",,{a.seconds:g}")
        for a in log.actions
        if a.time < log.time[-1]
    ]
    lines += [f"{t:g},{rest}" for t, rest in sorted(told)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def another(tmp_path, files):
    """Another dive of the same vehicle and runs through the same water."""
    return write_dive(tmp_path / "other.csv", load_vehicle(files[0]), made_up_column(), 6)


@pytest.fixture
def files(tmp_path):
    """A vehicle, a cast and a dive as a table."""
    vehicle, column = made_up_vehicle(tmp_path), made_up_column()
    lines = ["pressure_dbar,temperature_degC,salinity"]
    for p in range(0, 2001, 5):
        warm = 6.0 + 16.0 / (1.0 + np.exp((p - 120.0) / 40.0))
        lines.append(f"{p},{warm:.4f},{35.0 + p / 3000.0:.4f}")
    cast = tmp_path / "cast.csv"
    cast.write_text("\n".join(lines) + "\n")
    dive = write_dive(tmp_path / "dive.csv", vehicle, column, 5)
    return tmp_path / "float.toml", cast, dive


def run(files, out, *options):
    vehicle, cast, dive = files
    return main(
        [
            "identify",
            str(dive),
            "--vehicle",
            str(vehicle),
            "--cast",
            str(cast),
            *options,
            "--out",
            str(out),
        ]
    )


def test_in_words_and_files(capsys, tmp_path, files):
    out = tmp_path / "out"
    assert run(files, out, "--full") == 0
    said = capsys.readouterr().out
    assert "pump_delivery" in said
    assert "drag 160 +- 16 N s2/m2" in said
    assert {p.name for p in out.iterdir()} == {
        "deep.csv",
        "deep.json",
        "deep.png",
        "report.html",
        "vehicle.toml",
    }
    after = load_vehicle(out / "vehicle.toml")
    kept = json.loads((out / "deep.json").read_text())
    told = kept["parameters"]["pump_delivery"]["value"]
    assert after.actuator.pump.delivery == pytest.approx(0.8e-6 * told)
    columns, keys = (rows("files-written.md", "identify --cast")[i] for i in (0, 1))
    with (out / "deep.csv").open() as text:
        reader = csv.DictReader(text)
        assert reader.fieldnames == list(columns)
        imbalance = [float(row["imbalance_m3"]) for row in reader]
    assert np.sqrt(np.mean(np.square(imbalance))) == pytest.approx(
        kept["imbalance_rms_m3"], rel=1e-4
    )
    assert float(f"{1e6 * kept['imbalance_rms_m3']:.2g}") in numbers(said)  # mL
    check(keys, kept)


def test_as_json_with_a_prior_and_a_value(capsys, tmp_path, files):
    out = tmp_path / "out"
    options = ("--json", "--prior", "valve=0.9 +- 0.05", "--fixed", "drag=165 N s2/m2")
    assert run(files, out, *options) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["identified"]
    assert answer["parameters"]["drag"] == {
        "value": 165.0,
        "std": 0.0,
        "ci95": [165.0, 165.0],
        "unit": "N s2/m2",
        "origin": "set",
    }
    assert answer["priors"]["valve"] == {"mean": 0.9, "std": pytest.approx(0.05)}
    valve = answer["parameters"]["valve"]
    assert valve["ci95"][0] < 0.9 < valve["ci95"][1]


def test_the_answer_no(capsys, tmp_path, files):
    """Hardly anything is known of trapped air from a dive that begins at 10 m."""
    out = tmp_path / "out"
    options = ("--free", "trapped_air,valve", "--prior", "trapped_air=0 +- 1e-7 m3")
    assert run(files, out, *options) == 1
    said = capsys.readouterr().out
    assert "trapped_air" in said.splitlines()[0]
    assert not (out / "vehicle.toml").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--process-noise", "always"), "no use with --cast"),
        (("--drag", "linear"), "no use with --cast"),
        (("--free", "K2"), "no such parameter of deep dives"),
        (("--fixed", "psi=1e-6 m3/m"), "no such parameter"),
        (("--column", "pump_s=Pump"), "no such column"),
        (("--log-format", "mermaid"), "no line with a pressure"),
    ],
)
def test_what_is_refused(capsys, tmp_path, files, options, says):
    assert run(files, tmp_path / "out", *options) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_a_cast_is_needed(capsys, files):
    vehicle, _, dive = files
    assert main(["identify", str(dive), "--vehicle", str(vehicle)]) == 2
    assert "--cast" in capsys.readouterr().err
    assert main(["identify", "x.csv", "--vehicle", "feup-em", "--cast-where", "a=1"]) == 2
    assert "how to read a cast, and there is none" in capsys.readouterr().err


@pytest.mark.prove
def test_casts_of_one_file(capsys, tmp_path, files, another):
    """Two profiles in a file: both are too much, each can be chosen, and one for each log."""
    vehicle, cast, dive = files
    lines = cast.read_text().splitlines()
    both = tmp_path / "both.csv"
    rows_ = [f"{line},{k}" for k in (1, 2) for line in lines[1:]]
    both.write_text("\n".join([f"{lines[0]},dive", *rows_]) + "\n")
    start = ["identify", str(dive), "--vehicle", str(vehicle), "--cast", str(both)]
    out = ["--out", str(tmp_path / "out")]
    assert main([*start, *out]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "Choose one with --cast-profile 1, or rows with --cast-where" in said
    assert main([*start, "--cast-where", "dive=2", *out]) == 0
    capsys.readouterr()
    assert main([*start, "--cast-where", "dive=1,2", *out]) == 2
    assert "2 casts for 1 dives" in capsys.readouterr().err
    assert main([*start, str(another), "--cast-where", "dive=1,2", *out]) == 0


@pytest.mark.prove
def test_logs_of_two_floats(capsys, tmp_path, files, another):
    """Of two dives alike, one with valve runs as they were and one with twice their seconds."""
    lines = []
    for line in another.read_text().splitlines():
        cells = line.split(",")
        if cells[-1].replace(".", "").isdigit():
            cells[-1] = str(2.0 * float(cells[-1]))
        lines.append(",".join(cells))
    another.write_text("\n".join(lines) + "\n")
    out = tmp_path / "out"
    held = ("--fixed", "drag=165 N s2/m2", "--fixed", "stiffening=3e-18 1/Pa2")
    assert run(files, out, str(another), *held) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "other.csv" in said or "dive.csv" in said
    assert not (out / "vehicle.toml").exists()
    kept = json.loads((out / "deep.json").read_text())
    assert kept["parameters"]["valve"]["ci95"] is None
    assert {told["source"] for told in kept["dives"]} == {"dive.csv", "other.csv"}


def test_a_number_without_a_place(capsys, tmp_path, files):
    """Temperatures of a sensor that tells a twentieth of the hull's warmth, the other way round."""
    _, cast, dive = files
    water = np.genfromtxt(cast, delimiter=",", names=True)
    lines = dive.read_text().splitlines()
    odd = [f"{lines[0]},temperature_degC"]
    for line in lines[1:]:
        p = line.split(",")[1]
        if not p:
            odd.append(f"{line},")
            continue
        warm = np.interp(float(p) / 1e4, water["pressure_dbar"], water["temperature_degC"])
        odd.append(f"{line},{15.0 - 0.04 * (warm - 15.0):.5f}")
    dive.write_text("\n".join(odd) + "\n")
    out = tmp_path / "out"
    assert run(files, out, "--prior", "thermal_expansion=0 +- 2e-3 1/K") == 1
    said = capsys.readouterr().out.splitlines()[0]
    assert said.startswith("thermal_expansion ")
    assert min(numbers(said)) < -0.001  # 1/K, the least that a vehicle's file may have
    assert "temperature_degC" in said
    assert {p.name for p in out.iterdir()} == {"deep.png", "deep.csv", "deep.json", "report.html"}
    assert run(files, out, "--fixed", "drag_up=0.02") == 2
    assert "--fixed" in capsys.readouterr().err
