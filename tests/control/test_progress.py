"""Whether a float comes nearer to where it is sent, and needs no more volume than it can."""

import math
from dataclasses import replace

import pytest

from swimbladder.control.law import NEVER, leaf_names
from swimbladder.control.registry import bind
from swimbladder.control.supervisor import (
    SUPERVISOR,
    ProgressWatch,
    Reason,
    SupervisorParameters,
    Watched,
    watch_progress,
)
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop.floats import flown_law
from swimbladder.vehicle import Supervisor

FLOAT = load_vehicle("example-float")
ALL = supervisor_parameters(FLOAT, 1.0)
LIMITS = ALL.progress
BEGUN = ProgressWatch(target=200.0, farthest=100.0, waited=5, light=0, drifted=0.0)


def seen(depth: float, reference: float = 200.0, computed: float = 0.0) -> Watched:
    return Watched(depth, 0.1, 0.0, 14.0, False, 0, 0, reference, computed)


def watched(begun: ProgressWatch, now: Watched, *, rises: bool = False) -> ProgressWatch:
    s = SUPERVISOR.initial(ALL, now, 0.0)
    before = now.depth + (0.03 if rises else 0.0)
    motion = s.motion._replace(z1=before)
    return watch_progress(ALL, s._replace(progress=begun, motion=motion), now)


def test_the_limits_are_those_of_law_and_stroke():
    """Three bands of 10 m; 8 of its longest waits; half of the stroke that is left."""
    law, parameters, *_ = bind(FLOAT.controller)
    assert LIMITS.arrived == pytest.approx(3.0 * parameters.tolerance)
    assert LIMITS.waits == 8 * law.longest_wait(parameters)
    assert LIMITS.light_volume == FLOAT.trim_error
    assert LIMITS.light_range == pytest.approx(0.5 * (FLOAT.stroke.maximum - FLOAT.trim_error))
    assert LIMITS.light_smoothing == pytest.approx(1.0 / 21601.0)
    assert LIMITS.light_slope == FLOAT.hull.psi
    trimmed = FLOAT.model_copy(
        update={"trim_error": 2e-5, "supervisor": Supervisor(neutral_range="40 cm3")}
    )
    limits = supervisor_parameters(trimmed, 1.0).progress
    assert (limits.light_volume, limits.light_range) == pytest.approx((2e-5, 4e-5))
    with pytest.raises(InputError, match="full buoyancy not lift"):
        supervisor_parameters(
            FLOAT.model_copy(update={"supervisor": Supervisor(neutral_range="310 cm3")}), 1.0
        )


@pytest.mark.parametrize("name", ["feup-em", "ntnu-bv"])
def test_a_vehicle_whose_volume_is_measured_is_held_against_its_model_instead(name):
    off = supervisor_parameters(load_vehicle(name), 0.5).progress
    assert off.waits == off.light == NEVER
    assert math.isinf(off.light_range)


def test_a_law_that_says_no_band_may_take_any_time():
    alone = FLOAT.model_copy(update={"controller": None})
    limits = supervisor_parameters(alone, 1.0).progress
    assert limits.waits == NEVER
    assert limits.light_range == LIMITS.light_range


def test_it_is_as_patient_as_the_slowest_of_the_laws_under_it():
    law, own, *_ = bind(FLOAT.controller)
    wide, slow = own._replace(tolerance=25.0), own._replace(dead=100.0)
    limits = supervisor_parameters(FLOAT, 2.0, laws=[(law, wide), (law, slow)]).progress
    assert limits.arrived == pytest.approx(75.0)
    assert limits.waits == 8 * 100 / 2
    no_band = replace(law, band="")
    assert supervisor_parameters(FLOAT, 2.0, laws=[(no_band, own)]).progress.waits == NEVER
    for dead, waits in ((120.0, 8 * 120), (121.0, NEVER)):  # seldom: it may drift for hours
        seldom = own._replace(dead=dead)
        assert supervisor_parameters(FLOAT, 1.0, laws=[(law, seldom)]).progress.waits == waits
    watch = flown_law(FLOAT, law, slow, 2.0, True)[2]
    names = leaf_names(SupervisorParameters)
    assert watch.limits[names.index("waits")] == limits.waits


