"""``swimbladder firmware``: what is printed, written, refused."""

import json
import re

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.io.presets import preset_text
from tests.docs.test_reference import check, rows

LIMIT = ["--time-limit", "2 h"]
QUICK = ["firmware", "feup-em", "--duration", "30 s", *LIMIT]


def test_it_writes_a_library_and_says_what_to_do(capsys, tmp_path):
    assert main([*QUICK, "--full", "--out", str(tmp_path / "library")]) == 0
    printed = capsys.readouterr().out
    for said in (
        "law cascade every 0.3 s, command -12 to 12 V",
        "1.5 to 3 m in 101 ticks",
        "fill in the two functions",
    ):
        assert said in printed
    written = {str(p.relative_to(tmp_path / "library")) for p in tmp_path.rglob("*") if p.is_file()}
    assert {"library.properties", "README.md", "src/swb_cascade.c", "extras/golden.csv"} <= written
    assert {"report.html", "firmware.json", "extras/golden.png"} <= written
    wrote = printed.splitlines()[-1].removeprefix(f"wrote to {tmp_path / 'library'}: ")
    assert written == set(wrote.split(", "))


@pytest.mark.parametrize(("duration", "short"), [("5 s", True), ("60 s", False)])
def test_a_golden_trace_that_does_not_arrive_is_said(capsys, tmp_path, duration, short):
    assert (
        main(["firmware", "feup-em", *LIMIT, "--duration", duration, "--out", str(tmp_path)]) == 0
    )
    assert ("before the vehicle has arrived" in capsys.readouterr().out) == short


def test_json_is_one_object(capsys, tmp_path):
    code = main(
        [
            "firmware",
            *LIMIT,
            "ntnu-bv",
            "--law",
            "position-pid",
            "--step",
            "50 cm:1.2 m",
            "--duration",
            "1 min",
            "--json",
            "--out",
            str(tmp_path),
        ]
    )
    assert code == 0
    told = json.loads(capsys.readouterr().out)
    floats = {"drive"}  # of a pump and valve only
    (keys,) = rows("files-written.md", "firmware")
    check(set(keys) - floats, told)
    assert set(told["golden"]) == set(re.findall(r"`(\w+)`", keys["golden"][0]))
    assert told["command"] == "volume"
    assert told["command_limits"] == pytest.approx([-3.2358e-5, 3.2358e-5], rel=1e-4)
    assert told["parameters"]["K_p"] == {"value": float(np.float32(0.026)), "unit": "m/m"}
    assert told["golden"]["target_depth_m"] == 1.2
    assert told["golden"]["ticks"] == 124
    table = (tmp_path / "extras" / "golden.csv").read_text().splitlines()
    assert len(table) == 125 + 11 + 15  # and the sensor that fails
    assert table[0].endswith(",reference_volume_m3,supervisor_reason")


def test_the_library_is_the_same_twice(capsys, tmp_path):
    for name in ("one", "two"):
        assert main([*QUICK, "--out", str(tmp_path / name)]) == 0
    capsys.readouterr()
    for path in (tmp_path / "one").rglob("*.*"):
        assert (
            path.read_bytes()
            == (tmp_path / "two" / path.relative_to(tmp_path / "one")).read_bytes()
        )


def test_another_seed_is_another_trace(tmp_path, capsys):
    noisy = tmp_path / "noisy.toml"
    noisy.write_text(
        preset_text("feup-em").replace(
            "[controller]", '[sensors]\ndepth_noise = "2 mm"\n[controller]', 1
        )
    )
    traces = []
    for seed in ("1", "2"):
        out = tmp_path / seed
        assert (
            main(
                [
                    "firmware",
                    str(noisy),
                    *LIMIT,
                    "--duration",
                    "9 s",
                    "--seed",
                    seed,
                    "--out",
                    str(out),
                ]
            )
            == 0
        )
        traces.append((out / "extras" / "golden.csv").read_text())
    capsys.readouterr()
    assert traces[0] != traces[1]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--law", "position-pid"], "is of the law 'cascade'"),
        (["--law", "cascad"], "Did you mean cascade?"),
        (["--step", "1.5:-1 m"], "--step"),
        (["--step", "1.5:3 s"], "--step"),
        (["--step", "200:3 m"], "supervisor turns the vehicle round at 49.98 m"),
        (["--duration", "0.1 s"], "shorter than one sample"),
        (["--duration", "0 s"], "above 0"),
        (["--bottom-depth", "4.5 s"], "--bottom-depth"),
        (["--rounds", "2"], "Give --bottom-depth"),
        (["--bottom-depth", "1 m"], "between the depths of rest"),
        (
            ["--bottom-depth", "4.5 m", "--volume-changes", "10:400 cm3"],
            "got '10:400 cm3', expected unit cm3",
        ),
        (
            ["--bottom-depth", "4.5 m", "--volume-changes", "10 : 400 cm3"],
            "got '10 : 400 cm3', expected",
        ),
        (
            ["--bottom-depth", "4.5 m", "--volume-changes", "10 cm3:500 mL"],
            "got '10 cm3:500 mL', expected",
        ),
        (["--bottom-depth", "4.5 m", "--volume-changes", "0 m3"], "has to be above 0"),
        (["--bottom-depth", "4.5 m", "--volume-changes", "10:"], "--volume-changes"),
        (["--bottom-depth", "4.5 m", "--volume-changes", "10:20 m"], "--volume-changes"),
        (["--bottom-depth", "4.5 m", "--clearance", "2.2 m"], "smaller --clearance"),
        (["--bottom-depth", "4.5 m", "--rounds", "0"], "of at least 1"),
    ],
)
def test_what_is_refused_names_the_option(capsys, tmp_path, options, said):
    assert main(["firmware", "feup-em", *LIMIT, *options, "--out", str(tmp_path / "out")]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_a_vehicle_without_a_controller_is_refused(capsys, tmp_path):
    text = preset_text("feup-em")
    bare = tmp_path / "bare.toml"
    for line in ("S_p = 0.3 s", "Table 3, in dm3 as printed; eqs (36)-(37)"):
        place = "sample_time" if line.startswith("S") else "parameters"
        before = "section 3.2: " if place == "sample_time" else ""
        text = text.replace(f'"controller.{place}" = "{before}{line}"\n', "")
    bare.write_text(text[: text.index("# The cascade of Fig. 15")])
    assert main(["firmware", str(bare), *LIMIT, "--out", str(tmp_path / "out")]) == 2
    assert "has no controller" in " ".join(capsys.readouterr().err.split())


def test_a_controller_that_loses_the_vehicle_is_exit_code_1(capsys, tmp_path):
    mad = tmp_path / "mad.toml"
    mad.write_text(preset_text("feup-em").replace('"1002 V/dm3"', '"-200 V/dm3"'))
    code = main(
        [
            "firmware",
            *LIMIT,
            str(mad),
            "--step",
            "3 m:1.5 m",
            "--duration",
            "100 min",
            "--out",
            str(tmp_path / "out"),
        ]
    )
    assert code == 1
    assert "golden mission" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
