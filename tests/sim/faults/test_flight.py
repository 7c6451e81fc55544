"""A flight in which things fail: against `simulate`, SciPy and what each fault is said to do."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import solve_ivp

import swimbladder as sb
from swimbladder.codegen.twin import ControllerTwin, twin
from swimbladder.control.supervisor import Reason
from swimbladder.control.supervisor_limits import command_limits, supervisor_parameters
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.lane import N_PLANT, Row
from swimbladder.sim.closed_loop.single import choose_law
from swimbladder.sim.faults.draw import RESULT, Result
from swimbladder.sim.faults.flight import EARLY, FULL, OWN, _hand_on
from swimbladder.sim.faults.kinds import (
    NOTHING_KEPT,
    On,
    _held,
    act,
    acted,
    changes,
    flip,
    see_depth,
)
from tests.sim.faults.oracle import Fault

ALWAYS = math.inf
FILES = Path(__file__).parents[2] / "frozen" / "inputs"


@pytest.mark.parametrize(
    ("name", "depth", "target", "depths"),
    [("feup-em", 1.5, 3.0, None), ("ntnu-bv", 0.5, 1.2, (1.0, 1.5))],
)
def test_a_mission_without_faults_is_that_of_simulate_with_the_twin(
    rig_of, name, depth, target, depths
):
    rig, n = rig_of(name, depths), 1500
    vehicle = rig.vehicle
    law, parameters, tick = choose_law(vehicle, None, None, None)
    low, high = command_limits(vehicle)
    first = 0.0 if law.command == "voltage" else vehicle.stroke.maximum
    board = ControllerTwin(twin(law), parameters, tick_s=tick, limits=(low, high), first=first)
    solution = sb.simulate(
        vehicle,
        law=lambda seen, asked: float(board.tick(seen.depth, seen.volume, asked)),
        sample_time=tick,
        setpoints=[(0.0, target)],
        duration=n * tick,
        start_depth=depth,
        parts=1,
    )
    _, flown = rig.fly(depth=depth, target=target, ticks=n)
    if name == "feup-em":  # the same kernel, the same step
        assert np.abs(solution.depth - flown["depth"]).max() < 1e-12
        assert np.array_equal(solution.command, flown["command"])
    else:  # its drag asks for the same steps from both
        assert np.abs(solution.depth - flown["depth"]).max() < 1e-6
        assert np.abs(solution.volume - flown["volume"]).max() < 1e-9


def test_a_stalled_piston_leaves_the_glide_of_the_hull(rig):
    p, z0 = plant(rig.vehicle), 20.0
    V = rig.vehicle.neutral_volume(z0) + 20e-6
    _, flown = rig.fly((Fault.STALLED, 0, 0, 0, ALWAYS), depth=z0, volume=V, ticks=300)
    time = rig.tick * np.arange(301)
    glide = solve_ivp(
        lambda _, x: [x[1], p.a_b * (p.psi * x[0] + p.V_0 - V) - p.d_l * x[1]],
        (0.0, time[-1]),
        [z0, 0.0],
        t_eval=time,
        rtol=1e-11,
        atol=1e-12,
    )
    under = glide.y[0] > 0.5
    assert under.sum() > 100
    assert np.abs(flown["depth"][:301][under] - glide.y[0][under]).max() < 1e-7
    assert np.ptp(flown["volume"]) < 1e-15


def test_water_that_leaks_in_is_a_volume_that_is_lost(rig):
    rate, z0, begin = 1e-6, 20.0, 20
    p, V = plant(rig.vehicle), rig.vehicle.neutral_volume(z0)
    fault_rows = ((Fault.STALLED, 0, 0, 0, ALWAYS), (Fault.LEAK_LARGE, rate, 0, begin, ALWAYS))
    _, flown = rig.fly(*fault_rows, depth=z0, ticks=200)
    k = np.arange(201)
    assert flown["water"] == pytest.approx(rate * rig.tick * np.maximum(k - begin, 0), abs=1e-18)
    x, depths = [z0, 0.0], [z0]
    for water in flown["water"][:-1]:
        step = solve_ivp(
            lambda _, y, w=water: [
                y[1],
                p.a_b * (p.psi * y[0] + p.V_0 + w - V) - p.d_l * y[1],
            ],
            (0.0, rig.tick),
            x,
            rtol=1e-10,
            atol=1e-12,
        )
        x = step.y[:, -1]
        depths.append(x[0])
    assert depths[-1] > z0 + 1.0
    assert np.abs(flown["depth"] - depths).max() < 1e-7


def test_the_law_pumps_out_what_leaks_in(rig):
    rate = 5e-6 / 60.0
    _, flown = rig.fly((Fault.LEAK_SMALL, rate, 0, 0, ALWAYS), ticks=4000)
    late = slice(2000, None)
    volume = flown["volume"] - flown["water"]
    neutral = rig.vehicle.neutral_volume(20.0) + rig.vehicle.hull.psi * (flown["depth"] - 20.0)
    assert np.mean((volume - neutral)[late]) == pytest.approx(0.0, abs=2e-6)
    assert flown["water"][-1] == pytest.approx(rate * 4000 * rig.tick, rel=1e-9)


def test_what_the_depth_sensor_says(rig):
    def seen(fault, first, second=0, begin=50):
        _, flown = rig.fly((fault, first, second, begin, ALWAYS), target=21.0, ticks=200)
        return flown["depth_seen"], flown["depth"], flown["depth_age"], np.arange(201)

    said, true, _, k = seen(Fault.DEPTH_NAN, 0)
    assert np.array_equal(np.isnan(said), k >= 50)
    said, true, age, _ = seen(Fault.DEPTH_STUCK, 0)
    assert set(said[50:]) == {true[50]}
    assert not age.any()
    said, true, age, _ = seen(Fault.DEPTH_LATE, 6.0, 1)
    assert np.array_equal(said[50:], true[30:-20])
    assert age[50:] == pytest.approx(6.0)
    assert not seen(Fault.DEPTH_LATE, 6.0, 0)[2].any()
    said, true, age, k = seen(Fault.DEPTH_OLD, 3.0)
    assert np.array_equal(said[50:], true[50 + (k[50:] - 50) // 10 * 10])
    assert age.max() == pytest.approx(2.7)
    said, true, _, k = seen(Fault.DEPTH_DRIFT, 0.1)
    assert said - true == pytest.approx(0.1 * rig.tick * np.maximum(k - 50, 0), abs=1e-9)
    said, true, _, _ = seen(Fault.DEPTH_SCALE, -0.25)
    assert said[50:] == pytest.approx(0.75 * true[50:])
    said, true, _, _ = seen(Fault.DEPTH_JUMP, -7.0)
    assert said[50:] == pytest.approx(true[50:] - 7.0)
    said, true, _, _ = seen(Fault.DEPTH_NOISE, 2.0)
    assert np.std((said - true)[50:]) == pytest.approx(2.0, rel=0.2)
    said, _, _, _ = seen(Fault.DEPTH_DROPOUTS, 0.5)
    assert 50 < np.isnan(said).sum() < 100


def test_what_the_actuator_does(rig):
    _, reversed_ = rig.fly((Fault.REVERSED, 0, 0, 40, ALWAYS), target=21.0, ticks=100)
    assert np.array_equal(reversed_["applied"][40:], -reversed_["command"][40:])
    _, loose = rig.fly((Fault.RUNS_ON, 9.0, 0, 3, ALWAYS), target=25.0, ticks=100)
    assert set(loose["applied"][3:33]) == {-12.0}
    # a board that is reset commands nothing meanwhile: the driver had its direction before
    _, reset = rig.fly(
        (Fault.RESETS, 1.2, 0, 4, ALWAYS), (Fault.RUNS_ON, 9.0, 0, 10, ALWAYS), target=1.0, ticks=40
    )
    assert reset["command"][10] == 0.0
    assert reset["applied"][10] == 12.0
    stroke = 700e-6
    result, blocked = rig.fly((Fault.BLOCKED_OUT, 0.01, 0, 10, ALWAYS), target=10.0, ticks=600)
    most = blocked["volume"][10] + 0.01 * stroke
    assert blocked["volume"].max() == pytest.approx(most, abs=1e-12)
    contact = int(np.argmax(blocked["volume"] >= most - 1e-12))
    assert result[RESULT.acting] == contact + 3  # the fourth tick: held back for a second on end
    assert contact > 10
    _, slow = rig.fly((Fault.SLOW, 0.1, 0, 0, ALWAYS), target=25.0, ticks=40)
    _, quick = rig.fly(target=25.0, ticks=40)
    load = plant(rig.vehicle).load_drive * 20.0
    rate = -0.1 * plant(rig.vehicle).gain * (12.0 + load)
    assert np.diff(slow["volume"])[10] / rig.tick == pytest.approx(rate, rel=0.01)
    assert np.diff(quick["volume"])[10] / rig.tick == pytest.approx(10 * rate, rel=0.01)


def test_a_dead_battery_stops_the_board(rig):
    result, flown = rig.fly(
        (Fault.BATTERY_DEAD, 60.0, 0, 100, ALWAYS), ticks=400, brown_out=5.4, supply=12.0
    )
    since = rig.tick * (np.arange(401) - 100)
    assert flown["battery"] == pytest.approx(12.0 * np.clip(1.0 - since / 60.0, 0.0, 1.0))
    assert np.array_equal(flown["board"] == 2.0, flown["battery"] < 5.4)
    assert not flown["applied"][flown["board"] == 2.0].any()
    assert result[RESULT.resets] == 1.0


@pytest.mark.parametrize(("supply", "reason"), [(9.7, 0.0), (9.5, Reason.BATTERY_LOW)])
def test_the_board_sees_the_voltage_that_the_battery_has(rig, supply, reason):
    """It is low below 9.6 V, 0.8 of the supply."""
    _, flown = rig.fly(who="supervised", supply=supply, ticks=100)
    assert flown["reason"][-1] == reason


def test_a_sagging_battery_gives_what_kirchhoff_allows(rig):
    """With all that grows with speed taken for back electromotive force, the load makes the sag."""
    share, p = 0.5, plant(rig.vehicle)
    _, flown = rig.fly((Fault.BATTERY_SAG, share, 0, 0, ALWAYS), depth=30.0, target=0.0, ticks=12)
    # R i = u - kappa q = c z while the motor runs evenly, and the battery loses share R i
    drawn = p.load_drive * flown["depth"][8]
    assert flown["applied"][8] == 12.0
    assert np.diff(flown["volume"])[9] / rig.tick == pytest.approx(
        p.gain * (12.0 - (1.0 + share) * drawn), rel=1e-3
    )


@pytest.mark.promise("restarted", faults=["law hangs"])
def test_a_law_that_hangs_is_reset_by_the_watchdog_again_and_again(rig):
    result, flown = rig.fly((Fault.HANG, 6.0, 0, 100, ALWAYS), ticks=400)
    board = flown["board"]
    assert np.all(board[100:120] == 1.0)
    assert np.all(board[120:127] == 2.0)
    assert result[RESULT.resets] == (400 - 100) // 27
    assert len(set(flown["command"][100:120])) == 1


def test_a_board_that_pauses_does_so_again_and_again(rig):
    _, flown = rig.fly((Fault.PAUSE, 9.0, 6.0, 100, ALWAYS), ticks=200)
    for begin in (100, 150):
        assert np.all(flown["board"][begin : begin + 30] == 1.0)
        assert np.all(flown["board"][begin + 30 : begin + 50] == 0.0)
        assert len(set(flown["command"][begin - 1 : begin + 30])) == 1
    assert np.array_equal(np.flatnonzero(flown["lost_ticks"] == 30.0), [129, 179])


def test_a_board_that_has_not_begun_yet_commands_nothing_and_counts_its_ticks(rig):
    """Lost from the first one on: the motor is off until there is a command."""
    _, flown = rig.fly((Fault.PAUSE, 3.0, 600.0, 0, ALWAYS), target=21.0, ticks=30)
    assert np.all(flown["board"][:10] == 1.0)
    assert not flown["command"][:10].any()
    assert np.array_equal(flown["lost_ticks"][:10], np.arange(1.0, 11.0))
    assert flown["command"][10] != 0.0


@pytest.mark.promise("restarted", faults=["board resets"])
def test_a_board_that_is_reset_begins_its_mission_anew(rig):
    turns = ((0.0, 20.0), (40.0, 21.0), (80.0, 22.0))
    _, well = rig.fly(turns=turns, ticks=200)
    assert well["reference"][[39, 40, 80]] == pytest.approx([20.0, 21.0, 22.0])
    # reset at 50 and 150, off for 7 ticks: its first is 57, the next set-point falls due at 97
    _, flown = rig.fly((Fault.RESETS, 30.0, 0, 50, 250), turns=turns, ticks=200)
    assert np.array_equal(np.flatnonzero(np.diff(flown["board"] == 2.0)), [49, 56, 149, 156])
    assert flown["reference"][49] == 21.0
    assert np.all(flown["reference"][57:97] == 20.0)
    assert np.all(flown["reference"][97:137] == 21.0)
    assert np.all(flown["reference"][137:150] == 22.0)
    assert np.all(flown["reference"][157:197] == 20.0)


def test_a_positioner_that_stalled_goes_on_with_the_command_it_has(rig_of):
    rig = rig_of("ntnu-bv", (1.0, 1.5))
    p = plant(rig.vehicle)
    fault_row = (Fault.STALLED, 0, 0, 10, 60)
    start = rig.vehicle.neutral_volume(1.0)
    _, flown = rig.fly(
        fault_row, (Fault.DEPTH_NAN, 0, 0, 0, ALWAYS), depth=1.0, ticks=90, how=1, full_after=20.0
    )
    assert flown["command"][21:] == pytest.approx(p.V_max)
    assert np.all(flown["volume"][20:61] == flown["volume"][20])
    moved = p.rate * rig.tick * np.arange(1, 30)
    after = np.minimum(flown["volume"][20] + moved, p.V_max)
    assert flown["volume"][61:90] == pytest.approx(after, abs=1e-12)
    assert flown["volume"][89] > start


def test_told_to_come_up_it_does_so_at_full_voltage(rig):
    result, flown = rig.fly((Fault.DEPTH_NAN, 0, 0, 100, ALWAYS), ticks=1500, how=1)
    assert np.all(flown["command"][300:] == 12.0)
    assert flown["volume"][-1] == pytest.approx(350e-6)
    assert flown["depth"][-1] < 0.1
    assert Result(*result).acting == 100.0


def test_it_is_told_after_the_first_fault_or_after_the_last(rig):
    """200 ticks after; a block counts once it has held the piston back for a second."""
    fault_rows = (Fault.DEPTH_NAN, 0, 0, 100, ALWAYS), (Fault.VOLUME_NAN, 0, 0, 180, ALWAYS)
    for how, told in ((1, 380), (2, 300)):
        _, flown = rig.fly(*fault_rows, ticks=600, how=how)
        assert np.all(flown["command"][told:] == 12.0)
        assert flown["command"][told - 1] != 12.0
    fault_rows = (Fault.LEAK_SMALL, 1e-9, 0, 50, ALWAYS), (Fault.BLOCKED_OUT, 1e-3, 0, 60, ALWAYS)
    turns = ((0.0, 20.0), (300.0, 18.0))  # the way up asks for volume at once
    result, flown = rig.fly(*fault_rows, ticks=700, turns=turns, how=1)
    assert result[RESULT.acting] == 50.0
    held = int(np.argmax(flown["volume"] >= flown["volume"].max() - 1e-12))
    assert held > 300
    assert np.all(flown["command"][held + 3 + 200 + 2 :] == 12.0)
    never, flown = rig.fly(*fault_rows, ticks=280, how=1)  # it holds its depth below the block
    assert never[RESULT.last] == 280.0
    assert not np.all(flown["command"][270:] == 12.0)


def test_a_board_that_is_left_alone_is_never_told_to_come_up(rig):
    """Of the three ways to fly a mission the board's own differs from both that command it up."""
    fault_row = (Fault.DEPTH_NAN, 0, 0, 100, ALWAYS)
    for how, told in ((OWN, False), (FULL, True), (EARLY, True)):
        _, flown = rig.fly(fault_row, ticks=400, how=how)
        assert np.all(flown["command"][300:] == 12.0) == told


