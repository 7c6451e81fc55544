"""swimbladder pool, from the command line."""

import json

from swimbladder.cli import main
from swimbladder.identify import identify
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import read_log


def test_a_rehearsal_ends_good_enough_and_its_logs_give_the_same_numbers(capsys, tmp_path):
    code = main(["pool", "feup-em", "--simulate", "--out", str(tmp_path), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert code == 0
    assert told["good_enough"]
    logs = [read_log(path) for path in sorted(tmp_path.glob("experiment-*.csv"))]
    again = identify(logs, load_vehicle("feup-em")).to_json()
    assert again["parameters"] == told["parameters"]
    assert len(logs) == len(told["experiments"])

    code = main(["pool", "feup-em", "--follow", str(tmp_path / "pool.csv"), "--no-wait",
                 "--out", str(tmp_path / "again"), "--json"])  # fmt: skip
    followed = json.loads(capsys.readouterr().out)
    assert code == 0
    assert followed["parameters"] == told["parameters"]
