"""Many vehicles along one record against one after the other."""

import numpy as np
import pytest

from swimbladder import drive, load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.replay import Course

TIME = np.arange(0.0, 60.0, 0.3)


def volume_of(vehicle, z0, dV):
    return vehicle.neutral_volume(z0) + np.where(TIME > 3.0, dV, 0.0)


@pytest.mark.parametrize("name", ["feup-em", "example-em", "ntnu-bv"])
@pytest.mark.parametrize("dV", [5e-6, -5e-6, 30e-6])
def test_depths_are_those_of_drive_through_the_surface_too(name, dV):
    vehicle = load_vehicle(name)
    volume = volume_of(vehicle, 3.0, dV)
    alone = drive(vehicle, time=TIME, volume=volume, start_depth=3.0)
    p = plant(vehicle)
    starts = np.tile([volume[0], 3.0, 0.0, 0.0], (3, 1))
    together = Course(TIME, volume, ramps=True).follow([p, p._replace(psi=2.0 * p.psi), p], starts)
    n = len(alone.depth)
    assert together[0][:n] == pytest.approx(alone.depth, abs=3e-6)  # fewer steps of the drag
    assert np.array_equal(together[0], together[2], equal_nan=True)
    assert np.nanmax(np.abs(together[1] - together[0])) > 1e-4


def test_a_voltage_drives_too():
    vehicle = load_vehicle("feup-em")
    voltage = np.where((TIME > 3.0) & (TIME < 5.0), 6.0, 0.2)
    alone = drive(vehicle, time=TIME, voltage=voltage, start_depth=3.0)
    starts = np.array([[vehicle.neutral_volume(3.0), 3.0, 0.0, 0.0]])
    together = Course(TIME, voltage, ramps=False).follow([plant(vehicle)], starts)
    assert together[0][: len(alone.depth)] == pytest.approx(alone.depth, abs=1e-9)


def test_a_bundle_takes_the_steps_of_its_first_vehicle_whatever_the_others_ask_for():
    """Bit for bit those that it takes alone, so that differences of its neighbours are smooth."""
    vehicle = load_vehicle("ntnu-bv")
    volume = volume_of(vehicle, 3.0, 30e-6)
    first = plant(vehicle)
    bluff = first._replace(d_t=300.0 * first.d_t)
    starts = np.tile([volume[0], 3.0, 0.0, 0.0], (2, 1))
    course = Course(TIME, volume, ramps=True)
    alone = course.follow([first], starts[:1])
    together = course.follow([first, bluff], starts)
    assert np.array_equal(together[0], alone[0], equal_nan=True)
    # the other would take more
    finer = course.follow([bluff], starts[:1])
    assert not np.array_equal(together[1], finer[0], equal_nan=True)


def test_a_drag_that_asks_for_thousands_of_steps_is_no_vehicle():
    """A search that is lost there took seconds for each run along a hundred samples."""
    vehicle = load_vehicle("ntnu-bv")
    volume = volume_of(vehicle, 3.0, 30e-6)
    p = plant(vehicle)
    lost = p._replace(d_t=1e4 * p.d_t, a_b=1e3 * p.a_b)
    starts = np.array([[volume[0], 3.0, 0.0, 0.0]])
    assert np.isfinite(Course(TIME, volume, ramps=True).follow([p], starts)).all()
    assert np.isnan(Course(TIME, volume, ramps=True).follow([lost], starts)).all()


def test_uneven_samples():
    vehicle = load_vehicle("feup-em")
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.1, 0.5, 100))
    volume = vehicle.neutral_volume(5.0) + 1e-5 * np.sin(time / 3.0)
    alone = drive(vehicle, time=time, volume=volume, start_depth=5.0)
    starts = np.array([[volume[0], 5.0, 0.0, 0.0]])
    together = Course(time, volume, ramps=True).follow([plant(vehicle)], starts)
    assert together[0] == pytest.approx(alone.depth, abs=1e-8)


@pytest.mark.parametrize("dV", [-5e-6, 30e-6])  # on the way, and up to the surface
def test_a_neutral_volume_that_drifts_is_a_volume_that_shrinks(dV):
    """Of each vehicle its own, from before the first sample on."""
    vehicle, drift = load_vehicle("feup-em"), 2e-7
    volume, p = volume_of(vehicle, 3.0, dV), plant(vehicle)
    starts = np.array([[volume[0], 3.0, 0.01, own] for own in (0.0, drift)])
    course = Course(TIME + 9.0, volume, ramps=True, since=5.0)
    still, drifting = course.follow([p, p], starts)
    shrunk = volume - drift * (TIME - TIME[0] + 4.0)
    alone = Course(TIME, shrunk, ramps=True).follow([p], starts[:1])[0]
    assert np.isfinite(alone).all()
    assert drifting == pytest.approx(alone, abs=1e-6)
    assert np.abs(drifting - still).max() > 1e-3
