"""The information in noisy, rounded samples, and the bound, against what is known by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from studies.bound import Experiment, bounds, slopes
from studies.noise import Noise
from studies.truth import Body, Motor, Step, follow

K_B = 9806.65
DEPTHS = np.linspace(1.0, 1.02, 41)


def test_unrounded_normal_noise_tells_one_over_its_variance():
    assert np.allclose(Noise(sigma=2e-3).of_sample(DEPTHS), 250000.0)


def test_a_fine_quantum_adds_its_variance():
    """Sheppard's correction is exact to rounding where the quantum is below the noise."""
    found = Noise(sigma=2e-3, quantum=1e-3).of_sample(DEPTHS)
    assert np.allclose(found, 1.0 / (2e-3**2 + 1e-3**2 / 12.0), rtol=1e-3)


def test_a_coarse_quantum_tells_only_near_its_edges():
    """One edge: a coin with chance Phi, whose information at the edge is (2/pi)/sigma2."""
    noise = Noise(sigma=0.2e-3, quantum=5e-3)
    at_edge, between = noise.of_sample(np.array([1.0025, 1.005]))
    assert at_edge == pytest.approx(2.0 / math.pi / 0.2e-3**2, rel=1e-9)
    assert between < 1e-9 * at_edge


@pytest.mark.parametrize(
    "noise",
    [
        Noise(sigma=1e-3, quantum=5e-3),
        Noise(sigma=3e-3, quantum=5e-3),
        Noise(sigma=2e-3, quantum=5e-3, outliers=0.1, outlier_sigma=0.02),
        Noise(sigma=2e-3, outliers=0.1, outlier_sigma=0.3),
    ],
)
def test_information_is_the_variance_of_the_score(noise):
    """Drawn samples: the mean squared slope of their log likelihood, from their own histogram."""
    rng = np.random.default_rng(5)
    z, h, n = 1.0013, 2e-4, 4_000_000
    width = noise.quantum or 2e-4
    edges = (np.arange(round(0.99 / width), round(1.013 / width)) + 0.5) * width

    def histogram(depth):
        return np.histogram(noise.draw(rng, np.full(n, depth)), edges)[0] / n

    less, more = histogram(z - h), histogram(z + h)
    middle = 0.5 * (less + more)
    met = middle > 2e-5
    found = np.sum(((more - less)[met] / (2 * h)) ** 2 / middle[met])
    # The slope's own scatter adds, in each cell, the variance of a share over (2 h)^2.
    found -= met.sum() * 2.0 / (4.0 * h**2 * n)
    assert found == pytest.approx(noise.of_sample(np.array([z]))[0], rel=0.04)


def test_outliers_cost_little_more_than_their_share():
    clean, wild = (Noise(sigma=2e-3), Noise(sigma=2e-3, outliers=0.1, outlier_sigma=0.3))
    share = wild.of_sample(DEPTHS)[0] / clean.of_sample(DEPTHS)[0]
    assert 0.86 < share < 0.90


def test_memory_is_the_inverse_covariance():
    noise = Noise(sigma=2e-3, memory=0.8)
    slope = np.stack([np.ones(30), np.arange(30.0) ** 2], axis=1)
    lag = np.abs(np.subtract.outer(np.arange(30), np.arange(30)))
    expected = slope.T @ np.linalg.inv(2e-3**2 * 0.8**lag) @ slope
    assert np.allclose(noise.information(np.zeros(30), slope), expected, rtol=1e-9)
    drawn = np.stack([noise.draw(np.random.default_rng(k), np.zeros(10)) for k in range(4000)])
    assert np.allclose(np.cov(drawn.T) / 2e-3**2, 0.8 ** lag[:10, :10], atol=0.08)
    with pytest.raises(ValueError, match="memory"):
        Noise(sigma=1e-3, quantum=1e-3, memory=0.5)


def _flight(body, motor, sample_time=0.3, rest=2, samples=100):
    step = Step(
        sample_time=sample_time,
        rest=rest,
        pulse=1,
        voltage=8.0,
        start_depth=3.7,
        reference_depth=3.7,
    )
    depth, volume = follow(body, motor, step, samples)
    return Experiment(step=step, depth=depth[0], volume=volume[0])


