"""``swimbladder identify``: numbers, files, exit codes, and what is refused."""

import csv
import json

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.io.config import load_vehicle
from tests.estimation.motion.pool import campaign, pool_log

STEPS = (2e-5, -3e-5, 4.5e-5, -7.5e-5)
TRUTH = {"K2": 7935.54, "T2": 36.3, "psi": 4.04e-6}


def table(logs):
    """Return logs as the text of one CSV file, with a number for each."""
    lines = ["run,time_s,depth_m,volume_m3"]
    for run, log in enumerate(logs, start=1):
        columns = (log.time.tolist(), log.depth.tolist(), log.volume.tolist())
        lines += [f"{run},{t!r},{z!r},{v!r}" for t, z, v in zip(*columns, strict=True)]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    """Four experiments of feup-em that SciPy made, and one that is too short."""
    logs = campaign(61, quantum=5e-3, steps=STEPS)
    logs.append(pool_log(7.5e-5, travel=0.35, rng=np.random.default_rng(7)))
    path = tmp_path_factory.mktemp("pool") / "pool.csv"
    path.write_text(table(logs), encoding="ascii")
    return path


@pytest.fixture(scope="module")
def made(pool, tmp_path_factory):
    """What the command printed and wrote, once for all."""
    import contextlib
    import io

    out = tmp_path_factory.mktemp("made") / "deep" / "out"
    printed = io.StringIO()
    options = ["--vehicle", "feup-em", "--where", "run=1,2,3,4", "--paper", "--out", str(out)]
    with contextlib.redirect_stdout(printed):
        assert main(["identify", str(pool), *options, "--json"]) == 0
    return json.loads(printed.getvalue()), out


def run(capsys, *arguments, code=0):
    capsys.readouterr()
    assert main(["identify", *map(str, arguments)]) == code
    shown = capsys.readouterr()
    assert "Traceback" not in shown.err
    return shown.out, " ".join(shown.err.split())


def columns(path):
    with path.open(newline="", encoding="ascii") as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, np.array(rows, float).T, strict=True))


def test_the_parameters_with_their_intervals(made):
    told, _ = made
    assert told["identified"] is True
    for name, truth in TRUTH.items():
        e = told["parameters"][name]
        assert set(e) == {"value", "std", "ci95", "unit", "origin"}
        assert e["ci95"][0] < e["value"] < e["ci95"][1]
        assert abs(e["value"] - truth) < 4.0 * e["std"]
    assert told["parameters"]["psi"]["unit"] == "m3/m"
    assert np.shape(told["correlation"]) == np.shape(told["covariance"]) == (3, 3)
    assert [e["log"].endswith(f"(run={n})") for n, e in enumerate(told["experiments"], 1)] == [
        True
    ] * 4
    assert told["seconds"] > 0.0
    assert any("0.5 cm3" in text for text in told["assumptions"])


def test_the_paper_stands_beside_with_its_bias(made):
    told, _ = made
    paper = told["paper"]
    assert paper["by_depth"]["K2"] > 1.4 * told["parameters"]["K2"]["value"]
    assert len(paper["experiments"]) == 4
    assert "outside our interval" in paper["sentence"]


def test_the_files_say_what_was_printed(made):
    told, out = made
    names = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    pictures = {
        f"figures/{name}.png"
        for name in (
            "fits",
            "residuals",
            "distribution",
            "ellipses",
            "profiles",
            "neutral",
            "gains",
        )
    }
    assert names == {
        "report.html",
        "identify.json",
        "residuals.csv",
        "vehicle.toml",
        *pictures,
    }
    assert told["files"] == [str(out / name) for name in told_order(names)]
    written = json.loads((out / "identify.json").read_text(encoding="utf-8"))
    assert written == {k: v for k, v in told.items() if k not in ("files", "seconds")}
    found = columns(out / "residuals.csv")
    assert list(found) == [
        "log",
        "time_s",
        "depth_m",
        "depth_fitted_m",
        "residual_m",
        "weight",
        "volume_m3",
    ]
    for number, e in enumerate(told["experiments"], start=1):
        mine = (found["log"] == number) & (found["weight"] > 0.0)
        assert np.sqrt(np.mean(found["residual_m"][mine] ** 2)) == pytest.approx(e["rms_m"])
    off = found["depth_m"] - found["depth_fitted_m"] - found["residual_m"]
    assert np.nanmax(np.abs(off)) < 1e-12


