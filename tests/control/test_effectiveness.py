"""What a motor can do, learnt: by hand, and in large steps of vehicles whose motor does less."""

import numpy as np
import pytest

from swimbladder.control.law import TuningParameters
from swimbladder.control.profile import estimate_effectiveness, own_drive, usable
from swimbladder.control.registry import LAWS
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability.around import wrapped
from swimbladder.design.tuning.gains import gains, setting_of
from swimbladder.design.tuning.region import region
from swimbladder.design.tuning.trial import Drawn, Step, traces
from swimbladder.io.config import load_vehicle

H = 0.3
KNOBS = {
    "planned": TuningParameters(0.18, 0.8, 1.0, sharpness=8.0, learning=0.01, share=0.8),
    "sea-cascade": TuningParameters(0.35, 1.0, 1.6, sharpness=6.5, share=0.8),
    "adrc": TuningParameters(0.2, 1.0, 1.6, sharpness=6.0, learning=0.25, share=0.8),
}


def test_it_comes_to_the_share_that_is_seen_and_only_where_the_drive_is_hard_and_steady():
    effectiveness = 1.0
    for _ in range(30):
        effectiveness = estimate_effectiveness(effectiveness, 10.0, 10.0, 6.0, 12.0)
    assert effectiveness == pytest.approx(0.6, abs=1e-4)
    assert estimate_effectiveness(0.6, 5.0, 10.0, 0.0, 12.0) == 0.6  # not hard
    assert estimate_effectiveness(0.6, 10.0, -10.0, 0.0, 12.0) == 0.6  # turned round
    assert estimate_effectiveness(0.6, 12.0, 2.9, 0.0, 12.0) == 0.6  # just begun
    assert estimate_effectiveness(0.6, 12.0, 3.1, 0.0, 12.0) < 0.6
    assert estimate_effectiveness(0.6, -10.0, -10.0, -10.0, 12.0) == pytest.approx(0.72)
    for moved in (-20.0, 20.0):  # nothing is believed beyond what a motor can be
        for _ in range(60):
            effectiveness = estimate_effectiveness(effectiveness, 10.0, 10.0, moved, 12.0)
        assert 0.1 <= effectiveness <= 1.0
    assert usable(1.0) == 1.0
    assert usable(0.95) == 1.0
    assert usable(0.5) == pytest.approx(0.55)


def test_what_a_supervisor_pushed_the_other_way_says_nothing_of_the_motor():
    assert own_drive(-10.0, 9.0) == own_drive(10.0, -9.0) == 0.0
    assert estimate_effectiveness(0.6, 0.0, -10.0, 9.0, 12.0) == 0.6
    assert estimate_effectiveness(0.6, -10.0, 0.0, -4.0, 12.0) == 0.6  # the motor turns round
    assert own_drive(10.0, -0.5) == own_drive(10.0, 9.0) == 10.0  # blocked, and given way a little
    blocked = estimate_effectiveness(0.6, 10.0, 10.0, -0.5, 12.0)
    assert blocked == pytest.approx(0.6 + 0.3 * (0.1 - 0.6))


@pytest.mark.prove
@pytest.mark.parametrize("name", ["planned", "sea-cascade", "adrc"])
def test_large_steps_settle_with_half_to_twice_the_gain_and_half_a_sample_late(name):
    """The command is multiplied after its limit: with 0.5 the battery has half of its voltage."""
    vehicle = load_vehicle("feup-em")
    noisy = vehicle.sensors.model_copy(update={"depth_noise": 2e-3})
    vehicle = vehicle.model_copy(update={"sensors": noisy})
    setting = setting_of(vehicle, sample_time=H, supply=10.8, neutral_range=20e-6)
    bound = BoundLaw(LAWS[name], gains(name, setting, KNOBS[name]), H)
    for gain, late in ((0.5, False), (0.7, False), (0.7, True), (1.0, True), (2.0, False)):
        seen = traces(
            vehicle,
            wrapped(bound, gain=gain, late=late, rest=0.1),
            Step(1.5, 3.0, 300.0),
            Drawn(40, region(vehicle), 10.8),
        )
        last = np.abs(seen.depth[seen.time > 200.0] - 3.0).max(axis=0)
        assert (last < 0.03).mean() >= 0.97, (gain, late, last)
