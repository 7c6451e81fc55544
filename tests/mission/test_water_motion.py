"""Waves that a mission's file asks for are those that the vehicle meets."""

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.io.config import load_mission, load_vehicle
from swimbladder.mission.prepare import make_plan
from swimbladder.seawater import Cast, cast_column, motion_table

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
    np.testing.assert_array_equal(plan.waves, motion_table(task.water_motion, sea.gravity))
    assert plan.waves.shape == (2, 6)
    still = np.zeros((0, 6))
    assert make_plan(vehicle, task, sea, waves=still).waves is still


def test_a_wave_that_this_water_does_not_have(tmp_path, sea):
    with pytest.raises(InputError, match=r"the shortest in sea lasts \d+ s"):
        make_plan(load_vehicle("example-float"), mission(tmp_path, period="2 min"), sea)


def test_set_points_are_flown_in_water_at_rest(tmp_path):
    kind = 'start_depth = 1\nduration = 60\n[[setpoints]]\ntime = 0\ndepth = "2 m"\n'
    with pytest.raises(InputError, match="belongs to a mission with phases") as caught:
        mission(tmp_path, kind=kind)
    assert caught.value.field == "water_motion"
