"""A processor that errs about its drive, and a mission that begins with a volume of its own."""

import numpy as np
import pytest

from swimbladder.physics.hull import neutral_volume
from swimbladder.sim.engine.rodas.records import Note
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import DriveError
from tests.sim.mission.conftest import phases

SHORT = 4e-7  # m3 that each start falls short by


@pytest.fixture(scope="module")
def steady(profiler):
    """The float with a pump of one delivery, no bypass and runs as long as they have to be."""
    pump = profiler.actuator.pump.model_copy(update={"slip": 0.0})
    actuator = profiler.actuator.model_copy(
        update={
            "pump": pump,
            "bypass": None,
            "quantum": 0.0,
            "longest_run": None,
            "line": None,
            "start_volume": SHORT,
        }
    )
    return profiler.model_copy(update={"actuator": actuator})


def runs(flight, kind):
    """Volume asked for and volume got [m3] of the runs that came to their end under way."""
    notes = flight.notes
    begun = np.flatnonzero(notes["what"] == kind)
    over = np.flatnonzero(notes["what"] == Note.RUN_OVER)
    pairs = []
    for k in begun:
        end = over[over > k][0]
        if notes["z"][k] > 10.0 and notes["number"][end] < 50.0:
            change = notes["v"][end] - notes["v"][k]
            pairs.append((notes["number"][k], change))
    return np.array(pairs)


@pytest.mark.parametrize(
    ("drive_error", "lacks"),
    [
        (DriveError(), 0.0),
        (DriveError(pump=0.5, starts=False), SHORT),
        (DriveError(pump=0.5), None),
    ],
)
def test_a_run_of_the_pump_gives_its_share(steady, sea, drive_error, lacks):
    got = runs(fly_mission(steady, phases(), sea, drive_error=drive_error), Note.PUMP)
    assert len(got) >= 2
    # a run made longer for its start gives a share of that too
    lacks = SHORT - drive_error.pump * SHORT if lacks is None else lacks
    np.testing.assert_allclose(got[:, 1], drive_error.pump * got[:, 0] - lacks, rtol=1e-3)


def test_an_opening_of_the_valve_lets_in_its_share(steady, sea):
    got = [
        runs(fly_mission(steady, phases(), sea, drive_error=r), Note.VALVE)
        for r in (DriveError(), DriveError(valve=0.5))
    ]
    shares = [values[:, 1] / values[:, 0] for values in got]
    assert min(map(len, shares)) >= 2
    # the flow is reckoned with where a run begins, and the float sinks while it lasts
    np.testing.assert_allclose(shares[0], 1.0, rtol=0.02)
    np.testing.assert_allclose(shares[1], 0.5, rtol=0.02)


def test_it_begins_with_the_volume_that_is_given(profiler, sea):
    neutral = float(np.interp(100.0, sea.depth, neutral_volume(profiler, sea)))
    task = phases(start_depth=100.0)
    rests = fly_mission(profiler, task, sea)
    heavy = fly_mission(profiler, task, sea, start_volume=neutral - 2e-5)
    assert rests.begin["v"] == pytest.approx(neutral, abs=1e-12)
    assert heavy.begin["v"] == neutral - 2e-5
    # it sinks at once, at no more than the speed that 20 cm3 give
    weight = 1025.0 * 9.81
    fastest = np.sqrt(2e-5 * weight / profiler.drag.k_dt)
    soon = heavy.rows[heavy.rows["t"] < 60.0]
    assert soon["w"][-1] > 0.5 * fastest
    assert np.all(soon["w"] < 1.01 * fastest)
