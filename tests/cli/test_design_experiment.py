"""``swimbladder design-experiment``: what is printed, written, refused."""

import json

import pytest

from swimbladder.cli import main
from swimbladder.design.plan import load_plan
from tests.pages import figures_of, without_scripts
from tests.quoted import numbers

QUICK = [
    "design-experiment",
    "feup-em",
    "--bottom-depth",
    "4.5 m",
    "--depth-noise",
    "2 mm",
    "--settling",
    "5 min",
    "--max-moves",
    "1",
    "--max-experiments",
    "2",
]


def test_it_prints_and_writes_a_plan(capsys, tmp_path):
    code = main([*QUICK, "--against", "20,-20 cm3", "--full", "--out", str(tmp_path)])
    printed = capsys.readouterr().out
    assert code == 0
    design = json.loads((tmp_path / "design.json").read_text(encoding="utf-8"))
    share = 100.0 * design["parameters"]["K2"]["std"] / design["parameters"]["K2"]["value"]
    assert any(abs(share - number) <= 0.06 * share for number in numbers(printed))
    assert {20.0, -20.0} <= numbers(printed)  # cm3, of the steps that it is held against
    assert "1 sigma" in printed
    assert "drag law: linear" in printed
    names = {"plan.toml", "report.html", "plan.png", "design.png", "design.json"}
    assert {path.name for path in tmp_path.iterdir()} == names
    plan = load_plan(tmp_path / "plan.toml")
    assert len(plan.experiments) == 2
    head = (tmp_path / "plan.toml").read_text(encoding="utf-8").splitlines()
    assert head[1].startswith("# 2 experiments in")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("☐") == 2
    assert set(figures_of(page)) == {"plan", "design"}
    assert "http" not in without_scripts(page)  # it needs nothing but itself


def test_json_is_one_object(capsys, tmp_path):
    assert main([*QUICK, "--against", "none", "--json", "--out", str(tmp_path)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["against"] is None
    assert set(told["parameters"]) == {"K2", "T2", "psi"}
    K2 = told["parameters"]["K2"]
    assert K2["ci95"][0] < K2["value"] < K2["ci95"][1]
    assert sum(K2["sources"].values()) == pytest.approx(1.0)
    assert told["experiments"][0]["moves"][0]["going"] is None
    written = json.loads((tmp_path / "design.json").read_text(encoding="utf-8"))
    assert written == {key: value for key, value in told.items() if key != "files"}


def test_a_no_is_exit_code_1(capsys, tmp_path):
    code = main(
        [
            *QUICK,
            "--depth-noise",
            "5 cm",
            "--max-experiments",
            "1",
            "--neutral-std",
            "none",
            "--against",
            "none",
            "--json",
            "--out",
            str(tmp_path),
        ]
    )
    printed = capsys.readouterr()
    assert code == 1
    assert json.loads(printed.out)["identifiable"] is False
    assert "psi" in printed.err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--against", "20,-20"], "the unit is missing"),
        (["--against", "20 cm,-20 cm3"], "--against"),
        (["--against", "900 cm3"], "not within"),
        (["--prior", "psi=2e-6 m3/m"], "a prior has a mean and a standard deviation"),
        (["--prior", "psy=2e-6 +- 1e-6"], "Did you mean psi?"),
        (["--fixed", "psi=2 cm3"], "--fixed psi"),
        (["--fixed", "psi"], "not a pair"),
        (["--criterion", "E"], "Choose largest, D or A"),
        (["--pool-time", "1 min"], "too short"),
        (["--bottom-depth", "1 m"], "leaves no travel"),
        (["--depth-noise", "2 s"], "--depth-noise"),
        (["--depth-noise", "0"], "it must be above 0 where there is no --depth-quantum"),
    ],
)
def test_what_is_refused_names_the_option(capsys, tmp_path, options, said):
    assert main([*QUICK, *options, "--out", str(tmp_path / "out")]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
