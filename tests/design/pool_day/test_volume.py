"""The volume while a piston stands."""

import numpy as np
import pytest

from swimbladder.design.pool_day.segments import quantum, steadied

TIME = 0.3 * np.arange(140)


def test_noise_and_quantum_of_a_standing_piston_go():
    rng = np.random.default_rng(1)
    true = 20e-6
    noisy = true + 1e-6 * rng.normal(size=140)
    assert np.ptp(steadied(TIME, noisy)) == pytest.approx(0.0, abs=1e-18)
    assert steadied(TIME, noisy)[0] == pytest.approx(true, abs=4e-6 / np.sqrt(140))
    ramp = np.linspace(0.0, true, 10)
    creep = np.append(ramp, true + 0.4e-6 * np.sin(TIME / 10.0)[10:])
    toggles = 0.75e-6 * np.round(creep / 0.75e-6)
    assert quantum(toggles) == pytest.approx(0.75e-6)
    assert np.ptp(steadied(TIME, toggles)[12:]) == pytest.approx(0.0, abs=1e-18)


def test_a_leak_is_followed():
    rng = np.random.default_rng(2)
    leak = 20e-6 - 0.1e-6 * TIME
    seen = leak + 0.2e-6 * rng.normal(size=140)
    assert np.abs(steadied(TIME, seen) - leak).max() < 0.1e-6


def test_what_moves_stays_as_logged():
    volume = np.concatenate([np.linspace(0.0, 60e-6, 20), np.full(120, 60e-6)])
    assert steadied(TIME, volume)[:19] == pytest.approx(volume[:19], abs=1e-15)


def test_each_stretch_between_turns_has_its_own_level():
    rng = np.random.default_rng(3)
    true = np.where(TIME < 15.0, -17e-6, np.where(TIME < 30.0, 56e-6, 3e-6))
    found = steadied(TIME, true + 0.3e-6 * rng.normal(size=140))
    assert np.abs(found - true).max() < 0.25e-6
