"""Search all combinations of parts for the one that does the dive with the least mass or energy.

Also what is said of it: sentences, a table, JSON and a vehicle.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np

from swimbladder.design.sizing.candidates import (
    PARTS,
    Batch,
    Combination,
    Hydraulic,
    Parts,
    combinations,
    load_parts,
)
from swimbladder.design.sizing.evaluation import (
    REQUIREMENTS,
    Dive,
    Evaluation,
    Requirements,
    evaluate,
    requirements,
)
from swimbladder.errors import InputError, NoAnswerError, check_number
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.hull import weight_mass
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column, uniform_column
from swimbladder.units import rounded
from swimbladder.vehicle import (
    DatasheetPump,
    ElectromechanicalActuator,
    Load,
    PumpAndValve,
    Stroke,
    Supply,
    Valve,
    Vehicle,
)
from swimbladder.vehicle.schema import check_choice

Least = Literal["mass", "energy"]
Solve = Callable[[Dive], tuple[Requirements, Evaluation]]
_AS_GOOD = 1.002
_ROOM = 0.5  # of the body: what the drive lets in has to find room inside, beside all else
# degC where no cast says: water is densest there and fills deep lakes; the oceans have 2 to 5 degC
# at 1000 m (Talley et al., "Descriptive Physical Oceanography", 6th ed. 2011, ch. 4)
_COLDEST = 4.0
_SWEPT = {
    "max_depth": (0.5, 0.75, 1.0, 1.25, 1.5, 2.0),
    "turn_time": (0.25, 0.5, 1.0, 2.0, 4.0),
    "speed": (0.5, 0.75, 1.0, 1.5, 2.0),
    "trim_std": (0.0, 0.5, 1.0, 2.0, 4.0),
    "cycles": (0.25, 0.5, 1.0, 2.0, 4.0),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Choice:
    """The best that a part can be in, all others free; `index` of -1 where there is none.

    what: kind of part; name of the part; missing: the requirement that the best drive with it
    fails, and by which share.
    """

    what: str
    name: str
    index: int
    missing: str = ""
    margin: float = math.inf


@dataclasses.dataclass(frozen=True)
class Sweep:
    """The best drive as one wish changes: values in SI, mass [kg] and energy [J] NaN for none."""

    what: str
    values: list[float]
    mass: list[float]
    cycle_energy: list[float]
    stroke: list[float]
    drive: list[str]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sizing(Answer):
    """All candidates, weighed, the best of them, and what each wish and each part costs."""

    body: Vehicle
    column: Column
    asked: Requirements
    parts: Parts
    goal: Least
    batch: Batch
    evaluation: Evaluation
    best: int
    pareto: list[int]
    choices: list[Choice]
    sweeps: list[Sweep]

    @property
    def chosen(self) -> Combination:
        """The best combination of parts."""
        return self.batch.of[self.best]

    @property
    def sentences(self) -> list[str]:
        """The drive, the stroke, what it takes, what limits it."""
        return _sentences(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the whole answer in SI units."""
        return _numbers(self)


def size(
    body: Vehicle,
    dive: Dive,
    *,
    cast: Column | None = None,
    parts: Parts | None = None,
    goal: Least = "mass",
    max_piston_stroke: float = 0.6,
    max_mass: float = math.inf,
    sweeps: bool = True,
    advance: Advance = silent,
) -> Sizing:
    """Find the drive and battery with the least mass or energy for a dive, of all that parts make.

    Parameters
    ----------
    body
        A vehicle, as `load_vehicle` returns it: its hull, mass and drag are used, its drive and
        stroke are not.
    dive
        The dive that is asked for.
    cast
        The water, as `read_cast` or `cast_column` returns it; none: that of the body, with a
        battery at 4 degC.
    parts
        As `load_parts` returns them; none: those that come with swimbladder.
    goal
        What is to be least: mass or energy.
    max_piston_stroke
        Of a piston [m].
    max_mass
        Of drive and battery [kg], which the body bounds too, as its volume does the stroke.
    sweeps
        Whether to vary what the dive asks for as well.
    advance
        Called with 1 for the first search, and for each of the sweeps.

    Returns
    -------
    Sizing
        The best combination, all others, and what each wish and each part costs.

    Raises
    ------
    InputError
        The body is not rated for the depth, or a number makes no sense.
    NoAnswerError
        No combination will do: which requirement is in the way, and by how much.
    """
    parts = load_parts() if parts is None else parts
    if cast is None and dive.battery_temperature is None:
        dive = dataclasses.replace(dive, battery_temperature=_COLDEST)
    check_choice(goal, get_args(Least), "no such goal", field="goal")
    _check(body, dive, max_piston_stroke, max_mass)
    batch = combinations(parts, body.water)

    def water(swept: Dive) -> Column:
        return cast or uniform_column(body.water, swept.max_depth * 1.001)

    def solve(swept: Dive) -> tuple[Requirements, Evaluation]:
        asked = requirements(body, water(swept), swept)
        room = min(max_mass, weight_mass(body)), _ROOM * body.hull.displaced_volume
        return asked, evaluate(batch, asked, body.water, (max_piston_stroke, *room))

    asked, evaluation = solve(dive)
    advance(1.0)
    score = _score(evaluation, goal)
    if not np.any(evaluation.feasible):
        raise _none(batch, evaluation, dive)
    best = _best(batch, evaluation, score)
    deepest, swept = math.inf if cast is None else cast.deepest, []
    for what in _SWEPT if sweeps else ():
        swept.append(_sweep(what, _dives(dive, what, deepest), solve, batch, goal))
        advance(1.0)
    return Sizing(
        body=body,
        column=water(dive),
        asked=asked,
        parts=parts,
        goal=goal,
        batch=batch,
        evaluation=evaluation,
        best=best,
        pareto=_pareto(evaluation),
        choices=_choices(batch, evaluation, score),
        sweeps=swept,
    )


