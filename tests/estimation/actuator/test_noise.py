"""Quantum, outliers, autoregression; and the mean of estimates that differ."""

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from swimbladder.estimation.actuator.bench import autoregression, quantum, spikes
from swimbladder.estimation.actuator.model import pool, shown, student
from swimbladder.estimation.estimates import Estimate
from swimbladder.estimation.series import WHITE, white_noise


@pytest.mark.parametrize("step", [1e-5, 3.4e-7, 2.0])
def test_the_quantum_of_a_reading_is_found(step):
    random = np.random.default_rng(1)
    smooth = 300.0 * step * np.sin(np.linspace(0.0, 20.0, 2000))
    assert quantum(step * np.rint((smooth + 0.7 * step * random.normal(size=2000)) / step)) == (
        pytest.approx(step, rel=1e-6)
    )


def test_a_reading_without_steps_has_no_quantum():
    random = np.random.default_rng(2)
    assert quantum(np.cumsum(random.normal(size=3000))) == 0.0
    assert quantum(np.zeros(50)) == 0.0


def test_white_noise_on_a_smooth_position_is_seen_at_any_times_and_with_outliers():
    random = np.random.default_rng(3)
    time = np.cumsum(random.uniform(0.5, 1.5, 4000))
    position = 3.0 * time + 0.2 * random.normal(size=4000)
    assert white_noise(time, position) == pytest.approx(0.2, rel=0.05)
    position[random.random(4000) < 0.05] += 50.0
    assert white_noise(time, position) == pytest.approx(0.2, rel=0.25)


def test_spikes_are_found_and_ramps_and_corners_are_not_spikes():
    random = np.random.default_rng(4)
    ramp = np.maximum(np.arange(200.0) - 100.0, 0.0)
    hit = random.random(200) < 0.1
    assert not spikes(ramp, 0.0)[:95].any()
    assert not spikes(ramp, 0.5).any()
    assert np.array_equal(spikes(ramp + 40.0 * hit, 2.0), hit)


def ar2(random, n, a, b):
    return lfilter([1.0], [1.0, -a, -b], random.normal(size=n + 500))[500:]


def test_an_autoregression_is_found_in_blocks():
    random = np.random.default_rng(5)
    found = autoregression([ar2(random, 4000, 1.2, -0.5) for _ in range(4)])
    assert found.coefficients[:2] == pytest.approx((1.2, -0.5), abs=0.04)
    assert np.abs(found.coefficients[2:]).max(initial=0.0) < 0.05
    assert autoregression([random.normal(size=5000)]) == WHITE
    assert autoregression([np.zeros(100)]) == WHITE


def test_whitening_makes_the_stationary_covariance_that_of_white_noise():
    random = np.random.default_rng(6)
    found = autoregression([ar2(random, 20000, 0.9, -0.3)])
    # the covariance of such noise, from its impulse response
    answer = lfilter([1.0], [1.0, *(-c for c in found.coefficients)], np.eye(1, 400)[0])
    lags = np.array([answer[: 400 - k] @ answer[k:] for k in range(12)])
    lengths = np.array([12, 1, 5])
    whiten = found.matrix(lengths).toarray()
    start = 0
    for n in lengths:
        part = whiten[start : start + n, start : start + n]
        assert part @ toeplitz(lags[:n]) @ part.T == pytest.approx(np.eye(n), abs=1e-8)
        start += n
    block = random.normal(size=(12, 2))
    assert whiten[:12, :12] @ block == pytest.approx(found.whiten(block), abs=1e-12)
    assert whiten[:12, 12:].any() == 0


def test_what_agrees_is_averaged_by_weight():
    pooled = pool([1.0, 1.1, 0.95], [0.1, 0.2, 0.1])
    w = np.array([100.0, 25.0, 100.0])
    assert pooled.mean == pytest.approx(w @ [1.0, 1.1, 0.95] / w.sum())
    assert pooled.std == pytest.approx(w.sum() ** -0.5)
    assert (pooled.between, pooled.df) == (0.0, np.inf)


def test_what_differs_is_averaged_as_paule_and_mandel_say():
    x, s = np.array([1.0, 2.0, 4.0, 3.0]), np.array([0.1, 0.2, 0.1, 0.3])
    pooled = pool(x, s)
    w = 1.0 / (s**2 + pooled.between**2)
    assert w @ (x - w @ x / w.sum()) ** 2 == pytest.approx(3.0, rel=1e-6)
    assert pooled.df == pytest.approx(3.0, rel=0.1)
    assert pooled.p < 1e-6


def test_the_mean_of_what_differs_is_within_its_interval_as_often_as_it_says():
    random = np.random.default_rng(7)
    held = 0
    for _ in range(400):
        x = 5.0 + random.normal(size=6) * np.hypot(0.3, 0.1)
        low, high = pool(x, np.full(6, 0.1)).estimate("s").ci95
        held += low <= 5.0 <= high
    assert stats.binomtest(held, 400, 0.95).pvalue > 0.001


def test_intervals():
    assert Estimate.of(2.0, 0.1, "s").ci95 == pytest.approx((2.0 - 0.1959964, 2.0 + 0.1959964))
    low, high = Estimate.of(2.0, 0.1, "s", reach=0.1 * student(4.0), logarithmic=True).ci95
    assert (np.log(high / 2.0), low * high) == pytest.approx((2.776445 * 0.05, 4.0))
    assert Estimate.given(3.0, "V").to_dict()["origin"] == "set"
    assert Estimate.unknown("V", "why").to_dict() | {"ci95": None} == {
        "value": None,
        "std": None,
        "ci95": None,
        "unit": "V",
        "origin": "none",
    }
    assert Estimate.unknown("V", "why").why == "why"
    assert Estimate.bounded(0.0, 0.2, "s", "short").ci95 == (0.0, 0.2)
    assert shown(0.005245, "m/s") == "5.245 mm/s"
    assert shown(1.25, "-") == "1.25"