def test_a_vehicle_that_bobs_has_come_up(rig):
    """With full buoyancy from 20 m it comes fast, and goes down by metres before it comes back."""
    fault_row = (Fault.DEPTH_NAN, 0, 0, 0, ALWAYS)
    stay = round(60.0 / rig.tick)
    result, flown = rig.fly(fault_row, ticks=3000, how=1, full_after=0.0, stay=stay)
    arrived, last = int(result[RESULT.arrived]), int(result[RESULT.last])
    assert flown["depth"][arrived] <= 1.0 + 1e-9 < flown["depth"][arrived - 1]
    assert stay <= last - arrived < stay + 30.0 / rig.tick
    assert np.nanmax(flown["depth"][arrived:]) > 2.0
    assert result[RESULT.depth] <= 1.0
    # one that a leak fills goes down for good
    leak = (Fault.LEAK_LARGE, 4e-6, 0, 0, ALWAYS)
    result, flown = rig.fly(
        fault_row, leak, ticks=3000, how=1, full_after=0.0, stay=stay, bottom=40.0
    )
    assert np.nanmin(flown["depth"]) < 1.0
    assert math.isnan(result[RESULT.arrived])
    up = int(result[RESULT.up])
    assert flown["depth"][up] <= 1.0 + 1e-9 < flown["depth"][:up].min()
    assert result[RESULT.filled] == 1.0
    # the sum of forces says so too: water against all that the volume displaces beyond neutral
    p = plant(rig.vehicle)
    left = up + int(np.flatnonzero(flown["depth"][up:] <= 1.0).max())
    spare = p.V_max - p.V_0 - p.psi * flown["depth"][left:] - flown["water"][left:]
    assert np.all(flown["volume"][left : left + 20] > 0.98 * p.V_max)
    assert spare[0] > 0.0 > spare[-1]
    # not filled: it could go out further
    block = (Fault.BLOCKED_OUT, 0.5, 0, 0, ALWAYS)
    result, flown = rig.fly(
        fault_row, leak, block, ticks=3000, how=1, full_after=0.0, stay=stay, bottom=40.0
    )
    assert flown["volume"].max() < 0.97 * p.V_max
    assert result[RESULT.filled] == -1.0
    # nor does a law count that was near the surface before it was told
    result, flown = rig.fly(ticks=100, depth=0.8, quiet_at=60.0)
    assert result[RESULT.arrived] == 60.0


