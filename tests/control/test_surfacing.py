"""What the processor does at the surface, case by case from the vehicle's volumes."""

import math

import pytest

from swimbladder.control.pump_valve import (
    IN,
    LAW,
    OUT,
    WAIT,
    SurfacingParameters,
    SurfacingState,
    at_surface,
)

UP = SurfacingParameters(
    shallow=5.0, neutral=1e-5, full=3e-4, negligible=6e-7, slack=1.1e-5, measured=0.0
)
AFLOAT, ON_ITS_WAY = SurfacingState(0.0, 0.0), SurfacingState(0.0, 1.0)


@pytest.mark.parametrize(("depth", "reference"), [(5.01, 0.0), (500.0, 20.0), (math.nan, 0.0)])
def test_the_law_decides_in_the_water(depth, reference):
    assert at_surface(UP, AFLOAT, depth, 0.0, reference, 0.0) == (LAW, 0.0, AFLOAT)


def test_the_law_decides_on_a_depth_above_the_limit():
    assert at_surface(UP, AFLOAT, 1.0, 0.0, 4.0, 0.0)[0] == LAW


def test_it_surfaces_with_all_volume_and_is_left_there():
    action, wanted, _ = at_surface(UP, AFLOAT, 4.0, 1e-4, 0.0, 0.0)
    assert action == OUT
    assert wanted == pytest.approx(UP.full - 1e-4)
    assert at_surface(UP, AFLOAT, 0.0, UP.full - 0.9 * UP.negligible, 0.0, 1.0)[0] == WAIT
    assert at_surface(UP, AFLOAT, 0.0, UP.full - 1.1 * UP.negligible, 0.0, 1.0)[0] == OUT
    assert at_surface(UP, AFLOAT, 0.0, UP.full, 0.0, 0.0)[0] == OUT  # not known to float yet


def test_a_dive_lets_in_what_makes_it_sink_and_then_waits_until_it_does():
    action, wanted, after = at_surface(UP, AFLOAT, 0.0, UP.full, 400.0, 0.0)
    assert (action, after) == (IN, SurfacingState(0.0, 1.0))
    assert wanted == pytest.approx(-(UP.full - UP.neutral) - UP.slack)
    assert at_surface(UP, after, 0.01, 0.0, 400.0, 0.0)[1] == -UP.slack  # it floats still
    assert at_surface(UP, after, 0.50, 0.0, 400.0, 0.0)[1] == 0.0  # it sinks


def test_a_dive_of_a_measured_volume_goes_to_where_it_sinks():
    known = UP._replace(measured=1.0)
    sinks = UP.neutral - UP.slack
    assert at_surface(known, AFLOAT, 0.0, UP.full, 400.0, 0.0)[1] == sinks
    below = sinks - 1e-6
    assert at_surface(known, ON_ITS_WAY, 0.01, below, 400.0, 0.0)[1] == below - UP.slack
    assert at_surface(known, ON_ITS_WAY, 0.50, below, 400.0, 0.0)[1] == sinks  # above: no run
