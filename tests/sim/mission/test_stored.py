"""What the sea has stored in the balance of a mission: the work that forces do on the way."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.prepare import Accuracy, given_of, make_table
from swimbladder.sim.engine.rodas.records import NOW, Account, made
from swimbladder.sim.mission.balance import close_balance
from swimbladder.sim.mission.prepare import medium_for

VEHICLE = load_vehicle("feup-em")
WEIGHT, TOP = VEHICLE.water.specific_weight, VEHICLE.hull.emergence_depth  # N/m3, m


def state(z, v):
    x = made(NOW)
    x["z"], x["v"] = z, v
    return x


def stored(begin, end, *, sampled):
    """What a mission between two states (m, m3) at rest says that the sea gained [J]."""
    column = uniform_column(VEHICLE.water, 50.0)
    task = Mission(start_depth=1.0, phases=[{"kind": "profile", "depth": 40.0}])
    plan = SimpleNamespace(
        given=given_of(VEHICLE, column, bottom=math.inf, accuracy=Accuracy()),
        table=make_table(VEHICLE, column)[0],
        water=medium_for(VEHICLE, task, column) if sampled else None,
    )
    flight = SimpleNamespace(
        vehicle=VEHICLE,
        plan=plan,
        accounts=np.zeros(len(Account)),
        begin=state(*begin),
        end=state(*end),
        whole={"place": int(end[0] < TOP)},
    )
    return close_balance(flight).sinks["sea"]


@pytest.mark.parametrize("sampled", [True, False])
@pytest.mark.parametrize(
    ("begin", "end"),
    [
        ((10.0, 5e-5), (10.0, 5e-5)),
        ((10.0, 5e-5), (30.0, 5e-5)),
        ((30.0, 5e-5), (10.0, -1e-4)),
        ((TOP - 0.04, 2e-4), (30.0, -1e-4)),
        ((30.0, -1e-4), (TOP - 0.04, 2e-4)),
        ((TOP - 0.04, 2e-4), (TOP - 0.04, 2e-4)),
    ],
)
def test_the_sea_gains_what_weight_and_pressure_take_on_the_way(begin, end, sampled):
    """Force over depth with the volume held, then pressure over volume at the depth."""

    def force(z):
        spring = VEHICLE.hull.waterplane_area * max(TOP - z, 0.0)
        return WEIGHT * (VEHICLE.neutral_volume(z) - begin[1] + spring)

    sinks = quad(force, begin[0], end[0], points=[TOP], limit=100)[0]
    pressed = WEIGHT * end[0] * (end[1] - begin[1])
    assert stored(begin, end, sampled=sampled) == pytest.approx(pressed - sinks, abs=1e-6, rel=1e-6)
