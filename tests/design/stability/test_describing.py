"""Describing functions, against their integral and the values of the textbooks."""

import math

import numpy as np
import pytest

from swimbladder.design.stability.cycles import (
    dead_zone,
    harmonic,
    play,
    quantiser,
    relay,
    saturation,
)

ALL = [saturation(2.0), dead_zone(0.5), quantiser(5e-3), relay(3.0, 0.4), relay(2.0), play(0.3)]


@pytest.mark.parametrize("one", ALL, ids=lambda one: f"{one.name} {one.size:g}")
@pytest.mark.parametrize("times", [1.05, 1.4, 3.3, 20.0])
def test_the_formula_is_the_first_harmonic(one, times):
    A = times * one.onset
    expected = harmonic(one.output, A, 1) / A
    assert one.gain(np.array([A]))[0] == pytest.approx(expected, rel=3e-3, abs=2e-3)


def test_values_of_the_textbooks():
    def N(one, A):
        return complex(one.gain(np.array([A]))[0])

    # Gelb and Vander Velde 1968: the quantiser's greatest value, play at twice its half width,
    # a relay's 4 M/(pi A), a limit far exceeded is one.
    assert N(quantiser(1.0), math.sqrt(0.5)) == pytest.approx(4.0 / math.pi)
    A = np.linspace(0.501, 30.0, 20_000)
    assert np.abs(quantiser(1.0).gain(A)).max() == pytest.approx(4.0 / math.pi, abs=1e-6)
    assert N(play(1.0), 2.0) == pytest.approx(0.5 - 1j / math.pi)
    assert N(relay(2.0), 5.0) == pytest.approx(8.0 / (5.0 * math.pi))
    assert N(relay(2.0, 3.0), 3.0) == pytest.approx(-8j / (3.0 * math.pi))
    assert N(saturation(1.0), 1e4) == pytest.approx(4.0 / (math.pi * 1e4), rel=1e-6)
    assert N(saturation(1.0), 0.3) == 1.0
    assert N(dead_zone(1.0), 0.9) == 0.0
    assert N(dead_zone(1.0), 2.5) + N(saturation(1.0), 2.5) == pytest.approx(1.0)


def test_the_third_harmonic_of_a_switch_is_a_third():
    assert relay(1.0).third(1.0) == pytest.approx(1.0 / 3.0, rel=1e-4)
    assert saturation(1.0).third(0.5) == pytest.approx(0.0, abs=1e-12)
    assert dead_zone(1.0).third(0.5) == math.inf