def _check(body: Vehicle, dive: Dive, max_piston_stroke: float, max_mass: float) -> None:
    limit = body.hull.depth_limit
    if limit is not None and dive.max_depth > limit:
        what = f"the body {body.name!r} is rated for {limit:g} m (hull.depth_limit)"
        remedy = "Ask for less, or size the drive of a body that is rated for it"
        raise InputError(what, field="max_depth", value=dive.max_depth, unit="m", remedy=remedy)
    check_number(max_piston_stroke, "max_piston_stroke", "m", above=0.0, most=math.inf)
    check_number(max_mass, "max_mass", "kg", above=0.0, most=math.inf)


def _score(evaluation: Evaluation, goal: Least) -> Array:
    """What is to be small, infinite for what does not do; ties go to the lighter."""
    first = evaluation.mass if goal == "mass" else evaluation.cycle_energy + 1e-6 * evaluation.mass
    return np.where(evaluation.feasible, first, np.inf)


def _best(batch: Batch, evaluation: Evaluation, score: Array) -> int:
    """The best; of those as good to 0.2 %, the one of the lowest supply and most of its voltage.

    Supply and winding hardly change mass and energy, but no driver runs well at a tenth of its
    voltage.
    """
    as_good = np.flatnonzero(score <= np.min(score) * _AS_GOOD)
    order = np.lexsort((evaluation.margins["voltage"][as_good], batch.supply[as_good, 0]))
    return int(as_good[order[0]])


def _pareto(evaluation: Evaluation) -> list[int]:
    """Candidates that no other beats in both mass and energy per cycle, lightest first."""
    order = np.lexsort((evaluation.cycle_energy, evaluation.mass))
    front: list[int] = []
    least = math.inf
    for index in order[evaluation.feasible[order]]:
        if evaluation.cycle_energy[index] < least * (1.0 - 1e-9):
            least = float(evaluation.cycle_energy[index])
            front.append(int(index))
    return front


def _choices(batch: Batch, evaluation: Evaluation, score: Array) -> list[Choice]:
    """The best drive with each part in it, or what is in the way of one."""
    members: dict[tuple[str, str], list[int]] = {}
    for index, combination in enumerate(batch.of):
        for what, name in combination.choices.items():
            members.setdefault((what, name), []).append(index)
    found = []
    for (what, name), indices in members.items():
        best = indices[int(np.argmin(score[indices]))]
        if math.isfinite(score[best]):
            found.append(Choice(what=what, name=name, index=best))
            continue
        nearest = indices[int(np.argmax(evaluation.worst[indices]))]
        missing = evaluation.tightest(nearest)
        margin = float(evaluation.margins[missing][nearest])
        found.append(Choice(what=what, name=name, index=-1, missing=missing, margin=margin))
    return found


def _dives(dive: Dive, what: str, deepest: float) -> list[Dive]:
    """Return the dive with multiples of one wish; depths below the cast are left out."""
    values = [getattr(dive, what) * factor for factor in _SWEPT[what]]
    if what == "cycles":
        values = [max(round(value), 1) for value in values]
    dives = [dataclasses.replace(dive, **{what: value}) for value in values]
    return [one for one in dives if what != "max_depth" or one.max_depth <= deepest]


