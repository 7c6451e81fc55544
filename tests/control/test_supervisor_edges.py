"""The supervisor right at its limits: what is still good there, and what it begins with."""

import math
from contextlib import nullcontext

import pytest

from swimbladder.control.law import NEVER, leaves
from swimbladder.control.supervisor import (
    GREW,
    SUPERVISOR,
    PushWatch,
    Watched,
    believable,
    bring_up,
    drag_volume,
    enough,
    rests,
    watch_deep,
    watch_motion,
    watch_proof,
    watch_push,
    watch_sameness,
    watch_stops,
    way_to_stop,
)
from swimbladder.control.supervisor_limits import arming_parameters, supervisor_parameters, ticks
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import Positioner, Supervisor
from tests.vehicles import LITERAL, body, paper

PAPER = supervisor_parameters(paper(), 0.3)


def test_a_depth_may_change_by_just_what_it_may():
    """In a tick by `step`, in two by twice the fastest and the jump."""
    p, last = PAPER.depth, 2.0
    at_most = {0: p.step, 2: 2 * p.fastest + p.jump}
    for since, change in at_most.items():
        assert believable(p, last + change, last, since) == (last + change - last <= change)
        assert believable(p, last + 0.999 * change, last, since)
        assert not believable(p, last + 1.001 * change, last, since)
    assert believable(p, p.step, 0.0, 0)


def test_a_depth_that_the_sensor_can_just_mean_is_one():
    """From 1 m of weather above that in air to 1.5 times the deepest, 350 cm3 / psi, and 10 m."""
    p, hull = PAPER.depth, paper().hull
    assert p.depth_least == pytest.approx(hull.emergence_depth - hull.height - 1.0)
    assert p.depth_most == pytest.approx(1.5 * 350.0 / 4.04 + 10.0)
    for end, beyond in ((p.depth_least, -math.inf), (p.depth_most, math.inf)):
        assert believable(p, end, end, 0)
        assert not believable(p, math.nextafter(end, beyond), end, 0)


def test_a_block_is_found_inward_of_where_pushes_ended_before():
    """One that ends short of it takes two away; from none on a new place counts, six times."""
    p = PAPER._replace(rate=PAPER.rate._replace(stop_rate=1e-6))
    s = SUPERVISOR.initial(p, Watched(2.0, 0.1, 0.0, 12.0, False, 0, 0), 0.0).rate
    counts = []
    for volume in [5e-5] * 3 + [2e-5] * 8:
        s = watch_stops(p, s, 2e-6, 0.0, volume)
        counts.append(s.stops)
    assert counts == [1, 2, 3, 1, 0, 1, 2, 3, 4, 5, 6]


def test_the_share_of_turns_is_a_mean_of_200_ticks():
    """Of a depth that turns at every tick 1 - 0.995^n is seen after n: 0.42 of it after 109."""
    calm = Watched(2.0, 0.1, 1e-5, 12.0, False, 0, 0)
    watch = SUPERVISOR.initial(PAPER, calm, 0.0).same._replace(sank=True)
    before, depth, turns = 2.001, 2.0, 0
    while watch.noisy < PAPER.same.noisy:
        watch = watch_sameness(PAPER, watch, depth, before, 0.0, old=False, resting=False)
        before, depth, turns = depth, before, turns + 1
    assert turns == math.ceil(math.log(1.0 - 0.42) / math.log(1.0 - 1.0 / 200.0)) == 109


@pytest.mark.parametrize(("depth", "metres"), [(20.0, 0.0), (22.0, 2.0), (15.0, 5.0)])
def test_the_neutral_volume_may_differ_by_more_the_farther_off_it_was_learnt(depth, metres):
    """17.5 cm3, and 30 % of psi for each metre from where the dive has shown it, at 20 m."""
    allowed, room = 17.5e-6 + 0.3 * 4.04e-6 * metres, 8.75e-5
    s = SUPERVISOR.initial(PAPER, Watched(2.0, 0.1, 0.0, 12.0, False, 0, 0), 0.0).motion
    s = s._replace(z1=depth, z2=depth, own_depth=20.0, known=PAPER.motion.known)
    for n, wrong in ((0.99 * allowed, 0), (1.01 * allowed, 1), (-1.01 * allowed, 1)):
        begun = s._replace(n1=n, n2=n)
        after = watch_motion(PAPER, begun, depth, n, room, stands=True, anew=False)
        assert after.wrong == wrong


