"""Campaigns: the same again, going on after a kill, verdicts on rows made by hand."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from swimbladder.codegen.library import digest, firmware
from swimbladder.control.supervisor import Reason
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.sim.engine.advance import LEFT_WATER, TOO_DEEP
from swimbladder.sim.faults import draw as drawing
from swimbladder.sim.faults import faults
from swimbladder.sim.faults.campaign_result import Outcome, outcomes, reason_words, rule_of_three
from swimbladder.sim.faults.draw import RESULT, FaultRow, Result, course_of, draw
from swimbladder.sim.faults.kinds import FAULTS, KINDS, draw_fault, kinds_of
from swimbladder.sim.faults.run import missions_csv
from swimbladder.vehicle import Supervisor
from tests.sim.faults.oracle import Fault
from tests.vehicles import limited, usual

FEUP = load_vehicle("feup-em")
BEGIN = FaultRow._fields.index("begin")
DRIFT = FAULTS["DEPTH_DRIFT"]


def same(a, b):
    return np.array_equal(a, b, equal_nan=True)


def same_rows(a, b):
    return same(a.view(np.float64), b.view(np.float64))


def test_the_catalogue_has_every_kind():
    assert list(KINDS) == list(FAULTS.values())
    families = {"sensor", "actuator", "battery", "timing", "program", "leak", "weight"}
    assert {kind.family for kind in KINDS.values()} == families
    assert len({kind.name for kind in KINDS.values()}) == len(KINDS)
    random = np.random.default_rng(1)
    for fault, kind in KINDS.items():
        drawn = np.array([draw_fault(fault, random) for _ in range(200)])
        if kind.first is not None:
            sizes = np.abs(drawn[:, 0])
            assert kind.first.least <= sizes.min() <= sizes.max() <= kind.first.most
            assert (drawn[:, 0].min() < 0.0) == kind.first.either
            assert kind.why
        assert np.isinf(drawn[:, 2]).all() != kind.may_end
    assert Fault.BATTERY_DROP not in kinds_of(load_vehicle("ntnu-bv"))


def test_half_of_the_missions_have_a_second_fault_within_30_s():
    """And every one goes to its depths at 0.1 m/s, docs/how-to/faults.md."""
    course = course_of(usual(FEUP), None)
    missions = [draw(course, seed=5, number=n, healthy=False) for n in range(600)]
    begins = [
        m.fault_rows[:, BEGIN]
        for m in missions
        if len(m.faults) == 2 and not any(KINDS[fault].from_start for fault in m.faults)
    ]
    assert np.mean([len(m.faults) == 2 for m in missions]) == pytest.approx(0.5, abs=0.06)
    apart = np.diff(begins, axis=1)[:, 0] * course.tick
    assert stats.kstest(apart, stats.uniform(0.0, 30.0).cdf).pvalue > 0.01
    assert course.ramp == pytest.approx(0.1)


def test_a_mission_depends_on_seed_and_number_only():
    course = course_of(usual(FEUP), None)
    one = draw(course, seed=3, number=41, healthy=False)
    again = draw(course, seed=3, number=41, healthy=False)
    for field in dataclasses.fields(one):
        if field.name != "layers":
            assert same(getattr(one, field.name), getattr(again, field.name))
    assert one.layers is again.layers is course.medium.layers
    other = draw(course, seed=4, number=41, healthy=False)
    assert other.fault_rows[0, BEGIN] != one.fault_rows[0, BEGIN]
    well = draw(course, seed=3, number=41, healthy=True)
    assert well.faults == ()
    assert len(well.fault_rows) == 0


def test_missions_stay_where_they_may():
    course = course_of(usual(FEUP), None)
    drawn = [draw(course, seed=1, number=n, healthy=False) for n in range(300)]
    least, most, _ = course.depths
    for m in drawn:
        assert least <= min(m.depths[:-1]) <= max(m.depths[:-1]) <= most
        assert m.depths[-1] < 0.0
        assert np.all(np.diff(m.turns) > 0.0)
        early = KINDS[m.faults[0]].from_start
        assert m.fault_rows[0, BEGIN] == 0.0 if early else m.fault_rows[0, BEGIN] * course.tick > 29
        assert max(m.depths[:-1]) < m.plant[-1]
    assert {m.faults[0] for m in drawn} == set(kinds_of(FEUP))
    assert 0.4 < np.mean([len(m.faults) == 2 for m in drawn]) < 0.6
    assert max(max(m.depths) for m in drawn) > 0.95 * most


def test_one_fault_in_seven_ends_after_5_to_300_s_where_it_can():
    """Evenly in the logarithm, as severities are; a leak goes on."""
    random, count = np.random.default_rng(4), 20_000
    lasts = np.array([draw_fault(FAULTS["DEPTH_STUCK"], random)[2] for _ in range(count)])
    ends = lasts[lasts < math.inf]
    assert len(ends) / count == pytest.approx(0.15, abs=4.0 * math.sqrt(0.15 * 0.85 / count))
    scaled = np.log(ends / 5.0) / math.log(300.0 / 5.0)
    assert stats.kstest(scaled, "uniform").pvalue > 0.01
    assert all(draw_fault(FAULTS["LEAK_SMALL"], random)[2] == math.inf for _ in range(200))


@pytest.mark.parametrize(("name", "share"), [("feup-em", 0.25), ("example-float", 0.6)])
def test_the_first_fault_begins_early_enough_to_act(name, share):
    """Evenly from 30 s on within a quarter of the time until it comes up, of a float 0.6 of it."""
    course = course_of(usual(load_vehicle(name), (12.0, 40.0)), (12.0, 40.0))
    begun = []
    for number in range(400):
        one = draw(course, seed=2, number=number, healthy=False)
        if KINDS[one.faults[0]].from_start or DRIFT in one.faults:  # begins, or ends, otherwise
            continue
        latest = share * one.turns[-1]
        first = 30.0 / course.tick
        begun.append((one.fault_rows[0, BEGIN] - first) / (latest - first))
    assert stats.kstest(begun, "uniform").pvalue > 0.01


@pytest.mark.parametrize("hours", [1.0, 10.0])
def test_a_mission_lasts_until_a_drift_is_3_m_or_its_time_limit_acts(hours):
    """From 0.1 mm/s on that takes up to 8 h 20 min; one that ends by itself is not waited for."""
    course = course_of(limited(FEUP, hours * 3600.0), None)
    room = course.time_limit - course.takes
    lasted, cut = [], 0
    for number in range(600):
        one = draw(course, seed=9, number=number, healthy=False)
        rates = [row for row in one.fault_rows if row[0] == DRIFT]
        needed = [row[BEGIN] * course.tick + 3.0 / abs(row[1]) for row in rates]
        waits = [t for row, t in zip(rates, needed, strict=True) if t < row[4] * course.tick]
        end = min(max([1200.0, *waits]), 1200.0 + room)
        assert one.turns[-1] * course.tick == pytest.approx(end, abs=course.tick)
        assert one.condition.quiet_at >= one.turns[-1]
        lasted.append(end)
        cut += max([0.0, *waits]) > end
    assert 4.0 * 1200.0 < max(lasted) < 31_000.0 if hours > 9.0 else max(lasted) == 1200.0 + room
    assert (cut > 0) == (hours < 9.0)


@pytest.mark.parametrize("least", [0.0, 1.0])
def test_a_first_depth_is_drawn_evenly_of_the_range_or_in_its_logarithm_from_above_0_on(least):
    """Three in four evenly in depth, the others in its logarithm where the range has one."""
    course = course_of(usual(FEUP), None)
    most = course.depths.most
    course = course._replace(depths=course.depths._replace(least=least))
    first = [drawing._set_points(course, 0.5, np.random.default_rng(n))[1][0] for n in range(2000)]

    def share(z):
        even = (z - least) / (most - least)
        rather = np.log(z / least) / np.log(most / least) if least > 0.0 else even
        return 0.75 * even + 0.25 * rather

    assert least <= min(first)
    assert max(first) <= most
    assert stats.kstest(first, share).pvalue > 0.01


@pytest.fixture(scope="module")
def flown(request):
    request.getfixturevalue("gcc")
    return faults(usual(FEUP), missions=310, healthy=60, seed=5)


@pytest.mark.promise("recovered")
def test_without_the_supervisor_many_are_lost_and_with_it_fewer(flown):
    assert flown.all_lost_without_supervisor > 0.3
    last = flown.lines()[-1]
    assert last.missions == 310
    assert last.recovered > 0.9 * last.recoverable
    assert last.recoverable - last.recovered < 0.4 * last.lost_without_supervisor


@pytest.mark.promise("no-false-alarm")
def test_healthy_missions_raise_no_alarm(flown):
    assert len(flown.false_alarms) == 0
    assert len(flown.healthy_lost) == 0


def test_a_law_too_slow_for_its_time_limit_raises_no_false_alarm(flown):
    table = flown.healthy.copy()
    table["flights"][[3, 5], 0, RESULT.reason] = Reason.TIME_LIMIT, Reason.DEPTH_FROZEN
    judged = dataclasses.replace(flown, healthy=table)
    assert judged.too_slow.tolist() == [3]
    assert judged.false_alarms.tolist() == [5]


def test_a_drift_that_its_time_limit_cuts_short_is_named(flown):
    table, limit = flown.faulty.copy(), flown.course.time_limit
    table["faults"] = [(0.0, math.nan, math.nan, math.nan, math.nan)] * 2
    begin, rate = 100.0, 3.0 / (limit - 100.0 * flown.tick)
    for number, (severity, end) in enumerate(
        [(0.99 * rate, math.inf), (-1.01 * rate, math.inf), (0.99 * rate, 3000.0)]
    ):
        table["faults"][number][number % 2] = float(DRIFT), severity, 0.0, begin, end
    assert dataclasses.replace(flown, faulty=table).cut_short.tolist() == [0]


def test_a_reason_that_flipped_bits_have_made_is_unknown():
    assert [reason_words(code) for code in (0.0, 2.0, 64.0)] == ["", "leak", "unknown"]


def test_what_nothing_can_save_is_not_counted_on(flown):
    reversed_ = (flown.fault_row(0, "kind") == Fault.REVERSED) & (flown.fault_row(1, "kind") == 0.0)
    for_good = np.isinf(flown.fault_row(0, "end"))
    assert not flown.recoverable[reversed_ & for_good].any()


def test_a_run_that_was_killed_goes_on_to_the_same_end(flown, tmp_path):
    class KilledError(Exception):
        pass

    def kill(_):
        raise KilledError

    with pytest.raises(KilledError):
        faults(usual(FEUP), missions=310, healthy=60, seed=5, keep=tmp_path, advance=kill)
    kept = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.npy")}
    assert kept
    again = faults(usual(FEUP), missions=310, healthy=60, seed=5, keep=tmp_path)
    assert same_rows(again.faulty, flown.faulty)
    assert same_rows(again.healthy, flown.healthy)
    for name, written in kept.items():
        assert (tmp_path / name).stat().st_mtime_ns == written


def test_the_table_has_a_row_for_each(flown):
    lines = missions_csv(flown).splitlines()
    names = lines[0].split(",")
    assert names[1:5] == ["fault_1", "severity_1", "onset_1_s", "end_1_s"]
    assert len(lines) == 311
    assert all(line.count(",") == len(names) - 1 for line in lines)


def test_outcomes_of_rows_made_by_hand():
    fine = Result(
        stop=0.0,
        last=1000.0,
        arrived=800.0,
        beyond=math.nan,
        bottom=0.0,
        depth=0.0,
        deepest=9.0,
        latched=math.nan,
        reason=0.0,
        released=math.nan,
        resets=0.0,
        acting=1.0,
        up=700.0,
        filled=-1.0,
    )
    rows = [
        (fine, Outcome.SURFACED),
        (fine._replace(arrived=801.0), Outcome.NOT_UP),
        (fine._replace(arrived=math.nan), Outcome.NOT_UP),
        (fine._replace(beyond=5.0), Outcome.BEYOND),
        (fine._replace(arrived=math.nan, bottom=1.0), Outcome.BOTTOM),
        (fine._replace(arrived=math.nan, stop=float(LEFT_WATER)), Outcome.SURFACED),
        (fine._replace(arrived=math.nan, stop=float(TOO_DEEP)), Outcome.STOPPED),
        (fine._replace(filled=1.0), Outcome.SURFACED),
        (fine._replace(arrived=math.nan, bottom=1.0, filled=1.0), Outcome.FILLED),
        (fine._replace(beyond=5.0, filled=1.0), Outcome.FILLED),
        (fine._replace(beyond=5.0, filled=1.0, up=math.nan), Outcome.BEYOND),
        (fine._replace(filled=1.0, stop=float(TOO_DEEP), arrived=math.nan), Outcome.STOPPED),
    ]
    found = outcomes(np.array([row for row, _ in rows]), tick=0.3)
    assert found.tolist() == [float(outcome) for _, outcome in rows]
    assert all(outcome.words for outcome in Outcome)


def test_the_bound_on_what_was_never_seen_is_the_rule_of_three():
    assert rule_of_three(0, 1000) == pytest.approx(1.0 - 0.05 ** (1 / 1000))
    assert rule_of_three(0, 1000) == pytest.approx(3e-3, rel=5e-3)
    assert rule_of_three(5, 5) == 1.0
    # P(at most 2 of 50) = 5 % at the upper end
    p = rule_of_three(2, 50)
    assert sum(math.comb(50, k) * p**k * (1 - p) ** (50 - k) for k in range(3)) == pytest.approx(
        0.05
    )


@pytest.mark.parametrize(
    ("vehicle", "options", "said"),
    [
        (FEUP.model_copy(update={"controller": None}), {}, "has no controller"),
        (FEUP, {"missions": 0}, "from 1 to 10,000,000"),
        (FEUP, {"depth_range": (5.0, 2.0)}, "depths that grow"),
        (FEUP, {"depth_range": (5.0, 5.0)}, "depths that grow"),
        (FEUP, {"depth_range": (5.0, 95.0)}, "turns the vehicle round"),
        (
            FEUP.model_copy(update={"supervisor": Supervisor(time_limit=100.0)}),
            {},
            "would be cut short",
        ),
    ],
)
def test_what_cannot_be_flown_is_refused(vehicle, options, said):
    with pytest.raises(InputError, match=said):
        faults(limited(vehicle), **{"missions": 5, **options})


def test_without_a_time_limit_neither_missions_nor_firmware_are_written():
    """Nothing else brings up a vehicle whose depth drifts; with one both are the same C."""
    with pytest.raises(InputError, match=r"time_limit: no time limit .* take 1840 s with it"):
        faults(FEUP, missions=5)
    with pytest.raises(InputError, match="whose depth drifts slowly"):
        firmware(FEUP, duration=30.0)
    vehicle = limited(FEUP, 2400.0)
    flown = faults(vehicle, missions=2, healthy=1)
    made = firmware(vehicle, duration=30.0)
    assert flown.program == digest(made).hex() == made.to_dict()["sha256_of_c"]
    other = firmware(limited(FEUP, 2500.0), duration=30.0)
    assert digest(other).hex() != flown.program


def test_depths_that_no_rating_limits_say_so():
    """ntnu-bv states none: its stroke and motor give the depth. With a rating there is nothing."""
    vehicle = load_vehicle("ntnu-bv")
    assert (
        "no rating is stated, give hull.depth_limit or `depth_range=`"
        in course_of(usual(vehicle), None).depths.limit
    )
    rated = vehicle.model_copy(
        update={"hull": vehicle.hull.model_copy(update={"depth_limit": 40.0})}
    )
    assert "rating" not in course_of(usual(rated), None).depths.limit
