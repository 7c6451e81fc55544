"""Ballast: the volume a vehicle rests with in a real sea, what to add, and whether the stroke does.

::

    Uncertainty      1 sigma of what is not known: mass, volume, psi, heat, air, trim, density
    seas             casts -> the water down to where a vehicle goes; with_mass: that on the scale
    ballast          a vehicle, casts, a target -> Ballasting: mass to add, needs, margins, odds
    ballasted        the vehicle with that mass in the water of the cast

Volumes are those of the drive, 0 at mid-stroke; the law is `swimbladder.physics.hull`. Vehicles are
drawn from the uncertainty, to see for how many the stroke is enough.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import (
    PsiTerms,
    displaced_volume,
    hull_parts,
    mass_mismatch,
    neutral_volume,
    psi_terms,
    weighing,
    weight_mass,
)
from swimbladder.physics.seawater import Cast, Column, cast_column, check_rows, uniform_column
from swimbladder.physics.seawater.cast import above_rating, check_cast_unit
from swimbladder.physics.seawater.column import ATMOSPHERE
from swimbladder.units import in_unit, parse_quantity, read_numbers, rounded
from swimbladder.vehicle import Hull, HullPart, PhysicalMotion, Vehicle

# Where nothing is said: the error of a neutral volume that one experiment leaves; a share of the
# hull's compression, as `tune` takes where nothing was identified; and how well the density of the
# sea on the day is known at best (docs/adr/0009).
_TRIM = 0.5e-6  # m3
_SHARE = 0.05
_DENSITY = 0.1  # kg/m3


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """How far each may be off, 1 sigma, all independent."""

    mass: float = in_unit("kg", 0.0)
    volume: float = in_unit("m3", 0.0)  # of the hull
    trim: float = in_unit("m3", 0.0)  # of the volume at which it is neutral
    psi: float = in_unit("m3/m", 0.0)  # of the hull's compression
    heat: float = in_unit("1/K", 0.0)  # of the hull's thermal expansion
    air: float = in_unit("m3", 0.0)  # of the trapped air at the surface
    density: float = in_unit("kg/m3", 0.0)  # of the sea, all the way down
    said: tuple[str, ...] = ()  # where each comes from, in words

    def __post_init__(self) -> None:
        """Read texts with units; refuse what is no standard deviation."""
        read_numbers(self)
        for name, value in self.numbers().items():
            check_number(value, name, least=0.0, remedy="Check the standard deviation")

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
            between = found.between.psi if found.between is not None else 0.0
            k = found.names.index("psi")
            values["psi"] = math.hypot(math.sqrt(found.covariance[k][k]), between)
            origin = "identified, with how logs differ" if between else "identified"
        else:
            loss = sum(part.volume * abs(part.compressibility) for part in hull_parts(vehicle))
            values["psi"] = _SHARE * loss * vehicle.water.specific_weight
            origin = f"assumed: {100.0 * _SHARE:g} % of the hull's compression; `psi=`"
        said.append(_shown("psi", values["psi"], origin))
    if "trim" not in values and not {"mass", "volume"} & set(values):
        known = found.neutral_std if found is not None else 0.0
        values["trim"] = known or _TRIM
        origin = "identified" if known else "assumed: what weighing it in water leaves; `trim=`"
        said.append(_shown("trim", values["trim"], origin))
    if "density" not in values:
        values["density"] = _DENSITY
        said.append(_shown("density", _DENSITY, "assumed; `density=`"))
    return Uncertainty(**values, said=tuple(said))


_SHOWN = {  # in words, unit and factor from SI
    "mass": ("mass", "g", 1e3),
    "volume": ("volume of the hull", "cm3", 1e6),
    "trim": ("neutral volume", "cm3", 1e6),
    "psi": ("psi", "cm3/m", 1e6),
    "heat": ("thermal expansion", "1/K", 1.0),
    "air": ("trapped air", "cm3", 1e6),
    "density": ("density of the sea", "kg/m3", 1.0),
}


def _shown(name: str, value: float, origin: str) -> str:
    words, unit, factor = _SHOWN[name]
    return f"{words}: {value * factor:.3g} {unit} ({origin})"


def _fields(vehicle: Vehicle, column: Column) -> tuple[float, Array, Array, Array, Array]:
    """Return mass [kg], density [kg/m3] of the water, depth, heat and air per unit [n]."""
    weight = weight_mass(vehicle)
    shrunk = column.density / (1.0 - column.compressibility * column.pressure)
    deeper = column.pressure / vehicle.water.specific_weight
    total = sum(part.volume for part in hull_parts(vehicle))
    warmer = total * (column.temperature - vehicle.hull.reference_temperature)
    kelvin = (column.temperature + 273.15) / (vehicle.hull.reference_temperature + 273.15)
    boyle = ATMOSPHERE / (ATMOSPHERE + column.pressure) * kelvin
    return weight, shrunk, deeper, warmer, boyle


def drawn_volumes(
    vehicle: Vehicle, column: Column, uncertainty: Uncertainty, *, draws: int, seed: int
) -> Array:
    """Return the neutral volumes of `draws` vehicles drawn from it, in one column [draws, n]."""
    weight, water, deeper, warmer, boyle = _fields(vehicle, column)
    rng = np.random.default_rng(seed)
    noise, holes = rng.standard_normal((draws, 7, 1)), rng.standard_normal((draws, 1))
    mass, volume, trim, psi, heat, air, density = (
        std * noise[:, k] for k, std in enumerate(uncertainty.numbers().values())
    )
    displaced = displaced_volume(vehicle, column.pressure, column.temperature) + volume
    displaced = displaced - psi * deeper + heat * warmer
    displaced = displaced + np.maximum(air, -vehicle.hull.trapped_air) * boyle
    density = density + column.density_std * holes
    return (weight + mass) / (water + density) - displaced + trim


def sensitivities(vehicle: Vehicle, column: Column, uncertainty: Uncertainty) -> dict[str, Array]:
    """Return what 1 sigma of each uncertainty moves the neutral volume by, linearised [m3] [n]."""
    weight, water, deeper, warmer, boyle = _fields(vehicle, column)
    flat = np.ones_like(deeper)
    return {
        "mass": uncertainty.mass / water,
        "volume": -uncertainty.volume * flat,
        "trim": uncertainty.trim * flat,
        "psi": uncertainty.psi * deeper,
        "heat": -uncertainty.heat * warmer,
        "air": -uncertainty.air * boyle,
        "density": -weight / water**2 * np.hypot(uncertainty.density, column.density_std),
    }


_LIGHT = 5e-5  # kg, less is nothing
_WORTH = 0.01  # share of the stroke that a better trim has to bring, to be spoken of


@dataclass(frozen=True, kw_only=True)
class Target:
    """What the ballast is to bring about; nothing: it stays as it is.

    With a neutral depth the mass is for that, and the freeboard something that the stroke has to
    do; without, the mass is for the freeboard. The stroke is to cover what the sea asks for with
    the probability, and to sink and rise with the speed besides.
    """

    neutral_depth: float | None = in_unit("m", None)
    neutral_volume: float = in_unit("m3", 0.0)  # of the drive, at which it is neutral there
    freeboard: float | None = in_unit("m", None)  # of hull out of the water at the largest volume
    probability: float = in_unit("", 0.95)
    speed: float = in_unit("m/s", 0.0)

    def __post_init__(self) -> None:
        """Read texts with units."""
        read_numbers(self)


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
class Ballasting(Answer):
    """Everything that `ballast` found."""

    vehicle: Vehicle  # as ballasted
    given: Vehicle
    target: Target
    columns: tuple[Column, ...]
    curves: tuple[Curve, ...]
    needs: tuple[Need, ...]
    uncertainty: Uncertainty
    draws: int
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
    assumptions: tuple[str, ...]  # the warnings first
    warnings: tuple[str, ...] = ()

    @property
    def worst(self) -> Need:
        """The need of the cast with the smallest probability, then margin."""
        return min(self.needs, key=lambda need: (need.probability, need.margin))

    @property
    def covered(self) -> bool:
        """Whether the stroke covers every cast with the probability asked for."""
        return self.worst.probability >= self.target.probability

    @property
    def stroke(self) -> float:
        """The whole stroke [m3]."""
        return self.vehicle.stroke.maximum - self.vehicle.stroke.minimum

    @property
    def sentences(self) -> tuple[str, ...]:
        """The answer in words."""
        return (*self._mass_words(), *self._stroke_words(), self._psi_words())

    def _mass_words(self) -> Iterator[str]:
        w, then = self.target, self._mass(self.added)
        if w.neutral_depth is not None:
            at = f"at {w.neutral_depth:g} m with a volume of {_cm3(w.neutral_volume)}"
            yield f"To be neutral {at}: {then}."
        elif w.freeboard is not None:
            out = f"{_cm(w.freeboard)} of hull out of the water at the largest volume"
            yield f"To float with {out}: {then}."
        if self.freeboard > 0.0:
            out = f"{_cm(self.freeboard)} of hull are out of the water"
            sure = f"{_cm(self.sure_freeboard)} or more in {self._percent} of cases"
            yield f"At the surface and the largest volume {out}, {sure}."
        else:
            yield "At the surface even the largest volume leaves the hull under water."

    def _mass(self, mass: float, *, again: bool = False) -> str:
        if abs(mass) < _LIGHT:
            return "add nothing"
        where = "inside the hull" if self.material == "inside" else f"of {self.material} outside"
        word = f"{'add' if mass > 0.0 else 'take away'}{' another' if again else ''}"
        return f"{word} {_gram(abs(mass))} {where}"

    @property
    def _percent(self) -> str:
        return f"{100.0 * self.target.probability:g} %"

    def _stroke_words(self) -> Iterator[str]:
        need, stroke = self.worst, self.vehicle.stroke
        deepest = self.columns[0].deepest
        sea = f" in {need.source}, the worst of {len(self.needs)}" if len(self.needs) > 1 else ""
        speed = self.target.speed
        moving = f", at {100.0 * speed:g} cm/s too" if speed > 0.0 else ""
        least = f"{_cm3(need.least)} (at {need.least_depth:g} m)"
        most = f"{_cm3(need.most)} (at {need.most_depth:g} m)"
        has = f"the stroke has {_cm3(stroke.minimum)} to {_cm3(stroke.maximum)}"
        takes = f"From the surface to {deepest:g} m it takes {least} to {most}"
        yield f"{takes}{moving}{sea}; {has}."
        chance = f"with a probability of {self._chance(need.probability)}"
        if self.covered:
            share = 100.0 * need.margin / self.stroke
            left = f"in {self._percent} of cases {_cm3(need.margin)} or more are left"
            margin = f"at the tighter end, a stroke margin of {share:.0f} %"
            yield f"The stroke covers it {chance}; {left} {margin}."
        else:
            yield f"The stroke does NOT cover it: it does {chance}, {self._percent} are asked for."
            yield from self._short(need)
        if self.best_margin - need.margin > _WORTH * self.stroke:
            trim = self._mass(self.best, again=self.added * self.best > 0.0)
            left = f"have {_cm3(self.best_margin)} left"
            if self.best_margin <= 0.0:
                left = f"are short by {_cm3(-self.best_margin)}"
                left += ": it takes a longer stroke or another hull"
            yield f"With the best trim ({trim}) both ends {left}."

    def _short(self, need: Need) -> Iterator[str]:
        rise = f"to rise from {need.most_depth:g} m"
        if need.out_for == "freeboard":
            rise = f"to float with {_cm(self.target.freeboard or 0.0)} of freeboard"
        for end, margin, what in (
            ("retracted", need.margin_in, f"light to sink past {need.least_depth:g} m"),
            ("extended", need.margin_out, f"heavy {rise}"),
        ):
            if margin < 0.0:
                yield f"Short by {_cm3(-margin)} at the {end} end ({self._percent}): too {what}."

    def _chance(self, p: float) -> str:
        if p >= 1.0 - 0.5 / self.draws:
            return f"more than {100.0 * (1.0 - 3.0 / self.draws):.2f} %"
        if p <= 0.5 / self.draws:
            return f"less than {300.0 / self.draws:.2f} %"
        return f"{100.0 * p:.3g} %"

    def _psi_words(self) -> str:
        t = self.psi
        parts = {"hull": t.hull, "heat": t.heat, "trapped air": t.air, "water": t.water}
        terms = ", ".join(f"{name} {1e6 * x:.3g}" for name, x in parts.items() if x != 0.0)
        here = f"psi in this sea at {self.psi_depth:g} m: {1e6 * t.psi:.3g} cm3/m ({terms})"
        return f"{here}; the vehicle's file has {1e6 * self.given.hull.psi:.3g}."

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as JSON, SI."""
        return {
            **as_json(self.vehicle, "vehicle=name trim_error_m3"),
            **as_json(self.target, "probability_asked=probability speed_m_s"),
            **as_json(self, _ANSWER),
            **as_json(self.worst, "probability margin_m3"),
            "margin_share": self.worst.margin / self.stroke,
            "deepest_m": self.columns[0].deepest,
            "stroke_m3": [self.vehicle.stroke.minimum, self.vehicle.stroke.maximum],
            "casts": [as_json(need, _OF_CAST) for need in self.needs],
            "psi": {"depth_m": self.psi_depth, "psi_m3_m": self.psi.psi, **self.psi._asdict()},
            "uncertainty": self.uncertainty.numbers(),
        }


