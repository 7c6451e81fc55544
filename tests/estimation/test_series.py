"""What is common to series of samples."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from swimbladder.estimation.series import shifted


@pytest.mark.parametrize("samples", [4, 5, 200])
@pytest.mark.parametrize("late", [0.0, 0.2, -0.7, 3.0])
def test_values_of_another_time_are_those_of_scipys_spline(samples: int, late: float) -> None:
    rng = np.random.default_rng(samples)
    time = np.cumsum(rng.uniform(0.1, 0.5, samples))
    values = np.cumsum(rng.normal(size=(3, samples)), axis=1)
    found, rates = shifted(time, values, late)
    spline = CubicSpline(time, values, axis=1)
    size = np.abs(spline(time + late)).max()
    np.testing.assert_allclose(found, spline(time + late), atol=1e-12 * size, rtol=0.0)
    size = np.abs(spline(time + late, 1)[0]).max()
    np.testing.assert_allclose(rates, spline(time + late, 1)[0], atol=1e-11 * size, rtol=0.0)
