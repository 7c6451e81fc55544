"""The float in the tank: logs that taught nothing are predicted; and how the study sums up."""

import argparse

import numpy as np
import pytest

from studies.tank import bottom_of, expanding, judge, load, logs_folder, tank_logs, train
from studies.tank_table import Row, parameters, pooled, table
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from swimbladder.physics.hull import heat_expansion

TEACHERS = (31, 45, 47, 49, 63)
HELD_OUT = (35, 43, 51, 65)


def row(**change):
    given = {
        "log": 1,
        "skill10": 0.5,
        "integrator10": 0.4,
        "coverage10": 0.9,
        "rms10": 0.1,
        "n10": 100,
        "skill60": 0.2,
        "integrator60": 0.3,
        "coverage60": 1.0,
        "rms60": 0.2,
        "n60": 50,
        "persistence10": 0.2,
        "persistence60": 0.25,
        "constant": 0.1,
        "drifting": 0.03,
        "travelled": 1e-6,
        "touches": False,
        "reason": "",
    }
    return Row(**(given | change))


def test_scores_are_pooled_over_predictions_not_over_logs():
    rows = [row(), row(log=2, rms10=0.3, n10=300, persistence10=0.3, coverage10=0.5, skill10=0.0)]
    p = pooled(rows)
    ours = np.sqrt((100 * 0.1**2 + 300 * 0.3**2) / 400)
    stays = np.sqrt((100 * 0.2**2 + 300 * 0.3**2) / 400)
    assert p["pooled10"] == pytest.approx(1.0 - ours / stays)
    assert p["coverage10"] == pytest.approx((100 * 0.9 + 300 * 0.5) / 400)
    assert p["median10"] == 0.25


def test_the_open_loop_median_leaves_out_logs_that_touch():
    rows = [row(), row(log=2, constant=9.0, drifting=9.0, touches=True)]
    assert pooled(rows)["drifting"] == 0.03
    assert "with a drift 30 mm" in table(rows)
    without = [row(constant=np.nan, drifting=np.nan)]
    assert "open loop" not in table(without)


def test_a_log_below_the_bottom_has_none():
    def log(deepest):
        depth = np.full(50, deepest)
        return Log(source="x", time=np.arange(50.0), depth=depth, line=np.arange(50))

    assert bottom_of(log(1.43)) == 1.43
    assert bottom_of(log(1.6)) == np.inf


def test_a_hull_that_expands_gains_so_much_per_kelvin():
    assert heat_expansion(expanding(load_vehicle("ntnu-bv"), 1.5e-6)) == pytest.approx(1.5e-6)


@pytest.mark.prove
@pytest.mark.data
def test_logs_that_taught_nothing_are_predicted_ten_seconds_ahead(data_dir):
    """Thresholds well inside what all splits of the logs gave (docs/explanation/filter.md)."""
    folder = data_dir / "ntnu_bv"
    assert set(TEACHERS) | set(HELD_OUT) <= set(tank_logs(folder))
    vehicle, found = train(load(folder, TEACHERS), load_vehicle("ntnu-bv"))
    assert found.drifts
    assert 6.3 < vehicle.mass < 13.0  # dry 6.29 kg, and the water that moves with it
    assert "walk =" in parameters(vehicle, found)
    logs = load(folder, HELD_OUT)
    rows = [judge(n, log, vehicle, open_loop=False) for n, log in logs.items()]
    for r in rows:
        assert r.skill10 > 0.5, r
        assert r.integrator10 > 0.3, r
    p = pooled(rows)
    assert p["pooled10"] > 0.55
    assert p["integrator60"] > 0.4
    assert 0.9 < p["coverage10"] <= 1.0


def test_the_folder_is_that_of_all_data_or_of_the_vehicle(tmp_path, capsys):
    parser = argparse.ArgumentParser()
    inner = tmp_path / "ntnu_bv"
    inner.mkdir()
    (inner / "missions_meta.csv").write_text("log\n")
    assert logs_folder(tmp_path, parser) == logs_folder(inner, parser) == inner
    with pytest.raises(SystemExit, match="2"):
        logs_folder(inner / "elsewhere", parser)
    assert "there is no missions_meta.csv" in capsys.readouterr().err
