"""A hull that takes the water's temperature in time: first order, its limits, and its balance."""

import math

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.physics.hull import displaced_volume, heat_expansion, neutral_volume
from swimbladder.physics.seawater import (
    InternalWave,
    WaterMotion,
    motion_table,
    moved,
    uniform_column,
)
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import Account, Note
from swimbladder.sim.mission.balance import close_balance
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.vehicle import HullPart
from tests.sim.mission.conftest import phases
from tests.sim.mission.oracle import Oracle
from tests.sim.mission.test_flight import TIGHT, coast

EXPANSION, LAG = 7e-5, 900.0  # 1/K, of aluminium; s, as a logged float's


def heated(vehicle, lag=LAG, expansion=EXPANSION, **hull):
    part = HullPart(
        name="hull",
        volume=vehicle.hull.displaced_volume,
        compressibility=3.4e-10,
        thermal_expansion=expansion,
    )
    changes = {"parts": (part,), "thermal_time_constant": lag, **hull}
    return vehicle.model_copy(update={"hull": vehicle.hull.model_copy(update=changes)})


def warm(mission, celsius):
    return mission.model_copy(update={"start_temperature": celsius})


def test_in_water_of_one_temperature_it_is_a_decay(profiler):
    """T = T_water + (T_0 - T_water) e^(-t/tau), wherever the vehicle goes, at rest too."""
    vehicle = heated(profiler)
    column = uniform_column(vehicle.water, 400.0)
    water = vehicle.water.temperature
    task = warm(phases(duration=7200.0), 30.0)
    for accuracy in (TIGHT, Accuracy()):
        flight = fly_mission(vehicle, task, column, accuracy=accuracy, span=1.0)
        due = water + (30.0 - water) * math.exp(-flight.duration / LAG)
        assert flight.duration > 3.0 * LAG
        assert flight.end["hull"] == pytest.approx(due, rel=1e-7, abs=1e-4)


def test_sinking_through_layers_it_stays_behind_by_speed_times_gradient(profiler, sea):
    """A ramp of b K/s is followed at a distance b tau: as a vehicle of no expansion sinks."""
    linear = sea.__class__(
        depth=sea.depth,
        pressure=sea.pressure,
        density=sea.density,
        temperature=20.0 - 0.02 * sea.depth,
        gravity=sea.gravity,
    )
    vehicle = heated(profiler, lag=60.0, expansion=1e-12)
    start = float(np.interp(50.0, sea.depth, neutral_volume(vehicle, linear)))
    x, _, _ = coast(vehicle, linear, depth=50.0, volume=start - 100e-6, speed=0.0, seconds=1200.0)
    ahead = coast(vehicle, linear, depth=50.0, volume=start - 100e-6, speed=0.0, seconds=1140.0)[0]
    # the speed changes slowly: it is as warm as the water that it left tau before
    there = 20.0 - 0.02 * float(ahead["z"])
    assert x["z"] > 100.0
    assert x["hull"] == pytest.approx(there, abs=0.02)
    assert x["hull"] > 20.0 - 0.02 * x["z"] + 0.05


@pytest.mark.prove
def test_a_dive_is_that_of_scipy_at_every_event(profiler, sea):
    vehicle = heated(profiler)
    flight = fly_mission(vehicle, warm(phases(), 24.0), sea, accuracy=TIGHT)
    states = Oracle(vehicle, sea).replay(flight)
    assert len(states) > 30
    assert np.max(np.abs(states[:, 0] - flight.notes["z"])) < 1e-6
    assert np.max(np.abs(states[:, 2] - flight.notes["v"])) < 1e-12
    at_once = fly_mission(heated(profiler, lag=0.0), phases(), sea, accuracy=TIGHT)
    assert abs(at_once.duration - flight.duration) > 60.0  # and it matters


def test_a_dive_in_an_internal_wave_is_that_of_scipy(profiler, sea):
    """The hull takes the heat of the layer that is there."""
    wave = InternalWave(amplitude=12.0, period=2400.0, water_depth=380.0, phase=0.7)
    table = motion_table(WaterMotion(internal_waves=(wave,)), sea.gravity)
    task = Mission(
        start_depth=20.0,
        start_temperature=5.0,
        phases=[
            {"kind": "descend", "depth": 90.0, "tolerance": 4.0},
            {"kind": "hold", "depth": 90.0, "tolerance": 4.0, "duration": 3600.0},
        ],
    )
    vehicle = heated(profiler)
    flown = fly_mission(vehicle, task, sea, waves=table, accuracy=TIGHT, checked=False)
    states = Oracle(vehicle, sea, waves=lambda z, t: moved(table, z, t)).replay(flown)
    assert np.max(np.abs(states[:, 0] - flown.notes["z"])) < 1e-6
    assert close_balance(flown).relative_residue < 1e-6