_ANSWER = (
    "covered added_kg added_volume_m3 material best_added_kg=best best_margin_m3 freeboard_m "
    "freeboard_sure_m=sure_freeboard spread_m3 sentences assumptions"
)
_OF_CAST = (
    "source least_m3 least_depth_m most_m3 most_depth_m probability margin_in_m3 margin_out_m3"
)


def _cm3(volume: float) -> str:
    return f"{rounded(1e6 * volume, 3)} cm3"


def _gram(mass: float) -> str:
    return f"{rounded(1e3 * mass, 3)} g" if mass < 1.0 else f"{mass:.4g} kg"


def _cm(length: float) -> str:
    return f"{100.0 * length:.3g} cm"


# kg/m3 at room temperature: CRC Handbook of Chemistry and Physics, 97th ed., section 4 (elements)
# and 12 (alloys): lead, iron/plain steel, stainless steel 304, aluminium.
MATERIALS = {"lead": 11340.0, "steel": 7850.0, "stainless": 8000.0, "aluminium": 2700.0}


class Seas(NamedTuple):
    """The waters a vehicle may meet, what was assumed of them, and warnings."""

    columns: list[Column]
    assumed: list[str]
    warnings: list[str]


def seas(vehicle: Vehicle, casts: Sequence[Cast], deepest: float | None = None) -> Seas:
    """Return the waters of casts down to where a vehicle is to go; its own where there are none.

    deepest [m]; None: its rating, or where the first cast ends. Raises InputError for a depth that
    it cannot go to, where none is known, and for a cast that may be in another unit.
    """
    limit = vehicle.hull.depth_limit
    if deepest is not None:
        remedy = "Give a depth below the surface"
        check_number(deepest, "max_depth", "m", above=0.0, most=math.inf, remedy=remedy)
        if limit is not None and deepest > limit:
            what = f"deeper than the vehicle is rated for, {limit:g} m"
            remedy = "Give a lesser depth, or correct hull.depth_limit"
            raise InputError(what, field="max_depth", value=deepest, unit="m", remedy=remedy)
    if not casts:
        down = limit if deepest is None else deepest
        if down is None:
            what = "neither a cast, nor a depth, nor the vehicle's file says how deep it goes"
            raise InputError(what, field="max_depth", remedy="Give this depth, or a cast")
        column = uniform_column(vehicle.water, down, step=down / 1000.0)
        return Seas([column], [f"no cast: {column.source}, as in the vehicle's file"], [])
    for cast in casts:
        check_cast_unit(cast, deepest, limit)
    assumed: list[str] = []
    warnings: list[str] = []
    if deepest is None:
        ends = [(cast_column(cast).deepest, cast.name) for cast in casts]
        shallowest, name = min(ends, key=itemgetter(0))
        deepest = min(shallowest, math.inf if limit is None else limit)
        why = "its rating" if deepest == limit else "where the cast ends; `max_depth=`"
        assumed.append(f"it goes down to {deepest:g} m ({why})")
        warnings += above_rating(name, shallowest, limit, "max_depth")
    columns = [cast_column(cast, deepest) for cast in casts]
    said = dict.fromkeys(line for column in columns for line in column.report)
    return Seas(columns, [*assumed, *said], warnings)


