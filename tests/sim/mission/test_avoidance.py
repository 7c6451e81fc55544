"""The bottom and ice: what a vehicle does by itself, its rules applied to the trajectory."""

import dataclasses

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.log_text import counted
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas.records import Note, Stop
from swimbladder.sim.mission import export
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import first_state
from swimbladder.sim.mission.result import MissionResult
from swimbladder.vehicle import Supervisor
from tests.sim.mission.conftest import stratified
from tests.sim.mission.test_phase_laws import FILES

BOTTOM, SHIFT = 90.0, 40.0
DESCEND = {"kind": "descend", "depth": 150.0, "tolerance": 5.0}
PARK = {"kind": "park", "depth": 150.0, "tolerance": 8.0, "duration": 21_600.0}
PARK["check_interval"] = 60.0
UP = {"kind": "surface", "duration": 600.0}
GROUND = {"volume": 8e-6, "shift": SHIFT}


def task(*phases, **more):
    return Mission(phases=phases, **{"bottom_depth": BOTTOM, "grounding": GROUND, **more})


def noted(flight, what):
    return flight.notes[flight.notes["what"] == what]


def still(flight, note, change):
    """Return the time since the volume let in was enough, the depth not having changed [s]."""
    rows = flight.rows[flight.rows["t"] <= note["t"]]
    moved = np.flatnonzero(np.abs(rows["z"] - note["z"]) >= change)[-1]
    after = rows[moved:]
    enough = np.maximum.accumulate(after["v"]) - after["v"] >= 15e-6
    return float(note["t"] - after["t"][np.argmax(enough)])


def fallen(flight, note, change=1.0):
    """Return the greatest volume since the depth last changed, less that at a note [m3]."""
    rows = flight.rows[flight.rows["t"] <= note["t"]]
    moved = np.flatnonzero(np.abs(rows["z"] - note["z"]) >= change)[-1]
    return float(rows["v"][moved:].max() - note["v"])


def test_it_is_grounded_once_it_let_in_the_volume_and_does_not_sink(profiler, sea):
    flight = fly_mission(profiler, task(DESCEND, UP), sea)
    grounded = noted(flight, Note.GROUNDED)
    assert len(grounded) == 1
    assert grounded["z"][0] == BOTTOM
    assert fallen(flight, grounded[0]) >= 8e-6
    valves = noted(flight, Note.VALVE)
    before = valves[valves["z"] == BOTTOM]
    enough = before["t"][np.argmax([fallen(flight, one) >= 8e-6 for one in before])]
    assert 60.0 <= grounded["t"][0] - enough <= 60.0 + 2.0 * 70.0, "a minute, and its samples"
    begun = noted(flight, Note.PHASE)
    assert begun["t"][1] == grounded["t"][0], "the next phase begins there and then"
    found = MissionResult(flight, flight.reach)
    assert found.completed
    assert found.missed == {}
    assert found.arrival is None
    assert found.to_dict()["grounded_m"] == {"descend": [BOTTOM]}
    assert (
        "the phase 'descend' was grounded 1 time, at 90 m, and went on with the next phase"
        in found.reasons[1]
    )
    assert "grounded" in export.events_csv(flight)


def test_where_the_bottom_is_deeper_nothing_is_different(profiler, sea):
    plain, knows = (
        fly_mission(profiler, Mission(phases=[DESCEND, PARK, UP], **more), sea)
        for more in ({}, {"grounding": GROUND, "bottom_depth": 300.0})
    )
    assert plain.rows.tobytes() == knows.rows.tobytes()
    assert plain.notes.tobytes() == knows.notes.tobytes()


def test_a_park_that_shifts_goes_on_above_the_bottom(profiler, sea):
    flight = fly_mission(profiler, task({**PARK, "grounding": "shift"}, UP), sea)
    (grounded,) = noted(flight, Note.GROUNDED)
    arrived = noted(flight, Note.ARRIVED)[0]
    pumps = noted(flight, Note.PUMP)
    (lift,) = pumps[pumps["t"] == grounded["t"]]
    assert lift["number"] == pytest.approx(fallen(flight, grounded)), "all that it let in there"
    assert arrived["z"] == pytest.approx(BOTTOM - SHIFT + 8.0, abs=1e-6)
    later = flight.rows[(flight.rows["t"] > arrived["t"]) & (flight.rows["t"] < 21_600.0)]
    assert np.abs(later["z"] - (BOTTOM - SHIFT)).max() < 10.0
    found = MissionResult(flight, flight.reach)
    assert found.completed
    assert found.held["park"]["rms"] < 8.0, "of the depth that it shifted to"
    assert found.arrival is None, "it never came to its own depth"
    assert grounded["t"] < arrived["t"]
    assert found.shifted == {"park": [BOTTOM - SHIFT]}
    assert "at 90 m, and went on at 50 m" in found.reasons[1]


