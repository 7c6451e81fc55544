"""What missions are drawn from: every number of many missions against the range it is said to have.

The ranges are those of docs/how-to/faults.md, "The missions", and of the remarks beside them.
"""

import dataclasses
import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from swimbladder.design.tuning.region import member, unknowns
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.closed_loop.water import share_read
from swimbladder.sim.faults import draw as drawing
from swimbladder.sim.faults.draw import FaultRow, Wave, course_of, draw, reached
from swimbladder.sim.faults.kinds import KINDS, kinds_of
from tests import layered
from tests.sim.faults.oracle import Fault
from tests.vehicles import limited, usual

NAMES = ["feup-em", "ntnu-bv", "example-float"]
DIVES = "example-float"
COUNT = 4000


@cache
def course(name):
    return course_of(usual(load_vehicle(name), None), None)


@cache
def missions(name):
    return [draw(course(name), seed=8, number=n, healthy=False) for n in range(COUNT)]


def conditions(name, field):
    return np.array([getattr(m.condition, field) for m in missions(name)])


def plants(name):
    return [Plant(*m.plant) for m in missions(name)]


def fills(values, least, most, *, log=False, past=0.0):
    """Assert that numbers are drawn evenly from a range, and from all of it.

    past: as a share of the range, by which rounding may bring one beyond its most.
    """
    x, ends = np.asarray(values, float), (least, most)
    if log:
        x, ends = np.log(x), (math.log(least), math.log(most))
    share = (x - ends[0]) / (ends[1] - ends[0])
    assert len(share) > 800
    assert -1e-9 < share.min() < 0.01
    assert 0.99 < share.max() < 1.0 + past + 1e-9
    assert stats.kstest(share, "uniform").pvalue > 1e-4


def in_shares(values, **shares):
    """Assert that values fall into cells as often as is said, to four deviations."""
    for value, share in shares.values():
        near = 4.0 * math.sqrt(share * (1.0 - share) / len(values))
        assert np.mean(values == value) == pytest.approx(share, abs=near)


def half(chosen):
    in_shares(np.asarray(chosen, bool), yes=(True, 0.5))


@pytest.mark.parametrize(
    "name", ["feup-em", *(pytest.param(n, marks=pytest.mark.prove) for n in NAMES[1:])]
)
def test_half_of_the_missions_are_in_swell(name):
    """Of half a hundredth to a twentieth of the stroke, with the periods of swell."""
    stroke = np.ptp([getattr(load_vehicle(name).stroke, end) for end in ("minimum", "maximum")])
    swell = conditions(name, "swell")
    half(swell > 0.0)
    fills(swell[swell > 0.0] / stroke, 0.005, 0.05, log=True)
    fills(2.0 * math.pi / conditions(name, "swell_omega"), 5.0, 12.0)
    fills(conditions(name, "swell_phase"), 0.0, 2.0 * math.pi)


@pytest.mark.parametrize(
    "name", ["feup-em", *(pytest.param(n, marks=pytest.mark.prove) for n in NAMES[1:])]
)
def test_half_of_the_vehicles_have_a_leak_input(name):
    """It speaks from 2 to 20 cm3 of water on."""
    speaks = conditions(name, "leak_input")
    half(np.isfinite(speaks))
    fills(speaks[np.isfinite(speaks)], 2e-6, 20e-6)


@pytest.mark.parametrize("name", ["feup-em", DIVES])
def test_sensors_of_which_nothing_is_stated(name):
    """0.5 to 5 mm of noise, no quantum or one of 1 or 5 mm, up to 1e-4 of the stroke in volume."""
    fills(conditions(name, "depth_noise"), 0.5e-3, 5e-3, log=True)
    quantum = conditions(name, "depth_quantum")
    assert set(quantum) == {0.0, 1e-3, 5e-3}
    in_shares(quantum, none=(0.0, 1 / 3), fine=(1e-3, 1 / 3), coarse=(5e-3, 1 / 3))
    stroke = np.ptp([getattr(load_vehicle(name).stroke, end) for end in ("minimum", "maximum")])
    fills(conditions(name, "volume_noise") / stroke, 0.0, 1e-4)
    assert not conditions(name, "volume_quantum").any()
    assert set(conditions(name, "battery_noise")) == {0.005}


