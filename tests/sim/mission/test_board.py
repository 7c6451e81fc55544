"""Missions of floats as flashed; the oracle is `simulate`, whose board is held against its twin."""

import json
import math

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.control.supervisor import Reason
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.run import MOST, Floats
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.engine.rodas.records import Account, Note, Stop
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.law_flight import ByBoard
from swimbladder.sim.mission.orders import flown_laws
from swimbladder.sim.mission.prepare import DriveError, cost_words, make_plan
from swimbladder.sim.mission.result import MissionResult
from swimbladder.vehicle import Supervisor
from swimbladder.vehicle.spread import Spread
from tests.quoted import refused
from tests.sim.mission.test_line import TIGHT

WHERE = {"kind": "descend", "depth": 150.0, "timeout": 7200.0}
THERE = {"kind": "hold", "depth": 150.0, "duration": 1800.0}
HIGHER = {"kind": "hold", "depth": 60.0, "duration": 1200.0}
UP = {"kind": "surface", "duration": 600.0}


def task(*phases, **more):
    return Mission(phases=list(phases or (WHERE, THERE, HIGHER, UP)), **more)


@pytest.fixture(scope="module")
def watched(profiler):
    """The float with a table [supervisor]."""
    return profiler.model_copy(update={"supervisor": Supervisor()})


@pytest.fixture(scope="module")
def water(watched):
    return uniform_column(watched.water, 400.0)


@pytest.fixture(scope="module")
def flight(watched, water):
    return fly_mission(watched, task(cycles=2), water)


@pytest.mark.promise("no-false-alarm")
def test_a_float_may_rest_as_far_from_its_depth_as_its_phase_says(watched, water):
    """50 m above it for two hours; the law of its file keeps 10 m."""
    far = {"kind": "hold", "depth": 150.0, "tolerance": 60.0, "duration": 7200.0}
    flight = fly_mission(watched, task({**WHERE, "depth": 100.0}, far, UP), water)
    assert flight.stop is Stop.FINISHED
    held = flight.rows[flight.rows["t"] < flight.duration - 3600.0]
    assert np.median(np.abs(held["z"] - 150.0)) > 20.0


def test_board_and_supervisor_fly_as_they_are_simulated(watched, water):
    """By set-points at the times at which the phases begin, in the same water."""
    flight = fly_mission(watched, task(), water, accuracy=TIGHT)
    begun = flight.notes[flight.notes["what"] == Note.PHASE]
    depths = [150.0, 150.0, 60.0, 0.0]
    found = simulate(
        watched,
        setpoints=[(float(n["t"]), depths[int(n["number"])]) for n in begun],
        start_depth=0.0,
        duration=np.ceil(flight.duration),
        cast=water,
    )
    assert found.supervised
    assert flight.plan.supervised
    assert flight.stop is Stop.FINISHED
    rows = flight.rows[np.abs(flight.rows["t"] - np.round(flight.rows["t"])) < 1e-9]
    depth, volume = (np.interp(rows["t"], found.time, own) for own in (found.depth, found.volume))
    assert len(rows) > 3_000
    assert depth.max() > 140.0
    np.testing.assert_allclose(rows["v"], volume, rtol=0.0, atol=3e-12)
    bobs = depth < 1.0
    np.testing.assert_allclose(rows["z"][~bobs], depth[~bobs], rtol=0.0, atol=5e-5)
    np.testing.assert_allclose(rows["z"][bobs], depth[bobs], rtol=0.0, atol=0.05)


def test_it_is_not_the_rule_and_takes_about_what_the_rule_takes(watched, water, flight):
    rule = fly_mission(watched, task(cycles=2), water, supervised=False)
    assert not rule.plan.supervised
    assert rule.rows.tobytes() != flight.rows.tobytes()
    energy = [f.accounts[Account.PUMP_ENERGY] for f in (rule, flight)]
    assert energy[1] == pytest.approx(energy[0], rel=0.1)
    assert flight.duration == pytest.approx(rule.duration, rel=0.05)


def test_volume_and_energy_are_conserved(flight):
    a, begin, end = flight.accounts, flight.begin, flight.end
    moved = a[Account.PUMPED] - a[Account.LET_IN] - a[Account.LEAKED]
    assert end["v"] - begin["v"] == pytest.approx(moved, abs=1e-12)
    names = ("PUMP", "VALVE", "HOLDING", "LOAD", "SURFACING")
    spent = sum(a[Account[f"{name}_ENERGY"]] for name in names) + a[Account.SELF_DISCHARGED]
    assert begin["charge"] - end["charge"] == pytest.approx(spent, rel=1e-9)


