"""The law for a positioner: its margins, its bound, the stops and a neutral volume that is off."""

import math
from dataclasses import replace

import numpy as np
import pytest

from studies.tank_law import FITTING, position_observer_gains
from swimbladder.control.law import Measurement, numbers
from swimbladder.control.position_observer import POSITION_OBSERVER, initial, step
from swimbladder.design.linear.sampled import BoundLaw, linearise_law, loop_of
from swimbladder.design.planning import least_time
from swimbladder.design.tuning.margins import WANTED, exactly, violated_margins
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate, step_metrics
from swimbladder.vehicle import Sensors

NOISE = 0.0103  # m, of the depths logged in the tank, as identified
TANK = load_vehicle("ntnu-bv").model_copy(update={"sensors": Sensors(depth_noise=NOISE)})
NUMBERS = position_observer_gains(TANK, **FITTING)
RUN = dict(sample_time=NUMBERS.S_p, start_depth=0.3, bottom_depth=1.5)


def flown(*, duration=120.0, law=POSITION_OBSERVER, numbers=NUMBERS, **changes):
    given = RUN | {"setpoints": [(0.0, 1.0)], "duration": duration} | changes
    return simulate(TANK, law=law, parameters=numbers, **given)


@pytest.mark.parametrize("depth", [0.5, 1.2])
def test_it_has_the_margins_asked_of_every_law(depth):
    """At rest a small move is over within a sample, so the volume is the one commanded before."""

    def believing(p, s, seen, reference):
        return step(p, s, seen._replace(volume=math.nan), reference)

    p, law = NUMBERS._replace(dead=0.0), replace(POSITION_OBSERVER, step=believing)
    seen = Measurement(0.0, depth, TANK.neutral_volume(depth))
    linear = linearise_law(BoundLaw(law, p, p.S_p), seen)
    loop = loop_of(plant(TANK), linear, depth=depth, delay=0.1 * p.S_p)
    found = exactly(loop.broken_at_depth())
    assert violated_margins(found, WANTED) == ()


@pytest.mark.prove
def test_it_is_slower_than_any_bound_and_settles():
    run = flown()
    metrics = step_metrics(run.time, run.depth, start=0.3, target=1.0)
    bound = least_time(TANK, 0.3, 1.0, sample_time=NUMBERS.S_p).time
    assert bound <= metrics.settle2_s + NUMBERS.S_p
    assert metrics.settle2_s < 60.0
    assert metrics.overshoot_pct < 6.0


def test_a_neutral_volume_that_is_off_is_learnt():
    off = TANK.model_copy(update={"trim_error": TANK.trim_error + 5e-6})
    run = simulate(
        off,
        law=POSITION_OBSERVER,
        parameters=NUMBERS,
        setpoints=[(0.0, 1.0)],
        duration=200.0,
        start_volume=TANK.neutral_volume(0.3),
        **RUN,
    )
    held = run.time > 120.0
    assert np.abs(run.depth[held] - 1.0).max() < 0.02
    assert np.mean(run.volume[held]) == pytest.approx(off.neutral_volume(1.0), abs=0.5e-6)


def test_a_volume_that_is_not_measured_is_where_it_was_sent():
    """From neutral, without noise, the piston is each time where the command of before said."""
    seen_all = flown(law=by_hand(lambda v: v), numbers=None)
    blind = flown(law=by_hand(lambda _: math.nan), numbers=None)
    assert np.abs(seen_all.depth - blind.depth).max() < 1e-9


def by_hand(look):
    states = []

    def law(seen, reference):
        seen = seen._replace(volume=look(seen.volume) if states else seen.volume)
        before = states[-1] if states else initial(NUMBERS, seen, reference)
        command, after, wait = step(NUMBERS, before, seen, reference)
        states.append(after)
        return command, wait

    return law


def test_no_command_is_farther_than_the_piston_goes_nor_beyond_the_stops():
    run = flown(duration=60.0, seed=3)
    reach = plant(TANK).rate * NUMBERS.S_p
    assert np.abs(run.command - run.volume).max() <= reach * (1 + 1e-9)
    assert run.command.min() >= TANK.stroke.minimum - 1e-12
    assert run.command.max() <= TANK.stroke.maximum + 1e-12


def test_a_depth_that_is_no_number_corrects_nothing():
    state = initial(NUMBERS, Measurement(0.0, 1.0, 1e-5), 1.0)
    command, after, _ = step(NUMBERS, state, Measurement(0.0, math.nan, 1e-5), 1.0)
    assert all(map(math.isfinite, (command, *numbers(after))))