def test_who_rests_between_pushes_has_longer_to_come_up(rig):
    limits = supervisor_parameters(rig.vehicle, rig.tick)
    for who, longer in (
        ("unsupervised", 1.0),
        ("supervised", 1.0 + limits.push.rest / limits.push.again),
    ):
        result, _ = rig.fly(who=who, ticks=200)
        assert result[RESULT.last] == math.ceil(200 * longer)


def test_passing_the_rated_depth_ends_a_mission(rig):
    result, flown = rig.fly((Fault.REVERSED, 0, 0, 0, ALWAYS), target=60.0, ticks=3000, rated=25.0)
    if math.isnan(result[RESULT.beyond]):
        result, flown = rig.fly(target=60.0, ticks=3000, rated=25.0)
    assert result[RESULT.beyond] == result[RESULT.last] == len(flown["depth"]) - 1
    assert flown["depth"][-2] <= 25.0 < result[RESULT.depth]


def test_the_deaf_vehicle_is_the_supervised_one_until_there_is_a_reason(rig):
    """With a depth that stands still it is pushed outward to see; then there is a reason."""
    fault_rows = ((Fault.DEPTH_STUCK, 0, 0, 100, ALWAYS),)
    _, heard = rig.fly(*fault_rows, who="supervised", ticks=600, target=20.5)
    _, ideal = rig.fly(*fault_rows, who="ideal", ticks=600, target=20.5)
    latched = int(np.argmax(heard["reason"] > 0.0))
    assert latched > 200
    for name in ("depth", "volume", "command"):
        assert np.array_equal(heard[name][:latched], ideal[name][:latched])
    pushed = heard["command"][:latched] == 12.0
    assert pushed[-40:].any()  # its volume is seen through two low passes of 7 s
    assert not ideal["reason"].any()
    assert np.all(heard["command"][latched : latched + 50] == 12.0)
    assert ideal["command"][latched] != 12.0  # its law's again


