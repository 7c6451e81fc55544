"""What cannot be flown is refused alike by whatever flies it."""

from functools import partial

import pytest

from swimbladder.design.law_comparison import compare_laws
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.closed_loop import simulate, simulate_ensemble
from swimbladder.sim.faults.draw import course_of
from swimbladder.sim.mission.flight import fly_mission
from tests.quoted import refused
from tests.vehicles import usual

STEP = {"setpoints": [(0.0, 5.0)], "duration": 60.0, "start_depth": 4.0}
DIVE = {"setpoints": [(0.0, 100.0)], "duration": 600.0, "start_depth": 0.0}
HOLD = [
    {"kind": "hold", "depth": 4.0, "duration": 60.0, "tolerance": 1.0},
    {"kind": "surface", "duration": 60.0},
]


def by_mission(vehicle, phases=HOLD):
    mission = Mission(start_depth=0.0, phases=phases)
    return fly_mission(vehicle, mission, uniform_column(vehicle.water, 500.0))


def slow():
    vehicle = load_vehicle("feup-em")
    own = vehicle.controller.model_copy(update={"sample_time": 10.0})
    return vehicle.model_copy(update={"controller": own})


@pytest.mark.parametrize(
    "fly",
    [
        partial(simulate, **STEP),
        partial(simulate_ensemble, count=2, **STEP),
        by_mission,
        partial(compare_laws, laws=[], depth_range=(2.0, 8.0)),
    ],
    ids=["simulate", "ensemble", "mission", "compare-laws"],
)
def test_a_sample_time_at_which_the_law_does_not_hold_the_vehicle(fly):
    with refused(InputError, field="controller.sample_time", value=10.0) as caught:
        fly(slow())
    assert "does not hold" in str(caught.value)


def test_a_sample_time_of_a_phase_is_named_as_that():
    phases = [HOLD[0] | {"sample_time": 10.0}, HOLD[1]]
    with refused(InputError, field="phases[0].sample_time", value=10.0):
        by_mission(load_vehicle("feup-em"), phases)


@pytest.mark.parametrize(
    "fly",
    [
        partial(simulate, **DIVE),
        partial(simulate_ensemble, count=2, **DIVE),
        by_mission,
        partial(course_of, depths=None),
    ],
    ids=["simulate", "ensemble", "mission", "faults"],
)
def test_a_float_whose_gas_keeps_the_oil_out_of_the_hull_does_not_dive(fly):
    vehicle = load_vehicle("example-float")
    closed = vehicle.actuator.model_copy(update={"internal_pressure": 1.05e5})
    with pytest.raises(NoAnswerError, match=r"does not dive.*internal_pressure\) is 0.037 bar"):
        fly(vehicle.model_copy(update={"actuator": closed}))


def test_missions_with_faults_are_within_the_stroke_in_the_vehicles_own_water_too():
    """A hull that is stiffer than the water gets lighter: -5 cm3 at 250 m, of 3 cm3 of stroke."""
    vehicle = load_vehicle("example-float")
    hull = vehicle.hull.model_copy(update={"psi": -0.02e-6, "parts": (), "trapped_air": 0.0})
    stroke = vehicle.stroke.model_copy(update={"minimum": -3e-6, "maximum": 3e-6})
    short = vehicle.model_copy(update={"hull": hull, "stroke": stroke})
    with refused(InputError, field="depth_range", value=250.0):
        course_of(usual(short, (11.0, 250.0)), (11.0, 250.0))
    assert course_of(usual(short, (11.0, 140.0)), (11.0, 140.0)).depths[:2] == (11.0, 140.0)
