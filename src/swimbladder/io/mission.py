"""What a vehicle is asked to do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field

from swimbladder.errors import InputError, check_number
from swimbladder.physics.seawater import WaterMotion
from swimbladder.vehicle import LawNumbers, Parameters, Unit, Vehicle
from swimbladder.vehicle.schema import refusal

_MOST_PHASES = 50  # whether each was missed is kept as a bit of a double's 53
_DEEPEST = 11_000.0  # m; Challenger Deep: 10,935 m
_START, _TARGET, _DURATION = 1.5, 3.0, 400.0  # m, m and s of a step
_DIVE, _WAY = 500.0, 250.0  # m, and m in an hour, of a float with pump and valve
_SHOWN = 6  # phases or set-points in the words for a mission


class Setpoint(Parameters):
    """A set-point."""

    time: Annotated[float, Unit("s"), Field(ge=0.0)]
    """when it begins to hold"""
    depth: Annotated[float, Unit("m")]
    """target"""


class Phase(Parameters):
    """A phase of a cycle.

    descend and profile end at their depth. park and hold stay at theirs: park corrects seldom and
    lasts from its begin, hold from its arrival. surface comes up and floats.
    """

    kind: Literal["descend", "park", "profile", "hold", "surface"]
    """of phase"""
    name: str = ""
    """in results; default: its kind"""
    depth: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """target; surface has none"""
    tolerance: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """distance that counts as arrived; default: that of the law `rate`, else 10 m"""
    speed: Annotated[float, Unit("m/s"), Field(gt=0.0, le=5.0)] | None = None
    """of a sampled law's set-point (default: it jumps), or of the mission's own rule (default: that
    of the law `rate`, else 10 cm/s)"""
    duration: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """of park, hold and surface"""
    timeout: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """to arrive, then the next phase begins (after surface the mission ends); default: twice the
    way and an hour; park has none"""
    check_interval: Annotated[float, Unit("s"), Field(ge=0.1)] | None = None
    """between samples of depth and speed; default: park 10 min, else that of the law `rate`, or 60
    s"""
    law: str | None = None
    """default: the controller's; `rate` in every phase: the mission's own rule"""
    parameters: LawNumbers = Field(default_factory=dict)
    """of that law; default: the controller's, if it has the same law"""
    sample_time: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """of that law; default: the controller's"""
    grounding: Literal["next", "stay", "shift"] | None = None
    """go on, stay, or shift the depth above the bottom; default: park and hold stay"""
    rest_band: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """distance within which law and actuator rest in park or hold; default: never"""

    @property
    def title(self) -> str:
        """What the phase is called."""
        return self.name or self.kind

    def check(self) -> None:
        """Refuse fields that do not go together."""
        stays = self.kind in ("park", "hold", "surface")
        for name, wanted in (("depth", self.kind != "surface"), ("duration", stays)):
            given = getattr(self, name) is not None
            if wanted and not given:
                raise refusal(f"a phase {self.kind!r} needs it", f"Add a line {name} = ...", name)
            if given and not wanted:
                raise refusal(f"a phase {self.kind!r} has none", "Leave the line out", name)
        if self.kind == "park" and self.timeout is not None:
            what = "a phase 'park' has none: it lasts for its duration, the way there included"
            other = 'write kind = "hold", which lasts from its arrival'
            remedy = f"Leave the line out, lengthen the duration, or {other}"
            raise refusal(what, remedy, "timeout")
        if self.rest_band is not None and self.kind not in ("park", "hold"):
            raise refusal(f"a phase {self.kind!r} has none", "Leave the line out", "rest_band")
        if self.rest_band is not None and self.rest_band > (self.tolerance or math.inf):
            what = f"it is wider than the tolerance of {self.tolerance:g} m"
            raise refusal(what, "Give less than the tolerance", "rest_band")
        if self.grounding is not None and self.kind not in ("park", "hold"):
            what = f"a phase {self.kind!r} has none: grounded, it goes on with the next"
            raise refusal(what, "Leave the line out", "grounding")
        if self.depth is not None and (self.tolerance or 0.0) >= self.depth:
            what = f"it reaches the surface from {self.depth:g} m"
            raise refusal(what, "Give less than the phase's depth", "tolerance")


