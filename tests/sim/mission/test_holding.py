"""How phases hold their depth, when they arrive, and how long the pump runs for it."""

import math

import numpy as np
import pytest

from swimbladder.io.mission import Mission
from swimbladder.sim.engine.rodas.names import Account, At, Drive, Note, Now, Stop
from swimbladder.sim.mission.core.hooks import fly
from swimbladder.sim.mission.core.names import Cycle, Holding, Row
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import first_state, make_plan
from tests.sim.mission.conftest import phases
from tests.sim.mission.oracle import Oracle
from tests.sim.mission.test_flight import TIGHT


def holdings(flight):
    return flight.accounts[int(Account.COUNT) :].reshape(-1, int(Holding.COUNT))


def test_at_rest_beside_its_depth_the_distance_is_all_there_is(profiler, sea):
    """Nothing is asked for within the near band, so that it stays 3 m off for the whole time."""
    task = Mission(
        start_depth=100.0,
        phases=[{"kind": "park", "depth": 103.0, "tolerance": 5.0, "duration": 7200.0}],
    )
    flown = fly_mission(profiler, task, sea, accuracy=TIGHT)
    assert np.ptp(flown.rows[:, Row.Z]) < 1e-6
    time, inside, squares, most = holdings(flown)[0]
    assert time == inside == pytest.approx(7200.0)
    assert math.sqrt(squares / time) == pytest.approx(3.0, rel=1e-9)
    assert most == pytest.approx(3.0, rel=1e-9)


def test_what_is_held_is_what_the_trajectory_shows(profiler, sea):
    """A hold of a tolerance that the law does not keep: time inside, rms, largest departure."""
    stages = [
        {"kind": "descend", "depth": 60.0, "tolerance": 5.0, "speed": 0.2},
        {"kind": "hold", "depth": 60.0, "tolerance": 0.5, "duration": 3000.0, "speed": 0.2},
    ]
    task = Mission(start_depth=20.0, phases=stages, cycles=2)
    flown = fly_mission(profiler, task, sea, accuracy=TIGHT)
    rows = flown.rows
    total, inside, squares, most = 0.0, 0.0, 0.0, 0.0
    arrivals = flown.notes[
        (flown.notes[:, Drive.WHAT] == Note.ARRIVED) & (flown.notes[:, Drive.NUMBER] == 1.0)
    ][:, Drive.T]
    assert len(arrivals) == 2
    for begin in arrivals:
        t = np.linspace(begin, begin + 3000.0, 300_001)
        off = np.interp(t, rows[:, Row.T], rows[:, Row.Z]) - 60.0
        total += 3000.0
        inside += 3000.0 * np.mean(np.abs(off) <= 0.5)
        squares += np.trapezoid(off**2, t)
        most = max(most, np.max(np.abs(off)))
    found = holdings(flown)[1]
    assert 0.0 < inside < total
    assert found[Holding.TIME] == pytest.approx(total, rel=1e-9)
    assert found[Holding.INSIDE] == pytest.approx(inside, abs=0.2)
    assert found[Holding.SQUARES] == pytest.approx(squares, rel=1e-4)
    assert found[Holding.MOST] == pytest.approx(most, rel=1e-6)
    held = found[Holding.INSIDE] >= 0.9 * found[Holding.TIME]
    assert bool(np.any(flown.cycles[:, Cycle.NOT_HELD] == 2.0)) is not held


def test_arrival_is_that_of_the_first_phase_of_a_depth(profiler, sea):
    """Whatever arrives later; a phase at the surface before it counts for nothing."""
    stages = [phase.model_dump(exclude_none=True) for phase in phases().phases]
    surface, rest = stages[-1], stages[:-1]
    rest[0]["timeout"] = 20_000.0
    flown = fly_mission(profiler, Mission(phases=[surface, *rest, surface]), sea)
    arrived = flown.notes[flown.notes[:, Drive.WHAT] == Note.ARRIVED]
    first = arrived[arrived[:, Drive.NUMBER] == 1.0][0]
    assert first[Drive.Z] == pytest.approx(145.0, abs=1e-3)
    assert flown.cycles[0, Cycle.ARRIVAL] == first[Drive.T]


