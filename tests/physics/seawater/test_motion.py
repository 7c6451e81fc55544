"""Waves: speed is the derivative of displacement, mode shapes, dispersion, compiled alike."""

import math

import gsw
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.errors import InputError
from swimbladder.physics.seawater import Cast, cast_column, uniform_column
from swimbladder.physics.seawater.motion import (
    InternalWave,
    Swell,
    WaterMotion,
    check_motion,
    motion_table,
    moved,
)
from swimbladder.sim.engine.cache import inlined, part
from swimbladder.vehicle import Water
from tests.quoted import refused

SEA = WaterMotion(
    internal_waves=(
        InternalWave(amplitude="5 m", period="2 h", water_depth="2000 m"),
        InternalWave(amplitude=2.0, period=1800.0, water_depth=2000.0, mode=3, phase=1.0),
    ),
    swell=(Swell(amplitude="1.5 m", period="9 s", phase="30 deg"),),
)
WAVES = motion_table(SEA, 9.81)
_kernel_part = inlined(moved)


@part
def compiled(waves, z, t):
    return _kernel_part(waves, z, t)


@given(st.floats(0.0, 2100.0), st.floats(0.0, 1e5))
def test_the_speed_is_the_derivative_of_the_displacement(z, t):
    h = 1e-2
    late, early = moved(WAVES, z, t + h)[0], moved(WAVES, z, t - h)[0]
    assert moved(WAVES, z, t)[1] == pytest.approx((late - early) / (2.0 * h), abs=1e-5)
    np.testing.assert_allclose(compiled(WAVES, z, t), moved(WAVES, z, t), rtol=0, atol=1e-9)


def test_internal_waves_rest_at_surface_and_bottom_and_between_their_layers():
    waves = motion_table(WaterMotion(internal_waves=SEA.internal_waves[1:]), 9.81)
    for z in (0.0, 2000.0, 2500.0, 2000.0 / 3.0, 4000.0 / 3.0):
        assert moved(waves, z, 400.0) == pytest.approx((0.0, 0.0), abs=1e-12)
    top, below = moved(waves, 2000.0 / 6.0, 400.0)[0], moved(waves, 1000.0, 400.0)[0]
    assert top == pytest.approx(-below)  # the next layer goes the other way
    assert top == pytest.approx(2.0 * math.sin(2.0 * math.pi * 400.0 / 1800.0 + 1.0))


def test_swell_decays_as_deep_water_waves_do():
    waves = motion_table(WaterMotion(swell=(Swell(amplitude=1.0, period=8.0),)), 9.81)
    length = 9.81 * 8.0**2 / (2.0 * math.pi)  # g T^2/(2 pi), about 100 m
    at_top, half_a_length_down = moved(waves, 0.0, 1.0), moved(waves, length / 2.0, 1.0)
    assert at_top == pytest.approx((math.sin(math.pi / 4), math.pi / 4 * math.cos(math.pi / 4)))
    # the textbook's rule: at half a wavelength e^-pi, 4 %, is left
    assert half_a_length_down[1] / at_top[1] == pytest.approx(math.exp(-math.pi))


def test_no_internal_wave_is_faster_than_the_buoyancy_frequency():
    p = np.arange(0.0, 1001.0, 5.0)
    SA, CT = np.full_like(p, 35.0), 5.0 + 10.0 * np.exp(-p / 100.0)
    column = cast_column(Cast(pressure=p, SA=SA, CT=CT, latitude=30.0, name="sea"))
    squared, _ = gsw.Nsquared(SA[::2], CT[::2], p[::2], 30.0)
    assert column.buoyancy_frequency == pytest.approx(np.sqrt(squared.max()), rel=0.01)
    period = 2.0 * math.pi / column.buoyancy_frequency
    # N^2 = g alpha dT/dz, where salt plays no part
    by_heat = 9.79 * gsw.alpha(35.0, 14.5, 5.0) * 0.1 * math.exp(-0.05)
    assert period == pytest.approx(2.0 * math.pi / math.sqrt(by_heat), rel=0.02)
    wave = {"amplitude": 1.0, "water_depth": 2000.0}
    check_motion(WaterMotion(internal_waves=({"period": 1.01 * period, **wave},)), column)
    fast = WaterMotion(internal_waves=({"period": 0.99 * period, **wave},))
    with refused(InputError, field="water_motion.internal_waves[0].period") as caught:
        check_motion(fast, column)
    assert caught.value.field == "water_motion.internal_waves[0].period"
    check_motion(fast, uniform_column(Water(), 100.0))  # not known there: no layers


def test_water_at_rest():
    waves = motion_table(WaterMotion(), 9.81)
    assert waves.shape == (0, 6)
    assert compiled(waves, 10.0, 3.0) == (0.0, 0.0)


def test_a_wave_without_a_bottom_is_refused():
    with pytest.raises(InputError, match="water_depth"):
        InternalWave(amplitude=1.0, period=600.0)
