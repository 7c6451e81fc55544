"""Missions against SciPy, against the paper's model, and against their own balance."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import swimbladder as sb
from swimbladder.io.mission import Mission
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import uniform_column
from swimbladder.physics.seawater.motion import Swell, WaterMotion, motion_table, moved
from swimbladder.sim.engine.rodas import step
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.engine.rodas.records import GIVEN, NOW, Account, Doing, Note, Stop, Table
from swimbladder.sim.mission.balance import close_balance
from swimbladder.sim.mission.core.hooks import fly
from swimbladder.sim.mission.flight import fly_mission, thinned
from swimbladder.sim.mission.prepare import first_state, make_plan
from swimbladder.sim.mission.result import MissionResult
from tests.quoted import numbers
from tests.sim.mission.conftest import phases
from tests.sim.mission.oracle import Oracle
from tests.vehicles import by_rule

TIGHT = Accuracy(
    relative=1e-9, depth=1e-9, speed=1e-11, volume=1e-15, rest_deep=1e-7, rest_afloat=1e-7
)


def times(flight, kind):
    return flight.notes[flight.notes["what"] == kind]["t"]


@pytest.fixture(scope="module")
def tight(profiler, sea):
    return fly_mission(profiler, phases(), sea, accuracy=TIGHT)


def test_a_dive_is_that_of_scipy_at_every_event(tight, profiler, sea):
    oracle = Oracle(profiler, sea)
    states = oracle.replay(tight)
    assert tight.stop is Stop.FINISHED
    assert len(states) > 40
    assert np.max(np.abs(states[:, 0] - tight.notes["z"])) < 1e-6
    assert np.max(np.abs(states[:, 2] - tight.notes["v"])) < 1e-12
    # the surface, crossed down and up, and each time it bobs
    crossed = np.sort(np.concatenate([times(tight, Note.EMERGED), times(tight, Note.SUBMERGED)]))
    count = min(len(crossed), len(oracle.crossings))
    assert count >= 2
    assert np.allclose(crossed[:count], oracle.crossings[:count], rtol=0.0, atol=1e-5)


def test_arrival_and_end_stop_stand_on_their_edges(tight, profiler):
    arrived = tight.notes[tight.notes["what"] == Note.ARRIVED]
    assert arrived["z"][0] == pytest.approx(145.0, abs=1e-9)  # 150 m less the tolerance
    assert arrived["z"][2] == pytest.approx(25.0, abs=1e-9)  # from below
    full = tight.notes[tight.notes["what"] == Note.UPPER_STOP]
    assert len(full) == 1
    assert full["v"][0] == profiler.stroke.maximum


def test_a_swell_carries_the_vehicle_as_scipy_says(profiler, sea):
    table = motion_table(
        WaterMotion(swell=(Swell(amplitude=1.5, period=9.0, phase=0.3),)), sea.gravity
    )
    task = Mission(start_depth=20.0, phases=[{"kind": "descend", "depth": 60.0, "tolerance": 2.0}])
    flown = fly_mission(profiler, task, sea, waves=table, accuracy=TIGHT)
    oracle = Oracle(profiler, sea, waves=lambda z, t: moved(table, z, t))
    states = oracle.replay(flown)
    assert np.max(np.abs(states[:, 0] - flown.notes["z"])) < 1e-6
    balance = close_balance(flown)
    assert balance.sinks["moving water"] != 0.0
    assert balance.relative_residue < 1e-6


def coast(
    vehicle,
    column,
    *,
    depth,
    volume,
    speed,
    seconds,
    accuracy=TIGHT,
    bottom=math.inf,
    step=None,
    celsius=None,
):
    """Let a vehicle go, with nobody looking; return state and accounts after `seconds`."""
    task = Mission(
        start_depth=depth,
        bottom_depth=None if math.isinf(bottom) else bottom,
        start_temperature=celsius,
        phases=[{"kind": "park", "depth": depth, "duration": seconds}],
    )
    plan = make_plan(vehicle, task, column, accuracy=accuracy)
    x, at, accounts = first_state(plan, task)
    if step is not None:
        plan.given["longest_step"] = x["h"] = step
    x["v"], x["w"], x["t_sample"], x["t_end"] = volume, speed, math.inf, seconds
    at["new_phase"], at["arrived"] = 0, 1
    fly(plan.under_way((x, at, accounts)))
    return x, at, accounts


def test_a_run_ends_at_its_volume_though_the_vehicle_emerges_in_the_same_step():
    """Rising while volume is drawn in: at 0.9 of a step it is in, at 0.8 to 1 the hull is out."""
    vehicle = sb.load_vehicle("example-em")
    column = uniform_column(vehicle.water, 30.0)
    task = Mission(start_depth=1.0, phases=[{"kind": "park", "depth": 10.0, "duration": 60.0}])
    loose = Accuracy(relative=1e9, depth=1e9, speed=1e9, volume=1e9)
    plan = make_plan(vehicle, task, column, accuracy=loose)
    rate = plan.table[0, Table.RATE_IN]
    emerged = 0
    for share in np.linspace(0.76, 0.99, 12):
        x, at, accounts = first_state(plan, task)
        x["z"], x["w"], x["h"] = 0.1 * share, -0.1, 1.0
        x["v_move"] = x["v"] - 0.9 * rate
        x["t_sample"], x["t_move"], x["t_end"] = 1.0, math.inf, 1.0
        at["new_phase"], at["doing"] = 0, Doing.LETTING_IN
        goal, begin = float(x["v_move"]), float(x["v"])
        flown = plan.under_way((x, at, accounts), notes=40)
        fly(flown)
        notes = flown.lane.notes[: flown.lane.counts[1]]
        kinds = notes["what"]
        emerged += int(Note.EMERGED in kinds)
        ended = notes[kinds == Note.RUN_OVER][0]
        assert ended["v"] == goal
        assert accounts[Account.LET_IN] == pytest.approx(begin - goal, rel=1e-9)
    assert emerged > 5


def test_the_order_is_four(profiler):
    """Slowing down in the paper's water, where all is smooth: errors fall as step^4."""
    column = uniform_column(profiler.water, 400.0)
    given = {"depth": 100.0, "volume": neutral_at(profiler, column, 100.0) - 20e-6, "speed": 0.2}
    right = coast(profiler, column, seconds=128.0, **given)[0]
    loose = Accuracy(relative=1e9, depth=1e9, speed=1e9, volume=1e9, rest_deep=0.0)

    def error(step):
        found = coast(profiler, column, seconds=128.0, accuracy=loose, step=step, **given)[0]
        return abs(found["z"] - right["z"])

    ratios = [error(step) / error(0.5 * step) for step in (4.0, 2.0)]
    assert all(12.0 < ratio < 22.0 for ratio in ratios), ratios


