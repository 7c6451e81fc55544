"""Margins against brute force, python-control, textbook loops and the paper's check values."""

import math
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from swimbladder.design.linear.margins import (
    crossing_frequencies,
    equivalent_poles,
    frequency_response,
    largest_delay,
    loop_margins,
    response,
    spectral_radius,
)
from swimbladder.design.linear.models import StateSpace
from tests.examples import examples


def system(A, B, C, h):
    n = len(A)
    return StateSpace(
        A=np.array(A, float),
        B=np.reshape(B, (n, 1)),
        C=np.reshape(C, (1, n)),
        D=np.zeros((1, 1)),
        states=tuple(f"x{i}" for i in range(n)),
        inputs=("u",),
        outputs=("y",),
        sample_time=h,
    )


def from_polynomials(numerator, denominator, h):
    """Controllable canonical form; the denominator is monic and of higher degree."""
    n = len(denominator) - 1
    A = np.eye(n, k=-1)
    A[0] = -np.array(denominator[1:])
    C = np.zeros(n)
    C[n - len(numerator) :] = numerator
    return system(A, np.eye(n)[0], C, h)


LOOPS = ["at the voltage", "at the depth", "stepper at the volume", "stepper at the depth"]


@pytest.fixture(params=LOOPS)
def loop(request, paper_loop, stepper_loop):
    whole = stepper_loop if "stepper" in request.param else paper_loop
    return whole.broken_at_depth() if "depth" in request.param else whole.broken_at_command()


def test_paper_check_values(paper_loop):
    """41 degrees broken at the voltage, 0.24 s of computation, one whole sample is too much."""
    found = loop_margins(paper_loop.broken_at_command())
    assert math.degrees(found.phase) == pytest.approx(41.0, abs=0.5)

    def closed(delay):
        return replace(paper_loop, command_delay=delay).closed()

    limit = largest_delay(closed, step=0.3 / 16, horizon=1.0)
    assert limit == pytest.approx(0.24, abs=0.005)
    assert spectral_radius(closed(0.3)) > 1.0


def test_gain_margins_are_where_it_destabilises(loop):
    """A sweep of 4,000 gains over eight decades, eigenvalues only, and its two ends bisected."""
    found = loop_margins(loop)

    def radius(k):
        return spectral_radius(loop.A - k * loop.B @ loop.C)

    gains = np.geomspace(1e-4, 1e4, 4001)
    stable = np.array([radius(k) < 1.0 for k in gains])
    middle = 2000
    assert gains[middle] == pytest.approx(1.0)
    assert stable[middle]
    above = (
        gains[middle + int(np.argmin(stable[middle:]))] if not stable[middle:].all() else math.inf
    )
    below = gains[middle - int(np.argmin(stable[middle::-1]))] if not stable[:middle].all() else 0.0
    ratio = gains[1] / gains[0]
    if math.isfinite(above):
        assert above / ratio <= found.gain_up <= above
        assert radius(found.gain_up) == pytest.approx(1.0, abs=1e-9)
    else:
        assert found.gain_up > gains[-1]
    if below > 0.0:
        assert below <= found.gain_down <= below * ratio
        # A slow root crosses slowly: what is checked is where it crosses, not how far it got.
        assert radius(found.gain_down * (1 + 1e-4)) < 1.0 < radius(found.gain_down * (1 - 1e-4))
    else:
        assert found.gain_down < gains[0]


def test_phase_margin_destabilises_exactly_there(loop):
    """Turn L by a complex factor: eigenvalues of A - exp(i phi) B C."""
    found = loop_margins(loop)

    def radius(phi):
        return spectral_radius(loop.A - np.exp(1j * phi) * loop.B @ loop.C)

    angles = np.linspace(0.0, found.phase * (1 - 1e-6), 400)
    assert all(radius(a) < 1.0 and radius(-a) < 1.0 for a in angles)
    both = radius(found.phase), radius(-found.phase)
    assert max(both) == pytest.approx(1.0, abs=1e-9)
    assert max(radius(found.phase * 1.001), radius(-found.phase * 1.001)) > 1.0


