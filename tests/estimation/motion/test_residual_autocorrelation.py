"""Coloured noise behind a fit that has followed some of it: its covariance is known here."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from swimbladder.estimation.motion.fit import ArNoise, ar_noises, autoregression, information


def _designs():
    """Two experiments of 100 samples: a level and a slope of their own, and one curve in common."""
    t = np.linspace(-1.0, 1.0, 100)
    nothing = np.zeros(100)
    one = np.stack([t**2, np.ones(100), t, nothing, nothing], axis=1)
    other = np.stack([t**3 - t**2, nothing, nothing, np.ones(100), t], axis=1)
    return [one, other]


@pytest.mark.prove
def test_the_spread_of_coloured_estimates_is_not_underrated():
    """The mean covariance over many draws of noise of memory 0.8, against the exact one."""
    rng = np.random.default_rng(1)
    X = np.concatenate(_designs())
    inverse = np.linalg.inv(X.T @ X)
    gamma = toeplitz(0.8 ** np.arange(100))
    exact = sum(inverse @ x.T @ gamma @ x @ inverse for x in _designs())[0, 0]
    mended, plain = [], []
    for _ in range(400):
        start = rng.normal(size=(2, 1))
        fresh = 0.6 * rng.normal(size=(2, 100))
        noise = np.stack(
            [
                lfilter([1.0], [1.0, -0.8], f, zi=0.8 * s)[0]
                for f, s in zip(fresh, start, strict=True)
            ]
        )
        left = noise.ravel() - X @ (inverse @ (X.T @ noise.ravel()))
        scale = np.sqrt(left @ left / (len(left) - 5))  # as the fit has it
        parts = [left[:100] / scale, left[100:] / scale]
        seen = [autoregression(u) for u in parts]
        found = ar_noises(_designs(), parts, seen, inverse, np.zeros((5, 5)))
        spread = inverse @ information(_designs(), found) @ inverse * scale**2
        mended.append(spread[0, 0])
        raw = [ArNoise(c, 1.0) for c in seen]
        plain.append((inverse @ information(_designs(), raw) @ inverse * scale**2)[0, 0])
    assert np.mean(plain) < 0.8 * exact
    assert np.mean(mended) == pytest.approx(exact, rel=0.12)


def test_white_noise_is_left_white():
    rng = np.random.default_rng(2)
    parts = [rng.normal(size=100), rng.normal(size=100)]
    X = np.concatenate(_designs())
    seen = [autoregression(u) for u in parts]
    found = ar_noises(_designs(), parts, seen, np.linalg.inv(X.T @ X), np.zeros((5, 5)))
    assert found == (ArNoise((), 1.0), ArNoise((), 1.0))
    assert information(_designs(), found) == pytest.approx(X.T @ X)


def test_information_is_the_product_written_out():
    found = [ArNoise((0.5, 0.2), 1.7), ArNoise((), 1.0)]
    X, Y = _designs()
    r = np.empty(100)  # autocorrelation by the recursion of Yule and Walker
    r[0], r[1] = 1.0, 0.5 / 0.8
    for k in range(2, 100):
        r[k] = 0.5 * r[k - 1] + 0.2 * r[k - 2]
    expected = 1.7 * X.T @ toeplitz(r) @ X + Y.T @ Y
    assert information([X, Y], found) == pytest.approx(expected, rel=1e-9)
