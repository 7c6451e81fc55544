"""Whether a float's hull has trapped air: the study on points made up, and on measured ones."""

import numpy as np
import pytest
from scipy.optimize import minimize

from studies.trapped_air import Points, better_by, fit, lost_share, read_points
from swimbladder.physics.seawater.column import ATMOSPHERE

DEPTHS = np.array([1.0, 5.0, 10.0, 15.0, 18.0, 15.0, 10.0, 5.0, 1.0])


def made_up(rng, *, psi=6e-7, air=40e-6, drift=4e-7, noise=3e-7):
    lost = 1.0 - ATMOSPHERE / (ATMOSPHERE + 9806.65 * DEPTHS)
    volume = psi * DEPTHS + air * lost + drift * np.arange(9.0)
    return Points(DEPTHS, volume + noise * rng.standard_normal(9))


def test_boyle_takes_half_of_the_air_where_the_pressure_doubles():
    (at_surface, half) = lost_share(np.array([0.0, ATMOSPHERE / 9806.65]))
    assert at_surface == pytest.approx(0.0, abs=1e-12)
    assert half == pytest.approx(0.5, abs=1e-9)


def test_points_without_noise_are_found_again():
    found = fit(made_up(np.random.default_rng(0), noise=1e-13), "psi z and air, drift")
    assert found.values["psi"] == pytest.approx(6e-7, rel=1e-4)
    assert found.values["air"] == pytest.approx(40e-6, rel=1e-4)
    assert found.values["drift"] == pytest.approx(4e-7, rel=1e-4)


def test_intervals_hold_the_truth_and_air_is_not_found_where_there_is_none():
    rng = np.random.default_rng(1)
    runs = 600
    held = alarms = 0
    for _ in range(runs):
        found = fit(made_up(rng), "psi z and air, drift")
        low, high = found.ci95["air"]
        held += low <= 40e-6 <= high
        none = made_up(rng, air=0.0)
        alarms += better_by(fit(none, "psi z, drift"), fit(none, "psi z and air, drift"))[1] < 0.05
    noise = 4.0 * np.sqrt(0.95 * 0.05 / runs)
    assert held / runs == pytest.approx(0.95, abs=noise)
    assert alarms / runs == pytest.approx(0.05, abs=noise)


def test_the_likelihood_is_that_of_normal_errors():
    points = made_up(np.random.default_rng(2))
    found = fit(points, "psi z")

    def minus(x):
        residuals = points.volume - x[0] - x[1] * points.depth
        sigma = np.exp(x[2])
        return 9.0 * np.log(np.sqrt(2.0 * np.pi) * sigma) + residuals @ residuals / (2 * sigma**2)

    start = [found.values["constant"], found.values["psi"] * 1.1, np.log(found.rms * 1.2)]
    scale = {"method": "Nelder-Mead", "options": {"xatol": 1e-12, "fatol": 1e-10, "maxiter": 9999}}
    assert found.log_likelihood == pytest.approx(-minimize(minus, start, **scale).fun, abs=1e-3)


@pytest.mark.data
def test_a_measured_float_has_trapped_air(data_dir):
    points = read_points(data_dir)
    assert len(points.depth) == 9
    plain, air = fit(points, "psi z, drift"), fit(points, "psi z and air, drift")
    bent = fit(points, "psi z and b z2, drift")
    ratio, p = better_by(plain, air)
    assert ratio > 40.0
    assert p < 1e-5
    assert bent.aicc - air.aicc > 15.0  # Boyle's law, and not just any bend
    assert air.rms < 0.25e-6
    low, high = air.ci95["air"]
    assert 35e-6 < low < 43e-6 < high < 50e-6
    low, high = air.ci95["psi"]
    assert 0.4e-6 < low < 0.61e-6 < high < 0.8e-6
    # and without the drift the evidence is weaker and says the same
    _, p = better_by(fit(points, "psi z"), fit(points, "psi z and air"))
    assert 1e-3 < p < 5e-3
    assert fit(points, "psi z").values["psi"] == pytest.approx(2.0e-6, abs=0.05e-6)
