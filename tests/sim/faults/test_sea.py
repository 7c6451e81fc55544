"""The sea that missions are flown in, and sensors that are not what the file says."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from swimbladder.control.supervisor import Reason
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.sim.closed_loop.supervision import supervision_of
from swimbladder.sim.closed_loop.water import Swell, depth_error, share_read, wavenumber
from swimbladder.sim.faults.draw import HEIGHTS, Wave, course_of, draw
from swimbladder.sim.faults.run import faults
from swimbladder.vehicle import Supervisor
from tests.vehicles import usual


def noisy(noise, quantum=0.0, name="feup-em"):
    vehicle = load_vehicle(name)
    stated = vehicle.sensors.model_copy(update={"depth_noise": noise, "depth_quantum": quantum})
    return vehicle.model_copy(update={"sensors": stated})


@pytest.mark.parametrize("period", [4.0, 8.0, 12.0])
def test_what_is_read_is_what_the_length_of_the_hull_leaves(period):
    """The mean of exp(-k z) along the hull, by quadrature, from what its top reads."""
    hull, z = load_vehicle("feup-em").hull, 3.0
    k = wavenumber(period, 9.80665)
    top = z - hull.emergence_depth
    mean = quad(lambda x: math.exp(-k * x), top, top + hull.height)[0] / hull.height
    assert share_read(k, hull) * math.exp(-k * z) == pytest.approx(math.exp(-k * z) - mean)


@pytest.mark.parametrize("highest", [0.2, 1.0])
def test_a_board_reads_the_waves_at_the_depth_where_it_is(rig, highest):
    waves = [Wave(highest, 0.08, 0.9, 0.3), Wave(0.1, 0.2, 1.4, 2.0), Wave(0.05, 0.3, 1.7, 4.0)]
    _, run = rig.fly(depth=4.0, target=8.0, ticks=400, waves=waves)
    t = rig.tick * np.arange(len(run["depth"]))
    z = run["depth"]
    read = sum(w.amplitude * np.exp(-w.k * z) * np.cos(w.omega * t + w.phase) for w in waves)
    np.testing.assert_allclose(run["depth_seen"] - z, read, atol=1e-6)  # the board has floats
    assert np.ptp(z) > 1.0


def test_a_sea_is_as_high_as_it_is_drawn():
    """Half of the missions have none; the variance of what is read is that of `depth_error`."""
    course = course_of(usual(noisy(2e-3)), None)
    missions = [draw(course, seed=3, number=n, healthy=True) for n in range(400)]
    rough = [m for m in missions if m.waves[:, 0].any()]
    assert 0.4 < len(rough) / len(missions) < 0.6
    for m in rough[:20]:
        nearest, t = float(m.depths[:-1].min()), np.arange(0.0, 3600.0, 0.3)
        w = Wave(*m.waves.T)
        read = w.amplitude * np.exp(-w.k * nearest) * np.cos(w.omega * t[:, None] + w.phase)
        most = float(np.interp(nearest, *HEIGHTS))
        sea = Swell(most, tuple((2.0 * math.pi / w.omega).tolist()))
        same = depth_error(sea, course.vehicle, t, depth=nearest, runs=1, seed=1)
        assert read.sum(axis=1).std() <= 1.02 * same.std()


def test_floats_are_launched_in_half_the_highest_seas():
    vehicle = load_vehicle("example-float")
    limited = vehicle.model_copy(update={"supervisor": Supervisor(time_limit=60_000.0)})
    course = course_of(limited, None)
    heights = []
    for n in range(200):
        waves = draw(course, seed=3, number=n, healthy=True).waves
        shares = np.array([share_read(w[1], vehicle.hull) if w[0] else 1.0 for w in waves])
        heights.append(4.0 * math.sqrt(float(np.sum((waves[:, 0] / shares) ** 2)) / 2.0))
    assert max(heights) == pytest.approx(0.5 * HEIGHTS[1][-1], rel=0.05)
    assert 0.4 < np.mean(np.array(heights) > 0.0) < 0.6


def test_sensors_are_not_always_what_the_file_says():
    course = course_of(usual(noisy(2e-3)), None)
    missions = [draw(course, seed=3, number=n, healthy=True) for n in range(400)]
    noise = np.array([m.condition.depth_noise for m in missions])
    quantum = np.array([m.condition.depth_quantum for m in missions])
    assert noise.min() == pytest.approx(0.5e-3, rel=0.1)
    assert noise.max() == pytest.approx(8e-3, rel=0.1)
    assert (noise == 2e-3).mean() == pytest.approx(0.5, abs=0.1)
    assert set(quantum) == {0.0, 5e-3}
    assert (quantum > 0.0).mean() == pytest.approx(0.25, abs=0.07)


def test_a_sensor_that_is_not_stated_rounds_to_what_a_driver_may_round_to():
    """5 mm at most, for which the supervisor allows without a word; 0.5 to 5 mm of noise."""
    course = course_of(usual(noisy(0.0)), None)
    missions = [draw(course, seed=3, number=n, healthy=True).condition for n in range(200)]
    quantum, noise = np.array([(c.depth_quantum, c.depth_noise) for c in missions]).T
    assert set(quantum) == {0.0, 1e-3, 5e-3}
    assert (noise.min(), noise.max()) == pytest.approx((0.5e-3, 5e-3), rel=0.1)


@pytest.mark.promise("no-false-alarm")
@pytest.mark.parametrize(
    ("stated", "noise", "quantum"),
    [(8e-3, 2e-3, 0.0), (2e-3, 8e-3, 0.0), (2e-3, 2e-3, 5e-3), (2e-3, 0.5e-3, 5e-3)],
)
def test_two_hours_of_holding_with_another_sensor_raise_no_alarm(
    monkeypatch, stated, noise, quantum
):
    as_flashed = supervision_of(noisy(stated), 0.3, True)
    monkeypatch.setattr(
        "swimbladder.sim.closed_loop.floats.supervision_of", lambda *_, **__: as_flashed
    )
    held = {"setpoints": [(0.0, 2.0)], "start_depth": 2.0, "duration": 7200.0}
    runs = simulate_ensemble(noisy(noise, quantum), **held, count=20, seed=3, supervised=True)
    assert {Reason(int(code)).words for code in runs.alarm if code} == set()


@pytest.mark.promise("no-false-alarm")
@pytest.mark.usefixtures("gcc")
def test_no_healthy_vehicle_is_brought_up_in_a_sea():
    found = faults(usual(noisy(2e-3)), missions=1, healthy=150, seed=20)
    assert len(found.false_alarms) == 0
