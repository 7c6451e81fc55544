"""`swimbladder ballast`: what it says, writes and refuses."""

import csv
import json

import gsw
import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_vehicle
from swimbladder.io.vehicle_file import vehicle_template
from swimbladder.physics.hull import check_mass, neutral_volume, weight_mass
from swimbladder.physics.seawater import cast_column
from tests.docs.test_reference import check, rows


@pytest.fixture
def cast(tmp_path):
    lines = ["pressure_dbar,temperature_degC,salinity"]
    lines += [f"{p},{4.0 + 12.0 * np.exp(-p / 150.0):.4f},35.0" for p in range(0, 1100, 5)]
    path = tmp_path / "cast.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def run(cast, out, *options):
    place = ("--latitude", "43 deg", "--longitude", "8")
    return main(["ballast", "example-eh", "--cast", str(cast), *place, *options, "--out", str(out)])


def test_a_neutral_depth_in_words_and_files(capsys, tmp_path, cast):
    out = tmp_path / "out"
    assert run(cast, out, "--neutral-depth", "500 m") == 0
    said = capsys.readouterr().out
    assert "To be neutral at 500 m with a volume of 0 cm3: add " in said
    assert "The stroke covers it with a probability of more than 99" in said
    assert "it goes down to 1000 m (its rating)" in said
    assert {p.name for p in out.iterdir()} == {
        "report.html",
        "ballast.png",
        "ballast.csv",
        "ballast.json",
        "vehicle.toml",
    }
    with (out / "ballast.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 1001
    at = float(rows[500]["neutral_volume_m3"])
    assert at == pytest.approx(0.0, abs=1e-12)
    assert (
        float(rows[500]["neutral_volume_low_m3"]) < at < float(rows[500]["neutral_volume_high_m3"])
    )


def test_the_vehicle_that_is_written_is_the_one_that_was_ballasted(capsys, tmp_path, cast):
    out = tmp_path / "out"
    assert run(cast, out, "--neutral-depth", "500 m", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    made, given = load_vehicle(out / "vehicle.toml"), load_vehicle("example-eh")
    assert weight_mass(made) - weight_mass(given) == pytest.approx(answer["added_kg"])
    assert made.trim_error == pytest.approx(answer["trim_error_m3"])
    column = cast_column(read_cast(cast, latitude=43.0, longitude=8.0), 1000.0)
    assert neutral_volume(made, column)[500] == pytest.approx(0.0, abs=1e-10)
    assert answer["covered"] is True
    columns, keys = rows("files-written.md", "ballast")
    check(keys, answer)
    with (out / "ballast.csv").open() as file:
        assert next(csv.reader(file)) == list(columns)
    assert answer == json.loads((out / "ballast.json").read_text()) | {"files": answer["files"]}


def test_a_stroke_that_is_short_is_exit_1_with_the_numbers(capsys, tmp_path, cast):
    out = tmp_path / "out"
    code = run(cast, out, "--neutral-depth", "500 m", "--neutral-volume=-240 cm3")
    assert code == 1
    said = capsys.readouterr().out
    assert "The stroke does NOT cover it" in said
    assert "cm3 at the retracted end (95 %): too light to sink past 1000 m." in said
    assert "With the best trim (add" in said
    assert (out / "ballast.json").exists()


def test_without_a_cast_it_is_the_papers_water(capsys, tmp_path):
    options = ["--json", "--out", str(tmp_path / "out")]
    assert main(["ballast", "example-eh", *options]) == 0
    answer = json.loads(capsys.readouterr().out)
    (need,) = answer["casts"]
    assert need["least_m3"] == pytest.approx(-78e-6, abs=1e-9)  # psi z of the file
    assert answer["psi"]["psi_m3_m"] == pytest.approx(-7.8e-8)
    assert answer["added_kg"] == 0.0


def test_uncertainty_is_taken_from_the_options(capsys, tmp_path, cast):
    options = ("--neutral-depth", "500 m", "--json")
    assert run(cast, tmp_path / "a", *options) == 0
    sure = json.loads(capsys.readouterr().out)
    more = (
        "--mass-std",
        "30 g",
        "--volume-std",
        "20 cm3",
        "--heat-std",
        "1e-5 1/K",
        "--psi-std",
        "0.02 cm3/m",
        "--density-std",
        "0.5 kg/m3",
        "--air-std",
        "1 cm3",
    )
    assert run(cast, tmp_path / "b", *options, *more) == 0
    unsure = json.loads(capsys.readouterr().out)
    assert unsure["uncertainty"]["mass"] == 0.03
    assert unsure["uncertainty"]["trim"] == 0.0
    assert unsure["margin_m3"] < sure["margin_m3"] - 20e-6
    assert unsure["spread_m3"]["volume"] == pytest.approx(20e-6)


def test_a_mass_on_the_scale_takes_the_place_of_the_trim(capsys, tmp_path, cast):
    assert run(cast, tmp_path / "a", "--neutral-depth", "500 m", "--json") == 0
    trimmed = json.loads(capsys.readouterr().out)
    heavier = weight_mass(load_vehicle("example-eh")) + 0.1
    options = ("--mass", f"{heavier} kg", "--mass-std", "2 g", "--volume-std", "5 cm3")
    assert run(cast, tmp_path / "b", "--neutral-depth", "500 m", "--json", *options) == 0
    weighed = json.loads(capsys.readouterr().out)
    # 100 g less of weight have to be added, in lead: by what lead weighs in water
    rho = 1029.9  # kg/m3 at 500 m
    less = trimmed["added_kg"] - weighed["added_kg"]
    assert less == pytest.approx(0.1 / (1.0 - rho / 11340.0), rel=1e-3)
    assert any("as given" in line for line in weighed["assumptions"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--max-depth", "2000 m"], "deeper than the vehicle is rated for, 1000 m"),
        (["--neutral-depth", "500 dbar"], "--neutral-depth"),
        (["--mass", "45 g"], "--mass"),
        (["--material", "cork"], "no such ballast"),
        (["--material", "900 kg/m3"], "not denser than the water"),
        (["--probability", "99"], "--probability"),
        (["--inversions", "ignore"], "--inversions"),
        (["--psi-std", "-1 cm3/m"], "--psi-std"),
        (["--cast-profile", "4"], "1 profile"),
        (["--cast-column", "pressure=p"], "no such column of a cast"),
        (["--cast-column", "salinity=a", "--cast-column", "salinity=b"], "given twice"),
        (["--cast-where", "dive=1"], "no such column to choose rows by"),
    ],
)
def test_bad_input_is_exit_2_and_nothing_is_written(capsys, tmp_path, cast, options, words):
    out = tmp_path / "out"
    assert run(cast, out, *options) == 2
    said = capsys.readouterr().err.replace("\n", " ")
    assert words in said
    assert "Traceback" not in said
    assert not out.exists()


def test_a_cast_that_ends_above_the_target(capsys, tmp_path, cast):
    short = tmp_path / "short.csv"
    short.write_text("\n".join(cast.read_text().splitlines()[:100]) + "\n")
    code = main(
        [
            "ballast",
            "example-eh",
            "--cast",
            str(short),
            "--max-depth",
            "1000 m",
            "--out",
            str(tmp_path / "out"),
        ]
    )
    assert code == 2
    assert "above 1000 m" in capsys.readouterr().err.replace("\n", " ")


def shortened(cast, rows):
    short = cast.with_name("short.csv")
    short.write_text("\n".join(cast.read_text().splitlines()[: rows + 1]) + "\n")
    return short


def test_a_cast_that_ends_far_above_the_rating_is_refused_unless_that_is_asked(
    capsys, tmp_path, cast
):
    out = tmp_path / "out"
    lines = cast.read_text().splitlines()
    bar = tmp_path / "bar.csv"  # pressure in bar under a name that says no unit
    rows = [line.split(",") for line in lines[1:]]
    lines = [f"{float(p) / 10.0},{t},{s}" for p, t, s in rows]
    bar.write_text("\n".join(["pressure,temperature,salinity", *lines]) + "\n")
    assert run(bar, out) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "the cast ends at 108 m if it is in dbar" in said
    assert "if it is in bar; the vehicle is rated for 1000 m" in said
    assert not out.exists()
    assert run(bar, out, "--cast-column", "pressure_dbar=pressure@bar") == 0
    assert "warning" not in capsys.readouterr().out
    short = shortened(cast, 60)  # 295 dbar
    assert run(short, out) == 2
    end = int(-gsw.z_from_p(295.0, 43.0))  # m
    assert f'--max-depth "{end} m"' in capsys.readouterr().err
    assert run(short, out, "--max-depth", f"{end} m") == 0


def test_a_cast_that_ends_somewhat_above_the_rating_is_told_first(capsys, tmp_path, cast):
    short = shortened(cast, 141)  # 700 dbar
    assert run(short, tmp_path / "out") == 0
    said = capsys.readouterr().out.splitlines()
    end = int(-gsw.z_from_p(700.0, 43.0))  # m
    ends = f"warning: short.csv ends at {end} m, the vehicle is rated for 1000 m"
    assert said[1].startswith(ends)
    assert run(short, tmp_path / "out", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["assumptions"][0] == said[1].removeprefix("warning: ")


@pytest.mark.parametrize(("share", "warned"), [(1.01, False), (1.03, True), (0.97, True)])
def test_a_dry_mass_that_contradicts_the_trim_is_told_first(capsys, tmp_path, share, warned):
    text = vehicle_template("pump-valve").replace("28.19 kg", f"{28.1875 * share} kg")
    file = tmp_path / "mine.toml"
    file.write_text(text)
    assert main(["ballast", str(file), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[1].startswith("warning: the vehicle's file says a dry mass of") is warned
    if warned:
        assert "wrong by 3 %" in said[1]
    mass = ["--mass", "28.19 kg", "--mass-std", "10 g", "--volume-std", "10 cm3"]
    assert main(["ballast", str(file), *mass, "--out", str(tmp_path / "out")]) in (0, 1)
    assert "warning" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("share", "said"), [(10.0, "sinks in any water"), (0.1, "floats in any water")]
)
@pytest.mark.parametrize("command", ["ballast", "mission", "campaign", "simulate"])
def test_a_dry_mass_that_no_water_carries_is_refused(capsys, tmp_path, command, share, said):
    """A factor 10 is a slip of the unit; a factor 3 may be inertia with the water that moves."""
    kind, mass = ("electromechanical", 27.5) if command == "simulate" else ("pump-valve", 28.19)
    file, task, out = tmp_path / "mine.toml", tmp_path / "task.toml", tmp_path / "out"
    file.write_text(vehicle_template(kind).replace(f"{mass} kg", f"{mass * share:.6g} kg"))
    task.write_text(
        'schema_version = 1\n[[phases]]\nkind = "surface"\nduration = "1 min"\ntimeout = "2 min"\n'
    )
    more = {
        "ballast": [],
        "mission": [str(task)],
        "campaign": [str(task), "--floats", "1"],
        "simulate": ["--duration", "3 s"],
    }[command]
    assert main([command, str(file), *more, "--out", str(out)]) == 2
    printed = " ".join(capsys.readouterr().err.split())
    assert said in printed
    assert ", motion.dry_mass: a vehicle that displaces" in printed
    assert f"(got {mass * share:.6g}" in printed
    assert not out.exists()
    for believed in (0.6, 3.0):
        file.write_text(vehicle_template(kind).replace(f"{mass} kg", f"{mass * believed:.6g} kg"))
        check_mass(load_vehicle(file))


def test_options_that_would_have_no_effect_are_refused(capsys, tmp_path, cast):
    out = str(tmp_path / "out")
    assert main(["ballast", "example-eh", "--salinity", "0", "--out", out]) == 2
    assert "--salinity: it says how to read a cast" in capsys.readouterr().err.replace("\n", " ")
    assert run(cast, tmp_path / "out", "--neutral-volume", "1 cm3") == 2
    assert "needs the depth" in capsys.readouterr().err.replace("\n", " ")


def test_a_latitude_beyond_the_pole(capsys, tmp_path, cast):
    code = main(
        [
            "ballast",
            "example-eh",
            "--cast",
            str(cast),
            "--latitude",
            "143",
            "--out",
            str(tmp_path / "out"),
        ]
    )
    assert code == 2
    assert "it must be -90 or more and 90 at most" in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.data
def test_a_float_in_the_ligurian_sea(capsys, tmp_path, data_dir):
    path = data_dir / "mermaid_p0051" / "ctd_profiles.csv.gz"
    code = main(
        [
            "ballast",
            "example-eh",
            "--cast",
            str(path),
            "--cast-where",
            "profile_time=2020-07-03 21:54:40",
            "--neutral-depth",
            "500 m",
            "--json",
            "--out",
            str(tmp_path / "out"),
        ]
    )
    assert code == 0
    answer = json.loads(capsys.readouterr().out)
    # From the surface to 1000 m the float's sea gets 7 kg/m3 denser: 0.68 % of 44 L is 300 cm3,
    # of which the hull gives back V_p beta p = 116 cm3.
    (need,) = answer["casts"]
    assert need["most_m3"] - need["least_m3"] == pytest.approx(183e-6, abs=15e-6)
    assert answer["covered"]