@pytest.mark.parametrize(("turns", "then"), [(0, 0), (1, 1), (2, 1), (3, 1), (GREW, GREW)])
def test_a_tick_that_is_lost_ends_a_try_of_either_kind(turns, then):
    """Also the first of one at the inner end; what grew the other way round stays so."""
    begun = PushWatch(phase=0, pushed=-3.5e-4, astray=0, turns=turns)
    push = watch_push(PAPER, begun, -3.5e-4, False, False, False, high=False, blind=True)
    assert push.turns == then


def test_a_slow_piston_is_pushed_for_twice_its_stroke_before_it_rests():
    """Where that is longer than 5 min, docs/explanation/supervisor.md."""
    vehicle = load_vehicle("ntnu-bv")
    travel = vehicle.stroke.maximum - vehicle.stroke.minimum
    for seconds, stall in ((100.0, 300.0), (200.0, 400.0)):
        actuator = Positioner(speed=travel / seconds, piston_area=1.0)
        slow = vehicle.model_copy(update={"actuator": actuator})
        assert supervisor_parameters(slow, 0.5).push.stall == math.ceil(stall / 0.5)


@pytest.mark.parametrize("start", [0.0, 4.5e-6, 2e-5])
def test_a_push_of_a_pump_makes_up_for_what_its_start_falls_short(start):
    """As slow as it gets it delivers what it does in 10 s, and a tick's more at most."""
    vehicle = load_vehicle("example-float")
    engine = vehicle.engine.model_copy(update={"start_volume": start})
    p = supervisor_parameters(vehicle.model_copy(update={"actuator": engine}), 0.5)
    delivered = p.deep.turn_rate * p.push.again * 0.5 - start
    assert 0.0 <= delivered / p.deep.turn_rate - 10.0 < 0.5


def test_the_voltage_that_holds_makes_up_for_what_leaks_in():
    """K1 A (u - c z) = k_l z at the deepest: where the hull or the motor ends it."""
    gain, load, leaks = 0.444e-3 * 75e-4, 0.07707, 5e-8  # m3/s/V, V/m, m2/s
    actuator = paper().actuator.model_copy(update={"k_l": leaks})
    p = supervisor_parameters(paper(actuator=actuator), 0.3)
    stalls = 0.95 * gain * 9.6 / (gain * load + leaks)
    assert p.deep.deepest == pytest.approx(min(350.0 / 4.04, stalls))
    assert gain * (p.push.hold_command - load * p.deep.deepest) == pytest.approx(
        leaks * p.deep.deepest
    )


def test_at_the_surface_with_the_room_that_it_has_it_may_rest():
    p, room = PAPER.rest, 4e-5
    assert rests(p, p.surface, -room, room)
    assert not rests(p, math.nextafter(p.surface, 1.0), -room, room)
    assert not rests(p, p.surface, math.nextafter(-room, -1.0), room)


def test_a_drag_that_jumps_is_laminar_up_to_the_speed_of_its_jump():
    """Eq. (13): up to epsilon, and at it."""
    vehicle = paper(**body(LITERAL))
    p = supervisor_parameters(vehicle, 0.3).motion
    at, beyond = drag_volume(p, p.epsilon), drag_volume(p, math.nextafter(p.epsilon, 1.0))
    assert at == pytest.approx(LITERAL.k_dl * p.epsilon / vehicle.water.specific_weight)
    assert beyond == pytest.approx(LITERAL.k_dt * p.epsilon**2 / vehicle.water.specific_weight)
    assert beyond < 0.9 * at
    assert drag_volume(p, -p.epsilon) == -at


def test_a_vehicle_that_sinks_at_an_even_speed_goes_on_for_ever():
    """With 50 cm3 too little and no stroke left: however slowly, it does not stop."""
    assert way_to_stop(PAPER, 0.1, 5e-5, 0.0) == 1e6
    assert way_to_stop(PAPER, 0.1, 0.0, 3e-4) < 10.0


def test_it_begins_with_nothing_counted_and_nothing_held_against_the_vehicle():
    seen = Watched(2.0, 0.1, 3e-5, 12.0, False, 0, 0)
    begun = leaves(SUPERVISOR.initial(PAPER, seen, 0.0))
    others = {name: value for name, value in begun.items() if value != 0.0}
    least = PAPER.volume.volume_least
    assert others["weight"] == 0.5  # of what the dive shows against what was known before
    assert others["shown"] == others["pushed"] == least
    assert others["allowed"] == 1e6  # any depth
    assert set(others) <= {"weight", "shown", "pushed", "allowed", "since", "block", "last_depth"}


