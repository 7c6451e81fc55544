"""What a campaign says of its missions: read off them one by one, as how-to/faults.md has it."""

import csv
import dataclasses
import io
import math
from collections import Counter

import numpy as np
import pytest
from scipy import stats

from swimbladder.control.supervisor import Reason
from swimbladder.io.config import load_vehicle
from swimbladder.sim.engine.advance import DONE, LEFT_WATER, TOO_DEEP
from swimbladder.sim.faults.campaign_result import (
    ROW,
    TOGETHER,
    FaultResult,
    Outcome,
    outcomes,
    rule_of_three,
)
from swimbladder.sim.faults.draw import FaultRow, Result, Trace, course_of, draw
from swimbladder.sim.faults.kinds import KINDS, kinds_of
from swimbladder.sim.faults.run import TRACE_COLUMNS, Flown, missions_csv, trace_csv
from tests.sim.faults.oracle import Fault
from tests.vehicles import usual

FEUP = load_vehicle("feup-em")
COURSE = course_of(usual(FEUP), None)
TICK = COURSE.tick
NONE = FaultRow(0.0, math.nan, math.nan, math.nan, math.nan)
SUPERVISED, UNSUPERVISED, IDEAL, EARLY = range(4)
EMPTY = -1e9  # an empty cell
LOST = {Outcome.NOT_UP, Outcome.BEYOND, Outcome.BOTTOM}


def result(random):
    """Return how some flight may end: every way, often."""

    def tick_or_never():
        return random.choice([math.nan, float(random.integers(100, 4000))])

    last = float(random.integers(4000, 5000))
    return Result(
        stop=float(random.choice([DONE, LEFT_WATER, TOO_DEEP], p=[0.9, 0.05, 0.05])),
        last=last,
        arrived=random.choice([math.nan, last - random.integers(198, 203), last - 900.0]),
        beyond=random.choice([math.nan, 30.0], p=[0.9, 0.1]),
        bottom=float(random.random() < 0.2),
        depth=random.uniform(-0.5, 50.0),
        deepest=random.uniform(0.0, 60.0),
        latched=tick_or_never(),
        reason=float(random.choice([0.0, *Reason])),
        released=tick_or_never(),
        resets=float(random.integers(0, 4)),
        acting=float(random.integers(0, 300)),
        up=random.choice([math.nan, 700.0, 701.0]),
        filled=float(random.choice([-1.0, 0.0, 1.0])),
    )


def ends(r):
    """Return how a flight ended, by the words of how-to/faults.md."""
    if not math.isnan(r.beyond):
        how = Outcome.BEYOND
    elif r.bottom:
        how = Outcome.BOTTOM
    elif r.stop == LEFT_WATER:  # it leapt out of the water
        how = Outcome.SURFACED
    elif r.stop != DONE:
        how = Outcome.STOPPED
    else:
        stays = math.floor(60.0 / TICK)
        how = Outcome.SURFACED if r.last - r.arrived >= stays else Outcome.NOT_UP
    was_up = not math.isnan(r.up)
    return Outcome.FILLED if how in LOST and was_up and r.filled == 1.0 else how


def faults(random, kinds):
    """Return the two rows of a mission: one kind or two."""
    row = FaultRow(
        kind=float(random.choice(kinds)),
        first=random.uniform(0.1, 2.0),
        second=0.0,
        begin=float(random.integers(0, 900)),
        end=random.choice([math.inf, 2000.0]),
    )
    if random.random() < 0.4:
        return row, NONE
    return row, row._replace(kind=float(random.choice(kinds)), begin=row.begin + 20.0)


def made_up(count=1000, seed=2, healthy=30):
    random = np.random.default_rng(seed)
    kinds = [*kinds_of(FEUP)[:6], Fault.DEPTH_OFFSET]
    tables = [np.full(n, np.nan, ROW) for n in (count, healthy)]
    for table in tables:
        for row in table:
            row["start"], row["deepest"] = random.uniform(1.0, 40.0, 2)
            row["bottom"], row["supply"] = random.choice([math.inf, 44.0]), random.uniform(11, 12)
            row["faults"] = faults(random, kinds) if table is tables[0] else (NONE, NONE)
            for n in range(4):
                row["flights"][n] = result(random)
    return FaultResult(
        course=COURSE, seed=7, faulty=tables[0], healthy=tables[1], program="0123abcd"
    )


