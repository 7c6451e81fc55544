"""What a mission by sampled laws keeps of itself, in case it is killed."""

import numpy as np

from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.mission import law_flight, prepare
from swimbladder.sim.mission.law_flight import ByLaws
from swimbladder.sim.mission.prepare import first_state, make_plan


def begun(vehicle, mission, plan):
    """A mission whose first law is laid out at its start."""
    pilot = ByLaws(vehicle, mission, plan, first_state(plan, mission), seed=7)
    pilot.way["law"] = 0.0
    pilot.way["parts"] = 1.0
    pilot._lay_out(np.array([0.0, 0.0, 2.0, 0.0]))
    return pilot


def test_every_exponential_that_was_made_is_there_again(monkeypatch):
    """Of modes that the vehicle was in earlier too, and of no others; and the noise goes on."""
    monkeypatch.setattr(prepare, "_emerges", lambda *_, **__: True)
    monkeypatch.setattr(law_flight, "_CHUNK", 4)  # of noise
    vehicle = load_vehicle("feup-em")
    hold = {"kind": "hold", "depth": 3.0, "tolerance": 1.0, "duration": 60.0}
    mission = Mission(start_depth=2.0, phases=[hold])
    plan = make_plan(vehicle, mission, uniform_column(vehicle.water, 50.0))
    first = begun(vehicle, mission, plan)
    modes = [3, 24, 41]
    first.running.built[:] = 0
    first.running.built[0, modes] = 1
    first.running.chains[0, modes] = np.random.default_rng(1).normal(
        size=first.running.chains[0, modes].shape
    )
    first.way["drawn"] = 5.0
    ahead = first._drawn(9)[5:]
    assert ahead.shape == (4, 2, 1)  # of depth and volume, as 5 were used up
    kept = {name: array.copy() for name, array in first.kept().items()}
    again = begun(vehicle, mission, plan)
    again.resume(kept)
    assert np.array_equal(again.running.built, first.running.built)
    assert np.array_equal(again.running.chains[0, modes], first.running.chains[0, modes])
    assert np.array_equal(again._drawn(4)[:4], ahead)
    for name, array in again.kept().items():
        assert array.tobytes() == kept[name].tobytes(), name