def test_in_an_alarm_the_pump_runs_on_in_runs_that_it_stands(profiler, sea):
    """Sinking past the depth it may go to: 30 s and again 30 s, without a pause between."""
    actuator = profiler.actuator.model_copy(update={"longest_run": 30.0})
    vehicle = profiler.model_copy(update={"actuator": actuator})
    stages = [
        {**phase.model_dump(exclude_none=True), "speed": 0.5} for phase in phases(deep=150.0).phases
    ]
    flown = fly_mission(
        vehicle, Mission(phases=stages, safety={"deepest": 151.0}), sea, checked=False
    )
    assert flown.stop is Stop.PASSED_DEPTH
    notes = flown.notes
    alarm = notes[notes[:, Drive.WHAT] == Note.TOO_DEEP][0, Drive.T]
    over = notes[(notes[:, Drive.WHAT] == Note.RUN_OVER) & (notes[:, Drive.T] > alarm)]
    begun = notes[(notes[:, Drive.WHAT] == Note.PUMP) & (notes[:, Drive.T] >= alarm)]
    assert len(over) > 3
    assert np.max(over[:, Drive.NUMBER]) <= 30.0 + 1e-9
    assert np.array_equal(begun[1:, Drive.T], over[: len(begun) - 1, Drive.T])
    assert flown.end[Now.V] == pytest.approx(profiler.stroke.maximum, rel=1e-3)


def leaking(profiler, coefficient):
    actuator = profiler.actuator.model_copy(update={"leakage": coefficient})
    return profiler.model_copy(update={"actuator": actuator})


def afloat(days):
    stages = [phase.model_dump(exclude_none=True) for phase in phases(duration=600.0).phases]
    stages[-1]["duration"] = days * 86400.0
    return Mission(phases=stages)


def test_what_leaks_at_the_surface_is_pumped_out_again(profiler, sea):
    """Never more than a thousandth of the stroke is lacking, and a run is started for that much."""
    flown = fly_mission(leaking(profiler, 5e-15), afloat(5.0), sea)
    full, length = profiler.stroke.maximum, 600e-6
    surfaced = flown.cycles[0, Cycle.SURFACED]
    late = flown.rows[flown.rows[:, Row.T] > surfaced]
    assert np.min(late[:, Row.V]) > full - 1.2e-3 * length
    pumped = flown.notes[
        (flown.notes[:, Drive.WHAT] == Note.PUMP) & (flown.notes[:, Drive.T] > surfaced)
    ]
    assert len(pumped) > 3
    assert np.min(pumped[:, Drive.NUMBER]) > 1e-3 * length
    assert flown.stop is Stop.FINISHED


def test_a_float_that_leaks_and_cannot_pump_sinks_from_the_surface(profiler, sea):
    """It goes under when the volume over neutral is gone, by the leak's own rate, and falls."""
    vehicle = leaking(profiler, 1e-13)
    task = Mission(phases=[{"kind": "surface", "duration": 4e5}])
    plan = make_plan(vehicle, task, sea)
    x, at, accounts = first_state(plan, task)
    x[Now.T_LOOK], x[Now.T_END] = math.inf, 4e5
    at[At.NEW_PHASE], at[At.ARRIVED] = 0, 1
    flown = plan.under_way((x, at, accounts), notes=1000)
    fly(flown)
    notes = flown.notes
    under = notes[notes[:, Drive.WHAT] == Note.SUBMERGED]
    top = profiler.hull.emergence_depth
    oracle = Oracle(vehicle, sea)
    assert under[0, Drive.V] == pytest.approx(oracle.at("neutral", top), abs=1e-7)
    # the leak, quasi-static: dV/dt = -leak(z), z where the spring holds what is over neutral
    stiff = oracle.surface_weight * profiler.hull.waterplane_area
    volumes = np.linspace(oracle.at("neutral", top), profiler.stroke.maximum, 20_001)
    depths = []
    z = top
    for v in volumes:
        for _ in range(3):
            push = float(oracle.slope(max(z, 0.0))) * (v - oracle.at("neutral", z))
            z = top - push / stiff
        depths.append(z)
    leak = np.array([oracle.at("leak", max(z, 0.0)) for z in depths])
    assert under[0, Drive.T] == pytest.approx(np.trapezoid(1.0 / leak, volumes), rel=0.02)
    assert np.max(notes[:, Drive.Z]) > 100.0


def test_the_bypass_lets_in_where_the_reservoir_is_at_one_atmosphere(profiler, sea):
    """No head at depth 0, some where it floats: the bypass has the larger flow and is used."""
    actuator = profiler.actuator.model_copy(update={"internal_pressure": 101325.0})
    flown = fly_mission(profiler.model_copy(update={"actuator": actuator}), phases(), sea)
    shallow = flown.notes[flown.notes[:, Drive.Z] < 1.0]
    what = [Note(int(k)) for k in shallow[:, Drive.WHAT]]
    assert Note.BYPASS in what
    assert Note.VALVE not in what
    assert flown.stop is Stop.FINISHED
