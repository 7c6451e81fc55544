"""Eqs (36)-(37) in exact arithmetic, and the closed loop against independently computed numbers."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import expm

from swimbladder.control import cascade
from swimbladder.control.law import Measurement
from swimbladder.control.registry import bind
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate, step_metrics


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("feup-em")


def test_table_3_in_si(vehicle):
    """Printed in dm3: a litre is 1e-3 m3."""
    _, gains = bind(vehicle.controller)
    assert gains.k_pV == pytest.approx(1002e3, rel=1e-15)
    assert gains.k_pz == pytest.approx(-0.1043e-3, rel=1e-15)
    assert gains.k_iz == pytest.approx(-7.486e-7, rel=1e-15)
    assert gains.k_dz == pytest.approx(-2.341e-3, rel=1e-15)
    assert gains.S_p == 0.3


def test_eqs_36_and_37_by_hand(vehicle):
    """Four samples in exact fractions, written out one by one."""
    _, gains = bind(vehicle.controller)
    k_pV, kp, ki, kd, S = (Fraction(x) for x in gains)
    e = [Fraction(3, 2), Fraction(7, 5), Fraction(13, 10), Fraction(-1, 10)]
    V = [Fraction(1, 10**5), Fraction(-2, 10**5), Fraction(0), Fraction(3, 10**5)]
    U_i = [V[0], V[0] + ki * S * e[0]]
    U_i.append(U_i[1] + ki * S * e[1])
    U_i.append(U_i[2] + ki * S * e[2])
    U = [
        kp * e[0] + U_i[0],  # e(-1) = e(0): no derivative kick
        kp * e[1] + kd * (e[1] - e[0]) / S + U_i[1],
        kp * e[2] + kd * (e[2] - e[1]) / S + U_i[2],
        kp * e[3] + kd * (e[3] - e[2]) / S + U_i[3],
    ]
    state = cascade.initial(gains, Measurement(0.0, 3.0 - 1.5, float(V[0])), 3.0)
    for k in range(4):
        seen = Measurement(0.3 * k, 3.0 - float(e[k]), float(V[k]))
        voltage, state, wait = cascade.step(gains, state, seen, 3.0)
        assert voltage == pytest.approx(float(k_pV * (U[k] - V[k])), rel=1e-11)
        assert state.volume_reference == pytest.approx(float(U[k]), rel=1e-11)
        assert wait == 0.3


def test_too_shallow_takes_volume_in(vehicle):
    """The signs of Table 3: below the target more volume, above it less."""
    _, gains = bind(vehicle.controller)
    for depth, sign in ((1.0, -1.0), (3.0, 1.0)):
        seen = Measurement(0.0, depth, 0.0)
        voltage, _, _ = cascade.step(gains, cascade.initial(gains, seen, 2.0), seen, 2.0)
        assert np.sign(voltage) == sign


def test_the_independent_closed_loop(vehicle):
    """SciPy's LSODA at 1e-9 on the printed numbers: 14.7 %, 37.8 s, 338 s, -99 to +13 cm3."""
    s = simulate(vehicle, setpoints=[(0.0, 3.0)], duration=400.0, start_depth=1.5)
    m = step_metrics(s.time, s.depth, start=1.5, target=3.0)
    assert m.overshoot_pct == pytest.approx(14.7, abs=0.05)
    assert m.rise90_s == pytest.approx(37.8, abs=0.01)
    assert m.settle2_s == pytest.approx(338.0, abs=0.5)
    assert s.volume.min() * 1e6 == pytest.approx(-99.0, abs=0.5)
    assert s.volume.max() * 1e6 == pytest.approx(13.0, abs=0.5)
    assert abs(s.voltage[0]) == 12.0  # the motor is on its limit at first


def sampled(start, target, samples):
    """The same loop once more, by exponentials between samples and nothing of the engine."""
    K1A, T1, K2, T2, psi, load, S = 3.33e-6, 0.09, 7935.54, 36.3, 4.04e-6, 0.07707, 0.3
    A = np.array(
        [
            [-1 / T1, 0, -K1A * load / T1, 0, K1A / T1],
            [1, 0, 0, 0, 0],
            [0, 0, 0, 1, 0],
            [0, -K2 / T2, psi * K2 / T2, -1 / T2, 0],
            [0, 0, 0, 0, 0],
        ]
    )
    step = expm(A * S)
    x = np.array([0.0, psi * start, start, 0.0])
    U_i, before = x[1], target - start
    depths = []
    for _ in range(samples + 1):
        depths.append(x[2])
        e = target - x[2]
        U = -0.1043e-3 * e - 2.341e-3 * (e - before) / S + U_i
        u = min(max(1.002e6 * (U - x[1]), -12.0), 12.0)
        U_i, before = U_i - 7.486e-7 * S * e, e
        x = (step @ [*x, u])[:4]
    return np.array(depths)


@pytest.mark.parametrize(("start", "target"), [(1.5, 3.0), (3.0, 1.5), (1.0, 3.5), (0.9, 0.5)])
def test_the_loop_sample_by_sample(vehicle, start, target):
    """The trajectory to 2e-5 m and better against the printed numbers alone."""
    s = simulate(vehicle, setpoints=[(0.0, target)], duration=300.0, start_depth=start)
    assert s.depth == pytest.approx(sampled(start, target, 1000), abs=1e-9)


def test_the_start_of_the_integral_matters_by_centimetres(vehicle):
    """U_i(0) = 0 instead of the neutral volume shifts the depth by up to 5 cm."""
    law, gains = bind(vehicle.controller)

    class Zeroed:
        state = None

        def __call__(self, seen, reference):
            if self.state is None:
                self.state = law.initial(gains, seen, reference)._replace(integral=0.0)
            u, self.state, _ = law.step(gains, self.state, seen, reference)
            return u

    as_is = simulate(vehicle, setpoints=[(0.0, 3.0)], duration=200.0, start_depth=1.5)
    zeroed = simulate(
        vehicle, setpoints=[(0.0, 3.0)], duration=200.0, start_depth=1.5, law=Zeroed()
    )
    shift = np.abs(zeroed.depth - as_is.depth).max()
    assert 0.03 < shift < 0.055


def test_overshoot_is_slightly_lower_ascending(evidence):
    """The claim of section 3.2, as far as a prediction can bear it: a fraction of a point."""
    for pair in evidence.pairs:
        assert 0.0 < pair.down.overshoot_pct - pair.up.overshoot_pct < 1.0


def test_a_longer_step_converges(evidence):
    assert evidence.long_metrics.final_depth_m == pytest.approx(3.5, abs=1e-3)
    assert evidence.long_step.events == ()  # neither surface nor bottom
