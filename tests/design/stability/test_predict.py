"""Foretold limit cycles of real loops beside the simulator's, and the measuring of both."""

import math

import numpy as np
import pytest

from swimbladder.control.registry import bind
from swimbladder.control.sea_cascade import SEA_CASCADE, sea_cascade_gains
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability.cycles import Confirmed, Held, edge, hold, measure, predict
from swimbladder.design.tuning.margins import at_rest
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from tests.control.examples import SEA

FEUP = load_vehicle("feup-em")
P = plant(FEUP)
LAW, NUMBERS = bind(FEUP.controller)
H, DEPTH = 0.3, 2.0
BOUND = BoundLaw(LAW, NUMBERS, H)
QUIET = SEA._replace(
    gains=sea_cascade_gains(P.a_b, P.d_l, P.gain, 0.125, H), smoothing=0.07, dead_zone=1.5e-6
)


def foretold(law, numbers, source, p=P, **quanta):
    bound = BoundLaw(law, numbers, H)
    linear = at_rest(bound.without_rest, P, depth=DEPTH)
    found = predict(p, bound, linear, depth=DEPTH, **quanta)
    return [one for one in found if one.source == source]


@pytest.mark.prove
def test_the_dead_zone_of_a_law_makes_the_cycle_that_was_foretold():
    one = next(c for c in foretold(SEA_CASCADE, QUIET, "dead zone of the law") if c.cycle.stable)
    assert one.cycle.believed
    for start in (0.003, 0.04):
        seen = hold(Held(FEUP, BoundLaw(SEA_CASCADE, QUIET, H), DEPTH), start, one.cycle.period)
        assert seen.cycles
        amplitude, period = Confirmed(one, seen).errors
        assert abs(amplitude) < 0.2
        assert abs(period) < 0.12


def test_the_voltage_limit_makes_an_edge_where_the_balance_says_how_sure_it_is():
    (one,) = foretold(LAW, NUMBERS, "voltage limit")
    assert not one.cycle.stable
    free = {"V_min": -1.0, "V_max": 1.0, "z_surface": -1e4, "z_air": -2e4}
    held = Held(FEUP, BOUND, DEPTH, free)
    found = edge(held, (1.0, 200.0), one.cycle.period)
    seen, disturbance = found
    amplitude, period = Confirmed(one, seen).errors
    assert not one.cycle.believed
    assert abs(amplitude) <= one.cycle.amplitude_error
    assert abs(period) <= one.cycle.period_error
    # Below the edge it decays, above it does not.
    for factor, decays in ((0.97, True), (1.03, False)):
        end = hold(held, factor * disturbance, 60.0, kick=0.0)
        assert (end.farthest < 0.05) is decays


def test_without_a_motor_that_sticks_there_is_no_friction_to_foretell():
    assert foretold(LAW, NUMBERS, "friction of the motor") == []
    sticky = foretold(LAW, NUMBERS, "friction of the motor", p=P._replace(friction=0.5))
    (one,) = [c for c in sticky if c.cycle.stable]
    # The balance is not believed there, and rightly: the simulation is slower by a factor of 2.
    assert not one.cycle.believed
    seen = hold(Held(FEUP, BOUND, DEPTH, {"friction": 0.5}), 0.01, 200.0)
    assert seen.cycles
    assert 0.3 < one.depth_amplitude / seen.amplitude < 1.5


def test_a_quantum_of_the_depth_keeps_the_vehicle_within_about_half_of_it():
    (one,) = foretold(LAW, NUMBERS, "quantum of the depth", depth_quantum=5e-3)
    coarse = FEUP.sensors.model_copy(update={"depth_quantum": 5e-3})
    held = Held(FEUP.model_copy(update={"sensors": coarse}), BOUND, DEPTH)
    seen = hold(held, 0.01, 60.0, quantised=True)
    assert one.depth_amplitude == pytest.approx(2.5e-3, rel=0.01)
    assert seen.farthest == pytest.approx(2.5e-3, rel=0.15)


def test_a_sine_is_measured_as_what_it_is():
    t = np.arange(0.0, 900.0, 0.3)
    seen = measure(t, 2.0 + 0.02 * np.sin(0.11 * t) + 0.003 * np.sin(0.33 * t), 2.0)
    assert seen.cycles
    assert seen.amplitude == pytest.approx(0.02, rel=0.01)
    assert seen.period == pytest.approx(2.0 * math.pi / 0.11, rel=0.002)
    assert seen.farthest == pytest.approx(0.02, rel=0.2)
    assert not measure(t, 2.0 + 0.02 * np.exp(-t / 100.0) * np.sin(0.11 * t), 2.0).cycles
    assert not measure(t, np.full_like(t, 2.0), 2.0).cycles
