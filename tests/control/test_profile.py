"""The target's way, against a linear program, the minimum-jerk polynomial and its ends."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.optimize import linprog

from swimbladder.control.law import SMOOTH
from swimbladder.control.profile import Target, aim, approach, depart, usable

S_P = 0.3
REST = Target(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
gaps = st.one_of(st.floats(0.01, 100.0), st.floats(-100.0, -0.01))


def way(start: Target, wanted: float, shortest: float, n: int, S_p: float = S_P) -> np.ndarray:
    """Rows of (depth, speed, acceleration, left, ...), the start first."""
    rows = [start]
    for _ in range(n):
        rows.append(approach(rows[-1], wanted, shortest, S_p))
    return np.array(rows)


@given(gap=gaps, T=st.floats(6.0, 200.0))
@example(gap=-6.058818238834054, T=176.185546875)  # passes the surface next to a sample
def test_from_rest_it_is_the_minimum_jerk_motion(gap: float, T: float) -> None:
    """Flash and Hogan's closed form 10 s^3 - 15 s^4 + 6 s^5, until the shortest time is left."""
    shortest = 2.0
    n = int((T - shortest) / S_P)
    rows = way(Target(5.0, 0.0, 0.0, T, 0.0, 0.0), 5.0 + gap, shortest, n)
    s = np.arange(n + 1) * S_P / T
    depth = 5.0 + gap * (10 * s**3 - 15 * s**4 + 6 * s**5)
    np.testing.assert_allclose(rows[:, 0], depth, rtol=1e-9, atol=1e-12)
    speed = gap / T * (30 * s**2 - 60 * s**3 + 30 * s**4)
    np.testing.assert_allclose(rows[:, 1], speed, rtol=1e-7, atol=1e-8 * abs(gap))
    acceleration = gap / T**2 * (60 * s - 180 * s**2 + 120 * s**3)
    np.testing.assert_allclose(rows[:, 2], acceleration, rtol=1e-7, atol=1e-8 * abs(gap))


@given(
    depth=st.floats(0.0, 10.0),
    speed=st.floats(-0.3, 0.3),
    acceleration=st.floats(-0.05, 0.05),
    T=st.floats(3.0, 60.0),
)
def test_from_any_motion_it_meets_its_boundary_conditions(depth, speed, acceleration, T) -> None:
    """The fifth-order polynomial through both ends, its coefficients by linear algebra."""
    powers = [np.polynomial.Polynomial.basis(k) for k in range(6)]
    ends = [[q.deriv(d)(t) if d else q(t) for q in powers] for t in (0.0, T) for d in range(3)]
    c = np.linalg.solve(ends, [depth, speed, acceleration, 4.0, 0.0, 0.0])
    polynomial = np.polynomial.Polynomial(c)
    n = int((T - 1.0) / S_P)
    rows = way(Target(depth, speed, acceleration, T, 0.0, 0.0), 4.0, 1.0, n)
    t = np.arange(n + 1) * S_P
    np.testing.assert_allclose(rows[:, 0], polynomial(t), atol=1e-8)
    np.testing.assert_allclose(rows[:, 1], polynomial.deriv()(t), atol=1e-8)
    np.testing.assert_allclose(rows[:, 2], polynomial.deriv(2)(t), atol=1e-8)


@pytest.mark.parametrize("T", [8.0, 19.0])
def test_from_rest_no_way_has_less_jerk(T: float) -> None:
    """A linear program: of all jerks held over N intervals that end at rest, the least largest."""
    n, gap = 48, 1.5
    h = T / n
    ages = T - h * (np.arange(n) + 1)  # from the end of an interval to the end of the way
    ends = np.array(
        [
            np.full(n, h),
            h * ages + h**2 / 2,
            h * ages**2 / 2 + h**2 * ages / 2 + h**3 / 6,
        ]
    )
    bound = np.vstack([np.c_[np.eye(n), -np.ones(n)], np.c_[-np.eye(n), -np.ones(n)]])
    best = linprog(
        [0.0] * n + [1.0],
        A_ub=bound,
        b_ub=np.zeros(2 * n),
        A_eq=np.c_[ends, np.zeros(3)],
        b_eq=[0.0, 0.0, gap],
        bounds=[(None, None)] * (n + 1),
    )
    assert depart(REST, gap, 0.0, best.fun, 1.0).left == pytest.approx(T, rel=1e-6)