def _sweep(what: str, dives: list[Dive], solve: Solve, batch: Batch, goal: Least) -> Sweep:
    """Return the best drive for each of the dives, which differ in one number."""
    rows = []
    for dive in dives:
        asked, evaluation = solve(dive)
        score = _score(evaluation, goal)
        best = int(np.argmin(score))
        mass, energy, drive = math.nan, math.nan, "none"
        if math.isfinite(score[best]):
            mass, energy = float(evaluation.mass[best]), float(evaluation.cycle_energy[best])
            drive = _brief(batch.of[best])
        rows.append((float(getattr(dive, what)), mass, energy, asked.stroke, drive))
    return Sweep(what, *(list(column) for column in zip(*rows, strict=True)))


def _brief(combination: Combination) -> str:
    """Return a drive in few words."""
    unnamed = ("kind", "winding", "battery")
    names = [name for what, name in combination.choices.items() if what not in unnamed]
    return ", ".join(name for name in names if name != "none")


def _none(batch: Batch, evaluation: Evaluation, dive: Dive) -> NoAnswerError:
    """Say which requirement is in the way of the nearest drive, and what leaving it out gives."""
    nearest = int(np.argmax(evaluation.worst))
    missing = evaluation.tightest(nearest)
    met = {name: margin >= 1.0 for name, margin in evaluation.margins.items()}
    failed = np.sum([~one for one in met.values()], axis=0)
    without = {name: failed == ~one for name, one in met.items()}
    helps = [f"{name} ({met.sum()})" for name, met in without.items() if met.any()]
    if helps:  # what lacks one thing is nearer than what lacks a little of several
        missing = max(without, key=lambda name: int(without[name].sum()))
        nearest = int(np.argmax(np.where(without[missing], evaluation.margins[missing], -np.inf)))
    short = float(evaluation.margins[missing][nearest])
    alone = "No single requirement left out would leave a drive"
    if helps:
        alone = f"Left out one at a time, these requirements leave drives: {', '.join(helps)}"
    return NoAnswerError(
        f"none of {len(batch.of):,} drives does {dive.max_depth:g} m: the nearest "
        f"({_brief(batch.of[nearest])}) has {100.0 * short:.0f} % of {REQUIREMENTS[missing]}. "
        f"{alone}. A longer turn time, a slower dive, less trim to cover or stronger parts "
        "(`parts=`) make it easier."
    )


_DEEPEST = 11_000.0  # m, there is no deeper water

_REPLACED = {"actuator", "water", "supply", "stroke", "trim_error", "loads", "driver"}
_REPLACED |= {"controller", "identified", "sensors"}
_EVACUATED = 2e4  # Pa
_YEAR = 365.25 * 86400.0  # s


def _sentences(found: Sizing) -> list[str]:
    """Return the answer: the drive, the stroke, what it takes, what limits it."""
    w, b, asked, dive = found.evaluation, found.best, found.asked, found.asked.dive
    c, depth = found.chosen, f"{dive.max_depth:g} m"
    named = ((what, name) for what, name in c.choices.items() if what != "kind")
    parts = ", ".join(name if name.startswith(what) else f"{what} {name}" for what, name in named)
    feasible = int(np.count_nonzero(w.feasible))
    power = dive.hotel + found.batch.driver.standby_power
    rest = power * dive.cycle_time + dive.surface_energy
    tight = w.tightest(b)
    volumes = asked.shares.items()
    shares = ", ".join(f"{name} {V * 1e6:.0f}" for name, V in volumes if V > 0.0)
    lines = [
        f"{feasible:,} of {len(found.batch.of):,} drives do {depth}; least {found.goal}: "
        f"{c.kind}, {parts}.",
        f"Stroke {asked.stroke * 1e6:.0f} cm3 ({shares} cm3), neutral at the surface "
        f"{-asked.lowest * 1e6:.0f} cm3 above the inner stop.",
        f"At {depth} ({asked.bottom_pressure / 1e5:.0f} bar) it moves "
        f"{w.rate[b] * 1e6 * 60.0:.1f} mL/min with {w.voltage[b]:.1f} V and {w.current[b]:.2f} A, "
        f"{w.energy_per_volume[b] * 1e-6:.1f} J/mL; at the voltage of a low battery it turns from "
        f"sinking to rising in {w.turn_time[b] / 60.0:.1f} min and {_stall(w.stall[b])}.",
        f"A cycle takes {w.cycle_energy[b]:.0f} J for the drive and {rest:.0f} J for the "
        f"rest; {dive.cycles} cycles need {w.battery_energy[b] / 3600.0:.0f} Wh of "
        f"{c.battery.name}, {rounded(float(w.battery_mass[b]), 2)} kg. Drive and battery weigh "
        f"{rounded(float(w.mass[b]), 2)} kg.",
        _battery(found),
        f"Tightest: {REQUIREMENTS[tight]}, {100.0 * (w.margins[tight][b] - 1.0):.0f} % to spare.",
    ]
    if np.ptp(found.column.density) == 0.0:
        more = "a sea that is lighter at its surface asks for more stroke (`cast=`)"
        lines.append(f"The water has one density at every depth: {more}.")
    if w.holding_power[b] > 0.0 and dive.park_time > 0.0:
        takes = f"{w.holding_power[b]:.2f} W, which is in the energy of a cycle"
        lines.append(f"The screw can be driven back: holding it at {depth} takes {takes}.")
    return lines


