"""A cast whose pressure may be in another unit: what the commands that ask for a depth say."""

import gsw
import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.cli.cast_unit import doubted_unit
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.casts import read_cast

PER_DBAR = {"dbar": 1.0, "bar": 0.1, "MPa": 0.01, "kPa": 10.0, "mbar": 100.0}


def written(folder, unit="dbar", deepest=2000.0, header="pressure", depth=False):
    """A sea in a file, its pressures in a unit under a name that says none."""
    p = np.arange(0.0, deepest + 1.0, 2.0)
    columns = [p * PER_DBAR[unit], 3.0 + 15.0 * np.exp(-p / 150.0), np.full_like(p, 35.0)]
    names = f"{header},temperature,salinity"
    if depth:
        columns.append(-gsw.z_from_p(p, 45.0))
        names += ",depth"
    path = folder / f"{unit}.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", fmt="%.6f", header=names, comments="")
    return path


def warned(capsys, cast, asked, rating):
    capsys.readouterr()
    with doubted_unit([cast], asked, rating):
        pass
    return " ".join(capsys.readouterr().err.split())


def metres(dbar):
    return f"{-gsw.z_from_p(dbar, 45.0):.0f} m"


@pytest.mark.parametrize(
    ("unit", "deepest", "asked", "rating"),
    [
        ("bar", 2000.0, 180.0, 2000.0),  # it reaches, and in bar it is a cast for the vehicle
        ("MPa", 2000.0, 15.0, 2000.0),
        ("kPa", 600.0, 500.0, 2000.0),
        ("kPa", 600.0, 1000.0, 2000.0),  # in kPa it ends above what is asked for
        ("kPa", 600.0, 500.0, None),
        ("mbar", 40.0, 30.0, 40.0),
    ],
)
def test_the_unit_that_fits_is_told(capsys, tmp_path, unit, deepest, asked, rating):
    path = written(tmp_path, unit, deepest)
    said = warned(capsys, read_cast(path), asked, rating)
    assert f"{unit}.csv ends at {metres(deepest * PER_DBAR[unit])} if" in said
    assert f"{metres(deepest)} if it is in {unit}" in said
    assert f'"pressure_dbar=pressure@{unit}"' in said
    for told in (unit, "dbar"):  # either answer ends it
        column = {"pressure_dbar": f"pressure@{told}"}
        assert warned(capsys, read_cast(path, columns=column), asked, rating) == ""


@pytest.mark.parametrize(
    ("deepest", "asked", "rating"),
    [
        (2000.0, 180.0, 2000.0),
        (2000.0, 1900.0, None),
        (2000.0, 900.0, 1000.0),  # a deep cast for a shallower vehicle
        (200.0, 180.0, 200.0),
        (300.0, 180.0, 200.0),
        (500.0, 400.0, 2000.0),  # in bar it would be far too deep for the vehicle
    ],
)
def test_of_a_cast_that_fits_as_it_is_nothing_is_said(capsys, tmp_path, deepest, asked, rating):
    assert warned(capsys, read_cast(written(tmp_path, "dbar", deepest)), asked, rating) == ""


def test_depths_beside_tell_the_unit(capsys, tmp_path):
    cast = read_cast(written(tmp_path, "dbar", 200.0, depth=True))
    assert warned(capsys, cast, 180.0, 2000.0) == ""
    plain = read_cast(written(tmp_path, "dbar", 200.0))
    assert "in bar" in warned(capsys, plain, 180.0, 2000.0)


@pytest.mark.parametrize(
    "error", [NoAnswerError("it ends above."), InputError("above", field="cast", remedy="Ask.")]
)
def test_an_error_about_the_depth_says_it_too_and_keeps_its_kind(tmp_path, error):
    cast = read_cast(written(tmp_path, "bar"))
    with pytest.raises(type(error)) as caught, doubted_unit([cast], 1000.0, 2000.0):
        raise error
    assert f"at {metres(2000.0)} if it is in bar" in str(caught.value)
    assert ".." not in str(caught.value).replace("...", "")


MISSION = """schema_version = 1
[[phases]]
kind = "descend"
depth = "{} m"
[[phases]]
kind = "surface"
duration = "10 min"
"""


@pytest.mark.parametrize("command", ["mission", "campaign"])
def test_missions_that_go_deeper_are_refused_with_the_unit(capsys, tmp_path, command):
    task = tmp_path / "task.toml"
    task.write_text(MISSION.format(1000))
    words = [command, "example-float", str(task), "--cast", str(written(tmp_path, "bar"))]
    assert main([*words, "--out", str(tmp_path / "out")]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "m above the 1000 m of the phase" in said
    assert f"at {metres(2000.0)} if it is in bar, the vehicle is rated for 2000 m" in said
    assert not (tmp_path / "out").exists()


def test_a_mission_that_the_cast_reaches_is_flown_with_a_warning(capsys, tmp_path):
    task = tmp_path / "task.toml"
    task.write_text(MISSION.format(180))
    words = ["mission", "example-float", str(task), "--cast", str(written(tmp_path, "bar"))]
    assert main([*words, "--out", str(tmp_path / "out"), "--json"]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "warning: bar.csv ends at" in said
    told = ["--column", "pressure_dbar=pressure@bar"]
    assert main([*words, *told, "--out", str(tmp_path / "out"), "--json"]) == 0
    assert "warning" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (["energy", "example-float"], "--depth"),
        (["ballast", "example-float"], "--deepest"),
    ],
)
def test_a_depth_that_is_asked_for_does_not_silence_it(capsys, tmp_path, words, option):
    more = ["--cast", str(written(tmp_path, "bar")), option, "180 m"]
    assert main([*words, *more, "--out", str(tmp_path / "out")]) == 0
    assert f"{metres(2000.0)} if it is in bar" in " ".join(capsys.readouterr().err.split())


def test_size_and_simulate_say_it(capsys, tmp_path):
    cast = written(tmp_path, "bar")
    words = ["size", "example-float", "--cast", str(cast), "--depth", "1000 m"]
    assert main([*words, "--out", str(tmp_path / "out")]) in (1, 2)
    assert f"{metres(2000.0)} if it is in bar" in " ".join(capsys.readouterr().err.split())
    cast = written(tmp_path, "bar", 30.0)  # 3 m of water, for a vehicle of a pool
    words = ["simulate", "feup-em", "--start", "1.5", "--target", "6", "--duration", "60"]
    assert main([*words, "--cast", str(cast), "--out", str(tmp_path / "out")]) == 1
    assert "30 m if it is in bar" in " ".join(capsys.readouterr().err.split())
