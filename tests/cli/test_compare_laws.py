"""``swimbladder compare-laws``: files, JSON, the list, refusals."""

import json
import re

import pytest

from swimbladder.cli import main
from swimbladder.control.registry import bind
from swimbladder.design.law_comparison import SCENARIOS
from swimbladder.io.config import load_vehicle
from tests.docs.test_reference import check, rows
from tests.few_lines import few
from tests.pages import figures_of, without_scripts


@pytest.mark.prove
def test_the_page_the_table_and_the_pictures(capsys, tmp_path):
    out = tmp_path / "comparison"
    # a law that does not fit: only the paper's own is flown
    command = ["compare-laws", "feup-em", "--laws", "position-pid", "--runs", "2"]
    command += ["--out", str(out)]
    assert main([*command, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [law["name"] for law in answer["laws"]] == ["cascade, the paper's"]
    assert set(answer["laws"][0]["results"]) == {s.name for s in SCENARIOS}
    assert answer["energy_unknown"]
    files = sorted(p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file())
    written = [f for f in files if not f.startswith("parts/")]
    assert written == [
        "laws.csv",
        "laws.json",
        "pareto.png",
        "report.html",
        "steps.png",
        "vehicles/cascade-the-papers.toml",
    ]
    check(rows("files-written.md", "compare-laws")[0], answer)
    kept = json.loads((out / "laws.json").read_text(encoding="utf-8"))
    assert kept == {k: v for k, v in answer.items() if k != "files"}
    assert sorted(answer["files"]) == sorted(str(out / f) for f in written)
    lines = (out / "laws.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + len(SCENARIOS)
    hold = dict(zip(lines[0].split(","), lines[1 + 9].split(","), strict=True))
    assert hold["scenario"] == "hold"
    assert float(hold["rms_m"]) == answer["laws"][0]["results"]["hold"]["rms_m"]
    page = (out / "report.html").read_text(encoding="utf-8")
    plain = without_scripts(page)
    listed = set(re.findall(r'(?:src|href)="([^"]*)"', plain))
    assert listed == set(written) - {"report.html"}  # nothing is fetched
    assert "{{" not in plain
    assert set(figures_of(page)) == {"pareto", "steps"}
    for s in SCENARIOS:
        assert f"<h2>{s.name}: " in page
    flown = load_vehicle(out / "vehicles/cascade-the-papers.toml")
    assert bind(flown.controller) == bind(load_vehicle("feup-em").controller)
    # the same again, from what was kept, for a person
    assert main(command) == 0
    few(capsys.readouterr().out)
    assert main([*command, "--full"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "cascade, the paper's" in told
    assert "J/h is unknown: R and k_T of the motor are not known" in told
    assert "left out: position-pid: it commands a volume" in told


def test_the_list_of_scenarios(capsys):
    assert main(["compare-laws", "--list-scenarios"]) == 0
    told = capsys.readouterr().out
    for s in SCENARIOS:
        assert s.name in told
    assert main(["compare-laws", "feup-em", "--list-scenarios", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["scenarios"]
    assert listed["step-down"]["start_m"] == 1.5
    assert listed["step-down"]["target_m"] == 3.0
    assert list(listed) == [s.name for s in SCENARIOS]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ([], 2, "no vehicle"),
        (["feup-em", "--laws", "planed"], 2, "Did you mean planned?"),
        (["feup-em", "--laws", "foo"], 2, "--laws: no such law (got 'foo')"),
        (["feup-em", "--runs", "1"], 2, "whole number of at least 2"),
        (["feup-em", "--depth-range", "5"], 2, "a colon between"),
        (
            ["feup-em", "--depth-range", "0:90 m"],
            2,
            "--depth-range: the supervisor turns the vehicle round at 49.98 m (got '0:90 m', "
            "expected unit m). Ask for less depth, or say more of the vehicle in its [supervisor] "
            "table.",
        ),
        (["feup-em", "--depth-range", "0:90 m", "--unsupervised"], 1, "leaves the stroke"),
        (["feup-em", "--depth-noise", "-1 mm"], 2, "greater than or equal to 0"),
        (["feup-em", "--seed", "-1"], 2, "of at least 0"),
    ],
)
def test_bad_input_is_named_and_writes_nothing(capsys, tmp_path, arguments, code, words):
    assert main(["compare-laws", *arguments, "--out", str(tmp_path / "out")]) == code
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
