"""Waves that a mission's file asks for are those that the vehicle meets."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from swimbladder.errors import InputError
from swimbladder.io.config import load_mission, load_vehicle
from swimbladder.physics.seawater import Cast, Swell, WaterMotion, cast_column, motion_table
from swimbladder.physics.seawater.motion import InternalWave, moved
from swimbladder.sim.engine.rodas.motion import _change
from swimbladder.sim.engine.rodas.records import AT, GIVEN, NOW, Note
from swimbladder.sim.engine.sensor import measured_depth
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import make_plan, seen_share, waves_of
from tests.quoted import refused
from tests.sim.mission.conftest import phases

TEXT = """\
schema_version = 1
{kind}
[[water_motion.internal_waves]]
amplitude = "8 m"
period = "{period}"
water_depth = "2 km"
[[water_motion.swell]]
amplitude = "1 m"
period = "9 s"
"""
PHASES = '[[phases]]\nkind = "descend"\ndepth = "50 m"\n'


@pytest.fixture(scope="module")
def sea():
    p = np.arange(0.0, 2100.0, 10.0)
    return cast_column(
        Cast(pressure=p, SA=np.full_like(p, 35.0), CT=4.0 + 10.0 * np.exp(-p / 100.0), name="sea")
    )


def mission(folder, *, kind=PHASES, period="2 h"):
    path = folder / "mission.toml"
    path.write_text(TEXT.format(kind=kind, period=period))
    return load_mission(path)


def test_the_waves_of_the_file_are_flown(tmp_path, sea):
    task, vehicle = mission(tmp_path), load_vehicle("example-float")
    plan = make_plan(vehicle, task, sea)
    table = motion_table(task.water_motion, sea.gravity)
    np.testing.assert_array_equal(plan.waves[0], table[0])
    np.testing.assert_array_equal(plan.waves[1, 1:5], table[1, 1:5])
    share = seen_share(table[1, 4], vehicle.hull.height)
    assert plan.waves[1, 0] == share * table[1, 0]
    assert plan.waves.shape == (2, 6)
    still = np.zeros((0, 6))
    assert make_plan(vehicle, task, sea, waves=still).waves is still


def test_a_wave_that_this_water_does_not_have(tmp_path, sea):
    with refused(InputError, field="water_motion.internal_waves[0].period", value=120.0):
        make_plan(load_vehicle("example-float"), mission(tmp_path, period="2 min"), sea)


def test_set_points_are_flown_in_water_at_rest(tmp_path):
    kind = 'start_depth = 1\nduration = 60\n[[setpoints]]\ntime = 0\ndepth = "2 m"\n'
    with refused(InputError, field="water_motion") as caught:
        mission(tmp_path, kind=kind)
    assert caught.value.field == "water_motion"


SWELL = WaterMotion(swell=[Swell(amplitude=1.0, period=9.0, phase=0.4)])


@pytest.mark.parametrize("depth", [-0.5, 0.0, 0.3, 0.9, 5.0, 40.0, 700.0, 2100.0])
@pytest.mark.parametrize("t", [0.0, 3.0, 1000.0])
def test_what_changes_in_waves_is_the_slope_of_what_they_move(depth, t):
    """Against central differences of displacement and speed; above the water nothing bends."""
    wave = InternalWave(amplitude=8.0, period=7200.0, phase=0.3, mode=2, water_depth=2000.0)
    swell = Swell(amplitude=1.0, period=9.0, phase=0.4)
    table = motion_table(WaterMotion(internal_waves=[wave], swell=[swell]), 9.81)
    by_depth, by_time, stretch = _change(table, depth, t)
    h, dt = 1e-3, 1e-3
    up, down = moved(table, depth + h, t), moved(table, depth - h, t)
    later, before = moved(table, depth, t + dt), moved(table, depth, t - dt)
    if depth <= 0.0:
        up = down
    assert by_depth == pytest.approx((up[1] - down[1]) / (2.0 * h), rel=1e-5, abs=1e-9)
    assert stretch == pytest.approx((up[0] - down[0]) / (2.0 * h), rel=1e-5, abs=1e-9)
    assert by_time == pytest.approx((later[1] - before[1]) / (2.0 * dt), rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("amplitude", [1.0, 0.25])
def test_water_that_goes_along_with_the_swell_keeps_its_pressure(amplitude):
    """p = rho g (z - displacement): along the path of a parcel it stays, to the second order."""
    table = motion_table(WaterMotion(swell=[Swell(amplitude=amplitude, period=9.0)]), 9.81)
    path = solve_ivp(
        lambda t, z: [moved(table, z[0], t)[1]],
        (0.0, 36.0),
        [5.0],
        rtol=1e-10,
        atol=1e-12,
        max_step=0.1,
    )
    displaced = [moved(table, z, t)[0] for t, z in zip(path.t, path.y[0], strict=True)]
    head = path.y[0] - displaced
    k = (2.0 * np.pi / 9.0) ** 2 / 9.81
    assert np.ptp(path.y[0]) > 1.5 * amplitude * np.exp(-k * 5.0)
    assert np.ptp(head) < 2.0 * k * amplitude**2


@pytest.mark.parametrize("height", [1e-3, 1.2, 300.0])
def test_the_sensor_sees_the_water_at_the_top_beyond_the_mean_along_the_hull(height):
    k = (2.0 * np.pi / 9.0) ** 2 / 9.81
    mean = quad(lambda z: np.exp(-k * z), 0.0, height)[0] / height
    assert seen_share(k, height) == pytest.approx(1.0 - mean, rel=1e-6, abs=1e-12)


def test_the_processor_looks_through_the_swell(profiler):
    waves = waves_of(SWELL, profiler.hull.height, 9.81)
    p, x, at = np.zeros(1, GIVEN)[0], np.zeros(1, NOW)[0], np.zeros(1, AT)[0]
    at["seed"] = -1
    k = (2.0 * np.pi / 9.0) ** 2 / 9.81
    for t, z in ((0.0, 0.0), (2.0, 3.0), (7.0, 20.0)):
        x["t"], x["z"] = t, z
        a = seen_share(k, profiler.hull.height) * np.exp(-k * z)
        due = z - a * np.sin(2.0 * np.pi * t / 9.0 + 0.4)
        assert measured_depth(p, waves, x, at) == pytest.approx(due, abs=1e-12)


def test_a_float_in_swell_comes_to_the_surface_once(profiler, sea):
    """The surface goes along: it does not emerge and go under with every wave, and it rests."""
    flights = [
        fly_mission(profiler, phases(deep=60.0, water_motion=motion), sea)
        for motion in (WaterMotion(), SWELL)
    ]
    crossings = [int(np.sum(f.notes["what"] == Note.EMERGED)) for f in flights]
    assert crossings[1] <= crossings[0] + 2
    assert [f.stop.name for f in flights] == ["FINISHED", "FINISHED"]
    assert abs(flights[1].duration - flights[0].duration) < 0.1 * flights[0].duration
