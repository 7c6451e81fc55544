"""What is made of a mission before it is flown, and what is made of its rows: by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Stop
from swimbladder.sim.mission import export, prepare, result, words
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.result import MissionResult
from tests.sim.mission.conftest import phases


def test_a_dive_begins_5_m_down_or_half_way_to_its_least_target(profiler):
    """5 m are half a bar, from which floats of the MERMAID kind count as diving."""
    assert prepare.shallow_depth(profiler, phases()) == 5.0
    stages = [{"kind": "descend", "depth": depth, "tolerance": 1.0} for depth in (9.0, 12.0)]
    assert prepare.shallow_depth(profiler, Mission(phases=stages)) == 4.0


@pytest.mark.parametrize("depth", [None, 0.5])
def test_a_dive_begins_a_tenth_of_the_hull_below_where_it_emerges_at_least(profiler, depth):
    """So it does where no phase has a depth, or half of the least one is less."""
    surface = {"kind": "surface", "duration": 60.0}
    least = [] if depth is None else [{"kind": "profile", "depth": depth, "tolerance": 0.2}]
    for top in (0.0, 0.3):
        hull = profiler.hull.model_copy(update={"emergence_depth": top, "height": 2.0})
        vehicle = profiler.model_copy(update={"hull": hull})
        found = prepare.shallow_depth(vehicle, Mission(phases=[*least, surface]))
        assert found == pytest.approx(top + 0.2)


def test_a_heavier_float_is_slower_and_floats_deeper_in_proportion():
    """Buoyancy and waterplane act on its mass, what its drive errs by on its rates."""
    vehicle = load_vehicle("feup-em")
    task = Mission(
        start_depth=2.0,
        phases=[{"kind": "hold", "depth": 3.0, "tolerance": 1.0, "duration": 60.0}],
    )
    plan = prepare.make_plan(vehicle, task, uniform_column(vehicle.water, 50.0))
    own = plan.medium(vehicle).plant
    plan.given["mass"] *= 1.25
    plan.given["delivery"], plan.given["trim"], plan.given["give"] = 0.8, 1e-6, 1e-7
    found = plan.medium(vehicle).plant
    assert found.a_b == pytest.approx(own.a_b / 1.25, rel=1e-12)
    assert found.a_s == pytest.approx(own.a_s / 1.25, rel=1e-12)
    assert found.gain == pytest.approx(0.8 * own.gain, rel=1e-12)
    assert found.kappa == pytest.approx(own.kappa / 0.8, rel=1e-12)
    assert pytest.approx(1e-6, rel=1e-9) == found.V_0 - own.V_0
    assert found.psi - own.psi == pytest.approx(1e-7, rel=1e-9)


def test_a_hold_reckons_with_the_slower_of_pump_and_valve(profiler, sea, monkeypatch):
    given = []
    monkeypatch.setattr(prepare, "hold_parameters", lambda *of: given.append(of[-1]))
    prepare.make_plan(profiler, phases(), sea)
    pressure = np.interp([150.0, 150.0, 20.0], sea.depth, sea.pressure)
    drive = drive_map(profiler, pressure)
    slower = np.minimum(drive.rate_out, drive.rate_in)
    assert np.all(slower < np.maximum(drive.rate_out, drive.rate_in))
    assert given == pytest.approx(list(slower), rel=1e-3)


def test_a_hull_as_stiff_as_the_water_is_flown_without_a_depth_to_rest_at(profiler):
    """psi = 0 in water of one density: nothing brings it back, and it does not count as resting."""
    hull = profiler.hull.model_copy(update={"psi": 0.0, "parts": (), "trapped_air": 0.0})
    vehicle = profiler.model_copy(update={"hull": hull})
    column = uniform_column(vehicle.water, 300.0)
    task = Mission(start_depth=50.0, phases=[{"kind": "park", "depth": 50.0, "duration": 3600.0}])
    flight = fly_mission(vehicle, task, column, checked=False)
    assert flight.stop is Stop.FINISHED
    assert np.all(np.isfinite(flight.rows["z"]))


def test_speeds_of_ways_of_two_points(profiler, sea, monkeypatch):
    """100 m in 500 s down and in 400 s up: 0.2 and 0.25 m/s in every layer between."""
    flight = fly_mission(profiler, phases(), sea, checked=False)
    ways = [((0.0, 500.0), (0.0, 100.0)), ((900.0, 1300.0), (100.0, 0.0))]
    monkeypatch.setattr(export, "_ways", lambda _: [tuple(map(np.array, way)) for way in ways])
    found = export.speeds(flight)
    crossed = found["depth_m"] < 95.0
    assert found["sinking_m_s"][crossed] == pytest.approx(0.2, rel=1e-9)
    assert found["rising_m_s"][crossed] == pytest.approx(0.25, rel=1e-9)


@pytest.mark.parametrize(
    ("energy", "said"),
    [
        (0.0, "0 J"),
        (999.0, "999 J"),
        (-999.0, "-999 J"),
        (1000.0, "1 kJ"),
        (1500.0, "1.5 kJ"),
        (-1500.0, "-1.5 kJ"),
        (12_700.0, "12.7 kJ"),
    ],
)
def test_energies_are_said_in_kilojoules_from_one_on(energy, said):
    assert result._joules(energy) == said


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (None, "never"),
        (59.4, "59 s"),
        (3599.0, "1 h 0 min"),
        (3.0 * 3600.0 + 610.0, "3 h 10 min"),
        (86400.0, "1 d 0 h"),
        (9.0 * 86400.0 + 23.5 * 3600.0, "9 d 23 h"),
        (200.0 * 86400.0, "200 d"),
    ],
)
def test_a_time_is_said_in_the_two_largest_units_that_it_takes(seconds, said):
    assert words.span_words(seconds) == said


def test_a_battery_that_has_nothing_to_give_lasts_no_number_of_cycles(profiler, sea):
    flight = fly_mission(profiler, phases(), sea, checked=False)
    found = MissionResult(flight, None)
    assert found.battery_cycles > 0
    given = flight.plan.given.copy()
    given["reserve"] = given["charge"]
    empty = replace(flight, plan=replace(flight.plan, given=given))
    assert MissionResult(empty, None).battery_cycles is None
    assert math.isfinite(float(given["charge"]))
