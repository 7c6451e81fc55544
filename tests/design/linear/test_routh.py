"""Routh's table against roots that are known, and against numpy's."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, example, given
from hypothesis import strategies as st

from swimbladder.design.linear import linearise, transfer
from swimbladder.design.linear.depths import (
    double_integrator_phase_margin,
    doubling_time,
    stiff_hull,
)
from swimbladder.design.linear.models import polynomials
from swimbladder.design.linear.transfer import routh_table
from swimbladder.physics.dynamics import plant

real_roots = st.lists(st.integers(-4, 4), max_size=3)
pairs = st.lists(st.tuples(st.integers(-3, 3), st.integers(1, 3)), max_size=3)


def from_roots(reals, complexes, gain):
    """Whole-number coefficients of a polynomial whose roots are given, and those roots."""
    p = np.array([gain], dtype=object)
    for r in reals:
        p = np.convolve(p, np.array([1, -r], dtype=object))
    for re, im in complexes:
        p = np.convolve(p, np.array([1, -2 * re, re * re + im * im], dtype=object))
    return [int(c) for c in p], [complex(r) for r in reals] + [
        complex(re, sign * im) for re, im in complexes for sign in (1, -1)
    ]


@given(real_roots, pairs, st.sampled_from([1, -3, 7]))
@example([], [(0, 1)], 1)  # a row of zeros
@example([], [(0, 1), (0, 1)], 1)  # two of them
@example([2, -2], [(0, 3)], 1)  # symmetric about the origin in two ways
@example([], [(1, 1), (-1, 1)], 1)  # s^4 + 4: a row of zeros, then a zero at its head
@example([-1], [(1, 1), (-1, 1), (0, 2)], 1)
@example([0, 0, -1], [], -3)  # roots at 0
@example([1, -1, 3], [(0, 1), (2, 1), (-2, 1)], 1)  # both methods at once
def test_counts_every_known_root(reals, complexes, gain):
    coefficients, roots = from_roots(reals, complexes, gain)
    assume(len(roots) > 0)
    table = routh_table(coefficients)
    assert table.right == sum(r.real > 0 for r in roots)
    assert table.axis == sum(r.real == 0 for r in roots)
    assert table.at_zero == sum(r == 0 for r in roots)
    assert table.stable == all(r.real < 0 for r in roots)
    assert len(table.rows) + table.at_zero == len(coefficients)


@given(
    st.lists(st.floats(-1e3, 1e3).filter(lambda c: c == 0 or abs(c) > 1e-3), min_size=2, max_size=8)
)
@example([1.0, 0.0, 0.0, 0.0, 1.0])
@example([1.0, 1.0, 2.0, 2.0, 3.0])
@example([1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
def test_agrees_with_numpy_wherever_numpy_can_tell(coefficients):
    assume(coefficients[0] != 0.0)
    roots = np.roots(coefficients)
    # Where a root is too near the axis for floating point, numpy cannot be the judge.
    assume(len(roots) == 0 or np.min(np.abs(roots.real)) > 1e-4 * max(1.0, np.max(np.abs(roots))))
    table = routh_table(coefficients)
    assert table.right == int(np.sum(roots.real > 0))
    assert table.axis == 0


def test_table_by_hand():
    """s^4 + 2 s^3 + 3 s^2 + 4 s + 5: rows 1 3 5, 2 4, 1 5, -6, 5 (Ogata, example 5-12)."""
    table = routh_table([1, 2, 3, 4, 5])
    assert table.rows == (("1", "3", "5"), ("2", "4"), ("1", "5"), ("-6",), ("5",))
    assert table.powers == (4, 3, 2, 1, 0)
    assert table.first_column == (1, 1, 1, -1, 1)
    assert table.right == 2
    assert "two roots with a positive real part" in table.sentence
    assert "unstable" in table.sentence


def test_a_zero_at_the_end_of_a_row_stands_there():
    assert routh_table((1.0, 3.0, 1.0, 0.0, -2.0)).rows[:2] == (("1", "1", "-2"), ("3", "0"))


def test_zero_at_the_head_of_a_row():
    """s^5 + 2 s^4 + 3 s^3 + 6 s^2 + 5 s + 3: (6 epsilon - 7)/epsilon stands in the first column."""
    table = routh_table([1, 2, 3, 6, 5, 3])
    assert table.rows[2] == ("epsilon", "3.5")
    assert table.rows[3] == ("-7 epsilon^-1", "3")
    assert table.notes[2] == "epsilon"
    assert table.right == 2


def test_row_of_zeros():
    """s^5 + 2 s^4 + 24 s^3 + 48 s^2 - 25 s - 50 (Ogata, example 5-13): auxiliary 8 s^3 + 96 s."""
    table = routh_table([1, 2, 24, 48, -25, -50])
    assert table.rows[2] == ("8", "96")
    assert table.notes[2] == "auxiliary"
    assert [row[0] for row in table.rows[3:]] == ["24", "112.667", "-50"]
    assert (table.right, table.axis) == (1, 2)


@given(st.lists(st.integers(-9, 9), min_size=3, max_size=7))
def test_rows_follow_from_the_two_above(coefficients):
    """Each regular element is the determinant of four above it, over the head of the row above."""
    assume(coefficients[0] != 0 and coefficients[-1] != 0)
    table = routh_table(coefficients)
    assume(not any(table.notes))
    rows = [[sp.Rational(c) for c in coefficients[i::2]] for i in (0, 1)]
    while len(rows) < len(coefficients):
        a, b = rows[-2], rows[-1]
        pad = [*b, 0]
        rows.append([(b[0] * a[j + 1] - a[0] * pad[j + 1]) / b[0] for j in range(len(a) - 1)])
    for ours, theirs in zip(table.rows, rows, strict=True):
        for j, text in enumerate(ours):
            value = float(theirs[j]) if j < len(theirs) else 0.0
            assert float(text) == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize("bad", [[1.0], [0.0, 0.0], [], [1.0, math.nan], [math.inf, 1.0]])
def test_no_polynomial_no_table(bad):
    with pytest.raises(ValueError, match=r"polynomial|finite"):
        routh_table(bad)


def test_huge_and_tiny_coefficients_do_not_overflow():
    table = routh_table([1e300, 1e300, 1e-300, 1e300, 1e300])
    roots = np.roots([1.0, 1.0, 0.0, 1.0, 1.0])
    assert table.right == int(np.sum(roots.real > 1e-9)) == 2


# The claims of section 2.5.

positive = {
    "K1": st.floats(1e-5, 1e-2),
    "K2": st.floats(1e2, 1e5),
    "A": st.floats(1e-4, 1e-1),
    "T1": st.floats(1e-3, 1.0),
    "T2": st.floats(1.0, 100.0),
}


@given(
    st.fixed_dictionaries(positive),
    st.floats(-1e-4, 1e-4),
    st.floats(1e-3, 1.0),
    st.just(0.0) | st.floats(1e-9, 1e-6),
)
def test_any_load_makes_34_unstable_whatever_psi(p, psi, depth_voltage, k_l):
    """Stiffer than water (psi < 0) or softer: k_z alone makes it grow, and so does k_l alone."""
    for loads in ((depth_voltage, 0.0), (depth_voltage, k_l), (0.0, k_l or 1e-9)):
        _, denominator = transfer.depth_per_voltage(
            **p, psi=psi, depth_voltage=loads[0], k_l=loads[1]
        )
        table = routh_table(denominator)
        assert table.right >= 1
        assert np.max(np.roots(denominator).real) > 0.0


@given(st.fixed_dictionaries(positive), st.floats(-1e-4, -1e-9))
def test_without_loads_a_stiff_hull_grows_nothing(p, psi):
    _, denominator = transfer.depth_per_voltage(**p, psi=psi, depth_voltage=0.0, k_l=0.0)
    table = routh_table(denominator)
    assert (table.right, table.at_zero) == (0, 1)


def test_paper_vehicle_with_a_stiff_hull(feup):
    found = stiff_hull(plant(feup))
    assert found is not None
    _, denominator = transfer.depth_per_voltage(
        K1=0.444e-3,
        K2=7935.54,
        A=75e-4,
        T1=0.09,
        T2=36.3,
        psi=-4.04e-6,
        depth_voltage=7.707e-2,
        k_l=0.0,
    )
    growth = max(np.roots(denominator).real)
    assert found.poles[0].real == pytest.approx(growth, rel=1e-9)
    assert found.doubling_time == pytest.approx(math.log(2.0) / growth, rel=1e-9)
    assert found.unstable
    # Half again as slow as with the hull it has, and not at all without the load.
    assert found.doubling_time > 1.4 * doubling_time(linearise(plant(feup)))
    assert max(pole.real for pole in found.poles_without_loads) == pytest.approx(0.0, abs=1e-15)


def test_stiff_hull_has_no_meaning_without_compressibility_or_motor(feup, stepper):
    assert stiff_hull(plant(feup)._replace(psi=0.0)) is None
    assert stiff_hull(plant(stepper)) is None


def test_open_loop_of_the_paper_has_one_growing_root(feup):
    _, denominator = polynomials(linearise(plant(feup)).part(output="z", input="u"))
    table = routh_table(denominator)
    assert table.right == 1
    # "At least two of the coefficients are negative."
    assert sum(c < 0 for c in denominator) == 2


@given(st.fixed_dictionaries(positive), st.floats(1e-3, 1e3))
def test_equation_35_has_a_negative_phase_margin(p, gain):
    """Type two with two lags: no proportional gain closes it (section 2.5)."""
    margin = double_integrator_phase_margin(**p, gain=gain)
    assert -math.pi < margin < 0.0
    (numerator,), denominator = transfer.depth_per_voltage_without_loads(**p)
    closed = [*denominator[:-1], -gain * numerator]
    table = routh_table(closed)
    assert table.right == 2


def test_phase_margin_of_35_agrees_with_python_control():
    control = pytest.importorskip("control")
    p = dict(K1=0.444e-3, K2=7935.54, A=75e-4, T1=0.09, T2=36.3)
    numerator, denominator = transfer.depth_per_voltage_without_loads(**p)
    for gain in (0.01, 1.0, 12.0):
        loop = control.tf([-gain * numerator[0]], list(denominator))
        _, margin, _, _ = control.margin(loop)
        ours = double_integrator_phase_margin(**p, gain=gain)
        assert math.degrees(ours) == pytest.approx(margin, abs=1e-6)
