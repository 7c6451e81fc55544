"""Draws from the posterior against what is known of it."""

import numpy as np
import pytest

from swimbladder.estimation.motion.fit import fit
from swimbladder.estimation.motion.posterior import sample
from tests.estimation.motion.pool import campaign
from tests.estimation.motion.test_problem import problem_of


@pytest.mark.prove
def test_a_nearly_normal_posterior_has_the_fit_s_moments():
    pytest.importorskip("emcee")
    problem = problem_of(campaign(40)[4:], ("K2", "T2"), fixed={"psi": 4.04e-6})
    found = fit(problem)
    told = []
    drawn = sample(problem, found, seed=1, steps=260, walkers=16, advance=told.append)
    assert sum(told) == pytest.approx(1.0)
    assert drawn.effective > 50.0
    logs = np.log(drawn.draws)
    std = np.sqrt(np.diag(found.covariance)[:2])
    assert (logs.mean(axis=0) - found.x[:2]) / std == pytest.approx([0.0, 0.0], abs=0.4)
    assert logs.std(axis=0) / std == pytest.approx([1.0, 1.0], abs=0.25)
    correlation = found.covariance[0, 1] / (std[0] * std[1])
    assert np.corrcoef(logs.T)[0, 1] == pytest.approx(correlation, abs=0.1)
    low, median, high = drawn.interval("T2")
    assert low < median < high
    assert drawn.to_dict()["T2"] == {"median": median, "ci95": [low, high]}


@pytest.mark.prove
def test_the_same_seed_draws_the_same():
    pytest.importorskip("emcee")
    problem = problem_of(campaign(41)[6:], ("K2", "T2"), fixed={"psi": 4.04e-6})
    found = fit(problem)
    a, b = (sample(problem, found, seed=3, steps=200, walkers=6).draws for _ in range(2))
    assert np.array_equal(a, b)
