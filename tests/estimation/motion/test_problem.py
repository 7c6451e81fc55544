"""Predictions and derivatives of a fit against SciPy's integrator."""

import math

import numpy as np
import pytest

from swimbladder.estimation.comparison.record import record
from swimbladder.estimation.motion.problem import (
    DELAY,
    DEPTH,
    DRIFT,
    SPEED,
    VOLUME,
    Assumed,
    Problem,
    experiment,
    model_of,
)
from swimbladder.io.config import load_vehicle
from tests.estimation.motion.pool import G, pool_log, trace

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
        drift, late = x[problem.first_drift + j] * DRIFT, x[problem.delay_at] * DELAY
        for k, s in enumerate(e.segments):
            at = problem.starts_at[j] + 2 * k
            part = slice(s.first, s.last + 1)
            t = e.record.time[part]
            fine = np.union1d(t, (t + late)[(t + late > t[0]) & (t + late < t[-1])])
            depth = trace(
                fine,
                np.interp(fine, t, e.inputs[part] - drift * (t - e.record.time[0])),
                z0=x[at] * DEPTH,
                w0=x[at + 1] * SPEED,
                V0=V0,
                m=m,
                k_dl=k_dl,
                k_dt=k_dt,
                psi=values["psi"],
            )
            found.append(np.interp(t + late, fine, depth))
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
    x[problem.first_drift : problem.delay_at] = 1.5, -0.8
    exact = 2e-9 if law == "linear" else 2e-7
    assert problem.predict(x) == pytest.approx(scipy_depths(problem, x), abs=exact)
    J = problem.slope(x)
    for i in range(problem.delay_at):
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
        [pool_log(20e-6)],
        ("K2", "psi"),
        priors={"K2": Prior(8000.0, 400.0)},
        speed_std=1e-3,
        drift_std=2e-9,
        delay_std=0.1,
    )
    x = problem.begin({"K2": 8200.0})
    x[problem.shared], x[problem.first_start + 1] = 0.25, 0.3
    x[problem.first_drift], x[problem.delay_at] = 0.7, -2.0
    rows, slopes = problem.prior_rows(x)
    known = [(8000.0 - 8200.0) / 400.0, -0.25e-6 / 0.5e-6, -0.3e-2 / 1e-3]
    assert rows == pytest.approx([*known, -0.7e-9 / 2e-9, 0.02 / 0.1])
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


@pytest.mark.parametrize("late", [0.0, 0.13, -0.4])
def test_late_volumes_against_scipy(late):
    """The depths of a log whose volumes are read later, and what a little later does: the speed."""
    problem = problem_of([pool_log(30e-6, longest=30.0)], ("K2", "T2"))
    x = problem.begin()
    x[problem.delay_at] = late / DELAY
    inside = slice(2, -2)  # beyond the ends there is no volume
    assert problem.predict(x)[inside] == pytest.approx(scipy_depths(problem, x)[inside], abs=2e-6)
    h, moved = 0.02 / DELAY, []
    for sign in (1.0, -1.0):
        near = x.copy()
        near[problem.delay_at] += sign * h
        moved.append(scipy_depths(problem, near)[inside])
    slope = problem.slope(x)[inside, problem.delay_at]
    assert slope == pytest.approx((moved[0] - moved[1]) / (2.0 * h), abs=0.01 * np.abs(slope).max())
