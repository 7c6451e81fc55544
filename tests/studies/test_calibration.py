"""The intervals of `identify` on simulated campaigns: neither too narrow nor too wide.

Each test has one chance in 10,000 to fail where all is right. Intervals that are a fifth too narrow
or too wide fail the second one nearly always: their squared distances are off by 40 % or more.
"""

import os

import pytest
from scipy.stats import binom, chi2

from studies.calibration import study
from studies.scenarios import SCENARIOS
from studies.summary import figures

RARELY = 1e-4
CAMPAIGNS = 100


@pytest.fixture(scope="module", params=["paper", "random"])
def found(request, tmp_path_factory):
    (scenario,) = (s for s in SCENARIOS if s.name == request.param)
    jobs = 1 if "PYTEST_XDIST_WORKER" in os.environ else 2
    folder = tmp_path_factory.mktemp("study")
    return scenario, study(scenario, campaigns=CAMPAIGNS, seed=1, jobs=jobs, folder=folder)


@pytest.mark.prove
def test_the_intervals_hold_the_truth_as_often_as_they_say(found):
    scenario, campaigns = found
    assert all(f["identified"] for f in campaigns)
    for name in scenario.names:
        held = [f["parameters"][name] for f in campaigns]
        hits = sum(p["low"] <= p["truth"] <= p["high"] for p in held)
        assert binom.cdf(hits, CAMPAIGNS, 0.95) > RARELY, f"{name}: {hits} of {CAMPAIGNS}"


@pytest.mark.prove
def test_the_truth_is_as_far_away_as_the_intervals_say(found):
    scenario, campaigns = found
    squares = sum(f["distance"] ** 2 for f in campaigns)
    freedom = CAMPAIGNS * len(scenario.names)
    low, high = chi2.ppf([RARELY / 2, 1.0 - RARELY / 2], freedom)
    assert low < squares < high, f"mean square {squares / freedom:.3f} of what it should be"
    # A fifth less or more of width would be seen.
    assert freedom / 0.8**2 > 1.1 * high
    assert freedom / 1.2**2 < low


@pytest.mark.prove
def test_intervals_are_about_as_narrow_as_can_be(found):
    scenario, campaigns = found
    for name in scenario.names:
        f = figures(name, campaigns, logarithmic=scenario.logarithmic(name))
        assert 0.9 < f["width_bound"] < 1.3, name
        assert f["rms_bound"] < 1.3, name