@pytest.mark.parametrize("tick", [0.3, 1.0])
def test_times_are_those_of_the_page(tick):
    """docs/explanation/supervisor.md: 10 s, 5 s, the mean of 200 ticks, a minute."""
    known = Supervisor(neutral_change="40 cm3")  # so far off, it moves 2 cm in less than 5 s
    p = supervisor_parameters(paper(supervisor=known), tick)
    assert p.motion.known == math.ceil(10.0 / tick)
    assert p.rest.still == math.ceil(5.0 / tick)
    assert p.same.noisy_weight == pytest.approx(1.0 / 200.0)
    assert supervisor_parameters(load_vehicle("example-float"), tick).progress.light == math.ceil(
        60.0 / tick
    )


def test_a_quarter_of_a_positioner_is_one_of_its_travel():
    vehicle = load_vehicle("ntnu-bv")
    travel = vehicle.stroke.maximum - vehicle.stroke.minimum
    assert supervisor_parameters(vehicle, 0.5).push.quarter == pytest.approx(0.25 * travel)
    assert PAPER.push.quarter == 3.0  # V


def test_shares_are_those_of_the_page():
    """The neutral volume may change in a dive by a fifth of its range; half the full rate is fast.

    The range is a quarter of half the stroke of 350 cm3; at 12 V the motor makes 40 cm3/s.
    """
    assert PAPER.motion.neutral_change == pytest.approx(0.2 * 0.25 * 350e-6)
    assert PAPER.push.away_fast == pytest.approx(0.5 * 12.0 * 0.444e-3 * 75e-4 * 0.3)
    ends = PAPER.volume.volume_low, PAPER.volume.volume_high  # a twentieth of the stroke from them
    assert ends == pytest.approx((-350e-6 + 0.05 * 700e-6, 350e-6 - 0.05 * 700e-6))


@pytest.mark.parametrize(("tick", "tau"), [(0.3, 7.0), (0.7, 7.0), (1.0, 10.0)])
def test_a_low_pass_takes_7_s_or_ten_ticks(tick, tau):
    p = supervisor_parameters(paper(), tick)
    assert p.motion.per_tau == pytest.approx(1.0 / tau)
    assert p.deep.lag == pytest.approx(0.3 * tau + max(1.0, 2.0 * tick))  # and a push comes late


def test_a_vehicle_may_be_armed_as_deep_as_it_comes_up_from():
    """A hull that is rated for just the depth at which one that sinks is armed, or a hair less."""
    armed = {}
    for rated in (50.0, 20.0):
        vehicle = paper(hull=paper().hull.model_copy(update={"depth_limit": rated}))
        p = supervisor_parameters(vehicle, 0.3)
        found = arming_parameters(vehicle, p)
        armed[rated] = found.submerged + found.under * p.depth.fastest
    assert armed[50.0] == armed[20.0] < 20.0
    for rated, refused in ((armed[20.0], False), (math.nextafter(armed[20.0], 0.0), True)):
        vehicle = paper(hull=paper().hull.model_copy(update={"depth_limit": rated}))
        p = supervisor_parameters(vehicle, 0.3)
        assert p.deep.deepest == rated
        with pytest.raises(InputError, match="may be armed") if refused else nullcontext():
            arming_parameters(vehicle, p)


@pytest.mark.parametrize(("name", "positioner"), [("feup-em", 0.0), ("ntnu-bv", 1.0)])
def test_a_board_is_disarmed_as_its_actuator_is(name, positioner):
    vehicle = load_vehicle(name)
    p = supervisor_parameters(vehicle, 0.5)
    assert (p.rate.positioner, arming_parameters(vehicle, p).positioner) == (positioner,) * 2


@pytest.mark.parametrize(
    ("blind", "below", "turns"), [(False, 1e-9, 2), (True, 1e-9, 0), (False, 0.0, 0)]
)
def test_a_push_that_stands_is_tried_the_other_way_at_the_inner_end_where_it_is_seen(
    blind, below, turns
):
    p, volume = PAPER, PAPER.volume.volume_low - below
    begun = PushWatch(phase=0, pushed=volume, astray=p.push.astray, turns=0)
    after = watch_push(p, begun, volume, True, sinks=False, lifts=False, high=False, blind=blind)
    assert after.turns == turns


