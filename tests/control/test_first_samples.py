"""What the laws for the sea make of their first samples, and of what nothing can measure."""

import math

import pytest

from swimbladder.control.adrc import ADRC
from swimbladder.control.deadband import DEADBAND
from swimbladder.control.law import Measurement
from swimbladder.control.sea_cascade import SEA_CASCADE
from tests.control.examples import ADRC_FAST, SEA, SLEEPER

DEEPEST_PLACE = 10_935.0  # m, Challenger Deep (Greenaway et al., Deep-Sea Res. I 178, 2021)
LAWS = [(ADRC, ADRC_FAST), (SEA_CASCADE, SEA), (DEADBAND, SLEEPER)]
each_law = pytest.mark.parametrize(("law", "parameters"), LAWS, ids=[law.name for law, _ in LAWS])


@each_law
@pytest.mark.parametrize("depth", [-DEEPEST_PLACE, 0.5, DEEPEST_PLACE])
def test_every_depth_of_the_sea_is_one(law, parameters, depth):
    state = law.initial(parameters, Measurement(0.0, depth, 1e-5), depth)
    assert (state.begun, state.depth, state.goal) == (1.0, depth, depth)
    # the neutral volume, by what each law calls it, is that of rest at this depth
    rest = {"adrc": "disturbance", "sea-cascade": "integral", "deadband": "neutral"}[law.name]
    scale = parameters.b if law is ADRC else 1.0
    assert getattr(state, rest) / scale == pytest.approx(1e-5 - parameters.psi * depth, rel=1e-9)
    for _ in range(2):
        _, state, _ = law.step(parameters, state, Measurement(0.3, depth, 1e-5), depth)
    assert state.depth == pytest.approx(depth, abs=0.5)


@each_law
@pytest.mark.parametrize("depth", [math.nan, math.inf, -1.3e4, 1.3e4])
def test_what_is_no_depth_begins_nothing_and_is_not_gone_to(law, parameters, depth):
    state = law.initial(parameters, Measurement(0.0, depth, 1e-5), 2.0)
    assert (state.begun, state.depth) == (0.0, 0.0)
    state = law.initial(parameters, Measurement(0.0, 2.0, 1e-5), depth)
    assert (state.begun, state.goal) == (1.0, 2.0)
    for _ in range(5):
        _, state, _ = law.step(parameters, state, Measurement(0.3, 2.0, 1e-5), depth)
    assert state.goal == 2.0


@each_law
def test_a_law_begins_at_rest_with_a_motor_that_does_all_it_can(law, parameters):
    state = law.initial(parameters, Measurement(0.0, 2.0, 1e-5), 3.0)._asdict()
    assert state.get("effectiveness", 1.0) == 1.0
    path = state.get("path")
    if path is not None:
        left = 10.0 * parameters.S_p  # a way takes so long at least
        assert tuple(path) == pytest.approx((2.0, 0.0, 0.0, left, 0.0, 0.0))
