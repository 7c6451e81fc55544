"""What is made of a vehicle and its water for RODAS, by hand."""

import math

import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.physics.hull import heat_expansion
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.prepare import Accuracy, given_of, line_columns, line_given
from swimbladder.sim.engine.rodas.records import Table
from swimbladder.vehicle import Oil
from tests.sim.mission.test_hull_heat import heated
from tests.sim.mission.test_line import RESERVOIR, with_line

ATMOSPHERE, N = 101325.0, 1.4
OIL = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)


def floating(oil=OIL):
    return with_line(load_vehicle("example-float"), oil)


def test_the_air_of_a_line_keeps_p_V_to_the_n_down_to_the_reservoirs_pressure():
    """`trapped_air` is a share of the line's volume at the pressure of the atmosphere."""
    vehicle = floating()
    gas = line_given(vehicle, uniform_column(vehicle.water, 500.0))["line_gas"]
    assert RESERVOIR * gas**N == pytest.approx(ATMOSPHERE * (0.05 * 1e-4) ** N, rel=1e-12)


@pytest.mark.parametrize("step", [1000.0, 10.0])
def test_a_line_is_tabulated_beyond_the_pressure_at_the_end_of_the_water(step):
    """By a fifth of that, and no more, in water of few layers as of many."""
    vehicle = floating()
    column = uniform_column(vehicle.water, 2000.0, step=step)
    given, rows = line_given(vehicle, column), line_columns(vehicle, column)
    assert given["line_top"] == math.inf  # the pump does not stall
    ends = RESERVOIR * math.exp(given["line_step"] * (len(rows[Table.FILLING]) - 1))
    over = ATMOSPHERE - RESERVOIR
    assert ends - RESERVOIR == pytest.approx(1.2 * column.pressure[-1] + over, rel=1e-9)
    assert np.all(np.diff(rows[Table.FILLING][:, 0]) > 0.0)


@pytest.mark.parametrize("lag", [0.5, 1.0, 900.0])
def test_a_hull_that_lags_at_all_follows_by_one_over_its_time(lag):
    vehicle = heated(load_vehicle("example-float"), lag=lag)
    column = uniform_column(vehicle.water, 100.0)
    given = given_of(vehicle, column, bottom=math.inf, accuracy=Accuracy())
    assert given["follows"] * lag == 1.0
    assert given["expansion"] == heat_expansion(vehicle) > 0.0


def test_a_hull_that_does_not_lag_has_no_temperature_of_its_own():
    vehicle = heated(load_vehicle("example-float"), lag=0.0)
    column = uniform_column(vehicle.water, 100.0)
    given = given_of(vehicle, column, bottom=math.inf, accuracy=Accuracy())
    assert (given["follows"], given["expansion"]) == (0.0, 0.0)
