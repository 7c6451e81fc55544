"""The command `size`: its files, its JSON and its refusals."""

import csv
import json
import re

import pytest

from swimbladder.cli import main
from swimbladder.io.config import load_vehicle
from tests.docs.test_reference import check, rows

PARTS = """
schema_version = 1
supplies = ["24 V"]
[[motors]]
name = "motor"
voltage = "24 V"
resistance = "0.61 ohm"
torque_constant = "25.9 mN m/A"
rotor_inertia = "34 g cm2"
rated_torque = "85 mN m"
largest_speed = "10000 rpm"
mass = "240 g"
[[pumps]]
name = "pump"
displacement = "0.02 cc/rev"
efficiency = "76 %"
largest_pressure = "400 bar"
largest_speed = "5000 rpm"
mass = "300 g"
[[batteries]]
name = "cells"
specific_energy = "170 Wh/kg"
usable = "80 %"
"""


@pytest.fixture
def parts(tmp_path):
    file = tmp_path / "parts.toml"
    file.write_text(PARTS)
    return str(file)


def test_it_writes_a_vehicle_the_drives_and_pictures(capsys, tmp_path, parts):
    out = tmp_path / "sized"
    words = ["size", "example-eh", "--max-depth", "800 m", "--parts", parts, "--out", str(out)]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    columns, keys = rows("files-written.md", "size")
    check(keys, told)
    assert told["combinations"] == told["feasible"] == 1
    names = [
        "drives.csv",
        "drives.png",
        "parts.png",
        "report.html",
        "requirements.png",
        "size.json",
        "vehicle.toml",
    ]
    assert sorted(p.name for p in out.iterdir()) == names
    with (out / "drives.csv").open() as file:
        table = list(csv.DictReader(file))
    assert set(table[0]) == set(columns)
    assert float(table[0]["mass_kg"]) == pytest.approx(told["chosen"]["mass_kg"])
    vehicle = load_vehicle(out / "vehicle.toml")
    assert vehicle.actuator.kind == told["chosen"]["parts"]["kind"] == table[0]["kind"]
    assert vehicle.stroke.maximum - vehicle.stroke.minimum == pytest.approx(told["stroke_m3"])
    assert json.loads((out / "size.json").read_text()).keys() == told.keys() - {"files"}


def test_the_vehicle_and_the_answer_are_for_a_person_to_read(capsys, tmp_path, parts):
    out = tmp_path / "sized"
    words = ["size", "example-eh", "--max-depth", "800 m", "--parts", parts, "--out", str(out)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "least mass: pump-valve, motor, " in said
    assert "motor motor" not in said
    text = (out / "vehicle.toml").read_text()
    digits = [re.sub(r"e.*|[-.]", "", n).lstrip("0") for n in re.findall(r"= (-?[\d.e-]+)", text)]
    assert len(digits) > 20
    assert max(len(number) for number in digits) <= 12


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--max-depth", "-3 m"], 2, "--max-depth"),
        (["--max-depth", "1200 m"], 2, "rated for 1000 m"),
        (["--goal", "cost"], 2, "Choose from mass, energy"),
        (["--speed", "3 kg"], 2, "--speed"),
        (["--hotel", "-1 W"], 2, "--hotel: it must be 0 or more (got '-1 W'"),
        (
            ["--stroke-reserve", "10"],
            2,
            "--stroke-reserve: it must be 0 or more and 1 at most (got '10')",
        ),
        (["--cycles", "0"], 2, "--cycles"),
        (["--park-time", "-1 s"], 2, "--park-time"),
        (["--max-mass", "1 kg"], 1, "% of the mass that drive and battery"),
    ],
)
def test_refusals_name_what_is_wrong_and_write_nothing(
    capsys, tmp_path, parts, options, code, words
):
    out = tmp_path / "out"
    assert main(["size", "--parts", parts, *options, "--out", str(out)]) == code
    assert words in " ".join(capsys.readouterr().err.split())
    assert not out.exists()
