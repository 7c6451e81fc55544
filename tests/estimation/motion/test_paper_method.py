"""The paper's way on experiments whose truth SciPy made, and where it cannot be used."""

import dataclasses

import numpy as np
import pytest

from swimbladder.estimation.motion import identify
from swimbladder.estimation.motion.paper_method import paper_fits
from swimbladder.io.config import load_vehicle
from tests.estimation.motion.pool import STEPS, campaign, pool_log

FEUP_EM = load_vehicle("feup-em")
QUICK = {"profiles": False, "choices": False}


def test_the_averages_of_exact_experiments_are_those_found_by_others():
    """13076 and 62.5 s: the average of single fits of eq. (27) where psi is left out."""
    logs = [pool_log(dV) for dV in STEPS]
    found = paper_fits(identify(logs, FEUP_EM, **QUICK))
    assert found.by_depth[:2] == pytest.approx((13076.0, 62.5), rel=0.02)
    gains = [fit.by_depth.K2 for fit in found.each]
    # from the smallest step to the largest, 16300 to 10600
    assert gains[:2] == pytest.approx([16300.0] * 2, rel=0.03)
    assert gains[-2:] == pytest.approx([10600.0] * 2, rel=0.03)
    assert "outside our interval" in found.sentence
    assert "psi" in found.sentence


def test_a_hull_as_stiff_as_the_water_is_found_as_the_paper_does():
    truth = {"m": 44.9, "k_dl": 1.2358, "psi": 0.0}
    logs = [pool_log(dV, **truth) for dV in STEPS[::3]]
    found = paper_fits(identify(logs, FEUP_EM, fixed={"psi": 0.0}, **QUICK))
    for fit in (found.by_speed, found.by_depth):
        assert fit[:2] == pytest.approx((9806.65 / 1.2358, 44.9 / 1.2358), rel=1e-2)
    told = found.to_dict()
    assert set(told) == {"by_speed", "by_depth", "experiments", "sentence"}
    assert told["experiments"][0]["step_m3"] == pytest.approx(2e-5)
    assert told["by_depth"]["rms_m"] < 1e-3


def test_logs_that_it_cannot_be_used_on_say_why():
    logs = campaign(41, steps=STEPS[:4])
    uneven = logs[0].time + 0.1 * np.sin(np.arange(len(logs[0].time)))
    moving = dataclasses.replace(
        logs[1],
        time=logs[1].time[60:] - logs[1].time[60],
        depth=logs[1].depth[60:],
        volume=logs[1].volume[60:] + 1e-9 * np.arange(len(logs[1].time) - 60),
        line=logs[1].line[60:],
        suspect=logs[1].suspect[60:],
    )
    logs[0] = dataclasses.replace(logs[0], time=uneven - uneven[0])
    logs[1] = moving
    found = paper_fits(identify(logs, FEUP_EM, neutral_std=float("inf"), **QUICK))
    assert [fit.why for fit in found.each] == [
        "it is not sampled evenly",
        "it does not begin at rest",
        "",
        "",
    ]
    told = [fit.by_depth for fit in found.each[2:]]
    assert found.by_depth == pytest.approx(np.mean(told, axis=0))
    none = paper_fits(identify(logs[:2], FEUP_EM, neutral_std=float("inf"), **QUICK))
    assert none.by_depth is None
    assert "it does not begin at rest" in none.sentence
