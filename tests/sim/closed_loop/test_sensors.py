"""What the controller sees: noise of the stated size, quanta of the stated step, seeds."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from swimbladder.control.law import Measurement
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Sensors
from tests.oracle import TABLE_3, paper_cascade
from tests.vehicles import paper

N = 6000


def seen(sensors: Sensors, seed: int | None, law: Any = None) -> tuple[np.ndarray, np.ndarray, Any]:
    """Measured depths and volumes of a motor at rest, and the run."""
    rows: list[tuple[float, float]] = []

    def look(measurement: Measurement, _: float) -> float:
        rows.append((measurement.depth, measurement.volume))
        return 0.8  # holds the piston against 10.4 m or so: V and z creep

    s = simulate(
        paper(sensors=sensors),
        law=law or look,
        sample_time=0.01,
        setpoints=[(0.0, 10.0)],
        duration=0.01 * (N - 1),
        start_depth=10.38,
        seed=seed,
    )
    depth, volume = np.array(rows).T
    return depth, volume, s


def test_noise_is_white_normal_and_of_the_stated_size() -> None:
    z, V, s = seen(Sensors(depth_noise=2e-3, volume_noise=3e-7), seed=5)
    for error, sigma in ((z - s.depth, 2e-3), (V - s.volume, 3e-7)):
        x = error / sigma
        assert stats.kstest(x, "norm").pvalue > 1e-3
        assert abs(x.mean()) < 4.0 / np.sqrt(N)
        assert x.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(2 * N))
        for lag in (1, 2, 7):
            assert abs(np.mean(x[lag:] * x[:-lag])) < 4.0 / np.sqrt(N)
    cross = np.mean((z - s.depth) * (V - s.volume)) / (2e-3 * 3e-7)
    assert abs(cross) < 4.0 / np.sqrt(N)


def test_the_quantum_rounds_to_the_nearest_step() -> None:
    z, V, s = seen(Sensors(depth_quantum=5e-3, volume_quantum=1e-6), seed=0)
    for measured, true, step in ((z, s.depth, 5e-3), (V, s.volume, 1e-6)):
        np.testing.assert_allclose(measured / step, np.round(measured / step), atol=1e-9)
        assert np.abs(measured - true).max() <= step / 2 * (1 + 1e-9)


def test_noise_comes_before_the_quantum() -> None:
    z, _, s = seen(Sensors(depth_noise=4e-3, depth_quantum=5e-3), seed=2)
    assert len(np.unique(z)) > 3
    np.testing.assert_allclose(z / 5e-3, np.round(z / 5e-3), atol=1e-9)
    # Sheppard: rounding adds step^2/12 to the variance
    expected = np.sqrt(4e-3**2 + 5e-3**2 / 12)
    assert (z - s.depth).std() == pytest.approx(expected, rel=0.06)


def test_without_a_seed_the_sensors_are_ideal() -> None:
    z, V, s = seen(Sensors(depth_noise=2e-3, depth_quantum=5e-3, volume_noise=1e-6), seed=None)
    np.testing.assert_array_equal(z, s.depth)
    np.testing.assert_array_equal(V, s.volume)


def test_a_seed_makes_a_run_and_another_seed_another() -> None:
    vehicle = paper(sensors=Sensors(depth_noise=2e-3))
    run: dict[str, Any] = dict(setpoints=[(0.0, 3.0)], duration=60.0, start_depth=3.0)
    a, b, c = (simulate(vehicle, seed=seed, **run) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.depth, b.depth)
    np.testing.assert_array_equal(a.command, b.command)
    assert np.abs(a.command - c.command).max() > 1.0
    # noise that is drawn does not depend on how long the run is, nor on its chunks of 4096 samples
    long = simulate(vehicle, seed=1, **run | {"duration": 3000.0})
    np.testing.assert_array_equal(long.depth[: len(a.depth)], a.depth)


def test_compiled_law_and_function_see_the_same_noise() -> None:
    vehicle = paper(sensors=Sensors(depth_noise=2e-3, volume_noise=1e-7))
    run: dict[str, Any] = dict(setpoints=[(0.0, 3.0)], duration=1500.0, start_depth=3.0, seed=9)
    compiled = simulate(vehicle, **run)
    law = paper_cascade(**TABLE_3)
    by_hand = simulate(
        vehicle, law=lambda m, ref: law(m.time, m.depth, m.volume, ref), sample_time=0.3, **run
    )
    np.testing.assert_allclose(by_hand.depth, compiled.depth, rtol=0.0, atol=1e-9)


def test_depth_noise_moves_the_volume_as_an_independent_run_found() -> None:
    """2 mm of white noise: 75 L of volume an hour and 1.1 cm rms; a 5 mm quantum alone 5.5 L."""
    hour: dict[str, Any] = dict(setpoints=[(0.0, 2.0)], duration=3600.0, start_depth=2.0)
    noisy = [
        simulate(paper(sensors=Sensors(depth_noise=2e-3)), seed=seed, **hour) for seed in range(3)
    ]
    litres = np.mean([s.actuator_travel for s in noisy]) * 1e3
    assert litres == pytest.approx(75.0, rel=0.05)
    rms = np.sqrt(np.mean([np.mean((s.depth - 2.0) ** 2) for s in noisy]))
    assert rms == pytest.approx(0.011, rel=0.15)
    coarse = simulate(paper(sensors=Sensors(depth_quantum=5e-3)), seed=0, **hour)
    assert coarse.actuator_travel * 1e3 == pytest.approx(5.5, rel=0.25)