@pytest.mark.promise("test-pushes", faults=["blocked outward"])
def test_a_piston_blocked_outward_is_found_before_the_vehicle_sinks(rig):
    """1 cm3 above where it holds its depth: found at the top, where that still lifts it.

    There the actuator is shown every 90 s; a block since then is met on the way down only.
    """
    fault_rows = ((Fault.BLOCKED_OUT, 1.4e-3, 0, 150, ALWAYS),)
    turns = ((0.0, 20.0), (600.0, 30.0))
    result, flown = rig.fly(*fault_rows, who="supervised", turns=turns, ticks=3000, ramp=0.03)
    assert flown["reason"][-1] == 10.0
    assert result[RESULT.latched] * rig.tick < 45.0 + 96.0 + 20.0
    assert result[RESULT.deepest] < 20.5
    assert result[RESULT.depth] < 1.0
    result, flown = rig.fly(*fault_rows, turns=turns, ticks=3000, ramp=0.03)
    assert result[RESULT.deepest] > 60.0


@pytest.mark.promise("test-pushes", faults=["small leak", "blocked outward"])
def test_a_block_beside_a_leak_is_found_before_the_leak_takes_what_is_left(rig_of):
    """9 mL a minute from 150 s on; the piston is blocked 20 cm3 above where it holds its depth.

    What is neutral rises towards the block: a push that is measured by what was neutral, on
    average, in the dive would not reach it while it still lifts the vehicle.
    """
    own = load_vehicle(str(FILES / "law-adrc.toml")).model_copy(update={"name": "adrc"})
    rig = rig_of(own)
    leak = (Fault.LEAK_SMALL, 1.5e-7, 0, 500, ALWAYS)
    block = (Fault.BLOCKED_OUT, 20.0 / 700.0, 0, 500, ALWAYS)
    result, flown = rig.fly(leak, block, who="supervised", ticks=1200, depth_noise=0.002)
    assert flown["reason"][-1] == 10.0
    left = 2e-5 - 1.5e-7 * (result[RESULT.latched] - 500.0) * rig.tick
    assert left > 5e-6
    assert flown["depth"].min() < 1.0
    result, flown = rig.fly(leak, block, ticks=1200, depth_noise=0.002)
    assert flown["depth"].min() > 19.0