def sensing(name="feup-em", **stated):
    vehicle = load_vehicle(name)
    sensors = vehicle.sensors.model_copy(update=stated)
    vehicle = vehicle.model_copy(update={"sensors": sensors})
    own = course_of(usual(vehicle, None), None)
    return [draw(own, seed=8, number=n, healthy=True).condition for n in range(COUNT)]


def test_a_stated_noise_is_right_in_half_of_the_missions():
    """Else it is up to four times less or more, as often, or the sensor has a quantum of 5 mm."""
    found = sensing(depth_noise=2e-3, volume_noise=3e-8, volume_quantum=1e-8)
    noise, quantum = np.array([(c.depth_noise, c.depth_quantum) for c in found]).T
    assert {(c.volume_noise, c.volume_quantum) for c in found} == {(3e-8, 1e-8)}
    in_shares(np.sign(np.log(noise / 2e-3)), less=(-1.0, 0.25), more=(1.0, 0.25))
    fills(noise[noise < 2e-3], 0.5e-3, 2e-3, log=True)
    fills(noise[noise > 2e-3], 2e-3, 8e-3, log=True)
    coarse = quantum > 0.0
    in_shares(coarse, yes=(True, 0.25))
    assert set(quantum[coarse]) == {5e-3}
    assert set(noise[coarse]) == {2e-3}


@pytest.mark.parametrize(
    ("stated", "coarse"),
    [
        (4.83e-3, 5e-3),
        *(pytest.param(*both, marks=pytest.mark.prove) for both in ((8e-3, 8e-3), (1e-3, 5e-3))),
    ],
)
def test_a_stated_quantum_is_at_least_5_mm_in_a_quarter_of_the_missions(stated, coarse):
    found = sensing(depth_quantum=stated)
    assert {c.depth_noise for c in found} == {0.0}
    quantum = np.array([c.depth_quantum for c in found])
    assert set(quantum) == {stated, coarse}
    if stated != coarse:
        in_shares(quantum, coarse=(coarse, 0.25))


@pytest.mark.parametrize("name", NAMES)
def test_the_numbers_that_all_missions_of_a_vehicle_share(name):
    """As how-to/faults.md says what is counted: 1 m, 60 s there, full buoyancy 60 s after."""
    own, floats, vehicle = course(name), name == DIVES, load_vehicle(name)
    tick = vehicle.controller.sample_time
    whole = {
        "band": 1.0,
        "stay": 60.0 / tick,
        "full_after": math.ceil(60.0 / tick),
        "boot": math.ceil(2.0 / tick),
        "tick": tick,
        "gravity": vehicle.water.gravity,
        "end": math.ceil(own.end / tick),
        "rated": {"feup-em": 100.0, "ntnu-bv": math.inf, DIVES: 2000.0}[name],
        "ramp": math.inf if floats else own.ramp * tick,
        # a 5 V regulator, and what drops over it, under a 12 V battery
        "brown_out": {"feup-em": 5.4, "ntnu-bv": 0.0, DIVES: 5.4 / 12.0 * 14.4}[name],
    }
    for field, value in whole.items():
        assert conditions(name, field) == pytest.approx(np.full(COUNT, value), rel=1e-12), field
    full = conditions(name, "full")
    if floats:
        assert set(full) == {tick}
    elif vehicle.voltage_driven:
        assert full == pytest.approx([p.supply for p in plants(name)])
    else:
        assert full == pytest.approx([p.V_max for p in plants(name)])
        assert np.isnan(conditions(name, "battery_noise")).all()
    fills(conditions(name, "seed"), 0.0, 2.0**32)


@pytest.mark.parametrize("name", NAMES)
def test_trim_drifts_by_what_is_not_known_of_it(name):
    """To either side, in 1000 s at the quickest, and in half of the time limit."""
    own = course(name)
    slowest = {"feup-em": 1000.0}.get(name, 0.5 * own.time_limit)
    assert 0.5 * own.time_limit < 1000.0 or name != "feup-em"
    fills(conditions(name, "drift") * slowest / own.neutral, -1.0, 1.0)


@pytest.mark.parametrize("name", NAMES)
def test_half_of_the_missions_are_over_a_bottom(name):
    """1 to 50 m under the deepest set-point."""
    bottom = np.array([p.z_bottom for p in plants(name)])
    under = bottom - [m.depths[:-1].max() for m in missions(name)]
    half(np.isfinite(under))
    fills(under[np.isfinite(under)], 1.0, 50.0)


