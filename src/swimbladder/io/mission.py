"""What a vehicle is asked to do, and whether it can be asked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from swimbladder.errors import InputError
from swimbladder.parameters import Parameters, Unit, Vehicle
from swimbladder.parameters.schema import refusal

__all__ = ["MOST_SAMPLES", "Mission", "Setpoint", "check_mission"]

MOST_SAMPLES = 100_000_000


class Setpoint(Parameters):
    """A depth to go to, and when."""

    time: Annotated[float, Unit("s"), Field(ge=0.0)] = Field(
        description="when the set-point begins to hold"
    )
    depth: Annotated[float, Unit("m")] = Field(description="depth to go to")


class Mission(Parameters):
    """What a vehicle is asked to do: a list of set-points, from rest at a depth."""

    schema_version: Literal[1] = Field(1, description="version of this file's format")
    name: str = Field("", description="what the mission is called")
    description: str = Field("", description="one sentence on the mission")
    start_depth: Annotated[float, Unit("m")] = Field(
        description="depth at which the vehicle rests, neutral, at the start"
    )
    bottom_depth: Annotated[float, Unit("m"), Field(gt=0.0)] | None = Field(
        None, description="depth of the bottom; not given: none"
    )
    duration: Annotated[float, Unit("s"), Field(gt=0.0)] = Field(description="how long it lasts")
    setpoints: Annotated[tuple[Setpoint, ...], Field(min_length=1)] = Field(
        description="depths to go to, in the order of time; the first at 0"
    )

    @property
    def bottom(self) -> float:
        """Depth of the bottom [m], infinite without one."""
        return math.inf if self.bottom_depth is None else self.bottom_depth

    @property
    def pairs(self) -> list[tuple[float, float]]:
        """The set-points as (time [s], depth [m])."""
        return [(point.time, point.depth) for point in self.setpoints]

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        times = [point.time for point in self.setpoints]
        if times[0] != 0.0:
            raise refusal(
                f"the first set-point is at {times[0]:g} s, so nothing is asked for before it",
                "Give the first set-point the time 0",
                "setpoints",
                0,
                "time",
            )
        for index, (before, after) in enumerate(pairwise(times), start=1):
            if after <= before:
                raise refusal(
                    f"the set-point at {after:g} s comes after the one at {before:g} s",
                    "Sort the set-points by time, each time once",
                    "setpoints",
                    index,
                    "time",
                )
        if times[-1] >= self.duration:
            raise refusal(
                f"the set-point at {times[-1]:g} s is not before the end at {self.duration:g} s",
                "Lengthen the duration or leave the set-point out",
                "setpoints",
                len(times) - 1,
                "time",
            )
        return self


def check_mission(
    vehicle: Vehicle,
    mission: Mission,
    *,
    names: Mapping[str, str] | None = None,
    sample_time: float | None = None,
) -> None:
    """Check that a vehicle can be asked to do a mission; simulate nothing.

    names: what the user calls the mission's fields (``{"start_depth": "--start"}``).
    sample_time: of the control law [s], the vehicle's own when None.
    Raises InputError where a depth is above the surface, below the bottom or the vehicle's
    rating, where the stroke does not reach the neutral volume there, and where the duration is
    shorter than a sample or absurdly long.
    """
    called = dict(names or {})
    _check_duration(vehicle, mission, called.get("duration", "duration"), sample_time)
    places = [("start_depth", mission.start_depth)]
    places += [(f"setpoints[{i}].depth", p.depth) for i, p in enumerate(mission.setpoints)]
    for name, depth in places:
        field = called.get(name, name)
        bottom = called.get("bottom_depth", "bottom_depth")
        _check_depth(vehicle, depth, mission.bottom, field, bottom)


def _check_duration(
    vehicle: Vehicle, mission: Mission, field: str, sample_time: float | None
) -> None:
    if sample_time is None:
        if vehicle.controller is None:
            raise InputError(
                f"the vehicle {vehicle.name!r} has no controller, so no loop can be closed",
                field="controller",
                remedy="Add a table [controller] with law, sample_time and parameters",
            )
        sample_time = vehicle.controller.sample_time
    samples = mission.duration / sample_time
    problem = partial(InputError, field=field, value=mission.duration, unit="s")
    if samples < 1.0:
        raise problem(
            f"the duration is shorter than one sample of {sample_time:g} s",
            remedy="Lengthen it, or shorten the controller's sample time",
        )
    if samples > MOST_SAMPLES:
        raise problem(
            f"the duration is {samples:.3g} samples of {sample_time:g} s, more than "
            f"{MOST_SAMPLES:.0e} are not kept",
            remedy="Shorten it, or split it into several",
        )


def _check_depth(
    vehicle: Vehicle, depth: float, bottom: float, field: str, bottom_field: str
) -> None:
    problem = partial(InputError, field=field, value=depth, unit="m")
    if depth < 0.0:
        raise problem("the depth is above the surface", remedy="Depths are positive downwards")
    if depth > bottom:
        raise problem(
            f"the depth is below the bottom at {bottom:g} m",
            remedy=f"Give a depth of at most {bottom:g} m, or a deeper bottom ({bottom_field})",
        )
    limit = vehicle.hull.depth_limit
    if limit is not None and depth > limit:
        raise problem(
            f"the vehicle {vehicle.name!r} is rated for {limit:g} m (hull.depth_limit)",
            remedy=f"Ask for {limit:g} m at most",
        )
    stroke, neutral = vehicle.stroke, vehicle.neutral_volume(depth)
    if not stroke.minimum < neutral < stroke.maximum:
        end = stroke.maximum if neutral >= stroke.maximum else stroke.minimum
        deepest = (end - vehicle.trim_error) / vehicle.hull.psi
        raise problem(
            f"the stroke is smaller than the neutral volume there: {neutral * 1e6:.4g} cm3 is "
            f"outside {stroke.minimum * 1e6:g} to {stroke.maximum * 1e6:g} cm3",
            remedy=f"Stay above {deepest:.4g} m, to which the stroke suffices, or lengthen it",
        )