def with_mass(vehicle: Vehicle, mass: float | None = None) -> tuple[Vehicle, str, list[str]]:
    """Return the vehicle with the mass on the scale [kg], what is assumed of it, warnings.

    None: what its trim_error says. Raises InputError for a mass that the hull could not carry by
    far: a wrong unit or volume.
    """
    by_trim = weight_mass(vehicle)
    if mass is None:
        assumed = f"it weighs {by_trim:.6g} kg, by trim_error in the water of the vehicle's file"
        if isinstance(vehicle.motion, PhysicalMotion):
            assumed += f" (its dry mass there is {vehicle.motion.dry_mass:.6g} kg)"
        warning = mass_mismatch(vehicle)
        rest = ", and trim_error is taken; weigh it and give `mass=`"
        return vehicle, assumed, [warning + rest] if warning else []
    if not 0.5 * by_trim < mass < 2.0 * by_trim:
        litres = by_trim / vehicle.water.density * 1e3
        what = f"a vehicle that displaces {litres:.4g} L does not weigh this"
        remedy = "Check the mass, and hull.displaced_volume in the vehicle's file"
        raise InputError(what, field="mass", value=mass, unit="kg", remedy=remedy)
    assumed = f"it weighs {mass:.6g} kg, as given (by trim {by_trim:.6g} kg)"
    return weighing(vehicle, mass), assumed, []