@pytest.mark.parametrize("how", [{"grounding": "stay"}, {}, {"grounding": "shift"}])
def test_one_that_stays_lets_nothing_more_in(profiler, sea, how):
    """So does one that would shift, where the bottom is less deep than it takes for that."""
    least = {"least_depth": BOTTOM + 10.0} if "shift" in how.values() else {}
    if how == {}:
        how, least = {"grounding": "shift"}, {"shift": BOTTOM - 5.0}  # to the surface, nearly
    flight = fly_mission(profiler, task({**PARK, **how}, UP, grounding=GROUND | least), sea)
    grounded = noted(flight, Note.GROUNDED)[0]
    parked = flight.rows[flight.rows["t"] >= grounded["t"]]
    parked = parked[(parked["phase"] == 0) & (parked["cycle"] == 0)]
    assert np.all(parked["z"] == BOTTOM)
    runs = np.concatenate([noted(flight, kind) for kind in (Note.PUMP, Note.VALVE)])
    ends = noted(flight, Note.PHASE)["t"][1]
    assert not np.any((runs["t"] > grounded["t"]) & (runs["t"] < ends))
    assert ends == pytest.approx(21_600.0)
    found = MissionResult(flight, flight.reach)
    assert found.completed
    assert found.shifted == {}
    why = ""
    if how["grounding"] == "shift":
        deep = "it is no deeper than 100 m (grounding.least_depth)"
        why = f", as {deep if 'least_depth' in least else '85 m above it is at the surface'}"
    assert found.reasons[1].endswith(f"and stayed there{why}")
    assert found.to_dict()["grounded_m"] == {"park": [BOTTOM]}
    assert export.cycle_columns(found)["grounded"].sum() == 1.0


def test_without_a_bottom_there_is_no_grounding(profiler):
    """Also where it rests for long before it dives, looks often, or turns round under ice."""
    twice = [
        {"kind": "hold", "depth": 40.0, "tolerance": 5.0, "duration": 3600.0},
        {"kind": "hold", "depth": 150.0, "tolerance": 5.0, "duration": 600.0, "speed": 0.02},
    ]
    ground = {"volume": 2e-6, "shift": 30.0}
    often = {"kind": "park", "depth": 150.0, "tolerance": 3.0, "duration": 7200.0}
    phases = [*twice, {**often, "check_interval": 10.0}, UP]
    mission = Mission(phases=phases, cycles=3, ice=ICE | {"wait": 1e6}, grounding=ground)
    flight = fly_mission(profiler, mission, cold(60.0), seed=4)
    assert len(noted(flight, Note.ICE)) > 0
    assert len(noted(flight, Note.GROUNDED)) == 0


def test_a_piston_all_the_way_in_is_grounded_too(profiler, sea):
    """Nothing more can be let in: the depth that does not change says it."""
    stroke = profiler.stroke.model_copy(update={"minimum": -20e-6})
    vehicle = profiler.model_copy(update={"stroke": stroke})
    ground = {"volume": 300e-6, "time": 600.0}
    flight = fly_mission(vehicle, task(DESCEND, UP, grounding=ground), sea, checked=False)
    (grounded,) = noted(flight, Note.GROUNDED)
    assert grounded["v"] == pytest.approx(-20e-6, abs=1e-6)
    assert MissionResult(flight, flight.reach).missed == {}


def test_one_that_cannot_leave_the_bottom_in_time_has_missed_its_phase(profiler):
    slow = {**PARK, "grounding": "shift", "kind": "hold", "timeout": 1800.0}
    lame = profiler.model_copy(update={"supervisor": Supervisor()})
    water = uniform_column(lame.water, 400.0)
    flight = fly_mission(lame, task(slow, UP), water, checked=False)
    found = MissionResult(flight, flight.reach)
    assert found.missed == {"hold": 1}
    assert not found.completed
    assert "grounded, it did not come up to where it goes on" in " ".join(found.reasons)


def test_a_float_as_flashed_goes_up_from_the_bottom(profiler):
    vehicle = profiler.model_copy(update={"supervisor": Supervisor()})
    water = uniform_column(vehicle.water, 400.0)
    flight = fly_mission(vehicle, task({**PARK, "grounding": "shift"}, UP), water)
    assert flight.plan.supervised
    assert flight.stop is Stop.FINISHED
    (grounded,) = noted(flight, Note.GROUNDED)
    assert 8e-6 <= fallen(flight, grounded) < 14e-6
    late = flight.rows[(flight.rows["t"] > 18_000.0) & (flight.rows["t"] < 21_600.0)]
    assert np.abs(late["z"] - (BOTTOM - SHIFT)).max() < 10.0


