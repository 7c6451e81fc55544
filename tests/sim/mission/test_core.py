"""What the hooks of a mission enter and decide, one call at a time, without flying."""

import math

import numpy as np
import pytest

from swimbladder.sim.closed_loop.lane import Row, rows
from swimbladder.sim.engine.accounts import Account as Sums
from swimbladder.sim.engine.advance import CHATTERS
from swimbladder.sim.engine.rodas.drive import STAYED
from swimbladder.sim.engine.rodas.records import (
    AT,
    GIVEN,
    NOTE,
    NOW,
    WORK,
    Account,
    Doing,
    Lane,
    Note,
    Stop,
    made,
    record,
)
from swimbladder.sim.mission.core import hooks, phases, sampled
from swimbladder.sim.mission.core.phases import CYCLE, ROW, STAGE, Holding, Kind, Phases
from swimbladder.sim.mission.core.sampled import Numbers, Sampled, Way

DEPTH, TOLERANCE = 30.0, 2.0  # m


def under_way(*kinds, kept=100, cycles=4, notes=20):
    """A mission of phases at one depth, submerged there; nothing moves and nothing is limited."""
    stages = np.zeros(len(kinds), STAGE)
    stages["kind"], stages["depth"], stages["tolerance"] = kinds, DEPTH, TOLERANCE
    stages["duration"] = stages["timeout"] = 100.0
    p, x, at = made(GIVEN), made(NOW), made(AT)
    p["v_max"], p["held"], p["deepest"], p["mass"] = 1e-3, 0.9, math.inf, 30.0
    p["empty"] = p["reserve"] = -math.inf
    p["last_cycle"], p["last_time"] = math.inf, math.inf
    x["z"], x["t_end"] = DEPTH, math.inf
    accounts = np.zeros(len(Account) + len(Holding) * len(kinds))
    made_of = np.zeros(notes, NOTE), np.zeros(3, np.int64), np.zeros(WORK)
    lane = Lane(p, np.zeros((2, 40)), np.zeros((0, 6)), x, at, accounts, *made_of)
    return Phases(
        lane,
        stages,
        np.zeros(kept, ROW),
        np.zeros(cycles, CYCLE),
        board=np.zeros(10),
        numbers=np.zeros((len(kinds), 0)),
    )


@pytest.mark.parametrize("off", [0.0, 1.9, 2.0, -2.0, 2.1, -2.1, 40.0])
def test_at_rest_it_is_inside_all_the_time_or_never(off):
    f = under_way(Kind.DESCEND, Kind.HOLD)
    f.lane.at["phase"], f.lane.x["z"] = 1, DEPTH + off
    phases.enter_hold(f, DEPTH + off, 50.0)
    own = f.lane.accounts[len(Account) + len(Holding) :]
    inside = 50.0 if abs(off) <= TOLERANCE else 0.0
    assert own == pytest.approx([50.0, inside, 50.0 * off * off, abs(off)])
    assert f.lane.x["t_inside"] == inside
    assert not np.any(f.lane.accounts[: len(Account) + len(Holding)])


@pytest.mark.parametrize(
    ("begin", "end"), [(-5.0, 3.0), (5.0, -1.0), (3.0, 9.0), (-1.0, 1.0), (1.75, 2.25)]
)
def test_on_its_way_it_is_inside_for_the_share_of_the_way_that_lies_there(begin, end):
    f = under_way(Kind.PARK)
    f.lane.x["z"] = DEPTH + end
    phases.enter_hold(f, DEPTH + begin, 8.0)
    way = np.linspace(begin, end, 100_001)
    own = f.lane.accounts[len(Account) :]
    assert own[Holding.TIME] == 8.0
    assert own[Holding.INSIDE] == pytest.approx(8.0 * np.mean(np.abs(way) <= 2.0), abs=1e-3)
    assert own[Holding.SQUARES] == pytest.approx(8.0 * np.mean(way**2), rel=1e-4)
    assert own[Holding.MOST] == max(abs(begin), abs(end))


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_phase_that_never_arrived_is_missed_and_no_other(number):
    f = under_way(Kind.PROFILE, Kind.PARK, Kind.HOLD, Kind.DESCEND)
    f.lane.at["phase"] = number
    assert not phases.next_phase(f)
    missed = {n for n in range(4) if int(f.lane.at["missed"]) >> n & 1}
    assert missed == {number}
    assert f.lane.at["not_held"] == 0
    assert (f.lane.at["phase"], f.lane.at["new_phase"]) == (number + 1, 1)
    assert f.lane.notes["what"][0] == Note.OUT_OF_TIME
    assert f.lane.notes["number"][0] == number