def test_at_terminal_speed_the_bound_is_that_of_a_straight_line():
    """Without inertia the depth is a straight line of slope -K2 V, through an unknown depth."""
    body = Body.identified(k_b=K_B, K2=5000.0, T2=1e-4, psi=0.0)
    flight = _flight(body, Motor(K1=0.444e-3, T1=1e-6, area=75e-4), rest=0)
    noise = Noise(sigma=2e-3)
    fixed = {"T2": 0.0, "neutral_error": 0.0, "start_speed": 0.0}
    found = bounds(body, Motor(K1=0.444e-3, T1=1e-6, area=75e-4), [flight], noise, ["K2"], fixed)
    t = 0.3 * np.arange(100) - 0.15  # the ramp of one sample takes half of it away
    t[0] = 0.0
    expected = 2e-3 / math.sqrt(np.sum((t - t.mean()) ** 2)) / (5000.0 * flight.volume[-1])
    assert found["K2"] == pytest.approx(expected, rel=1e-3)


def test_a_prior_is_the_bound_of_what_the_data_cannot_tell():
    """At rest, exactly neutral, nothing moves: K2 and T2 are as well known as before."""
    body = Body.identified(k_b=K_B, K2=7935.54, T2=36.3, psi=4e-6)
    motor = Motor(K1=0.444e-3, T1=0.09, area=75e-4)
    step = Step(sample_time=0.3, rest=0, pulse=1, voltage=0.0, start_depth=2.0, reference_depth=2.0)
    depth, volume = follow(body, motor, step, 50)
    still = Experiment(step=step, depth=depth[0], volume=volume[0])
    known = {"K2": 0.2, "T2": 0.3, "psi": 1e-6, "neutral_error": 0.0, "start_speed": 0.0}
    found = bounds(body, motor, [still], Noise(sigma=2e-3), ["K2", "T2", "psi"], known)
    assert found == pytest.approx({"K2": 0.2, "T2": 0.3, "psi": 1e-6}, rel=1e-6)
    free = bounds(body, motor, [still], Noise(sigma=2e-3), ["K2", "T2"], {})
    assert math.isinf(free["K2"])


def test_without_priors_psi_and_K2_and_the_neutral_volume_cannot_be_told_apart():
    """A volume that is wrong from the start on: psi K2, K2 V0 and T2 are all that there is."""
    body = Body.identified(k_b=K_B, K2=7935.54, T2=36.3, psi=4.04e-6)
    motor = Motor(K1=0.444e-3, T1=0.09, area=75e-4)
    step = Step(
        sample_time=0.3,
        rest=0,
        pulse=1,
        voltage=0.0,
        start_depth=3.0,
        reference_depth=3.0,
        neutral_error=-20e-6,
    )
    depth, volume = follow(body, replace(motor, load=0.0), step, 130)
    flight = Experiment(step=step, depth=depth[0], volume=volume[0])
    names = ["K2", "T2", "psi", "neutral_error"]
    slope = slopes(body, replace(motor, load=0.0), flight, names)
    slope = slope[1:] / np.linalg.norm(slope[1:], axis=0)
    singular = np.linalg.svd(slope, compute_uv=False)
    assert singular[-1] < 1e-5 * singular[-2]


def test_slopes_do_not_depend_on_the_integrator():
    linear = Body.identified(k_b=K_B, K2=7935.54, T2=36.3, psi=4.04e-6)
    motor = Motor(K1=0.444e-3, T1=0.09, area=75e-4, load=0.077)
    names = ["K2", "T2", "psi", "neutral_error", "start_depth", "start_speed"]
    flight = _flight(linear, motor)
    exact = slopes(linear, motor, flight, names)
    by_steps = slopes(replace(linear, k_dt=1e-300), motor, flight, names)
    assert (np.abs(by_steps - exact) / np.abs(exact).max(axis=0)).max() < 1e-5
