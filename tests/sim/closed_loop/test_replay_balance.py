"""The balance of a run whose volume was given."""

import numpy as np

from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import drive


def test_a_given_volume_works_on_the_water_and_tells_nothing_of_the_motor() -> None:
    vehicle = load_vehicle("feup-em")
    time = np.arange(0.0, 100.0, 0.1)
    volume = 30e-6 * np.sin(time / 10.0) + vehicle.neutral_volume(3.0)
    run = drive(vehicle, time=time, volume=volume, start_depth=3.0)
    assert "volume was given" in run.balance.basis
    assert set(run.balance.energy) == {"source", "drag", "bottom", "vehicle motion", "sea"}
    assert run.balance.relative_energy_residue < 1e-5
    # the work on the water, by the trapezoidal rule from the trajectory alone
    weight = vehicle.water.specific_weight
    work = weight * np.sum(0.5 * (run.depth[1:] + run.depth[:-1]) * np.diff(run.volume))
    assert abs(run.balance.energy["source"] - work) < 1e-3 * run.balance.throughput
