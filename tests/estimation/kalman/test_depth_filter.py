"""The filter against NumPy, SciPy's Riccati solver and the density of a whole record."""

import math

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are
from scipy.stats import chi2, multivariate_normal

from swimbladder.estimation.kalman import (
    CLIPPED,
    COUNTED,
    HELD,
    REJECTED,
    RESTARTED,
    UNSEEN,
    Member,
    Noise,
    Samples,
    Start,
    filter_bank,
    filter_depth,
)
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import drive

NOISE = Noise(depth=3e-3, random_walk=0.2e-6, acceleration=1e-4)
START = Start(depth=60.0, speed=0.0, neutral=0.0, depth_std=0.02, speed_std=0.01, neutral_std=3e-6)
PLANT = plant(load_vehicle("feup-em"))


def system(p, h, noise):
    """F, Q, and what V and dV/dt add to the state; volumes in cm3, by matrix exponentials."""
    a = 1e-6 * p.a_b
    A = np.array([[0.0, 1.0, 0.0], [p.a_b * p.psi, -p.d_l, a], [0.0, 0.0, 0.0]])
    L = np.diag([0.0, noise.acceleration**2, 1e12 * noise.random_walk**2])
    E = expm(np.block([[-A, L], [np.zeros((3, 3)), A.T]]) * h)
    F = expm(A * h)
    forced = np.zeros((5, 5))
    forced[:3, :3], forced[1, 3], forced[3, 4] = A, -a, 1.0
    return F, F @ E[:3, 3:], expm(forced * h)[:3, 3:]


def made(n=40, seed=1, p=PLANT, noise=NOISE, start=START, even=False):
    """A record of the linear model itself, with its true states; volumes in m3."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) * 0.5 if even else np.cumsum(rng.uniform(0.1, 1.2, n))
    volume = p.psi * 60.0 + 5e-6 * np.sin(0.3 * time) + rng.normal(0.0, 1e-6, n)
    states = np.empty((n, 3))
    x = np.array([start.depth, start.speed, 1e6 * start.neutral])
    x = x + rng.normal(0.0, [start.depth_std, start.speed_std, 1e6 * start.neutral_std])
    for k in range(n):
        if k:
            h = time[k] - time[k - 1]
            F, Q, B = system(p, h, noise)
            step = np.array([volume[k - 1], (volume[k] - volume[k - 1]) / h]) * 1e6
            x = F @ x + B @ step + rng.multivariate_normal(np.zeros(3), Q)
        states[k] = x
    depth = states[:, 0] + rng.normal(0.0, noise.depth, n)
    states[:, 2] *= 1e-6
    return Samples(time, volume, depth, np.ones(n, np.int8)), states


def filtered(samples, **change):
    given = {"noise": NOISE, "start": START, "gate": math.inf} | change
    return filter_depth(PLANT, samples, **given)


def plain_filter(samples, noise=NOISE, start=START):
    """The textbook's linear Kalman filter, in cm3."""
    x = np.array([start.depth, start.speed, 1e6 * start.neutral])
    P = np.diag(np.square([start.depth_std, start.speed_std, 1e6 * start.neutral_std]))
    H, R = np.array([[1.0, 0.0, 0.0]]), noise.depth**2
    found, total = [], 0.0
    for k in range(len(samples.time)):
        if k:
            h = samples.time[k] - samples.time[k - 1]
            F, Q, B = system(PLANT, h, noise)
            a, b = samples.volume[k - 1], samples.volume[k]
            x = F @ x + B @ (np.array([a, (b - a) / h]) * 1e6)
            P = F @ P @ F.T + Q
        e = samples.depth[k] - x[0]
        S = (H @ P @ H.T)[0, 0] + R
        K = (P @ H.T / S)[:, 0]
        total -= 0.5 * (e**2 / S + math.log(2.0 * math.pi * S))
        x = x + K * e
        P = (np.eye(3) - np.outer(K, H)) @ P
        found.append((x.copy(), P.copy(), e, S))
    return found, total