def material_of(text: str) -> tuple[float, str]:
    """Return density [kg/m3] and name of ballast; infinite for what stands inside the hull.

    Raises InputError for what is neither one of `MATERIALS`, nor a density, nor "inside".
    """
    if text == "inside":
        return math.inf, text
    if text in MATERIALS:
        return MATERIALS[text], text
    try:
        density = parse_quantity(text, "kg/m3")
    except InputError:
        remedy = f'Give one of {", ".join(MATERIALS)}, a density like "19 g/cm3", or inside'
        what = "no such ballast"
        raise InputError(what, field="material", value=text, remedy=remedy) from None
    return density, f"{density:g} kg/m3"


_DRAWS = 20_000  # so that a probability of 95 % is known to 0.15 % (1 sigma)
_POINTS = 200  # depths that each draw is looked at, the extremes of the mean among them


def ballast(
    vehicle: Vehicle,
    casts: Sequence[Cast] = (),
    *,
    target: Target = Target(),
    max_depth: float | None = None,
    uncertainty: Uncertainty | None = None,
    material: str = "lead",
    mass: float | None = None,
    advance: Advance = silent,
) -> Ballasting:
    """Find the ballast of a vehicle in a real sea, and whether its stroke is enough.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    casts
        The seas that it may meet, as `read_cast` returns them; the target is for the first. None:
        water of constant density, that of the vehicle's file.
    target
        What the ballast is to bring about.
    max_depth
        How deep it is to go [m]; none: its rating, or where the first cast ends.
    uncertainty
        What is not known of the vehicle, 1 sigma; none: as its file and `uncertainty_of` have it.
    material
        Of the ballast: lead, steel, ..., a density with its unit, or inside.
    mass
        On the scale [kg]; none: what trim_error says.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    Ballasting
        What to add, the vehicle with it, and the probability that its stroke does.

    Raises
    ------
    InputError
        A target, a depth or a mass makes no sense, or a cast may be in another unit.
    NoAnswerError
        No mass brings about the target.
    """
    of = material_of(material)
    sea = seas(vehicle, casts, max_depth)
    vehicle, stated, more = with_mass(vehicle, mass)
    unknown, warned = uncertainty or uncertainty_of(vehicle, {}), (*sea.warnings, *more)
    found = ballast_in(
        vehicle,
        sea.columns,
        target=target,
        uncertainty=unknown,
        material=of,
        assumptions=(*warned, *sea.assumed, stated, *_hull_words(vehicle), *unknown.said),
        advance=advance,
    )
    return replace(found, warnings=warned)