def test_each_phase_has_numbers_of_its_own(watched, water):
    slow = fly_mission(watched, task({**WHERE, "speed": 0.05}, THERE, HIGHER, UP), water)
    usual = fly_mission(watched, task(), water)
    first = [f.notes[f.notes["what"] == Note.ARRIVED]["t"][0] for f in (slow, usual)]
    assert first[0] > first[1] + 200.0
    assert [law.parameters.law.far_speed for law in slow.plan.laws][:2] == [0.05, 0.1]


def test_a_supervisor_that_takes_over_brings_it_up(watched, water):
    vehicle = watched.model_copy(update={"supervisor": Supervisor(time_limit=4000.0)})
    found = fly_mission(vehicle, task(), water)
    result = MissionResult(found, found.reach)
    assert found.stop is Stop.ALARM
    assert result.alarm.reason is Reason.TIME_LIMIT
    assert 4000.0 <= result.alarm.time <= 4002.0
    assert float(found.rows["z"][-1]) < vehicle.hull.emergence_depth
    assert not result.completed


def test_below_the_deepest_depth_of_the_mission_all_volume_goes_out(watched, water):
    near = {**THERE, "tolerance": 1.0}
    safe = task(WHERE, near, UP, safety={"deepest": 150.5})
    found = fly_mission(watched, safe, water, checked=False)
    assert found.plan.supervised
    assert found.stop is Stop.PASSED_DEPTH
    assert 150.5 < float(found.rows["z"].max()) < 152.0  # it was on its way back already
    assert float(found.rows["z"][-1]) < 0.2
    assert float(found.rows["v"][-1]) == pytest.approx(watched.stroke.maximum)


def test_what_the_board_cannot_do_is_refused(watched, water):
    with refused(InputError, field="phases[0].depth", value=1900.0, holds=[1800.0]):
        fly_mission(
            watched, task({**WHERE, "depth": 1900.0}, UP), uniform_column(watched.water, 2100.0)
        )
    limited = watched.model_copy(update={"supervisor": Supervisor(time_limit=1000.0)})
    with refused(InputError, field="supervisor.time_limit", value=1000.0):
        fly_mission(limited, task(), water)
    bare = watched.model_copy(update={"controller": None})
    flown = fly_mission(bare, task(), water)
    assert not flown.plan.supervised
    assert "it has none" in " ".join(MissionResult(flown, flown.reach).to_dict()["notes"])
    with refused(InputError, field="supervised"):
        fly_mission(bare, task(), water, supervised=True)


def test_a_killed_flight_goes_on_under_its_board(watched, water, tmp_path, monkeypatch):
    monkeypatch.setattr(ByBoard, "rows", 200)

    def kill(_):
        if len(list(tmp_path.iterdir())) == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly_mission(watched, task(), water, seed=4, keep=tmp_path, advance=kill)
    again = fly_mission(watched, task(), water, seed=4, keep=tmp_path)
    whole = fly_mission(watched, task(), water, seed=4)
    for name in ("rows", "notes", "end", "whole", "accounts"):
        assert getattr(again, name).tobytes() == getattr(whole, name).tobytes(), name


def test_a_float_of_a_campaign_is_flown_by_its_board(watched, water, tmp_path):
    same = Spread(trim=0.0, psi=0.0, drag=0.0, pump=0.0)
    job = Floats(
        vehicle=watched,
        mission=task(),
        columns=[water],
        floats=1,
        spread=same,
        store=tmp_path / "s.zarr",
    )
    job.create()
    job.do(0)
    alone = fly_mission(watched, task(), water, seed=job.seed * MOST, checked=False)
    row = job.layout.table()[0]
    assert alone.plan.supervised
    assert row["stop"] == Stop.FINISHED
    assert row["duration"] == alone.duration


def test_the_command_says_that_board_and_supervisor_fly_it(watched, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "v.toml").write_text(vehicle_file(watched), encoding="utf-8")
    (tmp_path / "m.toml").write_text(
        'schema_version = 1\n[[phases]]\nkind = "descend"\ndepth = "100 m"\n'
        '[[phases]]\nkind = "surface"\nduration = "5 min"\n'
    )
    assert main(["mission", "v.toml", "m.toml", "--out", "o"]) == 0
    assert "law 'rate' and supervisor fly all phases every 1 s" in capsys.readouterr().out
    answer = json.loads((tmp_path / "o/mission.json").read_text())
    assert answer["supervised"] is True
    assert answer["laws"][0]["sample_time_s"] == 1.0
    assert main(["mission", "v.toml", "m.toml", "--out", "o", "--unsupervised"]) == 0
    assert "law 'rate' flies all phases" in capsys.readouterr().out
    assert json.loads((tmp_path / "o/mission.json").read_text())["supervised"] is False


