"""Columns against gsw itself, the hydrostatic integral, and the limit to the paper's water."""

import gsw
import numpy as np
import pytest
from scipy.integrate import quad

from swimbladder.errors import InputError
from swimbladder.physics.seawater import Cast, cast_column, uniform_column
from swimbladder.physics.seawater.cast import pressure_of_depth
from swimbladder.vehicle import Water


def ocean(deepest=2000.0, latitude=43.0):
    """A warm layer over the deep Mediterranean, every 5 dbar."""
    p = np.arange(0.0, deepest + 1.0, 5.0)
    SP, t = 38.5 - 0.5 * np.exp(-p / 80.0), 13.2 + 10.0 * np.exp(-p / 60.0)
    SA = gsw.SA_from_SP(SP, p, 8.0, latitude)
    return Cast(pressure=p, SA=SA, CT=gsw.CT_from_t(SA, t, p), latitude=latitude, longitude=8.0)


def test_density_and_temperature_are_those_of_gsw_at_that_pressure():
    cast = ocean()
    column = cast_column(cast)
    p = column.pressure / 1e4
    SA, CT = np.interp(p, cast.pressure, cast.SA), np.interp(p, cast.pressure, cast.CT)
    np.testing.assert_allclose(column.density, gsw.rho(SA, CT, p), rtol=0, atol=1e-12)
    np.testing.assert_allclose(column.temperature, gsw.t_from_CT(SA, CT, p), rtol=0, atol=1e-12)
    assert column.compressibility == 0.0


def test_depth_and_pressure_are_those_of_gsw_with_the_water_of_the_cast():
    cast = ocean()
    column = cast_column(cast, step=2.0)
    p = column.pressure / 1e4
    SA, CT = np.interp(p, cast.pressure, cast.SA), np.interp(p, cast.pressure, cast.CT)
    height = gsw.geo_strf_dyn_height(SA, CT, p, 0.0, interp_method="linear")
    depth = -gsw.z_from_p(p, cast.latitude, height)
    assert np.abs(depth - column.depth).max() < 2e-3  # m, in 2000: gsw integrates in steps too


def test_pressure_is_the_weight_of_the_water_above():
    column = cast_column(ocean())
    weight = (
        quad(
            lambda z: np.interp(z, column.depth, column.density),
            0.0,
            1500.0,
            limit=2000,
            epsabs=1.0,
        )[0]
        * column.gravity
    )
    # gravity grows by 2.2e-7 of itself a metre on the way down, half of it on average
    grown = 0.5 * (gsw.grav(43.0, 1511.0) / gsw.grav(43.0, 0.0) - 1.0)
    found = float(np.interp(1500.0, column.depth, column.pressure))
    assert found == pytest.approx(weight * (1.0 + grown), rel=2e-6)


def test_a_lake_is_no_standard_ocean():
    p = np.arange(0.0, 101.0)
    lake = Cast(pressure=p, SA=np.zeros_like(p), CT=np.full_like(p, 10.0), latitude=47.0)
    column = cast_column(lake)
    assert column.deepest == 101.0 or column.deepest == 102.0  # 100 dbar of fresh water
    assert column.pressure[100] == pytest.approx(99.97e4 * 9.808 / 10.0, rel=2e-3)
    assert -gsw.z_from_p(100.0, 47.0) < 99.3  # what the standard ocean would have said


def test_depths_become_the_pressures_they_came_from():
    cast = ocean(1000.0)
    column = cast_column(cast)
    p = column.pressure[1:] / 1e4
    SP, t = 38.5 - 0.5 * np.exp(-p / 80.0), 13.2 + 10.0 * np.exp(-p / 60.0)
    found = pressure_of_depth(column.depth[1:], SP, t, 43.0)
    assert np.abs(found - p).max() < 0.02  # dbar; Reference for Absolute Salinity makes 0.005


def test_the_papers_water_is_constant():
    column = uniform_column(Water(density=1025.0), 100.0, step=0.5)
    assert set(column.density) == {1025.0}
    np.testing.assert_allclose(column.pressure, 1025.0 * 9.80665 * column.depth, rtol=1e-15)
    assert column.deepest == 100.0
    assert column.step == 0.5
    assert column.compressibility == 4.4e-10


def test_the_default_compressibility_is_that_of_sea_water_near_the_surface():
    assert Water().compressibility == pytest.approx(gsw.kappa(35.16504, 10.0, 0.0), rel=0.005)


def test_a_column_ends_where_the_cast_does_or_just_below():
    cast = ocean(500.0)
    bottom = cast_column(cast).deepest
    assert 494.0 < bottom < 500.0
    below = cast_column(cast, bottom + 0.5)
    assert below.deepest == bottom + 1.0
    step = (below.pressure[-1] - below.pressure[-2]) / below.density[-1]
    assert step == pytest.approx(gsw.grav(43.0, 500.0), rel=1e-5)


def test_a_cast_that_ends_above_the_target_is_refused_with_the_distance():
    with pytest.raises(InputError, match=r"ends at 49\d m \(500 dbar\), 50\d m above 1000 m"):
        cast_column(ocean(500.0), 1000.0)


def test_a_cast_that_begins_below_the_surface_says_so():
    p = np.array([12.0, 100.0])
    cast = Cast(pressure=p, SA=np.full(2, 35.0), CT=np.full(2, 5.0), latitude=0.0)
    column = cast_column(cast)
    assert column.report == ("the cast begins at 12.0 dbar and is taken to be the same above",)
    assert column.temperature[0] == pytest.approx(5.0, abs=1e-2)


@pytest.mark.parametrize(
    ("pressure", "salinity"),
    [([0.0], [35.0]), ([0.0, 1.0], [35.0]), ([1.0, 1.0], [35.0] * 2), ([-1.0, 1.0], [35.0] * 2)],
)
def test_what_is_no_profile_is_refused(pressure, salinity):
    with pytest.raises(InputError):
        Cast(pressure=np.array(pressure), SA=np.array(salinity), CT=np.array(salinity))


@pytest.mark.parametrize(("deepest", "step"), [(0.0, 1.0), (float("nan"), 1.0), (10.0, -1.0)])
def test_a_column_needs_a_depth_and_a_step(deepest, step):
    with pytest.raises(InputError, match="above 0"):
        uniform_column(Water(), deepest, step=step)


@pytest.mark.parametrize(("top", "end"), [(51.0, 2000.0), (1500.0, 2000.0), (11.0, 20.0)])
def test_a_cast_that_begins_far_below_the_surface_is_refused(top, end):
    """As one that ends above the target: there is no water to reckon with."""
    p = np.linspace(top, end, 20)
    cast = Cast(pressure=p, SA=np.full(20, 35.0), CT=np.linspace(10.0, 5.0, 20))
    with pytest.raises(InputError, match=f"begins at {top:.0f} dbar") as refused:
        cast_column(cast)
    assert "a row at 0 dbar" in refused.value.remedy
    known = Cast(pressure=np.append(0.0, p), SA=np.full(21, 35.0), CT=np.linspace(12.0, 5.0, 21))
    assert cast_column(known).report == ()
