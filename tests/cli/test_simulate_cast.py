"""`simulate --cast`: a vehicle in layered water, from files to files."""

import csv
import json

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.cli import main
from swimbladder.io.casts import read_cast
from swimbladder.physics.seawater import cast_column


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """Fresh water, 22 degrees warm above 4 m and 8 degrees below."""
    path = tmp_path_factory.mktemp("lake") / "lake.csv"
    depth = np.arange(0.0, 15.1, 0.25)
    warmth = 8.0 + 14.0 / (1.0 + np.exp((depth - 4.0) / 0.4))
    np.savetxt(
        path,
        np.column_stack([0.98 * depth, warmth]),
        delimiter=",",
        fmt="%.4f",
        header="Pressure [dbar],Temperature (deg C)",
        comments="",
    )
    return path


def words(lake, folder, *more):
    return [
        "simulate",
        "feup-em",
        "--step",
        "1.5:6",
        "--duration",
        "120",
        "--cast",
        str(lake),
        "--salinity",
        "0",
        "--out",
        str(folder),
        *more,
    ]


def test_the_files_have_what_python_gives(capsys, lake, tmp_path):
    assert main([*words(lake, tmp_path), "--netcdf", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["water"] == "lake.csv"
    assert any(note.startswith("cast: a salinity of 0") for note in found["notes"])
    assert any("N/m3, the cast's mean" in note for note in found["notes"])
    column = cast_column(read_cast(lake, salinity=0.0), step=0.1)
    run = dict(setpoints=[(0.0, 6.0)], duration=120.0, start_depth=1.5)
    v = sb.load_vehicle("feup-em")
    ours, even = sb.simulate(v, cast=column, **run), sb.simulate(v, **run)
    with (tmp_path / "trajectory.csv").open(newline="", encoding="ascii") as file:
        depth = [float(row["depth_m"]) for row in csv.DictReader(file)]
    assert np.array_equal(depth, ours.depth)
    assert found["energy_J"] == ours.balance.energy["source"]
    # 14 degrees are 0.2 % of 27.5 litres: half a decilitre, of which a metre of psi is 4 cm3
    assert ours.volume[0] - even.volume[0] == pytest.approx(60e-6, abs=10e-6)
    assert np.abs(ours.depth - even.depth).max() > 0.2
    import xarray

    with xarray.open_dataset(tmp_path / "trajectory.nc") as data:
        assert data.attrs["title"].endswith("in the water of lake.csv")


def test_a_mission_file_goes_through_it_and_notes_say_where_the_cast_ends(capsys, lake, tmp_path):
    task = tmp_path / "steps.toml"
    task.write_text(
        'schema_version = 1\nstart_depth = "12 m"\nduration = "200 s"\n'
        '[[setpoints]]\ntime = 0\ndepth = "14.9 m"\n'
    )
    words_ = ["simulate", "feup-em", str(task), "--cast", str(lake), "--salinity", "0"]
    assert main([*words_, "--out", str(tmp_path / "out")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "feup-em in the water of lake.csv, law cascade alone, 200.1 s" in said
    assert "and the cast ends at 15 m: below, its last gradient goes on" in said
    task.write_text(task.read_text().replace("14.9 m", "16 m"))
    assert main([*words_, "--out", str(tmp_path / "out")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "lake.csv ends at 15 m, 1 m above the 16 m asked for" in said


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--salinity", "20"], "smaller than the neutral volume there, in the water of the cast"),
        (["--inversions", "no"], "--inversions"),
        (["--latitude", "95"], "--latitude"),
    ],
)
def test_what_cannot_be_is_refused(capsys, lake, tmp_path, more, said):
    arguments = words(lake, tmp_path / "none", *more)
    if "--salinity" in more:
        del arguments[arguments.index("--salinity") : arguments.index("--salinity") + 2]
    assert main(arguments) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert said in error
    assert "Traceback" not in error
    assert not (tmp_path / "none").exists()


def test_options_of_a_cast_need_one(capsys, tmp_path):
    assert main(["simulate", "feup-em", "--salinity", "0", "--out", str(tmp_path / "none")]) == 2
    assert "there is none" in capsys.readouterr().err
