"""A cast through TEOS-10 into a column: in-situ density, pressure and temperature by depth.

Depth comes from the pressure and the density of the cast itself, dz = dp/(rho g), not from that of
a standard ocean: in a lake the two differ by 2.7 %.

A cast may be in another unit of pressure than it is taken to be in. Physics detects a wrong unit at
times, and readers refuse it then. Mostly it does not: water that is cold at 200 m is as real as
water that is cold at 2000. What the vehicle is for says more, and where it speaks for another unit
the file has to say which, in a header at least: a vehicle ballasted for the wrong water is lost.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from swimbladder.errors import InputError, Parameter, column_as
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater.column import Column, grid
from swimbladder.units import unit_factor

_problem = partial(InputError, field="cast")
_DBAR = 1e4  # Pa
_LAYER = 10.0  # dbar
_FINE = 1.0  # dbar between two points of the hydrostatic integral
_ROUNDS = 4  # of pressure against density; each leaves some 1e-4 of the error before it


@dataclass(frozen=True, kw_only=True)
class Cast:
    """Absolute Salinity and Conservative Temperature over increasing pressure [n].

    latitude and longitude in degrees, longitude None where it is not known. report: what a reader
    assumed, averaged and left out. pressure_column: the file's column of pressures whose unit
    only its name shows, if anything; None where more does. unit_named: whether that does.
    """

    pressure: Array  # dbar, above the atmosphere
    SA: Array  # g/kg
    CT: Array  # degC
    latitude: float = 45.0
    longitude: float | None = None
    name: str = ""
    report: tuple[str, ...] = ()
    pressure_column: str | None = None
    unit_named: bool = False

    def __repr__(self) -> str:
        low, high = self.pressure[0], self.pressure[-1]
        return f"Cast({self.name!r}: {len(self.pressure)} rows, {low:g} to {high:g} dbar)"

    def __post_init__(self) -> None:
        """Refuse what is no profile."""
        n = len(self.pressure)
        if n < 2 or len(self.SA) != n or len(self.CT) != n:
            raise _problem(
                f"{n} pressures, {len(self.SA)} salinities and {len(self.CT)} temperatures are no "
                "profile",
                remedy="Give two rows at least, and as many of each",
            )
        if not (np.diff(self.pressure) > 0.0).all() or self.pressure[0] < 0.0:
            what = "the pressures of a profile do not increase from 0"
            raise _problem(what, remedy="Sort the rows and average those of one pressure")


def cast_column(cast: Cast, max_depth: float | None = None, *, step: float = 1.0) -> Column:
    """Return a cast as a column of water.

    Above its first row the cast goes on as it begins, for at most a step below its last as it ends.

    Parameters
    ----------
    cast
        As `read_cast` returns it.
    max_depth
        How deep the column goes [m]; none: to the cast's own end.
    step
        Between two depths of the column [m].

    Returns
    -------
    Column
        The water on a uniform grid of depths from 0.

    Raises
    ------
    InputError
        The cast ends above `max_depth` or above the first step, or begins far below the surface.
    """
    import gsw

    top, end = float(cast.pressure[0]), float(cast.pressure[-1])
    fine = np.append(np.arange(0.0, end, _FINE), end)
    z_fine = depth_of_pressure(cast, fine)
    bottom = float(z_fine[-1])
    if max_depth is not None and max_depth > bottom + step:
        raise _problem(
            f"the cast {cast.name or 'given'} ends at {bottom:.0f} m ({end:.0f} dbar), "
            f"{max_depth - bottom:.0f} m above {max_depth:.0f} m",
            value=round(bottom, 1),
            unit="m",
            remedy="Take a cast that goes as deep, or ask for a lesser depth",
        )
    wanted = bottom if max_depth is None else max_depth
    if wanted < step:
        what = f"the cast ends at {bottom:.2f} m, above the first step of the column, {step:g} m"
        raise _problem(what, remedy="Take a deeper cast, or a smaller step")
    depth = grid(wanted, step)
    if max_depth is None and depth[-1] > bottom and len(depth) > 2:
        depth = depth[:-1]
    slope = _DBAR / (float(gsw.rho(cast.SA[-1], cast.CT[-1], end)) * _gravity(cast, end))
    z_ends = np.append(z_fine, bottom + slope * (2.0 * step / slope))
    pressure = np.interp(depth, z_ends, np.append(fine, end + 2.0 * step / slope))
    SA, CT = (np.interp(pressure, cast.pressure, v) for v in (cast.SA, cast.CT))
    report = list(cast.report)
    if top > max(_NEAR, min(_FAR, 0.5 * end)):
        raise _problem(
            f"the cast {cast.name or 'given'} begins at {top:.0f} dbar, and of the water above, "
            "where a vehicle floats and dives, it says nothing",
            value=round(top, 1),
            unit="dbar",
            remedy="Take one that begins near the surface, or add a row at 0 dbar with the "
            "temperature and salinity that the surface has",
        )
    if top > _NEAR:
        report.append(f"the cast begins at {top:.1f} dbar and is taken to be the same above")
    std, said = in_holes(cast, pressure)
    report += said
    return Column(
        depth=depth,
        pressure=_DBAR * pressure,
        density_std=std,
        density=np.asarray(gsw.rho(SA, CT, pressure)),
        temperature=np.asarray(gsw.t_from_CT(SA, CT, pressure)),
        gravity=_gravity(cast, 0.0),
        buoyancy_frequency=_buoyancy_frequency(cast, SA, CT, pressure),
        source=cast.name or "cast",
        report=tuple(report),
        cast=cast,
    )


_KNOWN = 0.1  # kg/m3, 1 sigma, to which water between two rows has to be known


def check_rows(column: Column) -> None:
    """Raise InputError for the water of a cast of two rows that does not follow from them."""
    unknown = float(column.density_std.max())
    if column.cast is not None and len(column.cast.pressure) <= 2 and unknown > _KNOWN:
        what = f"the cast {column.source} has two rows, and between them the water is not known"
        remedy = "Give the rows between, or leave the cast out for water of constant density"
        raise _problem(what, value=round(unknown, 3), unit="kg/m3", remedy=remedy)


_HOLE = 0.05  # of the range of a cast, without a row
_SLIGHT = 0.05  # kg/m3, 1 sigma, that is not spoken of


def in_holes(cast: Cast, pressure: Array) -> tuple[Array, list[str]]:
    """Return how uncertain the density is at pressures [dbar], 1 sigma [kg/m3], and where it is so.

    Only between rows that are more than 5 % of the cast's range apart. There it may be anywhere
    between what is straight and what goes on as it does above or below, but not beyond the rows
    beside: they are stable. Beside a row without another one nothing is known but that.
    """
    import gsw

    p, std, said = cast.pressure, np.zeros(len(pressure)), list[str]()
    for k in np.flatnonzero(np.diff(p) > _HOLE * (p[-1] - p[0])).tolist():
        middle = 0.5 * float(p[k] + p[k + 1])
        near = slice(max(k - 1, 0), k + 3)
        density = np.asarray(gsw.rho(cast.SA[near], cast.CT[near], middle))
        at = k - near.start  # of the row above
        ends, rows = np.sort(density[at : at + 2]), p[near]
        inside = (pressure > p[k]) & (pressure < p[k + 1])
        z = pressure[inside]
        may = [np.interp(z, rows, density), *(np.full_like(z, end) for end in ends)]
        if 0 < at < len(rows) - 2:
            above, _, below = np.diff(density) / np.diff(rows)
            further = density[at] + above * (z - p[k]), density[at + 1] - below * (p[k + 1] - z)
            may[1:] = [np.clip(line, *ends) for line in further]
        std[inside] = np.ptp(may, axis=0) / math.sqrt(12.0)
        largest = float(std[inside].max(initial=0.0))
        if largest > _SLIGHT:
            where = f"no row from {p[k]:.4g} to {p[k + 1]:.4g} dbar"
            said.append(f"{where}: the density there is known to {largest:.2g} kg/m3 (1 sigma)")
    return std, said


_NEAR = 3.0  # dbar from the surface at which casts are used to begin
_FAR = 50.0  # dbar: the warm layer of a summer, some kg/m3 lighter, is shallower


def _gravity(cast: Cast, pressure: float) -> float:
    import gsw

    return float(gsw.grav(cast.latitude, pressure))


def _buoyancy_frequency(cast: Cast, SA: Array, CT: Array, pressure: Array) -> float:
    """Return the greatest buoyancy frequency N [rad/s] over layers of 10 dbar."""
    import gsw

    p = np.arange(float(pressure[0]), float(pressure[-1]), _LAYER)
    if len(p) < 2:
        p = pressure[[0, -1]]
    layers = [np.interp(p, pressure, v) for v in (SA, CT)]
    squared, _ = gsw.Nsquared(*layers, p, cast.latitude)
    return float(np.sqrt(max(float(np.max(squared)), 0.0)))


def depth_of_pressure(cast: Cast, pressure: Array) -> Array:
    """Return the depths [m] of increasing pressures [dbar] in the water of a cast.

    pressure starts at 0. The integral of dp/(rho g), by trapezoids.
    """
    import gsw
    from scipy.integrate import cumulative_trapezoid

    SA, CT = (np.interp(pressure, cast.pressure, v) for v in (cast.SA, cast.CT))
    per_dbar = _DBAR * gsw.specvol(SA, CT, pressure) / gsw.grav(cast.latitude, pressure)
    return np.asarray(cumulative_trapezoid(per_dbar, pressure, initial=0))


def pressure_of_depth(depth: Array, SP: Array, temperature: Array, latitude: float) -> Array:
    """Return the pressures [dbar] at increasing depths [m] of water of that salinity [-] and
    temperature [degC], by the hydrostatic integral.

    Above the first depth the water is as it is there.
    """
    import gsw

    pressure = np.asarray(gsw.p_from_z(-depth, latitude))
    thickness = np.diff(depth, prepend=0.0)
    SA = gsw.SR_from_SP(SP)
    for _ in range(_ROUNDS):
        density = gsw.rho(SA, gsw.CT_from_t(SA, temperature, pressure), pressure)
        gradient = density * gsw.grav(latitude, pressure) / _DBAR
        means = 0.5 * (gradient + np.append(gradient[0], gradient[:-1]))
        pressure = np.cumsum(means * thickness)
    return np.asarray(pressure)


_LARGER, _SMALLER = ("bar", "MPa"), ("kPa", "mbar", "psi")
_RATED = (0.75, 1.25)  # of the rating, where a cast for a vehicle ends
_DEEPER = 2.2  # of the rating: deep casts are taken for shallower vehicles too, 2000 m for 1000
_BEYOND = 4.0  # times the depth asked for: as deep as a cast for it goes, where there is no rating
_SHALLOW = 0.25  # of the rating: less is no cast for the vehicle
_FAR_ABOVE = 0.5  # of the rating: a cast that ends above it may be in another unit
_SHOWN = 10.0  # m below which a depth is shown with a decimal


def check_cast_unit(cast: Cast, asked: float | None, rating: float | None) -> str:
    """Raise InputError for a cast whose file states no unit and that fits the vehicle in another.

    Where a header states dbar, return what is to be warned of; "" where nothing is.
    asked: the deepest place [m] that is asked for, none: near the rating. rating [m], none: not
    known.
    """
    if asked is None:
        asked = 0.0 if rating is None else _RATED[0] * rating
    others = _others(cast, asked, rating)
    if not others:
        return ""
    name = cast.pressure_column
    fits = " or ".join(f"{_metres(depth)} if it is in {unit}" for unit, depth in others.items())
    rated = "" if rating is None else f"; the vehicle is rated for {rating:g} m"
    said = " or ".join(column_as("pressure_dbar", f"{name}@{unit}") for unit in (*others, "dbar"))
    ends = f"the cast ends at {_metres(_down(cast, 'dbar'))} if it is in dbar, at {fits}{rated}"
    remedy = f"Say which, with {said}"
    if not cast.unit_named:
        what = f"the column {name!r} states no unit: {ends}"
        raise InputError(what, file=cast.name or None, field="pressure_dbar", remedy=remedy)
    return f"{cast.name}: the column {name!r} is taken at its word: {ends}. {remedy}"


def above_rating(name: str, end: float, rating: float | None, asked: str) -> list[str]:
    """Return what is said of a cast that ends above the rating [m] though no depth was asked for.

    asked: the field that asks for a depth. Raises InputError where it ends far above.
    """
    if rating is None:
        return []
    if end < _FAR_ABOVE * rating:
        what = f"it ends at {end:.0f} m, and the vehicle is rated for {rating:g} m"
        bar = column_as("pressure_dbar", "NAME@bar")
        remedy = "Do its rows below lack a temperature or salinity, or is its pressure in bar, not "
        remedy += f"dbar? Then map it with {bar}. If not, say how deep it is to go: "
        remedy += f"`{asked}='{end:.0f} m'`"
        raise InputError(what, file=name, field=Parameter("cast"), remedy=remedy)
    # the grid of a cast that was taken down to the rating ends within a metre of it
    if end >= rating - 1.0:
        return []
    return [
        f"{name} ends at {end:.0f} m, the vehicle is rated for {rating:g} m: nothing is said of "
        "the water below"
    ]


def _others(cast: Cast, asked: float, rating: float | None) -> dict[str, float]:
    """Return the units in which a cast would fit the vehicle better, with the depth [m] of its end.

    None where the user or physics determines the unit, or the cast fits in dbar.
    """
    if cast.pressure_column is None:
        return {}
    end = _down(cast, "dbar")
    most = _BEYOND * asked if rating is None else max(_RATED[1] * rating, asked)
    least = asked
    if rating is not None and end > most:  # in kPa it may even end above what is asked for
        least = min(asked, _SHALLOW * rating)
    elif rating is not None and end >= asked:  # it does; only a cast for this vehicle is ambiguous
        least = max(asked, _RATED[0] * rating)
    if least <= end <= most:
        return {}
    deeper = most
    if rating is not None and cast.unit_named:  # believed unless another unit fits exactly
        least = max(least, _RATED[0] * rating)
    elif rating is not None:
        deeper = max(_DEEPER * rating, asked)
    limits = dict.fromkeys(_LARGER, deeper) | dict.fromkeys(_SMALLER, most)
    if cast.unit_named:  # who writes dbar is believed where the other unit is off by little
        del limits["psi"]
    ends = {unit: _down(cast, unit) for unit in limits}
    return {unit: depth for unit, depth in ends.items() if least <= depth <= limits[unit]}


def _down(cast: Cast, unit: str) -> float:
    """Return the depth [m] at which a cast ends if its numbers are in a unit of pressure."""
    import gsw

    return -float(gsw.z_from_p(cast.pressure[-1] * unit_factor(unit, "dbar"), cast.latitude))


def _metres(depth: float) -> str:
    return f"{depth:.1f} m" if depth < _SHOWN else f"{depth:.0f} m"
