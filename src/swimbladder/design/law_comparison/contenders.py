"""Who is compared, and on what: the vehicle's own controller, and every law tuned fast and quiet.

What is flown is a table of scenarios, with depths that are those of the vehicle at hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

from swimbladder.control.law import Law
from swimbladder.control.records import leaves
from swimbladder.control.registry import LAWS, bind, law_parameters, own_law
from swimbladder.design.linear.depths import stall
from swimbladder.design.linear.pump_valve import pump_stall
from swimbladder.design.tuning import tune
from swimbladder.errors import InputError, NoAnswerError, SwimbladderError
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store
from swimbladder.physics.dynamics import body_plant, plant
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.units import rounded
from swimbladder.vehicle import Controller, Vehicle
from swimbladder.vehicle.schema import did_you_mean

LOW_SUPPLY = 0.9  # of the supply's voltage: what `tune` takes for a battery that is nearly empty
_REACH = 0.8  # of the depth at which stroke or supply end: where a vehicle is still to be steered
_UNSTATED = 10.0  # m, that a vehicle of no stated rating is taken to
_NEAR = (1.5, 0.3)  # m below the least depth, and at most this share of the range: as `tune` steps
_WATCHED = 20.0  # times the least time of a step, that it is watched at least
_HOUR = 3600.0
_SLOW = 0.03  # m/s


class Swell(NamedTuple):
    """Waves: significant height [m] and the periods [s] among which the energy is shared evenly."""

    height: float
    periods: tuple[float, ...]


class Scenario(NamedTuple):
    """One scenario, for any vehicle.

    at: near the least depth of the range, or at its greatest. size [m]: of a step, positive down,
    and at most `share` of the range; 0: a depth is held. duration [s] at least. counted [s]: since
    when errors and volumes count. supply [-]: of the vehicle's. drawn: vehicles from the region
    of what is not known, instead of the nominal one. walk [m3/s^0.5]: intensity of the neutral
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
    walk: float = 0.0


_SWELL = Swell(1.0, (8.0, 10.0, 12.0))
_WALK = 1e-6 / math.sqrt(_HOUR)  # 1 cm3 per root hour

SCENARIOS: tuple[Scenario, ...] = (
    Scenario("step-down", "a step of 1.5 m down", "shallow", 1.5),
    Scenario("step-up", "the same step up", "shallow", -1.5),
    Scenario("step-small", "a step of 0.5 m down", "shallow", 0.5, share=0.1),
    Scenario("step-small-up", "the same step up", "shallow", -0.5, share=0.1),
    Scenario("step-large", "a step of 5 m down", "shallow", 5.0, share=0.6),
    Scenario("step-large-up", "the same step up", "shallow", -5.0, share=0.6),
    Scenario("step-deep", "a step of 1.5 m down to the greatest depth", "deep", 1.5),
    Scenario("step-low-battery", f"1.5 m down with {100 * LOW_SUPPLY:.0f} % of the supply",
             "shallow", 1.5, supply=LOW_SUPPLY),
    Scenario("step-uncertain", "the same of vehicles drawn from the region of what is not known",
             "shallow", 1.5, supply=LOW_SUPPLY, drawn=True),
    Scenario("hold", "an hour at rest, with the noise of the sensor", "shallow",
             duration=_HOUR, counted=600.0),
    Scenario("hold-swell", f"the same in swell of {_SWELL.height:g} m", "shallow",
             duration=_HOUR, counted=600.0, swell=_SWELL),
    Scenario("hold-deep", "an hour at the greatest depth", "deep", duration=_HOUR, counted=600.0),
    Scenario("hold-drift", "two hours while the neutral volume walks 1 cm3 per root hour",
             "shallow", duration=2.0 * _HOUR, counted=1200.0, walk=_WALK),
)  # fmt: skip

FLOAT_SCENARIOS: tuple[Scenario, ...] = (
    Scenario("step-down", "a step of 100 m down", "shallow", 100.0),
    Scenario("step-up", "the same step up", "shallow", -100.0),
    Scenario("step-small", "a step of 30 m down", "shallow", 30.0),
    Scenario("step-small-up", "the same step up", "shallow", -30.0),
    Scenario("step-large", "a step of 400 m down", "shallow", 400.0, share=0.6),
    Scenario("step-large-up", "the same step up", "shallow", -400.0, share=0.6),
    Scenario("step-deep", "a step of 100 m down to the greatest depth", "deep", 100.0),
    Scenario("step-uncertain", "100 m down, of vehicles drawn from the region of what is not known",
             "shallow", 100.0, drawn=True),
    Scenario("hold", "six hours at rest, with the noise of the sensor", "shallow",
             duration=6.0 * _HOUR, counted=_HOUR),
    Scenario("hold-swell", f"the same in swell of {_SWELL.height:g} m", "shallow",
             duration=6.0 * _HOUR, counted=_HOUR, swell=_SWELL),
    Scenario("hold-deep", "six hours at the greatest depth", "deep",
             duration=6.0 * _HOUR, counted=_HOUR),
    Scenario("hold-drift", "half a day while the neutral volume walks 1 cm3 per root hour",
             "shallow", duration=12.0 * _HOUR, counted=_HOUR, walk=_WALK),
)  # fmt: skip
"""Of floats with pump and valve, whose laws sleep for minutes and keep a band of metres."""

