"""Water that internal waves move: what it becomes and how far it goes, against linear algebra."""

import math

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov

from swimbladder.estimation.motion.deep_filter import AWAY, displaced_variance, swing


def motion(tau: float, back: float = 0.0) -> np.ndarray:
    """Return the matrix of u, u' and zeta, which comes back at a rate [1/s]."""
    d = math.sqrt(0.5)
    return np.array([[0, 1, 0], [-1 / tau**2, -2 * d / tau, 0], [1, 0, -back]], dtype=float)


@pytest.mark.parametrize("tau", [60.0, 300.0, 1500.0])
@pytest.mark.parametrize("t", [0.5, 15.0, 60.0, 4000.0])
def test_it_swings_as_the_exponential_of_its_matrix(t: float, tau: float) -> None:
    whole = expm(t * motion(tau))
    u_u, u_v, v_u, v_v, way_u, way_v = swing(t, tau)
    assert np.array([u_u, u_v, v_u, v_v]) == pytest.approx(whole[:2, :2].ravel(), rel=1e-9)
    assert np.array([way_u, way_v]) == pytest.approx(whole[2, :2], rel=1e-7)


def test_the_displacement_is_bounded_and_as_large_as_it_says() -> None:
    """Lyapunov's equation with the white noise that gives the speed its variance."""
    tau, size = 300.0, 3e-3
    A = motion(tau, 1.0 / AWAY)
    # 4 d s^2/tau^3 keeps u'' + 2 d u'/tau + u/tau^2 at the variance s^2
    noise = np.diag([0.0, 4.0 * math.sqrt(0.5) * size**2 / tau**3, 0.0])
    P = solve_continuous_lyapunov(A, -noise)
    assert P[0, 0] == pytest.approx(size**2, rel=1e-9)
    assert P[1, 1] == pytest.approx((size / tau) ** 2, rel=1e-9)
    assert displaced_variance(size**2, tau) == pytest.approx(P[2, 2], rel=1e-9)


def test_its_spectrum_is_white_up_to_a_frequency() -> None:
    """That of the filter's steps: half the power at 1/tau, the fourth power of frequency above."""
    tau, t = 300.0, 1.0
    u_u, u_v, v_u, v_v, _, _ = swing(t, tau)
    A = np.array([[u_u, u_v], [v_u, v_v]])
    P = np.diag([1.0, 1.0 / tau**2])
    Q = P - A @ P @ A.T

    def power(w: float) -> float:
        H = np.linalg.inv(np.eye(2) * np.exp(1j * w * t) - A)
        return float((H @ Q @ H.conj().T)[0, 0].real)

    low = power(1e-6)
    assert power(0.3 / tau) == pytest.approx(low, rel=0.01)
    assert power(1.0 / tau) == pytest.approx(0.5 * low, rel=0.01)
    assert power(10.0 / tau) == pytest.approx(1e-4 * low, rel=0.02)
