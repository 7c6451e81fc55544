"""What is measured, against NumPy by hand, analytic motions and single runs of the simulator."""

import math

import numpy as np
import pytest

from swimbladder.design.law_comparison.contenders import (
    PAPER,
    SCENARIOS,
    Placed,
    Scenario,
    own,
    place,
)
from swimbladder.design.law_comparison.run import fly_scenario, no_energy
from swimbladder.design.tuning.region import region
from swimbladder.design.tuning.run import places
from swimbladder.design.tuning.trial import Drawn, Measured, Runs, measure, summarise
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.closed_loop.single import as_law
from swimbladder.sim.closed_loop.water import depth_error

FEUP = load_vehicle("feup-em")


def noisy(vehicle=FEUP, noise=2e-3):
    sensors = vehicle.sensors.model_copy(update={"depth_noise": noise})
    return vehicle.model_copy(update={"sensors": sensors})


def flown(vehicle, placed, *, runs=2, seed=3):
    who = own(vehicle)[0]
    return fly_scenario(vehicle, who, placed, Drawn(runs, region(vehicle), seed=seed))


def named(name):
    return next(s for s in SCENARIOS if s.name == name)


def measured(time, depth, volume, *, target=0.0, since=0.0):
    two = [np.stack([values, values], axis=1) for values in (depth, 0.0 * depth, volume, volume)]
    nothing = np.full(2, np.nan)
    energy, stopped = np.array([5.0, 7.0]), np.zeros(2, bool)
    target = np.full(2, target)
    alarm = np.array([0, 11])
    runs = Runs(time, *two, target, nothing, nothing, energy, nothing, stopped, alarm)
    return measure(runs, since)


def test_a_sine_has_the_rms_and_the_travel_of_a_sine():
    time = np.arange(0, 100_001) * 0.01  # ten periods of 100 s
    wave = np.sin(2.0 * math.pi * time / 100.0)
    m = measured(time, 0.02 * wave + 3.0, 5e-6 * wave, target=3.0)
    assert np.sqrt(m.square) == pytest.approx(0.02 / math.sqrt(2.0), rel=1e-4)
    assert m.farthest == pytest.approx(0.02, rel=1e-6)
    assert m.rate == pytest.approx(4.0 * 5e-6 / 100.0, rel=1e-6)
    assert m.power == pytest.approx([5.0 / 1000.0, 7.0 / 1000.0])
    assert m.alarms.tolist() == [0.0, 1.0]


def test_starts_and_turns_are_those_of_a_motor_that_is_switched():
    time = np.arange(0, 1201) * 1.0
    rate = np.where(time % 60 < 20, 1e-7, 0.0)  # on for 20 s a minute ...
    rate[time % 60 >= 10] *= -1.0  # ... out for ten, back for ten
    volume = np.concatenate([[0.0], np.cumsum(rate[:-1])])
    m = measured(time, np.zeros(1201), volume)
    assert m.turns * 1200.0 == pytest.approx([20.0, 20.0])
    assert m.starts * 1200.0 == pytest.approx([19.0, 19.0])  # the first is not seen to begin
    late = measured(time, np.zeros(1201), volume, since=600.0)
    assert late.turns * 600.0 == pytest.approx([10.0, 10.0])
    assert late.rate == pytest.approx(m.rate)


def test_only_what_counts_is_counted():
    time = np.arange(0, 1001) * 1.0
    m = measured(time, np.where(time < 500.0, 9.0, 1.0), np.zeros(1001), since=500.0)
    assert m.farthest == pytest.approx([1.0, 1.0])


def test_runs_are_summed_up_as_the_words_say():
    nothing = np.zeros(4)
    f = Measured(
        settle=np.array([10.0, np.nan, 30.0, 20.0]),
        overshoot=np.array([0.0, 0.3, 0.1, np.nan]),
        square=np.array([1.0, 4.0, 4.0, 7.0]),
        farthest=np.array([1.0, 2.0, 5.0, 3.0]),
        rate=np.array([1.0, 2.0, 3.0, 6.0]),
        starts=nothing + 2.0,
        turns=nothing + 1.0,
        energy=nothing,
        power=nothing + 9.0,
        lost=np.array([0.0, 1.0, 0.0, 0.0]),
        alarms=np.array([0.0, 0.0, 1.0, 1.0]),
    )
    r = summarise(f)
    assert (r.settled, r.settle_median, r.lost) == (0.75, 20.0, 0.25)
    assert math.isnan(r.settle_95)  # one of four never settles
    assert (r.rms, r.farthest, r.rate, r.starts_and_turns) == (2.0, 5.0, 3.0, 3.0)
    assert r.overshoot_median == pytest.approx(0.05)


def test_the_papers_cascade_settles_after_338_seconds():
    """Without noise: the figures of docs/explanation/laws.md, counted from the samples."""
    quiet = noisy(noise=0.0)
    found, time, depth = flown(quiet, place(named("step-down"), quiet, places(quiet)))
    outside = np.flatnonzero(np.abs(depth - 3.0) > 0.02 * 1.5)
    assert found.settle == pytest.approx([time[outside[-1]]] * 2)
    assert found.settle == pytest.approx([338.0] * 2, abs=1.0)
    assert found.overshoot == pytest.approx([(depth.max() - 3.0) / 1.5] * 2)
    assert found.overshoot == pytest.approx([0.147] * 2, abs=0.001)


