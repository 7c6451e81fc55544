"""Who is compared, and on what: the vehicle's own controller, and every law tuned fast and quiet.

What is flown is a table of scenarios, with depths that are those of the vehicle at hand.
"""

import math
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any, Literal, NamedTuple

from pydantic import TypeAdapter

from swimbladder.control.law import Law
from swimbladder.control.registry import LAWS, bind, controller_of, own_law
from swimbladder.design.tuning.run import Asked, Places, search_gains
from swimbladder.design.tuning.trial import usual_step
from swimbladder.errors import SwimbladderError
from swimbladder.io.config import load_vehicle
from swimbladder.io.progress import Advance
from swimbladder.jobs import Store
from swimbladder.physics.dynamics import plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.sim.closed_loop.water import Swell
from swimbladder.vehicle import Controller, Vehicle
from swimbladder.vehicle.schema import no_such

_WATCHED = 20.0  # times the least time of a step, that it is watched at least
_HOUR = 3600.0  # s
_SLOW = 0.03  # m/s


class Scenario(NamedTuple):
    """One scenario, for any vehicle.

    at: near the least depth of the range, or at its greatest. size [m]: of a step, positive down,
    and at most `share` of the range; 0: a depth is held. duration [s] at least. counted [s]: since
    when errors and volumes count. supply [-]: of the vehicle's. drawn: vehicles from the region
    of what is not known, instead of the nominal one. drift [m3/s^0.5]: intensity of the neutral
    volume's random walk.
    """

    name: str
    words: str
    at: Literal["shallow", "deep"]
    size: float = 0.0
    share: float = 0.4
    duration: float = 900.0
    counted: float = 0.0
    supply: float = 1.0
    drawn: bool = False
    swell: Swell | None = None
    drift: float = 0.0


def _scenarios() -> Iterator[tuple[Scenario, ...]]:
    """Yield the scenarios of motors and positioners, then those of floats."""
    text = resources.files(__package__).joinpath("scenarios.toml").read_text(encoding="utf-8")
    for table in tomllib.loads(text).values():
        yield TypeAdapter(tuple[Scenario, ...]).validate_python(table)


SCENARIOS, FLOAT_SCENARIOS = _scenarios()


def scenarios_of(vehicle: Vehicle) -> tuple[Scenario, ...]:
    """Return what is flown with a vehicle."""
    return FLOAT_SCENARIOS if vehicle.command == "volume change" else SCENARIOS


class Placed(NamedTuple):
    """A scenario with the depths [m] and the duration [s] that a vehicle gives it."""

    scenario: Scenario
    start: float
    target: float
    duration: float

    @property
    def is_step(self) -> bool:
        """Whether the depth is to change."""
        return self.start != self.target


def place(scenario: Scenario, vehicle: Vehicle, where: Places) -> Placed:
    """Return a scenario with depths and duration for a vehicle.

    The duration is at least 20 times the time that the step takes without drag and psi, and at the
    speed that half of the room in the stroke keeps; of a float with pump and valve two hours beyond
    the way at 3 cm/s.
    """
    span = where.most - where.least
    size = min(abs(scenario.size), scenario.share * span)
    shallow, _ = usual_step(where.least, where.most)
    near = shallow if scenario.at == "shallow" else where.most - size
    far = near + size if scenario.at == "shallow" else where.most
    start, target = (far, near) if scenario.size < 0.0 else (near, far)
    if size == 0.0:
        return Placed(scenario, start, target, scenario.duration)
    if vehicle.command == "volume change":
        return Placed(scenario, start, target, size / _SLOW + 2.0 * _HOUR)
    p = plant(vehicle)
    rate = p.rate if p.positioner else p.gain * p.supply
    pull = 0.5 * p.a_b * min(p.V_max - p.V_0, p.V_0 - p.V_min)
    drag = max(p.d_l, p.d_b)
    root = drag + math.sqrt(drag * drag + 4.0 * p.d_t * pull)
    slow = size * root / (2.0 * pull)
    least = math.cbrt(32.0 * size / (p.a_b * rate)) + slow
    return Placed(scenario, start, target, max(scenario.duration, _WATCHED * least))


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
    def supervised(self) -> bool:
        """Whether it is flown under the supervisor, as flashed: all but the paper's."""
        return self.tuning != PAPER

    @property
    def name(self) -> str:
        """What a row is called."""
        return f"{self.law.name}, {self.tuning}"

    def controller(self) -> Controller:
        """Return it as a vehicle's [controller]."""
        return controller_of(self.law, self.parameters, sample_time=self.sample_time)


def choose_laws(vehicle: Vehicle, wanted: Sequence[str] | None) -> tuple[list[str], dict[str, str]]:
    """Return the laws to be tuned, and why others cannot be; raises InputError for no law's name.

    wanted: names of laws; all where not given.
    """
    for name in wanted or ():
        if name not in LAWS:
            raise no_such("no such law", name, LAWS.names(), field="laws")
    command = vehicle.command
    kept = []
    out = {} if wanted else dict(LAWS.broken())
    for name in dict.fromkeys(wanted or LAWS):
        law = LAWS[name]
        if law.command != command:
            out[name] = f"it commands a {law.command}, and the vehicle's actuator takes a {command}"
        elif law.recipe is None:
            out[name] = "it is not tuned; the vehicle file's own gains, if any, are compared"
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
    parts = ("actuator", "stroke", "hull", "motion", "water")
    papers = all(getattr(vehicle, part) == getattr(paper, part) for part in parts)
    published = paper.controller if papers else None
    for controller, tuning in ((vehicle.controller, IN_FILE), (published, PAPER)):
        if controller is None:
            continue
        one = _bound(controller, tuning)
        if found and (one.law, one.parameters) == (found[0].law, found[0].parameters):
            found[0] = replace(one, tuning=PAPER)
        else:
            found.append(one)
    return found


def tuner(
    vehicle: Vehicle,
    where: Places,
    *,
    sample_time: float | None,
    column: Column | None,
    supervised: bool,
) -> Asked:
    """Return what the laws of a vehicle are tuned for over a range of depths."""
    first = place(scenarios_of(vehicle)[0], vehicle, where)
    depths = (where.least, where.most)
    return Asked(
        depth_range=depths,
        step=(first.start, first.target),
        sample_time=sample_time,
        runs=_TRIALS,
        cast=column,
        supervised=supervised,
    )


def tuned(
    vehicle: Vehicle, name: str, goal: str, how: Asked, store: Store, advance: Advance
) -> Contender | str:
    """Return a law tuned for a goal, or why it cannot be; advance: called with the share done."""
    law, left = LAWS[name], 1.0

    def progress(share: float) -> None:
        nonlocal left
        left -= share
        advance(share)

    def controller() -> dict[str, Any]:
        """Return the tuned controller's fields, ready to be kept; or why there is none."""
        try:
            found = search_gains(vehicle, name, how._replace(goal=goal), progress).answer
            assert found.result_vehicle.controller is not None
            return found.result_vehicle.controller.model_dump()
        except SwimbladderError as error:
            return {"why": str(error)}

    kept = store.get(controller, "tune", vehicle, name, source_of(law), goal, how)
    advance(max(left, 0.0))
    return str(kept["why"]) if "why" in kept else _bound(Controller(**kept), goal)


def _bound(controller: Controller, tuning: str) -> Contender:
    law, numbers = bind(controller)
    return Contender(law=law, tuning=tuning, parameters=numbers, sample_time=controller.sample_time)