class Safety(Parameters):
    """Limits of a mission."""

    deepest: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """below it all volume is moved out and the mission ends; default: the depth limit"""
    stroke: Annotated[float, Unit(""), Field(ge=0.0, lt=1.0)] = 0.05
    """share to be left at either end"""
    battery: Annotated[float, Unit(""), Field(ge=0.0, lt=1.0)] = 0.1
    """share below which no cycle begins"""


class Grounding(Parameters):
    """Detection of the bottom, and what follows.

    A vehicle is grounded if its depth does not change for a time after it let in a volume, or all
    that it can. With this table phases may be deeper than bottom_depth.
    """

    volume: Annotated[float, Unit("m3"), Field(gt=0.0)] | None = None
    """let in without a change of depth; default: a tenth of the stroke"""
    change: Annotated[float, Unit("m"), Field(gt=0.0)] = 1.0
    """of depth that counts"""
    time: Annotated[float, Unit("s"), Field(ge=0.0)] = 60.0
    """without a change after that"""
    shift: Annotated[float, Unit("m"), Field(gt=0.0)] = 100.0
    """above the bottom; too near the surface a phase stays"""
    least_depth: Annotated[float, Unit("m"), Field(ge=0.0)] = 0.0
    """of the bottom, from which phases shift; shallower they stay"""


class Ice(Parameters):
    """Avoidance of ice at the surface by the temperature on the way up.

    If the median temperature in a layer is that of ice, the surface phase ends at the top of the
    layer, and the next phase begins.
    """

    temperature: Annotated[float, Unit("degC"), Field(ge=-3.0, le=40.0)] = -1.79
    """median at or below which there may be ice"""
    start_depth: Annotated[float, Unit("m"), Field(gt=0.0)] = 50.0
    """lower edge of the layer"""
    stop_depth: Annotated[float, Unit("m"), Field(gt=0.0)] = 20.0
    """upper edge, where it turns back"""
    wait: Annotated[float, Unit("s"), Field(ge=0.0)] = 0.0
    """after ice; until then it turns back in any case"""
    longest: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """without surfacing, then it surfaces in any case; default: never"""

    def check(self) -> None:
        """Refuse edges that do not go together."""
        if self.stop_depth >= self.start_depth:
            what = f"it is not above the start_depth of {self.start_depth:g} m"
            raise refusal(what, "Give a lesser depth: it measures on its way up", "stop_depth")


