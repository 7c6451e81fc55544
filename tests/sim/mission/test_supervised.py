"""Missions by law and supervisor: `simulate`, which has its own oracle, is the oracle of these."""

import json
from pathlib import Path

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.control.supervisor import Reason
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.run import MOST, Floats
from swimbladder.sim.engine.rodas.records import Stop
from swimbladder.sim.mission import law_flight
from swimbladder.sim.mission.law_flight import ByLaws
from swimbladder.sim.mission.result import MissionResult
from swimbladder.vehicle import Supervisor
from swimbladder.vehicle.spread import Spread
from tests.quoted import refused
from tests.sim.mission.test_phase_laws import DIVE, FILES, flown, simulated, steps

SHALLOW = {"kind": "hold", "depth": 1.5, "tolerance": 1.2, "duration": 120.0}
DEEP = {"kind": "hold", "depth": 6.0, "tolerance": 1.2, "duration": 200.0}

ADRC_FIRST = [
    "adrc",
    *(pytest.param(n, marks=pytest.mark.prove) for n in ("cascade", "planned", "position-pid")),
]


def watched(name, **given):
    """Return the vehicle of a law with a table [supervisor], and 2 mm of noise."""
    vehicle = load_vehicle(str(FILES / f"law-{name}.toml"))
    sensors = vehicle.sensors.model_copy(update={"depth_noise": 0.002})
    return vehicle.model_copy(update={"sensors": sensors, "supervisor": Supervisor(**given)})


@pytest.mark.parametrize("name", ADRC_FIRST)
@pytest.mark.parametrize("seed", [None, 3])
def test_law_and_supervisor_fly_as_they_are_simulated(name, seed):
    vehicle, task = watched(name), steps(SHALLOW, DEEP)
    flight = flown(vehicle, task, seed=seed, checked=False)
    found, samples = simulated(vehicle, flight, seed=seed)
    assert found.supervised
    assert flight.stop is Stop.FINISHED
    np.testing.assert_allclose(flight.rows["z"], found.depth[samples], atol=1e-9)
    np.testing.assert_allclose(flight.rows["v"], found.volume[samples], atol=1e-13)
    alone = flown(vehicle, task, seed=seed, checked=False, supervised=False)
    n = min(len(alone.rows), len(flight.rows))
    assert np.abs(alone.rows["z"][:n] - flight.rows["z"][:n]).max() > 1e-3, "it proves its actuator"


@pytest.mark.prove
def test_a_vehicle_without_the_table_flies_its_law_alone():
    vehicle = load_vehicle("feup-em")
    alone, over = (
        flown(vehicle, steps(SHALLOW, DEEP), checked=False, **how)
        for how in ({}, {"supervised": True})
    )
    assert not alone.plan.supervised
    assert over.plan.supervised
    assert MissionResult(alone, alone.reach).to_dict()["supervised"] is False
    assert alone.rows.tobytes() != over.rows.tobytes()


@pytest.mark.parametrize("name", ADRC_FIRST)
def test_it_dives_again_and_again(name):
    """It bobs at the surface, under water for moments: the law does not take over there."""
    descend = {"kind": "descend", "depth": 8.0, "speed": 0.05, "tolerance": 1.0}
    task = Mission(cycles=3, phases=[descend, *DIVE[1:]])
    for supervised in (False, True):
        flight = flown(watched(name), task, seed=1, checked=False, supervised=supervised)
        found = MissionResult(flight, flight.reach)
        assert found.completed, found.reasons
        assert found.alarm is None
        np.testing.assert_allclose(np.diff(flight.cycles["t_end"]), 700.0, atol=60.0)


@pytest.mark.promise("time-limit")
def test_the_time_limit_counts_over_all_phases_and_brings_it_up():
    """Also where another law flies the second phase: it is one supervisor over both."""
    limit = 300.0
    vehicle = watched("cascade", time_limit=limit)
    slow = {**DEEP, "speed": 0.02, "duration": 60.0, "parameters": {"k_dz": "-3 dm3 s/m"}}
    flight = flown(vehicle, steps(SHALLOW, slow), seed=1, checked=False)
    found = MissionResult(flight, flight.reach)
    tick = vehicle.controller.sample_time
    assert flight.stop is Stop.ALARM
    assert not found.completed
    assert found.alarm.reason is Reason.TIME_LIMIT
    assert limit <= found.alarm.time <= limit + 2.0 * tick
    assert float(flight.rows["z"][-1]) < vehicle.hull.emergence_depth
    assert "time limit" in " ".join(found.reasons)


