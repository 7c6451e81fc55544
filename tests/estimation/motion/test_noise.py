"""Scale, outliers and colour of residuals, on noise that is known."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from swimbladder.estimation.motion.fit import (
    autocovariance,
    autoregression,
    pooled,
    robust_scale,
    scale,
    weights,
    whiteness,
)


def test_weights_are_one_fall_and_vanish():
    u = np.linspace(-10.0, 10.0, 2001)
    w = weights(u)
    assert (w[np.abs(u) <= 3.5] == 1.0).all()
    assert (w[np.abs(u) >= 6.0] == 0.0).all()
    assert (np.diff(w[u > 0]) <= 0.0).all()


def test_scales_of_normal_noise():
    r = 3e-3 * np.random.default_rng(0).normal(size=200_000)
    assert scale(r, np.ones(len(r)), 0.0) == pytest.approx(3e-3, rel=0.01)
    assert robust_scale(r) == pytest.approx(3e-3, rel=0.01)
    few = r[:10]
    assert scale(few, np.ones(10), 4.0) == pytest.approx(np.sqrt((few**2).sum() / 6.0))


def test_colour_is_found_and_white_noise_left_white():
    rng = np.random.default_rng(1)
    coloured = lfilter([1.0], [1.0, -1.2, 0.4], rng.normal(size=20_000))
    a = autoregression(coloured)
    assert a[:2] == pytest.approx((1.2, -0.4), abs=0.03)
    orders = [len(autoregression(rng.normal(size=300))) for _ in range(300)]
    assert np.mean(np.array(orders) > 0) < 0.06


def test_autocovariance_of_an_ar1_is_geometric():
    gamma = autocovariance((0.8,), 2.0, 50)
    assert gamma == pytest.approx(2.0 * 0.8 ** np.arange(50))
    assert autocovariance((), 2.0, 4) == pytest.approx([2.0, 0.0, 0.0, 0.0])


def test_whiteness_is_uniform_for_white_noise_and_small_for_coloured():
    rng = np.random.default_rng(2)
    p = [whiteness(rng.normal(size=400)) for _ in range(400)]
    assert kstest(p, "uniform").pvalue > 1e-3
    assert whiteness(lfilter([1.0], [1.0, -0.5], rng.normal(size=400))) < 1e-6
    assert whiteness(np.zeros(50)) == 1.0


def test_scales_that_differ_by_chance_are_drawn_together_and_others_are_not():
    rng = np.random.default_rng(3)
    freedom = np.full(8, 60.0)
    by_chance = 2e-3 * np.sqrt(rng.chisquare(60.0, (2000, 8)) / 60.0)
    drawn = np.array([pooled(scales, freedom) for scales in by_chance])
    scatter = np.mean((np.log(drawn / 2e-3)) ** 2) / np.mean((np.log(by_chance / 2e-3)) ** 2)
    assert 0.1 < scatter < 0.35  # one scale for all of them has an eighth
    assert np.mean(drawn**2) == pytest.approx(4e-6, rel=0.01)
    apart = np.geomspace(1e-3, 1e-2, 8)
    assert pooled(apart, np.full(8, 200.0)) == pytest.approx(apart, rel=0.03)
    assert pooled(np.array([2e-3]), np.array([50.0])) == pytest.approx([2e-3])
