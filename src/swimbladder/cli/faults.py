"""``swimbladder faults``: missions in which something fails, with the vehicle's own C on board."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.casts import CastReading, water_of_cast
from swimbladder.cli.common import working
from swimbladder.cli.options import Files, Options, TimeLimit, VehicleName, grouped, loaded, valued
from swimbladder.cli.texts import Given
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.vehicle import Vehicle


class Missions(Options):
    """Which missions are flown, as `sim.faults.faults` has it."""

    missions: int = valued("N", "Missions with faults.", 100_000)
    healthy: int | None = valued("N", "Missions without a fault (a tenth as many).")
    depth_range: Given = valued("LEAST:MOST", "Depth range of these missions.")
    seed: int = valued("N", "Seed of all random draws.", 1, min=0)


_REPEAT = typer.Option(metavar="N", help="Repeat this mission with its trajectory; hN: healthy.")


@grouped("missions healthy depth_range time_limit repeat", out=Path("swimbladder-faults"))
def faults(
    vehicle: VehicleName,
    *,
    missions: Missions,
    limit: TimeLimit,
    reading: CastReading,
    repeat: Annotated[str | None, _REPEAT] = None,
    to: Files,
) -> None:
    """Simulate the vehicle's C in missions with faults of sensors, actuator or battery.

    With --cast they are flown in that water; the C is that of the vehicle's file.

    The controller and its supervisor are compiled on this machine and flown against the plant.
    Exit code 1: a recoverable mission was lost (full buoyancy 60 s after fault onset would have
    surfaced the vehicle), or a healthy mission raised an alarm. A run that is killed resumes.
    """
    from swimbladder.io.files import unfinished

    v, asked = limit.on(loaded(vehicle)), missions.read()
    reach = None if asked["depth_range"] is None else asked["depth_range"][1]
    asked["cast"] = water_of_cast(reading.casts(), reach, v.hull.depth_limit)
    if repeat is not None:
        _one(v, repeat, asked, to)
        return
    keep = unfinished(to.out)
    with working("flying missions", keep=keep) as advance:
        from swimbladder.show.faults import FaultResultShown
        from swimbladder.sim.faults import faults as fly

        flown = fly(v, **asked, keep=keep, advance=advance)
    to.answer(FaultResultShown(flown, asked=vehicle), keep=keep)


def _one(vehicle: Vehicle, mission: str, asked: dict[str, Any], to: Files) -> None:
    """Fly one mission again and write its trajectories."""
    number = mission.removeprefix("h")
    if not (number.isascii() and number.isdigit() and len(number) < 9):
        why = "a mission is a number of eight digits at most, or one with an h before it"
        remedy = "Write it like 17, or h17 for a healthy one"
        raise InputError(why, field="--repeat", value=mission, remedy=remedy)
    how = {name: asked[name] for name in ("seed", "depth_range", "cast")}
    with working("flying the mission"):
        from swimbladder.show.faults import FlownShown
        from swimbladder.sim.faults.run import fly_one

        flown = fly_one(vehicle, int(number), healthy=mission.startswith("h"), **how)
    to.answer(FlownShown(flown))
