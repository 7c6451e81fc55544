"""What a mission is refused for and what is said then, without flying."""

from types import SimpleNamespace

import numpy as np
import pytest

from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.registry import bind
from swimbladder.errors import NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Account, Stop, Table
from swimbladder.sim.mission import flight, prepare
from swimbladder.sim.mission.core.phases import Holding
from tests.quoted import refused
from tests.sim.mission.conftest import phases
from tests.vehicles import LINEAR, by_rule, screw

FEUP = by_rule("feup-em")  # its hull gives way: psi > 0


def plan_for(monkeypatch, vehicle, mission, *, back=np.inf, deepest=60.0):
    """A plan of a vehicle that comes up from above `back` [m] and from nowhere below."""
    monkeypatch.setattr(prepare, "_comes_up", lambda _, depth, **__: depth < back)
    column = uniform_column(vehicle.water, deepest, step=0.5)
    return prepare.make_plan(vehicle, mission, column)


def test_a_vehicle_that_sinks_through_its_depth_is_not_said_to_stall(monkeypatch):
    """Its drive gives something wherever it is sent: too slowly. Where it gives nothing, so."""
    task = phases(deep=40.0, tolerance=1.0)
    plan = plan_for(monkeypatch, FEUP, task, back=20.0)
    assert plan.back == pytest.approx(20.0, abs=0.5)
    with refused(NoAnswerError, holds={40.0}) as caught:
        flight.check_reach(FEUP, task, plan)
    assert "it could not come up). Ask for less" in str(caught.value)
    plan.table[:, Table.RATE_OUT] = 0.0
    with refused(NoAnswerError, holds={40.0}) as caught:
        flight.check_reach(FEUP, task, plan)
    assert "its drive stalls" in str(caught.value)


@pytest.mark.parametrize("uneven", [0.7, 1.0, 1.5])
def test_a_way_takes_its_neutral_volume_and_the_drag_of_its_speed_up_and_down(monkeypatch, uneven):
    """Down F_d(v)/(rho g) less than neutral, up that more, or what the drag takes up if more."""
    vehicle = screw(drag=LINEAR.model_copy(update={"rising_ratio": uneven}))
    task = Mission(
        start_depth=10.0,
        phases=[
            {"kind": "descend", "depth": 30.0, "speed": 0.08, "tolerance": 1.0},
            {"kind": "profile", "depth": 12.0, "speed": 0.05, "tolerance": 1.0},
        ],
    )
    plan, trim = plan_for(monkeypatch, vehicle, task), 2e-6
    plan.given["trim"] = trim
    found = flight.reach_of(vehicle, task, plan)
    down, up = (drag_force(LINEAR, v) / vehicle.water.specific_weight for v in (0.08, 0.05))
    rests = vehicle.neutral_volume  # the less the deeper it is, as psi < 0
    assert found.least.volume == pytest.approx(rests(30.0) + trim - down, rel=1e-9)
    most = rests(12.0) + trim + max(uneven, 1.0) * up
    assert found.most.volume == pytest.approx(most, rel=1e-9)
    assert (found.least.depth, found.most.depth) == (30.0, 12.0)


def test_a_hold_by_the_law_rate_is_refused_for_its_steps_and_not_for_noise(monkeypatch):
    """It says how it went, how often it looks and by which volume it steps."""
    vehicle = load_vehicle("example-float")
    task = Mission(phases=[{"kind": "hold", "depth": 150.0, "tolerance": 0.9, "duration": 3600.0}])
    plan = plan_for(monkeypatch, vehicle, task, deepest=300.0)
    assert plan.stages["capture"][0] == 0.0  # `hold_step` does not fly it
    accounts = np.zeros(len(Account) + len(Holding))
    accounts[len(Account) :] = 3600.0, 900.0, 3600.0 * 1.5**2, 2.5
    flown = SimpleNamespace(
        vehicle=vehicle, mission=task, plan=plan, accounts=accounts, stop=Stop.FINISHED
    )
    with refused(NoAnswerError, holds={0.9, 150.0, 25.0, 2.5}) as caught:
        flight._refuse_band(flown, 0, lambda _: SimpleNamespace(stop=Stop.LOST))
    law, said = bind(vehicle.controller)[1], str(caught.value)
    assert f"sampled every {law.dead + law.run:.3g} s, with changes of volume of" in said
    assert "noise" not in said


def test_a_band_of_just_six_times_the_noise_can_be_seen(monkeypatch):
    """Times what an error grows by until the next look; a hair less cannot."""
    task = Mission(phases=[{"kind": "hold", "depth": 20.0, "tolerance": 1.0, "duration": 3600.0}])
    plan = plan_for(monkeypatch, FEUP, task)
    law = DeadbandParameters(*map(float, plan.stages["hold"][0]))
    assert plan.stages["capture"][0] > 0.0  # `hold_step` flies it
    least = 6.0 * law.depth_noise * law.growth
    held = [{"missed": 0, "not_held": 0}]
    whole = {"cycle": 1, "phase": 0}
    flown = SimpleNamespace(cycles=held, whole=whole, stop=Stop.FINISHED, plan=plan)
    for tolerance, seen in ((least, True), (np.nextafter(least, 0.0), False)):
        plan.stages["tolerance"] = tolerance
        assert flight._met(flown, 0) is seen