@pytest.mark.parametrize("inside", [89.0, 91.0])
@pytest.mark.parametrize("kind", [Kind.PARK, Kind.HOLD, Kind.PROFILE])
def test_a_depth_is_held_for_nine_tenths_of_the_time_since_it_arrived_or_not(kind, inside):
    f = under_way(Kind.DESCEND, kind, Kind.SURFACE)
    x, at = f.lane.x, f.lane.at
    at["phase"], at["arrived"] = 1, 1
    x["t"], x["t_arrived"], x["t_inside"] = 300.0, 200.0, inside
    phases.next_phase(f)
    held = inside > 90.0 or kind == Kind.PROFILE
    assert at["not_held"] == (0 if held else 0b10)
    assert at["missed"] == 0


@pytest.mark.parametrize("alarm", [0, 1])
def test_afloat_after_the_alarm_the_mission_is_over_in_whatever_phase(alarm):
    """Without an alarm a phase at a depth takes no notice of the surface."""
    f = under_way(Kind.PARK)
    f.lane.at["place"], f.lane.at["alarm"], f.lane.x["v"] = 1, alarm, 1e-3
    assert not phases.afloat(f, False)
    assert f.lane.at["stop"] == (Stop.PASSED_DEPTH if alarm else Stop.GOES_ON)
    f.lane.x["v"], f.lane.at["stop"] = 0.9e-3, 0
    assert not phases.afloat(f, False)
    assert f.lane.at["stop"] == Stop.GOES_ON  # not all of its volume is out


@pytest.mark.parametrize(
    ("counts", "is_full"),
    [
        ([0, 0, 0], False),
        ([92, 12, 3], False),
        ([93, 0, 0], True),
        ([0, 13, 0], True),
        ([0, 0, 4], True),
    ],
)
def test_a_buffer_is_full_where_a_step_s_rows_or_notes_or_a_cycle_have_no_room(counts, is_full):
    f = under_way(Kind.PARK, kept=100, notes=20, cycles=4)
    f.lane.counts[:] = counts
    assert hooks.full(f, 8) is is_full
    assert not hooks.full(under_way(Kind.PARK, kept=0, notes=0, cycles=0), 8)  # nothing is kept


@pytest.mark.parametrize("buffer", ["kept", "notes", "cycles"])
def test_a_buffer_of_one_is_a_buffer(buffer):
    f = under_way(Kind.PARK, **{"kept": 0, "notes": 0, "cycles": 0, buffer: 1})
    assert hooks.full(f, 8) is (buffer != "cycles")
    f.lane.counts[2] = 1
    assert hooks.full(f, 8)


@pytest.mark.parametrize(("idle", "stop"), [(199, Stop.GOES_ON), (200, Stop.STUCK)])
def test_two_hundred_ticks_may_pass_without_time_and_no_more(idle, stop):
    f = under_way(Kind.PARK)
    f.lane.at["idle"] = idle
    hooks._begin(f, np.zeros(rows(0, 0)), 0, None)
    assert f.lane.at["stop"] == stop


@pytest.mark.parametrize(
    ("event", "place", "doing", "kept"),
    [
        (STAYED, 0, Doing.NOTHING, 0),
        (STAYED, 1, Doing.NOTHING, 0),
        (STAYED, 0, Doing.LETTING_IN, 1),
        (STAYED, 2, Doing.NOTHING, 1),
        (-1, 0, Doing.NOTHING, 1),
    ],
)
def test_a_row_is_kept_of_every_step_but_where_it_rests_off_the_bottom_with_the_drive_off(
    event, place, doing, kept
):
    f = under_way(Kind.PARK)
    f.lane.at["place"], f.lane.at["doing"], f.lane.x["t"] = place, doing, 3.0
    hooks._moved(f, event, 1.0, DEPTH)
    assert f.lane.counts[0] == kept


def test_a_passage_is_noted_at_its_own_time_and_depth_while_there_is_room():
    f = under_way(Kind.PARK, notes=2)
    f.lane.x["t"] = 9.0
    for t in (7.25, 8.5, 8.75):
        sampled._note(f.lane, t, Note.EMERGED, 0.25)
    assert f.lane.notes["t"].tolist() == [7.25, 8.5]
    assert f.lane.notes["z"].tolist() == [0.25, 0.25]
    assert f.lane.counts.tolist() == [0, 2, 0]


