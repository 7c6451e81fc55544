"""An ensemble with a random walk of the neutral volume, errors of the depth, and a balance."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.control.law import Measurement
from swimbladder.control.registry import bind
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import motor_rhs, plant
from swimbladder.sim.closed_loop import simulate, simulate_ensemble

FEUP = load_vehicle("feup-em")
STEP = {"start_depth": 1.5, "setpoints": [(0.0, 3.0)]}


def samples(seconds, vehicle=FEUP):
    return int(np.ceil(seconds / vehicle.controller.sample_time - 1e-9)) + 1


def flown(vehicle=FEUP, *, duration=60.0, count=2, start_depth=1.5, to=3.0, **given):
    return simulate_ensemble(
        vehicle,
        count=count,
        duration=duration,
        keep="trajectory",
        start_depth=start_depth,
        setpoints=[(0.0, to)],
        **given,
    )


def test_a_neutral_volume_that_jumps_is_what_scipy_makes_of_it():
    law, p = bind(FEUP.controller)
    h, jump, at = FEUP.controller.sample_time, 8e-6, 40
    n = samples(45.0)
    change = np.where(np.arange(n) >= at, jump, 0.0)[:, None]
    ran = flown(duration=45.0, neutral_change=change)
    still = plant(FEUP)
    x = np.array([0.0, FEUP.neutral_volume(1.5), 1.5, 0.0])
    state = law.initial(p, Measurement(0.0, x[2], x[1]), 3.0)
    depths = []
    for k in range(n):
        depths.append(x[2])
        u, state, _ = law.step(p, state, Measurement(k * h, x[2], x[1]), 3.0)
        u = min(max(u, -12.0), 12.0)
        now = still._replace(V_0=float(change[k, 0]))
        x = solve_ivp(
            lambda _, y, u=u, now=now: motor_rhs(y, u, now),
            (0.0, h),
            x,
            method="DOP853",
            rtol=1e-12,
            atol=1e-15,
        ).y[:, -1]
    for lane in (0, 1):
        assert ran["depth"].to_numpy()[:, lane] == pytest.approx(np.array(depths), abs=1e-9)
    without = flown(duration=45.0)["depth"].to_numpy()
    assert np.abs(ran["depth"].to_numpy() - without).max() > 0.02  # the jump is felt


@pytest.mark.parametrize("name", ["feup-em", "example-em", "example-eh", "ntnu-bv"])
def test_beginning_anew_at_every_sample_changes_nothing(name):
    """Too small a change to be felt, but each makes every mode and exponential be made again."""
    vehicle = load_vehicle(name)
    to = 60.0 if name == "feup-em" else 8.0
    n = samples(90.0, vehicle)
    tiny = 1e-30 * (np.arange(n) % 2)[:, None]
    one = flown(vehicle, duration=90.0, to=to, seed=3)
    other = flown(vehicle, duration=90.0, to=to, seed=3, neutral_change=tiny)
    least, most = vehicle.stroke.minimum, vehicle.stroke.maximum
    if name in ("feup-em", "ntnu-bv"):  # such a step takes them to an end stop
        volume = one["volume"].to_numpy()
        assert volume.min() == least or volume.max() == most
    for field in ("depth", "volume", "command"):
        assert other[field].to_numpy() == pytest.approx(one[field].to_numpy(), rel=1e-9, abs=1e-12)


def test_a_lane_that_left_the_water_stays_where_it_stopped():
    n = samples(60.0)
    up = np.where(np.arange(n) % 50 < 25, -4e-4, -4.1e-4)[:, None] * np.array([1.0, 0.0])
    hull = FEUP.hull.model_copy(update={"height": 0.05})
    ran = flown(FEUP.model_copy(update={"hull": hull}), duration=60.0, to=1.5, neutral_change=up)
    assert ran["stop"].to_numpy().tolist() == [1, 0]
    stopped = round(float(ran["stop_time"][0]) / FEUP.controller.sample_time)
    assert 0 < stopped < n - 100
    late = ran["depth"].to_numpy()[stopped + 1 :, 0]
    assert np.ptp(late) == 0.0


def test_an_error_of_the_depth_is_a_shift_of_the_reference():
    n = samples(60.0)
    off = flown(depth_error=np.full((n, 1), 0.1))["depth"].to_numpy()
    shifted = flown(to=2.9)["depth"].to_numpy()
    assert off == pytest.approx(shifted, abs=1e-9)


def test_an_error_of_the_depth_comes_on_top_of_the_noise():
    sensors = FEUP.sensors.model_copy(update={"depth_noise": 2e-3, "depth_quantum": 5e-3})
    noisy = FEUP.model_copy(update={"sensors": sensors})
    n = samples(60.0)
    plain = flown(noisy, seed=4)["depth"].to_numpy()
    none = flown(noisy, seed=4, depth_error=np.zeros((n, 2)))["depth"].to_numpy()
    assert np.array_equal(none, plain)
    # a whole number of quanta: the same noise, the same rounding
    off = flown(noisy, seed=4, depth_error=np.full((n, 2), 0.1))["depth"].to_numpy()
    shifted = flown(noisy, seed=4, to=2.9)["depth"].to_numpy()
    assert off == pytest.approx(shifted, abs=1e-9)


@pytest.mark.parametrize("name", ["example-em", "feup-em", "ntnu-bv"])
def test_energy_is_that_of_a_single_run(name):
    vehicle = load_vehicle(name)
    ran = flown(vehicle, to=2.5, seed=7, balance=True)
    alone = simulate(vehicle, duration=60.0, start_depth=1.5, setpoints=[(0.0, 2.5)], seed=7)
    assert ran["depth"].to_numpy()[:, 0] == pytest.approx(alone.depth, abs=1e-9)
    assert float(ran["energy"][0]) == pytest.approx(alone.balance.energy["source"], rel=1e-6)
    assert ran["energy"].attrs["long_name"] == alone.balance.basis
    assert float(ran["actuator_travel"][0]) > 0.0


def test_series_of_a_wrong_shape_are_refused():
    n = samples(60.0)
    for field in ("depth_error", "neutral_change"):
        with pytest.raises(InputError, match="a row for each sample"):
            flown(**{field: np.zeros((n - 1, 1))})
        with pytest.raises(InputError, match="no finite number"):
            flown(**{field: np.full((n, 1), np.nan)})