def test_it_is_the_linear_filter_of_the_textbook():
    samples, _ = made()
    ours = filtered(samples)
    found, total = plain_filter(samples)
    D = np.diag([1.0, 1.0, 1e6])
    for k, (x, P, e, S) in enumerate(found):
        np.testing.assert_allclose(D @ ours.mean[k], x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(D @ ours.covariance[k] @ D, P, rtol=1e-7, atol=1e-12)
        assert ours.innovation[k] == pytest.approx(e, rel=1e-8, abs=1e-12)
        assert ours.variance[k] == pytest.approx(S, rel=1e-9)
    assert ours.log_likelihood == pytest.approx(total, rel=1e-11)
    assert ours.log_likelihood == pytest.approx(ours.contribution.sum(), rel=1e-13)
    assert set(ours.fate) == {COUNTED}


def whole(samples, noise=NOISE, start=START):
    """Mean and covariance of all states of a record stacked, [n, 3], in cm3, built by recursion."""
    n = len(samples.time)
    mean = np.zeros((n, 3))
    C = np.zeros((3 * n, 3 * n))
    mean[0] = start.depth, start.speed, 1e6 * start.neutral
    C[:3, :3] = np.diag(np.square([start.depth_std, start.speed_std, 1e6 * start.neutral_std]))
    for k in range(1, n):
        h = samples.time[k] - samples.time[k - 1]
        F, Q, B = system(PLANT, h, noise)
        a, b = samples.volume[k - 1], samples.volume[k]
        mean[k] = F @ mean[k - 1] + B @ (np.array([a, (b - a) / h]) * 1e6)
        new, old = slice(3 * k, 3 * k + 3), slice(3 * k - 3, 3 * k)
        C[new, : 3 * k] = F @ C[old, : 3 * k]
        C[: 3 * k, new] = C[new, : 3 * k].T
        C[new, new] = F @ C[old, old] @ F.T + Q
    return mean, C


def test_the_likelihood_is_the_density_of_the_whole_record():
    samples, _ = made(n=15, seed=3)
    mean, C = whole(samples)
    density = multivariate_normal(mean[:, 0], C[::3, ::3] + NOISE.depth**2 * np.eye(15))
    assert filtered(samples).log_likelihood == pytest.approx(
        density.logpdf(samples.depth), rel=1e-9
    )


def test_correlated_noise_of_the_depth_is_part_of_the_density():
    samples, _ = made(n=15, seed=6)
    noise = NOISE._replace(correlated=7e-3, correlation_time=2.5)
    mean, C = whole(samples)
    apart = np.abs(np.subtract.outer(samples.time, samples.time))
    lasts = 7e-3**2 * np.exp(-apart / 2.5)
    density = multivariate_normal(mean[:, 0], C[::3, ::3] + lasts + NOISE.depth**2 * np.eye(15))
    found = filtered(samples, noise=noise)
    assert found.log_likelihood == pytest.approx(density.logpdf(samples.depth), rel=1e-9)
    gain = C[-3:, ::3] @ np.linalg.inv(density.cov)
    last = found.mean[-1] * [1.0, 1.0, 1e6]
    expected = mean[-1] + gain @ (samples.depth - mean[:, 0])
    np.testing.assert_allclose(last, expected, rtol=1e-7, atol=1e-8)
    left = C[-3:, -3:] - gain @ C[-3:, ::3].T
    D = np.diag([1.0, 1.0, 1e6])
    np.testing.assert_allclose(D @ found.covariance[-1] @ D, left, rtol=1e-6, atol=1e-11)


def test_the_error_of_a_volume_is_part_of_the_density():
    samples, _ = made(n=15, seed=8)
    noise = NOISE._replace(correlated=7e-3, correlation_time=2.5)
    begins, std, white = [0, 4, 9], 2e-6, 1e-12  # m3, m6 s
    volume_error = np.full((2, 15), -1.0)
    volume_error[0, begins], volume_error[1] = std**2, white
    # The white part is as good as more acceleration.
    shaken = noise._replace(acceleration=math.hypot(noise.acceleration, PLANT.a_b * white**0.5))
    found = filtered(samples._replace(volume_error=volume_error), noise=noise).log_likelihood
    mean, C = whole(samples, noise=shaken)
    apart = np.abs(np.subtract.outer(samples.time, samples.time))
    C = C[::3, ::3] + 7e-3**2 * np.exp(-apart / 2.5) + NOISE.depth**2 * np.eye(15)
    for first, last in ((0, 4), (4, 9), (9, 14)):
        moved, x = np.zeros(15), np.zeros(3)
        for k in range(1, 15):
            F = system(PLANT, samples.time[k] - samples.time[k - 1], NOISE)[0]
            # The record counts from its first volume, which is known to be neutral.
            own = 0.0 if first == 0 and k <= 4 else -1.0 if first == 0 else float(first < k <= last)
            x[2] = own * 1e6 * std
            x = F @ x
            moved[k] = x[0]
        C = C + np.outer(moved, moved)
    density = multivariate_normal(mean[:, 0], C)
    assert found == pytest.approx(density.logpdf(samples.depth), rel=1e-9)


def test_correlated_noise_does_not_outlast_a_state_that_was_wrong():
    samples, _ = made(n=30, seed=7)
    jumped = samples._replace(depth=samples.depth + np.where(np.arange(30) >= 15, 5.0, 0.0))
    noise = NOISE._replace(correlated=7e-3, correlation_time=20.0)
    found = filtered(jumped, noise=noise, gate=3.0)
    assert RESTARTED in found.fate
    assert np.abs(found.innovation[-8:]).max() < 0.1


def test_the_smoother_conditions_on_the_whole_record():
    samples, _ = made(n=15, seed=4)
    mean, C = whole(samples)
    gain = C[:, ::3] @ np.linalg.inv(C[::3, ::3] + NOISE.depth**2 * np.eye(15))
    expected = mean.ravel() + gain @ (samples.depth - mean[:, 0])
    left = C - gain @ C[::3, :]
    found, covariance = filtered(samples).smoothed()
    D = np.diag([1.0, 1.0, 1e6])
    np.testing.assert_allclose(found @ D, expected.reshape(15, 3), rtol=1e-7, atol=1e-8)
    for k in range(15):
        block = left[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(D @ covariance[k] @ D, block, rtol=1e-5, atol=1e-9)


def test_a_prediction_conditions_on_what_was_measured_before():
    samples, _ = made(n=15, seed=5)
    mean, C = whole(samples)
    seen = slice(0, 9)
    z = C[::3, ::3]
    gain = z[14, seen] @ np.linalg.inv(z[seen, seen] + NOISE.depth**2 * np.eye(9))
    expected = mean[14, 0] + gain @ (samples.depth[seen] - mean[seen, 0])
    bank = filter_bank(samples, [Member(PLANT, NOISE, START, drift=0.0)], gate=math.inf)
    depth, std = bank.ahead(np.array([8]), np.array([14]))
    assert depth[0] == pytest.approx(expected, rel=1e-10)
    assert std[0] == pytest.approx(math.sqrt(z[14, 14] - gain @ z[seen, 14]), rel=1e-7)


def test_the_covariance_settles_where_the_riccati_equation_says():
    noise = Noise(depth=3e-3, random_walk=0.5e-6)
    samples, _ = made(n=3000, even=True)
    ours = filtered(samples, noise=noise)
    F, Q, _ = system(PLANT, 0.5, noise)
    H = np.array([[1.0, 0.0, 0.0]])
    expected = solve_discrete_are(F.T, H.T, Q, np.array([[noise.depth**2]]))
    D = np.diag([1.0, 1.0, 1e6])
    np.testing.assert_allclose(
        D @ ours.predicted_covariance[-1] @ D, expected, rtol=1e-7, atol=1e-12
    )


def test_errors_are_as_large_as_the_filter_says():
    """NEES and NIS over simulated records: chi-squared, as for a filter that tells the truth."""
    nees, nis = [], []
    for seed in range(60):
        samples, states = made(n=50, seed=seed)
        ours = filtered(samples)
        D = np.array([1.0, 1.0, 1e6])
        e = (ours.mean[-1] - states[-1]) * D
        nees.append(e @ np.linalg.solve(D[:, None] * ours.covariance[-1] * D, e))
        nis.append(ours.innovation**2 / ours.variance)
    low, high = chi2(3 * 60).ppf([0.001, 0.999])
    assert low < sum(nees) < high
    low, high = chi2(50 * 60).ppf([0.001, 0.999])
    assert low < np.sum(nis) < high


def test_samples_that_are_not_looked_at_change_nothing():
    samples, _ = made()
    use = samples.use.copy()
    use[10:14] = -1
    ours = filtered(samples._replace(use=use))
    kept = use > 0
    # the volume is linear between samples: leave the time grid as it is, only the depth unseen
    depth = np.where(kept, samples.depth, np.nan)
    other = filtered(samples._replace(depth=depth))
    assert (ours.fate[10:14] == UNSEEN).all()
    assert np.isnan(ours.innovation[10:14]).all()
    assert ours.log_likelihood == other.log_likelihood
    np.testing.assert_array_equal(ours.mean, other.mean)


def test_gross_outliers_do_not_move_it():
    samples, states = made(n=150, seed=7)
    rng = np.random.default_rng(0)
    bad = rng.random(150) < 0.1
    bad[:20] = False
    depth = samples.depth + np.where(
        bad, rng.choice([-1.0, 1.0], 150) * rng.uniform(0.1, 3, 150), 0
    )
    clean = filtered(samples)
    ours = filtered(samples._replace(depth=depth), gate=3.0)
    assert (ours.fate[bad] == REJECTED).all()
    assert not (ours.fate == RESTARTED).any()
    std = np.sqrt(ours.covariance[:, 0, 0])
    assert np.abs((ours.mean[:, 0] - states[:, 0]) / std).max() < 5.0
    assert np.abs(ours.mean[-1, 2] - clean.mean[-1, 2]) < math.sqrt(clean.covariance[-1, 2, 2])


def test_an_excess_loses_weight_as_its_density_says():
    """The weight is the slope of the loss over its argument; loss and weight go on smoothly."""
    samples, _ = made(n=60, seed=8)
    plain = filtered(samples)
    k, gate, deviation = 50, 4.0, math.sqrt(plain.variance[50])

    def run(size):
        depth = samples.depth.copy()
        depth[k] = plain.predicted[k, 0] + size * deviation
        return filtered(samples._replace(depth=depth), gate=gate)

    def loss(size):
        return -run(size).contribution[k] - 0.5 * math.log(2.0 * math.pi * plain.variance[k])

    gain = (run(1.0).mean[k, 0] - plain.predicted[k, 0]) / deviation
    for size in (3.9, 4.1, 6.0, 20.0):
        slope = (loss(size + 1e-3) - loss(size - 1e-3)) / 2e-3
        moved = (run(size).mean[k, 0] - plain.predicted[k, 0]) / deviation
        assert moved == pytest.approx(gain * slope, rel=1e-4)
    assert loss(gate + 1e-9) == pytest.approx(0.5 * gate**2, rel=1e-6)
    assert [run(size).fate[k] for size in (3.9, 6.0, 20.0)] == [COUNTED, CLIPPED, REJECTED]


def test_a_jump_that_stays_restarts_the_filter():
    samples, _ = made(n=100, seed=9)
    depth = samples.depth.copy()
    depth[50:] += 1.0
    ours = filtered(samples._replace(depth=depth), gate=3.0)
    assert ours.fate[53] == RESTARTED
    assert (ours.fate == RESTARTED).sum() == 1
    assert np.abs(ours.innovation[-20:]).max() < 0.05
    assert np.abs(ours.predicted[53, 0] - depth[53]) > 0.5


def test_a_vehicle_on_the_bottom_tells_nothing_of_its_neutral_volume_and_then_it_does():
    vehicle = load_vehicle("ntnu-bv")
    p = plant(vehicle, bottom_depth=1.4)
    time = np.arange(0.0, 120.0, 0.5)
    neutral = vehicle.trim_error + 2e-6  # the truth
    heavy = neutral - 6e-6
    # heavy for 60 s on the bottom, then 1 cm3 lighter than neutral: it rises
    volume = np.interp(
        time, [0.0, 60.0, 65.0, 120.0], [heavy, heavy, neutral + 1e-6, neutral + 1e-6]
    )
    truth = drive(
        vehicle.model_copy(update={"trim_error": neutral}),
        time=time,
        volume=volume,
        start_depth=1.4,
        bottom_depth=1.4,
    )
    depth = truth.depth + np.random.default_rng(2).normal(0.0, 2e-3, len(time))
    clear = truth.depth < 1.37
    samples = Samples(time, volume, depth, clear.astype(np.int8))
    start = Start(1.4, 0.0, vehicle.trim_error, 0.02, 0.02, 4e-6)
    ours = filter_depth(p, samples, noise=Noise(2e-3, 0.02e-6), start=start)
    lying = time < 55.0
    assert (ours.fate[lying] == HELD).all()
    assert ours.covariance[lying, 2, 2].min() > 0.99 * (4e-6) ** 2
    assert abs(ours.mean[-1, 2] - neutral) < 0.3e-6
    assert abs(ours.mean[-1, 0] - truth.depth[-1]) < 5e-3


@pytest.mark.parametrize(("size", "counts"), [(2.9, 2.9), (6.0, 0.5), (30.0, 0.036)])
def test_an_excess_counts_as_the_page_says(size, counts):
    """docs/explanation/filter.md, outliers: moved as by an innovation of so many deviations."""
    samples, _ = made(n=60, seed=8)
    before, k = filtered(samples, gate=3.0), 50
    deviation = math.sqrt(before.variance[k])
    depth = samples.depth.copy()
    depth[k] = before.predicted[k, 0] + size * deviation
    moved = filtered(samples._replace(depth=depth), gate=3.0).mean[k, 0] - before.predicted[k, 0]
    gain = before.predicted_covariance[k, 0, 0] / before.variance[k]
    assert moved / (gain * deviation) == pytest.approx(counts, rel=0.01)