CAMPAIGN = made_up()


def read(campaign):
    """Return [(FaultRow, FaultRow, four Results)] of the missions with faults."""
    return [
        (*(FaultRow(*f) for f in row["faults"]), [Result(*r) for r in row["flights"]])
        for row in campaign.faulty
    ]


def came_up(flights, n, ideal=IDEAL):
    """Say whether it surfaced, or was up no later than with ideal detection and then filled."""
    how = ends(flights[n])
    return how == Outcome.SURFACED or (how == Outcome.FILLED and flights[n].up <= flights[ideal].up)


def test_outcomes_have_numbers_and_words_of_their_own():
    assert [*Outcome] == [0, 1, 2, 3, 4, 5]
    assert {o.name: o.words for o in Outcome} == {
        "SURFACED": "surfaced",
        "BEYOND": "beyond the rated depth",
        "BOTTOM": "on the bottom",
        "NOT_UP": "not at the surface",
        "STOPPED": "the simulation stopped",
        "FILLED": "surfaced and was filled by the leak",
    }


@pytest.mark.parametrize("flight", range(4))
def test_how_each_flight_ended(flight):
    expected = [ends(flights[flight]) for *_, flights in read(CAMPAIGN)]
    assert CAMPAIGN.outcome(flight).tolist() == expected
    assert set(expected) == set(Outcome)
    up = [came_up(flights, flight) for *_, flights in read(CAMPAIGN)]
    assert CAMPAIGN.came_up(flight).tolist() == up


def test_missions_that_are_named():
    """Recoverable, lost, lost early, filled: mission by mission, and some of each."""
    lost, early, filled, able = [], [], [], []
    for n, (first, second, flights) in enumerate(read(CAMPAIGN)):
        recoverable = ends(flights[IDEAL]) == Outcome.SURFACED
        able.append(recoverable)
        if recoverable and not came_up(flights, SUPERVISED):
            lost.append(n)
        if recoverable and came_up(flights, SUPERVISED):
            filled += [n] * (ends(flights[SUPERVISED]) == Outcome.FILLED)
        from_start = float(Fault.DEPTH_OFFSET) in (first.kind, second.kind)
        before = ends(flights[EARLY]) == Outcome.SURFACED and not recoverable
        if before and not came_up(flights, SUPERVISED, EARLY) and not from_start:
            early.append(n)
    assert CAMPAIGN.recoverable.tolist() == able
    for found, expected in (
        (CAMPAIGN.lost, lost),
        (CAMPAIGN.filled, filled),
        (CAMPAIGN.lost_early, early),
    ):
        assert found.tolist() == expected
        assert len(expected) > 3


def test_shares_that_are_lost_without_the_supervisor():
    missions = read(CAMPAIGN)
    lost = [not came_up(flights, UNSUPERVISED) for *_, flights in missions]
    able = [ends(flights[IDEAL]) == Outcome.SURFACED for *_, flights in missions]
    assert CAMPAIGN.all_lost_without_supervisor == pytest.approx(sum(lost) / len(missions))
    of_able = sum(a and b for a, b in zip(lost, able, strict=True)) / sum(able)
    assert CAMPAIGN.lost_without_supervisor == pytest.approx(of_able)
    none = dataclasses.replace(CAMPAIGN, faulty=CAMPAIGN.faulty[:3].copy())
    none.faulty["flights"][:, IDEAL, Result._fields.index("beyond")] = 1.0
    assert none.lost_without_supervisor == 0.0


def test_healthy_missions_are_judged_by_the_first_flight():
    flights = [Result(*row["flights"][SUPERVISED]) for row in CAMPAIGN.healthy]
    slow = [n for n, r in enumerate(flights) if r.reason == Reason.TIME_LIMIT]
    alarms = [n for n, r in enumerate(flights) if r.reason and n not in slow]
    assert CAMPAIGN.too_slow.tolist() == slow
    assert CAMPAIGN.false_alarms.tolist() == alarms
    assert CAMPAIGN.healthy_lost.tolist() == [
        n for n, r in enumerate(flights) if ends(r) != Outcome.SURFACED
    ]
    assert not CAMPAIGN.passed