@pytest.mark.parametrize("name", ["feup-em", "ntnu-bv"])
def test_a_mission_begins_at_rest(name):
    """Where the volume is that which the hull displaces less, as far as the stroke has it."""
    stroke = load_vehicle(name).stroke
    for m, p in zip(missions(name)[:500], plants(name), strict=False):
        assert m.condition.start_depth == m.depths[0]
        rest = p.psi * m.depths[0] + p.V_0
        assert m.condition.start_volume == pytest.approx(
            np.clip(rest, stroke.minimum, stroke.maximum), abs=1e-15
        )


@pytest.mark.parametrize(("trim", "end"), [(-1.0, "minimum"), (1.0, "maximum")])
def test_a_vehicle_that_cannot_rest_begins_at_the_end_of_its_stroke(trim, end):
    own, stroke = course("feup-em"), load_vehicle("feup-em").stroke
    p = own.medium.plant._asdict() | {"V_0": trim}
    given = drawing._condition(own, p, np.random.default_rng(1), start=3.0, quiet=9.0)
    assert given.start_volume == getattr(stroke, end)
    assert given.quiet_at == math.ceil(9.0 / own.tick)


def test_a_mission_in_layers_begins_at_rest_there():
    """What the halocline adds is the weight that thinner water does not carry."""
    vehicle, column = layered.vehicle(), layered.column()
    depths = (1.0, 5.0)
    own = course_of(usual(vehicle, depths, column), depths, column)
    bends = []
    for n in range(100):
        m = draw(own, seed=8, number=n, healthy=True)
        p, z = Plant(*m.plant), float(m.depths[0])
        assert m.condition.gravity == column.gravity
        assert m.layers is own.medium.layers
        if vehicle.stroke.minimum < m.condition.start_volume < vehicle.stroke.maximum:
            thinner = float(layered.added(z, vehicle))
            bends.append((thinner, m.condition.start_volume - (p.psi * z + p.V_0)))
    thinner, found = np.array(bends).T  # but for the trim, and what a metre of water compresses
    assert np.ptp(thinner) > 2e-6
    assert found - thinner == pytest.approx(np.full(len(bends), np.mean(found - thinner)), abs=5e-8)


@pytest.mark.parametrize("name", NAMES)
def test_one_to_four_depths_come_a_minute_apart_at_least(name):
    """Each as often; at most a third of the stay later, and by 10 m or a twentieth of the most."""
    own = course(name)
    stays = 7200.0 if name == DIVES else 1200.0
    random = np.random.default_rng(5)
    drawn = [drawing._set_points(own, 0.3, random) for _ in range(COUNT)]
    in_shares(
        np.array([len(z) - 1 for _, z in drawn]), **{f"n{n}": (n, 0.25) for n in (1, 2, 3, 4)}
    )
    least, most, _ = own.depths
    gaps, steps = [], []
    for times, z in drawn:
        way = 1.5 * z[0] / own.ramp if name == DIVES else 0.0
        assert times[0] == 0.0
        assert times[-1] == pytest.approx(way + stays)
        assert z[-1] == (-1.0 if name == DIVES else pytest.approx(0.3 - 1.0))
        at = [way, *times[1:-1]]
        gaps += np.diff(at).tolist()
        for one, other in pairwise(z[:-1]):
            step = max(10.0, 0.05 * most)
            if least + step < one < most - step:
                steps.append((other - one) / step)
            assert least <= other <= most
    fills(gaps, 60.0, stays / 3.0)
    fills(steps, -1.0, 1.0)
    # of a float that comes up to above where its hull emerges
    if name == DIVES:
        assert drawing._set_points(own, -0.5, random)[1][-1] == -1.5


@pytest.mark.parametrize("name", ["feup-em", DIVES])
def test_three_in_four_begin_anywhere_in_the_range(name):
    """The others evenly in the logarithm of the depth; tested closely, in 30,000 draws."""
    own, random = course(name), np.random.default_rng(6)
    least, most, _ = own.depths
    first = np.array([drawing._set_points(own, 0.0, random)[1][0] for _ in range(30_000)])
    assert least <= first.min() < 1.01 * least
    assert 0.99 * most < first.max() <= most
    for even in (0.02, 0.1):  # a tenth of the range is more than half of its logarithm
        middle = least + even * (most - least)
        share = 0.75 * even + 0.25 * math.log(middle / least) / math.log(most / least)
        in_shares(first < middle, yes=(True, share))


