"""Eigenvalues and margins over the region, against a dense grid and python-control."""

import math

import control
import numpy as np
import pytest

from swimbladder.control.registry import bind
from swimbladder.design.linear.models import linearise
from swimbladder.design.linear.sampled import BoundLaw, SampledLoop
from swimbladder.design.stability.around import modes, modulus, robustness_around
from swimbladder.design.tuning.margins import at_rest, exactly
from swimbladder.design.tuning.region import member
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import Identified

FEUP = load_vehicle("feup-em")
LAW, NUMBERS = bind(FEUP.controller)
H = 0.3
BOUND = BoundLaw(LAW, NUMBERS, H)
KNOWN = Identified(
    names=("K2", "T2", "psi"),
    values=(7935.54, 36.3, 4.04e-6),
    covariance=(
        (400.0**2, 0.5 * 400.0 * 2.0, 0.0),
        (0.5 * 400.0 * 2.0, 4.0, 0.0),
        (0.0, 0.0, 1e-14),
    ),
    logs=("a",),
)


def look(vehicle=FEUP, numbers=NUMBERS, **options):
    given = {"depths": (0.0, 5.0), "delay": 0.0, "advance": lambda _: None} | options
    return robustness_around(vehicle, BOUND._replace(parameters=numbers), **given)


@pytest.mark.parametrize(
    "vehicle",
    [FEUP, pytest.param(FEUP.model_copy(update={"identified": KNOWN}), marks=pytest.mark.prove)],
)
def test_the_worst_is_no_better_than_a_dense_grid(vehicle):
    found = look(vehicle)
    n = 2 if vehicle.identified is None else 3
    draws = np.random.default_rng(2).uniform(-1.0, 1.0, (40, n))
    if n == 3:
        draws /= np.maximum(1.0, np.linalg.norm(draws, axis=1, keepdims=True))
    linear = at_rest(BOUND, plant(FEUP), depth=0.0)
    for s in draws:
        loop = SampledLoop(plant=linearise(member(vehicle, s).plant), law=linear)
        radius = np.abs(np.linalg.eigvals(loop.closed())).max()
        assert radius <= found.radius + 1e-9
        m = exactly(loop.broken_at_command())
        assert m.peak_sensitivity <= found.margins.peak_sensitivity * (1.0 + 1e-3)
        assert m.phase >= found.margins.phase - 1e-3
        assert m.gain_up >= found.margins.gain_up * (1.0 - 1e-3)
    assert all(f.searched >= f.on_grid for f in found.found)
    assert found.same_at_all_depths
    assert found.stable


def test_the_papers_cascade_is_unstable_with_a_whole_sample_of_delay():
    found = look()
    assert found.whole_sample_radius > 1.0
    linear = at_rest(BOUND, plant(FEUP), depth=0.0)
    nominal = exactly(SampledLoop(plant=linearise(plant(FEUP)), law=linear).broken_at_command())
    assert math.degrees(nominal.phase) == pytest.approx(41.0, abs=0.5)
    assert nominal.delay < H


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (1.0564, "1.056"),
        (0.99976, "0.99976"),
        (0.9999871, "0.999987"),
        (1.00002, "1.000020"),
        (1.0, "1.000"),
    ],
)
def test_a_modulus_is_said_with_the_digits_that_tell_it_from_one(value, said):
    assert modulus(value) == said


def test_modes_are_python_controls():
    linear = at_rest(BOUND, plant(FEUP), depth=0.0)
    closed = SampledLoop(plant=linearise(plant(FEUP)), law=linear).closed()
    system = control.ss(closed, np.zeros((len(closed), 1)), np.zeros((1, len(closed))), 0, H)
    w, zeta, poles = control.damp(system, doprint=False)
    kept = (np.abs(poles) > 1e-6) & (poles.imag >= 0.0)
    ours = modes(closed, H)
    pairs = sorted(m.damping for m in ours if abs(m.z) > 1e-6 and m.s.imag > 0.0)
    theirs = sorted(zeta[kept][poles[kept].imag > 0.0])
    # a pole between -1 and 0 is an oscillation at the Nyquist frequency
    assert pairs[: len(theirs)] == pytest.approx(theirs, rel=1e-6)
    slow = max(1.0 / (w * zeta)[kept])
    assert ours[0].time_constant == pytest.approx(slow, rel=1e-6)


def test_gains_that_are_too_high_are_found_unstable_and_where():
    found = look(numbers=NUMBERS._replace(k_pV=5.0 * NUMBERS.k_pV))
    assert not found.stable
    assert found.radius > 1.0
    assert "K2" in found.worst_point.words


def test_a_law_that_is_not_linear_has_no_eigenvalues():
    from swimbladder.control.deadband import DEADBAND
    from tests.control.examples import SLEEPER

    sleeper = BoundLaw(DEADBAND, SLEEPER, H)
    assert robustness_around(FEUP, sleeper, (1.0,), delay=0.0, advance=lambda _: None) is None