def test_a_depth_that_is_the_supervisors_limit_is_refused_before_it_is_flown():
    vehicle = watched("cascade", depth_limit=5.0)
    with refused(InputError, field="phases[1].depth", value=6.0, holds=[5.0]):
        flown(vehicle, steps(SHALLOW, DEEP))
    limit = supervisor_parameters(vehicle, 0.3).deep.depth_limit
    at_it = {**DEEP, "depth": limit - 1.0, "tolerance": 0.9}
    assert flown(vehicle, steps(SHALLOW, at_it), checked=False).stop is Stop.FINISHED
    assert flown(vehicle, steps(SHALLOW, DEEP), supervised=False).stop is Stop.FINISHED


@pytest.mark.parametrize(
    ("more", "least"),
    [({}, 320.0), ({"cycles": 2}, 640.0), ({"duration": 500.0}, 500.0)],
)
def test_a_mission_longer_than_the_time_limit_is_refused(more, least):
    with refused(InputError, field="supervisor.time_limit", value=least - 1.0, holds=[least]):
        flown(watched("cascade", time_limit=least - 1.0), steps(SHALLOW, DEEP, **more))


def test_a_supervisor_has_one_sample_time():
    other = {**DEEP, "sample_time": 0.5}
    with refused(InputError, field="phases[1].sample_time", value=0.5):
        flown(watched("cascade"), steps(SHALLOW, other))
    assert flown(watched("cascade"), steps(SHALLOW, other), supervised=False, checked=False)


def test_what_no_law_at_each_sample_flies_has_no_supervisor():
    by_rule = {**DEEP, "law": "rate"}
    assert not flown(watched("cascade"), steps(by_rule), checked=False).plan.supervised
    with refused(InputError, field="supervised"):
        flown(watched("cascade"), steps(by_rule), supervised=True)


def test_a_killed_flight_goes_on_under_its_supervisor(tmp_path, monkeypatch):
    vehicle, task = watched("cascade"), steps({**SHALLOW, "duration": 900.0}, DEEP)
    monkeypatch.setattr(ByLaws, "rows", 500)
    monkeypatch.setattr(law_flight, "_CHUNK", 700)

    def kill(_):
        if len(list(tmp_path.iterdir())) == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        flown(vehicle, task, seed=4, checked=False, keep=tmp_path, advance=kill)
    again = flown(vehicle, task, seed=4, checked=False, keep=tmp_path)
    whole = flown(vehicle, task, seed=4, checked=False)
    for name in ("rows", "notes", "end", "whole", "accounts"):
        assert getattr(again, name).tobytes() == getattr(whole, name).tobytes(), name


@pytest.mark.parametrize(("supervised", "stop"), [(None, Stop.ALARM), (False, Stop.FINISHED)])
def test_a_float_of_a_campaign_has_its_supervisor_too(tmp_path, supervised, stop):
    vehicle = watched("cascade", time_limit=330.0)
    task, sea = steps(SHALLOW, {**DEEP, "speed": 0.02}), uniform_column(vehicle.water, 50.0)
    same = Spread(trim=0.0, psi=0.0, drag=0.0, pump=0.0)
    job = Floats(
        vehicle=vehicle,
        mission=task,
        columns=[sea],
        floats=1,
        spread=same,
        store=tmp_path / "s.zarr",
        supervised=supervised,
    )
    job.create()
    job.do(0)
    noise = job.seed * MOST
    alone = flown(vehicle, task, column=sea, seed=noise, checked=False, supervised=supervised)
    row = job.layout.table()[0]
    assert alone.stop is stop
    assert row["stop"] == stop
    assert row["duration"] == alone.duration


def test_the_command_says_who_flies_and_that_it_was_brought_up(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    own = (FILES / "law-cascade.toml").read_text()
    Path("v.toml").write_text(own + '\n[supervisor]\ntime_limit = "2 min"\n')
    Path("m.toml").write_text(
        'schema_version = 1\nstart_depth = "2 m"\n[[phases]]\nkind = "hold"\ndepth = "6 m"\n'
        'speed = "2 cm/s"\ntolerance = "0.3 m"\nduration = "1 min"\n'
    )
    assert main(["mission", "v.toml", "m.toml", "--out", "o"]) == 1
    out = capsys.readouterr().out
    assert "law 'cascade' and supervisor fly all phases every 0.3 s" in out
    assert "the supervisor took over after 2 min: time limit" in out
    answer = json.loads(Path("o/mission.json").read_text())
    assert answer["supervised"] is True
    assert answer["alarm"]["reason"] == "time limit"
    assert answer["stop"] == "alarm"
    assert ",alarm," in Path("o/events.csv").read_text()
    assert main(["mission", "v.toml", "m.toml", "--out", "o", "--unsupervised"]) == 0
    assert "law 'cascade' alone flies all phases every 0.3 s" in capsys.readouterr().out
    answer = json.loads(Path("o/mission.json").read_text())
    assert answer["supervised"] is False
    assert answer["alarm"] is None