@pytest.mark.parametrize("name", NAMES)
def test_the_kinds_come_in_turn_and_any_other_with_them(name):
    own, kinds = course(name), kinds_of(load_vehicle(name))
    found = missions(name)
    assert [m.faults[0] for m in found] == [kinds[n % len(kinds)] for n in range(COUNT)]
    half([len(m.faults) == 2 for m in found])
    pairs = [m.faults for m in found if len(m.faults) == 2]
    assert all(first != second for first, second in pairs)
    apart = [(kinds.index(b) - kinds.index(a)) % len(kinds) for a, b in pairs]
    counts = np.bincount(apart, minlength=len(kinds))[1:]
    assert stats.chisquare(counts).pvalue > 1e-3
    for m in found:
        for fault, row in zip(m.faults, m.fault_rows, strict=True):
            row = FaultRow(*row)
            assert row.kind == fault
            assert (row.begin == 0.0) or not KINDS[fault].from_start
            if math.isfinite(row.end):
                lasts = row.end - row.begin
                assert KINDS[fault].may_end
                assert lasts == round(lasts)
                assert 5.0 - own.tick < lasts * own.tick < 300.0 + own.tick


@pytest.mark.parametrize(("name", "share"), [("feup-em", 0.25), ("ntnu-bv", 0.25), (DIVES, 0.6)])
def test_the_first_begins_from_30_s_on_and_the_second_within_30_s(name, share):
    tick, first, second = course(name).tick, [], []
    for m in missions(name):
        rows = [FaultRow(*row) for row in m.fault_rows]
        if any(KINDS[fault].from_start for fault in m.faults) or Fault.DEPTH_DRIFT in m.faults:
            continue
        begin, ends = rows[0].begin * tick, share * m.turns[-1] * tick
        first.append((begin - 30.0) / (ends - 30.0))
        if len(rows) == 2:
            second.append((rows[1].begin - rows[0].begin) * tick)
        assert m.condition.quiet_at >= max(m.turns[-1], *(row.begin - 1 for row in rows))
    fills(first, 0.0, 1.0, past=0.005)
    even = np.array(second)  # whole ticks
    assert -1e-9 < even.min() < 1.0
    assert 29.0 < even.max() < 30.0 + tick
    assert np.mean(even) == pytest.approx(15.0, abs=0.5 + 0.5 * tick)


def test_a_fault_lasts_for_a_tick_at_least():
    """Of a controller that is slower than the shortest of them: one, and a whole one."""
    own = course("feup-em")
    slow = own.vehicle.controller.model_copy(update={"sample_time": 40.0})
    own = own._replace(vehicle=own.vehicle.model_copy(update={"controller": slow}))
    lasts = set()
    for n in range(600):
        for row in draw(own, seed=8, number=n, healthy=False).fault_rows:
            row = FaultRow(*row)
            if math.isfinite(row.end):
                lasts.add(row.end - row.begin)
    assert lasts == {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0}


def test_when_a_drift_is_3_m():
    """At 1 cm/s after 300 s, where it lasts for so long; nothing else is waited for."""
    tick = 0.5
    drift = FaultRow(float(Fault.DEPTH_DRIFT), -0.01, 0.0, 40.0, math.inf)
    assert reached(drift, tick) == pytest.approx(320.0)
    assert reached(drift._replace(first=0.01), tick) == pytest.approx(320.0)
    exact = drift._replace(first=0.5, begin=0.0)  # 6 s are 12 ticks
    assert reached(exact._replace(end=13.0), tick) == 6.0
    assert reached(exact._replace(end=12.0), tick) == 0.0  # over when it would be
    assert reached(FaultRow(0.0, 0.0, 0.0, 0.0, 0.0), tick) == 0.0
    for other in (Fault.CLOCK_DRIFTS, Fault.DEPTH_OFFSET, Fault.VOLUME_DRIFT):
        assert reached(drift._replace(kind=float(other)), tick) == 0.0


