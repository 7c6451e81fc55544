"""Who is compared: the vehicle's own controller, and every law tuned fast and tuned quiet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from swimbladder.control.law import Law
from swimbladder.control.records import leaves
from swimbladder.control.registry import LAWS, bind, law_parameters, own_law
from swimbladder.design.law_comparison.scenarios import LOW_SUPPLY, Places
from swimbladder.design.tuning import tune
from swimbladder.errors import InputError, SwimbladderError
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.vehicle import Controller, Vehicle
from swimbladder.vehicle.schema import did_you_mean

GOALS = ("fast", "quiet")  # fast for steps, quiet for holding
IN_FILE = "as in the file"
PAPER = "the paper's"
_TRIALS = 40  # runs of every trial of the tuner
_PAPERS = "feup-em"  # the preset with the paper's vehicle and gains


@dataclass(frozen=True, kw_only=True)
class Contender:
    """A law with gains, and where they come from: a goal of `tune`, the file, the paper."""

    law: Law
    tuning: str
    parameters: Any
    sample_time: float  # s

    @property
    def name(self) -> str:
        """What a row is called."""
        return f"{self.law.name}, {self.tuning}"

    @property
    def slug(self) -> str:
        """What a file is called."""
        return self.name.replace(", ", "-").replace("'", "").replace(" ", "-")

    def controller(self) -> Controller:
        """Return it as a vehicle's [controller]."""
        numbers = {n: v for n, v in leaves(self.parameters).items() if n != "S_p"}
        return Controller(law=self.law.name, sample_time=self.sample_time, parameters=numbers)


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A law that is not compared, and why."""

    name: str
    why: str


def choose_laws(vehicle: Vehicle, wanted: Sequence[str] | None) -> tuple[list[str], list[LeftOut]]:
    """Return the laws to be tuned, and those that cannot be; raises InputError for no law's name.

    wanted: names of laws; all where not given.
    """
    for name in wanted or ():
        if name not in LAWS:
            raise InputError(
                "no such law", field="--laws", value=name,
                remedy=f"{did_you_mean(name, LAWS.names())}Choose from {', '.join(LAWS.names())}",
            )  # fmt: skip
    command = vehicle.command
    kept = []
    out = [] if wanted else [LeftOut(name=n, why=why) for n, why in LAWS.broken().items()]
    for name in dict.fromkeys(wanted or LAWS):
        law = LAWS[name]
        if law.command != command:
            why = f"it commands a {law.command}, and the vehicle's actuator takes a {command}"
            out.append(LeftOut(name=name, why=why))
        elif law.recipe is None:
            why = "it is not tuned; the vehicle file's own gains, if any, are compared"
            out.append(LeftOut(name=name, why=why))
        else:
            kept.append(name)
    return kept, out


def own(vehicle: Vehicle) -> list[Contender]:
    """Return the vehicle's own controller, where it has one, and the paper's for its vehicle.

    Only the paper's where they are the same.
    """
    found: list[Contender] = []
    if vehicle.controller is not None:
        own_law(vehicle, sampled=False)
    paper = load_vehicle(_PAPERS)
    papers = all(
        getattr(vehicle, part) == getattr(paper, part)
        for part in ("actuator", "stroke", "hull", "motion", "water")
    )
    for controller, tuning in (
        (vehicle.controller, IN_FILE), (paper.controller if papers else None, PAPER),
    ):  # fmt: skip
        if controller is None:
            continue
        law, numbers = bind(controller)
        one = Contender(
            law=law, tuning=tuning, parameters=numbers, sample_time=controller.sample_time
        )
        if found and (one.law, one.parameters) == (found[0].law, found[0].parameters):
            found[0] = replace(one, tuning=PAPER)
        else:
            found.append(one)
    return found


def tuned(
    vehicle: Vehicle, name: str, goal: str, *, where: Places, step: tuple[float, float],
    sample_time: float | None, store: Store, advance: Callable[[float], None],
    column: Column | None = None,
) -> Contender | LeftOut:  # fmt: skip
    """Return a law tuned for a goal over the range of depths, or why it cannot be.

    step [m]: of the tuner's trials. column: their water. advance: told the share of the work done.
    """
    least = None if vehicle.supply is None else LOW_SUPPLY * vehicle.supply.voltage
    law = LAWS[name]
    inputs = (
        "tune", vehicle, name, source_of(law), goal, where.least, where.most, step, sample_time,
        least, column,
    )  # fmt: skip
    kept = store.read(*inputs)
    if kept is None:
        told = 0.0

        def tell(share: float) -> None:
            nonlocal told
            told += share
            advance(share)

        try:
            found = tune(
                vehicle, law=name, goal=goal, depths=(where.least, where.most), step=step,
                sample_time=sample_time, supply=least, runs=_TRIALS, advance=tell,
                column=column,
            )  # fmt: skip
            numbers = {n: v for n, v in leaves(found.parameters).items() if n != "S_p"}
            kept = {"numbers": numbers, "sample_time": found.sample_time}
        except SwimbladderError as error:
            kept = {"why": str(error)}
        store.write(kept, *inputs)
        advance(max(1.0 - told, 0.0))
    else:
        advance(1.0)
    if "why" in kept:
        return LeftOut(name=f"{name}, {goal}", why=str(kept["why"]))
    h = float(kept["sample_time"])
    return Contender(
        law=law, tuning=goal, sample_time=h,
        parameters=law_parameters(law, kept["numbers"], sample_time=h),
    )  # fmt: skip
