"""docs/reference/: made from the schema as it is, and what it says of files and JSON is so."""

import json
import re

import pytest

from scripts.make_reference import FOLDER, made
from swimbladder.cli import main
from swimbladder.io.log_format import COLUMNS
from swimbladder.io.log_formats import FORMATS
from tests.blank_pictures import blank_pictures as blank_pictures

PAGES = sorted(FOLDER.glob("*.md"))


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_the_reference_is_that_of_the_schema(path):
    page = path.read_text(encoding="utf-8")
    assert made(page) == page, "run python scripts/make_reference.py"


def test_every_part_of_the_schema_is_in_the_reference():
    page = (FOLDER / "vehicle-file.md").read_text(encoding="utf-8")
    for field in ("trim_error", "k_dt", "lead", "pump_displacement", "k_pV", "volume_noise"):
        assert f"`{field}`" in page


def rows(page, heading=None):
    """Return the lists of names of a page, or of a section: each {name: what is said of it}.

    An item of several names, "- `a`, `b`: both", is one for each; a table is such a list too.
    """
    text = (FOLDER / page).read_text(encoding="utf-8")
    if heading is not None:
        text = text.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    found = []
    for block in re.findall(r"(?:^\|.*\n)+|(?:^- `.*\n)+", text, re.MULTILINE):
        if block.startswith("|"):
            table = [re.split(r" (?<!\\)\| ", line.strip("| ")) for line in block.splitlines()[2:]]
        else:
            table = [re.split(r"(?<=`): ", line[2:], maxsplit=1) for line in block.splitlines()]
        found.append({n.strip("`"): cells[1:] for cells in table for n in cells[0].split(", ")})
    return found


def answer(capsys, *arguments):
    code = main([*arguments, "--json"])
    assert code == 0
    return json.loads(capsys.readouterr().out)


def check(said, given):
    """Compare the keys of a table, where a.b opens a, with those of a JSON object.

    Those of many commands may be left out, but not `parameters`, which have keys of their own.
    """
    many = set(rows("files-written.md", "Common to all commands")[1]) - {"parameters"}
    assert {key.partition(".")[0] for key in said} - many == set(given) - many
    for key in {key.partition(".")[0] for key in said if "." in key}:
        inner = {k.partition(".")[2] for k in said if k.startswith(f"{key}.")}
        assert inner == set(given[key])


def header(path):
    return path.read_text(encoding="utf-8").splitlines()[0].split(",")


def test_what_simulate_writes(capsys, tmp_path):
    columns, keys = rows("files-written.md", "simulate")
    floats = {"volume_change_m3", "run_s", "volume_rate_m3_s", "drive"}
    columns = {name: meaning for name, meaning in columns.items() if name not in floats}
    told = answer(
        capsys, "simulate", "example-em", "--duration", "30", "--netcdf", "--out", str(tmp_path)
    )
    check(keys, told)
    names = list(keys)
    first = names.index("time_s")
    ten = names[first : names.index("duration_s")]
    assert len(ten) == 10  # "it and the next nine keys"
    assert set(told["steps"][0]) == {*ten, "events"}
    assert header(tmp_path / "trajectory.csv") == list(columns)
    assert set(columns) <= set(COLUMNS) | {"power_W"}

    import xarray

    with xarray.open_dataset(tmp_path / "trajectory.nc", engine="h5netcdf") as data:
        bare = {re.sub(r"_(m3|m_s|m|s|V|A|W)$", "", name) for name in columns}
        assert {*data.variables} == {
            {"reference_depth": "reference", "reference_volume": "volume_reference"}.get(name, name)
            for name in bare
        } | {"motor_rate"}


