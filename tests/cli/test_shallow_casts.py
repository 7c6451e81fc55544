"""`identify --cast` and `compare --cast` of a shallow float, from files to files."""

import json

import pytest

from swimbladder.cli import main
from swimbladder.io.files import write_csv
from swimbladder.io.vehicle_file import vehicle_file
from tests.layered import COLUMN_HEADER, cast_rows, sailed, vehicle


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A vehicle, its log, and the cast that has the densities of the log's water."""
    folder = tmp_path_factory.mktemp("shallow")
    v, log = vehicle(), sailed(vehicle(), seed=9)
    (folder / "float.toml").write_text(vehicle_file(v))
    write_csv(
        folder / "log.csv", {"time_s": log.time, "depth_m": log.depth, "volume_m3": log.volume}
    )
    (folder / "cast.csv").write_text("\n".join([COLUMN_HEADER, *cast_rows()]) + "\n")
    return folder


def words(files, command, *more):
    return [
        command,
        str(files / "log.csv"),
        "--vehicle",
        str(files / "float.toml"),
        "--column",
        "volume_m3=volume_m3",
        "--out",
        str(files / command),
        *more,
    ]


def answer(capsys, arguments, code=0):
    capsys.readouterr()
    assert main([*arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_compare_and_ahead_follow_the_cast(capsys, files):
    cast = ["--cast", str(files / "cast.csv")]
    more = ["--horizons", "10 s", "--free", "neutral_volume,start_depth,start_speed"]
    ends = ((cast, 0), ([], 1))  # in other water the volume explains nothing
    found = [answer(capsys, words(files, "compare", *more, *c), code) for c, code in ends]
    assert "(--cast)" in found[1]["findings"][0]["sentence"]
    assert found[0]["rms_m"] < 0.006 < 0.1 < found[1]["rms_m"]
    ahead = [f["ahead"]["horizons"][0]["rms_m"] for f in found]
    assert ahead[0] < 0.6 * ahead[1]


def test_what_is_said_of_the_cast_is_not_of_the_log(capsys, files):
    rows = [line.split(",") for line in (files / "cast.csv").read_text().splitlines()]
    k = next(i for i, name in enumerate(rows[0]) if name.startswith("pressure"))
    odd = files / "odd.csv"
    odd.write_text(
        "\n".join(
            ",".join([*r[:k], f"{10.0 * float(r[k]):g}" if i else "Druck", *r[k + 1 :]])
            for i, r in enumerate(rows)
        )
        + "\n"
    )
    cast = ["--cast", str(odd)]
    assert main(words(files, "compare", *cast)) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert '--cast-column "pressure_dbar=NAME@UNIT"' in said
    mapped = answer(
        capsys, words(files, "compare", *cast, "--cast-column", "pressure_dbar=Druck@kPa")
    )
    plain = answer(capsys, words(files, "compare", "--cast", str(files / "cast.csv")))
    assert mapped["rms_m"] == pytest.approx(plain["rms_m"], rel=1e-3)
    assert main(words(files, "compare", *cast, "--cast-profile", "2")) == 2
    two = files / "two.csv"
    lines = (files / "cast.csv").read_text().splitlines()
    two.write_text("\n".join([*lines, *lines[:0:-1], *lines[1:]]) + "\n")
    capsys.readouterr()
    assert main(words(files, "compare", "--cast", str(two))) == 2
    assert "Choose one with --cast-profile 1, or" in " ".join(capsys.readouterr().err.split())
    again = answer(capsys, words(files, "compare", "--cast", str(two), "--cast-profile", "3"))
    assert again["rms_m"] == pytest.approx(plain["rms_m"], rel=1e-9)


@pytest.mark.prove
def test_identify_of_a_piston_float_takes_the_cast(capsys, files):
    cast = ["--cast", str(files / "cast.csv"), "--no-profiles", "--neutral-std", "5 cm3"]
    found = answer(capsys, words(files, "identify", *cast))
    v = vehicle()
    T2 = found["parameters"]["T2"]
    assert T2["value"] == pytest.approx(v.mass / v.drag.k_dl, rel=0.05)
    assert any("density of the cast" in said for said in found["assumptions"])


@pytest.mark.parametrize("command", ["compare", "identify"])
def test_what_does_not_go_together_is_refused(capsys, files, command):
    cast = ["--cast", str(files / "cast.csv")]
    for more, said in (
        (["--cast-where", "dive=1"], "how to read a cast, and there is none"),
        (["--cast-column", "salinity=S"], "how to read a cast, and there is none"),
        (["--cast-profile", "2"], "how to read a cast, and there is none"),
        ([*cast, *cast], "2 casts for 1 log"),
        ([*cast, "--drive", "voltage"], "--drive"),
        (["--cast", str(files / "none.csv")], "none.csv"),
    ):
        assert main(words(files, command, *more)) == 2
        error = capsys.readouterr().err
        assert said in " ".join(error.split())
        assert "Traceback" not in error
    if command == "identify":
        assert main(words(files, command, *cast, "--paper")) == 2
        assert "do not model layered water" in capsys.readouterr().err
