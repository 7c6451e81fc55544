"""A log made in layered water: SciPy's motion, met with the cast and missed without it."""

from dataclasses import replace

import numpy as np
import pytest

from swimbladder.errors import InputError, LogError
from swimbladder.estimation.comparison import compare
from swimbladder.estimation.comparison.ahead import predict_ahead
from swimbladder.estimation.comparison.record import follow_in, layers_of, water_of_each
from swimbladder.io.casts import read_cast
from swimbladder.physics.dynamics import plant
from swimbladder.physics.hull import along_hull, linear_psi
from swimbladder.physics.seawater import Column, cast_column, uniform_column
from swimbladder.vehicle import Water
from tests.layered import SEA, STEP, added, column, density, mean_density, sailed, vehicle
from tests.quoted import refused

VEHICLE, COLUMN = vehicle(), column()


def test_the_vehicles_own_water_adds_nothing():
    for water in (VEHICLE.water, Water(density=1025.0, compressibility=4.4e-10)):
        v = VEHICLE.model_copy(update={"water": water})
        layers = layers_of(v, uniform_column(water, 50.0))
        assert np.abs(layers.table[:, 0]).max() < 1e-15


def test_water_that_thins_evenly_is_psi():
    """Specific volume on a line: what layers add is on one too, and its slope that of eq. (31)."""
    depth = np.arange(0.0, 10.01, 0.1)
    rho = 1.0 / (1.0 / SEA + 2e-7 * (4.0 - depth))
    water = Column(
        depth=depth,
        pressure=SEA * 9.8 * depth,
        density=rho,
        temperature=0.0 * depth + 8.0,
        gravity=9.8,
        compressibility=VEHICLE.water.compressibility,
    )
    layers = layers_of(VEHICLE, water)
    weight = SEA * (VEHICLE.hull.displaced_volume + VEHICLE.trim_error)
    np.testing.assert_allclose(layers.table[:-5, 1], -2e-7 * weight, rtol=1e-3)
    bare = VEHICLE.model_copy(update={"hull": VEHICLE.hull.model_copy(update={"psi": 0.0})})
    assert layers.table[50, 1] == pytest.approx(linear_psi(bare, water, 5.0), rel=1e-3)


def test_a_hull_feels_the_mean_density_over_its_height():
    hull = VEHICLE.hull
    found = along_hull(COLUMN, hull)
    inside = COLUMN.depth < 7.0
    np.testing.assert_allclose(
        found.density[inside], mean_density(COLUMN.depth, hull.height)[inside], atol=0.01
    )
    layers = layers_of(VEHICLE, COLUMN)
    np.testing.assert_allclose(
        layers.along(COLUMN.depth[inside]), added(COLUMN.depth[inside], VEHICLE), atol=8e-8
    )
    assert found.density[-1] == pytest.approx(float(density(8.0)), rel=1e-9)
    # the sensor 0.2 m below the top of the hull: the same hull, 0.2 m higher
    higher = hull.model_copy(update={"emergence_depth": 4 * STEP})
    np.testing.assert_allclose(
        along_hull(COLUMN, higher).density[4:], found.density[:-4], rtol=1e-12
    )


def test_the_whole_log_is_met_with_the_cast_and_missed_without_it():
    log = sailed(VEHICLE, noise=0.0)
    with_cast = compare(log, VEHICLE, free=("start_depth", "start_speed"), cast=COLUMN)
    assert with_cast.rms < 3e-3  # the rows of the cast are 5 cm apart
    assert with_cast.solution is None
    without = compare(log, VEHICLE, free=("neutral_volume",))
    assert without.rms > 20.0 * with_cast.rms


def test_the_neutral_volume_and_its_drift_are_found_in_layers():
    log = sailed(VEHICLE, error=2e-6, drift=1e-8, seed=2)
    names = ("neutral_volume", "neutral_drift", "start_depth", "start_speed")
    found = compare(log, VEHICLE, free=names, cast=COLUMN)
    assert found.rms == pytest.approx(3e-3, rel=0.3)
    neutral, drift = found.fitted["neutral_volume"], found.fitted["neutral_drift"]
    assert neutral.value == pytest.approx(VEHICLE.trim_error + 2e-6, abs=0.2e-6)
    assert drift.value == pytest.approx(1e-8, abs=0.1e-8)


def test_predictions_ahead_gain_by_the_cast():
    log = sailed(VEHICLE, seed=3)
    skills = [
        predict_ahead(log, VEHICLE, horizons=(10.0, 40.0), column=water).horizons
        for water in (COLUMN, None)
    ]
    for near, far in zip(*skills, strict=True):
        assert near.rms < 0.6 * far.rms
        assert near.skill["persistence"] > 0.6
        assert near.coverage > 0.85


def test_a_volume_of_its_own_zero_is_neutral_where_the_log_begins():
    log = sailed(VEHICLE, noise=0.0, start=1.2, pushes=(0.0, 3.0, -4.0, 20.0))
    shifted = replace(log, volume=log.volume - log.volume[0] + 5e-6, volume_absolute=False)
    rec = compare(shifted, VEHICLE, cast=COLUMN, free=("start_depth",)).record
    assert rec.volume[0] == pytest.approx(
        VEHICLE.neutral_volume(1.2) + added(1.2, VEHICLE), abs=1e-7
    )


def test_what_a_cast_cannot_be_used_for_is_said():
    log = sailed(VEHICLE)
    with refused(LogError, field="depth_m", holds={2.0}):
        compare(log, VEHICLE, cast=column(2.0))
    with refused(InputError, field="cast", value="halocline"):
        compare(replace(log, reference_depth=log.depth), VEHICLE, drive="setpoint", cast=COLUMN)
    with refused(InputError, field="cast", holds={2.0, 3.0}):
        water_of_each(3, [COLUMN, COLUMN])
    assert water_of_each(2, []) == (None, None)
    assert water_of_each(2, [COLUMN]) == (COLUMN, COLUMN)


def test_a_model_quicker_than_any_vehicle_is_not_followed():
    """A search may try a drag that would take 20,000 steps from sample to sample."""
    layers, p = layers_of(VEHICLE, COLUMN), plant(VEHICLE)
    time, start = np.arange(0.0, 5.0, 0.5), np.array([[3.0, 0.01, 0.0]])
    volume = np.full(len(time), VEHICLE.trim_error + 5e-6)
    assert np.isfinite(follow_in(layers, [p], time, volume, start)).all()
    for quick in (p._replace(d_l=100.0), p._replace(d_t=1e8), p._replace(a_b=1e9)):
        assert np.isnan(follow_in(layers, [quick], time, volume, start)).all()


def test_a_cast_that_says_nothing_of_the_logs_water_is_refused(tmp_path):
    """mission and ballast refused two rows; compare and identify took what is straight between."""
    path, log = tmp_path / "cast.csv", sailed(VEHICLE)
    head = "pressure_dbar,temperature_degC,salinity\n"
    path.write_text(head + "0,12,34\n100,8,35\n")
    with refused(InputError, field="cast"):
        compare(log, VEHICLE, cast=cast_column(read_cast(path)))
    path.write_text(head + "".join(f"{p},8,{34 + 0.01 * p}\n" for p in range(30, 100)))
    with refused(LogError, field="depth_m"):
        compare(log, VEHICLE, cast=cast_column(read_cast(path)))