def told_order(names):
    first = ["report.html", "identify.json", "residuals.csv", "vehicle.toml"]
    order = ["fits", "residuals", "distribution", "ellipses", "profiles", "neutral", "gains"]
    return [*first, *(f"figures/{name}.png" for name in order if f"figures/{name}.png" in names)]


def test_every_other_command_reads_the_vehicle(made, tmp_path, capsys, pool):
    told, out = made
    path = out / "vehicle.toml"
    vehicle = load_vehicle(path)
    for name, value in (("K2", vehicle.motion.K2), ("T2", vehicle.motion.T2)):
        assert value == told["parameters"][name]["value"]  # to the bit
    assert vehicle.hull.psi == told["parameters"]["psi"]["value"]
    assert np.array_equal(vehicle.identified.covariance, told["covariance"])
    assert vehicle.identified.logs == tuple(e["log"] for e in told["experiments"])
    short = ["--duration", "30", "--out", str(tmp_path / "s")]
    compared = ["compare", str(pool), "--vehicle", str(path), "--where", "run=1"]
    for command in (
        ["simulate", str(path), *short],
        ["analyse", str(path)],
        ["vehicle", "show", str(path)],
        [*compared, "--out", str(tmp_path / "c")],
    ):
        assert main([*command, "--json"]) == 0, command
    capsys.readouterr()


def test_the_report_for_people(capsys, pool, tmp_path):
    out, _ = run(
        capsys,
        pool,
        "--vehicle",
        "feup-em",
        "--where",
        "run=1,2",
        "--no-profiles",
        "--prior",
        "psi=4.04 cm3/m +- 10 %",
        "--fixed",
        "T2=36.3 s",
        "--full",
        "--out",
        tmp_path,
    )
    assert "K2 is " in out
    assert "with 1 cm3 too much or too little the speed settles at" in out
    assert "assumed: each log's neutral volume is known to 0.5 cm3 (1 sigma)" in out
    assert "prior: psi = 4.04e-06 +- 4.04e-07 m3/m" in out
    assert "T2" in out
    assert "set" in out
    assert "behind the best" in out
    (wrote,) = (line for line in out.splitlines() if line.startswith(f"wrote to {tmp_path}: "))
    assert "vehicle.toml" in wrote
    assert not (tmp_path / "figures" / "profiles.png").exists()


def test_what_the_data_do_not_tell_is_exit_1_without_a_number(capsys, pool, tmp_path):
    out = tmp_path / "out"
    asked = [pool, "--vehicle", "feup-em", "--where", "run=5", "--out", out, "--no-profiles"]
    run(capsys, *asked, "--free", "K2", "--fixed", "T2=36.3 s", "--fixed", "psi=4.04 cm3/m")
    assert (out / "vehicle.toml").exists()
    assert (out / "figures" / "gains.png").exists()
    printed, err = run(capsys, *asked, "--neutral-std", "none", "--json", code=1)
    told = json.loads(printed)
    assert told["identified"] is False
    assert all(e["value"] is None for e in told["parameters"].values())
    assert "psi" in err
    assert any(f["severity"] == "no" and "psi" in f["sentence"] for f in told["findings"])
    # nothing of the earlier run can be taken for the answer
    assert not (out / "vehicle.toml").exists()
    assert {path.name for path in (out / "figures").iterdir()} == {
        "fits.png",
        "residuals.png",
        "distribution.png",
        "neutral.png",
    }
    assert "ψ" in (out / "report.html").read_text(encoding="utf-8")