def _stall(depth: float) -> str:
    return f"stalls at {depth:.0f} m" if depth < _DEEPEST else "stalls nowhere in the sea"


def _battery(found: Sizing) -> str:
    """Return what becomes of the battery's energy, in a sentence."""
    spent, asked = _spent(found, found.best), found.asked
    years = asked.dive.cycles * asked.dive.cycle_time / _YEAR
    lasting = f"{years:.1f} years" if years >= 1.0 else f"{12.0 * years:.1f} months"

    def share(*names: str) -> str:
        return f"{100.0 * sum(spent[name] for name in names) / spent['carried']:.1f} %"

    return (
        f"Of the battery's energy {share('drawn')} is used "
        f"({share('driver_loss', 'driver_standby')} by the driver), {share('cold')} is not "
        f"available in water of {asked.coldest:.3g} degC, {share('self_discharged')} is "
        f"self-discharge in {lasting}, {share('reserve')} is the reserve "
        f"({100.0 * asked.dive.battery_reserve:g} % of what is available in that water), and "
        f"{share('unusable')} is unusable."
    )


def _spent(found: Sizing, index: int) -> dict[str, float]:
    spent = vars(found.evaluation.spent).items()
    return {name: float(energy[index]) for name, energy in spent if name != "life"}


def sized_vehicle(found: Sizing) -> Vehicle:
    """Return the body with the chosen drive, stroke and battery, ballasted for the sea's surface.

    It has no controller: gains of another drive would not fit.
    """
    asked, c, body = found.asked, found.chosen, found.body
    half = 0.5 * asked.stroke
    source = f"sized: least {found.goal} of {len(found.batch.of):,} combinations"
    mass = rounded(float(found.evaluation.battery_mass[found.best]), 2)
    shares = [f"{name} {volume * 1e6:.0f} cm3" for name, volume in asked.shares.items()]
    provenance = {k: x for k, x in body.provenance.items() if k.split(".")[0] not in _REPLACED}
    provenance |= {
        "actuator": f"{source}; {', '.join(c.choices.values())}",
        "supply": f"{source}; {c.battery.name}, {mass} kg",
        "loads": "asked for: hotel load and surface energy",
        "driver": found.parts.provenance.get("driver", "as in the list of parts"),
        "stroke": f"sized: {', '.join(shares)}",
        "water": f"at the surface: {found.column.source}",
        "trim_error": "sized: ballasted so that the stops lie evenly about 0",
    }
    surface = {name: float(getattr(found.column, name)[0]) for name in ("density", "temperature")}
    supply = Supply(
        voltage=c.supply,
        internal_resistance=c.supply * c.battery.resistance,
        capacity=float(found.evaluation.battery_energy[found.best]) * c.battery.usable,
        cold_share=c.battery.cold_share,
        self_discharge=c.battery.self_discharge,
    )
    hotel, surfacing = asked.dive.hotel, asked.dive.surface_energy
    load = Load(name="all but the drive", power=hotel, energy_per_surfacing=surfacing)
    exclude = {*_REPLACED, "provenance", "name", "description"}
    return Vehicle.model_validate(
        body.model_dump(exclude=exclude, exclude_unset=True)
        | {
            "schema_version": 1,
            "name": f"{body.name}-{asked.dive.max_depth:g}m",
            "description": f"{body.name} with a drive sized for {asked.dive.max_depth:g} m",
            "provenance": provenance,
            "water": body.water.model_copy(update=surface),
            "actuator": _as_built(found),
            "supply": supply,
            "driver": found.batch.driver,
            "stroke": Stroke(minimum=-half, maximum=half),
            "loads": (load,),
            "trim_error": -(asked.lowest + half),
        }
    )


