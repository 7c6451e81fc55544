"""What is taken away bit by bit ends in the mission without it."""

import numpy as np
import pytest

from swimbladder.physics.seawater.motion import InternalWave, WaterMotion, motion_table
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import Account, Note
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import make_plan
from tests.sim.mission.conftest import phases, stratified

TIGHT = Accuracy(
    relative=1e-9, depth=1e-9, speed=1e-11, volume=1e-15, rest_deep=1e-7, rest_afloat=1e-7
)


def arrivals(flight):
    return flight.notes[flight.notes["what"] == Note.ARRIVED]["t"]


def waves(amplitude):
    wave = InternalWave(amplitude=amplitude, period=3600.0, water_depth=400.0)
    return motion_table(WaterMotion(internal_waves=(wave,)), 9.81)


def test_a_wave_of_no_amplitude_moves_nothing(profiler, sea):
    """First order in the amplitude down to it, and the still water's flight at 0.

    A vehicle in a wave goes on by steps where one at rest is left out: no equality to the bit.
    """
    still = fly_mission(profiler, phases(), sea, accuracy=TIGHT)
    none = fly_mission(profiler, phases(), sea, waves=waves(0.0), accuracy=TIGHT)
    np.testing.assert_allclose(arrivals(none), arrivals(still), rtol=0.0, atol=1e-3)
    off = []
    for amplitude in (1e-2, 1e-3):
        moved = fly_mission(profiler, phases(), sea, waves=waves(amplitude), accuracy=TIGHT)
        off.append(abs(arrivals(moved)[0] - arrivals(still)[0]))
    # over 0.1 m/s a layer moved by 1 cm comes some 0.1 s earlier or later
    assert 1e-3 < off[0] < 1.0
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)


def test_a_clock_of_no_step_is_none(profiler, sea):
    def first(quantum):
        actuator = profiler.actuator.model_copy(update={"quantum": quantum})
        vehicle = profiler.model_copy(update={"actuator": actuator})
        return fly_mission(vehicle, phases(), sea, accuracy=TIGHT)

    exact = first(0.0)
    fine = first(1e-9)
    assert len(fine.notes) == len(exact.notes)
    np.testing.assert_array_equal(fine.notes["what"], exact.notes["what"])
    np.testing.assert_allclose(fine.notes["t"], exact.notes["t"], rtol=0.0, atol=1e-2)
    # a run is half a step wrong at most: the first volume let in, by its flow
    coarse = first(1e-3)
    let = [f.notes[f.notes["what"] == Note.RUN_OVER]["number"][0] for f in (exact, fine, coarse)]
    assert abs(let[1] - let[0]) <= 0.5e-9 * 1.001
    assert abs(let[2] - let[0]) <= 0.5e-3 * 1.001


def test_a_battery_that_the_cold_leaves_alone(profiler):
    """cold_share = 1: nothing is held back in any water; the share just below it holds back so."""
    cold, warm = stratified(), stratified()
    warm = warm.__class__(**{**vars(warm), "temperature": np.full_like(warm.temperature, 20.0)})

    def flown(share, column):
        supply = profiler.supply.model_copy(update={"cold_share": share, "capacity": 1e6})
        return profiler.model_copy(update={"supply": supply}), column

    def empty(share, column):
        return make_plan(flown(share, column)[0], phases(), column).given["empty"]

    assert empty(1.0, cold) == empty(1.0, warm) == empty(0.5, warm) == 0.0
    # linear from 20 degC down: (1 - share)(20 - T)/20 of what is in it
    coldest = float(np.min(cold.temperature[cold.depth <= 150.0]))
    for share in (0.5, 1.0 - 1e-9):
        held = 1e6 * (1.0 - share) * (20.0 - coldest) / 20.0
        assert empty(share, cold) == pytest.approx(held, rel=1e-6)
    vehicle, _ = flown(1.0, cold)
    near, _ = flown(1.0 - 1e-9, cold)
    a, b = (fly_mission(v, phases(), cold) for v in (vehicle, near))
    np.testing.assert_array_equal(a.rows, b.rows)
    assert a.accounts[Account.PUMP_ENERGY] == b.accounts[Account.PUMP_ENERGY] > 0.0
    assert a.rows["t"][-1] > 0.0