def test_a_vehicle_file_that_is_not_ours_is_left_alone(capsys, pool, made, tmp_path):
    mine = tmp_path / "vehicle.toml"
    mine.write_text((made[1] / "vehicle.toml").read_text(encoding="utf-8"), encoding="utf-8")
    before = mine.read_bytes()
    asked = [pool, "--where", "run=1", "--out", tmp_path]
    _, err = run(capsys, *asked, "--vehicle", mine, code=2)
    assert "written over the one that is read" in err
    mine.write_bytes(before.split(b"\n", 5)[5])
    _, err = run(capsys, *asked, "--vehicle", "feup-em", code=2)
    assert "did not write" in err
    assert mine.read_bytes() == before.split(b"\n", 5)[5]
    assert [path.name for path in tmp_path.iterdir()] == ["vehicle.toml"]


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (["--free", "K2,T9"], "--free: there is no such parameter (got 'T9')"),
        (["--free", "none"], "--free: nothing is left to identify"),
        (["--free", "mass"], "--free: the drag law linear has no such parameter"),
        (["--free", "psi,K1"], "--free: a logged volume"),
        (["--fixed", "psi=2 cm3"], "--fixed psi: the unit 'cm3' is of another kind"),
        (["--fixed", "psi=1", "--fixed", "psi=2"], "--fixed: given twice"),
        (["--fixed", "K2=-1"], "--fixed: it must be above 0"),
        (["--fixed", "psi=0", "--prior", "psi=1 +- 1"], "--prior: it has a prior, but is not"),
        (["--prior", "psi=2e-6"], "--prior psi: a prior has a mean and a standard deviation"),
        (["--drag", "cubic"], "--drag: this drag law cannot be identified (got 'cubic')"),
        (["--neutral-std", "0"], "--neutral-std: it must be above 0"),
        (["--speed-std", "1 cm3"], "--speed-std: the unit 'cm3' is of another kind"),
        (["--drive", "setpoint"], "--drive: this does not drive"),
        (["--bottom-depth", "-1"], "--bottom-depth: it must not be negative"),
        (["--where", "run=9"], "none of"),
        (["--column", "depth=z"], "no such column of a log"),
        (["--log-format", "nonsense"], "--log-format: there is no log format"),
    ],
)
def test_bad_options_are_one_paragraph_and_write_nothing(capsys, pool, tmp_path, options, part):
    out = tmp_path / "out"
    where = [] if "--where" in options else ["--where", "run=1"]
    _, err = run(capsys, pool, "--vehicle", "feup-em", *where, "--out", out, *options, code=2)
    assert part in err
    assert not out.exists()


def test_runs_of_a_pump_need_a_vehicle_that_has_one(capsys, tmp_path):
    dive, cast = tmp_path / "dive.csv", tmp_path / "cast.csv"
    dive.write_text("time_s,pressure_Pa,pump_s\n0,0,\n60,9e4,5\n", encoding="ascii")
    rows = "0,15,35\n10,14,35\n20,13,35\n"
    cast.write_text(f"pressure_dbar,temperature_degC,salinity\n{rows}", encoding="ascii")
    given = (dive, "--vehicle", "feup-em", "--cast", cast, "--out", tmp_path / "out")
    _, err = run(capsys, *given, code=2)
    assert "(pump_s), and the vehicle 'feup-em' has no pump and valve" in err
    assert not (tmp_path / "out").exists()


def test_an_out_that_is_a_file(capsys, pool, tmp_path):
    out = tmp_path / "out"
    out.write_text("mine", encoding="ascii")
    _, err = run(capsys, pool, "--vehicle", "feup-em", "--where", "run=1", "--out", out, code=2)
    assert "--out" in err
    assert out.read_text(encoding="ascii") == "mine"


def test_a_log_that_never_leaves_the_surface(capsys, tmp_path):
    log = tmp_path / "log.csv"
    rows = "".join(f"{t},0.02,1e-5\n" for t in range(60))
    log.write_text(f"time_s,depth_m,volume_m3\n{rows}", encoding="ascii")
    _, err = run(capsys, log, "--vehicle", "feup-em", "--out", tmp_path / "out", code=2)
    assert "clear of surface and bottom" in err


@pytest.mark.prove
@pytest.mark.data
@pytest.mark.slow
def test_tank_logs_of_the_real_float(capsys, data_dir, tmp_path):
    log = data_dir / "ntnu_bv" / "missions.csv.gz"
    printed, err = run(
        capsys,
        log,
        "--vehicle",
        "ntnu-bv",
        "--where",
        "log=47,65",
        "--neutral-std",
        "none",
        "--fixed",
        "psi=0",
        "--drag",
        "linear",
        "--no-profiles",
        "--paper",
        "--out",
        tmp_path,
        "--json",
    )
    told = json.loads(printed)
    assert err.count("read so") == 1  # one file
    # others fitted 8.5 to 8.6 kg and 0.88 N/(m/s) to logs 46 and 47, with a drag that is not
    # separable at these speeds: the mass agrees to 20 %, the drag to a factor of 2
    assert told["derived"]["mass"]["value"] == pytest.approx(8.6, rel=0.2)
    assert 0.44 < told["derived"]["drag"]["value"] < 1.76
    assert all(e["rms_m"] < 0.03 for e in told["experiments"])
    assert load_vehicle(tmp_path / "vehicle.toml").identified.names == ("K2", "T2")
