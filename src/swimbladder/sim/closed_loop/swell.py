"""Swell, and what of it a drifting vehicle's depth sensor reads.

What swell does to the depth that a drifting vehicle reads is by linear wave theory. A body as light
as the water it displaces, and small against the waves, is moved by them as that water is: the
pressure gradient drives its mass and its added mass alike, so that against the water it keeps the
speed it had, and drag sees no waves. The pressure of water that goes its own way does not change
(D'Asaro, *J. Atmos. Oceanic Technol.* 32, 2015, "Surface wave measurements from subsurface
floats"). What a sensor reads of the waves is then only what the hull's length leaves: the hull goes
with the mean of the water along it, the sensor sits at one end::

    reading - depth in the water = sum a cos(w t + f) [exp(-k z) - exp(-k z_c) sinh(k L/2)/(k L/2)]

w^2 = g k (deep water; Dean and Dalrymple, *Water Wave Mechanics for Engineers and Scientists*,
1991, ch. 3 and 4), z the depth of the sensor, z_c that of the hull's middle, L its length. Depths
in swell are depths in the water: below the surface that goes with it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.vehicle import Hull, Vehicle

Array = NDArray[np.float64]


class Swell(NamedTuple):
    """Waves: significant height [m] and the periods [s] among which the energy is shared evenly."""

    height: float
    periods: tuple[float, ...]


SEAS = Swell(1.0, (8.0, 10.0, 12.0)), Swell(1.0, (4.0, 5.0, 6.0))
"""A swell and a wind sea, in which no supervisor must take a healthy vehicle for a faulty one."""


def wavenumber(period: float, g: float) -> float:
    """Return the wave number k [1/m] of a wave in deep water: w^2 = g k."""
    return (2.0 * math.pi / period) ** 2 / g


def amplitude(swell: Swell) -> float:
    """Return the amplitude of each of the waves [m]: sixteen times the variance is the height^2."""
    return swell.height * math.sqrt(2.0 / (16.0 * len(swell.periods)))


def share_read(k: float, hull: Hull) -> float:
    """Return the share of exp(-k z) that a hull's sensor reads of a wave of wave number k [1/m]."""
    half = 0.5 * k * hull.height
    return 1.0 - math.exp(-k * (0.5 * hull.height - hull.emergence_depth)) * math.sinh(half) / half


def depth_error(
    swell: Swell, vehicle: Vehicle, time: Array, *, depth: float, runs: int, seed: int
) -> Array:
    """Return what the sensor reads beyond the depth in the water [samples, runs] in m.

    time [s, samples]; depth [m]: of the sensor, about which the vehicle is held. The phases of the
    waves are each run's own.
    """
    g = vehicle.water.gravity
    size = (runs, len(swell.periods))
    phases = np.random.default_rng([seed, 2]).uniform(0.0, 2.0 * math.pi, size)
    found: Array = np.zeros((len(time), runs))
    for n, period in enumerate(swell.periods):
        k = wavenumber(period, g)
        read = amplitude(swell) * math.exp(-k * depth) * share_read(k, vehicle.hull)
        found += read * np.cos((2.0 * math.pi / period) * time[:, None] + phases[None, :, n])
    return found
