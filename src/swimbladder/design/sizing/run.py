"""Search all combinations of parts for the one that does the dive with the least mass or energy."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.sizing.candidates import Batch, Combination, combinations
from swimbladder.design.sizing.evaluation import REQUIREMENTS, Evaluation, evaluate
from swimbladder.design.sizing.parts import Parts, load_parts
from swimbladder.design.sizing.requirements import Dive, Requirements, requirements
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.physics.hull import weight_mass
from swimbladder.physics.seawater import Column, uniform_column
from swimbladder.vehicle import Vehicle

Least = Literal["mass", "energy"]
_AS_GOOD = 1.002
_ROOM = 0.5  # of the body: what the drive lets in has to find room inside, beside all else
# degC where no cast says: water is densest there and fills deep lakes; the oceans have 2 to 5 degC
# at 1000 m (Talley et al., "Descriptive Physical Oceanography", 6th ed. 2011, ch. 4)
_COLDEST = 4.0
_SWEPT = {
    "depth": (0.5, 0.75, 1.0, 1.25, 1.5, 2.0),
    "turn_time": (0.25, 0.5, 1.0, 2.0, 4.0),
    "speed": (0.5, 0.75, 1.0, 1.5, 2.0),
    "trim": (0.0, 0.5, 1.0, 2.0, 4.0),
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


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sweep:
    """The best drive as one wish changes: values in SI, mass [kg] and energy [J] NaN for none."""

    what: str
    values: list[float]
    mass: list[float]
    cycle_energy: list[float]
    stroke: list[float]
    drive: list[str]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sizing:
    """All candidates, weighed, the best of them, and what each wish and each part costs."""

    body: Vehicle
    column: Column
    asked: Requirements
    parts: Parts
    least: Least
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


def size(
    body: Vehicle,
    dive: Dive,
    *,
    column: Column | None = None,
    parts: Parts | None = None,
    least: Least = "mass",
    longest_travel: float = 0.6,
    largest_mass: float = math.inf,
    sweeps: bool = True,
    advance: Callable[[float], None] | None = None,
) -> Sizing:
    """Return the drive and battery that do a dive with the least `least`, of all that parts make.

    body: its hull, mass and drag are used, its drive and stroke are not. column: the water; that
    of the body where not given, with a battery at 4 degC. longest_travel of a piston [m],
    largest_mass of drive and battery [kg], which the body bounds too, as its volume does the
    stroke. Raises NoAnswerError where no combination will do: which
    requirement is in the way, and by how much.
    """
    parts = load_parts() if parts is None else parts
    if column is None and dive.coldest is None:
        dive = dataclasses.replace(dive, coldest=_COLDEST)
    if least not in get_args(Least):
        raise InputError(
            "not something to be least", field="least", value=least,
            remedy="Allowed: mass, energy",
        )  # fmt: skip
    _check(body, dive, longest_travel, largest_mass)
    batch = combinations(parts, body.water)

    def solve(swept: Dive) -> tuple[Requirements, Evaluation]:
        water = uniform_column(body.water, swept.depth * 1.001) if column is None else column
        asked = requirements(body, water, swept)
        found = evaluate(
            batch, asked, body.water, longest_travel=longest_travel,
            largest_mass=min(largest_mass, weight_mass(body)),
            largest_stroke=_ROOM * body.hull.displaced_volume,
        )  # fmt: skip
        return asked, found

    asked, evaluation = solve(dive)
    if advance is not None:
        advance(1.0)
    score = _score(evaluation, least)
    if not np.any(evaluation.feasible):
        raise _none(batch, evaluation, dive)
    best = _best(batch, evaluation, score)
    swept = []
    for what, factors in _SWEPT.items() if sweeps else ():
        swept.append(_sweep(what, factors, dive, column, solve, batch, least))
        if advance is not None:
            advance(1.0)
    return Sizing(
        body=body,
        column=uniform_column(body.water, dive.depth * 1.001) if column is None else column,
        asked=asked,
        parts=parts,
        least=least,
        batch=batch,
        evaluation=evaluation,
        best=best,
        pareto=_pareto(evaluation),
        choices=_choices(batch, evaluation, score),
        sweeps=swept,
    )


def _check(body: Vehicle, dive: Dive, longest_travel: float, largest_mass: float) -> None:
    limit = body.hull.depth_limit
    if limit is not None and dive.depth > limit:
        raise InputError(
            f"the body {body.name!r} is rated for {limit:g} m (hull.depth_limit)",
            field="depth", value=dive.depth, unit="m",
            remedy="Ask for less, or size the drive of a body that is rated for it",
        )  # fmt: skip
    for name, value, unit in (
        ("longest_travel", longest_travel, "m"), ("largest_mass", largest_mass, "kg"),
    ):  # fmt: skip
        if not value > 0.0:
            raise InputError(
                "it has to be above 0", field=name, value=value, unit=unit,
                remedy="Check the number and its unit",
            )  # fmt: skip


def _score(evaluation: Evaluation, least: Least) -> NDArray[np.float64]:
    """What is to be small, infinite for what does not do; ties go to the lighter."""
    first = evaluation.mass if least == "mass" else evaluation.cycle_energy + 1e-6 * evaluation.mass
    return np.where(evaluation.feasible, first, np.inf)


def _best(batch: Batch, evaluation: Evaluation, score: NDArray[np.float64]) -> int:
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


def _choices(batch: Batch, evaluation: Evaluation, score: NDArray[np.float64]) -> list[Choice]:
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
        missing = min(evaluation.margins, key=lambda m: evaluation.margins[m][nearest])
        margin = float(evaluation.margins[missing][nearest])
        found.append(Choice(what=what, name=name, index=-1, missing=missing, margin=margin))
    return found


def _sweep(
    what: str,
    factors: tuple[float, ...],
    dive: Dive,
    column: Column | None,
    solve: Callable[[Dive], tuple[Requirements, Evaluation]],
    batch: Batch,
    least: Least,
) -> Sweep:
    """Return the best drive for multiples of one wish; depths below the cast are left out."""
    sweep = Sweep(what=what, values=[], mass=[], cycle_energy=[], stroke=[], drive=[])
    for factor in factors:
        value = getattr(dive, what) * factor
        value = max(round(value), 1) if what == "cycles" else value
        if what == "depth" and column is not None and value > column.deepest:
            continue
        asked, evaluation = solve(dataclasses.replace(dive, **{what: value}))
        score = _score(evaluation, least)
        best = int(np.argmin(score))
        done = math.isfinite(score[best])
        sweep.values.append(float(value))
        sweep.stroke.append(asked.stroke)
        sweep.mass.append(float(evaluation.mass[best]) if done else math.nan)
        sweep.cycle_energy.append(float(evaluation.cycle_energy[best]) if done else math.nan)
        sweep.drive.append(_brief(batch.of[best]) if done else "none")
    return sweep


def _brief(combination: Combination) -> str:
    """Return a drive in few words."""
    unnamed = ("kind", "winding", "battery")
    names = [name for what, name in combination.choices.items() if what not in unnamed]
    return ", ".join(name for name in names if name != "none")


def _none(batch: Batch, evaluation: Evaluation, dive: Dive) -> NoAnswerError:
    """Say which requirement is in the way of the nearest drive, and what leaving it out gives."""
    nearest = int(np.argmax(evaluation.worst))
    missing = min(evaluation.margins, key=lambda m: evaluation.margins[m][nearest])
    without = {}
    for name in REQUIREMENTS:
        others = np.stack([m for other, m in evaluation.margins.items() if other != name])
        without[name] = np.min(others, axis=0) >= 1.0
    helps = [f"{name} ({met.sum()})" for name, met in without.items() if met.any()]
    if helps:  # what lacks one thing is nearer than what lacks a little of several
        missing = max(without, key=lambda name: int(without[name].sum()))
        nearest = int(np.argmax(np.where(without[missing], evaluation.margins[missing], -np.inf)))
    short = float(evaluation.margins[missing][nearest])
    alone = (
        "Left out one at a time, these requirements leave drives: " + ", ".join(helps)
        if helps
        else "No single requirement left out would leave a drive"
    )
    return NoAnswerError(
        f"none of {len(batch.of):,} drives does {dive.depth:g} m: the nearest "
        f"({_brief(batch.of[nearest])}) has {100.0 * short:.0f} % of {REQUIREMENTS[missing]}. "
        f"{alone}. A longer turn time, a slower dive, less trim to cover or stronger parts "
        "(--parts) make it easier."
    )
