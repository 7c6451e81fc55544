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
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import (
    Cast,
    Column,
    WaterMotion,
    cast_column,
    motion_table,
    uniform_column,
)
from swimbladder.physics.seawater.cast_unit import check_cast_unit
from swimbladder.sim.closed_loop.water import Medium, medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_NO_LAYER = 1e-12  # m3: what rounding makes of even water
_MARGIN = 1.1  # of the deepest phase: how far down the vehicle's own water is tabulated, and
_BELOW = 50.0  # m more


def water_of(vehicle: Vehicle, mission: Mission, cast: Cast | None = None) -> Column:
    """Return the water of a cast, or the vehicle's own, as deep as a mission goes.

    Parameters
    ----------
    vehicle, mission
        As `load_vehicle` and `load_mission` return them.
    cast
        The water, as `read_cast` returns it; none: that of the vehicle's file, of constant density.

    Returns
    -------
    Column
        The water over depth. Where the cast may be in another unit, its report says it.

    Raises
    ------
    InputError
        The cast is in another unit, it begins far below the surface, or the mission gives the
        latitude of a cast that there is not.
    """
    deepest = max([mission.start_depth, *(mission.reached(phase) for phase in mission.phases)])
    if cast is None:
        if (place := mission.latitude) is not None:
            why = "it says where a cast was taken, and there is none"
            how = "Give `cast=`, or leave it out"
            raise InputError(why, field="latitude", value=place, unit="deg", remedy=how)
        return uniform_column(vehicle.water, _MARGIN * deepest + _BELOW)
    warning = check_cast_unit(cast, deepest, vehicle.hull.depth_limit)
    column = cast_column(cast)
    return replace(column, report=(*column.report, warning)) if warning else column


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
