"""What is said before flying: what fails, where, by how much."""

import numpy as np
import pytest

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.engine.rodas.records import Note, Stop
from swimbladder.sim.mission.flight import check_flight, fly_mission
from swimbladder.sim.mission.orders import drag_coefficient, law_parameters
from swimbladder.sim.mission.prepare import make_plan
from tests.quoted import refused
from tests.sim.mission.conftest import phases
from tests.vehicles import by_rule


def reach(vehicle, mission, column):
    return fly_mission(vehicle, mission, column, cycles=1).reach


def test_a_cast_that_ends_above_the_target(profiler, sea):
    with refused(InputError, field="cast", value=400.0, holds={50.0, 400.0, 450.0}):
        check_flight(profiler, phases(deep=450.0), sea)


def test_a_stroke_too_short_says_where_and_by_how_much(profiler, sea):
    """To rise through the warm layer takes neutral volume plus c v^2; a cm3 less does not do."""
    task = phases(safety={"stroke": 0.0})
    found = reach(profiler, task, sea)
    law = 1090e-6 * 0.1**2  # the vehicle's coefficient and speed
    within = neutral_volume(profiler, sea)[sea.depth <= 150.0]
    assert found.most.volume == pytest.approx(within.max() + law, rel=1e-12)
    assert found.least.volume == pytest.approx(within.min() - law, rel=1e-12)
    stroke = profiler.stroke.model_copy(update={"maximum": found.most.volume - 1e-6})
    with refused(NoAnswerError, holds={0.0, 0.1, 1.0}):
        reach(profiler.model_copy(update={"stroke": stroke}), task, sea)


def test_the_margin_of_the_stroke_is_kept_back(profiler, sea):
    stroke = profiler.stroke
    length = stroke.maximum - stroke.minimum
    found = reach(profiler, phases(safety={"stroke": 0.0}), sea)
    left = min(stroke.maximum - found.most.volume, found.least.volume - stroke.minimum)
    assert found.margin == pytest.approx(left / length)
    reach(profiler, phases(safety={"stroke": found.margin - 1e-6}), sea)
    with pytest.raises(NoAnswerError, match=r"kept back \(safety.stroke\)"):
        reach(profiler, phases(safety={"stroke": found.margin + 1e-3}), sea)


def test_a_drive_that_stalls_above_the_target(profiler):
    column = uniform_column(profiler.water, 1200.0)
    motor = profiler.actuator.pump.motor
    weak = motor.model_copy(update={"torque_constant": 0.05 * motor.torque_constant})
    pump = profiler.actuator.pump.model_copy(update={"motor": weak})
    actuator = profiler.actuator.model_copy(update={"pump": pump})
    vehicle = profiler.model_copy(update={"actuator": actuator})
    with refused(NoAnswerError, holds={1000.0}) as caught:
        reach(vehicle, phases(deep=1000.0), column)
    assert "its drive stalls" in str(caught.value)
    assert "Take a stronger motor" in str(caught.value)


def test_a_depth_below_the_rating_and_a_time_too_short(profiler, sea):
    shallow = profiler.model_copy(
        update={"hull": profiler.hull.model_copy(update={"depth_limit": 120.0})}
    )
    with pytest.raises(NoAnswerError, match=r"30 m .* 120 m .* \(hull.depth_limit\)"):
        reach(shallow, phases(), sea)
    stages = [phase.model_dump(exclude_none=True) for phase in phases().phases]
    stages[0]["timeout"] = 1000.0
    task = Mission(phases=stages)
    flight = fly_mission(profiler, task, sea, checked=False)
    late = flight.notes[flight.notes["what"] == Note.OUT_OF_TIME][0]
    assert late["t"] == 1000.0
    left = 145.0 - late["z"]  # m to the edge of the tolerance, at 0.1 m/s
    with refused(NoAnswerError, holds={1000.0, round(10.0 * left), round(left, 1)}):
        reach(profiler, task, sea)
    stages[0]["timeout"] = 1000.0 + 10.0 * left + 600.0
    reach(profiler, Mission(phases=stages), sea)


def test_the_coefficient_is_drag_over_weight_and_speed_squared():
    vehicle = load_vehicle("example-eh")  # laminar to 0.05 m/s, k_dt w^2 above, continuous
    weight = vehicle.water.specific_weight
    assert drag_coefficient(vehicle, 0.2) == pytest.approx(16.0 / weight)
    assert drag_coefficient(vehicle, 0.02) == pytest.approx(0.8 / 0.02 / weight)


