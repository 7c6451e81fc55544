"""How much of what dives say counts: against draws of dives that are right, and that are not."""

import math

import numpy as np
import pytest

from swimbladder.estimation.motion.deep_fit import DiveScore, overdispersion


def dives_of(rng: np.random.Generator, wider: float, count: int = 6, size: int = 5):
    """Return dives whose own parameters lie `wider` times their deviations from the same truth."""
    informed, own = [], []
    for _ in range(count):
        A = rng.normal(size=(size, size)) * 10.0 ** rng.uniform(0.0, 3.0, size)
        informed.append(A @ A.T)
        own.append(wider * np.linalg.solve(A.T, rng.normal(size=size)))
    whole = np.sum(informed, axis=0) + np.eye(size)
    best = np.linalg.solve(
        whole, np.sum([one @ x for one, x in zip(informed, own, strict=True)], axis=0)
    )
    return [DiveScore(one @ (best - x), one) for one, x in zip(informed, own, strict=True)]


@pytest.mark.parametrize("wider", [1.0, 7.0])
def test_it_is_the_square_of_how_far_dives_lie_apart(wider: float) -> None:
    rng = np.random.default_rng(2)
    found = [overdispersion(dives_of(rng, wider)) for _ in range(200)]
    # 25 squares each: their mean over 200 draws is within 2 %, 1 sigma
    assert np.mean(found) == pytest.approx(wider**2, rel=0.06)


def test_what_a_dive_does_not_tell_does_not_count() -> None:
    """Two dives tell one parameter, 3 deviations apart, and nothing of the other."""
    told = np.diag([1e8, 0.0])
    off = np.array([1.5 * math.sqrt(2.0) * 1e-4, 0.0])  # of each from both, 1e-4 being its own
    dives = [DiveScore(sign * told @ off, told) for sign in (1.0, -1.0)]
    # The difference has twice the variance of each: 3^2 of one free square.
    assert overdispersion(dives) == pytest.approx(9.0, rel=1e-6)
    more = [DiveScore(dive.gradient, told + np.diag([0.0, 1e-9])) for dive in dives]
    assert overdispersion(more) == pytest.approx(9.0, rel=1e-6)


def test_one_dive_contradicts_nothing() -> None:
    assert overdispersion([DiveScore(np.array([0.3, -0.2]), np.diag([50.0, 2.0]))]) == 1.0
