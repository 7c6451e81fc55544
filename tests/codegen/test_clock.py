"""What the twin of a board gives its law to see, and how it begins."""

import math
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.codegen.clock import arming_twin
from swimbladder.codegen.library import make_library
from swimbladder.control.supervisor import Watched
from swimbladder.io.config import load_vehicle
from tests.codegen import chip
from tests.vehicles import limited


@pytest.fixture(scope="module")
def made():
    return make_library(limited(load_vehicle("feup-em")))


@pytest.mark.parametrize("waits", [1, 3])
def test_a_law_sees_the_time_of_its_tick_in_seconds(waits, made):
    twin, times = chip.twin_of(made), []
    sample = float(twin.tick_s)

    def step(_parameters, state, measurement, _reference):
        times.append(measurement.time)
        return np.float32(1.0), state, np.float32(waits * sample)

    twin.law = replace(twin.law, step=step)
    for _ in range(7):
        twin.tick(2.0, 0.0, 2.0)
    assert times == pytest.approx([n * sample for n in range(0, 7, waits)])


@pytest.mark.parametrize(("how", "armed"), [({}, False), ({"was_armed": True}, True)])
def test_it_begins_as_one_that_nobody_armed(how, armed, made):
    """One that was armed when the power went is armed by a depth that stays away; no other is."""
    vehicle = chip.vehicle_twin(made)
    vehicle.switch_on(arming_twin(), made.arming, **how)
    for _ in range(int(made.arming.blind) + 1):
        vehicle.tick(Watched(math.nan, 0.0, 0.0, 12.0, False, 0, 0), 3.0)
    assert vehicle.armed == armed