@pytest.mark.parametrize(
    ("old", "values", "ages"),
    [
        ((1.0, 0.0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [0.0] * 6),  # healthy
        ((0.0, 0.0), [0.0] * 6, [0.0] * 6),  # it stays for good, and looks new
        ((0.0, 1.0), [0.0] * 6, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]),  # for good, and its age is said
        ((1.0, 1.0), [0.0, 0.0, 2.0, 2.0, 4.0, 4.0], [0.0, 0.5] * 3),  # a new one each second
    ],
)
def test_a_value_that_stays(old, values, ages):
    kept = np.array([math.nan, -math.inf])
    found = [_held(kept, 0, np.array(old), float(k), k, 0.5) for k in range(6)]
    assert found == list(zip(values, ages, strict=True))


@pytest.mark.parametrize(
    ("latency", "ages"), [(1.0, [0, 1, 2, 2, 2, 2]), (60.0, [0, 1, 2, 3, 3, 3])]
)
def test_a_depth_that_comes_late_is_as_old_as_its_latency_or_all_that_is_kept(latency, ages):
    """Four depths are kept, at two a second; before that it is the first one."""
    effects, late = np.zeros((len(On), 2)), np.zeros(4)
    effects[:, 0] = 1.0
    effects[On.LATE] = 0.0, latency
    seen = [see_depth(effects, k, 0.5, float(k), 0.0, NOTHING_KEPT.copy(), late) for k in range(6)]
    assert seen == [(k - age, 0.5 * age) for k, age in enumerate(ages)]


