"""A drag that differs up and down, a hull that stiffens and a drive that creeps, in missions."""

import math

import numpy as np
import pytest

from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Account
from swimbladder.sim.mission.balance import close_balance
from swimbladder.sim.mission.flight import fly_mission, reach_of
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.vehicle import HullPart
from tests.sim.mission.conftest import phases
from tests.sim.mission.oracle import Oracle
from tests.sim.mission.test_flight import TIGHT, coast, neutral_at

RATIO, CREEP = 0.6, 2e-10


def uneven(vehicle, **drag):
    motion = vehicle.motion
    changed = motion.model_copy(update={"drag": motion.drag.model_copy(update=drag)})
    return vehicle.model_copy(update={"motion": changed})


@pytest.fixture(scope="module")
def deep(profiler):
    """The float as one that deep dives tell of."""
    hull = profiler.hull
    part = HullPart(
        name="hull", volume=hull.displaced_volume, compressibility=3.4e-10, stiffening=5.2e-18
    )
    changes = {
        "actuator": profiler.actuator.model_copy(update={"creep": CREEP}),
        "hull": hull.model_copy(update={"parts": (part,)}),
    }
    return uneven(profiler.model_copy(update=changes), rising_ratio=RATIO)


@pytest.mark.prove
def test_a_dive_is_that_of_scipy_at_every_event(deep, sea):
    flight = fly_mission(deep, phases(), sea, accuracy=TIGHT)
    states = Oracle(deep, sea).replay(flight)
    assert len(states) > 30
    assert np.max(np.abs(states[:, 0] - flight.notes["z"])) < 1e-6
    assert np.max(np.abs(states[:, 2] - flight.notes["v"])) < 1e-12
    assert close_balance(flight).relative_residue < 1e-6


def test_it_coasts_farther_upwards_by_what_the_drag_is_less(profiler):
    """Neutral everywhere, dw/dt = -r k w|w|/m: it goes m/(r k) ln(1 + r k w0 t/m)."""
    hull = profiler.hull.model_copy(update={"psi": 0.0, "parts": ()})
    vehicle = uneven(profiler.model_copy(update={"hull": hull}), rising_ratio=RATIO)
    column = uniform_column(vehicle.water, 400.0)
    volume = neutral_at(vehicle, column, 100.0)
    k, m = vehicle.drag.k_dt, vehicle.mass
    for way, ratio in ((1.0, 1.0), (-1.0, RATIO)):
        x, _, _ = coast(vehicle, column, depth=100.0, volume=volume, speed=way * 0.2, seconds=600.0)
        due = m / (ratio * k) * math.log1p(ratio * k * 0.2 * 600.0 / m)
        assert way * (x["z"] - 100.0) == pytest.approx(due, rel=1e-7)


def test_a_ratio_of_1_is_the_flight_without_it(profiler, sea):
    ends = [
        fly_mission(v, phases(), sea).end for v in (profiler, uneven(profiler, rising_ratio=1.0))
    ]
    assert len({end.tobytes() for end in ends}) == 1


def test_it_creeps_as_long_as_nothing_runs(profiler, sea):
    actuator = profiler.actuator.model_copy(update={"creep": CREEP})
    flight = fly_mission(
        profiler.model_copy(update={"actuator": actuator}), phases(duration=86400.0), sea
    )
    a = flight.accounts
    idle = flight.duration - a[Account.PUMP_TIME] - a[Account.VALVE_TIME]
    assert idle > 86400.0
    assert a[Account.LEAKED] == pytest.approx(CREEP * idle, rel=1e-6)
    assert abs(close_balance(flight).volume_residue) < 1e-15


def test_a_drag_that_is_larger_up_takes_more_of_the_stroke(profiler, sea):
    task = phases()
    most = [
        reach_of(v, task, make_plan(v, task, sea)).most.volume
        for v in (profiler, uneven(profiler, rising_ratio=1.5), uneven(profiler, rising_ratio=0.5))
    ]
    law = 1090e-6 * 0.1**2  # the vehicle's coefficient and speed
    assert most[1] - most[0] == pytest.approx(0.5 * law, rel=1e-9)
    assert most[2] == most[0]  # its law asks for as much, whatever the drag is