def _hull_words(vehicle: Vehicle) -> list[str]:
    """Return what is assumed of the hull."""
    if vehicle.hull.parts:
        return [f"the hull is {', '.join(part.name for part in vehicle.hull.parts)}"]
    unknown = "its thermal expansion is unknown and assumed 0; [[hull.parts]] states it"
    return [f"the hull is one part whose compression is that of psi, and {unknown}"]


def ballast_in(
    vehicle: Vehicle,
    columns: Sequence[Column],
    *,
    target: Target = Target(),
    uncertainty: Uncertainty,
    material: tuple[float, str] = (MATERIALS["lead"], "lead"),
    draws: int = _DRAWS,
    assumptions: Sequence[str] = (),
    advance: Advance = silent,
) -> Ballasting:
    """Return what to add to a vehicle for a target, and whether its stroke does in every column.

    columns: the seas it may meet, down to the deepest it has to go; the target is for the first.
    material: of what is added, as `material_of` has it. Raises InputError for targets that make no
    sense and NoAnswerError where no mass fulfils them.
    """
    density, named = material
    _check(vehicle, columns, target, density)
    added = _added(vehicle, columns[0], target, density)
    made = ballasted(vehicle, added, density, columns[0])
    curves, needs, at_surface, p = [], [], [], target.probability
    for k, column in enumerate(columns):
        thin = _thinned(column, made)
        nominal = neutral_volume(made, thin)
        drawn = drawn_volumes(made, thin, uncertainty, draws=draws, seed=k)
        needs.append(_need(made, thin, nominal, drawn, target))
        low, high = np.quantile(drawn, [0.5 - 0.5 * p, 0.5 + 0.5 * p], axis=0)
        curves.append(Curve(depth=thin.depth, nominal=nominal, low=low, high=high))
        at_surface.append((nominal[0], np.quantile(drawn[:, 0], p)))
        advance(1.0 / len(columns))
    tight = min(needs, key=lambda need: (need.probability, need.margin))
    shift = 0.5 * (tight.margin_out - tight.margin_in)
    first = columns[0]
    per_mass = 1.0 / float(first.density[0]) - 1.0 / density
    out = (made.stroke.maximum - np.array(at_surface[0])) / made.hull.waterplane_area
    free, sure = np.clip(out, 0.0, made.hull.height).tolist()
    at = min(target.neutral_depth or 0.5 * first.deepest, first.deepest)
    spread = sensitivities(made, first, uncertainty).items()
    return Ballasting(
        vehicle=made,
        given=vehicle,
        target=target,
        columns=tuple(columns),
        curves=tuple(curves),
        needs=tuple(needs),
        uncertainty=uncertainty,
        draws=draws,
        added=added,
        added_volume=added / density,
        material=named,
        best=shift / per_mass,
        best_margin=0.5 * (tight.margin_in + tight.margin_out),
        freeboard=free,
        sure_freeboard=sure,
        psi_depth=at,
        psi=psi_terms(made, first, at),
        assumptions=tuple(assumptions),
        spread={name: float(abs(values[-1])) for name, values in spread},
    )