@pytest.mark.parametrize("where", ["command_delay", "depth_delay"])
@pytest.mark.parametrize("name", ["paper_loop", "stepper_loop"])
def test_delay_limit_is_where_it_destabilises(name, where, request):
    loop = request.getfixturevalue(name)
    h = loop.law.sample_time

    def closed(d):
        return replace(loop, **{where: d}).closed()

    limit = largest_delay(closed, step=h / 16, horizon=40.0 * h)
    assert 0.0 < limit < 40.0 * h
    for d in np.linspace(0.0, limit * (1 - 1e-7), 25):
        assert spectral_radius(closed(d)) < 1.0
    assert spectral_radius(closed(limit)) == pytest.approx(1.0, abs=1e-9)
    assert spectral_radius(closed(limit * 1.001)) > 1.0
    # The frequency response says nearly the same; exactly so only for whole samples.
    broken = loop.broken_at_depth() if where == "depth_delay" else loop.broken_at_command()
    assert loop_margins(broken).delay == pytest.approx(limit, rel=0.05)


def test_whole_samples_of_delay_fit_the_frequency_response(stepper_loop):
    """The delay margin in samples, rounded down, is survived and the next one is not."""
    h = stepper_loop.law.sample_time
    for where, broken in (
        ("command_delay", stepper_loop.broken_at_command()),
        ("depth_delay", stepper_loop.broken_at_depth()),
    ):
        samples = math.floor(loop_margins(broken).delay / h)
        assert spectral_radius(replace(stepper_loop, **{where: samples * h}).closed()) < 1.0
        assert spectral_radius(replace(stepper_loop, **{where: (samples + 1) * h}).closed()) > 1.0


def test_agrees_with_python_control(loop):
    control = pytest.importorskip("control")
    found = loop_margins(loop)
    theirs = loop.to_control()
    # On frequency data, so that no transfer function is formed.
    w = np.unique(
        np.concatenate(
            [
                np.geomspace(1e-5, math.pi / loop.sample_time * (1 - 1e-9), 4_000),
                np.linspace(0.1, math.pi / loop.sample_time * (1 - 1e-9), 4_000),
            ]
        )
    )
    data = control.FRD(theirs, w, smooth=True)
    gains, phases, distances, *_ = control.stability_margins(data, returnall=True)
    up, down = (
        min((g for g in gains if g > 1.0), default=math.inf),
        max((g for g in gains if g < 1.0), default=0.0),
    )
    if found.gain_up_frequency < w[-1]:
        assert found.gain_up == pytest.approx(up, rel=1e-3)
    if found.gain_down > 0.0 and found.gain_down_frequency > w[0]:
        assert found.gain_down == pytest.approx(down, rel=1e-3)
    assert math.degrees(found.phase) == pytest.approx(min(abs(phases)), abs=1e-2)
    assert 1.0 / found.peak_sensitivity == pytest.approx(min(distances), rel=1e-3)
    if hasattr(control, "disk_margins"):
        alpha, gain_dB, phase_deg = control.disk_margins(theirs, w)
        assert found.disk == pytest.approx(float(alpha), rel=1e-3)
        assert 20.0 * math.log10(found.disk_gain) == pytest.approx(float(gain_dB), rel=1e-2)
        assert math.degrees(found.disk_phase) == pytest.approx(float(phase_deg), rel=1e-3)


def test_peak_sensitivity_on_a_dense_grid(loop):
    found = loop_margins(loop)
    w = np.geomspace(1e-6, math.pi / loop.sample_time, 200_001)
    L = loop.at(np.exp(1j * w * loop.sample_time))[:, 0, 0]
    S = 1.0 / (1.0 + L)
    assert found.peak_sensitivity >= np.max(np.abs(S)) * (1 - 1e-12)
    assert found.peak_sensitivity == pytest.approx(np.max(np.abs(S)), rel=1e-6)
    assert 1.0 / found.disk == pytest.approx(np.max(np.abs(S - 0.5)), rel=1e-6)