@pytest.mark.parametrize(("lost", "alarm"), [(False, False), (True, False), (False, True)])
def test_a_campaign_passes_without_a_loss_and_without_an_alarm(lost, alarm):
    well = Result(
        last=900.0, arrived=1.0, bottom=0.0, reason=0.0, latched=math.nan, up=1.0, acting=0.0
    )
    one = made_up(count=4, healthy=4)
    one.faulty["flights"], one.healthy["flights"] = well, well
    one.healthy["flights"][2, SUPERVISED, Result._fields.index("reason")] = float(Reason.LEAK) * (
        alarm
    )
    one.faulty["flights"][1, SUPERVISED, Result._fields.index("beyond")] = 9.0 if lost else math.nan
    assert one.passed == (not lost and not alarm)
    assert one.lost.tolist() == [1] * lost


def line_of(name, missions):
    """Return a row of the table, by the words of files-written.md."""
    able = [ends(f[IDEAL]) == Outcome.SURFACED for _, _, f in missions]
    good = [came_up(f, SUPERVISED) for _, _, f in missions]
    alone = [came_up(f, UNSUPERVISED) for _, _, f in missions]
    late = [(f[0].latched - f[0].acting) * TICK for _, _, f in missions]
    late = sorted(x for x in late if not math.isnan(x))
    three = list(zip(able, good, alone, strict=True))
    return {
        "name": name,
        "missions": len(missions),
        "recoverable": sum(able),
        "recovered": sum(a and g for a, g, _ in three),
        "lost_without_supervisor": sum(a and not u for a, _, u in three),
        "recovered_by_supervisor": sum(a and g and not u for a, g, u in three),
        "unrecoverable_surfaced": sum(g and not a for a, g, _ in three),
        "latched": len(late),
        "detection_time_median": stats.scoreatpercentile(late, 50) if late else math.nan,
        "detection_time_95": stats.scoreatpercentile(late, 95) if late else math.nan,
        "deepest": max(f[SUPERVISED].deepest for _, _, f in missions),
    }


def test_the_table_counts_kinds_that_came_alone_pairs_and_all():
    missions, found = read(CAMPAIGN), CAMPAIGN.lines()
    expected = []
    for number, kind in KINDS.items():
        alone = [m for m in missions if m[0].kind == number and m[1].kind == 0.0]
        if alone:
            expected.append(line_of(kind.name, alone) | {"family": kind.family})
    pairs = [m for m in missions if m[1].kind]
    expected.append(line_of(TOGETHER, pairs) | {"family": ""})
    expected.append(line_of("all", missions) | {"family": ""})
    assert len(expected) == 9
    for line, wanted in zip(found, expected, strict=True):
        assert line._asdict() == pytest.approx(wanted, nan_ok=True)
    silent = dataclasses.replace(CAMPAIGN, faulty=CAMPAIGN.faulty[:2].copy())
    silent.faulty["flights"][:, SUPERVISED, Result._fields.index("latched")] = math.nan
    last = silent.lines()[-1]
    assert math.isnan(last.detection_time_median)
    assert math.isnan(last.detection_time_95)
    assert last.latched == 0


def test_the_answer_in_json():
    told, c = CAMPAIGN.to_dict(), CAMPAIGN
    assert told["missions"] == len(c.faulty)
    assert told["recoverable"] == c.recoverable.sum()
    assert told["depths_m"] == [COURSE.depths.least, COURSE.depths.most]
    assert told["time_limit_s"] == COURSE.time_limit
    assert told["law"] == "cascade"
    assert (told["vehicle"], told["water"], told["seed"]) == (FEUP.name, None, 7)
    assert told["sha256_of_c"] == "0123abcd"
    assert told["passed"] is False
    for name in ("lost", "lost_early", "filled", "cut_short"):
        assert told[name] == getattr(c, name).tolist()
    assert told["lost_share_without_supervisor"] == c.lost_without_supervisor
    assert told["lost_share_without_supervisor_of_all"] == c.all_lost_without_supervisor
    assert [row["name"] for row in told["kinds"]] == [line.name for line in c.lines()]
    well = told["healthy"]
    assert well["missions"] == 30
    for name, found in (("false_alarms", c.false_alarms), ("too_slow", c.too_slow)):
        assert well[name] == found.tolist()
    assert well["lost"] == c.healthy_lost.tolist()
    alarms = len(c.false_alarms)
    assert stats.binom.cdf(alarms, 30, well["bound_95"]) == pytest.approx(0.05)


