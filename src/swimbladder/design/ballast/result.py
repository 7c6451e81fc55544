"""What comes out of ballasting: masses, needs and margins of the stroke, sentences, JSON.

`Uncertainty` is what is not known of a vehicle's weight and volume; vehicles are drawn from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.answers import as_json
from swimbladder.physics.hull import PsiTerms, displaced_volume, hull_parts, weight_mass
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.column import ATMOSPHERE
from swimbladder.units import rounded
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


_LIGHT = 5e-5  # kg, less is nothing
_WORTH = 0.01  # share of the stroke that a better trim has to bring, to be spoken of


@dataclass(frozen=True, kw_only=True)
class Target:
    """What the ballast is to bring about; nothing: it stays as it is.

    With a neutral depth the mass is for that, and the freeboard something that the stroke has to
    do; without, the mass is for the freeboard.
    """

    neutral_depth: float | None = None  # m
    volume: float = 0.0  # m3 of the drive at which it is neutral there
    freeboard: float | None = None  # m of hull out of the water at the largest volume

    @property
    def asked_freeboard(self) -> float:
        """The freeboard that the stroke has to give [m], 0 where the mass is chosen for it."""
        return self.freeboard or 0.0 if self.neutral_depth is not None else 0.0


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Neutral volumes [m3] over depth [m], as it is and in the band of the probability [n]."""

    depth: Array
    nominal: Array
    low: Array
    high: Array


@dataclass(frozen=True, kw_only=True)
class Need:
    """The volumes that one cast asks of the drive, and what is left of the stroke.

    least, most: as the vehicle is [m3], at depths [m]. probability: that the stroke covers both.
    margin_in, margin_out: what is left at the retracted and at the extended end, at the
    probability asked for [m3]; negative: short of it.
    """

    source: str
    least: float
    least_depth: float
    most: float
    most_depth: float
    probability: float
    margin_in: float
    margin_out: float
    out_for: str  # what needs the largest volume: "rise" or "freeboard"

    @property
    def margin(self) -> float:
        """The lesser of the two [m3]."""
        return min(self.margin_in, self.margin_out)


