"""The target's way, against the minimum-jerk polynomial and against its boundary conditions."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from swimbladder.control.profile import Target, approach, duration

S_P = 0.3
gaps = st.one_of(st.floats(0.01, 100.0), st.floats(-100.0, -0.01))


def way(start: Target, wanted: float, shortest: float, n: int, S_p: float = S_P) -> np.ndarray:
    """Rows of (depth, speed, acceleration, left), the start first."""
    rows = [start]
    for _ in range(n):
        rows.append(approach(rows[-1], wanted, shortest, S_p))
    return np.array(rows)


@given(gap=gaps, T=st.floats(6.0, 200.0))
def test_from_rest_it_is_the_minimum_jerk_motion(gap: float, T: float) -> None:
    """Flash and Hogan's closed form 10 s^3 - 15 s^4 + 6 s^5, until the shortest time is left."""
    shortest = 2.0
    n = int((T - shortest) / S_P)
    rows = way(Target(5.0, 0.0, 0.0, T), 5.0 + gap, shortest, n)
    s = np.arange(n + 1) * S_P / T
    np.testing.assert_allclose(
        rows[:, 0], 5.0 + gap * (10 * s**3 - 15 * s**4 + 6 * s**5), rtol=1e-9
    )
    speed = gap / T * (30 * s**2 - 60 * s**3 + 30 * s**4)
    np.testing.assert_allclose(rows[:, 1], speed, rtol=1e-7, atol=1e-8 * abs(gap))
    acceleration = gap / T**2 * (60 * s - 180 * s**2 + 120 * s**3)
    np.testing.assert_allclose(rows[:, 2], acceleration, rtol=1e-7, atol=1e-8 * abs(gap))


@given(
    depth=st.floats(0.0, 10.0), speed=st.floats(-0.3, 0.3), acceleration=st.floats(-0.05, 0.05),
    T=st.floats(3.0, 60.0),
)  # fmt: skip
def test_from_any_motion_it_meets_its_boundary_conditions(depth, speed, acceleration, T) -> None:
    """The fifth-order polynomial through both ends, its coefficients by linear algebra."""
    powers = [np.polynomial.Polynomial.basis(k) for k in range(6)]
    ends = [[q.deriv(d)(t) if d else q(t) for q in powers] for t in (0.0, T) for d in range(3)]
    c = np.linalg.solve(ends, [depth, speed, acceleration, 4.0, 0.0, 0.0])
    polynomial = np.polynomial.Polynomial(c)
    n = int((T - 1.0) / S_P)
    rows = way(Target(depth, speed, acceleration, T), 4.0, 1.0, n)
    t = np.arange(n + 1) * S_P
    np.testing.assert_allclose(rows[:, 0], polynomial(t), atol=1e-8)
    np.testing.assert_allclose(rows[:, 1], polynomial.deriv()(t), atol=1e-8)
    np.testing.assert_allclose(rows[:, 2], polynomial.deriv(2)(t), atol=1e-8)


@given(gap=gaps, fastest=st.floats(0.01, 1.0), jerk=st.floats(1e-4, 0.1))
def test_from_rest_speed_and_jerk_reach_one_limit_and_pass_none(gap, fastest, jerk) -> None:
    T = duration(Target(0.0, 0.0, 0.0, 0.0), gap, fastest, jerk, 0.0)
    s = np.linspace(0.0, 1.0, 2001)
    speed = np.max(np.abs(gap / T * (30 * s**2 - 60 * s**3 + 30 * s**4)))
    hardest = np.max(np.abs(gap / T**3 * (60 - 360 * s + 360 * s**2)))
    assert max(speed / fastest, hardest / jerk) == pytest.approx(1.0, rel=1e-5)


@given(
    gap=gaps, speed=st.floats(-0.3, 0.3), acceleration=st.floats(-0.03, 0.03),
    jerk=st.floats(1e-3, 0.1),
)  # fmt: skip
def test_a_turn_on_the_way_keeps_the_jerk(gap, speed, acceleration, jerk) -> None:
    """The first jerk of the new polynomial, from its third derivative at the start."""
    T = duration(Target(0.0, speed, acceleration, 0.0), gap, 0.0, jerk, 0.0)
    assume(T < 1e4)
    first = abs(60.0 * gap - 36.0 * speed * T - 9.0 * acceleration * T**2) / T**3
    assert first <= 1.1 * jerk


@pytest.mark.parametrize(("gap", "over"), [(0.003, 0.02), (0.1, 0.01), (1.5, 2e-3), (40.0, 1e-5)])
def test_it_hardly_overshoots_and_comes_to_rest(gap: float, over: float) -> None:
    """A change small enough for the linear filter overshoots as that does; a large one does not."""
    start = Target(2.0, 0.0, 0.0, 0.0)
    T = duration(start, 2.0 + gap, 0.2, 0.007, 5.0)
    rows = way(start._replace(left=T), 2.0 + gap, 5.0, int(T / S_P) + 200)
    assert rows[:, 0].max() <= 2.0 + gap * (1.0 + over)
    assert rows[-1, 0] == pytest.approx(2.0 + gap, abs=1e-9)
    np.testing.assert_allclose(rows[-1, 1:3], 0.0, atol=1e-9)


def test_small_changes_pass_a_linear_filter_with_the_poles_named() -> None:
    """One sample's map, differentiated, has the eigenvalues exp(s S_p) of the cubic's roots."""
    T, S_p = 5.0, 1e-4
    columns = [approach(Target(*row, T), 0.0, T, S_p)[:3] for row in np.eye(3)]
    found = np.sort_complex(np.log(np.linalg.eigvals(np.array(columns).T)) / S_p)
    expected = np.sort_complex(np.roots([1.0, 9.0 / T, 36.0 / T**2, 60.0 / T**3]))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_without_limits_it_jumps() -> None:
    T = duration(Target(1.0, 0.0, 0.0, 0.0), 3.0, 0.0, 0.0, 0.0)
    assert T == 0.0
    assert approach(Target(1.0, 0.0, 0.0, T), 3.0, 0.0, S_P) == pytest.approx(
        (3.0, 0.0, 0.0, S_P), abs=1e-12
    )
