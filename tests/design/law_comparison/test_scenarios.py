"""Scenarios fit any vehicle: within its range, or a refusal that says what ends it."""

import pytest

from swimbladder.design.law_comparison.contenders import SCENARIOS, place
from swimbladder.design.planning import least_time
from swimbladder.design.tuning.run import places
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from tests.quoted import refused

FEUP = load_vehicle("feup-em")
PRESETS = ("feup-em", "ntnu-bv", "example-em", "example-eh")


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("given", [None, (0.0, 1.2), (0.3, 6.0)])
def test_every_scenario_lies_within_the_range_and_the_stroke(name, given):
    vehicle = load_vehicle(name)
    where = places(vehicle, given)
    for scenario in SCENARIOS:
        p = place(scenario, vehicle, where)
        assert p.is_step == (scenario.size != 0.0)
        assert (p.target - p.start) * scenario.size >= 0.0
        assert abs(p.target - p.start) <= abs(scenario.size) + 1e-12
        for depth in (p.start, p.target):
            assert where.least <= depth <= where.most
            neutral = vehicle.neutral_volume(depth)
            assert vehicle.stroke.minimum < neutral < vehicle.stroke.maximum
    assert len({s.name for s in SCENARIOS}) == len(SCENARIOS)


def test_the_papers_step_is_among_them():
    p = place(SCENARIOS[0], FEUP, places(FEUP))
    assert (p.scenario.name, p.start, p.target) == ("step-down", 1.5, 3.0)


def test_what_ends_the_range_is_named_and_true():
    stroke = places(FEUP, supervised=False)
    end = FEUP.stroke.maximum / FEUP.hull.psi
    assert stroke.most == pytest.approx(0.8 * end)
    assert "leaves the stroke" in stroke.words
    rated = FEUP.hull.model_copy(update={"depth_limit": 20.0})
    assert (
        "its rating ends" in places(FEUP.model_copy(update={"hull": rated}), supervised=False).words
    )
    weak = FEUP.supply.model_copy(update={"voltage": 3.0})
    weak_places = places(FEUP.model_copy(update={"supply": weak}), supervised=False)
    assert "the motor stalls with 2.7 V" in weak_places.words
    assert weak_places.most == pytest.approx(0.8 * 2.7 / 0.07707)
    free = FEUP.hull.model_copy(update={"depth_limit": None, "psi": 0.0})
    driven = FEUP.actuator.model_copy(update={"depth_voltage": 0.0})
    endless = places(FEUP.model_copy(update={"hull": free, "actuator": driven}), supervised=False)
    assert (endless.most, "no rating" in endless.words) == (10.0, True)
    assert places(load_vehicle("ntnu-bv")).most == 10.0


def test_a_range_that_cannot_be_is_refused():
    with refused(NoAnswerError, holds={86.63}):
        places(FEUP, (0.0, 90.0), supervised=False)
    for given in ((5.0, 2.0), (-1.0, 3.0), (0.0, float("inf")), (2.0, 2.0), (0.0, -1.0)):
        with refused(InputError, field="depth_range"):
            places(FEUP, given)


@pytest.mark.parametrize("name", ["feup-em", "ntnu-bv"])
def test_a_step_is_watched_for_many_times_the_least_it_needs(name):
    vehicle = load_vehicle(name)
    where = places(vehicle, (0.0, 5.0))
    step = next(s for s in SCENARIOS if s.name == "step-large")._replace(duration=0.0)
    p = place(step, vehicle, where)
    least = least_time(vehicle, p.start, p.target, sample_time=0.5).time
    assert p.duration > 10.0 * least
