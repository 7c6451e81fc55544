"""A plan of experiments as a file: what to do at the pool, in which order, and what to expect.

Each experiment begins at rest, neutral, at a depth; then the volume moves, at the release and each
time the depth passes the place named; the record ends where the depth leaves the plan's range.
Volumes count from the one that held the vehicle at rest.
"""

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from swimbladder.io.config import file_text, read_model
from swimbladder.io.vehicle_file import toml_lines, toml_value
from swimbladder.units import format_quantity, parse_quantity, shown_unit
from swimbladder.vehicle import Parameters, Unit
from swimbladder.vehicle.schema import refusal

_Length = Annotated[float, Unit("m")]
_Time = Annotated[float, Unit("s"), Field(ge=0.0)]
_Series = Annotated[tuple[Annotated[float, Field(strict=True)], ...], Field(min_length=1)]


class Move(Parameters):
    """A change of volume at the release, or when the depth passes a value.

    It stays until the next move.
    """

    volume: Annotated[float, Unit("m3")]
    """above that at rest"""
    depth: _Length | None = None
    """where it happens; default: at the release"""
    going: Literal["up", "down"] | None = None
    """direction there"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if (self.depth is None) != (self.going is None):
            what = "depth and going belong together"
            remedy = 'Give both, as in depth = "2.2 m" and going = "up"; or none, for the release'
            raise refusal(what, remedy, "depth" if self.depth is None else "going")


class Trace(Parameters):
    """The expected record, of the vehicle assumed."""

    time: _Series
    """s since the release"""
    depth: _Series
    """m"""
    volume: _Series
    """m3 above the one at rest"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if not len(self.time) == len(self.depth) == len(self.volume):
            raise refusal("the lists differ in length", "Give as many of each", "time")


class PlannedExperiment(Parameters):
    """One release: from rest at a depth, through its moves, to the end of the record."""

    start_depth: _Length
    """at rest"""
    longest: Annotated[float, Unit("s"), Field(gt=0.0)]
    """latest end after the release"""
    settling: _Time = 0.0
    """expected, to come to rest"""
    duration: _Time = 0.0
    """expected, from release to end"""
    moves: Annotated[tuple[Move, ...], Field(min_length=1)]
    """changes of volume, in order"""
    trace: Trace | None = None
    """the record expected"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        for k, move in enumerate(self.moves):
            if (move.depth is None) != (k == 0):
                what = "the first move is the release and has no depth, every other one has a depth"
                remedy = "Give depth and going to all moves but the first"
                raise refusal(what, remedy, "moves", k, "depth")


class Expected(Parameters):
    """Expected estimate of a parameter."""

    name: str
    """as `identify` calls it"""
    value: float
    """assumed, in `unit`"""
    std: Annotated[float, Field(ge=0.0)]
    """standard deviation"""
    unit: str
    """of both"""


class Plan(Parameters):
    """Experiments in a pool, in the order in which to run them."""

    schema_version: Literal[1] = 1
    """of this format"""
    name: str = ""
    """of the plan"""
    vehicle: str = ""
    """name"""
    bottom_depth: Annotated[float, Unit("m"), Field(gt=0.0)]
    """of the bottom"""
    shallowest: _Length
    """above it a record ends"""
    deepest: _Length
    """below it a record ends"""
    sample_time: Annotated[float, Unit("s"), Field(gt=0.0)]
    """of the record"""
    rest: _Time = 0.0
    """recorded before each release"""
    depth_noise: Annotated[float, Unit("m"), Field(ge=0.0)] = 0.0
    """assumed white noise, 1 sigma"""
    depth_quantum: Annotated[float, Unit("m"), Field(ge=0.0)] = 0.0
    """resolution"""
    neutral_std: Annotated[float, Unit("m3"), Field(gt=0.0)] | None = None
    """1 sigma of the neutral volume at rest"""
    expected: tuple[Expected, ...] = ()
    """expected errors"""
    experiments: Annotated[tuple[PlannedExperiment, ...], Field(min_length=1)]
    """in the order in which to run them"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        if not 0.0 <= self.shallowest < self.deepest <= self.bottom_depth:
            ends = f"from {self.shallowest:g} to {self.deepest:g} m"
            what = f"a range {ends} is not inside a pool of {self.bottom_depth:g} m"
            remedy = "Give the shallowest above the deepest, both between surface and bottom"
            raise refusal(what, remedy, "shallowest")
        for k, one in enumerate(self.experiments):
            depths: dict[tuple[str | int, ...], float | None] = {("start_depth",): one.start_depth}
            depths |= {("moves", i, "depth"): move.depth for i, move in enumerate(one.moves)}
            for at, depth in depths.items():
                if depth is not None and not self.shallowest <= depth <= self.deepest:
                    reach = f"{self.shallowest:g} to {self.deepest:g} m"
                    what = f"{depth:g} m is outside the plan's range of {reach}"
                    raise refusal(what, "Give a depth inside it", "experiments", k, *at)

    @property
    def time(self) -> float:
        """Pool time expected [s], settling included."""
        return sum(e.settling + e.duration for e in self.experiments)


def load_plan(path: str | Path) -> Plan:
    """Return the plan in a TOML file.

    Raises InputError with file, line, field, value, unit and remedy.
    """
    return read_model(Plan, file_text(Path(path)), path)


def plan_file(plan: Plan, *, head: str = "") -> str:
    """Return a plan as the text of a TOML file that reads back as the same plan."""
    lines = [f"# {line}".rstrip() for line in head.splitlines()]
    lines += toml_lines(plan, lambda _, value, __: value not in (None, ()), _text)
    return "\n".join(lines) + "\n"


def _text(value: Any, unit: str | None) -> str:
    if unit is None:
        return toml_value(value)
    for digits in (3, 6, 12, 15, 17):  # the shortest from which the same number is read
        text = format_quantity(value, unit, shown_unit(unit), digits)
        if parse_quantity(text, unit) == value:
            return json.dumps(text)
    return json.dumps(value)
