"""The water of a mission: what a vehicle is in it, and its swell as a free vehicle meets it.

A free vehicle goes up and down with the water, and so does the surface.

Depths of a mission are those of pressure, which under waves over deep water stays the same along
the path of a parcel of water (linear theory: the pressure of the wave and that of the way up and
down cancel; Kundu, Cohen, Dowling, *Fluid Mechanics*, 5th ed., section 7.4). A vehicle as heavy as
the water goes its way; so its depth below the surface, where the surface stands at 0, does not see
the swell but for the second order in its steepness. What a pressure sensor at the top of the hull
does see is how far the water there goes beyond the mean of the water along the hull, of height H:

    a e^(-k z) (1 - (1 - e^(-k H))/(k H)) sin(2 pi t/period + phase),   k = (2 pi/period)^2/g
"""

import math

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import Column, WaterMotion, motion_table
from swimbladder.sim.closed_loop.water import Medium, medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_NO_LAYER = 1e-12  # m3: what rounding makes of even water


def seen_share(wavenumber: float, height: float) -> float:
    """Return what a sensor at the top sees of the water's displacement there [-].

    wavenumber [1/m]; height of the hull [m].
    """
    x = wavenumber * height
    return 1.0 + math.expm1(-x) / x


def waves_of(motion: WaterMotion, height: float, gravity: float) -> Array:
    """Return the waves as the kernel takes them [n, 6], see `seawater.motion_table`.

    Internal waves as they are. Swell with the amplitude that the sensor sees and a last column of
    -inf: it moves nothing. height: of the hull [m].
    """
    table = motion_table(motion, gravity)
    for row in table:
        if row[4] > 0.0:
            row[0] *= seen_share(float(row[4]), height)
            row[5] = -math.inf
    return table


def medium_for(vehicle: Vehicle, mission: Mission, column: Column) -> Medium:
    """Return the vehicle in the water of a mission; in even water as in its own."""
    depths = [phase.depth for phase in mission.phases if phase.depth is not None]
    reach = max([mission.start_depth, *depths])
    found = medium_of(vehicle, column, reach=reach, bottom_depth=mission.bottom)
    own = medium_of(vehicle, None, reach=reach, bottom_depth=mission.bottom)
    even = found.layers.largest <= _NO_LAYER
    return own if even and math.isclose(found.plant.a_b, own.plant.a_b, rel_tol=1e-9) else found