def ballasted(vehicle: Vehicle, added: float, density: float, column: Column) -> Vehicle:
    """Return the vehicle with a mass [kg] of that density [kg/m3] added, in the water of a column.

    Its [water] is that of the surface of the column, and trim_error the volume at which it is
    neutral there; what weighs and what is displaced is otherwise as before.
    """
    volume = added / density
    hull = vehicle.hull.model_dump()
    hull["displaced_volume"] += volume
    if vehicle.hull.parts and volume != 0.0:
        hull["parts"] = _with_ballast(vehicle.hull, volume)
    surface = {"density": float(column.density[0]), "temperature": float(column.temperature[0])}
    water = vehicle.water.model_copy(update=surface | {"gravity": column.gravity})
    displaced = (weight_mass(vehicle) + added) / water.density
    if not vehicle.hull.parts:  # the hull gives way as before, whatever psi is counted from
        loss = hull_parts(vehicle)[0].volume * hull_parts(vehicle)[0].compressibility
        hull["psi"] = (loss - displaced * water.compressibility) * water.specific_weight
    warm = vehicle.model_copy(update={"hull": Hull.model_validate(hull)})
    # at pressure 0, where it does not matter what the hull's compression is
    trim = displaced - float(displaced_volume(warm, 0.0, water.temperature))
    changes: dict[str, object] = {"water": water, "trim_error": trim}
    if isinstance(vehicle.motion, PhysicalMotion) and added != 0.0:
        heavier = {"dry_mass": vehicle.motion.dry_mass + added}
        changes["motion"] = vehicle.motion.model_copy(update=heavier)
    return warm.model_copy(update=changes)