def neutral_at(vehicle, column, depth):
    return float(np.interp(depth, column.depth, neutral_volume(vehicle, column)))


def test_in_the_papers_water_it_is_the_papers_model():
    """Constant density, linear psi, a drive of constant rate: `drive` with the same volumes."""
    vehicle = by_rule("ntnu-bv")
    column = uniform_column(vehicle.water, 30.0)
    task = Mission(
        start_depth=1.0,
        phases=[
            {"kind": "descend", "depth": 3.0, "tolerance": 0.2, "speed": 0.05},
            {"kind": "hold", "depth": 3.0, "tolerance": 0.2, "speed": 0.05, "duration": 120.0},
            {"kind": "profile", "depth": 1.0, "tolerance": 0.2, "speed": 0.05},
        ],
    )
    flown = fly_mission(vehicle, task, column, accuracy=TIGHT)
    rows = flown.rows[np.concatenate(([True], np.diff(flown.rows["t"]) > 0.0))]
    assert np.ptp(rows["v"]) > 1e-6
    paper = sb.drive(
        vehicle,
        time=rows["t"],
        volume=rows["v"],
        start_depth=1.0,
    )
    assert np.max(np.abs(paper.depth - rows["z"])) < 1e-6


def test_a_step_of_no_length_leaves_the_battery_as_it_is():
    """Self-discharge over 0 s is nothing; so located steps may be."""
    x, accounts = np.zeros(1, NOW)[0], np.zeros(len(Account))
    given = np.zeros(1, GIVEN)[0]
    x["charge"], given["self_discharge"] = 5e6, 6e-10
    step.enter_energy(given, x, accounts, 0.0, 3.0, 0.0)
    assert x["charge"] == 5e6
    assert accounts[Account.SELF_DISCHARGED] == 0.0
    step.enter_energy(given, x, accounts, 0.0, 3.0, 100.0)
    assert x["charge"] == pytest.approx(5e6 - 300.0 - 5e6 * 6e-8, abs=1e-4)


