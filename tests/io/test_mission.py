"""Whether a vehicle can be asked to do a mission, and what is said where it cannot."""

import pytest

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.io.mission_check import MOST_SAMPLES, check_mission
from tests.quoted import refused


@pytest.fixture(scope="module")
def feup():
    return load_vehicle("feup-em")


def mission(**fields):
    step = {"start_depth": 1.5, "duration": 400.0, "setpoints": [{"time": 0.0, "depth": 3.0}]}
    return Mission(**step | fields)


def to(depth):
    return [{"time": 0.0, "depth": 3.0}, {"time": 100.0, "depth": depth}]


def test_the_papers_pool_is_fine(feup):
    check_mission(feup, mission(bottom_depth=4.5))
    check_mission(feup, mission(start_depth=0.0, setpoints=to(86.0)))


@pytest.mark.parametrize(
    ("fields", "field", "words"),
    [
        ({"start_depth": -0.1}, "start_depth", "above the surface (got -0.1, expected unit m)"),
        ({"setpoints": to(-1.0)}, "setpoints[1].depth", "Depths are positive downwards"),
        ({"bottom_depth": 2.0}, "setpoints[0].depth", "below the bottom at 2 m"),
        ({"bottom_depth": 1.0}, "start_depth", "Give a depth of at most 1 m"),
        ({"setpoints": to(100.5)}, "setpoints[1].depth", "rated for 100 m (hull.depth_limit)"),
        ({"duration": 0.2}, "duration", "shorter than one sample of 0.3 s"),
        ({"duration": 0.3 * MOST_SAMPLES * 1.01}, "duration", "Shorten it"),
    ],
)
def test_what_cannot_be_asked(feup, fields, field, words):
    with pytest.raises(InputError) as caught:
        check_mission(feup, mission(**fields))
    assert caught.value.field == field
    assert words in str(caught.value)
    assert caught.value.remedy


def test_a_stroke_smaller_than_the_neutral_volume_says_how_deep_it_suffices(feup):
    # psi z = 350 cm3 at z = 350e-6/4.04e-6
    deepest = 350e-6 / 4.04e-6
    check_mission(feup, mission(setpoints=to(deepest - 0.01)))
    with refused(InputError, field="setpoints[1].depth", holds={350.0}) as caught:
        check_mission(feup, mission(setpoints=to(deepest + 0.01)))
    said = str(caught.value)
    assert f"The stroke ends at {deepest:.4g} m: ask for less by more than a step" in said


def test_a_stiff_hull_runs_out_at_the_other_end(feup):
    hull = feup.hull.model_copy(update={"psi": -4e-6})
    stiff = feup.model_copy(update={"hull": hull, "trim_error": 50e-6})
    check_mission(stiff, mission(setpoints=to(99.0)))
    hull = hull.model_copy(update={"psi": -5e-6, "depth_limit": None})
    stiff = stiff.model_copy(update={"hull": hull})
    # 50 cm3 - 5 cm3/m z = -350 cm3 at 80 m
    with refused(InputError, field="setpoints[1].depth", value=80.5, holds={80.0}):
        check_mission(stiff, mission(setpoints=to(80.5)))


@pytest.mark.parametrize(
    ("psi", "trim", "words"),
    [
        (-1e-6, 360e-6, "suffices below 10 m: ask for more"),  # 360 - 1 z = 350 cm3 at 10 m
        (1e-6, -360e-6, "suffices below 10 m: ask for more"),
        (0.0, 360e-6, "Trim the vehicle otherwise"),
        (1e-6, 360e-6, "Trim the vehicle otherwise"),  # at no depth at all
    ],
)
def test_a_vehicle_that_is_trimmed_beyond_its_stroke(feup, psi, trim, words):
    hull = feup.hull.model_copy(update={"psi": psi})
    light = feup.model_copy(update={"hull": hull, "trim_error": trim})
    with pytest.raises(InputError, match=words):
        check_mission(light, mission(start_depth=20.0, setpoints=to(3.0)))


def test_a_vehicle_without_a_controller(feup):
    bare = feup.model_copy(update={"controller": None})
    with refused(InputError, field="controller"):
        check_mission(bare, mission())
    check_mission(bare, mission(), sample_time=0.5)
    with refused(InputError, field="duration", value=400.0, holds={500.0}):
        check_mission(bare, mission(), sample_time=500.0)


def test_fields_are_called_what_the_user_calls_them(feup):
    names = {"setpoints[0].depth": "--target", "bottom_depth": "--bottom"}
    with pytest.raises(InputError) as caught:
        check_mission(feup, mission(bottom_depth=2.0), names=names)
    assert caught.value.field == "--target"
    assert "(--bottom)" in str(caught.value)


def test_order_is_checked_in_python_too():
    with refused(InputError, field="setpoints[1].time", value=0.0):
        mission(setpoints=[{"time": 0.0, "depth": 1.0}, {"time": 0.0, "depth": 2.0}])
    with refused(InputError, field="setpoints[0].time", value=1.0):
        mission(setpoints=[{"time": 1.0, "depth": 1.0}])
