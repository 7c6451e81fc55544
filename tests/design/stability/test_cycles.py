"""Limit cycles by harmonic balance, against textbooks, exact relay theory and recursion."""

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from swimbladder.design.linear.margins import spectral_radius
from swimbladder.design.linear.models import StateSpace
from swimbladder.design.stability.cycles import balance, dead_zone, quantiser, relay, saturation

H = 0.01
# an integrator and two lags of a second
LAG = (np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]]), [0.0, 0.0, 1.0], [1, 0, 0])


def held(A, B, h):
    block = np.zeros((len(A) + 1, len(A) + 1))
    block[:-1, :-1], block[:-1, -1] = A * h, np.asarray(B) * h
    E = expm(block)
    return E[:-1, :-1], E[:-1, -1:]


def sampled(A, B, C, *, h=H, gain=1.0):
    Ad, Bd = held(A, B, h)
    n = len(A)
    return StateSpace(
        A=Ad,
        B=gain * Bd,
        C=np.array([C], float),
        D=np.zeros((1, 1)),
        states=tuple("abcdefg"[:n]),
        inputs=("u",),
        outputs=("y",),
        sample_time=h,
    )


def recursed(loop, one, start, steps):
    """Follow x+ = A x - B f(C x); return C x over the last third."""
    x, seen = np.asarray(start, float), []
    for _ in range(steps):
        y = float(loop.C[0] @ x)
        seen.append(y)
        x = loop.A @ x - loop.B[:, 0] * float(one.output(np.array([y]))[0])
    return np.array(seen[-steps // 3 :])


def period(y, h):
    up = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))
    at = up - y[up] / (y[up + 1] - y[up])
    return float(np.mean(np.diff(at))) * h


def test_a_relay_before_an_integrator_and_two_lags():
    # The phase is -180 degrees at 1 rad/s, where 1/(s (s + 1)^2) is 1/2: A = (4/pi)/2, T = 2 pi.
    (found,) = balance(sampled(*LAG, h=1e-3), relay(1.0))
    assert found.amplitude == pytest.approx(2.0 / math.pi, rel=2e-3)
    assert found.period == pytest.approx(2.0 * math.pi, rel=1e-3)
    assert found.stable
    assert found.believed

    # Exactly: half a period sampled, C (-I - Phi)^-1 Gamma = 0 (Astrom and Hagglund, Automatica
    # 20, 1984, 645). The prediction errs by no more than it says.
    A, B, C = LAG

    def locus(half):
        Phi, Gamma = held(A, B, half)
        return float((np.array(C) @ np.linalg.solve(-np.eye(3) - Phi, Gamma))[0])

    exact = 2.0 * brentq(locus, 2.0, 4.5)
    error = abs(found.period / exact - 1.0)
    assert 1e-4 < error <= found.period_error


@pytest.mark.parametrize(
    ("loop", "one", "start"),
    [
        (sampled(*LAG, gain=8.0), saturation(0.3), [0.4, 0.0, 0.0]),
        (sampled(*LAG, gain=3.0), relay(0.2), [0.4, 0.0, 0.0]),
        (sampled(*LAG, gain=2.4), saturation(0.3), [0.4, 0.0, 0.0]),
    ],
    ids=["limit", "switch", "limit, hardly reached"],
)
def test_a_stable_cycle_is_what_remains(loop, one, start):
    (found,) = balance(loop, one)
    y = recursed(loop, one, start, 30_000)
    assert found.stable
    assert found.believed
    assert abs(found.amplitude / (0.5 * np.ptp(y)) - 1.0) <= found.amplitude_error + 0.03
    assert abs(found.period / period(y, H) - 1.0) <= found.period_error + 0.005


# (s + 1)(s + 0.5)^2/s^4 and more: stable with its gain, unstable with much less
AT_LEAST = np.poly([-1.0, -0.5, -0.5])


def conditionally_stable(gain):
    A = np.diag([1.0, 1.0, 1.0], 1)
    return sampled(A, [0.0, 0.0, 0.0, 1.0], AT_LEAST[::-1], gain=gain)


def test_a_limit_in_a_loop_that_needs_its_gain_has_an_edge():
    loop = conditionally_stable(8.0)
    assert spectral_radius(loop.A - loop.B @ loop.C) < 1.0
    one = saturation(1.0)
    found = [c for c in balance(loop, one) if not c.stable]
    edge = found[-1]
    # Below the edge it decays, beyond it grows; started on the eigenvector of the crossing.
    k = float(one.gain(np.array([edge.amplitude]))[0].real)
    values, vectors = np.linalg.eig(loop.A - k * loop.B @ loop.C)
    near = int(np.argmin(np.abs(np.abs(np.angle(values)) / H - edge.frequency)))
    v = vectors[:, near] / (loop.C[0] @ vectors[:, near])
    decays = recursed(loop, one, np.real(0.8 * edge.amplitude * v), 6_000)
    grows = recursed(loop, one, np.real(1.25 * edge.amplitude * v), 6_000)
    assert np.abs(decays).max() < 0.2 * edge.amplitude
    assert np.abs(grows).max() > 1.5 * edge.amplitude


def test_a_dead_zone_in_a_loop_that_needs_its_gain_makes_a_stable_cycle():
    loop = conditionally_stable(8.0)
    (found,) = [c for c in balance(loop, dead_zone(1.0)) if c.stable]
    y = recursed(loop, dead_zone(1.0), [0.5, 0.1, 0.1, 0.1], 60_000)
    # What the third harmonic alone may do is an estimate, and here all harmonics count.
    assert abs(found.period / period(y, H) - 1.0) <= 3.0 * found.period_error
    assert abs(found.amplitude / np.abs(y).max() - 1.0) <= 3.0 * found.amplitude_error


def test_a_loop_that_holds_with_any_less_gain_has_no_cycle():
    loop = sampled(*LAG, gain=1.0)
    for one in (saturation(1.0), dead_zone(1.0), quantiser(1.0)):
        assert balance(loop, one) == ()
    y = recursed(loop, quantiser(1.0), [3.3, 0.0, 0.0], 30_000)
    assert np.ptp(y) < 0.2
