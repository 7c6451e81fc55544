"""A vehicle in its own water or in that of a cast, as the engine takes it.

In a cast the neutral volume is what `hull` makes of density, pressure and temperature: parts of the
hull, their heat and trapped air as they are given, the density as its mean over the hull's height.
Force, motor load and leakage go with one specific weight, the cast's mean from the surface down to
where the vehicle is asked to go: of a volume that misses the neutral one by dV the force is
rho_mean g dV. So the engine's pressure is rho_mean g z, and the energy balance stays exact.

Swell, and what of it a drifting vehicle's depth sensor reads.

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
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from swimbladder.errors import InputError
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, body_plant, plant
from swimbladder.physics.hull import along_hull, neutral_volume
from swimbladder.physics.seawater import Column
from swimbladder.sim.engine.modes import NO_LAYERS, Layers, layers_from
from swimbladder.vehicle import Hull, Vehicle

_PER_WEIGHT = ("load_drive", "load_back", "k_l", "a_b", "a_s")  # of Plant: they go with rho g


@dataclass(frozen=True)
class Medium:
    """A vehicle's plant in some water, and what layers of it add to psi z + V_0."""

    plant: Plant
    layers: Layers
    specific_weight: float  # N/m3, rho g
    misses: float  # -, of the specific weight down there, by which the cast's is off anywhere
    share: float = 1.0  # -, of the specific weight of the vehicle's own water

    def of(self, plant: Plant) -> Plant:
        """Return another plant of the vehicle, that of its own water, in this water."""
        return plant._replace(**{name: self.share * getattr(plant, name) for name in _PER_WEIGHT})

    def neutral_volume(self, depth: float) -> float:
        """Return the volume at which the vehicle rests at a depth [m3]."""
        return self.plant.psi * depth + self.plant.V_0 + self.layers.at(depth)

    def potential(self, V: float, z: float) -> float:
        """Return the energy of volume at depth over mass [J/kg], with that of the emerged hull."""
        p = self.plant
        emerged = max(p.z_surface - z, 0.0)
        neutral = 0.5 * p.psi * z * z + self.layers.integral(z)
        return p.a_b * (z * (V - p.V_0) - neutral) + 0.5 * p.a_s * emerged**2


def medium_of(
    vehicle: Vehicle, column: Column | None, *, reach: float, bottom_depth: float = math.inf
) -> Medium:
    """Return a vehicle in the water of a column, or in its own where that is None.

    reach: the greatest depth it is asked to go to [m]. bottom_depth [m].
    Of a pump and valve the plant is that of the body. Raises InputError where the column ends
    above, and as `dynamics.plant` does.
    """
    pumped = vehicle.command == "volume change"
    own = (body_plant if pumped else plant)(vehicle, bottom_depth=bottom_depth)
    k_b = vehicle.water.specific_weight
    if column is None:
        return Medium(own, NO_LAYERS, k_b, 0.0)
    check_reach(column, reach)
    depth = column.depth
    added = neutral_volume(vehicle, along_hull(column, vehicle.hull))
    layers = layers_from(added - own.psi * depth - own.V_0, column.step)
    down = float(np.clip(reach, column.step, column.deepest))
    mean = float(np.interp(down, depth, column.pressure)) / down
    within = column.density[depth <= down + column.step] * column.gravity
    share = mean / k_b
    medium = Medium(own, layers, mean, float(np.abs(within / mean - 1.0).max()), share)
    return replace(medium, plant=medium.of(own))


def check_reach(column: Column, reach: float) -> None:
    """Raise InputError where the water is not known as deep as a vehicle is asked to go [m]."""
    if reach > column.deepest + column.step:
        raise InputError(
            f"{column.source or 'the water'} ends at {column.deepest:.4g} m, "
            f"{reach - column.deepest:.3g} m above the {reach:g} m asked for",
            field="cast",
            value=round(column.deepest, 3),
            unit="m",
            remedy="Take a cast that goes as deep, or ask for a lesser depth",
        )


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
