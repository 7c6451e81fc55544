"""``swimbladder faults``: what is printed, written, refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.errors import InputError
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_vehicle
from swimbladder.io.files import write_csv
from swimbladder.physics.seawater import cast_column
from swimbladder.sim.faults import faults
from swimbladder.sim.faults.run import TRACE_COLUMNS
from tests.codegen.conftest import gcc
from tests.docs.test_reference import rows
from tests.quoted import numbers
from tests.vehicles import usual

__all__ = ["gcc"]

LIMIT = ["--time-limit", "1839.8286367098249 s"]
FEW = ["faults", "feup-em", "--missions", "62", "--healthy", "20", *LIMIT]


@pytest.mark.usefixtures("gcc")
def test_a_campaign_and_one_of_its_missions(capsys, tmp_path):
    code = main([*FEW, "--json", "--out", str(tmp_path / "out")])
    told = json.loads(capsys.readouterr().out)
    assert code == (0 if told["passed"] else 1)
    assert told["passed"] == (not told["lost"] and not told["healthy"]["false_alarms"])
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "report.html",
        "faults.json",
        "missions.csv",
        "faults.png",
    }
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]
    assert told["missions"] == 62
    assert told["kinds"][-1]["missions"] == 62
    table = (tmp_path / "out" / "missions.csv").read_text(encoding="utf-8").splitlines()
    number = 7
    head, row = table[0].split(","), table[1 + number].split(",")
    given = dict(zip(head, row, strict=True))
    assert (
        main(
            [
                "faults",
                "feup-em",
                *LIMIT,
                "--repeat",
                "7",
                "--json",
                "--out",
                str(tmp_path / "one"),
            ]
        )
        == 0
    )
    one = json.loads(capsys.readouterr().out)
    assert one["outcomes"]["supervised"] == given["supervised"]
    assert one["outcomes"]["unsupervised"] == given["unsupervised"]
    assert one["reason"] == given["reason"]
    assert one["faults"][0]["kind"] == given["fault_1"]
    assert {p.name for p in (tmp_path / "one").iterdir()} == {
        "report.html",
        "mission-7-supervised.csv",
        "mission-7-unsupervised.csv",
        "mission-7-ideal_detection.csv",
        "mission-7.json",
        "mission-7.png",
    }


@pytest.mark.usefixtures("gcc")
def test_the_table_is_printed(capsys, tmp_path):
    code = main([*FEW, "--full", "--out", str(tmp_path)])
    said = capsys.readouterr()
    kept = json.loads((tmp_path / "faults.json").read_text(encoding="utf-8"))
    for row in kept["kinds"]:  # its name, and its counts
        lines = [line for line in said.out.splitlines() if line.strip().startswith(row["name"])]
        counts = {
            float(row[n])
            for n in ("missions", "recoverable", "recovered", "lost_without_supervisor")
        }
        assert any(counts <= numbers(line) for line in lines), row
    if code == 1:
        assert "--repeat" in said.err


def test_without_a_compiler_one_line_says_what_to_install(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert main([*FEW, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "no C compiler" in said
    assert "Install gcc or clang" in said
    assert not (tmp_path / "out").exists()
    monkeypatch.setenv("CC", "no-such-cc")
    assert main([*FEW, "--out", str(tmp_path / "out")]) == 2
    assert "no-such-cc" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--repeat", "x"], "--repeat"),
        (["--repeat", "999999999"], "eight digits at most"),
        (["--depth-range", "5"], "--depth-range"),
        (["--missions", "0"], "--missions"),
    ],
)
def test_what_is_refused_names_the_option(capsys, tmp_path, options, said):
    assert main([*FEW, *options, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
def test_missions_are_flown_in_the_water_of_a_cast(capsys, tmp_path):
    """In layers; a water that ends above the missions is refused, by Python too."""
    cast, depth = tmp_path / "lake.csv", np.arange(0.0, 8.1, 0.25)
    warm = 8.0 + 14.0 / (1.0 + np.exp((depth - 4.0) / 0.4))
    write_csv(cast, {"pressure_dbar": depth, "temperature_degC": warm, "salinity": 0.0 * depth})
    lake = [
        "--cast",
        str(cast),
        "--latitude",
        "45",
        "--cast-column",
        "pressure_dbar=pressure_dbar@dbar",
    ]
    words = ["faults", "feup-em", "--missions", "8", "--healthy", "2", *lake, *LIMIT]
    shallow = ["--depth-range", "1:5 m"]
    out = ["--out", str(tmp_path / "o"), "--json"]
    assert main([*words, *shallow, *out]) in (0, 1)
    answer = json.loads(capsys.readouterr().out)
    assert answer["water"] == "lake.csv"
    assert main(["faults", "feup-em", "--repeat", "3", *LIMIT, *shallow, *out]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert plain["water"] is None
    assert main([*words, "--repeat", "3", *shallow, *out]) == 0
    assert json.loads(capsys.readouterr().out)["faults"] == plain["faults"]
    column = cast_column(read_cast(cast, latitude=45.0), step=0.1)
    with pytest.raises(InputError) as refused:
        faults(usual(load_vehicle("feup-em"), column=column), missions=2, cast=column)
    assert main([*words, *out]) == 2
    assert refused.value.what in json.loads(capsys.readouterr().out)["error"]


@pytest.mark.usefixtures("gcc")
def test_the_reference_names_what_is_written(capsys, tmp_path):
    page = Path(__file__).parents[2] / "docs" / "reference" / "files-written.md"
    section = page.read_text(encoding="utf-8").partition("## faults\n")[2].partition("\n## ")[0]
    tables = [list(table) for table in rows("files-written.md", "faults")]
    main([*FEW, "--json", "--out", str(tmp_path)])
    missions = (tmp_path / "missions.csv").read_text(encoding="utf-8")
    assert tables[0] == missions.partition("\n")[0].split(",")
    assert tables[1] == list(TRACE_COLUMNS)
    told = json.loads(capsys.readouterr().out)
    many = rows("files-written.md", "Common to all commands")[1]
    assert tables[2] == [key for key in told if key not in many]
    for inner in (*told["kinds"][0], *told["healthy"]):
        assert f"`{inner}`" in section