class Mission(Parameters):
    """What a vehicle is asked to do: set-points (`simulate`), or phases in cycles (`mission`)."""

    schema_version: Literal[1] = 1
    """of this format"""
    name: str = ""
    """of the mission"""
    description: str = ""
    """one sentence"""
    start_depth: Annotated[float, Unit("m")] = 0.0
    """at rest; required with set-points; with phases 0 is afloat, all volume out"""
    start_temperature: Annotated[float, Unit("degC"), Field(ge=-40.0, le=80.0)] | None = None
    """of the hull, with a `thermal_time_constant`; default: the water's"""
    bottom_depth: Annotated[float, Unit("m"), Field(gt=0.0)] | None = None
    """default: none"""
    duration: Annotated[float, Unit("s"), Field(gt=0.0)] | None = None
    """required with set-points; with phases no cycle begins after it"""
    latitude: Annotated[float, Unit("deg"), Field(ge=-90.0, le=90.0)] | None = None
    """north positive, for a cast without latitude"""
    cycles: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """default: once, or for `duration`"""
    setpoints: tuple[Setpoint, ...] = ()
    """set-points in order of time, the first at 0"""
    phases: tuple[Phase, ...] = ()
    """what a cycle is made of, in order"""
    safety: Safety = Safety()
    """what a mission must not come near"""
    grounding: Grounding | None = None
    """detection of the bottom; default: none"""
    ice: Ice | None = None
    """how it avoids ice; not given: it does not"""
    water_motion: WaterMotion = WaterMotion()
    """waves that move the water"""

    def __repr__(self) -> str:
        """Return its phases or set-points in some words."""
        steps = [f"{p.title} ({p.depth or 0.0:g} m)" for p in self.phases]
        steps += [f"{point.depth:g} m at {point.time:g} s" for point in self.setpoints]
        shown = steps if len(steps) <= _SHOWN else [*steps[:_SHOWN], f"{len(steps) - _SHOWN} more"]
        often = f", {self.cycles} cycles" if self.cycles else ""
        return f"Mission({self.name!r}: {', '.join(shown)}{often})"

    __str__ = __repr__

    @property
    def bottom(self) -> float:
        """Depth of the bottom [m], infinite without one."""
        return math.inf if self.bottom_depth is None else self.bottom_depth

    def over(self, bottom: float) -> Mission:
        """Return the mission over a bottom at another depth [m]; raises InputError as a file's."""
        return Mission(**{**self.model_dump(exclude_unset=True), "bottom_depth": bottom})

    def limited(self, *, cycles: float | None = None, duration: float | None = None) -> Mission:
        """Return the mission with other cycles, and a time after which none begins [s], if given.

        Raises InputError for what they cannot be.
        """
        if cycles is not None and not (cycles >= 1 and cycles == math.floor(cycles)):
            what = "it must be a whole number of at least 1"
            remedy = "Give how often the phases are repeated"
            raise InputError(what, field="cycles", value=cycles, remedy=remedy)
        check_number(duration, "duration", "s", above=0.0, most=math.inf)
        asked = {"cycles": cycles, "duration": duration}
        return self.model_copy(update={k: v for k, v in asked.items() if v is not None})

    def reached(self, phase: Phase) -> float:
        """Return the depth that a phase comes to [m]: its own, or the bottom; 0 of a surface."""
        return min(phase.depth or 0.0, self.bottom)

    @property
    def pairs(self) -> list[tuple[float, float]]:
        """The set-points as (time [s], depth [m]); raises InputError where it has phases."""
        if not self.setpoints:
            what = "the mission has phases, and this takes set-points"
            remedy = "Fly it with `swimbladder mission`, or write [[setpoints]]"
            raise InputError(what, field="phases", remedy=remedy)
        return [(point.time, point.depth) for point in self.setpoints]

    @property
    def titles(self) -> list[str]:
        """What the phases are called; one whose name others have too with its place from 1."""
        titles = [phase.title for phase in self.phases]
        return [
            title if titles.count(title) == 1 else f"{title} ({place})"
            for place, title in enumerate(titles, start=1)
        ]

    @property
    def span(self) -> float:
        """How long it lasts at most [s]; infinite where that is not given."""
        return math.inf if self.duration is None else self.duration

    @property
    def least_duration(self) -> float:
        """How long its phases and cycles last at least, without their ways [s]."""
        cycle = sum(phase.duration or 0.0 for phase in self.phases)
        if self.cycles is None:
            return max(cycle, self.duration or 0.0)
        return max(cycle, min(self.cycles * cycle, self.span))

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if bool(self.setpoints) == bool(self.phases):
            has = "both" if self.phases else "neither"
            what = f"a mission has either set-points or phases, and this one has {has}"
            remedy = "Write [[setpoints]] for `simulate`, or [[phases]] for `mission`"
            pointed = self.phases or "setpoints" in self.model_fields_set
            raise refusal(what, remedy, "setpoints" if pointed else "phases")
        if self.phases:
            self._check_phases()
            return
        for name in ("start_depth", "duration"):
            if name not in self.model_fields_set or getattr(self, name) is None:
                unit = "m" if name == "start_depth" else "s"
                what = "a mission with set-points needs it"
                raise refusal(what, f'Add a line {name} = "... {unit}"', name)
        own = ("cycles", "latitude", "safety", "grounding", "ice", "start_temperature")
        for name in (*own, "water_motion"):
            if name in self.model_fields_set:
                raise refusal("it belongs to a mission with phases", "Leave it out", name)
        self._check_order()

    def _check_phases(self) -> None:
        if self.start_depth < 0.0:
            what = "the depth is above the surface"
            raise refusal(what, "Depths are positive downwards", "start_depth")
        if len(self.phases) > _MOST_PHASES:
            what = f"there are {len(self.phases)} phases, and more than {_MOST_PHASES} are not kept"
            raise refusal(what, "Repeat a shorter list by `cycles`", "phases")
        depths: dict[tuple[str | int, ...], float | None] = {("start_depth",): self.start_depth}
        depths |= {("phases", k, "depth"): phase.depth for k, phase in enumerate(self.phases)}
        for place, depth in depths.items():
            if depth is not None and depth > _DEEPEST:
                raise refusal("no sea is so deep", "Check the unit", *place)
            knows = self.grounding is not None and place[0] == "phases"
            if depth is not None and depth > self.bottom and not knows:
                below = f"the depth is below the bottom at {self.bottom:g} m"
                raise refusal(below, "Check both depths, or add a table [grounding]", *place)
        for k, phase in enumerate(self.phases):
            if phase.grounding is not None and self.grounding is None:
                what = "the mission does not say how the vehicle finds the bottom"
                raise refusal(what, "Add a table [grounding]", "phases", k, "grounding")
        if self.ice is not None:
            self._check_ice(self.ice)

    def _check_ice(self, ice: Ice) -> None:
        """Refuse a way to the surface on which no temperature is measured."""
        before = ("start_depth", self.start_depth)
        if self.bottom <= ice.stop_depth:
            what = f"the bottom at {self.bottom:g} m is not below it, so that nothing is measured"
            raise refusal(what, "Give a lesser one, or a deeper bottom", "ice", "stop_depth")
        for k, phase in enumerate(self.phases):
            if phase.kind == "surface" and 0.0 < before[1] <= ice.stop_depth:
                what = f"the way up from {before[1]:g} m ({before[0]}) does not measure above it"
                raise refusal(what, "Give a lesser one, or dive deeper", "ice", "stop_depth")
            before = (f"phases[{k}]", phase.depth or 0.0)

    def _check_order(self) -> None:
        times = [point.time for point in self.setpoints]
        if times[0] != 0.0:
            what = f"the first set-point is at {times[0]:g} s, so nothing is asked for before it"
            raise refusal(what, "Give the first set-point the time 0", "setpoints", 0, "time")
        for index, (before, after) in enumerate(pairwise(times), start=1):
            if after <= before:
                what = f"the set-point at {after:g} s comes after the one at {before:g} s"
                remedy = "Sort the set-points by time, each time once"
                raise refusal(what, remedy, "setpoints", index, "time")
        if times[-1] >= self.span:
            what = f"the set-point at {times[-1]:g} s is not before the end at {self.span:g} s"
            remedy = "Lengthen the duration or leave the set-point out"
            raise refusal(what, remedy, "setpoints", len(times) - 1, "time")


