"""How phases hold their depth, when they arrive, and how long the pump runs for it."""

import math

import numpy as np
import pytest

from swimbladder.io.mission import Mission
from swimbladder.sim.engine.rodas.records import Account, Note, Stop
from swimbladder.sim.mission.core.hooks import fly
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import first_state, make_plan
from tests.sim.mission.conftest import phases
from tests.sim.mission.oracle import Oracle
from tests.sim.mission.test_flight import TIGHT


def holdings(flight):
    return flight.accounts[len(Account) :].reshape(-1, len(Holding))


def test_at_rest_beside_its_depth_the_distance_is_all_there_is(profiler, sea):
    """Nothing is asked for within the near band, so that it stays 3 m off for the whole time."""
    task = Mission(
        start_depth=100.0,
        phases=[{"kind": "park", "depth": 103.0, "tolerance": 5.0, "duration": 7200.0}],
    )
    flown = fly_mission(profiler, task, sea, accuracy=TIGHT)
    assert np.ptp(flown.rows["z"]) < 1e-6
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
    arrivals = flown.notes[(flown.notes["what"] == Note.ARRIVED) & (flown.notes["number"] == 1.0)][
        "t"
    ]
    assert len(arrivals) == 2
    for begin in arrivals:
        t = np.linspace(begin, begin + 3000.0, 300_001)
        off = np.interp(t, rows["t"], rows["z"]) - 60.0
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
    assert bool(np.any(flown.cycles["not_held"] == 2.0)) is not held


def test_arrival_is_that_of_the_first_phase_of_a_depth(profiler, sea):
    """Whatever arrives later; a phase at the surface before it counts for nothing."""
    stages = [phase.model_dump(exclude_none=True) for phase in phases().phases]
    surface, rest = stages[-1], stages[:-1]
    rest[0]["timeout"] = 20_000.0
    flown = fly_mission(profiler, Mission(phases=[surface, *rest, surface]), sea)
    arrived = flown.notes[flown.notes["what"] == Note.ARRIVED]
    first = arrived[arrived["number"] == 1.0][0]
    assert first["z"] == pytest.approx(145.0, abs=1e-3)
    assert flown.cycles["arrival"][0] == first["t"]


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
    alarm = notes[notes["what"] == Note.TOO_DEEP]["t"][0]
    over = notes[(notes["what"] == Note.RUN_OVER) & (notes["t"] > alarm)]
    begun = notes[(notes["what"] == Note.PUMP) & (notes["t"] >= alarm)]
    assert len(over) > 3
    assert np.max(over["number"]) <= 30.0 + 1e-9
    assert np.array_equal(begun["t"][1:], over["t"][: len(begun) - 1])
    assert flown.end["v"] == pytest.approx(profiler.stroke.maximum, rel=1e-3)


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
    surfaced = flown.cycles["surfaced"][0]
    late = flown.rows[flown.rows["t"] > surfaced]
    assert np.min(late["v"]) > full - 1.2e-3 * length
    pumped = flown.notes[(flown.notes["what"] == Note.PUMP) & (flown.notes["t"] > surfaced)]
    assert len(pumped) > 3
    assert np.min(pumped["number"]) > 1e-3 * length
    assert flown.stop is Stop.FINISHED


def test_a_float_that_leaks_and_cannot_pump_sinks_from_the_surface(profiler, sea):
    """It goes under when the volume over neutral is gone, by the leak's own rate, and falls."""
    vehicle = leaking(profiler, 1e-13)
    task = Mission(phases=[{"kind": "surface", "duration": 4e5}])
    plan = make_plan(vehicle, task, sea)
    x, at, accounts = first_state(plan, task)
    x["t_sample"], x["t_end"] = math.inf, 4e5
    at["new_phase"], at["arrived"] = 0, 1
    flown = plan.under_way((x, at, accounts), notes=1000)
    fly(flown)
    notes = flown.lane.notes
    under = notes[notes["what"] == Note.SUBMERGED]
    top = profiler.hull.emergence_depth
    oracle = Oracle(vehicle, sea)
    assert under["v"][0] == pytest.approx(oracle.at("neutral", top), abs=1e-7)
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
    assert under["t"][0] == pytest.approx(np.trapezoid(1.0 / leak, volumes), rel=0.02)
    assert np.max(notes["z"]) > 100.0


def test_the_bypass_lets_in_where_the_reservoir_is_at_one_atmosphere(profiler, sea):
    """No head at depth 0, some where it floats: the bypass has the larger flow and is used."""
    actuator = profiler.actuator.model_copy(update={"internal_pressure": 101325.0})
    flown = fly_mission(profiler.model_copy(update={"actuator": actuator}), phases(), sea)
    shallow = flown.notes[flown.notes["z"] < 1.0]
    what = [Note(int(k)) for k in shallow["what"]]
    assert Note.BYPASS in what
    assert Note.VALVE not in what
    assert flown.stop is Stop.FINISHED