@pytest.mark.parametrize(
    ("now", "farthest", "waited"),
    [
        (seen(100.0), 100.0, 6),  # no nearer
        (seen(100.05), 100.0, 6),  # by less than counts
        (seen(100.2), 99.8, 0),
        (seen(90.0), 110.0, 6),  # away
        (seen(300.2), 100.2, 6),  # beyond it, and as far
        (seen(299.0), 99.0, 0),
        (seen(100.0, 150.0), 50.0, 0),  # asked for another depth
        (seen(189.0), 11.0, 0),  # arrived
        (seen(187.0, computed=1.0), 13.0, 0),
    ],
)
def test_what_counts_as_coming_nearer(now, farthest, waited):
    after = watched(BEGUN, now)
    assert after.farthest == pytest.approx(farthest)
    assert after.waited == waited
    assert after.target == now.reference


def test_a_float_that_rests_where_it_is_sent_or_at_the_surface_may_wait():
    resting = BEGUN._replace(farthest=5.0)
    assert watched(resting, seen(195.0)).waited == 0
    assert watched(BEGUN, seen(0.3)).waited == 0
    at_surface = watched(BEGUN, seen(0.3, -1.0))
    assert (at_surface.target, at_surface.waited) == (0.0, 0)


@pytest.mark.parametrize("reference", [math.nan, math.inf, -math.inf])
def test_a_set_point_that_is_none_says_nothing(reference):
    after = watched(BEGUN, seen(100.0, reference))
    assert after._replace(drifted=0.0) == BEGUN


@pytest.mark.parametrize(
    ("volume", "depth", "given", "counts"),
    [
        (1.51e-4, 2.0, {}, True),
        (1.49e-4, 2.0, {}, False),
        (1.51e-4, 2.0, {"rises": True}, False),
        (1.51e-4, 0.3, {}, False),
        # a hull that is stiffer than the water needs less at depth: 49 cm3 at 1,000 m
        (1.02e-4, 1000.0, {}, True),
        (1.00e-4, 1000.0, {}, False),
        (math.nan, 2.0, {}, False),
    ],
)
def test_volume_beyond_what_it_can_need_has_to_lift_it(volume, depth, given, counts):
    begun = BEGUN._replace(light=4)
    after = watched(begun, seen(depth, computed=volume), **given)
    assert after.light == (5 if counts else 2)


def test_what_is_off_for_hours_is_taken_for_runs_that_are_not_known_so_well():
    """A low pass of 6 h from the surface on: of 90 cm3 off it has 1 - 1/e then; no less than 0."""
    way, needed = BEGUN, FLOAT.trim_error + 2.0 * FLOAT.hull.psi
    for _ in range(21600):
        way = watched(way, seen(2.0, computed=needed + 9e-5))
    assert way.drifted == pytest.approx(9e-5 * (1.0 - math.exp(-1.0)), rel=1e-3)
    assert watched(way, seen(2.0, computed=1.51e-4)).light == 0
    assert watched(way, seen(2.0, computed=1.51e-4 + way.drifted)).light == 1
    assert watched(way, seen(0.2, computed=9e-5)).drifted == 0.0
    assert watched(way, seen(2.0, computed=math.nan)).drifted == 0.0
    heavy = watched(BEGUN._replace(drifted=-1e-4), seen(2.0, computed=1.51e-4))
    assert heavy.light == 1


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"waited": LIMITS.waits - 2}, 0),
        ({"waited": LIMITS.waits - 1}, Reason.NOT_MOVING_AS_MODELLED),
        ({"light": LIMITS.light - 2}, 0),
        ({"light": LIMITS.light - 1}, Reason.NOT_MOVING_AS_MODELLED),
    ],
)
@pytest.mark.promise("comes-nearer")
def test_the_last_tick_of_them_is_a_reason(changed, reason):
    first = seen(100.0, computed=2e-4)
    state = SUPERVISOR.step(ALL, SUPERVISOR.initial(ALL, first, 0.0), first, 0.0)[1]
    state = state._replace(progress=state.progress._replace(**changed))
    command, after, _ = SUPERVISOR.step(ALL, state, first, 0.0)
    assert after.recovery.reason == reason
    assert command == (1.0 if reason else 0.0)
