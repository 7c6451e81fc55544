"""Casts with holes: what is not known of the water there stands in the answer."""

import gsw
import numpy as np
import pytest

import swimbladder as sb
from swimbladder.design.ballast import Target, ballast_in, sensitivities, uncertainty_of
from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import Cast, cast_column
from swimbladder.sim.mission.prepare import water_of
from tests.quoted import refused


def cast(rows, SA, CT=10.0):
    """Return a cast of rows [dbar] whose Absolute Salinity is a function of pressure."""
    p = np.array(rows, float)
    return Cast(pressure=p, SA=np.asarray(SA(p), float), CT=np.full(len(p), CT), name="made")


def straight(p):
    return 30.0 + 0.05 * p


def stepped(p):
    """A mixed layer on another."""
    return np.where(p < 50.0, 30.0, 34.0)


WITH_HOLE = [*range(0, 31, 2), *range(70, 101, 2)]


def test_without_holes_the_density_is_known():
    column = cast_column(cast(range(0, 101, 2), stepped))
    assert (column.density_std == 0.0).all()
    assert not any("no row" in line for line in column.report)


def test_where_gradients_agree_a_hole_hides_nothing():
    column = cast_column(cast(WITH_HOLE, straight))
    assert column.density_std.max() < 0.01


def test_between_two_mixed_layers_the_density_is_anything_between():
    """Uniform between the two: their difference over the root of 12."""
    column = cast_column(cast(WITH_HOLE, stepped))
    low, high = (float(gsw.rho(SA, 10.0, 50.0)) for SA in (30.0, 34.0))
    inside = (column.pressure > 30e4) & (column.pressure < 70e4)
    expected = np.where(inside, (high - low) / np.sqrt(12.0), 0.0)
    assert column.density_std == pytest.approx(expected, rel=1e-6)
    (said,) = [line for line in column.report if "no row" in line]
    assert said.startswith("no row from 30 to 70 dbar: the density there is known to 0.8")


def test_a_gradient_above_that_goes_on_ends_at_the_row_below():
    def kinked(p):
        return np.where(p <= 30.0, 30.0 + 0.1 * p, 33.2)

    column = cast_column(cast(WITH_HOLE, kinked))
    between = column.density_std[(column.pressure > 30e4) & (column.pressure < 70e4)]
    known = float(gsw.rho(33.2, 10.0, 50.0) - gsw.rho(33.0, 10.0, 50.0))
    assert 0.0 < between.max() <= known / np.sqrt(12.0) * 1.001


def test_the_hole_is_in_the_neutral_volumes_and_two_rows_are_refused():
    vehicle = sb.load_vehicle("example-float")
    column = cast_column(cast(WITH_HOLE, stepped))
    known = uncertainty_of(vehicle, {})
    spread = sensitivities(vehicle, column, known)["density"]
    hole = (column.pressure > 30e4) & (column.pressure < 70e4)
    assert np.abs(spread[hole]).min() > 5.0 * np.abs(spread[~hole]).max()
    answer = ballast_in(vehicle, [column], uncertainty=known, target=Target(), draws=4000)
    widths = answer.curves[0].high - answer.curves[0].low
    at = answer.curves[0].depth
    assert widths[np.abs(at - 50.0) < 10.0].min() > 2.0 * widths[at > 75.0].max()
    with refused(InputError, field="cast"):
        ballast_in(vehicle, [cast_column(cast([0, 100], stepped))], uncertainty=known)
    ballast_in(vehicle, [cast_column(cast([0, 100], lambda p: 30.0 + 0.0 * p))], uncertainty=known)


def test_a_mission_does_not_fly_between_two_rows():
    vehicle = sb.load_vehicle("example-float")
    down = {"kind": "descend", "depth": 50.0}
    task = Mission(phases=[down])
    with refused(InputError, field="cast"):
        water_of(vehicle, task, cast([0, 100], stepped))
    assert "no row" in " ".join(water_of(vehicle, task, cast(WITH_HOLE, stepped)).report)