@given(st.floats(0.0, 2.0 * math.pi), st.floats(0.0, 0.999))
@examples(50)
def test_no_disturbance_inside_the_disk_destabilises(paper_broken, angle, share):
    """(2 + alpha e)/(2 - alpha e) for any |e| < 1: the disk of gains and phases around 1."""
    alpha = loop_margins(paper_broken).disk
    e = share * np.exp(1j * angle)
    factor = (2.0 + alpha * e) / (2.0 - alpha * e)
    assert spectral_radius(paper_broken.A - factor * paper_broken.B @ paper_broken.C) < 1.0


@pytest.fixture(scope="module")
def paper_broken(paper_loop):
    return paper_loop.broken_at_command()


# Textbook loops, whose margins can be written down.


def test_accumulator_with_gain_half():
    """L = k/(z - 1): root 1 - k, so the gain may reach 2; at k = 1/2 that is 4 times."""
    found = loop_margins(system([[1.0]], [1.0], [0.5], 0.1))
    assert found.gain_up == pytest.approx(4.0)
    assert found.gain_up_frequency == pytest.approx(math.pi / 0.1)
    assert found.gain_down == 0.0
    # |e^iw - 1| = 1/2 at w h = 2 asin(1/4); the angle of -1/(e^iw - 1) from 180 degrees.
    w = 2.0 * math.asin(0.25)
    assert found.phase_frequency * 0.1 == pytest.approx(w)
    assert found.phase == pytest.approx(math.pi / 2 - w / 2)
    assert found.delay == pytest.approx((math.pi / 2 - w / 2) / w * 0.1)
    # |S| grows up to the Nyquist frequency: 1/(1 - 1/4).
    assert found.peak_sensitivity == pytest.approx(4.0 / 3.0)
    assert found.peak_frequency == pytest.approx(math.pi / 0.1)


def test_unstable_plant_needs_a_least_gain():
    """L = k/(z - 1.5): root 1.5 - k, stable for 0.5 < k < 2.5; both ends real roots."""
    found = loop_margins(system([[1.5]], [1.0], [1.0], 1.0))
    assert found.gain_down == pytest.approx(0.5)
    assert found.gain_down_frequency == 0.0
    assert found.gain_up == pytest.approx(2.5)
    assert found.gain_up_frequency == pytest.approx(math.pi)


def test_loop_that_never_reaches_one_needs_no_phase():
    found = loop_margins(system([[0.5]], [1.0], [0.2], 1.0))
    assert (found.phase, found.delay) == (math.inf, math.inf)
    assert found.gain_up == pytest.approx(1.5 / 0.2)
    assert found.gain_down == 0.0


def test_conditionally_stable_loop_has_both_margins():
    """Three accumulators, a lag and two zeros: too little gain is as fatal as too much."""
    denominator = np.poly([1.0, 1.0, 1.0, 0.2])
    numerator = 0.5 * np.poly([0.95, 0.9])
    found = loop_margins(from_polynomials(numerator, denominator, 1.0))
    assert 0.0 < found.gain_down < 1.0 < found.gain_up < math.inf

    def radius(k):
        return np.max(np.abs(np.roots(denominator + k * np.concatenate([[0.0, 0.0], numerator]))))

    assert radius(found.gain_down * 0.99) > 1.0 > radius(found.gain_down * 1.01)
    assert radius(found.gain_up * 0.99) < 1.0 < radius(found.gain_up * 1.01)


def test_unstable_loop_has_no_margins():
    loop = system([[1.5]], [1.0], [0.1], 1.0)
    assert loop_margins(loop) is None
    assert largest_delay(lambda _: loop.A - loop.B @ loop.C, step=0.1, horizon=1.0) == 0.0


def test_delay_without_a_limit():
    assert largest_delay(lambda _: np.array([[0.5]]), step=0.1, horizon=1.0) == math.inf


def test_margins_are_of_one_input_and_one_output():
    with pytest.raises(ValueError, match="one input"):
        frequency_response(system([[0.5]], [1.0], [1.0], None))


