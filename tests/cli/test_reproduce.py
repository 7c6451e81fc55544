"""``swimbladder reproduce``: exit codes, output, and what is left behind."""

import functools
import json

import pytest

from swimbladder import paper as package
from swimbladder.cli import main
from swimbladder.paper.evidence import gather
from swimbladder.paper.verdict import claim
from swimbladder.show import static
from tests.few_lines import few


@pytest.fixture(scope="module", autouse=True)
def gathered_once():
    """Simulate once for a seed, and save no picture: what is tested is the command around it."""
    with pytest.MonkeyPatch.context() as patch:
        once = functools.cache(gather)
        patch.setattr(package, "gather", lambda seed, _: once(seed))
        patch.setattr(static, "save", lambda _figure, path: path)
        yield


def test_the_report_is_made_and_named(tmp_path, capsys):
    out = tmp_path / "report" / "paper"
    assert main(["reproduce", "--out", str(out), "--seed", "3"]) == 0
    shown = few(capsys.readouterr().out)
    assert str(out / "report.html") in shown.replace("\n", "")
    assert "37 of 37 checked and met" in shown
    assert "0 fail" in shown
    assert (out / "report.html").is_file()
    assert json.loads((out / "results.json").read_text())["seed"] == 3


def test_json_is_one_object_and_nothing_else(tmp_path, capsys):
    assert main(["reproduce", "--out", str(tmp_path / "paper"), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["report"] == str(tmp_path / "paper" / "report.html")
    assert answer["passed"] is True
    assert answer["seed"] == 2023
    written = json.loads((tmp_path / "paper" / "results.json").read_text())
    assert {**written, "report": answer["report"]} == answer


def test_the_folder_has_a_default(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce"]) == 0
    assert (tmp_path / "report" / "paper" / "report.html").is_file()
    assert capsys.readouterr().out


def test_a_verdict_that_fails_is_exit_code_1(tmp_path, capsys, monkeypatch):
    def one(_):
        return [claim(False, where="section 9", what="pigs fly", paper="yes", ours="no")]

    monkeypatch.setattr(package, "published", one)
    assert main(["reproduce", "--out", str(tmp_path / "paper")]) == 1
    captured = capsys.readouterr()
    assert "fails: section 9, pigs fly: yes against no" in captured.err
    assert "1 fail" in captured.out
    page = (tmp_path / "paper" / "report.html").read_text(encoding="utf-8")
    assert 'class="verdict fails">FAILS' in page  # the report is there all the same


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--seed", "-1"], "greater than or equal to 0"),
        (["--seed", "one"], "--seed"),
        (["--vehicle", "feup-em"], "--vehicle"),
    ],
)
def test_bad_options_are_exit_code_2(tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_is_exit_code_2(tmp_path, capsys):
    (tmp_path / "paper").write_text("mine")
    assert main(["reproduce", "--out", str(tmp_path / "paper")]) == 2
    assert "--out" in capsys.readouterr().err
    assert (tmp_path / "paper").read_text() == "mine"
