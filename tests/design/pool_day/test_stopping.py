"""The study of stopping when the numbers look good: its days, its table, and going on."""

import json

import numpy as np
import pytest

from studies import stopping
from swimbladder.design.pool_day import Operator, paper_tasks
from swimbladder.io.config import load_vehicle


def _told(count, value, state="good enough"):
    p = {"truth": 10.0, "value": value, "std": 0.5, "low": value - 1.0, "high": value + 1.0}
    return {"experiments": count, "state": state, "K2": p, "T2": p, "psi": p}


def _day(number, count=4, value=10.5, state="good enough"):
    stop = _told(count, value, state)
    each = {"4": _told(4, 10.5), "5": stop}
    return {"number": number, "each": each, "stop": stop, "4": stop, "8": _told(8, 10.0)}


def test_the_table_by_hand():
    found = [_day(0), _day(1, 5, 12.0), _day(2, 16, 9.5, "more experiments"), _day(3)]
    lines = stopping.table(found, target=0.05).splitlines()
    assert lines[1].split() == ["at", "the", "stop", "K2", "3", "66.7", "9.4-99.2", "+2.00", "6.00"]
    assert lines[4].split()[:5] == ["without", "a", "margin", "K2", "4"]
    assert lines[4].split()[-2:] == ["+1.00", "1.00"]  # the first that meets 5 %
    assert lines[10].split()[:5] == ["after", "8", "K2", "4", "100.0"]
    assert lines[-2] == "experiments at the stop: 4: 2, 5: 1"
    assert lines[-1] == "ended: good enough 3, more experiments 1"


def test_the_study_goes_on_where_it_stopped(tmp_path, monkeypatch):
    asked = []

    def run_day(number, folder, **_):
        assert folder.is_dir()
        asked.append(number)
        return _day(number)

    monkeypatch.setattr(stopping, "run_day", run_day)
    options = {"target": 0.02, "rehearsed": False}
    list(stopping.days(range(3), tmp_path, **options))
    kept = {json.loads(f.read_text())["number"]: f for f in tmp_path.rglob("*.json")}
    assert sorted(kept) == [0, 1, 2]
    kept[2].write_text(kept[2].read_text()[:-20])  # a disk that lost the end of the third
    found = list(stopping.days(range(4), tmp_path, **options))
    assert asked == [0, 1, 2, 2, 3]
    assert [f["number"] for f in found] == [0, 1, 2, 3]
    assert {json.loads(f.read_text())["number"] for f in tmp_path.rglob("*.json")} == {0, 1, 2, 3}


def test_an_experiment_of_the_study_does_as_the_vehicle_must():
    """Held, then let go at rest; 20 cm3 more lift it, less what the sea takes of the stroke."""
    believed = load_vehicle("feup-em")
    task = paper_tasks(believed, bottom_depth=4.5)[0]
    perform = stopping.performer(
        believed, np.array([7935.54, 36.3, 4.04e-6]), np.random.default_rng(1)
    )
    time, depth, volume = perform(task).T
    assert np.allclose(np.diff(time), 0.3)
    still = time < time[0] + 75.0
    assert abs(np.polyfit(time[still], depth[still], 1)[0]) < 6e-4
    assert volume[-1] - volume[still].mean() == pytest.approx(20e-6, abs=1.5e-6)
    assert depth[-1] < 0.1 < depth[0]
    assert perform(task)[0, 0] > time[-1] + 5.0  # a gap


@pytest.mark.prove
def test_a_day_ends_and_its_numbers_are_near_the_truth(tmp_path):
    found = stopping.run_day(0, tmp_path, target=0.05)
    assert found["stop"]["state"] == "good enough"
    assert found["stop"]["experiments"] == 4
    assert found["8"]["experiments"] == 8
    for name in ("K2", "T2", "psi"):
        p = found["8"][name]
        assert abs(p["value"] - p["truth"]) < 4.0 * p["std"] < 0.15 * p["truth"]


def test_a_rehearsed_piston_stands_while_the_vehicle_goes():
    """Held by a voltage for the depth of the sample, it would creep by 0.1 cm3 on its way."""
    vehicle = load_vehicle("feup-em")
    task = paper_tasks(vehicle, bottom_depth=4.5)[0]
    done = Operator(vehicle, vehicle, bottom_depth=4.5, seed=0).perform(task)
    begun = next(at for at, does in done.phases if does == "glide")
    volume = done.volume[done.time > begun + 2.0]
    assert len(volume) > 50
    assert np.ptp(volume) < 0.02e-6
