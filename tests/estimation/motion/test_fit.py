"""The fit against SciPy's own, and its covariance against brute force."""

import math

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.optimize import least_squares

from swimbladder.estimation.motion.fit import autocovariance, fit, regression
from swimbladder.estimation.motion.process_noise import fit_process_noise
from tests.estimation.motion.pool import FEUP, campaign, pool_log
from tests.estimation.motion.test_problem import FEUP_EM, problem_of, scipy_depths


def test_the_fit_is_the_minimum_that_scipy_finds_with_its_own_integrator():
    rng = np.random.default_rng(5)
    logs = [pool_log(dV, rng=rng, error=0.3e-6, longest=40.0) for dV in (75e-6, -45e-6)]
    problem = problem_of(logs, ("K2", "T2", "psi"))
    found = fit(problem)
    assert (found.weight == 1.0).all()
    each = np.repeat(found.noise, np.diff(problem.rows))

    def rows(x):
        left = (problem.measured - scipy_depths(problem, x)) / each
        return np.concatenate([left, problem.prior_rows(x)[0]])

    start = found.x + 0.02 * rng.normal(size=len(found.x))

    def slopes(x):  # of steps that do not shrink with x, as SciPy's do
        steps = 1e-5 * np.eye(len(x))
        return np.stack([(rows(x + h) - rows(x - h)) / 2e-5 for h in steps], axis=1)

    other = least_squares(rows, start, slopes, xtol=1e-10, ftol=1e-12)
    std = np.sqrt(np.diag(found.covariance))
    assert np.abs((found.x - other.x) / std).max() < 0.02


def test_exact_data_give_the_truth_back():
    for law, names, truth in (
        ("linear", ("K2", "T2", "psi"), {}),
        ("quadratic", ("mass", "drag_quadratic", "psi"), {"m": 44.0, "k_dt": 12.0, "psi": 1e-6}),
        (
            "blended",
            ("K2", "T2", "drag_quadratic", "psi"),
            {"m": 44.0, "k_dl": 1.0, "k_dt": 12.0, "psi": 1e-6},
        ),
    ):
        logs = [pool_log(dV, longest=60.0, **truth) for dV in (60e-6, -30e-6, 25e-6)]
        problem = problem_of(logs, names, law=law)
        values = problem.named(fit(problem).x)
        truth = truth or FEUP
        expected = {
            "K2": 9806.65 / truth.get("k_dl", math.inf),
            "T2": truth["m"] / truth.get("k_dl", 1e9),
            "mass": truth["m"],
            "drag_quadratic": truth.get("k_dt", 0.0),
            "psi": truth["psi"],
        }
        for name in names:
            assert values[name] == pytest.approx(expected[name], rel=1e-5), (law, name)


def test_a_wrong_vehicle_is_mended_by_the_regression():
    """K2, T2 and psi a factor of four off are no obstacle."""
    problem = problem_of(campaign(1), ("K2", "T2", "psi"))
    near = fit(problem)
    problem.values |= {"K2": 2000.0, "T2": 150.0, "psi": -1e-6}
    far = fit(problem)
    assert np.abs((far.x - near.x) / np.sqrt(np.diag(near.covariance))).max() < 0.05


def test_the_regression_is_near():
    problem = problem_of([pool_log(dV) for dV in (60e-6, -30e-6)], ("K2", "T2", "psi"))
    values, errors = regression(problem.experiments, problem.model, psi=None, free_neutral=True)
    assert values["K2"] == pytest.approx(7935.54, rel=0.15)
    assert values["T2"] == pytest.approx(36.3, rel=0.15)
    assert values["psi"] == pytest.approx(4.04e-6, rel=0.15)
    assert np.abs(errors).max() < 1e-6


def test_covariance_is_the_sandwich_written_out():
    rng = np.random.default_rng(3)
    logs = [pool_log(dV, rng=rng, noise=3e-3) for dV in (60e-6, -30e-6)]
    for log in logs:  # noise that resembles its neighbours
        white = rng.normal(size=len(log))
        coloured = np.zeros(len(log))
        for k in range(1, len(log)):
            coloured[k] = 0.7 * coloured[k - 1] + 3e-3 * white[k]
        log.depth[:] += coloured
    problem = problem_of(logs, ("K2", "T2"), fixed={"psi": 4.04e-6})
    found = fit(problem)
    assert any(found.ar)
    A, B = np.zeros((problem.size,) * 2), np.zeros((problem.size,) * 2)
    for j, (a, b) in enumerate(zip(problem.rows[:-1], problem.rows[1:], strict=True)):
        X = np.sqrt(found.weight[a:b, None]) * found.slope[a:b] / found.noise[j]
        A += X.T @ X
        B += X.T @ toeplitz(autocovariance(*found.ar_noise[j], b - a)) @ X
    P = problem.prior_rows(found.x)[1]
    inverse = np.linalg.inv(A + P.T @ P)
    expected = inverse @ (B + P.T @ P) @ inverse
    assert found.covariance == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert found.information == pytest.approx(A + P.T @ P, rel=1e-9)


@pytest.mark.parametrize("kind", ["far", "same side", "drop-outs"])
def test_gross_outliers_move_nothing_by_a_standard_deviation(kind):
    clean = campaign(11)
    rng = np.random.default_rng(4)
    dirty = campaign(11)
    for log in dirty:
        hit = rng.random(len(log)) < 0.1
        size = {"far": rng.normal(0.0, 1.0, hit.sum()), "same side": 0.5, "drop-outs": None}[kind]
        log.depth[hit] = 0.2 if size is None else log.depth[hit] + size
    names = ("K2", "T2", "psi")
    a, b = fit(problem_of(clean, names)), fit(problem_of(dirty, names))
    std = np.sqrt(np.diag(a.covariance))[:3]
    assert np.abs((b.x - a.x)[:3] / std).max() < 1.0
    assert b.noise == pytest.approx(a.noise, rel=0.15)


def test_a_poor_start_is_left_by_way_of_process_noise():
    """A record of minutes under a volume that moves often, from parameters that are far off."""
    rng = np.random.default_rng(8)
    time = np.arange(0.0, 300.0, 0.5)
    volume = 8e-6 * np.sign(np.sin(2.0 * np.pi * time / 37.0)) * (time > 5.0)
    from swimbladder.io.logs import Log
    from tests.estimation.motion.pool import trace

    truth = {"m": 44.0, "k_dl": 3.0, "psi": 0.0}
    z = trace(time, volume, z0=5.0, V0=0.4e-6, **truth) + 3e-3 * rng.normal(size=len(time))
    log = Log(source="x", time=time, depth=z, volume=volume, line=np.arange(len(time)))
    problem = problem_of([log], ("K2", "T2"), fixed={"psi": 0.0}, neutral_std=math.inf)
    problem.values |= {"K2": 300.0, "T2": 500.0}
    begun = fit_process_noise(problem, FEUP_EM).values
    values = problem.named(fit(problem, [problem.begin(begun)]).x)
    assert values["K2"] == pytest.approx(9806.65 / 3.0, rel=0.02)
