"""Dives that differ: against conjugate normal results, quadrature, and draws of vehicles."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from swimbladder.estimation.motion.deep import weakly_determined
from swimbladder.estimation.motion.deep_fit import (
    _LEAST,
    TYPICAL,
    DeepFit,
    RandomEffects,
    Single,
    random_effects,
    square_error,
)
from swimbladder.estimation.motion.deep_model import Prior

Z95 = 1.959964


def alone(says: np.ndarray, information: np.ndarray) -> Single:
    """Return a dive whose likelihood is normal about `says`, with the prior N(0, 1) put to it."""
    whole = information + np.eye(len(says))
    return Single(np.linalg.solve(whole, information @ says), information)


@pytest.mark.parametrize("says", [[0.2, 0.9, -0.3], [0.5, 0.5], [0.1, 0.4, 0.2, 1.4, 0.8, 0.3]])
def test_one_parameter_by_quadrature(says: list[float]) -> None:
    """Of tau, with x integrated by hand: N(m_d; x, v + tau^2) and N(x; 0, 1)."""
    variance = 0.01

    def moment(power: int) -> float:
        def inner(tau: float) -> float:
            weight = 1.0 / (variance + tau * tau)
            total = 1.0 + len(says) * weight
            mean = weight * sum(says) / total
            square = sum(m * m for m in says) * weight - mean * mean * total
            like = weight ** (0.5 * len(says)) * np.exp(-0.5 * square) / np.sqrt(total)
            what = (1.0, mean, 1.0 / total + mean * mean)[power]
            return float(like * what / (1.0 + (tau / TYPICAL) ** 2))

        return quad(inner, 0.0, 4.0, limit=200)[0]

    none, first, second = (moment(n) for n in range(3))
    found = random_effects([alone(np.array([m]), np.eye(1) / variance) for m in says])
    assert found.value[0] == pytest.approx(first / none, abs=0.01)
    deviation = np.sqrt(second / none - (first / none) ** 2)
    # the grid of tau has steps of a half and ends at 3
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(deviation, rel=0.08)


def test_many_looks_at_few_dives_tell_no_more_than_the_dives() -> None:
    """Information a thousand times larger leaves the interval as it is."""
    says = [np.array([m, -m]) for m in (0.1, 0.5, -0.2, 0.3, 0.0)]
    wide = [
        float(np.sqrt(random_effects([alone(m, much * np.eye(2)) for m in says]).covariance[0, 0]))
        for much in (1e3, 1e6)
    ]
    assert wide[1] == pytest.approx(wide[0], rel=0.05)
    spread = float(np.std([m[0] for m in says], ddof=1)) / np.sqrt(len(says))
    assert wide[1] > spread


@pytest.mark.parametrize("tau", [0.0, 0.4])
@pytest.mark.parametrize("count", [3, pytest.param(6, marks=pytest.mark.prove)])
def test_intervals_hold_what_was_drawn(tau: float, count: int) -> None:
    """Vehicles drawn from the priors, dives that differ by tau, or do not."""
    rng, size = np.random.default_rng(3), 3
    inside = []
    for _ in range(40):
        truth = rng.normal(size=size)
        dives = []
        for _ in range(count):
            A = rng.normal(size=(size, size)) * 10.0 ** rng.uniform(0.5, 1.5, size)
            information = A @ A.T
            own = truth + tau * rng.normal(size=size)
            dives.append(alone(own + np.linalg.solve(A.T, rng.normal(size=size)), information))
        found = random_effects(dives)
        inside.append(np.abs(found.value - truth) < Z95 * np.sqrt(np.diag(found.covariance)))
    # 120 intervals, of which 95 % are to hold; fewer than 90 % are three deviations off
    assert np.mean(inside) > 0.90


def test_a_set_elsewhere_has_the_way_there_in_its_error() -> None:
    found = RandomEffects(np.array([0.0, 1.0]), np.diag([0.04, 0.01]), np.zeros(2))
    error = square_error(found, np.array([-1.0, 1.0]))
    assert np.sqrt(np.diag(error)) == pytest.approx([np.hypot(0.2, 1.0), 0.1])
    # the mean square of x_0 - x for x of that distribution
    x = norm.rvs(size=20000, random_state=1) * 0.2
    assert error[0, 0] == pytest.approx(np.mean((-1.0 - x) ** 2), rel=0.02)


def test_what_each_dive_tells_by_itself_is_told_though_the_set_does_not_tell_it() -> None:
    """The set of several dives is off by its bias too; a parameter that was asked for is known."""
    priors = {name: Prior(1.0, 0.5) for name in ("drag", "valve", "slip")}
    fit = DeepFit(
        names=tuple(priors),
        values={"drag": 2.0, "valve": 1.1, "slip": 3.0},
        starts=np.zeros(2),
        covariance=np.diag([0.45, 0.45, 0.45, 1.0, 1.0]) ** 2,
        noise=_LEAST,
        tempering=1.0,
        random_effects=RandomEffects(np.zeros(3), np.diag([0.1, 0.9, 0.9]) ** 2, np.zeros(3)),
        distance=(),
        priors=priors,
        innovations=(),
        residuals=(),
    )
    assert not any(map(fit.identified, priors))
    assert [name for name in priors if fit.identified_singly(name)] == ["drag"]
    near, off, apart = weakly_determined(fit, list(priors))
    assert near.endswith("valve.")
    assert off.endswith("slip.")
    assert apart.endswith("drag.")
    assert not replace(fit, random_effects=None).identified_singly("drag")
