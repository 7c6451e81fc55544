"""A buffer that is full breaks nothing off: what was decided goes on."""

import numpy as np
import pytest

from swimbladder.sim.mission import law_flight
from swimbladder.sim.mission.flight import fly_mission
from tests.sim.mission.conftest import phases


@pytest.mark.parametrize("rows", [100, 333])
def test_how_often_the_rows_are_fetched_changes_nothing(rows, profiler, sea, monkeypatch):
    task = phases(duration=5 * 86400.0)
    usual = fly_mission(profiler, task, sea, seed=3)
    monkeypatch.setattr(law_flight.ByRule, "rows", rows)
    often = fly_mission(profiler, task, sea, seed=3)
    assert len(usual.rows) > 2 * rows
    for name in usual.end.dtype.names:
        np.testing.assert_array_equal(often.end[name], usual.end[name], err_msg=name)
