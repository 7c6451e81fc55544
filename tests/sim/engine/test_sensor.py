"""A sensor: what noise and quantum do to one reading."""

import math

import numpy as np
import pytest

from swimbladder.sim.engine.cache import part
from swimbladder.sim.engine.sensor import Sensor, measured, quantised


@part
def read(noise, quantum, true, normal):
    return measured(Sensor(noise, quantum), true, normal)


@part
def rounded(value, quantum):
    return quantised(value, quantum)


def test_noise_comes_before_the_quantum() -> None:
    for normal in np.random.default_rng(3).standard_normal(200):
        reading = read(2e-3, 5e-3, 1.2345, normal)
        steps = (1.2345 + 2e-3 * normal) / 5e-3
        assert reading == pytest.approx(5e-3 * round(steps), rel=1e-14)
    assert read(2e-3, 0.0, 1.2345, -1.5) == pytest.approx(1.2315, rel=1e-15)
    assert read(0.0, 0.0, 1.2345, 7.0) == 1.2345


def test_halves_go_up_and_what_is_no_number_stays_so() -> None:
    assert [rounded(x, 0.5) for x in (0.25, -0.25, 0.74, -0.76, 1e300)] == [0.5, 0, 0.5, -1, 1e300]
    assert math.isnan(rounded(math.nan, 0.5))
    assert rounded(math.inf, 0.5) == math.inf