@dataclass(frozen=True, kw_only=True)
class Ballasting:
    """Everything that `ballast` found."""

    vehicle: Vehicle  # as ballasted
    given: Vehicle
    target: Target
    columns: tuple[Column, ...]
    curves: tuple[Curve, ...]
    needs: tuple[Need, ...]
    uncertainty: Uncertainty
    wanted: float  # probability
    draws: int
    speed: float  # m/s
    added: float  # kg, negative: removed
    added_volume: float  # m3 that it displaces
    material: str
    best: float  # kg to add beyond that, for equal margins at both ends in the worst cast
    best_margin: float  # m3, then
    freeboard: float  # m, at the largest volume
    sure_freeboard: float  # m, what it has at least with the probability asked for
    psi_depth: float  # m
    psi: PsiTerms
    spread: dict[str, float]  # m3, 1 sigma of the neutral volume at the deepest, by cause
    assumptions: tuple[str, ...]

    @property
    def worst(self) -> Need:
        """The need of the cast with the smallest probability, then margin."""
        return min(self.needs, key=lambda need: (need.probability, need.margin))

    @property
    def covered(self) -> bool:
        """Whether the stroke covers every cast with the probability asked for."""
        return self.worst.probability >= self.wanted

    @property
    def stroke(self) -> float:
        """The whole stroke [m3]."""
        return self.vehicle.stroke.maximum - self.vehicle.stroke.minimum

    @property
    def sentences(self) -> tuple[str, ...]:
        """The answer in words."""
        return (*self._mass_words(), *self._stroke_words(), self._psi_words())

    def _mass_words(self) -> list[str]:
        w, made = self.target, []
        if w.neutral_depth is not None:
            made.append(
                f"To be neutral at {w.neutral_depth:g} m with a volume of {_cm3(w.volume)}: "
                f"{self._mass(self.added)}."
            )
        elif w.freeboard is not None:
            made.append(
                f"To float with {100.0 * w.freeboard:.3g} cm of hull out of the water at the "
                f"largest volume: {self._mass(self.added)}."
            )
        made.append(
            f"At the surface and the largest volume {100.0 * self.freeboard:.3g} cm of hull are "
            f"out of the water, {100.0 * self.sure_freeboard:.3g} cm or more in "
            f"{100.0 * self.wanted:g} % of cases."
            if self.freeboard > 0.0
            else "At the surface even the largest volume leaves the hull under water."
        )
        return made

    def _mass(self, mass: float, *, again: bool = False) -> str:
        if abs(mass) < _LIGHT:
            return "add nothing"
        where = "inside the hull" if self.material == "inside" else f"of {self.material} outside"
        word = f"{'add' if mass > 0.0 else 'take away'}{' another' if again else ''}"
        return f"{word} {_gram(abs(mass))} {where}"

    def _stroke_words(self) -> list[str]:
        need, stroke = self.worst, self.vehicle.stroke
        deepest = self.columns[0].deepest
        sea = f" in {need.source}, the worst of {len(self.needs)}" if len(self.needs) > 1 else ""
        moving = f", at {100.0 * self.speed:g} cm/s too" if self.speed > 0.0 else ""
        made = [
            f"From the surface to {deepest:g} m it takes {_cm3(need.least)} (at "
            f"{need.least_depth:g} m) to {_cm3(need.most)} (at {need.most_depth:g} m){moving}{sea};"
            f" the stroke has {_cm3(stroke.minimum)} to {_cm3(stroke.maximum)}."
        ]
        percent = f"{100.0 * self.wanted:g} %"
        chance = f"with a probability of {self._chance(need.probability)}"
        if self.covered:
            share = 100.0 * need.margin / self.stroke
            made.append(
                f"The stroke covers it {chance}; in {percent} of cases {_cm3(need.margin)} or "
                f"more are left at the tighter end, a stroke margin of {share:.0f} %."
            )
        else:
            made.append(f"The stroke does NOT cover it: it does {chance}, {percent} are asked for.")
            made += self._short(need)
        if self.best_margin - need.margin > _WORTH * self.stroke:
            trim = self._mass(self.best, again=self.added * self.best > 0.0)
            made.append(
                f"With the best trim ({trim}) both ends have {_cm3(self.best_margin)} left."
                if self.best_margin > 0.0
                else f"With the best trim ({trim}) both ends are short by "
                f"{_cm3(-self.best_margin)}: it takes a longer stroke or another hull."
            )
        return made

    def _short(self, need: Need) -> list[str]:
        made = []
        percent = f"{100.0 * self.wanted:g} %"
        if need.margin_in < 0.0:
            made.append(
                f"Short by {_cm3(-need.margin_in)} at the retracted end ({percent}): too light to "
                f"sink past {need.least_depth:g} m."
            )
        if need.margin_out < 0.0:
            what = (
                f"to float with {100.0 * (self.target.freeboard or 0.0):.3g} cm of freeboard"
                if need.out_for == "freeboard"
                else f"to rise from {need.most_depth:g} m"
            )
            made.append(
                f"Short by {_cm3(-need.margin_out)} at the extended end ({percent}): too heavy "
                f"{what}."
            )
        return made

    def _chance(self, p: float) -> str:
        if p >= 1.0 - 0.5 / self.draws:
            return f"more than {100.0 * (1.0 - 3.0 / self.draws):.2f} %"
        if p <= 0.5 / self.draws:
            return f"less than {300.0 / self.draws:.2f} %"
        return f"{100.0 * p:.3g} %"

    def _psi_words(self) -> str:
        t = self.psi
        terms = ", ".join(
            f"{name} {_small(value)}"
            for name, value in (
                ("hull", t.hull), ("heat", t.heat), ("trapped air", t.air), ("water", t.water),
            )
            if value != 0.0
        )  # fmt: skip
        return (
            f"psi in this sea at {self.psi_depth:g} m: {_small(t.psi)} cm3/m ({terms}); the "
            f"vehicle's file has {_small(self.given.hull.psi)}."
        )

    def to_json(self) -> dict[str, Any]:
        """Return the answer as JSON, SI."""
        of_cast = (
            "source least_m3 least_depth_m most_m3 most_depth_m probability margin_in_m3 "
            "margin_out_m3"
        )
        return {
            **as_json(self.vehicle, "vehicle=name trim_error_m3"),
            **as_json(
                self,
                "covered probability_asked=wanted added_kg added_volume_m3 material "
                "best_added_kg=best best_margin_m3 freeboard_m freeboard_sure_m=sure_freeboard "
                "speed_m_s spread_m3 sentences assumptions",
            ),
            **as_json(self.worst, "probability margin_m3"),
            "margin_share": self.worst.margin / self.stroke,
            "deepest_m": self.columns[0].deepest,
            "stroke_m3": [self.vehicle.stroke.minimum, self.vehicle.stroke.maximum],
            "casts": [as_json(need, of_cast) for need in self.needs],
            "psi": {"depth_m": self.psi_depth, "psi_m3_m": self.psi.psi, **self.psi._asdict()},
            "uncertainty": self.uncertainty.numbers(),
        }


def _cm3(volume: float) -> str:
    return f"{rounded(1e6 * volume, 3)} cm3"


def _gram(mass: float) -> str:
    return f"{rounded(1e3 * mass, 3)} g" if mass < 1.0 else f"{mass:.4g} kg"


def _small(psi: float) -> str:
    return f"{1e6 * psi:.3g}"
