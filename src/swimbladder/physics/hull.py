"""What a vehicle displaces, and the volume at which it rests: hull, heat, trapped air, water.

The paper's eq. (31) has one number for all of it: psi, the volume lost per metre beyond what the
water does. Here each has its own law, and their sum, linearised at a depth, is psi again
(`linear_psi`); in the paper's water of constant density, `seawater.uniform_column`, a vehicle
without parts and trapped air rests at exactly psi z + trim_error.

With p above the atmosphere and V(p, T) what is displaced without the volume of the drive::

    V(p, T) = sum_i V_i (1 - beta_i p + s_i p^2/2 + alpha_i (T - T_ref))
              + V_air p_a/(p_a + p) T/T_ref
    V_neutral = weight_mass/rho - V(p, T)

A part that stiffens (s_i > 0) gives way no more from beta_i/s_i on.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.errors import InputError
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.column import ATMOSPHERE, slopes, water_compressibility
from swimbladder.vehicle import Hull, HullPart, IdentifiedMotion, PhysicalMotion, Vehicle

_ZERO_CELSIUS = 273.15  # K
_CONTRADICT = 0.02  # of the mass: sea water against fresh is more
_IMPLIED = (0.1, 30.0)  # of it: of an identified motion, with the water that moves along
_FEASIBLE = (0.5, 4.0)  # of it: heavier where the water that moves along counts too


class PsiTerms(NamedTuple):
    """dV_neutral/dz at a depth [m3/m], by cause; the sum is the paper's psi."""

    hull: float  # the parts give way
    heat: float  # the parts shrink in the cold
    air: float  # trapped air is pressed together, and cools
    water: float  # the water gets denser: by pressure, cold and salt

    @property
    def psi(self) -> float:
        """The sum [m3/m]."""
        return self.hull + self.heat + self.air + self.water


def hull_parts(vehicle: Vehicle) -> tuple[HullPart, ...]:
    """Return the parts of the hull; where none are given, the one that psi describes.

    It loses psi [m3/m], and as much as the displaced water does besides, per metre of [water].
    """
    hull, water = vehicle.hull, vehicle.water
    if hull.parts:
        return hull.parts
    volume = hull.displaced_volume - hull.trapped_air
    displaced = hull.displaced_volume + vehicle.trim_error
    loss = hull.psi / water.specific_weight + displaced * water.compressibility
    own = HullPart.model_construct(
        name="hull",
        volume=volume,
        compressibility=loss / volume,
        thermal_expansion=hull.thermal_expansion * hull.displaced_volume / volume,
    )
    return (own,)


def displaced_volume(vehicle: Vehicle, pressure: ArrayLike, temperature: ArrayLike) -> Array:
    """Return the volume displaced without that of the drive, V(p, T) [m3] [n].

    pressure: above the atmosphere [Pa]; temperature: of hull and trapped air [degC].
    """
    p, T = np.asarray(pressure, dtype=np.float64), np.asarray(temperature, dtype=np.float64)
    reference = vehicle.hull.reference_temperature
    warmth = (T + _ZERO_CELSIUS) / (reference + _ZERO_CELSIUS)
    air = vehicle.hull.trapped_air * ATMOSPHERE / (ATMOSPHERE + p) * warmth
    solid = sum(
        part.volume * (1.0 - _pressed(part, p)[0] + part.thermal_expansion * (T - reference))
        for part in hull_parts(vehicle)
    )
    return np.asarray(solid + air)


def heat_expansion(vehicle: Vehicle) -> float:
    """Return what the parts of the hull gain per kelvin [m3/K]; trapped air is not among them."""
    return sum(part.volume * part.thermal_expansion for part in hull_parts(vehicle))


def _pressed(part: HullPart, pressure: Array) -> tuple[Array, Array]:
    """Return the share of its volume that a part has lost under pressure [Pa] [n], and its slope.

    The slope is the compressibility there [1/Pa].
    """
    s, p = part.stiffening, pressure
    if s > 0.0:
        p = np.minimum(p, part.compressibility / s)
    return part.compressibility * p - 0.5 * s * p * p, part.compressibility - s * p


def weight_mass(vehicle: Vehicle) -> float:
    """Return the mass that the displaced water has to carry [kg].

    It follows from trim_error: with that volume the vehicle is neutral at the surface of its own
    [water]. Free-flooded water weighs nothing in water and does not count.
    """
    at_surface = float(displaced_volume(vehicle, 0.0, vehicle.water.temperature))
    return vehicle.water.density * (at_surface + vehicle.trim_error)


def mass_mismatch(vehicle: Vehicle) -> str:
    """Return what is odd about a dry mass that trim_error does not carry; "" where nothing is."""
    if not isinstance(vehicle.motion, PhysicalMotion):
        return ""
    dry, by_trim = vehicle.motion.dry_mass, weight_mass(vehicle)
    share = abs(dry / by_trim - 1.0)
    if share <= _CONTRADICT:
        return ""
    return (
        f"the vehicle's file says a dry mass of {dry:.6g} kg, and a trim_error by which it weighs "
        f"{by_trim:.6g} kg: one of them is wrong by {100.0 * share:.2g} %"
    )


