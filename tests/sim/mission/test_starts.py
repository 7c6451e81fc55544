"""Runs of the pump that are shorter than its start, against the line of SciPy."""

import dataclasses
import re

import numpy as np
import pytest

from swimbladder.errors import NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.sim.engine.rodas.records import Stop
from swimbladder.sim.mission.flight import fly_mission, reach_of
from swimbladder.sim.mission.prepare import make_plan, start_time
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.words import battery_words, starts_words
from swimbladder.vehicle import Oil
from tests.quoted import numbers
from tests.sim.mission.conftest import phases
from tests.sim.mission.test_line import PUMP, RESERVOIR, by_hand, with_line

AIRY = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)
DEEP, RISING = 150.0, 2  # m, and the number of the phase that begins to rise from there


def limited(profiler, longest, oil=AIRY, **more):
    return with_line(profiler, oil, longest_run=longest, **more)


def test_a_start_is_that_of_the_lines_pressure(profiler, sea):
    """From the reservoir's pressure: nothing before that time, a flow after it, by SciPy."""
    plan = make_plan(with_line(profiler, AIRY), phases(deep=DEEP), sea)
    start = start_time(plan, DEEP)
    hand = by_hand(AIRY)
    p = 101325.0 + float(np.interp(DEEP, sea.depth, sea.pressure))
    begin = [np.log(RESERVOIR), 0.0, 0.0]
    before, after = (
        hand.run(begin, 0.0, share * start, lambda _: p, pumps=True)[1] for share in (0.98, 1.02)
    )
    late = 1e6 * 0.02 * start * (PUMP.delivery - PUMP.slip * (p - RESERVOIR))
    assert before < 1e-2 * late
    assert after == pytest.approx(late, rel=0.05)


def test_what_a_start_falls_short_of_is_time_too(profiler, sea):
    vehicle = with_line(profiler, None, start_volume=3e-6)
    plan = make_plan(vehicle, phases(deep=DEEP), sea)
    head = float(np.interp(DEEP, sea.depth, sea.pressure)) + 101325.0 - RESERVOIR
    due = 3e-6 / (PUMP.delivery - PUMP.slip * head)
    assert start_time(plan, DEEP) == pytest.approx(due, rel=1e-3)


@pytest.mark.parametrize("more", [{}, {"oil": None, "start_volume": 3e-6}])
def test_runs_shorter_than_a_start_are_refused(profiler, sea, more):
    task = phases(deep=DEEP)
    start = start_time(make_plan(limited(profiler, 5.0, **more), task, sea), DEEP)
    vehicle = limited(profiler, 0.5, **more)
    with pytest.raises(NoAnswerError) as refused:
        fly_mission(vehicle, task, sea, cycles=1)
    said = str(refused.value)
    assert "'profile' does not come up" in said
    assert "actuator.longest_run" in said
    where = next(z for z in numbers(said) if abs(z - DEEP) <= task.phases[1].tolerance)
    taken = float(re.search(r"a start of the pump takes (\S+) s", said)[1])
    assert taken == pytest.approx(start, rel=0.1 * abs(where - DEEP) / DEEP + 0.03)
    assert 0.5 in numbers(said)  # s, of a run
    fly_mission(limited(profiler, 3.0 * start, **more), task, sea, cycles=1)


def test_a_sample_that_comes_before_a_start_is_over_is_what_limits(profiler, sea):
    stages = [phase.model_dump(exclude_none=True) for phase in phases(deep=DEEP).phases]
    stages[RISING]["check_interval"] = 4.0  # 2 s of them to measure the speed
    task = Mission(phases=stages)
    vehicle = with_line(profiler, None, start_volume=3e-6)
    with pytest.raises(NoAnswerError, match="check_interval") as refused:
        fly_mission(vehicle, task, sea, cycles=1)
    assert 2.0 in numbers(refused.value)  # s, the longest run


@pytest.mark.parametrize("longest", [0.5, 1.0])  # s: nothing pressed out, and little
def test_a_flight_that_such_runs_end_says_why(profiler, sea, longest):
    vehicle, task = limited(profiler, longest), phases(deep=DEEP)
    flight = fly_mission(vehicle, task, sea, checked=False)
    assert flight.stop is Stop.DID_NOT_SURFACE
    result = MissionResult(flight, reach_of(vehicle, task, flight.plan))
    said = next(line for line in result.reasons if line.startswith("the phase 'profile' ran out"))
    runs, out, share = re.search(
        r"The pump's (\d+) longest runs in it pressed out (\S+) cm3, (\S+) % of what", said
    ).groups()
    head = float(np.interp(DEEP, sea.depth, sea.pressure)) + 101325.0 - RESERVOIR
    could = 1e6 * int(runs) * longest * (PUMP.delivery - PUMP.slip * head)
    assert float(share) == pytest.approx(100.0 * float(out) / could, rel=0.05)
    assert float(share) < 50.0
    assert f"a run {longest:g} s at most (actuator.longest_run). Allow longer runs" in said
    assert "longer timeout" not in said


def test_of_a_flight_whose_runs_are_long_enough_nothing_is_said(profiler, sea):
    vehicle, task = limited(profiler, 30.0), phases(deep=DEEP)
    flight = fly_mission(vehicle, task, sea)
    assert not any(starts_words(flight, phase) for phase in range(len(task.phases)))


@pytest.mark.parametrize("depth", [-0.3, 60.0])
def test_a_battery_that_is_empty_lacks_what_pressing_all_out_takes_where_it_is(
    profiler, sea, depth
):
    """Power over delivery times the volume inside, against the pressure there."""
    flight = fly_mission(profiler, phases(deep=DEEP), sea, cycles=1)
    end = flight.end.copy()
    end["z"], end["v"] = depth, profiler.stroke.maximum - 200e-6
    drive = drive_map(profiler, np.interp(max(depth, 0.0), sea.depth, sea.pressure))
    due = 200e-6 * float(drive.power_out[0] / drive.rate_out[0])
    said = battery_words(dataclasses.replace(flight, end=end))
    lacks, inside = re.search(r"(\S+) J short .* the (\S+) cm3 inside there", said).groups()
    assert float(lacks) == pytest.approx(due, rel=0.01)
    assert float(inside) == 200.0
