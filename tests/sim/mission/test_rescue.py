"""Between which depths it is sought how deep a vehicle may go; that it comes up is given here."""

import math

import numpy as np
import pytest

from swimbladder.io.mission import Mission
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Table
from swimbladder.sim.mission import prepare
from tests.sim.mission.conftest import phases
from tests.vehicles import by_rule

FEUP = by_rule("feup-em")  # its hull gives way: psi > 0
TASK = phases(deep=20.0, tolerance=1.0, safety={"stroke": 0.05})


@pytest.fixture
def asked(monkeypatch):
    """Let the vehicle come up from wherever it is asked about; return what was asked."""
    found = []

    def comes_up(_plan, depth, **how):
        found.append((depth, how))
        return True

    monkeypatch.setattr(prepare, "_comes_up", comes_up)
    return found


def most():
    stroke = FEUP.stroke
    return stroke.maximum - 0.05 * (stroke.maximum - stroke.minimum)


def plan_for(deepest, mission=TASK):
    return prepare.make_plan(FEUP, mission, uniform_column(FEUP.water, deepest, step=0.5))


@pytest.mark.usefixtures("asked")
@pytest.mark.parametrize("deepest", [25.0, 60.0])
def test_beyond_the_table_its_neutral_volume_goes_on_straight(deepest):
    """psi z + trim = the stroke less what is kept back, wherever the water ends above that."""
    due = (most() - FEUP.trim_error) / FEUP.hull.psi
    assert due > deepest
    assert plan_for(deepest).back == pytest.approx(due, rel=1e-6)


@pytest.mark.usefixtures("asked")
@pytest.mark.parametrize("top", [0.0, 0.3, 1.2])
@pytest.mark.parametrize("first", [0.5, 2.0, 7.5])
def test_the_first_depth_at_which_it_cannot_rest_is_the_limit_but_for_what_floats(top, first):
    """Where the hull emerges its neutral volume is not asked for."""
    plan = plan_for(30.0)
    plan.given["z_surface"] = top
    depth = 0.5 * np.arange(len(plan.table))
    plan.table[depth >= first, Table.NEUTRAL] = 2.0 * most()
    plan.table[0, Table.NEUTRAL] = 2.0 * most()
    due = next(z for z in depth if z >= first and z > top)
    assert prepare.return_depth(FEUP, TASK, plan) == due


def test_it_may_sink_at_twice_its_fastest_speed_with_the_volume_for_it(asked):
    slow, fast = ({"kind": "profile", "depth": 10.0, "speed": v} for v in (0.1, 0.15))
    plan_for(60.0, Mission(phases=[fast, slow]))
    (_, how), *_ = asked
    assert how["speed"] == pytest.approx(0.3)
    due = drag_force(FEUP.drag, 0.3) / FEUP.water.specific_weight
    assert how["less"] == pytest.approx(due, rel=1e-12)


@pytest.mark.parametrize(
    ("deepest", "rated", "back", "due"),
    [
        (None, None, 80.0, 80.0),
        (None, 60.0, 80.0, 60.0),
        (None, 90.0, 80.0, 80.0),
        (None, None, math.inf, math.inf),
        (30.0, 60.0, 80.0, 30.0),
        (30.0, None, math.inf, 30.0),
    ],
)
def test_it_may_go_as_deep_as_is_asked_else_where_hull_and_return_allow(
    monkeypatch, deepest, rated, back, due
):
    monkeypatch.setattr(prepare, "return_depth", lambda *_: back)
    vehicle = FEUP.model_copy(update={"hull": FEUP.hull.model_copy(update={"depth_limit": rated})})
    task = phases(deep=20.0, safety={} if deepest is None else {"deepest": deepest})
    plan = prepare.make_plan(vehicle, task, uniform_column(vehicle.water, 50.0))
    assert plan.given["deepest"] == due
    assert plan.back == back
