"""A vehicle in its own water or in that of a cast, as the engine takes it.

In a cast the neutral volume is what `hull` makes of density, pressure and temperature: parts of the
hull, their heat and trapped air as they are given, the density as its mean over the hull's height.
Force, motor load and leakage go with one specific weight, the cast's mean from the surface down to
where the vehicle is asked to go: of a volume that misses the neutral one by dV the force is
rho_mean g dV. So the engine's pressure is rho_mean g z, and the energy books stay exact.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from swimbladder.errors import InputError
from swimbladder.physics.dynamics import Plant, body_plant, plant
from swimbladder.physics.hull import along_hull, neutral_volume
from swimbladder.physics.seawater import Column
from swimbladder.sim.engine.layers import NO_LAYERS, Layers, layers_from
from swimbladder.vehicle import Vehicle

_WEIGHED = ("load_drive", "load_back", "k_l", "a_b", "a_s")  # of Plant: they go with rho g


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
        return plant._replace(**{name: self.share * getattr(plant, name) for name in _WEIGHED})

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
