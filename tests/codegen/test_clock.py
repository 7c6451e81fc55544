"""What the twin of a board gives its law to see, and how it begins."""

import math
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.codegen.library import firmware
from swimbladder.codegen.twin import arming_twin
from swimbladder.control.supervisor import Watched
from swimbladder.io.config import load_vehicle
from tests.codegen import chip
from tests.vehicles import limited


@pytest.fixture(scope="module")
def made():
    return firmware(limited(load_vehicle("feup-em")))


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


@pytest.mark.parametrize("wait", [1, 4])
def test_what_it_sleeps_over_is_what_it_would_have_ticked_through(wait, made):
    """It wakes at the tick at which its law is called next, and its clock has gone on."""
    calls = {}
    for how in ("ticks", "sleeps"):
        twin, times = chip.twin_of(made), []
        sample = float(twin.tick_s)

        def step(_parameters, state, measurement, _reference, times=times, sample=sample):
            times.append(round(measurement.time / sample))
            return np.float32(1.0), state, np.float32(wait * sample)

        twin.law = replace(twin.law, step=step)
        while len(times) < 4:
            twin.tick(2.0, 0.0, 2.0)
            if how == "sleeps":
                left = twin.waiting
                assert twin.sleep(100) == left
                assert twin.waiting == 0
        calls[how] = times
    assert calls["sleeps"] == calls["ticks"] == [0, wait, 2 * wait, 3 * wait]


def test_it_sleeps_no_longer_than_asked(made):
    twin = chip.twin_of(made)
    twin.waiting = 5
    assert (twin.sleep(2), twin.waiting, twin.ticks) == (2, 3, 2)