def _as_built(found: Sizing) -> PumpAndValve | ElectromechanicalActuator:
    """Return the drive as a vehicle has it: a pump held at the wanted speed, behind a check valve.

    The hull is evacuated to 0.2 bar below the atmosphere, and the valve lets in the volume of a
    turn in the turn time under that alone: at the surface, where the sea does not help.
    """
    c, asked = found.chosen, found.asked
    actuator = c.actuator
    if isinstance(actuator, ElectromechanicalActuator):
        return actuator
    assert isinstance(c.drive, Hydraulic)
    n_h = actuator.drive.area_ratio
    speed = float(found.evaluation.speed[found.best])
    return PumpAndValve(
        pump=DatasheetPump(motor=actuator.motor, drive=actuator.drive, speed=speed),
        valve=Valve(flow=asked.rate / math.sqrt(_EVACUATED)),
        internal_pressure=ATMOSPHERIC_PRESSURE - _EVACUATED,
        leakage=min(c.drive.pump.at_rest, c.drive.pump.leakage) / n_h**2,
    )


_SWEEP = "what values mass_kg cycle_energy_J stroke_m3 drive"
# Arrays of an evaluation, by the name that a table has for each.
_NUMBERS = {
    "mass": "mass_kg",
    "battery_mass": "battery_mass_kg",
    "battery_energy": "battery_energy_J",
    "cycle_energy": "cycle_energy_J",
    "energy_per_volume": "energy_per_volume_J_per_m3",
    "rate": "rate_m3_per_s",
    "speed": "motor_speed_rad_per_s",
    "voltage": "voltage_V",
    "current": "current_A",
    "holding_power": "holding_power_W",
    "stall": "stall_depth_m",
    "turn_time": "turn_time_s",
}


def columns(found: Sizing) -> dict[str, list[Any]]:
    """Return every drive that does the dive, lightest first, as columns of a table [n]."""
    w = found.evaluation
    order = np.argsort(w.mass, kind="stable")
    order = order[w.feasible[order]]
    names = [found.batch.of[index].choices for index in order.tolist()]
    table: dict[str, list[Any]] = {key: [row.get(key, "") for row in names] for key in PARTS}
    numbers = {name: getattr(w, attribute) for attribute, name in _NUMBERS.items()}
    numbers["piston_travel_m"] = np.where(w.travel > 0.0, w.travel, np.nan)
    spent = {name: x for name, x in vars(w.spent).items() if name not in ("carried", "life")}
    numbers |= {f"battery_{name}_J": energy for name, energy in spent.items()}
    numbers |= {f"margin_{name.replace(' ', '_')}": margin for name, margin in w.margins.items()}
    return table | {name: values[order].tolist() for name, values in numbers.items()}


def _numbers(found: Sizing) -> dict[str, Any]:
    """Return the whole answer in SI units."""
    w, asked, dive = found.evaluation, found.asked, found.asked.dive.called

    def choice(one: Choice) -> dict[str, Any]:
        done = one.index >= 0
        return {
            **as_json(one, "what name"),
            "mass_kg": float(w.mass[one.index]) if done else math.nan,
            "cycle_energy_J": float(w.cycle_energy[one.index]) if done else math.nan,
            "missing": one.missing or None,
            "margin": None if done else one.margin,
        }

    return {
        "body": found.body.name,
        "water": found.column.source,
        "goal": found.goal,
        "sweeps": [as_json(sweep, _SWEEP) | {"what": dive(sweep.what)} for sweep in found.sweeps],
        **as_json(asked, "dive stroke_m3 stroke_shares_m3=shares pressure_Pa=bottom_pressure"),
        "neutral_above_inner_stop_m3": -asked.lowest,
        "least_rate_m3_s": asked.rate,
        "combinations": len(found.batch.of),
        "feasible": int(np.count_nonzero(w.feasible)),
        "chosen": _one(found, found.best),
        "pareto": [_one(found, index) for index in found.pareto],
        "choices": [choice(one) for one in found.choices],
        "sentences": found.sentences,
    }


def _one(found: Sizing, index: int) -> dict[str, Any]:
    w = found.evaluation
    numbers = {
        key: float(getattr(w, one)[index]) for one, key in _NUMBERS.items() if one != "speed"
    }
    return {
        "parts": found.batch.of[index].choices,
        **numbers,
        "battery": {f"{name}_J": energy for name, energy in _spent(found, index).items()},
        "margins": {name: float(margin[index]) for name, margin in w.margins.items()},
    }