def test_what_a_fault_makes_of_a_command_or_an_age_is_as_its_kind_says():
    """Nothing of the command, and a way of 1, for 9 s; an age that is hidden above 0.5."""
    effects = np.empty((len(On), 2))
    for k, command in ((9, (1.0, 0.0)), (10, (0.0, 1.0)), (27, (0.0, 1.0)), (28, (1.0, 0.0))):
        act(np.array([[Fault.RUNS_ON, 9.0, 0.0, 10.0, ALWAYS]]), k, 0.5, effects)
        assert tuple(effects[On.COMMAND]) == command
    for second, late in ((0.5, (1.0, 6.0)), (math.nextafter(0.5, 1.0), (0.0, 6.0))):
        act(np.array([[Fault.DEPTH_LATE, 6.0, second, 0.0, ALWAYS]]), 3, 0.5, effects)
        assert tuple(effects[On.LATE]) == late


@pytest.mark.parametrize("n", [0, 1, 3])
def test_only_faults_of_the_mission_act_and_change_anything(n):
    """What stands behind them in memory does not count."""
    memory = np.array([[Fault.DEPTH_NAN, 0.0, 0.0, k, k + 10.0] for k in range(8)])
    plant_, kept = np.zeros(N_PLANT), np.zeros(40)
    assert acted(plant_, plant_, memory[:n], 9, 0.5, 0.0, kept) == n
    begins, ends = set(range(n)), set(range(10, 10 + n))
    assert {k for k in range(20) if changes(memory[:n], k)} == begins | ends


