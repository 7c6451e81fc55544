"""Runs of the pump that are shorter than its start, against the line of SciPy."""

import re

import numpy as np
import pytest

from swimbladder.errors import NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.sim.engine.rodas.names import Stop
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.sim.mission.reach import check_reach, reach_of
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.starts import runs_of, start_of, starts_words
from swimbladder.vehicle import Oil
from tests.quoted import numbers
from tests.sim.mission.conftest import phases
from tests.sim.mission.test_line import PUMP, RESERVOIR, by_hand, with_line

AIRY = Oil(volume=1e-4, bulk_modulus=1.4e9, trapped_air=0.05)
DEEP, RISING = 150.0, 2  # m, and the number of the phase that begins to rise from there


def limited(profiler, longest, oil=AIRY, **more):
    return with_line(profiler, oil, longest_run=longest, **more)


@pytest.mark.parametrize("pause", [20.0, 65.0, 3600.0])
def test_a_start_is_that_of_the_lines_pressure(profiler, sea, pause):
    """From the sea's pressure a pause ago: nothing before that time, a flow after it, by SciPy."""
    vehicle = with_line(profiler, AIRY)
    plan = make_plan(vehicle, phases(deep=DEEP), sea)
    start = start_of(plan, DEEP, pause=pause)
    assert start.running_up == 0.0
    hand = by_hand(AIRY)
    p = 101325.0 + float(np.interp(DEEP, sea.depth, sea.pressure))
    rested = hand.run([np.log(p), 0.0, 0.0], 0.0, pause, lambda _: p, pumps=False)
    rested[1] = 0.0
    before, after = (
        hand.run(rested, 0.0, share * start.time, lambda _: p, pumps=True)[1]
        for share in (0.98, 1.02)
    )
    late = 1e6 * 0.02 * start.time * (PUMP.delivery - PUMP.slip * (p - RESERVOIR))
    assert before < 1e-3 * late
    assert after == pytest.approx(late, rel=0.02)
    assert start.time < start_of(plan, DEEP).time  # an empty line takes longer


def test_what_a_start_falls_short_of_is_time_too(profiler, sea):
    vehicle = with_line(profiler, None, start_volume=3e-6)
    plan = make_plan(vehicle, phases(deep=DEEP), sea)
    head = float(np.interp(DEEP, sea.depth, sea.pressure)) + 101325.0 - RESERVOIR
    start = start_of(plan, DEEP)
    assert start.filling == 0.0
    assert start.time == pytest.approx(3e-6 / (PUMP.delivery - PUMP.slip * head), rel=1e-9)
    assert "s for actuator.start_volume)" in start.words()


@pytest.mark.parametrize("more", [{}, {"oil": None, "start_volume": 3e-6}])
def test_runs_shorter_than_a_start_are_refused_before_flying(profiler, sea, more):
    task = phases(deep=DEEP)
    pause = runs_of(make_plan(limited(profiler, 5.0, **more), task, sea), RISING).pause
    begin = DEEP - task.phases[1].tolerance
    start = start_of(make_plan(limited(profiler, 5.0, **more), task, sea), begin, pause=pause)
    for share in (0.9, 1.1):
        vehicle = limited(profiler, share * start.time, **more)
        plan = make_plan(vehicle, task, sea)
        if share > 1.0:
            check_reach(vehicle, task, plan)
            continue
        with pytest.raises(NoAnswerError) as refused:
            check_reach(vehicle, task, plan)
        said = str(refused.value)
        assert "'profile'" in said
        assert "actuator.longest_run" in said
        assert {150.0, float(f"{share * start.time:.3g}")} <= numbers(said)  # m, s


def test_a_look_that_comes_before_a_start_is_over_is_what_limits(profiler, sea):
    stages = [phase.model_dump(exclude_none=True) for phase in phases(deep=DEEP).phases]
    stages[RISING]["check_interval"] = 4.0  # 2 s of them to measure the speed
    task = Mission(phases=stages)
    vehicle = with_line(profiler, None, start_volume=3e-6)
    with pytest.raises(NoAnswerError, match="check_interval") as refused:
        check_reach(vehicle, task, make_plan(vehicle, task, sea))
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
