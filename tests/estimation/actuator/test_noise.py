"""Quantum, outliers, autoregression; and the mean of estimates that differ."""

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import toeplitz
from scipy.optimize import brentq
from scipy.signal import lfilter

from swimbladder.estimation.actuator.bench import autoregression, quantum, spikes
from swimbladder.estimation.actuator.model import pool, shown
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


def posterior(x, s, scale):
    """Mean and 95 % interval of the mean by quadrature, after the prior that the guide states."""
    largest = scale * np.abs(x).max()
    spreads = largest * np.concatenate([[0.0], np.geomspace(1e-5, 1.0 / 0.015, 4001)])
    width = np.gradient(np.log(spreads[1:])) * spreads[1:]
    slab = stats.t(0.7).pdf(spreads[1:] / largest) * width
    prior = np.append(0.5, 0.5 * slab / slab.sum())
    both = s**2 + spreads[:, None] ** 2
    mean = (x / both).sum(axis=1) / (1.0 / both).sum(axis=1)
    std = (1.0 / both).sum(axis=1) ** -0.5
    # the likelihood of the spread, the mean integrated out: that of all but one contrast
    weight = prior * std * np.prod(stats.norm.pdf(x, mean[:, None], np.sqrt(both)), axis=1)
    weight /= weight.sum()

    def end(p):
        inside = 50.0 * float(s.max() + np.ptp(x))
        return brentq(
            lambda m: weight @ stats.norm.cdf(m, mean, std) - p, -inside, inside + x.max()
        )

    return weight @ mean, end(0.025), end(0.975)


@pytest.mark.parametrize("wide", [1.0, 10.0])
@pytest.mark.parametrize(
    ("x", "s"),
    [
        ([1.0, 1.0002], [1e-3, 1e-3]),
        ([1.0, 1.003], [1e-3, 1.5e-3]),
        ([1.0, 1.02], [1e-4, 1e-4]),
        ([2.0, 2.1, 1.95], [0.1, 0.2, 0.1]),
        ([1.0, 1.01, 0.98, 1.02, 1.0], [2e-3, 4e-3, 2e-3, 2e-3, 3e-3]),
    ],
)
def test_the_mean_is_that_of_the_posterior(x, s, wide):
    x, s = np.array(x), np.array(s)
    mean, low, high = posterior(x, s, 0.015 * wide)
    pooled = pool(x, s, wide)
    assert pooled.mean == pytest.approx(mean, abs=0.02 * (high - low))
    assert 2.0 * 1.96 * pooled.std == pytest.approx(high - low, rel=0.04)


def test_what_agrees_is_averaged_by_weight_and_one_is_itself():
    pooled = pool([1.0, 1.1, 0.95], [0.1, 0.2, 0.1])
    w = np.array([100.0, 25.0, 100.0])
    assert pooled.mean == pytest.approx(w @ [1.0, 1.1, 0.95] / w.sum(), rel=2e-3)
    assert pooled.std == pytest.approx(w.sum() ** -0.5, rel=0.15)
    assert pooled.between == 0.0
    assert pool([2.0], [0.1])[:3] == (2.0, 0.1, 0.0)


def test_of_many_that_differ_the_spread_is_theirs():
    x, s = np.array([1.0, 2.0, 4.0, 3.0]), np.array([0.1, 0.2, 0.1, 0.3])
    pooled = pool(x, s)
    assert 0.5 * x.std(ddof=1) < pooled.between < 1.5 * x.std(ddof=1)
    assert pooled.p == pytest.approx(stats.chi2.sf(np.sum((x - 2.3333) ** 2 / s**2), 3), abs=1e-6)
    many = np.random.default_rng(8).normal(5.0, 0.1, 200)
    assert pool(many, np.full(200, 0.01)).between == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize(
    ("count", "spread", "noise", "wide"),
    [
        *((count, spread, 1e-4, 1.0) for count in (2, 3, 5, 8) for spread in (0.0, 0.02)),
        (6, 0.06, 0.02, 10.0),
    ],
)
def test_the_mean_of_what_differs_is_within_its_interval_as_often_as_it_says(
    count, spread, noise, wide
):
    random = np.random.default_rng(7)
    held = 0
    for _ in range(400):
        x = 5.0 + 5.0 * random.normal(size=count) * np.hypot(spread, noise)
        low, high = pool(x, np.full(count, 5.0 * noise), wide).estimate("s").ci95
        held += low <= 5.0 <= high
    assert stats.binomtest(held, 400, 0.95).pvalue > 0.001


def test_intervals():
    assert Estimate.of(2.0, 0.1, "s").ci95 == pytest.approx((2.0 - 0.1959964, 2.0 + 0.1959964))
    low, high = Estimate.of(
        2.0, 0.1, "s", reach=0.1 * stats.t.ppf(0.975, 4.0), logarithmic=True
    ).ci95
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