def _with_ballast(hull: Hull, volume: float) -> tuple[HullPart, ...]:
    """Return the parts with ballast among them; what is taken away is taken from the first.

    Ballast is stiff: the first part then loses and gains as much volume as before.
    """
    if volume > 0.0:
        return (*hull.parts, HullPart(name="added ballast", volume=volume, compressibility=0.0))
    first = hull.parts[0]
    left = first.volume + volume
    if left <= 0.0:
        taken = f"{rounded(-1e3 * volume, 3)} L of ballast would have to be taken away"
        remedy = "check the mass and the water of the cast"
        raise NoAnswerError(f"{taken}, more than {first.name} displaces: {remedy}")
    kept = ("compressibility", "thermal_expansion", "stiffening")
    changes = {name: getattr(first, name) * first.volume / left for name in kept}
    return (first.model_copy(update={"volume": left, **changes}), *hull.parts[1:])


def _check(vehicle: Vehicle, columns: Sequence[Column], target: Target, density: float) -> None:
    """Raise InputError for what cannot be asked."""
    deepest, height, stroke = columns[0].deepest, vehicle.hull.height, vehicle.stroke
    at, volume, out = target.neutral_depth, target.neutral_volume, target.freeboard

    def need(holds: bool, field: str, x: float | None, unit: str, what: str, remedy: str) -> None:
        if not holds:
            raise InputError(what, field=field, value=x, unit=unit, remedy=remedy)

    for column in columns:
        check_rows(column)
    how = "Write it like 95 %"
    check_number(target.probability, "probability", least=0.5, below=1.0, remedy=how)
    how = "Give what it has to sink and rise with, by its volume"
    check_number(target.speed, "speed", "m/s", least=0.0, most=2.0, remedy=how)
    what = "ballast that is not denser than the water does nothing"
    remedy = "Give the density of what you add, lead is 11340 kg/m3"
    need(density > float(columns[0].density[-1]), "material", density, "kg/m3", what, remedy)
    what = f"the depth is not between the surface and {deepest:g} m, where the water ends"
    remedy = "Give a depth in the water, or water as deep"
    need(at is None or 0.0 <= at <= deepest, "neutral_depth", at, "m", what, remedy)
    what = f"no more than the height of the hull, {height:g} m, can be out of the water"
    remedy, fits = "Check the number and its unit", out is None or 0.0 <= out <= height
    need(fits, "freeboard", out, "m", what, remedy)
    what = "a volume to be neutral with needs the depth"
    remedy = "Give the neutral depth too, or leave the volume out"
    need(volume == 0.0 or at is not None, "neutral_volume", volume, "m3", what, remedy)
    remedy, fits = "Volumes count from mid-stroke", stroke.minimum <= volume <= stroke.maximum
    need(fits, "neutral_volume", volume, "m3", "outside the stroke", remedy)


