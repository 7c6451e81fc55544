"""The machinery of the calibration study: draws, the table's figures, and going on after a stop."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from studies import calibration
from studies.scenarios import SCENARIOS, draw
from studies.summary import binomial_interval, figures, render, summary

BY_NAME = {s.name: s for s in SCENARIOS}


def _found(index, value, low, high, identified=True):
    p = {"truth": 10.0, "value": value, "low": low, "high": high, "bound": 0.05}
    return {
        "scenario": "paper-psi-known",
        "index": index,
        "identified": identified,
        "seconds": 0.1,
        "why": "",
        "parameters": {"K2": p, "T2": p},
    }


def test_figures_by_hand():
    found = [_found(0, 11.0, 9.0, 12.0), _found(1, 9.0, 8.0, 9.5), _found(2, 1.0, 1.0, 2.0, False)]
    f = figures("K2", found, logarithmic=True)
    assert (f["count"], f["hits"]) == (2, 1)
    assert f["bias"] == pytest.approx(0.0)
    assert f["rms"] == pytest.approx(0.1)
    off = math.log(1.1) ** 2 + math.log(0.9) ** 2
    assert f["rms_bound"] == pytest.approx(math.sqrt(off / 2.0) / 0.05)
    width = (math.log(12.0 / 9.0) + math.log(9.5 / 8.0)) / 2.0
    assert f["width_bound"] == pytest.approx(width / (2 * 1.96 * 0.05), rel=1e-4)
    plain = figures("K2", found, logarithmic=False)
    assert plain["width_bound"] == pytest.approx((0.3 + 0.15) / 2.0 / (2 * 1.96 * 0.05), rel=1e-4)
    assert plain["rms_bound"] == pytest.approx(2.0)
    rows = summary(BY_NAME["paper-psi-known"], found)
    assert [row[:3] for row in rows] == [
        ["paper-psi-known", "K2", "50.0"],
        ["paper-psi-known", "T2", "50.0"],
    ]
    assert rows[0][9] == "33.3"
    assert "paper-psi-known: the same" in render(rows, [BY_NAME["paper-psi-known"]])
    none = summary(BY_NAME["paper-psi-known"], [_found(0, 1.0, 1.0, 1.0, False)])
    assert none[0][9] == "100.0"


def test_the_interval_of_a_share_holds_what_it_must():
    low, high = binomial_interval(1900, 2000)
    assert binom.sf(1899, 2000, low) == pytest.approx(0.025)
    assert binom.cdf(1900, 2000, high) == pytest.approx(0.025)
    assert binomial_interval(0, 10)[0] == 0.0
    assert binomial_interval(10, 10)[1] == 1.0


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda s: s.name)
def test_a_campaign_is_what_its_number_says(scenario):
    one, same, other = (draw(scenario, seed=3, index=k) for k in (0, 0, 1))
    assert np.array_equal(one.kept[0].depth, same.kept[0].depth)
    assert one.truth == same.truth
    assert not np.array_equal(one.kept[0].depth[:5], other.kept[0].depth[:5])
    for flight, record in zip(one.experiments, one.kept, strict=True):
        assert len(record.time) == len(flight.depth) >= 20
        assert np.abs(flight.depth - flight.step.start_depth).max() <= 3.0
        assert record.volume[0] == 0.0


def test_the_study_goes_on_where_it_stopped(tmp_path, monkeypatch):
    from studies import campaign

    asked = []

    def outcome(_, *, index, **__):
        asked.append(index)
        return _found(index, 10.0 + index, 9.0, 12.0)

    monkeypatch.setattr(campaign, "outcome", outcome)
    scenario = BY_NAME["paper-psi-known"]
    options = {"seed": 1, "jobs": 1, "folder": tmp_path}
    calibration.study(scenario, campaigns=3, **options)
    (file, *_) = (path for path in tmp_path.iterdir() if '"index": 2' in path.read_text())
    file.write_text(file.read_text()[:-20])  # torn
    found = calibration.study(scenario, campaigns=5, **options)
    assert asked == [0, 1, 2, 2, 3, 4]
    assert [f["index"] for f in found] == list(range(5))
    assert len(list(tmp_path.iterdir())) == 5


def test_a_campaign_that_fails_says_which_it_was(tmp_path, monkeypatch):
    from studies import campaign

    def broken(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr(campaign, "identify", broken)
    with pytest.raises(ZeroDivisionError) as caught:
        calibration.study(SCENARIOS[0], campaigns=1, seed=7, jobs=1, folder=tmp_path)
    assert caught.value.__notes__ == ["in campaign 0 of paper, seed 7"]