def test_where_it_could_not_come_up_it_may_not_go():
    """psi z = 315 cm3, the stroke less what is kept back, at 78 m; the hull's rating is 100 m."""
    vehicle = load_vehicle("feup-em")
    column = uniform_column(vehicle.water, 150.0, step=0.5)
    task = phases(deep=50.0, safety={"stroke": 0.05})
    plan = make_plan(vehicle, task, column)
    back = (0.95 * 350e-6 - 0.05 * 350e-6 - vehicle.trim_error) / vehicle.hull.psi
    found = plan.back
    assert back <= found <= back + column.step
    assert plan.given["deepest"] == found
    with pytest.raises(NoAnswerError, match=r"safety.deepest is 95 m, and below \d+ m the vehicle"):
        reach(vehicle, phases(deep=50.0, safety={"deepest": 95.0}), column)
    with pytest.raises(NoAnswerError, match="too short at"):
        reach(vehicle, phases(deep=85.0), column)
    rated = vehicle.hull.model_copy(update={"depth_limit": 60.0})
    with pytest.raises(NoAnswerError, match=r"65 m, 5 m below the 60 m .* \(hull.depth_limit\)"):
        reach(vehicle.model_copy(update={"hull": rated}), phases(deep=65.0), column)


def test_a_hull_under_pressure_does_not_dive(profiler, sea):
    actuator = profiler.actuator.model_copy(update={"internal_pressure": 1.2e5})
    vehicle = profiler.model_copy(update={"actuator": actuator})
    with refused(NoAnswerError, holds={0.19}):
        reach(vehicle, phases(), sea)
    reach(vehicle, phases(start_depth=30.0), sea)  # under water the sea presses it in
    stays = Mission(phases=[{"kind": "surface", "duration": 60.0}])
    assert fly_mission(vehicle, stays, sea).stop is Stop.FINISHED  # and afloat it need not


def test_a_look_comes_as_often_as_the_phase_says(profiler):
    """The interval is the time that a speed is measured in, and the pause after it."""
    for interval, run in ((600.0, 10.0), (8.0, 4.0)):  # 10 s: the vehicle's own
        phase = Mission(
            phases=[{"kind": "park", "depth": 50.0, "duration": 1.0, "check_interval": interval}]
        ).phases[0]
        law = law_parameters(profiler, phase)
        assert (law.run, law.run + law.dead) == (run, interval)
        law = law_parameters(by_rule("example-eh"), phase)
        assert law.run + law.dead == interval


def test_a_mission_has_one_of_the_two_tables(profiler):
    del profiler
    both = {"setpoints": [{"time": 0.0, "depth": 1.0}], "start_depth": 0.0, "duration": 9.0}
    with refused(InputError, field="setpoints"):
        Mission(phases=[{"kind": "surface", "duration": 60.0}], **both)
    with refused(InputError, field="phases"):
        Mission(start_depth=1.0)
    with refused(InputError, field="phases[0].depth", value=3.0):
        Mission(phases=[{"kind": "surface", "duration": 60.0, "depth": 3.0}])
    with refused(InputError, field="phases[0].duration"):
        Mission(phases=[{"kind": "park", "depth": 3.0}])
    with refused(InputError, field="phases[0].timeout", value=60.0):
        Mission(phases=[{"kind": "park", "depth": 3.0, "duration": 60.0, "timeout": 60.0}])
    with refused(InputError, field="phases[0].tolerance", value=3.0):
        Mission(phases=[{"kind": "descend", "depth": 3.0, "tolerance": 3.0}])
    with refused(InputError, field="phases", holds={51.0}):
        Mission(phases=[{"kind": "surface", "duration": 60.0}] * 51)
    with refused(InputError, field="phases"):
        simulate(load_vehicle("feup-em"), setpoints=phases().pairs, duration=9.0, start_depth=0.0)


def test_what_energy_is_not_known_is_said(sea):
    vehicle = load_vehicle("feup-em")
    plan = make_plan(vehicle, phases(), sea)
    assert "actuator.motor.resistance" in plan.energy_known
    assert np.all(np.isfinite(plan.table))


@pytest.mark.parametrize(
    ("lines", "field"),
    [
        ({"deep": 1.0e5}, "phases[0].depth"),
        ({"start_depth": 2.0e4}, "start_depth"),
        ({"start_depth": 300.0, "bottom_depth": 200.0}, "start_depth"),
    ],
)
def test_depths_of_no_sea_are_refused(lines, field):
    with pytest.raises(InputError) as refused:
        phases(**lines)
    assert refused.value.field == field


def test_a_mission_does_not_begin_below_where_it_may_go(profiler):
    column = uniform_column(profiler.water, 2600.0)
    with refused(NoAnswerError, holds={500.0, 2000.0, 2500.0}):
        reach(profiler, phases(start_depth=2500.0), column)