@pytest.mark.parametrize("name", ["cascade", "adrc"])
def test_a_piston_by_a_law_that_samples_goes_up_from_the_bottom(name):
    vehicle = load_vehicle(str(FILES / f"law-{name}.toml"))
    hold = {"kind": "hold", "depth": 5.0, "tolerance": 0.5, "duration": 400.0}
    ground = {"volume": 15e-6, "change": 0.1, "time": 20.0, "shift": 1.5}
    phases = [{**hold, "grounding": "shift"}, UP]
    mission = Mission(start_depth=2.0, bottom_depth=4.0, phases=phases, grounding=ground)
    flight = fly_mission(vehicle, mission, uniform_column(vehicle.water, 50.0), checked=False)
    (grounded,) = noted(flight, Note.GROUNDED)
    assert grounded["z"] == 4.0
    assert fallen(flight, grounded, change=0.1) >= 15e-6
    assert still(flight, grounded, 0.1) == pytest.approx(20.0, abs=2.5)
    end = noted(flight, Note.PHASE)["t"][1]
    late = flight.rows[(flight.rows["t"] > end - 100.0) & (flight.rows["t"] <= end)]
    assert np.abs(late["z"] - 2.5).max() < 0.5
    assert MissionResult(flight, flight.reach).missed == {}


def cold(thickness, coldest=-1.85, warmest=1.0):
    """Return water that is at its coldest down to a depth [m] and warmer below."""
    sea = stratified()
    steps = np.where(sea.depth <= thickness, coldest, warmest)
    return dataclasses.replace(sea, temperature=steps)


ICE = {"temperature": -1.7, "start_depth": 50.0, "stop_depth": 20.0}
DIVE = (
    {"kind": "descend", "depth": 120.0, "tolerance": 8.0},
    {"kind": "park", "depth": 120.0, "tolerance": 8.0, "duration": 3600.0, "check_interval": 60.0},
    UP,
)


@pytest.mark.parametrize("thickness", [0.0, 20.0, 30.0, 40.0, 60.0])
def test_it_turns_back_where_the_median_of_the_layer_is_that_of_ice(profiler, thickness):
    water = cold(thickness)
    flight = fly_mission(profiler, Mission(phases=DIVE, cycles=2, ice=ICE), water)
    rows = flight.rows[(flight.rows["phase"] == 2) & (flight.rows["cycle"] == 0)]
    times = np.linspace(rows["t"][0], rows["t"][-1], 200_001)
    depths = np.interp(times, rows["t"], rows["z"])
    layer = depths[(depths <= 50.0) & (depths >= 20.0)]
    median = np.median(np.interp(layer, water.depth, water.temperature))
    ice = noted(flight, Note.ICE)
    assert (median <= -1.7) == (thickness in (40.0, 60.0)), "the waters are of both kinds"
    assert len(ice) == (2 if median <= -1.7 else 0)
    assert len(noted(flight, Note.AFLOAT)) == 2 - len(ice)
    found = MissionResult(flight, flight.reach)
    assert found.completed
    assert (found.ice_least < np.inf) == bool(len(ice))
    if len(ice):
        rose = flight.rows["z"][(flight.rows["t"] >= ice["t"][0]) & (flight.rows["cycle"] == 1)]
        assert found.ice_least == pytest.approx(min(rose[:40].min(), 20.0))
        assert ice["z"] == pytest.approx([20.0, 20.0])
        assert np.isnan(flight.cycles["surfaced"]).all()
        assert flight.rows["z"][flight.rows["t"] > 600.0].min() > 18.0
        assert "for ice it turned back 2 times in 2 cycles from 20 m, 2 of them" in found.reasons[1]
        assert found.to_dict()["ice_turns"] == 2


def test_after_too_long_it_comes_up_all_the_same(profiler):
    sea = cold(60.0)
    ice = {**ICE, "longest": 3.5 * 7200.0}
    flight = fly_mission(profiler, Mission(phases=DIVE, cycles=8, ice=ice), sea)
    up = ~np.isnan(flight.cycles["surfaced"])
    last, wanted = 0.0, []
    for cycle, floats in zip(flight.cycles, up, strict=True):
        wanted.append(float(cycle["t_end"]) - last > 3.5 * 7200.0)
        last = float(cycle["t_end"]) if floats else last
    assert up.tolist() == wanted
    assert 0 < up.sum() < 8
    found = MissionResult(flight, flight.reach)
    answer = found.to_dict()
    assert answer["surfaced_under_ice"] == up.sum()
    assert answer["ice_turns"] == 8 - up.sum()
    assert export.cycle_columns(found)["ice_turns"].tolist() == (~up).astype(float).tolist()
    (said,) = (words for words in found.reasons if "although" in words)
    assert f"came up {counted(int(up.sum()), 'time')} although there may have been ice, af" in said
    assert "after 7 h 0 min without surfacing (ice.longest)" in said