@pytest.mark.parametrize(
    ("command", "waits", "given"),
    [(0.5, 1.0, 0.5), (-0.5, 1.0, -0.5), (0.48, 1.0, 0.0), (-0.46, 1.0, 0.0), (0.5, 0.0, 0.0)],
)
def test_a_pump_that_runs_all_of_a_slow_clocks_tick_runs_until_its_next(command, waits, given):
    """What ends before the tick does is over, and so is all where a tick is missed."""
    now = SimpleNamespace(waits=waits, command=command, board=1.0, ran=0.0)
    _hand_on(now, "a stepper", np.zeros(4), np.zeros(max(Row) + 1), 0.5)
    assert now.command == given


def test_a_positioner_stays_where_it_is_while_its_board_is_off(rig_of):
    """Beside a leak, which changes what the vehicle weighs and not where its piston is."""
    rig = rig_of("ntnu-bv", (1.0, 1.5))
    leak = (Fault.LEAK_SMALL, 1e-8, 0, 0, ALWAYS)
    _, flown = rig.fly((Fault.RESETS, 6.0, 0, 30, ALWAYS), leak, depth=1.0, ticks=90)
    off = np.flatnonzero(flown["board"] == 2.0)
    assert len(off) > 10
    assert flown["water"][off[0]] > 1e-8
    assert flown["command"][off] == pytest.approx(flown["volume"][off], abs=1e-15)


def test_a_dying_cell_shows_above_a_twentieth_of_the_voltage(rig):
    """A motor with less hardly draws anything; the sensor's noise makes the law ask for all."""
    cell = (Fault.BATTERY_CELL, 0.3, 0, 0, ALWAYS)
    _, flown = rig.fly(cell, ticks=3000, depth_noise=1e-3)
    asked = np.abs(flown["applied"][:-1]) / 12.0
    assert ((asked > 0.045) & (asked < 0.05)).sum() > 3
    assert ((asked > 0.05) & (asked < 0.055)).sum() > 3
    expected = 12.0 * np.where(asked > 0.05, 0.7, 1.0)
    assert flown["battery"][1:] == pytest.approx(expected)


@pytest.mark.parametrize("share", [0.29, -0.29, 1.7])
def test_a_clock_that_is_wrong_ticks_twice_or_not_at_all(rig, share):
    """To the bit the commands of the twin, called as often as the board's clock ticks, or twice."""
    vehicle, tick, n, begin = rig.vehicle, rig.tick, 600, 100
    law, parameters, _ = choose_law(vehicle, None, None, None)
    low, high = command_limits(vehicle)
    board = ControllerTwin(twin(law), parameters, tick_s=tick, limits=(low, high))
    turns = ((0.0, 20.0), (300.0, 22.0))
    ahead, fault = 0.0, (Fault.CLOCK_WRONG, share, 0, begin, ALWAYS)
    _, flown = rig.fly(fault, turns=turns, ticks=n)
    share = min(share, 1.0)
    for k in range(n):
        ahead += share if k >= begin else 0.0
        whole = math.trunc(ahead)
        ahead -= whole
        for _ in range(1 + whole):
            board.tick(flown["depth_seen"][k], flown["volume_seen"][k], flown["reference"][k])
        assert flown["command"][k] == board.command
        assert flown["board"][k] == (whole < 0)
    assert board.ticks == pytest.approx(n + share * (n - begin), abs=1.0)
    turned = int(np.argmax(flown["reference"] == 22.0))
    assert turned == pytest.approx(begin + 200 / (1.0 + share), abs=1.0)


