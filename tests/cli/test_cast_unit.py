"""A cast whose pressure may be in another unit: what the commands that ask for a depth say."""

from pathlib import Path

import gsw
import h5netcdf
import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.cli.reading import refuse_doubted_unit
from swimbladder.design.law_comparison import compare_laws
from swimbladder.design.tuning import tune
from swimbladder.errors import InputError
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_mission, load_vehicle
from swimbladder.physics.seawater import cast_column
from swimbladder.physics.seawater.cast import _metres, check_cast_unit
from swimbladder.sim.campaign.run import Floats
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.mission.flight import fly_mission
from tests import quoted

PER_DBAR = {"dbar": 1.0, "bar": 0.1, "MPa": 0.01, "kPa": 10.0, "mbar": 100.0, "psi": 1.4503774}


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


def refused(cast, asked, rating):
    """What is said of the cast; nothing where it is taken."""
    try:
        refuse_doubted_unit([cast], asked, rating)
    except InputError as error:
        return str(error)
    return ""


def metres(dbar):
    return f"{-gsw.z_from_p(dbar, 45.0):.0f} m"


@pytest.mark.parametrize(("depth", "said"), [(9.96, "10.0 m"), (10.0, "10 m"), (10.4, "10 m")])
def test_a_depth_has_a_decimal_above_10_m(depth, said):
    assert _metres(depth) == said


@pytest.mark.parametrize(
    ("unit", "deepest", "asked", "rating"),
    [
        ("bar", 2000.0, 180.0, 2000.0),  # it reaches, and in bar it is a cast for the vehicle
        ("MPa", 2000.0, 15.0, 2000.0),
        ("bar", 2000.0, 150.0, 1000.0),  # a deep cast for a shallower vehicle
        ("kPa", 600.0, 500.0, 2000.0),
        ("kPa", 600.0, 1000.0, 2000.0),  # in kPa it ends above what is asked for
        ("kPa", 600.0, 500.0, None),
        ("mbar", 40.0, 30.0, 40.0),
        ("psi", 200.0, 180.0, 200.0),
    ],
)
def test_the_unit_that_fits_is_told(tmp_path, unit, deepest, asked, rating):
    path = written(tmp_path, unit, deepest)
    said = refused(read_cast(path), asked, rating)
    assert f"the cast ends at {metres(deepest * PER_DBAR[unit])} if it is in dbar" in said
    assert f"{metres(deepest)} if it is in {unit}" in said
    assert f'--cast-column "pressure_dbar=pressure@{unit}"' in said
    for told in (unit, "dbar"):  # either answer ends it
        column = {"pressure_dbar": f"pressure@{told}"}
        assert refused(read_cast(path, columns=column), asked, rating) == ""


@pytest.mark.parametrize(
    ("deepest", "asked", "rating"),
    [
        (2000.0, 180.0, 2000.0),
        (2000.0, 1900.0, None),
        (2000.0, 900.0, 1000.0),  # a deep cast for a shallower vehicle
        (200.0, 180.0, 200.0),
        (240.0, 180.0, 200.0),
        (500.0, 400.0, 2000.0),  # in bar it would be far too deep for the vehicle
    ],
)
def test_of_a_cast_that_fits_as_it_is_nothing_is_said(tmp_path, deepest, asked, rating):
    assert refused(read_cast(written(tmp_path, "dbar", deepest)), asked, rating) == ""


def test_depths_beside_tell_the_unit(tmp_path):
    cast = read_cast(written(tmp_path, "dbar", 200.0, depth=True))
    assert refused(cast, 180.0, 2000.0) == ""
    plain = read_cast(written(tmp_path, "dbar", 200.0))
    assert "in bar" in refused(plain, 180.0, 2000.0)


MISSION = """schema_version = 1
[[phases]]
kind = "descend"
depth = "{} m"
[[phases]]
kind = "surface"
duration = "10 min"
"""


