"""The benchmark of a year flies the same mission in both, before anything is timed."""

import pytest

from benchmarks.year import GOAL, Peer, Tried, compare, report


@pytest.mark.prove
def test_the_peers_agree():
    ours, scipy = compare(quick=True)
    assert ours.name == "swimbladder"
    assert 0.0 < ours.error < 0.05  # m, over a dive to 1990 m
    assert scipy.error <= ours.error
    loose, tight = scipy.runs
    assert loose.error >= ours.error >= tight.error


def test_the_report_has_the_ratio():
    runs = (Tried(1e-5, 2e-3, 7.0), Tried(1e-6, 5e-4, 9.0))
    text = report([Peer("swimbladder", 0.1, 1e-3), Peer("SciPy, LSODA", 8.0, 1e-3, runs)])
    assert "80" in text
    assert f"goal for the package: {GOAL} s" in text