@pytest.mark.parametrize("name", NAMES)
def test_seas_are_as_high_as_the_depth_allows(name):
    """Half have waves, of swell or wind as often; up to 0.5, 1 and 2.5 m from 1, 2 and 10 m on.

    The significant height is four deviations of the surface; a float is launched in half of 2.5 m.
    """
    hull, g = load_vehicle(name).hull, load_vehicle(name).water.gravity
    found = missions(name)
    rough = np.array([m.waves[:, 0].any() for m in found])
    half(rough)
    assert all(not m.waves.any() for m, any_ in zip(found, rough, strict=True) if not any_)
    heights, periods, phases = [], [], []
    for m in (m for m, any_ in zip(found, rough, strict=True) if any_):
        w = Wave(*m.waves.T)
        assert w.k == pytest.approx(w.omega**2 / g)  # of waves in deep water
        surface = w.amplitude / [share_read(k, hull) for k in w.k]
        nearest = m.depths[:-1].min()
        most = 1.25 if name == DIVES else np.interp(nearest, [1.0, 2.0, 10.0], [0.5, 1.0, 2.5])
        heights.append(4.0 * math.sqrt(np.sum(surface**2) / 2.0) / most)
        periods.append(tuple(np.round(2.0 * math.pi / w.omega, 9)))
        phases += w.phase.tolist()
    fills(heights, 0.0, 1.0)
    fills(phases, 0.0, 2.0 * math.pi)
    assert set(periods) == {(8.0, 10.0, 12.0), (4.0, 5.0, 6.0)}
    half([one == (8.0, 10.0, 12.0) for one in periods])


@pytest.mark.parametrize(
    ("nearest", "most"), [(0.5, 0.5), (1.0, 0.5), (1.5, 0.75), (2.0, 1.0), (6.0, 1.75), (30.0, 2.5)]
)
def test_the_highest_sea_by_the_depth(nearest, most):
    hull, random, highest = load_vehicle("feup-em").hull, np.random.default_rng(9), 0.0
    for _ in range(1500):
        w = Wave(*drawing._waves(course("feup-em"), random, nearest=nearest).T)
        if w.amplitude.any():
            surface = w.amplitude / [share_read(k, hull) for k in w.k]
            highest = max(highest, 4.0 * math.sqrt(np.sum(surface**2) / 2.0))
    assert 0.98 * most < highest < most * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["feup-em", DIVES])
def test_vehicles_are_drawn_evenly_from_their_region(name, monkeypatch):
    """A box, or a ball of as many unknowns: the n-th power of its radius is uniform.

    Trim is as far off as the region leaves it open, the supply from nine tenths of it on.
    """
    drawn = []

    def noted(vehicle, s):
        drawn.append((s, member(vehicle, s)))
        return drawn[-1][1]

    monkeypatch.setattr(drawing, "member", noted)
    vehicle, own = load_vehicle(name), course(name)
    names, ball = unknowns(vehicle)
    plants = [drawing._plant(own, np.random.default_rng(n))[0] for n in range(2000)]
    shares = np.array([s for s, _ in drawn])
    assert shares.shape == (2000, len(names))
    if ball:
        fills(np.linalg.norm(shares, axis=1) ** len(names), 0.0, 1.0)
        assert np.abs(shares.mean(axis=0)).max() < 0.07
    else:
        for share in shares.T:
            fills(share, -1.0, 1.0)
    healthy = [own.medium.of(one.plant) for _, one in drawn]
    trim = [p["V_0"] - one.V_0 for p, one in zip(plants, healthy, strict=True)]
    fills(np.array(trim) / own.neutral, -1.0, 1.0)
    supply = np.array([p["supply"] for p in plants])
    whole = vehicle.supply.voltage if own.floats else np.array([one.supply for one in healthy])
    fills(supply / whole, 0.9, 1.0)


def test_the_depths_of_missions():
    """From 1 m under where the hull emerges, or 10 m of a float, to nine tenths of the limit."""
    for name, least in (("feup-em", 1.0), ("ntnu-bv", 1.0), (DIVES, 10.1)):
        own = course(name)
        assert own.depths.least == pytest.approx(least)
        assert "90% of the supervisor's" in own.depths.limit
    vehicle = load_vehicle("feup-em")
    limit = course("feup-em").depths.most / 0.9
    assert f"{limit:.4g} m" in course("feup-em").depths.limit
    asked = course_of(usual(vehicle, (1.0, limit)), (1.0, limit))
    assert asked.depths == (1.0, limit, "as asked")
    beyond = (1.0, math.nextafter(limit, math.inf) * (1.0 + 1e-12))
    with pytest.raises(InputError, match="turns the vehicle round"):
        course_of(usual(vehicle, beyond), beyond)
    with pytest.raises(InputError, match="from 1 m on"):
        course_of(limited(vehicle), (0.99, 5.0))