def commands(folder):
    """Every command that takes a cast for a deep float, asked for 180 m; then its own option."""
    task, log = folder / "task.toml", folder / "dive.csv"
    task.write_text(MISSION.format(180))
    rows = [f"{60 * k},{min(k, 60 - k) * 6e4},,{60 * (k == 0)}\n" for k in range(60)]
    log.write_text("time_s,pressure_Pa,pump_s,valve_s\n" + "".join(rows))
    return {
        "mission": (["mission", "example-float", str(task)], "--cast-column"),
        "campaign": (["campaign", "example-float", str(task), "--floats", "2"], "--cast-column"),
        "ballast": (["ballast", "example-float", "--max-depth", "180 m"], "--cast-column"),
        "whole": (["ballast", "example-float"], "--cast-column"),
        "energy": (["energy", "example-float", "--max-depth", "180 m"], "--cast-column"),
        "size": (["size", "example-float", "--max-depth", "180 m"], "--cast-column"),
        "identify": (["identify", str(log), "--vehicle", "example-float"], "--cast-column"),
    }


@pytest.mark.parametrize("called", [tune, compare_laws])
def test_python_refuses_as_the_commands_do(tmp_path, called):
    column = cast_column(read_cast(written(tmp_path, "bar")))
    with quoted.refused(InputError, field="pressure_dbar"):
        called(load_vehicle("example-float"), depth_range=(100.0, 180.0), cast=column)