@pytest.mark.parametrize("name", ["feup-em", "example-em", "ntnu-bv"])
def test_a_step_is_measured_as_on_a_single_run(name):
    vehicle = noisy(load_vehicle(name))
    placed = place(named("step-up"), vehicle, places(vehicle))._replace(duration=300.0)
    found, time, shown = flown(vehicle, placed, seed=11)
    alone = simulate(
        vehicle, setpoints=[(0.0, placed.target)], duration=300.0, start_depth=placed.start, seed=11
    )
    assert shown == pytest.approx(alone.depth[: len(shown)], abs=1e-9)
    assert time == pytest.approx(alone.time[: len(time)])
    error = alone.depth - placed.target
    size = abs(placed.start - placed.target)
    out = alone.time[np.abs(error) > 0.02 * size]
    if out[-1] == alone.time[-1]:
        assert math.isnan(found.settle[0])
    else:
        assert found.settle[0] == pytest.approx(out[-1])
    past = np.max(-error * np.sign(placed.start - placed.target)) / size
    assert found.overshoot[0] == pytest.approx(max(past, 0.0), abs=1e-9)
    moves = np.diff(alone.volume)
    assert found.rate[0] == pytest.approx(np.abs(moves).sum() / alone.time[-1], rel=1e-6)
    assert found.square[0] == pytest.approx(np.mean(error**2), rel=1e-9)
    if no_energy(vehicle) is None:
        energy = alone.balance.energy["source"]
        assert found.power[0] == pytest.approx(energy / alone.time[-1], rel=1e-6)
    else:
        assert np.isnan(found.power).all()


def test_a_low_battery_is_one():
    vehicle = noisy()
    placed = place(named("step-low-battery"), vehicle, places(vehicle))._replace(duration=120.0)
    _, _, shown = flown(vehicle, placed, seed=2)
    weak = vehicle.supply.model_copy(update={"voltage": 0.9 * vehicle.supply.voltage})
    alone = simulate(
        vehicle.model_copy(update={"supply": weak}),
        setpoints=[(0.0, placed.target)],
        duration=120.0,
        start_depth=placed.start,
        seed=2,
    )
    assert shown == pytest.approx(alone.depth, abs=1e-9)


def test_swell_is_read_as_the_wave_theory_has_it():
    """A law in Python that is given the same error sees what the compiled one saw."""
    vehicle = noisy(noise=0.0)
    swell = named("hold-swell")._replace(counted=0.0)
    placed = place(swell, vehicle, places(vehicle))._replace(duration=60.0)
    _, time, shown = flown(vehicle, placed, runs=2, seed=4)
    error = depth_error(swell.swell, vehicle, time, depth=placed.target, runs=2, seed=4)[:, 0]
    who = own(vehicle)[0]
    state = None

    def law(seen, reference):
        nonlocal state
        k = round(seen.time / who.sample_time)
        seen = seen._replace(depth=seen.depth + error[k])
        state = who.law.initial(who.parameters, seen, reference) if state is None else state
        command, state, _ = who.law.step(who.parameters, state, seen, reference)
        return command

    assert as_law(vehicle, law, who.sample_time)[2] == who.sample_time
    alone = simulate(
        vehicle,
        law=law,
        sample_time=who.sample_time,
        duration=60.0,
        start_depth=placed.start,
        setpoints=[(0.0, placed.target)],
    )
    assert shown == pytest.approx(alone.depth, abs=1e-9)
    assert np.ptp(shown) > 1e-3


def test_a_trim_that_walks_makes_the_vehicle_move():
    """A walk of w per root second: nobody knows it, so the volume has to go where it went."""
    vehicle = noisy(noise=0.0)
    still = Scenario("still", "", "shallow", duration=3600.0, counted=600.0)
    walks = still._replace(drift=named("hold-drift").drift)
    where = places(vehicle)
    none, _, _ = flown(vehicle, place(still, vehicle, where), runs=8)
    some, _, _ = flown(vehicle, place(walks, vehicle, where), runs=8)
    assert none.farthest.max() < 1e-5  # the motor's load, with which the cascade starts
    assert some.farthest.min() > 20.0 * none.farthest.max()
    assert len(set(some.farthest.tolist())) == 8
    # at least the way that the trim went, in an hour about 1 cm3
    assert some.rate.mean() * 3000.0 > 0.1e-6
    assert walks.drift * math.sqrt(3600.0) == pytest.approx(1e-6)


def test_drawn_vehicles_differ():
    vehicle = noisy(noise=0.0)
    placed = place(named("step-uncertain"), vehicle, places(vehicle))
    found, _, _ = flown(vehicle, placed, runs=12)
    assert len(set(found.overshoot.round(9).tolist())) == 12


def test_who_leaves_the_rated_depths_is_lost():
    vehicle = noisy(noise=0.0)
    hull = vehicle.hull.model_copy(update={"depth_limit": 3.1})  # the paper's cascade overshoots
    shallow = vehicle.model_copy(update={"hull": hull})
    step = Placed(named("step-down"), 1.5, 3.0, 300.0)
    assert flown(shallow, step)[0].lost.tolist() == [1.0, 1.0]
    assert flown(vehicle, step)[0].lost.tolist() == [0.0, 0.0]


def test_the_papers_own_is_known_by_its_numbers():
    assert [(c.law.name, c.tuning) for c in own(FEUP)] == [("cascade", PAPER)]
    other = FEUP.controller.model_copy(update={"sample_time": 0.2})
    both = own(FEUP.model_copy(update={"controller": other, "name": "mine"}))
    assert [c.tuning for c in both] == ["as in the file", PAPER]
    assert [c.law.name for c in own(load_vehicle("ntnu-bv"))] == ["position-pid"]
    assert own(FEUP.model_copy(update={"controller": None}))[0].tuning == PAPER