def _added(vehicle: Vehicle, column: Column, target: Target, density: float) -> float:
    """Return the mass to add for a target [kg]: m/rho - V(p, T) is to be the volume wished for."""
    if target.neutral_depth is None and target.freeboard is None:
        return 0.0
    neutral = neutral_volume(vehicle, column)
    at = target.neutral_depth or 0.0
    volume = target.neutral_volume
    if target.neutral_depth is None and target.freeboard is not None:
        volume = vehicle.stroke.maximum - target.freeboard * vehicle.hull.waterplane_area
    now = float(np.interp(at, column.depth, neutral))
    rho = float(np.interp(at, column.depth, column.density))
    added = (volume - now) / (1.0 / rho - 1.0 / density)
    if added < -0.5 * weight_mass(vehicle):
        taken = f"{rounded(-added, 3)} kg would have to be taken away"
        remedy = "check its volume, its mass and the water of the cast"
        raise NoAnswerError(f"{taken}, more than half of the vehicle: {remedy}")
    return added


def _thinned(column: Column, vehicle: Vehicle) -> Column:
    """Return the column at `_POINTS` depths, and those where the vehicle's extremes are."""
    n = len(column.depth)
    neutral = neutral_volume(vehicle, column)
    even = np.linspace(0, n - 1, min(n, _POINTS)).astype(int)
    rows = np.unique([*even, np.argmin(neutral), np.argmax(neutral)])
    along = ["depth", "pressure", "density", "temperature"]
    along += ["density_std"] * (len(column.density_std) == n)
    return replace(column, **{name: getattr(column, name)[rows] for name in along})


def _need(vehicle: Vehicle, column: Column, nominal: Array, drawn: Array, target: Target) -> Need:
    """Return what the stroke has to cover in one column, and how likely it does."""
    stroke, weight = vehicle.stroke, column.density * column.gravity
    out = 0.0  # volume of the freeboard that the stroke has to give
    if target.neutral_depth is not None:  # else the mass is chosen for it
        out = (target.freeboard or 0.0) * vehicle.hull.waterplane_area
    down, up = (abs(drag_force(vehicle.drag, w)) / weight for w in (target.speed, -target.speed))
    sink, rise = nominal - down, nominal + up
    rise[0] = max(rise[0], nominal[0] + out)
    least, most = int(np.argmin(sink)), int(np.argmax(rise))
    highest = np.maximum((drawn + up).max(axis=1), drawn[:, 0] + out)
    inward = (drawn - down).min(axis=1) - stroke.minimum
    outward = stroke.maximum - highest
    return Need(
        source=column.source,
        least=float(sink[least]),
        least_depth=float(column.depth[least]),
        most=float(rise[most]),
        most_depth=float(column.depth[most]),
        probability=float(np.mean((inward >= 0.0) & (outward >= 0.0))),
        margin_in=float(np.quantile(inward, 1.0 - target.probability)),
        margin_out=float(np.quantile(outward, 1.0 - target.probability)),
        out_for="freeboard" if most == 0 and out > up[0] else "rise",
    )