@contextmanager
def of_step(made: bool = True) -> Iterator[None]:
    """Say `step` in InputErrors of the block for a set-point and a start, if a step made them."""
    try:
        yield
    except InputError as error:
        if not made or error.field not in ("setpoints[0].depth", "start_depth", "depth"):
            raise
        raise error.but(field="step") from None


@of_step()
def step_mission(
    vehicle: Vehicle,
    step: tuple[float, float] | None = None,
    *,
    duration: float | None = None,
    start_depth: float | None = None,
    bottom_depth: float | None = None,
) -> Mission:
    """Return one step (from, to) [m] as a mission; what is not given, as suits the vehicle.

    Of a float with pump and valve: a dive from the surface, and back where no step is given.
    """
    given = {"start_depth": start_depth, "duration": duration, "bottom_depth": bottom_depth}
    asked: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if step is not None:
        asked["start_depth"] = step[0]
    if vehicle.command != "volume change":
        asked = {"start_depth": _START, "duration": _DURATION, **asked}
        point = Setpoint(time=0.0, depth=_TARGET if step is None else step[1])
        return Mission(name="step", setpoints=(point,), **asked)
    deepest = min(vehicle.hull.depth_limit or math.inf, asked.get("bottom_depth", math.inf))
    depth = min(_DIVE, 0.5 * deepest) if step is None else step[1]
    way = abs(depth - asked.setdefault("start_depth", 0.0))
    span = 3600.0 * (2.0 if step is None else 1.0) * math.ceil(way / _WAY + 1.0)
    span = asked.setdefault("duration", span)
    points = (Setpoint(time=0.0, depth=depth), Setpoint(time=0.5 * span, depth=0.0))
    if step is None:
        return Mission(name="dive", setpoints=points, **asked)
    return Mission(name="step", setpoints=points[:1], **asked)