def test_what_its_ticks_cost_is_said_before_and_too_many_are_refused(watched, water):
    year = {"kind": "park", "depth": 150.0, "tolerance": 20.0, "duration": 3.2e7 / 52.0}
    laws, _ = flown_laws(watched, task(WHERE, year, UP, cycles=100), None)
    (said,) = cost_words(task(WHERE, year, UP, cycles=100), laws)
    assert said.startswith("61.6 million samples in 100 cycles, most by the law 'rate' every 1 s")
    assert "about 92 s of computing" in said
    assert "`supervised=False`" in said
    with pytest.raises(NoAnswerError, match="more than the 1000 million flown"):
        fly_mission(watched, task(WHERE, year, UP, cycles=2000), water)


def test_the_depth_that_it_comes_back_from_is_the_rule_s(watched, water):
    """Whose numbers are fewer than those of a board: it is flown with none of these."""
    soft = watched.model_copy(
        update={"hull": watched.hull.model_copy(update={"psi": 2e-8, "parts": ()})}
    )
    plans = [make_plan(soft, task(), water, supervised=s) for s in (None, False)]
    assert plans[0].supervised
    assert math.isfinite(plans[0].back)
    assert plans[0].back == plans[1].back


@pytest.mark.parametrize("pump", [0.85, 1.0])
def test_it_is_at_the_surface_when_its_board_takes_it_to_be(watched, water, pump):
    """Its volume is computed: what a weak pump did not press out it does not know of."""
    found = fly_mission(watched, task(), water, drive_error=DriveError(pump=pump), checked=False)
    assert found.stop is Stop.FINISHED
    last = found.rows[-1]
    lacks = watched.stroke.maximum - float(last["v"])
    assert float(last["z"]) < watched.hull.emergence_depth
    assert (lacks > 1e-5) == (pump < 1.0)
    assert np.count_nonzero(found.notes["what"] == Note.AFLOAT) == 1


def test_it_begins_with_the_volume_that_it_has(watched):
    deep = uniform_column(watched.water, 1600.0)
    below = task({**THERE, "depth": 1500.0}, UP, start_depth=1500.0)
    found = fly_mission(watched, below, deep)
    assert found.stop is Stop.FINISHED
    assert float(found.rows[-1]["v"]) == pytest.approx(watched.stroke.maximum, abs=1e-6)


def test_what_a_board_has_no_use_for_is_refused_in_its_words(watched, water):
    with pytest.raises(InputError, match=r"a board ticks at the sample_time of the \[controller\]"):
        fly_mission(watched, task({**WHERE, "sample_time": 5.0}, UP), water)
    with pytest.raises(InputError, match="so does its board, whose law says itself"):
        fly_mission(watched, task(WHERE, {**THERE, "rest_band": 1.0}, UP), water)


def test_a_campaign_of_too_many_ticks_is_refused_by_the_cycles_asked_for(watched, water, tmp_path):
    long = {"kind": "park", "depth": 150.0, "tolerance": 20.0, "duration": 6e5}
    same = Spread(trim=0.0, psi=0.0, drag=0.0, pump=0.0)

    def job(cycles, asked):
        return Floats(
            vehicle=watched,
            mission=task(WHERE, long, UP, cycles=cycles),
            columns=[water],
            floats=1,
            spread=same,
            store=tmp_path / f"{cycles}-{asked}.zarr",
            cycles=asked,
        )

    assert job(2000, 1).cost == []
    (said,) = job(1, 100).cost
    assert said.startswith("each float: 60.06 million samples in 100 cycles")
    with pytest.raises(NoAnswerError, match="more than the 1000 million flown"):
        job(1, 2000)


def test_rows_of_a_slow_board_are_a_tick_apart(watched, water):
    slow = watched.model_copy(
        update={"controller": watched.controller.model_copy(update={"sample_time": 30.0})}
    )
    found = fly_mission(slow, task(), water)
    assert found.plan.laws[0].sample_time == 30.0
    assert len(found.rows) < 3.0 * found.duration / 30.0
    assert np.all(np.diff(found.rows["t"]) >= 0.0)