@given(gap=gaps, fastest=st.floats(0.01, 1.0), jerk=st.floats(1e-4, 0.1))
def test_from_rest_speed_and_jerk_reach_one_limit_and_pass_none(gap, fastest, jerk) -> None:
    """Of the target as it goes, by differences; at the end it is where it was sent."""
    start = depart(REST, gap, fastest, jerk, 0.0)
    n, S_p = 400, start.left / 400.0
    rows = way(start, gap, 0.0, n, S_p)
    speed, hardest = np.abs(rows[:, 1]).max(), np.abs(np.diff(rows[:, 2])).max() / S_p
    assert max(speed / fastest, hardest / jerk) == pytest.approx(1.0, rel=1e-4)
    assert rows[-1, 0] == pytest.approx(gap, rel=1e-6)
    np.testing.assert_allclose(
        rows[:, 0],
        np.cumsum(np.r_[0.0, 0.5 * S_p * (rows[1:, 1] + rows[:-1, 1])]),
        atol=1e-4 * abs(gap),
    )


@given(gap=gaps, fastest=st.floats(0.05, 1.0), jerk=st.floats(1e-3, 0.1), S_p=st.floats(0.1, 1.0))
def test_samples_that_straddle_a_turn_change_nothing(gap, fastest, jerk, S_p) -> None:
    """The same way in samples of any length and in much shorter ones, where both have one."""
    start = depart(REST, gap, fastest, jerk, 0.5)
    n = min(int((start.left - 2.0) / S_p), 200)
    assume(n > 0)
    long, short = way(start, gap, 0.5, n, S_p), way(start, gap, 0.5, 8 * n, S_p / 8.0)
    np.testing.assert_allclose(long[:, :4], short[::8, :4], rtol=1e-6, atol=1e-7 * abs(gap))


@given(
    gap=gaps,
    speed=st.floats(-0.3, 0.3),
    acceleration=st.floats(-0.03, 0.03),
    jerk=st.floats(1e-3, 0.1),
)
def test_a_turn_on_the_way_keeps_the_jerk(gap, speed, acceleration, jerk) -> None:
    """The first jerk of the new polynomial, from its third derivative at the start."""
    start = depart(
        REST._replace(target_speed=speed, target_acceleration=acceleration), gap, 0.0, jerk, 0.0
    )
    T = start.left
    assume(start.whole == 0.0)
    assume(T < 1e4)
    first = abs(60.0 * gap - 36.0 * speed * T - 9.0 * acceleration * T**2) / T**3
    assert first <= 1.1 * jerk


@pytest.mark.parametrize(("gap", "over"), [(0.003, 0.02), (0.1, 0.01), (1.5, 1e-3), (40.0, 1e-5)])
def test_it_hardly_overshoots_and_comes_to_rest(gap: float, over: float) -> None:
    """A change small enough for the linear filter overshoots as that does; a large one does not."""
    start = depart(REST._replace(target=2.0), 2.0 + gap, 0.2, 0.007, 3.0)
    rows = way(start, 2.0 + gap, 3.0, int(start.left / S_P) + 200)
    assert rows[:, 0].max() <= 2.0 + gap * (1.0 + over)
    assert rows[-1, 0] == pytest.approx(2.0 + gap, abs=1e-9)
    np.testing.assert_allclose(rows[-1, 1:3], 0.0, atol=1e-9)


def test_small_changes_pass_a_linear_filter_with_the_poles_named() -> None:
    """One sample's map, differentiated, has the eigenvalues exp(s S_p) of the cubic's roots."""
    T, S_p = 5.0, 1e-4
    columns = [approach(Target(*row, T, 0.0, 0.0), 0.0, T, S_p)[:3] for row in np.eye(3)]
    found = np.sort_complex(np.log(np.linalg.eigvals(np.array(columns).T)) / S_p)
    expected = np.sort_complex(np.roots([1.0, 9.0 / T, 36.0 / T**2, 60.0 / T**3]))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_without_limits_it_jumps() -> None:
    start = depart(REST, 3.0, 0.0, 0.0, 0.0)
    assert start.left == 0.0
    assert approach(start, 3.0, 0.0, S_P)[:3] == pytest.approx((3.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("wanted", [5.0, 80.0])
def test_a_speed_takes_a_quarter_of_the_room_to_the_nearer_end(wanted):
    """Shallow the compressed hull leaves less above neutral, deep less below, linear in depth."""
    p = SimpleNamespace(
        psi=2e-6,
        volume_min=-50e-6,
        volume_max=200e-6,
        depth_voltage=0.0,
        balanced=SMOOTH,
        voltage_limit=12.0,
        jerk=1.0,
        fastest=1.0,
        shortest=0.1,
    )
    now, damping = REST._replace(target=20.0), 1e-4
    room = min(200e-6 - 2e-6 * max(20.0, wanted), 2e-6 * min(20.0, wanted) + 50e-6)
    expected = depart(now, wanted, 0.25 * room / damping, usable(1.0), 0.1)
    found = aim(p, now, wanted, 20.0, 1.0, damping, 0.0)
    assert found.left > 100.0
    assert list(found) == pytest.approx(list(expected), rel=1e-12)