def test_a_bound_where_all_trials_found_it_is_1():
    assert rule_of_three(4, 4) == 1.0
    assert rule_of_three(3, 4) == pytest.approx(0.95**0.25)  # that all four do, in 95 %


def test_what_happened_to_a_mission_in_a_line():
    seen, unseen = Counter(), 0
    for n, (first, second, flights) in enumerate(read(CAMPAIGN)):
        said = CAMPAIGN.description(n)
        assert said.startswith(f"mission {n}: ")
        assert said.endswith(f", {ends(flights[SUPERVISED]).words}")
        for row in (first, second):
            if row.kind:
                kind = KINDS[int(row.kind)]
                how = f"{kind.name} {kind.size(row.first)}".rstrip()
                begins = f"{how} at {row.begin * TICK:.0f} s"
                lasts = f" for {(row.end - row.begin) * TICK:.0f} s"
                assert begins in said
                assert (begins + lasts in said) == math.isfinite(row.end)
                seen[kind.name] += 1
        r = flights[SUPERVISED]
        if r.reason:
            late = (r.latched - r.acting) * TICK
            assert f"{Reason(int(r.reason)).words} {late:.0f} s after the first onset" in said
        else:
            assert "not detected" in said
            unseen += 1
    assert len(seen) == 7
    assert unseen > 3


def number(text):
    return float(text) if text else EMPTY


def test_a_row_for_each_mission():
    """Times in seconds from the start, numbers to six digits, what is not known is nan."""
    rows = list(csv.DictReader(io.StringIO(missions_csv(CAMPAIGN))))
    assert len(rows) == len(CAMPAIGN.faulty)
    for n, (row, (first, second, flights)) in enumerate(zip(rows, read(CAMPAIGN), strict=True)):
        facts, r, alone = CAMPAIGN.faulty[n], flights[SUPERVISED], flights[UNSUPERVISED]
        numbers = {
            "mission": n,
            "start_depth_m": facts["start"],
            "deepest_setpoint_m": facts["deepest"],
            "bottom_m": facts["bottom"] if math.isfinite(facts["bottom"]) else math.nan,
            "supply_V": facts["supply"],
            "recoverable": float(ends(flights[IDEAL]) == Outcome.SURFACED),
            "latched_s": r.latched * TICK,
            "release_s": r.released * TICK,
            "deepest_m": r.deepest,
            "resets": r.resets,
            "unsupervised_deepest_m": alone.deepest,
        }
        for place, fault in ((1, first), (2, second)):
            kind = KINDS.get(int(fault.kind))
            assert row[f"fault_{place}"] == (kind.name if kind else "")
            sized = kind is not None and kind.first is not None
            numbers[f"severity_{place}"] = fault.first if sized else EMPTY
            numbers[f"onset_{place}_s"] = fault.begin * TICK if kind else EMPTY
            ends_at = math.nan if math.isinf(fault.end) else fault.end * TICK
            numbers[f"end_{place}_s"] = ends_at if kind else EMPTY
        assert row["supervised"] == ends(r).words
        assert row["unsupervised"] == ends(alone).words
        assert row["reason"] == (Reason(int(r.reason)).words if r.reason else "")
        found = {name: number(row[name]) for name in numbers}
        assert found == pytest.approx(numbers, rel=1e-5, nan_ok=True)


