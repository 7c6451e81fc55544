"""``swimbladder identify-actuator``: numbers, files, exit codes, and what is refused."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from studies.benches import Motor, measured, random_moves, soft_moves, steps, travel
from swimbladder.cli import main
from swimbladder.estimation.actuator import identify_actuator
from swimbladder.io.answers import json_text
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import read_log
from swimbladder.show.html import symbols
from tests.pages import figures_of, without_scripts


def write(path, **columns):
    with path.open("w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


def bench(path, levels, seed=1, noise=1e-5):
    time, voltage = steps(levels, hold=1.0, rest=1.0, step=0.02)
    position = measured(travel(Motor(), time, voltage), np.random.default_rng(seed), noise=noise)
    return write(path, time_s=time, piston_m=position, voltage_V=voltage)


@pytest.fixture
def log(tmp_path):
    return bench(tmp_path / "bench.csv", [3.0, -3.0, 6.0, -6.0, 12.0, -12.0])


def run(capsys, *arguments, code=0):
    capsys.readouterr()
    assert main(["identify-actuator", *map(str, arguments)]) == code
    shown = capsys.readouterr()
    assert "Traceback" not in shown.err
    return shown


def answer(capsys, *arguments, code=0):
    return json.loads(run(capsys, *arguments, "--json", code=code).out)


def test_the_numbers_and_the_files(capsys, log, tmp_path):
    out = tmp_path / "out"
    a = answer(capsys, log, "--vehicle", "feup-em", "--plot", "--out", out)
    K1 = a["parameters"]["K1"]
    assert K1["ci95"][0] < Motor().K1 < K1["ci95"][1]
    assert K1["unit"] == "m/s/V"
    assert a["parameters"]["rate"]["value"] is None
    assert a["parameters"]["rate"]["ci95"][1] is None
    assert len(a["nine"]) == 9
    names = {"report.html", "identify-actuator.json", "steps.csv", "steps.png", "vehicle.toml"}
    assert {path.name for path in out.iterdir()} == names
    assert {Path(path).name for path in a["files"]} == names
    found = load_vehicle(out / "vehicle.toml").actuator
    assert K1["value"] == found.K1
    assert found.dead_zone == max(a["parameters"]["dead_zone"]["value"], 0.0) > 0.0
    assert (out / "steps.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    with (out / "steps.csv").open(newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(step["samples"] for step in a["steps"])


def test_the_report_for_people(capsys, log, tmp_path):
    out = run(capsys, log, "--out", tmp_path / "out", "--full").out
    assert "mm/s/V" in out
    assert "no limit is seen" in out
    assert "not known" in out
    assert "assumed:" in out


def test_the_page_has_everything_and_needs_nothing(capsys, log, tmp_path):
    out = tmp_path / "out"
    a = answer(capsys, log, "--vehicle", "feup-em", "--out", out)
    page = (out / "report.html").read_text(encoding="utf-8")
    plain = without_scripts(page)
    assert not re.findall(
        r'(?:src|href)="(?!identify-actuator\.json|steps\.csv|vehicle\.toml)', plain
    )
    assert set(figures_of(page)) == {"speeds", "log-1", "steps-1"}
    text = re.sub(r"<[^>]+>", "", plain)
    assert f"K1 is {1e3 * a['parameters']['K1']['value']:.3f}" in text
    assert "mm/s/V" in text
    for known in a["nine"]:
        assert known["meaning"] in text
    for said in (*a["assumptions"], *a["notes"], *(f["sentence"] for f in a["findings"])):
        assert str(re.sub(r"<[^>]+>", "", symbols(said))) in text
    assert "Made by " in text


@pytest.mark.prove
def test_no_vehicle_of_an_earlier_run_stays_beside_an_answer_without_one(capsys, tmp_path):
    good = bench(tmp_path / "good.csv", [3.0, -3.0, 12.0, -12.0])
    out = tmp_path / "out"
    given = ("--fixed", "dead_zone=0.5 V", "--out", out)
    a = answer(capsys, good, "--vehicle", "feup-em", *given)
    assert str(out / "vehicle.toml") in a["files"]
    answer(capsys, good, *given)
    assert not (out / "vehicle.toml").exists()
    (out / "vehicle.toml").write_text("# mine\n", encoding="utf-8")
    answer(capsys, good, *given)
    assert (out / "vehicle.toml").read_text(encoding="utf-8") == "# mine\n"


def test_the_page_of_several_logs_shows_each(capsys, tmp_path):
    levels = [3.0, -3.0, 12.0, -12.0]
    logs = [bench(tmp_path / f"run{k}.csv", levels, seed=k) for k in (1, 2)]
    answer(capsys, *logs, "--fixed", "dead_zone=0.5 V", "--out", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for name in ("run1.csv", "run2.csv"):
        assert f"<h2>{name} by itself</h2>" in page
    assert page.count("<figure") == 5
    assert ">set</td>" in page


def test_what_is_not_told_is_exit_1_with_the_sentence(capsys, tmp_path):
    log = bench(tmp_path / "one.csv", [6.0, -6.0], noise=1e-4)
    shown = run(capsys, log, "--out", tmp_path / "out", code=1)
    assert "K1" in shown.out
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Actuator: not identified from 1 log" in page
    shown = run(capsys, log, "--out", tmp_path / "out", "--json", code=1)
    a = json.loads(shown.out)
    assert a["identified"] is False
    assert a["parameters"]["K1"]["value"] is None
    assert a["parameters"]["K1"]["why"]
    assert "K1" in shown.err
    fixed = ["--fixed", "dead_zone=0.5 V", "--fixed", "load_voltage=100 mV"]
    a = answer(capsys, log, *fixed, "--out", tmp_path / "out")
    assert a["parameters"]["load_voltage"] == {
        "value": 0.1,
        "std": 0.0,
        "ci95": [0.1, 0.1],
        "unit": "V",
        "origin": "set",
        "why": None,
    }


def test_what_is_asked_for_decides(capsys, log, tmp_path):
    answer(capsys, log, "--required", "K1,dead_zone", "--out", tmp_path)
    a = answer(capsys, log, "--required", "rate", "--out", tmp_path, code=1)
    assert a["asked"] == ["rate"]


@pytest.mark.prove
def test_moves_of_several_logs_in_one_file(capsys, tmp_path):
    logs = [random_moves(np.random.default_rng(k), Motor(T1=0.05)) for k in (4, 5)]
    path = write(
        tmp_path / "moves.csv",
        run=np.repeat([1, 2], [len(log) for log in logs]),
        t=np.concatenate([log.time for log in logs]),
        position=np.concatenate([log.piston for log in logs]) / 0.0254,
    )
    columns = ["--where", "run=1,2", "--column", "time_s=t@s", "--column", "piston_m=position@in"]
    asked = [path, *columns, "--out", tmp_path / "out"]
    a = answer(capsys, *asked, "--plot")
    assert a["driven_by"] == "nothing"
    assert [fit["log"].endswith(f"(run={k})") for k, fit in enumerate(a["logs"], 1)] == [True] * 2
    low, high = a["parameters"]["T1"]["ci95"]
    assert low < 0.05 < high
    said = run(capsys, *asked, "--full").out
    for k in (1, 2):
        assert f"moves.csv (run={k}) by itself" in said.splitlines()


def test_the_json_of_several_logs_is_what_python_gives(capsys, tmp_path):
    paths = []
    for k in (1, 2):
        log = soft_moves(
            np.random.default_rng(k), ramp=1e-3, speed=(4.9e-3, 5.1e-3)[k - 1], hold=3.0, step=0.1
        )
        paths.append(write(tmp_path / f"run{k}.csv", time_s=log.time, piston_m=log.piston))
    a = answer(capsys, *paths, "--required", "rate", "--out", tmp_path / "out")
    logs = [read_log(path, required=("piston_m",)) for path in paths]
    told = json.loads(json_text(identify_actuator(logs, required=["rate"]).to_dict()))
    (said,) = [f for f in told["findings"] if f["kind"] == "logs differ"]
    assert "run1.csv" in said["sentence"]
    assert {key: a[key] for key in told} == told


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--fixed", "K9=1"], "no such parameter"),
        (["--fixed", "K1=2 kg"], "--fixed K1"),
        (["--fixed", "K1"], "NAME=VALUE"),
        (["--required", "K1,speed"], "no such parameter"),
        (["--column", "piston_m=depth"], "no such column"),
        (["--vehicle", "ntnu-bv"], "driven by positions"),
        (["--where", "run=3"], "run"),
    ],
)
def test_what_cannot_be_is_refused(capsys, log, tmp_path, more, words):
    shown = run(capsys, log, "--out", tmp_path / "out", *more, code=2)
    assert words in " ".join(shown.err.split())
    assert not (tmp_path / "out").exists()


def test_a_log_that_stands_is_exit_1(capsys, tmp_path):
    time = np.arange(200) * 0.02
    log = write(tmp_path / "still.csv", time_s=time, piston_m=0.0 * time, voltage_V=0.0 * time)
    shown = run(capsys, log, code=1)
    assert "no voltage steps" in shown.err
