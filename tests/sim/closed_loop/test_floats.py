"""Floats with pump and valve in the closed loop: against SciPy, missions and their balances."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from swimbladder.control.cascade import CASCADE
from swimbladder.control.law import Measurement
from swimbladder.control.rate import RATE
from swimbladder.control.registry import bind
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.closed_loop.block import Block
from swimbladder.sim.closed_loop.ensemble import simulate_ensemble
from swimbladder.sim.closed_loop.floats import FloatModel
from swimbladder.sim.closed_loop.pumped import BEGIN, END, run_for
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import NOTE, Account, Doing, Note
from swimbladder.sim.mission.flight import fly_mission
from tests.cf import cf_problems
from tests.quoted import refused
from tests.sim.engine.test_rodas_motion import lane_of

FLOAT = load_vehicle("example-float")
TIGHT = Accuracy(relative=1e-8, depth=1e-7, speed=1e-9, volume=1e-14)


@pytest.fixture(scope="module")
def dive():
    """From afloat to 300 m and back."""
    return simulate(
        FLOAT, setpoints=[(0.0, 300.0), (7200.0, 0.0)], duration=12600.0, start_depth=0.0
    )


@pytest.fixture(scope="module")
def hover():
    """From rest at 380 m to 420 m and back to 400 m, off the surface all the way."""
    return simulate(
        FLOAT, setpoints=[(0.0, 420.0), (2400.0, 400.0)], duration=4800.0, start_depth=380.0
    )


def flown_by_scipy(solution):
    """Return the depths of the recorded commands: seconds of pump and valve, written out anew."""
    v, a = FLOAT, FLOAT.actuator
    grid = np.arange(300.0, 500.0, 0.5)
    weight = v.water.specific_weight
    drives = drive_map(v, weight * grid)
    rests = CubicSpline(grid, neutral_volume(v, uniform_column(v.water, 500.0, step=0.5))[600:1000])
    rate_out, rate_in = CubicSpline(grid, drives.rate_out), CubicSpline(grid, drives.rate_in)
    leakage, k = CubicSpline(grid, drives.leakage), v.drag.k_dt

    def force(_t, x, move):
        z, w, V = x
        rate = {1: rate_out(z), 0: 0.0, -1: -rate_in(z), 2: -leakage(z)}[move]
        return [w, (weight * (rests(z) - V) - k * w * abs(w)) / v.mass, rate]

    turns, ends = [(0.0, 2)], solution.time[-1]
    for t, z, change in zip(solution.time, solution.depth, solution.command, strict=True):
        if change == 0.0:
            continue
        flow = float(rate_out(z) if change > 0.0 else rate_in(z))
        short = a.start_volume if change > 0.0 else 0.0
        length = a.quantum * math.floor((abs(change) + short) / flow / a.quantum + 0.5)
        primed = t + short / flow
        turns += [(t, 0), (primed, 1)] if change > 0.0 else [(t, -1)]
        turns.append((t + length, 2))
    x, depth = np.array([solution.depth[0], 0.0, solution.volume[0]]), np.empty(0)
    for (t, move), (end, _) in zip(turns, [*turns[1:], (ends, 0)], strict=True):
        if end <= t:
            continue
        inside = solution.time[(solution.time >= t) & (solution.time < end)]
        found = solve_ivp(
            force,
            (t, end),
            x,
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            args=(move,),
            dense_output=True,
        )
        if len(inside):
            depth = np.concatenate((depth, found.sol(inside)[0]))
        x = found.y[:, -1]
    return np.append(depth, x[0])


def test_depths_are_those_of_scipy_for_the_seconds_of_pump_and_valve(hover):
    assert np.count_nonzero(hover.command > 0.0) >= 2
    assert np.count_nonzero(hover.command < 0.0) >= 1
    expected = flown_by_scipy(hover)
    assert np.abs(hover.depth - expected).max() < 6e-6  # of steps that may err by 1e-5 each


def test_the_law_is_called_when_it_asked_to_be(hover):
    """The law itself, from the recorded depths, gives the recorded commands and no others."""
    numbers = bind(FLOAT.controller)[1]
    state, due = None, 0.0
    for k, t in enumerate(hover.time):
        now = Measurement(float(t), float(hover.depth[k]), float(hover.volume[k]))
        reference = float(hover.reference[k])
        if state is None:
            state = RATE.initial(numbers, now, reference)
        change = 0.0
        if t >= due:
            change, state, pause = RATE.step(numbers, state, now, reference)
            due = t + pause
        assert hover.command[k] == pytest.approx(change, abs=1e-15)


def test_a_float_whose_law_sleeps_takes_steps_over_many_ticks(monkeypatch):
    """Up to its next look: of 1 s, as its ticks, they would be many times as many."""
    kept, lanes = [], FloatModel.lanes

    def noted(self, *given, **named):
        stepper, start = lanes(self, *given, **named)
        kept.append(stepper)
        return stepper, start

    monkeypatch.setattr(FloatModel, "lanes", noted)
    simulate(
        FLOAT,
        setpoints=[(0.0, 400.0)],
        duration=50.0,
        start_depth=400.0,
        start_volume=FLOAT.neutral_volume(400.0) - 1e-6,
    )
    (stepper,) = kept
    assert stepper.segment[0, END] - stepper.segment[0, BEGIN] > 2.0


def test_volume_and_energy_add_up(dive, hover):
    for s in (dive, hover):
        balance = s.balance
        assert abs(balance.volume_residue) < 1e-12
        assert balance.relative_energy_residue < 1e-5
        assert balance.energy["source"] > 0.0
        assert s.volume[-1] - s.volume[0] == pytest.approx(balance.volume["change"], abs=1e-15)
    spent = float(np.sum(0.5 * (dive.power[1:] + dive.power[:-1]) * np.diff(dive.time)))
    assert spent == pytest.approx(dive.balance.energy["source"], rel=0.05)


def test_the_record_says_what_pump_and_valve_do(hover):
    assert set(hover.drive[hover.command > 0.0]) <= {1.0, 4.0}
    assert set(hover.drive[hover.command < 0.0]) == {2.0}
    assert np.all(hover.motor_rate[hover.drive == 2.0] < 0.0)
    assert np.all(hover.motor_rate[hover.drive == 1.0] > 0.0)
    assert np.all(hover.power[hover.drive != 0.0] > 0.0)
    assert np.all(np.isnan(hover.voltage))
    data = hover.dataset()
    assert data["drive"].attrs["flag_meanings"].split()[2] == "valve"
    assert "voltage" not in data


def test_no_event_of_a_float_is_left_out(dive):
    assert dive.events
    assert dive.events_omitted == 0


def test_it_dives_and_surfaces(dive):
    before = dive.time <= 7200.0
    assert abs(dive.depth[before][-1] - 300.0) < 10.0  # the tolerance of its law
    kinds = [event.kind for event in dive.events]
    assert "submerged" in kinds
    assert "reached the upper end stop" in kinds
    assert dive.finished
    # afloat: what is above the water weighs what the volume lifts beyond the neutral one
    hull, excess = FLOAT.hull, dive.volume[-1] - FLOAT.neutral_volume(dive.depth[-1])
    assert excess == pytest.approx(FLOAT.stroke.maximum, rel=1e-3)
    rests = hull.emergence_depth - excess / hull.waterplane_area
    assert dive.depth[-1] == pytest.approx(rests, abs=2e-3)  # it bobs by less
    assert abs(dive.speed[-1]) < 1e-3


def changed_drive(**numbers):
    return FLOAT.model_copy(update={"actuator": FLOAT.actuator.model_copy(update=numbers)})


@pytest.mark.parametrize("longest", [FLOAT.actuator.longest_run, None])
def test_a_float_that_came_up_with_all_volume_out_dives_again(longest):
    """Its pump ran to the end stop, for as long as that took; its processor looks again after."""
    vehicle = changed_drive(longest_run=longest)
    s = simulate(vehicle, setpoints=[(0.0, 0.0), (2400.0, 60.0)], duration=4200.0, start_depth=20.0)
    up = s.time <= 2400.0
    assert s.depth[up][-1] < 0.2
    assert s.volume[up][-1] == pytest.approx(FLOAT.stroke.maximum, rel=1e-3)
    assert abs(s.depth[-1] - 60.0) < 10.0  # the tolerance of its law


def test_a_float_that_leaks_afloat_sinks_each_second_by_what_its_volume_lost():
    """dz = -dV/A of its waterplane, at rest, where steps are as long as its processor sleeps."""
    s = simulate(
        changed_drive(leakage=1e-12), setpoints=[(0.0, 0.0)], duration=300.0, start_depth=0.0
    )
    rests = (s.drive[:-1] == 0.0) & (s.drive[1:] == 0.0)
    rests[0] = False  # it settles in its first second
    lost, sunk = -np.diff(s.volume)[rests], np.diff(s.depth)[rests]
    assert np.count_nonzero(lost > 0.0) > 100
    assert sunk == pytest.approx(lost / FLOAT.hull.waterplane_area, rel=1e-4, abs=1e-12)


def test_a_mission_of_the_same_phases_flies_the_same_way(dive):
    mission = Mission(
        phases=[{"kind": "hold", "depth": 300.0, "duration": 3600.0, "timeout": 5000.0}]
    )
    column = uniform_column(FLOAT.water, 460.0)
    flight = fly_mission(FLOAT, mission, column, accuracy=TIGHT)
    rows = flight.rows[(flight.rows["t"] > 0.0) & (flight.rows["t"] <= 7200.0)]
    assert len(rows) > 100
    assert rows["t"][-1] > 6000.0
    for column_, values, tolerance in (("z", dive.depth, 2e-3), ("v", dive.volume, 1e-9)):
        whole = rows[np.isclose(rows["t"] % 1.0, 0.0, atol=1e-9)]
        assert len(whole) > 50
        at = whole["t"].round().astype(int)
        assert np.abs(values[at] - whole[column_]).max() < tolerance


def test_lanes_are_single_runs_and_what_they_vary_counts():
    flown = {
        "setpoints": [(0.0, 420.0)],
        "duration": 2400.0,
        "start_depth": 380.0,
        "keep": "trajectory",
    }
    two = simulate_ensemble(FLOAT, count=2, vary={"d_t": [0.3893, 0.6]}, balance=True, **flown)
    drag = FLOAT.drag.model_copy(update={"k_dt": 0.6 * FLOAT.mass})
    slow = FLOAT.model_copy(update={"motion": FLOAT.motion.model_copy(update={"drag": drag})})
    flown.pop("keep")
    one = simulate(slow, **flown)
    assert np.abs(two["depth"].to_numpy()[:, 1] - one.depth).max() < 1e-9
    assert float(two["energy"][1]) == pytest.approx(one.balance.energy["source"], rel=1e-12)
    assert abs(float(two["final_depth"][0] - two["final_depth"][1])) > 0.1
    assert list(two["stop"]) == [0, 0]


def test_a_neutral_volume_that_drifts_is_followed():
    ticks = 2401
    drift = np.zeros((ticks, 1))
    drift[600:] = 2e-5  # 20 cm3 heavier
    flown = {"setpoints": [(0.0, 400.0)], "duration": 2400.0, "start_depth": 400.0}
    found = simulate_ensemble(FLOAT, count=1, neutral_change=drift, keep="trajectory", **flown)
    assert cf_problems(found.transpose("lane", ...)) == []
    assert found.command.attrs["units"] == "m3"
    depth = found["depth"].to_numpy()[:, 0]
    assert np.abs(depth[:600] - 400.0).max() < 1.0
    assert depth[600:].max() > 405.0
    assert float(found["pump_runs"][0]) >= 1.0


def test_noise_is_drawn_from_the_seed():
    noisy = FLOAT.model_copy(
        update={"sensors": FLOAT.sensors.model_copy(update={"depth_noise": 0.3})}
    )
    flown = {"setpoints": [(0.0, 400.0)], "duration": 1800.0, "start_depth": 380.0}
    runs = [simulate(noisy, seed=seed, **flown).depth for seed in (1, 1, 2)]
    assert np.array_equal(runs[0], runs[1])
    assert np.abs(runs[0] - runs[2]).max() > 1e-3


def test_a_float_that_hits_the_bottom_lies_there_and_comes_up_again():
    s = simulate(
        FLOAT,
        setpoints=[(0.0, 400.0), (3000.0, 300.0)],
        duration=6000.0,
        start_depth=380.0,
        start_volume=-5e-5,
        bottom_depth=400.0,
    )
    assert s.deepest <= 400.0 + 1e-9
    kinds = [event.kind for event in s.events]
    assert kinds.index("reached the bottom") < kinds.index("left the bottom")
    came, left = (s.events[kinds.index(f"{what} the bottom")].time for what in ("reached", "left"))
    lies = (s.time > came) & (s.time < left)
    assert np.count_nonzero(lies) > 10
    assert np.all(s.speed[lies] == 0.0)
    assert np.all(s.depth[lies] == 400.0)
    assert s.balance.energy["bottom"] > 0.0
    assert s.balance.relative_energy_residue < 1e-5
    assert s.depth[-1] < 330.0


def test_a_python_function_commands_changes_of_volume():
    def once(_seen, _reference):
        return -1e-5, 600.0

    s = simulate(
        FLOAT,
        law=once,
        setpoints=[(0.0, 400.0)],
        duration=1500.0,
        start_depth=380.0,
        sample_time=1.0,
    )
    asked = s.time[s.command != 0.0]
    assert list(asked) == [0.0, 600.0, 1200.0]
    assert s.balance.volume["let in"] == pytest.approx(3e-5, rel=1e-3)


def test_a_start_at_the_surface_with_a_volume_is_taken_as_it_is():
    s = simulate(
        FLOAT, setpoints=[(0.0, 100.0)], duration=60.0, start_depth=0.0, start_volume=-1e-4
    )
    assert s.volume[0] == -1e-4
    assert s.depth[0] == pytest.approx(0.0, abs=1e-8)
    assert s.depth[-1] > 1.0  # too heavy to float


def test_what_cannot_be_flown_is_refused():
    flown = {"duration": 100.0, "start_depth": 0.0}
    with refused(InputError, field="setpoints[0].depth", value=2500.0, holds=[2000.0]):
        simulate(FLOAT, setpoints=[(0.0, 2500.0)], **flown)
    parameters = CASCADE.parameters(*[1.0] * len(CASCADE.parameters._fields))
    with refused(InputError, field="controller.law", value="cascade"):
        simulate(
            FLOAT,
            setpoints=[(0.0, 100.0)],
            law=CASCADE,
            parameters=parameters,
            sample_time=1.0,
            **flown,
        )
    with refused(InputError, field="parts", value=4):
        simulate(FLOAT, setpoints=[(0.0, 100.0)], parts=4, **flown)
    with refused(InputError, field="vary['T1']", value="T1"):
        simulate_ensemble(FLOAT, count=1, setpoints=[(0.0, 100.0)], vary={"T1": 1.0}, **flown)


def test_seconds_of_another_drive_or_of_none_end_a_run_and_more_of_the_same_go_on_with_it():
    """Half a tick of the pump, more of it, then the valve and then nothing, in the same instant."""
    lane = lane_of(FLOAT, np.zeros((0, 6)))._replace(notes=np.zeros(9, NOTE))
    lane.x["t"] = 5.0
    run = [(0.5, Doing.PRIMING), (0.3, Doing.PRIMING), (-0.4, Doing.LETTING_IN)]
    for length, doing in run:
        run_for(lane, length, 0.0, 1.0)
        assert lane.at["doing"] == doing
        assert lane.x["t_move"] == pytest.approx(5.0 + abs(length))
    run_for(lane, 0.0, 0.0, 1.0)
    assert lane.at["doing"] == Doing.NOTHING
    said = lane.notes["what"][: lane.counts[1]].tolist()
    assert said == [Note.PUMP, Note.RUN_OVER, Note.VALVE, Note.RUN_OVER]
    assert lane.accounts[[Account.PUMP_RUNS, Account.VALVE_RUNS]].tolist() == [1.0, 1.0]


def test_where_no_trajectory_is_kept_none_is_written(monkeypatch):
    """Nor behind what would be its end: the room there stays as it was."""
    room, lay_out = np.full((7, 400, 1), np.nan), Block.__post_init__

    def laid_out(block):
        lay_out(block)
        assert block.record.shape == (7, 0, 1)
        block.record = room[:, :0]

    monkeypatch.setattr(Block, "__post_init__", laid_out)
    flown = {"setpoints": [(0.0, 420.0)], "duration": 300.0, "start_depth": 380.0}
    found = simulate_ensemble(FLOAT, count=1, workers=1, **flown)
    assert float(found["final_depth"][0]) > 380.5
    assert np.all(np.isnan(room))


def test_lanes_that_are_to_dive_with_a_hull_under_pressure_are_refused():
    """Afloat nothing comes in; deep down the sea presses it in."""
    tight = changed_drive(internal_pressure=1.2e5)
    flown = {"count": 1, "duration": 60.0}
    for start, to in ((0.0, [(0.0, 50.0)]), (30.0, [(0.0, 0.0), (30.0, 50.0)])):
        with pytest.raises(NoAnswerError, match="internal_pressure"):
            simulate_ensemble(tight, setpoints=to, start_depth=start, **flown)
    for start, to in ((30.0, [(0.0, 50.0)]), (30.0, [(0.0, 50.0), (30.0, 0.0)])):
        assert list(simulate_ensemble(tight, setpoints=to, start_depth=start, **flown)["stop"]) == [
            0
        ]