@pytest.mark.parametrize(
    "command", ["mission", "campaign", "ballast", "whole", "energy", "size", "identify"]
)
def test_every_command_refuses_alike(capsys, tmp_path, command):
    words, option = commands(tmp_path)[command]
    out = tmp_path / "out"
    assert main([*words, "--cast", str(written(tmp_path, "bar")), "--out", str(out)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"states no unit: the cast ends at {metres(200.0)} if it is in dbar" in said
    assert f"{metres(2000.0)} if it is in bar; the vehicle is rated for 2000 m" in said
    assert f'Say which, with {option} "pressure_dbar=pressure@bar" or {option} "' in said
    assert not out.exists()


def test_a_header_that_states_dbar_makes_it_a_warning(capsys, tmp_path):
    for header in ("pressure_dbar", "Pressure [dbar]"):
        cast = read_cast(written(tmp_path, "bar", header=header))
        assert refused(cast, 180.0, 2000.0) == ""
        said = " ".join(capsys.readouterr().err.split())
        assert f"warning: bar.csv: the column '{header}' is taken at its word" in said
        assert f'--cast-column "pressure_dbar={header}@bar"' in said
    lake = read_cast(written(tmp_path, "dbar", 15.0, header="Pressure [dbar]"))
    assert refused(lake, 6.0, 100.0) == ""  # in bar it would end at 150 m
    deep = read_cast(written(tmp_path, "dbar", 2000.0, header="Pressure [dbar]"))
    assert refused(deep, 30.0, 1000.0) == ""  # in kPa it would end at 200 m
    assert capsys.readouterr().err == ""
    cast = read_cast(written(tmp_path, "bar", header="Pressure [bar]"))
    assert refused(cast, 180.0, 2000.0) == ""
    assert capsys.readouterr().err == ""


def in_netcdf(folder, unit, name, attribute):
    """The same sea in a netCDF file: its variable of pressures so called, with such `units`."""
    table = np.loadtxt(written(folder, unit), delimiter=",", skiprows=1)
    path = folder / "cast.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"N": len(table)}
        units = (attribute, "degree_Celsius", "1")
        for called, unit_of, v in zip((name, "TEMP", "PSAL"), units, table.T, strict=True):
            variable = file.create_variable(called, ("N",), "f8", data=v)
            if unit_of:
                variable.attrs["units"] = unit_of
    return path


@pytest.mark.parametrize(
    ("unit", "name", "attribute", "what"),
    [
        ("bar", "PRES", "", "the column 'PRES' states no unit"),  # as a CSV's
        ("bar", "pressure_dbar", "", "taken at its word"),
        ("bar", "PRES", "decibar", "taken at its word"),
        ("bar", "PRES_BAR", "", ""),
        ("kPa", "PRES_KPA", "", ""),
        ("kPa", "PRES", "kPa", ""),
        ("dbar", "pressure_kPa", "dbar", ""),  # the attribute counts before the name
    ],
)
def test_a_netcdf_file_is_held_to_the_same_rule(capsys, tmp_path, unit, name, attribute, what):
    cast = read_cast(in_netcdf(tmp_path, unit, name, attribute))
    said = refused(cast, 180.0, 2000.0) + " ".join(capsys.readouterr().err.split())
    assert what in said if what else not said
    assert ("warning" in said) == (what == "taken at its word")
    if what:
        assert all(f'"pressure_dbar={name}@{one}"' in said for one in ("bar", "dbar"))
    else:
        assert cast.pressure[-1] == pytest.approx(2000.0)


def test_either_unit_that_is_said_is_taken(tmp_path):
    words = [
        "energy",
        "example-float",
        "--max-depth",
        "180 m",
        "--out",
        str(tmp_path / "out"),
        "--json",
    ]
    words += ["--cast", str(written(tmp_path, "bar")), "--cast-column"]
    for unit in ("bar", "dbar"):
        assert main([*words, f"pressure_dbar=pressure@{unit}"]) == 0


def test_pools_and_tanks_are_no_exception(capsys, tmp_path):
    cast = str(written(tmp_path, "bar", 80.0))  # 8 m of water
    out = ["--cast", cast, "--out", str(tmp_path / "out")]
    words = ["simulate", "feup-em", "--step", "1.5:6", "--duration", "60"]
    assert main([*words, *out]) == 2
    assert f"at {metres(80.0)} if it is in bar" in " ".join(capsys.readouterr().err.split())
    log = tmp_path / "log.csv"
    log.write_text("time_s,depth_m,volume_m3\n0,1.5,0\n1,1.5,0\n")
    for command in ("compare", "identify"):
        assert main([command, str(log), "--vehicle", "feup-em", *out]) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert '--cast-column "pressure_dbar=pressure@bar"' in said


@pytest.mark.parametrize("command", ["mission", "campaign", "ballast", "energy"])
def test_a_cast_of_known_unit_that_is_too_short_is_bad_input_everywhere(capsys, tmp_path, command):
    """Exit code 2, whichever command: the answer is not no, it is not known."""
    words, _ = commands(tmp_path)[command]
    (tmp_path / "task.toml").write_text(MISSION.format(1000))
    words = ["1000 m" if word == "180 m" else word for word in words]
    cast = str(written(tmp_path, "dbar", 600.0, header="pressure_dbar"))
    assert main([*words, "--cast", cast, "--out", str(tmp_path / "out")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "Take a cast that goes as deep, or ask for a lesser depth" in said


def test_python_refuses_what_the_commands_refuse(tmp_path):
    """The water of a cast knows the cast: who flies in it asks for the unit."""
    vehicle = load_vehicle("example-float")
    (tmp_path / "task.toml").write_text(MISSION.format(180))
    task = load_mission(tmp_path / "task.toml")
    cast = read_cast(written(tmp_path, "bar"))
    with pytest.raises(InputError) as asked:
        check_cast_unit(cast, 180.0, 2000.0)
    for fly in (
        lambda water: fly_mission(vehicle, task, water),
        lambda water: Floats(
            vehicle=vehicle, mission=task, columns=[water], floats=1, store=Path("campaign.zarr")
        ),
    ):
        with pytest.raises(InputError) as caught:
            fly(cast_column(cast))
        assert str(caught.value) == str(asked.value)
    feup = load_vehicle("feup-em")
    shallow = read_cast(written(tmp_path, "bar", 80.0))
    with pytest.raises(InputError) as caught:
        simulate(
            feup,
            setpoints=[(0.0, 6.0)],
            duration=60.0,
            start_depth=1.5,
            cast=cast_column(shallow, step=0.1),
        )
    with pytest.raises(InputError) as asked:
        check_cast_unit(shallow, 6.0, 100.0)
    assert str(caught.value) == str(asked.value)


def test_a_cast_that_ends_above_a_phase_is_refused_in_python_as_by_the_command(tmp_path, capsys):
    vehicle = load_vehicle("example-float")
    (tmp_path / "task.toml").write_text(MISSION.format(1050))
    task = load_mission(tmp_path / "task.toml")
    path = written(tmp_path, "dbar", 904.0, header="pressure_dbar")
    words = ["mission", "example-float", str(tmp_path / "task.toml"), "--cast", str(path)]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    by_command = " ".join(capsys.readouterr().err.split())
    for fly in (
        lambda water: fly_mission(vehicle, task, water),
        lambda water: fly_mission(vehicle, task, water, checked=False),
        lambda water: Floats(
            vehicle=vehicle, mission=task, columns=[water], floats=1, store=Path("campaign.zarr")
        ),
    ):
        with pytest.raises(InputError) as caught:
            fly(cast_column(read_cast(path)))
        error = caught.value
        assert (error.field, error.unit) == ("cast", "m")
        assert error.value == pytest.approx(-gsw.z_from_p(904.0, 45.0), abs=3.0)
        assert " ".join(str(error).split()) in by_command
