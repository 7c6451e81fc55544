"""The law of Argo floats: each of its rules, and what a vehicle of 4000 m does by it."""

import math

import pytest

from swimbladder.control.argo import ARGO, ArgoParameters, ArgoState, initial, pumped, step, ways
from swimbladder.control.law import Measurement

P = ArgoParameters(
    ascent_interval=120.0,
    ascent_progress=10.0,
    pump_volume=8e-6,
    pump_loss=1e-9,
    descent_interval=300.0,
    descent_progress=4.0,
    valve_volume=9e-6,
    valve_depth=0.0,
    gain=2e-8,
    tolerance=50.0,
    slow_depth=150.0,
    slow_progress=4.0,
    slow_share=0.4,
    depth_step=1.0,
)


def decided(reference: float, before: float | None, depth: float, p=P) -> tuple[float, float]:
    """Return the change of volume [m3] and the time to the next check [s]."""
    state = ArgoState(0.0, reference, 0.0) if before is None else ArgoState(1.0, reference, before)
    change, after, wait = step(p, state, Measurement(0.0, depth, 0.0), reference)
    assert after == ArgoState(1.0, reference, round(depth))
    return change, wait


@pytest.mark.parametrize(
    ("before", "depth", "acts"),
    [
        (None, 3960.0, True),  # the first check
        (3960.0, 3951.0, True),
        (3960.0, 3950.0, False),
        (3960.0, 3950.4, False),  # seen as 3950
        (3960.0, 3950.6, True),  # seen as 3951
        (3960.0, 3970.0, True),
    ],
)
def test_rising_the_pump_runs_where_it_came_up_by_too_little(before, depth, acts) -> None:
    change, wait = decided(0.0, before, depth)
    assert change == pytest.approx((8e-6 - 1e-9 * round(depth)) * acts)
    assert wait == 120.0


@pytest.mark.parametrize(
    ("before", "depth", "change"),
    [
        (None, 500.0, 0.0),  # nothing is known yet
        (500.0, 504.0, 0.0),
        (500.0, 503.0, -9e-6),
        (2695.0, 2695.0, -2e-8 * 305.0),  # near the target less is enough
        (2950.0, 2950.0, 0.0),  # the tolerance is of the band
        (3050.0, 3050.0, 0.0),
        (3051.0, 3051.0, 2e-8 * 51.0),  # too deep
        (3700.0, 3700.0, 8e-6 - 1e-9 * 3700.0),
        (3704.0, 3700.0, 0.0),  # it comes back by itself
        (3703.0, 3700.0, 8e-6 - 1e-9 * 3700.0),
    ],
)
def test_to_a_depth_it_acts_where_it_went_by_too_little(before, depth, change) -> None:
    assert decided(3000.0, before, depth) == (pytest.approx(change), 300.0)


@pytest.mark.parametrize(
    ("before", "depth", "share"),
    [
        (155.0, 151.0, 1.0),  # by 4 m, and 10 are enough
        (153.0, 149.0, 0.0),  # there 4 are
        (152.0, 149.0, 0.4),
        (None, 149.0, 0.4),
        (10.0, 3.0, 0.0),
    ],
)
def test_near_the_surface_it_comes_up_slower(before, depth, share) -> None:
    change, wait = decided(0.0, before, depth)
    assert change == pytest.approx(share * (8e-6 - 1e-9 * depth))
    assert wait == 120.0


@pytest.mark.parametrize("depth", [0.0, 30.0, 300.0, 2000.0])
def test_an_opening_lets_in_less_in_shallow_water(depth) -> None:
    shallow = P._replace(valve_depth=300.0)
    change, _ = decided(3000.0, depth, depth, shallow)
    assert change == pytest.approx(-9e-6 * depth / math.hypot(depth, 300.0))


def test_another_depth_is_another_way() -> None:
    state = ArgoState(1.0, 3000.0, 2990.0)
    change, after, _ = step(P, state, Measurement(0.0, 2990.0, 0.0), 4000.0)
    assert (change, after) == (0.0, ArgoState(1.0, 4000.0, 2990.0))


def test_without_a_depth_it_waits_and_knows_what_it_knew() -> None:
    state = ArgoState(1.0, 3000.0, 2000.0)
    assert step(P, state, Measurement(0.0, math.nan, 0.0), 3000.0) == (0.0, state, 300.0)


def test_a_pump_that_would_give_less_than_nothing_gives_nothing() -> None:
    assert pumped(P._replace(pump_loss=1e-8), 4000.0) == 0.0


def test_it_begins_without_a_check_and_knows_its_speeds() -> None:
    assert initial(P, Measurement(0.0, 12.4, 0.0), 3000.0) == ArgoState(0.0, 3000.0, 12.0)
    assert [(way.name, way.speed) for way in ways(P)] == [
        ("descent", pytest.approx(4.0 / 300.0)),
        ("ascent", pytest.approx(10.0 / 120.0)),
    ]
    assert ARGO.longest_wait is not None
    assert ARGO.longest_wait(P) == 300.0