def test_a_row_without_room_is_not_kept():
    f = under_way(Kind.PARK, kept=2)
    for t in (1.0, 2.0, 3.0):
        f.lane.x["t"] = t
        phases.row(f)
    assert f.rows["t"].tolist() == [1.0, 2.0]
    assert f.lane.counts[0] == 2


@pytest.mark.parametrize(
    ("ends", "empty", "halts", "stop"),
    [
        (math.inf, -math.inf, False, Stop.GOES_ON),
        (5.0, -math.inf, True, Stop.GOES_ON),  # a cycle is over
        (math.inf, 0.0, True, Stop.BATTERY_EMPTY),
    ],
)
def test_a_mission_halts_where_a_cycle_is_over_and_where_it_ends(ends, empty, halts, stop):
    f = under_way(Kind.PARK)
    f.lane.x["t"], f.lane.x["t_end"], f.lane.at["arrived"] = 5.0, ends, 1
    f.lane.p["empty"] = empty
    assert hooks.turn(f) is halts
    assert f.lane.at["stop"] == stop


def by_samples(f, *, tick=0.5, row_samples=6.0, band=0.0, unseen=0.0):
    own = Numbers(
        tick=tick,
        weight=1e4,
        neutral_top=0.0,
        row_samples=row_samples,
        longest=600.0,
        unseen=unseen,
    )
    way = made(record(*((name, float) for name in Way._fields)), tuple(Way()))
    tasks, log = np.array([[0.0, band, 0.0]]), np.zeros((1, 1, 3))
    sums, noted = np.zeros((1, len(Sums))), np.zeros((1, 1), np.int64)
    return Sampled(f, own, way, tasks, sums, log, noted, reason=np.zeros(1))


def test_a_row_is_kept_every_so_many_samples():
    """At rest at its depth, where nothing else happens."""
    f = under_way(Kind.PARK)
    f.lane.at["arrived"] = 1
    s, S = by_samples(f, row_samples=6.0), np.zeros(rows(0, 0))
    S[Row.Z] = DEPTH
    for k in range(1, 25):
        sampled._enter(s, S, k)
    kept = f.rows[: f.lane.counts[0]]
    assert kept["t"] == pytest.approx([3.0, 6.0, 9.0, 12.0])


@pytest.mark.parametrize(("off", "rests"), [(0.0, True), (0.2, True), (-0.25, True), (0.26, False)])
def test_a_law_is_let_rest_where_half_its_band_is_left_and_nothing_drifts(off, rests):
    f = under_way(Kind.PARK)
    f.lane.at["arrived"] = 1
    s = by_samples(f, band=0.5)
    assert not sampled._rests(s, DEPTH + off)  # seen once, a drift is not known
    f.lane.x["t"] = s.now["check"]
    assert sampled._rests(s, DEPTH + off) is rests
    f.lane.x["t"] = s.now["check"]
    assert sampled._rests(s, DEPTH + 0.45) is rests  # one that rests does so to the band's edge
    f.lane.x["t"] = s.now["check"]
    assert not sampled._rests(s, DEPTH + 0.55)


@pytest.mark.parametrize(
    ("drift", "unseen", "rests"),
    [
        (0.004, 0.0, True),
        (-0.004, 0.0, True),
        (0.006, 0.0, False),
        (0.006, 0.02, True),
        (0.03, 0.02, False),
    ],
)
def test_a_law_is_let_rest_with_a_drift_of_a_hundredth_of_its_band_or_unseen(drift, unseen, rests):
    f = under_way(Kind.PARK)
    f.lane.at["arrived"] = 1
    s = by_samples(f, band=0.5, unseen=unseen)
    sampled._rests(s, DEPTH)
    f.lane.x["t"] = s.now["check"]
    assert sampled._rests(s, DEPTH + drift) is rests


@pytest.mark.parametrize(
    ("known", "found"),
    [(Stop.GOES_ON, Stop.STUCK), (Stop.LEFT_WATER, Stop.LEFT_WATER), (Stop.LOST, Stop.LOST)],
)
def test_a_lane_that_stopped_for_no_reason_of_the_mission_is_stuck(known, found):
    f = under_way(Kind.PARK)
    f.lane.at["stop"] = known
    s, S = by_samples(f), np.zeros(rows(0, 0))
    S[Row.STOPPED] = CHATTERS
    assert sampled._begin(s, S, 0, None)
    assert f.lane.at["stop"] == found