def test_what_analyse_writes(capsys, tmp_path):
    (keys,) = rows("files-written.md", "analyse")
    told = answer(capsys, "analyse", "feup-em", "--out", str(tmp_path))
    check(keys, told)
    with_controller = {
        "report.html",
        "analysis.json",
        "analysis.txt",
        "open_loop.png",
        "poles.png",
        "loop_gains.png",
        "nyquist.png",
    }
    assert {path.name for path in tmp_path.iterdir()} == {*with_controller, "report.html"}
    text = (FOLDER / "files-written.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in text for name in with_controller)
    assert set(json.loads((tmp_path / "analysis.json").read_text())) == set(told) - {"files"}


def test_what_compare_writes(capsys, tmp_path):
    columns, keys, ahead = rows("files-written.md", "compare")
    log = tmp_path / "trajectory.csv"
    main(["simulate", "example-em", "--duration", "30", "--out", str(tmp_path), "--json"])
    capsys.readouterr()
    written = set()
    for drive in ("volume", "setpoint"):
        folder = tmp_path / drive
        told = answer(
            capsys,
            "compare",
            str(log),
            "--vehicle",
            "example-em",
            "--drive",
            drive,
            "--free",
            "none",
            "--out",
            str(folder),
        )
        check(keys, told)
        written |= set(header(folder / "compare.csv"))
        assert ("volume_predicted_m3" in header(folder / "compare.csv")) == (drive != "volume")
    assert written == set(columns)
    told = answer(
        capsys,
        "compare",
        str(log),
        "--vehicle",
        "example-em",
        "--horizons",
        "10 s",
        "--out",
        str(tmp_path),
    )
    assert set(told["ahead"]) == {"horizons", "noise"}
    assert set(told["ahead"]["horizons"][0]) == set(ahead)
    columns = {"time_s", "depth_m", "compared", "depth_predicted_10s_m", "depth_std_10s_m"}
    assert set(header(tmp_path / "compare-ahead.csv")) == columns


@pytest.mark.slow
def test_what_identify_writes(capsys, tmp_path):
    columns, keys = rows("files-written.md", "identify")
    steps = ["--step", "3.0:1.5", "--duration", "60"]
    main(["simulate", "feup-em", *steps, "--out", str(tmp_path / "log"), "--json"])
    capsys.readouterr()
    log = str(tmp_path / "log" / "trajectory.csv")
    out = tmp_path / "out"
    told = answer(
        capsys,
        "identify",
        log,
        "--vehicle",
        "feup-em",
        "--fixed",
        "psi=4.04 cm3/m",
        "--paper",
        "--out",
        str(out),
    )
    check(keys, told)
    assert set(header(out / "residuals.csv")) == set(columns)
    text = (FOLDER / "files-written.md").read_text(encoding="utf-8")
    for path in out.iterdir():
        assert f"`{path.name}`" in text or path.name == "figures"
    for e in (*told["parameters"].values(), *told["derived"].values()):
        assert set(e) == {"value", "std", "ci95", "unit", "origin"}


def test_what_identify_actuator_writes(capsys, tmp_path):
    columns, keys = rows("files-written.md", "identify-actuator")
    log = tmp_path / "bench.csv"
    lines = ["time_s,piston_m,voltage_V"]
    for k in range(800):
        # a motor without T1: it goes 1 mm/s/V while a voltage is on
        held, within = divmod(k, 100)
        u = (0.0, 4.0, 0.0, -4.0, 0.0, 8.0, 0.0, -8.0)[held]
        before = (0.0, 0.0, 8e-3, 8e-3, 0.0, 0.0, 16e-3, 16e-3)[held]
        lines.append(f"{0.02 * k:.2f},{before + 2e-5 * u * within:.7f},{u}")
    log.write_text("\n".join(lines) + "\n", encoding="ascii")
    out = tmp_path / "out"
    told = answer(
        capsys,
        "identify-actuator",
        str(log),
        "--required",
        "K1",
        "--vehicle",
        "feup-em",
        "--plot",
        "--out",
        str(out),
    )
    check(keys, told)
    assert header(out / "steps.csv") == list(columns)
    written = {"report.html", "identify-actuator.json", "steps.csv", "steps.png", "vehicle.toml"}
    assert {path.name for path in out.iterdir()} == written


def test_what_design_experiment_writes(capsys, tmp_path):
    (keys,) = rows("files-written.md", "design-experiment")
    told = answer(
        capsys,
        "design-experiment",
        "feup-em",
        "--bottom-depth",
        "4.5",
        "--depth-noise",
        "2 mm",
        "--settling",
        "5 min",
        "--max-moves",
        "1",
        "--max-experiments",
        "2",
        "--out",
        str(tmp_path),
    )
    check(keys, told)
    assert set(told["against"]) == {
        "name",
        "error_ratio",
        "time_s",
        "experiments",
        "parameters",
        "names",
        "covariance",
        "correlation",
        "bias",
    }
    text = (FOLDER / "files-written.md").read_text(encoding="utf-8")
    assert all(
        f"`{path.name}`" in text or f"[`{path.name}`]" in text for path in tmp_path.iterdir()
    )
    assert json.loads((tmp_path / "design.json").read_text()).keys() == told.keys() - {"files"}


def test_what_pool_writes(capsys, tmp_path):
    columns, keys = rows("files-written.md", "pool")
    given = ["--simulate", "--max-experiments", "1", "--json", "--out", str(tmp_path)]
    assert main(["pool", "feup-em", *given]) == 1
    told = json.loads(capsys.readouterr().out)
    check(keys, told)
    assert {path.name for path in tmp_path.iterdir()} == {
        "experiment-001.csv",
        "pool.csv",
        "pool.json",
        "report.html",
        "fits-1.png",
        "plan.png",
        "precision.png",
    }
    assert header(tmp_path / "experiment-001.csv") == list(columns)
    (one,) = told["experiments"]
    text = keys["experiments"][0]
    assert all(f"`{name}`" in text for name in one)


def test_what_stability_writes(capsys, tmp_path):
    (keys,) = rows("files-written.md", "stability")
    told = answer(
        capsys, "stability", "feup-em", "--cells", "5", "--within", "100 s", "--out", str(tmp_path)
    )
    check(keys, told)
    for name in ("linear", "cycles", "maps"):
        inner = told[name] if name == "linear" else told[name][0]
        said = re.findall(r"`([^`]+)`", keys[name][0])
        assert set(inner) <= {*said, "margins"}
    text = (FOLDER / "files-written.md").read_text(encoding="utf-8")
    for path in tmp_path.iterdir():
        assert f"`{path.name}`" in text or path.name == "map-errors-2.csv"
    assert header(tmp_path / "map-steps.csv")[2:] == ["verdict", "recovered_s", "hopeless"]


@pytest.mark.slow
def test_what_reproduce_writes(capsys, tmp_path):
    (keys,) = rows("files-written.md", "reproduce")
    told = answer(capsys, "reproduce", "--out", str(tmp_path))
    check(keys, told)
    assert {path.name for path in tmp_path.iterdir()} == {
        "report.html",
        "results.json",
        "figures",
        "trajectories",
    }
    assert {p.suffix for p in (tmp_path / "figures").iterdir()} == {".png"}
    assert {p.suffix for p in (tmp_path / "trajectories").iterdir()} == {".csv"}
    results = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert set(results) == set(told) - {"report"}


def test_what_energy_writes(capsys, tmp_path):
    columns, dives, keys, each, fitted = rows("files-written.md", "energy")
    told = answer(capsys, "energy", "example-float", "--out", str(tmp_path / "cost"))
    check(keys, told)
    assert header(tmp_path / "cost" / "energy.csv") == list(columns) == list(told["depths"])
    assert header(tmp_path / "cost" / "dives.csv") == list(dives)
    for key in ("efficiency_map", "hovering", "thruster"):
        assert set(re.findall(r"`([^`]+)`", keys[key][0])) == set(told[key])
    runs = tmp_path / "runs.csv"
    lines = [
        f"{20 + 7 * (k % 5)},{1e5 + 1e6 * (k % 7)},{7 + k % 7 + 0.01 * (k * k % 11)},{k // 7}"
        for k in range(70)
    ]
    runs.write_text("duration_s,pressure_Pa,power_W,dive\n" + "\n".join(lines) + "\n")
    found = answer(capsys, "energy", "--fit", str(runs), "--out", str(tmp_path / "fit"))
    assert header(tmp_path / "fit" / "runs.csv") == list(each)
    check(fitted, found)
    assert set(re.findall(r"`([^`]+)`", fitted["dives"][0])) == set(found["dives"][0])
    said = set(re.findall(r"`([^`]+)`", fitted["parameters"][0]))
    assert said == set(found["parameters"]["idle_power"])
    text = (FOLDER / "files-written.md").read_text(encoding="utf-8")
    for path in (*(tmp_path / "cost").iterdir(), *(tmp_path / "fit").iterdir()):
        assert f"`{path.name}`" in text


_DIVE = """schema_version = 1
[[phases]]
kind = "descend"
depth = "40 m"
[[phases]]
kind = "surface"
duration = "60 s"
"""


def test_what_mission_and_campaign_write(capsys, tmp_path):
    dive = tmp_path / "mission.toml"
    dive.write_text(_DIVE)
    columns, cycles, speeds, keys = rows("files-written.md", "mission")
    out = tmp_path / "flown"
    told = answer(
        capsys, "mission", "example-float", str(dive), "--netcdf", "--plot", "--out", str(out)
    )
    check(keys, told)
    assert header(out / "trajectory.csv") == list(columns)
    assert header(out / "cycles.csv") == list(cycles)
    assert header(out / "vertical-speed.csv") == list(speeds)
    text = (FOLDER / "files-written.md").read_text(encoding="utf-8")
    for name in header(out / "events.csv"):
        assert f"`{name}`" in text
    happened = {line.split(",")[1] for line in (out / "events.csv").read_text().splitlines()[1:]}
    assert {"phase", "arrived", "bypass", "afloat"} <= happened
    assert all(f"`{what}`" in text for what in happened)
    columns, keys, indices = rows("files-written.md", "campaign")
    out = tmp_path / "array"
    told = answer(
        capsys, "campaign", "example-float", str(dive), "--floats", "3", "--out", str(out)
    )
    check(keys, told)
    assert header(out / "floats.csv") == list(columns)
    told = answer(
        capsys,
        "campaign",
        "example-float",
        str(dive),
        "--floats",
        "100",
        "--out",
        str(tmp_path / "indices"),
        "--sensitivity",
    )
    check(indices, told["sensitivity"])
    promised = set(re.findall(r"`(\w+)`", indices["outputs"][0]))
    (some, *_) = [one for one in told["sensitivity"]["outputs"] if one["indices"]]
    assert promised == set(some) | set(some["indices"][0])


def test_what_vehicle_prints(capsys):
    (keys,) = rows("files-written.md", "vehicle")
    check(keys, answer(capsys, "vehicle", "show", "feup-em"))
    listed = answer(capsys, "vehicle", "list")["vehicles"]
    assert set(listed[0]) == {"name", "kind", "description"}


def test_the_columns_of_a_log():
    assert list(rows("log-format.md")[0]) == list(COLUMNS)
    for name, unit in COLUMNS.items():  # "The suffix of a name is its unit"
        assert name.endswith("_" + unit.replace("/", "_"))


def test_the_shipped_log_formats_are_named():
    text = (FOLDER / "log-format.md").read_text(encoding="utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith("Formats that come with")]
    assert re.findall(r"`([^`]+)`", line) == FORMATS.names()
