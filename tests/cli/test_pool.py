"""swimbladder pool, from the command line."""

import contextlib
import io
import json

import pytest

from swimbladder.cli import main
from swimbladder.design.pool_day import follow
from swimbladder.estimation.motion import identify
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import read_log
from tests.few_lines import few
from tests.pages import figures_of

ROUGH = ("--target-std", "4 %")  # of K2 and T2, which four to six experiments reach


@pytest.fixture(scope="module")
def rehearsal(tmp_path_factory):
    """Return the folder of a whole rehearsal, its exit code and what it printed."""
    folder, said = tmp_path_factory.mktemp("rehearsal"), io.StringIO()
    with contextlib.redirect_stdout(said):
        code = main(["pool", "feup-em", "--simulate", *ROUGH, "--out", str(folder)])
    return folder, code, said.getvalue()


@pytest.mark.prove
def test_a_rehearsal_ends_good_enough_and_its_logs_give_the_same_numbers(
    rehearsal, capsys, tmp_path
):
    folder, code, _ = rehearsal
    assert code == 0
    told = json.loads((folder / "pool.json").read_text())
    assert told["good_enough"]
    logs = [read_log(path) for path in sorted(folder.glob("experiment-*.csv"))]
    again = identify(logs, load_vehicle("feup-em")).to_dict()
    assert again["parameters"] == told["parameters"]
    assert len(logs) == len(told["experiments"])
    page = (folder / "report.html").read_text("utf-8")
    assert [*figures_of(page)] == ["fits-1", "plan", "precision"]
    now = {one["name"]: one for one in figures_of(page)["precision"]["data"]}["K2, now"]
    known = told["parameters"]["K2"]
    assert now["x"] == [len(logs)]
    assert now["y"] == pytest.approx([100.0 * known["std"] / known["value"]], rel=1e-4)
    follows = ["pool", "feup-em", "--follow", str(folder / "pool.csv"), "--no-wait", "--json"]
    code = main([*follows, *ROUGH, "--out", str(tmp_path)])
    followed = json.loads(capsys.readouterr().out)
    assert code == 0
    assert followed["parameters"] == told["parameters"]


def test_the_verdict_is_told_once(rehearsal, capsys, tmp_path):
    main(["pool", "feup-em", "--simulate", "--max-experiments", "1", "--out", str(tmp_path)])
    interim = few(capsys.readouterr().out)
    assert interim.count("At least 3 more") == 1
    _, code, said = rehearsal
    assert code == 0
    assert few(said).count("Good enough to stop") == 1


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pool")
    main(
        ["pool", "feup-em", "--simulate", "--max-experiments", "2", "--out", str(folder), "--json"]
    )
    return folder / "pool.csv"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "--simulate"),
        (["--simulate", "--follow", "log.csv"], "--simulate"),
        (["--simulate", "--target-std", "K9=2%"], "K9"),
        (["--simulate", "--target-std", "200 %"], "--target-std"),
        (["--simulate", "--prior", "psi=4e-6"], "+-"),
        (["--simulate", "--fixed", "K7=1"], "K7"),
        (["--simulate", "--real-time-factor", "0"], "--real-time-factor"),
        (["--simulate", "--travel", "1 cm"], "--travel"),
        (["--simulate", "--drag", "cubic"], "cubic"),
        (["--simulate", "--truth", "ntnu-bv"], "--truth"),
        (["--simulate", "--target-std", "2 cm"], "--target-std"),
        (["--simulate", "--target-std", "K2=-5 1/m2/s"], "--target-std: it must be above 0"),
        (["--simulate", "--bottom-depth", "0.5"], "--bottom-depth"),
        (["--simulate", "--column", "depth_m=z"], "--column"),
        (["--follow", "there-is-no.csv", "--truth", "feup-em"], "--truth"),
        (["--follow", "there-is-no.csv", "--timeout", "0 s"], "--timeout"),
        (["--follow", "there-is-no.csv", "--no-wait"], "there-is-no.csv"),
    ],
)
def test_what_is_refused(given, said, capsys, tmp_path):
    assert main(["pool", "feup-em", *given, "--out", str(tmp_path / "out"), "--json"]) == 2
    told = capsys.readouterr()
    assert json.loads(told.out)["exit_code"] == 2
    assert said in told.err


def test_bad_input_leaves_an_earlier_run_alone(log, capsys):
    before = {p.name: p.read_bytes() for p in log.parent.iterdir()}
    given = ["--simulate", "--truth", "ntnu-bv", "--out", str(log.parent)]
    assert main(["pool", "feup-em", *given]) == 2
    assert "--truth" in capsys.readouterr().err
    assert {p.name: p.read_bytes() for p in log.parent.iterdir()} == before


def test_a_folder_of_another_kind_is_left_alone(log, capsys):
    before = {p.name: p.read_bytes() for p in log.parent.iterdir()}
    code = main(["pool", "feup-em", "--follow", str(log), "--no-wait", "--out", str(log.parent)])
    assert code == 2
    assert "Choose another" in capsys.readouterr().err
    assert {p.name: p.read_bytes() for p in log.parent.iterdir()} == before


def test_columns_and_priors_reach_the_fit(log, capsys, tmp_path):
    path = tmp_path / "other.csv"
    rows = [line.split(",") for line in log.read_text(encoding="ascii").splitlines()[1:]]
    text = "".join(f"{t};{100.0 * float(z)!r};{1e6 * float(v)!r}\n" for t, z, v, _ in rows)
    path.write_text("t;Depth [cm];V\n" + text, encoding="ascii")
    code = main(
        [
            "pool",
            "feup-em",
            "--follow",
            str(path),
            "--no-wait",
            "--out",
            str(tmp_path / "out"),
            "--column",
            "time_s=t",
            "--column",
            "depth_m=Depth [cm]",
            "--column",
            "volume_m3=V@cm3",
            "--prior",
            "psi=4.04e-6 +- 1e-9 m3/m",
            "--json",
        ]
    )
    told = json.loads(capsys.readouterr().out)
    assert code == 1
    assert len(told["experiments"]) == 2
    assert told["parameters"]["psi"]["origin"] == "prior"
    assert told["state"] == "more experiments"


def test_an_interruption_writes_what_is_known(log, capsys, tmp_path, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setitem(follow.__kwdefaults__, "sleep", interrupted)
    out = tmp_path / "out"
    code = main(["pool", "feup-em", "--follow", str(log), "--out", str(out), "--json"])
    told = capsys.readouterr()
    assert code == 1
    assert "interrupted" in told.err
    assert len(json.loads(told.out)["experiments"]) == 2
    assert len(json.loads((out / "pool.json").read_text(encoding="utf-8"))["experiments"]) == 2


def test_a_log_that_is_not_there_leaves_no_folder_behind(capsys, tmp_path):
    out = tmp_path / "out"
    arguments = ["pool", "feup-em", "--follow", str(tmp_path / "none.csv"), "--out", str(out)]
    assert main([*arguments, "--no-wait"]) != 0
    assert "none.csv" in capsys.readouterr().err
    assert not out.exists()
    assert main([*arguments, "--timeout", "0.1 s"]) != 0
    assert not out.exists()
    out.mkdir()
    assert main([*arguments, "--no-wait"]) != 0
    assert out.is_dir()  # the one that was there stays
