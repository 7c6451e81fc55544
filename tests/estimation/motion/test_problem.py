"""Predictions and derivatives of a fit against SciPy's integrator."""

import math

import numpy as np
import pytest

from swimbladder.estimation.comparison.record import record
from swimbladder.estimation.motion.problem import (
    DEPTH,
    SPEED,
    VOLUME,
    Assumed,
    Problem,
    experiment,
    model_of,
)
from swimbladder.io.config import load_vehicle
from tests.estimation.motion.pool import FEUP, G, pool_log, trace

FEUP_EM = load_vehicle("feup-em")


def problem_of(logs, names, *, law="linear", vehicle=FEUP_EM, **options):
    experiments = [experiment(record(log, vehicle), vehicle) for log in logs]
    model = model_of(vehicle, law=law, bottom_depth=math.inf)
    return Problem(experiments, model, names, Assumed(**{"neutral_std": 0.5e-6} | options))


def scipy_depths(problem, x):
    """The same depths by SciPy, from x read anew."""
    values = problem.named(x)
    m = values["mass"] if problem.model.law == "quadratic" else G * values["T2"] / values["K2"]
    k_dl = 0.0 if problem.model.law == "quadratic" else G / values["K2"]
    k_dt = 0.0 if problem.model.law == "linear" else values["drag_quadratic"]
    found = []
    for j, e in enumerate(problem.experiments):
        V0 = x[problem.shared + j] * VOLUME - values["psi"] * e.reference
        for k, s in enumerate(e.segments):
            at = problem.starts_at[j] + 2 * k
            part = slice(s.first, s.last + 1)
            found.append(
                trace(
                    e.record.time[part],
                    e.inputs[part],
                    z0=x[at] * DEPTH,
                    w0=x[at + 1] * SPEED,
                    V0=V0,
                    m=m,
                    k_dl=k_dl,
                    k_dt=k_dt,
                    psi=values["psi"],
                )
            )
    return np.concatenate(found)


@pytest.mark.parametrize(
    ("law", "names"),
    [
        ("linear", ("K2", "T2", "psi")),
        ("quadratic", ("mass", "drag_quadratic", "psi")),
        ("blended", ("K2", "T2", "drag_quadratic", "psi")),
    ],
)
def test_depths_and_derivatives_are_those_of_scipy(law, names):
    problem = problem_of([pool_log(45e-6), pool_log(-20e-6, longest=20.0)], names, law=law)
    x = problem.begin()
    x[problem.shared] = 0.4
    x[problem.first_start + 1] = 0.7
    exact = 2e-9 if law == "linear" else 2e-7
    assert problem.predict(x) == pytest.approx(scipy_depths(problem, x), abs=exact)
    J = problem.slope(x)
    for i in range(problem.size):
        h = 1e-3
        up, down = x.copy(), x.copy()
        up[i] += h
        down[i] -= h
        slope = (scipy_depths(problem, up) - scipy_depths(problem, down)) / (2.0 * h)
        assert J[:, i] == pytest.approx(slope, abs=3e-5 * max(float(np.abs(slope).max()), 1e-3))


def test_a_neutral_volume_counts_from_the_first_sample_s_depth():
    """At rest and neutral there, whatever psi is, the vehicle stays."""
    log = pool_log(20e-6, rest=1e3, longest=30.0)
    problem = problem_of([log], ("psi",))
    for psi in (-1e-6, 0.0, 4e-6):
        x = problem.begin({"psi": psi})
        x[problem.first_start : problem.first_start + 2] = 3.75 / DEPTH, 0.0
        assert problem.predict(x) == pytest.approx(np.full(len(log), 3.75), abs=1e-12)


def test_priors_are_rows_in_standard_deviations():
    from swimbladder.estimation.estimates import Prior

    problem = problem_of(
        [pool_log(20e-6)], ("K2", "psi"), priors={"K2": Prior(8000.0, 400.0)}, speed_std=1e-3
    )
    x = problem.begin({"K2": 8200.0})
    x[problem.shared], x[problem.first_start + 1] = 0.25, 0.3
    rows, slopes = problem.prior_rows(x)
    assert rows == pytest.approx([(8000.0 - 8200.0) / 400.0, -0.25e-6 / 0.5e-6, -0.3e-2 / 1e-3])
    for i in range(problem.size):
        moved = x.copy()
        moved[i] += 1e-6
        numeric = -(problem.prior_rows(moved)[0] - rows) / 1e-6
        assert slopes[:, i] == pytest.approx(numeric, abs=1e-4)


def test_a_long_gap_and_the_surface_cut_a_log():
    time = np.concatenate([np.arange(0.0, 20.0, 0.5), np.arange(30.0, 60.0, 0.5)])
    depth = np.where((time > 40.0) & (time < 45.0), 0.02, 1.0)
    from swimbladder.io.logs import Log

    log = Log(
        source="x", time=time, depth=depth, volume=np.zeros(len(time)), line=np.arange(len(time))
    )
    e = experiment(record(log, FEUP_EM), FEUP_EM)
    spans = [(time[s.first], time[s.last]) for s in e.segments]
    assert spans == [(0.0, 19.5), (30.0, 40.0), (45.0, 59.5)]
    assert not e.used[(time > 40.0) & (time < 45.0)].any()


def test_drift_of_the_neutral_volume_against_scipy():
    log = pool_log(30e-6, longest=30.0)
    problem = problem_of([log], ("K2", "T2"), fixed={"psi": FEUP["psi"]})
    x = problem.begin()
    e = problem.experiments[0]
    t = e.record.time
    rate = 1e-9
    V0 = x[problem.shared] * VOLUME - FEUP["psi"] * e.reference
    start = {"z0": x[problem.first_start] * DEPTH, "w0": x[problem.first_start + 1] * SPEED}
    still = trace(t, e.inputs, V0=V0, **start, **FEUP)
    drifting = trace(t, e.inputs - rate * (t - t.mean()), V0=V0, **start, **FEUP)
    expected = (drifting - still) / rate
    found = problem.drift_slope(x, 0)
    assert found == pytest.approx(expected, abs=1e-4 * float(np.abs(expected).max()))