def test_a_row_for_each_tick():
    """Every number with all of its digits; what is infinite is nan."""
    rows = np.random.default_rng(1).normal(size=(5, len(Trace._fields)))
    rows[2, 3], rows[3, 0] = math.inf, -math.inf
    table = list(csv.reader(io.StringIO(trace_csv(rows, 0.3))))
    assert tuple(table[0]) == TRACE_COLUMNS
    found = np.array(table[1:], float)
    assert found[:, 0] == pytest.approx(0.3 * np.arange(5))
    rows[~np.isfinite(rows)] = math.nan
    assert np.array_equal(found[:, 1:], rows, equal_nan=True)


@pytest.fixture(scope="module")
def flown():
    """Mission 12 with one fault that ends and one that lasts, each flight ended by hand."""
    own = draw(COURSE, seed=1, number=12, healthy=False)
    fault_rows = np.array(
        [
            (float(Fault.DEPTH_JUMP), -7.5, 0.0, 100.0, 400.0),
            (float(Fault.DEPTH_NAN), 0.0, 0.0, 150.0, math.inf),
        ]
    )
    mission = dataclasses.replace(
        own, faults=(int(Fault.DEPTH_JUMP), int(Fault.DEPTH_NAN)), fault_rows=fault_rows
    )
    up = Result(stop=0.0, last=4000.0, arrived=3000.0, bottom=0.0, depth=-0.2, deepest=21.26)
    results = (
        up._replace(latched=500.0, reason=float(Reason.LEAK)),
        up._replace(arrived=math.nan, depth=30.04, bottom=1.0, reason=0.0),
        up._replace(arrived=math.nan, depth=2.0),
    )
    return Flown(course=COURSE, mission=mission, healthy=False, results=results, rows=())


def test_a_mission_tells_what_was_asked_what_failed_and_how_it_ended(flown):
    said, m = flown.lines(), flown.mission
    assert said[0] == "mission 12: set-points " + ", ".join(
        f"{z:.1f} m at {k * TICK:.0f} s" for k, z in zip(m.turns, m.depths, strict=True)
    )
    assert said[1:] == [
        "from 30 s to 120 s: depth jump, the depth jumps and stays off: -7.5 m",
        "from 45 s on: depth NaN, no depth (NaN)",
        "the supervisor took over at 150 s: leak",
        "with the supervisor: surfaced, deepest 21.3 m, at the end 0.0 m",
        "without it: on the bottom, deepest 21.3 m, at the end 30.0 m",
        "with full buoyancy 60 s after fault onset: not at the surface, deepest 21.3 m, at the "
        "end 2.0 m",
    ]
    quiet = flown.results[0]._replace(reason=0.0, latched=math.nan)
    well = dataclasses.replace(flown, healthy=True, results=(quiet, *flown.results[1:2]))
    assert well.lines()[0].startswith("mission h12: ")
    assert "the supervisor detected no fault" in well.lines()
    assert well.reason == ""
    assert [*well.to_dict()["outcomes"]] == ["supervised", "unsupervised"]


def test_a_mission_in_json(flown):
    told = flown.to_dict()
    assert told["mission"] == 12
    assert told["healthy"] is False
    assert (told["latched_s"], told["reason"]) == (pytest.approx(150.0), "leak")
    jump, nan = told["faults"]
    assert jump == pytest.approx(
        {"kind": "depth jump", "severity": -7.5, "onset_s": 30.0, "end_s": 120.0}
    )
    assert (nan["kind"], nan["onset_s"], nan["end_s"]) == ("depth NaN", pytest.approx(45), math.inf)
    assert told["outcomes"] == {
        "supervised": "surfaced",
        "unsupervised": "on the bottom",
        "ideal_detection": "not at the surface",
    }
    assert (told["vehicle"], told["water"]) == (FEUP.name, None)


def test_a_stay_is_of_whole_ticks():
    """A minute, or the whole ticks that are in it where none ends with it."""
    base = Result(last=1000.0)
    for tick, stays in ((0.3, 200), (0.25, 240), (7.0, 8), (60.0, 1)):
        for ticks, how in ((stays, Outcome.SURFACED), (stays - 1, Outcome.NOT_UP)):
            one = base._replace(arrived=1000.0 - ticks)
            assert outcomes(np.array([one]), tick).tolist() == [how]
