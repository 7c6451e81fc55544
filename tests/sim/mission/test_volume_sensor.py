"""A measured volume ends runs where its noise and its quantum say, and nowhere else."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.engine.rodas import drive
from swimbladder.sim.engine.rodas.records import AT, GIVEN, Doing, Note, Stop, made
from swimbladder.sim.engine.sensor import normal
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.result import MissionResult
from tests.sim.mission.conftest import phases
from tests.vehicles import by_rule

FEUP = by_rule("feup-em")
MISSION = Mission(
    phases=[
        {"kind": "hold", "depth": 30.0, "tolerance": 2.0, "duration": 14400.0},
        {"kind": "surface", "duration": 600.0},
    ]
)


def flown(seed=1, **sensors):
    vehicle = FEUP.model_copy(update={"sensors": FEUP.sensors.model_copy(update=sensors)})
    return fly_mission(vehicle, MISSION, uniform_column(FEUP.water, 200.0), seed=seed)


def runs(flight):
    """Volume at the begin of each run, at its end, and what was wanted [m3], end stops apart."""
    begins = (Note.PUMP, Note.VALVE, Note.BYPASS)
    notes = flight.notes[np.isin(flight.notes["what"], [*begins, Note.RUN_OVER])]
    pairs = [
        (a, b)
        for a, b in itertools.pairwise(notes)
        if a["what"] in begins and b["what"] == Note.RUN_OVER
    ]
    stroke = FEUP.stroke
    return np.array(
        [
            (a["v"], b["v"], a["number"])
            for a, b in pairs
            if stroke.minimum < b["v"] < stroke.maximum
        ]
    )


def splitmix(x):
    """The next state's number of Steele, Lea and Flood (2014), section 4, in Python's integers."""
    x = (x + 0x9E3779B97F4A7C15) % 2**64
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) % 2**64
    return x ^ (x >> 31)


@pytest.mark.parametrize("seed", [0, 1, 2023, 2**40 + 7])
def test_noise_is_that_of_the_published_generator(seed):
    """Its first number from 0 is the published one; two rounds a draw, then Box and Muller."""
    assert splitmix(0) == 0xE220A8397B1DCDAF

    def share(draw):
        x = (seed * 0x9E3779B97F4A7C15 + draw * 0xD1B54A32D192ED03) % 2**64
        return ((splitmix(splitmix(x)) >> 11) + 0.5) * 2.0**-53

    at = made(AT)
    at["seed"] = seed
    for n in range(20):
        wanted = math.sqrt(-2.0 * math.log(share(2 * n)))
        wanted *= math.cos(2.0 * math.pi * share(2 * n + 1))
        with np.errstate(over="ignore"):  # of 64 bits, as wanted
            assert normal(at) == pytest.approx(wanted, rel=1e-12)
    assert at["draws"] == 40


def test_without_a_seed_volumes_are_true():
    plain, noisy = flown(None), flown(None, volume_noise=1e-7, volume_quantum=1e-7)
    np.testing.assert_array_equal(plain.rows, noisy.rows)
    begin, end, wanted = runs(plain).T
    assert np.allclose(end - begin, wanted, rtol=0.0, atol=1e-12)


def test_a_pump_that_runs_for_a_time_says_that_no_volume_is_measured(profiler, sea):
    sensors = profiler.sensors.model_copy(update={"volume_noise": 1e-6})
    noisy = profiler.model_copy(update={"sensors": sensors})
    flights = [fly_mission(vehicle, phases(), sea, seed=1) for vehicle in (profiler, noisy)]
    np.testing.assert_array_equal(flights[0].rows, flights[1].rows)
    said = [" ".join(MissionResult(flight, None).notes) for flight in flights]
    assert ["no volume is measured" in words for words in said] == [False, True]
    assert not MissionResult(flown(volume_noise=1e-7), None).notes


@pytest.mark.parametrize("quantum", [2e-8, 5e-7])
def test_a_run_ends_at_a_step_of_the_converter(quantum):
    """There the measured volume becomes the wanted one: half a step before or behind its middle."""
    flight = flown(depth_noise=0.0, depth_quantum=0.0, volume_quantum=quantum)
    assert flight.stop is Stop.FINISHED
    _, end, _ = runs(flight).T
    assert end.size > 3
    edges = end / quantum - 0.5
    assert np.allclose(edges, np.round(edges), rtol=0.0, atol=2e-6)


def test_the_noise_of_begin_and_end_is_in_what_a_run_moves():
    """Both are drawn once a run: what it moves misses the wanted by sigma root 2."""
    sigma = 1e-7
    flight = flown(depth_noise=0.0, depth_quantum=0.0, volume_noise=sigma)
    begin, end, wanted = runs(flight).T
    pumped = np.abs(wanted) > 6.0 * sigma  # less is not run where the noise says it is done
    missed = (end - begin - wanted)[pumped]
    assert missed.size > 20
    # chi-squared of so many draws: five standard deviations of its root
    wide = 5.0 / math.sqrt(2.0 * missed.size)
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(math.sqrt(2.0) * sigma, rel=wide)
    assert Doing.PUMPING in flight.rows["doing"]
    assert np.array_equal(
        flight.rows, flown(depth_noise=0.0, depth_quantum=0.0, volume_noise=sigma).rows
    )


@pytest.mark.parametrize("goal", [3.2e-6, 3.5e-6, 3.8e-6, 4.0e-6, -3.2e-6, 0.0])
@pytest.mark.parametrize("doing", [Doing.PUMPING, Doing.LETTING_IN])
def test_a_run_ends_where_the_rounded_volume_first_comes_to_its_goal(doing, goal):
    """A millilitre is the quantum: a hair before, the volume that is read is not there yet."""
    q, p, at = 1e-6, made(GIVEN), made(AT)
    p["volume_quantum"], at["seed"] = q, 1
    end = drive._end_of(SimpleNamespace(p=p, at=at), doing, goal)
    out = 1.0 if doing == Doing.PUMPING else -1.0
    read, before = (q * np.round((end - out * back * q) / q) for back in (0.0, 1e-5))
    assert out * (read - goal) >= -1e-12
    assert out * (before - goal) < -1e-12
