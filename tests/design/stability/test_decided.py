"""Floats: what decays from decision to decision, what grows at rest, and limit cycles flown."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder import load_vehicle
from swimbladder.control.law import smooth
from swimbladder.control.registry import bind
from swimbladder.design.linear.pump_valve import drive_rates, moved_by_volume
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability import stability
from swimbladder.design.stability.around import around_decisions
from swimbladder.design.stability.cycles import hunting
from swimbladder.design.tuning.margins import decisions_of, radius_of, rest_of
from swimbladder.design.tuning.region import member
from swimbladder.design.tuning.trial import fly
from swimbladder.errors import InputError
from swimbladder.physics.dynamics import acceleration, plant
from swimbladder.sim.closed_loop.water import medium_of
from tests.quoted import refused

FLOAT = load_vehicle("example-float")
LAW, OWN = bind(FLOAT.controller)
BOUND = BoundLaw(LAW, OWN)
DEPTHS = (100.0, 800.0, 1500.0)


def with_psi(psi: float):
    return FLOAT.model_copy(update={"hull": FLOAT.hull.model_copy(update={"psi": psi})})


def with_law(**changes: float):
    numbers = FLOAT.controller.parameters | changes
    own = FLOAT.controller.model_copy(update={"parameters": numbers})
    return FLOAT.model_copy(update={"controller": own})


def test_the_search_finds_what_random_points_of_the_region_have():
    found = around_decisions(FLOAT, BOUND, depths=DEPTHS)
    assert found.stable
    assert 0.3 < found.on_grid <= found.radius < 1.0
    rates, random = drive_rates(FLOAT, DEPTHS), np.random.default_rng(5)
    for _ in range(40):
        s = random.normal(size=4)
        one = member(FLOAT, s / np.linalg.norm(s) * random.uniform() ** 0.25)
        for d in decisions_of(BOUND):
            assert radius_of(FLOAT, [one], d, rates, 2) <= found.radius + 1e-6
    assert all(w.ratio == pytest.approx(1.0, rel=1e-3) for w in found.ways)


@pytest.mark.parametrize(("share", "grows"), [(1.0, False), (1.7, False), (2.6, True)])
def test_flights_grow_from_decision_to_decision_where_the_map_says_so(share, grows):
    """Without bands and steps, from a speed that is 2 % off: how much each change is of the last.

    The rise to the surface is corrected both ways. 1500 m at 10 cm/s take 20 decisions.
    """
    bound = BoundLaw(LAW, OWN._replace(coefficient=share * OWN.coefficient))
    found = around_decisions(FLOAT, bound, depths=DEPTHS)
    rises = [w.nominal for w in found.ways if w.decision.way.name == "ascent"]
    assert (max(rises) >= 1.0) == grows
    p = plant(moved_by_volume(FLOAT))
    speed = -0.98 * OWN.ascent_speed
    heavy = -p.d_t / p.a_b * speed * speed
    flown = fly(
        FLOAT,
        bound._replace(parameters=smooth(LAW, bound.parameters)),
        target=0.0,
        start_depth=1500.0,
        duration=1100.0,
        start_speed=speed,
        start_volume=FLOAT.neutral_volume(1500.0) - heavy,
    )
    changes = np.abs(flown.actions[0][:, 1])
    # The nominal way needs a change each time (the neutral volume falls): growth stands out of it.
    assert (changes[8:].max() > 3.0 * changes[:3].max()) == grows


def test_an_unstable_law_is_said_with_its_parameters():
    wild = with_law(coefficient="3000 cm3 s2/m2")
    found = stability(wild, depth_range=(100.0, 1500.0), maps=False)
    assert not found.stable
    assert found.sentences[0].startswith("UNSTABLE: with drag -")
    assert found.to_dict()["decisions"]["largest_eigenvalue"] > 1.0


def test_drag_that_is_less_on_the_way_up_counts_there():
    """A coefficient from the drag of sinking asks for too much where the drag of rising is 0.4."""
    lighter = FLOAT.motion.drag.model_copy(update={"rising_ratio": 0.4})
    motion = FLOAT.motion.model_copy(update={"drag": lighter})
    found = around_decisions(
        FLOAT.model_copy(update={"motion": motion}), BOUND, depths=(100.0, 1500.0)
    )
    assert not found.stable
    assert not found.worst.down
    ratios = {w.decision.speed > 0.0: w.ratio for w in found.ways}
    assert ratios == {True: pytest.approx(1.0, rel=1e-3), False: pytest.approx(2.5, rel=1e-3)}


def test_a_hull_that_gives_way_faster_than_is_decided_is_unstable_at_rest():
    found = stability(with_psi(2e-6), depth_range=(20.0, 100.0), maps=False)
    assert not found.stable
    rest = found.decided.rest
    assert rest.band > rest.tolerance
    assert "UNSTABLE at rest" in " ".join(found.sentences)
    p = plant(moved_by_volume(with_psi(rest.psi)))
    tiny = 1e-6

    def motion(_, y):
        return [y[1], acceleration(p.psi * 50.0 + p.V_0, 50.0 + y[0], y[1], p)]

    sigma = 1.0 / rest.growth_time
    grown = solve_ivp(motion, (0.0, rest.growth_time), [tiny, sigma * tiny], rtol=1e-9, atol=1e-15)
    assert grown.y[0, -1] / tiny == pytest.approx(math.e, rel=1e-3)


def test_a_swing_halves_in_the_time_that_is_stated():
    rest = rest_of(FLOAT, BOUND, drive_rates(FLOAT, DEPTHS), medium_of(FLOAT, None, reach=0.0))
    p = plant(moved_by_volume(with_psi(rest.psi)))._replace(d_t=plant(moved_by_volume(FLOAT)).d_t)
    amplitude = 0.05 * rest.tolerance  # where the drag takes little in a period
    halves = rest.halves * rest.tolerance / amplitude

    def motion(_, y):
        return [y[1], acceleration(p.psi * 500.0 + p.V_0, 500.0 + y[0], y[1], p)]

    def turns(_, y):
        return y[1]

    flown = solve_ivp(
        motion, (0.0, 1.5 * halves), [amplitude, 0.0], events=turns, rtol=1e-9, atol=1e-12
    )
    time, swing = flown.t_events[0][-1], abs(flown.y_events[0][-1][0])
    assert time > halves
    # A' = -q A^2: one over the amplitude grows steadily
    assert 1.0 / swing == pytest.approx((1.0 + time / halves) / amplitude, rel=0.02)


def test_limit_cycles_on_the_way_are_as_predicted():
    found = {c.predicted.source: c for c in hunting(FLOAT, BOUND, depth=800.0, depths=DEPTHS[::2])}
    for way in ("sinking", "rising"):
        c = found[f"compressibility, {way}"]
        amplitude, period = c.errors
        assert abs(period) < 0.05
        assert abs(amplitude) < 0.15
        # the law of the balance, written out: 2 c_true dw/|psi|, at the next decision
        lost = OWN.speed_band - 0.5 * OWN.speed_step
        p = plant(moved_by_volume(FLOAT))
        time = 2.0 * (p.d_t / p.a_b) * lost / 4.9e-8
        assert 0.0 <= c.predicted.cycle.period - time < OWN.dead + OWN.run
    assert found["step of the volume"].predicted.cycle is None
    assert not found["step of the volume"].seen.cycles
    leak = found["leakage"]
    assert leak.seen.farthest < 1.5 * leak.predicted.depth_amplitude


def test_a_way_that_is_too_short_shows_no_cycle():
    cycles = hunting(FLOAT, BOUND, depth=200.0, depths=(100.0, 500.0))
    assert all(c.seen is None for c in cycles if c.predicted.source.startswith("compress"))


def test_a_step_of_the_volume_that_is_too_coarse_goes_to_and_fro_within_its_bound():
    coarse = BoundLaw(LAW, OWN._replace(volume_step=2e-6))
    (c,) = (
        c
        for c in hunting(FLOAT, coarse, depth=800.0, depths=DEPTHS[::2])
        if c.predicted.source == "step of the volume"
    )
    assert c.predicted.depth_amplitude == pytest.approx(0.5 * 2e-6 / 4.9e-8)
    assert c.seen.cycles
    assert c.seen.farthest < c.predicted.depth_amplitude + OWN.tolerance


def test_a_hull_that_gives_way_hunts_within_its_bound():
    (c,) = (
        c
        for c in hunting(with_psi(2e-8), BOUND, depth=800.0, depths=DEPTHS[::2])
        if c.predicted.source == "hull that gives way"
    )
    assert c.seen.farthest < 1.2 * c.predicted.depth_amplitude


def test_it_comes_back_from_everywhere_within_its_stroke(tmp_path):
    found = stability(FLOAT, depth_range=(100.0, 500.0), cells=5, keep=tmp_path)
    assert found.stable
    assert all(m.count(v) == 0 for m in found.maps for v in (2, 3, 4))
    assert found.within == pytest.approx(1.5 * 400.0 / 0.1 + 3600.0)


def test_what_has_no_samples_is_refused_gains_late_by_one():
    with refused(InputError, field="robustness"):
        stability(FLOAT, depth_range=(100.0, 500.0), robustness=True)
    with refused(InputError, field="laws"):
        stability(FLOAT, depth_range=(100.0, 500.0), laws=("adrc",))
