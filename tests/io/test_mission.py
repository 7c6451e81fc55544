"""Whether a vehicle can be asked to do a mission, and what is said where it cannot."""

import pytest

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.closed_loop.checks import check_depths
from swimbladder.sim.closed_loop.water import medium_of
from tests.quoted import refused


def check_mission(vehicle, task):
    """Ask a vehicle in Python for a mission; what cannot be asked is refused before a step."""
    medium = medium_of(vehicle, None, reach=0.0, bottom_depth=task.bottom)
    depths = [depth for _, depth in task.pairs]
    check_depths(vehicle, medium, setpoints=depths, start_depth=task.start_depth)


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
    ],
)
def test_what_cannot_be_asked(feup, fields, field, words):
    with pytest.raises(InputError) as caught:
        check_mission(feup, mission(**fields))
    task = mission(**fields)
    with pytest.raises(InputError) as said:
        simulate(
            feup,
            setpoints=task.pairs,
            duration=task.span,
            start_depth=task.start_depth,
            bottom_depth=task.bottom,
        )
    assert str(said.value) == str(caught.value)
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


@pytest.mark.parametrize(("duration", "number"), [(0.2, 0.3), (0.3e8 * 1.01, 100.0)])
def test_a_duration_in_samples(feup, duration, number):
    with refused(InputError, field="duration", value=duration, holds={number}) as caught:
        simulate(feup, setpoints=[(0.0, 3.0)], duration=duration, start_depth=1.5)
    assert caught.value.unit == "s"


def test_order_is_checked_in_python_too():
    with refused(InputError, field="setpoints[1].time", value=0.0):
        mission(setpoints=[{"time": 0.0, "depth": 1.0}, {"time": 0.0, "depth": 2.0}])
    with refused(InputError, field="setpoints[0].time", value=1.0):
        mission(setpoints=[{"time": 1.0, "depth": 1.0}])
