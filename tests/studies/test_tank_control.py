"""The study of the tank's controller: its measures by hand, and its replay of one real log."""

import csv
import math

import numpy as np
import pytest

from studies.tank import load, train
from studies.tank_control import behaviour, mission_of, pid_of, replay
from swimbladder.io.config import load_vehicle


def test_measures_are_those_of_a_mission_made_by_hand():
    time = np.arange(0.0, 101.0)
    depth = np.where(time < 20.0, 0.05 * time, 1.0)
    depth[25] = 1.2  # beyond once, and outside 5 cm for the last time
    volume = np.where(time < 10.0, 0.0, 1e-6)
    volume[50:] = -1e-6
    found = behaviour(time, depth, volume, [(0.0, 1.0)])
    assert found.settled == 25.0
    assert found.overshoot == pytest.approx(0.2)
    assert found.rms == pytest.approx(0.0, abs=1e-12)
    assert found.moved == pytest.approx(3e-6 / 100.0)
    assert found.starts == pytest.approx(2 / 100.0)
    assert math.isinf(behaviour(time, 0.0 * depth, volume, [(0.0, 1.0)]).settled)


def test_a_mission_without_gains_has_no_controller():
    row = dict.fromkeys(("pid_kp", "pid_ki", "pid_kd", "integralTreshold", "EMA_alpha"), "")
    assert pid_of(row, load_vehicle("ntnu-bv")) is None


@pytest.mark.data
@pytest.mark.prove
def test_a_logged_loop_is_replayed(data_dir):
    """Thresholds well above what the study printed for this mission: 21 mm, 6 s and 4 cm."""
    folder = data_dir / "ntnu_bv"
    vehicle, _ = train(load(folder, (35, 43, 49, 51, 63)), load_vehicle("ntnu-bv"))
    with (folder / "missions_meta.csv").open(newline="", encoding="utf-8") as file:
        rows = {int(row["log"]): row for row in csv.DictReader(file)}
    mission = mission_of(47, load(folder, [47])[47], rows[47], vehicle)
    logged, simulated, apart = replay(mission)
    assert apart < 0.06
    assert simulated.settled == pytest.approx(logged.settled, abs=30.0)
    # Of 52 cm; with five missions as teachers the drag is less sure than with the study's eight.
    assert simulated.overshoot == pytest.approx(logged.overshoot, abs=0.15)