def test_after_ice_it_waits_where_there_is_none_any_more(profiler, monkeypatch):
    def after_ice(*given, **more):
        state = first_state(*given, **more)
        state[0]["t_ice"] = 0.0
        return state

    monkeypatch.setattr("swimbladder.sim.mission.flight.first_state", after_ice)
    mission = Mission(phases=DIVE, cycles=4, ice={**ICE, "wait": 12_000.0})
    flight = fly_mission(profiler, mission, cold(0.0))
    ice, afloat = noted(flight, Note.ICE), noted(flight, Note.AFLOAT)
    assert len(ice) + len(afloat) == 4
    assert np.all(ice["number"] == 0.0)
    assert ice["t"][-1] < 12_000.0 < afloat["t"][0]
    said = MissionResult(flight, flight.reach).reasons[1]
    assert (
        f"turned back {counted(len(ice), 'time')} in 4 cycles from 20 m, 0 of them by the temp"
        in said
    )


@pytest.mark.parametrize(
    ("phases", "more", "says"),
    [
        ([DESCEND, UP], {"grounding": None}, "below the bottom at 90 m"),
        ([{**PARK, "grounding": "stay"}, UP], {"grounding": None, "bottom_depth": None}, "bottom"),
        ([{**DESCEND, "grounding": "stay"}, UP], {}, "a phase 'descend' has none"),
        ([PARK, {**UP, "grounding": "next"}], {}, "a phase 'surface' has none"),
        ([{**PARK, "grounding": "up"}, UP], {}, "(got 'up'). Allowed: next, stay, shift."),
        ([PARK, UP], {"ice": {"stop_depth": 50.0}}, "not above the start_depth of 50 m"),
        ([PARK, UP], {"grounding": {"volume": 0.0}}, "grounding.volume"),
        ([PARK, UP], {"start_depth": 95.0}, "below the bottom"),
        ([{**PARK, "depth": 15.0}, UP], {"ice": {}}, "from 15 m (phases[0]) does not measure"),
        ([PARK, UP], {"ice": {}, "bottom_depth": 20.0}, "the bottom at 20 m is not below it"),
    ],
)
def test_what_does_not_go_together_is_refused(phases, more, says):
    with pytest.raises(InputError) as refused:
        task(*phases, **more)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("phase", "more", "says"),
    [
        ({}, {"grounding": {"volume": 700e-6}}, "the whole stroke is 600 cm3 (got 0.0007"),
        ({}, {"grounding": {"change": 0.1}}, "the noise of the depth alone changes it by up to 0."),
        ({"grounding": "shift"}, {"grounding": {"shift": 6.0}}, "not less than the 6 m that the"),
        ({}, {"bottom_depth": 4.0}, "down to 5 m the vehicle counts as at the surface, and finds"),
        ({}, {"ice": {"stop_depth": 1.0}}, "from 5 m up the vehicle counts as at the surface"),
    ],
)
def test_what_the_vehicle_cannot_do_is_refused(profiler, sea, phase, more, says):
    sensors = profiler.sensors.model_copy(update={"depth_noise": 0.05})
    noisy = profiler.model_copy(update={"sensors": sensors})
    with pytest.raises(InputError) as refused:
        fly_mission(noisy, task({**PARK, **phase}, UP, **more), sea)
    assert says in str(refused.value)


def test_a_cast_that_ends_at_the_bottom_is_deep_enough(profiler):
    flight = fly_mission(profiler, task({**PARK, "depth": 900.0}, UP), stratified(100.0))
    assert len(noted(flight, Note.GROUNDED)) == 1
    assert Mission(phases=[PARK, UP], grounding=GROUND).over(70.0).bottom == 70.0


def test_a_flight_by_a_speed_leaves_the_bottom_at_that_speed():
    vehicle = load_vehicle(str(FILES / "law-adrc.toml"))
    ground = {"volume": 15e-6, "change": 0.1, "time": 20.0, "shift": 2.0}
    hold = {"kind": "hold", "depth": 5.0, "tolerance": 0.3, "duration": 200.0, "speed": 0.03}
    phases = [{**hold, "grounding": "shift"}, UP]
    mission = Mission(start_depth=2.0, bottom_depth=4.0, phases=phases, grounding=ground)
    flight = fly_mission(vehicle, mission, uniform_column(vehicle.water, 50.0), checked=False)
    (grounded,) = noted(flight, Note.GROUNDED)
    after = flight.rows[(flight.rows["t"] > grounded["t"]) & (flight.rows["phase"] == 0)]
    reached = after["t"][np.argmax(after["z"] <= 2.3)] - grounded["t"]
    assert reached > 0.8 * 1.7 / 0.03