def charged(x, power, s, *times):
    """Return the charge [J] after stretches of these times at a power [W]."""
    now, given = np.zeros(1, NOW)[0], np.zeros(1, GIVEN)[0]
    now["charge"], given["self_discharge"] = x, s
    for h in times:
        step.enter_energy(given, now, np.zeros(len(Account)), 0.0, power, h)
    return float(now["charge"])


@pytest.mark.parametrize(("power", "s"), [(0.5, 0.0), (0.5, 3e-9), (0.0, 1e-7), (12.0, 1e-6)])
def test_the_charge_is_that_of_its_differential_equation(power, s):
    solved = solve_ivp(lambda _, C: -power - s * C, (0.0, 3e6), [3.6e7], rtol=1e-11, atol=1e-3)
    assert charged(3.6e7, power, s, 3e6) == pytest.approx(solved.y[0, -1], rel=1e-8)


def test_two_stretches_are_one():
    together = charged(1e6, 2.0, 1e-7, 1e5)
    assert charged(1e6, 2.0, 1e-7, 4e4, 6e4) == pytest.approx(together, rel=1e-12)


def test_the_balance_closes_battery_included(profiler, sea):
    flown = fly_mission(profiler, phases(cycles=3), sea)
    balance = close_balance(flown)
    assert balance.relative_residue < 1e-4
    assert abs(balance.volume_residue) < 1e-15
    drawn = float(flown.begin["charge"] - flown.end["charge"])
    assert balance.drawn == pytest.approx(drawn, rel=1e-9)
    assert balance.drawn == pytest.approx(
        sum(balance.sinks.values()), abs=1e-4 * balance.throughput
    )
    assert {"pump", "valve", "processor", "satellite", "ctd"} <= set(balance.battery)
    # what drives it down and up is what drag takes: no other sink of motion is of that size
    assert balance.sinks["drag"] > 100.0 * abs(balance.sinks["oscillations at rest"])


def test_the_balance_closes_better_with_smaller_tolerances(profiler, sea, tight):
    loose = close_balance(fly_mission(profiler, phases(), sea)).relative_residue
    assert close_balance(tight).relative_residue < 1e-3 * loose


def test_a_parked_vehicle_costs_nothing(profiler, sea):
    steps = [
        int(fly_mission(profiler, phases(duration=days * 86400.0), sea).whole["steps"])
        for days in (2.0, 200.0)
    ]
    assert steps[1] - steps[0] <= 2


def test_drag_alone_stops_a_vehicle_as_the_formula_says(profiler):
    """Neutral everywhere and without linear drag, dw/dt = -k w|w|/m: it goes ln(1 + k w0 t/m)."""
    hull = profiler.hull.model_copy(update={"psi": 0.0, "parts": ()})
    vehicle = profiler.model_copy(update={"hull": hull})
    column = uniform_column(vehicle.water, 400.0)
    volume = neutral_at(vehicle, column, 100.0)
    x, _, accounts = coast(vehicle, column, depth=100.0, volume=volume, speed=0.2, seconds=600.0)
    k, m = vehicle.drag.k_dt, vehicle.mass
    way = m / k * math.log1p(k * 0.2 * 600.0 / m)
    assert x["z"] - 100.0 == pytest.approx(way, rel=1e-7)
    assert accounts[Account.DRAG] == pytest.approx(0.5 * m * (0.2**2 - x["w"] ** 2), rel=1e-7)


