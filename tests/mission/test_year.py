"""The benchmark of a year flies the same mission in both, before anything is timed."""

from benchmarks.year import GOAL, Peer, compare, report


def test_the_peers_agree():
    ours, scipy = compare(quick=True)
    assert ours.name == "swimbladder"
    assert 0.0 < ours.error < 0.05  # m, over a dive to 1990 m
    assert scipy.error <= ours.error
    assert scipy.tolerance is not None


def test_the_report_has_the_ratio():
    text = report([Peer("swimbladder", 0.1, 1e-3), Peer("SciPy, LSODA", 8.0, 1e-3, 1e-6)])
    assert "80" in text
    assert f"goal for the package: {GOAL} s" in text
