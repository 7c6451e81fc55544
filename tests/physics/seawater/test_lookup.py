"""The lookup: what stands in the column, C1 between, no inversions of its own, compiled alike."""

import gsw
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.physics.seawater import Cast, cast_column, look_up, uniform_column
from swimbladder.physics.seawater.column import look_up_bent, slopes
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.vehicle import Water

PRESSURE, DENSITY, TEMPERATURE = 0, 2, 4  # columns of a table; the slope stands one further


def water_table(column):
    """Pressure, density and temperature of a column, each with its slope."""
    values = (column.pressure, column.density, column.temperature)
    parts = [part for v in values for part in (v, slopes(v, column.step))]
    return np.ascontiguousarray(np.stack(parts, axis=1))


def deep(step=1.0):
    p = np.arange(0.0, 2001.0, 1.0)
    SA, CT = 38.6 + 0.1 * np.tanh(p / 300.0), 13.5 + 8.0 * np.exp(-p / 100.0)
    return cast_column(Cast(pressure=p, SA=SA, CT=CT, latitude=43.0), step=step)


COLUMN = deep()
TABLE = water_table(COLUMN)
_kernel_part = inlined(look_up_bent)


@part
def compiled(table, step, what, z):
    return _kernel_part(table, step, what, z)


@given(st.floats(0.0, 1900.0))
def test_values_are_those_of_gsw_between_the_depths_too(z):
    p = look_up(TABLE, 1.0, PRESSURE, z)[0] / 1e4
    SA, CT = 38.6 + 0.1 * np.tanh(p / 300.0), 13.5 + 8.0 * np.exp(-p / 100.0)
    # the cast itself is straight between its rows, which makes most of this
    assert look_up(TABLE, 1.0, DENSITY, z)[0] == pytest.approx(gsw.rho(SA, CT, p), abs=2e-4)
    t = gsw.t_from_CT(SA, CT, p)
    assert look_up(TABLE, 1.0, TEMPERATURE, z)[0] == pytest.approx(t, abs=2e-4)


@given(st.floats(0.1, 1900.0), st.sampled_from([PRESSURE, DENSITY, TEMPERATURE]))
def test_the_slope_is_the_derivative(z, what):
    h = 1e-4
    above, below = look_up(TABLE, 1.0, what, z - h)[0], look_up(TABLE, 1.0, what, z + h)[0]
    slope = look_up(TABLE, 1.0, what, z)[1]
    scale = {PRESSURE: 1e4, DENSITY: 1e-2, TEMPERATURE: 1e-1}[what]
    assert slope == pytest.approx((below - above) / (2.0 * h), abs=1e-4 * scale)


def test_value_and_slope_are_continuous_at_the_depths_of_the_column():
    for z in (1.0, 57.0, 1000.0):
        for what in (PRESSURE, DENSITY, TEMPERATURE):
            left, right = (
                look_up(TABLE, 1.0, what, np.nextafter(z, 0)),
                look_up(TABLE, 1.0, what, z),
            )
            np.testing.assert_allclose(left, right, rtol=1e-11)
            assert right[0] == pytest.approx(TABLE[int(z), what], rel=1e-15)


def test_the_error_falls_as_the_cube_of_the_step_at_least():
    fine = deep(0.5)
    errors = []
    for step in (64.0, 32.0):
        coarse = deep(step)
        table = water_table(coarse)
        at = fine.depth[(fine.depth > 130.0) & (fine.depth < 1800.0)]
        found = np.array([look_up(table, step, DENSITY, z)[0] for z in at])
        errors.append(np.abs(found - np.interp(at, fine.depth, fine.density)).max())
    assert errors[0] / errors[1] > 6.0
    assert errors[1] < 2e-4  # kg/m3


@given(st.lists(st.floats(0.0, 5.0), min_size=2, max_size=30), st.floats(0.0, 1.0))
def test_what_never_falls_in_the_column_never_falls_between(rises, s):
    values = 1000.0 + np.cumsum(rises)
    table = np.stack([values, slopes(values, 2.0)], axis=1)
    for k in range(len(values) - 1):
        value, slope = look_up(table, 2.0, 0, 2.0 * (k + s))
        assert values[k] - 1e-9 <= value <= values[k + 1] + 1e-9
        assert slope >= -1e-9


def test_beyond_the_ends_it_goes_on_straight():
    column = uniform_column(Water(density=1000.0), 10.0)
    table = water_table(column)
    for z in (-2.0, 13.0):
        value, slope = look_up(table, 1.0, PRESSURE, z)
        assert value == pytest.approx(9806.65 * z)
        assert slope == pytest.approx(9806.65)
        assert look_up(table, 1.0, DENSITY, z) == (1000.0, 0.0)


def test_a_kernel_gets_what_python_gets():
    for z in (-1.0, 0.0, 0.3, 17.25, 1999.0, 2500.0):
        for what in (PRESSURE, DENSITY, TEMPERATURE):
            found = compiled(TABLE, 1.0, what, z)
            np.testing.assert_allclose(found, look_up_bent(TABLE, 1.0, what, z), rtol=1e-13)


@pytest.mark.parametrize("what", [PRESSURE, DENSITY, TEMPERATURE])
@pytest.mark.parametrize("z", [-3.0, 0.4, 17.25, 1999.6, 2500.0])
def test_the_curvature_is_that_of_the_slope(what, z):
    """The slope is a parabola between two rows, so that a central difference of it is exact."""
    h = 0.05
    above, below = look_up(TABLE, 1.0, what, z - h)[1], look_up(TABLE, 1.0, what, z + h)[1]
    found = look_up_bent(TABLE, 1.0, what, z)
    scale = max(abs(below), abs(above))
    assert found[2] == pytest.approx((below - above) / (2.0 * h), abs=1e-10 * scale)
    assert found[:2] == look_up(TABLE, 1.0, what, z)