def test_the_same_seed_is_the_same_flight(profiler, sea):
    sensors = profiler.sensors.model_copy(update={"depth_noise": 0.05, "depth_quantum": 0.02})
    noisy = profiler.model_copy(update={"sensors": sensors})
    ends = [fly_mission(noisy, phases(), sea, seed=seed).end for seed in (1, 1, 2)]
    assert ends[0].tobytes() == ends[1].tobytes()
    assert ends[0].tobytes() != ends[2].tobytes()


def test_the_bottom_takes_the_speed_at_the_instant_that_scipy_says(profiler, sea):
    volume = neutral_at(profiler, sea, 100.0) - 30e-6
    x, at, accounts = coast(
        profiler, sea, depth=100.0, volume=volume, speed=0.1, seconds=900.0, bottom=120.0
    )
    oracle = Oracle(profiler, sea)
    found = solve_ivp(
        oracle.rhs("nothing"),
        (0.0, 900.0),
        [100.0, 0.1, volume * 1e6, 9.0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        events=_lands,
    )
    w = float(found.y_events[0][0, 1])
    assert at["place"] == 2
    assert (x["z"], x["w"]) == (120.0, 0.0)
    assert accounts[Account.IMPACTS] == pytest.approx(0.5 * profiler.mass * w**2, rel=1e-6)


def _lands(_, y):
    return y[0] - 120.0


_lands.terminal = True


def test_it_pumps_itself_off_the_bottom(profiler, sea):
    """Its target is 20 m above the bottom, where it falls in haste."""
    task = phases(deep=180.0, tolerance=4.0, bottom_depth=185.0)
    stages = [phase.model_dump(exclude_none=True) for phase in task.phases]
    stages[0]["speed"] = 1.0
    flown = fly_mission(profiler, Mission(phases=stages, bottom_depth=185.0), sea, checked=False)
    assert len(times(flown, Note.BOTTOM)) >= 1
    assert len(times(flown, Note.LEFT_BOTTOM)) >= 1
    assert np.max(flown.rows["z"]) == 185.0
    assert flown.stop is Stop.FINISHED
    assert close_balance(flown).relative_residue < 1e-4


def test_below_its_depth_it_presses_all_out_and_comes_up(profiler, sea):
    task = phases(deep=150.0, safety={"deepest": 151.0})
    fast = [{**phase.model_dump(exclude_none=True), "speed": 0.5} for phase in task.phases]
    flown = fly_mission(
        profiler, Mission(phases=fast, safety={"deepest": 151.0}), sea, checked=False
    )
    assert flown.stop is Stop.PASSED_DEPTH
    assert len(times(flown, Note.TOO_DEEP)) == 1
    assert flown.end["v"] == pytest.approx(profiler.stroke.maximum, rel=1e-3)
    assert flown.end["z"] < profiler.hull.emergence_depth + 1e-9


def test_only_a_cast_has_an_end_below_which_its_water_is_not_known(profiler, sea):
    flown = fly_mission(profiler, phases(deep=150.0), sea)
    short = uniform_column(profiler.water, 100.0)
    unknown = "where the water is not known: below 100 m"
    for cast, said in ((None, False), (object(), True)):
        column = replace(short, cast=cast)
        reasons = MissionResult(replace(flown, column=column), None).reasons
        assert any(unknown in reason for reason in reasons) == said


def test_the_battery_ends_the_mission_at_its_reserve(profiler, sea):
    task = phases()
    one = close_balance(fly_mission(profiler, task, sea)).drawn
    supply = profiler.supply.model_copy(
        update={"capacity": 5.0 * one, "cold_share": 1.0, "self_discharge": 0.0}
    )
    vehicle = profiler.model_copy(update={"supply": supply})
    flown = fly_mission(vehicle, task, sea, cycles=100)
    assert flown.stop is Stop.RESERVE
    # a tenth is kept back: 4.5 cycles' worth, the fifth is the one that reaches into it
    assert flown.whole["cycle"] == 5


def test_a_vehicle_that_came_down_on_the_bottom_is_said_to(profiler, sea):
    """A park that lies on the bottom is within its tolerance; the answer says why."""
    # in steps of 1 cm3 it comes some decimetres below the depth that was asked for
    parameters = profiler.controller.parameters | {"volume_step": 1e-6}
    controller = profiler.controller.model_copy(update={"parameters": parameters})
    vehicle = profiler.model_copy(update={"controller": controller})
    result = MissionResult(fly_mission(vehicle, phases(bottom_depth=150.5), sea), None)
    assert "it came down on the bottom at 150.5 m 1 time" in result.reasons
    clear = MissionResult(fly_mission(vehicle, phases(bottom_depth=300.0), sea), None)
    assert not any("bottom" in reason for reason in clear.reasons)


def test_an_empty_battery_loses_the_vehicle(profiler, sea):
    one = close_balance(fly_mission(profiler, phases(), sea)).drawn
    supply = profiler.supply.model_copy(update={"capacity": 0.5 * one})
    flown = fly_mission(profiler.model_copy(update={"supply": supply}), phases(), sea)
    assert flown.stop is Stop.BATTERY_EMPTY
    result = MissionResult(flown, None)
    assert result.battery_cycles == 0
    # what it says is short is power over rate at that depth, for all that is not out
    found = re.fullmatch(
        r".*'(\w+)' of cycle 1\D* ([\d.]+) m\D* ([\d.e+]+) J\D* ([\d.]+) cm3\D*", result.reasons[1]
    )
    assert found is not None
    z, v = flown.rows["z"][-1], flown.rows["v"][-1]
    drive = drive_map(profiler, np.interp(z, sea.depth, sea.pressure))
    inside = profiler.stroke.maximum - v
    assert found[1] == Mission(phases=phases().phases).titles[int(flown.rows["phase"][-1])]
    assert float(found[2]) == pytest.approx(z, abs=0.051)
    assert float(found[3]) == pytest.approx(
        inside * drive.power_out[0] / drive.rate_out[0], rel=6e-3
    )
    assert float(found[4]) == pytest.approx(1e6 * inside, rel=6e-4)


def test_a_phase_out_of_time_is_told_and_the_next_begins(profiler, sea):
    task = phases()
    slow = [phase.model_dump(exclude_none=True) for phase in task.phases]
    slow[0]["timeout"] = 600.0
    flown = fly_mission(profiler, Mission(phases=slow), sea, checked=False)
    assert int(flown.cycles["missed"][0]) & 1
    assert times(flown, Note.OUT_OF_TIME)[0] == 600.0
    # the profile arrives at its 20 m, from the other side: that is no arrival at 150 m
    assert len(times(flown, Note.ARRIVED)) >= 2
    assert math.isnan(flown.cycles["arrival"][0])
    assert flown.stop is Stop.FINISHED
    reached = np.interp(600.0, flown.rows["t"], flown.rows["z"])
    said = numbers(MissionResult(flown, None).reasons[1])
    assert {round(reached, 1), round(145.0 - reached, 1), 5.0} <= said  # m


def test_a_surface_that_is_not_reached_says_how_deep_it_is(profiler, sea):
    late = [phase.model_dump(exclude_none=True) for phase in phases().phases]
    late[-1]["timeout"] = 60.0
    flown = fly_mission(profiler, Mission(phases=late), sea, checked=False)
    assert flown.stop is Stop.DID_NOT_SURFACE
    z, v = flown.rows["z"][-1], flown.rows["v"][-1]
    lacking = 1e6 * (profiler.stroke.maximum - v)
    said = numbers(MissionResult(flown, None).reasons[1])
    assert {float(f"{z:.1f}"), float(f"{lacking:.3g}")} <= said  # m, cm3


def test_of_two_phases_of_a_name_each_is_told(profiler, sea):
    """The first of two is out of time, the second is not."""
    twice = [phase.model_dump(exclude_none=True) for phase in phases().phases]
    twice = [twice[0] | {"timeout": 600.0}, twice[0] | {"depth": 55.0}, twice[-1]]
    result = MissionResult(fly_mission(profiler, Mission(phases=twice), sea, checked=False), None)
    assert result.missed == {"descend (1)": 1}
    assert not result.completed


def test_a_hold_lasts_from_its_arrival(profiler, sea):
    task = Mission(
        start_depth=30.0,
        phases=[{"kind": "hold", "depth": 100.0, "tolerance": 5.0, "duration": 3000.0}],
    )
    flown = fly_mission(profiler, task, sea)
    assert flown.duration - times(flown, Note.ARRIVED)[0] == pytest.approx(3000.0, abs=1e-6)


def test_every_run_keeps_the_longest_and_its_quantum(profiler, sea):
    actuator = profiler.actuator.model_copy(update={"longest_run": 20.0, "quantum": 0.5})
    flown = fly_mission(profiler.model_copy(update={"actuator": actuator}), phases(), sea)
    over = flown.notes[flown.notes["what"] == Note.RUN_OVER]["number"]
    begun = flown.notes[np.isin(flown.notes["what"], [Note.PUMP, Note.VALVE, Note.BYPASS])]
    assert np.all(over <= 20.0 + 1e-9)
    controlled = begun["z"][: len(over)] > 5.0  # those that fill the bladder end when it is full
    pumped = over[controlled & (begun["what"][: len(over)] == Note.PUMP)]
    assert np.allclose(pumped / 0.5, np.round(pumped / 0.5), atol=1e-6)
    # so are the runs that let in, from the first one on, which dives
    let = over[np.isin(begun["what"][: len(over)], [Note.VALVE, Note.BYPASS])]
    assert begun["what"][0] == Note.BYPASS
    assert np.allclose(let / 0.5, np.round(let / 0.5), atol=1e-6)
    assert Doing.PUMPING in flown.rows["doing"]


def test_rows_are_thinned_between_what_happens(profiler, sea):
    rows = fly_mission(profiler, phases(), sea).rows
    few = thinned(rows, 120.0)
    assert len(few) < 0.5 * len(rows)
    state = rows[["phase", "doing", "cycle"]]
    changes = np.flatnonzero(state[1:] != state[:-1])
    kept = set(few["t"])
    assert {rows["t"][k] for k in changes} <= kept
    assert {rows["t"][k + 1] for k in changes} <= kept
    assert np.array_equal(few[[0, -1]], rows[[0, -1]])
    assert np.max(np.diff(few["t"])) <= 240.0 + np.max(np.diff(rows["t"]))
    assert np.array_equal(thinned(rows, 0.0), rows)


def test_nothing_discharges_by_itself_where_nothing_is_known_of_it(profiler, sea):
    supply = profiler.supply.model_copy(update={"capacity": None})
    flown = fly_mission(profiler.model_copy(update={"supply": supply}), phases(), sea)
    assert flown.accounts[Account.SELF_DISCHARGED] == 0.0
    assert "self-discharge" not in close_balance(flown).battery


def test_no_run_is_longer_than_the_pump_stands(profiler, sea):
    actuator = profiler.actuator.model_copy(update={"longest_run": 60.0})
    flown = fly_mission(profiler.model_copy(update={"actuator": actuator}), phases(), sea)
    assert flown.stop is Stop.FINISHED
    over = flown.notes[flown.notes["what"] == Note.RUN_OVER]["number"]
    assert np.max(over) <= 60.0 + 1e-6
    assert flown.end["v"] == pytest.approx(profiler.stroke.maximum, rel=1e-3)