def test_a_bit_that_flips_is_one_of_all_that_are_remembered():
    """One at a time, and each as often."""
    effects = np.ones((len(On), 2))
    flips = np.zeros((4, 8))
    for n in range(4000):
        effects[On.FLIP, 0] = float(n % 2)
        memory = np.array([3, 0, 255, 77], np.uint8)
        before = np.unpackbits(memory).reshape(4, 8)
        flip(effects, memory)
        flips += before != np.unpackbits(memory).reshape(4, 8)
    assert flips.sum() == 2000
    assert stats.chisquare(flips.ravel()).pvalue > 1e-3


def test_flipped_bits_bring_down_no_more_than_the_vehicle(rig):
    """Whatever the board remembers, its C comes back with a command in its limits, or none."""
    for who in ("supervised", "unsupervised"):
        _, flown = rig.fly((Fault.BIT_FLIPS, 0.3, 0, 20, ALWAYS), who=who, ticks=3000)
        assert np.abs(flown["applied"][np.isfinite(flown["applied"])]).max() <= 12.0


def test_a_law_that_waits_is_called_once_more_and_no_longer(rig):
    """From its next call on its command holds: for as long as a controller waits at most."""
    _, flown = rig.fly((Fault.LAW_WAITS, 0, 0, 100, ALWAYS), ticks=600, target=21.0)
    assert len(set(flown["command"][100:])) == 1
    assert len(set(flown["command"][:100])) > 50
    assert flown["depth"][-1] > 25.0 or flown["depth"][-1] < 1.0


@pytest.mark.promise("no-command", faults=["set-point NaN", "law waits for ever"])
@pytest.mark.parametrize("fault", [Fault.SETPOINT_NAN, Fault.SETPOINT_INFINITE, Fault.LAW_WAITS])
@pytest.mark.parametrize("name", ["adrc", "observer", "planned"])
def test_whatever_law_gets_no_depth_or_no_turn_is_taken_over_from(rig_of, name, fault):
    """Some laws would hold the last depth for ever, a leak's vehicle too."""
    own = load_vehicle(str(FILES / f"law-{name}.toml")).model_copy(update={"name": name})
    vehicle = rig_of(own)
    result, flown = vehicle.fly((fault, 1e39, 0, 200, ALWAYS), who="supervised", ticks=900)
    assert flown["reason"][-1] == Reason.NO_COMMAND
    assert result[RESULT.latched] * vehicle.tick < 60.0 + 15.0
    assert flown["depth"][-1] < 10.0


@pytest.mark.parametrize(
    ("fault", "severity", "asked"),
    [
        (Fault.SETPOINT_NAN, 0.0, math.nan),
        (Fault.SETPOINT_INFINITE, -1e39, -1e39),
        (Fault.SETPOINT_ABSURD, 12000.0, 12000.0),
    ],
)
def test_a_depth_that_cannot_be_asked_for(rig, fault, severity, asked):
    _, flown = rig.fly((fault, severity, 0, 100, 200), ticks=300, target=21.0)
    on = np.arange(301) // 100 == 1
    assert np.all(flown["reference"][~on] == 21.0)
    assert np.array_equal(flown["reference"][on], np.full(100, asked), equal_nan=True)
    if fault == Fault.SETPOINT_ABSURD:  # full speed downwards
        assert flown["command"][150] == -12.0
    else:  # the law gives no number, and the command before it holds
        assert len(set(flown["command"][99:200])) == 1


def test_a_weight_taken_on_at_the_surface_is_heavy_with_all_volume_out(rig):
    """What `filled` says of a leak it says of a weight: no command helps."""
    weight = (Fault.WEIGHT, 1.2, 0, 1200, ALWAYS)
    result, flown = rig.fly(
        (Fault.DEPTH_NAN, 0, 0, 0, ALWAYS), weight, ticks=3000, how=2, full_after=0.0, stay=9e9
    )
    assert flown["depth"][:1200].min() < 1.0
    assert flown["depth"][-1] > 20.0
    assert result[RESULT.filled] == 1.0
