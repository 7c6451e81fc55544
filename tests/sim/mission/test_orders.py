"""Which numbers of the law `rate` fly a phase: the vehicle's, the phase's, or ones made for it."""

import pytest

from swimbladder.control.registry import bind
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.sim.mission.orders import (
    flown_by,
    hold_parameters,
    law_parameters,
    rate_controller,
)
from tests.vehicles import by_rule

FLOAT, FEUP = load_vehicle("example-float"), load_vehicle("feup-em")  # by `rate`, by `cascade`


def park(**more):
    stage = {"kind": "park", "depth": 400.0, "duration": 60.0, **more}
    return Mission(phases=[stage]).phases[0]


@pytest.mark.parametrize("tolerance", [0.5, 5.0, 20.0, 200.0])
def test_near_and_far_reach_from_the_tolerance_of_the_phase_on(tolerance):
    """Else the vehicle's own: no band within which it is slow ends inside the tolerance."""
    own = bind(FLOAT.controller)[1]
    law = law_parameters(FLOAT, park(tolerance=tolerance))
    assert law.tolerance == tolerance
    assert law.near == (own.near if tolerance <= own.near else tolerance)
    assert law.far == (own.far if tolerance <= own.far else tolerance)


def test_a_vehicle_of_the_law_rate_flies_a_phase_by_its_own_numbers():
    """Whether the phase names the law or not."""
    own = bind(FLOAT.controller)[1]
    for phase in (park(), park(law="rate")):
        assert flown_by(FLOAT, phase) == FLOAT.controller
        assert rate_controller(FLOAT, phase) == own


def test_of_another_vehicle_the_law_rate_has_numbers_made_for_the_phase():
    assert flown_by(FEUP, park(law="rate")) is None
    assert rate_controller(FEUP, park(law="rate")) is None
    assert flown_by(FEUP, park()) == FEUP.controller
    given = law_parameters(FEUP, park(law="rate", tolerance=2.0))
    assert (given.tolerance, given.near, given.far) == (2.0, 2.0, 6.0)


@pytest.mark.parametrize(
    ("kind", "given", "longest"),
    [("park", None, 600.0), ("hold", None, 4 * 60.0), ("park", 45.0, 45.0), ("hold", 45.0, 45.0)],
)
def test_a_vehicle_that_does_not_run_away_is_looked_after_every_10_minutes_or_4_looks_at_least(
    kind, given, longest
):
    """Parked, and where it is held; or as often as its phase says."""
    vehicle = by_rule("feup-em")
    stage = {"kind": kind, "depth": 20.0, "tolerance": 1.0, "duration": 60.0}
    phase = Mission(phases=[{**stage, "check_interval": given}]).phases[0]
    law = law_parameters(vehicle, phase)
    _, found = hold_parameters(vehicle, phase, law, psi=-1e-6, rate=1e-5)
    assert found.longest == longest
