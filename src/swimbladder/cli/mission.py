"""``swimbladder mission``: phases in repeated cycles, in the water of a cast."""

from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from swimbladder.cli.casts import CastReading, warn_of_mass
from swimbladder.cli.common import (
    aside,
    asked_of,
    compile_notice,
    kept,
    progress,
)
from swimbladder.cli.options import (
    Files,
    Options,
    VehicleName,
    flag,
    grouped,
    loaded,
    supervised,
    valued,
)
from swimbladder.cli.texts import Given
from swimbladder.errors import SwimbladderError


class Flown(Options):
    """How a mission is flown."""

    cycles: int | None = valued("N", "Cycles (as in the mission).", min=1)
    duration: Given = valued("TIME", "Duration: no cycle begins after it.")
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (as in the mission).")
    seed: int | None = valued("N", "Seed of the sensors' noise (no noise).", min=0)
    supervised: bool | None = supervised()
    begin: Given = valued("DATE", "Start, ISO 8601, for netCDF (none).")


class Also(Options):
    """What else is written."""

    netcdf: bool = flag("--netcdf", "Also write netCDF (OG1): mission.nc.")
    plot: bool = flag("--plot", "Also draw mission.png.")
    config: bool = flag("--config", "Also write Argo's CONFIG_ names: argo-config.json.")


_MISSION = typer.Argument(metavar="MISSION", help="TOML file with phases and cycles.")


@grouped("cycles duration bottom_depth netcdf", out=Path("swimbladder-mission"))
def mission(
    vehicle: VehicleName,
    mission: Annotated[Path, _MISSION],
    *,
    how: Flown,
    reading: CastReading,
    to: Files,
    also: Also,
) -> None:
    r"""Simulate a mission of phases and cycles: depth, time, pump, battery.

    Without --cast the water is that of the vehicle's file, of constant density.

    Exit code 1: it cannot be met (no file is written) or was not.

    A run that is killed resumes.
    """
    from swimbladder.io.config import load_mission
    from swimbladder.io.files import unfinished

    v, task = loaded(vehicle, weighed=True), load_mission(mission)
    asked = how.read()
    begin, bottom = asked.pop("begin"), asked.pop("bottom_depth")
    cycles, span = asked.pop("cycles"), asked.pop("duration")
    if also.netcdf and begin is not None:
        from swimbladder.sim.mission.export import og1_time

        og1_time(begin)
    keep = unfinished(to.out)
    read = next(iter(reading.casts(task.latitude)), None)
    warn_of_mass(v)
    more: dict[str, object] = {}
    with asked_of(mission, task, duration=how.duration):
        with progress("loading the simulator"):
            from swimbladder.sim.mission.export import argo_configuration
            from swimbladder.sim.mission.orders import flown_laws
            from swimbladder.sim.mission.prepare import cost_words
            from swimbladder.sim.mission.result import mission as fly

        task = (task if bottom is None else task.over(bottom)).limited(cycles=cycles, duration=span)
        if also.config:
            more["argo-config.json"] = argo_configuration(v, task)
        with suppress(SwimbladderError):  # the flight raises it, after what is to be checked first
            aside(*cost_words(task, flown_laws(v, task, asked["supervised"])[0]))
        with kept(keep), compile_notice(), progress("flying", 1.0) as advance:
            found = fly(v, task, read, **asked, keep=keep, advance=advance)
    from swimbladder.io.netcdf import write_netcdf
    from swimbladder.show.files import Gone
    from swimbladder.show.mission import MissionResultShown

    if also.netcdf:
        place = {} if read is None else {"latitude": read.latitude, "longitude": read.longitude}
        data = found.dataset(begin=begin, **place)
        more["mission.nc"] = partial(write_netcdf, dataset=data)
    names = ["mission.nc", "argo-config.json", *([] if also.plot else ["mission.png"])]
    more = dict.fromkeys(names, Gone()) | more  # what is not asked for goes
    to.answer(
        MissionResultShown(found, begin=begin, cast=read, pictures=also.plot, more=more), keep=keep
    )
