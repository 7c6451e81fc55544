"""The water on a uniform grid of depths, and the paper's water of constant density.

A column is one array; its values at any depth are by cubic Hermite, one read, no search.
`look_up_bent` is plain Python on scalars; kernels compile it (`engine.cache.part`). Slopes are
those of Fritsch and Butland (1984, SIAM J. Sci. Stat. Comput. 5, 300), so that what rises between
two depths of the column rises all the way between them: the lookup makes no density inversion of
its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from swimbladder.errors import check_number
from swimbladder.physics.arrays import Array
from swimbladder.vehicle import Water

if TYPE_CHECKING:
    from swimbladder.physics.seawater.cast import Cast

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
    density_std: Array = field(default_factory=lambda: np.zeros(1))  # kg/m3 [n], in holes of a cast
    buoyancy_frequency: float = 0.0  # rad/s, the greatest over 10 m; 0 where density is constant
    source: str = ""  # the cast, or the vehicle's water
    report: tuple[str, ...] = ()  # what was assumed
    cast: Cast | None = field(default=None, repr=False, compare=False)  # what it was made of

    def __repr__(self) -> str:
        return f"Column({self.source!r}: {len(self.depth)} depths to {self.deepest:g} m)"

    @property
    def step(self) -> float:
        """Distance of two depths [m]."""
        return float(self.depth[1] - self.depth[0])

    @property
    def deepest(self) -> float:
        """The last depth [m]."""
        return float(self.depth[-1])


def grid(max_depth: float, step: float) -> Array:
    """Return depths from 0 to `max_depth` or just below, a `step` apart [m] [n].

    Raises InputError where one of the two is not above 0.
    """
    for name, value in (("max_depth", max_depth), ("step", step)):
        check_number(value, name, "m", above=0.0, remedy="Give a depth in metres")
    count = max(math.ceil(max_depth / step * (1.0 - 1e-12)), 1)
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


def uniform_column(water: Water, max_depth: float, *, step: float = 1.0) -> Column:
    """Return the paper's water down to `max_depth` [m]: constant density, p = rho g z."""
    depth = grid(max_depth, step)
    return Column(
        depth=depth,
        pressure=water.specific_weight * depth,
        density=np.full_like(depth, water.density),
        temperature=np.full_like(depth, water.temperature),
        gravity=water.gravity,
        compressibility=water.compressibility,
        source=f"water of {water.density:g} kg/m3 at every depth",
    )


def slopes(values: Array, step: float) -> Array:
    """Return the slopes [n] of values [n] on a grid of that step, without overshoot between."""
    if len(values) == 2:
        return np.full(2, (values[1] - values[0]) / step)
    from scipy.interpolate import PchipInterpolator

    at = step * np.arange(float(len(values)))
    return np.asarray(PchipInterpolator(at, values).derivative()(at))


def look_up(table: Array, step: float, what: int, z: float) -> tuple[float, float]:
    """Return a value of a table [n, k] and its slope at depth z [m], both continuous.

    what: the column of the value, its slope being the next. Beyond the ends the end's value goes
    on along the end's slope.
    """
    return look_up_bent(table, step, what, z)[:2]


def look_up_bent(table: Array, step: float, what: int, z: float) -> tuple[float, float, float]:
    """Return what `look_up` does and the curvature, which a Jacobian takes; kernels compile it."""
    last = table.shape[0] - 2
    s = z / step
    k = min(max(int(s), 0), last)
    s = s - k
    a, b = table[k, what], table[k + 1, what]
    da, db = table[k, what + 1] * step, table[k + 1, what + 1] * step
    if s < 0.0:
        return a + da * s, da / step, 0.0
    if s > 1.0:
        return b + db * (s - 1.0), db / step, 0.0
    c2 = 3.0 * (b - a) - 2.0 * da - db
    c3 = 2.0 * (a - b) + da + db
    slope = (da + s * (2.0 * c2 + 3.0 * s * c3)) / step
    return a + s * (da + s * (c2 + s * c3)), slope, (2.0 * c2 + 6.0 * s * c3) / (step * step)
