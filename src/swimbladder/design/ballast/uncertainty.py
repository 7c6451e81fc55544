"""What is not known of a vehicle's weight and volume, and vehicles drawn from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.physics.hull import displaced_volume, hull_parts, weight_mass
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.column import ATMOSPHERE
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

# Where nothing is said: the error of a neutral volume that one experiment leaves; a share of the
# hull's compression, as `tune` takes where nothing was identified; and how well the density of the
# sea on the day is known at best (docs/adr/0009).
_TRIM = 0.5e-6  # m3
_SHARE = 0.05
_DENSITY = 0.1  # kg/m3


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """How far each may be off, 1 sigma, all independent."""

    mass: float = 0.0  # kg
    volume: float = 0.0  # m3, of the hull
    trim: float = 0.0  # m3, of the volume at which it is neutral
    psi: float = 0.0  # m3/m, of the hull's compression
    heat: float = 0.0  # 1/K, of the hull's thermal expansion
    air: float = 0.0  # m3, of the trapped air at the surface
    density: float = 0.0  # kg/m3, of the sea, all the way down
    said: tuple[str, ...] = ()  # where each comes from, in words

    def __post_init__(self) -> None:
        """Refuse what is no standard deviation."""
        for name, value in self.numbers().items():
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(
                    "a standard deviation is 0 or more", field=f"--{name}-std", value=value,
                    remedy="Check the number",
                )  # fmt: skip

    def numbers(self) -> dict[str, float]:
        """Return the standard deviations by name."""
        return {f.name: float(getattr(self, f.name)) for f in fields(self) if f.name != "said"}


def uncertainty_of(vehicle: Vehicle, given: Mapping[str, float | None]) -> Uncertainty:
    """Return what is not known: as given, else as identified, else a default that is said."""
    values = {name: value for name, value in given.items() if value is not None}
    said = [_shown(name, value, "given") for name, value in values.items()]
    found = vehicle.identified
    if "psi" not in values:
        if found is not None and "psi" in found.names:
            k = found.names.index("psi")
            between = found.between.psi if found.between is not None else 0.0
            values["psi"] = math.hypot(math.sqrt(found.covariance[k][k]), between)
            origin = "identified, with how logs differ" if between else "identified"
        else:
            parts = hull_parts(vehicle)
            loss = sum(part.volume * abs(part.compressibility) for part in parts)
            values["psi"] = _SHARE * loss * vehicle.water.specific_weight
            origin = f"assumed: {100.0 * _SHARE:g} % of the hull's compression; --psi-std"
        said.append(_shown("psi", values["psi"], origin))
    if "trim" not in values and not {"mass", "volume"} & set(values):
        known = found is not None and found.neutral_std > 0.0
        values["trim"] = found.neutral_std if found is not None and known else _TRIM
        origin = "identified" if known else "assumed: what weighing it in water leaves; --trim-std"
        said.append(_shown("trim", values["trim"], origin))
    if "density" not in values:
        values["density"] = _DENSITY
        said.append(_shown("density", _DENSITY, "assumed; --density-std"))
    return Uncertainty(**values, said=tuple(said))


_SHOWN = {  # in words, unit and factor from SI
    "mass": ("mass", "g", 1e3), "volume": ("volume of the hull", "cm3", 1e6),
    "trim": ("neutral volume", "cm3", 1e6), "psi": ("psi", "cm3/m", 1e6),
    "heat": ("thermal expansion", "1/K", 1.0), "air": ("trapped air", "cm3", 1e6),
    "density": ("density of the sea", "kg/m3", 1.0),
}  # fmt: skip


def _shown(name: str, value: float, origin: str) -> str:
    words, unit, factor = _SHOWN[name]
    return f"{words}: {value * factor:.3g} {unit} ({origin})"


def _fields(vehicle: Vehicle, column: Column) -> tuple[float, Array, Array, Array, Array]:
    """Return mass [kg], density [kg/m3] of the water, hull volume, heat and air per unit [n]."""
    weight = weight_mass(vehicle)
    shrunk = column.density / (1.0 - column.compressibility * column.pressure)
    hull = displaced_volume(vehicle, column.pressure, column.temperature)
    total = sum(part.volume for part in hull_parts(vehicle))
    warmer = total * (column.temperature - vehicle.hull.reference_temperature)
    kelvin = (column.temperature + 273.15) / (vehicle.hull.reference_temperature + 273.15)
    boyle = ATMOSPHERE / (ATMOSPHERE + column.pressure) * kelvin
    return weight, shrunk, hull, warmer, boyle


def drawn_volumes(
    vehicle: Vehicle, column: Column, uncertainty: Uncertainty, *, draws: int, seed: int
) -> Array:
    """Return the neutral volumes of `draws` vehicles drawn from it, in one column [draws, n]."""
    weight, water, hull, warmer, boyle = _fields(vehicle, column)
    deeper = column.pressure / vehicle.water.specific_weight
    noise = np.random.default_rng(seed).standard_normal((draws, 7, 1))
    s = uncertainty
    mass = weight + s.mass * noise[:, 0]
    displaced = (
        hull + s.volume * noise[:, 1] - s.psi * noise[:, 3] * deeper
        + s.heat * noise[:, 4] * warmer
        + np.maximum(s.air * noise[:, 5], -vehicle.hull.trapped_air) * boyle
    )  # fmt: skip
    return mass / (water + s.density * noise[:, 6]) - displaced + s.trim * noise[:, 2]


def sensitivities(vehicle: Vehicle, column: Column, uncertainty: Uncertainty) -> dict[str, Array]:
    """Return what 1 sigma of each uncertainty moves the neutral volume by, linearised [m3] [n]."""
    weight, water, _, warmer, boyle = _fields(vehicle, column)
    deeper = column.pressure / vehicle.water.specific_weight
    flat = np.ones_like(deeper)
    return {
        "mass": uncertainty.mass / water,
        "volume": -uncertainty.volume * flat,
        "trim": uncertainty.trim * flat,
        "psi": uncertainty.psi * deeper,
        "heat": -uncertainty.heat * warmer,
        "air": -uncertainty.air * boyle,
        "density": -weight / water**2 * uncertainty.density,
    }
