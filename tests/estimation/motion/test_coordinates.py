"""The search's own coordinates: back and forth, derivatives, and a start without laminar drag."""

import math

import numpy as np
import pytest

from swimbladder.estimation.comparison.record import record
from swimbladder.estimation.motion.fit import fit
from swimbladder.estimation.motion.problem import (
    Assumed,
    Coordinates,
    Problem,
    experiment,
    model_of,
)
from swimbladder.io.config import load_vehicle
from tests.estimation.motion.pool import G, campaign

BLENDED = {"m": 5.7, "k_dl": G / 42660.0, "k_dt": 6.45, "psi": 3.06e-7}
STEPS = (8e-6, -11e-6, 5e-6, -8e-6)


def _problem(names, law):
    vehicle = load_vehicle("feup-em")
    logs = campaign(3, noise=1e-3, steps=STEPS, **BLENDED)
    experiments = [experiment(record(log, vehicle), vehicle) for log in logs]
    return Problem(
        experiments,
        model_of(vehicle, law=law, bottom_depth=math.inf),
        names,
        Assumed({"psi": BLENDED["psi"]}, neutral_std=0.5e-6),
    )


@pytest.mark.parametrize("names", [("K2", "T2", "drag_quadratic"), ("K2", "drag_quadratic")])
def test_coordinates_lead_back_and_their_slopes_are_differences(names):
    problem = _problem(names, "blended")
    coordinates, x = Coordinates(problem), problem.begin()
    y = coordinates.of(x)
    assert coordinates.back(y) == pytest.approx(x, abs=1e-13)
    low, high = coordinates.bounds()
    assert (low < y).all()
    assert (y < high).all()
    J = coordinates.slope(y, problem.slope(x))
    for i in range(len(names)):
        h = 1e-5 * np.eye(len(y))[i]
        ahead, behind = (problem.predict(coordinates.back(y + s * h)) for s in (1.0, -1.0))
        assert J[:, i] == pytest.approx((ahead - behind) / 2e-5, abs=1e-3 * np.abs(J[:, i]).max())


def test_a_start_that_has_no_laminar_drag_ends_where_the_truth_does():
    """From T2 = 1000 s, in logarithms, the search was still on its way after 130 evaluations."""
    problem = _problem(("K2", "T2", "drag_quadratic"), "blended")
    mass = BLENDED["m"]
    far = fit(problem, [problem.begin({"K2": G * 1e3 / mass, "T2": 1e3, "drag_quadratic": 10.0})])
    k_dl = BLENDED["k_dl"]
    true = problem.begin({"K2": G / k_dl, "T2": mass / k_dl, "drag_quadratic": BLENDED["k_dt"]})
    near = fit(problem, [true])
    assert far.objective == pytest.approx(near.objective, abs=0.01)
    assert far.x[:3] == pytest.approx(near.x[:3], abs=1e-3)


def test_outliers_among_the_first_samples_do_not_begin_a_stretch():
    log = campaign(5, noise=1e-3, steps=(40e-6,), **BLENDED)[0]
    vehicle = load_vehicle("feup-em")
    log.depth[[1, 2, 6]] += [-3.0, 2.0, 0.7]
    (stretch,) = experiment(record(log, vehicle), vehicle).segments
    assert stretch.depth == pytest.approx(3.75, abs=5e-3)
    assert abs(stretch.speed) < 0.02