def check_mass(vehicle: Vehicle) -> None:
    """Raise InputError for a dry mass that no ballast and no water brings into balance.

    What the hull displaces and trim_error give the vehicle's weight. The dry mass may differ as
    far as it stands for the inertia with the water that moves along, and no farther. The mass that
    an identified motion implies may be off by what poor logs leave open.
    """
    by_trim = weight_mass(vehicle)
    if isinstance(vehicle.motion, IdentifiedMotion):
        K2, T2 = vehicle.motion.K2, vehicle.motion.T2
        if not _IMPLIED[0] * by_trim < vehicle.mass < _IMPLIED[1] * by_trim:
            raise InputError(
                f"with T2 = {T2:g} s this implies a mass of rho g T2/K2 = {vehicle.mass:.3g} kg, "
                f"and the vehicle weighs about {by_trim:.4g} kg by hull.displaced_volume and "
                "trim_error",
                field="motion.K2",
                value=K2,
                unit="1/m2/s",
                remedy="Check the units of motion.K2, motion.T2 and hull.displaced_volume, or "
                "identify the motion again",
            )
        return
    dry = vehicle.motion.dry_mass
    if _FEASIBLE[0] * by_trim < dry < _FEASIBLE[1] * by_trim:
        return
    displaced, ends = by_trim / vehicle.water.density, "sinks" if dry > by_trim else "floats"
    what = (
        f"a vehicle that displaces {1e3 * displaced:.4g} L weighs about {by_trim:.4g} kg, by "
        f"hull.displaced_volume and trim_error: with this it {ends} in any water, whatever its "
        "drive does"
    )
    remedy = "Weigh it, and check the units of motion.dry_mass and hull.displaced_volume"
    raise InputError(what, field="motion.dry_mass", value=dry, unit="kg", remedy=remedy)


def weighing(vehicle: Vehicle, mass: float) -> Vehicle:
    """Return the vehicle with the trim_error of a mass [kg] in its own [water]."""
    at_surface = float(displaced_volume(vehicle, 0.0, vehicle.water.temperature))
    trim = mass / vehicle.water.density - at_surface
    # a compression by psi is counted with the water that is displaced
    psi = vehicle.hull.psi
    if not vehicle.hull.parts:
        grown = (trim - vehicle.trim_error) * vehicle.water.compressibility
        psi -= grown * vehicle.water.specific_weight
    return vehicle.but("hull", psi=psi).model_copy(update={"trim_error": trim})


def neutral_volume(vehicle: Vehicle, column: Column, *, mass: float | None = None) -> Array:
    """Return the volume of the drive at which the vehicle rests at each depth [m3] [n].

    mass: what weighs [kg], `weight_mass` where it is not given. Water of constant density shrinks
    by its `Column.compressibility`.
    """
    weight = weight_mass(vehicle) if mass is None else mass
    water = weight / column.density * (1.0 - column.compressibility * column.pressure)
    return np.asarray(water - displaced_volume(vehicle, column.pressure, column.temperature))


def along_hull(column: Column, hull: Hull) -> Column:
    """Return a column whose density at each depth is its mean over a hull with the sensor there.

    The hull reaches from emergence_depth above the sensor down by its height; what is out of the
    water does not count, and below the column its last density goes on. In water whose density
    bends within a hull's height, as in a halocline, its buoyancy is that of the mean.
    """
    from scipy.interpolate import make_interp_spline

    z, rho = column.depth, column.density
    deep = np.append(z, z[-1] + hull.height + abs(hull.emergence_depth))
    mass = make_interp_spline(deep, np.append(rho, rho[-1]), k=1).antiderivative()  # kg/m2 above
    top = np.maximum(z - hull.emergence_depth, 0.0)
    low = np.maximum(z - hull.emergence_depth + hull.height, column.step)
    return replace(column, density=(mass(low) - mass(top)) / (low - top))


def layered_volume(vehicle: Vehicle, column: Column) -> Array:
    """Return neutral_volume less what pressure does to it at each depth [m3] [n].

    What changes over depth is then only the layers of the water, their salt and heat: so much of
    the neutral volume goes along where a layer is moved. Water shrinks as `water_compressibility`.
    """
    p, T = column.pressure, column.temperature
    between = 0.5 * (T[1:] + T[:-1])
    hull = displaced_volume(vehicle, p[:-1], between) - displaced_volume(vehicle, p[1:], between)
    shrinks = weight_mass(vehicle) / column.density * water_compressibility(column)
    water = 0.5 * (shrinks[1:] + shrinks[:-1]) * np.diff(p)
    pressed = np.concatenate(([0.0], np.cumsum(hull - water)))
    return np.asarray(neutral_volume(vehicle, column) - pressed)


def psi_terms(vehicle: Vehicle, column: Column, depth: float) -> PsiTerms:
    """Return dV_neutral/dz at a depth [m], by cause."""
    water = (column.pressure, column.density, column.temperature)
    rates = (slopes(values, column.step) for values in water)
    p, rho, T = (float(np.interp(depth, column.depth, values)) for values in water)
    dp, drho, dT = (float(np.interp(depth, column.depth, values)) for values in rates)
    hull, parts = vehicle.hull, hull_parts(vehicle)
    kelvin = hull.reference_temperature + _ZERO_CELSIUS
    boyle = hull.trapped_air * ATMOSPHERE / (ATMOSPHERE + p) / kelvin
    weight = weight_mass(vehicle)
    thinner = 1.0 - column.compressibility * p
    return PsiTerms(
        hull=sum(part.volume * float(_pressed(part, np.asarray(p))[1]) for part in parts) * dp,
        heat=-heat_expansion(vehicle) * dT,
        air=boyle * ((T + _ZERO_CELSIUS) / (ATMOSPHERE + p) * dp - dT),
        water=-weight / rho * (drho / rho * thinner + column.compressibility * dp),
    )


def linear_psi(vehicle: Vehicle, column: Column, depth: float) -> float:
    """Return dV_neutral/dz [m3/m] at a depth [m]: psi of eq. (31), of hull, heat, air and water."""
    return psi_terms(vehicle, column, depth).psi
