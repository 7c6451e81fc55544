"""``swimbladder compare``: numbers, files, exit codes, and what is refused."""

import csv
import json
import math

import numpy as np
import pytest

import swimbladder
from swimbladder.cli import main
from swimbladder.io.log_formats import FORMATS

COLUMNS = [
    "time_s",
    "depth_m",
    "depth_predicted_m",
    "residual_m",
    "compared",
    "volume_m3",
    "voltage_V",
]


@pytest.fixture(scope="module")
def sailed(tmp_path_factory):
    """The trajectory that `simulate` writes is itself a log."""
    folder = tmp_path_factory.mktemp("sailed")
    step = ["--step", "1.5:2.5", "--duration", "90"]
    assert main(["simulate", "feup-em", *step, "--out", str(folder)]) == 0
    return folder / "trajectory.csv"


def answer(capsys, *arguments, code=0):
    capsys.readouterr()
    assert main(["compare", *map(str, arguments), "--json"]) == code
    return json.loads(capsys.readouterr().out)


def refusal(capsys, *arguments, code=2):
    capsys.readouterr()
    assert main(["compare", *map(str, arguments)]) == code
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "Traceback" not in shown.err
    return " ".join(shown.err.split())


def test_a_simulated_trajectory_is_predicted_by_what_made_it(capsys, sailed, tmp_path):
    for drive, limit in (("volume", 1e-3), ("voltage", 1e-5), ("setpoint", 1e-6)):
        a = answer(
            capsys,
            sailed,
            "--vehicle",
            "feup-em",
            "--drive",
            drive,
            "--free",
            "none",
            "--out",
            tmp_path,
        )
        assert a["drive"] == drive
        assert a["rms_m"] < limit
        assert a["fitted"] == {}
        assert a["n"] == 301
        assert a["duration_s"] == pytest.approx(90.0)
        names = ("report.html", "compare.json", "compare.csv")
        assert a["files"] == [str(tmp_path / name) for name in names]