def shallow(vehicle, depth):
    own = vehicle.supervisor.model_copy(update={"depth_limit": depth})
    return limited(vehicle.model_copy(update={"supervisor": own}))


def test_a_limit_that_leaves_no_depth_for_a_mission_is_refused():
    vehicle = load_vehicle("feup-em")
    for limit, refused in ((1.1, True), (1.2, False)):  # nine tenths of them, and 1 m
        if refused:
            with pytest.raises(InputError, match="too shallow for a mission"):
                course_of(shallow(vehicle, limit), None)
        else:
            assert course_of(shallow(vehicle, limit), None).depths.most == pytest.approx(1.08)


def test_full_buoyancy_rises_as_fast_as_drag_allows():
    """Half way up, the lift of what the hull does not displace less against linear drag: K2 V."""
    own, vehicle = course("feup-em"), load_vehicle("feup-em")
    lift = vehicle.stroke.maximum - vehicle.hull.psi * 0.5 * own.depths.most - vehicle.trim_error
    assert own.speed == pytest.approx(vehicle.motion.K2 * lift)
    # where nothing lifts it a twentieth of the stroke does
    stroke = vehicle.stroke.maximum - vehicle.stroke.minimum
    stuck = drawing._rise_speed(own.medium, 2.0 * vehicle.stroke.maximum / vehicle.hull.psi)
    assert stuck == pytest.approx(vehicle.motion.K2 * 0.05 * stroke)
    # quadratic drag, and what the water adds half way up
    dive, floats = course(DIVES), load_vehicle(DIVES)
    middle = 0.5 * dive.depths.most
    lift = floats.stroke.maximum - dive.medium.neutral_volume(middle)
    assert dive.speed == pytest.approx(
        math.sqrt(floats.water.specific_weight * lift / floats.drag.k_dt), rel=1e-6
    )
    salt = layered.column()
    deep = course_of(usual(layered.vehicle(), (1.0, 5.0), salt), (1.0, 5.0), salt)
    p = deep.medium.plant
    assert deep.speed == pytest.approx(
        p.a_b * (p.V_max - deep.medium.neutral_volume(2.5)) / p.d_l, rel=1e-6
    )


@pytest.mark.parametrize("name", NAMES)
def test_how_long_missions_take(name):
    """20 min and the way up at 0.1 m/s, at a fifth of the speed at most; 3 min for being slower.

    A float has two hours, both ways half as long again, and an hour; all have three times the rise
    with full buoyancy beyond the time limit.
    """
    own, hull = course(name), load_vehicle(name).hull
    rise = own.depths.most - hull.emergence_depth + 1.0
    assert own.ramp == pytest.approx(min(0.1, own.speed / 5.0))
    takes, slack = 1200.0 + rise / own.ramp, 180.0
    if name == DIVES:
        takes, slack = 7200.0 + 2.0 * 1.5 * rise / own.ramp, 3600.0
    assert own.takes == pytest.approx(takes, rel=1e-12)
    assert own.slack == slack
    assert own.way(30.0) == pytest.approx(1.5 * 30.0 / own.ramp if name == DIVES else 0.0)
    assert own.time_limit == pytest.approx(takes + slack)
    assert own.end == pytest.approx(takes + 2.0 * slack + 3.0 * rise / own.speed)
    exact = limited(load_vehicle(name), own.takes)
    assert course_of(exact, None).time_limit == own.takes
    with pytest.raises(InputError, match="would be cut short"):
        course_of(limited(load_vehicle(name), own.takes * (1.0 - 1e-9)), None)


def test_healthy_missions_are_others_than_those_with_faults_of_the_same_number():
    one, other = (draw(course("feup-em"), seed=3, number=7, healthy=well) for well in (True, False))
    assert one.condition.seed != other.condition.seed
    assert one.fault_rows.shape == (0, len(FaultRow._fields))
    assert one.condition.quiet_at == one.turns[-1]
    assert dataclasses.asdict(one)["number"] == 7
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.number = 8
