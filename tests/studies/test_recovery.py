"""Counts of maps: every run is counted once, and the table."""

import numpy as np
import pytest

from studies import recovery
from studies.recovery import lines, main, maps_of
from swimbladder.design.stability.recover import Map, Verdict


def made(verdicts, hopeless):
    verdicts = np.array(verdicts)
    return Map(
        name="steps",
        title="steps",
        x_label="depth [m]",
        y_label="change [m]",
        x=np.arange(verdicts.shape[1], dtype=float),
        y=np.arange(verdicts.shape[0], dtype=float),
        verdicts=verdicts,
        seconds=np.zeros(verdicts.shape),
        edge=np.zeros(verdicts.shape[1]),
        hopeless=np.array(hopeless),
    )


def test_a_row_counts_each_run_once_and_the_hopeless_among_the_lost():
    V = Verdict
    one = made(
        [[V.LOST, V.LOST, V.SLOW], [V.RECOVERED, V.NOT_ASKED, V.UNSETTLED]],
        [[True, False, True], [False, False, False]],
    )
    assert lines("cascade", [one]) == ["| cascade | steps | 5 | 1 | 1 | 1 | 2 | 1 |"]


def test_the_command_prints_a_row_for_each_map(capsys, monkeypatch):
    monkeypatch.setattr(
        recovery, "maps_of", lambda *_: (made([[Verdict.RECOVERED]], [[False]]),) * 4
    )
    main(["--law", "cascade", "planned"])
    found = capsys.readouterr().out.splitlines()
    assert len(found) == 2 + 8
    assert found[-1] == "| planned | steps | 1 | 1 | 0 | 0 | 0 | 0 |"


@pytest.mark.slow
def test_from_rest_in_shallow_water_the_cascade_is_never_lost():
    steps, *errors = maps_of("cascade", 10.0, cells=5)
    assert steps.asked == 8
    assert steps.count(Verdict.LOST) == 0
    assert len(errors) == 3
    for one in errors:  # no run beyond the edge of what any controller can do came back
        assert not np.any(one.hopeless & (one.verdicts == Verdict.RECOVERED))