def test_its_books_balance_with_what_heat_did(profiler, sea):
    flown = fly_mission(heated(profiler), warm(phases(), 24.0), sea, accuracy=TIGHT)
    balance = close_balance(flown)
    assert abs(balance.sinks["heat of the hull"]) > 1e3 * abs(balance.residue)
    assert balance.relative_residue < 1e-6
    assert close_balance(fly_mission(heated(profiler), phases(), sea)).relative_residue < 1e-4
    at_once = fly_mission(heated(profiler, lag=0.0), phases(), sea)
    assert at_once.accounts[Account.HEAT] == 0.0


def test_the_shorter_its_time_the_nearer_it_is_to_a_hull_at_once(profiler, sea):
    """The distance of depths falls with tau."""

    def depth(lag):
        vehicle = heated(profiler, lag=lag)
        return coast(vehicle, sea, depth=20.0, volume=volume, speed=0.0, seconds=900.0)[0]["z"]

    start = float(np.interp(20.0, sea.depth, neutral_volume(heated(profiler), sea)))
    volume = start - 60e-6
    right = depth(0.0)
    far, near = (abs(depth(lag) - right) for lag in (2.0, 1.0))
    assert 1e-5 < near < far < 1.0
    assert far / near == pytest.approx(2.0, rel=0.05)
    assert abs(depth(1e-6) - right) < 1e-6


def test_one_that_never_warms_is_a_hull_without_expansion(profiler, sea):
    vehicle = heated(profiler, lag=1e6)
    still = heated(profiler, lag=0.0, expansion=0.0)
    warmth = vehicle.hull.reference_temperature
    assert warmth == vehicle.water.temperature  # so that both weigh the same
    ends = [
        fly_mission(v, task, sea).rows["t"][-1]
        for v, task in ((vehicle, warm(phases(), warmth)), (still, phases()))
    ]
    assert ends[0] == pytest.approx(ends[1], rel=0.02)


def test_it_is_lifted_off_the_bottom_when_its_hull_has_warmed(profiler):
    """E (T_water - T) e^(-t/tau) falls to what it is too light by, in tau ln of their ratio."""
    vehicle = heated(profiler)
    column = uniform_column(vehicle.water, 400.0)
    water, bottom = vehicle.water.temperature, 100.0
    colder, light = 10.0, 5e-6  # K, m3
    task = Mission(
        start_depth=bottom - 0.01,
        bottom_depth=bottom,
        start_temperature=water - colder,
        phases=[{"kind": "park", "depth": bottom - 1.0, "tolerance": 5.0, "duration": 3600.0}],
    )
    rest = float(np.interp(bottom, column.depth, neutral_volume(vehicle, column)))
    flown = fly_mission(vehicle, task, column, start_volume=rest + light)
    kinds = flown.notes["what"]
    left = flown.notes[kinds == Note.LEFT_BOTTOM]
    due = LAG * math.log(heat_expansion(vehicle) * colder / light)
    assert np.sum(kinds == Note.BOTTOM) == 1
    assert left["t"][0] == pytest.approx(due, abs=0.1 * LAG)


def test_it_sinks_on_while_its_hull_cools(profiler, sea):
    """It comes to where the hull of the water's temperature rests, and does not stop before."""
    vehicle, cold = heated(profiler), heated(profiler, lag=0.0)
    volume = float(np.interp(100.0, sea.depth, neutral_volume(cold, sea)))
    given = {"depth": 100.0, "volume": volume, "speed": 0.0, "seconds": 12.0 * LAG}
    right = coast(cold, sea, accuracy=Accuracy(), **given)[0]["z"]
    flown = coast(vehicle, sea, accuracy=Accuracy(), celsius=20.0, **given)[0]
    early = coast(vehicle, sea, accuracy=Accuracy(), celsius=20.0, **given | {"seconds": LAG})[0]
    assert early["z"] < right - 5.0
    assert flown["z"] == pytest.approx(right, abs=0.05)


def test_its_expansion_is_the_slope_of_what_it_displaces(profiler):
    vehicle = heated(profiler)
    grown = displaced_volume(vehicle, 1e6, 16.0) - displaced_volume(vehicle, 1e6, 15.0)
    assert heat_expansion(vehicle) == pytest.approx(float(grown), rel=1e-9)
    assert heat_expansion(profiler) == 0.0 or profiler.hull.parts


def test_a_temperature_at_the_start_that_changes_nothing_is_refused(profiler, sea):
    with pytest.raises(InputError, match=r"hull\.thermal_time_constant"):
        fly_mission(heated(profiler, lag=0.0), warm(phases(), 20.0), sea)