@given(st.integers(0, 2**32 - 1))
@examples(150)
def test_random_loops_stand_until_the_margin_and_not_beyond(seed):
    """Random plants, resonant and unstable ones among them, judged by eigenvalues only."""
    rng = np.random.default_rng(seed)
    found = None
    for _ in range(50):  # most loops that are drawn are not stable
        n = int(rng.integers(2, 7))
        A = rng.normal(size=(n, n)) / math.sqrt(n)
        loop = system(A, rng.normal(size=n), rng.normal(size=n) * rng.uniform(0.05, 1.0), 1.0)
        found = loop_margins(loop)
        if found is not None:
            break
    assert found is not None

    def radius(k):
        return spectral_radius(loop.A - k * loop.B @ loop.C)

    for k in np.geomspace(max(found.gain_down, 1e-3) * (1 + 1e-6), 1.0, 50):
        assert radius(k) < 1.0 + 1e-9
    for k in np.geomspace(1.0, min(found.gain_up, 1e3) * (1 - 1e-6), 50):
        assert radius(k) < 1.0 + 1e-9
    if math.isfinite(found.gain_up):
        assert radius(found.gain_up) == pytest.approx(1.0, abs=1e-6)
    if found.gain_down > 0.0:
        assert radius(found.gain_down) == pytest.approx(1.0, abs=1e-6)
    if math.isfinite(found.phase):
        turned = [
            spectral_radius(loop.A - np.exp(1j * sign * found.phase) * loop.B @ loop.C)
            for sign in (1, -1)
        ]
        assert max(turned) == pytest.approx(1.0, abs=1e-6)
    for phi in np.linspace(0.0, min(found.phase, math.pi) * (1 - 1e-6), 40):
        assert spectral_radius(loop.A - np.exp(1j * phi) * loop.B @ loop.C) < 1.0 + 1e-9


@contextmanager
def no_convergence():
    """Make LAPACK's QZ iteration give up, as it did for two vehicles of `test_analyse`."""

    def give_up(*_, **__):
        raise np.linalg.LinAlgError("did not converge")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scipy.linalg, "eig", give_up)
        yield


@pytest.mark.parametrize("solved", [nullcontext, no_convergence])
@given(seed=st.integers(0, 2**32 - 1))
@examples(60)
def test_no_crossing_is_missed(solved, seed):
    """Every change of sign of Im L and of |L| - 1 on a dense grid has its eigenvalue."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    A = rng.normal(size=(n, n)) / math.sqrt(n)
    loop = system(A, rng.normal(size=n), rng.normal(size=n), 1.0)
    w = np.linspace(1e-3, math.pi - 1e-3, 20_001)
    L = loop.at(np.exp(1j * w))[:, 0, 0]
    with solved():
        found = crossing_frequencies(loop)
    for signs in (np.sign(L.imag), np.sign(np.abs(L) - 1.0)):
        for i in np.flatnonzero(signs[1:] != signs[:-1]):
            assert np.min(np.abs(found - w[i])) < 1e-3


def test_margins_do_not_depend_on_how_the_crossings_were_found(loop):
    found = loop_margins(loop)
    with no_convergence():
        np.testing.assert_allclose(loop_margins(loop), found, rtol=1e-6)


def test_L_keeps_its_digits_close_to_poles_at_one():
    """A motor, volume, speed, depth and integral of numbers large and small: state after state."""
    A = np.eye(5)
    A[:4, 0] = 0.37, 0.63, -3608.0, -1296.0
    A[2:4, 1], A[3, 2], A[4, 3] = (-9806.65, -4903.325), 1.0, 1e-11
    b, c = 1e-4, 1e8
    loop = system(A, [b, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1e-6 * c, c], 1.0)
    w = np.geomspace(1e-8, 1.0, 30)
    d = -2.0 * np.sin(0.5 * w) ** 2 + 1j * np.sin(w)  # z - 1
    rate = b / (d + 0.63)
    volume = 0.63 * rate / d
    speed = (-3608.0 * rate - 9806.65 * volume) / d
    depth = (-1296.0 * rate - 4903.325 * volume + speed) / d
    expected = c * (1e-6 * depth + 1e-11 * depth / d)
    np.testing.assert_allclose(response(loop)(w), expected, rtol=1e-6)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 14))
@examples(25)
def test_response_solves_the_equations_at_each_frequency(seed, n):
    """Backward stable: it is the exact response of a loop that differs by rounding."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-3.0, 0.0, (n, 1))
    A[rng.uniform(size=(n, n)) < 0.3] = 0.0  # rows that need no elimination, or an exchange
    loop = replace(system(A, *rng.standard_normal((2, n)), 0.3), D=rng.standard_normal((1, 1)))
    w = np.array([1e-3, 0.1, 1.0, 5.0, math.pi / 0.3])
    z = np.exp(1j * 0.3 * w)
    inverses = [np.linalg.inv(point * np.eye(n) - A) for point in z]
    expected = [(loop.C @ inverse @ loop.B + loop.D)[0, 0] for inverse in inverses]
    size = [
        np.linalg.norm(loop.C @ inverse) * np.linalg.norm(inverse @ loop.B) for inverse in inverses
    ]
    bound = 1e-13 * np.array(size) * (1.0 + np.linalg.norm(A)) + 1e-14
    assert np.all(np.abs(response(loop)(w) - expected) <= bound)