def test_the_keys_and_the_table(capsys, sailed, tmp_path):
    a = answer(
        capsys,
        sailed,
        "--vehicle",
        "feup-em",
        "--free",
        "neutral_volume,start_speed",
        "--plot",
        "--out",
        tmp_path,
    )
    assert {
        "log",
        "vehicle",
        "drive",
        "rms_m",
        "bias_m",
        "variance_explained",
        "largest_m",
        "fitted",
        "n",
        "n_not_compared",
        "duration_s",
        "volume_rms_m3",
        "possible",
        "findings",
        "piston_rms_m",
        "notes",
        "ahead",
        "files",
    } == set(a)
    assert set(a["fitted"]) == {"neutral_volume", "start_speed"}
    assert set(a["fitted"]["neutral_volume"]) == {"value", "std", "unit"}
    assert abs(a["fitted"]["neutral_volume"]["value"]) < 1e-7
    with (tmp_path / "compare.csv").open(newline="", encoding="ascii") as file:
        header, *rows = csv.reader(file)
    assert [name for name in header if name != "reference_depth_m"] == COLUMNS
    columns = dict(zip(header, np.array(rows, float).T, strict=True))
    off = columns["depth_predicted_m"] - columns["depth_m"]
    assert a["rms_m"] == pytest.approx(np.sqrt((off**2).mean()), rel=1e-12)
    assert a["bias_m"] == pytest.approx(off.mean(), rel=1e-9)
    assert (tmp_path / "compare.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_report_for_people(capsys, sailed, tmp_path):
    capsys.readouterr()
    assert main(["compare", str(sailed), "--vehicle", "feup-em", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "trajectory.csv" in out
    assert "cm3" in out
    assert out.endswith(f"\nwrote to {tmp_path}: report.html, compare.json, compare.csv\n")


def test_other_columns_and_several_logs(capsys, sailed, tmp_path):
    with sailed.open(newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    lines = ["dive,t,Depth [cm],V"]
    for dive in (1, 2):
        lines += [
            f"{dive},{row['time_s']},{100 * float(row['depth_m'])},{row['volume_m3']}"
            for row in rows
        ]
    log = tmp_path / "dives.csv"
    log.write_text("\n".join(lines) + "\n", encoding="ascii")
    mapped = [
        log,
        "--vehicle",
        "feup-em",
        "--column",
        "time_s=t",
        "--column",
        "depth_m=Depth [cm]",
        "--column",
        "volume_m3=V@m3",
        "--out",
        tmp_path / "out",
    ]
    one = answer(capsys, *mapped, "--where", "dive=2")
    assert one["rms_m"] < 1e-3
    assert "dive=2" in one["log"]
    both = answer(capsys, *mapped, "--where", "dive=1,2")
    assert [c["rms_m"] for c in both["comparisons"]] == [one["rms_m"]] * 2
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    each = ["compare-dive-1.csv", "compare-dive-2.csv", "compare.csv"]
    assert names == [*each, "compare.json", "report.html"]
    some = answer(capsys, *mapped, "--where", "dive=1,7", code=2)
    assert "dive=7" in some["comparisons"][1]["error"]
    assert some["comparisons"][0]["rms_m"] == one["rms_m"]
    assert "dives.csv dive=7" in refusal_of_one(capsys, mapped)


def refusal_of_one(capsys, mapped):
    capsys.readouterr()
    assert main(["compare", *map(str, mapped), "--where", "dive=1,7"]) == 2
    shown = capsys.readouterr()
    assert "none of 602 rows" in " ".join(shown.err.split())
    return shown.out


def test_a_log_format_from_a_file_and_the_shipped_one_of_the_vehicle(capsys, tmp_path):
    vehicle = swimbladder.load_vehicle("ntnu-bv")
    time = np.arange(0.0, 60.0, 0.5)
    inward = 0.0158 + 0.003 * np.sin(0.3 * time)
    volume = (0.02575 - inward) * vehicle.actuator.piston_area
    s = swimbladder.drive(vehicle, time=time, volume=volume, start_depth=0.8)
    log = tmp_path / "log.csv"
    rows = "".join(
        f"{t!r},{x!r},{z!r},1.0\n"
        for t, x, z in zip(time.tolist(), inward.tolist(), s.depth.tolist(), strict=True)
    )
    log.write_text(f"t_s,piston_position_m,depth_raw_m,target_depth_m\n{rows}", encoding="ascii")
    form = tmp_path / "form.toml"
    form.write_text(FORMATS["ntnu-bv"], encoding="utf-8")
    common = [log, "--vehicle", "ntnu-bv", "--out", tmp_path]
    given = answer(capsys, *common, "--log-format", form)
    assert given["rms_m"] < 1e-5
    assert given["fitted"]["neutral_volume"]["value"] == pytest.approx(vehicle.trim_error, abs=1e-9)
    assert answer(capsys, *common)["rms_m"] == given["rms_m"]
    capsys.readouterr()
    main(["compare", *map(str, common), "--json"])
    assert "read so" in " ".join(capsys.readouterr().err.split())
    unnamed = tmp_path / "unnamed.csv"
    unnamed.write_text(f"a,b,c,d\n{rows}", encoding="ascii")
    text = refusal(capsys, unnamed, "--vehicle", "feup-em", "--out", tmp_path)
    assert '--column "time_s=NAME@UNIT"' in text
    assert "--log-format" not in text  # no format is known of that vehicle's logs
    raw = tmp_path / "raw.txt"
    raw.write_text("Vehicle settings: a, b\nTime[ms],#Mission\n1,2\n")
    text = refusal(capsys, raw, "--vehicle", "ntnu-bv", "--out", tmp_path)
    assert "for --log-format: ntnu-bv, ntnu-bv-raw" in text


def test_the_log_of_a_float_that_pumps_is_told_by_its_lines(capsys, tmp_path):
    log = tmp_path / "dive.LOG"
    log.write_text("1900000000:[MAIN  ,111]board 1\n1900001100:[PRESS , 81]P  +7000mbar\n")
    text = refusal(capsys, log, "--vehicle", "feup-em", "--out", tmp_path)
    assert "no volume" in text
    assert "a --vehicle that has a pump and a valve" in text


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (["--drive", "thrust"], "--drive: no such input"),
        (["--free", "weight"], "--free: this cannot be fitted"),
        (["--free", "mas"], "Did you mean mass?"),
        (["--where", "log"], "--where: not a pair"),
        (["--where", "log=1"], "no such column to choose rows by"),
        (["--column", "depth=z"], "no such column of a log"),
        (["--bottom-depth", "deep"], "--bottom-depth: "),
        (["--bottom-depth", "-1"], "must not be negative"),
        (["--log-format", "nonsense"], "--log-format: there is no log format"),
    ],
)
def test_bad_options_are_one_paragraph(capsys, sailed, tmp_path, options, part):
    out = tmp_path / "out"
    assert part in refusal(capsys, sailed, "--vehicle", "feup-em", "--out", out, *options)
    assert not out.exists()


def test_a_log_and_a_vehicle_that_are_not_there(capsys, sailed, tmp_path):
    assert "no such file" in refusal(capsys, tmp_path / "no.csv", "--vehicle", "feup-em")
    assert "no preset of that name" in refusal(capsys, sailed, "--vehicle", "feup-me")
    capsys.readouterr()
    assert main(["compare", str(sailed)]) == 2
    assert "--vehicle" in capsys.readouterr().err


@pytest.mark.data
def test_a_mission_of_the_real_float(capsys, data_dir, tmp_path):
    log = data_dir / "ntnu_bv" / "missions.csv.gz"
    common = [log, "--vehicle", "ntnu-bv", "--where", "log=47", "--out", tmp_path]
    a = answer(capsys, *common, "--plot")
    assert a["drive"] == "volume"
    assert a["rms_m"] < 0.022
    assert list(a["fitted"]) == ["neutral_volume"]
    b = answer(capsys, *common, "--drive", "setpoint", "--free", "none")
    assert b["rms_m"] < 0.021
    assert b["piston_rms_m"] < 0.0011


def still(folder):
    """A vehicle that hangs where it is neutral, by a sensor that does not move."""
    path = folder / "still.csv"
    rows = [f"{0.5 * k},2.0,8.08e-6" for k in range(100)]
    path.write_text("\n".join(["time_s,depth_m,volume_m3", *rows]), encoding="ascii")
    return str(path)


def test_what_is_below_any_sensor_is_printed_as_zero(capsys, tmp_path):
    words = ["compare", still(tmp_path), "--vehicle", "feup-em", "--out", str(tmp_path)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "start_speed = 0 m/s +- 0 m/s" in out
    assert "start_depth = 2 m" in out
    assert "nan" not in out  # no variance, of which a share could be explained


def test_a_share_far_below_zero_is_no_row_of_digits(capsys, tmp_path):
    path = tmp_path / "other.csv"
    rows = [f"{0.5 * k},{2.0 + 0.05 * math.sin(k / 4.0)},{8e-5 * (k > 9)}" for k in range(100)]
    path.write_text("\n".join(["time_s,depth_m,volume_m3", *rows]), encoding="ascii")
    words = ["compare", str(path), "--vehicle", "feup-em", "--free", "none", "--out", str(tmp_path)]
    assert main(words) == 0  # nothing was asked to be fitted
    assert "< -100 %" in capsys.readouterr().out


def test_identify_says_that_nothing_moved(capsys, tmp_path):
    out = tmp_path / "out"
    words = ["identify", still(tmp_path), "--vehicle", "feup-em", "--out", str(out)]
    assert main(words) == 1
    assert "the depth stays at 2 m" in capsys.readouterr().err
    assert not out.exists()