@pytest.mark.promise("swapped-wires", faults=["actuator slow", "actuator reversed"])
@pytest.mark.parametrize(
    ("lifts", "astray", "below", "turns"),
    [(False, 60, 0.0, 0), (False, 60, 1e-9, 3), (True, 60, 1e-9, 0), (True, 0, 1e-9, 3)],
)
def test_a_volume_that_falls_slowly_is_tried_unless_the_motion_shows_that_the_vehicle_is_light(
    lifts, astray, below, turns
):
    """By `away`; what falls at half of the full rate does so whatever the motion, which lags."""
    p = PAPER
    begun = PushWatch(phase=0, pushed=0.0, astray=astray, turns=0)
    volume = -p.push.away - below
    after = watch_push(p, begun, volume, True, sinks=False, lifts=lifts, high=False, blind=False)
    assert after.turns == turns


@pytest.mark.parametrize(("lifts", "limit"), [(False, "again"), (True, "astray")])
def test_a_try_that_moves_nothing_ends_sooner_where_the_vehicle_is_light(lifts, limit):
    p = PAPER
    for short, turns in ((1, 3), (0, 1)):
        ticks = getattr(p.push, limit) - short
        s = PushWatch(phase=0, pushed=1e-4, astray=ticks, turns=3)
        after = watch_push(p, s, 1e-4, True, sinks=False, lifts=lifts, high=False, blind=False)
        assert after.turns == turns


def test_a_turned_push_that_is_up_to_the_limit_holds():
    """At just the volume that counts as all out, where it has not grown for long."""
    high = PAPER.volume.volume_high
    s = SUPERVISOR.initial(PAPER, Watched(2.0, 0.1, high, 12.0, False, 0, 0), 0.0)
    push = PushWatch(phase=0, pushed=high, astray=PAPER.push.astray, turns=GREW)
    s = s._replace(push=push, recovery=s.recovery._replace(reason=1, reasons=1))
    for volume, command in ((high, 0.0), (math.nextafter(high, 0.0), -12.0)):
        now = s._replace(volume=s.volume._replace(volume=volume, measured=True))
        assert bring_up(PAPER, now, True, 0).command == command


def test_a_time_of_more_ticks_than_are_counted_is_refused():
    assert ticks(NEVER - 1.0, 1.0) == NEVER - 1
    with pytest.raises(InputError, match=rf"counts to {NEVER - 1}"):
        ticks(float(NEVER), 1.0)


def test_a_way_that_ends_just_where_the_vehicle_still_turns_is_none_too_deep():
    s = SUPERVISOR.initial(PAPER, Watched(2.0, 0.1, 0.0, 12.0, False, 0, 0), 0.0)
    depth, n = 20.0, 0.0  # m, m3: 0.1 m/s behind its low passes
    s = s._replace(motion=s.motion._replace(z1=depth - 0.35, z2=depth - 0.35))
    first, lacks = depth - s.motion.z1, PAPER.deep.heavier - n
    speed = (first + first) * PAPER.motion.per_tau
    heavy = max(lacks - drag_volume(PAPER.motion, speed), 0.0)
    speed = speed + PAPER.deep.lag * PAPER.deep.force * heavy
    ends = depth + way_to_stop(PAPER, speed, lacks, PAPER.deep.largest)
    assert depth + 0.1 < ends < 80.0
    for deepest, count in ((ends, 0), (math.nextafter(ends, 0.0), 1)):
        p = PAPER._replace(deep=PAPER.deep._replace(deepest=deepest))
        assert watch_deep(p, s, depth, n, 0.0) == count


def test_a_vehicle_on_its_way_down_has_to_show_more_the_faster_it_is():
    """By what stops it at a speed w: w sqrt(psi/a_b), docs/explanation/supervisor.md."""
    depth, asked, neutral = 5.0, 8.0, PAPER.neutral.psi * 5.0
    for speed in (0.0, 0.05, 0.1):
        begun = SUPERVISOR.initial(PAPER, Watched(depth, 0.1, 0.0, 12.0, False, 0, 0), 0.0)
        behind = depth - speed / PAPER.motion.per_tau
        s = begun._replace(motion=begun.motion._replace(z1=behind, z2=behind))
        seen = Watched(depth, 0.1, neutral, 12.0, False, 0, 0, reference=asked)
        lacks, _ = watch_proof(PAPER, s, seen, neutral, False)
        stops = speed * math.sqrt(PAPER.neutral.psi / PAPER.deep.force)
        assert lacks == pytest.approx(enough(PAPER, asked - depth) + stops + PAPER.push.grown)