def test_double_crossing_close_to_half_the_sampling_frequency():
    """The phase hovers around 180 degrees there, by less than a grid resolves, and still decides.

    A vehicle that was found by chance: a slow piston under a cascade sampled every 0.06 s.
    """
    h, T1, gain = 0.0605521, 0.0164466, 1.57354e-4 * 1.16077e-4
    motion = np.array([[-1 / T1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, -0.3, 0, -0.1]])
    block = np.zeros((5, 5))
    block[:4, :4], block[0, 4] = motion * h, gain / T1 * h
    exact = expm(block)
    A = np.zeros((5, 5))
    A[:4, :4], A[4, 2] = exact[:4, :4], 1.0
    k_pV = 2e8
    loop = system(A, [*exact[:4, 4], 0.0], [0.0, k_pV, -0.101 * k_pV, 0.0, 0.1 * k_pV], h)
    found = loop_margins(loop)
    # At half the sampling frequency, where a grid would look for it, it is 2 % more.
    assert found.gain_up < -0.99 / loop.at(-1.0)[0, 0, 0].real
    for k in np.geomspace(1.0, found.gain_up * (1 - 1e-6), 200):
        assert spectral_radius(loop.A - k * loop.B @ loop.C) < 1.0
    assert spectral_radius(loop.A - found.gain_up * (1 + 1e-6) * loop.B @ loop.C) > 1.0


def test_narrow_resonance_is_not_overlooked():
    """A mode with a damping of 1e-5, narrower than any coarse grid, decides every margin."""
    h, w0, damping = 0.1, 7.3, 1e-5
    A = expm(np.array([[0.0, 1.0], [-(w0**2), -2.0 * damping * w0]]) * h)
    loop = system(A, [0.0, 1e-4], [1.0, 0.0], h)
    found = loop_margins(loop)
    dense = np.linspace(w0 - 1e-3, w0 + 1e-3, 20_001)
    L = loop.at(np.exp(1j * dense * h))[:, 0, 0]
    crossing = np.flatnonzero(np.diff(np.sign(L.imag)))
    assert len(crossing) == 1
    assert found.gain_up == pytest.approx(-1.0 / L.real[crossing[0]], rel=1e-3)
    assert found.gain_up_frequency == pytest.approx(dense[crossing[0]], abs=1e-6)
    assert found.peak_sensitivity == pytest.approx(np.max(1.0 / np.abs(1.0 + L)), rel=1e-5)
    grid, values = frequency_response(loop)
    assert np.max(np.abs(values)) == pytest.approx(np.max(np.abs(L)), rel=2e-3)
    assert np.all(np.diff(grid) > 0.0)


@given(st.floats(-30.0, 0.0), st.floats(0.0, 9.0), st.floats(0.05, 0.3))
def test_equivalent_poles_sample_back(re, im, h):
    s = complex(re, im)
    z = np.exp(s * h)
    found = equivalent_poles(np.array([z]), h)[0]
    assert found == pytest.approx(s, abs=1e-6) or abs(z) < 1e-3
    assert np.exp(found * h) == pytest.approx(z)


def test_pole_at_zero_is_infinitely_fast():
    assert equivalent_poles(np.array([0.0]), 0.3)[0].real == -math.inf
