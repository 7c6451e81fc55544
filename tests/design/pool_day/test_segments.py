"""The phases of the procedure, found in logs of which it is known what was done when."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from swimbladder.design.pool_day.segments import (
    Changed,
    Cut,
    End,
    Ready,
    Refused,
    Rules,
    Sample,
    Segmenter,
    Why,
)
from swimbladder.io.config import load_vehicle
from swimbladder.sim import pool
from swimbladder.vehicle import Sensors
from tests.examples import examples


@pytest.fixture(scope="module")
def runs():
    sensors = Sensors(depth_noise=2e-3, depth_quantum=5e-3, volume_quantum=0.75e-6)
    vehicle = load_vehicle("feup-em").model_copy(update={"sensors": sensors})
    return pool.pool_test(vehicle, dVs=[20e-6, 75e-6], seed=7)


def events_of(time, depth, volume, rules=None):
    segmenter = Segmenter(Rules() if rules is None else rules)
    rows = np.column_stack([time, depth, volume]).tolist()
    found = [event for row in rows for event in segmenter.feed(Sample(*row))]
    return found + segmenter.close()


def test_the_two_experiments_of_a_run_are_found_where_they_were_done(runs):
    for run in runs:
        found = events_of(run.solution.time, run.seen_depth, run.seen_volume)
        cuts = [e for e in found if isinstance(e, Cut)]
        assert len(cuts) == 2
        for cut, done in zip(cuts, run.experiments, strict=True):
            pulse = done.released + done.pulse_time
            assert done.released - 0.7 <= cut.released <= pulse + 0.3
            assert cut.change == pytest.approx(done.dV, rel=0.1)
            assert cut.rest.neutral == pytest.approx(done.neutral, abs=0.3e-6)
            assert cut.end is End.TRAVEL
            assert abs(cut.travel) == pytest.approx(3.0, abs=0.15)
            assert cut.columns()["volume_m3"][0] == 0.0
        kinds = [type(e) for e in found]
        assert kinds.count(Changed) == 2
        assert Ready in kinds[: kinds.index(Changed)]


def day(rng, *, noise=1e-3, jitter=4e-6, size=30e-6, speed=0.0, tick=0.3, gain=218.0, early=0.0):
    """A hold near 3.75 m, a release, a glide up of 3 m and the loop again; when it was released.

    gain: acceleration per volume [1/m2/s2]; the vehicle's speed before is `speed` [m/s].
    """
    rest = 90.0 - early
    t = np.arange(0.0, rest + 120.0, tick)
    since = np.maximum(t - rest, 0.0)
    travel = 0.5 * gain * size * since**2
    over = rest + np.sqrt(2.0 * 3.4 / (gain * size))
    depth = 3.75 - np.minimum(travel, 3.4) + speed * (t - rest) * (t < rest)
    volume = np.where(t <= rest, jitter * rng.normal(size=len(t)), size)
    volume = np.where(t > over, size + 3.0 * size * np.sin(t), volume)
    return t, depth + noise * rng.normal(size=len(t)), volume, rest


def cuts_of(found):
    return [e for e in found if isinstance(e, Cut)]


@examples(40)
@given(
    seed=st.integers(0, 10_000),
    noise=st.floats(0.0, 0.01),
    jitter=st.floats(0.0, 5e-6),
    size=st.floats(20e-6, 80e-6),
    tick=st.floats(0.1, 0.5),
    gain=st.floats(100.0, 500.0),
    quantum=st.sampled_from([0.0, 5e-3, 1e-2]),
)
def test_one_release_is_one_experiment(seed, noise, jitter, size, tick, gain, quantum):
    t, z, v, rest = day(
        np.random.default_rng(seed), noise=noise, jitter=jitter, size=size, tick=tick, gain=gain
    )
    if quantum:
        z = quantum * np.round(z / quantum)
    (cut,) = cuts_of(events_of(t, z, v))
    assert abs(cut.released - rest) <= 2.0 * tick + 1e-9
    assert cut.change == pytest.approx(size, rel=0.1)
    assert cut.rest.neutral == pytest.approx(0.0, abs=1e-9 + 4.0 * jitter / np.sqrt(60.0 / tick))
    assert abs(cut.travel) <= 3.5


@examples(25)
@given(seed=st.integers(0, 10_000))
@example(seed=222)  # three depths of five on one side
@example(seed=531)
@example(seed=2814)  # two volumes in a second, that a mean under way followed
def test_spikes_gone_samples_and_repeats_change_no_phase(seed):
    rng = np.random.default_rng(seed)
    t, sound, v, rest = day(rng)
    z = np.where(rng.random(len(t)) < 0.02, sound + rng.normal(size=len(t)) * 3.0, sound)
    v = np.where(rng.random(len(t)) < 0.005, v + 1e-4, v)
    kept = rng.random(len(t)) > 0.1
    t, z, sound, v = (x[kept] for x in (t, z, sound, v))
    for i in range(len(t)):  # a median of five depths bears two
        latest = slice(max(i - 4, 0), i + 1)
        if np.count_nonzero(z[latest] != sound[latest]) > 2:
            z[i] = sound[i]
    t, z, v = (np.repeat(x, 2) for x in (t, z, v))
    (cut,) = cuts_of(events_of(t, z, v))
    assert abs(cut.released - rest) <= 1.5


def test_three_spikes_of_five_depths_are_a_motion_and_the_rest_is_refused():
    t, z, v, rest = day(np.random.default_rng(1))
    before = int(np.searchsorted(t, rest - 10.0))
    for faults, cuts in ((2, 1), (3, 0)):
        spiked = z.copy()
        spiked[before : before + faults] -= 1.5
        found = events_of(t, spiked, v)
        assert len(cuts_of(found)) == cuts
        refused = [e.why for e in found if isinstance(e, Refused)]
        assert (Why.NOT_AT_REST in refused) == (cuts == 0)


def test_what_is_fed_twice_or_is_no_number_is_left_out():
    segmenter = Segmenter(Rules())
    assert segmenter.feed(Sample(0.0, 1.0, 0.0)) == []
    for bad in (Sample(0.0, 9.0, 9.0), Sample(-1.0, 1.0, 0.0), Sample(1.0, np.nan, 0.0)):
        assert segmenter.feed(bad) == []


def test_a_release_from_no_rest_is_refused_with_the_speed():
    t, z, v, _ = day(np.random.default_rng(1), speed=0.02)
    found = events_of(t, z, v)
    assert not cuts_of(found)
    assert Why.NOT_AT_REST in [e.why for e in found if isinstance(e, Refused)]


def test_depths_in_millimeters_are_no_float_that_is_not_at_rest():
    t, z, v, _ = day(np.random.default_rng(1), speed=0.02)
    found = events_of(t, 1e3 * z, v)
    assert {e.why for e in found if isinstance(e, Refused)} == {Why.NO_FLOAT}


def test_a_rest_of_less_than_a_minute_is_none():
    t, z, v, rest = day(np.random.default_rng(1), early=50.0)
    found = events_of(t, z, v)
    assert not cuts_of(found)
    assert not [e for e in found if isinstance(e, Ready) and e.time <= rest]


@pytest.mark.parametrize(
    ("rules", "end"),
    [
        (Rules(), End.TRAVEL),
        (Rules(surface=1.5), End.SURFACE),
        (Rules(travel=10.0, surface=0.0), End.STOPPED),
    ],
)
def test_what_ends_a_glide(rules, end):
    t, z, v, rest = day(np.random.default_rng(1))
    if end is End.STOPPED:  # the piston stays, something holds the vehicle
        v = np.where(t > rest, 30e-6, v)
    (cut,) = cuts_of(events_of(t, z, v, rules))
    assert cut.end is end


def test_a_piston_that_moves_ends_it_there():
    t, z, v, rest = day(np.random.default_rng(1))
    moved = rest + 20.0
    v = np.where(t > moved, 30e-6 + 40e-6 * np.sin(t), v)
    (cut,) = cuts_of(events_of(t, z, v))
    assert cut.end is End.PISTON
    assert cut.samples[-1].time == pytest.approx(moved, abs=1.5)


def test_a_gap_ends_it_where_the_log_does():
    t, z, v, rest = day(np.random.default_rng(1))
    kept = (t < rest + 22.0) | (t > rest + 32.0)
    (cut,) = cuts_of(events_of(t[kept], z[kept], v[kept]))
    assert cut.end is End.GAP
    assert cut.samples[-1].time < rest + 22.0