BAND = 10.0  # m, within which such a float has come to its depth, as those of Argo count


def scenarios_of(vehicle: Vehicle) -> tuple[Scenario, ...]:
    """Return what is flown with a vehicle."""
    return FLOAT_SCENARIOS if vehicle.command == "volume change" else SCENARIOS


class Places(NamedTuple):
    """Between which depths a vehicle's laws are compared [m], and what ends the range."""

    least: float
    most: float
    words: str


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


def places(vehicle: Vehicle, given: tuple[float, float] | None = None) -> Places:
    """Return the range of depths: that given [m], or what rating, stroke and supply allow.

    It begins where the hull is under water.

    Raises InputError for no range, NoAnswerError where the vehicle does not reach what was given.
    """
    top = max(vehicle.hull.emergence_depth, 0.0)
    if vehicle.command == "volume change":
        top = max(top, 2.0 * BAND)  # near the surface its processor acts, not the law
    reach, why = _reach(vehicle)
    if given is None:
        most, words = (
            _REACH * reach,
            f"down to {100.0 * _REACH:.0f} % of {rounded(reach, 3)} m, where {why}",
        )
        if vehicle.hull.depth_limit is None and most > top + _UNSTATED:
            most = top + _UNSTATED
            words = f"down to {most:g} m, as the vehicle states no rating (--depth)"
        if most <= top:
            raise NoAnswerError(
                f"there is no depth to compare laws at: {why} at {rounded(reach, 3)} m"
            )
        return Places(top, most, words)
    least, most = max(given[0], top), given[1]
    if not (given[0] >= 0.0 and least < most < math.inf):
        raise InputError(
            "no range of depths under water", field="--depth", value=f"{given[0]:g}:{most:g}",
            unit="m", remedy="Give the least and the greatest, like 0:10",
        )  # fmt: skip
    if most >= reach:
        raise NoAnswerError(
            f"the vehicle cannot be held at {most:g} m: at {reach:.4g} m {why}. Compare laws for "
            "less depth, or give it more stroke or a higher supply"
        )
    return Places(least, most, "as given")


def _reach(vehicle: Vehicle) -> tuple[float, str]:
    """Return the depth [m] that ends the vehicle's range, and what happens there."""
    floats = vehicle.command == "volume change"
    p = body_plant(vehicle) if floats else plant(vehicle)
    found = [(math.inf, "")]
    if vehicle.hull.depth_limit is not None:
        found.append((vehicle.hull.depth_limit, "its rating ends"))
    if p.psi != 0.0:
        end = p.V_max if p.psi > 0.0 else p.V_min
        found.append(((end - p.V_0) / p.psi, "its neutral volume leaves the stroke"))
    if vehicle.voltage_driven:
        weak = p._replace(supply=LOW_SUPPLY * p.supply)
        held = stall(weak, depth=0.0, depth_limit=None).holding_depth
        found.append((held, f"the motor stalls with {weak.supply:.3g} V"))
    if floats:
        found.append((pump_stall(vehicle, depth=0.0).holding_depth, "the pump stalls"))
    return min(found)


def place(scenario: Scenario, vehicle: Vehicle, where: Places) -> Placed:
    """Return a scenario with depths and duration for a vehicle.

    The duration is at least 20 times the time that the step takes without drag and psi, and at the
    speed that half of the room in the stroke keeps; of a float with pump and valve two hours beyond
    the way at 3 cm/s.
    """
    span = where.most - where.least
    size = min(abs(scenario.size), scenario.share * span)
    shallow = where.least + min(_NEAR[0], _NEAR[1] * span)
    near, far = (shallow, shallow + size) if scenario.at == "shallow" else (
        where.most - size, where.most,
    )  # fmt: skip
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


def choose_laws(vehicle: Vehicle, wanted: Sequence[str] | None) -> tuple[list[str], dict[str, str]]:
    """Return the laws to be tuned, and why others cannot be; raises InputError for no law's name.

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
) -> Contender | str:  # fmt: skip
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
        return str(kept["why"])
    h = float(kept["sample_time"])
    return Contender(
        law=law, tuning=goal, sample_time=h,
        parameters=law_parameters(law, kept["numbers"], sample_time=h),
    )  # fmt: skip
