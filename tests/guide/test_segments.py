"""The phases of the procedure, found in logs of which it is known what was done when."""

import numpy as np
import pytest

from swimbladder import pool
from swimbladder.guide.events import Changed, End, Ended, Ready, Sample
from swimbladder.guide.rules import Rules
from swimbladder.guide.segments import Segmenter
from swimbladder.io.config import load_vehicle
from swimbladder.parameters import Sensors


@pytest.fixture(scope="module")
def runs():
    sensors = Sensors(depth_noise=2e-3, depth_quantum=5e-3, volume_quantum=0.75e-6)
    vehicle = load_vehicle("feup-em").model_copy(update={"sensors": sensors})
    return pool.pool_test(vehicle, dVs=[20e-6, 75e-6], seed=7)


def events_of(time, depth, volume, rules=None):
    segmenter = Segmenter(Rules() if rules is None else rules)
    rows = np.column_stack([time, depth, volume]).tolist()
    found = [event for row in rows for event in segmenter.feed(Sample(*row))]
    return found + segmenter.close()


def test_the_two_experiments_of_a_run_are_found_where_they_were_done(runs):
    for run in runs:
        found = events_of(run.solution.time, run.seen_depth, run.seen_volume)
        cuts = [e.cut for e in found if isinstance(e, Ended)]
        assert len(cuts) == 2
        for cut, done in zip(cuts, run.experiments, strict=True):
            pulse = done.released + done.pulse_time
            assert done.released - 0.7 <= cut.released <= pulse + 0.3
            assert cut.change == pytest.approx(done.dV, rel=0.1)
            assert cut.rest.neutral == pytest.approx(done.neutral, abs=0.3e-6)
            assert cut.end is End.TRAVEL
            assert abs(cut.travel) == pytest.approx(3.0, abs=0.15)
            assert cut.columns()["volume_m3"][0] == 0.0
        kinds = [type(e) for e in found]
        assert kinds.count(Changed) == 2
        assert Ready in kinds[: kinds.index(Changed)]
