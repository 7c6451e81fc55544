"""Long logs of an unstable vehicle, where a small error of the start grows a millionfold."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.estimation.motion import identify
from swimbladder.estimation.motion.fit import cost
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from tests.estimation.motion.pool import FEUP, trace

FEUP_EM = load_vehicle("feup-em")


def held_log(seed, *, noise=2e-3):
    """Return 300 s under a controller that holds two depths; the volume is a sum of a few sines.

    Its depths are SciPy's, under the volume that stands in the log, straight between samples.
    """
    rng = np.random.default_rng(seed)
    psi, m, k_dl = FEUP["psi"], FEUP["m"], FEUP["k_dl"]
    step = 0.5

    def rates(_, x, V):
        return [x[1], 9806.65 * (psi * x[0] - V) / m - k_dl * x[1] / m]

    state, volume, depth = np.array([1.5, 0.0]), [psi * 1.5], [1.5]
    for k in range(600):
        target = 1.5 if k < 20 or k > 300 else 3.0
        V = psi * target + 40e-6 * (state[0] - target) + 8e-4 * state[1]
        V = float(np.clip(V, volume[-1] - 2e-5, volume[-1] + 2e-5))
        t = np.array([0.0, step])
        mean = np.array([volume[-1], V])
        run = solve_ivp(
            lambda t, x, mean=mean: rates(t, x, mean[0] + (mean[1] - mean[0]) * t / step),
            t,
            state,
            rtol=1e-11,
            atol=1e-13,
        )
        state = run.y[:, -1]
        volume.append(V)
        depth.append(state[0])
    z = np.array(depth) + noise * rng.normal(size=len(depth))
    time = step * np.arange(len(z))
    return Log(source="held", time=time, depth=z, volume=np.array(volume), line=np.arange(len(z)))


@pytest.mark.parametrize("fixed", [{}, {"psi": 4.04e-6}], ids=["psi sought", "psi known"])
def test_the_search_does_not_stray(fixed):
    found = identify([held_log(3)], FEUP_EM, fixed=fixed, profiles=False, choices=False)
    assert found.identified
    (e,) = found.experiments
    assert e.rms == pytest.approx(2e-3, rel=0.1)
    for name, truth in (("K2", 7935.54), ("T2", 36.3)):
        estimate = found.parameters[name]
        assert abs(estimate.value - truth) < 4.0 * estimate.std
        assert estimate.std < 0.05 * truth


def test_calling_samples_outliers_does_not_pay_by_a_smaller_noise():
    residual = np.concatenate([np.full(60, 1e-4), np.full(40, 0.1)])
    honest = cost(residual, np.full(100, 0.06)).sum()
    greedy = [cost(residual, np.full(100, sigma)).sum() for sigma in (1e-4, 1e-5)]
    # an outlier costs the same under any noise that makes it one
    assert cost(np.array([0.1]), np.array([1e-3])) == cost(np.array([5.0]), np.array([1e-5]))
    assert greedy[0] < honest  # where most agree, the rest may be outliers
    assert greedy[1] > greedy[0]
    # normal noise costs what its density says
    assert cost(np.array([2e-3]), np.array([1e-3]))[0] == pytest.approx(4.0 + 2.0 * np.log(1e-3))


def test_the_experiments_of_these_tests_are_exact():
    log = held_log(3, noise=0.0)
    z = trace(log.time, log.volume, z0=1.5, **FEUP)
    # the same equation with the same integrand: as far apart as the unstable mode makes them
    assert np.abs(z - log.depth)[:60].max() < 1e-8
