"""Every command answers in 15 lines at most, the most important first, and the rest on request."""

import re
from pathlib import Path

import pytest

from swimbladder.cli import COMMANDS, common, main
from swimbladder.show.parts import Table
from tests.cli.test_identify_actuator import bench
from tests.few_lines import few

DIVE = """schema_version = 1
cycles = 2
[[phases]]
kind = "park"
depth = "200 m"
duration = "1 h"
[[phases]]
kind = "surface"
duration = "10 min"
"""
STEP = ["--duration", "60", "--plot", "--netcdf"]
POOL = [
    "--bottom-depth",
    "4.5 m",
    "--depth-noise",
    "2 mm",
    "--pool-time",
    "15 min",
    "--max-experiments",
    "2",
]
LIMIT = ["--time-limit", "2 h"]
QUICK = {
    "analyse": ["feup-em"],
    "ballast": ["example-float"],
    "campaign": ["example-float", "dive.toml", "--floats", "3"],
    "compare": ["swimbladder-simulate/trajectory.csv", "--vehicle", "feup-em"],
    "design-experiment": ["feup-em", *POOL, "--against", "none"],
    "energy": ["example-eh"],
    "faults": ["feup-em", "--missions", "20", "--healthy", "2", *LIMIT],
    "firmware": ["feup-em", "--duration", "30", *LIMIT],
    "identify": ["swimbladder-simulate/trajectory.csv", "--vehicle", "feup-em"],
    "identify-actuator": ["bench.csv", "--vehicle", "feup-em", "--plot"],
    "mission": ["example-float", "dive.toml", "--netcdf", "--plot"],
    "plan": ["feup-em", "--step", "1.5:3", "--sample-time", "0.5"],
    "simulate": ["feup-em", *STEP],
    "size": ["example-eh", "--max-depth", "300 m"],
    "stability": ["feup-em", "--depth-range", "0:5 m", "--no-maps"],
    "vehicle": ["show", "feup-em"],
}
# Long commands, in tests of their own that count lines too.
LONG = {
    "board": "codegen/test_board.py",
    "compare-laws": "cli/test_compare_laws.py",
    "pool": "cli/test_pool.py",
    "reproduce": "cli/test_reproduce.py",
    "tune": "design/tuning/test_tune.py",
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("few")
    (folder / "dive.toml").write_text(DIVE, encoding="ascii")
    bench(folder / "bench.csv", [3.0, -3.0, 6.0, -6.0, 12.0, -12.0])
    step = ["simulate", "feup-em", "--out", str(folder / "swimbladder-simulate")]
    assert main(step) == 0
    return folder


SLOW = ("identify", "faults", "size", "design-experiment")  # seconds each: `make prove` takes them
EACH = [
    pytest.param(command, marks=pytest.mark.prove if command in SLOW else ())
    for command in (*QUICK, "vehicle list", "vehicle set")
]


@pytest.mark.parametrize("command", EACH)
def test_a_command_prints_15_lines_at_most(command, place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    name, *more = command.split()
    words = {"list": [], "set": ["feup-em", "motion.K2=7000"]}
    given = words[more[0]] if more else QUICK[name]
    capsys.readouterr()
    assert main([name, *more, *given]) in (0, 1)
    printed = few(capsys.readouterr().out)
    if command not in ("analyse", "ballast", "energy", "simulate", "vehicle list"):
        return
    assert main([name, *more, *given, "--full"]) in (0, 1)
    whole = capsys.readouterr().out
    left = re.search(r"^\.\.\. (\d+) lines? more: --full$", printed, re.MULTILINE)
    if left:
        assert len(whole.splitlines()) == len(printed.splitlines()) - 1 + int(left[1])
        files = [line for line in printed.splitlines() if line.startswith("wrote to ")]
        assert all(line.partition(", ")[0] in whole for line in files)
    else:
        assert whole == printed


def test_every_command_is_counted():
    assert {*QUICK, *LONG} == {*COMMANDS}
    for name, test in LONG.items():
        assert "few(" in (Path(__file__).parents[1] / test).read_text(encoding="utf-8"), name


def test_a_table_is_cut_between_rows_and_a_heading_does_not_stand_alone(capsys):
    rows = Table(("name", "value"), [(f"row {k}", str(k)) for k in range(30)])
    common.show_answer(["first", rows], ["wrote"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 15
    assert lines[0] == "first"
    assert [*lines[-3].split(), lines[-2]] == ["row", "10", "10", "... 19 lines more: --full"]
    assert lines[-1] == "wrote"
    common.show_answer([*map(str, range(12)), rows], ["wrote"])
    assert capsys.readouterr().out.splitlines()[-3:] == ["11", "... 31 lines more: --full", "wrote"]
    common.show_answer([*map(str, range(12)), rows], ["wrote"], full=True)
    assert len(capsys.readouterr().out.splitlines()) == 44


def test_a_line_that_a_terminal_breaks_counts_as_its_rows(monkeypatch):
    from io import StringIO

    file = StringIO()
    screen = common.Output(file=file, force_terminal=True, color_system=None, width=50)
    monkeypatch.setattr(common, "output", screen)
    common.show_answer(["a word " * 20] * 6)
    assert len(file.getvalue().splitlines()) == 5
    assert file.getvalue().splitlines()[-1] == "... 2 lines more: --full"
