"""The water on a uniform grid of depths, and the paper's water of constant density."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.vehicle import Water

if TYPE_CHECKING:
    from swimbladder.physics.seawater.cast import Cast

Array = NDArray[np.float64]
ATMOSPHERE = 101325.0  # Pa, standard atmosphere
_SALINITY = 35.0  # g/kg, of sea water, to make a temperature conservative


@dataclass(frozen=True, kw_only=True)
class Column:
    """The water on a uniform grid of depths from 0; arrays of one length [n].

    compressibility: what a constant density leaves out [1/Pa], 0 where the density is in situ.
    A hull loses volume beyond what the water does, so one of the two has to say what water does.
    """

    depth: Array  # m
    pressure: Array  # Pa above the atmosphere
    density: Array  # kg/m3 in situ
    temperature: Array  # degC in situ; constant where the water has none
    gravity: float  # m/s2, at the latitude
    compressibility: float = 0.0
    buoyancy_frequency: float = 0.0  # rad/s, the greatest over 10 m; 0 where density is constant
    source: str = ""  # the cast, or the vehicle's water
    report: tuple[str, ...] = ()  # what was assumed
    cast: Cast | None = field(default=None, repr=False, compare=False)  # what it was made of

    @property
    def step(self) -> float:
        """Distance of two depths [m]."""
        return float(self.depth[1] - self.depth[0])

    @property
    def deepest(self) -> float:
        """The last depth [m]."""
        return float(self.depth[-1])


def grid(deepest: float, step: float) -> Array:
    """Return depths from 0 to `deepest` or just below, a `step` apart [m] [n].

    Raises InputError where one of the two is not above 0.
    """
    for name, value in (("deepest", deepest), ("step", step)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(
                "not above 0", field=name, value=value, unit="m", remedy="Give a depth in metres"
            )
    count = max(math.ceil(deepest / step * (1.0 - 1e-12)), 1)
    return np.asarray(step * np.arange(count + 1.0))


def water_compressibility(column: Column) -> Array:
    """Return by how much the water shrinks that keeps its salt and heat [1/Pa] [n].

    Where the density is in situ that is TEOS-10's for this density, temperature and pressure.
    """
    given = np.full_like(column.pressure, column.compressibility)
    if column.compressibility > 0.0 or np.ptp(column.density) == 0.0:
        return given
    import gsw

    p = column.pressure / 1e4  # dbar
    CT = gsw.CT_from_t(_SALINITY, column.temperature, p)
    # NaN below the density of fresh water; compressibility hardly depends on the salt
    SA = np.nan_to_num(gsw.SA_from_rho(column.density, CT, p))
    return np.asarray(gsw.kappa(SA, CT, p))


def uniform_column(water: Water, deepest: float, *, step: float = 1.0) -> Column:
    """Return the paper's water down to `deepest` [m]: constant density, p = rho g z."""
    depth = grid(deepest, step)
    return Column(
        depth=depth,
        pressure=water.specific_weight * depth,
        density=np.full_like(depth, water.density),
        temperature=np.full_like(depth, water.temperature),
        gravity=water.gravity,
        compressibility=water.compressibility,
        source=f"water of {water.density:g} kg/m3 at every depth",
    )
